"""The chapters on whole robots and on the suite's own discovery."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from vjm.continuation.path import Path
from vjm_output.number_text import DASH, listed, number, percent
from vjm_output.plots import (
    EVENT_MARKERS,
    FE,
    FOOT_SPRING,
    PAPER,
    REFINED,
    Picture,
    drawing_of,
    engine_style,
    figure,
)
from vjm_validation.metrics import force_difference
from vjm_validation.page_content import ReportTable
from vjm_validation.report.figures import draw_force, legend
from vjm_validation.report.words import ReportFinding, Tone
from vjm_validation.studies.chain import CAUSE, Discovery, DiscoveryStudy, Run
from vjm_validation.studies.robots import (
    COMPARED,
    LARGEST,
    LOAD,
    REACH,
    ROBOT,
    SECOND_ENGINE,
    TOO_LONG,
    MisfitRow,
    PlatformStiffnessRow,
    RobotCriticalRow,
    Robots,
    RobotStudy,
)

# --- The chapter on whole robots: the Orthoglide loaded, its critical forces, errors of assembly, and the others---

AGREEMENT = 0.005
"""Relative difference up to which the robot's stiffness and critical forces are said to agree."""
SHOWN = 1e-6
"""Of a row's scale: what is less is none."""
COMMAND = "`validate all --only robots`."


def robots(run: Run) -> ReportFinding | None:
    """What the whole robots show."""
    if run.robots is None:
        return None
    rows = run.robots.rows
    worst = max(row.difference for row in rows.stiffness if row.robot == ROBOT)
    others = max(row.difference for row in rows.stiffness if row.robot != ROBOT)
    apart = max(worst, _apart(_forces(rows, "-x"), REFINED))
    agree = apart <= AGREEMENT
    words = "and finite elements agree within" if agree else "miss the finite elements by"
    title = f"The whole Orthoglide: refined chains {words} {percent(apart)}"
    sentences = [
        f"Its platform's six stiffnesses, free of load and under {LOAD:g} N along and against each axis, differ by "
        f"{percent(worst)} at most at the isotropic point and at both corners of the workspace. Those of the "
        f"others ({listed(sorted({row.robot for row in rows.stiffness} - {ROBOT}))}) by {percent(others)}.",
        *_pressed(rows),
        *_pulled(rows),
        _misfit(rows.misfit),
    ]
    mobility = [f"{row.robot} at {row.pose}" for row in rows.mobility if not row.holds]
    sentences.append(
        f"Mobility, degree of overconstraint and rank of K are not theory's in {listed(mobility)}."
        if mobility
        else "Mobility, degree of overconstraint and rank of K are theory's in every pose of all robots."
    )
    return ReportFinding(Tone.AGREES if agree else Tone.DIFFERS, title, tuple(sentences))


def _forces(rows: Robots, direction: str) -> dict[str, dict[str, RobotCriticalRow]]:
    """Critical rows of one direction by pose and engine."""
    by_pose: dict[str, dict[str, RobotCriticalRow]] = {}
    for row in rows.critical:
        if row.direction == direction:
            by_pose.setdefault(row.pose, {})[row.engine] = row
    return by_pose


def _apart(by_pose: dict[str, dict[str, RobotCriticalRow]], label: str) -> float:
    """Largest relative difference of an engine's critical forces from the finite elements'."""
    gaps = []
    for engines in by_pose.values():
        ours, theirs = engines[label].F_cr, engines[FE].F_cr
        if ours and theirs:
            gaps.append(abs(ours / theirs - 1.0))
        elif ours or theirs:  # one has none
            gaps.append(float("inf"))
    return max(gaps, default=0.0)


def _pressed(rows: Robots) -> list[str]:
    by_pose = _forces(rows, "-x")
    where = [
        f"{number(engines[FE].F_cr)} N at {pose} (leg {engines[FE].first_leg})"
        for pose, engines in by_pose.items()
        if engines[FE].F_cr
    ]
    if not where:
        return [f"Pressed against x, {FE} stays stable up to {LARGEST:g} N."]
    legs = {engines[label].first_leg or "" for engines in by_pose.values() for label in COMPARED} - {""}
    same = f"In all engines leg {legs.pop()}" if len(legs) == 1 else f"Legs {listed(sorted(legs))}"
    second = ""
    if all(SECOND_ENGINE.label in engines for engines in by_pose.values()):
        second = f" {SECOND_ENGINE.label.capitalize()} has it to {percent(_apart(by_pose, SECOND_ENGINE.label))}."
    text = (
        f"Pressed against x, the free platform loses its stability at {listed(where)} with finite elements. It is "
        f"the same with {REFINED} to {percent(_apart(by_pose, REFINED))} and with {FOOT_SPRING}, the foot as one "
        f"spring, to {percent(_apart(by_pose, FOOT_SPRING))}. {same} loses stability first." + second
    )
    return [text]


