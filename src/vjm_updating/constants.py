"""What kind of number a constant of this package is, declared where the constant stands.

Each returns the value that it is given. `tests/vjm_updating/test_constants.py` reads the declarations: every number
of a module has one, and no more are tuned than were before.

Example:
    >>> FAR_OFF = tuned(2.0)
    >>> USUAL_LAG = prior_scale(30.0, "s")
    >>> FAR_OFF, USUAL_LAG
    (2.0, 30.0)
"""

from __future__ import annotations

from typing import TypeVar

Value = TypeVar("Value")
ONE = "1"
"""The unit of a ratio, a share, a number of standard deviations."""


def _declared(value: Value, _unit: str = ONE) -> Value:
    """The number as it is: the name under which this is called says what kind it is."""
    return value


tuned = _declared
"""A number that decides what is said, and was set by judgement or by what it did on data."""
prior_scale = _declared
"""The scale of a prior distribution, or a probability before the data."""
physical_bound = _declared
"""A physical limit: beyond it there is no machine, instrument or test."""
stated_level = _declared
"""The level of a test or an interval: a probability, or the standard deviations or odds that mean one."""
numerical = _declared
"""A step, a tolerance, a seed, a limit of iterations: another one moves a result by less than its interval."""
definition = _declared
"""A constant of nature or of mathematics, a unit, or an index."""
shown = _declared
"""What a page or a line of text shows."""
