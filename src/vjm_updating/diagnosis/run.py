"""The diagnosis of a test of ramps, of a column, by loads or of a joint, from its first fit to its findings."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vjm import __version__
from vjm.errors import NoConvergenceError
from vjm.io.findings import Finding
from vjm.rotations import Array
from vjm_output.documents import VersionRow, doubt_rows
from vjm_updating.calibration.calibrated_model import extended_text
from vjm_updating.constants import numerical, prior_scale, shown
from vjm_updating.diagnosis.discrepancy import law_covariance
from vjm_updating.diagnosis.document import (
    AlternativeRow,
    CandidateRow,
    CauseRow,
    ContrastRow,
    CriticalForceRow,
    CriticalPointRow,
    Diagnosis,
    ExperimentRow,
    NoiseRow,
    TransferRow,
    ValueRow,
    Word,
    words,
)
from vjm_updating.diagnosis.evidence import ScoredModel, effective_samples, estimates, joined, nuisance_estimates
from vjm_updating.diagnosis.kinds import kind_of
from vjm_updating.diagnosis.preprocess import Prepared, critical_points, possible, prepare, refresh, unpredicted
from vjm_updating.diagnosis.ramp_kind import RampTest, behind
from vjm_updating.diagnosis.screening import projection
from vjm_updating.diagnosis.search import RIVAL, Search
from vjm_updating.diagnosis.verdict import Verdict, judge, predicts_worse, proved, withdrawn
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.mistakes import TITLES, Mistake, corrected, mistakes_of
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem
from vjm_updating.inference.forward import Predictor
from vjm_updating.inference.model_error import driven_place, loading
from vjm_updating.inference.observed import Observed
from vjm_updating.inference.parameters import (
    EffectParameter,
    FitParameter,
    Hypothesis,
    coordinates,
    nuisance_coordinates,
    release_key,
)
from vjm_updating.inference.significance import FALSE_ALARMS
from vjm_updating.mechanisms.catalogue import Maker, plug_in
from vjm_updating.result import EXTENDED, DiagnosisResult

# --- What a diagnosis of one specimen says of another: its findings taken over one by one, nothing fitted anew ----


def transfer(fit: Fit, other: Measurement) -> list[TransferRow]:
    """Errors of another test's readings under what a fit has found: nothing of it, each cause, tolerances, all.

    Raises:
        ValueError: the other test cannot be used.
    """
    kind = kind_of(other)
    observed = kind.observe(other)
    forward = kind.forward(observed)
    causes = sorted({effect.cause for effect in fit.hypothesis})

    def row(what: str, chosen: Sequence[int], *, nuisances: bool) -> TransferRow:
        value = _values_there(fit, set(chosen), nuisances=nuisances)
        rmse, unit = _error(forward, observed, tuple(fit.hypothesis[i] for i in chosen), value)
        return TransferRow(causes=causes, what=what, rmse=rmse, unit=unit)

    every = range(len(fit.hypothesis))
    return [
        row("nothing: the sheet's own model", (), nuisances=False),
        *(row(effect.cause, (i,), nuisances=False) for i, effect in enumerate(fit.hypothesis)),
        *([row("zeros, scales and tolerances", (), nuisances=True)] if causes else []),
        row("all of it", every, nuisances=True),
    ]


def _values_there(fit: Fit, chosen: set[int], *, nuisances: bool) -> Callable[[FitParameter], float]:
    """A coordinate's value: that of the chosen causes and, if so, of the nuisances that no cause has released."""
    freed = {release_key(fit.hypothesis[i]) for i in chosen}
    all_freed = {release_key(effect) for effect in fit.hypothesis}
    order = {str(i): str(k) for k, i in enumerate(sorted(chosen))}
    known: dict[tuple[str, str, str], float] = {}
    for c, z in zip(fit.parameters, fit.evaluation.z, strict=True):
        if isinstance(c, EffectParameter):
            if c.subject in order:
                known[c.kind, order[c.subject], c.quantity.name] = c.value(float(z))
        elif (c.kind, c.subject) in freed or (nuisances and (c.kind, c.subject) not in all_freed):
            known[c.kind, c.subject, ""] = c.value(float(z))

    def value(c: FitParameter) -> float:
        return known.get((c.kind, c.subject, c.quantity.name if isinstance(c, EffectParameter) else ""), 0.0)

    return value


