"""Which way a branch leaves a bifurcation: computed from points on it, with its error, or undecided.

On the branch the path's parameter is ``s = s₀ + c₁ a + c₂ a² + …`` with the amplitude a of the critical mode.
Points are taken at ±a, ±2a, ±4a …, each from the ones before it. Half their difference over a gives c₁, their
mean's distance from the critical value over a² gives c₂ (Koiter's coefficients, here by Richardson's
extrapolation). A statement is made only where all of this holds:

* three estimates in a row agree;
* the points run into the critical point: the mean's parameter and shape, extrapolated to no amplitude, are the
  critical ones within the extrapolation's own error. Points of another branch are not;
* a falling branch is unstable, as exchange of stability asks (Crandall and Rabinowitz, *Arch. Rational Mech.
  Anal.* 52, 1973).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from vjm.continuation.path import Equilibrium, StationLabel
from vjm.errors import NoConvergenceError
from vjm.rotations import Array

AGREE = 0.25
"""Difference of two estimates in a row, over the larger, up to which they are one."""
IN_A_ROW = 3
"""Estimates that have to agree."""
MET = 1e-2
"""Distance of the extrapolated parameter and shape from the critical ones, over their change at the row's smallest
amplitude, that is allowed beside the extrapolation's error. Near a critical point a solver's tolerance leaves as
much; points of another branch miss by more than they change."""
AMPLIFIED = (64.0 - 20.0 / 4.0 + 1.0 / 16.0) / 45.0
"""What `_extrapolated` makes of an error of the critical value, which weighs by one over the amplitude's square."""
LOCATED = 1e-9
"""Share of a path's length to which its critical points are located."""
NEIGHBOUR = 20.0
"""Distance of a state from the bifurcation, over its amplitude, from which it is no neighbour."""
DIRECTIONS = 8
"""In which a branch is looked for where two modes lose their stability at once, over half a turn between them."""


class Measure(NamedTuple):
    """A physical amplitude.

    Attributes:
        name: what moves.
        unit: rad or mm.
        rate: how much it moves by the mode's amplitude.
    """

    name: str
    unit: str
    rate: float


Measuring = Callable[[Equilibrium, Equilibrium, float], Measure]
"""The physical amplitude of a branch, from its points at an amplitude to both sides."""


def station_measure(stations: Sequence[StationLabel]) -> Measuring:
    """The largest deflection of a station, mm.

    Args:
        stations: labels of the rows of the shapes.
    """

    def measure(ahead: Equilibrium, behind: Equilibrium, size: float) -> Measure:
        moved = np.linalg.norm(ahead.shape - behind.shape, axis=1) / (2.0 * size)
        k = int(np.argmax(moved))
        return Measure(f"deflection of {stations[k].part}@{stations[k].fraction:.4g}", "mm", float(moved[k]))

    return measure


NO_MEASURE = Measure("amplitude of the mode, scaled to length one", "", 1.0)


def _of_mode(ahead: Equilibrium, behind: Equilibrium, size: float) -> Measure:
    return NO_MEASURE


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
        curvature: c₂, likewise by its square; zero where it does not count.
        error: of the one that counts.
        amplitude: largest one that was taken.
        how: in words, how it was found or why it was not, with the coefficient in the physical amplitude.
        measure: the physical amplitude. In it the coefficients are c₁ over its rate, c₂ over that squared.
    """

    leaving: Leaving
    slope: float
    curvature: float
    error: float
    amplitude: float
    how: str
    measure: Measure = NO_MEASURE

    @property
    def coefficient(self) -> float:
        """The one that counts, in the physical amplitude or in its square; zero where none is known."""
        return self.slope / self.measure.rate if self.slope else self.curvature / self.measure.rate**2

    def __str__(self) -> str:
        """In words, with the reason."""
        if self.leaving is Leaving.UNDECIDED:
            return f"whether it is sub- or supercritical is undecided: {self.how}"
        return f"it is {self.leaving}: {self.how}"


class NoStableBranchError(NoConvergenceError):
    """No stable branch leads on from a bifurcation."""

    def __init__(self, shape: BranchShape, why: str = "") -> None:
        """Say how the branch leaves, and what else is known."""
        super().__init__(f"{shape}; {why}" if why else str(shape))
        self.shape = shape


Along = Callable[[float, Array], Equilibrium]
"""The branch's point at an amplitude of either sign, from a state near it; it may raise `NoConvergenceError`."""


