"""A lumped machine under a load case, as a problem whose path can be followed.

The same machine is also built with a deflection in the shape in which the perfect one buckles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from vjm.continuation.arc_length import ArcControl, trace
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
from vjm.continuation.events import NEUTRAL
from vjm.continuation.one_path import foresee
from vjm.continuation.path import Equilibrium, EventKind, Path, StationLabel, driven_force
from vjm.errors import NoConvergenceError
from vjm.kernels.entry_points import Limits
from vjm.model.end_condition import deflects, held
from vjm.model.law_states import LawState, free_words, law_states
from vjm.model.load_case import COMPONENTS, LoadCase, PointControl
from vjm.model.mechanism import NO_LOADS, Mechanism, loading_of
from vjm.model.parts import Joint
from vjm.rank import NEGLIGIBLE, SUM_ROUNDING
from vjm.rotations import Array, displaced
from vjm.statics import (
    MAX_ITERATIONS,
    NO_MOTION,
    TOLERANCE,
    Configuration,
    Stability,
    critical_modes,
    loaded_stiffness,
    near_critical,
    solve_newton,
    stability,
    without_neutral,
)

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
SHARED = tuple(field.name for field in fields(LoadCase) if field.name not in ("to", "axis", "branch"))
"""What ramps of one machine in one posture do not differ in."""
STEPS_OF_CONSTANT_LOADS = 1e-3
"""Smallest share of the constant loads that is put on at once."""


DIVERGED = 1e6
"""Scaled residual from which Newton's method does not come back."""
NUDGE = 1e-9
"""Change of the ramp, over its end, that leaves a state which is singular to the last digit."""


class Border(NamedTuple):
    """A condition on the state beside equilibrium, linearised: ``row · δx + at_ramp δramp = missing``."""

    missing: float
    row: Array
    at_ramp: float


