"""What is too rare to be an accident, and how many samples may be outliers: one rate and one prior for all."""

from __future__ import annotations

from math import log

from vjm_updating.constants import definition, numerical, prior_scale, stated_level
from vjm_updating.observation.distributions import chi2_sf, normal_isf, rare_share_sf

FALSE_ALARMS = stated_level(0.004)
"""Chance at which a test in which nothing is wrong is taken for one in which something is."""
OUTLIERS = prior_scale(0.02)
"""Share of samples that are outliers, in the mean; the shares of channels are distributed as ``(1 − q)^(1/m − 2)``,
a beta distribution that has most where there are none."""
NOISE_KNOWN = prior_scale(1.35)
"""Variance of a noise over what its sheet says, at most: a standard deviation is known to a sixth."""
LAW_ERROR = prior_scale(0.03)
"""Relative error of a law, of the size of what its cause does: scale of a half-Cauchy prior, which is its median.
Measured from what the catalogue's laws leave of textbooks' (`tests/vjm_updating/inference/test_law_errors.py`)."""
RARER = prior_scale(2.8)
"""What a further cause costs, twice a negative logarithm: machines that lack two are a quarter as frequent as those
that lack one."""
NORMAL_95 = definition(1.959963984540054)
"""Standard deviations within which 95 % of a normal distribution lie."""
CUT = numerical(4.0)
"""Standard deviations at which a residual is cut off where it is asked for what many readings share."""


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
