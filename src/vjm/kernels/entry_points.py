"""Compiled entry points for one machine at one state after another.

Here are solutions, stiffness, modes, marches, and the steps of a path that leave nothing to look into.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.kernels.arrays import Floats, Ints, MachineArrays, Work
from vjm.kernels.border import jacobi, solve
from vjm.kernels.compilation import entry, kernel
from vjm.kernels.elimination import load, move
from vjm.kernels.newton import CONVERGED, UNSTABLE, newton
from vjm.kernels.statics import act, carried, force_on, place

WELL_BELOW = 0.01
"""Share of the tolerance below which a march leaves a residual as it is."""


@entry
def solve_state(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, x: Floats, end_wrench: Floats,
    tolerance: float, most: int,
) -> tuple[int, int, float, int]:  # fmt: skip
    """`vjm.kernels.newton.newton` under all loads."""
    return newton(model, command, natural, x, end_wrench, 1.0, False, tolerance, most, False, work)


@kernel
def answer(model: MachineArrays, work: Work, forces: Floats, gap: Floats) -> None:
    """Solve ``(K − H) δx − Jᵀ δλ = forces`` (n,), ``J δx = gap`` (f,) with the present factors.

    Writes ``work.step`` (n,), and the closures' wrenches in ``work.y``, before their moments' correction.
    """
    load(model, forces, gap, work)
    solve(model, work)
    move(model, False, work)


@kernel
def corrected(model: MachineArrays, work: Work, wrench: Floats) -> None:
    """Change of the closures' wrenches ``(f,)`` in world axes: a moment turns with nothing."""
    for i in range(model.size[2]):
        wrench[i] = work.y[i]
    for k in range(len(model.closure_rows)):
        if model.closure_rows[k] == 6:
            joint = max(model.closure_joint[k, 0], model.closure_joint[k, 1])
            second = model.closure_joint[k, 1]
            u = model.carrier[second] if second >= 0 else model.carrier[joint]
            moment = model.closure_first[k] + 3
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                m_b, m_c = work.wrench[moment + b], work.wrench[moment + c]
                wrench[moment + a] -= 0.5 * (m_b * work.turn[u, c] - m_c * work.turn[u, b])


@entry
def respond(model: MachineArrays, work: Work, forces: Floats, gap: Floats, wrench: Floats) -> None:
    """`answer`, with the change of the closures' wrenches ``(f,)`` in world axes."""
    answer(model, work, forces, gap)
    corrected(model, work, wrench)


@kernel
def closure_stiffness(model: MachineArrays, work: Work, closure: int, K: Floats) -> None:
    """Write ``K^F`` (6, 6) of (18) of a weld to the ground with the present factors."""
    first = model.closure_first[closure]
    for i in range(6):
        work.right[:] = 0.0
        work.right[first + i] = 1.0
        solve(model, work)
        for j in range(6):
            K[j, i] = work.y[first + j]
    m0, m1, m2 = 0.5 * work.wrench[first + 3], 0.5 * work.wrench[first + 4], 0.5 * work.wrench[first + 5]
    K[3, 4] += m2
    K[3, 5] -= m1
    K[4, 3] -= m2
    K[4, 5] += m0
    K[5, 3] += m1
    K[5, 4] -= m0


@entry
def end_stiffness(model: MachineArrays, work: Work, K: Floats) -> None:
    """``K^F`` (6, 6) of (18) of the first closure with the present factors."""
    closure_stiffness(model, work, 0, K)


@entry
def generalised(model: MachineArrays, work: Work, wrenches: Floats, out: Floats) -> None:
    """Generalised forces ``out`` (n,) of ``wrenches`` (l, 6) on the loaded points, at the state last visited."""
    m = len(model.parent)
    S = np.zeros((m, 15))
    out[:] = 0.0
    for k in range(len(model.load_joint)):
        act(S, model.load_joint[k], work.point, k, wrenches, k, 1.0)
    for j in range(m - 1, -1, -1):
        i, c = model.parent[j], model.coordinate[j]
        if c >= 0:
            out[c] += model.factor[j] * force_on(S, j, model.rotary[j], work.w, work.o)
        if i >= 0:
            for a in range(15):
                S[i, a] += S[j, a]


