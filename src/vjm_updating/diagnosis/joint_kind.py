"""Tests of one joint, its torque against its angle: a kind of test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vjm_updating.constants import numerical
from vjm_updating.diagnosis.document import CriticalPointRow, ExperimentRow, ValueRow
from vjm_updating.diagnosis.evidence import Costs, Ranked
from vjm_updating.diagnosis.ramp_kind import RampTest, instrument_effects
from vjm_updating.diagnosis.search import Search
from vjm_updating.diagnosis.verdict import Verdict
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.channels import unit_of
from vjm_updating.experiment.joint_levers import levers_of, one_sided
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.forward import values_of
from vjm_updating.inference.joint_forward import JointForward
from vjm_updating.inference.parameters import coordinates, start
from vjm_updating.inference.refit import after_a_step, begun_anew
from vjm_updating.inference.trust_region import best_fit
from vjm_updating.mechanisms.catalogue import Maker
from vjm_updating.mechanisms.effect import Effect
from vjm_updating.mechanisms.play import ActuatorBacklash
from vjm_updating.mechanisms.single_joint import (
    DriveFriction,
    JointCompliance,
    JointHardening,
    JointThreeSlopes,
    drive_of,
)
from vjm_updating.observation.observed import Observed, observe_joint

STARTS = numerical(2)
"""Of the trials of causes together, from which they are fitted."""


class JointTest(RampTest):
    """The kind of a test of one joint; see `vjm_updating.mechanisms.single_joint`.

    A geared joint that is loaded through zero has some of everything: a third cause costs no more than a second.
    """

    name = "joint"
    # a law is read over its own torque and turn, which are what the discrepancy's shapes go with
    costs = Costs(third=0.0, off_sheet=True, other_shapes=False)

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
        """What leaves more than noise is completed by all of the joint's own causes, less those that do not pay.

        Four may act together, and any three of them leave what the fourth does. The spring is of one law at a time.
        """
        if best.labels:
            fits = [best.fit]
            if len(best.labels) == 1 and (again := together(search.fitter, search.null, best.fit.hypothesis)):
                fits.append(again)
            best = min((search.kept(begun_anew(search.fitter, fit)) for fit in fits), key=lambda r: r.criterion)
        if best.labels and not search.is_wrong(search.rest(best.fit)):
            return best
        own = {type(effect): effect for effect in search.effects}
        beside = [own[kind] for kind in (ActuatorBacklash, DriveFriction) if kind in own]
        # a spring of another law has a compliance of its own
        for spring in (JointHardening, JointThreeSlopes):
            every = (*([own[spring]] if spring in own else []), *beside)
            fit = together(search.fitter, search.null, every) if every else None
            if fit is None:
                continue
            found = search.kept(begun_anew(search.fitter, fit))
            while len(found.labels) > 1:
                less = [one for effect in found.fit.hypothesis for one in without(search, found, effect)]
                top = min(less, key=lambda r: r.criterion, default=found)
                if top.criterion >= found.criterion:
                    break
                found = top
            if found.criterion < best.criterion and search.significant(found):
                best = found
        return best

    def parameters(self, fitter: Fitter, fit: Fit, found: Mapping[str, ValueRow]) -> dict[str, ValueRow | str]:
        """Of a gear whose second kink no reading reached, that it was not."""
        observed = fitter.forward.observed
        return dict.fromkeys(not_reached(observed, found), "not reached by the test")

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
    """The best fit of causes together, begun where their trials lead in a step; None where none stands."""
    m, hypothesis = len(fitter.nuisances), tuple(effects)
    found = coordinates(fitter.nuisances, hypothesis)
    trials = [list(effect.trials()) for effect in effects]
    ways = []
    for k in range(max(map(len, trials), default=0)):
        z = start(found, hypothesis, null.at.z[:m], [own[k % len(own)] for own in trials])
        ways.append(after_a_step(fitter, hypothesis, found, z))
    fits = [
        best_fit(fitter, hypothesis, z[:m], values_of(found, z, hypothesis))
        for _, z in sorted(ways, key=lambda way: way[0])[:STARTS]
    ]
    return min((fit for fit in fits if fit is not None), key=lambda fit: fit.objective, default=None)


def not_reached(observed: Observed, found: Mapping[str, ValueRow]) -> list[str]:
    """Parameters of a gear's slopes beyond the largest load of a test: by their names, K3 and T2.

    Args:
        observed: the readings.
        found: parameters by their names.
    """
    own = f"{JointThreeSlopes.cause}."
    names = {number: [n for n in found if n.startswith(f"{own}{number}_")] for number in ("T2", "K3")}
    lever, _, of_load = levers_of(observed.measurement)
    largest = float(np.nanmax(np.abs(observed.wrench))) / of_load * lever
    beyond = any(found[name].value >= largest for name in names["T2"])
    return [*names["T2"], *names["K3"]] if beyond else []


def without(search: Search, ranked: Ranked, effect: Effect) -> list[Ranked]:
    """Hypotheses with one cause less, which the search then knows, and with a linear spring in place of another."""
    fit, m = ranked.fit, len(search.fitter.nuisances)
    kept = [(e, v) for e, v in zip(fit.hypothesis, fit.values, strict=True) if e != effect]
    ways = [kept] if kept else []
    if isinstance(effect, JointHardening | JointThreeSlopes):
        linear = [e for e in search.effects if isinstance(e, JointCompliance)]
        ways += [[*kept, (e, list(e.trials()[0]))] for e in linear]
    found = (best_fit(search.fitter, tuple(e for e, _ in way), fit.at.z[:m], [v for _, v in way]) for way in ways)
    return [search.kept(one) for one in found if one is not None]


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
        JointThreeSlopes(force, own.compliance, joint.name, own),
        *backlash,
        DriveFriction(force * lever, reach, joint.slides, joint.name),
    ]
