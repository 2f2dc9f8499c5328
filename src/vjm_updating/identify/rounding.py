"""The rounding of printed compliance matrices, such as (19) and (20).

Each printed entry stands for an interval of half a unit of its last digit to either side. The intervals of all
entries are a box. Only the points of the box at which the matrices are positive definite are compliances.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linprog

from vjm.model.machine import Machine
from vjm.model.parts import Beam
from vjm.rotations import Array
from vjm_updating.constants import definition, numerical

PRINTED_DIGITS = definition(2)
"""Significant digits of (19) and (20)."""
DIFFERENCE_STEP = numerical(0.05)
"""Of the central differences, in half units: figures change by per cents over one, so that 0.05 errs by 1e-5."""


@dataclass(frozen=True)
class PrintedEntry:
    """A printed entry of a compliance matrix, with its mirror image.

    Attributes:
        part: name of the beam.
        row: zero-based.
        column: zero-based, not below the row.
        half_unit: half a unit of the last printed digit.
    """

    part: str
    row: int
    column: int
    half_unit: float


def printed_entries(chain: Machine) -> list[PrintedEntry]:
    """The entries other than zero of the chain's compliance matrices; zeros follow from the parts' symmetry."""
    return [
        PrintedEntry(
            beam.name,
            i,
            j,
            0.5 * 10.0 ** (np.floor(np.log10(abs(beam.compliance[i, j]))) - PRINTED_DIGITS + 1),
        )
        for beam in chain.beams
        if beam.compliance is not None
        for i in range(6)
        for j in range(i, 6)
        if beam.compliance[i, j] != 0.0
    ]


def perturbed(chain: Machine, entries: list[PrintedEntry], amounts: Array) -> Machine:
    """The chain with its printed entries moved by ``amounts`` ``(n,)`` half units."""

    def change(beam: Beam) -> Beam:
        if beam.compliance is None:
            return beam
        C = beam.compliance.copy()
        for entry, amount in zip(entries, amounts, strict=True):
            if entry.part == beam.name:
                C[entry.row, entry.column] += amount * entry.half_unit
                C[entry.column, entry.row] = C[entry.row, entry.column]
        return replace(beam, compliance=C)

    return replace(chain, parts=tuple(change(p) if isinstance(p, Beam) else p for p in chain.parts))


class AdmissibleRoundings:
    """The box of roundings cut by positive definiteness."""

    margin = 0.01
    """Smallest admissible eigenvalue over its nominal value."""

    def __init__(self, chain: Machine, entries: list[PrintedEntry]) -> None:
        self.entries = entries
        self.blocks: list[tuple[Array, list[tuple[int, Array]], float]] = []
        for beam in chain.beams:
            if beam.compliance is None:
                continue
            d = 1.0 / np.sqrt(np.diag(beam.compliance))
            nominal = beam.compliance * d[:, None] * d
            directions = []
            for k, entry in enumerate(entries):
                if entry.part == beam.name:
                    E = np.zeros((6, 6))
                    E[entry.row, entry.column] = E[entry.column, entry.row] = entry.half_unit
                    directions.append((k, E * d[:, None] * d))
            self.blocks.append((nominal, directions, self.margin * float(np.linalg.eigvalsh(nominal)[0])))

    def furthest(self, slope: Array) -> Array:
        """Point ``(n,)`` of box and cone at which a linear function is largest, by cutting planes."""
        cuts, limits = np.empty((0, len(self.entries))), np.empty(0)
        while True:
            amounts = np.asarray(linprog(-slope, A_ub=cuts, b_ub=limits, bounds=(-1.0, 1.0)).x)
            new = self._cuts(amounts)
            if not new:
                return amounts
            cuts = np.vstack([cuts, *(cut for cut, _ in new)])
            limits = np.append(limits, [limit for _, limit in new])

    def _cuts(self, amounts: Array) -> list[tuple[Array, float]]:
        """Planes between a point ``(n,)`` and the cone; none where it lies in it."""
        cuts = []
        for nominal, directions, floor in self.blocks:
            M = nominal + sum(amounts[k] * E for k, E in directions)
            values, vectors = np.linalg.eigh(M)
            for value, v in zip(values, vectors.T, strict=True):
                if value < 0.5 * floor:
                    cut = np.zeros(len(self.entries))
                    for k, E in directions:
                        cut[k] = -v @ E @ v
                    cuts.append((cut, float(v @ nominal @ v) - floor))
        return cuts
