"""Change of branch at a bifurcation of a meshed chain, without an imperfection.

A branch is entered by its own amplitude: how far the chain has moved along the critical mode is prescribed and the
ramp is what results.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from vjm.continuation.branch_shape import behind_bifurcation
from vjm.continuation.path import Equilibrium
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_fea.common.beam_statics import BeamStatics
from vjm_fea.common.linearized_statics import Border, Tangent

FIRST_DEFLECTION = 1e-3
"""First guess of the largest deflection on a new branch, over the chain's characteristic length."""
DIRECTIONS = 8
"""In which a branch is looked for where two modes lose their stability at once, over half a turn between them."""
ENTRY = 1e-2
"""Scaled amplitude at which a branch is entered that is followed by its arc."""
LAST_DEFLECTION = 0.2
"""The largest at which it is looked at to tell which way it leads."""
TINY = 1e-5
"""Amplitude, in scaled units, at which a mode's deflection is differenced."""
STILL = 1e-9
"""Largest deflection of a unit mode, over the chain's length, that is none."""
AMPLITUDE_TRIALS = 12
NEAR = 0.1
"""How near to the wanted distance behind the bifurcation the amplitude's search ends, relative."""


class Branching(Protocol):
    """A problem at whose bifurcations the branch is changed, see `vjm_fea.common.beam_problem.BeamProblem`."""

    statics: BeamStatics
    length: float
    load_case: LoadCase

    def solve(self, s: float, start: Equilibrium) -> Equilibrium:
        """Equilibrium at ``s`` from a neighbour."""

    def distance(self, change: Array) -> float:
        """Length of a change of state along an arc."""

    def parameter(self, state: Array) -> float:
        """The path's parameter of a state."""

    def exact(self, state: Array) -> Tangent:
        """The exact tangent at an equilibrium."""

    def device(self, state: Array) -> Array | None:
        """Row of the device that imposes a point's displacement, where there is one."""

    def bordered(self, state: Array, border: Callable[[Array], Border]) -> tuple[Array, int, float]:
        """Equilibrium with one condition more: the state, iterations and residual."""

    def equilibrium(self, s: float, state: Array, iterations: int, error: float) -> Equilibrium:
        """What the path keeps of a state."""


def switch(problem: Branching, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
    """A stable state at ``s`` on the branch that leaves ``critical`` along its softest motion.

    The amplitude is sought at which the path's parameter is ``s``.

    Raises:
        NoConvergenceError: no branch was found, it does not lead onwards, or it is unstable.
    """

    def behind(mode: Array, size: float) -> Equilibrium:
        def at_amplitude(amplitude: float) -> Equilibrium:
            state, iterations, error = _on_branch(problem, critical, mode, amplitude)
            return problem.equilibrium(problem.parameter(state), state, iterations, error)

        unit = problem.length / size
        return behind_bifurcation(
            critical, lambda: _at(problem, critical, s, mode, size), at_amplitude,
            FIRST_DEFLECTION * unit, LAST_DEFLECTION * unit, problem.load_case.length,
        )  # fmt: skip

    return _firmest(problem, critical, sign, behind)


def enter(problem: Branching, critical: Equilibrium, sign: int) -> Equilibrium:
    """A state a little way along the branch that leaves ``critical``, wherever it leads.

    Raises:
        NoConvergenceError: the branch was not found.
    """

    def entered(mode: Array, _: float) -> Equilibrium:
        amplitude = ENTRY / problem.distance(problem.statics.change(critical.state, mode, 0.0, 0.0))
        state, iterations, error = _on_branch(problem, critical, mode, amplitude)
        away = problem.distance(state - critical.state)
        return problem.equilibrium(critical.s + away, state, iterations, error)

    return _firmest(problem, critical, sign, entered)


def _firmest(
    problem: Branching, critical: Equilibrium, sign: int, branch: Callable[[Array, float], Equilibrium]
) -> Equilibrium:
    """The branch that leaves along the critical mode; of two modes at once along the firmest mixture."""
    modes = problem.exact(critical.state).critical_modes(problem.device(critical.state))
    if not modes:
        raise NoConvergenceError("no real mode loses its stability here")
    oriented = [_oriented(problem, critical.state, mode) for mode in modes]
    if len(oriented) == 1:
        mode, size = oriented[0]
        return branch(sign * mode, size)
    failure = NoConvergenceError("no branch was found where two modes lose their stability at once")
    found = []
    (first, size), (second, _) = oriented
    for angle in np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
        try:
            found.append(branch(sign * (np.cos(angle) * first + np.sin(angle) * second), size))
        except NoConvergenceError as error:
            failure = error
    if not found:
        raise failure
    return min(found, key=lambda point: (point.unstable, -point.eigenvalue))


def _at(problem: Branching, critical: Equilibrium, s: float, mode: Array, size: float) -> Equilibrium:
    amplitude = FIRST_DEFLECTION * problem.length / size
    for _ in range(AMPLITUDE_TRIALS):
        state, iterations, error = _on_branch(problem, critical, mode, amplitude)
        reached = problem.parameter(state)
        ratio = (reached - critical.s) / (s - critical.s)
        if ratio <= 0.0:
            raise NoConvergenceError("the crossing branch does not rise where it begins")
        if abs(ratio - 1.0) < NEAR:
            break
        # a symmetric bifurcation: the parameter grows with the amplitude's square
        amplitude *= float(np.clip(ratio**-0.5, 0.1, 10.0))
    else:
        raise NoConvergenceError(f"no amplitude of the buckling mode found for s = {s:.6g}")
    near = problem.equilibrium(reached, state, iterations, error)
    found = problem.solve(s, near)
    if _distance(found.shape, near.shape) > 0.5 * _distance(critical.shape, near.shape):
        raise NoConvergenceError("fell back to the branch that loses its stability")
    if found.unstable != 0:
        raise NoConvergenceError(f"the branch found has {found.unstable} unstable modes")
    return found


def _on_branch(
    problem: Branching, critical: Equilibrium, mode: Array, amplitude: float
) -> tuple[Array, int, float]:
    """The state with a prescribed amplitude of the mode."""
    statics = problem.statics
    row = np.zeros(len(statics.unit))
    row[statics.free] = mode
    # corrections of the state stay across the mode
    return problem.bordered(statics.moved_freely(critical.state, amplitude * mode), lambda _: Border(0.0, row, 0.0))


def _oriented(problem: Branching, state: Array, mode: Array) -> tuple[Array, float]:
    """The motion, its largest deflection component positive, and that component in mm."""
    statics = problem.statics
    ahead, behind = (statics.shape(statics.moved_freely(state, step * mode)) for step in (TINY, -TINY))
    change = ((ahead - behind) / (2.0 * TINY)).ravel()
    largest = float(change[np.argmax(np.abs(change))])
    if abs(largest) < STILL * problem.length:
        raise NoConvergenceError("the critical mode moves no point of the chain")
    return float(np.sign(largest)) * mode, abs(largest)


def _distance(a: Array, b: Array) -> float:
    return float(np.max(np.linalg.norm(a - b, axis=1)))
