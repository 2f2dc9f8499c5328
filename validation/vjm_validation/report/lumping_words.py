"""The words about lumping: how the link's artefact fades with springs, and which foot is right."""

from __future__ import annotations

import numpy as np

from vjm.continuation.direction import Direction
from vjm.continuation.path import Path
from vjm.model.machine import FOOT
from vjm_output.number_text import listed, number, percent
from vjm_output.plot_style import FE, FE_FOOT_SPRING, FOOT_SPRING, REFINED
from vjm_validation.report.lumping_figures import converged, forces, lumping_pair, place_name, places
from vjm_validation.report.proofs import FOOT_ENGINES
from vjm_validation.report.words import SHARP, engine_metrics
from vjm_validation.studies.study_results import Key, LumpingStudy, Run

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
    found = {n: force for n, force in rows.items() if force is not None}
    if not found:
        return ""
    gone = [n for n, force in rows.items() if force is None and n > max(found)]
    after = f", none on the path from {gone[0]} on" if gone else ""
    return f"{place_name(place)} {listed([f'{number(force)} N with {n}' for n, force in found.items()])}{after}"


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
