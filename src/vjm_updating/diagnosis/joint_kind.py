"""Tests of one joint, its torque against its angle: a kind of test."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm_updating.diagnosis.document import CriticalPointRow, ExperimentRow
from vjm_updating.diagnosis.evidence import Costs
from vjm_updating.diagnosis.ramp_kind import RampTest, instrument_effects
from vjm_updating.diagnosis.scored_hypothesis import Ranked
from vjm_updating.diagnosis.search import Search
from vjm_updating.diagnosis.verdict import Verdict
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.channels import unit_of
from vjm_updating.experiment.joint_levers import levers_of, one_sided
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.joint_forward import JointForward
from vjm_updating.inference.trust_region import best_fit
from vjm_updating.mechanisms.catalogue import Maker
from vjm_updating.mechanisms.effect import Effect
from vjm_updating.mechanisms.play import ActuatorBacklash
from vjm_updating.mechanisms.single_joint import DriveFriction, JointCompliance, JointHardening, drive_of
from vjm_updating.observation.observed import Observed, observe_joint


class JointTest(RampTest):
    """The kind of a test of one joint; see `vjm_updating.mechanisms.single_joint`.

    A geared joint that is loaded through zero has some of everything: a third cause costs no more than a second.
    """

    name = "joint"
    costs = Costs(third=0.0)

    def applies(self, measurement: Measurement) -> bool:
        """Where the sheet says so."""
        return measurement.sheet.kind == "joint"

    def observe(self, measurement: Measurement) -> Observed:
        """All readings with a motion and a load."""
        return observe_joint(measurement)

    def forward(self, observed: Observed) -> JointForward:
        """The joint's law."""
        return JointForward(observed)

    def effects(self, observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
        """The joint's own, and the instruments'; effects of a file are made for chains and are not taken."""
        motion = next(iter(observed.slots))
        largest = {unit_of(motion): float(np.abs(observed.pose[:, 0]).max())}
        largest[unit_of(observed.columns[0])] = float(np.nanmax(np.abs(observed.wrench)))
        duration = 0.0 if observed.clock is None else float(np.ptp(observed.clock))
        return [*joint_effects(observed), *instrument_effects(observed, duration, largest)]

    def completed(self, search: Search, best: Ranked) -> Ranked:
        """All of the joint's own causes together, those left out that do not pay, where that is better.

        Four may act together, and any three of them leave what the fourth does.
        """
        own = {type(effect) for effect in joint_effects(search.fitter.forward.observed)}
        # a spring that hardens has a compliance of its own
        own.discard(JointCompliance)
        every = tuple(effect for effect in search.effects if type(effect) in own)
        fit = together(search.fitter, search.null, every)
        if fit is None:
            return best
        found = search.kept(fit)
        while len(found.labels) > 1:
            less = [without(search, found, effect) for effect in found.fit.hypothesis]
            top = min((r for r in less if r is not None), key=lambda r: r.criterion, default=found)
            if top.criterion >= found.criterion:
                break
            found = top
        return found if found.criterion < best.criterion and search.significant(found) else best

    def critical_points(self, fitter: Fitter, null: Fit, fit: Fit) -> list[CriticalPointRow]:
        """A joint has none."""
        return []

    def next_experiment(self, fitter: Fitter, verdict: Verdict) -> ExperimentRow:
        """Of the load's scale the cell itself tells; of the rest both directions and larger loads."""
        observed = fitter.forward.observed
        causes = {cause for member in verdict.members for cause in member.causes}
        effort = observed.columns[0]
        if "instrument_scale" in causes:
            why, path = (
                "a scale error and a stiffness change the slope alike",
                f"{effort} under known weights alone",
            )
        else:
            why = "backlash, friction and hardening differ where the load turns round and where it is largest"
            path = "both directions through zero in fine steps, twice, to a larger load"
        return ExperimentRow(why=why, posture=observed.measurement.drive.name, path=path)


def together(fitter: Fitter, null: Fit, effects: Sequence[Effect]) -> Fit | None:
    """The best fit of causes together, begun from each of their trials in turn; None where none stands."""
    m = len(fitter.nuisances)
    trials = [list(effect.trials()) for effect in effects]
    starts = [[list(own[k % len(own)]) for own in trials] for k in range(max(map(len, trials), default=0))]
    found = [best_fit(fitter, tuple(effects), null.at.z[:m], start) for start in starts]
    return min((fit for fit in found if fit is not None), key=lambda fit: fit.objective, default=None)


def without(search: Search, ranked: Ranked, effect: Effect) -> Ranked | None:
    """A hypothesis with one cause less, which the search then knows; None where it does not stand."""
    fit, m = ranked.fit, len(search.fitter.nuisances)
    kept = [(e, v) for e, v in zip(fit.hypothesis, fit.values, strict=True) if e != effect]
    less = best_fit(search.fitter, tuple(e for e, _ in kept), fit.at.z[:m], [v for _, v in kept])
    return None if less is None else search.kept(less)


def joint_effects(observed: Observed) -> list[Effect]:
    """What a joint under test may have: another stiffness, hardening, friction; backlash by loads to both sides."""
    joint = observed.measurement.drive
    lever, of_motion, of_load = levers_of(observed.measurement)
    compliance = observed.measurement.joint_compliance
    force = float(np.nanmax(np.abs(observed.wrench))) / of_load
    reach = float(np.abs(observed.pose[:, 0]).max()) * of_motion / lever
    own = drive_of(joint.name, slides=joint.slides, compliance=compliance, lever=lever, force=force)
    backlash = [] if one_sided(observed.measurement) else [ActuatorBacklash(force, joint.name, own)]
    return [
        JointCompliance(joint.name, own),
        JointHardening(force, own.compliance, joint.name, own),
        *backlash,
        DriveFriction(force * lever, reach, joint.slides, joint.name),
    ]
