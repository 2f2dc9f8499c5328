"""How beams become elements, and material points of a meshed machine.

It says which body carries a point, and how the point moves with it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from vjm.model.load_case import LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Section
from vjm.rotations import Array, skew

NO_POINTS: Mapping[str, tuple[float, ...]] = {}
"""No fraction of a beam at which a node is needed."""
NEAR = 1e-9
"""Difference of two fractions of a part that are one."""


@dataclass(frozen=True)
class Place:
    """A material point.

    Attributes:
        body: the engine's own name of what carries it; None for the ground.
        position: ``(3,)`` in the reference configuration, mm, world.
    """

    body: Any
    position: Array


@dataclass(frozen=True)
class Piece:
    """A straight stretch of a part on one body, where points can be found by part and fraction.

    Attributes:
        part: name of the part.
        start: fraction of the part's elastic length at which it begins.
        stop: and ends; the same where it is one point.
        body: what carries it, see `Place`.
        root: ``(3,)`` mm where it begins, in the reference configuration.
        along: ``(3,)`` mm from there to where it ends.
        mass: kg.
        centre: ``(3,)`` mm where its weight acts, in the reference configuration.
    """

    part: str
    start: float
    stop: float
    body: Any
    root: Array
    along: Array
    mass: float = 0.0
    centre: Array | None = None

    def at(self, fraction: float) -> Place:
        """The point at a fraction of the part."""
        length = self.stop - self.start
        share = (fraction - self.start) / length if length > 0.0 else 0.0
        return Place(self.body, self.root + share * self.along)


def find(chain: str, pieces: Sequence[Piece], part: str, fraction: float) -> Place:
    """The point of a part at a fraction of its elastic length.

    Where two bodies meet it is on the further one, as in `vjm.model.mechanism.Mechanism.find`.

    Raises:
        ValueError: the part has no such point.
    """
    own = [piece for piece in pieces if piece.part == part]
    if not own:
        known = ", ".join(dict.fromkeys(piece.part for piece in pieces))
        raise ValueError(f"{chain}: no part '{part}' with points on it (there are {known})")
    for piece in reversed(own):
        if piece.start - NEAR <= fraction <= piece.stop + NEAR:
            return piece.at(fraction)
    raise ValueError(f"{chain}: part '{part}' has points from 0 to 1 of its length, not at {fraction:g}")


def wanted(load_case: LoadCase) -> dict[str, tuple[float, ...]]:
    """Fractions of the parts at which a load case needs a point, by part."""
    places = [(load.part, load.at) for load in load_case.loads]
    if isinstance(load_case.control, PointControl):
        places.append((load_case.control.part, load_case.control.at))
    return {
        part: tuple(sorted({fraction for name, fraction in places if name == part})) for part, _ in places if part
    }


def fixed_points(chain: Machine) -> dict[str, tuple[float, ...]]:
    """Fractions of beams at which springs between points are fixed and joints ride, by name, in a posture."""
    beams: dict[str, Beam] = {beam.name: beam for beam in chain.beams}
    points: dict[str, set[float]] = {name: {fraction} for name, fraction in chain.cuts.items()}
    for spring in chain.point_springs:
        for part, point in zip(spring.parts, spring.points, strict=True):
            if part in beams:
                points.setdefault(part, set()).add(beams[part].fraction_of(point))
    return {part: tuple(sorted(fractions)) for part, fractions in points.items()}


@dataclass(frozen=True)
class Moving:
    """A point at a state, and how it moves with the coordinates.

    Attributes:
        position: ``(3,)`` mm.
        rotation: ``(3, 3)`` of its body from the reference.
        motions: indices ``(k,)`` of the motions that move it.
        jacobian: shift and turn ``(6, k)`` by these motions.
        hessian: derivative ``(k, k)`` of ``Jᵀ w`` by them, at a constant wrench ``w`` (6,).
    """

    position: Array
    rotation: Array
    motions: np.ndarray
    jacobian: Array
    hessian: Callable[[Array], Array]


def on_body(motions: np.ndarray, position: Array, rotation: Array, arm: Array) -> Moving:
    """A point of a body with shifts and turns of its own.

    Args:
        motions: indices ``(6,)`` of the body's.
        position: of the body ``(3,)``, mm.
        rotation: of the body from the reference ``(3, 3)``.
        arm: from the body to the point in the reference configuration ``(3,)``, world axes.
    """
    lever = rotation @ arm
    J = np.eye(6)
    J[:3, 3:] = -skew(lever)

    def hessian(wrench: Array) -> Array:
        H = np.zeros((6, 6))
        H[3:, 3:] = skew(wrench[:3]) @ skew(lever)
        return H

    return Moving(position + lever, rotation, motions, J, hessian)


def on_ground(position: Array) -> Moving:
    """A point ``(3,)`` mm that nothing moves."""
    none = np.zeros(0, dtype=np.int64)
    return Moving(position, np.eye(3), none, np.zeros((6, 0)), lambda _: np.zeros((0, 0)))


@dataclass(frozen=True)
class Mesh:
    """How beams become elements.

    Attributes:
        elements: of every beam that is meshed.
        shear: whether the section's own shear stiffness counts; else beams are shear-rigid.
        corrected: residual-flexibility correction ``1/GA* = 1/GA + h²/(12 EI)``. The one-point element alone
            is of second order; with it, bending in a plane is of fourth, and shear-rigid beams are possible.
        foot_spring: the foot as one 6×6 spring at its tip instead of a beam.
    """

    elements: int = 16
    shear: bool = False
    corrected: bool = True
    foot_spring: bool = False

    def __post_init__(self) -> None:
        if self.elements < 1:
            raise ValueError(f"a beam needs at least one element, not {self.elements}")
        if not self.corrected and not self.shear:
            raise ValueError("the plain element needs a finite shear stiffness: ask for shear=True")

    def grid(self, points: Sequence[float] = ()) -> Array:
        """Fractions ``(n + 1,)`` of a beam at which its nodes are; see `grid`."""
        return grid(self.elements, points)

    def section_stiffness(self, section: Section, h: float, name: str) -> Array:
        """Stiffness ``(6, 6)`` of an element ``h`` mm long: EA, GA*y, GA*z, GJ, EIy, EIz on the diagonal.

        Raises:
            ValueError: the plain element, and a section without a finite shear stiffness.
        """
        # GAy lets the beam deflect along y, as bending about z does
        flexibility = np.array([1.0 / section.GAy, 1.0 / section.GAz]) if self.shear else np.zeros(2)
        if self.corrected:
            flexibility = flexibility + h**2 / (12.0 * np.array([section.EIz, section.EIy]))
        if not np.all(flexibility > 0.0):
            raise ValueError(f"part '{name}': the plain element needs finite GAy and GAz")
        GAy, GAz = 1.0 / flexibility
        return np.diag([section.EA, GAy, GAz, section.GJ, section.EIy, section.EIz])


def grid(elements: int, points: Sequence[float] = ()) -> Array:
    """Fractions ``(n + 1,)`` of a beam at which its nodes are: equal elements between points that need a node.

    Args:
        elements: of the whole beam; where points need nodes of their own there may be more.
        points: fractions from 0 to 1; others are left out.
    """
    inside = [fraction for fraction in sorted(points) if NEAR < fraction < 1.0 - NEAR]
    uniform = np.arange(elements + 1) / elements
    if all(np.abs(uniform - fraction).min() < NEAR for fraction in inside):
        return uniform
    ends = [
        0.0,
        *(fraction for fraction, before in zip(inside, [0.0, *inside], strict=False) if fraction - before > NEAR),
        1.0,
    ]
    spans = [
        np.linspace(a, b, max(1, round((b - a) * elements)) + 1)[1:] for a, b in pairwise(ends)
    ]  # fmt: skip
    return np.concatenate([[0.0], *spans])


def lumped_mass(beam: Beam, fractions: Array, i: int) -> tuple[float, float]:
    """A node's share of a beam's mass in kg, and how far ahead of the node its centre is in mm.

    Half of an element's mass is lumped at either node, a sixth of the element's length inside. These are the force
    and moment by which beam theory replaces an even load, q h/2 and q h²/12, so that nodes are where it has them.
    """
    steps = np.diff(fractions)
    before = float(steps[i - 1]) if i > 0 else 0.0
    after = float(steps[i]) if i < len(steps) else 0.0
    mass = 0.5 * beam.mass * (before + after)
    # mean of ± h/6, each weighted by its half element
    offset = beam.length * (after**2 - before**2) / (6.0 * (before + after))
    return mass, offset