def _error(
    forward: Predictor, observed: Observed, hypothesis: Hypothesis, value: Callable[[FitParameter], float]
) -> tuple[float | None, str]:
    """Error of the readings under given values and its unit, see `Observed.scored`; None where nothing stands."""
    unknowns = coordinates(nuisance_coordinates(observed), hypothesis)
    z = np.array([c.coordinate(value(c)) for c in unknowns])
    own, unit = observed.scored
    try:
        evaluation = forward.evaluate(unknowns, z, hypothesis)
    except NoConvergenceError:
        return None, unit
    return float(np.sqrt(np.mean(evaluation.residual[:, own][observed.present[:, own]] ** 2))), unit


# --- Mistakes of the instruments in a diagnosis, named beside the causes found in the readings without them -------
#
# A factor near that between two units, or a sign, may as well be a machine's. So a mistake is named only where the
# readings without it leave no more than noise. Else it is a guess beside `unknown`.


def unless_unexplained(verdict: Verdict, mistakes: Sequence[Mistake]) -> Verdict:
    """The verdict on readings whose mistakes were undone; unknown where these still leave more than noise."""
    rest = verdict.rest
    if not mistakes or verdict.kind == "unknown" or min(rest.p, rest.prior_p) >= FALSE_ALARMS:
        return verdict
    left = f"takes {rest.farthest}" if rest.prior_p < rest.p else f"leaves {rest.worst or 'a rough residual'}"
    doubt = f"a mistake of the instruments alone is a guess: without it what fits best {left}"
    return replace(withdrawn(verdict, doubt), more_than_noise=True, within_law_error=False)


def with_mistakes(document: Diagnosis, mistakes: Sequence[Mistake]) -> Diagnosis:
    """A diagnosis of corrected readings as one of the readings as they were.

    A mistake is exact, a factor between units or a sign; it has no standard deviation. Where nothing else is found,
    the mistakes are the verdict. Where the residual is unknown, it stays so, and the mistakes are in its words and
    beside each alternative.
    """
    if not mistakes:
        return document
    causes = sorted({mistake.cause for mistake in mistakes})
    parameters: dict[str, ValueRow | str] = {}
    for mistake in mistakes:
        if mistake.order:
            parameters[f"{mistake.cause}.columns"] = " and ".join(mistake.order)
        for name, value in mistake.parameters.items():
            parameters[name] = ValueRow(value=value, std=0.0, interval95=[value, value])
    findings = document.findings
    if findings.trusted:
        # found before anything was fitted, and named where the readings without it leave noise alone
        rows_of = [CauseRow(cause=cause, probability=1.0, share=None, word=Word.ACTS) for cause in causes]
        findings = findings.model_copy(update={"causes": [*rows_of, *findings.causes], "nothing": 0.0})
        document = document.model_copy(update={"findings": findings.model_copy(update={"words": words(findings)})})
    undone = "undone before anything was fitted: " + ", ".join(TITLES[cause] for cause in causes)
    residual = "; ".join(text for text in (document.residual, undone) if text)
    changed: dict[str, object] = {"residual": residual}
    if document.verdict == "unknown":
        changed["alternatives"] = [
            row.model_copy(update={"causes": sorted({*row.causes, *causes})}) for row in document.alternatives
        ] or [AlternativeRow(causes=causes, places=causes, confidence=1.0 - document.confidence)]
        return document.model_copy(update=changed)
    if document.verdict == "none":
        candidates = [CandidateRow(causes=causes, probability=1.0, parameters=parameters, gain=None)]
        changed["verdict"] = "named"
    else:
        candidates = [
            row.model_copy(
                update={"causes": sorted({*row.causes, *causes}), "parameters": parameters | row.parameters}
            )
            for row in document.candidates
        ]
    changed |= {"candidates": candidates, "parameters": candidates[0].parameters}
    return document.model_copy(update=changed | {"causes": sorted({*document.causes, *causes})})


# --- The residual of the nominal model taken apart into contrasts that a person can read, and how sure each is


def contrasts(fitter: LeastSquaresProblem, null: Fit) -> list[ContrastRow]:
    """Every contrast that the data allow, the most significant first."""
    observed = fitter.forward.observed
    space = projection(fitter, null)
    result = []
    for name, column in _columns(fitter, null):
        for c, channel in enumerate(observed.columns):
            if not observed.present[:, c].any():
                continue
            raw = np.zeros(observed.present.shape)
            raw[:, c] = column
            free = np.concatenate([fitter.whitening.flat(raw), np.zeros(len(space.residual) - space.rows)])
            rest = space.rest(free[:, None])[:, 0]
            square = float(rest @ rest)
            if square < 1e-4 * float(free @ free) or square == 0.0:
                continue
            along = float(rest @ space.residual)
            result.append(
                ContrastRow(name=name, channel=channel, size=along / square, significance=along / square**0.5)
            )
    return sorted(result, key=lambda contrast: -abs(contrast.significance))


