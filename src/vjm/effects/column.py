"""A pinned column steered by the deflection of its middle: large deflections, a bow, and bending beyond yield.

The line of action passes through both pins, so that the bending moment is the force times the distance from it.
From the middle outwards ``dy/ds = sin θ``, ``dθ/ds = −(κ(P y) + κ₀(s))`` with κ the curvature that a moment makes
and κ₀ that of the bow; P is such that y vanishes at the pin (the elastica where κ = M/EI). The curve is the limit of
many virtual springs. Loading must be monotone: what has yielded is taken to follow the same curve (deformation
theory).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vjm.rotations import Array

STEPS = 24
"""Of the fourth-order Runge-Kutta rule over half the column."""
FIBRES = 400
"""Over half the depth of the section."""
FAR = 60.0
"""Curvature over that at first yield up to which moments are tabulated."""
ROUNDS = 60
"""Of the search for the force."""


@dataclass(frozen=True)
class Fibres:
    """What bending beyond yield needs of a section.

    Attributes:
        depth: in the plane of bending, mm.
        core: depth of a hollow core of the same shape, mm; zero where it is solid.
        area: mm².
    """

    depth: float
    core: float
    area: float

    def widths(self) -> tuple[Array, Array]:
        """Distances ``(k,)`` from the middle over half the depth, and the widths there over the section's own."""
        y = (np.arange(FIBRES) + 0.5) / FIBRES
        inner = self.core / self.depth
        return y, np.where(y < inner, 1.0 - inner, 1.0)


@lru_cache(maxsize=64)
def yield_curve(fibres: Fibres, hardening: float) -> tuple[Array, Array]:
    """Moments ``(k,)`` over that at first yield, by curvatures ``(k,)`` over the one there.

    Args:
        fibres: of the section.
        hardening: tangent modulus over Young's beyond yield.
    """
    y, width = fibres.widths()
    curvature = np.concatenate([[0.0], np.geomspace(0.2, FAR, 240)])
    strain = curvature[:, None] * y
    stress = np.where(strain < 1.0, strain, 1.0 + hardening * (strain - 1.0))
    moment = (stress * y * width).sum(axis=1)
    elastic = float((y * y * width).sum())
    return moment / elastic, curvature


def bending(stiffness: float, first_yield: float, fibres: Fibres, hardening: float) -> Callable[[Array], Array]:
    """Curvature by moment.

    Args:
        stiffness: EI, N mm².
        first_yield: moment, N mm; infinite where it never yields.
        fibres: of the section.
        hardening: tangent modulus over Young's beyond yield.
    """
    if not np.isfinite(first_yield):
        return lambda M: M / stiffness
    moments, curvatures = yield_curve(fibres, hardening)
    last = (curvatures[-1] - curvatures[-2]) / (moments[-1] - moments[-2])

    def curvature(M: Array) -> Array:
        m = np.abs(M) / first_yield
        k = np.interp(m, moments, curvatures) + last * np.maximum(m - moments[-1], 0.0)
        result: Array = np.sign(M) * k * first_yield / stiffness
        return result

    return curvature


def column_force(
    deflection: Array, length: float, stiffness: float, bow: float, curvature: Callable[[Array], Array]
) -> Array:
    """Compressive forces ``(n,)`` at deflections of the middle from the unloaded shape.

    Args:
        deflection: ``(n,)`` mm.
        length: between the pins, mm.
        stiffness: EI, N mm², for the scale of the search.
        bow: amplitude of the half sine wave of the unloaded shape, mm, towards positive deflections.
        curvature: by moment.

    Returns:
        N; Euler's load where a straight column is not deflected.
    """
    euler = np.pi**2 * stiffness / length**2
    start = bow + deflection
    start = np.where(np.abs(start) < 1e-6, 1e-6, start)
    low, high = np.full(len(start), -4.0 * euler), np.full(len(start), 2.0 * euler)
    # at the pin y falls with the force
    value_low, value_high = (_end(P, start, length, bow, curvature) * np.sign(start) for P in (low, high))
    # Illinois: the end that stays twice counts half
    side = np.zeros(len(start))
    P = low
    size = np.abs(start)
    value_low = np.minimum(value_low, size)
    for k in range(ROUNDS):
        P = high - value_high * (high - low) / np.where(value_high == value_low, 1.0, value_high - value_low)
        P = np.clip(P, low + 1e-3 * (high - low), high - 1e-3 * (high - low))
        P = np.where(k % 4 == 3, 0.5 * (low + high), P)
        value = np.clip(_end(P, start, length, bow, curvature) * np.sign(start), -size, size)
        above = value > 0.0
        low, high = np.where(above, P, low), np.where(above, high, P)
        value_high = np.where(above, np.where(side > 0.0, 0.5, 1.0) * value_high, value)
        value_low = np.where(above, value, np.where(side < 0.0, 0.5, 1.0) * value_low)
        side = np.where(above, 1.0, -1.0)
        if float(np.minimum((high - low) / euler, np.abs(value) / size).max()) < 1e-9:
            break
    return P


def _end(P: Array, start: Array, length: float, bow: float, curvature: Callable[[Array], Array]) -> Array:
    """Distance ``(n,)`` of the pin from the line of action."""
    h = 0.5 * length / STEPS
    own = bow * (np.pi / length) ** 2
    y, turn = start.copy(), np.zeros(len(start))
    curled, flung = np.zeros(len(start), dtype=bool), np.zeros(len(start), dtype=bool)

    def rate(s: float, y: Array, turn: Array) -> tuple[Array, Array]:
        return np.sin(turn), -(curvature(P * y) + own * np.cos(np.pi * s / length))

    for k in range(STEPS):
        s = k * h
        a, b = rate(s, y, turn)
        c, d = rate(s + 0.5 * h, y + 0.5 * h * a, turn + 0.5 * h * b)
        e, f = rate(s + 0.5 * h, y + 0.5 * h * c, turn + 0.5 * h * d)
        g, i = rate(s + h, y + h * e, turn + h * f)
        y = y + h / 6.0 * (a + 2.0 * c + 2.0 * e + g)
        turn = turn + h / 6.0 * (b + 2.0 * d + 2.0 * f + i)
        # beyond a right angle the force is too large, wherever the curl ends
        way = turn * np.sign(start)
        curled |= way < -0.5 * np.pi
        flung |= ~curled & (way > 0.5 * np.pi)
        y = np.where(curled, -start, np.where(flung, start, y))
        turn = np.where(curled | flung, 0.0, turn)
    return y