class LumpedProblem:
    """A lumped machine under a load case: `vjm.continuation.events.Problem` for the virtual joint method.

    A state is the coordinates, the support's wrench and the ramp, ``(n + 7,)``.

    Attributes:
        model: with the support's joints at its end and the load case's loads on its bodies.
        load_case: what is done.
        label: of the engine.
        stations: labels of the rows of the shapes.
    """

    def __init__(self, model: Mechanism, load_case: LoadCase, label: str, bow: Array | None = None) -> None:
        """Set up the unloaded state.

        Args:
            model: the lumped chain.
            load_case: what is done.
            label: of the engine.
            bow: deflection ``(n,)`` of the coordinates, the support's included, with which the chain is built.

        Raises:
            ValueError: the chain has no such part or posture, or the ramped load moves nothing.
            MechanismError: what is free makes it a mechanism.
        """
        if _moves_nothing(load_case):
            raise ValueError(
                "the ramped load acts on held components only: free those that it drives, as "
                "`validate curve --free` does"
            )
        x0 = model.configuration(model.chain.posture(load_case.posture))
        self._loading, self._on_tool, self._watched = loading_of(model, x0, load_case)
        self._end_condition = held(model, load_case)
        loaded = self._end_condition.model.under(self._loading)
        self._x0 = loaded.configuration(loaded.chain.posture(load_case.posture))
        if bow is not None:
            loaded = loaded.with_rest_shape(loaded.natural + bow)
            self._x0 = self._x0 + bow
        self._alone = model.under(self._loading).with_rest_shape(self._end_condition.alone(loaded.natural))
        # a bow that is built into closed loops leaves them open, and the end-effector is to be where it was
        stands = bow is None or model.chain.closes
        pose = self._end_condition.support if stands else loaded.kinematics(self._x0).end
        stations = tuple(StationLabel(s.part, s.fraction) for s in model.stations)
        self.model, self.load_case, self.label, self.stations = loaded, load_case, label, stations
        # of the support, from which the displacement counts
        self._pose0 = pose

    def along(self, load_case: LoadCase) -> LumpedProblem:
        """The same machine in the same posture on another ramp of displacements; what it is made of is shared.

        Args:
            load_case: differs from the own one in ``to``, ``axis`` and ``branch`` alone.

        Raises:
            ValueError: it differs in more, or one of both is driven by loads.
        """
        own, given = ([getattr(case, name) for name in SHARED] for case in (self.load_case, load_case))
        if own != given or self.load_case.load_driven or load_case.load_driven:
            raise ValueError("a problem is shared by ramps of displacements that differ in nothing else")
        other = copy(self)
        other.load_case = load_case
        return other

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

    def law_states(self, point: Equilibrium) -> list[LawState]:
        """See `vjm.continuation.events.WithLaws`."""
        return self._law_states(point.state)

    def _law_states(self, state: Array) -> list[LawState]:
        return law_states(self._alone, self._end_condition.alone(state[: self.model.size]))

    def law_rates(self, point: Equilibrium, along: Array) -> Array:
        """See `vjm.continuation.events.WithLaws`."""
        way = self.tangent(point, along)
        way *= DIFFERENCE / np.abs(self.scaled(way)).max()
        grown = self.distance(way) if self.load_case.by_arc else self.growth(point, way)
        if grown == 0.0:
            raise NoConvergenceError("the ramp turns at this point: it has no rates")
        ahead, behind = (
            np.array([law.deflection for law in self._law_states(point.state + step)]) for step in (way, -way)
        )
        return np.asarray((ahead - behind) / (2.0 * grown))

    def at_rest(self) -> Configuration:
        """The posture as drawn, under the loads that act all along.

        Raises:
            NoConvergenceError: they are more than the machine bears.
        """
        if np.any(self._loading.constant) or self.model.prestressed(self._x0) or self._open:
            return self._settled()
        return Configuration(self.model, self._x0, np.zeros(6), 0.0, 0)

    @property
    def _open(self) -> bool:
        """Whether errors of assembly, or a bow that is built in, leave the loops open as drawn."""
        if not self.model.chain.closes:
            return False
        return self.model.compiled.residual(self._x0, np.zeros(6), self._pose0)[2] > TOLERANCE

    def _settled(self) -> Configuration:
        """The drawn pose under the constant loads and the springs' preloads, which are put on step by step."""
        loaded = self.model.under(self._loading.gradual())
        # tangents of laws that bend within a step foresee nothing of it: there both ends are stable, and no more
        bends = self._open or any(spring.law for spring in loaded.chain.point_springs) or not loaded.plain
        prestressed = loaded.prestressed(self._x0)
        start = loaded.partially_unloaded(self._x0, 0.0) if prestressed else loaded
        state, step = Configuration(start, self._x0, np.zeros(6), 0.0, 0, 0.0), 1.0
        while state.load < 1.0:
            load = min(state.load + step, 1.0)
            model = loaded.partially_unloaded(self._x0, load) if prestressed else loaded
            try:
                next_state = solve_newton(model, self._pose0, state.x, state.wrench, load=load)
                lost = stability(next_state).unstable > 0 or not (bends or self._leads(state, next_state))
            except (NoConvergenceError, np.linalg.LinAlgError):
                lost = True
            if not lost:
                state = next_state
                continue
            step = 0.5 * (load - state.load)
            if step < STEPS_OF_CONSTANT_LOADS:
                borne = "constant loads" if np.any(self._loading.constant) or prestressed else "errors of assembly"
                raise NoConvergenceError(
                    f"the posture does not bear its {borne}: stable up to {state.load:.3g} of them"
                )
        return Configuration(self.model, state.x, state.wrench, state.residual, state.iterations, 0.0)

    def _leads(self, state: Configuration, next_state: Configuration) -> bool:
        """Whether one state leads to another as the constant loads grow: both foresee the motion between them.

        Raises:
            numpy.linalg.LinAlgError: one is critical.
        """
        scale = self.model.coordinate_scale
        chord = (next_state.x - state.x) / scale
        if np.linalg.norm(chord) <= NEGLIGIBLE:
            return True

        def way(begin: Configuration, end: Configuration) -> Array:
            solver = end.model.compiled
            statics, gap, _ = solver.residual(begin.x, begin.wrench, self._pose0, end.load)
            return solver.response(begin.x, begin.wrench, statics, gap, end.load)[0] / scale

        return foresee(chord, way(state, next_state), -way(next_state, state))

    def unloaded(self) -> Equilibrium:
        """What the path keeps of `at_rest`, where it begins.

        Raises:
            NoConvergenceError: as there, or nothing holds the machine where laws of its springs have no slope.
        """
        point = self.equilibrium(0.0, self.at_rest(), 0.0)
        free = free_words(self.law_states(point))
        # it is nan where the imposed pose leaves no motion
        if free and point.eigenvalue <= 0.0:
            raise NoConvergenceError(
                f"nothing holds the machine where the path begins: {free}. Let it begin under loads that act "
                "all along, or with a preload"
            )
        return point

    def solve(self, s: float, start: Equilibrium, slope: Array | None = None) -> Equilibrium:
        """Equilibrium at ``s`` by Newton-Raphson from a neighbour, prolonged along its slope."""
        state = start.state if slope is None else start.state + slope * (s - start.s)
        x, wrench, ramp = self._taken_apart(state)
        if self.load_case.by_arc:
            way = self.tangent(start) if slope is None else slope
            ramp, configuration = self._on_plane(start, way, self.scaled(way), s - start.s)
            return self.equilibrium(s, configuration, ramp)
        ramp, configuration = self._solved(s, x, wrench, ramp)
        return self.equilibrium(s, configuration, ramp)

    def _bordered(
        self, x: Array, wrench: Array, ramp: float, border: Callable[[Configuration, float], Border]
    ) -> tuple[float, Configuration]:
        """Equilibrium with one more condition at a state and a ramp, and the ramp that it takes, from those given.

        Two solutions with the factored tangent, for the residual and for the ramp, and a scalar equation for the
        ramp: regular at critical points.

        Raises:
            NoConvergenceError: none was found.
        """
        compiled = self.model.compiled
        error = before = np.inf
        for iteration in range(MAX_ITERATIONS):
            load = self.load(ramp)
            statics, gap, error = compiled.residual(x, wrench, self.target(ramp), load)
            state = Configuration(self.model, x, wrench, error, iteration, load)
            if not error < DIVERGED:
                break
            try:
                missing, row, at_ramp = border(state, ramp)
                # a Newton iteration at least quarters the residual, at a double root too, until it is rounding
                ended = error < TOLERANCE or (0.5 * before <= error and compiled.rounded(x, statics, gap))
                if ended and abs(missing) < TOLERANCE:
                    return ramp, state
                before = error
                dx, dF = compiled.response(x, wrench, statics, gap, load)
                dx_by, dF_by = self.rate(state)
            except np.linalg.LinAlgError:
                ramp += NUDGE * self.load_case.length
                continue
            moves = float(row @ dx_by + at_ramp)
            if abs(moves) <= NO_MOTION * float(np.abs(row) @ np.abs(dx_by) + abs(at_ramp)):
                raise NoConvergenceError(
                    "the controlled displacement does not change along the path: control another point or direction"
                )
            change = float(missing - row @ dx) / moves
            x, wrench, ramp = x + dx + change * dx_by, wrench + dF + change * dF_by, ramp + change
        raise NoConvergenceError(f"Newton did not meet the path's condition (scaled residual {error:.1e})")

    def _solved(self, s: float, x: Array, wrench: Array, ramp: float) -> tuple[float, Configuration]:
        """Ramp and configuration at the path's parameter ``s``, from a state near it."""
        if isinstance(self.load_case.control, PointControl):
            return self._bordered(x, wrench, ramp, lambda at, _: self._point_border(at, s))
        return s, solve_newton(self.model, self.target(s), x, wrench, load=self.load(s))

    def switch(self, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
        """A state at ``s`` on the branch that crosses at a bifurcation, without an imperfection.

        The branch is entered by its own amplitude: the component of the motion along the critical mode is
        imposed and the ramp is what results. It grows with the amplitude squared, which gives the amplitude that
        belongs to ``s``.
        """
        state = self.configuration(critical)

        def behind(mode: Array) -> Equilibrium:
            along = self._with_wrench(state, mode)
            direct = partial(self._branch, critical, along, s)
            at_amplitude = partial(self._on_branch, critical, along)
            end = self.load_case.length
            return behind_bifurcation(critical, direct, at_amplitude, along, AMPLITUDES, end, self._measure)

        return stiffest(critical_modes(state, self._device(state)), sign, behind)

    def _measure(self, ahead: Equilibrium, behind: Equilibrium, size: float) -> Measure:
        """The physical amplitude of a branch: the turn of the joint that turns most, else a deflection."""
        moved = (ahead.state - behind.state) / (2.0 * size)
        built = self._alone.built
        turns = {
            part.name: float(moved[built.spans[part.name].start])
            for part in self._alone.chain.parts
            if isinstance(part, Joint) and not part.slides and len(built.spans[part.name]) == 1
        }
        if not turns or not any(turns.values()):
            return station_measure(self.stations)(ahead, behind, size)
        name = max(turns, key=lambda each: abs(turns[each]))
        return Measure(f"rotation of {name}", "rad", turns[name])

    def nearest_product(self, point: Equilibrium) -> float:
        """See `vjm.continuation.events.Problem.nearest_product`; of loads that have a potential only."""
        state = self.configuration(point)
        if not self.conservative or self._device(state) is not None:
            return float("nan")
        try:
            values, _ = self.model.compiled.modes(state.x, state.wrench, 2, state.load, SKETCHED)
        except np.linalg.LinAlgError:
            return 0.0
        return float(np.abs(np.prod(values))) if len(values) == 2 else float("nan")

    def branch_shapes(self, critical: Equilibrium) -> tuple[BranchShape, ...]:
        """How the branches leave a bifurcation, an event's point on a path, along each of its critical modes."""
        state = self.configuration(critical)
        modes = (self._with_wrench(state, mode) for mode in critical_modes(state, self._device(state)))
        known = LOCATED * self.load_case.length, AMPLITUDES, self._measure
        return tuple(
            branch_shape(partial(self._on_branch, critical, mode), critical, mode, *known) for mode in modes
        )

    def enter(self, critical: Equilibrium, sign: int) -> Equilibrium:
        """A state a little way along the branch that crosses at a bifurcation, wherever it leads."""
        state = self.configuration(critical)

        def entered(mode: Array) -> Equilibrium:
            along = self._with_wrench(state, mode)
            point = self._on_branch(critical, along, ENTRY, critical.state + ENTRY * along)
            return replace(point, s=critical.s + self.distance(point.state - critical.state))

        return stiffest(critical_modes(state, self._device(state)), sign, entered)

    def tangent(self, point: Equilibrium, along: Array | None = None) -> Array:
        """Derivative ``(n + 7,)`` of the state by the arc's length.

        Args:
            point: an equilibrium.
            along: a change of state ``(n + 7,)`` that tells forwards from backwards; else the ramp grows.

        Raises:
            NoConvergenceError: the point is critical.
        """
        state = self.configuration(point)
        try:
            dx, dF = self.rate(state)
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
        """See `vjm.continuation.events.Problem.scaled`."""
        return np.asarray(change / self._arc_unit, dtype=float)

    def growth(self, point: Equilibrium, change: Array) -> float:
        """See `vjm.continuation.events.Problem.growth`."""
        if not isinstance(self.load_case.control, PointControl):
            return float(change[-1])
        state = self.configuration(point)
        return float(self._point_rate(state) @ change[: len(state.x)])

    def across(self, start: Equilibrium, slope: Array, step: float) -> Equilibrium:
        """See `vjm.continuation.events.Problem.across`."""
        along = self.scaled(slope)
        along[-1] = 0.0
        ramp, state = self._on_plane(start, slope, along, step)
        return self.equilibrium(self._parameter(ramp, state), state, ramp)

    def plain_steps(
        self, known: Sequence[Equilibrium], limits: Limits, origin: float, step: float
    ) -> tuple[list[Equilibrium], float]:
        """See `vjm.continuation.load_stepping.Marching`."""
        if not self.load_case.pose_only or self.model.free <= 0 or known[-1].state[-1] != known[-1].s:
            return [], step
        n, direction = self.model.size, self.load_case.direction
        states = np.array([p.state for p in known])
        kept = tuple(np.array([getattr(p, name) for p in known]) for name in ("eigenvalue", "tangent", "shape"))
        rows, step = self.model.compiled.plain_steps(
            self._pose0, direction, np.array([p.s for p in known]), states[:, :n], states[:, n : n + 6],
            (kept[0], kept[1], kept[2]), limits, origin, step,
        )  # fmt: skip
        K = self._without_rounding(rows.stiffness)
        inner = rows.wrench[:, 6:]
        return [
            Equilibrium(
                s=s, displacement=self.load_case.displacement(s), wrench=rows.wrench[i, :6],
                tangent=float(direction @ K[i] @ direction), eigenvalue=float(rows.eigenvalue[i]), unstable=0,
                iterations=int(rows.iterations[i]), residual=float(rows.residual[i]), shape=rows.shape[i],
                state=np.concatenate([rows.x[i], inner[i], rows.wrench[i, :6], [s]]), stiffness=K[i], ramp=s,
            )
            for i, s in enumerate(rows.s.tolist())
        ], step  # fmt: skip

    def point(self, s: float, x: Array, wrench: Array) -> Equilibrium:
        """What the path keeps of an equilibrium at the ramp ``s``, coordinates ``(n,)`` and wrench ``(6,)``."""
        return self.equilibrium(s, Configuration(self.model, x, wrench, 0.0, 0, self.load(s)), s)

    def configuration(self, point: Equilibrium) -> Configuration:
        """The joint coordinates and the support's wrench of a point of this problem's path."""
        x, wrench, ramp = self._taken_apart(point.state)
        return Configuration(self.model, x, wrench, point.residual, point.iterations, self.load(ramp))

    def equilibrium(self, s: float, state: Configuration, ramp: float) -> Equilibrium:
        """What the path keeps of a configuration: stiffness (18), stability, shape."""
        K = self._stiffness(state)
        verdict = self._stability(state)
        unstable = without_neutral(
            verdict.unstable,
            int(-NEUTRAL * abs(self._smallest_eigenvalue) < verdict.eigenvalue < 0.0),
            self.conservative,
        )
        return Equilibrium(
            s=s,
            displacement=self._displacement(state, ramp),
            wrench=self._wrench(state, ramp),
            tangent=self._tangent_stiffness(state, K, verdict.eigenvalue),
            eigenvalue=verdict.eigenvalue,
            unstable=unstable,
            iterations=state.iterations,
            residual=state.residual,
            # without the support, which is behind the chain
            shape=self.model.compiled.shape(state.x)[: len(self.stations)],
            state=np.concatenate([state.x, state.wrench, [ramp]]),
            stiffness=K,
            ramp=ramp,
        )

    # --- what is kept of a state --------------------------------------------------------------------------

    def _stiffness(self, state: Configuration) -> Array:
        """K^F (18) ``(6, 6)`` of the support; of the end-effector where the support holds nothing of its pose.

        What is zero but for rounding is zero. It is nan at a critical point, and infinite where the end-effector is
        free and does not deflect in all directions.
        """
        if set(self.load_case.free) == set(COMPONENTS):
            x = self._end_condition.alone(state.x)
            if not deflects(self._alone, self._alone.kinematics(x)):
                return np.full((6, 6), np.inf)
            state = Configuration(self._alone, x, np.zeros(6), state.residual, state.iterations, state.load)
        try:
            K = loaded_stiffness(state)
        except np.linalg.LinAlgError:
            return np.full((6, 6), np.nan)
        return self._without_rounding(K)

    def _without_rounding(self, K: Array) -> Array:
        """Stiffnesses ``(…, 6, 6)`` in which what is zero but for rounding is zero."""
        K[np.abs(K) < self._rounding] = 0.0
        return K

    @cached_property
    def _rounding(self) -> Array:
        unit = self.model.wrench_scale
        return np.asarray(ROUNDING * unit[:, None] * unit / unit[3])

    def _displacement(self, state: Configuration, ramp: float) -> Array:
        """How far the end-effector has come from its unloaded pose ``(6,)``, mm, rad."""
        if self._end_condition.joints:
            return self._end_condition.displacement(self.target(ramp), state.x)
        return self.load_case.displacement(ramp)

    def _wrench(self, state: Configuration, ramp: float) -> Array:
        """What acts on the end-effector ``(6,)``: the support's wrench and the loads there, N, N mm, world axes."""
        wrench = self._end_condition.wrench(self.target(ramp), state.x, state.wrench)
        if self._on_tool.any():
            wrench = wrench + self.model.compiled.acting(state.x, state.wrench, state.load)[self._on_tool].sum(
                axis=0
            )
        return wrench

    def _tangent_stiffness(self, state: Configuration, K: Array, eigenvalue: float) -> float:
        """Change of the driven force by the driven displacement, by stiffness and eigenvalue nearest zero there."""
        direction = self.load_case.direction
        if not self.load_case.load_driven:
            return float(direction @ K @ direction)
        try:
            dx, _ = self.rate(state)
            work = float(self.model.compiled.ramped(state.x, state.wrench, state.load) @ dx)
        except np.linalg.LinAlgError:
            return 0.0
        # closures hold the loads back: rounding of that is so much of what the loads could do on the lowest mode
        felt = abs(work) * abs(eigenvalue) * self.model.compiled.energy
        return 1.0 / work if felt > SUM_ROUNDING * self._ramped_size**2 else float("inf")

    @cached_property
    def _ramped_size(self) -> float:
        """Of the ramped loads, N mm: forces over the machine's length."""
        ramped = self._loading.ramped
        forces = np.linalg.norm(ramped[:, :3], axis=1) * self.model.characteristic_length
        return float(np.sum(forces + np.linalg.norm(ramped[:, 3:], axis=1)))

    @cached_property
    def _smallest_eigenvalue(self) -> float:
        """Smallest eigenvalue without any load."""
        bare = self.model.under(NO_LOADS) if len(self._loading) else self.model
        return stability(Configuration(bare, self._x0, np.zeros(6), 0.0, 0)).eigenvalue

    def _device(self, state: Configuration) -> Array | None:
        """Generalised forces ``(n,)`` of the device that imposes a point's displacement, where there is one."""
        if not self.load_case.held_by_device:
            return None
        try:
            return self._point_rate(state)
        except np.linalg.LinAlgError:
            return None

    def _stability(self, state: Configuration) -> Stability:
        return stability(state, self._device(state))

    # --- Newton -------------------------------------------------------------------------------------------

    def _taken_apart(self, state: Array) -> tuple[Array, Array, float]:
        n = self.model.size
        return state[:n], state[n : n + 6], float(state[-1])

    @cached_property
    def _arc_unit(self) -> Array:
        """Units ``(n + 7,)`` in which an arc is measured: turns and lengths; the ramp by its end; no forces."""
        return np.concatenate([self.model.coordinate_scale, np.full(6, np.inf), [self.load_case.length]])

    def rate(self, state: Configuration) -> tuple[Array, Array]:
        """Derivatives of coordinates ``(n,)`` and wrench ``(6,)`` by the ramp."""
        compiled = self.model.compiled
        if self.load_case.load_driven:
            load = compiled.ramped(state.x, state.wrench, state.load)
        else:
            load = np.zeros(self.model.size)
        return compiled.response(state.x, state.wrench, load, self.load_case.direction, state.load)

    def _on_plane(self, start: Equilibrium, slope: Array, along: Array, step: float) -> tuple[float, Configuration]:
        """Ramp and equilibrium on the plane across ``along`` (units of an arc), near a step along ``slope``."""
        row = along / self._arc_unit / (along @ along)
        n, begin = self.model.size, start.state

        def border(state: Configuration, ramp: float) -> Border:
            gone = row[:n] @ (state.x - begin[:n]) + row[-1] * (ramp - begin[-1])
            return Border(step - float(gone), row[:n], float(row[-1]))

        x, wrench, ramp = self._taken_apart(begin + slope * step)
        return self._bordered(x, wrench, ramp, border)

    # --- branches -----------------------------------------------------------------------------------------

    def _with_wrench(self, state: Configuration, mode: Array) -> Array:
        """Change of the whole state ``(n + 7,)`` along a critical mode ``(n,)``: closures' wrenches change too.

        They are those of one more inverse iteration, from the mode, which gives the mode again.
        """
        unit = self.model.coordinate_scale
        device = self._device(state)

        def wrenches(near: Configuration) -> Array:
            def response(forces: Array) -> Array:
                parts = self.model.compiled.response(near.x, near.wrench, forces, np.zeros(6), near.load)
                return np.concatenate(parts)

            change = response(mode / unit**2)
            if device is not None:
                held, n = response(device), len(mode)
                change -= (device @ change[:n]) / (device @ held[:n]) * held
            size = float((mode / unit**2) @ change[: len(mode)])
            if not 0.0 < abs(size) < np.inf:
                raise np.linalg.LinAlgError("singular")
            return np.asarray(change / size, dtype=float)

        change = near_critical(state, wrenches)
        moves = np.isfinite(unit)
        change[: len(mode)][moves] = mode[moves]
        return np.concatenate([change, [0.0]])

    def _branch(self, critical: Equilibrium, mode: Array, s: float) -> Equilibrium:
        """A state at ``s`` on the branch that leaves a bifurcation along ``mode`` (n + 7,)."""
        amplitude = AMPLITUDES[0]
        beyond = self._on_branch(critical, mode, amplitude, critical.state + amplitude * mode).s
        if beyond <= critical.s:
            raise NoConvergenceError("the crossing branch does not rise where it begins")
        amplitude *= np.sqrt((s - critical.s) / (beyond - critical.s))
        near = self._on_branch(critical, mode, amplitude, critical.state + amplitude * mode)
        point = self.solve(s, near)
        gone = float(self._row(mode) @ (point.state - critical.state))
        if gone < 0.5 * amplitude or self.distance(point.state - critical.state) > NEIGHBOUR * amplitude:
            raise NoConvergenceError("Newton fell back from the crossing branch")
        return point

    def _parameter(self, ramp: float, state: Configuration) -> float:
        """The path's parameter of a state: the ramp, or the controlled displacement."""
        return self.controlled_displacement(state) if isinstance(self.load_case.control, PointControl) else ramp

    def _row(self, mode: Array) -> Array:
        """Row ``(n + 7,)`` that gives a change of state's component along a critical mode ``(n + 7,)``."""
        n = self.model.size
        return np.concatenate([mode[:n] / self.model.coordinate_scale**2, np.zeros(7)])

    def _on_branch(self, critical: Equilibrium, mode: Array, amplitude: float, near: Array) -> Equilibrium:
        """The state at which the motion from a bifurcation along ``mode`` has an amplitude of either sign.

        Raises:
            NoConvergenceError: none was found, or not near the bifurcation.
        """
        row, begin = self._row(mode)[: self.model.size], self._taken_apart(critical.state)[0]

        def border(state: Configuration, _: float) -> Border:
            return Border(amplitude - float(row @ (state.x - begin)), row, 0.0)

        x, wrench, ramp = self._taken_apart(near)
        ramp, state = self._bordered(x, wrench, ramp, border)
        point = self.equilibrium(self._parameter(ramp, state), state, ramp)
        if self.distance(point.state - critical.state) > NEIGHBOUR * abs(amplitude):
            raise NoConvergenceError("the state found on the crossing branch is a jump away")
        return point

    # --- a point whose displacement is imposed -----------------------------------------------------------

    def _point_rate(self, state: Configuration) -> Array:
        """Derivative ``(n,)`` of the controlled displacement by the coordinates."""
        assert isinstance(self.load_case.control, PointControl)
        unit = np.zeros((len(self._loading), 6))
        unit[self._watched, :3] = self.load_case.sign * np.array(self.load_case.control.direction)
        return self.model.compiled.load_forces(state.x, state.wrench, state.load, unit)

    def controlled_displacement(self, state: Configuration) -> float:
        """Controlled displacement of the path, mm."""
        assert isinstance(self.load_case.control, PointControl)
        position = self.model.compiled.points(state.x, state.wrench, state.load)[self._watched]
        along = self.load_case.sign * np.array(self.load_case.control.direction)
        return float(along @ (position - self._point0))

    @cached_property
    def _point0(self) -> Array:
        """Where the controlled point is in the unloaded posture ``(3,)``."""
        return self.model.compiled.points(self._x0, np.zeros(6), 0.0)[self._watched].copy()

    def _point_border(self, state: Configuration, s: float) -> Border:
        return Border(
            (s - self.controlled_displacement(state)) / self.model.characteristic_length,
            self._point_rate(state) / self.model.characteristic_length,
            0.0,
        )


def _moves_nothing(load_case: LoadCase) -> bool:
    """Whether the ramp drives dead loads on the end-effector alone, where its pose is held."""
    ramped = [load for load in load_case.loads if load.ramped]
    if not load_case.load_driven or load_case.weight_ramped or any(load.part or load.follower for load in ramped):
        return False
    free = [name in load_case.free for name in COMPONENTS]
    return not any(np.any(np.array(load.wrench)[free]) for load in ramped)


REACH = (1.0, 2.0, 4.0, 8.0)
"""How far beyond the load case's own end the perfect chain is taken to find how it buckles."""


def buckling_shape(problem_of: Callable[[LoadCase], LumpedProblem], load_case: LoadCase) -> Array:
    """Coordinates ``(n,)`` of the critical mode of a perfect machine, per mm of its largest deflection.

    It points towards the load case's branch.

    Args:
        problem_of: the perfect machine under a load case, ready to be followed.
        load_case: under which it buckles.

    Raises:
        ValueError: the machine does not buckle under its load case, or without any point of it moving.
    """
    for reach in REACH:
        perfect = replace(load_case, imperfection=0.0, to=reach * load_case.to, steps=None)
        problem = problem_of(perfect)
        path = trace(problem, perfect, ArcControl(last=EventKind.BIFURCATION))
        event = next((e for e in path.events if e.kind is EventKind.BIFURCATION), None)
        if event is not None and event.point is not None:
            break
    else:
        raise ValueError(
            f"posture {load_case.posture} has no bifurcation up to {REACH[-1]:g} times this load case's end. "
            "Without a mode an imperfection has no shape: give a load case that buckles"
        )
    state = problem.configuration(event.point)
    mode = critical_modes(state)[0]
    size = float(np.linalg.norm(problem.model.velocities(state.x, mode), axis=1).max())
    if size < 1e-9 * problem.model.characteristic_length:
        raise ValueError("the critical mode moves no point of the chain: use more than one spring a link")
    return (load_case.branch or 1) * mode / size


@dataclass(frozen=True)
class ImperfectionCurve:
    """What imperfections cost; k sizes.

    Attributes:
        size: ``(k,)`` mm.
        force: ``(k,)`` driven force, or load factor, at each path's first limit point; at the path's end where the
            force only grows.
        ramp: ``(k,)`` where that is.
        limit: ``(k,)`` whether it is a limit point.
        paths: as far as there.
    """

    size: Array
    force: Array
    ramp: Array
    limit: np.ndarray
    paths: tuple[Path, ...]


def imperfection_curve(
    problem_of: Callable[[LoadCase], LumpedProblem],
    load_case: LoadCase,
    sizes: Sequence[float],
    progress: Callable[[float], None] | None = None,
) -> ImperfectionCurve:
    """The largest force against the size of an imperfection in the shape of the buckling mode.

    Args:
        problem_of: the machine under a load case, imperfection included, ready to be followed.
        load_case: under which the perfect machine buckles; its own imperfection is replaced.
        sizes: mm.
        progress: called with the fraction done.
    """
    paths, rows = [], []
    for k, size in enumerate(sizes):
        imperfect = replace(load_case, imperfection=float(size))
        path = trace(problem_of(imperfect), imperfect, ArcControl(last=EventKind.LIMIT))
        top = next((e.point for e in path.events if e.kind is EventKind.LIMIT), None) or path.points[-1]
        rows.append((float(size), driven_force(imperfect, top), top.ramp, top is not path.points[-1]))
        paths.append(path)
        if progress is not None:
            progress((k + 1) / len(sizes))
    size_, force_, ramp_, limit_ = (np.array(column) for column in zip(*rows, strict=True))
    return ImperfectionCurve(size_, force_, ramp_, limit_, tuple(paths))
