"""Compiled charts of the equilibria of a machine under all forces on an end: three coordinates along their tangent.

They are regular where the force has a limit, and at bifurcations.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from vjm.kernels.arrays import Floats, MachineArrays, Work
from vjm.kernels.border import invert, solve
from vjm.kernels.compilation import kernel
from vjm.kernels.jacobi import jacobi
from vjm.kernels.newton import LARGEST_STEP, advance, linearise
from vjm.kernels.substitution import load, move
from vjm.tree.constrained_minimum import H

MOST = 20
"""Iterations of Newton's method: each point lies near a known one."""
ARRIVED = 1e-7
"""Step after which Newton's method, whose steps shrink by their square, has arrived."""
NEAR = 0.1 * H**2
"""The same for points of a quadratic model: the residual, its square, is a part of 1e-6 of the model's bends."""
PAIRS = tuple(combinations(range(3), 2))
AROUND = H * np.vstack([np.eye(3), -np.eye(3), [np.eye(3)[a] + np.eye(3)[b] for a, b in PAIRS]])
"""Coordinates ``(9, 3)`` of the points around a chart's centre from which its model is made."""


@kernel
def _towards(model: MachineArrays, work: Work, own: bool, end: int, axis: int) -> None:
    """Motion ``work.step`` by a unit force along an axis on an end; with ``own`` what Newton's method asks for.

    The factors at hand have the end frames' columns.
    """
    T, right, inner, last = work.T, work.right, model.size[5], model.size[6]
    column = last if own else inner + 6 * end + axis
    for i in range(inner):
        right[i] = -T[i, column]
    solve(model, work)
    if not own:
        work.y[column] = 1.0
        work.b[:] = 0.0
    move(model, own, work)


@kernel
def unit_responses(model: MachineArrays, work: Work, end: int, response: Floats, y: Floats, turn: Floats) -> None:
    """What unit forces on an end move ``(n, 3)``, with the border's ``(3, …)`` and the bodies' turns ``(3, …)``."""
    for a in range(3):
        _towards(model, work, False, end, a)
        for i in range(len(response)):
            response[i, a] = work.step[i]
        y[a], turn[a] = work.y, work.turn


@kernel
def felt_by(model: MachineArrays, work: Work, pattern: Floats, mode: Floats) -> float:
    """Stiffness that a device with a pattern of forces feels, and what its unit push moves."""
    load(model, pattern, np.zeros(model.size[2]), work)
    solve(model, work)
    move(model, False, work)
    given = 0.0
    for i in range(len(pattern)):
        mode[i] = work.step[i]
        given += pattern[i] * work.step[i]
    return 1.0 / given


@kernel
def set_chart(model: MachineArrays, response: Floats, far: float, size: float, Q: Floats, scale: Floats) -> None:
    """Orthonormal tangent ``Q`` (n + 3, 3) of motions and forces over their scales ``(n + 3,)``."""
    n = len(response)
    for a in range(3):
        for i in range(n):
            scale[i] = model.unit[i] * far * size
            Q[i, a] = response[i, a] / scale[i]
        for b in range(3):
            scale[n + b] = size
            Q[n + b, a] = 1.0 / size if a == b else 0.0
    for a in range(3):
        # twice, as Kahan says, against rounding
        for _ in range(2):
            for b in range(a):
                s = 0.0
                for i in range(n + 3):
                    s += Q[i, a] * Q[i, b]
                for i in range(n + 3):
                    Q[i, a] -= s * Q[i, b]
            s = 0.0
            for i in range(n + 3):
                s += Q[i, a] * Q[i, a]
            s = np.sqrt(s)
            for i in range(n + 3):
                Q[i, a] /= s


