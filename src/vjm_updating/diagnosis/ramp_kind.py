"""Tests in which the end-effector is taken along ramps of displacement and its wrench is read; other kinds differ.

Every step of a diagnosis asks the kind of test for what differs, and none asks which it is. A further kind is a
class with the methods that differ from those of `RampTest`, and a line in `vjm_updating.diagnosis.kinds`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from vjm_updating.constants import prior_scale, shown
from vjm_updating.diagnosis.critical import critical_points
from vjm_updating.diagnosis.document import CriticalPointRow, ExperimentRow, ValueRow
from vjm_updating.diagnosis.evidence import Costs
from vjm_updating.diagnosis.experiment import propose
from vjm_updating.diagnosis.holdout import HoldOut, hold_out, split_of
from vjm_updating.diagnosis.scored_hypothesis import Ranked
from vjm_updating.diagnosis.screening import far_off
from vjm_updating.diagnosis.search import Search
from vjm_updating.diagnosis.verdict import Verdict
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.channels import TIME, unit_of
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.forward import Forward, Predictor
from vjm_updating.inference.instrument import LEVER, InstrumentScale, InstrumentZero, ThermalDrift
from vjm_updating.inference.ramp_readings import observe_ramps
from vjm_updating.mechanisms.catalogue import Maker, catalogue
from vjm_updating.mechanisms.effect import Effect, Scene
from vjm_updating.observation.observed import Observed

LONG_BEFORE = prior_scale(4.0)
"""Spans of a test that its clock may have run before at most: one that shows the date says nothing."""
MOST_PAIRS = shown(5)
"""Members of a class that the next experiment tells from the most probable one."""


class RampTest:
    """The kind that takes every test, and the base of the others.

    Attributes:
        name: in one word.
        costs: what a choice of causes costs in a test of this kind.
    """

    name = "ramps"
    costs = Costs()

    def applies(self, measurement: Measurement) -> bool:
        """To every test; `observe` refuses those without a displacement."""
        return True

    def observe(self, measurement: Measurement) -> Observed:
        """The readings to be explained: all with a displacement and a wrench, of a chain with a link that bends.

        Raises:
            ValueError: the test cannot be diagnosed; one line.
        """
        if not measurement.chain.beams:
            raise ValueError(
                f"{measurement.sheet.file}: [test] model: no link of {measurement.chain.name} bends, and causes in "
                'forces are sought along one. `validate calibrate` fits its joints, and a sheet of kind = "poses" '
                "diagnoses it"
            )
        return observe_ramps(measurement)

    def forward(self, observed: Observed) -> Predictor:
        """Equilibria of the chain at the displacements, from tables along rays."""
        return Forward(observed)

    def effects(self, observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
        """The machine's effects, those of ``more`` included where the kind takes them, and the instruments'."""
        return ramp_effects(observed, more)

    def without_outliers(self, observed: Observed, outliers: np.ndarray) -> Observed:
        """The readings that count, where samples ``(n, 6)`` stand out: the others."""
        return observed.without(outliers)

    def reweighted(self, fitter: Fitter, everything: Observed, best: Fit) -> Observed | None:
        """All readings with the noise that a fit shows, the sheet's; None where it is too far off to show any."""
        return None if far_off(fitter, best) else everything

    def completed(self, search: Search, best: Ranked) -> Ranked:
        """The hypothesis that a search ends with, once what it leaves out on purpose was tried: nothing here."""
        return best

    def hold_out(self, fitter: Fitter, null: Fit) -> HoldOut:
        """Postures one at a time, else directions, cycles or every third reading."""
        return hold_out(fitter, null, split_of(fitter.forward.observed))

    def critical_points(self, fitter: Fitter, null: Fit, fit: Fit) -> list[CriticalPointRow]:
        """Critical loads of the half-rays: measured, of the nominal model and of the extended one."""
        return critical_points(fitter, null, fit)

    def parameters(self, fitter: Fitter, fit: Fit, found: Mapping[str, ValueRow]) -> dict[str, ValueRow | str]:
        """What follows from a fit's parameters in a test of this kind: nothing beyond the causes' own."""
        return {}

    def scatter(self, observed: Observed) -> str:
        """In words, how far noise that was found exceeds the sheet's; empty: here the sheet's is kept."""
        return ""

    def next_experiment(self, fitter: Fitter, verdict: Verdict) -> ExperimentRow:
        """Posture, direction, cycles and holds that tell the most probable member from the others."""
        first = verdict.members[0]
        others: dict[frozenset[str], Fit] = {}
        for member in verdict.members:
            if member.causes != first.causes and len(others) < MOST_PAIRS:
                others.setdefault(member.causes, member.fit)
        found = propose(fitter, [first.fit, *others.values()])
        if found is None:
            return ExperimentRow(why="no posture of the model separates them")
        one, *rest = (" + ".join(sorted(causes)) for causes in (first.causes, *others))
        told = f"it tells {one} from {' and from '.join(rest)}"
        return ExperimentRow(
            why=f"{told}: {found.channel} would differ by up to {found.difference:.3g}",
            posture=found.posture,
            path=found.path,
            difference=found.difference,
            channel=found.channel,
            strength=found.strength,
        )


