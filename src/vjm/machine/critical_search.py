"""Compiled search for critical forces.

The least force on charts of equilibria where a stiffness has a value, by quadratic models of both, and its check.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from vjm.kernels.arrays import Floats, Ints, MachineArrays, Work
from vjm.kernels.border import invert, jacobi, solve
from vjm.kernels.compilation import entry, kernel
from vjm.kernels.elimination import load, move
from vjm.kernels.newton import LARGEST_STEP, advance, end_compliance, linearise, loaded
from vjm.kernels.statics import place, turn_followers

H = 1e-2
"""Between points of a chart, over its unit, in which F is as large as the force sought: remainders of the quadratic
model are its square."""
SHARES = (1.0, 0.5, 0.25, 0.125)
"""Of the stiffness that is left: by how much it is to fall in one step."""
ITERATIONS = 30
"""Of Newton's method on a model."""
CLIPPED = 4
"""Times that a radius stops these before they are given up."""
FLAT = 1e-9
"""Of the force's curvature: the least that a step is divided by."""
LAST = 1e-9
"""Of a chart's unit: the step at which it ends."""


@kernel
def fitted(middle: Floats, around: Floats, slope: Floats, bend: Floats) -> None:
    """Slopes and bends from values ``(9, q)`` at H along the axes, against them, and along their sums in pairs."""
    for q in range(len(middle)):
        for a in range(3):
            slope[q, a] = (around[a, q] - around[3 + a, q]) / (2.0 * H)
            bend[q, a, a] = (around[a, q] + around[3 + a, q] - 2.0 * middle[q]) / H**2
        for a in range(2):
            for b in range(a + 1, 3):
                mixed = around[5 + a + b, q] - around[a, q] - around[b, q] + middle[q]
                bend[q, a, b] = bend[q, b, a] = mixed / H**2


@kernel
def model_at(middle: Floats, slope: Floats, bend: Floats, theta: Floats, value: Floats, slopes: Floats) -> None:
    """Write as many values ``(q,)`` and slopes ``(q, 3)`` as there is room for at coordinates ``(3,)``."""
    for q in range(len(value)):
        value[q] = middle[q]
        for a in range(3):
            s = 0.0
            for b in range(3):
                s += bend[q, a, b] * theta[b]
            value[q] += (slope[q, a] + 0.5 * s) * theta[a]
            slopes[q, a] = slope[q, a] + s


@kernel
def foreseen(force: Floats, left: float, slopes: Floats) -> tuple[float, float]:
    """Least force where no stiffness is left, by a straight line; its slope over the stiffness's.

    Args:
        force: ``(3,)`` at hand.
        left: stiffness there.
        slopes: ``(4, 3)`` there.
    """
    size = np.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    along = steep = whole = 0.0
    for a in range(3):
        gradient = force[0] * slopes[0, a] + force[1] * slopes[1, a] + force[2] * slopes[2, a]
        along += slopes[3, a] * gradient / size
        steep += slopes[3, a] ** 2
        whole += (gradient / size) ** 2
    return size - left * along / steep, np.sqrt(whole / steep)


@kernel
def towards(middle: Floats, slope: Floats, bend: Floats, radius: float, last: float, theta: Floats) -> None:
    """Coordinates within a radius of the least force where the stiffness has fallen as far as they allow."""
    for share in SHARES:
        if _least(middle, slope, bend, last + (1.0 - share) * (middle[3] - last), radius, theta):
            break


