"""Legs on a platform by finite elements: the platform's stiffness, and which legs lose stability."""

from __future__ import annotations

import numpy as np

from vjm.continuation.path import Equilibrium
from vjm.engine import Engine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_fea.common.beam_problem import BeamProblem
from vjm_fea.common.branches import TINY

NEARLY_NOTHING = 1e-6
"""mm: end of a path of which only the unloaded beginning is wanted."""


def platform_stiffness(engine: Engine, machine: Machine, pose: str, displacement: Array) -> Array:
    """Stiffness ``(6, 6)`` of a platform held at a displacement ``(6,)`` from a pose, N/mm, N, N mm.

    Raises:
        NoConvergenceError: the displacement is not reached, or not on a stable path.
    """
    still = not np.any(displacement)
    load_case = (
        LoadCase(pose, NEARLY_NOTHING, steps=1) if still else LoadCase(pose, 1.0, tuple(displacement), steps=4)
    )
    path = engine.trace(machine, load_case)
    if not path.complete:
        raise NoConvergenceError(path.stopped)
    K = path.points[0 if still else -1].stiffness
    assert K is not None
    return K


def deflecting_shares(problem: BeamProblem, critical: Equilibrium) -> dict[str, float]:
    """Which legs deflect at a critical point: each one's share of the mode, their squares adding up to one.

    What counts is how far a leg's beams bow out of their chords.

    Args:
        problem: of a machine of legs, see `vjm.machine.legs.legs_of`.
        critical: a critical point of the problem.
    """
    mode = problem.exact(critical.state).critical_modes()[0]
    ahead, behind = (
        problem.statics.shape(problem.statics.moved_freely(critical.state, t * mode)) for t in (TINY, -TINY)
    )
    bows: dict[str, float] = {}
    for part in dict.fromkeys(station.part for station in problem.stations):
        rows = [i for i, station in enumerate(problem.stations) if station.part == part]
        leg, _, own = part.partition("/")
        if own:
            fractions = np.array([problem.stations[i].fraction for i in rows])
            bows[leg] = bows.get(leg, 0.0) + _bow(fractions, (ahead - behind)[rows])
    whole = sum(bows.values())
    return {leg: float(np.sqrt(bow / whole)) for leg, bow in bows.items()}


def _bow(fractions: Array, moved: Array) -> float:
    """Sum of the squares of what stations ``(k, 3)`` of a part move out of the chord between its ends."""
    first, last = np.argmin(fractions), np.argmax(fractions)
    if first == last:
        return 0.0
    along = (fractions - fractions[first]) / (fractions[last] - fractions[first])
    chord = moved[first] + np.outer(along, moved[last] - moved[first])
    return float(np.sum((moved - chord) ** 2))
