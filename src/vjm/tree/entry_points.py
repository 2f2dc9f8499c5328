"""Compiled entry points of a tree: equilibria over many postures, and solutions with their tangents."""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import entry, kernel
from vjm.kernels.packed_model import Floats, Ints
from vjm.tree.arrays import TreeArrays, TreeWork, workspace
from vjm.tree.dense import definite, factor, solve
from vjm.tree.kernel import evaluate, jacobian, place, turn_followers

STABLE, UNSTABLE, LOST = 0, 1, 2
"""What became of a posture: a stable or an unstable equilibrium, or none found."""
ITERATIONS = 40
"""Of Newton's method at one share of the loads."""
LARGEST_STEP = 0.3
"""Radians, or lengths of the machine, that one step may move a coordinate by."""
LAST_STEP = 1e-9
"""Below it the next would be lost in rounding, as steps shrink by their square."""
REGULAR = 1e-13
"""Pivot of a compliance, scaled to a unit diagonal, below which it is rounding: under six springs move the end."""
STILL = 1e-24
"""Compliance of a direction over the largest of its kind that is rounding: that of J, 1e-15, squared is 1e-30."""
SMALLEST_SHARE = 1.0 / 256.0
"""Of the loads that is put on at once where all of them do not converge."""


@kernel
def _newton(
    model: TreeArrays, command: Floats, natural: Floats, x: Floats, end_wrench: Floats, share: float, work: TreeWork
) -> bool:
    """Equilibrium at a share of the loads from ``x``, which is overwritten."""
    n = len(x)
    for _ in range(ITERATIONS):
        evaluate(model, command, natural, x, end_wrench, share, work, True)
        if not factor(work.A, work.swaps):
            return False
        Z = work.r.reshape((n, 1))
        solve(work.A, work.swaps, Z)
        largest = 0.0
        for i in range(n):
            largest = max(largest, abs(Z[i, 0]) / model.unit[i])
        if not largest < np.inf:
            return False
        cut = min(1.0, LARGEST_STEP / largest) if largest > 0.0 else 1.0
        for i in range(n):
            x[i] += cut * Z[i, 0]
        if largest < LAST_STEP:
            return True
    return False


@kernel
def _loaded(
    model: TreeArrays, command: Floats, natural: Floats, x: Floats, end_wrench: Floats, work: TreeWork
) -> bool:
    """Equilibrium under all loads from ``x`` (n,); they are put on in steps where it is not found at once."""
    for i in range(len(x)):
        work.begin[i] = x[i]
    if _newton(model, command, natural, x, end_wrench, 1.0, work):
        return True
    start = work.begin
    x[:] = start
    done, step = 0.0, 0.25
    if not _newton(model, command, natural, x, end_wrench, 0.0, work):
        return False
    while done < 1.0:
        start[:] = x
        share = min(done + step, 1.0)
        if _newton(model, command, natural, x, end_wrench, share, work):
            done = share
            continue
        x[:] = start
        step *= 0.5
        if step < SMALLEST_SHARE:
            return False
    return True


@kernel
def _displacement(R: Floats, R0: Floats, p: Floats, p0: Floats, A: Floats, out: Floats) -> None:
    """Displacement ``(6,)`` between two frames; the turn is nan at half a turn."""
    for a in range(3):
        out[a] = p[a] - p0[a]
        for b in range(3):
            A[a, b] = R[a, 0] * R0[b, 0] + R[a, 1] * R0[b, 1] + R[a, 2] * R0[b, 2]
    x, y, z = 0.5 * (A[2, 1] - A[1, 2]), 0.5 * (A[0, 2] - A[2, 0]), 0.5 * (A[1, 0] - A[0, 1])
    sine, cosine = np.sqrt(x * x + y * y + z * z), 0.5 * (A[0, 0] + A[1, 1] + A[2, 2] - 1.0)
    scale = np.arctan2(sine, cosine) / sine if sine > 1e-9 else (1.0 if cosine > 0.0 else np.nan)
    out[3], out[4], out[5] = x * scale, y * scale, z * scale


@kernel
def _end_compliance(model: TreeArrays, work: TreeWork, k: int, C: Floats) -> None:
    """``J A⁻¹ Jᵀ`` (6, 6) of an end frame with the tangent's factor at hand."""
    n = len(work.t)
    jacobian(model, work, model.end_joint[k], work.end_p[k])
    for i in range(n):
        for a in range(6):
            work.Z[i, a] = work.J[a, i]
    solve(work.A, work.swaps, work.Z)
    for a in range(6):
        for b in range(6):
            s = 0.0
            for i in range(n):
                s += work.J[a, i] * work.Z[i, b]
            C[a, b] = s


