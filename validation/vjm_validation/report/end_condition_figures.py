"""The figure and the words of the end conditions: what the support decides, and what imperfections cost."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from vjm.continuation.imperfections import ImperfectionCurve
from vjm.continuation.path import EventKind, Path, travel
from vjm_output.number_text import listed, number, percent
from vjm_output.plot_style import EVENT_MARKERS, FE, REFINED, Picture, drawing_of, figure
from vjm_validation.metrics import path_metrics
from vjm_validation.report.words import SHARP, ReportFinding, Tone
from vjm_validation.studies.end_conditions import END_CONDITIONS, HINGED_LOAD
from vjm_validation.studies.study_results import EndConditionStudy, Run

LOOKS: dict[str, tuple[str, Any, float]] = {
    "pose imposed": ("#000000", "-", 3.2),
    "hinged": ("#0072B2", (0, (5, 1.5)), 3.2),
    "dead load": ("#E69F00", "-", 1.4),
    HINGED_LOAD: ("#D55E00", (0, (5, 1.5)), 1.4),
}
"""Colour, line and width of each end condition: dashed where the end-effector is hinged, thin under a dead load."""
MARKS = ("o", "s", "^", "D")
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
        for (at, condition, engine), path in study.paths.items()
        if at == posture and engine == REFINED and "load" not in condition
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
                at = abs(float(event.point.displacement[0]))
                ax.plot(at, event.force / 1e3, EVENT_MARKERS[event.kind], color=colour, ms=5.5, mfc="white")
    ax.set(xlabel="displacement in compression, mm", ylabel="force along x, kN", xlim=(0.0, 2.0 * longest))
    ax.set_ylim(0.0, None)
    ax.set_title(f"Posture {posture}")
    ax.legend(loc="lower right")


def _sensitivity(ax: Axes, study: EndConditionStudy) -> None:
    for mark, posture in zip(MARKS, sorted(study.imperfections), strict=False):
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
