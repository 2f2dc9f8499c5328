"""Compiled entry points: what Python calls, each with a model and its workspace in flat buffers."""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import entry, kernel
from vjm.kernels.factorization import bunch_parlett_solve, jacobi
from vjm.kernels.packed_model import Floats, Ints, PackedModel, Workspace, model_of, work_of
from vjm.kernels.recursion import apply_loads, forward_kinematics, pose_error
from vjm.kernels.unsymmetric import linearise, solve

CONVERGED, DIVERGED, SINGULAR, UNSTABLE = 0, 1, 2, 3
"""How an iteration or a march ends."""


@kernel
def newton_step(model: PackedModel, work: Workspace, x: Floats, force: Floats) -> None:
    """Move a state by the solution of its factored system."""
    solve(model, work, work.residual, work.gap)
    for i in range(len(x)):
        x[i] += work.step[i]
    m0, m1, m2, r0, r1, r2 = force[3], force[4], force[5], work.gap[3], work.gap[4], work.gap[5]
    for i in range(6):
        force[i] += work.right[i]
    # the moment turns with nothing: the half of its coupling that is not symmetric
    force[3] -= 0.5 * (m1 * r2 - m2 * r1)
    force[4] -= 0.5 * (m2 * r0 - m0 * r2)
    force[5] -= 0.5 * (m0 * r1 - m1 * r0)


@kernel
def iterate(
    model: PackedModel,
    work: Workspace,
    target: Floats,
    x: Floats,
    force: Floats,
    tolerance: float,
    max_iterations: int,
) -> tuple[int, int, float, int]:
    """See `newton`."""
    R_to, p_to = target[:9].reshape((3, 3)), target[9:]
    error, negative = np.inf, -1
    for iteration in range(max_iterations + 1):
        forward_kinematics(model, x, work)
        if not pose_error(work, R_to, p_to) and tolerance < np.inf:
            return DIVERGED, iteration, error, -1
        negative = linearise(model, x, force, work)
        error, heavy = 0.0, 1.0
        for i in range(len(work.residual)):
            error = max(error, abs(work.residual[i]))
        for i in range(6):
            error = max(error, abs(work.gap[i]))
            heavy = max(heavy, abs(force[i]))
            for k in range(len(work.acting)):
                heavy = max(heavy, abs(work.acting[k, i]))
        error /= heavy
        if error < tolerance and negative >= 0:
            return CONVERGED, iteration, error, negative
        if not error < 1e6:
            return DIVERGED, iteration, error, -1
        if negative < 0:
            return SINGULAR, iteration, error, -1
        if iteration == max_iterations:
            break
        newton_step(model, work, x, force)
    return DIVERGED, max_iterations, error, negative


@entry
def newton(
    integers: Ints,
    numbers: Floats,
    work_integers: Ints,
    work_numbers: Floats,
    target: Floats,
    x: Floats,
    force: Floats,
    tolerance: float,
    max_iterations: int,
) -> tuple[int, int, float, int]:
    """Equilibrium with the end-effector at a frame, from ``x`` (n,) and ``force`` (6,), both overwritten.

    Args:
        integers: see `vjm.kernels.packed_model.Buffers`.
        numbers: likewise.
        work_integers: likewise.
        work_numbers: likewise.
        target: ``(12,)`` the frame: rotation row by row, then position.
        x: coordinates.
        force: wrench.
        tolerance: scaled residual at which it ends; infinite to factor at the state that is given.
        max_iterations: after which it gives up.

    Returns:
        How it ended, iterations, scaled residual, and the number of negative eigenvalues there. The factors in
        the workspace are those of the state returned.
    """
    model = model_of(integers, numbers)
    work = work_of(integers, work_integers, work_numbers)
    return iterate(model, work, target, x, force, tolerance, max_iterations)


@entry
def respond(
    integers: Ints, numbers: Floats, work_integers: Ints, work_numbers: Floats, load: Floats, gap: Floats
) -> None:
    """`vjm.kernels.unsymmetric.solve` with the present factors."""
    model = model_of(integers, numbers)
    solve(model, work_of(integers, work_integers, work_numbers), load, gap)


@entry
def place_loads(integers: Ints, numbers: Floats, work_integers: Ints, work_numbers: Floats, x: Floats) -> None:
    """Kinematics at ``x`` (n,): where the loads act, and how."""
    forward_kinematics(model_of(integers, numbers), x, work_of(integers, work_integers, work_numbers))


