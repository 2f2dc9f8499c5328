"""What a run found, in words. Every number and every claim comes from the run; without data, no sentence."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vjm.continuation.path import Path
from vjm.model.load_case import Direction
from vjm.model.machine import FOOT
from vjm_output.number_text import listed, number, percent
from vjm_output.plots import FE, FE_FOOT_SPRING, FOOT_SPRING, LINEAR, MSA, PAPER, REFINED
from vjm_validation.report.chapter_figures import (
    FOOT_ENGINES,
    converged,
    end_conditions,
    forces,
    lumping_pair,
    place_name,
    places,
    verified,
)
from vjm_validation.report.chapters import discovery, robots
from vjm_validation.report.figures import worst_difference
from vjm_validation.report.words import (
    SHARP,
    ReportFinding,
    Tone,
    at_critical,
    bends,
    critical_points,
    engine_metrics,
    failed_acceptance,
    short,
    within,
)
from vjm_validation.studies.chain import Key, LumpingStudy, Run

# --- The words about lumping: how the link's artefact fades with springs, and which foot is right -----------------

SAME_FOOT = 0.01
"""Up to this relative difference in displacement two feet are said to be the same."""
CLOSE = 1e-3
"""Relative error of a critical force that is said to be close: far below what the data of a real machine allow."""

FOOT_TITLES = {
    FOOT_SPRING: "one spring by (22)",
    FE_FOOT_SPRING: "Exudyn's 6×6 spring",
    REFINED: "16 springs along the foot",
    FE: "the foot as a finite element beam",
}


def lumping_evidence(run: Run) -> list[str]:
    """How the critical force moves as the bar gets more springs."""
    tension, compression = lumping_pair(run)
    sentences = []
    if compression is not None:
        sentences += [_approach(compression, place) for place in places(compression)]
        sentences += _needed(compression)
    if tension is not None:
        spurious = [text for place in places(tension) if (text := _spurious(tension, place))]
        if spurious:
            sentences.append(f"The bifurcation in tension moves away as springs are added: {'; '.join(spurious)}.")
    return sentences


def _approach(study: LumpingStudy, place: str) -> str:
    rows = forces(study, place)
    n, last = list(rows.items())[-1]
    never = [str(count) for count, force in rows.items() if force is None]
    text = f"Posture {study.posture} in {study.direction}, {place_name(place)}: "
    if never:
        text += f"with {listed(never)} none buckles; "
    text += f"with {n} " + (f"the critical force is {number(last)} N" if last is not None else "none is found")
    if last is not None and study.reference is not None:
        text += f", {percent(last / study.reference - 1.0)} from the finite elements"
    return text + "."


def _needed(study: LumpingStudy) -> list[str]:
    """How many springs each placement takes to come close to the converged force."""
    finest = converged(study)
    if finest is None:
        return []
    most = max(n for _, n, _ in study.rows)
    needed = []
    for place in places(study):
        off = [n for n, f in forces(study, place).items() if f is None or abs(f / finest[1] - 1.0) > CLOSE]
        enough = [n for n in forces(study, place) if n > max(off, default=0)]
        needed.append(f"{place_name(place)}: {enough[0] if enough else f'more than {most}'}")
    return [
        f"Number of springs, of those tried, from which the critical force is within {percent(CLOSE)} of the "
        f"converged {number(finest[1])} N: {'; '.join(needed)}."
    ]


def _spurious(study: LumpingStudy, place: str) -> str:
    """Bifurcations that one placement has in tension; empty where it has none."""
    rows = forces(study, place)
    bifurcations = {n: force for n, force in rows.items() if force is not None}
    if not bifurcations:
        return ""
    gone = [n for n, force in rows.items() if force is None and n > max(bifurcations)]
    after = f", none on the path from {gone[0]} on" if gone else ""
    return (
        f"{place_name(place)} {listed([f'{number(force)} N with {n}' for n, force in bifurcations.items()])}{after}"
    )


def foot_law(run: Run) -> tuple[str, tuple[str, ...], bool] | None:
    """Title, sentences, and whether the run decides which foot is right; None without two sorts of feet."""
    metrics = {label: engine_metrics(run, Direction.COMPRESSION, label) for label in FOOT_ENGINES}
    feet = {label: {p: m for p, m in by.items() if m["critical"]} for label, by in metrics.items()}
    shared = sorted(feet[FOOT_SPRING].keys() & feet[REFINED].keys() & feet[FE].keys())
    if not shared:
        return None
    shift = {
        label: {p: by[p]["d_cr"] / feet[FE][p]["d_cr"] - 1.0 for p in shared if p in by}
        for label, by in feet.items()
    }
    worst = {label: max(map(abs, by.values())) for label, by in shift.items() if by}
    force = {
        label: max(abs(by[p]["F_cr"] / feet[FE][p]["F_cr"] - 1.0) for p in shared if p in by)
        for label, by in feet.items()
        if label in worst
    }
    sharp = [p for p in shared if feet[FE][p]["critical"] in SHARP] or shared
    p = max(sharp, key=lambda posture: abs(shift[FOOT_SPRING][posture]))
    values = [
        f"{number(by[p]['d_cr'])} mm ({FOOT_TITLES[label]}, {label})" for label, by in feet.items() if p in by
    ]
    sentences = [
        "All these feet have the same unloaded matrix (19). "
        f"Critical displacement of posture {p} in compression: {listed(values)}.",
        f"Over {listed(shared)} the one spring by (22) is off by up to {percent(worst[FOOT_SPRING])} in "
        f"displacement and {percent(force[FOOT_SPRING])} in force.",
    ]
    if FE_FOOT_SPRING in worst:
        sentences.append(
            f"{FOOT_TITLES[FE_FOOT_SPRING]}, another law, is off by up to {percent(worst[FE_FOOT_SPRING])} in "
            f"displacement and {percent(force[FE_FOOT_SPRING])} in force."
        )
    decided = worst[REFINED] <= SAME_FOOT and worst[FOOT_SPRING] > 2.0 * worst[REFINED]
    if not decided:
        title = "This run does not decide which law of the lumped foot is right"
        sentences.append(
            f"Foot with many springs and foot as a finite element beam differ by up to {percent(worst[REFINED])}."
        )
        return title, tuple(sentences), False
    sentences.append(
        f"The foot as a beam is right: many springs and finite elements agree within {percent(worst[REFINED])}, "
        "and they share nothing but the beam's data."
    )
    turned = tip_rotation(run.paths.get(Key(p, Direction.COMPRESSION, REFINED)))
    if turned is not None:
        sentences.append(f"At the critical point of {p} the foot's tip has turned by {number(turned, 2)} rad.")
    sentences.append(
        "Cause: a spring by (22) takes its matrix's lever arms in the unturned base frame. So the tip moves "
        "on a straight line where the real one moves on an arc."
    )
    title = (
        f"One spring by (22) for the foot misplaces the critical displacement by up to "
        f"{percent(worst[FOOT_SPRING])}; the foot as a beam is right"
    )
    return title, tuple(sentences), True


def tip_rotation(path: Path | None) -> float | None:
    """Angle by which the foot's last piece has turned at the critical point, rad; None where unknown."""
    if path is None or path.critical is None or path.critical.point is None:
        return None
    rows = [row for row, station in enumerate(path.stations) if station.part == FOOT]
    if len(rows) < 2:
        return None
    before, after = (
        point.shape[rows[-1]] - point.shape[rows[-2]] for point in (path.points[0], path.critical.point)
    )
    return float(np.arctan2(np.linalg.norm(np.cross(before, after)), before @ after))


