"""Compiled steps of a path that leave nothing to look into: on one stable path, evenly, without an event.

They are those of `vjm.continuation.load_stepping` with what `vjm.continuation.one_path` and
`vjm.continuation.stability_dips` ask of a step. The first that is not plain is left to these.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.kernels.arrays import Floats, Ints, MachineArrays, Work
from vjm.kernels.compilation import entry, kernel
from vjm.kernels.entry_points import aim, answer, closure_stiffness, nearest, predict, smooth_in
from vjm.kernels.newton import CONVERGED, newton
from vjm.kernels.statics import carried


class Rows(NamedTuple):
    """Points of a path, g of them.

    Attributes:
        s: path parameters ``(g,)``.
        x: coordinates ``(g, n)``.
        wrench: the closures' ``(g, f)``.
        stiffness: K^F ``(g, 6, 6)``.
        tangent: ``(g,)`` along the ramp.
        eigenvalue: ``(g,)`` nearest zero.
        residual: scaled ``(g,)``.
        iterations: ``(g,)``.
        shape: positions of the stations ``(g, k, 3)``.
        rate: derivatives ``(g, n)`` of the coordinates, in their units, by the path parameter.
    """

    s: Floats
    x: Floats
    wrench: Floats
    stiffness: Floats
    tangent: Floats
    eigenvalue: Floats
    residual: Floats
    iterations: Ints
    shape: Floats
    rate: Floats


class Limits(NamedTuple):
    """What a step is asked for; see `vjm.continuation.load_stepping` and the modules that look at its steps.

    Attributes:
        length: of the path.
        largest: step.
        small: step from which others look at what bends.
        bend: of the shape.
        half: what the smallest eigenvalue may fall to, over that before.
        end: distance of the chord from what an end's tangent foresees.
        mean: likewise from the mean of the two.
        nothing: motion of a coordinate over the largest of a step that is none.
        slight: likewise, of which the mean alone is asked.
        still: motion in the coordinates' units that is none.
        neutral: eigenvalue that is within rounding of zero.
        wide: change of the shape from which a second mode is looked at.
        knee: tangent stiffness that is an event.
        tolerance: scaled residual of an equilibrium.
        most: iterations of Newton's method.
    """

    length: float
    largest: float
    small: float
    bend: float
    half: float
    end: float
    mean: float
    nothing: float
    slight: float
    still: float
    neutral: float
    wide: float
    knee: float
    tolerance: float
    most: int


class ImposedRamp(NamedTuple):
    """Displacements ``(6,)`` per unit of the path parameter from an unloaded pose ``(3, 3)``, ``(3,)``."""

    R: Floats
    p: Floats
    direction: Floats


class ModeSearch(NamedTuple):
    """Where the search for the smallest eigenvalue begins.

    Attributes:
        last: mode ``(n,)``, overwritten.
        some: ``(n,)`` added to it, in units of its length.
        basis: ``(k, n)`` written.
        accuracy: of the eigenvalue, relative.
        restarts: of the search.
    """

    last: Floats
    some: Floats
    basis: Floats
    accuracy: float
    restarts: int


@entry
def plain_steps(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end_wrench: Floats, ramp: ImposedRamp,
    modes: ModeSearch, joint: Ints, offset: Floats, limits: Limits, origin: float, known: int, step: float,
    rows: Rows,
) -> tuple[int, float]:  # fmt: skip
    """Follow a path as long as its steps are plain.

    Args:
        model: the machine; its first closure's frame on the ground is overwritten.
        work: written.
        command: ``(m,)``.
        natural: ``(n,)``.
        end_wrench: ``(e, 6)``.
        ramp: of the first closure's frame.
        modes: of the last point.
        joint: before each station ``(k,)`` and
        offset: its place behind it ``(k, 3)``.
        limits: of the steps.
        origin: where the path begins at a bifurcation, which may be the first of the points; −inf elsewhere.
        known: number of points, at most three, that are given: the last ones.
        step: to begin with.
        rows: the points; those behind the ones that are given are written as far as there are rows.

    Returns:
        Number of points that are known now, and the next step.
    """
    i = known - 1
    begin = 1 if rows.s[0] == origin else 0
    _copy(work.wrench, rows.wrench[i])
    aim(model, ramp.R, ramp.p, ramp.direction, rows.s[i])
    how, _, _, negative = newton(model, command, natural, rows.x[i], end_wrench, 1.0, False, np.inf, 0, False, work)
    if how != CONVERGED or negative != 0:
        return known, step
    _rate(model, work, ramp, rows.rate[i])
    while rows.s[i] < limits.length * (1.0 - 1e-12) and i + 1 < len(rows.s):
        target = min(rows.s[i] + step, limits.length)
        if limits.length - target < 0.3 * step:
            target = limits.length
        rows.s[i + 1] = target
        predict(rows.s, rows.x, rows.wrench, i + 1, 3, origin)
        if not _found(model, work, command, natural, end_wrench, ramp, modes, joint, offset, limits, i + 1, rows):
            break
        bend = _bend(rows, i, origin, limits.length)
        if bend > limits.bend:
            if target - rows.s[i] <= limits.small:
                break
            step = 0.5 * (target - rows.s[i])
            continue
        if not _is_even(model.unit, rows, i, origin > -np.inf, limits) or _may_hide(rows, i, begin, limits):
            break
        if rows.tangent[i] > limits.knee >= rows.tangent[i + 1] or rows.tangent[i] > 0.0 >= rows.tangent[i + 1]:
            break
        i += 1
        step = min(limits.largest, (target - rows.s[i - 1]) * (2.0 if bend < 0.5 * limits.bend else 1.2))
    return i + 1, step


@kernel
def _copy(to: Floats, values: Floats) -> None:
    for i in range(len(to)):
        to[i] = values[i]


@kernel
def _rate(model: MachineArrays, work: Work, ramp: ImposedRamp, rate: Floats) -> None:
    """Write the derivative ``(n,)`` of the scaled coordinates with the factors at hand."""
    gap = np.zeros(model.size[2])
    gap[:6] = ramp.direction
    answer(model, work, np.zeros(len(rate)), gap)
    for c in range(len(rate)):
        rate[c] = work.step[c] / model.unit[c]


@kernel
def _found(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end_wrench: Floats, ramp: ImposedRamp,
    modes: ModeSearch, joint: Ints, offset: Floats, limits: Limits, i: int, rows: Rows,
) -> bool:  # fmt: skip
    """Complete a row from the state foreseen in it; false unless it is a stable equilibrium."""
    n = rows.x.shape[1]
    aim(model, ramp.R, ramp.p, ramp.direction, rows.s[i])
    _copy(work.wrench, rows.wrench[i])
    how, rows.iterations[i], rows.residual[i], negative = newton(
        model, command, natural, rows.x[i], end_wrench, 1.0, False, limits.tolerance, limits.most, False, work
    )
    if how != CONVERGED or negative != 0:
        return False
    _copy(rows.wrench[i], work.wrench)
    closure_stiffness(model, work, 0, rows.stiffness[i])
    tangent = size = 0.0
    for a in range(6):
        for b in range(6):
            tangent += ramp.direction[a] * rows.stiffness[i, a, b] * ramp.direction[b]
    rows.tangent[i] = tangent
    for c in range(n):
        size += modes.last[c] ** 2
    size = np.sqrt(size)
    if not size < np.inf:
        return False
    for c in range(n):
        modes.last[c] += size * modes.some[c]
    value = nearest(model, work, modes.last, modes.basis, modes.accuracy, modes.restarts)
    rows.eigenvalue[i] = value
    if not limits.neutral < value < np.inf:
        return False
    _rate(model, work, ramp, rows.rate[i])
    for k in range(len(joint)):
        carried(work.R, work.p, joint[k], offset[k], rows.shape[i, k])
    return True


@kernel
def _bend(rows: Rows, i: int, origin: float, length: float) -> float:
    """How far the shape behind point i lies from the prolongation of the last two, over the way to it."""
    if i == 0:
        return 0.0
    s, shape, way, least = rows.s, rows.shape, 0.0, np.inf
    for k in range(shape.shape[1]):
        for a in range(3):
            way += (shape[i + 1, k, a] - shape[i, k, a]) ** 2
    for form in range(2 if origin > -np.inf else 1):
        ratio, missed = (s[i + 1] - s[i]) / (s[i] - s[i - 1]), 0.0
        if form == 1:
            start, last = smooth_in(s[i - 1], origin), smooth_in(s[i], origin)
            ratio = (smooth_in(s[i + 1], origin) - last) / (last - start)
        for k in range(shape.shape[1]):
            for a in range(3):
                missed += (shape[i + 1, k, a] - shape[i, k, a] - (shape[i, k, a] - shape[i - 1, k, a]) * ratio) ** 2
        least = min(least, np.sqrt(missed))
    return least / (np.sqrt(way) + 1e-6 * length)


@kernel
def _is_even(unit: Floats, rows: Rows, i: int, by_root: bool, limits: Limits) -> bool:
    """Whether the step behind point i stays on one path, see `vjm.continuation.one_path`."""
    if not limits.neutral < rows.eigenvalue[i]:
        return False
    h, n = rows.s[i + 1] - rows.s[i], rows.x.shape[1]
    first, last, chord = h * rows.rate[i], h * rows.rate[i + 1], np.empty(n)
    a = b = c = off_a = off_b = most = 0.0
    for k in range(n):
        chord[k] = (rows.x[i + 1, k] - rows.x[i, k]) / unit[k]
        a, b, c = a + first[k] ** 2, b + last[k] ** 2, c + chord[k] ** 2
        off_a, off_b = off_a + (chord[k] - first[k]) ** 2, off_b + (chord[k] - last[k]) ** 2
        most = max(most, abs(chord[k]))
    if not max(a, b, c) < limits.still**2:
        if not (off_a <= limits.end**2 * a and off_b <= limits.end**2 * b):
            return False
        for k in range(n):
            larger = max(abs(first[k]), abs(last[k]))
            if not abs(chord[k] - 0.5 * (first[k] + last[k])) <= limits.mean * (larger + limits.nothing * most):
                return False
            largest = limits.end * (larger + limits.slight * most)
            if not (abs(chord[k] - first[k]) <= largest and abs(chord[k] - last[k]) <= largest):
                return False
    ratio = rows.eigenvalue[i + 1] / rows.eigenvalue[i]
    return by_root or limits.half <= ratio <= 1.0 / limits.half


@kernel
def _may_hide(rows: Rows, i: int, begin: int, limits: Limits) -> bool:
    """Whether stability may be lost and won back about point i, see `vjm.continuation.stability_dips`."""
    if i - 1 < begin:
        return False
    value, shape, spread, moved = rows.eigenvalue, rows.shape, 0.0, 0.0
    if value[i] < min(value[i - 1], value[i + 1]):
        return True
    for k in range(shape.shape[1]):
        for a in range(3):
            spread += (shape[i - 1, k, a] - shape[i - 1, 0, a]) ** 2
            moved += (shape[i + 1, k, a] - shape[i - 1, k, a]) ** 2
    return moved > limits.wide**2 * spread
