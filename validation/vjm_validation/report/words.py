"""The words of a report: what a finding is, and sentences about metrics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from vjm.continuation.path import EventKind
from vjm.model.load_case import Direction
from vjm_output.number_text import listed, missing, number
from vjm_output.plots import Picture
from vjm_validation.studies.chain import Run

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


def findings_markdown(
    title: str,
    command: str | None,
    findings: Sequence[ReportFinding],
    pictures: Mapping[str, Sequence[Picture]],
    versions: str = "",
) -> str:
    """The findings of a run as Markdown beside its figures: short enough to be kept in a repository.

    Args:
        title: of the machine.
        command: that made the run.
        findings: what it found.
        pictures: shown under the findings, by the folder beside the text in which they lie.
        versions: of what made it.
    """
    lines = [f"# {title}", "", f"Written by `{command}`.", ""]
    for finding in findings:
        lines += [f"## {finding.title}", "", *(f"- {sentence}" for sentence in finding.sentences), ""]
    for folder, own in pictures.items():
        for one in own:
            lines += [f"![{one.title}]({folder}/{one.name}.png)", "", f"**{one.title}** {one.caption}", ""]
    return "\n".join([*lines, versions, ""] if versions else lines)


def failed_acceptance(rows: Sequence[Mapping[str, Any]]) -> ReportFinding | None:
    """Acceptance rows that do not hold, as ``summary.json`` has them."""
    failed = [row for row in rows if row["passed"] is False]
    if not failed:
        return None
    sentences = (f"{row['name']}: required {row['requirement']}, found {number(row['value'])}." for row in failed)
    title = (
        f"{len(failed)} of {len(rows)} acceptance rows failed: do not rely on this run before they are corrected"
    )
    return ReportFinding(Tone.FAILED, title, tuple(sentences))
