"""Compliances from textbooks, written out entry by entry: nothing here comes from the suite."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def cantilever(L, EA, GJ, EIy, EIz, GAy=np.inf, GAz=np.inf) -> Array:
    """Tip compliance ``(6, 6)`` of a cantilever along x: L³/3EI + L/GA, L²/2EI, L/EI."""
    C = np.diag([L / EA, L**3 / (3 * EIz) + L / GAy, L**3 / (3 * EIy) + L / GAz, L / GJ, L / EIy, L / EIz])
    C[1, 5] = C[5, 1] = L**2 / (2 * EIz)
    C[2, 4] = C[4, 2] = -(L**2) / (2 * EIy)
    return C


def turned(C: Array, R: Array) -> Array:
    """The compliance in axes against which its own are turned by R."""
    B = np.kron(np.eye(2), R)
    return B @ C @ B.T


def with_rigid_arm(C: Array, arm) -> Array:
    """Read at the end of a rigid arm: a force there brings a moment, a turn brings a shift."""
    x, y, z = arm
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])  # arm × force
    wrench = np.block([[np.eye(3), np.zeros((3, 3))], [cross, np.eye(3)]])
    return wrench.T @ C @ wrench


def rotation(rng: np.random.Generator) -> Array:
    """A random rotation."""
    Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return Q * np.sign(np.linalg.det(Q))


def as_text(C: Array, digits: int) -> str:
    """Six rows of numbers with so many significant digits; what is nothing beside the diagonal is written as 0."""
    small = 1e-12 * np.sqrt(np.outer(np.diag(C), np.diag(C)))
    return "\n".join(
        " ".join(f"{C[i, j]:.{digits - 1}e}" if abs(C[i, j]) > small[i, j] else "0" for j in range(6))
        for i in range(6)
    )
