"""Material points of a chain: which body carries them, and how they move with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vjm.model.load_case import LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.parts import Beam
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


def find(chain: str, pieces: Sequence[Piece], part: str, at: float) -> Place:
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
        if piece.start - NEAR <= at <= piece.stop + NEAR:
            return piece.at(at)
    raise ValueError(f"{chain}: part '{part}' has points from 0 to 1 of its length, not at {at:g}")


def wanted(load_case: LoadCase) -> dict[str, tuple[float, ...]]:
    """Fractions of the parts at which a load case needs a point, by part."""
    places = [(load.part, load.at) for load in load_case.loads]
    if isinstance(load_case.control, PointControl):
        places.append((load_case.control.part, load_case.control.at))
    return {part: tuple(sorted({at for name, at in places if name == part})) for part, _ in places if part}


def fixed_points(chain: Machine) -> dict[str, tuple[float, ...]]:
    """Fractions of beams at which springs between points are fixed and joints ride, by name, in a posture."""
    beams: dict[str, Beam] = {beam.name: beam for beam in chain.beams}
    found: dict[str, set[float]] = {name: {at} for name, at in chain.cuts.items()}
    for spring in chain.point_springs:
        for part, point in zip(spring.parts, spring.points, strict=True):
            if part in beams:
                found.setdefault(part, set()).add(beams[part].fraction_of(point))
    return {part: tuple(sorted(at)) for part, at in found.items()}


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
