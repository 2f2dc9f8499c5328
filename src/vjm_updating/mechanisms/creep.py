"""A force that relaxes while the displacement is held: a solid with a spring and two retarded terms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.model.machine import FOOT
from vjm_updating.constants import prior_scale
from vjm_updating.mechanisms.drives import BEFORE_JOINTS, DriveSite, drives
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.modified_chain import LINK, ModifiedChain, foot_of, link_of, links_of, place_of
from vjm_updating.mechanisms.relaxation import Relaxation
from vjm_updating.mechanisms.series_elements import SeriesElement, retarded, together

LATER, DECADE = prior_scale(10.0), prior_scale(2.3)
"""Time of the slow term over that of the fast one, and the spread of its logarithm: materials relax over decades of
time, of which one lies between the terms, give or take another."""


@dataclass(frozen=True)
class Creep(Effect):
    """A share φ of the part's stiffness relaxes; at first it is nominal, in the end ``(1 − φ)`` of that.

    Its compliance then gains ``φ/(1 − φ)``, delayed by ``τ/(1 − φ)`` for a relaxation time τ; a
    part of it comes later (a Prony series of two terms, Findley, Lai and Onaran 1976, chapter 5).

    Attributes:
        part: ``actuator``, ``foot`` or ``link``; the link's name where there are several, or a joint's.
        compliance: of the drive's spring in the model, mm/N.
        duration: of the test, s.
        interval: between readings, s.
        beam: the part's name in the chain; empty: that of the foot, or of the last link.
        drive: which, where the part is the drive before all passive joints or one in a joint.
    """

    part: str = "foot"
    compliance: float = 0.0
    duration: float = 100.0
    interval: float = 1.0
    beam: str = ""
    drive: DriveSite = BEFORE_JOINTS
    cause = "creep"
    title = "the force relaxes while the displacement is held"

    @property
    def _is_drive(self) -> bool:
        return self.part == "actuator" or bool(self.drive.joint)

    def quantities(self) -> tuple[Quantity, ...]:
        """φ, τ, how much of φ is late, and how many times as late."""
        shortest, longest = 0.1 * self.interval, 10.0 * self.duration
        # materials relax in all decades of time; a test shows those between a reading's and its own
        middle = (self.duration * self.interval) ** 0.5
        spread = np.log(max(self.duration / self.interval, 10.0)) / 12.0**0.5
        return (
            Quantity("fraction", 0.0, 0.9, 0.01, neutral=0.0),
            Quantity("time_s", shortest, longest, middle, usual=middle, spread=float(spread), log=True),
            Quantity("slow_share", 0.0, 0.95, 0.1, usual=0.25, spread=0.25),
            Quantity("slow_over_fast", 2.0, 1000.0, LATER, usual=LATER, spread=DECADE, log=True),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Fast to slow."""
        times = (3.0 * self.interval, (self.duration * self.interval) ** 0.5, self.duration / 8.0, self.duration)
        return [(0.03, time, 0.25, LATER) for time in times]

    def elements(self, machine: ModifiedChain, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """The drive's, of two terms behind its own spring: a spring on an axis, so that this is exact."""
        if not self._is_drive:
            return ()
        fraction, time, slow, later = values
        gain = self.compliance * fraction / (1.0 - fraction)
        delay = time / (1.0 - fraction)
        terms = together(retarded((1.0 - slow) * gain, delay), retarded(slow * gain, later * delay))
        return (SeriesElement(self.drive.place(machine), terms, smooth=True),)

    def relaxation(self, machine: ModifiedChain, values: Sequence[float]) -> Relaxation | None:
        """A beam's, which bends as well."""
        if self._is_drive:
            return None
        fraction, time, slow, later = values
        part = self.beam or (FOOT if self.part == "foot" else link_of(machine.nominal))
        return Relaxation(part, ((1.0 - slow) * fraction, slow * fraction), (time, later * time))


def effects(scene: Scene) -> list[Effect]:
    """In each drive that is elastic, and in each beam, where there is a clock."""
    if scene.duration <= 0.0 or scene.interval <= 0.0:
        return []
    clock = scene.duration, scene.interval
    elastic = [own for own in drives(scene) if own.compliance > 0.0]
    found: list[Effect] = [Creep(own.part or "actuator", own.compliance, *clock, drive=own) for own in elastic]
    found += [Creep("foot", 0.0, *clock)] if foot_of(scene.chain) else []
    links = links_of(scene.chain)
    return [*found, *(Creep(place_of(scene.chain, name) or LINK, 0.0, *clock, name) for name in links)]