# ------------------------------------------------------------------------------------------------------------------


AGREEMENT = 0.02
"""Up to this relative difference two engines are said to agree."""
REPRODUCTION = 0.05
"""Up to this relative difference a force of the paper, whose input has two digits, is said to be reproduced."""


def findings(run: Run, no_renders: str = "") -> list[ReportFinding]:
    """All findings in the order in which a reader needs them.

    Args:
        run: what was computed.
        no_renders: why there are no renders, empty where there are.
    """
    parts: Sequence[tuple[Callable[[Run], ReportFinding | None], str]] = (
        (_failed_acceptance, "checks"),
        (no_finite_elements, ""),
        (paper_model, "table2"),
        (link_lumping, "lumping"),
        (refined_agreement, "postures"),
        (foot, "foot"),
        (end_conditions, "end-conditions"),
        (published, "table2"),
        (robots, "robots"),
        (discovery, "discovery"),
        (conventional, "postures"),
        (verified, "verification"),
        (stopped_paths, ""),
        (left_out, ""),
    )
    report_findings = [
        replace(finding, chapter=chapter) for part, chapter in parts if (finding := part(run)) is not None
    ]
    if no_renders:
        text = f"Off-screen rendering is impossible on this machine: {no_renders}. All numbers are complete."
        report_findings.append(ReportFinding(Tone.NOTE, "No renders in this report", (text,)))
    return report_findings