@entry
def positions(
    model: MachineArrays, work: Work, command: Floats, x: Floats, joint: Ints, offset: Floats, out: Floats
) -> None:
    """World positions ``(k, 3)`` of points fixed behind joints at coordinates ``x`` (n,); the bodies are placed."""
    place(model, command, x, work)
    for k in range(len(joint)):
        carried(work.R, work.p, joint[k], offset[k], out[k])


@kernel
def inverse(model: MachineArrays, work: Work, v: Floats, forces: Floats, gap: Floats, out: Floats) -> None:
    """The inverse second variation on what the closures leave, times ``v`` (n,), both scaled by the units."""
    for i in range(len(v)):
        forces[i] = v[i] * model.energy[0] / model.unit[i]
    answer(model, work, forces, gap)
    for i in range(len(v)):
        out[i] = work.step[i] / model.unit[i]


@entry
def inverse_times(model: MachineArrays, work: Work, vectors: Floats, out: Floats) -> None:
    """`inverse` of each row of ``vectors`` (k, n)."""
    forces, gap = np.empty(len(model.unit)), np.zeros(model.size[2])
    for k in range(len(vectors)):
        inverse(model, work, vectors[k], forces, gap, out[k])


@entry
def nearest(
    model: MachineArrays, work: Work, vector: Floats, basis: Floats, tolerance: float, restarts: int
) -> float:
    """Eigenvalue nearest zero of the second variation on what the closures leave, with the present factors.

    Lanczos's method with the inverse, whose eigenvalues fall off fast; every new vector is made orthogonal to all
    others. It ends when the residual's square, which bounds the relative error, is below the tolerance.

    Args:
        model: the machine.
        work: at a state.
        vector: ``(n,)`` to start from, with a share of the mode sought; becomes that mode.
        basis: ``(k, n)`` written.
        tolerance: relative.
        restarts: from the best vector so far, when the basis is full.

    Returns:
        The eigenvalue; nan where it is not found within the tolerance, and inf where the factors are singular to
        the last digit.
    """
    k, n = basis.shape
    T = np.zeros((k, k))
    forces, gap, image = np.empty(n), np.zeros(model.size[2]), np.empty(n)
    for _ in range(restarts):
        T[:, :] = 0.0
        _copy_unit(vector, basis[0])
        for j in range(k):
            inverse(model, work, basis[j], forces, gap, image)
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
                return np.inf
            A = T[: j + 1, : j + 1].copy()
            V = jacobi(A)
            best = 0
            for r in range(1, j + 1):
                if abs(A[r, r]) > abs(A[best, best]):
                    best = r
            largest = A[best, best]
            lacking = left * V[j, best] / largest
            if lacking * lacking <= tolerance or j == k - 1 or left <= 1e-14 * abs(largest):
                for i in range(n):
                    vector[i] = 0.0
                for r in range(j + 1):
                    for i in range(n):
                        vector[i] += V[r, best] * basis[r, i]
                if j < k - 1 or lacking * lacking <= tolerance:
                    return 1.0 / largest
                break
            T[j, j + 1] = T[j + 1, j] = left
            for i in range(n):
                basis[j + 1, i] = image[i] / left
    return np.nan


@kernel
def _copy_unit(v: Floats, out: Floats) -> None:
    size = 0.0
    for i in range(len(v)):
        size += v[i] * v[i]
    size = np.sqrt(size)
    for i in range(len(v)):
        out[i] = v[i] / size


@entry
def arnoldi(
    model: MachineArrays, work: Work, device: Floats, held: Floats, begin: int, basis: Floats, H: Floats
) -> int:
    """Extend a basis of the space that the inverse tangent makes of its first vector, with the present factors.

    Args:
        model: the machine.
        work: at a state.
        device: ``(n,)`` scaled forces of a device that holds one motion more, over its own work on ``held``; empty
            where there is none.
        held: ``(n,)`` what the device's unit load moves, scaled.
        begin: so many of its vectors have been multiplied.
        basis: ``(k + 1, n)`` the first ``begin + 1`` given, orthonormal.
        H: ``(k + 1, k)`` the products in the basis, Hessenberg's form.

    Returns:
        How many vectors have been multiplied: k, or fewer where the space is exhausted.
    """
    n = basis.shape[1]
    forces, gap, image = np.empty(n), np.zeros(model.size[2]), np.empty(n)
    for j in range(begin, H.shape[1]):
        inverse(model, work, basis[j], forces, gap, image)
        if len(device):
            s = 0.0
            for i in range(n):
                s += device[i] * image[i]
            for i in range(n):
                image[i] -= s * held[i]
        size = 0.0
        for i in range(n):
            size += image[i] * image[i]
        # twice, as Kahan says, against rounding
        for _turn in range(2):
            for r in range(j + 1):
                along = 0.0
                for i in range(n):
                    along += basis[r, i] * image[i]
                for i in range(n):
                    image[i] -= along * basis[r, i]
                H[r, j] += along
        left = 0.0
        for i in range(n):
            left += image[i] * image[i]
        if not left > 1e-28 * size:
            return j + 1
        left = np.sqrt(left)
        H[j + 1, j] = left
        for i in range(n):
            basis[j + 1, i] = image[i] / left
    return H.shape[1]


