"""Equilibria of a meshed machine under a load case, as a problem that can be followed.

It is followed by its ramp or its arc, with the change of branch at a bifurcation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from vjm.continuation.branch_shape import NEIGHBOUR, behind_bifurcation, station_measure, stiffest
from vjm.continuation.events import NEUTRAL
from vjm.continuation.path import Equilibrium, StationLabel
from vjm.errors import NoConvergenceError
from vjm.model.end_condition import displacement_from
from vjm.model.load_case import LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.rotations import Array, frame
from vjm.statics import NO_MOTION as STILL
from vjm_fea.common.beam_statics import BeamStatics
from vjm_fea.common.linearized_statics import ScaledBorder, StabilityVerdict, Tangent
from vjm_fea.common.mesh import Place

DEFLECTIONS = np.array([1e-3 * 2.0**k for k in range(8)])
"""Largest deflections, over the chain's length, at which a crossing branch is looked at to tell how it leaves."""
ENTRY = 1e-2
"""Scaled amplitude at which a branch is entered that is followed by its arc."""
TINY = 1e-5
"""Amplitude, in scaled units, at which a mode's deflection is differenced."""
NO_DEFLECTION = 1e-9
"""Largest deflection of a unit mode, over the chain's length, that is none."""
AMPLITUDE_TRIALS = 12
NEAR = 0.1
"""How near to the wanted distance behind the bifurcation the amplitude's search ends, relative."""


