"""The figures that carry the findings: the tension artefact, the foot's law, and Table II beside ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from vjm.paths import Path
from vjm_validation.report.figures import Window, draw_force, legend, posture_paths, postures
from vjm_validation.report.style import (
    FE,
    FE_FOOT_SPRING,
    FOOT_SPRING,
    PAPER,
    REFINED,
    Picture,
    engine_order,
    engine_style,
    figure,
    number,
    png,
)
from vjm_validation.run import Direction, Key, LumpingStudy, Run

PLACEMENTS = {"end": ("#D55E00", "v"), "middle": ("#0072B2", "s"), "best": ("#009E73", "D")}
"""Colour and mark of each place of the spring in its segment."""

PLACES = {"end": "at the far end (the paper)", "middle": "at the middle", "best": "at two thirds"}

FOOT_ENGINES = (FOOT_SPRING, FE_FOOT_SPRING, REFINED, FE)
"""Two lumped feet and two beams."""

RATIOS = (0.7, 1.3)
"""Range of the axis of ratios; what lies outside is written at its edge."""


def lumping_pair(run: Run) -> tuple[LumpingStudy | None, LumpingStudy | None]:
    """The studies of tension and of compression for the first posture that was studied."""
    posture = run.lumping[0].posture if run.lumping else ""
    found = {study.direction: study for study in run.lumping if study.posture == posture}
    return found.get(Direction.TENSION), found.get(Direction.COMPRESSION)


def lumping_pictures(run: Run) -> list[Picture]:
    """The proof of ``link_lumping`` and how fast each placement gets better; nothing without a study."""
    tension, compression = lumping_pair(run)
    if compression is None:
        return []
    pictures = [_proof(run, tension, compression)]
    if compression.reference is not None:
        pictures.append(_convergence(compression, compression.reference))
    return pictures


def _proof(run: Run, tension: LumpingStudy | None, compression: LumpingStudy) -> Picture:
    posture = compression.posture
    with figure(4.0, 2, widths=[1.15, 1.0]) as (fig, axes):
        _both_directions(axes[0], run, posture)
        _critical_against_springs(axes[1], tension, compression)
        content = png(fig)
    return Picture(
        "link_lumping",
        content,
        f"Posture {posture}: which way it buckles is decided by the lumping",
        "Left: tension to the right and up, compression to the left and down; circles are bifurcations. "
        "Right: the critical force against the number of springs in the bar, for three places of the spring "
        "in its segment. Filled: compression. Hollow: the bifurcation in tension, which no beam has and "
        "which moves out of reach as springs are added. A mark on the upper edge: none on the path.",
    )


def _both_directions(ax: Axes, run: Run, posture: str) -> None:
    for label in (FE, REFINED, PAPER):
        for direction in Direction:
            path = run.paths.get(Key(posture, direction, label))
            if path is not None:
                draw_force(ax, label, path, direction.sign)
    ax.axhline(0.0, color="black", lw=0.6)
    ax.axvline(0.0, color="black", lw=0.6)
    ax.set(xlabel="displacement along x, mm (+ tension, − compression)", ylabel="force along x, kN")
    ax.set_title("force against displacement")
    handles = {str(line.get_label()): line for line in ax.get_lines()}
    shown = [label for label in sorted(handles, key=engine_order) if not label.startswith("_")]
    ax.legend([handles[label] for label in shown], shown, loc="upper left", handlelength=3.0)
    paper, fe = (
        run.paths.get(Key(posture, direction, label))
        for direction, label in ((Direction.TENSION, PAPER), (Direction.COMPRESSION, FE))
    )
    if paper is not None and paper.critical:
        _name_critical(ax, PAPER, paper, 1)
    if fe is not None and fe.critical:
        _name_critical(ax, FE, fe, -1)


def _name_critical(ax: Axes, label: str, path: Path, sign: int) -> None:
    """Name a critical point to its lower right, where no line runs in either direction."""
    event = path.critical
    assert event is not None
    ax.annotate(
        f"{event.kind}, {number(event.force)} N",
        (sign * event.s, sign * event.force / 1e3),
        xytext=(9, -5),
        textcoords="offset points",
        va="top",
        fontsize=8,
        color=engine_style(label).colour,
    )


def _critical_against_springs(ax: Axes, tension: LumpingStudy | None, compression: LumpingStudy) -> None:
    studies = [study for study in (compression, tension) if study is not None]
    found = [force for study in studies for _, _, force in study.rows if force is not None]
    top = 2.2 * max([*found, compression.reference or 0.0, 1.0])
    if compression.reference is not None:
        ax.axhline(compression.reference / 1e3, color="black", lw=3.0, zorder=1)
    for study in studies:
        pressed = study.direction is Direction.COMPRESSION
        for place, (colour, marker) in PLACEMENTS.items():
            rows = sorted((n, force) for at, n, force in study.rows if at == place and force is not None)
            if rows:
                n, force = zip(*rows, strict=True)
                ax.plot(
                    n, np.array(force) / 1e3, marker=marker, color=colour, ms=5.5, lw=1.2,
                    ls="-" if pressed else ":", mfc=colour if pressed else "white",
                )  # fmt: skip
            never = [n for at, n, force in study.rows if at == place and force is None]
            if pressed and never:
                edge = np.full(len(never), top / 1e3)
                ax.plot(never, edge, marker, color=colour, ms=6.5, clip_on=False, zorder=5)
                ax.annotate(
                    "never", (never[0], top / 1e3), xytext=(7, -2), textcoords="offset points",
                    va="top", fontsize=7.5, color=colour,
                )  # fmt: skip
    counts = sorted({n for study in studies for _, n, _ in study.rows})
    ax.set(xscale="log", yscale="log", xlabel="springs in the bar", ylabel="critical force, kN")
    ax.set_xticks(counts, [str(n) for n in counts])
    ax.minorticks_off()
    ax.set_ylim(0.55 * min(found, default=1e3) / 1e3, top / 1e3)
    ax.set_yticks(ticks := _decade_ticks(ax), [f"{tick:g}" for tick in ticks])
    ax.set_title("critical force against number of springs", pad=9)
    entries = [
        Line2D([], [], color=colour, marker=marker, ms=5, lw=1.2, label=PLACES[place])
        for place, (colour, marker) in PLACEMENTS.items()
    ]
    entries.append(Line2D([], [], color="#555555", ls=":", marker="o", mfc="white", label="in tension"))
    if compression.reference is not None:
        entries.append(
            Line2D([], [], color="black", lw=3.0, label=f"finite elements, {number(compression.reference)} N")
        )
    ax.legend(handles=entries, loc="upper right", bbox_to_anchor=(1.0, 0.99), fontsize=7.5)


def _decade_ticks(ax: Axes) -> list[float]:
    low, high = ax.get_ylim()
    return [m * 10.0**e for e in range(-3, 4) for m in (1, 2, 5) if low <= m * 10.0**e <= high]


def _convergence(study: LumpingStudy, reference: float) -> Picture:
    with figure(3.0, 1) as (fig, (ax,)):
        for place, (colour, marker) in PLACEMENTS.items():
            rows = sorted((n, force) for at, n, force in study.rows if at == place and force is not None)
            if rows:
                n, force = np.array(rows).T
                error = 100.0 * np.abs(force / reference - 1.0)
                ax.plot(n, error, marker=marker, color=colour, ms=5.5, lw=1.3, label=PLACES[place])
        counts = np.array(sorted({n for _, n, _ in study.rows}))
        slope = 100.0 * (counts / counts[0]) ** -2.0
        ax.plot(counts, slope, color="#999999", lw=0.8, ls="--", label="second order, 1/n²")
        ax.set(xscale="log", yscale="log", xlabel="springs in the bar")
        ax.set_ylabel("difference to finite elements, %")
        ax.set_xticks(counts, [str(n) for n in counts])
        ax.minorticks_off()
        ax.yaxis.set_major_formatter(lambda v, _: f"{v:g}")
        fig.legend(loc="outside right center")
        content = png(fig)
    return Picture(
        "lumping_convergence",
        content,
        f"Posture {study.posture}: how many springs the bar needs",
        f"Difference of the critical force in {study.direction} to that of the finite elements "
        f"({number(reference)} N). Missing marks: that model has no bifurcation on the path. "
        "The finite elements have an error of their own, below which a line no longer falls.",
    )


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
        content = png(fig)
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
        content = png(fig)
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