@kernel
def _least(middle: Floats, slope: Floats, bend: Floats, aim: float, radius: float, theta: Floats) -> bool:
    """Coordinates within a radius of the model's least force where its stiffness has a value, and whether they are.

    Newton's method on the Lagrangian, downhill where that bends the other way.
    """
    clipped = 0
    value, J, hessian, Z = np.empty(4), np.empty((4, 3)), np.empty((3, 3)), np.empty((3, 2))
    gradient, step, right, small = np.empty(3), np.empty(3), np.empty(2), np.empty((2, 2))
    theta[:] = 0.0
    for _ in range(ITERATIONS):
        model_at(middle, slope, bend, theta, value, J)
        normal = J[3]
        size = normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2
        if not size > 0.0:
            break
        factor = curved = 0.0
        for a in range(3):
            gradient[a] = J[0, a] * value[0] + J[1, a] * value[1] + J[2, a] * value[2]
            factor -= normal[a] * gradient[a] / size
            curved += J[0, a] ** 2 + J[1, a] ** 2 + J[2, a] ** 2
        for a in range(3):
            for b in range(3):
                h = factor * bend[3, a, b]
                for q in range(3):
                    h += J[q, a] * J[q, b] + value[q] * bend[q, a, b]
                hessian[a, b] = h
            step[a] = (aim - value[3]) / size * normal[a]
        _across(normal, size, Z)
        for i in range(2):
            right[i] = 0.0
            for a in range(3):
                s = gradient[a]
                for b in range(3):
                    s += hessian[a, b] * step[b]
                right[i] += Z[a, i] * s
            for j in range(2):
                small[i, j] = 0.0
                for a in range(3):
                    for b in range(3):
                        small[i, j] += Z[a, i] * hessian[a, b] * Z[b, j]
        small[0, 1] = small[1, 0] = 0.5 * (small[0, 1] + small[1, 0])
        vectors = jacobi(small)
        for i in range(2):
            s = vectors[0, i] * right[0] + vectors[1, i] * right[1]
            s /= max(abs(small[i, i]), FLAT * curved + 1e-300)
            for a in range(3):
                step[a] -= (Z[a, 0] * vectors[0, i] + Z[a, 1] * vectors[1, i]) * s
        length = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        if not length < np.inf:
            break
        cut, far = min(1.0, radius / max(length, 1e-300)), 0.0
        for a in range(3):
            theta[a] += cut * step[a]
            far += theta[a] ** 2
        far = np.sqrt(far)
        if far > radius:
            for a in range(3):
                theta[a] *= radius / far
            clipped += 1
            if clipped == CLIPPED:
                break
        elif length < LAST:
            return True
    return False


@kernel
def _across(normal: Floats, square: float, Z: Floats) -> None:
    """Two unit vectors ``Z`` (3, 2) across a vector with a square and each other."""
    size, k = np.sqrt(square), 0
    for a in range(1, 3):
        if abs(normal[a]) < abs(normal[k]):
            k = a
    # n × e_k, over its length
    i, j = (k + 1) % 3, (k + 2) % 3
    length = np.sqrt(normal[i] ** 2 + normal[j] ** 2)
    Z[k, 0], Z[i, 0], Z[j, 0] = 0.0, normal[j] / length, -normal[i] / length
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        Z[a, 1] = (normal[b] * Z[c, 0] - normal[c] * Z[b, 0]) / size


# --- Compiled charts of the equilibria of a machine under all forces on an end: coordinates along their tangent
#
# They are regular where the force has a limit, and at bifurcations.

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
    """Equilibrium at coordinates ``theta`` (3,) of a chart about a point ``centre`` (n + 3,): motion and force.

    It is found from coordinates ``x`` (n,), the closures' ``wrench`` (f,) and the ``force`` (3,) in N, which become
    its own. With ``fine`` to the last digit, and with the ``response`` (n, 3) to unit forces on the end; else as a
    point of a quadratic model. Written are ``felt`` (k,), the stiffnesses that devices feel which push along a
    motion with ``patterns`` (k, n) of forces, and ``mode`` (n,), what the last one's unit push moves.

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
        negative = linearise(model, command, natural, x, acting, 1.0, True, work)
        if negative < 0:
            break
        if fine or not arrived:
            unit_responses(model, work, end, response, y, turn)
        if arrived:
            wrench[:] = work.wrench
            for k in range(len(patterns)):
                felt[k] = felt_by(model, work, patterns[k], mode)
            return negative + work.state[3]
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
    ``V`` (n, k) are orthonormal motions without a force, scaled, ``s`` (k,) their compliances, ``mode`` (n,) the
    motion; ``pattern`` is written.
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
    x, new_wrench, force, mode, response = (
        np.empty(n),
        np.empty(len(wrench)),
        np.empty(3),
        np.empty(n),
        np.empty((n, 3)),
    )
    theta = np.empty(3)
    for k in range(len(AROUND)):
        theta[:] = AROUND[k]
        for i in range(n + 3):
            s = centre[i] + scale[i] * (Q[i, 0] * theta[0] + Q[i, 1] * theta[1] + Q[i, 2] * theta[2])
            if i < n:
                x[i] = s
            else:
                force[i - n] = s
        new_wrench[:] = wrench
        if (
            equilibrium_at(
                model, work, command, natural, end, centre, Q, scale, theta, patterns, False, x, new_wrench, force,
                felt[k], mode, response,
            )
            < 0
        ):  # fmt: skip
            return False
        rows[k, :3], rows[k, 4 : 4 + n], rows[k, 4 + n :] = force, x, new_wrench
    return True


TOLERANCE = 1e-5
"""Relative, of a critical force: the stiffness where the search ends, over that without a force."""
LEFT = 0.1
"""Of the tolerance: the stiffness that is aimed at, for the factors are singular where none is left."""
EXACT = 1e-4
"""Remainder of the quadratic model in the last step: the force, which is least there, errs by its square."""
FIRST_STEP = 1e-4
"""Of the machine's reach: how far the first force moves the end; so little that all is linear there."""
RADIUS = 2.0
"""Of a chart's unit: the longest step. A step of one changes the force by about as much as it is."""
SMALLEST = 2.0**-12
"""Of it: a step below which a search is lost."""
GOOD, FAIR = 0.05, 0.3
"""Remainder of the model over the step: below the one the next is longer, above the other it is taken again."""
STEPS = 80
"""After which a search is given up."""
LIKELY = 2.0
"""Times the least force so far that a straight line foresees: a search beyond is given up."""
OVER = 1.2
"""Times the least force so far: a search there is given up. A little more may fall again, as the device changes."""
PARTS = 8
"""In which the force is put on at last, each halved up to `HALVINGS` times."""
HALVINGS = 6
SHORT = 0.02
"""Of a critical force: by how much the last of these parts falls short of it. Of the stiffness without a force:
below it the signs of other modes, which may vanish together with it, are not asked for."""
QUARTERS = 3
"""How often what is short is quartered, to see that the way ends at the critical equilibrium. It halves the
distance to a limit and quarters that to a bifurcation; beside another sheet of equilibria the distance stays."""
NEARER = 0.75
"""Half-way between the one and the other."""
BESIDE = 0.1
"""Of a chart's unit: how far from a critical equilibrium the eigenvalues are counted at most, and what is on its
chart, of a unit by the force as the machine yields without one."""
INVERSE = 6
"""Iterations to the mode of smallest stiffness where stability is lost on the way."""
TO_DO, FOUND, BEYOND, FAILED, NOWHERE = 0, 1, 2, 3, 4
"""What became of a start: not followed yet, a critical force, more than the most, lost, stability lost before."""


