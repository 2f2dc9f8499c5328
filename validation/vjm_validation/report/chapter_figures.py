"""Figures of the paper's chapters: lumping, end conditions, what carries a finding, and the verification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from vjm.continuation.lumped_problem import ImperfectionCurve
from vjm.continuation.path import EventKind, Path, travel
from vjm.model.load_case import Direction
from vjm.model.parts import Placement
from vjm_output.number_text import listed, number, percent
from vjm_output.plots import (
    EVENT_MARKERS,
    FE,
    FE_FOOT_SPRING,
    FOOT_SPRING,
    PAPER,
    REFINED,
    Picture,
    drawing_of,
    engine_order,
    engine_style,
    figure,
    text_colour,
)
from vjm_validation.metrics import path_metrics
from vjm_validation.report.figures import Window, draw_force, legend, posture_paths, postures
from vjm_validation.report.words import SHARP, ReportFinding, Tone
from vjm_validation.studies.chain import END_CONDITIONS, HINGED_LOAD, EndConditionStudy, Key, LumpingStudy, Run
from vjm_validation.verification.library import GROUPS
from vjm_validation.verification.runner import MESHED, TITLES
from vjm_validation.verification.study import GROUP as INVARIANCE

# --- The figures of the lumping: the artefact in tension, and how many springs each placement needs ---------------

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
    placements = {place for study in studies if study is not None for place, _, _ in study.rows}
    return sorted(placements, key=lambda place: (order.index(place) if place in order else len(order), place))


def forces(study: LumpingStudy, place: str) -> dict[int, float | None]:
    """Critical force by number of springs at one placement, N."""
    return {n: force for placement, n, force in sorted(study.rows, key=lambda row: row[1]) if placement == place}


def converged(study: LumpingStudy) -> tuple[int, float] | None:
    """Springs and critical force of the finest lumped model by the suite's rule, if it is fine enough."""
    critical_forces = [(n, force) for n, force in forces(study, Placement.BEST).items() if force is not None]
    return critical_forces[-1] if critical_forces and critical_forces[-1][0] >= CONVERGED else None


def lumping_pair(run: Run) -> tuple[LumpingStudy | None, LumpingStudy | None]:
    """The studies of tension and of compression for the first posture that was studied."""
    posture = run.lumping[0].posture if run.lumping else ""
    studies = {study.direction: study for study in run.lumping if study.posture == posture}
    return studies.get(Direction.TENSION), studies.get(Direction.COMPRESSION)


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
    critical_forces = [force for study in studies for _, _, force in study.rows if force is not None]
    top = 7.0 * max([*critical_forces, compression.reference or 0.0, 1.0])
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
    ax.set_ylim(0.55 * min(critical_forces, default=1e3) / 1e3, top / 1e3)
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


# --- The figure and the words of the end conditions: what the support decides, and what imperfections cost --------

LOOKS: dict[str, tuple[str, Any, float]] = {
    "pose imposed": ("#000000", "-", 3.2),
    "hinged": ("#0072B2", (0, (5, 1.5)), 3.2),
    "dead load": ("#E69F00", "-", 1.4),
    HINGED_LOAD: ("#D55E00", (0, (5, 1.5)), 1.4),
}
"""Colour, line and width of each end condition: dashed where the end-effector is hinged, thin under a dead load."""
POSTURE_MARKS = ("o", "s", "^", "D")
MADE_MM = 1.0
"""A bow that a bar some 300 mm long may well have: an imperfection whose cost the words name."""


def end_condition_picture(run: Run) -> Picture | None:
    """Force against displacement under every end condition, and against imperfections; None without a study."""
    study = run.end_conditions
    if study is None or not study.imperfections:
        return None
    posture = most_sensitive(study)
    with figure(3.7, 2) as (fig, (left, right)):
        _paths(left, study, posture)
        _sensitivity(right, study)
        content = drawing_of(fig)
    return Picture(
        "end_conditions",
        content,
        f"What holds the end-effector decides how it buckles: posture {posture}, and what imperfections cost",
        f"Left: compression of posture {posture} under each end condition; solid points are stable, thin lines are "
        "not; a circle is a bifurcation, a triangle a limit point. Right: the largest dead load that a chain with "
        "a hinged end-effector bears, over the bifurcation load of the perfect one, against the size of an "
        "imperfection in the shape of the buckling mode. Grey: the two-thirds law of a symmetric subcritical "
        "bifurcation through the smallest one.",
    )


