"""The figure of the iterations: what (13) and Newton-Raphson take along the paper's paths."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from vjm.statics.equilibrium import TOLERANCE
from vjm_output.number_text import number
from vjm_output.plot_style import Picture, drawing_of, figure
from vjm_validation.report.iteration_words import USUAL
from vjm_validation.studies.iterations import LIMIT, LOOSE, NOISE, STEP_MM
from vjm_validation.studies.study_results import IterationPoint, IterationStudy, Run

LINES = {
    "paper": ("#D55E00", "-", 1.8),
    "paper_loose": ("#D55E00", (0, (4, 1.5)), 1.3),
    "disturbed_loose": ("#CC79A7", (0, (1, 1)), 1.5),
    "newton": ("#0072B2", "-", 1.8),
}
"""Colour, line and width of each count that is drawn; the others would lie close to these."""


def iteration_picture(run: Run) -> Picture | None:
    """Iterations and contraction along the path of every posture; None without a study."""
    studies = [study for study in run.iterations if study.points]
    if not studies:
        return None
    loose, tight = number(LOOSE, 1), number(TOLERANCE, 1)
    names = {
        "paper": f"(13) to {tight}",
        "paper_loose": f"(13) to {loose}",
        "disturbed_loose": f"(13) to {loose}, start disturbed",
        "newton": f"Newton-Raphson to {tight}",
    }
    columns = len(studies)
    with figure(4.3, columns, rows=2, sharey=True) as (fig, axes):
        for study, counts, rates in zip(studies, axes[:columns], axes[columns:], strict=True):
            _counts(counts, study, names)
            _rates(rates, study)
            counts.set_title(f"Posture {study.posture}")
            for ax in (counts, rates):
                if study.d_cr is not None:
                    ax.axvline(study.d_cr, color="black", lw=0.8, ls=":")
        axes[0].set_ylabel("iterations")
        axes[columns].set_ylabel("contraction of (13)")
        fig.supxlabel(f"displacement in {studies[0].direction}, mm", fontsize=8.5)
        handles = {str(line.get_label()): line for ax in axes for line in ax.get_lines()}
        shown = [line for label, line in handles.items() if not label.startswith("_")]
        fig.legend(handles=shown, loc="outside upper center", ncols=4, handlelength=2.6)
        content = drawing_of(fig)
    return Picture(
        "iterations",
        content,
        "How many iterations the paper's (13) and Newton-Raphson take",
        f"The paper's own model, each equilibrium sought from its neighbour {STEP_MM:g} mm before it, to a scaled "
        f"residual of {tight} (the suite's) or {loose}. Disturbed: with random noise of {NOISE:g} coordinate units "
        f"on every joint, the same for every start. A cross: not found within {LIMIT} iterations. Grey band: the "
        f"paper's {USUAL[0]} to {USUAL[1]}. Below: the factor by which (13) shrinks a small error, computed from "
        "its derivative at the equilibrium, and F/F_cr, the prediction before a bifurcation. Dotted: the critical "
        "point.",
    )


def _counts(ax: Axes, study: IterationStudy, names: dict[str, str]) -> None:
    ax.axhspan(*USUAL, color="#dddddd", zorder=0)
    top = 1.6 * LIMIT
    for column, (colour, line, width) in LINES.items():
        for i, run in enumerate(_branches(study)):
            s = [point.s for point in run]
            found = [getattr(point, column) for point in run]
            ax.plot(
                s, [np.nan if n is None else n for n in found], color=colour, ls=line, lw=width,
                label=names[column] if i == 0 else "_",
            )  # fmt: skip
            failed = [at for at, n in zip(s, found, strict=True) if n is None]
            ax.plot(failed, np.full(len(failed), LIMIT), "x", color=colour, ms=5.0, zorder=5)
    ax.set(xscale="log", yscale="log", ylim=(0.8, top))
    ticks = [n for n in (1, 2, 5, 10, 20, 50, 100, 200) if n <= top]
    ax.set_yticks(ticks, [str(n) for n in ticks])
    ax.minorticks_off()


def _rates(ax: Axes, study: IterationStudy) -> None:
    for i, run in enumerate(_branches(study)):
        ax.plot(
            [point.s for point in run], [point.contraction for point in run], color="black", lw=1.6,
            label="contraction" if i == 0 else "_",
        )  # fmt: skip
    known = [(point.s, point.predicted) for point in study.points if point.predicted is not None]
    if known:
        ax.plot(
            *np.array(known).T, color="#E69F00", ls="", marker="o", ms=3.2, mfc="none", mew=0.9, label="$F/F_{cr}$"
        )
    ax.axhline(1.0, color="#999999", lw=0.8)
    ax.set(xscale="log", ylim=(0.0, 1.08))
    low, high = study.points[0].s, study.points[-1].s
    ticks = [m * 10.0**e for e in range(-6, 4) for m in (1, 3) if low <= m * 10.0**e <= high] or [low, high]
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()


def _branches(study: IterationStudy) -> list[Sequence[IterationPoint]]:
    """The points before and behind a bifurcation: no line joins them."""
    before = [point for point in study.points if point.predicted is not None]
    behind = study.points[len(before) :]
    return [run for run in (before, behind) if run]
