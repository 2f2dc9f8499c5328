"""Platforms at thousands of poses and wrenches at once: equilibria, stiffness and critical forces as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.kernels.packed_model import buffers as packed_buffers
from vjm.model.pack import packed
from vjm.platform.batch_kernel import (
    NO_EQUILIBRIUM,
    OUT_OF_REACH,
    SOLVED,
    critical_forces,
    equilibria,
)
from vjm.platform.loaded_manipulator import lumped
from vjm.platform.machine_kernel import Machine
from vjm.platform.manipulator import BASE, PLATFORM, Manipulator
from vjm.platform.rigid import home_pose
from vjm.platform.rigid_legs import refuse_rigid_legs
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine

TOLERANCE = 1e-10
"""Scaled residual at which an equilibrium counts as found."""
ITERATIONS = 25
NEAR_ITERATIONS = 12
"""Of a step of the force from an equilibrium near by."""
FIRST_TURN, LAST_TURN = 0.06, 0.04
"""rad by which the weakest direction is turned to look for a weaker one; the force is flat there: 0.04 rad cost it
0.1 %."""


@dataclass(frozen=True)
class Platforms:
    """Free platforms under dead wrenches; n poses, l legs.

    Attributes:
        drives: coordinates ``(n, l)`` of the unloaded pose, mm, rad.
        displacement: ``(n, 6)`` that the wrench causes, mm, rad.
        stiffness: K^F ``(n, 6, 6)`` there.
        forces: end wrenches ``(n, l, 6)`` of the legs in their own worlds, N, N mm.
        solved: ``(n,)`` whether a stable equilibrium was found; all else is nan where not.
        why: ``(n,)`` reason where not.
        iterations: ``(n,)``.
    """

    drives: Array
    displacement: Array
    stiffness: Array
    forces: Array
    solved: np.ndarray
    why: np.ndarray
    iterations: np.ndarray


def packed_machine(manipulator: Manipulator, engine: VjmEngine) -> Machine:
    """A manipulator as the kernels take it.

    Raises:
        RigidLegError: a leg does not deflect in all directions.
        ValueError: a leg does not run from the base to the platform, or it is coupled or built wrong.
    """
    if any((leg.start, leg.end) != (BASE, PLATFORM) for leg in manipulator.legs) or manipulator.couplings:
        raise ValueError(f"{manipulator.name}: only machines whose legs all run from base to platform are compiled")
    if manipulator.errors or manipulator.offsets:
        raise ValueError(f"{manipulator.name}: machines with errors of assembly are not compiled")
    pose = home_pose(manipulator)
    models = [lumped(engine, leg.chain) for leg in manipulator.legs]
    refuse_rigid_legs(pose, models)
    buffers = [packed_buffers(packed(model)) for model in models]

    def joined(arrays: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        return np.concatenate(arrays), np.cumsum([0, *(len(a) for a in arrays)]).astype(np.int64)

    seats, worlds, axes, slides = [], [], [], []
    for leg in manipulator.legs:
        seat = leg.root if leg.drive is None else leg.seat
        seats.append(_flat(seat))
        worlds.append(_flat(np.linalg.inv(seat) @ leg.root))
        axes.append(np.zeros(3) if leg.drive is None else leg.drive.axis)
        slides.append(-1 if leg.drive is None else int(leg.drive.slides))
    coordinates = [model.configuration(q) / model.coordinate_scale for model, q in zip(models, pose.q, strict=True)]
    x, at = joined(coordinates)
    return Machine(
        *joined([b.integers for b in buffers]),
        *joined([b.numbers for b in buffers]),
        *joined([b.work_integers for b in buffers]),
        *joined([b.work_numbers for b in buffers]),
        at,
        np.array([[m.chain.characteristic_length, m.wrench_scale[3]] for m in models]),
        np.array(seats),
        np.array(axes, dtype=float),
        np.array(slides, dtype=np.int64),
        np.array(worlds),
        np.array([_flat(leg.attachment) for leg in manipulator.legs]),
        _flat(manipulator.home),
        x,
        pose.drives.astype(float),
    )


def _flat(T: Array) -> Array:
    return np.concatenate([T[:3, :3].ravel(), T[:3, 3]])


def platforms(machine: Machine, poses: Array, wrenches: Array) -> Platforms:
    """Free platforms at rigid poses, each under its dead wrench.

    Args:
        machine: see `packed_machine`.
        poses: displacements ``(n, 6)`` from home, neighbours next to one another.
        wrenches: ``(n, 6)`` or one ``(6,)`` for all.
    """
    poses = np.ascontiguousarray(poses, dtype=float)
    n, legs = len(poses), len(machine.slides)
    # a copy: for a read-only view the kernels would be compiled a second time
    wrenches = np.broadcast_to(np.asarray(wrenches, dtype=float), (n, 6)).copy()
    drives, displacement = np.full((n, legs), np.nan), np.full((n, 6), np.nan)
    K, forces = np.full((n, 6, 6), np.nan), np.full((n, legs, 6), np.nan)
    status, negative, iterations = (np.zeros(n, dtype=np.int64) for _ in range(3))
    equilibria(
        machine,
        poses,
        wrenches,
        TOLERANCE,
        ITERATIONS,
        drives,
        displacement,
        K,
        forces,
        status,
        negative,
        iterations,
    )
    why = np.full(n, "", dtype=object)
    why[status == OUT_OF_REACH] = "out of reach"
    why[status == NO_EQUILIBRIUM] = "no equilibrium found near the unloaded pose"
    why[(status == SOLVED) & (negative != 0)] = "unstable"
    solved = (status == SOLVED) & (negative == 0)
    for values in (displacement, K, forces):
        values[~solved] = np.nan
    return Platforms(drives, displacement, K, forces, solved, why, iterations)


@dataclass(frozen=True)
class Weakest:
    """The smallest critical force of a pose over all directions of a force.

    Attributes:
        force: N; infinite where none was found below the largest force that was tried, nan out of reach.
        direction: ``(3,)`` unit vector, world axes.
        leg: index of the leg towards which the search for the direction began.
    """

    force: float
    direction: Array
    leg: int


def weakest(machine: Machine, pose: Array, most: float, tolerance: float = 1e-3) -> Weakest:
    """The smallest critical force of a free platform over the directions of a dead force.

    In the linear model a leg's end force is a linear function of the platform's, so the force that strains one leg
    most for its size is known: along the leg's own force and against it. Those are tried, and the weakest of them
    is improved by turning it.

    Args:
        machine: see `packed_machine`.
        pose: rigid displacement ``(6,)`` from home.
        most: largest force tried, N.
        tolerance: relative, of the force.
    """
    legs = len(machine.slides)
    rest = platforms(machine, np.repeat(np.asarray(pose, dtype=float)[None], 3, axis=0), 1e-3 * np.eye(6)[:3])
    nowhere = np.full(3, np.nan)
    if not rest.solved.all():
        return Weakest(float("nan"), nowhere, -1)
    # end forces by the platform's, one row a leg: the size of their pull has this gradient
    slopes = np.array([np.linalg.svd(rest.forces[:, leg, :3].T)[2][0] for leg in range(legs)])
    trial = np.vstack([slopes, -slopes])
    forces, found = critical(machine, pose, trial, most, tolerance)
    if not found.any():
        return Weakest(float("inf"), nowhere, -1)
    forces[~found] = np.inf
    best = int(np.argmin(forces))
    direction, force = trial[best], float(forces[best])
    turn = FIRST_TURN
    while turn > LAST_TURN:
        side = np.linalg.svd(direction[None])[2][1:]
        around = np.array([direction + turn * s for s in (side[0], -side[0], side[1], -side[1])])
        around /= np.linalg.norm(around, axis=1)[:, None]
        tried, found = critical(machine, pose, around, most, tolerance)
        tried[~found] = np.inf
        k = int(np.argmin(tried))
        if tried[k] < force * (1.0 - 2.0 * tolerance):
            direction, force = around[k], float(tried[k])
        else:
            turn *= 0.5
    return Weakest(force, direction, best % legs)


def critical(
    machine: Machine, pose: Array, directions: Array, most: float, tolerance: float = 1e-4
) -> tuple[Array, np.ndarray]:
    """Critical forces of a free platform along directions.

    Args:
        machine: see `packed_machine`.
        pose: rigid displacement ``(6,)`` from home.
        directions: unit vectors ``(k, 3)``.
        most: largest force tried, N.
        tolerance: relative, of the force.

    Returns:
        Forces ``(k,)`` in N and whether there is one ``(k,)``.

    Raises:
        ValueError: the pose is out of reach.
    """
    directions = np.atleast_2d(directions)
    wrenches = np.ascontiguousarray(np.hstack([directions, np.zeros((len(directions), 3))]))
    forces, found = np.empty(len(wrenches)), np.zeros(len(wrenches), dtype=np.int64)
    pose = np.ascontiguousarray(pose, dtype=float)
    how = critical_forces(
        machine, pose, wrenches, most / 64.0, most, tolerance, TOLERANCE, NEAR_ITERATIONS, forces, found
    )
    if how == OUT_OF_REACH:
        raise ValueError("the pose is out of reach")
    return forces, found.astype(bool)