@kernel
def aim(model: MachineArrays, R_0: Floats, p_0: Floats, direction: Floats, s: float) -> None:
    """Set the first closure's frame on the ground to a displacement s from a pose."""
    R, p = model.closure_R[0, 0], model.closure_p[0, 0]
    angle = np.sqrt(direction[3] ** 2 + direction[4] ** 2 + direction[5] ** 2)
    for a in range(3):
        p[a] = p_0[a] + s * direction[a]
    if angle == 0.0:
        R[:, :] = R_0
        return
    w0, w1, w2 = direction[3] / angle, direction[4] / angle, direction[5] / angle
    c, sine = np.cos(angle * s), np.sin(angle * s)
    for b in range(3):
        r0, r1, r2 = R_0[0, b], R_0[1, b], R_0[2, b]
        d = (1.0 - c) * (w0 * r0 + w1 * r1 + w2 * r2)
        R[0, b] = c * r0 + sine * (w1 * r2 - w2 * r1) + d * w0
        R[1, b] = c * r1 + sine * (w2 * r0 - w0 * r2) + d * w1
        R[2, b] = c * r2 + sine * (w0 * r1 - w1 * r0) + d * w2


@kernel
def smooth_in(s: float, origin: float) -> float:
    """What states are smooth in: the path parameter, or the root of the distance from a bifurcation."""
    return np.sqrt(s - origin) if origin > -np.inf else s


@kernel
def predict(s: Floats, x: Floats, wrench: Floats, i: int, order: int, origin: float) -> None:
    """Write the coordinates and wrenches of row i that the polynomial through the last rows foresees.

    Args:
        s: ``(g,)`` path parameters.
        x: ``(g, n)`` coordinates.
        wrench: ``(g, f)``.
        i: of the row.
        order: number of rows before it, or as many as there are.
        origin: see `smooth_in`.
    """
    x[i], wrench[i], target = 0.0, 0.0, smooth_in(s[i], origin)
    order = min(i, order)
    # the nearest first
    for k in range(i - 1, i - 1 - order, -1):
        weight, own = 1.0, smooth_in(s[k], origin)
        for other in range(i - 1, i - 1 - order, -1):
            if other != k:
                node = smooth_in(s[other], origin)
                weight *= (target - node) / (own - node)
        for c in range(x.shape[1]):
            x[i, c] += weight * x[k, c]
        for c in range(wrench.shape[1]):
            wrench[i, c] += weight * wrench[k, c]


