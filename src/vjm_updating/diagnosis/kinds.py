"""The kinds of test that a diagnosis knows: of a column, of one joint, by loads, and by ramps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from vjm_updating.constants import numerical, shown
from vjm_updating.diagnosis.column import (
    ColumnForward,
    column_effects,
    is_column,
    noise_found,
    observe_column,
    with_noise_found,
)
from vjm_updating.diagnosis.document import CriticalPointRow, ExperimentRow, ValueRow
from vjm_updating.diagnosis.evidence import Costs, ScoredModel, estimates
from vjm_updating.diagnosis.holdout import HoldOut, hold_out, split_of_marks
from vjm_updating.diagnosis.ramp_kind import RampTest, instrument_effects, scene_of
from vjm_updating.diagnosis.search import RIVAL, Search
from vjm_updating.diagnosis.verdict import Verdict
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.comparison import gauges_of, levers_of, one_sided
from vjm_updating.experiment.data_file import WRENCH, unit_of
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem, best_fit, prior
from vjm_updating.inference.forward import values_of
from vjm_updating.inference.instruments import LEVER
from vjm_updating.inference.joint_forward import (
    DriveFriction,
    JointCompliance,
    JointForward,
    JointHardening,
    JointThreeSlopes,
    drive_of,
)
from vjm_updating.inference.load_forward import LoadForward
from vjm_updating.inference.observed import Observed, observe_joint, observe_loads
from vjm_updating.inference.parameters import Evaluation, coordinates, start
from vjm_updating.inference.refit import after_a_step, begun_anew
from vjm_updating.inference.significance import NORMAL_95
from vjm_updating.mechanisms.catalogue import Maker, catalogue
from vjm_updating.mechanisms.contacts import ActuatorBacklash
from vjm_updating.mechanisms.effect import Effect
from vjm_updating.mechanisms.loads import Gravity

# --- Tests of marks, one load each: further causes with the noise that each leaves --------------------------------
#
# How well a hand stops at a mark is not known beforehand, so the noise is a part of each hypothesis. What a few
# causes leave would else count as noise, and hide the next one.


def _with(search: Search, base: ScoredModel, effect: Effect) -> None:
    """Fit a hypothesis with one cause more."""
    fitter, fit = search.fitter, base.fit
    m = len(fitter.nuisances)
    hypothesis = (*fit.hypothesis, effect)
    attempts = [
        best_fit(fitter, hypothesis, begin, [*fit.values, list(trial)])
        for trial in effect.trials()
        for begin in (fit.evaluation.z[:m], np.zeros(m))
    ]
    fits = [one for one in attempts if one is not None]
    if fits:
        ranked = search.ranked(min(fits, key=lambda one: one.objective))
        search.tried[ranked.labels] = ranked


def _worth(search: Search, ranked: ScoredModel) -> float:
    """The criterion with the noise that the hypothesis leaves in the place of that in force."""
    fit = ranked.fit
    likelihood, _ = noise_found(search.fitter.forward.observed, fit)
    off, _ = prior(fit.parameters, fit.evaluation.z)
    return likelihood + float(off @ off) + ranked.criterion - fit.objective


# --- What to do next with a column: the direct measurement that distinguishes explanations, and what it would show


def direct(
    measurement: Measurement, posture: str, cause: str, values: Mapping[str, ValueRow], load: float
) -> ExperimentRow | None:
    """The measurement that shows a cause directly, by how much over the sheet's sigma; None where there is none.

    ``load`` is the largest one of the test, N.
    """
    name = next((n for n in values if n.startswith(f"{cause}.")), None)
    if name is None:
        return None
    e, channel = values[name], name.partition(".")[2]
    known, tolerance, cell = measurement.sheet.sigma, measurement.sheet.tolerance, channel == WRENCH[0]
    size = abs(e.value)
    shown: float | None = None
    if cause == "instrument_zero":
        what = "load cell" if cell else "ruler"
        path = f"take the column out of the rig and read the {what}"
        why = (
            f"an error of zero of the {what} would show as {e.value:.3g} there, against the sheet's "
            f"±{known(channel).zero:.3g}; a column that is stiffer or longer would not"
        )
        shown, off, sigma = size, size, known(channel).zero
    elif cause == "instrument_scale" and cell:
        path, shown = f"load the cell with a known weight of some {load:.3g} N", size * load
        why = (
            f"an error of its scale would show as {size * load:.3g} N; a column that is stiffer or longer would not"
        )
        off, sigma = size, known(channel).scale
    elif cause == "instrument_scale":
        path, why = "lay a second ruler beside the first", f"it would be off by {100.0 * e.value:.2g} %"
        off, sigma = size, known(channel).scale
    elif cause == "link_compliance":
        path = "lay the column on two supports and bend it by a known weight at its middle"
        why = (
            f"it would deflect by {100.0 * abs(1.0 - e.value):.2g} % {'less' if e.value < 1.0 else 'more'} "
            "than the model says; errors of zero and scale of the rig do not change it"
        )
        off, sigma = abs(1.0 / e.value - 1.0), tolerance.modulus_rel
    elif cause == "link_length":
        path = "measure the distance between the knife edges with calipers"
        why = f"it would be off by {e.value:.3g} mm"
        off, sigma = size, tolerance.link_length_mm
    else:
        return None
    return ExperimentRow(
        path=path, why=why, posture=posture, difference=shown,
        channel=channel if cause.startswith("instrument") else "", strength=off / sigma if sigma > 0.0 else None,
    )  # fmt: skip


FIRST_YIELD, DEPARTS = "plasticity.yield_N", "plasticity.departs_mm"
HANDBOOK = "plasticity.handbook"
MANY = shown(6.0)
"""Noise of the load over the sheet's from which on it is reported."""