def _pulled(rows: Robots) -> list[str]:
    by_pose = _forces(rows, "+x")
    artefact = [
        f"{number(engines[PAPER].F_cr)} N at {pose}" for pose, engines in by_pose.items() if engines[PAPER].F_cr
    ]
    real = [pose for pose, engines in by_pose.items() if any(engines[label].F_cr for label in COMPARED)]
    sentences = []
    if artefact:
        rest = f"the others lose theirs too at {listed(real)}" if real else f"no other does up to {LARGEST:g} N"
        sentences.append(
            f"Pulled along x, the robot of the paper's chains buckles at {listed(artefact)}; {rest}: the artefact "
            "of one spring a link is the whole robot's too."
        )
    for pose, engines in _forces(rows, "-x").items():
        ours, theirs = engines[PAPER], engines[FE]
        if ours.F_cr and theirs.F_cr and ours.first_leg != theirs.first_leg:
            sentences.append(
                f"Pressed at {pose} it buckles at {number(ours.F_cr)} N by leg {ours.first_leg}, which is "
                f"pulled there, long before leg {theirs.first_leg} at {number(theirs.F_cr)} N."
            )
    return sentences


def _misfit(rows: list[MisfitRow]) -> str:
    worst = max(row.difference for row in rows)
    prestressed = [row for row in rows if "against" not in row.what and row.quantity.startswith("force")]
    most = {name: max(r.exudyn for r in prestressed if r.robot == name) for name in {r.robot for r in prestressed}}
    parts = [
        f"{number(force, 3)} N in {name}" if force > SHOWN * LOAD else f"none in {name}"
        for name, force in sorted(most.items())
    ]
    return (
        f"A bar {TOO_LONG:g} mm too long: the forces that it leaves in the unloaded machine are {listed(parts)}. "
        f"Where the platform goes and what the beams bear, loaded and not, is Exudyn's to {percent(worst)}."
    )


# --- tables -----------------------------------------------------------------------------------------------


def robot_tables(rows: Robots) -> list[ReportTable]:
    """Stiffness, critical forces, errors of assembly and mobility."""
    return [_stiffness(rows.stiffness), _critical(rows.critical), _misfits(rows.misfit), _mobility(rows)]


def _stiffness(rows: list[PlatformStiffnessRow]) -> ReportTable:
    table = [
        (
            row.robot,
            row.pose,
            "none" if row.load == "none" else row.load.replace("-", "−"),
            ", ".join(number(v) for v in row.vjm),
            ", ".join(number(v) for v in row.exudyn),
            percent(row.difference),
        )
        for row in rows
    ]
    caption = (
        f"Eigenvalues of the platform's stiffness, turns over the longest part's length, N/mm; load: {LOAD:g} N on "
        f"the free platform. Made by {COMMAND}"
    )
    return ReportTable(caption, ("robot", "pose", "load", REFINED, FE, "largest difference"), tuple(table), words=3)


def _critical(rows: list[RobotCriticalRow]) -> ReportTable:
    table = [
        (
            row.pose,
            row.direction.replace("-", "−"),
            row.engine,
            str(row.kind or DASH),
            number(row.F_cr),
            (row.first_leg or DASH),
        )
        for row in rows
    ]
    caption = (
        f"The Orthoglide's free platform under a dead force along x, up to {LARGEST:g} N: where it first loses its "
        f"stability. Made by {COMMAND}"
    )
    header = ("pose", "along", "engine", "event", "force, N", "leg that loses stability")
    return ReportTable(caption, header, tuple(table), words=4)


def _misfits(rows: list[MisfitRow]) -> ReportTable:
    table = [
        (row.robot, row.what, row.quantity, number(row.vjm), number(row.exudyn), percent(row.difference))
        for row in rows
        if abs(row.exudyn) > SHOWN * row.scale
    ]
    caption = f"A part too long at Q1; differences over the largest of their kind. Made by {COMMAND}"
    header = ("robot", "what", "quantity", REFINED, FE, "difference")
    return ReportTable(caption, header, tuple(table), words=3)


