"""The words about the printed matrices: the beams behind them, and what Table II implies for them."""

from __future__ import annotations

from vjm_output.number_text import percent
from vjm_validation.report.words import ReportFinding, Tone
from vjm_validation.studies.printed_matrices import PrintedMatrices
from vjm_validation.studies.study_results import Run

CLOSE = 0.02
"""Relative miss beyond its own rounding up to which a figure of Table II is said to be met."""


def matrices_as_beams(run: Run) -> ReportFinding | None:
    """What (19) and (20) are, by themselves."""
    found: PrintedMatrices | None = run.matrices
    if found is None:
        return None
    sentences = [
        f"{name}: {line}." for name, one in (("(19)", found.foot), ("(20)", found.bar)) for line in one.findings
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