@kernel
def _followed(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end: int, V: Floats, s: Floats, most: float,
    least: float, expected: float, far: float, response: Floats, begun: bool, slope: Floats, bend: Floats,
    left: float, x: Floats, wrench: Floats, force: Floats, pattern: Floats,
) -> tuple[int, int, float]:  # fmt: skip
    """Along the constrained minimum to a critical equilibrium.

    Args beside those of `linearise` and `push_along`:
        most: force beyond which the search is given up, N.
        least: the least critical force so far, N; infinite where there is none.
        expected: the force that is expected, N.
        far: see `begin_at`.
        response: ``(n, 3)`` where it begins; overwritten.
        begun: whether the model there is given.
        slope: ``(4 + n + f, 3)`` of that model on a chart of the size expected; overwritten.
        bend: ``(4 + n + f, 3, 3)`` likewise.
        left: stiffness that the device feels there.
        x: ``(n,)`` the equilibrium where it begins; become those of the critical one.
        wrench: ``(f,)`` of the closures, likewise.
        force: ``(3,)`` on the end, N, likewise.
        pattern: ``(1, n)`` of the device, likewise.

    Returns:
        What became of it, the number of negative eigenvalues behind it, and the force's error, N.
    """
    n, wide = len(x), len(slope)
    full, size, radius = 1.0 / model.energy[0], expected, RADIUS
    Q, scale, centre, theta = np.empty((n + 3, 3)), np.empty(n + 3), np.empty(n + 3), np.zeros(3)
    row, rows, predicted, slopes = np.empty(wide), np.empty((9, wide)), np.empty(wide), np.empty((wide, 3))
    felt, now, mode, beside = np.empty((9, 1)), np.empty(1), np.empty(n), np.empty(3)
    trial_x, trial_wrench, trial_force = np.empty(n), np.empty(len(wrench)), np.empty(3)
    for _ in range(STEPS):
        set_chart(model, response, far, size, Q, scale)
        centre[:n], centre[n:] = x, force
        row[:3], row[3], row[4 : 4 + n], row[4 + n :] = force, left, x, wrench
        if not begun:
            if not points_around(
                model, work, command, natural, end, centre, wrench, Q, scale, pattern, rows, felt
            ):  # fmt: skip
                return FAILED, 0, 0.0
            rows[:, 3] = felt[:, 0]
            fitted(row, rows, slope, bend)
        begun = False
        while True:
            towards(row, slope, bend, radius, LEFT * TOLERANCE * full, theta)
            model_at(row, slope, bend, theta, predicted, slopes)
            trial_force[:], trial_x[:], trial_wrench[:] = predicted[:3], predicted[4 : 4 + n], predicted[4 + n :]
            negative = equilibrium_at(
                model, work, command, natural, end, centre, Q, scale, theta, pattern, True, trial_x, trial_wrench,
                trial_force, now, mode, response,
            )  # fmt: skip
            length = np.sqrt(theta[0] ** 2 + theta[1] ** 2 + theta[2] ** 2)
            remainder = ((now[0] - predicted[3]) / full) ** 2
            for a in range(3):
                remainder += ((trial_force[a] - predicted[a]) / size) ** 2
            remainder = np.sqrt(remainder)
            # where several modes vanish together their signs are not asked for
            good = negative == 0 or (negative > 0 and now[0] < SHORT * full)
            if good and remainder <= max(FAIR * length, TOLERANCE):
                break
            radius = 0.5 * min(radius, length)
            if not radius >= SMALLEST:
                return FAILED, 0, 0.0
        if remainder < GOOD * length:
            radius = min(2.0 * radius, RADIUS)
        reached = np.sqrt(trial_force[0] ** 2 + trial_force[1] ** 2 + trial_force[2] ** 2)
        ahead, falls = foreseen(trial_force, now[0], slopes)
        if reached > min(most, OVER * least) or ahead > LIKELY * min(most, least):
            return BEYOND, 0, 0.0
        if abs(now[0]) < TOLERANCE * full and remainder < EXACT:
            x[:], wrench[:], force[:] = trial_x, trial_wrench, trial_force
            error = abs(now[0]) * falls + remainder**2 * size
            steep = np.sqrt(slopes[3, 0] ** 2 + slopes[3, 1] ** 2 + slopes[3, 2] ** 2)
            # where the stiffness hardly changes the points stay near by
            distance = min(SHORT * full / steep, BESIDE)
            for side in range(2):
                for a in range(3):
                    beside[a] = theta[a] + (1.0 - 2.0 * side) * distance * slopes[3, a] / steep
                model_at(row, slope, bend, beside, predicted, slopes)
                trial_force[:], trial_x[:], trial_wrench[:] = (
                    predicted[:3],
                    predicted[4 : 4 + n],
                    predicted[4 + n :],
                )
                negative = equilibrium_at(
                    model, work, command, natural, end, centre, Q, scale, beside, pattern, True, trial_x,
                    trial_wrench, trial_force, now, mode, response,
                )  # fmt: skip
                if (side == 0 and negative != 0) or (side == 1 and negative < 1):
                    return FAILED, 0, 0.0
                model_at(row, slope, bend, theta, predicted, slopes)
            # at the least force it falls with the stiffness that is left
            return FOUND, negative, error
        # the device pushes along the mode of smallest stiffness there
        x[:], wrench[:], force[:] = trial_x, trial_wrench, trial_force
        push_along(model, V, s, mode, pattern[0])
        left = felt_by(model, work, pattern[0], mode)
        size = max(reached, LEFT * size)
    return FAILED, 0, 0.0


