"""Compiled equilibria on a grid of displacements: marched along it, or each from a state near by."""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import entry, kernel
from vjm.kernels.entry_points import CONVERGED, UNSTABLE, iterate, loaded_stiffness, newton_step
from vjm.kernels.packed_model import Floats, Ints, model_of, work_of
from vjm.kernels.recursion import turn_about

WELL_BELOW = 0.01
"""Share of the tolerance below which a march leaves a residual as it is."""


@kernel
def _turn_of(direction: Floats, axis: Floats) -> float:
    """Angle per unit of s of a displacement's ``direction`` (6,); writes its unit ``axis`` (3,) where it turns."""
    angle = np.sqrt(direction[3] ** 2 + direction[4] ** 2 + direction[5] ** 2)
    if angle > 0.0:
        for a in range(3):
            axis[a] = direction[3 + a] / angle
    return float(angle)


@kernel
def _aim(R_0: Floats, p_0: Floats, direction: Floats, axis: Floats, angle: float, s: float, to: Floats) -> None:
    """The packed frame ``to`` (12,) at a displacement s; ``angle`` about ``axis`` (3,) per unit of it."""
    R_to = to[:9].reshape((3, 3))
    for a in range(3):
        to[9 + a] = p_0[a] + s * direction[a]
        for b in range(3):
            R_to[a, b] = R_0[a, b]
    turn_about(R_to, axis, angle * s)


@entry
def march(
    integers: Ints,
    numbers: Floats,
    work_integers: Ints,
    work_numbers: Floats,
    R_0: Floats,
    p_0: Floats,
    direction: Floats,
    s: Floats,
    origin: float,
    known: int,
    tolerance: float,
    max_iterations: int,
    x: Floats,
    force: Floats,
    K: Floats,
    error: Floats,
    iterations: Ints,
    negative: Ints,
) -> tuple[int, int]:
    """Equilibria, stiffness and stability along a grid, each predicted from up to four before it.

    Behind a bifurcation a branch is smooth in the root of the distance from it, and is predicted in that.

    Args:
        integers: see `vjm.kernels.packed_model.Buffers`.
        numbers: likewise.
        work_integers: likewise.
        work_numbers: likewise.
        R_0: ``(3, 3)`` and
        p_0: ``(3,)`` the unloaded pose.
        direction: ``(6,)`` displacement per unit of s.
        s: ``(g,)`` the grid.
        origin: where the branch begins at a bifurcation, before the grid; −inf where it does not.
        known: how many of its points are given, at least one.
        tolerance: scaled residual at which an equilibrium counts as found.
        max_iterations: of Newton's method.
        x: ``(g, n)`` coordinates and
        force: ``(g, 6)`` wrenches; the known ones given, the others written.
        K: ``(g, 6, 6)`` loaded stiffness; of the known points only the first one's is written.
        error: ``(g,)`` scaled residuals.
        iterations: ``(g,)``.
        negative: ``(g,)`` numbers of negative eigenvalues.

    Returns:
        How it ended, and the number of points that are good: stable equilibria.
    """
    model = model_of(integers, numbers)
    work = work_of(integers, work_integers, work_numbers)
    to, turn = np.empty(12), np.zeros(3)
    angle = _turn_of(direction, turn)
    at = np.sqrt(s - origin) if np.isfinite(origin) else s
    n = x.shape[1]
    # of the first point only the factors are wanted
    _aim(R_0, p_0, direction, turn, angle, s[0], to)
    how, _, _, _ = iterate(model, work, to, x[0], force[0], np.inf, 0)
    if how != CONVERGED:
        return how, 0
    loaded_stiffness(model, work, force[0], K[0])
    for i in range(known, len(s)):
        order = min(i, 4)
        for c in range(n):
            x[i, c] = 0.0
        for c in range(6):
            force[i, c] = 0.0
        for k in range(order):
            weight = 1.0
            for other in range(order):
                if other != k:
                    weight *= (at[i] - at[i - 1 - other]) / (at[i - 1 - k] - at[i - 1 - other])
            for c in range(n):
                x[i, c] += weight * x[i - 1 - k, c]
            for c in range(6):
                force[i, c] += weight * force[i - 1 - k, c]
        _aim(R_0, p_0, direction, turn, angle, s[i], to)
        how, iterations[i], error[i], negative[i] = iterate(
            model, work, to, x[i], force[i], tolerance, max_iterations
        )
        if how != CONVERGED:
            return how, i
        loaded_stiffness(model, work, force[i], K[i])
        if negative[i] > 0:
            return UNSTABLE, i
        # once more with the factors at hand: extrapolation multiplies what is left of the error by 15 a point
        if error[i] > WELL_BELOW * tolerance:
            newton_step(model, work, x[i], force[i])
    return CONVERGED, len(s)


@entry
def correct(
    integers: Ints,
    numbers: Floats,
    work_integers: Ints,
    work_numbers: Floats,
    R_0: Floats,
    p_0: Floats,
    direction: Floats,
    s: Floats,
    tolerance: float,
    max_iterations: int,
    x: Floats,
    force: Floats,
    K: Floats,
    negative: Ints,
) -> int:
    """Equilibria and stiffness at displacements, each from a state near by; nothing is said of stability between.

    Args:
        integers: see `vjm.kernels.packed_model.Buffers`.
        numbers: likewise.
        work_integers: likewise.
        work_numbers: likewise.
        R_0: ``(3, 3)`` and
        p_0: ``(3,)`` the unloaded pose.
        direction: ``(6,)`` displacement per unit of s.
        s: ``(g,)`` the displacements.
        tolerance: scaled residual at which an equilibrium counts as found.
        max_iterations: of Newton's method.
        x: ``(g, n)`` coordinates and
        force: ``(g, 6)`` wrenches to start from, overwritten.
        K: ``(g, 6, 6)`` loaded stiffness, written.
        negative: ``(g,)`` numbers of negative eigenvalues, written.

    Returns:
        The number of points found: all, or those before the first that was not.
    """
    model = model_of(integers, numbers)
    work = work_of(integers, work_integers, work_numbers)
    to, turn = np.empty(12), np.zeros(3)
    angle = _turn_of(direction, turn)
    for i in range(len(s)):
        _aim(R_0, p_0, direction, turn, angle, s[i], to)
        how, _, _, negative[i] = iterate(model, work, to, x[i], force[i], tolerance, max_iterations)
        if how != CONVERGED:
            return i
        loaded_stiffness(model, work, force[i], K[i])
    return len(s)
