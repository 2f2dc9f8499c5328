"""The words of a report: what a finding is, and sentences about metrics, iterations and the printed matrices."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf, isfinite
from statistics import median
from typing import Any

from vjm.continuation.path import EventKind
from vjm.model.load_case import Direction
from vjm.statics import TOLERANCE
from vjm_output.number_text import listed, missing, number, percent
from vjm_validation.studies.chain import LIMIT, LOOSE, NOISE, STEP_MM, IterationPoint, IterationStudy, Run
from vjm_validation.studies.table2 import PrintedMatrices

# --- What a finding is, and small pieces of sentences about the metrics of ``summary.json`` -----------------------

Metrics = Mapping[str, Any]
"""One engine's row: K0, K1, critical, F_cr, d_cr, K2, F_end, d_end, K3, each perhaps None."""

SHARP = (EventKind.BIFURCATION, EventKind.LIMIT)
"""Critical points that one can point at, unlike a stiffness knee."""


class Tone(StrEnum):
    """What a finding is about; the page marks each in its own way."""

    FAILED = "failed"
    AGREES = "agrees"
    DIFFERS = "differs"
    CAUSE = "cause"
    NOTE = "note"


@dataclass(frozen=True)
class ReportFinding:
    """One thing that the run shows.

    Attributes:
        tone: what it is about.
        title: one sentence.
        sentences: what stands behind it.
        chapter: of the page that proves it; empty where the sentences are all.
    """

    tone: Tone
    title: str
    sentences: tuple[str, ...]
    chapter: str = ""


def engine_metrics(run: Run, direction: Direction, label: str) -> dict[str, Metrics]:
    """Rows of one engine in one direction by posture."""
    chain: Mapping[str, Any] = run.summary.get("chain", {})
    rows = {posture: by.get(str(direction), {}).get(label) for posture, by in sorted(chain.items())}
    return {posture: row for posture, row in rows.items() if row is not None}


def at_critical(metrics: Metrics) -> str:
    """Kind and place of a critical point; engines that know no displacement there tell none."""
    place = "" if missing(metrics["d_cr"]) else f", {number(metrics['d_cr'])} mm"
    return f"{metrics['critical']} at {number(metrics['F_cr'])} N{place}"


def critical_points(metrics: Mapping[str, Metrics]) -> str:
    """Critical points of several postures."""
    return listed([f"{at_critical(m)} in {p}" for p, m in metrics.items()])


def within(metrics: Mapping[str, Metrics]) -> str:
    """How far the paths without a critical point reach: within 4 mm in A and C, within 14 mm in B and D."""
    ends: dict[str, list[str]] = {}
    for posture, row in metrics.items():
        ends.setdefault(short(row["d_end"]), []).append(posture)
    return listed([f"within {end} mm in {listed(labels)}" for end, labels in ends.items()])


def short(value: float) -> str:
    """A length that somebody chose, without idle digits: 4, 14, 0.3."""
    return f"{value:.3g}"


def bends(metrics: Mapping[str, Metrics]) -> list[str]:
    """A sentence about the postures whose stiffness fades without a sharp point, where there are any."""
    soft = {p: m for p, m in metrics.items() if m["critical"] == EventKind.STIFFNESS_KNEE}
    if not soft:
        return []
    where = listed([f"{number(m['F_cr'])} N, {number(m['d_cr'])} mm in {p}" for p, m in soft.items()])
    return [f"No sharp point, but a stiffness that falls through half of its unloaded value: at {where}."]


# --- The words about the iterations: what (13) takes, where it fails, and what Newton-Raphson takes ---------------

USUAL = (3, 5)
"""Iterations that the paper says are usually enough."""
FELT = 2.0
"""From this ratio of the median counts on a disturbed start is said to matter."""

Counts = Sequence[int | None]
"""Iterations; None where the limit was reached."""


def iterations(run: Run) -> ReportFinding | None:
    """How many iterations (13) and Newton-Raphson take along the paper's paths."""
    studies = [study for study in run.iterations if study.points]
    if not studies:
        return None
    points = [point for study in studies for point in study.points]
    loose, tight = (middle([getattr(p, name) for p in points]) for name in ("paper_loose", "paper"))
    newton = [p.newton for p in points]
    title = (
        f"The paper's iteration (13) takes a median of {_whole(loose)} iterations to a residual of "
        f"{number(LOOSE, 1)} and {_whole(tight)} to {number(TOLERANCE, 1)} (published: {USUAL[0]} to {USUAL[1]} "
        "are usually enough). Newton-Raphson "
    )
    title += "does not always arrive" if None in newton else f"never takes more than {_most(newton)}"
    sentences = [
        f"{len(points)} equilibria, closer together at small displacements, each sought from its neighbour "
        f"{STEP_MM:g} mm before it (the paper's step: 0.001 mm). The paper gives no tolerance: {number(LOOSE, 1)} "
        f"of the scaled residual stands for it, {number(TOLERANCE, 1)} is the suite's own.",
        *map(_study, studies),
        *_disturbance(studies),
        *_rate(points),
    ]
    return ReportFinding(Tone.AGREES if loose <= USUAL[1] else Tone.DIFFERS, title, tuple(sentences))


def middle(counts: Counts) -> float:
    """Median, where a failure counts as more than any number; infinite where most fail."""
    return float(median([inf if n is None else n for n in counts]))


