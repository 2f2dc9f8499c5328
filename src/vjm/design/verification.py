"""Derivatives against machines that are solved again: one central difference for each."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from vjm.errors import NoConvergenceError

APART = 1e-3
"""Relative change of a parameter: a central difference errs by its square."""
SOLVED = 1e-8
"""Relative error of a quantity that is solved for, at most."""


class SolvedAgain(NamedTuple):
    """What a difference says of a derivative.

    Attributes:
        difference: the central difference; None where there is none.
        why: why there is none, or why the derivative is doubtful; empty where both agree.
    """

    difference: float | None
    why: str

    @property
    def doubtful(self) -> bool:
        """Whether the two disagree beyond the error of both."""
        return self.difference is not None and bool(self.why)


NOT_ASKED = SolvedAgain(None, "not asked for")


def verified(at: Callable[[float], float], value: float, centre: float, derivative: float) -> SolvedAgain:
    """A derivative beside a central difference.

    The difference errs by less than it differs from the one-sided ones, which are nearer the corner of a quantity
    that has one, and by the error of the solutions over the step.

    Args:
        at: the quantity at a value of the parameter, solved again.
        value: of the quantity as it is.
        centre: value of the parameter.
        derivative: to be verified, per unit of the parameter.
    """
    step = APART * abs(centre)
    if not step:
        return SolvedAgain(None, "the parameter is zero, of which no share can be taken")
    try:
        ahead, behind = at(centre + step), at(centre - step)
    except (ValueError, NoConvergenceError) as error:
        return SolvedAgain(None, " ".join(str(error).split()))
    difference = (ahead - behind) / (2.0 * step)
    allowed = abs(ahead - 2.0 * value + behind) / (2.0 * step) + SOLVED * abs(value) / step
    if abs(derivative - difference) <= allowed:
        return SolvedAgain(difference, "")
    return SolvedAgain(difference, f"machines solved again give {difference:.5g}, not {derivative:.5g}")
