"""Stability of an equilibrium under an imposed pose.

The second variation of the energy is ``K − H`` on the motions that leave the end-effector where it is, the
null space of ``J = [J_θ J_q]``. The equilibrium is stable where it is positive definite.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.equilibrium import Configuration
from vjm.rotations import Array

NEUTRAL = 1e-12
"""Eigenvalues below this fraction of the largest are zero but for rounding."""
STILL = 1e-6
"""Deflection of a unit mode, over the characteristic length, below which the stations do not move."""
COINCIDENT = 1e-3
"""Two eigenvalues vanish together where the second is below this fraction of the third."""


@dataclass(frozen=True)
class Stability:
    """The second variation's verdict.

    Attributes:
        eigenvalue: the smallest, or of several negative ones the one nearest zero; units of the model's energy.
        unstable: number of negative eigenvalues.
    """

    eigenvalue: float
    unstable: int


def stability(at: Configuration) -> Stability:
    """Smallest eigenvalue and number of negative ones of the second variation on the null space of J.

    The number comes from the pivots of the factorisation. On a stable path the eigenvalue nearest zero is the
    smallest, and it is the one that passes zero at a bifurcation. Where J leaves no motion at all there is
    nothing to be unstable: nan and none.
    """
    model = at.model
    if model.size <= 6:
        return Stability(float("nan"), 0)
    compiled = model.compiled
    unstable = compiled.visit(at.x, at.wrench)
    try:
        eigenvalue = compiled.smallest(at.x, at.wrench)
    except np.linalg.LinAlgError:
        return Stability(0.0, 0)
    count = 2 * unstable
    while unstable and eigenvalue > 0.0 and count < 2 * model.size:
        # a positive one lies nearer to zero: look further
        count *= 2
        eigenvalue = float(compiled.modes(at.x, at.wrench, count)[0].min())
    return Stability(eigenvalue, unstable)


def critical_modes(at: Configuration) -> list[Array]:
    """Motions ``(m,)`` of the joints along which a critical point loses its stability: one, or two at once.

    Eigenvectors of the smallest eigenvalue, and of the next where it vanishes together with it (a bar that
    bends alike in both planes). Scaled by the model's coordinate units each has length one. Its sign makes the
    largest component of the deflection that it causes positive, or, where no station moves (one spring a
    link), of the motion itself.
    """
    unit = at.model.coordinate_scale
    try:
        values, motions = at.model.compiled.modes(at.x, at.wrench, 3)
    except np.linalg.LinAlgError:
        # singular to the last digit: a wrench that differs in the tenth has the same modes
        values, motions = at.model.compiled.modes(at.x, at.wrench * (1.0 + 1e-10), 3)
    together = 2 if len(values) == 3 and abs(values[1]) < COINCIDENT * abs(values[2]) else 1
    modes = []
    for mode in motions.T[:together]:
        deflection = at.model.shape_rate(at.kinematics, mode).ravel()
        if np.abs(deflection).max(initial=0.0) < STILL * at.model.chain.characteristic_length:
            deflection = mode / unit
        modes.append(mode * np.sign(deflection[np.argmax(np.abs(deflection))]))
    return modes


def free_stability(at: Configuration) -> Stability:
    """The same verdict for an end-effector that is free under a dead wrench: nothing constrains the motions.

    Motions that cost nothing, such as a tool turning about its own joint, count as neither.
    """
    model = at.model
    unit = model.coordinate_scale
    A = (at.stiffness - at.hessian) * unit[:, None] * unit / model.wrench_scale[3]
    values = np.linalg.eigvalsh(0.5 * (A + A.T))
    felt = values[np.abs(values) > NEUTRAL * np.max(np.abs(values))]
    return Stability(float(felt[0]), int(np.count_nonzero(felt < 0.0)))