@kernel
def _copy_ends(work: TreeWork, R: Floats, p: Floats) -> None:
    for k in range(len(p)):
        for a in range(3):
            p[k, a] = work.end_p[k, a]
            for b in range(3):
                R[k, a, b] = work.end_R[k, a, b]


@kernel
def _inverse(C: Floats, F: Floats, swaps: Ints, K: Floats) -> None:
    """``K = C⁻¹`` (6, 6), scaled to a unit diagonal on the way; nan where C has no inverse."""
    # a direction in which nothing moves: what its diagonal holds is rounding, squared
    largest = np.zeros(2)
    for a in range(6):
        largest[a // 3] = max(largest[a // 3], C[a, a])
    for a in range(6):
        if not C[a, a] > STILL * largest[a // 3]:
            K[:, :] = np.nan
            return
    good = True
    for a in range(6):
        for b in range(6):
            size = np.sqrt(C[a, a] * C[b, b])
            F[a, b] = C[a, b] / size
            K[a, b] = 1.0 if a == b else 0.0
            good = good and np.isfinite(F[a, b])
    good = good and factor(F, swaps)
    for a in range(6):
        good = good and abs(F[a, a]) > REGULAR
    if not good:
        K[:, :] = np.nan
        return
    solve(F, swaps, K)
    for a in range(6):
        for b in range(6):
            K[a, b] /= np.sqrt(C[a, a] * C[b, b])


@entry
def equilibria_of(
    model: TreeArrays,
    commands: Floats,
    naturals: Floats,
    end_wrench: Floats,
    x: Floats,
    verdict: Ints,
    forces: Floats,
    end_R: Floats,
    end_p: Floats,
    deflection: Floats,
    compliance: Floats,
    stiffness: Floats,
) -> None:
    """Equilibria of g postures; every array but the model's has g rows.

    Args:
        model: the machine.
        commands: ``(g, m)`` values of the held joints.
        naturals: ``(g, n)`` coordinates at which springs are free of stress.
        end_wrench: ``(g or 1, e, 6)`` wrenches on the end frames.
        x: ``(g, n)`` coordinates to start from; become those of the equilibria.
        verdict: ``(g,)`` written: `STABLE`, `UNSTABLE` or `LOST`.
        forces: ``(g, m)`` of the loads on the joints.
        end_R: ``(g, e, 3, 3)`` and
        end_p: ``(g, e, 3)`` the end frames.
        deflection: ``(g, e, 6)`` of them from the unloaded posture.
        compliance: ``(g, e, 6, 6)`` tangent compliance of them; without rows where it is not wanted.
        stiffness: ``(g, e, 6, 6)`` its inverse, nan where it has none; likewise.
    """
    work = workspace(model)
    unloaded = np.zeros(x.shape[1])
    single = len(end_wrench) == 1
    for g in range(len(x)):
        place(model, commands[g], unloaded, work)
        turn_followers(model, work)
        _copy_ends(work, end_R[g], end_p[g])
        wrench = end_wrench[0] if single else end_wrench[g]
        found = _loaded(model, commands[g], naturals[g], x[g], wrench, work)
        evaluate(model, commands[g], naturals[g], x[g], wrench, 1.0, work, True)
        for i in range(len(work.t)):
            for c in range(len(work.t)):
                work.B[i, c] = work.A[i, c]
        verdict[g] = (STABLE if definite(work.B) else UNSTABLE) if found and factor(work.A, work.swaps) else LOST
        for j in range(len(work.Q)):
            forces[g, j] = work.Q[j]
        for k in range(len(work.end_p)):
            _displacement(work.end_R[k], end_R[g, k], work.end_p[k], end_p[g, k], work.Kb, deflection[g, k])
            if len(compliance):
                _end_compliance(model, work, k, compliance[g, k])
                _inverse(compliance[g, k], work.Kb, work.swaps6, stiffness[g, k])
        _copy_ends(work, end_R[g], end_p[g])


@entry
def linearize(
    model: TreeArrays, natural: Floats, x: Floats, end_wrench: Floats, body: Floats, residual: Floats,
    forces: Floats, tangent: Floats, jacobians: Floats, wrenches: Floats, points: Floats, R: Floats, p: Floats,
) -> None:  # fmt: skip
    """All that there is to know of a machine with one end frame and no held joints at coordinates ``x`` (n,).

    Args:
        model: the machine; its loads that do not follow are those at this state.
        natural: ``(n,)`` coordinates at which springs are free of stress.
        x: ``(n,)`` where.
        end_wrench: ``(1, 6)`` on the end frame.
        body: ``(l, 6)`` loads that follow, in their bodies' axes.
        residual: ``(n,)`` written, as all that follow.
        forces: ``(n,)`` of all loads on the coordinates.
        tangent: ``(n, n)`` derivative of ``-residual``.
        jacobians: ``(1 + l, 6, n)`` of the end frame and of the loaded points.
        wrenches: ``(l, 6)`` on these points, world axes.
        points: ``(1 + l, 3)`` where they are.
        R: ``(m + 1, 3, 3)`` and
        p: ``(m + 1, 3)`` the frames behind the joints, and last the end frame.
    """
    work = workspace(model)
    work.body[:, :] = body
    evaluate(model, np.zeros(len(model.parent)), natural, x, end_wrench, 1.0, work, True)
    residual[:], forces[:], tangent[:, :] = work.r, work.t, work.A
    m = len(model.parent)
    R[:m], p[:m], R[m], p[m], points[0] = work.R, work.p, work.end_R[0], work.end_p[0], work.end_p[0]
    jacobian(model, work, model.end_joint[0], work.end_p[0])
    jacobians[0] = work.J
    for k in range(len(model.load_joint)):
        j = model.load_joint[k]
        for a in range(3):
            points[1 + k, a] = work.p[j, a]
            for b in range(3):
                points[1 + k, a] += work.R[j, a, b] * model.load_offset[k, b]
        jacobian(model, work, j, points[1 + k])
        jacobians[1 + k] = work.J
        for half in range(0, 6, 3):
            for a in range(3):
                wrenches[k, half + a] = model.load[k, half + a]
                if model.follows[k]:
                    wrenches[k, half + a] = 0.0
                    for b in range(3):
                        wrenches[k, half + a] += work.R[j, a, b] * body[k, half + b]


@entry
def residuals_of(
    model: TreeArrays,
    commands: Floats,
    naturals: Floats,
    end_wrench: Floats,
    x: Floats,
    residual: Floats,
    end_R: Floats,
    end_p: Floats,
    unloaded: bool,
) -> None:
    """Residuals ``(g, n)`` and end frames at coordinates ``(g, n)`` that need not be equilibria.

    With ``unloaded`` the end frames are those of the unloaded posture; see `equilibria_of` for the arguments.
    """
    work = workspace(model)
    home = np.zeros(x.shape[1])
    single = len(end_wrench) == 1
    for g in range(len(x)):
        place(model, commands[g], home, work)
        turn_followers(model, work)
        if unloaded:
            end_R[g], end_p[g] = work.end_R, work.end_p
            continue
        evaluate(
            model, commands[g], naturals[g], x[g], end_wrench[0] if single else end_wrench[g], 1.0, work, False
        )
        residual[g] = work.r
        end_R[g], end_p[g] = work.end_R, work.end_p


@entry
def responses_of(
    model: TreeArrays,
    commands: Floats,
    naturals: Floats,
    end_wrench: Floats,
    x: Floats,
    right: Floats,
    moved: Floats,
) -> None:
    """Motions of the end frames that residuals ``right`` (g, k, n) bring at the equilibria ``x`` (g, n).

    ``moved`` (g, k, e, 6) is written; see `equilibria_of` for the other arguments.
    """
    work = workspace(model)
    home = np.zeros(x.shape[1])
    single = len(end_wrench) == 1
    for g in range(len(x)):
        place(model, commands[g], home, work)
        turn_followers(model, work)
        evaluate(model, commands[g], naturals[g], x[g], end_wrench[0] if single else end_wrench[g], 1.0, work, True)
        factor(work.A, work.swaps)
        motions = np.ascontiguousarray(right[g].T)
        solve(work.A, work.swaps, motions)
        for e in range(len(model.end_joint)):
            jacobian(model, work, model.end_joint[e], work.end_p[e])
            for k in range(motions.shape[1]):
                for a in range(6):
                    s = 0.0
                    for i in range(len(home)):
                        s += work.J[a, i] * motions[i, k]
                    moved[g, k, e, a] = s
