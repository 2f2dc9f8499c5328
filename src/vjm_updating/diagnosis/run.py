"""The diagnosis of a test of ramps, of a column, by loads or of a joint, from its first fit to its findings."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from vjm import __version__
from vjm.io.findings import Finding
from vjm_output.documents import doubt_rows
from vjm_updating.constants import numerical, prior_scale, shown
from vjm_updating.diagnosis.contrasts import contrasts
from vjm_updating.diagnosis.document import (
    AlternativeRow,
    CandidateRow,
    CriticalForceRow,
    CriticalPointRow,
    Diagnosis,
    ExperimentRow,
    NoiseRow,
    ValueRow,
    VersionRow,
)
from vjm_updating.diagnosis.estimates import estimates, joined, nuisance_estimates
from vjm_updating.diagnosis.evidence import effective_samples
from vjm_updating.diagnosis.extended import extended_text
from vjm_updating.diagnosis.kinds import kind_of
from vjm_updating.diagnosis.mistaken import unless_unexplained, with_mistakes
from vjm_updating.diagnosis.preprocess import Prepared, possible, prepare, refresh
from vjm_updating.diagnosis.ramp_kind import RampTest
from vjm_updating.diagnosis.scored_hypothesis import Ranked
from vjm_updating.diagnosis.search import Search
from vjm_updating.diagnosis.transfer import transfer
from vjm_updating.diagnosis.verdict import Verdict, judge, proved
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.mistakes import corrected, mistakes_of
from vjm_updating.experiment.plausibility import considered
from vjm_updating.inference.fitting import Fit
from vjm_updating.mechanisms.catalogue import Maker, plug_in
from vjm_updating.result import EXTENDED, DiagnosisResult

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
    *,
    effects: Sequence[Path | Maker] = (),
    only: Sequence[str] = (),
    without: Sequence[str] = (),
    beside: Measurement | None = None,
    strict: bool = False,
    warn: Callable[[Sequence[Finding]], None] = lambda _: None,
    progress: Callable[[str], None] = lambda _: None,
) -> DiagnosisResult[Diagnosis]:
    """Diagnose a test of ramps, of a column, by loads or of a joint; arguments as of `vjm_updating.diagnose`.

    Here ``beside`` is a test of another specimen, of which is said what the findings are worth there. Errors are as
    of that function.
    """
    begun = time.perf_counter()
    more = [plug_in(one) if isinstance(one, Path) else one for one in effects]
    findings = considered(measurement, strict=strict)
    mistakes = mistakes_of(findings)
    measurement = corrected(measurement, mistakes)
    kind = kind_of(measurement)
    if beside is not None and kind_of(beside) is not kind:
        raise ValueError(
            f"--beside {beside.readings.file}: is another kind of test than {measurement.readings.file}"
        )
    observed = kind.observe(measurement)
    possible(kind.effects(observed, more), only, without)
    warn(findings)
    progress("the nominal model")
    prepared = prepare(observed, more, only=only, without=without)
    search = _search(prepared, kind, progress)
    best = search.run()
    prepared = replace(prepared, null=search.null)
    for _ in range(AGAIN):
        # seen from a model that was off, noise and outliers were guesses
        again = refresh(prepared, best.fit)
        if again is None:
            break
        prepared = again
        before, search = best, replace(_search(prepared, kind, progress), known=search.tried)
        best = search.run()
        prepared = replace(prepared, null=search.null)
        if best.labels == before.labels:
            break
    best = kind.completed(search, best)
    prepared = replace(prepared, null=search.null)
    progress("verdict")
    verdict, candidates, points = _proved(prepared, kind, unless_unexplained(judge(search, best), mistakes))
    document = _document(measurement, prepared, kind, verdict, candidates, points, begun)
    if beside is not None:
        document = document.model_copy(
            update={"transfer": [row for member in verdict.members for row in transfer(member.fit, beside)]}
        )
    document = with_mistakes(document, mistakes).model_copy(update={"doubts": doubt_rows(findings)})
    progress("report")
    chosen = verdict.members[0].fit if verdict.members else prepared.null
    found = estimates(prepared.fitter, chosen, 0.0)
    model = extended_text(measurement, prepared.fitter, chosen, verdict.kind, found)

    def page(document: Diagnosis) -> str:
        # matplotlib takes a second to import, and is an extra
        from vjm_updating.diagnosis.page import write_page

        return write_page(measurement, prepared, chosen, document)

    return DiagnosisResult(document, {EXTENDED: model}, page)


def _search(prepared: Prepared, kind: RampTest, progress: Callable[[str], None]) -> Search:
    fitter = prepared.fitter
    samples = effective_samples(fitter.whitening.autoregression, fitter.whitening.present)
    return Search(
        fitter, prepared.null, prepared.effects, samples, progress, signed=prepared.signed, costs=kind.costs
    )


def _proved(
    prepared: Prepared, kind: RampTest, verdict: Verdict
) -> tuple[Verdict, list[CandidateRow], list[CriticalPointRow]]:
    """The verdict judged by what its members predict of readings held out, and the first's critical points."""
    null = prepared.null
    if not verdict.members:
        return verdict, [], kind.critical_points(prepared.fitter, null, null)
    hold_out = kind.hold_out(prepared.fitter, null)
    points = [kind.critical_points(prepared.fitter, null, member.fit) for member in verdict.members]
    gains = [
        hold_out(member.fit).model_copy(update={"critical": own[0].forces if own else CriticalForceRow()})
        for member, own in zip(verdict.members, points, strict=True)
    ]
    first = gains[0]
    verdict = proved(verdict, first.before_in_sigma, first.after_in_sigma, first.expected_in_sigma)
    if not verdict.members:
        return verdict, [], kind.critical_points(prepared.fitter, null, null)
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
        residual=_residual_words(verdict) or kind.scatter(observed),
        contrasts=contrasts(fitter, prepared.null)[:SHOWN],
        noise=NoiseRow(
            autocorrelation={name: float(neighbours[k]) for name, k in channels.items()},
            outliers=observed.outliers,
            readings=len(observed.pose),
        ),
        nuisances=nuisance_estimates(fitter, chosen),
        critical=list(points),
        seconds=time.perf_counter() - begun,
    )


def _residual_words(verdict: Verdict) -> str:
    if verdict.kind != "unknown":
        return ""
    if verdict.doubt:
        return verdict.doubt
    rest = verdict.rest
    if rest.prior_p < rest.p:
        return f"what fits best takes {rest.farthest}"
    return f"the residual has the shape '{rest.worst or 'rough'}', strength {rest.left**0.5:.1f}"


def _values(prepared: Prepared, kind: RampTest, fit: Fit, places: Sequence[Ranked]) -> dict[str, ValueRow | str]:
    elsewhere = [estimates(prepared.fitter, place.fit, 0.0) for place in places]
    found = joined(estimates(prepared.fitter, fit, 0.0), elsewhere)
    result = {**found, **kind.parameters(prepared.fitter, fit, found)}
    for effect in fit.hypothesis:
        if effect.part and not any(name.startswith(f"{effect.cause}.{effect.part}") for name in result):
            other = [e.part for place in places for e in place.fit.hypothesis if e.cause == effect.cause]
            result[f"{effect.cause}.part"] = " or ".join(dict.fromkeys([effect.part, *other]))
    return result
