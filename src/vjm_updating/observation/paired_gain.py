"""Whether one prediction of readings is better than another beyond noise, by blocks of them.

Readings that are held out together are predicted by one fit, and those near by share what the model lacks: they do
not err independently. Differences of squared errors are therefore summed up by block, and the scatter of the blocks
is what a difference is held against (ratio estimator of a cluster sample, Cochran, Sampling Techniques, 1977).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import definition
from vjm_updating.observation.distributions import student_isf

TAIL_95 = definition(0.025)
"""Chance of each tail outside a 95 % interval."""


class Worth(StrEnum):
    """What one prediction is worth against another."""

    BETTER = "better"
    ALIKE = "no better"
    WORSE = "worse"


@dataclass(frozen=True)
class PairedGain:
    """The difference of squared errors, those before less those after.

    Attributes:
        before: root mean square of the errors before, and
        after: after.
        mean: of the differences, and
        std: its standard error, by blocks.
        blocks: how many there are.
    """

    before: float
    after: float
    mean: float
    std: float
    blocks: int

    @property
    def beyond(self) -> float:
        """Half of the 95 % interval of the mean, by Student's distribution; of one block nothing is known."""
        return student_isf(TAIL_95, self.blocks - 1) * self.std if self.blocks > 1 else np.inf

    @property
    def noise(self) -> float:
        """By how much the root mean square would have to fall for a gain beyond noise; at most all of it."""
        return self.before - float(np.sqrt(max(self.before**2 - self.beyond, 0.0)))

    @property
    def worth(self) -> Worth:
        """Better or worse where the 95 % interval of the mean leaves zero out."""
        if abs(self.mean) <= self.beyond:
            return Worth.ALIKE
        return Worth.BETTER if self.mean > 0.0 else Worth.WORSE


def paired_gain(before: Array, after: Array, block: np.ndarray, weight: Array) -> PairedGain | None:
    """Compare the errors of two predictions of the same readings.

    Args:
        before: ``(g, k)`` errors of one prediction, in any unit; nan where there is none.
        after: ``(g, k)`` of the other.
        block: ``(g,)`` number of the block of each row.
        weight: ``(g, k)`` of the readings.

    Returns:
        None where there is nothing to compare.
    """
    both = np.isfinite(before) & np.isfinite(after)
    if not both.any():
        return None
    w = np.where(both, weight, 0.0)
    was, now = (np.where(both, error, 0.0) ** 2 * w for error in (before, after))
    _, number = np.unique(block[both.any(axis=1)], return_inverse=True)
    rows = both.any(axis=1)
    total = np.bincount(number, (was - now)[rows].sum(axis=1))
    size = np.bincount(number, w[rows].sum(axis=1))
    mean, count = float(total.sum() / size.sum()), len(total)
    spread = float(np.sum((total - mean * size) ** 2)) * count / max(count - 1, 1)
    return PairedGain(
        float(np.sqrt(was.sum() / w.sum())), float(np.sqrt(now.sum() / w.sum())), mean,
        float(np.sqrt(spread) / size.sum()), count,
    )  # fmt: skip
