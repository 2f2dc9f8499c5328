"""Causes in the loads: the chain's own weight, and an imposed displacement that is misaligned.

The latter does not point along the nominal axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.model.machine import FOOT
from vjm.rotations import Array, rotation_from_vector
from vjm_updating.constants import prior_scale
from vjm_updating.mechanisms.effect import Effect, ExperimentContext, Quantity
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, foot_of

UNLIKE = prior_scale(0.2)
"""Standard deviation of the foot's share of the weight about what both have were they of one material."""


@dataclass(frozen=True)
class Gravity(Effect):
    """Weight of the links and, where it is a beam, of the foot, spread evenly over each.

    Attributes:
        links: shares of the links' weight by their names, as they have were they of one material.
        foot: share of the weight that the foot has if both are of one material; None: it is no beam, and could
            not bend under what it weighs.
    """

    links: tuple[tuple[str, float], ...] = (("link", 1.0),)
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    foot: float | None = None
    cause = "gravity"
    title = "the chain's own weight"

    def quantities(self) -> tuple[Quantity, ...]:
        """The whole mass, and the foot's share of it."""
        mass = Quantity("mass_kg", 0.0, 500.0, 1.0, neutral=0.0)
        if self.foot is None:
            return (mass,)
        return mass, Quantity("foot_share", 0.0, 1.0, UNLIKE, usual=self.foot, spread=UNLIKE)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """A bar of steel of that size weighs about this."""
        return [(2.0,)] if self.foot is None else [(2.0, self.foot)]

    def machine(self, machine: ModifiedMachine, values: Sequence[float]) -> ModifiedMachine:
        """Carrying its weight."""
        own: tuple[tuple[str, float], ...] = ()
        rest = values[0]
        if self.foot is not None:
            own, rest = ((FOOT, values[0] * values[1]),), values[0] * (1.0 - values[1])
        weight = (*own, *((name, rest * share) for name, share in self.links))
        return replace(machine, weight=weight, gravity=self.direction)


def gravity_effects(scene: ExperimentContext) -> list[Effect]:
    """Where links have a section that their weight acts on; down is −z where the sheet does not say."""
    # in proportion to the beams' volumes: their stiffness in pull times their length
    beams = scene.chain.beams
    size = {beam.name: beam.count * beam.section.EA * beam.length for beam in beams if beam.section is not None}
    foot = size.pop(FOOT, None) if foot_of(scene.chain) else None
    if not size or (scene.engine.segments or 1) == 1:
        return []
    links = sum(size.values())
    shares = tuple((name, own / links) for name, own in size.items())
    share = None if foot is None else foot / (foot + links)
    return [Gravity(shares, scene.gravity or (0.0, 0.0, -1.0), share)]


USUAL = prior_scale(0.03, "rad")
"""rad; standard deviation of either angle: two degrees are seen by eye when a test is set up."""


@dataclass(frozen=True)
class LoadMisalignment(Effect):
    """The device that imposes the displacement is turned.

    Attributes:
        axis: unit vector of the driven axis.
        first: and of two directions across it
        second: the other.
    """

    axis: tuple[float, ...] = (1.0, 0.0, 0.0)
    first: tuple[float, ...] = (0.0, 1.0, 0.0)
    second: tuple[float, ...] = (0.0, 0.0, 1.0)
    cause = "load_misalignment"
    exact = True
    extent = 2
    title = "the imposed displacement does not point along the nominal axis"

    def quantities(self) -> tuple[Quantity, ...]:
        """Angles towards both directions across."""
        return tuple(
            Quantity(f"towards_{k}_rad", -0.5, 0.5, 0.01, neutral=0.0, spread=USUAL) for k in ("first", "second")
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Towards each and both; the force along the axis changes with the square."""
        return [(0.02, 0.0), (0.0, 0.02), (-0.02, 0.0), (0.0, -0.02), (0.1, 0.0), (0.0, 0.1)]

    def imposed(self, pose: Array, values: Sequence[float]) -> Array:
        """Shifts turned about the axis across."""
        a, b, c = np.array(self.axis), np.array(self.first), np.array(self.second)
        turn = np.cross(a, values[0] * b + values[1] * c)
        R = rotation_from_vector(turn)
        result = pose.copy()
        result[:, :3] = pose[:, :3] @ R.T
        return result

    def tilted(self, values: Sequence[float]) -> Array:
        """Unit vector ``(3,)`` along which the device really goes."""
        return self.imposed(np.array([[*self.axis, 0.0, 0.0, 0.0]]), values)[0, :3]

    def reported(self, values: Sequence[float]) -> dict[str, float]:
        """Angle, and direction about the axis from the first direction across."""
        a, b = values
        return {
            f"{self.cause}.angle_rad": float(np.hypot(a, b)),
            f"{self.cause}.direction_rad": float(np.arctan2(b, a)),
        }


def load_misalignment_effects(scene: ExperimentContext) -> list[Effect]:
    """About the axis along which the test goes."""
    x, y, z = (tuple(float(v) for v in np.roll(axis, scene.driven)) for axis in np.eye(3))
    return [LoadMisalignment(x, y, z)]
