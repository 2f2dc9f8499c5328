"""The figures of the lumping: the artefact in tension, and how many springs each placement needs."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from vjm.continuation.direction import Direction
from vjm.continuation.path import Path
from vjm.model.parts import Placement
from vjm_output.number_text import number
from vjm_output.plot_style import (
    FE,
    PAPER,
    REFINED,
    Picture,
    drawing_of,
    engine_order,
    engine_style,
    figure,
    text_colour,
)
from vjm_validation.report.figures import draw_force
from vjm_validation.studies.study_results import Key, LumpingStudy, Run

PLACES = {
    Placement.END: "at the far end (the paper)",
    Placement.MIDDLE: "at the middle",
    Placement.TWO_THIRDS: "at two thirds",
    Placement.BEST: "beam-column spring (the suite's rule)",
}
"""What each placement is called."""
MARKS = {
    Placement.END: ("#D55E00", "v"),
    Placement.MIDDLE: ("#0072B2", "s"),
    Placement.TWO_THIRDS: ("#CC79A7", "^"),
    Placement.BEST: ("#009E73", "D"),
}
"""Colour and mark of each placement."""

CONVERGED = 16
"""Springs by the suite's rule from which on its own critical force is the measure of the others: 1e-7 and less."""


def place_name(place: str) -> str:
    """What a placement is called; its label where there is no name."""
    return PLACES[Placement(place)] if place in PLACES else place


def place_mark(place: str) -> tuple[str, str]:
    """Colour and mark of a placement, grey where it has none."""
    return MARKS[Placement(place)] if place in MARKS else ("#666666", "o")


def places(*studies: LumpingStudy | None) -> list[str]:
    """Placements of some studies, in the order of `PLACES`."""
    order = [str(place) for place in PLACES]
    found = {place for study in studies if study is not None for place, _, _ in study.rows}
    return sorted(found, key=lambda place: (order.index(place) if place in order else len(order), place))


def forces(study: LumpingStudy, place: str) -> dict[int, float | None]:
    """Critical force by number of springs at one placement, N."""
    return {n: force for at, n, force in sorted(study.rows, key=lambda row: row[1]) if at == place}


def converged(study: LumpingStudy) -> tuple[int, float] | None:
    """Springs and critical force of the finest lumped model by the suite's rule, if it is fine enough."""
    found = [(n, force) for n, force in forces(study, Placement.BEST).items() if force is not None]
    return found[-1] if found and found[-1][0] >= CONVERGED else None


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
    return [_proof(run, tension, compression), *_convergence(compression)]


def _proof(run: Run, tension: LumpingStudy | None, compression: LumpingStudy) -> Picture:
    posture = compression.posture
    with figure(4.0, 2, widths=[1.15, 1.0]) as (fig, axes):
        _both_directions(axes[0], run, posture)
        _critical_against_springs(axes[1], tension, compression)
        content = drawing_of(fig)
    return Picture(
        "link_lumping",
        content,
        f"Posture {posture}: which way it buckles is decided by the lumping",
        "Left: tension to the right and up, compression to the left and down; circles are bifurcations. "
        "Right: the critical force against the number of springs in the bar, by where a spring sits in its "
        "segment and by its law. Filled: compression. Hollow: the bifurcation in tension, which no beam has and "
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
        color=text_colour(engine_style(label).colour),
    )


