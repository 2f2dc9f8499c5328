"""Tests in which loads are put on a machine and gauges read how it moves: a kind of test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vjm_updating.diagnosis.document import CriticalPointRow, ExperimentRow
from vjm_updating.diagnosis.ramp_kind import RampTest, instrument_effects, scene_of
from vjm_updating.diagnosis.verdict import Verdict
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.channels import unit_of
from vjm_updating.experiment.comparison import gauges_of
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.instrument import LEVER
from vjm_updating.inference.load_forward import LoadForward
from vjm_updating.mechanisms.catalogue import Maker, catalogue
from vjm_updating.mechanisms.effect import Effect
from vjm_updating.mechanisms.gravity import Gravity
from vjm_updating.observation.observed import Observed, observe_loads


class LoadTest(RampTest):
    """The kind of a test by force; see `vjm_updating.observation.observed`."""

    name = "loads"

    def applies(self, measurement: Measurement) -> bool:
        """Where loads were imposed on a machine that bears them, or its pose is not wholly known."""
        return measurement.loaded

    def observe(self, measurement: Measurement) -> Observed:
        """All readings with every load and a displacement."""
        return observe_loads(measurement)

    def forward(self, observed: Observed) -> LoadForward:
        """Equilibria under the loads."""
        return LoadForward(observed)

    def effects(self, observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
        """Those of a machine under loads, and the instruments'."""
        return load_effects(observed, more)

    def critical_points(self, fitter: Fitter, null: Fit, fit: Fit) -> list[CriticalPointRow]:
        """None: nothing was loaded beyond its stability."""
        return []

    def next_experiment(self, fitter: Fitter, verdict: Verdict) -> ExperimentRow:
        """More gauges: candidates differ in what moves where."""
        observed = fitter.forward.observed
        return ExperimentRow(
            why=f"what {', '.join(observed.columns)} read does not tell the candidates apart",
            posture=str(observed.readings.posture[0]),
            path="the same loads with gauges at points between support and load, or on rotations; or another load",
        )


def load_effects(observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
    """The catalogue of a test by force.

    Friction in passive joints is not asked: its law is that of an imposed displacement. The machine's own weight is
    where the whole pose was read, which counts from the unloaded one; gauges are set when it has acted.
    """
    size = {"N": np.abs(observed.pose[:, :3]).max(), "Nmm": np.abs(observed.pose[:, 3:]).max()}
    for unit in ("mm", "rad"):
        own = [c for c, name in enumerate(observed.columns) if unit_of(name) == unit]
        size[unit] = np.nanmax(np.abs(observed.wrench[:, own]), initial=0.0)
    length = observed.measurement.chain.characteristic_length
    # where only moments act, their force at the longest part's end
    force = max(float(size["N"]), float(size["Nmm"]) / length, 1.0)
    scene = replace(
        scene_of(observed, force, max(float(size["mm"]), float(size["rad"]) * length)),
        loaded=True,
        gauged=any(gauge.body for gauge in gauges_of(observed.measurement)),
    )
    largest = {
        "N": scene.force,
        "Nmm": max(float(size["Nmm"]), LEVER * scene.force),
        "mm": scene.reach,
        "rad": float(size["rad"]) or float("inf"),
    }
    weighs = observed.measurement.wholly_read and not scene.gauged
    found = [effect for effect in catalogue(scene, more) if _is_of_loads(effect, weighs=weighs)]
    return [*found, *instrument_effects(observed, scene.duration, largest)]


def _is_of_loads(effect: Effect, *, weighs: bool) -> bool:
    has_friction = type(effect).friction is not Effect.friction
    return not has_friction and (weighs or not isinstance(effect, Gravity))
