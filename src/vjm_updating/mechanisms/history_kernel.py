"""What depends on history or is looked up at every reading, compiled: tables, friction, creep and yield."""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import entry, kernel
from vjm.rotations import Array

Packed = tuple[Array, Array, Array, Array, Array]
"""Of tables, one after the other: s ``(m,)``, wrench ``(m, 6)``, its slope by s and by the coordinate in which a
piece is interpolated ``(m, 6)``, stiffness ``(m, 6, 6)``."""


@kernel
def _node(s: Array, first: int, last: int, at: float) -> int:
    """Index of the node before a place, of the nodes from ``first`` up to but for ``last``."""
    low, high = first, last - 1
    while high - low > 1:
        middle = (low + high) // 2
        if s[middle] <= at:
            low = middle
        else:
            high = middle
    return low


@kernel
def _interval(s: Array, first: int, last: int, bifurcation: float, at: float) -> tuple[int, float, float]:
    """Node before a place between a table's ends, place in the interval from 0 to 1, and the interval's width.

    Behind a bifurcation both are of the root of the distance from it.
    """
    i = _node(s, first, last, at)
    a, b = s[i], s[i + 1]
    if a >= bifurcation:
        origin = bifurcation * (1.0 - 1e-12)
        a, b, at = np.sqrt(max(a - origin, 0.0)), np.sqrt(max(b - origin, 0.0)), np.sqrt(max(at - origin, 0.0))
    return i, (at - a) / (b - a), b - a


@entry
def interpolated(
    tables: Packed, first: int, last: int, bifurcation: float, at: float, wrench: Array, stiffness: Array
) -> None:
    """Wrench ``(6,)`` and stiffness ``(6, 6)`` of a table at a place; straight on beyond its ends."""
    s, W, slope, own, K = tables
    end = -1
    if at > s[last - 1]:
        end = last - 1
    elif at < 0.0:
        end = first
    if end >= 0:
        wrench[:] = W[end] + (at - s[end]) * slope[end]
        stiffness[:] = K[end]
        return
    i, t, width = _interval(s, first, last, bifurcation, at)
    h00, h10 = (1.0 + 2.0 * t) * (1.0 - t) ** 2, t * (1.0 - t) ** 2 * width
    h01, h11 = t**2 * (3.0 - 2.0 * t), t**2 * (t - 1.0) * width
    for k in range(6):
        wrench[k] = h00 * W[i, k] + h01 * W[i + 1, k] + h10 * own[i, k] + h11 * own[i + 1, k]
        for m in range(6):
            stiffness[k, m] = (1.0 - t) * K[i, k, m] + t * K[i + 1, k, m]


@entry
def looked_up(
    tables: Packed, first: np.ndarray, bifurcation: Array, both: np.ndarray, measure: Array, along: Array, u: Array
) -> tuple[Array, Array]:
    """Wrenches ``(n, 6)`` and stiffnesses ``(n, 6, 6)`` at displacements.

    Args:
        tables: packed.
        first: index ``(T + 1,)`` of the first node of each table, and of the end.
        bifurcation: of each table ``(T,)``.
        both: tables ``(n, 2)`` of each reading, on its ray and on the opposite one.
        measure: ``(n, 6)``, a displacement times it is its place on the ray.
        along: direction ``(n, 6)`` of the ray.
        u: displacements ``(n, 6)``.
    """
    n = len(u)
    wrench, stiffness = np.empty((n, 6)), np.empty((n, 6, 6))
    for r in range(n):
        s = 0.0
        for k in range(6):
            s += u[r, k] * measure[r, k]
        table = both[r, 0] if s >= 0.0 else both[r, 1]
        interpolated(tables, first[table], first[table + 1], bifurcation[table], abs(s), wrench[r], stiffness[r])
        for m in range(6):
            off = u[r, m] - s * along[r, m]
            if off != 0.0:
                for k in range(6):
                    wrench[r, k] += stiffness[r, k, m] * off
    return wrench, stiffness


@entry
def on_chords(s: Array, first: np.ndarray, bifurcation: Array, both: np.ndarray, at: Array, values: Array) -> Array:
    """What tables have at their nodes ``(m, k)``, linearly between them, at places ``(n,)`` on rays: ``(n, k)``.

    Behind a bifurcation linear in the root of the distance; beyond the ends as at them. Of a place below zero it is
    the opposite ray's. Other arguments as of `looked_up`.
    """
    n, width = len(at), values.shape[1]
    result = np.empty((n, width))
    for r in range(n):
        table = both[r, 0] if at[r] >= 0.0 else both[r, 1]
        begin, end = first[table], first[table + 1]
        i, t, _ = _interval(s, begin, end, bifurcation[table], min(abs(at[r]), s[end - 1]))
        for k in range(width):
            result[r, k] = (1.0 - t) * values[i, k] + t * values[i + 1, k]
    return result


@entry
def friction_along(
    free: Array, give: Array, limit: Array, begins: np.ndarray, rest: Array, sweeps: int, enough: float
) -> Array:
    """Torques ``(n, n_q)`` of dry friction, by projected Gauss-Seidel iteration at every reading."""
    n, joints = free.shape
    result = np.zeros((n, joints))
    tau, stands, turn = np.zeros(joints), np.zeros(joints), np.zeros(joints)
    for k in range(n):
        if begins[k]:
            tau[:] = 0.0
            stands[:] = rest[k]
        most = 0.0
        for j in range(joints):
            most = max(most, give[k, j, j])
        for _ in range(sweeps):
            largest, size = 0.0, 0.0
            for j in range(joints):
                # a joint that cannot turn while the end-effector is held needs no torque to stand
                if give[k, j, j] <= 1e-9 * most:
                    size = max(size, abs(tau[j]))
                    continue
                own = free[k, j] - stands[j]
                for i in range(joints):
                    own += give[k, j, i] * tau[i]
                new = min(max(tau[j] - own / give[k, j, j], -limit[j]), limit[j])
                largest = max(largest, abs(new - tau[j]))
                tau[j] = new
                size = max(size, abs(new))
            if largest <= enough * size:
                break
        for j in range(joints):
            turn[j] = free[k, j]
            for i in range(joints):
                turn[j] += give[k, j, i] * tau[i]
        stands[:] = turn
        result[k] = tau
    return result


@entry
def decaying(decay: Array, gain: Array, begins: np.ndarray) -> Array:
    """``x_k = d_k x_{k−1} + g_k`` ``(n,)``, from zero where a history begins."""
    x, last = np.empty(len(decay)), 0.0
    for k in range(len(decay)):
        last = 0.0 if begins[k] else decay[k] * last + gain[k]
        x[k] = last
    return x


@entry
def flowing(force: Array, begins: np.ndarray, limit: float, compliance: float, grows: float) -> tuple[Array, Array]:
    """Plastic slip ``(n,)`` with linear hardening, and its slope by the force.

    Of the hardening a share ``grows`` widens the elastic range, the rest moves it.
    """
    n = len(force)
    slip, middle, half = 0.0, 0.0, limit
    x, slope = np.empty(n), np.zeros(n)
    for k in range(n):
        if begins[k]:
            slip, middle, half = 0.0, 0.0, limit
        beyond = abs(force[k] - middle) - half
        if beyond > 0.0:
            way = 1.0 if force[k] > middle else -1.0
            slip += compliance * beyond * way
            middle += (1.0 - grows) * beyond * way
            half += grows * beyond
            slope[k] = compliance
        x[k] = slip
    return x, slope
