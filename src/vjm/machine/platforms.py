"""Platforms on legs: errors of assembly, and what the legs bear and do in an equilibrium."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium
from vjm.machine.rigid_mechanism import RigidMechanism
from vjm.model.machine import Machine, legs_of
from vjm.model.mechanism import Kinematics, Mechanism
from vjm.model.parts import Beam
from vjm.rotations import Array
from vjm.statics import Configuration, critical_modes


def assembled(machine: Machine, too_long: Mapping[str, float] = {}, off: Mapping[str, float] = {}) -> Machine:
    """A machine as built; its loops have gaps in its postures, which its springs close.

    Args:
        machine: as designed.
        too_long: by how many mm beams are longer, by their names.
        off: what the coordinates of held joints are off, mm or rad, by their names.

    Returns:
        The machine, its displacements counted from where the end-effector is as designed.

    Raises:
        ValueError: no such beam or held joint.

    Example:
        >>> import vjm
        >>> built = assembled(vjm.load("orthoglide"), {"x/link": 0.2})
        >>> vjm.stiffness(built, "isotropic").wrench[0] < -100.0
        True
    """
    beams, held = [beam.name for beam in machine.beams], [joint.name for joint in machine.held_joints]
    for name in too_long:
        if name not in beams:
            raise ValueError(f"{machine.name}: no beam '{name}' to be too long (it has {', '.join(beams)})")
    for name in off:
        if name not in held:
            raise ValueError(f"{machine.name}: no held joint '{name}' that could be off (it has {', '.join(held)})")
    if not too_long and not off:
        return machine
    tree = RigidMechanism(machine)
    return replace(
        machine,
        parts=tuple(
            replace(part, length=part.length + too_long.get(part.name, 0.0)) if isinstance(part, Beam) else part
            for part in machine.parts
        ),
        held={
            label: {name: value + off.get(name, 0.0) for name, value in values.items()}
            for label, values in machine.held.items()
        },
        nominal_ends={label: tree.end_frames(tree.posture(label)[None])[0] for label in machine.postures},
    )


def leg_wrenches(problem: LumpedProblem, point: Equilibrium) -> Array:
    """Wrenches ``(l, 6)`` that the bodies behind the legs' last joints put on them, about the legs' ends.

    Args:
        problem: of a machine of legs, see `vjm.model.machine.legs_of`.
        point: an equilibrium of the problem.

    Returns:
        N, N mm, world axes: all that acts on what a leg's last joint or spring carries, loads and closures alike.
    """
    model, state = problem.model, problem.configuration(point)
    kinematics = model.kinematics(state.x)
    joints, places, wrenches = _on_bodies(model, kinematics, state)
    legs = legs_of(model.chain)
    result = np.zeros((len(legs), 6))
    for row, leg in zip(result, legs, strict=True):
        end = model.end_of(leg.parts[-1])
        own = np.array([j >= 0 and (end.joint < 0 or model.way(j)[end.joint]) for j in joints.tolist()])
        levers = places[own] - (kinematics.behind[end.joint + 1] @ end.frame)[:3, 3]
        row[:3] = wrenches[own, :3].sum(axis=0)
        row[3:] = (wrenches[own, 3:] + np.cross(levers, wrenches[own, :3])).sum(axis=0)
    return result


def _on_bodies(model: Mechanism, kinematics: Kinematics, state: Configuration) -> tuple[np.ndarray, Array, Array]:
    """Last joints ``(k,)`` before what loads, closures and the support act on, where ``(k, 3)``, and wrenches."""
    joints, places, wrenches = [model.last], [kinematics.end[:3, 3]], [state.wrench]
    if len(model.applied_loads):
        joints += model.applied_loads.joint.tolist()
        places += list(model.compiled.points(state.x, state.wrench, state.load))
        wrenches += list(model.compiled.acting(state.x, state.wrench, state.load))
    first = model.coordinates
    for closure, own, frames in zip(model.chain.closures, model.closure_joints, model.closure_frames, strict=True):
        wrench = np.zeros(6)
        wrench[: closure.rows] = state.x[first : first + closure.rows]
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
        problem: of a machine of legs, see `vjm.model.machine.legs_of`.
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
