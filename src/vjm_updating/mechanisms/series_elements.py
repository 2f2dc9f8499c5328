"""Elements in series with a chain: what deflects under its force by a law of its own, perhaps of its history.

An element sits somewhere in the chain. An `ElementSite` says where: which scalar of the wrench drives it, and how
the end-effector moves with its extension at constant wrench. A drive before all else moves the whole chain along
its axis. What turns in a joint turns all behind it, and the moment about the joint's axis drives it.

Backlash in the joints, and a link itself, act along the link's line: all that the link carries is shifted along it.
By virtual work the force at the end-effector along that line drives it, wherever in the chain the link is. Of a
link between passive joints, which bear no torque, that is all of the force. The tip of the foot moves by its
translational compliance; its turn is taken back by the joints. So ``u = u_chain + Σ b_e x_e`` holds to first order
in the turns and in the shifts over the links' lengths, and the equilibrium is found with ``F = F(u_chain)`` of the
chain's own table.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.laws import Curve
from vjm.rotations import Array, skew
from vjm_updating.constants import numerical
from vjm_updating.mechanisms.history_kernels import curve_deflections, decaying, driven, flowing, softened, stepped

TOLERANCE = numerical(1e-7, "mm")
"""mm up to which elements are in balance with the chain."""
ITERATIONS = numerical(100)
"""Of a balance: a bracket that a past which still moves has spoilt takes twenty halvings to be opened again."""


class LoadedJoint(NamedTuple):
    """What a unit of deflection in a joint does to a machine that is displaced, and not to first order only.

    What the joint carries turns under the wrench, and deflects otherwise.

    Attributes:
        motion: displacement of the end-effector ``(n, 6)`` that has the same effect on the wrench.
        bend: likewise by the square of the unit, twice ``(n, 6)``.
        lever: change ``(n, 6)`` of what drives the joint, by the end-effector's wrench.
    """

    motion: Array
    bend: Array
    lever: Array


@dataclass(frozen=True)
class History:
    """When readings were taken, in their order.

    Attributes:
        time: s since the first reading ``(n,)``; zero where there is no clock.
        begins: ``(n,)`` whether a reading is the first of a posture: what has a history is fresh there.
        line: unit vector ``(n, 3)`` along the last link of each reading's unloaded posture, from root to tip.
        lever: from the base's origin to the end-effector where it stands ``(n, 3)``, mm, world axes.
        lines: the same as ``line`` of every link, by its name.
        joints: what a unit of each held joint, mm or rad, does to the end-effector ``(n, 6)``, by its name.
        loaded: of held joints of machines that stand by themselves what is known to second order, by their names.
        warmth: K above the first reading ``(n,)``; None where no temperature was read.
    """

    time: Array
    begins: np.ndarray
    line: Array
    lever: Array
    lines: Mapping[str, Array] = field(default_factory=dict)
    joints: Mapping[str, Array] = field(default_factory=dict)
    loaded: Mapping[str, LoadedJoint] = field(default_factory=dict)
    warmth: Array | None = None

    def along(self, link: str) -> Array:
        """Unit vector ``(n, 3)`` along a link, the last one where there is no name."""
        return self.lines[link] if link else self.line


Law = Callable[[Array, History], tuple[Array, Array]]
"""Extension ``(n,)`` under forces ``(n,)`` in their order, and its instantaneous derivative by them, ``(n,)``."""


class ElementSite(ABC):
    """Where an element sits."""

    @abstractmethod
    def motion(self, history: History) -> Array:
        """Displacement ``(n, 6)`` of the end-effector by the element's extension, at constant wrench."""

    def pull(self, history: History) -> Array:
        """What drives the element is the product ``(n,)`` of this ``(n, 6)`` and the end-effector's wrenches.

        By virtual work it is the motion, where the extension is one.
        """
        return self.motion(history)

    def change(self, history: History) -> tuple[Array, Array]:
        """By the extension the changes ``(n, 6)`` of the motion, and of what drives the element."""
        return np.zeros((len(history.time), 6)), np.zeros((len(history.time), 6))


@dataclass(frozen=True)
class AlongAxis(ElementSite):
    """A part before all joints that deflects along an axis, a unit vector fixed in the world."""

    axis: tuple[float, float, float]

    def motion(self, history: History) -> Array:
        """The whole chain moves."""
        return np.tile(np.concatenate([self.axis, np.zeros(3)]), (len(history.time), 1))


@dataclass(frozen=True)
class AboutAxis(ElementSite):
    """A part before all joints that turns about an axis of the world through the base's origin.

    The element's extension is the turn, and what drives it the moment of the end-effector's wrench about the axis;
    the turn under the chain's own weight, which hardly changes along a ramp, is not in it. The axis is a unit
    vector.
    """

    axis: tuple[float, float, float]

    def motion(self, history: History) -> Array:
        """The whole chain turns."""
        result = np.empty((len(history.lever), 6))
        result[:, :3], result[:, 3:] = history.lever @ skew(self.axis).T, self.axis
        return result


