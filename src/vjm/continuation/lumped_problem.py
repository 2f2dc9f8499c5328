"""A lumped chain under a load case, as a problem whose path can be followed."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from vjm.continuation.bordered_newton import Border, solve_bordered
from vjm.continuation.branch_shape import Measure
from vjm.continuation.loaded_problem import LoadedProblem
from vjm.continuation.path import Equilibrium, StationLabel
from vjm.errors import NoConvergenceError
from vjm.model.applied_loads import NO_LOADS
from vjm.model.end_condition import deflects, held
from vjm.model.joints import Joint
from vjm.model.load_case import COMPONENTS, LoadCase, PointControl
from vjm.model.loading import loading_of
from vjm.model.lumped import LumpedModel
from vjm.rank import SUM_ROUNDING
from vjm.rotations import Array
from vjm.statics.equilibrium import TOLERANCE, Configuration, solve_newton
from vjm.statics.stability import stability

STEPS_OF_CONSTANT_LOADS = 1e-3
"""Smallest share of the constant loads that is put on at once."""


class LumpedProblem(LoadedProblem[LumpedModel]):
    """A lumped chain under a load case.

    Attributes:
        model: with the support's joints at its end and the load case's loads on its bodies.
    """

    def __init__(self, model: LumpedModel, load_case: LoadCase, label: str, bow: Array | None = None) -> None:
        """Set up the unloaded state.

        Args:
            model: the lumped chain.
            load_case: what is done.
            label: of the engine.
            bow: deflection ``(n,)`` of the coordinates, the support's included, with which the chain is built.

        Raises:
            ValueError: the chain has no such part or posture, what is free makes it a mechanism, or the ramped load
                moves nothing.
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
        super().__init__(loaded, load_case, label, stations, pose)

    def along(self, load_case: LoadCase) -> LumpedProblem:
        """The same machine in the same posture on another ramp of displacements; what it is made of is shared.

        Args:
            load_case: differs from the own one in ``to``, ``axis`` and ``branch`` alone.

        Raises:
            ValueError: it differs in more, or one of both is driven by loads.
        """
        own = replace(self.load_case, to=load_case.to, axis=load_case.axis, branch=load_case.branch)
        if own != load_case or self.load_case.load_driven or load_case.load_driven:
            raise ValueError("a problem is shared by ramps of displacements that differ in nothing else")
        other = copy(self)
        other.load_case = load_case
        return other

    @cached_property
    def _smallest_eigenvalue(self) -> float:
        bare = self.model.under(NO_LOADS) if len(self._loading) else self.model
        return stability(Configuration(bare, self._x0, np.zeros(6), 0.0, 0)).eigenvalue

    def at_rest(self) -> Configuration[LumpedModel]:
        """The posture as drawn, under the loads that act all along, see `LoadedProblem.at_rest`."""
        if np.any(self._loading.constant) or self.model.prestressed(self._x0) or self._open:
            return self._settled()
        return Configuration(self.model, self._x0, np.zeros(6), 0.0, 0)

    @property
    def _open(self) -> bool:
        """Whether errors of assembly, or a bow that is built in, leave the loops open as drawn."""
        if not self.model.chain.closes:
            return False
        return self.model.compiled.residual(self._x0, np.zeros(6), self._pose0)[2] > TOLERANCE

    def _solved(self, s: float, x: Array, wrench: Array, ramp: float) -> tuple[float, Configuration[LumpedModel]]:
        if isinstance(self.load_case.control, PointControl):
            return solve_bordered(self, x, wrench, ramp, lambda at, _: self._point_border(at, s))
        return super()._solved(s, x, wrench, ramp)

    def _displacement(self, at: Configuration[LumpedModel], ramp: float) -> Array:
        if self._end_condition.joints:
            return self._end_condition.displacement(self.target(ramp), at.x)
        return self.load_case.displacement(ramp)

    def _stiffness(self, at: Configuration[LumpedModel]) -> Array:
        """K^F (18) of the support; of the end-effector where the support holds nothing of its pose.

        Infinite there where the machine does not deflect in all directions.
        """
        if set(self.load_case.free) != set(COMPONENTS):
            return super()._stiffness(at)
        alone = self._alone
        x = self._end_condition.alone(at.x)
        if not deflects(alone, alone.kinematics(x)):
            return np.full((6, 6), np.inf)
        return super()._stiffness(Configuration(alone, x, np.zeros(6), at.residual, at.iterations, at.load))

    def _tangent_stiffness(self, at: Configuration[LumpedModel], K: Array, eigenvalue: float) -> float:
        direction = self.load_case.direction
        if not self.load_case.load_driven:
            return float(direction @ K @ direction)
        try:
            dx, _ = self.rate(at)
            work = float(self.model.compiled.ramped(at.x, at.wrench, at.load) @ dx)
        except np.linalg.LinAlgError:
            return 0.0
        # closures hold the loads back: rounding of that is so much of what the loads could do on the lowest mode
        most = self._ramped_size**2 / (max(abs(eigenvalue), np.finfo(float).tiny) * self.model.compiled.energy)
        return 1.0 / work if abs(work) > SUM_ROUNDING * most else float("inf")

    @cached_property
    def _ramped_size(self) -> float:
        """Of the ramped loads, N mm: forces over the machine's length."""
        ramped = self._loading.ramped
        forces = np.linalg.norm(ramped[:, :3], axis=1) * self.model.characteristic_length
        return float(np.sum(forces + np.linalg.norm(ramped[:, 3:], axis=1)))

    def _device(self, at: Configuration[LumpedModel]) -> Array | None:
        if not self.load_case.held_by_device:
            return None
        try:
            return self._point_rate(at)
        except np.linalg.LinAlgError:
            return None

    def _wrench(self, at: Configuration[LumpedModel], ramp: float) -> Array:
        wrench = self._end_condition.wrench(self.target(ramp), at.x, at.wrench)
        if self._on_tool.any():
            wrench = wrench + self.model.compiled.acting(at.x, at.wrench, at.load)[self._on_tool].sum(axis=0)
        return wrench

    def _parameter(self, ramp: float, at: Configuration[LumpedModel]) -> float:
        return self._gone(at) if isinstance(self.load_case.control, PointControl) else ramp

    def growth(self, point: Equilibrium, change: Array) -> float:
        """See `vjm.continuation.problem.Problem.growth`."""
        if not isinstance(self.load_case.control, PointControl):
            return super().growth(point, change)
        at = self.configuration(point)
        return float(self._point_rate(at) @ change[: len(at.x)])

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
            return super()._measure(ahead, behind, size)
        name = max(turns, key=lambda each: abs(turns[each]))
        return Measure(f"rotation of {name}", "rad", turns[name])

    def _point_rate(self, at: Configuration[LumpedModel]) -> Array:
        """Derivative ``(n,)`` of the controlled displacement by the coordinates."""
        assert isinstance(self.load_case.control, PointControl)
        unit = np.zeros((len(self._loading), 6))
        unit[self._watched, :3] = self.load_case.sign * np.array(self.load_case.control.direction)
        return self.model.compiled.load_forces(at.x, at.wrench, at.load, unit)

    def _gone(self, at: Configuration[LumpedModel]) -> float:
        """Controlled displacement of the path, mm."""
        assert isinstance(self.load_case.control, PointControl)
        here = self.model.compiled.points(at.x, at.wrench, at.load)[self._watched]
        along = self.load_case.sign * np.array(self.load_case.control.direction)
        return float(along @ (here - self._point0))

    @cached_property
    def _point0(self) -> Array:
        """Where the controlled point is in the unloaded posture ``(3,)``."""
        result: Array = self.model.compiled.points(self._x0, np.zeros(6), 0.0)[self._watched].copy()
        return result

    def _point_border(self, at: Configuration[LumpedModel], s: float) -> Border:
        return Border(
            (s - self._gone(at)) / self.model.characteristic_length,
            self._point_rate(at) / self.model.characteristic_length,
            0.0,
        )

    def _settled(self) -> Configuration[LumpedModel]:
        """The drawn pose under the constant loads and the springs' preloads, which are put on step by step."""
        loaded = self.model.under(self._loading.gradual())
        prestressed = loaded.prestressed(self._x0)
        at, step = Configuration(loaded, self._x0, np.zeros(6), 0.0, 0, 0.0), 1.0
        while at.load < 1.0:
            load = min(at.load + step, 1.0)
            model = loaded.partially_unloaded(self._x0, load) if prestressed else loaded
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
                borne = "constant loads" if np.any(self._loading.constant) or prestressed else "errors of assembly"
                raise NoConvergenceError(
                    f"the posture does not bear its {borne}: stable up to {at.load:.3g} of them"
                )
        return Configuration(self.model, at.x, at.wrench, at.residual, at.iterations, 0.0)


def _moves_nothing(load_case: LoadCase) -> bool:
    """Whether the ramp drives dead loads on the end-effector alone, where its pose is held."""
    ramped = [load for load in load_case.loads if load.ramped]
    if not load_case.load_driven or load_case.weight_ramped or any(load.part or load.follower for load in ramped):
        return False
    free = [name in load_case.free for name in COMPONENTS]
    return not any(np.any(np.array(load.wrench)[free]) for load in ramped)
