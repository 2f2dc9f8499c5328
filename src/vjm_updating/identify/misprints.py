"""Which single entry of a matrix is misprinted: the one whose change makes it symmetric, and a beam's."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm_updating.constants import numerical
from vjm_updating.identify.candidates import UPPER, Form, Target
from vjm_updating.identify.fitting import distinct, nearest, search
from vjm_updating.identify.matrix_file import MatrixFileError, RawMatrix
from vjm_updating.identify.sanity import mirrored, target

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
