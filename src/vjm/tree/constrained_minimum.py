"""The least force on a chart of equilibria where a stiffness has a value, by quadratic models of both."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from vjm.rotations import Array

H = 1e-2
"""Between points of a chart, over its unit, in which F is as large as the force sought: remainders of the quadratic
model are its square."""
PAIRS = list(combinations(range(3), 2))
AROUND = H * np.vstack([np.eye(3), -np.eye(3), [np.eye(3)[a] + np.eye(3)[b] for a, b in PAIRS]])
"""Coordinates ``(9, 3)`` of the points around a chart's centre from which its model is made."""
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


@dataclass
class QuadraticModel:
    """Quadratic model of the force and the stiffness on a chart.

    Attributes:
        value: ``(4,)`` F and g at its centre.
        slope: ``(4, 3)``.
        bend: ``(4, 3, 3)``.
    """

    value: Array
    slope: Array
    bend: Array

    def at(self, theta: Array) -> tuple[Array, Array]:
        """Values ``(4,)`` and slopes ``(4, 3)`` at coordinates."""
        bent = self.bend @ theta
        return self.value + self.slope @ theta + 0.5 * bent @ theta, self.slope + bent

    @classmethod
    def of(cls, middle: Array, around: Array) -> QuadraticModel:
        """From values ``(4,)`` at the centre and ``(9, 4)`` at `AROUND`."""
        up, down, mixed = around[:3], around[3:6], around[6:]
        bend = np.zeros((4, 3, 3))
        for a in range(3):
            bend[:, a, a] = (up[a] + down[a] - 2.0 * middle) / H**2
        for (a, b), value in zip(PAIRS, mixed, strict=True):
            bend[:, a, b] = bend[:, b, a] = (value - up[a] - up[b] + middle) / H**2
        return cls(middle, (up - down).T / (2.0 * H), bend)


def towards(model: QuadraticModel, radius: float, last: float) -> Array:
    """Coordinates within a radius of the least force where the stiffness has fallen as far as they allow."""
    for share in SHARES:
        theta, arrived = _least(model, last + (1.0 - share) * (model.value[3] - last), radius)
        if arrived:
            break
    return theta


def _least(model: QuadraticModel, aim: float, radius: float) -> tuple[Array, bool]:
    """Coordinates within a radius of the model's least force where its stiffness has a value, and whether they are.

    Newton's method on the Lagrangian, downhill where that bends the other way.
    """
    theta, clipped = np.zeros(3), 0
    for _ in range(ITERATIONS):
        value, slope = model.at(theta)
        F, J, normal = value[:3], slope[:3], slope[3]
        size = float(normal @ normal)
        if not size > 0.0:
            break
        gradient = J.T @ F
        factor = -float(normal @ gradient) / size
        hessian = symmetric(J.T @ J + np.tensordot(F, model.bend[:3], 1) + factor * model.bend[3])
        along = (aim - value[3]) / size * normal
        Z = _across(normal)
        values, vectors = np.linalg.eigh(Z.T @ hessian @ Z)
        right = vectors.T @ (Z.T @ (gradient + hessian @ along))
        bends = np.maximum(np.abs(values), FLAT * float(np.sum(J * J)) + 1e-300)
        step = along - Z @ (vectors @ (right / bends))
        length = float(np.linalg.norm(step))
        if not np.isfinite(length):
            break
        theta = theta + step * min(1.0, radius / max(length, 1e-300))
        far = float(np.linalg.norm(theta))
        if far > radius:
            theta, clipped = theta * (radius / far), clipped + 1
            if clipped == CLIPPED:
                break
        elif length < LAST:
            return theta, True
    return theta, False


def _across(normal: Array) -> Array:
    """Two unit vectors ``(3, 2)`` across a vector and each other."""
    n = normal / np.linalg.norm(normal)
    first = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(n, first)])


def symmetric(A: Array) -> Array:
    """Symmetric part of matrices ``(…, n, n)``."""
    result: Array = 0.5 * (A + np.swapaxes(A, -1, -2))
    return result