class ColumnTest(RampTest):
    """Marks of deflection with a load each.

    Every column is bowed, however little, and yields in the end: a cause whose own parameter may as well be nothing
    costs nothing more. The elastica's law is exact, and marks scatter by a noise that is found.
    """

    name = "column"
    predictor = ColumnForward
    costs = Costs(third=0.0, disguised=0.0, law_error=0.0)
    takes_effects = False

    def applies(self, measurement: Measurement) -> bool:
        """Where a point of a body controls the test and the end's displacement was not read."""
        return is_column(measurement)

    def observe(self, measurement: Measurement) -> Observed:
        """What settled at each mark, as long as the deflection grows."""
        return observe_column(measurement)

    def effects(self, observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
        """The column's own; effects of a file are made for chains and are not taken."""
        return column_effects(observed)

    def without_outliers(self, observed: Observed, outliers: np.ndarray) -> Observed:
        """All: there are few marks, and each was set by hand."""
        return observed

    def critical(self, observed: Observed, evaluation: Evaluation) -> np.ndarray:
        """None: the law is exact on both sides of the buckling load."""
        return np.zeros(len(observed.imposed), dtype=bool)

    def reweighted(self, fitter: LeastSquaresProblem, everything: Observed, best: Fit) -> Observed | None:
        """With the noise of mark and load as the fit's residuals have it."""
        return with_noise_found(everything, best)

    def completed(self, search: Search, best: ScoredModel) -> ScoredModel:
        """With further causes, as long as each pays with the noise that it leaves.

        Those that then are as likely are refitted with that noise and make the search's hypotheses.
        """
        if not best.labels:
            return best
        fitter = search.fitter
        while True:
            for effect in search.effects:
                if effect.label not in best.labels:
                    _with(search, best, effect)
            more = [r for labels, r in search.tried.items() if labels > best.labels]
            top = min(more, key=lambda r: _worth(search, r), default=best)
            if _worth(search, top) >= _worth(search, best):
                break
            best = top
        near = [r for r in search.tried.values() if r.labels and _worth(search, r) < _worth(search, best) + RIVAL]
        fitter.forward.observed = with_noise_found(fitter.forward.observed, best.fit)
        fitter.weigh(best.fit.evaluation)
        m = len(fitter.nuisances)
        search.null = best_fit(fitter, (), search.null.evaluation.z[:m], []) or search.null
        again = [best_fit(fitter, r.fit.hypothesis, r.fit.evaluation.z[:m], r.fit.values) for r in near]
        hypotheses = [search.ranked(fit) for fit in (search.null, *again) if fit is not None]
        search.tried = {r.labels: r for r in hypotheses}
        return min((r for r in hypotheses if r.labels), key=lambda r: r.criterion)

    def hold_out(self, fitter: LeastSquaresProblem, null: Fit) -> HoldOut:
        """Every third mark in turn."""
        return hold_out(fitter, null, split_of_marks(fitter.forward.observed))

    def critical_points(self, fitter: LeastSquaresProblem, null: Fit, fit: Fit) -> list[CriticalPointRow]:
        """The column's largest load, where the readings fall again behind it."""
        forward = ColumnForward(fitter.forward.observed)
        observed = forward.observed
        on = observed.present[:, 0]
        read = -observed.measured[on, 0]
        predicted = read + fit.evaluation.residual[on, 0]
        tops = [int(np.argmax(load)) for load in (read, predicted)]
        turned = [top < len(read) - 2 for top in tops]
        euler = float(forward.evaluate_nominal(np.zeros(1))[0])
        largest = float(predicted[tops[1]]) if turned[1] else None
        onset = forward.first_yield(fit.parameters, fit.evaluation.z, fit.hypothesis, handbook=True)
        return [
            CriticalPointRow(
                posture=str(observed.readings.posture[0]),
                direction="compression",
                reached_N=float(read[tops[0]]),
                measured_N=float(read[tops[0]]) if turned[0] else None,
                before_N=euler,
                after_N=largest,
                nominal="bifurcation",
                nominal_N=euler,
                extended="limit" if turned[1] else "",
                extended_N=largest,
                yields_N=None if onset is None else onset[0],
                yields=forward.yield_unknown() if onset is None else f"at {onset[1]:.3g} mm of deflection",
            )
        ]

    def parameters(
        self, fitter: LeastSquaresProblem, fit: Fit, values: Mapping[str, ValueRow]
    ) -> dict[str, ValueRow | str]:
        """Where the column begins to yield, and from where on that shows."""
        result: dict[str, ValueRow | str] = {}
        forward = ColumnForward(fitter.forward.observed)
        onset = forward.first_yield(fit.parameters, fit.evaluation.z, fit.hypothesis)
        if onset is not None:
            stress = values["plasticity.yield_stress_MPa"]
            std = abs(onset[0]) * stress.std / stress.value
            ends = [onset[0] - NORMAL_95 * std, onset[0] + NORMAL_95 * std]
            result[FIRST_YIELD] = ValueRow(value=onset[0], std=std, interval95=ends)
            result[HANDBOOK] = forward.handbook_yield()
        departs = forward.departs(fit)
        if departs is not None:
            result[DEPARTS] = f"{departs:.3g}, where yield takes a hundredth of the load"
        return result

    def scatter(self, observed: Observed) -> str:
        """Where loads at marks scatter more than the sheet says: the residual is not explained, only bounded."""
        sheet = observed.measurement.sheet
        said, noise = float(sheet.sigma(WRENCH[0]).noise), float(observed.noise.wrench[0])
        if noise < MANY * said:
            return ""
        return (
            f"the residual scatters by {noise:.3g} N of load, {noise / said:.2g} times the sheet's noise: so much "
            "of the curve no cause explains"
        )

    def next_experiment(self, fitter: LeastSquaresProblem, verdict: Verdict) -> ExperimentRow:
        """Of the direct measurements the one that would show most, of a cause that not all members have."""
        observed = fitter.forward.observed
        common = frozenset.intersection(*(member.causes for member in verdict.members))
        load, posture = float(np.nanmax(np.abs(observed.measured[:, 0]))), str(observed.readings.posture[0])
        ways = [
            way
            for member in verdict.members
            for cause in sorted(member.causes - common)
            if (way := direct(observed.measurement, posture, cause, estimates(fitter, member.fit), load))
        ]
        if not ways:
            why = "turned over, a bow changes sides while errors of the instruments and the stiffness stay"
            return ExperimentRow(
                why=why, posture=posture, path="the same marks with the specimen turned half a turn"
            )
        return max(ways, key=lambda way: (way.difference is not None, way.strength or 0.0))


STARTS = numerical(2)
"""Of the trials of causes together, from which they are fitted."""


class JointTest(RampTest):
    """The kind of a test of one joint; see `vjm_updating.inference.joint_forward`.

    A geared joint that is loaded through zero has some of everything: a third cause costs no more than a second.
    """

    name = "joint"
    predictor = JointForward
    # a law is read over its own torque and turn, which are what the discrepancy's shapes go with
    costs = Costs(third=0.0, off_sheet=True, other_shapes=False)
    takes_effects = False

    def applies(self, measurement: Measurement) -> bool:
        """Where the sheet says so."""
        return measurement.sheet.kind == "joint"

    def observe(self, measurement: Measurement) -> Observed:
        """All readings with a motion and a load."""
        return observe_joint(measurement)

    def effects(self, observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
        """The joint's own, and the instruments'; effects of a file are made for chains and are not taken."""
        motion = next(iter(observed.slots))
        largest = {unit_of(motion): float(np.abs(observed.imposed[:, 0]).max())}
        largest[unit_of(observed.columns[0])] = float(np.nanmax(np.abs(observed.measured)))
        duration = 0.0 if observed.clock is None else float(np.ptp(observed.clock))
        return [*joint_effects(observed), *instrument_effects(observed, duration, largest)]

    def completed(self, search: Search, best: ScoredModel) -> ScoredModel:
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
            candidate = search.kept(begun_anew(search.fitter, fit))
            while len(candidate.labels) > 1:
                less = [one for effect in candidate.fit.hypothesis for one in without(search, candidate, effect)]
                top = min(less, key=lambda r: r.criterion, default=candidate)
                if top.criterion >= candidate.criterion:
                    break
                candidate = top
            if candidate.criterion < best.criterion and search.significant(candidate):
                best = candidate
        return best

    def parameters(
        self, fitter: LeastSquaresProblem, fit: Fit, values: Mapping[str, ValueRow]
    ) -> dict[str, ValueRow | str]:
        """Of a gear whose second kink no reading reached, that it was not."""
        observed = fitter.forward.observed
        return dict.fromkeys(not_reached(observed, values), "not reached by the test")

    def critical_points(self, fitter: LeastSquaresProblem, null: Fit, fit: Fit) -> list[CriticalPointRow]:
        """A joint has none."""
        return []

    def next_experiment(self, fitter: LeastSquaresProblem, verdict: Verdict) -> ExperimentRow:
        """Of the load's scale the cell itself tells; of the rest both directions and larger loads."""
        observed = fitter.forward.observed
        causes = {cause for member in verdict.members for cause in member.causes}
        effort = observed.columns[0]
        if "instrument_scale" in causes:
            why = "a scale error and a stiffness change the slope alike"
            path = f"{effort} under known weights alone"
        else:
            why = "backlash, friction and hardening differ where the load turns round and where it is largest"
            path = "both directions through zero in fine steps, twice, to a larger load"
        return ExperimentRow(why=why, posture=observed.measurement.drive.name, path=path)


def together(fitter: LeastSquaresProblem, null: Fit, effects: Sequence[Effect]) -> Fit | None:
    """The best fit of causes together, begun where their trials lead in a step; None where none stands."""
    m, hypothesis = len(fitter.nuisances), tuple(effects)
    unknowns = coordinates(fitter.nuisances, hypothesis)
    trials = [list(effect.trials()) for effect in effects]
    ways = []
    for k in range(max(map(len, trials), default=0)):
        z = start(unknowns, hypothesis, null.evaluation.z[:m], [own[k % len(own)] for own in trials])
        ways.append(after_a_step(fitter, hypothesis, unknowns, z))
    fits = [
        best_fit(fitter, hypothesis, z[:m], values_of(unknowns, z, hypothesis))
        for _, z in sorted(ways, key=lambda way: way[0])[:STARTS]
    ]
    return min((fit for fit in fits if fit is not None), key=lambda fit: fit.objective, default=None)


def not_reached(observed: Observed, values: Mapping[str, ValueRow]) -> list[str]:
    """Parameters of a gear's slopes beyond the largest load of a test: by their names, K3 and T2."""
    own = f"{JointThreeSlopes.cause}."
    names = {number: [n for n in values if n.startswith(f"{own}{number}_")] for number in ("T2", "K3")}
    lever, _, of_load = levers_of(observed.measurement)
    largest = float(np.nanmax(np.abs(observed.measured))) / of_load * lever
    beyond = any(values[name].value >= largest for name in names["T2"])
    return [*names["T2"], *names["K3"]] if beyond else []


def without(search: Search, ranked: ScoredModel, effect: Effect) -> list[ScoredModel]:
    """Hypotheses with one cause less, which the search then knows, and with a linear spring in place of another."""
    fit, m = ranked.fit, len(search.fitter.nuisances)
    kept = [(e, v) for e, v in zip(fit.hypothesis, fit.values, strict=True) if e != effect]
    ways = [kept] if kept else []
    if isinstance(effect, JointHardening | JointThreeSlopes):
        linear = [e for e in search.effects if isinstance(e, JointCompliance)]
        ways += [[*kept, (e, list(e.trials()[0]))] for e in linear]
    fits = (
        best_fit(search.fitter, tuple(e for e, _ in way), fit.evaluation.z[:m], [v for _, v in way]) for way in ways
    )
    return [search.kept(one) for one in fits if one is not None]


def joint_effects(observed: Observed) -> list[Effect]:
    """What a joint under test may have: another stiffness, hardening, friction; backlash by loads to both sides."""
    joint = observed.measurement.drive
    lever, of_motion, of_load = levers_of(observed.measurement)
    compliance = observed.measurement.joint_compliance
    force = float(np.nanmax(np.abs(observed.measured))) / of_load
    reach = float(np.abs(observed.imposed[:, 0]).max()) * of_motion / lever
    own = drive_of(joint, compliance=compliance, lever=lever, force=force)
    backlash = [] if one_sided(observed.measurement) else [ActuatorBacklash(force, joint.name, own)]
    return [
        JointCompliance(joint.name, own),
        JointHardening(force, own.compliance, joint.name, own),
        JointThreeSlopes(force, own.compliance, joint.name, own),
        *backlash,
        DriveFriction(force * lever, reach, joint.slides, joint.name),
    ]


class LoadTest(RampTest):
    """The kind of a test by force; see `vjm_updating.inference.observed`."""

    name = "loads"
    predictor = LoadForward

    def applies(self, measurement: Measurement) -> bool:
        """Where loads were imposed on a machine that bears them, or its pose is not wholly known."""
        return measurement.loaded

    def observe(self, measurement: Measurement) -> Observed:
        """All readings with every load and a displacement."""
        return observe_loads(measurement)

    def effects(self, observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
        """Those of a machine under loads, and the instruments'.

        Friction in passive joints is not asked: its law is that of an imposed displacement. The machine's own
        weight is where the whole pose was read, which counts from the unloaded one; gauges are set when it has
        acted.
        """
        size = {"N": np.abs(observed.imposed[:, :3]).max(), "Nmm": np.abs(observed.imposed[:, 3:]).max()}
        for unit in ("mm", "rad"):
            own = [c for c, name in enumerate(observed.columns) if unit_of(name) == unit]
            size[unit] = np.nanmax(np.abs(observed.measured[:, own]), initial=0.0)
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
        effects = [
            effect
            for effect in catalogue(scene, more)
            if type(effect).friction is Effect.friction and (weighs or not isinstance(effect, Gravity))
        ]
        return [*effects, *instrument_effects(observed, scene.duration, largest)]

    def critical_points(self, fitter: LeastSquaresProblem, null: Fit, fit: Fit) -> list[CriticalPointRow]:
        """None: nothing was loaded beyond its stability."""
        return []

    def next_experiment(self, fitter: LeastSquaresProblem, verdict: Verdict) -> ExperimentRow:
        """More gauges: candidates differ in what moves where."""
        observed = fitter.forward.observed
        return ExperimentRow(
            why=f"what {', '.join(observed.columns)} read does not tell the candidates apart",
            posture=str(observed.readings.posture[0]),
            path="the same loads with gauges at points between support and load, or on rotations; or another load",
        )


KINDS: tuple[RampTest, ...] = (JointTest(), ColumnTest(), LoadTest(), RampTest())
"""Each is asked in turn whether a test is of its kind; the last one takes every test."""


def kind_of(measurement: Measurement) -> RampTest:
    """The kind of a test."""
    return next(kind for kind in KINDS if kind.applies(measurement))
