"""Columns behind their first critical load: pinned, clamped and free, clamped at both ends.

By symmetry each is made of quarter waves: a clamped, free column is one, a pinned one two, and one that is clamped
at both ends four. A quarter wave of unit length under the dead compression P has N = −P cos θ, Q = P sin θ. Hence,
by `vjm_validation.exact.rod`,

    θ'' = −P (sin θ + c sin θ cos θ),   c = P (shear − axial),

    ½ θ'² = P (cos θ − cos α) [1 + ½ c (cos θ + cos α)],

where α is the turn at the inflection. sin(θ/2) = k sin φ with k = sin(α/2) takes the singularity out of dS = dθ/θ':

    dS = dφ / √(P (1 − k² sin² φ) (1 + ½ c (cos θ + cos α))),   0 ≤ φ ≤ π/2,

a smooth integrand, for which Gauss and Legendre's rule converges geometrically. With c = 0 the integrals are
elliptic: P = K², shortening 2 (1 − E/K), amplitude 2k/K (Euler 1744; Timoshenko and Gere, *Theory of Elastic
Stability*, 2nd ed. 1961, section 2.7).

Lengths are over the column's L, forces times L²/EI, ``axial`` = EI/(EA L²), ``shear`` = EI/(GA L²).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ellipk

STEEPEST = 0.95 * np.pi
"""Largest turn α in rad: 200 Gauss points give 1e-14 up to here."""

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(200)
_PHI = 0.25 * np.pi * (_POINTS + 1.0)


class Ends(StrEnum):
    """How a column is held."""

    CLAMPED_FREE = "clamped-free"
    PINNED = "pinned-pinned"
    CLAMPED = "clamped-clamped"

    @property
    def quarter_waves(self) -> int:
        """Into how many quarter waves the first mode divides the column."""
        return {"clamped-free": 1, "pinned-pinned": 2, "clamped-clamped": 4}[self.value]

    @property
    def amplitudes(self) -> int:
        """Greatest deflection in amplitudes of a quarter wave: at the free end, or at mid-span."""
        return 2 if self is Ends.CLAMPED else 1


@dataclass(frozen=True)
class Buckled:
    """A buckled column.

    Attributes:
        force: P L²/EI, compression positive.
        shortening: approach of the ends over L, along the undeformed axis.
        deflection: the greatest, over L: of the free end, else at mid-span.
        angle: turn of the section at the inflection, rad.
    """

    force: float
    shortening: float
    deflection: float
    angle: float


def at_angle(angle: float, ends: Ends = Ends.PINNED, axial: float = 0.0, shear: float = 0.0) -> Buckled:
    """The extensible, shearable column whose inflection is turned by ``angle``.

    Args:
        angle: rad, from 0, where the force is the critical load, to `STEEPEST`.
        ends: how the column is held.
        axial: EI/(EA L²), ≥ 0.
        shear: EI/(GA L²), ≥ 0.

    Raises:
        ValueError: an argument is out of range, or the column is so soft along its axis or in shear that it has no
            such shape.
    """
    _check(angle)
    if axial < 0.0 or shear < 0.0:
        raise ValueError(f"axial = {axial} and shear = {shear}: a flexibility cannot be negative")
    # a quarter wave is shorter than the column, and its flexibilities are over its own length squared
    a, b = axial * ends.quarter_waves**2, shear * ends.quarter_waves**2
    k = np.sin(0.5 * angle)
    P = _force(angle, a - b)
    cos = 1.0 - 2.0 * (k * np.sin(_PHI)) ** 2
    ds = _arc_lengths(angle, P, a - b)
    projected = float(ds @ (cos - a * P * cos**2 - b * P * (1.0 - cos**2)))
    # the moment at the root is P times the amplitude
    moment = np.sqrt(2.0 * P * 2.0 * k**2 * (1.0 - 0.5 * (a - b) * P * (1.0 + np.cos(angle))))
    return _scaled(ends, P, 1.0 - projected, float(moment) / P, angle)


def at_shortening(shortening: float, ends: Ends = Ends.PINNED, axial: float = 0.0, shear: float = 0.0) -> Buckled:
    """The column whose ends have approached by ``shortening``: straight up to the critical load, then buckled.

    Args:
        shortening: over L, above 0.
        ends: how the column is held.
        axial: EI/(EA L²), ≥ 0.
        shear: EI/(GA L²), ≥ 0.

    Raises:
        ValueError: an argument is out of range, or the column is so soft along its axis or in shear that it has no
            such shape.
    """
    if not shortening > 0.0:
        raise ValueError(f"shortening is {shortening} of the length: it must be above 0")
    if shortening <= at_angle(0.0, ends, axial, shear).shortening:
        return Buckled(shortening / axial, shortening, 0.0, 0.0)

    def missing(angle: float) -> float:
        return at_angle(angle, ends, axial, shear).shortening - shortening

    # in steps, because a column that is soft in shear has no buckled shape at the largest turns
    for steepest in np.linspace(0.0, STEEPEST, 20)[1:]:
        if missing(steepest) >= 0.0:
            return at_angle(brentq(missing, 0.0, steepest, xtol=1e-15, rtol=1e-15), ends, axial, shear)
    raise ValueError(f"shortening is {shortening} of the length: the column is wound up before")


def _check(angle: float) -> None:
    if not 0.0 <= angle <= STEEPEST:
        raise ValueError(f"angle is {angle} rad: it must be from 0 to {STEEPEST:.4f}")


def _arc_lengths(angle: float, force: float, softening: float) -> NDArray[np.float64]:
    """Undeformed lengths ``(200,)`` that belong to the Gauss points; they add up to one in equilibrium."""
    s = (np.sin(0.5 * angle) * np.sin(_PHI)) ** 2
    bracket = 1.0 - 0.5 * softening * force * (1.0 - 2.0 * s + np.cos(angle))
    lengths: NDArray[np.float64] = 0.25 * np.pi * _WEIGHTS / np.sqrt(force * (1.0 - s) * bracket)
    return lengths


def _force(angle: float, softening: float) -> float:
    """Force of a quarter wave of unit length; ``softening`` is axial minus shear, over its length squared."""
    rigid = float(ellipk(np.sin(0.5 * angle) ** 2) ** 2)
    if softening == 0.0:
        return rigid

    def excess(force: float) -> float:
        return float(_arc_lengths(angle, force, softening).sum()) - 1.0

    # The bracket in dS is at most 1 + |softening| P, which bounds the force from below. Up to ``highest`` the
    # length falls with the force for every θ; beyond it a column may get longer again, which is no first buckling.
    lowest = rigid / (1.0 + abs(softening) * rigid)
    worst = 1.0 + np.cos(angle) if softening > 0.0 else max(-2.0 * np.cos(angle), 0.0)
    highest = 2.0 * rigid if worst == 0.0 else min(2.0 * rigid, 1.0 / (abs(softening) * worst))
    if highest <= lowest or excess(highest) > 0.0:
        raise ValueError(f"EI/EA − EI/GA is {softening:.3g} of a quarter wave's length squared: no buckled shape")
    return brentq(excess, lowest, highest, xtol=1e-15, rtol=1e-15)


def _scaled(ends: Ends, force: float, shortening: float, amplitude: float, angle: float) -> Buckled:
    waves = ends.quarter_waves
    deflection = ends.amplitudes * amplitude / waves
    return Buckled(float(force) * waves**2, float(shortening), float(deflection), float(angle))
