"""What a map asks at each pose, and its answer: for machines that are compiled, and for all others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from vjm.continuation.arc_length import ArcControl, trace
from vjm.continuation.load_stepping import follow
from vjm.continuation.path import Equilibrium, EventKind, Path
from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS, TO_LIMIT, Load, LoadCase
from vjm.platform.batch_equilibria import packed_machine, platforms, weakest
from vjm.platform.closure import RigidPose
from vjm.platform.loaded_manipulator import lumped
from vjm.platform.machine_kernel import Machine
from vjm.platform.manipulator import BASE, PLATFORM, Manipulator
from vjm.platform.problem import ManipulatorProblem
from vjm.platform.rigid import PoseError, inverse_kinematics
from vjm.platform.rigid_legs import NO_COMPLIANCE, RigidLegError, platform_compliance
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine

OK = "ok"
NEARLY = 1e-4
"""Smallest eigenvalue over its unloaded value at which stability is as good as lost."""
QUICK = 4
"""Steps to a force at which a platform that has stayed stable needs no closer look."""
SAME = 0.04
"""rad between directions that are tried; the force is flat, see `vjm.platform.batch_equilibria.LAST_TURN`."""


class Quantity(StrEnum):
    """What is mapped."""

    STIFFNESS = "stiffness"
    """Smallest and largest stiffness against a force, the platform free to turn, and against a moment, free to
    shift: over the eigenvalues of the two blocks of K⁻¹. Under the wrench, if one is given."""
    CRITICAL = "critical"
    """The smallest force, over all directions, at which the free platform loses its stability."""
    DEFLECTION = "deflection"
    """The platform's displacement under the wrench."""


COLUMNS: dict[Quantity, tuple[str, ...]] = {
    Quantity.STIFFNESS: ("kt_min_N_per_mm", "kt_max_N_per_mm", "kr_min_Nmm_per_rad", "kr_max_Nmm_per_rad"),
    Quantity.CRITICAL: ("F_cr_N", "direction_x", "direction_y", "direction_z"),
    Quantity.DEFLECTION: ("ux_mm", "uy_mm", "uz_mm", "rx_rad", "ry_rad", "rz_rad", "u_mm"),
}
SHOWN = {Quantity.STIFFNESS: 0, Quantity.CRITICAL: 0, Quantity.DEFLECTION: 6}
"""The column that the pictures show."""
TITLES = {
    Quantity.STIFFNESS: "smallest stiffness against a force, N/mm",
    Quantity.CRITICAL: "smallest critical force, N",
    Quantity.DEFLECTION: "deflection, mm",
}


@dataclass(frozen=True)
class MapTask:
    """Some poses of a map.

    Attributes:
        index: of the task.
        manipulator: the machine.
        springs: how its beams become springs.
        quantity: what is mapped.
        poses: displacements ``(n, 6)`` from home, neighbours next to one another.
        wrench: on the platform, ``(6,)`` N, N mm.
        most: largest force tried for a critical one, N.
    """

    index: int
    manipulator: Manipulator
    springs: VjmEngine
    quantity: Quantity
    poses: Array
    wrench: tuple[float, ...]
    most: float


class MapRows(NamedTuple):
    """Answers at some poses.

    Attributes:
        task: its index.
        values: ``(n, c)``, nan where there is no answer.
        why: ``(n,)`` `OK`, or why there is none.
    """

    task: int
    values: Array
    why: list[str]


_machines: dict[tuple[str, str], Machine] = {}


def compiled_for(manipulator: Manipulator) -> bool:
    """Whether the kernels take this machine."""
    direct = all((leg.start, leg.end) == (BASE, PLATFORM) for leg in manipulator.legs)
    return direct and not (manipulator.couplings or manipulator.errors or manipulator.offsets)


def evaluate(task: MapTask) -> MapRows:
    """The rows of a task; a pose without an answer says why and stops no other."""
    if not compiled_for(task.manipulator):
        return _one_by_one(task)
    key = (task.manipulator.sha256 or str(id(task.manipulator)), repr(task.springs))
    if key not in _machines:
        try:
            _machines[key] = packed_machine(task.manipulator, task.springs)
        except RigidLegError:
            return _one_by_one(task)
    machine = _machines[key]
    columns = COLUMNS[task.quantity]
    values = np.full((len(task.poses), len(columns)), np.nan)
    wrench = np.zeros(6) if task.quantity is Quantity.CRITICAL else np.array(task.wrench)
    found = platforms(machine, task.poses, wrench)
    why = [OK if good else str(reason) for good, reason in zip(found.solved, found.why, strict=True)]
    for k in np.flatnonzero(found.solved).tolist():
        beyond = task.manipulator.beyond_limits(found.drives[k])
        if beyond:
            why[k] = f"out of reach: {beyond}"
            continue
        if task.quantity is Quantity.STIFFNESS:
            values[k] = principal(np.linalg.inv(found.stiffness[k])[None])[0]
        elif task.quantity is Quantity.DEFLECTION:
            values[k] = moved(found.displacement[k])
        else:
            weak = weakest(machine, task.poses[k], task.most)
            values[k] = [weak.force, *weak.direction]
            if not np.isfinite(weak.force):
                values[k] = np.nan
                why[k] = f"no critical force up to {task.most:g} N"
    values[~found.solved] = np.nan
    return MapRows(task.index, values, why)