def _failed_acceptance(run: Run) -> ReportFinding | None:
    return failed_acceptance(run.summary.get("acceptance", ()))


def no_finite_elements(run: Run) -> ReportFinding | None:
    """Said where the comparison's other side is missing."""
    if run.robots is not None:
        return None
    studied = run.end_conditions.paths if run.end_conditions is not None else ()
    compared = run.discovery is not None or any(key.engine == FE for key in run.paths)
    if compared or any(engine == FE for _, _, engine in studied):
        return None
    text = f"This run has no path of {FE}. What follows compares lumped models and the paper only."
    return ReportFinding(Tone.NOTE, "Nothing here is compared with finite elements", (text,))


def paper_model(run: Run) -> ReportFinding | None:
    """Whether the paper's own model buckles as published."""
    pulled, pushed = (engine_metrics(run, direction, PAPER) for direction in Direction)
    if not pulled:
        return None
    sharp = {p: m for p, m in pulled.items() if m["critical"] in SHARP}
    table = {(row["posture"], row["quantity"]): row["published"] for row in run.summary.get("published", ())}
    sentences, misses = [], []
    for posture, m in sharp.items():
        text = f"Posture {posture}: {at_critical(m)}"
        force, shift = table.get((posture, "F_cr")), table.get((posture, "d_cr"))
        if force and shift:
            misses.append(abs(m["F_cr"] / force - 1.0))
            text += f" (published: {force:g} N, {shift:g} mm)"
        if m["K1"] is not None and m["K2"] is not None:
            text += f"; its stiffness falls from {number(m['K1'])} to {number(m['K2'])} N/mm"
        sentences.append(text + ".")
    sentences += bends(pulled)
    quiet = {p: m for p, m in pushed.items() if m["critical"] is None}
    if sharp and quiet:
        sentences.append(f"Pushed, it has no critical point {within(quiet)}.")
    if not sharp:
        title, tone = "The paper's model has no sharp critical point in tension", Tone.DIFFERS
    elif misses and max(misses) <= REPRODUCTION:
        title = (
            f"The paper's model ({PAPER}) reproduces its published buckling force within "
            f"{percent(max(misses))}, in tension"
        )
        tone = Tone.AGREES
    else:
        title, tone = f"The paper's model ({PAPER}) buckles in tension", Tone.DIFFERS
        if misses:
            title += f", but its force misses the published one by up to {percent(max(misses))}"
    return ReportFinding(tone, title, tuple(sentences))