@entry
def load_forces(
    integers: Ints, numbers: Floats, work_integers: Ints, work_numbers: Floats, wrenches: Floats, out: Floats
) -> None:
    """Generalised forces ``out`` (n,) of ``wrenches`` (l, 6) on the loaded points, at the state last visited."""
    model = model_of(integers, numbers)
    work = work_of(integers, work_integers, work_numbers)
    apply_loads(model, work, wrenches)
    out[:] = 0.0
    for j in range(len(model.rotary)):
        out[model.coordinate[j]] += model.factor[j] * work.hung[j, 3]


@kernel
def loaded_stiffness(model: PackedModel, work: Workspace, force: Floats, K: Floats) -> None:
    """Write ``K^F`` (6, 6) of (18) with the present factors, under the wrench ``force`` (6,)."""
    if len(model.turning):
        load, gap = np.zeros(len(work.step)), np.zeros(6)
        for j in range(6):
            gap[:] = 0.0
            gap[j] = 1.0
            solve(model, work, load, gap)
            for i in range(6):
                K[i, j] = work.right[i]
    else:
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


@entry
def end_stiffness(
    integers: Ints, numbers: Floats, work_integers: Ints, work_numbers: Floats, force: Floats, K: Floats
) -> None:
    """``K^F`` (6, 6) of (18) with the present factors."""
    model = model_of(integers, numbers)
    loaded_stiffness(model, work_of(integers, work_integers, work_numbers), force, K)


@entry
def nearest(
    integers: Ints,
    numbers: Floats,
    work_integers: Ints,
    work_numbers: Floats,
    vector: Floats,
    basis: Floats,
    tolerance: float,
    restarts: int,
) -> float:
    """Eigenvalue nearest zero of the second variation on the null space of J, with the present factors.

    Lanczos's method with the inverse, whose eigenvalues fall off fast; every new vector is made orthogonal to all
    others. It ends when the residual's square, which bounds the relative error, is below the tolerance.

    Args:
        integers: see `vjm.kernels.packed_model.Buffers`.
        numbers: likewise.
        work_integers: likewise.
        work_numbers: likewise.
        vector: ``(n,)`` to start from, with a share of the mode sought; becomes that mode.
        basis: ``(k, n)`` written.
        tolerance: relative.
        restarts: from the best vector so far, when the basis is full.

    Returns:
        The eigenvalue; nan where the factors are singular to the last digit.
    """
    model = model_of(integers, numbers)
    work = work_of(integers, work_integers, work_numbers)
    gap = np.zeros(6)
    k, n = basis.shape
    T = np.zeros((k, k))
    value = np.nan
    for _ in range(restarts):
        T[:, :] = 0.0
        _copy_unit(vector, basis[0])
        for j in range(k):
            solve(model, work, basis[j], gap)
            image = work.step
            # twice, as Kahan says, against rounding
            for _turn in range(2):
                for r in range(j, -1, -1):
                    along = 0.0
                    for i in range(n):
                        along += basis[r, i] * image[i]
                    for i in range(n):
                        image[i] -= along * basis[r, i]
                    if r == j:
                        T[j, j] += along
            left = 0.0
            for i in range(n):
                left += image[i] * image[i]
            left = np.sqrt(left)
            if not np.isfinite(left + T[j, j]):
                return np.nan
            A = T[: j + 1, : j + 1].copy()
            V = jacobi(A)
            best = 0
            for r in range(1, j + 1):
                if abs(A[r, r]) > abs(A[best, best]):
                    best = r
            inverse = A[best, best]
            lacking = left * V[j, best] / inverse
            if lacking * lacking <= tolerance or j == k - 1 or left <= 1e-14 * abs(inverse):
                value = 1.0 / inverse
                for i in range(n):
                    vector[i] = 0.0
                for r in range(j + 1):
                    for i in range(n):
                        vector[i] += V[r, best] * basis[r, i]
                if j < k - 1 or lacking * lacking <= tolerance:
                    return value
                break
            T[j, j + 1] = T[j + 1, j] = left
            for i in range(n):
                basis[j + 1, i] = image[i] / left
    return value


@kernel
def _copy_unit(v: Floats, out: Floats) -> None:
    size = 0.0
    for i in range(len(v)):
        size += v[i] * v[i]
    size = np.sqrt(size)
    for i in range(len(v)):
        out[i] = v[i] / size
