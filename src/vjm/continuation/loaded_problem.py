"""A loaded model under a load case, as a problem whose path can be followed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from functools import cached_property, partial
from typing import Generic, TypeVar

import numpy as np

from vjm.continuation.bordered_newton import Border, solve_bordered
from vjm.continuation.branch_shape import (
    LOCATED,
    NEIGHBOUR,
    BranchShape,
    Measure,
    behind_bifurcation,
    branch_shape,
    station_measure,
    stiffest,
)
from vjm.continuation.critical_points import NEUTRAL
from vjm.continuation.path import Equilibrium, StationLabel
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.loaded_model import LoadedModel
from vjm.rotations import Array, displaced
from vjm.statics.equilibrium import Configuration, solve_newton
from vjm.statics.stability import Stability, critical_modes, stability, without_neutral
from vjm.statics.stiffness import loaded_stiffness

ROUNDING = 1e-10
"""Stiffness, in the model's own units, below which an entry of K^F is zero but for rounding."""
AMPLITUDES = np.array([1e-3 * 2.0**k for k in range(8)])
"""Scaled amplitudes of the critical mode at which a crossing branch is looked at, to tell which way it leads."""
DIFFERENCE = 1e-6
"""Scaled step of differences of the residual: errors of its square, and of rounding over it."""
SKETCHED = 1e-3
"""Of eigenvalues of which only a minimum along the path is looked for."""
ENTRY = 1e-2
"""Scaled amplitude at which a branch is entered that is followed by its arc: its stability, which grows with the
square, is distinguishable from what is neutral."""
M = TypeVar("M", bound=LoadedModel)