@entry
def march(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end_wrench: Floats, R_0: Floats,
    p_0: Floats, direction: Floats, s: Floats, origin: float, along: bool, tolerance: float, most: int, x: Floats,
    wrench: Floats, K: Floats, error: Floats, iterations: Ints, negative: Ints,
) -> tuple[int, int]:  # fmt: skip
    """Equilibria, stiffness and stability along a grid of displacements of the first closure.

    Along the grid each is predicted from up to four before it, and the march ends where one is unstable; behind a
    bifurcation a branch is smooth in the root of the distance from it, and is predicted in that. Otherwise each is
    found from its own start near by, by one step at least, and nothing is said of stability between.

    Args:
        model: the machine; its first closure's frame on the ground is overwritten.
        work: written.
        command: ``(m,)``.
        natural: ``(n,)``.
        end_wrench: ``(e, 6)``.
        R_0: ``(3, 3)`` and
        p_0: ``(3,)`` the unloaded pose.
        direction: ``(6,)`` displacement per unit of s.
        s: ``(g,)`` the grid.
        origin: where the branch begins at a bifurcation, before the grid; −inf where it does not.
        along: whether from one to the next, the first one being given.
        tolerance: scaled residual at which an equilibrium counts as found.
        most: iterations of Newton's method.
        x: ``(g, n)`` coordinates and
        wrench: ``(g, f)`` closures' wrenches; the first given and the others written, or all overwritten.
        K: ``(g, 6, 6)`` loaded stiffness.
        error: ``(g,)`` scaled residuals.
        iterations: ``(g,)``.
        negative: ``(g,)`` numbers of negative eigenvalues.

    Returns:
        How it ended, and the number of points that are good.
    """
    f = wrench.shape[1]
    for i in range(len(s)):
        begins = along and i == 0
        if along and i > 0:
            predict(s, x, wrench, i, 4, origin)
        aim(model, R_0, p_0, direction, s[i])
        for c in range(f):
            work.wrench[c] = wrench[i, c]
        if not along:
            # of a machine that differs by next to nothing the start may be near enough: the derivative is in a step
            how, _, _, _ = newton(
                model, command, natural, x[i], end_wrench, 1.0, False, np.inf, 0, False, work
            )  # fmt: skip
            if how == CONVERGED:
                _step(model, work, x[i], wrench[i])
                for c in range(f):
                    work.wrench[c] = wrench[i, c]
        # of the first point only the factors are wanted
        how, iterations[i], error[i], negative[i] = newton(
            model, command, natural, x[i], end_wrench, 1.0, False, np.inf if begins else tolerance,
            0 if begins else most, False, work,
        )  # fmt: skip
        for c in range(f):
            wrench[i, c] = work.wrench[c]
        if how != CONVERGED:
            return how, i
        closure_stiffness(model, work, 0, K[i])
        if along and i > 0:
            if negative[i] > 0:
                return UNSTABLE, i
            # once more with the factors at hand: extrapolation multiplies the remaining error by 15 a point
            if error[i] > WELL_BELOW * tolerance:
                _step(model, work, x[i], wrench[i])
    return CONVERGED, len(s)


@kernel
def _step(model: MachineArrays, work: Work, x: Floats, wrench: Floats) -> None:
    """One step more with the residual and the factors at hand."""
    change = np.empty(model.size[2])
    answer(model, work, work.r, work.gap)
    corrected(model, work, change)
    for i in range(len(x)):
        x[i] += work.step[i]
    for i in range(len(change)):
        wrench[i] += change[i]


ROWS = 64
"""Points of a path in one call."""


class Rows(NamedTuple):
    """Points of a path, g of them.

    Attributes:
        s: path parameters ``(g,)``.
        x: coordinates ``(g, n)``.
        wrench: the closures' ``(g, f)``.
        stiffness: K^F ``(g, 6, 6)``.
        tangent: ``(g,)`` along the ramp.
        eigenvalue: ``(g,)`` nearest zero.
        residual: scaled ``(g,)``.
        iterations: ``(g,)``.
        shape: positions of the stations ``(g, k, 3)``.
        rate: derivatives ``(g, n)`` of the coordinates, in their units, by the path parameter.
    """

    s: Floats
    x: Floats
    wrench: Floats
    stiffness: Floats
    tangent: Floats
    eigenvalue: Floats
    residual: Floats
    iterations: Ints
    shape: Floats
    rate: Floats


class Limits(NamedTuple):
    """What a step is asked for; see `vjm.continuation.load_stepping` and the modules that look at its steps.

    Attributes:
        length: of the path.
        largest: step.
        small: step from which others look at what bends.
        bend: of the shape.
        half: what the smallest eigenvalue may fall to, over that before.
        end: distance of the chord from what an end's tangent foresees.
        mean: likewise from the mean of the two.
        nothing: motion of a coordinate over the largest of a step that is none.
        slight: likewise, of which the mean alone is asked.
        still: motion in the coordinates' units that is none.
        neutral: eigenvalue that is within rounding of zero.
        wide: change of the shape from which a second mode is looked at.
        knee: tangent stiffness that is an event.
        tolerance: scaled residual of an equilibrium.
        most: iterations of Newton's method.
    """

    length: float
    largest: float
    small: float
    bend: float
    half: float
    end: float
    mean: float
    nothing: float
    slight: float
    still: float
    neutral: float
    wide: float
    knee: float
    tolerance: float
    most: int


class ImposedRamp(NamedTuple):
    """Displacements ``(6,)`` per unit of the path parameter from an unloaded pose ``(3, 3)``, ``(3,)``."""

    R: Floats
    p: Floats
    direction: Floats


