"""A drive whose spring stiffens, or softens, with load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.mechanisms.drives import BEFORE_JOINTS, DriveSite, InDrive, drives
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.series_elements import ElementSite, SeriesElement, memoryless

RATIO = Quantity("stiffness_ratio", 0.05, 20.0, 1.0, neutral=1.0, usual=1.0, spread=np.log(2.5), log=True)
"""Drives' stiffness over their range of load: strain wave gears' makers promise 1 to 1.3 to 1.6 for small, middle
and large torque, preloaded screws double theirs."""


EXPONENT = Quantity("exponent", 0.25, 4.0, 1.0, usual=1.0, spread=0.5, log=True)
"""Of the load: stiffness that falls or grows evenly, or exponentially, lies between 0.4 and 1.8."""


@dataclass(frozen=True)
class ActuatorHardening(InDrive):
    """Tangent compliance ``c₀ (1 + (1/r − 1) u^m)`` at a share ``u = |N|/N_max`` of the largest load.

    So ``x = c₀ N (1 + (1/r − 1) u^m/(m + 1))``; the tangent stiffness at the largest load is r times that at none.

    Attributes:
        force: N_max, the largest force of the test on the drive, N.
        compliance: c₀ of the drive's spring in the model, mm/N; zero where it has none, and c₀ is looked for.
        part: the joint in which the drive is; empty: the drive before all passive joints.
        drive: the same.
    """

    force: float = 1000.0
    compliance: float = 0.0
    part: str = ""
    drive: DriveSite = BEFORE_JOINTS
    cause = "actuator_hardening"
    title = "the drive's spring stiffens or softens with load"

    @property
    def contains(self) -> tuple[str, ...]:
        """A spring of its own may as well be linear."""
        return () if self.compliance else (f"actuator_compliance.{self.part}".rstrip("."),)

    def sliding(self) -> tuple[Quantity, ...]:
        """r, c₀ at zero load where the model has none, and m."""
        own = () if self.compliance else (Quantity("compliance_mm_per_N", 0.0, 1e-2, 1e-5, neutral=0.0),)
        return (RATIO, *own, EXPONENT)

    def sliding_trials(self) -> Sequence[tuple[float, ...]]:
        """Stiffening and softening ones."""
        if self.compliance:
            return [(1.5, 1.0), (0.6, 1.0)]
        return [(3.0, 2e-5, 1.0), (10.0, 4e-5, 1.0), (0.3, 1e-5, 1.0)]

    def sliding_elements(self, place: ElementSite, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """One spring with that law, in the place of the model's own."""
        r, c, m = values[0], self.compliance or values[1], values[-1]

        def law(N: Array) -> tuple[Array, Array]:
            x, slope = wound_up_by_load(N / self.force, r, m)
            return c * self.force * x - self.compliance * N, c * slope - self.compliance

        return (SeriesElement(place, memoryless(law)),)


def wound_up_by_load(load: Array, ratio: float, power: float) -> tuple[Array, Array]:
    """Wind-up ``(n,)`` and its derivative at shares of the largest load, of a spring of unit compliance at no load.

    Beyond the largest load the tangent stays.
    """
    size = np.minimum(np.abs(load), 1.0)
    grown = (1.0 / ratio - 1.0) * size**power
    return np.sign(load) * (size * (1.0 + grown / (power + 1.0)) + (np.abs(load) - size) / ratio), 1.0 + grown


def effects(scene: Scene) -> list[Effect]:
    """In every drive."""
    return [ActuatorHardening(own.force, own.compliance, own.part, own) for own in drives(scene)]