def link_lumping(run: Run) -> ReportFinding | None:
    """What the same parts do as beams, and why the lumped link does the opposite."""
    pulled, pushed = (engine_metrics(run, direction, FE) for direction in Direction)
    paper_pulled, paper_pushed = (engine_metrics(run, direction, PAPER) for direction in Direction)
    if not pulled and not pushed:
        return None
    sentences = []
    free = {p: m for p, m in pulled.items() if m["critical"] is None}
    if free and len(free) == len(pulled):
        sentences.append(f"Pulled, {FE} has no critical point {within(free)}.")
    elif pulled:
        loose = {p: m for p, m in pulled.items() if p not in free}
        sentences.append(f"Pulled, {FE} has a critical point too: {critical_points(loose)}.")
    sharp = {p: m for p, m in pushed.items() if m["critical"] in SHARP}
    if sharp:
        sentences.append(f"Pushed, {FE} buckles: {critical_points(sharp)}.")
        falls = [
            f"from {number(m['K1'])} to {number(m['K2'])} N/mm in {p}"
            for p, m in sharp.items()
            if m["K1"] is not None and m["K2"] is not None
        ]
        if falls:
            sentences.append(f"Its stiffness falls {listed(falls)}.")
    sentences += bends(pushed)
    never = [
        f"{number(paper_pushed[p]['F_end'])} N at {short(paper_pushed[p]['d_end'])} mm in {p}"
        for p, m in pushed.items()
        if m["critical"] and p in paper_pushed and paper_pushed[p]["critical"] is None
    ]
    if never:
        sentences.append(
            f"There {PAPER} never loses stability: it carries {listed(never)}, which a real chain would not."
        )
    proof = [
        p
        for p, m in paper_pulled.items()
        if m["critical"] in SHARP
        and p in free
        and pushed.get(p, {}).get("critical") in SHARP
        and paper_pushed.get(p, {"critical": "unknown"})["critical"] is None
    ]
    if not proof and all((pulled, pushed, paper_pulled, paper_pushed)):
        title = "The finite elements do not show the published buckling to be an artefact of the lumping"
        return ReportFinding(Tone.DIFFERS, title, tuple(sentences))
    if not proof:
        return ReportFinding(Tone.NOTE, "What the finite elements do on the paths of this run", tuple(sentences))
    where = f"{'posture' if len(proof) == 1 else 'postures'} {listed(proof)}"
    title = f"The buckling in tension is an artefact: beams buckle in compression (link_lumping, {where})"
    cause = (
        "Cause: a translational spring at the end of a rigid link moves the pins apart when it deflects "
        "sideways, whatever its sign. Pulling therefore makes the link lean and pushing holds it straight. A "
        "beam does the opposite: bending brings its ends together."
    )
    return ReportFinding(Tone.CAUSE, title, (cause, *sentences, *lumping_evidence(run)))


def refined_agreement(run: Run) -> ReportFinding | None:
    """How far the lumped model with many springs is from the finite elements."""
    worst: dict[str, tuple[float, str]] = {}
    kinds = []

    def keep(what: str, value: float, where: str) -> None:
        worst[what] = max(worst.get(what, (0.0, where)), (value, where))

    for direction in Direction:
        ours, theirs = (engine_metrics(run, direction, label) for label in (REFINED, FE))
        for p in ours.keys() & theirs.keys():
            where = f"posture {p} in {direction}"
            lumped, reference = (run.paths.get(Key(p, direction, label)) for label in (REFINED, FE))
            if lumped is not None and reference is not None:
                keep("Force at equal displacement differs", worst_difference(lumped, reference), where)
            if ours[p]["critical"] != theirs[p]["critical"]:
                kinds.append(where)
            elif ours[p]["critical"]:
                keep("Critical force differs", abs(ours[p]["F_cr"] / theirs[p]["F_cr"] - 1.0), where)
                keep("Critical displacement differs", abs(ours[p]["d_cr"] / theirs[p]["d_cr"] - 1.0), where)
    if not worst:
        return None
    largest = percent(max(value for value, _ in worst.values()))
    sentences = [f"{what} by at most {percent(value)} ({where})." for what, (value, where) in worst.items()]
    if kinds:
        sentences.append(f"The kind of the first critical point differs: {listed(sorted(kinds))}.")
    if not kinds and max(value for value, _ in worst.values()) <= AGREEMENT:
        title = f"With enough springs ({REFINED}) the lumped model agrees with the finite elements within {largest}"
        return ReportFinding(Tone.AGREES, title, tuple(sentences))
    title = (
        f"Even with many springs ({REFINED}) the lumped model differs from the finite elements by up to {largest}"
    )
    return ReportFinding(Tone.DIFFERS, title, tuple(sentences))


