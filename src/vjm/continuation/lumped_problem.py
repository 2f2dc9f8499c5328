"""A lumped model under a load case, as a problem whose path can be followed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from vjm.continuation.bordered_newton import Border, solve_bordered
from vjm.continuation.path import Equilibrium, StationLabel
from vjm.errors import NoConvergenceError
from vjm.model.applied_loads import NO_LOADS, loading_of
from vjm.model.end_condition import held
from vjm.model.load_case import LoadCase, PointControl
from vjm.model.lumped import LumpedModel
from vjm.rotations import Array, displaced
from vjm.statics.equilibrium import Configuration, solve_newton
from vjm.statics.stability import Stability, critical_modes, stability
from vjm.statics.stiffness import loaded_stiffness

ROUNDING = 1e-10
"""Stiffness, in the model's own units, below which an entry of K^F is zero but for rounding."""
NEUTRAL = 1e-6
"""Eigenvalue over the smallest unloaded one up to which a motion costs nothing. A bowed bar that bends alike in all
planes turns freely about its chord; that the springs' order of turns prefers one plane is not instability."""
DIRECTIONS = 8
"""In which a branch is looked for where two modes lose their stability at once, over half a turn between them."""
FIRST_AMPLITUDE = 1e-3
"""Scaled amplitude of the critical mode at which a crossing branch is first looked for."""
ENTRY = 1e-2
"""Scaled amplitude at which a branch is entered that is followed by its arc: its stability, which grows with the
square, is told apart from what is neutral."""
STEPS_OF_CONSTANT_LOADS = 1e-3
"""Smallest share of the constant loads that is put on at once."""


