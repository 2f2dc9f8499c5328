"""Compiled inverse kinematics of legs that run from the base to the platform."""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import kernel
from vjm.kernels.packed_model import PASSIVE, Floats, PackedModel, Workspace
from vjm.kernels.recursion import forward_kinematics, pose_error
from vjm.platform.machine_kernel import Machine, back, driven_world, solve_small, times, turned_by

RIGID_ITERATIONS, RIGID_TOLERANCE = 12, 1e-11
LARGEST = 0.5
"""Largest step of a passive joint in inverse kinematics: rad, or lengths of its leg."""
FIRST_STEP, SMALLEST_STEP = 1.0 / 8.0, 1e-3
"""Shares of the way from home: the step that is tried, and the one below which a pose counts as out of reach, as
in `vjm.platform.rigid`."""


@kernel
def _close_leg(
    machine: Machine, model: PackedModel, work: Workspace, leg: int, platform: Floats, x: Floats, drive: float
) -> tuple[float, float, float]:
    """Passive coordinates and drive of a leg, its springs at rest, for a platform's frame.

    Returns:
        The drive, its rate by the platform's shift is left to the caller; the gap that is left; the largest turn
        that a joint made.
    """
    n_q = len(work.z)
    driven = machine.slides[leg] >= 0
    n = n_q + (1 if driven else 0)
    passive = np.empty(n_q, dtype=np.int64)
    k = 0
    for block in range(len(model.kind)):
        if model.kind[block] == PASSIVE:
            passive[k] = model.first[block]
            k += 1
    length = machine.units[leg, 0]
    end, world, to = np.empty(12), np.empty(12), np.empty(12)
    times(platform, machine.attachments[leg], end)
    J, A, g = np.empty((6, n)), np.empty((n, n)), np.empty(n)
    before = np.empty(n_q)
    for i in range(n_q):
        before[i] = x[passive[i]]
    left = np.inf
    for iteration in range(RIGID_ITERATIONS):
        driven_world(machine, leg, drive, world)
        back(world, end, to)
        for i in range(3):
            to[9 + i] /= length
        forward_kinematics(model, x, work)
        if not pose_error(work, to[:9].copy().reshape((3, 3)), to[9:]):
            return drive, np.inf, 0.0
        left = 0.0
        for i in range(6):
            left = max(left, abs(work.gap[i]))
        if left < RIGID_TOLERANCE or iteration == RIGID_ITERATIONS - 1:
            break
        # Newton's next gap is its square, which need not be looked at
        last = left < np.sqrt(0.1 * RIGID_TOLERANCE)
        J[:, :] = 0.0
        for j in range(len(model.rotary)):
            for i in range(n_q):
                if model.coordinate[j] == passive[i]:
                    for c in range(3):
                        J[c, i] += model.factor[j] * work.v[j, c]
                        if model.rotary[j]:
                            J[3 + c, i] += model.factor[j] * work.w[j, c]
        if driven:
            # the drive's motion in the leg's world
            axis = np.empty(3)
            seat = machine.seats[leg]
            for c in range(3):
                axis[c] = (
                    seat[3 * c] * machine.axes[leg, 0]
                    + seat[3 * c + 1] * machine.axes[leg, 1]
                    + seat[3 * c + 2] * machine.axes[leg, 2]
                )
            twist = np.zeros(6)
            if machine.slides[leg] == 1:
                for c in range(3):
                    twist[c] = axis[c]
            else:
                r0, r1, r2 = end[9] - seat[9], end[10] - seat[10], end[11] - seat[11]
                twist[0] = (axis[1] * r2 - axis[2] * r1) / length
                twist[1] = (axis[2] * r0 - axis[0] * r2) / length
                twist[2] = (axis[0] * r1 - axis[1] * r0) / length
                for c in range(3):
                    twist[3 + c] = axis[c]
            for c in range(3):
                for half in range(2):
                    J[3 * half + c, n_q] = (
                        world[c] * twist[3 * half]
                        + world[3 + c] * twist[3 * half + 1]
                        + world[6 + c] * twist[3 * half + 2]
                    )
        for i in range(n):
            g[i] = 0.0
            for c in range(6):
                g[i] += J[c, i] * work.gap[c]
            for j in range(n):
                s = 0.0
                for c in range(6):
                    s += J[c, i] * J[c, j]
                A[i, j] = s
        if not solve_small(A, g):
            return drive, np.inf, 0.0
        largest = 0.0
        for i in range(n):
            largest = max(largest, abs(g[i]))
        f = min(1.0, LARGEST / max(largest, 1e-300))
        for i in range(n_q):
            x[passive[i]] += f * g[i]
        if driven:
            drive += f * g[n_q] * (length if machine.slides[leg] == 1 else 1.0)
        if last:
            left *= left
            break
    turned = 0.0
    for i in range(n_q):
        turned = max(turned, abs(x[passive[i]] - before[i]))
    return drive, left, turned


@kernel
def close_near(
    machine: Machine,
    models: list[PackedModel],
    works: list[Workspace],
    pose: Floats,
    x: Floats,
    drives: Floats,
    platform: Floats,
) -> bool:
    """All legs closed for the platform displaced from home; from ``x`` and ``drives``, which are overwritten."""
    for i in range(12):
        platform[i] = machine.home[i]
    for i in range(3):
        platform[9 + i] += pose[i]
    turned_by(platform, pose[3:])
    for leg in range(len(machine.slides)):
        a, b = machine.coordinates_at[leg], machine.coordinates_at[leg + 1]
        drives[leg], left, turned = _close_leg(machine, models[leg], works[leg], leg, platform, x[a:b], drives[leg])
        if not left < 1e2 * RIGID_TOLERANCE or turned > LARGEST:
            return False
    return True


@kernel
def close_from_home(
    machine: Machine,
    models: list[PackedModel],
    works: list[Workspace],
    pose: Floats,
    x: Floats,
    drives: Floats,
    platform: Floats,
) -> bool:
    """All legs closed, on a straight way from home on which they keep their branch.

    A step in which a leg does not close, or a joint moves too far, is halved.
    """
    x[:] = machine.x_home
    drives[:] = machine.drives_home
    x_good, drives_good = x.copy(), drives.copy()
    done, step = 0.0, FIRST_STEP
    while done < 1.0:
        to = min(1.0, done + step)
        if close_near(machine, models, works, pose * to, x, drives, platform):
            done, step = to, min(FIRST_STEP, 2.0 * step)
            x_good[:], drives_good[:] = x, drives
            continue
        x[:], drives[:] = x_good, drives_good
        step = 0.5 * (to - done)
        if step < SMALLEST_STEP:
            return False
    return True