def foot(run: Run) -> ReportFinding | None:
    """Which law of the lumped foot is right."""
    words = foot_law(run)
    if words is None:
        return None
    title, sentences, decided = words
    return ReportFinding(Tone.CAUSE if decided else Tone.DIFFERS, title, sentences)


def published(run: Run) -> ReportFinding | None:
    """Which figures of Table II are reached."""
    rows = [row for row in run.summary.get("published", ()) if row["ours"] is not None]
    fair = [row for row in rows if not row["definition_differs"]]
    if not fair:
        return None
    sought = [row for row in fair if row["inside"] is not None]
    outside = [row for row in sought if not row["inside"]]
    sentences = []
    if outside:
        sentences.append(f"Not reached: {'; '.join(_outside(row) for row in outside)}.")
    if other := [row for row in rows if row["definition_differs"]]:
        names = listed([f"{row['quantity']} of {row['posture']}" for row in other])
        sentences.append(f"Not counted, because there is no sharp critical point to read them at: {names}.")
    if not sought:
        farthest = max(fair, key=lambda row: abs(row["ratio"] - 1.0))
        title = (
            f"Ours differ from {len(fair)} comparable figures of Table II by up to "
            f"{percent(farthest['ratio'] - 1.0)} ({farthest['quantity']} of {farthest['posture']})"
        )
        sentences.append("What the rounding of the printed matrices can reach was not sought in this run.")
        return ReportFinding(Tone.NOTE, title, tuple(sentences))
    title = (
        f"{len(sought) - len(outside)} of {len(sought)} comparable figures of Table II lie within what the "
        "rounding of the printed matrices can reach"
    )
    return ReportFinding(Tone.DIFFERS if outside else Tone.AGREES, title, tuple(sentences))


def _outside(row: Mapping[str, Any]) -> str:
    reach = ""
    if row["reach_low"] is not None and row["reach_high"] is not None:
        reach = f", reach {number(row['reach_low'])} to {number(row['reach_high'])}"
    return (
        f"{row['quantity']} of {row['posture']} (published {row['published']:g} {row['unit']}, ours "
        f"{number(row['ours'])}{reach})"
    )


def conventional(run: Run) -> ReportFinding | None:
    """What the usual models say."""
    sentences = []
    for label in (LINEAR, MSA):
        ours, theirs = (engine_metrics(run, Direction.COMPRESSION, name) for name in (label, FE))
        both = sorted(ours.keys() & theirs.keys())
        if both:
            start = max(abs(ours[p]["K0"] / theirs[p]["K0"] - 1.0) for p in both)
            end = {p: ours[p]["K0"] * theirs[p]["d_end"] / theirs[p]["F_end"] for p in both}
            p = max(end, key=lambda posture: end[posture])
            sentences.append(
                f"{label} has the unloaded stiffness of {FE} within {percent(start)} and knows no critical "
                f"point. Pushed to {short(theirs[p]['d_end'])} mm, posture {p} would carry {number(end[p], 2)} "
                "times the force."
            )
    if not sentences:
        return None
    return ReportFinding(Tone.NOTE, "What the conventional models say", tuple(sentences))


def left_out(run: Run) -> ReportFinding | None:
    """What the run itself says that it left out."""
    notes = run.summary.get("notes", ())
    return ReportFinding(Tone.NOTE, "Left out of this run", tuple(f"{note}." for note in notes)) if notes else None


def stopped_paths(run: Run) -> ReportFinding | None:
    """Paths that did not reach their end."""
    stopped = [
        f"Posture {key.posture} in {key.direction}, {key.engine}: ends at {short(path.s[-1])} mm, {path.stopped}."
        for key, path in sorted(run.paths.items())
        if path.stopped
    ]
    if not stopped:
        return None
    return ReportFinding(Tone.NOTE, f"{len(stopped)} paths end before their load case does", tuple(stopped))
