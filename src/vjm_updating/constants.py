"""What kind of number a constant of this package is, declared where the constant stands.

Each function returns the value that it is given. `tests/vjm_updating/test_constants.py` reads the declarations:
every number of a module has one, and no more are tuned than were before.

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


def tuned(value: Value, _unit: str = ONE) -> Value:
    """A number that decides what is said, and was set by judgement or by what it did on data."""
    return value


def prior_scale(value: Value, _unit: str = ONE) -> Value:
    """The scale of a prior distribution, or a probability before the data."""
    return value


def physical_bound(value: Value, _unit: str = ONE) -> Value:
    """A physical limit: beyond it there is no machine, instrument or test."""
    return value


def stated_level(value: Value, _unit: str = ONE) -> Value:
    """The level of a test or an interval: a probability, or the standard deviations or odds that mean one."""
    return value


def numerical(value: Value, _unit: str = ONE) -> Value:
    """A step, a tolerance, a seed, a limit of iterations: another one moves a result by less than its interval."""
    return value


def definition(value: Value, _unit: str = ONE) -> Value:
    """A constant of nature or of mathematics, a unit, or an index."""
    return value


def shown(value: Value, _unit: str = ONE) -> Value:
    """What a page or a line of text shows."""
    return value