def ramp_effects(observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
    """The catalogue of a ramp test: the machine's effects, and the instruments'."""
    force = float(np.nanmax(np.linalg.norm(np.nan_to_num(observed.wrench[:, :3]), axis=1)))
    gravity = observed.measurement.sheet.test.gravity
    scene = replace(
        scene_of(observed, max(force, 1.0), float(np.abs(observed.pose[:, :3]).max())),
        gravity=None if gravity is None else (gravity[0], gravity[1], gravity[2]),
    )
    return [*catalogue(scene, more), *instrument_effects(observed, scene.duration, _largest(observed, scene))]


def scene_of(observed: Observed, force: float, reach: float) -> Scene:
    """A test as its effects take it, without gravity; its largest force in N, and how far it moved, mm."""
    measurement, clock = observed.measurement, observed.clock
    return Scene(
        chain=measurement.chain,
        engine=measurement.engine,
        force=force,
        reach=reach,
        duration=0.0 if clock is None else float(np.ptp(clock)),
        interval=0.0 if clock is None else float(np.median(np.diff(clock))),
        rays=tuple((ray.posture, tuple(ray.direction.tolist())) for ray in observed.rays),
    )


def instrument_effects(observed: Observed, duration: float, largest: Mapping[str, float]) -> list[Effect]:
    """Errors of every channel.

    Args:
        observed: the readings.
        duration: of the test, s; zero where there is no clock.
        largest: reading that gauges are made for, by unit.
    """
    found: list[Effect] = []
    for channel in (*observed.pose_channels, *observed.wrench_channels):
        found += [InstrumentZero(part=channel), InstrumentScale(part=channel)]
        most = largest[unit_of(channel)]
        if observed.warmth is not None:
            span = float(np.ptp(observed.warmth))
            found.append(ThermalDrift(channel, "K", span, duration=duration, largest=most))
        if observed.clock is not None:
            span, first = float(np.ptp(observed.clock)), float(observed.readings.values[TIME][0])
            since = float(np.clip(first / span, 0.0, LONG_BEFORE))
            found.append(ThermalDrift(channel, "s", span, since=since, largest=most))
    return found


def _largest(observed: Observed, scene: Scene) -> dict[str, float]:
    """The largest reading by its unit: what gauges of that kind are made for."""
    moment = float(np.abs(np.nan_to_num(observed.wrench[:, 3:])).max())
    turn = float(np.abs(observed.pose[:, 3:]).max())
    return {"N": scene.force, "Nmm": max(moment, LEVER * scene.force), "mm": scene.reach, "rad": turn or np.inf}