# --- the way to a critical force ---------------------------------------------------------------------------


@kernel
def _leads(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end: int, reach: float, force: Floats,
    share: float, ahead: float, x: Floats, wrench: Floats, C: Floats, point: Floats,
) -> bool:  # fmt: skip
    """Whether an equilibrium under a share of a force ``(3,)`` leads to one under a larger share.

    It does where halfway between the slopes at both lies what the end moves by. The coordinates ``x`` (n,), the
    closures' wrenches ``(f,)``, the end's compliance ``C`` (6, 6) and its place ``point`` (3,) become those of the
    second one.
    """
    acting, ahead_C, ahead_x = np.zeros((len(model.end_joint), 6)), np.empty((6, 6)), x.copy()
    for a in range(3):
        acting[end, a] = ahead * force[a]
    work.wrench[:] = wrench
    if loaded(model, command, natural, ahead_x, acting, False, True, False, work) != 0 or work.state[3] != 0:
        return False
    end_compliance(model, work, end, ahead_C)
    off = gone = 0.0
    for a in range(3):
        way = work.end_p[end, a] - point[a]
        gone += way * way
        for b in range(3):
            way -= 0.5 * (C[a, b] + ahead_C[a, b]) * (ahead - share) * force[b]
        off += way * way
    if np.sqrt(off) > 0.5 * np.sqrt(gone) + FIRST_STEP * reach:
        return False
    x[:], wrench[:], C[:, :], point[:] = ahead_x, work.wrench, ahead_C, work.end_p[end]
    return True


