"""Change of branch at a bifurcation of a meshed chain, without an imperfection.

A branch is entered by its own amplitude: how far the chain has moved along the critical mode is prescribed and the
ramp is what results.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from vjm.continuation.branch_shape import NEIGHBOUR, behind_bifurcation, station_measure, stiffest
from vjm.continuation.path import Equilibrium, StationLabel
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_fea.common.beam_statics import BeamStatics
from vjm_fea.common.linearized_statics import ScaledBorder, Tangent

DEFLECTIONS = np.array([1e-3 * 2.0**k for k in range(8)])
"""Largest deflections, over the chain's length, at which a crossing branch is looked at to tell how it leaves."""
ENTRY = 1e-2
"""Scaled amplitude at which a branch is entered that is followed by its arc."""
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
    stations: tuple[StationLabel, ...]

    def solve(self, s: float, start: Equilibrium) -> Equilibrium:
        """Equilibrium at ``s`` from a neighbour."""

    def distance(self, change: Array) -> float:
        """Length of a change of state along an arc."""

    def scaled(self, change: Array) -> Array:
        """A change of state in the units of an arc, of which `distance` is the length."""

    def followed(self, state: Array) -> Array:
        """A state that was added up of others as one that is a state, its support where its ramp has it."""

    def parameter(self, state: Array) -> float:
        """The path's parameter of a state."""

    def exact(self, state: Array) -> Tangent:
        """The exact tangent at an equilibrium."""

    def device(self, state: Array) -> Array | None:
        """Row of the device that imposes a point's displacement, where there is one."""

    def bordered(self, state: Array, border: Callable[[Array], ScaledBorder]) -> tuple[Array, int, float]:
        """Equilibrium with one condition more: the state, iterations and residual."""

    def equilibrium(self, s: float, state: Array, iterations: int, error: float) -> Equilibrium:
        """What the path keeps of a state."""


def switch(problem: Branching, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
    """A stable state at ``s`` on the branch that leaves ``critical`` along the motion of its smallest eigenvalue.

    The amplitude is sought at which the path's parameter is ``s``.

    Raises:
        NoConvergenceError: no branch was found, it does not lead onwards, or it is unstable.
    """
    modes, size = _modes(problem, critical)
    sizes = DEFLECTIONS * problem.length / size

    def behind(mode: Array) -> Equilibrium:
        def at_amplitude(amplitude: float, near: Array) -> Equilibrium:
            return _on_branch(problem, critical, mode, amplitude, near)

        change = problem.statics.change(critical.state, mode, 0.0, 0.0)
        return behind_bifurcation(
            critical, lambda: _at(problem, critical, s, mode, sizes[0]), at_amplitude, change, sizes,
            problem.load_case.length, station_measure(problem.stations),
        )  # fmt: skip

    return stiffest(modes, sign, behind)


def enter(problem: Branching, critical: Equilibrium, sign: int) -> Equilibrium:
    """A state a little way along the branch that leaves ``critical``, wherever it leads.

    Raises:
        NoConvergenceError: the branch was not found.
    """

    def entered(mode: Array) -> Equilibrium:
        amplitude = ENTRY / problem.distance(problem.statics.change(critical.state, mode, 0.0, 0.0))
        there = _on_branch(problem, critical, mode, amplitude)
        return replace(there, s=critical.s + problem.distance(there.state - critical.state))

    return stiffest(_modes(problem, critical)[0], sign, entered)


def _modes(problem: Branching, critical: Equilibrium) -> tuple[list[Array], float]:
    """The critical motions, their largest deflection component positive, and that component of the first in mm."""
    modes = problem.exact(critical.state).critical_modes(problem.device(critical.state))
    if not modes:
        raise NoConvergenceError("no real mode loses its stability here")
    oriented = [_oriented(problem, critical.state, mode) for mode in modes]
    return [mode for mode, _ in oriented], oriented[0][1]


def _at(problem: Branching, critical: Equilibrium, s: float, mode: Array, amplitude: float) -> Equilibrium:
    """The state at ``s``, by the amplitude that belongs to it, beginning with one."""
    for _ in range(AMPLITUDE_TRIALS):
        near = _on_branch(problem, critical, mode, amplitude)
        ratio = (near.s - critical.s) / (s - critical.s)
        if ratio <= 0.0:
            raise NoConvergenceError("the crossing branch does not rise where it begins")
        if abs(ratio - 1.0) < NEAR:
            break
        # a symmetric bifurcation: the parameter grows with the amplitude's square
        amplitude *= float(np.clip(ratio**-0.5, 0.1, 10.0))
    else:
        raise NoConvergenceError(f"no amplitude of the buckling mode found for s = {s:.6g}")
    found = problem.solve(s, near)
    if _distance(found.shape, near.shape) > 0.5 * _distance(critical.shape, near.shape):
        raise NoConvergenceError("fell back to the branch that loses its stability")
    if found.unstable != 0:
        raise NoConvergenceError(f"the branch found has {found.unstable} unstable modes")
    return found


def _on_branch(
    problem: Branching, critical: Equilibrium, mode: Array, amplitude: float, near: Array | None = None
) -> Equilibrium:
    """The state with a prescribed amplitude of the mode, from one near it.

    Raises:
        NoConvergenceError: none was found, or not near the bifurcation.
    """
    statics = problem.statics
    along = problem.scaled(statics.change(critical.state, mode, 0.0, 0.0))
    row = problem.scaled(along) / float(along @ along)

    def border(state: Array) -> ScaledBorder:
        return ScaledBorder(amplitude - float(row @ (state - critical.state)), *statics.gradient(state, row))

    start = statics.moved_freely(critical.state, amplitude * mode) if near is None else problem.followed(near)
    state, iterations, error = problem.bordered(start, border)
    point = problem.equilibrium(problem.parameter(state), state, iterations, error)
    if problem.distance(state - critical.state) > NEIGHBOUR * abs(amplitude) * float(np.linalg.norm(along)):
        raise NoConvergenceError("the state found on the crossing branch is a jump away")
    return point


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
