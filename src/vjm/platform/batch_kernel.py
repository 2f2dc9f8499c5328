"""Compiled: platforms at thousands of poses and wrenches, for machines whose legs all run from base to platform.

A machine is its legs' buffers one behind the other (`vjm.kernels.packed_model`), each leg scaled by its own units,
and a table of what the legs' places are. Poses and wrenches are in N, mm and rad.
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import entry, kernel
from vjm.kernels.condensation import factor, substitute
from vjm.kernels.factorization import bunch_parlett_solve
from vjm.kernels.packed_model import Floats, Ints, PackedModel, Workspace
from vjm.kernels.recursion import forward_kinematics, pose_error
from vjm.platform.closure_kernel import close_from_home, close_near
from vjm.platform.machine_kernel import (
    Machine,
    back,
    driven_world,
    legs_of,
    negatives,
    rotation_between,
    solve_small,
    times,
    turned_by,
)

SOLVED, OUT_OF_REACH, NO_EQUILIBRIUM = 0, 1, 2
"""How a pose ends."""
NEGLIGIBLE = 1e-9
"""Residual of a leg whose share in the next step need not be foreseen: the step after it would see to it."""


@kernel
def loaded_stiffness(work: Workspace, force: Floats, K: Floats) -> None:
    """Write ``K^F`` (6, 6) of (18) of one leg with the present factors, under the wrench ``force`` (6,)."""
    # the workspace that held T is free behind its factorisation
    B = work.T[:, :6]
    B[:, :] = 0.0
    for i in range(6):
        B[i, i] = 1.0
    bunch_parlett_solve(work.F, work.swaps, work.pivots, B)
    for i in range(6):
        for j in range(6):
            K[i, j] = B[i, j]
    m0, m1, m2 = 0.5 * force[3], 0.5 * force[4], 0.5 * force[5]
    K[3, 4] += m2
    K[3, 5] -= m1
    K[4, 3] -= m2
    K[4, 5] += m0
    K[5, 3] += m1
    K[5, 4] -= m0


@kernel
def balance(
    machine: Machine,
    models: list[PackedModel],
    works: list[Workspace],
    platform: Floats,
    drives: Floats,
    wrench: Floats,
    x: Floats,
    forces: Floats,
    tolerance: float,
    most: int,
    M: Floats,
    K_legs: Floats,
) -> tuple[int, int, int]:
    """Equilibrium of a free platform under a wrench, by Newton on it and all legs at once.

    Args:
        machine: the machine.
        models: its legs, see `legs_of`.
        works: likewise.
        platform: frame ``(12,)`` to start from; overwritten.
        drives: ``(l,)``.
        wrench: ``(6,)`` dead, at the platform's reference point.
        x: coordinates ``(n,)``, dimensionless, overwritten; and
        forces: ``(l, 6)`` end wrenches, dimensionless, likewise.
        tolerance: scaled residual.
        most: iterations.
        M: ``(6, 6)`` the platform's stiffness K^F there, written.
        K_legs: ``(l, 6, 6)`` each leg's share.

    Returns:
        How it ended, number of negative eigenvalues, iterations.
    """
    legs = len(machine.slides)
    worlds, end, to, r = np.empty((legs, 12)), np.empty(12), np.empty(12), np.empty(6)
    E, K, KE, W = np.zeros((legs, 6, 6)), np.empty((6, 6)), np.empty((6, 6)), np.empty(6)
    dF, gap, twist = np.empty(6), np.empty(6), np.empty(6)
    for leg in range(legs):
        driven_world(machine, leg, drives[leg], worlds[leg])
    negative = 0
    for iteration in range(most + 1):
        M[:, :] = 0.0
        for i in range(6):
            r[i] = wrench[i]
        lacking, negative, heavy = 0.0, 0, 1.0
        energy, reach = machine.units[0, 1], machine.units[0, 0]
        for leg in range(legs):
            length, unit = machine.units[leg, 0], machine.units[leg, 1]
            model, work = models[leg], works[leg]
            a, b = machine.coordinates_at[leg], machine.coordinates_at[leg + 1]
            times(platform, machine.attachments[leg], end)
            G = worlds[leg]
            back(G, end, to)
            for i in range(3):
                to[9 + i] /= length
            F = forces[leg]
            forward_kinematics(model, x[a:b], work)
            if not pose_error(work, to[:9].reshape((3, 3)), to[9:]):
                return NO_EQUILIBRIUM, -1, iteration
            found = factor(model, x[a:b], F, work)
            if found < 0:
                return NO_EQUILIBRIUM, -1, iteration
            negative += found
            left = 0.0
            for i in range(len(work.residual)):
                left = max(left, abs(work.residual[i]))
            for i in range(6):
                gap[i] = work.gap[i]
                left = max(left, abs(gap[i]))
                heavy = max(heavy, abs(F[i]))
            lacking = max(lacking, left)
            loaded_stiffness(work, F, K)
            if left < NEGLIGIBLE:
                dF[:] = 0.0
            else:
                substitute(model, work, work.residual, gap)
                for i in range(6):
                    dF[i] = work.right[i]
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                dF[3 + i] -= 0.5 * (F[3 + j] * gap[3 + k] - F[3 + k] * gap[3 + j])
            # to the world, about the platform's reference point, N and N mm
            own = E[leg]
            own[:, :] = 0.0
            l0, l1, l2 = end[9] - platform[9], end[10] - platform[10], end[11] - platform[11]
            for i in range(3):
                for j in range(3):
                    own[i, j] = own[3 + i, 3 + j] = G[3 * j + i]
                c0, c1, c2 = G[i], G[3 + i], G[6 + i]
                # row i of −Rᵀ [l]×
                own[i, 3] = -(c1 * l2 - c2 * l1)
                own[i, 4] = -(c2 * l0 - c0 * l2)
                own[i, 5] = -(c0 * l1 - c1 * l0)
            for i in range(6):
                for j in range(6):
                    # units: shifts over the length, forces over energy over length
                    s = unit / ((length if i < 3 else 1.0) * (length if j < 3 else 1.0))
                    K[i, j] *= s
            for i in range(6):
                for j in range(6):
                    s = 0.0
                    for k in range(6):
                        s += K[i, k] * own[k, j]
                    KE[i, j] = s
            share = K_legs[leg]
            for i in range(6):
                for j in range(6):
                    s = 0.0
                    for k in range(6):
                        s += own[k, i] * KE[k, j]
                    share[i, j] = s
            f0 = f1 = f2 = 0.0
            for i in range(6):
                s = 0.0
                t = 0.0
                for k in range(6):
                    u = unit / (length if k < 3 else 1.0)
                    s += own[k, i] * u * (F[k] + dF[k])
                    t += own[k, i] * u * F[k]
                r[i] -= s
                W[i] = t
            f0, f1, f2 = W[0], W[1], W[2]
            # the lever turns with the platform: [f]× [l]× = l fᵀ − (f · l)
            dot = f0 * l0 + f1 * l1 + f2 * l2
            share[3, 3] += l0 * f0 - dot
            share[3, 4] += l0 * f1
            share[3, 5] += l0 * f2
            share[4, 3] += l1 * f0
            share[4, 4] += l1 * f1 - dot
            share[4, 5] += l1 * f2
            share[5, 3] += l2 * f0
            share[5, 4] += l2 * f1
            share[5, 5] += l2 * f2 - dot
            for i in range(6):
                for j in range(6):
                    M[i, j] += share[i, j]
        # what the platform lacks, the legs' own lack aside
        for i in range(6):
            lacking = max(lacking, abs(r[i]) * (reach if i < 3 else 1.0) / energy)
        error = lacking / heavy
        if not error < 1e6:
            return NO_EQUILIBRIUM, -1, iteration
        if error < tolerance:
            own_negative = negatives(M)
            return SOLVED, (negative + own_negative if own_negative >= 0 else -1), iteration
        if iteration == most:
            break
        A = M.copy()
        if not solve_small(A, r):
            return NO_EQUILIBRIUM, -1, iteration
        largest = max(abs(r[3]), max(abs(r[4]), abs(r[5])))
        for leg in range(legs):
            length = machine.units[leg, 0]
            model, work = models[leg], works[leg]
            a, b = machine.coordinates_at[leg], machine.coordinates_at[leg + 1]
            for i in range(6):
                s = 0.0
                for j in range(6):
                    s += E[leg, i, j] * r[j]
                twist[i] = s / (length if i < 3 else 1.0)
            for i in range(6):
                gap[i] = work.gap[i] + twist[i]
            substitute(model, work, work.residual, gap)
            F = forces[leg]
            for i in range(b - a):
                x[a + i] += work.step[i]
            m0, m1, m2 = F[3], F[4], F[5]
            for i in range(6):
                F[i] += work.right[i]
            F[3] -= 0.5 * (m1 * gap[5] - m2 * gap[4])
            F[4] -= 0.5 * (m2 * gap[3] - m0 * gap[5])
            F[5] -= 0.5 * (m0 * gap[4] - m1 * gap[3])
        if largest > 2.0:
            return NO_EQUILIBRIUM, -1, iteration
        for i in range(3):
            platform[9 + i] += r[i]
        turned_by(platform, r[3:])
    return NO_EQUILIBRIUM, negative, most


@entry
def critical_forces(
    machine: Machine,
    pose: Floats,
    directions: Floats,
    first: float,
    most: float,
    tolerance: float,
    residual: float,
    iterations: int,
    forces: Floats,
    found: Ints,
) -> int:
    """Where the free platform loses its stability under forces that grow along directions.

    The force is raised in steps, from ``first`` on by half of itself each, until an equilibrium is unstable or
    none is found; then the interval is halved.

    Args:
        machine: the machine.
        pose: ``(6,)`` rigid displacement from home.
        directions: ``(k, 6)`` wrenches of unit size.
        first: smallest force.
        most: force at which it is given up.
        tolerance: relative, of the force.
        residual: at which an equilibrium counts as found.
        iterations: after which none is found.
        forces: ``(k,)`` critical forces, written; ``most`` where none is below it.
        found: ``(k,)`` whether one is.

    Returns:
        Whether the pose is in reach, as a status.
    """
    legs, n = len(machine.slides), len(machine.x_home)
    x_rest, drives, start = np.empty(n), np.empty(legs), np.empty(12)
    models, works = legs_of(machine)
    if not close_from_home(machine, models, works, pose, x_rest, drives, start):
        return OUT_OF_REACH
    x, own, platform = np.empty(n), np.zeros((legs, 6)), np.empty(12)
    x_good, own_good, platform_good = np.empty(n), np.empty((legs, 6)), np.empty(12)
    M, shares = np.empty((6, 6)), np.empty((legs, 6, 6))
    for k in range(len(directions)):
        x_good[:], own_good[:, :], platform_good[:] = x_rest, 0.0, start
        good, bad, force = 0.0, np.inf, first
        while good < most and bad - good > tolerance * max(good, first):
            x[:], own[:, :], platform[:] = x_good, own_good, platform_good
            how, negative, _ = balance(
                machine,
                models,
                works,
                platform,
                drives,
                force * directions[k],
                x,
                own,
                residual,
                iterations,
                M,
                shares,
            )
            if how == SOLVED and negative == 0:
                good = force
                x_good[:], own_good[:, :], platform_good[:] = x, own, platform
            else:
                bad = force
            force = 0.5 * (good + bad) if bad < np.inf else min(1.5 * max(good, first), most)
        found[k] = 1 if bad < np.inf else 0
        forces[k] = good
    return SOLVED


@entry
def equilibria(
    machine: Machine,
    poses: Floats,
    wrenches: Floats,
    tolerance: float,
    most: int,
    drives: Floats,
    displacement: Floats,
    K: Floats,
    forces: Floats,
    status: Ints,
    negative: Ints,
    iterations: Ints,
) -> None:
    """Free platforms at n poses, each under its wrench.

    Args:
        machine: the machine.
        poses: ``(n, 6)`` rigid displacements from home.
        wrenches: ``(n, 6)``.
        tolerance: scaled residual.
        most: iterations of Newton's method.
        drives: ``(n, l)`` written.
        displacement: ``(n, 6)`` by which the wrench moves the platform, written: shift and rotation vector.
        K: ``(n, 6, 6)`` loaded stiffness, written.
        forces: ``(n, l, 6)`` end wrenches of the legs in their own worlds, N and N mm, written.
        status: ``(n,)``.
        negative: ``(n,)`` negative eigenvalues.
        iterations: ``(n,)``.
    """
    legs = len(machine.slides)
    at_rest, x = machine.x_home.copy(), machine.x_home.copy()
    own, start, platform = np.zeros((legs, 6)), np.empty(12), np.empty(12)
    shares, here = np.empty((legs, 6, 6)), machine.drives_home.copy()
    models, works = legs_of(machine)
    known = False
    for k in range(len(poses)):
        same = known
        if known:
            for i in range(6):
                same = same and poses[k, i] == poses[k - 1, i]
        if not same:
            known = known and close_near(machine, models, works, poses[k], at_rest, here, start)
            if not known:
                known = close_from_home(machine, models, works, poses[k], at_rest, here, start)
        for leg in range(legs):
            drives[k, leg] = here[leg]
        if not known:
            status[k] = OUT_OF_REACH
            continue
        x[:] = at_rest
        own[:, :] = 0.0
        platform[:] = start
        status[k], negative[k], iterations[k] = balance(
            machine, models, works, platform, here, wrenches[k], x, own, tolerance, most, K[k], shares
        )
        for i in range(3):
            displacement[k, i] = platform[9 + i] - start[9 + i]
        rotation_between(start, platform, displacement[k, 3:])
        for leg in range(legs):
            for i in range(6):
                unit = machine.units[leg, 1] / (machine.units[leg, 0] if i < 3 else 1.0)
                forces[k, leg, i] = own[leg, i] * unit
