"""Load paths on a given grid, as arrays: equilibrium, stiffness and stability at thousands of displacements.

The paper's own experiment is of this kind. `vjm.continuation.load_stepping.follow` chooses its points itself and
keeps an object a point; here the compiled march does all points between two bifurcations in one call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.continuation.events import bifurcation
from vjm.continuation.load_stepping import StepControl
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium
from vjm.errors import NoConvergenceError
from vjm.kernels.machine_solver import March
from vjm.rotations import Array
from vjm.statics import MAX_ITERATIONS, TOLERANCE

HALVINGS, FIRST = 10, 2
"""Of a step of the grid that is too long for Newton's method; and of one behind which a path seems unstable.

That one has most often ended on another branch. To look for a bifurcation there takes as long as a path."""


@dataclass(frozen=True)
class BranchChange:
    """Where a path changes its branch.

    Attributes:
        s: path parameter of the bifurcation.
        behind: stable state just behind it.
    """

    s: float
    behind: Equilibrium


@dataclass(frozen=True)
class GridPath:
    """The stable equilibria on a grid; g points.

    Attributes:
        s: path parameter ``(g,)``, as far as the path goes.
        wrench: ``(g, 6)`` N, N mm.
        stiffness: loaded stiffness K^F ``(g, 6, 6)``.
        x: coordinates ``(g, n)``.
        residual: scaled ``(g,)``.
        iterations: of Newton's method ``(g,)``.
        turns: at which the path changed its branch.
        stopped: why the path ends before its grid does; empty where it does not.
    """

    s: Array
    wrench: Array
    stiffness: Array
    x: Array
    residual: Array
    iterations: np.ndarray
    turns: tuple[BranchChange, ...]
    stopped: str


def trace_grid(problem: LumpedProblem, grid: Array, known: Sequence[BranchChange] = ()) -> GridPath:
    """Trace the stable path through a grid of displacements.

    Args:
        problem: a lumped model in a posture under a ramp.
        grid: path parameters ``(g,)``, increasing from zero, in steps that Newton's method can take.
        known: where the same path changed its branch on another grid; these are not looked for again.
    """
    grid = np.asarray(grid, dtype=float)
    compiled, n = problem.model.compiled, problem.model.size
    pieces: list[tuple[Array, ...]] = []
    turns: list[BranchChange] = []
    rest = problem.at_rest()
    shortest = float(np.diff(grid).min(initial=np.inf)) / 2**HALVINGS
    begin, x, wrench, index, own, stopped = 0.0, rest.x, rest.wrench, 0, False, ""
    while True:
        # behind a bifurcation, and between two points, the march begins beside the grid; that point is left out
        s = np.concatenate([[begin], grid[index + (0 if own else 1) :]])
        origin = turns[-1].s if turns else -np.inf
        march = compiled.march(
            problem.target(0.0), problem.load_case.direction, s, x, wrench, TOLERANCE, MAX_ITERATIONS, origin
        )
        columns = (s, march.x, march.wrench, march.stiffness, march.residual, march.iterations)
        pieces.append(tuple(column[own : march.good] for column in columns))
        if not march.why:
            break
        last, own = s[march.good - 1], True
        turn = next((t for t in known if last < t.s < s[march.good]), None)
        why = f"no equilibrium found beyond {last:.6g}: {march.why}"
        if turn is None:
            # Newton's method does not follow so long a step, or ends on another branch
            most, half = HALVINGS if s[march.good] - last > shortest else 0, None
            if march.why == "unstable":
                half = _halfway(problem, s, march, origin, min(FIRST, most), whole=True)
                try:
                    turn = _next_branch(problem, s, march) if half is None else None
                except NoConvergenceError as failure:
                    why = f"no stable branch leads on beyond {last:.6g}: {failure}"
        if turn is None:
            half = half or _halfway(problem, s, march, origin, most)
            if half is None:
                stopped = why
                break
            begin, x, wrench = half
            index = int(np.searchsorted(grid, begin, side="right"))
            continue
        turns.append(turn)
        begin, state = turn.behind.s, turn.behind.state
        x, wrench = state[:n], state[n : n + 6]
        index = int(np.searchsorted(grid, begin, side="right"))
    s, X, F, K, error, iterations = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return GridPath(s, F, K, X, error, iterations, tuple(turns), stopped)


def _halfway(
    problem: LumpedProblem, grid: Array, march: March, origin: float, most: int, *, whole: bool = False
) -> tuple[float, Array, Array] | None:
    """Place, coordinates and wrench just before a point to which a step was too long; None where none is known.

    The step is halved so often at ``most``; with ``whole`` shorter ones must come to its end.
    """
    i = march.good - 1
    for halvings in range(1, most + 1):
        s = np.linspace(grid[i], grid[i + 1], 2**halvings + 1)
        refined = problem.model.compiled.march(
            problem.target(0.0), problem.load_case.direction, s, march.x[i], march.wrench[i], TOLERANCE,
            MAX_ITERATIONS, origin,
        )  # fmt: skip
        # what becomes unstable on the way is met again from there
        short = 0 if whole or refined.why != "unstable" else refined.good - 1
        k = len(s) - 2 if not refined.why else short
        if k:
            return float(s[k]), refined.x[k], refined.wrench[k]
    return None


def _next_branch(problem: LumpedProblem, s: Array, march: March) -> BranchChange:
    """The bifurcation between two points of the march, and a stable state just behind it."""
    a, b = (problem.point(float(s[i]), march.x[i], march.wrench[i]) for i in (march.good - 1, march.good))
    critical = bifurcation(problem, a, b)
    behind = critical.s * (1.0 + StepControl.behind)
    point = problem.switch(critical, behind, problem.load_case.branch)
    if point.unstable:
        raise NoConvergenceError("the branch that crosses is unstable")
    return BranchChange(critical.s, point)
