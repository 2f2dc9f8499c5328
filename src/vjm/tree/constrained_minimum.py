"""Compiled: the least force on a chart of equilibria where a stiffness has a value, by quadratic models of both.

A model has values ``(q,)`` at the chart's centre, slopes ``(q, 3)`` and bends ``(q, 3, 3)``. The first four values
are force and stiffness.
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import Floats
from vjm.kernels.compilation import kernel
from vjm.kernels.jacobi import jacobi

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
