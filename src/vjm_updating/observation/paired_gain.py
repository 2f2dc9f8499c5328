"""Whether one prediction of readings is better than another beyond noise, by blocks of them.

Readings that are held out together are predicted by one fit, and those near by share what the model lacks: they do
not err independently. Squared errors are therefore summed up by block, and compared there in pairs: by the
difference of their logarithms, since blocks differ by factors in how far they are off. The scatter of the blocks is
what the mean is held against (ratio estimator of a cluster sample, Cochran, Sampling Techniques, 1977).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import definition, numerical
from vjm_updating.observation.significance import student_isf

TAIL_95 = definition(0.025)
"""Chance of each tail outside a 95 % interval."""
ROUNDING = numerical(1e-12)
"""Share of all squared errors below which those of a block are none."""


class Worth(StrEnum):
    """What one prediction is worth against another."""

    BETTER = "better"
    ALIKE = "no better"
    WORSE = "worse"


@dataclass(frozen=True)
class PairedGain:
    """How much smaller squared errors are.

    Attributes:
        before: root mean square of the errors before, and
        after: after.
        mean: of the logarithm of squared errors before over those after, and
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
    def saved(self) -> float:
        """Share of the errors that is saved, in the geometric mean of the blocks; negative where they grow."""
        return 1.0 - float(np.exp(-0.5 * self.mean))

    @property
    def noise(self) -> float:
        """Share that would have to be saved, or lost where errors grow, to be beyond noise."""
        return abs(1.0 - float(np.exp(-0.5 * np.copysign(self.beyond, self.mean))))

    @property
    def worth(self) -> Worth:
        """Better or worse where the 95 % interval of the mean leaves zero out, and all errors together agree."""
        if abs(self.mean) <= self.beyond:
            return Worth.ALIKE
        if self.mean > 0.0:
            return Worth.BETTER if self.after < self.before else Worth.ALIKE
        return Worth.WORSE if self.after > self.before else Worth.ALIKE


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
    rows = both.any(axis=1)
    _, number = np.unique(block[rows], return_inverse=True)
    size = np.bincount(number, w[rows].sum(axis=1))
    squares = [np.bincount(number, square[rows].sum(axis=1)) for square in (was, now)]
    least = ROUNDING * max(float(square.sum()) for square in squares) + np.finfo(float).tiny
    ratio = np.log(np.maximum(squares[0], least) / np.maximum(squares[1], least))
    mean, count = float(ratio @ size / size.sum()), len(size)
    spread = float(np.sum((size * (ratio - mean)) ** 2)) * count / max(count - 1, 1)
    return PairedGain(
        float(np.sqrt(was.sum() / w.sum())), float(np.sqrt(now.sum() / w.sum())), mean,
        float(np.sqrt(spread) / size.sum()), count,
    )  # fmt: skip