class ModeSearch(NamedTuple):
    """Where the search for the smallest eigenvalue begins.

    Attributes:
        last: mode ``(n,)``, overwritten.
        some: ``(n,)`` added to it, in units of its length.
        basis: ``(k, n)`` written.
        accuracy: of the eigenvalue, relative.
        restarts: of the search.
    """

    last: Floats
    some: Floats
    basis: Floats
    accuracy: float
    restarts: int


@entry
def plain_steps(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end_wrench: Floats, ramp: ImposedRamp,
    modes: ModeSearch, joint: Ints, offset: Floats, limits: Limits, origin: float, known: int, step: float,
    rows: Rows,
) -> tuple[int, float]:  # fmt: skip
    """Follow a path as long as its steps are plain.

    Args:
        model: the machine; its first closure's frame on the ground is overwritten.
        work: written.
        command: ``(m,)``.
        natural: ``(n,)``.
        end_wrench: ``(e, 6)``.
        ramp: of the first closure's frame.
        modes: of the last point.
        joint: before each station ``(k,)`` and
        offset: its place behind it ``(k, 3)``.
        limits: of the steps.
        origin: where the path begins at a bifurcation, which may be the first of the points; −inf elsewhere.
        known: number of points, at most three, that are given: the last ones.
        step: to begin with.
        rows: the points; those behind the ones that are given are written as far as there are rows.

    Returns:
        Number of points that are known now, and the next step.
    """
    i = known - 1
    begin = 1 if rows.s[0] == origin else 0
    _copy(work.wrench, rows.wrench[i])
    aim(model, ramp.R, ramp.p, ramp.direction, rows.s[i])
    how, _, _, negative = newton(model, command, natural, rows.x[i], end_wrench, 1.0, False, np.inf, 0, False, work)
    if how != CONVERGED or negative != 0:
        return known, step
    _rate(model, work, ramp, rows.rate[i])
    while rows.s[i] < limits.length * (1.0 - 1e-12) and i + 1 < len(rows.s):
        target = min(rows.s[i] + step, limits.length)
        if limits.length - target < 0.3 * step:
            target = limits.length
        rows.s[i + 1] = target
        predict(rows.s, rows.x, rows.wrench, i + 1, 3, origin)
        if not _found(model, work, command, natural, end_wrench, ramp, modes, joint, offset, limits, i + 1, rows):
            break
        bend = _bend(rows, i, origin, limits.length)
        if bend > limits.bend:
            if target - rows.s[i] <= limits.small:
                break
            step = 0.5 * (target - rows.s[i])
            continue
        if not _is_even(model.unit, rows, i, origin > -np.inf, limits) or _may_hide(rows, i, begin, limits):
            break
        if rows.tangent[i] > limits.knee >= rows.tangent[i + 1] or rows.tangent[i] > 0.0 >= rows.tangent[i + 1]:
            break
        i += 1
        step = min(limits.largest, (target - rows.s[i - 1]) * (2.0 if bend < 0.5 * limits.bend else 1.2))
    return i + 1, step


@kernel
def _copy(to: Floats, values: Floats) -> None:
    for i in range(len(to)):
        to[i] = values[i]


@kernel
def _rate(model: MachineArrays, work: Work, ramp: ImposedRamp, rate: Floats) -> None:
    """Write the derivative ``(n,)`` of the scaled coordinates with the factors at hand."""
    gap = np.zeros(model.size[2])
    gap[:6] = ramp.direction
    answer(model, work, np.zeros(len(rate)), gap)
    for c in range(len(rate)):
        rate[c] = work.step[c] / model.unit[c]