def _columns(fitter: LeastSquaresProblem, null: Fit) -> list[tuple[str, Array]]:
    """What is compared with what, as a column ``(n,)`` that changes by one between them."""
    observed = fitter.forward.observed
    place, way = driven_place(observed), loading(observed)
    columns: list[tuple[str, Array]] = []
    if (way > 0.0).any() and (way < 0.0).any():
        columns.append(("way out against way back, along the ramp", 0.5 * way * np.sign(place)))
        columns.append(("way out against way back", 0.5 * way))
    if (place > 0.2).any() and (place < -0.2).any():
        columns.append(("pull against push", 0.5 * np.sign(place)))
        columns.append(("largest displacement, alike in pull and push", np.abs(place)))
    columns.append(("curvature along the ramp", np.sign(place) * place**2))
    labels = list(dict.fromkeys(observed.readings.posture.tolist()))
    if len(labels) > 1:
        for label in labels:
            on = observed.readings.posture == label
            columns.append((f"posture {label}: offset against the others", on.astype(float)))
            columns.append((f"posture {label}: slope against the others", np.where(on, place, 0.0)))
    runs = np.unique(observed.readings.run)
    if len(runs) > 1:
        columns.append(("last cycle against the first", (observed.readings.run - runs[0]) / (runs[-1] - runs[0])))
    held = _since_held(way)
    if held.max(initial=0.0) > 1:
        columns.append(("decay while held, along the ramp", np.sign(place) * np.log1p(held) / np.log1p(held.max())))
    if observed.clock is not None:
        columns.append(("with the clock", observed.clock / np.ptp(observed.clock)))
    if observed.warmth is not None:
        columns.append(("with the temperature", observed.warmth / np.ptp(observed.warmth)))
    far = behind(observed, null.evaluation)
    if far.any() and not far.all():
        columns.append(("after against before the critical point", far.astype(float)))
    return columns


def _since_held(way: Array) -> Array:
    count = np.zeros(len(way))
    for k in range(1, len(way)):
        count[k] = count[k - 1] + 1.0 if way[k] == 0.0 else 0.0
    return count


AGAIN = numerical(2)
"""Searches more at most, each about what the last one found."""
NOISE_ALONE = prior_scale(0.5)
"""Prior probability, even odds, that scatter far beyond what a sheet says of its instruments is noise, not a cause
outside the catalogue: both may be of any size, so that no reading tells. Beside such a cause no verdict would be
right; so the probability that one is, is this times that where the scatter is noise."""
SHOWN = shown(12)
"""Contrasts that are kept."""