def phases(study: IterationStudy) -> dict[str, list[IterationPoint]]:
    """The points before and behind the first critical point, or all of them where there is none."""
    if study.d_cr is None:
        return {"along the path": list(study.points)}
    where = f"the {study.critical} at {number(study.d_cr)} mm"
    split = {
        f"before {where}": [p for p in study.points if p.s <= study.d_cr],
        "behind it": [p for p in study.points if p.s > study.d_cr],
    }
    return {name: points for name, points in split.items() if points}


def failures(points: Sequence[IterationPoint], of: Callable[[IterationPoint], int | None]) -> list[str]:
    """Where a count is missing, neighbours together: 0.8200 mm, 1.72 to 1.94 mm."""
    runs: list[list[float]] = []
    inside = False
    for point in points:
        failed = of(point) is None
        if failed and inside:
            runs[-1].append(point.s)
        elif failed:
            runs.append([point.s])
        inside = failed
    return [
        f"{number(run[0], 3)} mm" if len(run) == 1 else f"{number(run[0], 3)} to {number(run[-1], 3)} mm"
        for run in runs
    ]


def _study(study: IterationStudy) -> str:
    parts = [
        f"{where}, {_spread([p.paper_loose for p in points])} and {_spread([p.paper for p in points])}"
        for where, points in phases(study).items()
    ]
    text = (
        f"Posture {study.posture}, median number of iterations (13) to {number(LOOSE, 1)} and to "
        f"{number(TOLERANCE, 1)}: {'; '.join(parts)}."
    )
    rough, fine = (failures(study.points, of) for of in (lambda p: p.paper_loose, lambda p: p.paper))
    if fine:
        text += f" It is not there within {LIMIT} at {listed(fine)}"
        if rough:
            text += f", not even to {number(LOOSE, 1)} at {listed(rough)}"
        text += "."
    return text


def _disturbance(studies: Sequence[IterationStudy]) -> list[str]:
    """The postures where (13) is quick only because its start has no part of the critical mode."""
    felt = []
    for study in studies:
        before = [p for p in study.points if p.predicted is not None]
        if not before:
            continue
        plain, disturbed = middle([p.paper for p in before]), middle([p.disturbed for p in before])
        if disturbed >= FELT * plain:
            moved = _spread([p.disturbed for p in before])
            rough = _spread([p.disturbed_loose for p in before])
            felt.append(
                f"{moved} instead of {_whole(plain)} to {number(TOLERANCE, 1)} and {rough} to {number(LOOSE, 1)} "
                f"in {study.posture}"
            )
    if not felt:
        return []
    return [
        "Before a bifurcation the path keeps a symmetry, so that its points contain nothing of the critical mode, "
        f"the one error that fades slowly. With noise of {NOISE:g} coordinate units on the start (the paper "
        f"disturbs every iteration) the median is {listed(felt)}."
    ]


def _rate(points: Sequence[IterationPoint]) -> list[str]:
    gaps = [abs(p.contraction / p.predicted - 1.0) for p in points if p.predicted]
    sentences = []
    if gaps:
        sentences.append(
            "An iteration of (13) multiplies a small error by F/F_cr before a bifurcation. The factor computed "
            f"from its derivative differs from that by at most {percent(max(gaps))}."
        )
    worst = max(points, key=lambda p: p.contraction)
    if worst.contraction >= 1.0:
        sentences.append(
            f"At {number(worst.s, 3)} mm the factor is {number(worst.contraction)}: (13) diverges there."
        )
    return sentences


def _spread(counts: Counts) -> str:
    end = f"not always within {LIMIT}" if None in counts else f"at most {_most(counts)}"
    return f"{_whole(middle(counts))} ({end})"


def _most(counts: Counts) -> int:
    return max(n for n in counts if n is not None)


def _whole(count: float) -> str:
    """A median of counts: 3, 3.5, or more than the limit."""
    return f"{count:g}" if isfinite(count) else f"more than {LIMIT}"


# --- The words about the printed matrices: the beams behind them, and what Table II implies for them --------------

CLOSE = 0.02
"""Relative miss beyond its own rounding up to which a figure of Table II is said to be met."""


def matrices_as_beams(run: Run) -> ReportFinding | None:
    """What (19) and (20) are, by themselves."""
    matrices: PrintedMatrices | None = run.matrices
    if matrices is None:
        return None
    sentences = [
        f"{name}: {line}."
        for name, one in (("(19)", matrices.foot), ("(20)", matrices.bar))
        for line in one.findings
    ]
    return ReportFinding(
        Tone.CAUSE, "The beams behind the paper's printed matrices, and a misprint", tuple(sentences)
    )


def table_fit(run: Run) -> ReportFinding | None:
    """Whether one choice of the entries within their rounding meets the published table."""
    if run.matrices is None:
        return None
    table = run.matrices.table2
    close = next(one for one in table.agreements if one.tolerance == CLOSE)
    total = len(close.met) + len(close.not_met)
    sentences = tuple(f"{line[0].upper()}{line[1:]}." for line in table.findings)
    if not close.not_met:
        return ReportFinding(
            Tone.AGREES,
            f"One choice of the matrices within their rounding meets Table II within {percent(CLOSE)}",
            sentences,
        )
    title = (
        f"No choice of the matrices within their rounding meets all of Table II: at most {len(close.met)} of its "
        f"{total} figures within {percent(CLOSE)} at once"
    )
    return ReportFinding(Tone.DIFFERS, title, sentences)


# --- A table of a page --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ReportTable:
    """A table of the page.

    Attributes:
        caption: what it holds.
        header: of its columns; the first ones are words.
        rows: as they are written.
        words: number of leading columns that hold words.
    """

    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int = 1
