"""How visible a change of the readings is: the strength of docs/measured-data.md.

    strength² = min over ν of (Δ − Gν)ᵀ Σ⁻¹ (Δ − Gν) + νᵀ P⁻¹ ν = Δᵀ (Σ + G P Gᵀ)⁻¹ Δ

The displacement is imposed and read with noise; nobody knows it better than its gauge. So what a gauge's error e
does to the force at a reading, −K e, is part of Σ and of G, and a change of the displacement's reading counts as
one of the force. With the displacement known but for zero and scale, strengths would be a tenth to a fifth larger.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from hidden_effects.rig import Rig
from hidden_effects.truth_models import as_drawn
from hidden_effects.virtual_rig import Design, RigResponse
from vjm.rotations import Array

PROBE = 1e-3
"""mm by which the displacement is shifted for the stiffness at every reading."""


@dataclass(frozen=True)
class Visibility:
    """The metric of a design's readings.

    Attributes:
        design: of the test.
        nominal: its noise-free readings as drawn.
        stiffness: derivative of the forces by ux at every reading ``(n, c)``.
        factor: lower Cholesky factor ``(n c, n c)`` of Σ + G P Gᵀ.
        nuisances: sensitivities G ``(n c, k)``, and their sigmas ``(k,)``.
    """

    design: Design
    nominal: RigResponse
    stiffness: Array
    factor: Array
    nuisances: tuple[Array, Array]

    @property
    def largest(self) -> float:
        """The largest force as drawn, N."""
        return float(np.abs(self.nominal.forces[:, 0]).max())

    def flat(self, change: RigResponse) -> Array:
        """A change of the readings as one of the forces alone ``(n c,)``."""
        result: Array = (change.forces - self.stiffness * change.ux[:, None]).ravel()
        return result

    def whitened(self, change: RigResponse) -> Array:
        """``(n c,)`` whose length is the strength."""
        return self.whitened_flat(self.flat(change))

    def whitened_flat(self, flat: Array) -> Array:
        """The same of a change of the forces alone ``(n c,)``."""
        result: Array = solve_triangular(self.factor, flat, lower=True, check_finite=False)
        return result

    def strength(self, change: RigResponse) -> float:
        """Of a change of the readings."""
        return float(np.linalg.norm(self.whitened(change)))


def visibility(design: Design) -> Visibility:
    """The metric at the machine as drawn."""
    rig = as_drawn(design)
    nominal = rig.response(design)
    shifted = replace(rig, screw=lambda u: np.full_like(u, PROBE))
    stiffness = (shifted.response(design).forces - nominal.forces) / PROBE
    G, sigma = _nuisances(design, rig, nominal, stiffness)
    c = len(design.channels)
    white = np.array([design.instruments[name].noise for name in design.channels])
    step = design.quantum * white
    gauge = design.instruments["ux_mm"].noise
    S = (G * sigma**2) @ G.T
    first = 0
    for sequence in design.sequences:
        m = len(sequence)
        lag = np.abs(np.subtract.outer(np.arange(m), np.arange(m)))
        autocorrelation = design.autocorrelation**lag if design.autocorrelation > 0.0 else np.eye(m)
        k = stiffness[first : first + m].ravel()
        at = slice(first * c, (first + m) * c)
        S[at, at] += np.kron(autocorrelation, np.diag(white**2)) + np.kron(np.eye(m), np.diag(step**2 / 12.0))
        # the gauge's noise reaches all channels at once
        S[at, at] += np.kron(autocorrelation * gauge**2, np.ones((c, c))) * np.outer(k, k)
        first += m
    return Visibility(design, nominal, stiffness, np.asarray(np.linalg.cholesky(S), dtype=float), (G, sigma))


def _nuisances(design: Design, rig: Rig, nominal: RigResponse, stiffness: Array) -> tuple[Array, Array]:
    """Sensitivities ``(n c, k)`` of the readings as forces, and sigmas ``(k,)``."""
    columns, sigmas = [], []
    c = len(design.channels)
    for i, name in enumerate(design.channels):
        one = np.zeros((len(nominal.ux), c))
        one[:, i] = 1.0
        columns += [one, one * nominal.forces]
        sigmas += [design.instruments[name].zero, design.instruments[name].scale]
    gauge = design.instruments["ux_mm"]
    columns += [-stiffness, -stiffness * nominal.ux[:, None]]
    sigmas += [gauge.zero, gauge.scale]
    for machine, sigma in (
        (replace(rig.machine, link_longer=design.length), design.length),
        (replace(rig.machine, foot_factor=1.0 / (1.0 + design.modulus)), design.modulus),
        (replace(rig.machine, link_factor=1.0 / (1.0 + design.modulus)), design.modulus),
    ):
        other = replace(rig, machine=machine).response(design)
        columns.append((other.forces - nominal.forces) / sigma)
        sigmas.append(sigma)
    return np.array([column.ravel() for column in columns]).T, np.array(sigmas)