@dataclass(frozen=True)
class AtJoint(ElementSite):
    """A held joint, about its axis or along it, as it stands in the nominal machine under the same displacement.

    Of one that turns the element's extension is the shift of a point at a lever from the axis. What drives it is
    the moment of the end-effector's wrench about the axis over the lever, so that laws are in mm and N. The lever
    is in mm, and 1 for one that slides.
    """

    joint: str
    lever: float = 1.0

    def motion(self, history: History) -> Array:
        """All that the joint carries turns or slides, and deflects otherwise under the wrench."""
        loaded = history.loaded.get(self.joint)
        return (history.joints[self.joint] if loaded is None else loaded.motion) / self.lever

    def pull(self, history: History) -> Array:
        """The moment about the axis, or the force along it."""
        return history.joints[self.joint] / self.lever

    def change(self, history: History) -> tuple[Array, Array]:
        """A point that turns goes round the axis, and the stiffness turns with it."""
        loaded, square = history.loaded.get(self.joint), self.lever**2
        return super().change(history) if loaded is None else (-loaded.bend / square, loaded.lever / square)


@dataclass(frozen=True)
class AlongLine(ElementSite):
    """A link, or its joints, along the line from its root to its tip.

    Between passive joints that is the line of the force but for friction. It is that of the posture's unloaded
    link, whichever link it is. Under load it turns by some hundredths of a radian, which changes an axial force by
    less than a thousandth where that is most of the force, else by as many hundredths of what is across. Without a
    name it is the last link.
    """

    link: str = ""

    def motion(self, history: History) -> Array:
        """Along the line, of all that the link carries."""
        return np.hstack([history.along(self.link), np.zeros((len(history.time), 3))])


@dataclass(frozen=True)
class Behind(ElementSite):
    """An elastic part before all joints whose tip moves by a compliance.

    The element's extension is a force: so much more of it the part seems to bear.

    Attributes:
        compliance: translational ``(3, 3)`` of the part's tip, world axes, mm/N.
        link: name of the link that it carries; empty: the last one.
    """

    compliance: tuple[tuple[float, ...], ...]
    link: str = ""

    def motion(self, history: History) -> Array:
        """The tip's motion by one newton along the line."""
        return np.hstack([history.along(self.link) @ np.array(self.compliance).T, np.zeros((len(history.time), 3))])

    def pull(self, history: History) -> Array:
        """Along the link's line."""
        return np.hstack([history.along(self.link), np.zeros((len(history.time), 3))])


@dataclass(frozen=True)
class SeriesElement:
    """A law in its place.

    Attributes:
        most: bound of its extension, for laws that end; infinite for others.
        smooth: whether Newton's method needs no bracket, which the past of a law that forgets slowly would spoil.
    """

    place: ElementSite
    law: Law
    most: float = float("inf")
    smooth: bool = False


@dataclass(frozen=True)
class Balance:
    """A chain with its elements.

    Attributes:
        pose: displacement ``(n, 6)`` that is left to the chain itself.
        wrench: ``(n, 6)``.
        stiffness: of chain and elements together ``(n, 6, 6)``.
        extension: of the elements ``(n, e)``.
    """

    pose: Array
    wrench: Array
    stiffness: Array
    extension: Array


def deflection(elements: Sequence[SeriesElement], wrench: Array, history: History) -> Array:
    """Displacement ``(n, 6)`` of the end-effector by elements under wrenches ``(n, 6)`` in their order."""
    result = np.zeros_like(wrench)
    for element in elements:
        extension, _ = element.law(force_on(element.place, wrench, history), history)
        result += extension[:, None] * element.place.motion(history)
    return result


def force_on(place: ElementSite, wrench: Array, history: History) -> Array:
    """What drives an element ``(n,)`` under wrenches ``(n, 6)``: N, where its extension is in mm."""
    return np.einsum("ni,ni->n", place.pull(history), wrench)