class LumpedProblem:
    """A lumped model under a load case: `vjm.continuation.load_stepping.Problem` for the virtual joint method.

    A state is the coordinates, the support's wrench and the ramp, ``(n + 7,)``.

    Attributes:
        model: with the support's joints at its end and the load case's loads on its bodies.
        load_case: what is done.
        label: of the engine.
        stations: labels of the rows of the shapes.
    """

    def __init__(self, model: LumpedModel, load_case: LoadCase, label: str, bow: Array | None = None) -> None:
        """Set up the unloaded state.

        Args:
            model: the lumped chain.
            load_case: what is done.
            label: of the engine.
            bow: deflection ``(n,)`` of the coordinates, the support's included, with which the chain is built.

        Raises:
            ValueError: the chain has no such part or posture, or what is free makes it a mechanism.
        """
        self.label = label
        self.load_case = load_case
        x0 = model.configuration(model.chain.posture(load_case.posture))
        self._loading, self._on_tool, self._watched = loading_of(model, x0, load_case)
        self._end_condition = held(model, load_case)
        self.model = self._end_condition.model.under(self._loading)
        self._x0 = self.model.configuration(self.model.chain.posture(load_case.posture))
        if bow is not None:
            self.model = self.model.bent(self.model.natural + bow)
            self._x0 = self._x0 + bow
        # springs that are strained in the posture as drawn
        self._preload = (self.model.natural - self._x0) * np.isin(np.arange(self.model.size), self.model.elastic)
        self.stations = tuple(StationLabel(s.part, s.fraction) for s in model.stations)
        as_drawn = bow is None and not self._end_condition.joints
        self._pose0 = self._end_condition.tool if as_drawn else self.model.kinematics(self._x0).end

    @cached_property
    def _softest(self) -> float:
        """Smallest eigenvalue without any load."""
        bare = self.model.under(NO_LOADS) if len(self._loading) else self.model
        return stability(Configuration(bare, self._x0, np.zeros(6), 0.0, 0)).eigenvalue

    def target(self, ramp: float) -> Array:
        """Frame ``(4, 4)`` of the support at a ramp."""
        return displaced(self._pose0, self.load_case.displacement(ramp))

    def load(self, ramp: float) -> float:
        """Factor on the ramped loads at a ramp."""
        return ramp if self.load_case.load_driven else 0.0

    def at_rest(self) -> Configuration:
        """The posture as drawn, under the loads that act all along.

        Raises:
            NoConvergenceError: they are more than the chain bears.
        """
        if np.any(self._loading.constant) or np.any(self._preload):
            return self._settled()
        return Configuration(self.model, self._x0, np.zeros(6), 0.0, 0)

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
            return self._on_arc(s, start, self.tangent(start) if slope is None else slope)
        if isinstance(self.load_case.control, PointControl):
            ramp, at = solve_bordered(self, x, wrench, ramp, lambda at, _: self._point_border(at, s))
        else:
            ramp, at = s, solve_newton(self.model, self.target(s), x, wrench, load=self.load(s))
        return self.equilibrium(s, at, ramp)

    def switch(self, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
        """A state at ``s`` on the branch that crosses at a bifurcation, without an imperfection.

        The branch is entered by its own amplitude: the component of the motion along the critical mode is
        imposed and the ramp is what results. It grows with the amplitude squared, which gives the amplitude that
        belongs to ``s``.
        """
        return self._firmest(critical, sign, lambda at, mode: self._branch(at, mode, critical, s))

    def enter(self, critical: Equilibrium, sign: int) -> Equilibrium:
        """A state a little way along the branch that crosses at a bifurcation, wherever it leads."""

        def entered(at: Configuration, mode: Array) -> Equilibrium:
            ramp, there = self._on_branch(at, mode, ENTRY, critical.ramp)
            change = self.distance(np.concatenate([there.x - at.x, np.zeros(6), [ramp - critical.ramp]]))
            return self.equilibrium(critical.s + change, there, ramp)

        return self._firmest(critical, sign, entered)

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
        return float(np.linalg.norm(change / self._arc_unit))

    def point(self, s: float, x: Array, wrench: Array) -> Equilibrium:
        """What the path keeps of an equilibrium at the ramp ``s``, coordinates ``(n,)`` and wrench ``(6,)``."""
        return self.equilibrium(s, Configuration(self.model, x, wrench, 0.0, 0, self.load(s)), s)

    def configuration(self, point: Equilibrium) -> Configuration:
        """The joint coordinates and the support's wrench of a point of this problem's path."""
        x, wrench, ramp = self._taken_apart(point.state)
        return Configuration(self.model, x, wrench, point.residual, point.iterations, self.load(ramp))

    def equilibrium(self, s: float, at: Configuration, ramp: float) -> Equilibrium:
        """What the path keeps of a configuration: stiffness (18), stability, shape."""
        K = self._stiffness(at)
        verdict = self._stability(at)
        unstable = verdict.unstable
        if unstable and abs(verdict.eigenvalue) < NEUTRAL * abs(self._softest):
            unstable -= 1
        end_condition = self.target(ramp)
        plain = not self._end_condition.joints
        return Equilibrium(
            s=s,
            displacement=self.load_case.displacement(ramp)
            if plain
            else self._end_condition.displacement(end_condition, at.x),
            wrench=self._wrench(at, end_condition),
            tangent=self._tangent_stiffness(at, K),
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

    def _stiffness(self, at: Configuration) -> Array:
        """K^F (18) ``(6, 6)``: what is zero but for rounding is zero, and nan at a critical point."""
        try:
            K = loaded_stiffness(at)
        except np.linalg.LinAlgError:
            return np.full((6, 6), np.nan)
        unit = self.model.wrench_scale
        K[np.abs(K) < ROUNDING * unit[:, None] * unit / unit[3]] = 0.0
        return K

    def _tangent_stiffness(self, at: Configuration, K: Array) -> float:
        direction = self.load_case.direction
        if not self.load_case.load_driven:
            return float(direction @ K @ direction)
        try:
            dx, _ = self.rate(at)
            work = float(self.model.compiled.ramped(at.x, at.wrench, at.load) @ dx)
        except np.linalg.LinAlgError:
            return 0.0
        return 1.0 / work if work != 0.0 else float("inf")

    def _stability(self, at: Configuration) -> Stability:
        return stability(at, self._device(at))

    def _device(self, at: Configuration) -> Array | None:
        """Generalised forces ``(n,)`` of the device that imposes a point's displacement, where there is one."""
        if not self.load_case.held_by_device:
            return None
        try:
            return self._point_rate(at)
        except np.linalg.LinAlgError:
            return None

    def _wrench(self, at: Configuration, end_condition: Array) -> Array:
        """What acts on the end-effector ``(6,)``: the support's wrench and the loads there, N, N mm, world axes."""
        wrench = self._end_condition.wrench(end_condition, at.x, at.wrench)
        if self._on_tool.any():
            wrench = wrench + self.model.compiled.acting(at.x, at.wrench, at.load)[self._on_tool].sum(axis=0)
        return wrench

    # --- Newton -------------------------------------------------------------------------------------------

    def _taken_apart(self, state: Array) -> tuple[Array, Array, float]:
        n = self.model.size
        return state[:n], state[n : n + 6], float(state[-1])

    @cached_property
    def _arc_unit(self) -> Array:
        """Units ``(n + 7,)`` in which an arc is measured: turns and lengths; the ramp by its end; no forces."""
        return np.concatenate([self.model.coordinate_scale, np.full(6, np.inf), [self.load_case.length]])

    def rate(self, at: Configuration) -> tuple[Array, Array]:
        """Derivatives of coordinates ``(n,)`` and wrench ``(6,)`` by the ramp."""
        compiled = self.model.compiled
        if self.load_case.load_driven:
            load = compiled.ramped(at.x, at.wrench, at.load)
        else:
            load = np.zeros(self.model.size)
        return compiled.response(at.x, at.wrench, load, self.load_case.direction, at.load)

    def _on_arc(self, s: float, start: Equilibrium, slope: Array) -> Equilibrium:
        """Equilibrium on the plane across ``slope`` at the distance ``s − start.s`` from a point."""
        along = slope / self._arc_unit
        row = along / self._arc_unit / (along @ along)
        n, begin = self.model.size, start.state

        def border(at: Configuration, ramp: float) -> Border:
            gone = row[:n] @ (at.x - begin[:n]) + row[-1] * (ramp - begin[-1])
            return Border(s - start.s - float(gone), row[:n], float(row[-1]))

        x, wrench, ramp = self._taken_apart(begin + slope * (s - start.s))
        ramp, at = solve_bordered(self, x, wrench, ramp, border)
        return self.equilibrium(s, at, ramp)

    def _point_rate(self, at: Configuration) -> Array:
        """Derivative ``(n,)`` of the steering displacement by the coordinates."""
        assert isinstance(self.load_case.control, PointControl)
        unit = np.zeros((len(self._loading), 6))
        unit[self._watched, :3] = self.load_case.sign * np.array(self.load_case.control.direction)
        return self.model.compiled.load_forces(at.x, at.wrench, at.load, unit)

    def _gone(self, at: Configuration) -> float:
        """Displacement of the point that steers the path, mm."""
        assert isinstance(self.load_case.control, PointControl)
        here = self.model.compiled.points(at.x, at.wrench, at.load)[self._watched]
        along = self.load_case.sign * np.array(self.load_case.control.direction)
        return float(along @ (here - self._point0))

    @cached_property
    def _point0(self) -> Array:
        """Where the steering point is in the unloaded posture ``(3,)``."""
        result: Array = self.model.compiled.points(self._x0, np.zeros(6), 0.0)[self._watched].copy()
        return result

    def _point_border(self, at: Configuration, s: float) -> Border:
        return Border(
            (s - self._gone(at)) / self.model.chain.characteristic_length,
            self._point_rate(at) / self.model.chain.characteristic_length,
            0.0,
        )

    def _settled(self) -> Configuration:
        """The drawn pose under the constant loads and the springs' preloads, which are put on step by step."""
        loaded = self.model.under(self._loading.gradual())
        at, step = Configuration(loaded, self._x0, np.zeros(6), 0.0, 0, 0.0), 1.0
        while at.load < 1.0:
            load = min(at.load + step, 1.0)
            model = loaded.bent(loaded.natural - (1.0 - load) * self._preload) if np.any(self._preload) else loaded
            try:
                there = solve_newton(model, self._pose0, at.x, at.wrench, load=load)
                lost = stability(there).unstable > 0
            except NoConvergenceError:
                lost = True
            if not lost:
                at = there
                continue
            step = 0.5 * (load - at.load)
            if step < STEPS_OF_CONSTANT_LOADS:
                raise NoConvergenceError(
                    f"the posture does not bear its constant loads: stable up to {at.load:.3g} of them"
                )
        return Configuration(self.model, at.x, at.wrench, at.residual, at.iterations, 0.0)

    # --- branches -----------------------------------------------------------------------------------------

    def _firmest(
        self, critical: Equilibrium, sign: int, branch: Callable[[Configuration, Array], Equilibrium]
    ) -> Equilibrium:
        """The branch that leaves along the critical mode; of two modes at once along the firmest mixture."""
        at = self.configuration(critical)
        modes = critical_modes(at, self._device(at))
        if len(modes) == 1:
            return branch(at, sign * modes[0])
        angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        failure = NoConvergenceError("no branch was found where two modes lose their stability at once")
        found = []
        for angle in angles:
            mode = np.cos(angle) * modes[0] + np.sin(angle) * modes[1]
            try:
                found.append(branch(at, sign * mode))
            except NoConvergenceError as error:
                failure = error
        if not found:
            raise failure
        return min(found, key=lambda point: (point.unstable, -point.eigenvalue))

    def _branch(self, at: Configuration, mode: Array, critical: Equilibrium, s: float) -> Equilibrium:
        """A state at ``s`` on the branch that leaves ``at``, the state of ``critical``, along ``mode``."""
        amplitude = FIRST_AMPLITUDE
        beyond = self._parameter(*self._on_branch(at, mode, amplitude, critical.ramp))
        if beyond <= critical.s:
            raise NoConvergenceError("the crossing branch turns back: the bifurcation is subcritical")
        amplitude *= np.sqrt((s - critical.s) / (beyond - critical.s))
        ramp, near = self._on_branch(at, mode, amplitude, critical.ramp)
        there = self.solve(s, self.equilibrium(self._parameter(ramp, near), near, ramp))
        along = mode @ ((there.state[: self.model.size] - at.x) / self.model.coordinate_scale**2)
        if along < 0.5 * amplitude:
            raise NoConvergenceError("Newton fell back from the crossing branch")
        return there

    def _parameter(self, ramp: float, at: Configuration) -> float:
        """The path's parameter of a state: the ramp, or the displacement of the point that steers."""
        return self._gone(at) if isinstance(self.load_case.control, PointControl) else ramp

    def _on_branch(
        self, at: Configuration, mode: Array, amplitude: float, ramp: float
    ) -> tuple[float, Configuration]:
        """Ramp and configuration at which the motion from ``at`` along ``mode`` has an amplitude."""
        row = mode / self.model.coordinate_scale**2

        def border(there: Configuration, _: float) -> Border:
            return Border(amplitude - float(row @ (there.x - at.x)), row, 0.0)

        return solve_bordered(self, at.x + amplitude * mode, at.wrench, ramp, border)