class LoadedProblem(ABC, Generic[M]):
    """A loaded model under a load case: `vjm.continuation.problem.Problem` for the virtual joint method.

    A state is the coordinates, the support's wrench and the ramp, ``(n + 7,)``.

    Attributes:
        model: a chain's or a manipulator's, with the load case's loads on it.
        load_case: what is done.
        label: of the engine.
        stations: labels of the rows of the shapes.
    """

    def __init__(
        self, model: M, load_case: LoadCase, label: str, stations: tuple[StationLabel, ...], pose: Array
    ) -> None:
        """Bind a model to its load case.

        Args:
            model: with the loads on it.
            load_case: what is done.
            label: of the engine.
            stations: labels of the rows of the shapes.
            pose: frame ``(4, 4)`` of the support from which the displacement counts.
        """
        self.model, self.load_case, self.label, self.stations = model, load_case, label, stations
        self._pose0 = pose

    @abstractmethod
    def at_rest(self) -> Configuration[M]:
        """The posture as drawn, under the loads that act all along.

        Raises:
            NoConvergenceError: they are more than the machine bears.
        """

    @property
    def conservative(self) -> bool:
        """Whether no load turns with its body and none is a moment."""
        return not len(self.model.applied_loads.turning)

    def target(self, ramp: float) -> Array:
        """Frame ``(4, 4)`` of the support at a ramp."""
        return displaced(self._pose0, self.load_case.displacement(ramp))

    def load(self, ramp: float) -> float:
        """Factor on the ramped loads at a ramp."""
        return ramp if self.load_case.load_driven else 0.0

    def unloaded(self) -> Equilibrium:
        """What the path keeps of `at_rest`, where it begins.

        Raises:
            NoConvergenceError: as there.
        """
        return self.equilibrium(0.0, self.at_rest(), 0.0)

    def solve(self, s: float, start: Equilibrium, slope: Array | None = None) -> Equilibrium:
        """Equilibrium at ``s`` by Newton-Raphson from a neighbour, prolonged along its slope."""
        state = start.state if slope is None else start.state + slope * (s - start.s)
        x, wrench, ramp = self._taken_apart(state)
        if self.load_case.by_arc:
            way = self.tangent(start) if slope is None else slope
            ramp, at = self._on_plane(start, way, self.scaled(way), s - start.s)
            return self.equilibrium(s, at, ramp)
        ramp, at = self._solved(s, x, wrench, ramp)
        return self.equilibrium(s, at, ramp)

    def _solved(self, s: float, x: Array, wrench: Array, ramp: float) -> tuple[float, Configuration[M]]:
        """Ramp and configuration at the path's parameter ``s``, from a state near it."""
        return s, solve_newton(self.model, self.target(s), x, wrench, load=self.load(s))

    def switch(self, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
        """A state at ``s`` on the branch that crosses at a bifurcation, without an imperfection.

        The branch is entered by its own amplitude: the component of the motion along the critical mode is
        imposed and the ramp is what results. It grows with the amplitude squared, which gives the amplitude that
        belongs to ``s``.
        """
        at = self.configuration(critical)

        def behind(mode: Array) -> Equilibrium:
            along = self._with_wrench(at, mode)
            direct = partial(self._branch, critical, along, s)
            at_amplitude = partial(self._on_branch, critical, along)
            end = self.load_case.length
            return behind_bifurcation(critical, direct, at_amplitude, along, AMPLITUDES, end, self._measure)

        return stiffest(critical_modes(at, self._device(at)), sign, behind)

    def _measure(self, ahead: Equilibrium, behind: Equilibrium, size: float) -> Measure:
        """The physical amplitude of a branch: the largest deflection of a station."""
        return station_measure(self.stations)(ahead, behind, size)

    def nearest_product(self, point: Equilibrium) -> float:
        """See `vjm.continuation.problem.Problem.nearest_product`; of loads that have a potential only."""
        at = self.configuration(point)
        if not self.conservative or self._device(at) is not None:
            return float("nan")
        try:
            values, _ = self.model.compiled.modes(at.x, at.wrench, 2, at.load, SKETCHED)
        except np.linalg.LinAlgError:
            return 0.0
        return float(np.abs(np.prod(values))) if len(values) == 2 else float("nan")

    def branch_shapes(self, critical: Equilibrium) -> tuple[BranchShape, ...]:
        """How the branches leave a bifurcation along each of its critical modes, wherever they lead.

        The amplitude is the mode's component of the motion, each coordinate in its unit
        `vjm.model.loaded_model.LoadedModel.coordinate_scale`.

        Args:
            critical: an event's point on a path of this problem.

        Example:
            >>> problem = VjmEngine(8).problem(chain, load_case)  # doctest: +SKIP
            >>> event = follow(problem, load_case).critical  # doctest: +SKIP
            >>> print(problem.branch_shapes(event.point)[0])  # doctest: +SKIP
            it is supercritical: the parameter changes by ...
        """
        at = self.configuration(critical)
        modes = (self._with_wrench(at, mode) for mode in critical_modes(at, self._device(at)))
        known = LOCATED * self.load_case.length, AMPLITUDES, self._measure
        return tuple(
            branch_shape(partial(self._on_branch, critical, mode), critical, mode, *known) for mode in modes
        )

    def enter(self, critical: Equilibrium, sign: int) -> Equilibrium:
        """A state a little way along the branch that crosses at a bifurcation, wherever it leads."""
        at = self.configuration(critical)

        def entered(mode: Array) -> Equilibrium:
            along = self._with_wrench(at, mode)
            there = self._on_branch(critical, along, ENTRY, critical.state + ENTRY * along)
            return replace(there, s=critical.s + self.distance(there.state - critical.state))

        return stiffest(critical_modes(at, self._device(at)), sign, entered)

    def tangent(self, point: Equilibrium, along: Array | None = None) -> Array:
        """Derivative ``(n + 7,)`` of the state by the arc's length.

        Args:
            point: an equilibrium.
            along: a change of state ``(n + 7,)`` that tells forwards from backwards; else the ramp grows.

        Raises:
            NoConvergenceError: the point is critical.
        """
        at = self.configuration(point)
        try:
            dx, dF = self.rate(at)
        except np.linalg.LinAlgError:
            raise NoConvergenceError("the path has no one direction at a critical point") from None
        rate = np.concatenate([dx, dF, [1.0]])
        rate /= self.distance(rate)
        if along is not None and (rate / self._arc_unit) @ (along / self._arc_unit) < 0.0:
            rate = -rate
        return rate

    def distance(self, change: Array) -> float:
        """Length of a change of state ``(n + 7,)`` along an arc."""
        return float(np.linalg.norm(self.scaled(change)))

    def scaled(self, change: Array) -> Array:
        """See `vjm.continuation.problem.Problem.scaled`."""
        return np.asarray(change / self._arc_unit, dtype=float)

    def growth(self, point: Equilibrium, change: Array) -> float:
        """See `vjm.continuation.problem.Problem.growth`."""
        return float(change[-1])

    def across(self, start: Equilibrium, slope: Array, step: float) -> Equilibrium:
        """See `vjm.continuation.problem.Problem.across`."""
        along = self.scaled(slope)
        along[-1] = 0.0
        ramp, at = self._on_plane(start, slope, along, step)
        return self.equilibrium(self._parameter(ramp, at), at, ramp)

    def point(self, s: float, x: Array, wrench: Array) -> Equilibrium:
        """What the path keeps of an equilibrium at the ramp ``s``, coordinates ``(n,)`` and wrench ``(6,)``."""
        return self.equilibrium(s, Configuration(self.model, x, wrench, 0.0, 0, self.load(s)), s)

    def configuration(self, point: Equilibrium) -> Configuration[M]:
        """The joint coordinates and the support's wrench of a point of this problem's path."""
        x, wrench, ramp = self._taken_apart(point.state)
        return Configuration(self.model, x, wrench, point.residual, point.iterations, self.load(ramp))

    def equilibrium(self, s: float, at: Configuration[M], ramp: float) -> Equilibrium:
        """What the path keeps of a configuration: stiffness (18), stability, shape."""
        K = self._stiffness(at)
        verdict = self._stability(at)
        unstable = without_neutral(
            verdict.unstable,
            int(-NEUTRAL * abs(self._smallest_eigenvalue) < verdict.eigenvalue < 0.0),
            self.conservative,
        )
        return Equilibrium(
            s=s,
            displacement=self._displacement(at, ramp),
            wrench=self._wrench(at, ramp),
            tangent=self._tangent_stiffness(at, K, verdict.eigenvalue),
            eigenvalue=verdict.eigenvalue,
            unstable=unstable,
            iterations=at.iterations,
            residual=at.residual,
            # without the support, which is behind the chain
            shape=self.model.compiled.shape(at.x)[: len(self.stations)],
            state=np.concatenate([at.x, at.wrench, [ramp]]),
            stiffness=K,
            ramp=ramp,
        )

    # --- what is kept of a state --------------------------------------------------------------------------

    def _stiffness(self, at: Configuration[M]) -> Array:
        """K^F (18) ``(6, 6)``: what is zero but for rounding is zero, and nan at a critical point."""
        try:
            K = loaded_stiffness(at)
        except np.linalg.LinAlgError:
            return np.full((6, 6), np.nan)
        unit = self.model.wrench_scale
        K[np.abs(K) < ROUNDING * unit[:, None] * unit / unit[3]] = 0.0
        return K

    @abstractmethod
    def _displacement(self, at: Configuration[M], ramp: float) -> Array:
        """How far the end-effector has come from its unloaded pose ``(6,)``, mm, rad."""

    @abstractmethod
    def _wrench(self, at: Configuration[M], ramp: float) -> Array:
        """What acts on the end-effector ``(6,)``: the support's wrench and the loads there, N, N mm, world axes."""

    @abstractmethod
    def _tangent_stiffness(self, at: Configuration[M], K: Array, eigenvalue: float) -> float:
        """Change of the driven force by the driven displacement.

        Args:
            at: a state.
            K: its stiffness ``(6, 6)``.
            eigenvalue: nearest zero, of the second variation there.
        """

    @property
    @abstractmethod
    def _smallest_eigenvalue(self) -> float:
        """Smallest eigenvalue without any load."""

    def _device(self, at: Configuration[M]) -> Array | None:
        """Generalised forces ``(n,)`` of the device that imposes a point's displacement, where there is one."""
        return None

    def _stability(self, at: Configuration[M]) -> Stability:
        return stability(at, self._device(at))

    # --- Newton -------------------------------------------------------------------------------------------

    def _taken_apart(self, state: Array) -> tuple[Array, Array, float]:
        n = self.model.size
        return state[:n], state[n : n + 6], float(state[-1])

    @cached_property
    def _arc_unit(self) -> Array:
        """Units ``(n + 7,)`` in which an arc is measured: turns and lengths; the ramp by its end; no forces."""
        return np.concatenate([self.model.coordinate_scale, np.full(6, np.inf), [self.load_case.length]])

    def rate(self, at: Configuration[M]) -> tuple[Array, Array]:
        """Derivatives of coordinates ``(n,)`` and wrench ``(6,)`` by the ramp."""
        compiled = self.model.compiled
        if self.load_case.load_driven:
            load = compiled.ramped(at.x, at.wrench, at.load)
        else:
            load = np.zeros(self.model.size)
        return compiled.response(at.x, at.wrench, load, self.load_case.direction, at.load)

    def _on_plane(
        self, start: Equilibrium, slope: Array, along: Array, step: float
    ) -> tuple[float, Configuration[M]]:
        """Ramp and equilibrium on the plane across ``along`` (units of an arc), near a step along ``slope``."""
        row = along / self._arc_unit / (along @ along)
        n, begin = self.model.size, start.state

        def border(at: Configuration[M], ramp: float) -> Border:
            gone = row[:n] @ (at.x - begin[:n]) + row[-1] * (ramp - begin[-1])
            return Border(step - float(gone), row[:n], float(row[-1]))

        x, wrench, ramp = self._taken_apart(begin + slope * step)
        return solve_bordered(self, x, wrench, ramp, border)

    # --- branches -----------------------------------------------------------------------------------------

    def _with_wrench(self, at: Configuration[M], mode: Array) -> Array:
        """Change of the whole state ``(n + 7,)`` along a critical mode ``(n,)``: the support's wrench changes too.

        The wrench is the one that keeps the joints in equilibrium, by differences of the residual.
        """
        compiled, unit = self.model.compiled, self.model.coordinate_scale
        moves = np.isfinite(unit)
        target = self._pose0  # the gap, in which alone it counts, is not asked for

        def statics(x: Array, wrench: Array) -> Array:
            return compiled.residual(x, wrench, target, at.load)[0][moves] * unit[moves]

        ahead, behind = (statics(at.x + step * mode, at.wrench) for step in (DIFFERENCE, -DIFFERENCE))
        by_mode = (ahead - behind) / (2.0 * DIFFERENCE)
        scale = self.model.wrench_scale
        none = statics(at.x, at.wrench)
        by_wrench = np.array(
            [statics(at.x, at.wrench + DIFFERENCE * part) - none for part in np.diag(scale)]
        ).T / DIFFERENCE  # fmt: skip
        change = scale * np.linalg.lstsq(by_wrench, -by_mode, rcond=DIFFERENCE)[0]
        return np.concatenate([mode, change, [0.0]])

    def _branch(self, critical: Equilibrium, mode: Array, s: float) -> Equilibrium:
        """A state at ``s`` on the branch that leaves a bifurcation along ``mode`` (n + 7,)."""
        amplitude = AMPLITUDES[0]
        beyond = self._on_branch(critical, mode, amplitude, critical.state + amplitude * mode).s
        if beyond <= critical.s:
            raise NoConvergenceError("the crossing branch does not rise where it begins")
        amplitude *= np.sqrt((s - critical.s) / (beyond - critical.s))
        near = self._on_branch(critical, mode, amplitude, critical.state + amplitude * mode)
        there = self.solve(s, near)
        gone = float(self._row(mode) @ (there.state - critical.state))
        if gone < 0.5 * amplitude or self.distance(there.state - critical.state) > NEIGHBOUR * amplitude:
            raise NoConvergenceError("Newton fell back from the crossing branch")
        return there

    def _parameter(self, ramp: float, at: Configuration[M]) -> float:
        """The path's parameter of a state: the ramp, or the controlled displacement."""
        return ramp

    def _row(self, mode: Array) -> Array:
        """Row ``(n + 7,)`` that gives a change of state's component along a critical mode ``(n + 7,)``."""
        n = self.model.size
        return np.concatenate([mode[:n] / self.model.coordinate_scale**2, np.zeros(7)])

    def _on_branch(self, critical: Equilibrium, mode: Array, amplitude: float, near: Array) -> Equilibrium:
        """The state at which the motion from a bifurcation along ``mode`` has an amplitude.

        Args:
            critical: the bifurcation.
            mode: ``(n + 7,)``.
            amplitude: of either sign.
            near: a state ``(n + 7,)`` to start from.

        Raises:
            NoConvergenceError: none was found, or not near the bifurcation.
        """
        row, begin = self._row(mode)[: self.model.size], self._taken_apart(critical.state)[0]

        def border(there: Configuration[M], _: float) -> Border:
            return Border(amplitude - float(row @ (there.x - begin)), row, 0.0)

        x, wrench, ramp = self._taken_apart(near)
        ramp, there = solve_bordered(self, x, wrench, ramp, border)
        point = self.equilibrium(self._parameter(ramp, there), there, ramp)
        if self.distance(point.state - critical.state) > NEIGHBOUR * abs(amplitude):
            raise NoConvergenceError("the state found on the crossing branch is a jump away")
        return point
