"""The words about lumping: how the link's artefact fades with springs, and which foot is right."""

from __future__ import annotations

import numpy as np

from vjm.chain import FOOT
from vjm.paths import Path
from vjm_validation.report.proofs import FOOT_ENGINES, PLACES, lumping_pair
from vjm_validation.report.style import FE, FE_FOOT_SPRING, FOOT_SPRING, REFINED, listed, number, percent
from vjm_validation.report.words import SHARP, engine_metrics
from vjm_validation.run import Direction, Key, LumpingStudy, Run

SAME_FOOT = 0.01
"""Up to this relative difference in displacement two feet are said to be the same."""

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
        for place, title in PLACES.items():
            rows = _rows(compression, place)
            if rows:
                sentences.append(_approach(compression, title, rows))
    if tension is not None:
        rows = _rows(tension, "end")
        found = {n: force for n, force in rows.items() if force is not None}
        gone = [n for n, force in rows.items() if force is None and n > max(found, default=0)]
        if found:
            forces = listed([f"{number(force)} N with {n}" for n, force in found.items()])
            after = f", and is off the path from {gone[0]} springs on" if gone else ""
            sentences.append(f"The bifurcation in tension (springs at far ends) moves away: {forces}{after}.")
    return sentences


def _rows(study: LumpingStudy, place: str) -> dict[int, float | None]:
    return {n: force for at, n, force in sorted(study.rows, key=lambda row: row[1]) if at == place}


def _approach(study: LumpingStudy, title: str, rows: dict[int, float | None]) -> str:
    n, last = list(rows.items())[-1]
    never = [str(count) for count, force in rows.items() if force is None]
    text = f"Springs {title}, posture {study.posture} in {study.direction}: "
    if never:
        text += f"with {listed(never)} none buckles; "
    text += f"with {n} " + (f"the critical force is {number(last)} N" if last is not None else "none is found")
    if last is not None and study.reference is not None:
        text += f", {percent(last / study.reference - 1.0)} from the finite elements"
    return text + "."


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
        "Cause: a spring by (22) takes its matrix's lever arms in the unturned base frame, so that the tip moves "
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
