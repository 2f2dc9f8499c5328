"""Figures that carry findings: the foot's law, and Table II beside ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from vjm.continuation.direction import Direction
from vjm_output.number_text import number
from vjm_output.plot_style import FE, FE_FOOT_SPRING, FOOT_SPRING, REFINED, Picture, drawing_of, figure
from vjm_validation.report.figures import Window, draw_force, legend, posture_paths, postures
from vjm_validation.studies.study_results import Run

FOOT_ENGINES = (FOOT_SPRING, FE_FOOT_SPRING, REFINED, FE)
"""Two lumped feet and two beams."""

RATIOS = (0.7, 1.3)
"""Range of the axis of ratios; what lies outside is written at its edge."""


def foot_picture(run: Run) -> Picture | None:
    """What the law of the lumped foot does to displacements; needs two of `FOOT_ENGINES` with an event."""
    panels = {
        posture: {
            label: path
            for label, path in posture_paths(run, posture, Direction.COMPRESSION).items()
            if label in FOOT_ENGINES and path.critical
        }
        for posture in postures(run)
    }
    panels = {posture: paths for posture, paths in panels.items() if len(paths) > 1}
    if not panels:
        return None
    with figure(3.4, len(panels)) as (fig, axes):
        for ax, (posture, paths) in zip(axes, panels.items(), strict=True):
            for label, path in paths.items():
                draw_force(ax, label, path)
            at = [path.critical.s for path in paths.values() if path.critical]
            window = Window.around(paths)
            ax.set_xlim(0.8 * min(at), 1.15 * max(at))
            ax.set_ylim(0.65 * window.force / 1.6 / 1e3, 1.08 * window.force / 1.6 / 1e3)
            ax.set(title=f"Posture {posture}", xlabel="displacement, mm")
            ax.locator_params(axis="x", nbins=4)
        axes[0].set_ylabel("force in compression, kN")
        legend(fig, axes)
        content = drawing_of(fig)
    return Picture(
        "foot_law",
        content,
        "The law of the lumped foot moves the critical point sideways",
        "Compression, around the critical point. All feet have the same unloaded matrix (19); as one spring "
        "they obey different laws once turned. Where two beams and a spring part, the beams are the machine.",
    )


def published_picture(run: Run) -> Picture | None:
    """Ratio of our figures to Table II, with the interval that the rounding of the input can reach."""
    rows = [row for row in run.summary.get("published", ()) if row["ratio"] is not None and row["published"]]
    if not rows:
        return None
    labels = sorted({row["posture"] for row in rows})
    with figure(2.9, len(labels), sharey=True) as (fig, axes):
        for ax, posture in zip(axes, labels, strict=True):
            _ratios(ax, [row for row in rows if row["posture"] == posture])
            ax.set_title(f"Posture {posture}")
            ax.set_xlim(*RATIOS)
        axes[0].invert_yaxis()
        fig.supxlabel("ours over published", fontsize=8.5)
        entries = [
            Line2D([], [], ls="", marker="o", color="#0072B2", label="published value within reach"),
            Line2D([], [], ls="", marker="o", mfc="white", mec="#D55E00", mew=1.5, label="out of reach"),
            Line2D([], [], ls="", marker="d", color="#777777", label="definition differs"),
            Line2D([], [], color="#999999", lw=3, alpha=0.6, label="reach of the rounding of (19), (20)"),
        ]
        fig.legend(handles=entries, loc="outside upper center", ncols=4)
        content = drawing_of(fig)
    return Picture(
        "published",
        content,
        "Table II beside ours",
        "Each figure of the paper's Table II: ours over the published one. A bar that crosses 1 means that "
        "some input within the rounding of the printed matrices gives the published figure.",
    )


def _ratios(ax: Axes, rows: Sequence[Mapping[str, Any]]) -> None:
    ax.axvline(1.0, color="black", lw=0.8)
    for row in rows:
        name = row["quantity"]
        if row["reach_low"] is not None and row["reach_high"] is not None:
            reach = [row["reach_low"] / row["published"], row["reach_high"] / row["published"]]
            ax.plot(reach, [name, name], color="#999999", lw=3.5, alpha=0.6, solid_capstyle="butt")
        style: dict[str, Any]
        if row["definition_differs"]:
            style = {"marker": "d", "color": "#777777"}
        elif row["inside"] is None:
            style = {"marker": "o", "color": "black"}
        elif row["inside"]:
            style = {"marker": "o", "color": "#0072B2"}
        else:
            style = {"marker": "o", "mfc": "white", "mec": "#D55E00", "mew": 1.5}
        shown = min(max(row["ratio"], RATIOS[0]), RATIOS[1])
        ax.plot([shown], [name], ls="", ms=5.5, zorder=4, clip_on=False, **style)
        if shown != row["ratio"]:
            beyond = shown == RATIOS[1]
            ax.annotate(
                f"{number(row['ratio'], 2)} →" if beyond else f"← {number(row['ratio'], 2)}",
                (shown, name),
                xytext=(-7 if beyond else 7, 0),
                textcoords="offset points",
                ha="right" if beyond else "left",
                va="center",
                fontsize=7.5,
            )
    ax.grid(axis="y", visible=False)
