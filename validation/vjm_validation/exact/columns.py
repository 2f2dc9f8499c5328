"""Critical loads of straight columns, exact for the extensible, shearable rod of Reissner.

The derivation and the exact stiffness of a piece of column are in `vjm_validation.exact.beam_column`. The column is
in equilibrium beside its straight state when the stiffness of its free coordinates becomes singular. The lowest
eigenvalue of that matrix falls through zero at the critical load, also where two modes coincide, and it has no pole
below as long as no piece buckles between two clamps; so each span is cut in two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import jv

from vjm_validation.exact.beam_column import Column, Matrix, stiffness, transfer


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
GUIDED = Support(lateral=0.0, rotational=float("inf"))
"""May shift sideways, may not turn."""


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


def equal_springs(count: int, stiffness: float) -> tuple[LateralSpring, ...]:
    """``count`` springs of ``stiffness`` N/mm that divide the column into equal spans."""
    return tuple(LateralSpring(i / (count + 1), stiffness) for i in range(1, count + 1))


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
    found = brentq(lowest, smallest, reachable, xtol=1e-15, rtol=1e-15)
    return scaled.load(found) * unit


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


def critical_shortening(
    column: Column, base: Support = PINNED, end: Support = PINNED, springs: Sequence[LateralSpring] = ()
) -> float:
    """Axial displacement of the end in mm, P L/EA, at which the straight column buckles when it is imposed.

    Up to there the column is straight, and an imposed displacement and a dead force have the same critical state.

    Raises:
        ValueError: as `critical_load`.
    """
    return critical_load(column, base, end, springs) * column.length / column.EA


def on_winkler_foundation(column: Column, foundation: float) -> float:
    """Critical load in N of a pinned column on a continuous elastic foundation.

    With V' = κ w the mode sin(n π S/L) takes λ (P − λ κ/(q² + κ/GA)) = EI q², q = n π/L, and the lowest of all n
    counts. For a rigid section P = EI q² + κ/q² (Timoshenko and Gere 1961, section 2.10).

    Args:
        column: the column.
        foundation: κ, N/mm², force per undeformed length and deflection, ≥ 0.

    Raises:
        ValueError: the foundation is negative, or no mode buckles.
    """
    if foundation < 0.0:
        raise ValueError(f"foundation is {foundation} N/mm²: it cannot be negative")
    lowest, n = float("inf"), 1
    # λ P is at least EI q²: once a mode without the foundation needs more than the lowest so far, so do the rest
    while (q := n * np.pi / column.length) <= column.largest_wave_number and column.load(q) < lowest:
        lowest = min(lowest, _winkler_load(column, foundation, q))
        n += 1
    if not np.isfinite(lowest):
        raise ValueError("no mode on the foundation buckles: the column shortens only")
    return lowest


def under_own_weight(column: Column) -> float:
    """Critical total weight q L in N of a cantilever that stands upright, inextensible and shear-rigid.

    The first root of J₋₁/₃((2/3) √(q L³/EI)): 7.837347 EI/L² (Greenhill 1881; Timoshenko and Gere 1961, section
    2.12).

    Raises:
        ValueError: EA or GA is finite; that is another equation.
    """
    if np.isfinite(column.EA) or np.isfinite(column.GA):
        raise ValueError("under its own weight the column must have infinite EA and GA")
    root = brentq(lambda x: float(jv(-1.0 / 3.0, x)), 1.0, 2.5, xtol=1e-15, rtol=1e-15)
    return 2.25 * root**2 * column.EI / column.length**2


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


def _winkler_load(column: Column, foundation: float, wave_number: float) -> float:
    """Lowest load of one mode, N; infinite where it has none."""
    reach = foundation / (wave_number**2 + foundation / column.GA)
    softness = 1.0 / column.GA - 1.0 / column.EA
    # a P² + b P + c = 0; its lowest positive root in the form that does not cancel
    a = softness * (1.0 - softness * reach)
    b = 1.0 - 2.0 * softness * reach
    c = -(column.EI * wave_number**2 + reach)
    radicand = b**2 - 4.0 * a * c
    if radicand < 0.0:
        return float("inf")
    return float(-2.0 * c / (b + np.sqrt(radicand)))


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
