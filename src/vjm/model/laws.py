"""Laws of springs whose stiffness is not constant: force against deflection, of joints and between points.

A law is one class. It says its numbers and its `Curve`: force, energy, tangent, the inverse, the compiled kernel
and the keys of a file all follow from these. A deflection is an angle in rad with a torque in N mm, or a length in
mm with a force in N. Forces resist: a positive deflection has a positive force.

Where the tangent of a law jumps, it goes over smoothly within a stated width, the ``transition``, centred on the
jump. Outside it the law is exactly as given. Within it the force is off by no more than 3/32 of the jump times
the width.

Friction and losses by hysteresis are no laws: their force depends on the way to a deflection.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, Field, dataclass, field, fields, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from vjm.kernels.statics import ORDER
from vjm.rotations import Array

BISECTIONS = 200
"""At most, to find a deflection by its force: a number of 64 bits has no more halves."""

UNITS = {
    "stiffness": ("Nmm_per_rad", "N_per_mm"),
    "stiffness2": ("Nmm_per_rad2", "N_per_mm2"),
    "stiffness3": ("Nmm_per_rad3", "N_per_mm3"),
    "force": ("Nmm", "N"),
    "deflection": ("rad", "mm"),
}
"""Ends of the keys of a file by the dimension of a number: of what turns, and of what slides or stretches."""


@dataclass(frozen=True)
class Curve:
    """A force that grows with the deflection, by polynomials between knots: smooth, and straight at both ends.

    Attributes:
        knots: ``(k,)`` deflections where one polynomial follows the other, ascending.
        pieces: ``(k + 1, ORDER)`` coefficients of the force, ascending powers of the deflection less the piece's
            `origin`.
    """

    knots: Array
    pieces: Array

    @cached_property
    def origin(self) -> Array:
        """Deflections ``(k + 1,)`` from which the polynomials count: the knot before each, of the first its end."""
        return self.knots[np.maximum(np.arange(len(self.pieces)) - 1, 0)]

    def _horner(self, deflection: ArrayLike, coefficients: Array) -> Array:
        u = np.asarray(deflection, dtype=float)
        piece = np.searchsorted(self.knots, u, side="right")
        s, own = u - self.origin[piece], coefficients[piece]
        value = own[..., -1]
        for power in range(coefficients.shape[1] - 2, -1, -1):
            value = value * s + own[..., power]
        return np.asarray(value)

    @cached_property
    def _energies(self) -> Array:
        """Coefficients ``(k + 1, ORDER + 1)`` of the energy, zero at no deflection."""
        energies = np.zeros((len(self.pieces), ORDER + 1))
        energies[:, 1:] = self.pieces / np.arange(1, ORDER + 1)
        for piece in range(2, len(energies)):
            s = self.knots[piece - 1] - self.knots[piece - 2]
            energies[piece, 0] = np.polynomial.polynomial.polyval(s, energies[piece - 1])
        energies[:, 0] -= self._horner(0.0, energies)
        return energies

    def energy(self, deflection: ArrayLike) -> Array:
        """Energies at deflections, N mm, zero at none."""
        return self._horner(deflection, self._energies)

    def force(self, deflection: ArrayLike) -> Array:
        """Forces at deflections."""
        return self._horner(deflection, self.pieces)

    def tangent(self, deflection: ArrayLike) -> Array:
        """Slopes of the force at deflections."""
        return self._horner(deflection, self.pieces[:, 1:] * np.arange(1, ORDER))

    def deflection(self, force: float) -> float:
        """The deflection at a force, to rounding.

        Where a stretch of deflections has this force, that nearest zero. A force that no deflection has gives the
        end of the stretch without a slope that is nearest to it.
        """
        if force == float(self.force(0.0)):
            return 0.0
        forces = self.force(self.knots)
        low, high = float(self.knots[0]), float(self.knots[-1])
        if force <= forces[0]:
            slope = float(self.pieces[0, 1])
            return low + (force - float(forces[0])) / slope if slope > 0.0 else min(0.0, low)
        if force >= forces[-1]:
            slope = float(self.pieces[-1, 1])
            return high + (force - float(forces[-1])) / slope if slope > 0.0 else max(0.0, high)
        level = np.flatnonzero(forces == force)
        if len(level):
            return float(np.clip(0.0, self.knots[level[0]], self.knots[level[-1]]))
        piece = int(np.searchsorted(forces, force))
        low, high = float(self.knots[piece - 1]), float(self.knots[piece])
        # Newton's method within brackets
        u = 0.5 * (low + high)
        for _ in range(BISECTIONS):
            lacking, slope = force - float(self.force(u)), float(self.tangent(u))
            low, high = (u, high) if lacking > 0.0 else (low, u)
            following = u + lacking / slope if slope > 0.0 else np.inf
            if not low < following < high:
                following = 0.5 * (low + high)
            if following == u or not low < following < high:
                break
            u = following
        return u


def straight(kinks: Sequence[tuple[float, float]], slopes: Sequence[float], width: float) -> Curve:
    """The curve of straight lines that meet in kinks, each gone round within a width.

    The tangent goes from the one slope to the other by ``3 t² − 2 t³`` over the width: the force is twice
    differentiable, and outside the widths it is on the lines.

    Args:
        kinks: deflection and force of each, ascending.
        slopes: of the lines, one more than kinks.
        width: of each transition.
    """
    knots: list[float] = []
    pieces: list[list[float]] = []
    for k, ((u, f), before, behind) in enumerate(zip(kinks, slopes[:-1], slopes[1:], strict=True)):
        begins, ends, jump = u - 0.5 * width, u + 0.5 * width, behind - before
        start = f - 0.5 * width * before
        if k == 0:
            pieces.append([start, before, 0.0, 0.0, 0.0])
        pieces.append([start, before, 0.0, jump / width**2, -0.5 * jump / width**3])
        pieces.append([f + 0.5 * width * behind, behind, 0.0, 0.0, 0.0])
        knots += [begins, ends]
    return Curve(np.array(knots), _padded(pieces))


def _padded(pieces: Sequence[Sequence[float]]) -> Array:
    padded = np.zeros((len(pieces), ORDER))
    for row, piece in zip(padded, pieces, strict=True):
        row[: len(piece)] = piece
    return padded


def number(dimension: str, **more: Any) -> Any:  # noqa: ANN401  (as dataclasses' field)
    """A number of a law, of a dimension of `UNITS`."""
    return field(metadata={"dimension": dimension}, **more)


@dataclass(frozen=True)
class Law(ABC):
    """A force against a deflection that it resists, see the module.

    Example:
        >>> from vjm.model.laws import DeadZone
        >>> backlash = DeadZone(stiffness=1e6, clearance=2e-3)
        >>> float(backlash.force(0.0005)), float(backlash.force(0.0020)), backlash.deflection(1000.0)
        (0.0, 1000.0, 0.002)
    """

    kind: ClassVar[str]
    """Its name in files."""

    def __post_init__(self) -> None:
        for name, value in self.numbers().items():
            if not np.isfinite(value):
                raise ValueError(f"{name} must be finite, not {value}")
        self.check()

    @abstractmethod
    def check(self) -> None:
        """Refuse numbers of which no law can be made.

        Raises:
            ValueError: saying which, and what to give.
        """

    @cached_property
    @abstractmethod
    def curve(self) -> Curve:
        """The force by polynomials."""

    @property
    @abstractmethod
    def kinks(self) -> tuple[float, ...]:
        """Deflections, ascending, at which it passes from one region to the next, see `regions`."""

    @property
    @abstractmethod
    def regions(self) -> tuple[str, ...]:
        """Words for where it is before, between and behind its `kinks`."""

    def place(self, deflection: float) -> int:
        """Number of the region in which a deflection is."""
        return int(np.searchsorted(self.kinks, deflection))

    def region(self, deflection: float) -> str:
        """Words for where it is at a deflection."""
        return self.regions[self.place(deflection)]

    def energy(self, deflection: ArrayLike) -> Array:
        """Energies at deflections, N mm, zero at none."""
        return self.curve.energy(deflection)

    def force(self, deflection: ArrayLike) -> Array:
        """Forces at deflections, N mm or N."""
        return self.curve.force(deflection)

    def tangent(self, deflection: ArrayLike) -> Array:
        """Tangent stiffnesses at deflections, N mm/rad or N/mm."""
        return self.curve.tangent(deflection)

    def deflection(self, force: float) -> float:
        """The deflection at a force, see `Curve.deflection`."""
        return self.curve.deflection(force)

    def secant(self, a: float, b: float) -> float:
        """Slope of the chord between two deflections, N mm/rad or N/mm; the tangent where they are one."""
        return float((self.force(b) - self.force(a)) / (b - a)) if a != b else float(self.tangent(a))

    @classmethod
    def _numbers(cls) -> list[Field[Any]]:
        return [each for each in fields(cls) if each.metadata.get("dimension")]

    def numbers(self) -> dict[str, float]:
        """Its numbers by name; those that are left out, or are lists, are not among them."""
        own = {each.name: getattr(self, each.name) for each in self._numbers()}
        return {name: value for name, value in own.items() if isinstance(value, int | float)}

    @classmethod
    def keys(cls, *, slides: bool) -> dict[str, str]:
        """Keys of a file by the names of its numbers, with their units."""
        return {each.name: f"{each.name}_{UNITS[each.metadata['dimension']][slides]}" for each in cls._numbers()}

    def table(self, *, slides: bool) -> dict[str, Any]:
        """How a file writes it."""
        result: dict[str, Any] = {"kind": self.kind}
        for name, key in self.keys(slides=slides).items():
            value = getattr(self, name)
            if value is not None:
                result[key] = list(value) if isinstance(value, tuple) else value
        return result | {name: getattr(self, name) for name in self.words()}

    @classmethod
    def words(cls) -> list[str]:
        """Names of what it says that is no number."""
        return [each.name for each in fields(cls) if not each.metadata.get("dimension")]

    def softer(self, factor: float) -> Self:
        """The law with all its deflections times a factor, and the same forces.

        Example:
            >>> from vjm.model.laws import DeadZone
            >>> DeadZone(stiffness=1e6, clearance=2e-3).softer(2.0)
            DeadZone(stiffness=500000.0, clearance=0.004, transition=None)
        """
        power = {"stiffness": -1, "stiffness2": -2, "stiffness3": -3, "force": 0, "deflection": 1}
        changed: dict[str, Any] = {}
        for each in self._numbers():
            value, by = getattr(self, each.name), factor ** power[each.metadata["dimension"]]
            if value is not None:
                changed[each.name] = tuple(by * v for v in value) if isinstance(value, tuple) else by * value
        return replace(self, **changed)

    @property
    def rises(self) -> bool:
        """Whether the force grows everywhere with the deflection, so that a force tells it."""
        return bool((self.tangent(self.curve.knots) > 0.0).all())

    @property
    def rest_stiffness(self) -> float:
        """Tangent without deflection, N mm/rad or N/mm."""
        return float(self.tangent(0.0))

    @property
    def largest_stiffness(self) -> float:
        """Largest tangent at its knots, N mm/rad or N/mm: a unit of its stiffness that is never zero."""
        return float(self.tangent(self.curve.knots).max())


def _positive(**numbers: float) -> None:
    for name, value in numbers.items():
        if not value > 0.0:
            raise ValueError(f"{name} must be above zero, not {value:g}")


def _narrow(width: float, room: float, between: str) -> None:
    if not 0.0 < width <= room:
        raise ValueError(f"transition must be above zero and at most {room:g}, {between}, not {width:g}")


@dataclass(frozen=True)
class StrainWave(Law):
    """Three slopes, as catalogues of strain wave gears give: K1 up to the torque T1, K2 up to T2, K3 beyond.

    The same with other signs the other way.

    Attributes:
        K1: stiffness up to T1.
        K2: from T1 to T2.
        K3: beyond T2.
        T1: torque of the first kink.
        T2: and of the second.
        transition: deflection over which slopes go over into each other; a tenth of the shorter of the first two
            stretches if left out.

    Example:
        >>> from vjm.model.laws import StrainWave
        >>> gear = StrainWave(K1=5e7, K2=8e7, K3=9e7, T1=1.4e4, T2=4.8e4)
        >>> gear.deflection(4.8e4 + 9e4) - gear.deflection(0.0)
        0.001705
    """

    kind: ClassVar[str] = "strain_wave"
    K1: float = number("stiffness")
    K2: float = number("stiffness")
    K3: float = number("stiffness")
    T1: float = number("force")
    T2: float = number("force")
    transition: float | None = number("deflection", default=None)

    def check(self) -> None:
        """Stiffnesses above zero, and T1 below T2."""
        _positive(K1=self.K1, K2=self.K2, K3=self.K3, T1=self.T1)
        if not self.T2 > self.T1:
            raise ValueError(f"T2 must be above T1 = {self.T1:g}, not {self.T2:g}")
        _narrow(self.width, min(2.0 * self._stretches[0], self._stretches[1]), "the shorter of its stretches")

    @property
    def _stretches(self) -> tuple[float, float]:
        return self.T1 / self.K1, (self.T2 - self.T1) / self.K2

    @property
    def width(self) -> float:
        """Of the transition."""
        return 0.1 * min(self._stretches) if self.transition is None else self.transition

    @cached_property
    def curve(self) -> Curve:
        """The lines and what goes round their kinks."""
        first, second = self._stretches[0], sum(self._stretches)
        kinks = [(-second, -self.T2), (-first, -self.T1), (first, self.T1), (second, self.T2)]
        return straight(kinks, [self.K3, self.K2, self.K1, self.K2, self.K3], self.width)

    @property
    def kinks(self) -> tuple[float, ...]:
        """Where its torque is T1 and T2."""
        first, second = self._stretches[0], sum(self._stretches)
        return -second, -first, first, second

    @property
    def regions(self) -> tuple[str, ...]:
        """By its torques."""
        return "beyond T2", "between T1 and T2", "below T1", "between T1 and T2", "beyond T2"


@dataclass(frozen=True)
class Polynomial(Law):
    """``K1 u + K2 u² + K3 u³`` within a stated range, straight beyond it: hardening or softening.

    Attributes:
        K1: stiffness without deflection.
        range: deflections within which the polynomial holds, about zero; its tangent has to be positive there.
        K2: of the square.
        K3: of the cube.

    Example:
        >>> import vjm
        >>> law = vjm.Polynomial(K1=100.0, range=(-2.0, 2.0), K3=5.0)
        >>> float(law.force(2.0)), float(law.tangent(2.0))
        (240.0, 160.0)
    """

    kind: ClassVar[str] = "polynomial"
    K1: float = number("stiffness")
    range: tuple[float, float] = number("deflection")
    _: KW_ONLY
    K2: float = number("stiffness2", default=0.0)
    K3: float = number("stiffness3", default=0.0)

    def check(self) -> None:
        """A range about zero, with a positive tangent."""
        _positive(K1=self.K1)
        low, high = self.range
        if not -np.inf < low < 0.0 < high < np.inf:
            raise ValueError(f"range must be [lower, upper] with zero within, not [{low:g}, {high:g}]")
        places = [low, high]
        if self.K3:
            places.append(float(np.clip(-self.K2 / (3.0 * self.K3), low, high)))
        least = min(places, key=self._slope)
        if not self._slope(least) > 0.0:
            raise ValueError(
                f"its tangent is {self._slope(least):.6g} at {least:.6g}: it must be positive in all of range "
                f"[{low:g}, {high:g}]; take a narrower one"
            )

    def _slope(self, u: float) -> float:
        return self.K1 + u * (2.0 * self.K2 + 3.0 * u * self.K3)

    @cached_property
    def curve(self) -> Curve:
        """The polynomial and its tangents at the ends of the range."""
        low, high = self.range

        def value(u: float) -> float:
            return u * (self.K1 + u * (self.K2 + u * self.K3))

        inside = [value(low), self._slope(low), self.K2 + 3.0 * self.K3 * low, self.K3]
        pieces = [[value(low), self._slope(low)], inside, [value(high), self._slope(high)]]
        return Curve(np.array([low, high]), _padded(pieces))

    @property
    def kinks(self) -> tuple[float, ...]:
        """The ends of its range."""
        return self.range

    @property
    def regions(self) -> tuple[str, ...]:
        """Outside its range nothing was stated."""
        return "outside its range", "within its range", "outside its range"


@dataclass(frozen=True)
class DeadZone(Law):
    """A clearance with contact at both ends: backlash as it is seen at rest under load.

    Attributes:
        stiffness: in contact.
        clearance: deflection from the one contact to the other, half of it on either side of zero.
        inside: stiffness within the clearance; none if left out. Then only other forces hold the joint there.
        transition: deflection over which contact comes; a tenth of the clearance if left out.

    Example:
        >>> import vjm
        >>> backlash = vjm.DeadZone(stiffness=1e6, clearance=2e-3)
        >>> float(backlash.force(5e-4)), float(backlash.force(3e-3))
        (0.0, 2000.0)
    """

    kind: ClassVar[str] = "dead_zone"
    stiffness: float = number("stiffness")
    clearance: float = number("deflection")
    inside: float = number("stiffness", default=0.0)
    transition: float | None = number("deflection", default=None)

    def check(self) -> None:
        """A clearance, and less stiffness within it than outside."""
        _positive(stiffness=self.stiffness, clearance=self.clearance)
        if not 0.0 <= self.inside < self.stiffness:
            raise ValueError(f"inside must be from 0 to below stiffness = {self.stiffness:g}, not {self.inside:g}")
        _narrow(self.width, self.clearance, "its clearance")

    @property
    def width(self) -> float:
        """Of the transition."""
        return 0.1 * self.clearance if self.transition is None else self.transition

    @cached_property
    def curve(self) -> Curve:
        """The lines and what goes round their kinks."""
        half = 0.5 * self.clearance
        force = self.inside * half
        return straight([(-half, -force), (half, force)], [self.stiffness, self.inside, self.stiffness], self.width)

    @property
    def kinks(self) -> tuple[float, ...]:
        """Where contact begins."""
        return -0.5 * self.clearance, 0.5 * self.clearance

    @property
    def regions(self) -> tuple[str, ...]:
        """By contact."""
        return "in contact", "within its clearance", "in contact"


@dataclass(frozen=True)
class OneSided(Law):
    """A spring that acts one way only, such as a cable, which pulls, or a stop.

    Attributes:
        stiffness: where it acts.
        transition: deflection over which it begins to act; slack before half of it the force is exactly zero.
        begins: deflection at which it begins to act.
        acts: ``above`` that deflection, as a cable, or ``below`` it.

    Example:
        >>> import vjm
        >>> cable = vjm.OneSided(stiffness=20.0, transition=0.1)
        >>> float(cable.force(-5.0)), float(cable.force(10.0))
        (0.0, 200.0)
    """

    kind: ClassVar[str] = "one_sided"
    stiffness: float = number("stiffness")
    transition: float = number("deflection")
    begins: float = number("deflection", default=0.0)
    acts: str = "above"

    def check(self) -> None:
        """A stiffness, and a side."""
        _positive(stiffness=self.stiffness, transition=self.transition)
        if self.acts not in ("above", "below"):
            raise ValueError(f"acts must be 'above' or 'below', not '{self.acts}'")
        if (self.begins if self.acts == "above" else -self.begins) < 0.0:
            raise ValueError(
                "begins must leave it without force at no deflection: give a preload or a rest for that"
            )

    @cached_property
    def curve(self) -> Curve:
        """The lines and what goes round their kink."""
        slopes = [0.0, self.stiffness] if self.acts == "above" else [self.stiffness, 0.0]
        return straight([(self.begins, 0.0)], slopes, self.transition)

    @property
    def kinks(self) -> tuple[float, ...]:
        """Where it begins to act."""
        return (self.begins,)

    @property
    def regions(self) -> tuple[str, ...]:
        """By whether it acts."""
        names = "without contact", "in contact"
        return names if self.acts == "above" else names[::-1]


@dataclass(frozen=True)
class Tabulated(Law):
    """Measured pairs that rise, joined by cubics that keep their shape (Fritsch and Butland 1984).

    It begins and ends with the slopes of the first and last chord, and goes on with these beyond the pairs.

    Attributes:
        deflections: ascending, with zero among them.
        forces: ascending, zero at no deflection.

    Example:
        >>> import vjm
        >>> law = vjm.Tabulated((-1.0, 0.0, 1.0, 2.0), (-10.0, 0.0, 10.0, 40.0))
        >>> float(law.force(2.0)), float(law.force(3.0))
        (40.0, 70.0)
    """

    kind: ClassVar[str] = "table"
    deflections: tuple[float, ...] = number("deflection")
    forces: tuple[float, ...] = number("force")

    def check(self) -> None:
        """Pairs that rise through zero."""
        u, f = self.deflections, self.forces
        if len(u) != len(f) or len(u) < 3:
            raise ValueError(f"deflections and forces must be at least three pairs, not {len(u)} and {len(f)}")
        for name, values in (("deflections", u), ("forces", f)):
            if not np.all(np.diff(values) > 0.0) or not np.all(np.isfinite(values)):
                raise ValueError(f"{name} must be finite and ascend")
        if (0.0, 0.0) not in zip(u, f, strict=True):
            raise ValueError(
                "a force of 0 at a deflection of 0 must be among its pairs: give a preload or rest else"
            )

    @cached_property
    def curve(self) -> Curve:
        """The cubics."""
        # a path without such a law starts without it
        from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

        u, f = np.array(self.deflections), np.array(self.forces)
        slopes, chords = PchipInterpolator(u, f)(u, 1), np.diff(f) / np.diff(u)
        slopes[[0, -1]] = chords[[0, -1]]
        inside = CubicHermiteSpline(u, f, slopes).c[::-1].T
        return Curve(u, _padded([[f[0], slopes[0]], *inside.tolist(), [f[-1], slopes[-1]]]))

    @property
    def kinks(self) -> tuple[float, ...]:
        """The ends of its pairs."""
        return self.deflections[0], self.deflections[-1]

    @property
    def regions(self) -> tuple[str, ...]:
        """Outside its pairs nothing was stated."""
        return "outside its table", "within its table", "outside its table"


LAWS: Mapping[str, type[Law]] = {law.kind: law for law in (StrainWave, Polynomial, DeadZone, OneSided, Tabulated)}
"""All laws by the names that files have for them."""
