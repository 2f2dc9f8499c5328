"""Laws of the virtual springs, each by its complementary energy.

A spring's law is its complementary energy Ψ(τ) as a function of the reactions τ: its coordinates are
``θ = ∂Ψ/∂τ``, its tangent compliance is ``∂²Ψ/∂τ²``. In this form an equilibrium needs no iteration inside a
spring, because the wrench on the end-effector and the Jacobian give the reactions, ``τ = J_θᵀ F`` (9).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from vjm.parts import Section
from vjm.rotations import Array

# Coefficients (a, b, c, e) from the Taylor series of φ and ψ about z = 0, with 1 + e z + f₂ z² + f₃ z³ + f₄ z⁴:
# a = 2 f₂, b = 2 f₃, c = 2 f₄ + a²/4. √z cot √z = 1 − z/3 − z²/45 − 2z³/945 − z⁴/4725 − 2z⁵/93555.
ROTATION = (14 / 15, -68 / 105, 9467 / 14175, -2 / 3)
SHIFT = (34 / 105, 124 / 945, 5777 / 72765, 2 / 5)


class Spring(Protocol):
    """A law between the reactions and the coordinates of one virtual spring with k coordinates."""

    @property
    def unloaded(self) -> Array:
        """Compliance ``(k, k)`` without load, mm, N, rad."""

    def strain(self, reaction: Array) -> Array:
        """Coordinates ``(k,)`` under reactions ``(k,)``."""

    def compliance(self, reaction: Array) -> Array:
        """Tangent compliance ``(k, k)`` under reactions ``(k,)``."""


@dataclass(frozen=True)
class LinearSpring:
    """``θ = k_θ τ`` (3), the paper's spring.

    Attributes:
        unloaded: compliance ``(k, k)``, mm, N, rad.
    """

    unloaded: Array

    def strain(self, reaction: Array) -> Array:
        """``k_θ τ``."""
        return self.unloaded @ reaction

    def compliance(self, reaction: Array) -> Array:
        """``k_θ``, whatever the load."""
        return self.unloaded


@dataclass(frozen=True)
class BeamColumnSpring:
    """A segment of a beam, lumped at its middle so that a column buckles where the beam does.

    The segment is two rigid halves with this spring between them, its shifts counted in the axes half-way
    between the two. Under an axial force N (tension positive) the exact segment of the extensible beam bends
    like this spring does with a rotational and a transverse compliance that depend on N through
    ``z = −N (1 + N/EA) h²/4EI``:

        c = h/EI φ(z) (1 + z N/EA),      φ = 1/(z + G),  G = √z cot √z
        d = h³/12EI ψ(z) (1 + N/EA)²,    ψ = 3 (1 − G)/(z G)

    Both have poles, far out (at n² times Euler's load and beyond). Here ``√(1 + a z² + b z³ + c z⁴) + e z`` stands
    for each: the same to order z⁴, and positive for all loads. The complementary energy

        Ψ = h N²/2EA + h T²/2GJ + Σ ½ c(N) M² + ½ (d(N) + h/GA) Q²

    over both planes makes the law conservative: its derivative by N is the shortening of the bowed segment.
    The derivation is in ``docs/virtual-springs.md``.

    Attributes:
        section: of the beam.
        length: h of the segment, mm.
    """

    section: Section
    length: float

    @cached_property
    def unloaded(self) -> Array:
        """Compliance ``(6, 6)`` without load: that of the segment at its middle."""
        return self.section.compliance_at_middle(self.length)

    def strain(self, reaction: Array) -> Array:
        """Coordinates ``(6,)``: shifts along x, y, z and turns about x, y, z."""
        N, Qy, Qz, T, My, Mz = reaction
        s, h = self.section, self.length
        (cz, cz1, _), (dy, dy1, _) = self._plane(N, s.EIz, s.GAy)
        (cy, cy1, _), (dz, dz1, _) = self._plane(N, s.EIy, s.GAz)
        bow = 0.5 * (cz1 * Mz**2 + dy1 * Qy**2 + cy1 * My**2 + dz1 * Qz**2)
        return np.array([h * N / s.EA + bow, dy * Qy, dz * Qz, h * T / s.GJ, cy * My, cz * Mz])

    def compliance(self, reaction: Array) -> Array:
        """Tangent compliance ``(6, 6)``; symmetric, as the law is conservative."""
        N, Qy, Qz, _, My, Mz = reaction
        s, h = self.section, self.length
        (cz, cz1, cz2), (dy, dy1, dy2) = self._plane(N, s.EIz, s.GAy)
        (cy, cy1, cy2), (dz, dz1, dz2) = self._plane(N, s.EIy, s.GAz)
        k = np.diag([h / s.EA, dy, dz, h / s.GJ, cy, cz])
        k[0, 0] += 0.5 * (cz2 * Mz**2 + dy2 * Qy**2 + cy2 * My**2 + dz2 * Qz**2)
        k[0, 1] = k[1, 0] = dy1 * Qy
        k[0, 2] = k[2, 0] = dz1 * Qz
        k[0, 4] = k[4, 0] = cy1 * My
        k[0, 5] = k[5, 0] = cz1 * Mz
        return k

    def _plane(self, N: float, EI: float, GA: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Rotational and transverse compliance of one plane, each with its two derivatives by N."""
        h, EA = self.length, self.section.EA
        kappa = h**2 / (4.0 * EI)
        stretch = 1.0 + N / EA
        z, z1, z2 = -kappa * N * stretch, -kappa * (1.0 + 2.0 * N / EA), -2.0 * kappa / EA
        q, q1, q2 = 1.0 + z * N / EA, (z1 * N + z) / EA, (z2 * N + 2.0 * z1) / EA
        f, g = _bounded(z, z1, z2, ROTATION), _bounded(z, z1, z2, SHIFT)
        p, p1, p2 = stretch**2, 2.0 * stretch / EA, 2.0 / EA**2
        c0, d0 = h / EI, h**3 / (12.0 * EI)
        c = (c0 * f[0] * q, c0 * (f[1] * q + f[0] * q1), c0 * (f[2] * q + 2.0 * f[1] * q1 + f[0] * q2))
        d = (d0 * g[0] * p, d0 * (g[1] * p + g[0] * p1), d0 * (g[2] * p + 2.0 * g[1] * p1 + g[0] * p2))
        return c, (d[0] + h / GA, d[1], d[2])


def _bounded(z: float, z1: float, z2: float, form: tuple[float, ...]) -> tuple[float, float, float]:
    """``√(1 + a z² + b z³ + c z⁴) + e z`` and its derivatives by a variable by which z has z1 and z2."""
    a, b, c, e = form
    root = np.sqrt(1.0 + z * z * (a + z * (b + z * c)))
    half = 0.5 * z * (2.0 * a + z * (3.0 * b + 4.0 * c * z)) / root
    curvature = (a + z * (3.0 * b + 6.0 * c * z) - half * half) / root
    slope = half + e
    return root + e * z, slope * z1, curvature * z1 * z1 + slope * z2
