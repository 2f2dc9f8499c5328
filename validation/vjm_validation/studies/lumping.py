"""The study that names the tension artefact's cause: critical force against number and placement of springs."""

from __future__ import annotations

from vjm.continuation.direction import Direction
from vjm.continuation.path import EventKind
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Placement
from vjm.vjm_engine import VjmEngine
from vjm_validation.studies.study_results import LumpingStudy

SPRINGS = (1, 2, 4, 8, 16, 32)
REACH_MM = 8.0
"""Far enough for two end springs, which buckle at 5.5 mm."""


def lumping_study(
    chain: Machine,
    posture: str,
    direction: Direction,
    reference: float | None,
) -> LumpingStudy:
    """First bifurcation of one posture with the bar in 1 to 32 springs, at every placement.

    Args:
        chain: the machine; its bar needs a section.
        posture: label.
        direction: of the ramp along x.
        reference: critical force of the finite elements, N, or None.
    """
    rows = []
    for placement in Placement:
        for n in SPRINGS:
            path = VjmEngine(n, placement=placement).trace(chain, LoadCase(posture, direction.sign * REACH_MM))
            event = path.critical
            sharp = event is not None and event.kind is EventKind.BIFURCATION
            rows.append((str(placement), n, event.force if event is not None and sharp else None))
    return LumpingStudy(posture, direction, reference, tuple(rows))
