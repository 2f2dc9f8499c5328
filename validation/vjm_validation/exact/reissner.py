"""Large bending of an extensible and shearable cantilever by a tip force, by shooting.

The rod of `vjm_validation.exact.rod` is integrated from its tip, where M = 0, to its root, where θ = 0. Lengths are
over L, forces times L²/EI; ``axial`` = EI/(EA L²) and ``shear`` = EI/(GA L²). Under an end moment alone the rod is
`vjm_validation.exact.elastica.end_moment`'s, whatever its axial and shear stiffness.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import root_scalar

from vjm_validation.exact import elastica
from vjm_validation.exact.elastica import Tip
from vjm_validation.exact.rod import State, integrate

LARGEST_LOAD = 50.0
"""F L²/EI. Under a pull an error grows along the rod by up to e^ω, ω² = F L²/EI: here from 1e-13 to 1e-10."""


def dead_force(load: float, angle: float = 0.5 * np.pi, axial: float = 0.0, shear: float = 0.0) -> Tip:
    """Tip under a force that keeps its direction.

    Args:
        load: F L²/EI, above 0 and at most `LARGEST_LOAD`.
        angle: of the force in rad from the undeformed axis, between 0 and π.
        axial: EI/(EA L²), ≥ 0.
        shear: EI/(GA L²), ≥ 0.

    Raises:
        ValueError: an argument is out of range, or the rod is so soft along its axis or in shear that shooting from
            the elastica's tip angle finds no equilibrium.
    """
    _check(load, axial, shear)
    start = elastica.dead_force(load, angle).theta

    def root_turn(turn: float) -> float:
        return float(_root(load, angle, turn, axial, shear)[2])

    # the secant's last step is of the order of the root's accuracy: it ends where integration does
    solution = root_scalar(root_turn, x0=start, x1=start * (1.0 - 1e-3), method="secant", xtol=1e-13, rtol=1e-13)
    if not solution.converged or abs(root_turn(solution.root)) > 1e-11:
        raise ValueError(f"no equilibrium near the elastica's for axial = {axial}, shear = {shear}")
    root = _root(load, angle, solution.root, axial, shear)
    return Tip(float(-root[0]), float(-root[1]), float(solution.root))


def follower_force(load: float, angle: float = 0.5 * np.pi, axial: float = 0.0, shear: float = 0.0) -> Tip:
    """Tip under a force that turns with the end section: one integration, and nothing to shoot for.

    Args:
        load: F L²/EI, above 0 and at most `LARGEST_LOAD`.
        angle: of the force in rad from the tip's section normal, which is the tip's tangent where no shear acts.
        axial: EI/(EA L²), ≥ 0.
        shear: EI/(GA L²), ≥ 0.

    Raises:
        ValueError: an argument is out of range.
    """
    _check(load, axial, shear)
    x, y, turn, _ = _root(load, angle, 0.0, axial, shear)
    cos, sin = np.cos(turn), np.sin(turn)
    return Tip(float(-x * cos - y * sin), float(x * sin - y * cos), float(-turn))


def _root(load: float, angle: float, turn: float, axial: float, shear: float) -> State:
    """State ``(4,)`` of the root, with the tip at the origin, turned by ``turn``."""
    force = (load * np.cos(angle), load * np.sin(angle))
    return integrate(np.array([0.0, 0.0, turn, 0.0]), force, (1.0, 0.0), axial, shear)


def _check(load: float, axial: float, shear: float) -> None:
    if not 0.0 < load <= LARGEST_LOAD:
        raise ValueError(f"load F L²/EI is {load}: it must be above 0 and at most {LARGEST_LOAD}")
    if axial < 0.0 or shear < 0.0:
        raise ValueError(f"axial = {axial} and shear = {shear}: a flexibility cannot be negative")