def branch_shape(
    along: Along,
    critical: Equilibrium,
    mode: Array,
    resolution: float,
    sizes: Array,
    measuring: Measuring = _of_mode,
) -> BranchShape:
    """How the path's parameter changes along a branch.

    Args:
        along: gives its points.
        critical: the bifurcation.
        mode: change of the state ``(n,)`` by the amplitude, there.
        resolution: to which the critical value of the parameter is known.
        sizes: amplitudes ``(k,)`` to look at, each twice the one before.
        measuring: gives the physical amplitude in which it is told.
    """
    pairs: list[_Pair] = []
    sides = [[critical.state], [critical.state]]
    why = "the branch's points are within rounding of the critical one"
    for size in sizes:
        try:
            ahead, behind = (
                along(sign * size, _ahead(states, sign * size * mode))
                for sign, states in zip((1.0, -1.0), sides, strict=True)
            )
        except NoConvergenceError as failure:
            if len(pairs) < IN_A_ROW:
                why = f"no point of the branch at the amplitude {size:.2g} ({failure})"
            break
        for states, point in zip(sides, (ahead, behind), strict=True):
            states.append(point.state)
        pairs.append(_Pair(float(size), ahead, behind))
        decision = _decided(pairs[-IN_A_ROW:], critical, resolution)
        if isinstance(decision, BranchShape):
            return _measured(decision, measuring(pairs[0].ahead, pairs[0].behind, pairs[0].size))
        why = decision or why
    return BranchShape(Leaving.UNDECIDED, 0.0, 0.0, 0.0, pairs[-1].size if pairs else 0.0, why)


class _Pair(NamedTuple):
    """Points at an amplitude to both sides."""

    size: float
    ahead: Equilibrium
    behind: Equilibrium

    @property
    def odd(self) -> float:
        return 0.5 * (self.ahead.s - self.behind.s) / self.size

    def even(self, critical: Equilibrium) -> float:
        return (0.5 * (self.ahead.s + self.behind.s) - critical.s) / self.size**2


def _ahead(states: Sequence[Array], step: Array) -> Array:
    """A state near the next one: along the mode, the chord, then the parabola through the last two."""
    if len(states) == 1:
        return states[0] + step
    if len(states) == 2:
        return 2.0 * states[1] - states[0]
    # nodes 0, 1/2, 1 and the value at 2
    return 3.0 * states[0] - 8.0 * states[-2] + 6.0 * states[-1]


def _decided(row: Sequence[_Pair], critical: Equilibrium, resolution: float) -> BranchShape | str:
    """What a row of pairs says, or why it says nothing."""
    if len(row) < IN_A_ROW:
        return ""
    first, last = row[0], row[-1]
    slope, slope_error = _extrapolated([pair.odd for pair in row])
    curvature, curvature_error = _extrapolated([pair.even(critical) for pair in row])
    # the critical value's error, which the solver's tolerance may make larger than its resolution
    missed = abs(_extrapolated([pair.size**2 * pair.even(critical) for pair in row])[0])
    curvature_error += AMPLIFIED * max(resolution, missed) / first.size**2
    # where the branch turns back before the critical value's own error, its slope is none
    excursion = 0.25 * slope**2 / abs(curvature) if curvature else np.inf
    if abs(slope) > slope_error and _agree([p.odd for p in row]) and abs(slope) > abs(curvature) * last.size:
        leaving, error = Leaving.ASYMMETRIC, slope_error
    elif not _agree([p.even(critical) for p in row]) or curvature_error > AGREE * abs(curvature):
        return "the estimates of how the parameter changes along the branch do not agree"
    elif abs(slope) > slope_error and excursion > resolution and abs(slope) > abs(curvature) * first.size:
        return "its slope and its curvature are of one size"
    else:
        leaving = Leaving.SUPERCRITICAL if curvature > 0.0 else Leaving.SUBCRITICAL
        error, slope = curvature_error, 0.0
    away = _missed(row, critical, resolution)
    if away:
        return away
    falling = [p for p in (last.ahead, last.behind) if p.s < critical.s - resolution]
    if any(point.unstable == 0 and point.eigenvalue > 0.0 for point in falling):
        return "points of the branch below the critical one are stable"
    if leaving is Leaving.ASYMMETRIC:
        curvature = 0.0
    return BranchShape(leaving, slope, curvature, error, last.size, "")


def _extrapolated(estimates: Sequence[float]) -> tuple[float, float]:
    """To no amplitude, of estimates at a, 2a and 4a whose error goes with a², and that extrapolation's error."""
    two = (4.0 * estimates[0] - estimates[1]) / 3.0
    three = (16.0 * two - (4.0 * estimates[1] - estimates[2]) / 3.0) / 15.0
    return three, abs(three - two)


def _agree(estimates: Sequence[float]) -> bool:
    largest = max(abs(value) for value in estimates)
    return largest > 0.0 and max(estimates) - min(estimates) <= AGREE * largest


