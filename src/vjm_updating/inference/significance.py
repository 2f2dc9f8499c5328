"""What is too rare to be an accident, and how many samples may be outliers: one rate and one prior for all.

Also whether one prediction of readings is better than another beyond noise, by blocks of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import log
from typing import Any

import numpy as np
from scipy.special import chdtrc, chdtri, fdtrc, ndtri, stdtrit

from vjm.rotations import Array
from vjm_updating.constants import definition, numerical, prior_scale, stated_level

# --- Tails of the distributions that tests of significance ask for, by `scipy.special` alone ----------------------
#
# `scipy.stats` has them too and more, but takes a third of a second to import, and far longer for one number.


def chi2_sf(x: Any, freedom: Any) -> Any:  # noqa: ANN401
    """Chance that a chi-squared number of so many degrees of freedom is above ``x``; nan where there are none."""
    return np.where(np.greater(freedom, 0.0), chdtrc(freedom, np.maximum(x, 0.0)), np.nan)


def chi2_isf(chance: float, freedom: float) -> float:
    """What a chi-squared number of so many degrees of freedom is above with this chance."""
    return float(chdtri(freedom, chance))


def normal_isf(chance: float) -> float:
    """What a standard normal number is above with this chance."""
    return -float(ndtri(chance))


def student_isf(chance: float, freedom: float) -> float:
    """What a number of Student's distribution is above with this chance."""
    return -float(stdtrit(freedom, chance))


def f_logsf(x: float, above: float, below: float) -> float:
    """Logarithm of the chance that a number of the F distribution is above ``x``; -inf where it underflows.

    The numerator has ``above`` degrees of freedom, the denominator ``below``.
    """
    chance = float(fdtrc(above, below, x))
    return float(np.log(chance)) if chance > 0.0 else -np.inf


def rare_share_sf(count: int, samples: int, b: float) -> float:
    """Chance of at least ``count`` of ``samples`` whose share is distributed as ``b (1 − q)^(b − 1)``.

    The beta-binomial distribution with a = 1. Each further one has the chance ``(n − i) / (n − i + b)`` after i of
    them: the sum of its terms telescopes.
    """
    left = samples - np.arange(min(count, samples + 1))
    return float(np.prod(left / (left + b)))


def drawn_sf(count: np.ndarray, total: int, marked: int, drawn: np.ndarray) -> Array:
    """Chances of at least ``count (m,)`` marked ones among ``drawn (m,)`` of ``total``, of which ``marked`` are so.

    The hypergeometric distribution. Its terms follow from the ratios of neighbours, whose products keep digits.
    """
    N = np.asarray(drawn, dtype=float)[:, None]
    least = np.maximum(N - (total - marked), 0.0)
    x = least + np.arange(marked + 1)
    ratio = np.maximum((marked - x) * (N - x), 0.0) / ((x + 1.0) * (total - marked - N + x + 1.0))
    with np.errstate(divide="ignore"):
        log = np.cumsum(np.log(ratio[:, :-1]), axis=1)
    log = np.concatenate([np.zeros_like(N), log], axis=1)
    weight = np.exp(log - log.max(axis=1, keepdims=True))
    tail = np.where(x >= np.asarray(count)[:, None], weight, 0.0)
    return tail.sum(axis=1) / weight.sum(axis=1)


def latin_hypercube(points: int, dimensions: int, seed: int) -> Array:
    """Points ``(n, d)`` in the unit cube, in every coordinate one in each n-th part (McKay et al. 1979).

    The same ones as of `scipy.stats.qmc.LatinHypercube`.
    """
    rng = np.random.default_rng(seed).spawn(1)[0]
    within = rng.uniform(size=(points, dimensions))
    place = np.tile(np.arange(1, points + 1), (dimensions, 1))
    for row in place:
        rng.shuffle(row)
    return (place.T - within) / points


FALSE_ALARMS = stated_level(0.004)
"""Chance at which a test in which nothing is wrong is taken for one in which something is."""
OUTLIERS = prior_scale(0.02)
"""Share of samples that are outliers, in the mean; the shares of channels are distributed as ``(1 − q)^(1/m − 2)``,
a beta distribution that has most where there are none."""
NOISE_KNOWN = prior_scale(1.35)
"""Variance of a noise over what its sheet says, at most: a standard deviation is known to a sixth."""
IMPROBABLE = stated_level(6.0)
"""Difference of two criteria at odds of 20 to 1, as those of what is said to act."""
LAW_ERROR = prior_scale(0.03)
"""Relative error of a law, of the size of what its cause does: scale of a half-Cauchy prior, which is its median.
Measured from what the catalogue's laws leave of textbooks' (`tests/vjm_updating/inference/test_law_errors.py`)."""
RARER = prior_scale(2.8)
"""What a further cause costs, twice a negative logarithm: machines that lack two are a quarter as frequent as those
that lack one."""
NORMAL_95 = definition(1.959963984540054)
"""Standard deviations within which 95 % of a normal distribution lie."""
ALL_ROUND = definition(np.pi / 3.0**0.5)
"""Standard deviation of an angle of which nothing is known, rad: evenly spread over a whole turn."""
CUT = numerical(4.0)
"""Standard deviations at which a residual is cut off where it is asked for what many readings share."""


MEDIAN_TO_SIGMA = definition(1.4826)
"""From the median of the sizes of normal numbers to their standard deviation."""


def median_sigma(values: Array) -> float:
    """Standard deviation by the median of the sizes of what was read, which a minority of outliers does not carry.

    ``values`` are about zero, of any shape; nan where nothing was read.

    Example:
        >>> median_sigma(np.array([-1.0, 1.0, 1e3, np.nan]))
        1.4826
    """
    return MEDIAN_TO_SIGMA * float(np.nanmedian(np.abs(values)))


def level(count: int) -> float:
    """Standard deviations that the largest of so many independent residuals exceeds with `FALSE_ALARMS`."""
    return normal_isf(0.5 * FALSE_ALARMS / max(count, 1))


def accident() -> float:
    """What a hypothesis costs that would be a false alarm: twice the negative logarithm of `FALSE_ALARMS`."""
    return -2.0 * log(FALSE_ALARMS)


def too_many(outliers: int, samples: int) -> bool:
    """Whether so many of a channel's samples are no accidents: their share would be rarer than `FALSE_ALARMS`."""
    return rare_share_sf(outliers, samples, 1.0 / OUTLIERS - 1.0) < FALSE_ALARMS


def more_than_noise(times: float, freedom: float) -> bool:
    """Whether readings scatter so many times as far as a sheet's noise that it is no accident.

    The square is a mean of so many; the noise itself is known to `NOISE_KNOWN`.
    """
    return bool(chi2_sf(times**2 * freedom / NOISE_KNOWN, freedom) < FALSE_ALARMS)


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
    """Compare the errors of two predictions of the same readings; None where there is nothing to compare.

    ``before`` and ``after`` (g, k) are errors in any unit, nan where there is none, of readings of ``weight``
    (g, k); ``block`` (g,) has the number of each row's block.
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