def most_sensitive(study: EndConditionStudy) -> str:
    """The posture of which the largest imperfection takes most."""
    return min(study.imperfections, key=lambda posture: _shares(study, posture)[-1])


def _perfect(study: EndConditionStudy, posture: str) -> float:
    """Bifurcation load of the perfect chain, hinged under a dead load."""
    return study.paths[posture, HINGED_LOAD, REFINED].events[0].force


def _shares(study: EndConditionStudy, posture: str) -> np.ndarray:
    """Largest force over the perfect chain's bifurcation load, by size."""
    return study.imperfections[posture].force / _perfect(study, posture)


def _subcritical(study: EndConditionStudy, posture: str) -> bool:
    """Whether the load falls behind the bifurcation."""
    first, *others = study.paths[posture, HINGED_LOAD, REFINED].events
    return any(event.force < first.force for event in others[:1])


def _paths(ax: Axes, study: EndConditionStudy, posture: str) -> None:
    longest = max(
        abs(path.points[-1].displacement[0])
        for (label, condition, engine), path in study.paths.items()
        if label == posture and engine == REFINED and "load" not in condition
    )
    for condition in END_CONDITIONS:
        path = study.paths[posture, condition, REFINED]
        along = np.array([abs(point.displacement[0]) for point in path.points])
        force, stable = path.force / 1e3, path.unstable == 0
        colour, line, width = LOOKS[condition]
        ax.plot(along, force, lw=0.7, color=colour, ls=line)
        ax.plot(along, np.where(stable, force, np.nan), lw=width, label=condition, color=colour, ls=line)
        for event in path.events:
            if event.kind in SHARP and event.point is not None:
                displacement = abs(float(event.point.displacement[0]))
                ax.plot(
                    displacement, event.force / 1e3, EVENT_MARKERS[event.kind], color=colour, ms=5.5, mfc="white"
                )
    ax.set(xlabel="displacement in compression, mm", ylabel="force along x, kN", xlim=(0.0, 2.0 * longest))
    ax.set_ylim(0.0, None)
    ax.set_title(f"Posture {posture}")
    ax.legend(loc="lower right")


def _sensitivity(ax: Axes, study: EndConditionStudy) -> None:
    for mark, posture in zip(POSTURE_MARKS, sorted(study.imperfections), strict=False):
        curve, shares = study.imperfections[posture], _shares(study, posture)
        ax.plot(curve.size, shares, marker=mark, ms=4.5, lw=1.3, label=f"posture {posture}")
        if _subcritical(study, posture):
            law = 1.0 - (1.0 - shares[0]) * (curve.size / curve.size[0]) ** (2.0 / 3.0)
            ax.plot(curve.size, law, color="#999999", lw=1.0, ls=":", zorder=1)
    ax.set(xscale="log", xlabel="imperfection, mm", ylabel="largest force over the perfect chain's")
    ax.set_title("dead load, hinged end-effector")
    ax.legend(loc="lower left")


def end_conditions(run: Run) -> ReportFinding | None:
    """What other supports than the paper's find."""
    study = run.end_conditions
    if study is None:
        return None
    hidden, sentences = [], []
    for posture in sorted({posture for posture, _, _ in study.paths}):
        words = [f"{name}: {_critical(study.paths[posture, name, REFINED])}" for name in END_CONDITIONS]
        sentences.append(f"Posture {posture} in compression. {'; '.join(words)}.")
        kinds = [path_metrics(study.paths[posture, name, REFINED]).critical for name in END_CONDITIONS]
        if kinds[0] not in SHARP and any(kind in SHARP for kind in kinds[1:]):
            hidden.append(posture)
    sentences += [_cost(study, posture, curve) for posture, curve in sorted(study.imperfections.items())]
    sentences += _agreement(study)
    if not hidden:
        return ReportFinding(
            Tone.NOTE, "What holds the end-effector does not change how it buckles", tuple(sentences)
        )
    title = (
        f"Imposing the whole pose hides a sharp loss of stability in {listed(hidden)}: "
        "under a dead load or with free rotations there is one"
    )
    return ReportFinding(Tone.CAUSE, title, tuple(sentences))


