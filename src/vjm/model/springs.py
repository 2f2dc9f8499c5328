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

from vjm.model.laws import Law
from vjm.model.parts import Section
from vjm.rotations import Array


class Spring(Protocol):
    """A law between the reactions and the coordinates of one virtual spring with k coordinates."""

    @property
    def unloaded(self) -> Array:
        """Compliance ``(k, k)`` without load, mm, N, rad."""

    @property
    def stiffness(self) -> Array:
        """Its inverse ``(k, k)``."""

    def strain(self, reaction: Array) -> Array:
        """Coordinates ``(k,)`` under reactions ``(k,)``."""

    def compliance(self, reaction: Array) -> Array:
        """Tangent compliance ``(k, k)`` under reactions ``(k,)``."""

    def tangent(self, reaction: Array) -> Array:
        """Tangent stiffness ``(k, k)`` under reactions ``(k,)``."""


@dataclass(frozen=True)
class LinearSpring:
    """``θ = k_θ τ`` (3), the paper's spring.

    Attributes:
        unloaded: compliance ``(k, k)``, mm, N, rad.
    """

    unloaded: Array

    @cached_property
    def stiffness(self) -> Array:
        """``k_θ⁻¹`` ``(k, k)``."""
        return np.asarray(np.linalg.inv(self.unloaded), dtype=float)

    def strain(self, reaction: Array) -> Array:
        """``k_θ τ``."""
        return self.unloaded @ reaction

    def compliance(self, reaction: Array) -> Array:
        """``k_θ``, whatever the load."""
        return self.unloaded

    def tangent(self, reaction: Array) -> Array:
        """``k_θ⁻¹``, whatever the load."""
        return self.stiffness


@dataclass(frozen=True)
class LawSpring:
    """The spring of one joint, with a law of its own.

    Where a law has no slope, as in a clearance, its compliance is infinite and its tangent stiffness zero.

    Attributes:
        law: moment against turn, or force against shift.
    """

    law: Law

    @cached_property
    def unloaded(self) -> Array:
        """Compliance ``(1, 1)`` without load."""
        return self.compliance(np.zeros(1))

    @cached_property
    def stiffness(self) -> Array:
        """Stiffness ``(1, 1)`` without load."""
        return self.tangent(np.zeros(1))

    def strain(self, reaction: Array) -> Array:
        """Coordinates ``(1, …)`` at which the law has the reactions."""
        return np.array([self.law.deflection(force) for force in reaction.ravel().tolist()]).reshape(reaction.shape)

    def compliance(self, reaction: Array) -> Array:
        """Tangent compliance ``(1, 1)``."""
        stiffness = float(self.tangent(reaction)[0, 0])
        return np.array([[1.0 / stiffness if stiffness > 0.0 else np.inf]])

    def tangent(self, reaction: Array) -> Array:
        """Tangent stiffness ``(1, 1)``."""
        return np.array([[float(self.law.tangent(self.strain(reaction)[0]))]])


@dataclass(frozen=True)
class BeamColumnSpring:
    """A segment of a beam, lumped at its middle so that a column buckles where the beam does.

    The segment is two rigid halves with this spring between them, its shifts counted in the axes half-way
    between the two. Under an axial force N (tension positive) the exact segment of the extensible, shearable beam
    bends like this spring does with a rotational compliance c and a transverse one d:

        1/c = EI/h (1/φ(z) + η),         φ = 1/(z + G),  G = √z cot √z
        d = h³/12EI ψ(z) λ² + h/GA,      ψ = 3 (1 − G)/(z G)

    with ``λ = 1 + N/EA − N/GA``, ``z = −N λ h²/4EI`` and ``η = N² h²/4EI (1/EA − 1/GA)``. Both factors have poles,
    far out (from 0.6 n² times Euler's load). So ``√(1 + a z² + b z³ + c z⁴) + e z`` stands for φ, and for ψ in
    compression: the same to order z⁴, and positive for all loads. In tension ψ has no pole and is used as it is;
    there a root would bring back a bifurcation in tension. The complementary energy

        Ψ = h N²/2EA + h T²/2GJ + Σ ½ c(N) M² + ½ d(N) Q²

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

    @cached_property
    def stiffness(self) -> Array:
        """Stiffness ``(6, 6)`` without load."""
        return np.asarray(np.linalg.inv(self.unloaded), dtype=float)

    def strain(self, reaction: Array) -> Array:
        """Coordinates ``(6,)``: shifts along x, y, z and turns about x, y, z."""
        N, Qy, Qz, T, My, Mz = reaction
        s, h = self.section, self.length
        cz, cz1, _, dy, dy1, _ = self._plane(N, s.EIz, s.GAy)
        cy, cy1, _, dz, dz1, _ = self._plane(N, s.EIy, s.GAz)
        bow = 0.5 * (cz1 * Mz**2 + dy1 * Qy**2 + cy1 * My**2 + dz1 * Qz**2)
        return np.array([h * N / s.EA + bow, dy * Qy, dz * Qz, h * T / s.GJ, cy * My, cz * Mz])

    def compliance(self, reaction: Array) -> Array:
        """Tangent compliance ``(…, 6, 6)`` under reactions ``(…, 6)``; symmetric, as the law is conservative."""
        N, Qy, Qz, _, My, Mz = np.moveaxis(reaction, -1, 0)
        s, h = self.section, self.length
        cz, cz1, cz2, dy, dy1, dy2 = self._plane(N, s.EIz, s.GAy)
        cy, cy1, cy2, dz, dz1, dz2 = self._plane(N, s.EIy, s.GAz)
        k = np.zeros((*reaction.shape, 6))
        bowed = 0.5 * (cz2 * Mz**2 + dy2 * Qy**2 + cy2 * My**2 + dz2 * Qz**2)
        for i, own in enumerate((h / s.EA + bowed, dy, dz, h / s.GJ, cy, cz)):
            k[..., i, i] = own
        for i, with_axial in ((1, dy1 * Qy), (2, dz1 * Qz), (4, cy1 * My), (5, cz1 * Mz)):
            k[..., 0, i] = k[..., i, 0] = with_axial
        return k

    def tangent(self, reaction: Array) -> Array:
        """Tangent stiffness ``(…, 6, 6)`` under reactions ``(…, 6)``."""
        return np.asarray(np.linalg.inv(self.compliance(reaction)), dtype=float)

    def _plane(self, N: Array, EI: float, GA: float) -> Array:
        """Rotational and transverse compliance ``(6, …)`` of one plane, each with two derivatives by N ``(…)``."""
        # imported when it is asked for: compiled code takes longer to load than a model file
        from vjm.kernels.beam_column import planes

        N, result, h = np.asarray(N, dtype=float), np.empty((np.size(N), 6)), float(self.length)
        planes(N.ravel(), float(self.section.EA), float(EI), h, h / GA, result)
        return result.T.reshape(6, *N.shape)
