"""What the legs of a machine bear and do in an equilibrium."""

from __future__ import annotations

import numpy as np

from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium
from vjm.machine.legs import legs_of
from vjm.model.kinematics import Kinematics
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array
from vjm.statics.equilibrium import Configuration
from vjm.statics.stability import critical_modes


def leg_wrenches(problem: LumpedProblem, point: Equilibrium) -> Array:
    """Wrenches ``(l, 6)`` that the bodies behind the legs' last joints put on them, about the legs' ends.

    Args:
        problem: of a machine of legs, see `vjm.machine.legs.legs_of`.
        point: an equilibrium of the problem.

    Returns:
        N, N mm, world axes: all that acts on what a leg's last joint or spring carries, loads and closures alike.
    """
    model, at = problem.model, problem.configuration(point)
    kinematics = model.kinematics(at.x)
    joints, places, wrenches = _on_bodies(model, kinematics, at)
    legs = legs_of(model.chain)
    result = np.zeros((len(legs), 6))
    for row, leg in zip(result, legs, strict=True):
        end = model.end_of(leg.parts[-1])
        own = (joints >= 0) & model.carried_by(end.joint)[joints]
        levers = places[own] - (kinematics.behind[end.joint + 1] @ end.frame)[:3, 3]
        row[:3] = wrenches[own, :3].sum(axis=0)
        row[3:] = (wrenches[own, 3:] + np.cross(levers, wrenches[own, :3])).sum(axis=0)
    return result


def _on_bodies(model: Mechanism, kinematics: Kinematics, at: Configuration) -> tuple[np.ndarray, Array, Array]:
    """Last joints ``(k,)`` before what loads, closures and the support act on, where ``(k, 3)``, and wrenches."""
    joints, places, wrenches = [model.last], [kinematics.end[:3, 3]], [at.wrench]
    if len(model.applied_loads):
        joints += model.applied_loads.joint.tolist()
        places += list(model.compiled.points(at.x, at.wrench, at.load))
        wrenches += list(model.compiled.acting(at.x, at.wrench, at.load))
    first = model.coordinates
    for closure, own, frames in zip(model.chain.closures, model.closure_joints, model.closure_frames, strict=True):
        wrench = np.zeros(6)
        wrench[: closure.rows] = at.x[first : first + closure.rows]
        first += closure.rows
        joints += own.tolist()
        place = (kinematics.behind[own[1] + 1] @ frames[1])[:3, 3]
        places += [place, place]
        wrenches += [-wrench, wrench]
    return np.array(joints, dtype=np.int64), np.array(places), np.array(wrenches)


def yielding_legs(problem: LumpedProblem, critical: Equilibrium) -> dict[str, float]:
    """Which legs deflect at a critical point: each one's share of the mode, their squares adding up to one.

    What counts is how far a leg's springs deflect; a leg that only turns in its joints follows the others.

    Args:
        problem: of a machine of legs, see `vjm.machine.legs.legs_of`.
        critical: a critical point of the problem.
    """
    model = problem.model
    mode = critical_modes(problem.configuration(critical))[0] / model.coordinate_scale
    sprung = np.zeros(model.size, dtype=bool)
    sprung[model.elastic] = True
    sizes, legs = [], legs_of(model.chain)
    for leg in legs:
        own = [c for part in leg.parts for c in model.span(part) if sprung[c]]
        sizes.append(float(np.linalg.norm(mode[own])))
    shares = np.array(sizes) / np.linalg.norm(sizes)
    return dict(zip((leg.name for leg in legs), shares.tolist(), strict=True))