def _agreement(study: EndConditionStudy) -> list[str]:
    """How far the finite elements' critical forces are from the lumped model's under all end conditions."""
    apart = []
    for (posture, condition, engine), path in study.paths.items():
        ours, theirs = (path_metrics(p).F_cr for p in (study.paths[posture, condition, REFINED], path))
        if engine == FE and ours and theirs:
            apart.append(abs(ours / theirs - 1.0))
    return [f"{REFINED} and {FE} agree on these critical forces within {percent(max(apart))}."] if apart else []


def _critical(path: Path) -> str:
    m = path_metrics(path)
    if m.critical is None:
        return f"no critical point up to {number(m.F_end)} N"
    text = f"{m.critical} at {number(m.F_cr)} N, {number(abs(m.d_cr or 0.0), 3)} mm"
    turns = [
        (event.force, event.point)
        for event in path.events[1:]
        if event.kind is EventKind.LIMIT and event.point is not None
    ]
    if turns and path.load_case.load_driven:
        force, point = turns[0]
        text += f", then the load turns at {number(force)} N, {number(abs(travel(path, point)), 3)} mm"
    return text


def _cost(study: EndConditionStudy, posture: str, curve: ImperfectionCurve) -> str:
    perfect = _perfect(study, posture)
    k = int(np.argmin(np.abs(curve.size - MADE_MM)))
    change = curve.force[k] / perfect - 1.0
    kind = "subcritical" if _subcritical(study, posture) else "supercritical"
    return (
        f"Posture {posture} under a dead load, hinged: the bifurcation is {kind}. Built with a deflection of "
        f"{number(float(curve.size[k]), 2)} mm in the mode's shape the chain bears "
        f"{number(float(curve.force[k]))} N, {percent(change)} {'less' if change < 0.0 else 'more'} than where the "
        "perfect one buckles."
    )


# --- Figures that carry findings: the foot's law, and Table II beside ours ----------------------------------------

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
            displacements = [path.critical.s for path in paths.values() if path.critical]
            window = Window.around(paths)
            ax.set_xlim(0.8 * min(displacements), 1.15 * max(displacements))
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


# --- The chapter on verification: relative errors, convergence, and three engines on the paper's chain ------------

COLOURS = {
    "linear": "#999999", "lumped": "#999999", "bending": "#0072B2", "columns": "#D55E00",
    "post-buckling": "#009E73", "arches": "#CC79A7", "space": "#E69F00", "paper": "#000000",
}  # fmt: skip
"""Of the groups of cases."""
LEAST = 1e-15
"""Errors below are drawn here."""
GUIDES = {"vjm": (2, 4, 10), "exudyn": (2, 4), "opensees": (2, 4)}
"""Orders whose slopes are drawn for comparison, by engine."""

Row = Mapping[str, Any]


def _rows(run: Run) -> list[Row]:
    """Rows of cases; those of runs that knew no cases have no name of one."""
    return [row for row in run.summary.get("verification", ()) if row.get("case")]


def digits_table(run: Run) -> list[dict[str, Any]]:
    """One row a case: fewest digits that agree and range of orders, by engine; the published figures apart."""
    cases: dict[str, dict[str, Any]] = {}
    for row in _rows(run):
        if row["group"] == INVARIANCE or row["engine"] not in TITLES:
            continue
        case = cases.setdefault(row["case"], {"case": row["case"], "group": row["group"], "engines": {}})
        cell = case["engines"].setdefault(row["engine"], {"exact": [], "other": [], "orders": [], "theory": set()})
        cell["not_run"] = row["not_run"]
        cell["failed"] = cell.get("failed", False) or row["passed"] is False
        if row["digits"] is not None:
            cell["exact" if row["kind"] == "exact" else "other"].append(row["digits"])
        if row["kind"] == "exact" and row["order"] is not None:
            cell["orders"].append(row["order"])
            cell["theory"].add(row["theoretical_order"])
    order = list(GROUPS)
    rows = sorted(cases.values(), key=lambda case: (order.index(case["group"]), case["case"]))
    return [
        {"case": case["case"], "group": GROUPS[case["group"]]}
        | {family: _cell(case["engines"].get(family)) for family in TITLES}
        for case in rows
    ]