def diagnose_ramps(
    measurement: Measurement,
    considered: Callable[[], list[Finding]],
    warn: Callable[[Sequence[Finding]], None],
    *,
    effects: Sequence[Path | Maker] = (),
    only: Sequence[str] = (),
    without: Sequence[str] = (),
    beside: Measurement | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> DiagnosisResult[Diagnosis]:
    """Diagnose a test of ramps, of a column, by loads or of a joint; arguments as of `vjm_updating.diagnose`.

    Here ``beside`` is a test of another specimen, of which is said what the findings are worth there, and
    ``considered`` says what is implausible about this one, and ``warn`` tells it. Errors are as of that function.
    """
    begun = time.perf_counter()
    more = [plug_in(one) if isinstance(one, Path) else one for one in effects]
    findings = considered()
    mistakes = mistakes_of(findings)
    measurement = corrected(measurement, mistakes)
    kind = kind_of(measurement)
    if effects and not kind.takes_effects:
        raise ValueError(
            f"{measurement.sheet.file}: --effects is for ramps and loads, and this is a test of a {kind.name}"
        )
    if beside is not None and kind_of(beside) is not kind:
        raise ValueError(
            f"--beside {beside.readings.file}: is another kind of test than {measurement.readings.file}"
        )
    observed = kind.observe(measurement)
    possible(kind.effects(observed, more), only, without)
    warn(findings)
    progress("the nominal model")

    def judged(*, near: bool) -> tuple[Prepared, Verdict, list[CandidateRow], list[CriticalPointRow]]:
        prepared, search, best = _refined(first, kind, progress, near=near)
        progress("verdict")
        return prepared, *_proved(prepared, kind, unless_unexplained(judge(search, best), mistakes))

    first = _searched(prepare(observed, more, only=only, without=without), kind, progress)
    prepared, verdict, candidates, points = judged(near=True)
    worse = verdict.doubt or any(row.gain is not None and predicts_worse(row.gain) for row in candidates[:1])
    if worse and (prepared.critical & ~prepared.aside).any():
        # what readings near a critical point show, and others do not bear out, is no cause but an imperfection
        prepared, verdict, candidates, points = judged(near=False)
    document = _document(measurement, prepared, kind, verdict, candidates, points, begun)
    if beside is not None:
        document = document.model_copy(
            update={"transfer": [row for member in verdict.members for row in transfer(member.fit, beside)]}
        )
    document = with_mistakes(document, mistakes).model_copy(update={"doubts": doubt_rows(findings)})
    progress("report")
    chosen = verdict.members[0].fit if verdict.members else prepared.null
    model = ""
    # what no cause explains is made up for by lengths and moduli: such a machine predicts nothing
    if verdict.kind != "unknown":
        values = _estimates(prepared, kind, chosen)
        model = extended_text(measurement, prepared.fitter, chosen, verdict.kind, values)

    def page(document: Diagnosis) -> str:
        # matplotlib takes a second to import, and is an extra
        from vjm_updating.diagnosis.page import write_page

        return write_page(measurement, prepared, chosen, document)

    return DiagnosisResult(document, {EXTENDED: model}, page)


def _searched(
    prepared: Prepared,
    kind: RampTest,
    progress: Callable[[str], None],
    known: Mapping[frozenset[str], ScoredModel] | None = None,
    begun: Sequence[ScoredModel] = (),
) -> tuple[Prepared, Search, ScoredModel]:
    """A search and its best; what an earlier one found is ``known``, and it goes on from what is ``begun``."""
    fitter = prepared.fitter
    samples = effective_samples(fitter.whitening.autoregression, fitter.whitening.present)
    search = Search(
        fitter, prepared.null, prepared.effects, samples, progress, known or {}, prepared.signed, kind.costs
    )
    best = search.run(begun)
    return replace(prepared, null=search.null), search, best


def _refined(
    first: tuple[Prepared, Search, ScoredModel], kind: RampTest, progress: Callable[[str], None], *, near: bool
) -> tuple[Prepared, Search, ScoredModel]:
    """The search about the noise that its own best shows, and the best.

    The ``first`` went without the readings near a critical point. As soon as a search without them leaves noise
    alone, the next one goes on with them from what is then likely, unless it is not to go ``near``. Where that
    leaves more, those that no likely hypothesis predicts stay aside.
    """
    prepared, search, best = first
    against, settled, more = not near, False, AGAIN
    while True:
        take_in = near and bool(prepared.aside.any()) and not search.is_wrong(search.rest(best.fit))
        if not take_in and (settled or more <= 0):
            break
        # seen from a model that was off, noise and outliers were guesses
        again = refresh(prepared, best.fit, prepared.aside & (not take_in))
        if again is None:
            break
        before, known = best, search.tried
        # the best first: a search takes up a few
        likely = sorted(
            (r for r in known.values() if r.criterion < best.criterion + RIVAL), key=lambda r: r.criterion
        )
        begun = likely if take_in and best.labels else []
        prepared, search, best = _searched(again, kind, progress, known, begun)
        if take_in and search.is_wrong(search.rest(best.fit)):
            against = True
            aside = unpredicted(prepared, [r.fit for r in likely])
            again = refresh(prepared, before.fit, aside) if aside.any() else None
            if again is not None:
                prepared, search, best = _searched(again, kind, progress, known, begun)
            break
        settled, more = best.labels == before.labels, more - 1
    best = search.begun_anew(kind.completed(search, best))
    return replace(prepared, null=search.null, held_against=against), search, best


def _proved(
    prepared: Prepared, kind: RampTest, verdict: Verdict
) -> tuple[Verdict, list[CandidateRow], list[CriticalPointRow]]:
    """The verdict judged by what its members predict of readings held out, and the first's critical points."""
    null = prepared.null
    if not verdict.members:
        return verdict, [], critical_points(prepared, null)
    hold_out = kind.hold_out(prepared.fitter, null)
    points = [critical_points(prepared, member.fit) for member in verdict.members]
    gains = [
        hold_out(member.fit).model_copy(update={"critical": own[0].forces if own else CriticalForceRow()})
        for member, own in zip(verdict.members, points, strict=True)
    ]
    verdict = proved(verdict, gains[0])
    if not verdict.members:
        return verdict, [], critical_points(prepared, null)
    candidates = [
        CandidateRow(
            causes=sorted(m.causes),
            places=sorted({e.place for e in m.fit.hypothesis}),
            probability=p,
            parameters=_values(prepared, kind, m.fit, places),
            gain=own,
        )
        for m, p, own, places in zip(verdict.members, verdict.probabilities, gains, verdict.places, strict=True)
    ]
    return verdict, candidates, points[0]


def _document(
    measurement: Measurement,
    prepared: Prepared,
    kind: RampTest,
    verdict: Verdict,
    candidates: Sequence[CandidateRow],
    points: Sequence[CriticalPointRow],
    begun: float,
) -> Diagnosis:
    fitter = prepared.fitter
    observed = fitter.forward.observed
    chosen = verdict.members[0].fit if verdict.members else prepared.null
    channels = {name: observed.columns.index(name) for name in observed.wrench_channels}
    neighbours = fitter.whitening.autoregression.neighbours
    return Diagnosis(
        verdict=verdict.kind,
        findings=verdict.findings,
        causes=sorted({cause for c in candidates for cause in c.causes}),
        candidates=list(candidates),
        parameters=candidates[0].parameters if candidates else {},
        confidence=verdict.confidence * (NOISE_ALONE if kind.scatter(observed) else 1.0),
        alternatives=[
            AlternativeRow(causes=sorted(r.causes), places=sorted(e.place for e in r.fit.hypothesis), confidence=w)
            for r, w in verdict.others
        ],
        gain=candidates[0].gain if candidates else None,
        next_experiment=kind.next_experiment(fitter, verdict) if verdict.kind == "class" else ExperimentRow(),
        version=VersionRow(
            package=__version__, model_sha256=measurement.chain.sha256, data_sha256=measurement.data_sha256
        ),
        residual="; ".join(
            text for text in (_residual_words(verdict) or kind.scatter(observed), aside_words(prepared)) if text
        ),
        contrasts=contrasts(fitter, prepared.null)[:SHOWN],
        noise=NoiseRow(
            autocorrelation={name: float(neighbours[k]) for name, k in channels.items()},
            outliers=observed.outliers,
            readings=len(observed.imposed),
            critical=int(prepared.aside.sum()),
        ),
        nuisances=nuisance_estimates(fitter, chosen),
        critical=list(points),
        seconds=time.perf_counter() - begun,
    )


def aside_words(prepared: Prepared) -> str:
    """How many readings a diagnosis left out near a critical point, and why; empty where it left out none."""
    count = int(prepared.aside.sum())
    if not count:
        return ""
    why = (
        "nothing that explains the others predicts them" if prepared.held_against else "nothing explains the others"
    )
    return f"{count} readings near a critical point are left out: {why}"


def _residual_words(verdict: Verdict) -> str:
    if verdict.kind != "unknown":
        return ""
    if verdict.doubt:
        return verdict.doubt
    rest = verdict.rest
    if rest.prior_p < rest.p:
        return f"what fits best takes {rest.farthest}"
    return f"the residual has the shape '{rest.worst or 'rough'}', strength {rest.left**0.5:.1f}"


def _estimates(prepared: Prepared, kind: RampTest, fit: Fit) -> dict[str, ValueRow]:
    """The parameters of a fit, its laws right to some per cent only."""
    explained = max(prepared.null.objective - fit.objective, 0.0)
    by_laws = law_covariance(prepared.fitter, fit, kind.costs.law_error, explained)
    return estimates(prepared.fitter, fit, by_laws)


def _values(
    prepared: Prepared, kind: RampTest, fit: Fit, places: Sequence[ScoredModel]
) -> dict[str, ValueRow | str]:
    elsewhere = [_estimates(prepared, kind, place.fit) for place in places]
    values = joined(_estimates(prepared, kind, fit), elsewhere)
    result = {**values, **kind.parameters(prepared.fitter, fit, values)}
    for effect in fit.hypothesis:
        if effect.part and not any(name.startswith(f"{effect.cause}.{effect.part}") for name in result):
            other = [e.part for place in places for e in place.fit.hypothesis if e.cause == effect.cause]
            result[f"{effect.cause}.part"] = " or ".join(dict.fromkeys([effect.part, *other]))
    return result