@kernel
def _found(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end_wrench: Floats, ramp: ImposedRamp,
    modes: ModeSearch, joint: Ints, offset: Floats, limits: Limits, i: int, rows: Rows,
) -> bool:  # fmt: skip
    """Complete a row from the state foreseen in it; false unless it is a stable equilibrium."""
    n = rows.x.shape[1]
    aim(model, ramp.R, ramp.p, ramp.direction, rows.s[i])
    _copy(work.wrench, rows.wrench[i])
    how, rows.iterations[i], rows.residual[i], negative = newton(
        model, command, natural, rows.x[i], end_wrench, 1.0, False, limits.tolerance, limits.most, False, work
    )
    if how != CONVERGED or negative != 0:
        return False
    _copy(rows.wrench[i], work.wrench)
    closure_stiffness(model, work, 0, rows.stiffness[i])
    tangent = size = 0.0
    for a in range(6):
        for b in range(6):
            tangent += ramp.direction[a] * rows.stiffness[i, a, b] * ramp.direction[b]
    rows.tangent[i] = tangent
    for c in range(n):
        size += modes.last[c] ** 2
    size = np.sqrt(size)
    if not size < np.inf:
        return False
    for c in range(n):
        modes.last[c] += size * modes.some[c]
    value = nearest(model, work, modes.last, modes.basis, modes.accuracy, modes.restarts)
    rows.eigenvalue[i] = value
    if not limits.neutral < value < np.inf:
        return False
    _rate(model, work, ramp, rows.rate[i])
    for k in range(len(joint)):
        carried(work.R, work.p, joint[k], offset[k], rows.shape[i, k])
    return True


@kernel
def _bend(rows: Rows, i: int, origin: float, length: float) -> float:
    """How far the shape behind point i lies from the prolongation of the last two, over the way to it."""
    if i == 0:
        return 0.0
    s, shape, way, least = rows.s, rows.shape, 0.0, np.inf
    for k in range(shape.shape[1]):
        for a in range(3):
            way += (shape[i + 1, k, a] - shape[i, k, a]) ** 2
    for form in range(2 if origin > -np.inf else 1):
        ratio, missed = (s[i + 1] - s[i]) / (s[i] - s[i - 1]), 0.0
        if form == 1:
            start, last = smooth_in(s[i - 1], origin), smooth_in(s[i], origin)
            ratio = (smooth_in(s[i + 1], origin) - last) / (last - start)
        for k in range(shape.shape[1]):
            for a in range(3):
                missed += (shape[i + 1, k, a] - shape[i, k, a] - (shape[i, k, a] - shape[i - 1, k, a]) * ratio) ** 2
        least = min(least, np.sqrt(missed))
    return least / (np.sqrt(way) + 1e-6 * length)


@kernel
def _is_even(unit: Floats, rows: Rows, i: int, by_root: bool, limits: Limits) -> bool:
    """Whether the step behind point i stays on one path, see `vjm.continuation.one_path`."""
    if not limits.neutral < rows.eigenvalue[i]:
        return False
    h, n = rows.s[i + 1] - rows.s[i], rows.x.shape[1]
    first, last, chord = h * rows.rate[i], h * rows.rate[i + 1], np.empty(n)
    a = b = c = off_a = off_b = most = 0.0
    for k in range(n):
        chord[k] = (rows.x[i + 1, k] - rows.x[i, k]) / unit[k]
        a, b, c = a + first[k] ** 2, b + last[k] ** 2, c + chord[k] ** 2
        off_a, off_b = off_a + (chord[k] - first[k]) ** 2, off_b + (chord[k] - last[k]) ** 2
        most = max(most, abs(chord[k]))
    if not max(a, b, c) < limits.still**2:
        if not (off_a <= limits.end**2 * a and off_b <= limits.end**2 * b):
            return False
        for k in range(n):
            larger = max(abs(first[k]), abs(last[k]))
            if not abs(chord[k] - 0.5 * (first[k] + last[k])) <= limits.mean * (larger + limits.nothing * most):
                return False
            largest = limits.end * (larger + limits.slight * most)
            if not (abs(chord[k] - first[k]) <= largest and abs(chord[k] - last[k]) <= largest):
                return False
    ratio = rows.eigenvalue[i + 1] / rows.eigenvalue[i]
    return by_root or limits.half <= ratio <= 1.0 / limits.half


@kernel
def _may_hide(rows: Rows, i: int, begin: int, limits: Limits) -> bool:
    """Whether stability may be lost and won back about point i, see `vjm.continuation.events`."""
    if i - 1 < begin:
        return False
    value, shape, spread, moved = rows.eigenvalue, rows.shape, 0.0, 0.0
    if value[i] < min(value[i - 1], value[i + 1]):
        return True
    for k in range(shape.shape[1]):
        for a in range(3):
            spread += (shape[i - 1, k, a] - shape[i - 1, 0, a]) ** 2
            moved += (shape[i + 1, k, a] - shape[i - 1, k, a]) ** 2
    return moved > limits.wide**2 * spread
