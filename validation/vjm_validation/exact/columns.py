"""Critical loads of straight columns, exact for the extensible, shearable rod of Reissner.

The derivation and the exact stiffness of a piece of column are in `vjm_validation.exact.columns`. The column is
in equilibrium beside its straight state when the stiffness of its free coordinates becomes singular. The lowest
eigenvalue of that matrix falls through zero at the critical load, also where two modes coincide, and it has no pole
below as long as no piece buckles between two clamps; so each span is cut in two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import jv

# --- A straight piece of the extensible, shearable rod under axial compression: its exact bending stiffness -------
#
# Linearise the rod of `vjm_validation.exact.rod` about the straight state n = (−P, 0), ε = −P/EA. With the small
# turn θ, deflection w and transverse force V (in fixed axes), Q = V + P θ to the first order, and
#
# w' = (1 − P/EA) θ + (V + P θ)/GA = λ θ + V/GA,      λ = 1 − P/EA + P/GA,
# M' = −(1 − P/EA) Q − P Q/GA = −λ (V + P θ),         EI θ' = M,   V' = 0,
#
# since γ N = −P Q/GA. So EI θ'' + λ P θ = −λ V, whose wave number is k² = λ P/EI: *where no transverse force acts,
# every classical critical load P = EI k² becomes λ P = EI k²*, i.e. P (1 + P/GA − P/EA) = EI k². Where one acts,
# the deflection brings in a second number, μ = 1 − P/EA, the length of the compressed column over L. From
# w' = λ (θ + V/P) − μ V/P:
#
# pinned, pinned             k L = π                     V = 0
# clamped, free              k L = π/2                   V = 0
# clamped, clamped           k L = 2 π                   V = 0
# clamped, pinned            tan k L = (μ/λ) k L
# clamped, clamped, antisym. tan ½ k L = (μ/λ) ½ k L
#
# For GA → ∞, μ = λ, and the columns of the textbooks come back with P (1 − P/EA) in the place of P. The pinned one
# is Ziegler's, *Ingenieur-Archiv* 52 (1982), after Reissner (1972).
#
# With the Stumpff functions of z = k S, c₁ = sin z/z, c₂ = (1 − cos z)/z², c₃ = (z − sin z)/z³, the state at S is
#
# θ = θ₀ cos z + M₀ S c₁/EI − V₀ λ S² c₂/EI,     M = −θ₀ λ P S c₁ + M₀ cos z − V₀ λ S c₁,
# w = w₀ + λ [θ₀ S c₁ + M₀ S² c₂/EI − V₀ λ S³ c₃/EI] + V₀ S/GA,     V = V₀.

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


@dataclass(frozen=True)
class Support:
    """What holds an end of a column against bending; infinite is rigid.

    Attributes:
        lateral: against deflection, N/mm.
        rotational: against turning, N mm/rad.
    """

    lateral: float = float("inf")
    rotational: float = 0.0

    def __post_init__(self) -> None:
        if not (self.lateral >= 0.0 and self.rotational >= 0.0):
            raise ValueError(
                f"support: {self.lateral} N/mm, {self.rotational} N mm/rad: stiffness cannot be negative"
            )


PINNED = Support()
CLAMPED = Support(rotational=float("inf"))
FREE = Support(lateral=0.0)


@dataclass(frozen=True)
class LateralSpring:
    """A spring against deflection between the ends.

    Attributes:
        at: distance from the base over the length, above 0 and below 1.
        stiffness: N/mm.
    """

    at: float
    stiffness: float

    def __post_init__(self) -> None:
        if not (0.0 < self.at < 1.0 and self.stiffness >= 0.0):
            raise ValueError(
                f"spring of {self.stiffness} N/mm at {self.at}: it must be ≥ 0 and lie between the ends"
            )


def critical_load(
    column: Column, base: Support = PINNED, end: Support = PINNED, springs: Sequence[LateralSpring] = ()
) -> float:
    """Lowest critical load in N under a dead axial compression of the end.

    Special cases: both pinned π², clamped and free π²/4, clamped and pinned 2.0457 π², both clamped 4 π² times
    EI/L² for an inextensible, shear-rigid column (Euler 1744; Timoshenko and Gere 1961, chapter 2).

    Raises:
        ValueError: the supports leave a mechanism, or the column is so stubby that it shortens without buckling.
    """
    # unit length and EI keep the matrix well scaled
    unit = column.EI / column.length**2
    scaled = Column(1.0, 1.0, column.EA / unit, column.GA / unit)
    per_length, per_turn = unit / column.length, unit * column.length
    ends = [Support(s.lateral / per_length, s.rotational / per_turn) for s in (base, end)]
    inner = [LateralSpring(s.at, s.stiffness / per_length) for s in springs]

    def lowest(wave_number: float) -> float:
        K = _assembled(scaled, scaled.load(wave_number), ends, inner)
        return float(np.linalg.eigvalsh(K)[0])

    # One of the spans is at least as long as they are on average, and buckles between clamps at 2π over its length;
    # a little more, so that a column that does just that is seen to have buckled.
    highest = 2.02 * np.pi * (len(inner) + 1)
    reachable = min(highest, scaled.largest_wave_number)
    smallest = 1e-4
    if lowest(smallest) <= 0.0:
        raise ValueError(f"base {base} and end {end} leave the column a mechanism")
    if lowest(reachable) > 0.0:
        raise ValueError(f"EI/(EA L²) = {1.0 / scaled.EA:.3g}: the column shortens without buckling")
    critical_wave_number = brentq(lowest, smallest, reachable, xtol=1e-15, rtol=1e-15)
    return scaled.load(critical_wave_number) * unit


def clamped_chain(pieces: Sequence[Column | float]) -> float:
    """Lowest critical load in N of pieces of column and rigid ones in a row, clamped at both ends.

    The state (w, θ, V, M) goes from one end to the other by `transfer`, over a rigid piece of length d by
    w + d θ and M − d (V + P θ). A state without w and θ at both ends is what buckling needs.

    Args:
        pieces: columns, and lengths of rigid pieces in mm, which may be negative and lead back.

    Raises:
        ValueError: there is no column among them.
    """
    columns = [piece for piece in pieces if isinstance(piece, Column)]
    if not columns:
        raise ValueError("no piece of column: nothing buckles")

    def determinant(load: float) -> float:
        T = np.eye(4)
        for piece in pieces:
            T = (transfer(piece, load, piece.length) if isinstance(piece, Column) else _rigid(piece, load)) @ T
        return float(np.linalg.det(T[:2, 2:]))

    # the longest column carries no more than between clamps of its own
    highest = 1.001 * critical_load(max(columns, key=lambda column: column.length), CLAMPED, CLAMPED)
    loads = np.linspace(1e-6 * highest, highest, 400)
    values = np.array([determinant(load) for load in loads])
    first = int(np.argmax(values * values[0] < 0.0))
    return brentq(determinant, loads[first - 1], loads[first], xtol=1e-12 * highest, rtol=1e-14)


def partially_following(column: Column, fraction: float) -> float:
    """Critical load in N of a cantilever whose tip load turns with ``fraction`` of the tip's turn.

    V = −η P θ_L gives cos k L = η/(η − 1) with k² = λ P/EI. Above η = ½ no static critical load exists, and the
    column flutters (Dzhanelidze 1958; Bolotin, *Nonconservative Problems*, 1963; η = 1 is Beck's column).

    Args:
        column: the column.
        fraction: η, from 0, a dead load, to ½.

    Raises:
        ValueError: the fraction is out of range, or the column shortens without buckling.
    """
    if not 0.0 <= fraction <= 0.5:
        raise ValueError(f"fraction is {fraction}: a static critical load exists from 0 to ½")
    return column.load(float(np.arccos(fraction / (fraction - 1.0))) / column.length)


def _rigid(length: float, load: float) -> Matrix:
    """`transfer` of a rigid piece."""
    T = np.eye(4)
    T[0, 1] = length
    T[3, 1:3] = -length * load, -length
    return T


def _assembled(column: Column, load: float, ends: Sequence[Support], springs: Sequence[LateralSpring]) -> Matrix:
    """Stiffness of the free coordinates (w, θ at each node) of the column of unit length."""
    supported = np.unique([0.0, *(s.at for s in springs), 1.0])
    nodes = np.sort(np.concatenate([supported, 0.5 * (supported[1:] + supported[:-1])]))
    K = np.zeros((2 * len(nodes), 2 * len(nodes)))
    for i, length in enumerate(np.diff(nodes)):
        K[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += stiffness(column, load, length)
    held = np.zeros(len(K))
    for spring in springs:
        held[2 * int(np.searchsorted(nodes, spring.at))] += spring.stiffness
    held[[0, 1, -2, -1]] += [ends[0].lateral, ends[0].rotational, ends[1].lateral, ends[1].rotational]
    free = np.isfinite(held)
    return (K + np.diag(np.where(free, held, 0.0)))[np.ix_(free, free)]


def lateral_strip(length: float, EI: float, GJ: float) -> float:
    """Critical force in N across the tip of a clamped strip, in its plane of great stiffness.

    ``γ √(EI GJ)/L²`` with ``J₋¼(γ/2) = 0``, γ = 4.0126 (Prandtl 1899; Timoshenko and Gere 1961, chapter 6), for a
    strip that does not bend in its plane before it buckles.

    Args:
        length: mm.
        EI: of bending across the strip, N mm².
        GJ: of torsion without warping, N mm².

    Raises:
        ValueError: an argument is not above zero.
    """
    if not min(length, EI, GJ) > 0.0:
        raise ValueError(f"length = {length}, EI = {EI}, GJ = {GJ}: each must be above 0")
    half = float(brentq(lambda x: jv(-0.25, x), 1.5, 2.5, xtol=1e-14))
    return 2.0 * half * float(np.sqrt(EI * GJ)) / length**2
