"""How the hand that holds the end-effector decides what a loaded chain does: end conditions and imperfections."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from vjm.chain import Chain
from vjm.imperfections import ImperfectionCurve, imperfection_curve
from vjm.paths import EventKind, Path
from vjm.programme import TO_LIMIT, Load, Programme
from vjm.vjm_engine import VjmEngine
from vjm_validation.run import EndConditionStudy

SPRINGS = 16
"""In bar and foot each: critical forces are converged to 1e-7 and better."""
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


def end_programme(condition: str, posture: str, reach: float) -> Programme:
    """Compression along x under an end condition.

    Args:
        condition: one of `END_CONDITIONS`.
        posture: label.
        reach: mm, where a displacement is imposed; forces are driven up to `FORCE_N`.
    """
    free = ROTATIONS if "hinged" in condition else ()
    if "dead load" not in condition:
        return Programme(posture, -reach, free=free)
    force = Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    return Programme(posture, -FORCE_N, "load", free=("x", *free), loads=(force,), control=TO_LIMIT)


def end_condition_study(
    chain: Chain,
    reaches: Mapping[str, float],
    done: Callable[[], None] | None = None,
) -> EndConditionStudy:
    """Compression of a chain under every end condition, and what imperfections cost where a dead load collapses it.

    Args:
        chain: the machine; its beams need sections.
        reaches: how far each posture is compressed, mm.
        done: called after each posture.
    """
    engine = VjmEngine(SPRINGS, SPRINGS)
    paths: dict[tuple[str, str], Path] = {}
    imperfections: dict[str, ImperfectionCurve] = {}
    for posture, reach in reaches.items():
        for condition in END_CONDITIONS:
            paths[posture, condition] = engine.walk(chain, end_programme(condition, posture, reach))
        hinged = paths[posture, HINGED_LOAD]
        kinds = [event.kind for event in hinged.events]
        if kinds[:1] == [EventKind.BIFURCATION] and EventKind.LIMIT in kinds:
            imperfections[posture] = imperfection_curve(engine, chain, hinged.programme, SIZES_MM)
        if done is not None:
            done()
    return EndConditionStudy(paths, imperfections)