@kernel
def _way(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end: int, reach: float, force: Floats,
    critical: Floats, beside: float, x: Floats, wrench: Floats,
) -> float:  # fmt: skip
    """Put a force ``(3,)`` on along its direction, from the equilibrium without it at ``x`` and ``wrench``.

    These become the last equilibrium on the way.

    Returns:
        The share of the force there; one where the whole way is stable and ends at the critical equilibrium, whose
        coordinates are ``critical`` (n,). What lies no farther than ``beside`` from it, over the units, is on its
        chart.
    """
    share, part, halved = 0.0, 1.0 / PARTS, 0
    C, point = np.empty((6, 6)), np.empty(3)
    work.wrench[:] = wrench
    linearise(model, command, natural, x, np.zeros((len(model.end_joint), 6)), 1.0, True, work)
    end_compliance(model, work, end, C)
    point[:] = work.end_p[end]
    short, far = SHORT, 0.0
    for _ in range(1 + QUARTERS):
        while share < 1.0 - short:
            ahead = min(share + part, 1.0 - short)
            if _leads(model, work, command, natural, end, reach, force, share, ahead, x, wrench, C, point):
                share = ahead
            elif halved < HALVINGS:
                part *= 0.5
                halved += 1
            else:
                return share
        near = float(np.linalg.norm((critical - x) / model.unit))
        if near <= max(NEARER * far, beside):
            return 1.0
        far, short, part, halved = near, 0.25 * short, short, 0
    return share


@kernel
def _smallest_mode(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end: int, V: Floats, s: Floats,
    some: Floats, force: Floats, x: Floats, wrench: Floats, pattern: Floats,
) -> bool:  # fmt: skip
    """Write the pattern of the mode with the smallest eigenvalue, by inverse iteration; false if singular."""
    acting, mode = np.zeros((len(model.end_joint), 6)), some * model.unit
    acting[end, :3], work.wrench[:] = force, wrench
    if linearise(model, command, natural, x, acting, 1.0, True, work) < 0:
        return False
    for _ in range(INVERSE):
        push_along(model, V, s, mode, pattern)
        felt_by(model, work, pattern, mode)
    push_along(model, V, s, mode, pattern)
    return True


