"""A straight piece of the extensible, shearable rod under axial compression: its exact bending stiffness.

Linearise the rod of `vjm_validation.exact.rod` about the straight state n = (−P, 0), ε = −P/EA. With the small
turn θ, deflection w and transverse force V (in fixed axes), Q = V + P θ to the first order, and

    w' = (1 − P/EA) θ + (V + P θ)/GA = λ θ + V/GA,      λ = 1 − P/EA + P/GA,
    M' = −(1 − P/EA) Q − P Q/GA = −λ (V + P θ),         EI θ' = M,   V' = 0,

since γ N = −P Q/GA. So EI θ'' + λ P θ = −λ V, whose wave number is k² = λ P/EI: *where no transverse force acts,
every classical critical load P = EI k² becomes λ P = EI k²*, i.e. P (1 + P/GA − P/EA) = EI k². Where one acts, the
deflection brings in a second number, μ = 1 − P/EA, the length of the compressed column over L. From
w' = λ (θ + V/P) − μ V/P:

    pinned, pinned             k L = π                     V = 0
    clamped, free              k L = π/2                   V = 0
    clamped, clamped           k L = 2 π                   V = 0
    clamped, pinned            tan k L = (μ/λ) k L
    clamped, clamped, antisym. tan ½ k L = (μ/λ) ½ k L

For GA → ∞, μ = λ, and the columns of the textbooks come back with P (1 − P/EA) in the place of P. The pinned one is
Ziegler's, *Ingenieur-Archiv* 52 (1982), after Reissner (1972).

With the Stumpff functions of z = k S, c₁ = sin z/z, c₂ = (1 − cos z)/z², c₃ = (z − sin z)/z³, the state at S is

    θ = θ₀ cos z + M₀ S c₁/EI − V₀ λ S² c₂/EI,     M = −θ₀ λ P S c₁ + M₀ cos z − V₀ λ S c₁,
    w = w₀ + λ [θ₀ S c₁ + M₀ S² c₂/EI − V₀ λ S³ c₃/EI] + V₀ S/GA,     V = V₀.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Column:
    """A straight prismatic column, in any consistent units.

    Attributes:
        length: undeformed, mm.
        EI: bending stiffness, N mm².
        EA: axial stiffness, N.
        GA: shear stiffness, N.
    """

    length: float
    EI: float
    EA: float = float("inf")
    GA: float = float("inf")

    def __post_init__(self) -> None:
        for name in ("length", "EI", "EA", "GA"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"column: {name} is {getattr(self, name)}: it must be above 0")

    @property
    def largest_wave_number(self) -> float:
        """k, 1/mm, at which the straight column ceases to resist a growing compression by bending.

        λ P has its maximum there; infinite where shear is the softer.
        """
        softening = 1.0 / self.EA - 1.0 / self.GA
        return float(np.sqrt(0.25 / (softening * self.EI))) if softening > 0.0 else float("inf")

    def load(self, wave_number: float) -> float:
        """P in N with P (1 + P/GA − P/EA) = EI k²: the root that tends to EI k² for a rigid section.

        Args:
            wave_number: k, 1/mm.

        Raises:
            ValueError: no load has that wave number: the column shortens without buckling.
        """
        if wave_number > self.largest_wave_number:
            raise ValueError(f"wave number {wave_number:.6g} is beyond {self.largest_wave_number:.6g}: too stubby")
        rigid = self.EI * wave_number**2
        radicand = 1.0 + 4.0 * (1.0 / self.GA - 1.0 / self.EA) * rigid
        return float(2.0 * rigid / (1.0 + np.sqrt(max(radicand, 0.0))))


def transfer(column: Column, load: float, length: float) -> Matrix:
    """Matrix ``(4, 4)`` from (w, θ, V, M) at one section to the same at another, ``length`` mm further on.

    Args:
        column: whose EI, EA and GA count.
        load: the compression P, N, ≥ 0.
        length: undeformed distance, mm.
    """
    stretch = 1.0 + load * (1.0 / column.GA - 1.0 / column.EA)
    S = length
    z = np.sqrt(stretch * load / column.EI) * S
    c1, c2, c3 = np.sinc(z / np.pi), 0.5 * np.sinc(0.5 * z / np.pi) ** 2, _stumpff3(z)
    bend = S / column.EI
    T = np.eye(4)
    T[0, 1:] = stretch * S * c1, S / column.GA - stretch**2 * bend * S**2 * c3, stretch * bend * S * c2
    T[1, 1:] = np.cos(z), -stretch * bend * S * c2, bend * c1
    T[3, 1:] = -stretch * load * S * c1, -stretch * S * c1, np.cos(z)
    return T


def stiffness(column: Column, load: float, length: float) -> Matrix:
    """Exact stiffness ``(4, 4)`` of a piece against (w, θ) at its two ends, in N, mm, rad.

    Symmetric; finite as long as the piece does not buckle between two clamps.

    Args:
        column: whose EI, EA and GA count.
        load: the compression P, N, ≥ 0.
        length: of the piece, undeformed, mm.
    """
    T = transfer(column, load, length)
    flexibility = np.linalg.inv(T[:2, 2:])
    near = flexibility @ T[:2, :2]
    # the internal force acts on the piece at its far end, and its opposite at the near one
    return np.block([[near, -flexibility], [T[2:, :2] - T[2:, 2:] @ near, T[2:, 2:] @ flexibility]])


def _stumpff3(z: float) -> float:
    if z > 1.0:
        return float((z - np.sin(z)) / z**3)
    # the closed form cancels here; the series' tenth term is below the last digit
    return float(sum((-(z**2)) ** j / factorial(2 * j + 3) for j in range(10)))