def _critical_against_springs(ax: Axes, tension: LumpingStudy | None, compression: LumpingStudy) -> None:
    studies = [study for study in (compression, tension) if study is not None]
    found = [force for study in studies for _, _, force in study.rows if force is not None]
    top = 7.0 * max([*found, compression.reference or 0.0, 1.0])
    if compression.reference is not None:
        ax.axhline(compression.reference / 1e3, color="black", lw=3.0, zorder=1)
    for study in studies:
        pressed = study.direction is Direction.COMPRESSION
        for place in places(study):
            colour, marker = place_mark(place)
            curve = {n: force / 1e3 for n, force in forces(study, place).items() if force is not None}
            if curve:
                ax.plot(
                    list(curve), list(curve.values()), marker=marker, color=colour, ms=5.0, lw=1.2,
                    ls="-" if pressed else ":", mfc=colour if pressed else "white",
                )  # fmt: skip
            never = [n for n, force in forces(study, place).items() if force is None]
            if pressed and never:
                edge = np.full(len(never), top / 1e3)
                ax.plot(never, edge, marker, color=colour, ms=6.5, clip_on=False, zorder=5)
                ax.annotate(
                    "never", (never[0], top / 1e3), xytext=(7, -2), textcoords="offset points",
                    va="top", fontsize=7.5, color=text_colour(colour),
                )  # fmt: skip
    counts = sorted({n for study in studies for _, n, _ in study.rows})
    ax.set(xscale="log", yscale="log", xlabel="springs in the bar", ylabel="critical force, kN")
    ax.set_xticks(counts, [str(n) for n in counts])
    ax.minorticks_off()
    ax.set_ylim(0.55 * min(found, default=1e3) / 1e3, top / 1e3)
    ax.set_yticks(ticks := _decade_ticks(ax), [f"{tick:g}" for tick in ticks])
    ax.set_title("critical force against number of springs", pad=9)
    entries = [
        Line2D(
            [], [], color=place_mark(place)[0], marker=place_mark(place)[1], ms=5, lw=1.2, label=place_name(place)
        )
        for place in places(*studies)
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


def _convergence(study: LumpingStudy) -> list[Picture]:
    """Error against number of springs; nothing without a force to measure it by."""
    finest = converged(study)
    measure = finest[1] if finest is not None else study.reference
    if measure is None:
        return []
    with figure(3.4, 1) as (fig, (ax,)):
        smallest = []
        for place in places(study):
            colour, marker = place_mark(place)
            error = {
                n: abs(force / measure - 1.0)
                for n, force in forces(study, place).items()
                if force is not None and force != measure
            }
            if error:
                ax.plot(
                    list(error), list(error.values()), marker=marker, color=colour, ms=5.5, lw=1.3,
                    label=place_name(place),
                )  # fmt: skip
                smallest.append(min(error.values()))
        counts = np.array(sorted({n for _, n, _ in study.rows}))
        for order, line in ((2, "--"), (4, ":")):
            slope = (counts / counts[0]) ** -float(order)
            ax.plot(
                counts,
                slope,
                color="#999999",
                lw=0.9,
                ls=line,
                label=f"order {order}, 1/n{'²' if order == 2 else '⁴'}",
            )
        own = abs(study.reference / measure - 1.0) if finest is not None and study.reference is not None else 0.0
        if own > 0.0:
            ax.axhline(own, color="black", lw=1.6, zorder=1, label="finite elements")
        ax.set(
            xscale="log", yscale="log", xlabel="springs in the bar", ylabel="relative error of the critical force"
        )
        ax.set_ylim(0.4 * min([*smallest, *filter(None, [own])], default=1e-3), 2.0)
        ax.set_xticks(counts, [str(n) for n in counts])
        ax.minorticks_off()
        fig.legend(loc="outside right center")
        content = drawing_of(fig)
    if finest is not None:
        against = (
            f"Critical force in {study.direction} against {finest[1]:.6g} N, to which the suite's rule itself has "
            f"converged with {finest[0]} springs; that point has no mark."
        )
        if own > 0.0:
            against += f" The black line is how far the finite elements are from it: {number(own, 2)}."
    else:
        against = (
            f"Critical force in {study.direction} against that of the finite elements ({number(measure)} N), whose "
            "own error is the floor of every line."
        )
    return [
        Picture(
            "lumping_convergence",
            content,
            f"Posture {study.posture}: how many springs the bar needs",
            f"{against} Other missing marks: that model has no bifurcation on the path.",
        )
    ]
