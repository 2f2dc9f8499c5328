"""A pinned column controlled by the deflection of its middle: large deflections, a bow, and bending beyond yield.

The line of action passes through both pins, so that the bending moment is the force times the distance from it.
From the middle outwards ``dy/ds = sin θ``, ``dθ/ds = −(κ(P y) + κ₀(s))`` with κ the curvature that a moment makes
and κ₀ that of the bow. P is such that y vanishes at the pin: the elastica where κ = M/EI, and the limit of many
virtual springs. Where the pins turn against a rotational spring k, its moment acts all along the column and
M = P y − k θ with θ the turn of the pin. Loading must be monotone: what has yielded is taken to follow the same
curve (deformation theory).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from vjm.io.shapes import Shape
from vjm.kernels.compilation import entry, kernel
from vjm.rotations import Array
from vjm_updating.constants import numerical

STEPS = numerical(24)
"""Of the fourth-order Runge-Kutta rule over half the column."""
FAR = numerical(60.0)
"""Curvature over that at the proof stress up to which moments are tabulated."""
CURVATURES = numerical(160)
"""At which moments are tabulated."""
ROUNDS = numerical(90)
"""Of the search for the force."""
TURNS = numerical(40)
"""Of the search for the moments of the pins."""
SHUT = numerical(1e-8)
"""Error of the pins' turns over the column's own at which it ends."""


@lru_cache(maxsize=64)
def yield_curve(shape: Shape, exponent: float, offset: float) -> tuple[Array, Array]:
    """Moments ``(k,)`` over that at which the outer fibre would reach the proof stress elastically, by curvatures.

    Each fibre follows Ramberg and Osgood (NACA TN 902, 1943), ``ε/ε_p = σ/σ_p + offset (σ/σ_p)^exponent``, with ε_p
    the elastic strain at the proof stress σ_p. The larger the exponent the sharper the knee.

    Args:
        shape: of the section, in bending about its z axis.
        exponent: of the law.
        offset: permanent strain that defines the proof stress, over ε_p.
    """
    y, area = shape.fibres()
    y = y / (0.5 * shape.sides[0])
    curvature = np.concatenate([[0.0], np.geomspace(0.05, FAR, CURVATURES)])
    # beyond the proof stress strain grows with a high power: stresses are spaced by it
    highest = max((FAR / offset) ** (1.0 / exponent), 1.0)
    share = np.concatenate(
        [np.linspace(0.0, 0.9, 200), highest - (highest - 0.9) * np.linspace(1.0, 0.0, 600)[1:] ** 2]
    )
    strain = share + offset * share**exponent
    stress = np.interp(curvature[:, None] * y, strain, share)
    moment = (stress * y * area).sum(axis=1)
    elastic = float((y * y * area).sum())
    return moment / elastic, curvature


def column_force(
    deflection: Array,
    length: float,
    stiffness: float,
    bow: float = 0.0,
    proof: float = float("inf"),
    shape: Shape | None = None,
    exponent: float = 40.0,
    offset: float = 0.5,
    restraint: float = 0.0,
) -> Array:
    """Compressive forces ``(n,)`` at deflections of the middle from the unloaded shape.

    Args:
        deflection: ``(n,)`` mm.
        length: between the pins, mm.
        stiffness: EI, N mm².
        bow: amplitude of the half sine wave of the unloaded shape, mm, towards positive deflections.
        proof: bending moment, N mm, at which the outer fibre would reach the proof stress elastically; infinite
            where it never yields.
        shape: of the section, where it yields.
        exponent: see `yield_curve`.
        offset: see `yield_curve`.
        restraint: stiffness of a rotational spring at each pin, N mm per rad; 0 for free pins.

    Returns:
        N; Euler's load where a straight column is not deflected.
    """
    moments, curvatures = np.array([0.0, 1.0]), np.array([0.0, 1.0])
    if shape is not None and np.isfinite(proof):
        moments, curvatures = yield_curve(shape, exponent, offset)
    scale = proof if len(moments) > 2 else stiffness / length
    start = np.asarray(deflection, dtype=float) + bow
    force, turn = np.empty(len(start)), np.empty(len(start))

    def missed(moment: Array) -> Array:
        """By how much the pins turn further than their springs let them under such moments ``(n,)``, rad."""
        _forces(start, length, stiffness, bow, scale, moments, curvatures, moment, force, turn)
        # the bow's own slope does not load the spring
        return turn - bow * np.pi / length - moment / restraint

    low = np.zeros(len(start))
    if restraint <= 0.0:
        _forces(start, length, stiffness, bow, scale, moments, curvatures, low, force, turn)
        return force
    at_low = missed(low)
    way = np.where(at_low >= 0.0, 1.0, -1.0)
    # clamped pins bear a moment of 2 π² EI w / L² at a small deflection w, and no spring much more
    clamped = 2.0 * np.pi**2 * stiffness / length**2 * np.abs(start)
    high = way * np.minimum(restraint * np.abs(at_low), clamped)
    at_high = missed(high)
    for _ in range(TURNS):
        middle = high - np.divide(
            at_high * (high - low), at_high - at_low, out=np.zeros(len(low)), where=at_high != at_low
        )
        at_middle = missed(middle)
        if (np.abs(at_middle) <= SHUT * np.abs(start) / length).all():
            break
        beyond = way * at_middle < 0.0
        # Illinois: the end that stays counts half
        at_low, at_high = np.where(beyond, 0.5 * at_low, at_middle), np.where(beyond, at_middle, 0.5 * at_high)
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return force


@entry
def _forces(
    start: Array,
    length: float,
    stiffness: float,
    bow: float,
    scale: float,
    moments: Array,
    curvatures: Array,
    held: Array,
    force: Array,
    turned: Array,
) -> None:
    """Write the forces ``(n,)`` by bisection and false position, and how far the pins turn.

    The moment ``scale`` has the curve's unit; ``held`` are the moments of the pins.
    """
    euler = np.pi**2 * stiffness / length**2
    for i in range(len(start)):
        y0 = start[i] if abs(start[i]) > 1e-6 else 1e-6
        # clamped pins bear four times Euler's load
        low, high = -4.0 * euler, (2.0 if held[i] == 0.0 else 6.0) * euler
        at_low = _end(low, y0, length, bow, stiffness, scale, moments, curvatures, held[i])[0]
        at_high = _end(high, y0, length, bow, stiffness, scale, moments, curvatures, held[i])[0]
        P = low
        side = 0
        for k in range(ROUNDS):
            P = 0.5 * (low + high)
            if k % 4 != 3 and at_high != at_low:
                P = high - at_high * (high - low) / (at_high - at_low)
                P = min(max(P, low + 1e-3 * (high - low)), high - 1e-3 * (high - low))
            value = _end(P, y0, length, bow, stiffness, scale, moments, curvatures, held[i])[0]
            if abs(value) < 1e-12 or high - low < 1e-11 * euler:
                break
            # Illinois: the end that stays twice counts half
            if value > 0.0:
                low, at_low = P, value
                at_high *= 0.5 if side == 1 else 1.0
                side = 1
            else:
                high, at_high = P, value
                at_low *= 0.5 if side == -1 else 1.0
                side = -1
        force[i] = P
        turned[i] = -_end(P, y0, length, bow, stiffness, scale, moments, curvatures, held[i])[1]


@kernel
def _curvature(M: float, stiffness: float, scale: float, moments: Array, curvatures: Array) -> float:
    """Curvature that a moment makes."""
    m = abs(M) / scale
    n = len(moments)
    if n == 2:
        return M / stiffness
    if m <= moments[1]:
        k = m
    else:
        j = min(max(int(np.searchsorted(moments, m)), 1), n - 1)
        share = (m - moments[j - 1]) / (moments[j] - moments[j - 1])
        k = curvatures[j - 1] + share * (curvatures[j] - curvatures[j - 1])
    k *= scale / stiffness
    return k if M > 0.0 else -k


@kernel
def _end(
    P: float,
    y0: float,
    length: float,
    bow: float,
    stiffness: float,
    scale: float,
    moments: Array,
    curvatures: Array,
    held: float,
) -> tuple[float, float]:
    """Distance of the pin from the line of action over that of the middle, from −1 to 1, and the slope there."""
    h = 0.5 * length / STEPS
    own = bow * (np.pi / length) ** 2
    y, turn = y0, 0.0
    sign = 1.0 if y0 > 0.0 else -1.0
    for k in range(STEPS):
        s = k * h
        a = np.sin(turn)
        b = -_curvature(P * y - held, stiffness, scale, moments, curvatures) - own * np.cos(np.pi * s / length)
        middle = own * np.cos(np.pi * (s + 0.5 * h) / length)
        y1, t1 = y + 0.5 * h * a, turn + 0.5 * h * b
        c, d = np.sin(t1), -_curvature(P * y1 - held, stiffness, scale, moments, curvatures) - middle
        y2, t2 = y + 0.5 * h * c, turn + 0.5 * h * d
        e, f = np.sin(t2), -_curvature(P * y2 - held, stiffness, scale, moments, curvatures) - middle
        y3, t3 = y + h * e, turn + h * f
        g = np.sin(t3)
        end = own * np.cos(np.pi * (s + h) / length)
        i = -_curvature(P * y3 - held, stiffness, scale, moments, curvatures) - end
        y += h / 6.0 * (a + 2.0 * c + 2.0 * e + g)
        turn += h / 6.0 * (b + 2.0 * d + 2.0 * f + i)
        # beyond a right angle, or across the line of action, the force is too large, wherever the curl ends
        if turn * sign < -0.5 * np.pi:
            return -1.0, turn
        if turn * sign > 0.5 * np.pi:
            return 1.0, turn
        if y * sign < 0.0 and k < STEPS - 1:
            return (max(y * sign / abs(y0), -1.0) if y * sign / abs(y0) < -1e-3 else -1e-3), turn
    return min(max(y * sign / abs(y0), -1.0), 1.0), turn