def balance(
    look: Callable[[Array], tuple[Array, Array]],
    pose: Array,
    elements: Sequence[SeriesElement],
    history: History,
    begin: Array | None = None,
) -> Balance:
    """The equilibrium of a chain with elements at imposed displacements, in their order.

    Newton's method on the extensions of all readings at once, each bracketed by what it has been tried with.
    ``look`` gives wrenches (n, 6) and stiffnesses (n, 6, 6) of the chain at displacements (n, 6), as ``pose``
    imposes them. It begins at extensions ``begin`` (n, e), at none by default.

    Raises:
        NoConvergenceError: none was found.
    """
    n, e = len(pose), len(elements)
    if not e:
        return Balance(pose, *look(pose), np.zeros((n, e)))
    most = np.array([element.most for element in elements], dtype=float)
    low, high = -np.broadcast_to(most, (n, e)).copy(), np.broadcast_to(most, (n, e)).copy()
    bracketed = np.array([not element.smooth for element in elements])
    slopes, gap = np.zeros((n, e)), np.empty((n, e))
    places = [element.place for element in elements]
    motions, pulls, bends, levers = (
        np.stack(each, axis=1)
        for each in zip(*((p.motion(history), p.pull(history), *p.change(history)) for p in places), strict=True)
    )
    lever = float(np.abs(history.lever).max())
    size = np.maximum(np.abs(motions[:, :, :3]), lever * np.abs(motions[:, :, 3:])).max(axis=(0, 2))
    if begin is None:
        x, own = np.zeros((n, e)), np.array(pose, dtype=float)
    else:
        x = begin.copy()
        own = pose - np.einsum("ne,nek->nk", x, motions + 0.5 * x[:, :, None] * bends)
    wrench, stiffness = look(own)
    for _ in range(ITERATIONS):
        forces = driven(pulls, levers, x, wrench)
        for i, element in enumerate(elements):
            wanted, slopes[:, i] = element.law(forces[i], history)
            gap[:, i] = wanted - x[:, i]
        # a reading that is in balance stays: what rounding makes of its next step may lie outside its bracket
        still = (np.abs(gap) * size < TOLERANCE).all(axis=1)
        if still.all():
            break
        stepped(gap, still, slopes, stiffness, motions, bends, most, bracketed, pose, x, low, high, own)
        wrench, stiffness = look(own)
    else:
        worst = float(np.max(np.abs(gap) * size))
        raise NoConvergenceError(f"elements in series are {worst:.2g} mm off balance after {ITERATIONS} steps")
    return Balance(own, wrench, softened(stiffness, motions, slopes), x)


@dataclass(frozen=True)
class Memoryless:
    """A law without history: extension ``(n,)`` and its slope by the forces ``(n,)``."""

    function: Callable[[Array], tuple[Array, Array]]

    def __call__(self, force: Array, history: History) -> tuple[Array, Array]:
        """Extension and slope ``(n,)`` under forces ``(n,)``."""
        return self.function(force)


memoryless = Memoryless
"""A law without history, by the name that effects write."""


def deflections(curve: Curve, forces: Array) -> tuple[Array, Array]:
    """Deflections ``(n,)`` at forces ``(n,)`` of a curve whose slope is nowhere zero, and tangents there ``(n,)``.

    Example:
        >>> from vjm.model.laws import StrainWave
        >>> gear = StrainWave(K1=1.0, K2=2.0, K3=4.0, T1=1.0, T2=3.0)
        >>> deflections(gear.curve, np.array([-0.5, 7.0]))[0].tolist()
        [-0.5, 3.0]
    """
    return curve_deflections(forces, curve.knots, curve.pieces)


def by_curve(curve: Curve, *, lever: float = 1.0, times: float = 1.0, less: float = 0.0) -> Memoryless:
    """What the spring of a curve extends by at a lever, so many times, less a straight spring's compliance."""

    def law(N: Array) -> tuple[Array, Array]:
        u, tangent = deflections(curve, N * lever)
        return times * lever * u - less * N, times * lever**2 / tangent - less

    return Memoryless(law)


def retarded(compliance: float, seconds: float) -> Law:
    """What follows a force with a delay: ``ẋ = (c N − x)/τ``, the force linear between readings.

    The Kelvin–Voigt element of a standard linear solid. In the end it has the ``compliance`` c; τ is ``seconds``.
    """

    def law(force: Array, history: History) -> tuple[Array, Array]:
        n = len(force)
        step = np.zeros(n)
        step[1:] = np.maximum(np.diff(history.time), 0.0)
        step[history.begins] = 0.0
        ratio = step / seconds
        decay = np.exp(-ratio)
        # of a ramp from N₀ to N₁ over h: weights of both ends
        small = ratio < 1e-6
        mean = np.where(small, 0.5 * ratio, 1.0 - (1.0 - decay) / np.where(small, 1.0, ratio))
        before = np.concatenate([[0.0], force[:-1]])
        gain = compliance * (mean * force + (1.0 - decay - mean) * before)
        x = decaying(decay, gain, history.begins)
        slope = np.where(history.begins, 0.0, compliance * mean)
        return x, slope

    return law


def yielding(limit: float, compliance: float, grows: float = 0.0) -> Law:
    """Plastic slip with linear hardening: it flows while the force is outside its elastic range.

    ``limit`` is the yield force, N, ``compliance`` the plastic extension by the force beyond it, mm/N. Of the
    hardening a share ``grows`` widens the range, which is then isotropic; the rest moves it (kinematic).
    """

    def law(force: Array, history: History) -> tuple[Array, Array]:
        return flowing(np.ascontiguousarray(force), history.begins, float(limit), float(compliance), float(grows))

    return law


def together(*laws: Law) -> Law:
    """Laws whose extensions under one force add up."""

    def law(force: Array, history: History) -> tuple[Array, Array]:
        pairs = [each(force, history) for each in laws]
        x, slope = (np.sum([pair[k] for pair in pairs], axis=0) for k in (0, 1))
        return x, slope

    return law
