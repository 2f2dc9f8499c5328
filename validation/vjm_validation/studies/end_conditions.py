"""How the support of the end-effector decides what a loaded chain does: end conditions and imperfections."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from vjm.batch import Failure, Task, trace_all
from vjm.continuation.imperfections import imperfection_curve
from vjm.continuation.path import EventKind, Path
from vjm.engine import Engine
from vjm.model.load_case import TO_LIMIT, Load, LoadCase
from vjm.model.machine import Machine
from vjm.vjm_engine import VjmEngine
from vjm_validation.studies.study_results import EndConditionStudy

ROTATIONS = ("rx", "ry", "rz")
FORCE_N = 10_000.0
"""How far forces are driven: above every critical force of the library's chain."""
SIZES_MM = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
"""Of the imperfections: from far below what can be made to far above."""
HINGED_LOAD = "dead load, hinged"

END_CONDITIONS: Mapping[str, str] = {
    "pose imposed": "the paper's: all six components of the pose are imposed",
    "hinged": "the displacement along x is imposed, the end-effector turns freely about its point",
    "dead load": "a dead force pushes along x on a straight guide, which holds the rest of the pose",
    HINGED_LOAD: "a dead force pushes along x on a straight guide, and the end-effector turns freely",
}
"""Name and meaning of each."""


def end_load_case(condition: str, posture: str, reach: float) -> LoadCase:
    """Compression along x under an end condition.

    Args:
        condition: one of `END_CONDITIONS`.
        posture: label.
        reach: mm, where a displacement is imposed; forces are driven up to `FORCE_N`.
    """
    free = ROTATIONS if "hinged" in condition else ()
    if "dead load" not in condition:
        return LoadCase(posture, -reach, free=free)
    force = Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    return LoadCase(posture, -FORCE_N, "load", free=("x", *free), loads=(force,), control=TO_LIMIT)


def end_condition_study(
    chain: Machine,
    reaches: Mapping[str, float],
    engines: Sequence[Engine],
    jobs: int = 1,
    done: Callable[[int, int], None] | None = None,
) -> EndConditionStudy:
    """Compression of a chain under every end condition, and what imperfections cost where a dead load collapses it.

    Args:
        chain: the machine; its beams need sections.
        reaches: how far each posture is compressed, mm.
        engines: the first is a lumped one, which imperfections are put into.
        jobs: processes.
        done: called with how many paths are finished, and of how many.

    Raises:
        ValueError: an engine finds no path at all.
    """
    keys = [(p, condition, k) for p in reaches for condition in END_CONDITIONS for k in range(len(engines))]
    tasks = [Task(engines[k], chain, end_load_case(condition, p, reaches[p])) for p, condition, k in keys]
    paths: dict[tuple[str, str, str], Path] = {}
    for (posture, condition, k), path in zip(keys, trace_all(tasks, jobs, done), strict=True):
        if isinstance(path, Failure):
            raise ValueError(f"posture {posture}, {condition}, {engines[k].label}: {path.message}")
        paths[posture, condition, engines[k].label] = path
    lumped = engines[0]
    assert isinstance(lumped, VjmEngine)
    imperfections = {}
    for posture in reaches:
        hinged = paths[posture, HINGED_LOAD, lumped.label]
        kinds = [event.kind for event in hinged.events]
        if kinds[:1] == [EventKind.BIFURCATION] and EventKind.LIMIT in kinds:
            imperfections[posture] = imperfection_curve(partial(lumped.problem, chain), hinged.load_case, SIZES_MM)
    return EndConditionStudy(paths, imperfections)