def _missed(row: Sequence[_Pair], critical: Equilibrium, resolution: float) -> str:
    """By how much the points, extrapolated to no amplitude, miss the critical one; empty where they meet it."""
    means = [pair.size**2 * pair.even(critical) for pair in row]
    at_zero, error = _extrapolated(means)
    change = max(abs(means[0]), row[0].size * abs(row[0].odd))
    if abs(at_zero) > error + resolution + MET * change:
        return f"at no amplitude the points found have a parameter that is off by {abs(at_zero):.2g}"
    shapes = [0.5 * (pair.ahead.shape + pair.behind.shape) - critical.shape for pair in row]
    two = (4.0 * shapes[0] - shapes[1]) / 3.0
    three = (16.0 * two - (4.0 * shapes[1] - shapes[2]) / 3.0) / 15.0
    deflection = float(np.linalg.norm(row[0].ahead.shape - row[0].behind.shape))
    off = float(np.linalg.norm(three))
    rounding = LOCATED * float(np.ptp(critical.shape, axis=0).max(initial=0.0))
    if off > float(np.linalg.norm(three - two)) + MET * deflection + rounding:
        return f"at no amplitude the points found are {off:.2g} mm away from the critical one"
    return ""


def _measured(shape: BranchShape, measure: Measure) -> BranchShape:
    """A shape with its coefficient in a physical amplitude, in words."""
    if not measure.rate:
        measure = NO_MEASURE
    measured = replace(shape, measure=measure)
    order = measure.name if shape.slope else f"square of the {measure.name}"
    error = shape.error / abs(measure.rate if shape.slope else measure.rate**2)
    unit = f" in {measure.unit}" if measure.unit else ""
    most = f"{abs(measure.rate) * shape.amplitude:.2g} {measure.unit}".rstrip()
    how = (
        f"the parameter changes by {measured.coefficient:.4g} ± {error:.1g} times the {order}{unit} "
        f"({2 * IN_A_ROW} points on the branch, up to {most})"
    )
    return replace(measured, how=how)


def behind_bifurcation(
    critical: Equilibrium,
    direct: Callable[[], Equilibrium],
    along: Along,
    mode: Array,
    sizes: Array,
    end: float,
    measuring: Measuring,
) -> Equilibrium:
    """A stable state on a crossing branch, and where there is none, why.

    Args:
        critical: the bifurcation.
        direct: gives the state where the branch rises clearly.
        along: the branch's state at an amplitude of either sign.
        mode: change of the state ``(n,)`` by the amplitude.
        sizes: amplitudes ``(k,)`` to look at, each twice the one before.
        end: of the path's parameter: no state beyond it.
        measuring: gives the physical amplitude in which it is told how the branch leaves.

    Raises:
        NoStableBranchError: none leads onwards, or it is not known whether one does.
    """
    try:
        return direct()
    except NoConvergenceError as failure:
        resolution = LOCATED * end
        shape = branch_shape(along, critical, mode, resolution, sizes, measuring)
        if shape.leaving is Leaving.SUPERCRITICAL or shape.slope > 0.0:
            states = [critical.state]
            for size in sizes:
                point = along(size, _ahead(states, size * mode))
                states.append(point.state)
                if point.s > end:
                    break
                if size >= shape.amplitude and point.s - critical.s > resolution:
                    if point.unstable == 0:
                        return point
                    raise NoStableBranchError(shape, f"the state at {size:.2g} is unstable") from None
            raise NoStableBranchError(shape, f"but {failure}") from None
        raise NoStableBranchError(shape) from None


def stiffest(modes: Sequence[Array], sign: int, branch: Callable[[Array], Equilibrium]) -> Equilibrium:
    """The branch that leaves along the critical mode; of two modes at once along the stiffest mixture.

    Args:
        modes: one or two, ``(n,)`` each.
        sign: which of the mirrored branches.
        branch: the state on the branch along a mode.

    Raises:
        NoConvergenceError: none was found.
    """
    if len(modes) == 1:
        return branch(sign * modes[0])
    points: list[Equilibrium] = []
    failures: list[NoConvergenceError] = []
    for angle in np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
        try:
            points.append(branch(sign * (np.cos(angle) * modes[0] + np.sin(angle) * modes[1])))
        except NoConvergenceError as failure:
            failures.append(failure)
    if not points:
        raise _of_directions(failures)
    return min(points, key=lambda point: (point.unstable, -point.eigenvalue))


def _of_directions(failures: Sequence[NoConvergenceError]) -> NoConvergenceError:
    """What the failures in all directions between two modes say together."""
    shapes = [failure.shape for failure in failures if isinstance(failure, NoStableBranchError)]
    decided = [shape for shape in shapes if shape.leaving is not Leaving.UNDECIDED]
    if not decided:
        return failures[-1]
    kinds = {shape.leaving: sum(other.leaving is shape.leaving for other in decided) for shape in decided}
    counts = ", ".join(f"{kind} in {number}" for kind, number in kinds.items())
    rest = len(failures) - len(decided)
    return NoConvergenceError(
        f"two modes lose their stability at once; of {len(failures)} directions between them the branch is {counts}"
        + (f", undecided in {rest}" if rest else "")
        + f" ({decided[0].how})"
    )