def _mobility(rows: Robots) -> ReportTable:
    table = [
        (row.robot, row.pose, *(f"{a} ({b})" for a, b in zip(computed, row.theory, strict=True)))
        for row in rows.mobility
        for computed in [(row.freedom, row.overconstraint, row.rank)]
    ]
    caption = f"Mobility, found and by theory (in brackets). Made by {COMMAND}"
    header = ("robot", "pose", "freedom", "degree of overconstraint", "rank of K, drives held")
    return ReportTable(caption, header, tuple(table), words=2)


# --- figures ----------------------------------------------------------------------------------------------


def robot_pictures(study: RobotStudy) -> list[Picture]:
    """Force-displacement curves and critical forces."""
    return [_curves(study), _bars(study.rows)] if study.curves else [_bars(study.rows)]


def _curves(study: RobotStudy) -> Picture:
    poses = list(dict.fromkeys(pose for pose, _, _ in study.curves))
    apart = max(
        force_difference(study.curves[pose, sign, REFINED], study.curves[pose, sign, FE])
        / float(np.max(study.curves[pose, sign, FE].force))
        for pose in poses
        for sign in (1, -1)
    )
    with figure(3.0, len(poses)) as (fig, axes):
        for ax, pose in zip(axes, poses, strict=True):
            for label in (FE, REFINED, PAPER):
                for sign in (1, -1):
                    draw_force(ax, label, study.curves[pose, sign, label], sign)
            ax.axhline(0.0, color="#888888", lw=0.6)
            ax.axvline(0.0, color="#888888", lw=0.6)
            ax.set(title=pose, xlabel="displacement along x, mm", xlim=(-REACH, REACH))
        axes[0].set_ylabel("force, kN")
        legend(fig, axes)
        content = drawing_of(fig)
    return Picture(
        "robot_curves",
        content,
        "The whole Orthoglide pulled and pressed along x",
        f"Force against displacement, the rest of the platform's pose held. {REFINED} and {FE} differ by at most "
        f"{percent(apart)} of the largest force. Made by {COMMAND}",
    )


def _bars(rows: Robots) -> Picture:
    labels = [
        label
        for label in (PAPER, FOOT_SPRING, REFINED, FE, SECOND_ENGINE.label)
        if any(r.engine == label for r in rows.critical)
    ]
    poses = list(dict.fromkeys(row.pose for row in rows.critical))
    width = 0.8 / len(labels)
    with figure(2.8, 2, sharey=True) as (fig, axes):
        for ax, (direction, title) in zip(axes, {"-x": "pressed against x", "+x": "pulled along x"}.items(),
                                          strict=True):  # fmt: skip
            by_pose = _forces(rows, direction)
            for k, label in enumerate(labels):
                positions = np.arange(len(poses)) + (k - 0.5 * (len(labels) - 1)) * width
                if any(label not in by_pose[pose] for pose in poses):
                    # asked for the other direction only
                    continue
                force = [by_pose[pose][label].F_cr or 0.0 for pose in poses]
                ax.bar(positions, np.array(force) / 1e3, width, color=engine_style(label).colour, label=label)
                for x, value in zip(positions, force, strict=True):
                    if not value:
                        ax.text(x, 0.0, "none", rotation=90, ha="center", va="bottom", fontsize=6.5)
            ax.set_xticks(np.arange(len(poses)), poses)
            ax.set(title=title)
        axes[0].set_ylabel("critical force, kN")
        handles, names = axes[0].get_legend_handles_labels()
        fig.legend(handles, names, loc="outside upper center", ncols=len(labels))
        content = drawing_of(fig)
    return Picture(
        "robot_critical",
        content,
        "Critical forces of the whole Orthoglide",
        f"Dead force along x on the free platform at which it loses its stability; none: stable up to {LARGEST:g} "
        f"N. Made by {COMMAND}",
    )


# --- The chapter on the suite's own discovery: a diagnosis that finds what the paper's lumped link gets wrong -----

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


def discovery_picture(study: DiscoveryStudy) -> Picture:
    """Readings and both models, in tension and in compression."""
    styles = engine_style(PAPER), engine_style(REFINED)
    with figure(2.9, 2) as (fig, axes):
        for k, (ax, name) in enumerate(zip(axes, ("tension", "compression"), strict=True)):
            sign = 1.0 if k == 0 else -1.0
            on = sign * study.displacement >= 0.0
            ax.plot(
                sign * study.displacement[on], sign * study.force[on] / 1e3, ".", ms=3.5,
                color=engine_style(FE).colour, label="readings of finite elements", zorder=3,
            )  # fmt: skip
            for paths, style, label in zip((study.nominal, study.extended), styles, (SHEET, EXTENDED), strict=True):
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