def switch(problem: BeamProblem, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
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


def enter(problem: BeamProblem, critical: Equilibrium, sign: int) -> Equilibrium:
    """A state a little way along the branch that leaves ``critical``, wherever it leads.

    Raises:
        NoConvergenceError: the branch was not found.
    """

    def entered(mode: Array) -> Equilibrium:
        amplitude = ENTRY / problem.distance(problem.statics.change(critical.state, mode, 0.0, 0.0))
        equilibrium = _on_branch(problem, critical, mode, amplitude)
        return replace(equilibrium, s=critical.s + problem.distance(equilibrium.state - critical.state))

    return stiffest(_modes(problem, critical)[0], sign, entered)


def _modes(problem: BeamProblem, critical: Equilibrium) -> tuple[list[Array], float]:
    """The critical motions, their largest deflection component positive, and that component of the first in mm."""
    modes = problem.exact(critical.state).critical_modes(problem.device(critical.state))
    if not modes:
        raise NoConvergenceError("no real mode loses its stability here")
    oriented = [_oriented(problem, critical.state, mode) for mode in modes]
    return [mode for mode, _ in oriented], oriented[0][1]


def _at(problem: BeamProblem, critical: Equilibrium, s: float, mode: Array, amplitude: float) -> Equilibrium:
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
    equilibrium = problem.solve(s, near)
    if _distance(equilibrium.shape, near.shape) > 0.5 * _distance(critical.shape, near.shape):
        raise NoConvergenceError("fell back to the branch that loses its stability")
    if equilibrium.unstable != 0:
        raise NoConvergenceError(f"the branch found has {equilibrium.unstable} unstable modes")
    return equilibrium


def _on_branch(
    problem: BeamProblem, critical: Equilibrium, mode: Array, amplitude: float, near: Array | None = None
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


def _oriented(problem: BeamProblem, state: Array, mode: Array) -> tuple[Array, float]:
    """The motion, its largest deflection component positive, and that component in mm."""
    statics = problem.statics
    ahead, behind = (statics.shape(statics.moved_freely(state, step * mode)) for step in (TINY, -TINY))
    change = ((ahead - behind) / (2.0 * TINY)).ravel()
    largest = float(change[np.argmax(np.abs(change))])
    if abs(largest) < NO_DEFLECTION * problem.length:
        raise NoConvergenceError("the critical mode moves no point of the chain")
    return float(np.sign(largest)) * mode, abs(largest)


def _distance(a: Array, b: Array) -> float:
    return float(np.max(np.linalg.norm(a - b, axis=1)))


# --- How a path begins that the displacement of a point controls --------------------------------------------------

TRIALS = 40
"""Ramps that are tried: each halves or doubles the one before."""


def begun(
    s: float,
    rate: Array,
    row: Array,
    at_ramp: Callable[[float], Array],
    gone: Callable[[Array], float],
    otherwise: Array,
) -> Array:
    """A state near the first ``s``, on the side of the beginning to which the path leads.

    Where the displacement soon goes with the square of the ramp, both signs of the ramp bring as much of it, and
    Newton's method controlled by the displacement may take either.

    Args:
        s: displacement of the point that is wanted, mm.
        rate: derivative ``(f,)`` of the free coordinates by the ramp where the path begins.
        row: derivative ``(f,)`` of the displacement by the free coordinates there.
        at_ramp: the equilibrium at a ramp; it may raise `NoConvergenceError`.
        gone: displacement of the point at a state.
        otherwise: what to begin with where no ramp brings half to twice the displacement.

    Raises:
        NoConvergenceError: the point does not move with the ramp.
    """
    moves = float(row @ rate)
    if abs(moves) <= STILL * float(np.abs(row) @ np.abs(rate)):
        raise NoConvergenceError(
            "the controlled displacement does not change along the path: control another point or direction"
        )
    ramp = s / moves
    for _ in range(TRIALS):
        try:
            state = at_ramp(ramp)
        except NoConvergenceError:
            ramp *= 0.5
            continue
        share = gone(state) / s
        if 0.5 <= share <= 2.0:
            return state
        ramp *= 2.0 if 0.0 < share < 0.5 else 0.5
    return otherwise


# ------------------------------------------------------------------------------------------------------------------


MAX_ITERATIONS = 25
DIVERGED = 1e6
"""Scaled residual from which Newton's method does not come back."""
SURE = 1e-2
"""Share of the tolerance below which a state needs no further step: elsewhere one more is taken, since near
critical points, where the stiffness is small, a state within the tolerance may still be far off."""
STEPS_OF_CONSTANT_LOADS = 1e-3
"""Smallest share of the constant loads that is put on at once."""
ROUNDINGS = 16.0
"""Units in the last place of positions and turns by which a residual may be wrong."""
DIFFERENCE = 1e-6
"""Length of an arc over which a displacement is differenced."""
ON_PATH = 1e-11
"""Error of the condition beside equilibrium, in units of turns and of the chain's length."""


class BeamProblem:
    """A meshed chain under a load case: `vjm.continuation.arc_length.ArcProblem` for finite elements.

    Newton's method on the residual with the exact tangent; it follows unstable equilibria as readily as stable
    ones, and each says by its eigenvalues which it is.

    Attributes:
        label: of the engine.
        load_case: what is done.
        stations: labels of the rows of the shapes.
        statics: residual and tangent.
        length: extent of the chain, mm.
        tolerance: scaled residual at which an equilibrium counts as found.
    """

    def __init__(
        self, chain: Machine, load_case: LoadCase, statics: BeamStatics, stations: tuple[StationLabel, ...],
        watched: Place | None, label: str, tolerance: float,
    ) -> None:  # fmt: skip
        """Set up the unloaded state.

        Args:
            chain: the machine.
            load_case: what is done.
            statics: of the meshed chain.
            stations: labels of the rows of the shapes.
            watched: the point that a `PointControl` controls.
            label: of the engine.
            tolerance: scaled residual at which an equilibrium counts as found.

        Raises:
            ValueError: a controlled point stands on the ground.
        """
        self.label, self.load_case, self.stations, self.statics = label, load_case, stations, statics
        extent = float(np.ptp(statics.shape(statics.initial), axis=0).max(initial=0.0))
        self.length = max(chain.characteristic_length, extent)
        self.tolerance = tolerance
        self._rounding = ROUNDINGS * np.finfo(float).eps * statics.extent(self.length)
        self._watched = watched
        self._known: tuple[Array, Tangent] | None = None
        if watched is not None and watched.body is None:
            assert isinstance(load_case.control, PointControl)
            raise ValueError(
                f"part '{load_case.control.part}' is fixed to the base: its displacement cannot control a path"
            )
        self.drive = load_case.direction / statics.unit[statics.held]
        """Scaled motion ``(6,)`` of the support per unit of the ramp."""

    # --- what a path needs --------------------------------------------------------------------------------

    @property
    def conservative(self) -> bool:
        """Whether no load turns with its body and none is a moment."""
        return self.statics.applied_loads.conservative

    def unloaded(self) -> Equilibrium:
        """The reference configuration, under the loads that act all along.

        Raises:
            NoConvergenceError: they are more than the chain bears.
        """
        state = self._settled() if self.statics.applied_loads.constant.any() else self.statics.initial
        return self.equilibrium(0.0, *self.bordered(state))

    def solve(self, s: float, start: Equilibrium, slope: Array | None = None) -> Equilibrium:
        """Equilibrium at ``s`` from the state of ``start``, along ``slope`` or else along the tangent.

        Raises:
            NoConvergenceError: Newton's method did not converge.
        """
        if self.load_case.by_arc:
            way = self.tangent(start) if slope is None else slope
            return self.equilibrium(s, *self._on_plane(start, way, self.scaled(way), s - start.s))
        point_controlled = isinstance(self.load_case.control, PointControl)
        if slope is not None:
            state = self.statics.states.normalised(start.state + slope * (s - start.s))
        elif point_controlled:
            state = self._begun(s, start) if start.s == 0.0 else start.state
        else:
            state = self._advanced(start.state, s - start.s)
        if point_controlled:
            return self.equilibrium(s, *self.bordered(state, lambda at: self._point_border(at, s)))
        return self.equilibrium(s, *self.bordered(self._ramped_to(state, s)))

    def solve_pose(self, displacement: Array, start: Equilibrium) -> Equilibrium:
        """Equilibrium near ``start`` at any displacement ``(6,)`` of the support from its unloaded pose.

        Raises:
            NoConvergenceError: Newton's method did not converge.
        """
        d, along = np.asarray(displacement, dtype=float), self.load_case.direction
        solution = self.bordered(self.statics.with_hand(start.state, d))
        return self.equilibrium(float(d @ along / (along @ along)), *solution, end_condition=d)

    def nearest_product(self, point: Equilibrium) -> float:
        """See `vjm.continuation.events.Problem.nearest_product`."""
        return self.exact(point.state).nearest_product(self.device(point.state))

    def switch(self, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
        """A stable state at ``s`` on the crossing branch, see `vjm_fea.common.beam_problem.switch`."""
        return switch(self, critical, s, sign)

    def enter(self, critical: Equilibrium, sign: int) -> Equilibrium:
        """A state a little way along it, see `vjm_fea.common.beam_problem.enter`."""
        return enter(self, critical, sign)

    def tangent(self, point: Equilibrium, along: Array | None = None) -> Array:
        """Derivative of the state by the arc's length.

        Args:
            point: an equilibrium.
            along: a change of state that tells forwards from backwards; else the ramp grows.

        Raises:
            NoConvergenceError: the point is critical.
        """
        state = point.state
        tangent = self.exact(state)
        try:
            free = tangent.solve(-self.by_ramp(state, tangent))
        except np.linalg.LinAlgError:
            raise NoConvergenceError("the path has no one direction at a critical point") from None
        rate = self.statics.change(state, free, self.drive, 1.0)
        rate /= self.distance(rate)
        if along is not None and (rate / self._arc_unit) @ (along / self._arc_unit) < 0.0:
            rate = -rate
        return rate

    def distance(self, change: Array) -> float:
        """Length of a change of state along an arc: mean of the bodies' turns, and of shifts over the length."""
        return float(np.linalg.norm(self.scaled(change)))

    def growth(self, point: Equilibrium, change: Array) -> float:
        """See `vjm.continuation.events.Problem.growth`."""
        if not isinstance(self.load_case.control, PointControl):
            return float(change[-1])
        share = DIFFERENCE / self.distance(change)
        ahead, behind = (self.statics.states.normalised(point.state + h * change) for h in (share, -share))
        return (self.controlled_displacement(ahead) - self.controlled_displacement(behind)) / (2.0 * share)

    def across(self, start: Equilibrium, slope: Array, step: float) -> Equilibrium:
        """See `vjm.continuation.events.Problem.across`."""
        along = self.scaled(slope)
        along[-1] = 0.0
        solution = self._on_plane(start, slope, along, step)
        return self.equilibrium(self.parameter(solution[0]), *solution)

    # --- what branches need -------------------------------------------------------------------------------

    def parameter(self, state: Array) -> float:
        """The path's parameter of a state: the ramp, or the controlled displacement."""
        return (
            self.controlled_displacement(state)
            if isinstance(self.load_case.control, PointControl)
            else float(state[-1])
        )

    def scaled(self, change: Array) -> Array:
        """A change of state in the units of an arc."""
        return np.asarray(change / self._arc_unit, dtype=float)

    def followed(self, state: Array) -> Array:
        """A state that was added up of others, its turns made turns and its support put where its ramp has it."""
        return self._ramped_to(self.statics.states.normalised(state), float(state[-1]))

    def exact(self, state: Array) -> Tangent:
        """The exact tangent at an equilibrium, kept: a path asks several times."""
        if self._known is None or not np.array_equal(self._known[0], state):
            self._known = state, self.statics.tangent(state)
        return self._known[1]

    def by_ramp(self, state: Array, tangent: Tangent) -> Array:
        """Derivative ``(f,)`` of the free coordinates' residual by the ramp."""
        return tangent.by_ramp(self.drive, self.statics.ramped(state))

    def device(self, state: Array) -> Array | None:
        """Derivative ``(m + c,)`` of the displacement that a device holds, see `LoadCase.held_by_device`."""
        return self._point_row(state) if self.load_case.held_by_device else None

    # --- Newton -------------------------------------------------------------------------------------------

    def bordered(
        self, state: Array, border: Callable[[Array], ScaledBorder] | None = None
    ) -> tuple[Array, int, float]:
        """Equilibrium with what is held as in ``state``, or with one condition more and the ramp free."""
        statics = self.statics
        tangent: Tangent | None = None
        error, polished, tolerance = np.inf, False, self.tolerance
        for iteration in range(MAX_ITERATIONS + 1):
            r = statics.residual(state)[statics.free]
            error = float(np.max(np.abs(r), initial=0.0))
            condition = border(state) if border is not None else None
            if error < tolerance and (condition is None or abs(condition.missing) < ON_PATH):
                if polished or error < SURE * tolerance:
                    return state, iteration, error
                polished = True
            if not error < DIVERGED:
                break
            tangent = statics.tangent(state, like=tangent)
            tolerance = max(self.tolerance, tangent.rounding(self._rounding))
            try:
                if condition is None:
                    state = statics.moved_freely(state, tangent.solve(-r))
                    continue
                missing, row, at_ramp = condition
                at_ramp += float(row[statics.held] @ self.drive)
                by_ramp = self.by_ramp(state, tangent)
                step = tangent.bordered(by_ramp, row[statics.free], at_ramp, -r, missing)
            except np.linalg.LinAlgError:
                break
            state = statics.moved_freely(state, step[:-1], ramp=float(step[-1]))
            state = self._ramped_to(state, float(state[-1]))
        raise NoConvergenceError(f"Newton stopped after {iteration} iterations at a scaled residual of {error:.1e}")

    def _ramped_to(self, state: Array, ramp: float) -> Array:
        """The state with the support where the ramp has it."""
        result = state.copy()
        result[-1] = ramp
        return self.statics.with_hand(result, self.load_case.displacement(ramp))

    def _advanced(self, state: Array, ramp: float) -> Array:
        """The state moved along the tangent by a change of the ramp."""
        tangent = self.exact(state)
        try:
            free = tangent.solve(-self.by_ramp(state, tangent) * ramp)
        except np.linalg.LinAlgError as failure:
            raise NoConvergenceError("the tangent is singular") from failure
        return self.statics.moved_freely(state, free, self.drive * ramp, ramp)

    @cached_property
    def _arc_unit(self) -> Array:
        """Units of the state in which an arc is measured; no multipliers, whose unit is infinite."""
        states, root = self.statics.states, np.sqrt(self.statics.states.bodies)
        # a turn is twice the change of its quaternion
        body = np.concatenate([np.full(3, self.length), np.full(4, 0.5)]) * root
        numbers = self.statics.number_unit(self.length) * root
        return np.concatenate([np.tile(body, states.bodies), numbers, [self.load_case.length]])

    def _on_plane(self, start: Equilibrium, slope: Array, along: Array, step: float) -> tuple[Array, int, float]:
        """Equilibrium on the plane across ``along``, in the units of an arc, near a step along ``slope``."""
        row = along / self._arc_unit / (along @ along)

        def border(state: Array) -> ScaledBorder:
            return ScaledBorder(step - float(row @ (state - start.state)), *self.statics.gradient(state, row))

        return self.bordered(self.followed(start.state + slope * step), border)

    # --- a controlled point -------------------------------------------------------------------------------

    @cached_property
    def _controlled_point(self) -> tuple[Place, Array]:
        """The point, and the direction ``(3,)`` along which it is to go."""
        assert self._watched is not None
        assert isinstance(self.load_case.control, PointControl)
        return self._watched, self.load_case.sign * np.array(self.load_case.control.direction)

    def controlled_displacement(self, state: Array) -> float:
        """Controlled displacement of the path, mm."""
        place, along = self._controlled_point
        return float(along @ (self.statics.points(state, [place])[0].position - place.position))

    def _point_row(self, state: Array) -> Array:
        """Derivative ``(m + c,)`` of that displacement by scaled motions."""
        place, along = self._controlled_point
        point = self.statics.points(state, [place])[0]
        row = np.zeros(len(self.statics.unit))
        row[point.motions] = along @ point.jacobian[:3]
        return row * self.statics.unit

    def _begun(self, s: float, start: Equilibrium) -> Array:
        """A state near the first ``s``, see `vjm_fea.common.beam_problem.begun`."""
        by_ramp = self.by_ramp(start.state, self.exact(start.state))
        try:
            rate = self.exact(start.state).solve(-by_ramp)
        except np.linalg.LinAlgError:
            return start.state

        def at(ramp: float) -> Array:
            return self.bordered(self._ramped_to(self._advanced(start.state, ramp), ramp))[0]

        return begun(
            s, rate, self._point_row(start.state)[self.statics.free], at, self.controlled_displacement, start.state
        )

    def _point_border(self, state: Array, s: float) -> ScaledBorder:
        return ScaledBorder(
            (s - self.controlled_displacement(state)) / self.length, self._point_row(state) / self.length, 0.0
        )

    # --- what is kept of a state --------------------------------------------------------------------------

    def _settled(self) -> Array:
        """The reference configuration under the constant loads, which are put on step by step."""
        state, share, step = self.statics.initial, 0.0, 1.0
        try:
            while share < 1.0:
                self.statics.share = min(share + step, 1.0)
                try:
                    next_state = self.bordered(state)[0]
                    lost = self._verdict(next_state, self.statics.tangent(next_state)).unstable > 0
                except NoConvergenceError:
                    lost = True
                if not lost:
                    state, share = next_state, self.statics.share
                    continue
                step = 0.5 * (self.statics.share - share)
                if step < STEPS_OF_CONSTANT_LOADS:
                    raise NoConvergenceError(
                        f"the posture does not bear its constant loads: stable up to {share:.3g} of them"
                    )
        finally:
            self.statics.share = 1.0
        return state

    @cached_property
    def _smallest_eigenvalue(self) -> float:
        """Eigenvalue nearest zero of the chain at rest."""
        share, self.statics.share = self.statics.share, 0.0
        values, _ = self.statics.tangent(self.statics.initial).stability()
        self.statics.share = share
        return float(np.abs(values).min(initial=np.inf)) if len(values) else 0.0

    def _verdict(self, state: Array, tangent: Tangent) -> StabilityVerdict:
        """See `Tangent.verdict`."""
        return tangent.verdict(self.device(state), NEUTRAL * self._smallest_eigenvalue)

    def equilibrium(
        self, s: float, state: Array, iterations: int = 0, error: float = 0.0, end_condition: Array | None = None
    ) -> Equilibrium:
        """What the path keeps of a state; at ``end_condition`` (6,) where that is no point of the ramp."""
        tangent = self.exact(state)
        verdict = self._verdict(state, tangent)
        try:
            K = self.statics.end_stiffness(state, tangent, self.load_case)
        except np.linalg.LinAlgError:
            K = np.full((6, 6), np.nan)
        ramp = float(state[-1])
        displacement = self.load_case.displacement(ramp) if end_condition is None else end_condition
        if self.load_case.free:
            tool, drawn = self.statics.at_tool(state), frame(p=self.statics.tool.position)
            displacement = displacement_from(drawn, frame(tool.rotation, tool.position))
        return Equilibrium(
            s=s,
            displacement=displacement,
            wrench=self.statics.wrench(state),
            tangent=self._tangent_stiffness(state, tangent, K),
            eigenvalue=verdict.eigenvalue,
            unstable=verdict.unstable,
            iterations=iterations,
            residual=error,
            shape=self.statics.shape(state),
            state=state,
            stiffness=K,
            ramp=ramp if end_condition is None else s,
            rounding=verdict.rounding,
        )

    def _tangent_stiffness(self, state: Array, tangent: Tangent, K: Array) -> float:
        along = self.load_case.direction
        if not self.load_case.load_driven:
            return float(along @ K @ along)
        load = self.statics.ramped(state)[self.statics.free]
        try:
            work = self.statics.energy * float(load @ tangent.solve(load))
        except np.linalg.LinAlgError:
            return 0.0
        return 1.0 / work if work else float("inf")
