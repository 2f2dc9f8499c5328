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

HALVINGS = 6
"""Of a step of the grid that is too long for Newton's method."""


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

    @property
    def bifurcations(self) -> tuple[float, ...]:
        """Path parameters at which the path changed its branch."""
        return tuple(turn.s for turn in self.turns)


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
    begin, x, wrench, at, own, stopped = 0.0, rest.x, rest.wrench, 0, False, ""
    while True:
        # behind a bifurcation, and between two points, the march begins beside the grid; that point is left out
        s = np.concatenate([[begin], grid[at + (0 if own else 1) :]])
        origin = turns[-1].s if turns else -np.inf
        found = compiled.march(
            problem.target(0.0), problem.load_case.direction, s, x, wrench, TOLERANCE, MAX_ITERATIONS, origin
        )
        columns = (s, found.x, found.wrench, found.stiffness, found.residual, found.iterations)
        pieces.append(tuple(column[own : found.good] for column in columns))
        if not found.why:
            break
        last, own = s[found.good - 1], True
        if found.why != "unstable":
            half = _halfway(problem, last, s[found.good], found, origin)
            if half is None:
                stopped = f"no equilibrium found beyond {last:.6g}: {found.why}"
                break
            begin, x, wrench = half
            at = int(np.searchsorted(grid, begin, side="right"))
            continue
        turn = next((t for t in known if last < t.s < s[found.good]), None)
        try:
            turn = turn or _next_branch(problem, s, found)
        except NoConvergenceError as failure:
            stopped = f"no stable branch leads on beyond {last:.6g}: {failure}"
            break
        turns.append(turn)
        begin, state = turn.behind.s, turn.behind.state
        x, wrench = state[:n], state[n : n + 6]
        at = int(np.searchsorted(grid, begin, side="right"))
    s, X, F, K, error, iterations = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return GridPath(s, F, K, X, error, iterations, tuple(turns), stopped)


def _halfway(
    problem: LumpedProblem, last: float, ahead: float, found: March, origin: float
) -> tuple[float, Array, Array] | None:
    """Place, coordinates and wrench just before a point to which a step was too long; None where none is known."""
    x, wrench = found.x[found.good - 1], found.wrench[found.good - 1]
    for halvings in range(1, HALVINGS + 1):
        s = np.linspace(last, ahead, 2**halvings + 1)
        there = problem.model.compiled.march(
            problem.target(0.0), problem.load_case.direction, s, x, wrench, TOLERANCE, MAX_ITERATIONS, origin
        )
        # what becomes unstable on the way is met again from there
        k = len(s) - 2 if not there.why else there.good - 1 if there.why == "unstable" else 0
        if k:
            return float(s[k]), there.x[k], there.wrench[k]
    return None


def _next_branch(problem: LumpedProblem, s: Array, found: March) -> BranchChange:
    """The bifurcation between two points of the march, and a stable state just behind it."""
    a, b = (problem.point(float(s[i]), found.x[i], found.wrench[i]) for i in (found.good - 1, found.good))
    critical = bifurcation(problem, a, b)
    behind = critical.s * (1.0 + StepControl.behind)
    there = problem.switch(critical, behind, problem.load_case.branch)
    if there.unstable:
        raise NoConvergenceError("the branch that crosses is unstable")
    return BranchChange(critical.s, there)