@entry
def critical_forces(
    model: MachineArrays, work: Work, commands: Floats, naturals: Floats, end: int, reach: float,
    most: float, rest_x: Floats, rest_wrench: Floats, V: Floats, s: Floats, some: Floats, patterns: Floats,
    expected: Floats, force: Floats, behind: Ints, error: Floats, lost: Ints,
) -> None:  # fmt: skip
    """The smallest critical forces of an end in g postures, from k starts each.

    Args:
        model: the machine.
        work: written.
        commands: ``(g, m)`` values of the held joints.
        naturals: ``(g, n)`` coordinates at which the springs are free of stress.
        end: index of the end frame.
        reach: of the machine, mm.
        most: largest force tried, N.
        rest_x: ``(g, n)`` equilibria without a force, and
        rest_wrench: ``(g, f)`` the closures' wrenches there.
        V: ``(g, n, c)`` and
        s: ``(g, c)`` see `push_along`.
        some: ``(n,)`` any motion, scaled, from which a mode is looked for.
        patterns: ``(g, k, n)`` of the starts' devices, scaled.
        expected: ``(g, k)`` force that is expected, N; infinite where there is no start. They are followed in this
            order.
        force: ``(g, 3)`` written: the smallest critical force, N; nan where there is none.
        behind: ``(g,)`` written: number of negative eigenvalues behind it.
        error: ``(g,)`` written: N.
        lost: ``(g,)`` written: number of starts that could not be followed to their ends.
    """
    n, f, starts = rest_x.shape[1], rest_wrench.shape[1], expected.shape[1]
    start_x, start_wrench, start_force = np.empty((starts, n)), np.empty((starts, f)), np.empty((starts, 3))
    pattern, reached, size = np.empty((starts, n)), np.empty((starts, 3)), np.empty(starts)
    x, wrench, own = np.empty(n), np.empty(f), np.empty((1, n))
    how, count = np.empty(starts, dtype=np.int64), np.empty(starts, dtype=np.int64)
    ends = np.empty((starts, n))
    bound, off, left, mode = np.empty(starts), np.empty(starts), np.empty(starts), np.empty(n)
    row, rows, felt, Q = np.empty(4 + n + f), np.empty((9, 4 + n + f)), np.empty((9, starts)), np.empty((n + 3, 3))
    rest, response, scale = np.empty((n, 3)), np.empty((n, 3)), np.empty(n + 3)
    slope, bend, centre = np.empty((4 + n + f, 3)), np.empty((4 + n + f, 3, 3)), np.zeros(n + 3)
    still = np.zeros(n)
    for g in range(len(commands)):
        command, natural = commands[g], naturals[g]
        place(model, command, still, work)
        turn_followers(model, work)
        for k in range(starts):
            start_x[k], start_wrench[k], start_force[k] = rest_x[g], rest_wrench[g], 0.0
            for i in range(n):
                pattern[k, i] = patterns[g, k, i] * model.energy[0] / model.unit[i]
            how[k] = TO_DO if expected[g, k] < np.inf else NOWHERE
        force[g], behind[g], error[g], lost[g] = np.nan, 0, np.nan, 0
        # all starts share the points around the equilibrium without a force
        first = expected[g].min()
        far = begin_at(model, work, command, natural, end, start_force[0], rest_x[g], rest_wrench[g], rest)
        for k in range(starts):
            left[k] = felt_by(model, work, pattern[k], mode)
        if not (far > 0.0 and first < np.inf):
            continue
        set_chart(model, rest, far, first, Q, scale)
        centre[:n] = rest_x[g]
        if not points_around(
            model, work, command, natural, end, centre, rest_wrench[g], Q, scale, pattern, rows, felt
        ):  # fmt: skip
            lost[g] = starts
            continue
        row[:3], row[4 : 4 + n], row[4 + n :] = 0.0, rest_x[g], rest_wrench[g]
        while True:
            best, least = -1, np.inf
            for k in range(starts):
                if how[k] == FOUND and size[k] < least:
                    best, least = k, size[k]
            for k in range(starts):
                if how[k] == TO_DO:
                    x[:], wrench[:], own[0] = start_x[k], start_wrench[k], pattern[k]
                    reached[k], bound[k] = start_force[k], least
                    begun = start_force[k, 0] == 0.0 and start_force[k, 1] == 0.0 and start_force[k, 2] == 0.0
                    if begun:
                        reach_of, response[:, :], row[3], rows[:, 3] = far, rest, left[k], felt[:, k]
                        fitted(row, rows, slope, bend)
                        ratio = expected[g, k] / first
                        slope *= ratio
                        bend *= ratio**2
                    else:
                        reach_of = begin_at(model, work, command, natural, end, reached[k], x, wrench, response)
                        left[k] = felt_by(model, work, pattern[k], mode)
                    how[k], count[k], off[k] = FAILED, 0, 0.0
                    if reach_of > 0.0:
                        how[k], count[k], off[k] = _followed(
                            model, work, command, natural, end, V[g], s[g], most, least, expected[g, k],
                            reach_of, response, begun, slope, bend, left[k], x, wrench, reached[k], own,
                        )  # fmt: skip
                    ends[k] = x
                    size[k] = np.sqrt(reached[k, 0] ** 2 + reached[k, 1] ** 2 + reached[k, 2] ** 2)
                    if how[k] == FOUND and size[k] < least:
                        best, least = k, size[k]
            if best < 0:
                break
            x[:], wrench[:] = rest_x[g], rest_wrench[g]
            share = _way(
                model,
                work,
                command,
                natural,
                end,
                reach,
                reached[best],
                ends[best],
                BESIDE * far * size[best],
                x,
                wrench,
            )
            if share == 1.0:
                force[g], behind[g], error[g] = reached[best], count[best], off[best]
                break
            # stability is lost on the way there, or the way leads elsewhere: another force is near its end
            how[best] = NOWHERE
            if start_force[best, 0] == 0.0 and start_force[best, 1] == 0.0 and start_force[best, 2] == 0.0:
                start_x[best], start_wrench[best], start_force[best] = x, wrench, share * reached[best]
                expected[g, best] = size[best]
                if _smallest_mode(
                    model, work, command, natural, end, V[g], s[g], some, start_force[best], x, wrench,
                    pattern[best],
                ):  # fmt: skip
                    how[best] = TO_DO
            # what was given up because of it is followed after all
            for k in range(starts):
                if how[k] == BEYOND and bound[k] < np.inf:
                    how[k] = TO_DO
        for k in range(starts):
            if how[k] == FAILED:
                lost[g] += 1
