"""Compiled equilibria near critical ones: on a chart of all equilibria under forces on an end, regular at folds."""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import Floats, Ints, MachineArrays, Work
from vjm.kernels.border import invert, solve
from vjm.kernels.compilation import entry, kernel
from vjm.kernels.entry_points import inverse
from vjm.kernels.newton import LARGEST_STEP, LAST_STEP, advance, linearise
from vjm.kernels.statics import place, turn_followers
from vjm.kernels.substitution import load, move

MOST = 20
"""Iterations of Newton's method: each point lies near a known one."""
AT_REST = 1e2
"""Times `LAST_STEP`: a step after which Newton's method, whose steps shrink by their square, has arrived."""


@kernel
def _towards(model: MachineArrays, work: Work, own: bool, end: int, force: Floats) -> None:
    """Motion ``work.step`` by a change ``(3,)`` of the force on an end frame, with what Newton's method asks for.

    Without ``own`` it is that of the force alone. The factors at hand have the end frames' columns.
    """
    T, right, inner, last = work.T, work.right, model.size[5], model.size[6]
    first = inner + 6 * end
    for i in range(inner):
        s = T[i, last] if own else 0.0
        for a in range(3):
            s += T[i, first + a] * force[a]
        right[i] = -s
    solve(model, work)
    for a in range(3):
        work.y[first + a] = force[a]
    if not own:
        work.b[:] = 0.0
    move(model, own, work)


@entry
def chart_points(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, home: Floats, end: int, centre_x: Floats,
    centre_force: Floats, chart_x: Floats, chart_force: Floats, at: Floats, pattern: Floats, x: Floats,
    wrench: Floats, force: Floats, value: Floats, mode: Floats, response: Floats, negative: Ints,
) -> None:  # fmt: skip
    """Equilibria at g points of a chart: ``chart_xᵀ (x − centre) + chart_forceᵀ (F − centre) = at``.

    The chart's rows are tangent to the equilibria under all forces F on an end, so that its points are regular
    where the force has a limit.

    Args:
        model: the machine.
        work: written.
        command: ``(m,)`` values of the held joints.
        natural: ``(n,)`` coordinates at which the springs are free of stress.
        home: ``(n,)`` coordinates of the unloaded posture.
        end: index of the end frame.
        centre_x: ``(n,)`` and
        centre_force: ``(3,)`` N, where the chart begins.
        chart_x: ``(n, 3)`` and
        chart_force: ``(3, 3)``.
        at: ``(g, 3)``.
        pattern: ``(n,)`` forces of a device that pushes along a motion.
        x: ``(g, n)`` coordinates to start from; become the equilibria's.
        wrench: ``(g, f)`` of the closures, likewise.
        force: ``(g, 3)`` N, likewise.
        value: ``(g,)`` written: stiffness that the device feels, zero where the equilibrium is critical.
        mode: ``(g, n)`` written: what its unit push moves.
        response: ``(g, n, 3)`` written: what unit forces on the end move.
        negative: ``(g,)`` number of negative eigenvalues, −1 where no equilibrium was found.
    """
    n, f = x.shape[1], model.size[2]
    acting, unit_force, change, M = np.zeros((len(model.end_joint), 6)), np.zeros(3), np.zeros(3), np.zeros((3, 3))
    none = np.zeros(f)
    for g in range(len(x)):
        place(model, command, home, work)
        turn_followers(model, work)
        work.wrench[:] = wrench[g]
        negative[g] = -1
        arrived = False
        for _ in range(MOST):
            for a in range(3):
                acting[end, a] = force[g, a]
            found = linearise(model, command, natural, x[g], acting, 1.0, True, work)
            if found < 0:
                break
            for a in range(3):
                unit_force[:] = 0.0
                unit_force[a] = 1.0
                _towards(model, work, False, end, unit_force)
                for i in range(n):
                    response[g, i, a] = work.step[i]
            if arrived:
                load(model, pattern, none, work)
                solve(model, work)
                move(model, False, work)
                given = 0.0
                for i in range(n):
                    mode[g, i] = work.step[i]
                    given += pattern[i] * work.step[i]
                value[g] = 1.0 / given
                negative[g] = found + work.state[3]
                break
            change[:] = 0.0
            _towards(model, work, True, end, change)
            for j in range(3):
                s = at[g, j]
                for i in range(n):
                    s -= chart_x[i, j] * (x[g, i] + work.step[i] - centre_x[i])
                for a in range(3):
                    s -= chart_force[a, j] * (force[g, a] - centre_force[a])
                change[j] = s
                for a in range(3):
                    s = chart_force[a, j]
                    for i in range(n):
                        s += chart_x[i, j] * response[g, i, a]
                    M[j, a] = s
            if not invert(M, 0.0):
                break
            for a in range(3):
                unit_force[a] = M[a, 0] * change[0] + M[a, 1] * change[1] + M[a, 2] * change[2]
            _towards(model, work, True, end, unit_force)
            largest = 0.0
            for i in range(n):
                largest = max(largest, abs(work.step[i]) / model.unit[i])
            if not largest < np.inf:
                break
            cut = min(1.0, LARGEST_STEP / largest) if largest > 0.0 else 1.0
            advance(model, cut, x[g], work)
            for a in range(3):
                force[g, a] += cut * unit_force[a]
            arrived = largest < AT_REST * LAST_STEP
        wrench[g] = work.wrench


@entry
def inverses_of(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, home: Floats, end_wrench: Floats, x: Floats,
    wrench: Floats, out: Floats,
) -> None:  # fmt: skip
    """Inverse second variations ``out`` (g, n, n) on what the closures leave, scaled by the units, at equilibria.

    See `vjm.kernels.batch.equilibria_of` for the arguments; those of the posture have one row each.
    """
    n = x.shape[1]
    forces, none, v = np.empty(n), np.zeros(model.size[2]), np.zeros(n)
    for g in range(len(x)):
        place(model, command, home, work)
        turn_followers(model, work)
        work.wrench[:] = wrench[g]
        linearise(model, command, natural, x[g], end_wrench[g], 1.0, False, work)
        for i in range(n):
            v[:] = 0.0
            v[i] = 1.0
            inverse(model, work, v, forces, none, out[g, i])
