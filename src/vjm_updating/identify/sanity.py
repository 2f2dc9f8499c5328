"""A raw matrix made a target to fit: symmetric within its rounding, definite, in plausible units; its misprint."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.io.checks import checked_compliance
from vjm.rotations import Array
from vjm_updating.constants import definition, numerical, physical_bound
from vjm_updating.identify.candidates import UPPER, Form, Target
from vjm_updating.identify.fitting import distinct, nearest, search
from vjm_updating.identify.matrix_file import MatrixFileError, RawMatrix

# --- A raw matrix made a target to fit: symmetric within its rounding, in plausible units, definite ---------------

CANTILEVER = definition(0.75)
"""|C_uφ|² / (|C_uu| |C_φφ|) of a cantilever: (L²/2EI)² over L³/3EI · L/EI. Above 1 no matrix is definite."""
APART = physical_bound(30.0)
"""Factor on it from which blocks have different units: half-way, in powers, to the 1000 of m for mm."""
COMPACT_MM = physical_bound(10.0, "mm")
"""Size below which turns in rad/(N m) are suspected: theirs is 32 times too small."""
SHORTEST_MM, LONGEST_MM = physical_bound(1.0, "mm"), physical_bound(2e4, "mm")
"""Of √(|C_uu|/|C_φφ|), a cantilever's length over √3: less or more is no robot's part in mm."""


def asymmetric_pairs(raw: RawMatrix) -> list[tuple[int, int]]:
    """Pairs ``i < j`` whose mirrored entries stand for intervals that do not meet, the most different first."""
    gap = np.abs(raw.values - raw.values.T) - raw.half - raw.half.T
    scale = np.sqrt(np.outer(np.abs(np.diag(raw.values)), np.abs(np.diag(raw.values))))
    # numbers that round to the interval's very end are still met
    pairs = [(i, j) for i in range(6) for j in range(i + 1, 6) if gap[i, j] > 1e-9 * scale[i, j]]
    return sorted(pairs, key=lambda p: -abs(gap[p]) / scale[p])


def mirrored(raw: RawMatrix, pair: tuple[int, int], keep: tuple[int, int]) -> RawMatrix:
    """The matrix with both entries of a pair as the one at ``keep``."""
    values, half = raw.values.copy(), raw.half.copy()
    for i, j in (pair, pair[::-1]):
        values[i, j], half[i, j] = raw.values[keep], raw.half[keep]
    return replace(raw, values=values, half=half)


def target(raw: RawMatrix, left_out: list[tuple[int, int]] | None = None) -> Target:
    """The compliance to fit, each pair where its two intervals meet.

    Args:
        raw: a matrix without asymmetric pairs but for those left out.
        left_out: pairs that shall not count.

    Raises:
        MatrixFileError: units that do not fit together, or an indefinite matrix.
    """
    low = np.maximum(raw.values - raw.half, (raw.values - raw.half).T)
    high = np.minimum(raw.values + raw.half, (raw.values + raw.half).T)
    M, half = 0.5 * (low + high), 0.5 * (high - low)
    for i, j in left_out or []:
        half[i, j] = half[j, i] = np.inf
        M[i, j] = M[j, i] = 0.5 * (raw.values[i, j] + raw.values[j, i])
    _check_diagonal(raw, M)
    if raw.kind == "stiffness":
        half = np.where(np.isfinite(half), half, np.abs(M))
        # units and definiteness are the same question for the inverse
        _check_definite(raw, M, half)
        inverse = np.linalg.inv(M)
        M, half = 0.5 * (inverse + inverse.T), np.abs(inverse) @ half @ np.abs(inverse)
    _check_units(raw, M)
    _check_definite(raw, M, half)
    return Target(M, half)


def _check_diagonal(raw: RawMatrix, M: Array) -> None:
    for k in range(6):
        if M[k, k] <= 0.0:
            raise MatrixFileError(
                f"{raw.file}: line {raw.lines[k][k]}: ({k + 1},{k + 1}) = {raw.texts[k][k]}: a {raw.kind} has "
                "positive diagonal entries, as a load moves its point its own way. Check the sign, or give the "
                "load case in which this freedom moves"
            )


def _check_units(raw: RawMatrix, C: Array) -> None:
    shift, both, turn = (float(np.linalg.norm(B, 2)) for B in (C[:3, :3], C[:3, 3:], C[3:, 3:]))
    where = f"{raw.file}: line {raw.lines[0][0]}:"
    coupling = both**2 / (shift * turn)
    if coupling > APART:
        factor = 10.0 ** (3 * max(1, round(np.log10(coupling / CANTILEVER) / 3)))
        raise MatrixFileError(
            f"{where} shifts by forces (rows and columns 1 to 3) are some {factor:.0f} times smaller than the "
            "couplings and turns ask for: are they in m/N and the rest in mm? Give all in one system, such as "
            "mm/N, 1/N and rad/(N mm)"
        )
    size = float(np.sqrt(shift / turn))
    # a compact hinge read near its elastic centre looks alike: it is let through where the file states its units
    alike = 0.1 < CANTILEVER / coupling / 1e3 < 10.0 and size < COMPACT_MM if coupling > 0.0 else False
    if alike and not raw.units_stated:
        raise MatrixFileError(
            f"{where} turns by moments (rows and columns 4 to 6) are some 1000 times larger than the rest asks "
            "for: are they in rad/(N m) and the rest in mm? Give all in mm/N, 1/N and rad/(N mm); if they are, "
            "write 'units = N mm rad' above them"
        )
    if size < SHORTEST_MM:
        raise MatrixFileError(
            f"{where} shifts over turns make a length of {size:.2g} mm, no machine part's: is the matrix in m? "
            "Write 'units = N m rad' above it"
        )
    if size > LONGEST_MM:
        raise MatrixFileError(
            f"{where} shifts over turns make a length of {size:.2g} mm, no machine part's: is the matrix in mm? "
            "Write 'units = N mm rad' above it"
        )


def _check_definite(raw: RawMatrix, M: Array, half: Array) -> None:
    """Refuse what no rounding makes definite: for the worst vector v, vᵀ M v stays negative on the whole box."""
    scale = np.sqrt(np.outer(np.diag(M), np.diag(M)))
    values, vectors = np.linalg.eigh(M / scale)
    v = np.abs(vectors[:, 0])
    open_ = np.where(np.isfinite(half), half, scale) / scale
    if values[0] + v @ open_ @ v > 0.0:
        return
    try:
        checked_compliance(M)
    except ValueError as error:
        raise MatrixFileError(f"{raw.file}: line {raw.lines[0][0]}: the {raw.kind} {error}") from None


# --- Which single entry of a matrix is misprinted: the one whose change makes it symmetric, and a beam's ----------

STARTS = numerical(6)
"""Beams near the matrix, by either measure, from which those near the rest of it are sought."""


@dataclass(frozen=True)
class Repair:
    """A change of one entry, or none but that a pair is made equal, and what comes of it.

    Attributes:
        entry: zero-based indices of the entry that changes.
        value: what it becomes, N, mm, rad.
        worst: smallest possible misfit of the worst entry by a beam of the form below, half-widths; infinite
            where the changed matrix is none of an elastic body.
        form: of the beam.
    """

    entry: tuple[int, int]
    value: float
    worst: float
    form: Form

    @property
    def makes_a_beam(self) -> bool:
        """Whether a beam meets every entry after it."""
        return self.worst <= 1.0 + 1e-6


def repairs_of_pair(raw: RawMatrix, pair: tuple[int, int], others: list[tuple[int, int]]) -> list[Repair]:
    """Both repairs that make an asymmetric pair equal, best first.

    Args:
        raw: the matrix.
        pair: the entries in question.
        others: asymmetric pairs besides, which are left out.
    """
    found = []
    for changed in (pair, pair[::-1]):
        keep = changed[::-1]
        value = float(raw.values[keep])
        found.append(_tried(mirrored(raw, pair, keep), others, changed, value))
    return sorted(found, key=lambda repair: repair.worst)


def _tried(raw: RawMatrix, left_out: list[tuple[int, int]], entry: tuple[int, int], value: float) -> Repair:
    try:
        aim = target(raw, left_out)
    except MatrixFileError:
        return Repair(entry, value, float("inf"), Form.STRAIGHT)
    tried = [(search(aim, form).worst, form) for form in (Form.STRAIGHT, Form.OFFSET)]
    met = [one for one in tried if one[0] <= 1.0 + 1e-6]
    worst, form = met[0] if met else min(tried)
    return Repair(entry, value, worst, form)


def single_changes(aim: Target, form: Form) -> list[Repair]:
    """Every single pair of mirrored entries whose change alone would let a beam of a form meet the rest.

    Each entry is left out in turn; the value proposed is that of the nearest beam to the rest.
    """
    found = []
    like = [fit for robust in (True, False) for fit in distinct(nearest(aim, form, robust=robust))[:STARTS]]
    for i in range(6):
        for j in range(i, 6):
            half = aim.half.copy()
            half[i, j] = half[j, i] = np.inf
            if i == j:
                # what an entry resolves bounds what is looked for; a missing diagonal entry keeps the old one's
                half[i, i] = 1e6 * aim.half[i, i]
            changed = replace(aim, half=half)
            # a beam that meets the others, each by one or less, has at most this sum of squares
            if nearest(changed, form, like)[0].squares > len(UPPER[0]):
                continue
            result = search(changed, form, like)
            if result.met:
                C = result.beam.beam.beam_compliance()
                found.append(Repair((i, j), float(C[i, j]), result.worst, form))
    return found
