"""The chapter on the suite's own discovery: a diagnosis that finds what the paper's lumped link gets wrong."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from vjm.continuation.path import Path
from vjm_output.number_text import number, percent
from vjm_output.plot_style import EVENT_MARKERS, FE, PAPER, REFINED, Picture, drawing_of, engine_style, figure
from vjm_validation.report.tables import ReportTable
from vjm_validation.report.words import ReportFinding, Tone
from vjm_validation.studies.discovery_results import CAUSE, Discovery, DiscoveryStudy
from vjm_validation.studies.study_results import Run

SHEET, EXTENDED = "the sheet's model, one spring a link", "extended model"


def discovery(run: Run) -> ReportFinding | None:
    """What the diagnosis of finite elements' data found."""
    if run.discovery is None:
        return None
    rows = run.discovery.rows
    right = rows.verdict == "named" and rows.causes == [CAUSE]
    title = (
        "Given finite elements' readings, the suite itself finds that one spring a link is wrong"
        if right
        else f"Given finite elements' readings, the suite does not name {CAUSE} (verdict {rows.verdict})"
    )
    sentences = [
        f"{rows.readings} readings of Exudyn's beams in posture A, with noise, zeros, scales and tolerances drawn, "
        f"and a sheet that says the paper's model. The verdict of `validate diagnose` is {rows.verdict}"
        + (f", {' + '.join(rows.causes)}" if rows.causes else "")
        + f", confidence {number(rows.confidence, 2)}.",
        _tension(rows),
        _held_out(rows),
        _compression(rows),
    ]
    return ReportFinding(Tone.CAUSE if right else Tone.DIFFERS, title, tuple(s for s in sentences if s))


def _tension(rows: Discovery) -> str:
    row = rows.tension
    if row.nominal_N is None:
        return ""
    seen = "show a knee, too" if row.measured_N is not None else "go straight on"
    after = "has none" if row.extended_N is None else f"has one at {number(row.extended_N)} N"
    return (
        f"Pulled, the sheet's model buckles at {number(row.nominal_N)} N; the readings {seen}, up to "
        f"{number(row.reached_N)} N, and the extended model {after}."
    )


def _held_out(rows: Discovery) -> str:
    parts = [
        f"{fold.name} from {number(fold.rmse_before, 3)} N to {number(fold.rmse_after, 3)} N "
        f"({percent(fold.rmse_after / fold.force)} of its force)"
        for fold in rows.held_out
    ]
    return f"Held out and predicted from the rest, the error falls for {' and for '.join(parts)}." if parts else ""


def _compression(rows: Discovery) -> str:
    row = rows.compression
    if row.extended_N is None or rows.truth_N is None:
        return ""
    apart = percent(row.extended_N / rows.truth_N - 1.0)
    before = "has no critical point" if row.nominal_N is None else f"says {number(row.nominal_N)} N"
    return (
        f"Pushed, the sheet's model {before}. The extended one predicts {number(row.extended_N)} N, beyond the "
        f"readings' {number(row.reached_N)} N. The beams that made the data buckle at {number(rows.truth_N)} N, "
        f"{apart} away."
    )


def discovery_tables(rows: Discovery) -> list[ReportTable]:
    """Critical forces of both models, and errors of what was held out."""
    critical = tuple(
        (
            row.direction,
            number(row.reached_N),
            "none" if row.measured_N is None else number(row.measured_N),
            _point(row.nominal, row.nominal_N),
            _point(row.extended, row.extended_N),
            number(rows.truth_N) if row.direction == "compression" else "none",
        )
        for row in rows.critical
    )
    held = tuple(
        (fold.name, str(fold.readings), number(fold.force), number(fold.rmse_before, 3), number(fold.rmse_after, 3),
         percent(fold.rmse_after / fold.force))
        for fold in rows.held_out
    )  # fmt: skip
    header = ("", "readings reach", "their knee", "sheet's model", EXTENDED, "beams of the data")
    return [
        ReportTable("Critical forces, N", header, critical),
        ReportTable(
            "Error of forces held out, root mean square, N",
            ("held out", "forces", "force, N", "sheet's model", EXTENDED, "over the force"),
            held,
        ),
    ]


def _point(kind: str, force: float | None) -> str:
    return "none" if force is None else f"{number(force)} ({kind})"


def discovery_picture(found: DiscoveryStudy) -> Picture:
    """Readings and both models, in tension and in compression."""
    styles = engine_style(PAPER), engine_style(REFINED)
    with figure(2.9, 2) as (fig, axes):
        for k, (ax, name) in enumerate(zip(axes, ("tension", "compression"), strict=True)):
            sign = 1.0 if k == 0 else -1.0
            on = sign * found.displacement >= 0.0
            ax.plot(
                sign * found.displacement[on], sign * found.force[on] / 1e3, ".", ms=3.5,
                color=engine_style(FE).colour, label="readings of finite elements", zorder=3,
            )  # fmt: skip
            for paths, style, label in zip((found.nominal, found.extended), styles, (SHEET, EXTENDED), strict=True):
                _draw(ax, paths[k], style.colour, style.line, label)
            ax.set(title=name, xlabel="displacement, mm", ylabel="force, kN", xlim=(0.0, None), ylim=(0.0, None))
        axes[0].legend(loc="lower right")
        content = drawing_of(fig)
    caption = (
        "Readings of Exudyn's beams, posture A, the model of the test sheet, and the model that the diagnosis made "
        "of it; marks are bifurcations. Both models at their own values, without the instruments' errors."
    )
    return Picture("discovery", content, "One spring a link, found out by readings", caption)


def _draw(ax: Axes, path: Path, colour: str, line: object, label: str) -> None:
    ax.plot(path.s, np.abs(path.force) / 1e3, ls=line, color=colour, lw=1.4, label=label, zorder=2)
    event = path.critical
    if event is not None:
        ax.plot(event.s, event.force / 1e3, EVENT_MARKERS[event.kind], color=colour, ms=6, mec="white", zorder=4)