@kernel
def equilibrium_at(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end: int, centre: Floats, Q: Floats,
    scale: Floats, theta: Floats, patterns: Floats, fine: bool, x: Floats, wrench: Floats, force: Floats,
    felt: Floats, mode: Floats, response: Floats,
) -> int:  # fmt: skip
    """Equilibrium at coordinates ``(3,)`` of a chart about a point ``centre`` (n + 3,): motion and force.

    Args:
        model: the machine.
        work: written.
        command: ``(m,)`` values of the held joints.
        natural: ``(n,)`` coordinates at which the springs are free of stress.
        end: index of the end frame.
        centre: where the chart begins.
        Q: see `set_chart`.
        scale: likewise.
        theta: coordinates.
        patterns: ``(k, n)`` forces of devices that push along a motion.
        fine: to the last digit, and with the response; else as a point of a quadratic model.
        x: ``(n,)`` coordinates to start from; become the equilibrium's.
        wrench: ``(f,)`` of the closures, likewise.
        force: ``(3,)`` N, likewise.
        felt: ``(k,)`` written: stiffnesses that the devices feel.
        mode: ``(n,)`` written: what the last device's unit push moves.
        response: ``(n, 3)`` written: what unit forces on the end move.

    Returns:
        Number of negative eigenvalues, −1 where no equilibrium was found.
    """
    n = len(x)
    acting, change, M = np.zeros((len(model.end_joint), 6)), np.zeros(3), np.zeros((3, 3))
    y, turn, own = np.empty((3, len(work.y))), np.empty((3, len(work.turn), 3)), np.empty(n)
    work.wrench[:] = wrench
    arrived = False
    for _ in range(MOST):
        for a in range(3):
            acting[end, a] = force[a]
        found = linearise(model, command, natural, x, acting, 1.0, True, work)
        if found < 0:
            break
        if fine or not arrived:
            unit_responses(model, work, end, response, y, turn)
        if arrived:
            wrench[:] = work.wrench
            for k in range(len(patterns)):
                felt[k] = felt_by(model, work, patterns[k], mode)
            return found + work.state[3]
        _towards(model, work, True, end, 0)
        for i in range(n):
            own[i] = work.step[i]
        for j in range(3):
            s = theta[j]
            for i in range(n):
                s -= Q[i, j] * (x[i] + own[i] - centre[i]) / scale[i]
            for a in range(3):
                s -= Q[n + a, j] * (force[a] - centre[n + a]) / scale[n + a]
            change[j] = s
            for a in range(3):
                s = Q[n + a, j] / scale[n + a]
                for i in range(n):
                    s += Q[i, j] * response[i, a] / scale[i]
                M[j, a] = s
        if not invert(M, 0.0):
            break
        largest = 0.0
        for a in range(3):
            f = M[a, 0] * change[0] + M[a, 1] * change[1] + M[a, 2] * change[2]
            acting[end, a] = f
            for i in range(n):
                own[i] += f * response[i, a]
            for i in range(model.size[2]):
                work.y[i] += f * y[a, i]
            for i in range(len(work.turn)):
                for b in range(3):
                    work.turn[i, b] += f * turn[a, i, b]
        for i in range(n):
            work.step[i] = own[i]
            largest = max(largest, abs(own[i]) / model.unit[i])
        if not largest < np.inf:
            break
        cut = min(1.0, LARGEST_STEP / largest) if largest > 0.0 else 1.0
        advance(model, cut, x, work)
        for a in range(3):
            force[a] += cut * acting[end, a]
        arrived = largest < (ARRIVED if fine else NEAR)
    return -1


@kernel
def push_along(model: MachineArrays, V: Floats, s: Floats, mode: Floats, pattern: Floats) -> None:
    """Forces ``(n,)`` that push along a motion, such that they feel a stiffness of one unit without a force.

    They are what the motion takes without a force. Where a turned machine moves stiff parts along with soft ones,
    these would drown the rest: a part counts as no stiffer than the motion as a whole.

    Args:
        model: the machine.
        V: ``(n, k)`` orthonormal motions without a force, scaled, and
        s: ``(k,)`` their compliances.
        mode: ``(n,)`` the motion.
        pattern: written.
    """
    n, k = V.shape
    along, size, own, felt = np.zeros(k), 0.0, 0.0, 0.0
    for i in range(n):
        m = mode[i] / model.unit[i]
        size += m * m
        for c in range(k):
            along[c] += V[i, c] * m
    for c in range(k):
        own += along[c] * along[c] * s[c] / size
    for c in range(k):
        along[c] /= s[c] + own
        felt += along[c] * along[c] * s[c]
    felt = np.sqrt(felt)
    for i in range(n):
        t = 0.0
        for c in range(k):
            t += V[i, c] * along[c]
        pattern[i] = t / felt * model.energy[0] / model.unit[i]


@kernel
def begin_at(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end: int, force: Floats, x: Floats,
    wrench: Floats, response: Floats,
) -> float:  # fmt: skip
    """Factor at an equilibrium under a force ``(3,)`` on an end, and write what unit forces move.

    Returns:
        How far a unit force moves the machine at most, over the units; zero where the equilibrium is not stable.
    """
    acting, gram = np.zeros((len(model.end_joint), 6)), np.zeros((3, 3))
    y, turn = np.empty((3, len(work.y))), np.empty((3, len(work.turn), 3))
    acting[end, :3], work.wrench[:] = force, wrench
    if linearise(model, command, natural, x, acting, 1.0, True, work) != 0 or work.state[3] != 0:
        return 0.0
    unit_responses(model, work, end, response, y, turn)
    for a in range(3):
        for b in range(3):
            for i in range(len(response)):
                gram[a, b] += response[i, a] * response[i, b] / model.unit[i] ** 2
    jacobi(gram)
    return np.sqrt(max(gram[0, 0], gram[1, 1], gram[2, 2]))


@kernel
def points_around(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end: int, centre: Floats, wrench: Floats,
    Q: Floats, scale: Floats, patterns: Floats, rows: Floats, felt: Floats,
) -> bool:  # fmt: skip
    """Write ``rows`` (9, 4 + n + f) of force, nothing, coordinates, wrenches `AROUND` a point, and ``felt`` (9, k).

    False where an equilibrium was not found; see `equilibrium_at` for the other arguments.
    """
    n = len(centre) - 3
    x, there, force, mode, response = np.empty(n), np.empty(len(wrench)), np.empty(3), np.empty(n), np.empty((n, 3))
    theta = np.empty(3)
    for k in range(len(AROUND)):
        theta[:] = AROUND[k]
        for i in range(n + 3):
            s = centre[i] + scale[i] * (Q[i, 0] * theta[0] + Q[i, 1] * theta[1] + Q[i, 2] * theta[2])
            if i < n:
                x[i] = s
            else:
                force[i - n] = s
        there[:] = wrench
        if (
            equilibrium_at(
                model, work, command, natural, end, centre, Q, scale, theta, patterns, False, x, there, force,
                felt[k], mode, response,
            )
            < 0
        ):  # fmt: skip
            return False
        rows[k, :3], rows[k, 4 : 4 + n], rows[k, 4 + n :] = force, x, there
    return True