def _cell(cell: Mapping[str, Any] | None) -> dict[str, Any]:
    """Digits, order and state of one case on one engine, as words."""
    if cell is None:
        return {"digits": "", "order": "", "failed": False}
    if not cell["exact"] and not cell["other"]:
        return {"digits": "gave up" if cell["failed"] else "not run", "order": "", "failed": cell["failed"]}
    digits = number(min(cell["exact"]), 2) if cell["exact"] else f"({number(min(cell['other']), 2)})"
    low, high = (f"{pick(cell['orders']):.1f}" if cell["orders"] else "" for pick in (min, max))
    theory = listed([f"{order:g}" for order in sorted(cell["theory"] - {None})])
    order = f"{low}" if low == high else f"{low}–{high}"
    return {
        "digits": digits,
        "order": f"{order} ({theory})" if order and theory else order,
        "failed": cell["failed"],
    }


def convergence_picture(run: Run) -> Picture | None:
    """Error against mesh of every case with an exact answer, one panel an engine; None without cases."""
    rows = [row for row in _rows(run) if row["kind"] == "exact" and row["group"] != INVARIANCE]
    families = [family for family in MESHED if any(row["engine"] == family and row["values"] for row in rows)]
    if not families:
        return None
    with figure(4.2, len(families), sharey=True) as (fig, axes):
        for ax, family in zip(axes, families, strict=True):
            _errors(ax, family, [row for row in rows if row["engine"] == family])
        axes[0].set_ylabel("relative error")
        shown = [group for group in GROUPS if any(row["group"] == group for row in rows)]
        handles = [Line2D([], [], color=COLOURS[group], label=GROUPS[group]) for group in shown]
        handles.append(Line2D([], [], color="black", ls=":", lw=0.8, label="slopes of order 2, 4 and 10"))
        fig.legend(handles=handles, loc="outside upper center", ncols=4)
        content = drawing_of(fig)
    return Picture(
        "verification",
        content,
        "How fast each engine comes to the exact answer",
        "Error of every quantity with an exact reference against the number of springs or elements of a beam or an "
        "arc. Springs find critical loads of columns with the tenth order, what bends in a plane without shear "
        "with the fourth, and with shear or in space the second. Below 1e-8 errors tell where events are located.",
    )


def _errors(ax: Axes, family: str, rows: Sequence[Row]) -> None:
    top = 1e-2
    for row in rows:
        pairs = [(n, max(e, LEAST)) for n, e in zip(row["meshes"], row["errors"], strict=False) if e is not None]
        if pairs:
            ax.plot(*zip(*pairs, strict=True), marker=".", ms=3, lw=0.8, color=COLOURS[row["group"]], alpha=0.75)
    n = np.array([4.0, 16.0])
    for order in GUIDES[family]:
        ax.plot(n, top * (n / n[0]) ** -float(order), color="black", ls=":", lw=0.8)
    ax.set(xscale="log", yscale="log", xlabel="springs" if family == "vjm" else "elements", title=family)
    ax.set_xticks([2, 4, 8, 16, 32, 64], ["2", "4", "8", "16", "32", "64"], minor=False)
    ax.minorticks_off()
    ax.set_ylim(LEAST, 1.0)


def verified(run: Run) -> ReportFinding | None:
    """What verification found, in words."""
    rows = _rows(run)
    if not rows:
        return None
    ran = [row for row in rows if row["passed"] is not None]
    cases = {row["case"] for row in ran if row["group"] in GROUPS}
    failed = [row for row in ran if not row["passed"]]
    sentences = [
        f"{len(ran)} answers to {len(cases)} cases, {len(rows) - len(ran)} not given because an engine is not "
        f"installed or cannot express the case; {len(failed)} miss."
    ]
    for family in MESHED:
        worst = [
            row["error"] for row in ran if row["engine"] == family and row["kind"] == "exact" and row["meshes"]
        ]
        given = [error for error in worst if error is not None]
        if given:
            sentences.append(f"{family}: largest error on the finest mesh {number(max(given), 2)}.")
    if failed:
        names = listed(sorted({row["name"] for row in failed}))
        return ReportFinding(
            Tone.FAILED, f"Verification: {len(failed)} answers miss", (*sentences, f"Look at {names}.")
        )
    return ReportFinding(Tone.AGREES, "Every solver meets every case with a known answer", tuple(sentences))
