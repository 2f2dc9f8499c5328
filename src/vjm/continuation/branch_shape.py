"""Which way a branch leaves a bifurcation: computed from points on it, or undecided.

On the branch the path's parameter is ``s = s₀ + c₁ a + c₂ a²`` with the amplitude a of the critical mode. Points at
±a, ±2a, ±4a … give c₁ by the odd and c₂ by the even part, the critical value itself, which is known to rounding
only, being left out. A coefficient counts where three estimates in a row agree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from vjm.continuation.path import Equilibrium
from vjm.errors import NoConvergenceError

AGREE = 0.25
"""Difference of two estimates in a row, over the larger, up to which they are one."""
IN_A_ROW = 3
"""Estimates that have to agree."""


class Leaving(StrEnum):
    """How a branch leaves."""

    SUPERCRITICAL = "supercritical"
    """The path's parameter grows to both sides."""
    SUBCRITICAL = "subcritical"
    """It falls to both sides."""
    ASYMMETRIC = "asymmetric"
    """It grows to one side and falls to the other."""
    UNDECIDED = "undecided"
    """No coefficient was found."""


@dataclass(frozen=True)
class BranchShape:
    """What was found of a branch.

    Attributes:
        leaving: how it leaves.
        slope: c₁, change of the path's parameter by the amplitude; zero where it does not count.
        curvature: c₂, likewise by its square.
        amplitude: largest one that was taken.
        how: in words, how it was found or why it was not.
    """

    leaving: Leaving
    slope: float
    curvature: float
    amplitude: float
    how: str

    def __str__(self) -> str:
        """In words, with the reason."""
        if self.leaving is Leaving.UNDECIDED:
            return f"whether it is sub- or supercritical is undecided: {self.how}"
        return f"it is {self.leaving}: {self.how}"


def branch_shape(along: Callable[[float], float], first: float, last: float) -> BranchShape:
    """How the path's parameter changes along a branch.

    Args:
        along: the parameter at an amplitude of either sign; it may raise `NoConvergenceError`.
        first: smallest amplitude.
        last: largest.
    """
    size, before, why = first, None, "the branch's points are within rounding of the critical one"
    slopes: list[float] = []
    curvatures: list[float] = []
    while size <= last:
        try:
            ahead, behind = along(size), along(-size)
        except NoConvergenceError as failure:
            why = f"no point of the branch at the amplitude {size:.2g} ({failure})"
            break
        even = 0.5 * (ahead + behind)
        slopes.append(0.5 * (ahead - behind) / size)
        if before is not None:
            curvatures.append((even - before) / (0.75 * size**2))
        before = even
        slope, curvature = _settled(slopes), _settled(curvatures)
        if slope is not None and abs(slope) * size > abs(curvatures[-1] if curvatures else 0.0) * size**2:
            return BranchShape(Leaving.ASYMMETRIC, slope, 0.0, size, _found("c1", slope, size, len(slopes)))
        if curvature is not None:
            leaving = Leaving.SUPERCRITICAL if curvature > 0.0 else Leaving.SUBCRITICAL
            return BranchShape(leaving, 0.0, curvature, size, _found("c2", curvature, size, len(slopes)))
        size *= 2.0
    return BranchShape(Leaving.UNDECIDED, 0.0, 0.0, min(size, last), why)


def _settled(estimates: list[float]) -> float | None:
    """The last of some estimates where they agree."""
    row = estimates[-IN_A_ROW:]
    largest = max((abs(value) for value in row), default=0.0)
    if len(row) < IN_A_ROW or largest == 0.0 or max(row) - min(row) > AGREE * largest:
        return None
    return row[-1]


def _found(what: str, value: float, size: float, count: int) -> str:
    order = "the amplitude" if what == "c1" else "the square of the amplitude"
    return (
        f"the parameter changes by {value:.3g} times {order} ({2 * count} points on the branch, up to {size:.2g})"
    )


def behind_bifurcation(
    critical: Equilibrium,
    direct: Callable[[], Equilibrium],
    at_amplitude: Callable[[float], Equilibrium],
    first: float,
    last: float,
    end: float,
) -> Equilibrium:
    """A stable state on a crossing branch, and where there is none, why.

    Args:
        critical: the bifurcation.
        direct: gives the state where the branch rises clearly.
        at_amplitude: the branch's state at an amplitude of either sign.
        first: smallest amplitude to look at.
        last: largest.
        end: of the path's parameter: no state beyond it.

    Raises:
        NoConvergenceError: none leads onwards, or it is not known whether one does.
    """
    try:
        return direct()
    except NoConvergenceError as failure:
        shape = branch_shape(lambda size: at_amplitude(size).s, first, last)
        if shape.leaving is Leaving.SUPERCRITICAL or shape.slope > 0.0:
            size = shape.amplitude
            while size <= last:
                there = at_amplitude(size)
                if there.s > end:
                    break
                # further than rounding has the critical value
                if there.s - critical.s > 0.5 * (shape.slope * size + shape.curvature * size**2) > 0.0:
                    if there.unstable == 0:
                        return there
                    raise NoConvergenceError(f"{shape}; the state at {size:.2g} is unstable") from None
                size *= 2.0
            raise NoConvergenceError(f"{shape}; but {failure}") from None
        raise NoConvergenceError(str(shape)) from None