def principal(C: Array) -> Array:
    """Smallest and largest stiffness against forces (N/mm) and moments (N mm/rad) ``(g, 4)``.

    Infinite in a direction in which nothing moves.

    Args:
        C: compliances ``(g, 6, 6)``.
    """
    rows = []
    for part in (slice(0, 3), slice(3, 6)):
        block = C[:, part, part]
        values = np.linalg.eigvalsh(0.5 * (block + np.swapaxes(block, 1, 2)))
        with np.errstate(divide="ignore"):
            least = np.where(values[:, 0] > NO_COMPLIANCE * values[:, 2], values[:, 0], 0.0)
            rows += [1.0 / values[:, 2], 1.0 / least]
    return np.stack(rows, axis=1)


def moved(displacement: Array) -> list[float]:
    """Displacement ``(6,)`` and the size of its shift."""
    return [*displacement.tolist(), float(np.linalg.norm(displacement[:3]))]


def _one_by_one(task: MapTask) -> MapRows:
    """The same by the whole machine's own equilibria."""
    values = np.full((len(task.poses), len(COLUMNS[task.quantity])), np.nan)
    why = []
    near: RigidPose | None = None
    for k, displacement in enumerate(task.poses):
        try:
            near = _closed(task.manipulator, displacement, near)
            if task.quantity is Quantity.CRITICAL:
                values[k] = _weakest_path(task, near)
            elif task.quantity is Quantity.DEFLECTION:
                values[k] = moved(_loaded(task, near).displacement)
            else:
                values[k] = principal(_compliance(task, near)[None])[0]
            why.append(OK)
        except (PoseError, RigidLegError, NoConvergenceError) as failure:
            why.append(" ".join(str(failure).split()))
    return MapRows(task.index, values, why)


def _closed(manipulator: Manipulator, displacement: Array, near: RigidPose | None) -> RigidPose:
    try:
        return inverse_kinematics(manipulator, displacement, near)
    except PoseError:
        # the straight way from a neighbour may leave the workspace where that from home does not
        return inverse_kinematics(manipulator, displacement)


def _compliance(task: MapTask, pose: RigidPose) -> Array:
    """Compliance ``(6, 6)`` of the platform under the task's wrench; it exists where a leg is rigid, too."""
    try:
        K = _loaded(task, pose).stiffness
    except RigidLegError:
        if any(task.wrench):
            raise
        return platform_compliance(pose, [lumped(task.springs, leg.chain) for leg in task.manipulator.legs])
    assert K is not None
    return np.asarray(np.linalg.inv(K), dtype=float)


def _loaded(task: MapTask, pose: RigidPose) -> Equilibrium:
    wrench = np.array(task.wrench)
    if not np.any(wrench):
        return ManipulatorProblem(task.manipulator, LoadCase("", 1.0), task.springs, pose).unloaded()
    load_case = LoadCase("", 1.0, "load", loads=(Load(tuple(wrench)),), free=COMPONENTS, steps=2)
    path = follow(ManipulatorProblem(task.manipulator, load_case, task.springs, pose), load_case)
    if not path.complete:
        raise NoConvergenceError(path.stopped)
    if path.events:
        raise NoConvergenceError(f"the platform buckles at {path.events[0].s:.3g} of the wrench")
    return path.points[-1]


def _weakest_path(task: MapTask, pose: RigidPose) -> list[float]:
    """Smallest critical force over directions, see `vjm.platform.batch_equilibria.weakest`."""
    slopes = []
    for axis in range(3):
        unit = LoadCase("", 1e-3, "load", loads=(Load(tuple(np.eye(6)[axis])),), free=COMPONENTS, steps=1)
        problem = _under(task, unit, pose)
        slopes.append(problem.leg_wrenches(follow(problem, unit).points[-1])[:, :3])
    best = [float("nan")] * 4
    for line in distinct([np.linalg.svd(strained.T)[2][0] for strained in np.array(slopes).transpose(1, 0, 2)]):
        for direction in (line, -line):
            wrench = (*direction.tolist(), 0.0, 0.0, 0.0)
            most = float(np.fmin(best[0], task.most))
            load = LoadCase("", most, "load", loads=(Load(wrench),), free=COMPONENTS, steps=QUICK)
            # one larger than the smallest so far is of no interest
            quick = None if np.isnan(best[0]) else follow(_under(task, load, pose), load)
            if quick is not None and quick.complete and not quick.events:
                continue
            # nor is the branch behind it
            along = replace(load, control=TO_LIMIT, branch=0, steps=None)
            force = stability_lost(trace(_under(task, along, pose), along, ArcControl(last=EventKind.BIFURCATION)))
            if force is not None and not force >= best[0]:
                best = [force, *direction.tolist()]
    if np.isnan(best[0]):
        raise NoConvergenceError(f"no critical force up to {task.most:g} N")
    return best


def _under(task: MapTask, load_case: LoadCase, pose: RigidPose) -> ManipulatorProblem:
    return ManipulatorProblem(task.manipulator, load_case, task.springs, pose)


def distinct(lines: Sequence[Array]) -> list[Array]:
    """Directions ``(3,)`` of which no two lie along almost the same line: legs in a row feel a force alike."""
    kept: list[Array] = []
    for line in lines:
        if all(np.linalg.norm(np.cross(line, other)) > SAME for other in kept):
            kept.append(line)
    return kept


def stability_lost(path: Path) -> float | None:
    """The force at which a path along the arc loses its stability, N; None where it keeps it to its end.

    The path of an over-constrained robot has no perfect bifurcation, but a knee so sharp that no step may follow
    it: there the path ends with its smallest eigenvalue all but zero, and that is the force.

    Raises:
        NoConvergenceError: it ends before, for another reason.
    """
    for event in path.events:
        if event.kind in (EventKind.BIFURCATION, EventKind.LIMIT):
            return event.force
    if path.complete:
        return None
    if abs(path.eigenvalue_relative[-1]) < NEARLY:
        return path.points[-1].ramp
    raise NoConvergenceError(path.stopped)
