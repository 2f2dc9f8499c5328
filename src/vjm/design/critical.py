"""The smallest factor on the loads at which a machine loses its stability, and how it changes with a parameter.

The path of the loaded machine is followed to its first critical point. That is then solved for exactly: the
equilibrium ``r(x, f, p) = 0``, ``g(x, p) = 0`` and a tangent ``B`` with ``wᵀ B v = 0``. Here ``v`` and ``w`` are
its null vectors. Where these keep holding, ``f' = -(wᵀ B_p v) / (wᵀ B_f v)`` with the changes of the state in both
derivatives; at a limit of the load it becomes ``f' = -(wᵀ r_p) / (wᵀ r_f)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import eigvals

from vjm.design.changes import STEP, changed, difference, gaps, placed, residual_forces, response
from vjm.design.linear_state import CARRIED, LinearState, Question, free_motions, loading, state_of
from vjm.design.modes import REAL
from vjm.errors import NoConvergenceError
from vjm.model.end_condition import held
from vjm.model.load_case import COMPONENTS, LOAD, TO_LIMIT, Load, LoadCase
from vjm.model.lumped import LumpedModel
from vjm.model.parameters import Parameter
from vjm.rotations import Array

REACHES = (1.05, 3.0)
"""Times the factor at which the unloaded machine would lose its stability if it did not deflect before: so far a
path is followed, and then further if it has no critical point. Most machines lose their stability earlier."""
SMALL = 1e-4
"""Largest turn, or shift over the characteristic length, of a state that is differenced along a direction."""
KEPT = 8
"""Critical points that are remembered: each parameter of a machine asks for the same one."""
ITERATIONS = 20
"""Of Newton's method, which starts at a point of a path and needs three or four."""
SOLVED = 1e-11
"""Relative change of the factor at which Newton's method ends."""
SYMMETRIC = 1e-6
"""Of a null vector's work by the loads, over the loads' size, below which a critical point is a bifurcation."""


@dataclass(frozen=True)
class _LoadedMachine:
    """A machine whose state and loads are moved about; directions are ``(n + c,)``, scaled.

    Attributes:
        asked: with the loads in full.
        model: its springs.
        x0: ``(size,)`` unloaded.
        scale: ``(n + c,)`` of the coordinates and of what closures hold.
    """

    asked: Question
    model: LumpedModel
    x0: Array
    scale: Array

    def at(self, x: Array, factor: float) -> LinearState:
        asked = under(self.asked, factor)
        return LinearState(asked, self.model, x, np.zeros(6), loading(asked, self.model, self.x0), np.zeros(6))

    def moved(self, x: Array, way: Array) -> Array:
        """The state moved along a direction; what the closures bear has the other sign in it."""
        n = self.model.coordinates
        step = self.scale * way
        return x + np.concatenate([step[:n], -step[n:]])

    def bordered(self, state: LinearState) -> Array:
        """Tangent ``(n + c, n + c)`` with the closures' derivative, scaled."""
        n, total = state.n, len(self.scale)
        B = np.zeros((total, total))
        B[:n, :n], B[:n, n:], B[n:, :n] = state.tangent, state.constraints.T, state.constraints
        result: Array = B * self.scale[:, None] * self.scale
        return result

    def residual_forces(self, state: LinearState) -> Array:
        """What a state lacks to be an equilibrium ``(n + c,)``, scaled."""
        return self.scale * np.concatenate([residual_forces(state), -gaps(state)])

    def answer(self, solver: _Bordered, missing: Callable[[Array], Array]) -> Array:
        """Direction ``(n + c,)`` in which the state follows a change, see `vjm.design.changes.response`."""
        still = np.zeros(len(self.scale))
        return response(
            lambda way: missing(way if len(way) else still), lambda right: solver.solve(right)[0],
            self.model.coordinates,
        )  # fmt: skip

    def step(self, way: Array, share: float) -> float:
        """Length at which a direction moves the machine by `SMALL`, and the loads by as much of themselves."""
        n = self.model.coordinates
        size = max(float(np.abs(self.scale[:n] * way[:n] / self.model.coordinate_scale[:n]).max()), share)
        return SMALL / size if size else 0.0

    def along(self, x: Array, factor: float, way: Array, share: float, of: Callable[[LinearState], Array]) -> Array:
        """Derivative of something by a direction, along which the factor grows by a share of itself."""

        def at(h: float) -> Array:
            return of(self.at(self.moved(x, h * way), factor * (1.0 + h * share) if factor else h * share))

        return difference(at, self.step(way, share))


def _machine(asked: Question, state: LinearState) -> _LoadedMachine:
    rows = state.constraints * state.unit
    size = np.abs(rows).max(axis=1, initial=0.0)
    scale = np.concatenate([state.unit, 1.0 / np.where(size > 0.0, size, 1.0)])
    x0 = state.model.configuration(state.model.chain.posture(asked.posture))
    return _LoadedMachine(asked, state.model, x0, scale)


def _linear_factor(asked: Question, first: LinearState) -> float:
    """Factor at which the tangent, changing as it begins to, is singular.

    Raises:
        ValueError: it does not become singular.
    """
    machine = _machine(asked, first)
    B = machine.bordered(first)
    forces = machine.along(first.x, 0.0, np.zeros(len(B)), 1.0, machine.residual_forces)
    way = np.asarray(np.linalg.lstsq(B, forces, rcond=CARRIED)[0], dtype=float)
    geometric = machine.along(first.x, 0.0, way, 1.0, machine.bordered)
    n = first.n
    N = free_motions(first.constraints, first.unit) / machine.scale[:n, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        factors: Any = eigvals(N.T @ B[:n, :n] @ N, -N.T @ geometric[:n, :n] @ N)
    straight = np.isfinite(factors) & (np.abs(factors.imag) <= REAL * np.abs(factors))
    real = factors.real[straight & (factors.real > 0.0)]
    if not len(real):
        raise ValueError(
            f"{asked.machine.name}, posture {asked.posture}: the loads take no stiffness from the machine as they "
            f"begin to grow: it has no critical load in this direction"
        )
    return float(real.min())


def _null(machine: _LoadedMachine, state: LinearState, count: int) -> tuple[Array, Array]:
    """Right and left null vectors ``(n + c, count)`` of the bordered tangent, scaled."""
    n = state.n
    B = machine.bordered(state)
    N = free_motions(state.constraints, state.unit) / machine.scale[:n, None]
    left, _, right = np.linalg.svd(N.T @ B[:n, :n] @ N)
    found = []
    for y, A in ((right[-count:].T, B), (left[:, -count:], B.T)):
        v = N @ y
        held_by = np.linalg.lstsq(A[n:, :n].T, -A[:n, :n] @ v, rcond=CARRIED)[0]
        found.append(np.vstack([v, held_by]))
    return found[0], found[1]


@dataclass(frozen=True)
class _Bordered:
    """The bordered tangent with its null vectors as further borders, by which singular systems are solved."""

    matrix: Array
    right: Array
    left: Array

    @classmethod
    def of(cls, machine: _LoadedMachine, state: LinearState, V: Array, W: Array) -> _Bordered:
        B, k = machine.bordered(state), V.shape[1]
        matrix = np.block([[B, W], [V.T, np.zeros((k, k))]])
        ones = np.vstack([np.zeros((len(B), k)), np.eye(k)])
        right = np.linalg.lstsq(matrix, ones, rcond=CARRIED)[0]
        left = np.linalg.lstsq(matrix.T, ones, rcond=CARRIED)[0]
        return cls(matrix, right, left)

    @property
    def null(self) -> tuple[Array, Array, Array]:
        """Right and left vectors ``(n + c, k)``, and what is missing to a singular tangent ``(k, k)``."""
        k = self.right.shape[1]
        return self.right[:-k], self.left[:-k], self.right[-k:]

    def solve(self, right: Array) -> tuple[Array, Array]:
        """A direction ``(n + c,)``, and the part of the right side ``(k,)`` that the tangent does not reach."""
        k = self.right.shape[1]
        y = np.linalg.lstsq(self.matrix, np.concatenate([right, np.zeros(k)]), rcond=CARRIED)[0]
        return y[:-k], y[-k:]


@dataclass(frozen=True)
class _Rates:
    """What the condition of a critical point is made of, by the logarithm of the factor.

    Attributes:
        unreached: ``(k,)`` part of the loads that the tangent does not reach.
        size: of the loads' forces.
        softening: mean change of the tangent along its null vectors, the state moving with the loads.
        bending: the same by the null vector itself.
    """

    unreached: Array
    size: float
    softening: float
    bending: float

    @property
    def limit(self) -> bool:
        """Whether the loads have a limit there, and no branch begins."""
        return float(np.abs(self.unreached).max()) > SYMMETRIC * self.size


def _rates(machine: _LoadedMachine, x: Array, factor: float, solver: _Bordered) -> _Rates:
    V, W, _ = solver.null
    forces = machine.along(x, factor, np.zeros(len(V)), 1.0, machine.residual_forces)
    _, unreached = solver.solve(forces)
    way = machine.answer(solver, lambda way: machine.along(x, factor, way, 1.0, machine.residual_forces))
    softening = _mean(W, machine.along(x, factor, way, 1.0, machine.bordered), V)
    bending = _mean(W, machine.along(x, factor, V[:, 0], 0.0, machine.bordered), V) if V.shape[1] == 1 else 0.0
    return _Rates(unreached, float(np.linalg.norm(forces)), softening, bending)


def _mean(W: Array, change: Array, V: Array) -> float:
    return float(np.trace(W.T @ change @ V)) / V.shape[1]


@dataclass(frozen=True)
class CriticalState:
    """A machine where it loses its stability.

    Attributes:
        state: the equilibrium under the factored loads.
        factor: on the wrench and the loads; the weight stays.
        machine: of which it is a state.
        solver: of its tangent.
        rates: of the condition that it is critical.
    """

    state: LinearState
    factor: float
    machine: _LoadedMachine
    solver: _Bordered
    rates: _Rates

    @property
    def limit(self) -> bool:
        """Whether the loads have a maximum there; else a branch begins."""
        return self.rates.limit


def critical_factor(asked: Question) -> float:
    """Smallest factor on the wrench and the loads at which the equilibrium loses its stability; weight stays.

    Raises:
        ValueError: there is no load that could grow, or none is critical up to the last of `REACHES`.
        NoConvergenceError: the path to it could not be followed.
    """
    return critical_state(asked).factor


@lru_cache(maxsize=KEPT)
def critical_state(asked: Question) -> CriticalState:
    """The first critical point under growing loads, see `critical_factor`."""
    if not asked.acting:
        raise ValueError("no load can grow to a critical one: give a wrench or a load")
    first = state_of(under(asked, 0.0))
    linear = _linear_factor(asked, first)
    where = f"{asked.machine.name}, posture {asked.posture}"
    loads = tuple(replace(load, ramped=True) for load in asked.acting)
    for reach in REACHES:
        case = LoadCase(
            asked.posture, reach * linear, axis=LOAD, free=COMPONENTS, loads=loads, gravity=asked.gravity,
            control=TO_LIMIT,
        )  # fmt: skip
        path = asked.engine.trace(asked.machine, case)
        event = path.critical
        if event is not None and event.point is not None:
            break
        if not path.complete:
            raise NoConvergenceError(f"{where}: the path to a critical load ended: {path.stopped}")
    else:
        raise ValueError(f"{where}: no critical load up to {case.to:.4g} times the loads")
    end = held(first.model, case)
    x = end.alone(event.point.state[: end.model.size])
    return _solved(asked, x, event.point.ramp, event.multiplicity, where)


def under(asked: Question, factor: float) -> Question:
    """The question with its wrench and loads times a factor."""
    if not factor:
        return replace(asked, wrench=(0.0,) * 6, loads=())
    loads = tuple(_times(load, factor) for load in asked.loads)
    return replace(asked, wrench=tuple(factor * v for v in asked.wrench), loads=loads)


def _times(load: Load, factor: float) -> Load:
    return replace(load, wrench=tuple(factor * v for v in load.wrench))


def _solved(asked: Question, x: Array, factor: float, count: int, where: str) -> CriticalState:
    """The critical point near a state and a factor, by Newton's method.

    Raises:
        NoConvergenceError: there is none near.
    """
    machine = _machine(asked, placed(asked, x))
    state = machine.at(x, factor)
    V, W = _null(machine, state, count)
    for _ in range(ITERATIONS):
        solver = _Bordered.of(machine, state, V, W)
        right, left, missing = solver.null
        way, unreached = solver.solve(machine.residual_forces(state))
        softened = _mean(left, machine.along(x, factor, way, 0.0, machine.bordered), right)
        rates = _rates(machine, x, factor, solver)
        excess = float(np.trace(missing)) / count - softened
        if rates.limit:
            grown, share = -float(unreached[0] / rates.unreached[0]), 0.0
            if rates.bending:
                share = (excess - grown * rates.softening) / rates.bending
        else:
            grown, share = excess / rates.softening, 0.0
        loads = machine.along(x, factor, np.zeros(len(right)), 1.0, machine.residual_forces)
        with_loads, _ = solver.solve(loads)
        x = machine.moved(x, way + grown * with_loads + share * right[:, 0])
        factor *= 1.0 + grown
        state, V, W = machine.at(x, factor), right, left
        if not np.isfinite(factor) or factor <= 0.0:
            break
        if abs(grown) < SOLVED:
            solver = _Bordered.of(machine, state, V, W)
            return CriticalState(state, factor, machine, solver, _rates(machine, x, factor, solver))
    raise NoConvergenceError(
        f"{where}: the critical load near {factor:.5g} times the loads could not be solved for"
    )


def critical_derivative(critical: CriticalState, parameter: Parameter) -> float:
    """Derivative of the critical factor by a parameter, per its unit; of equal ones the mean.

    Args:
        critical: the critical point.
        parameter: of the machine.

    Raises:
        ValueError: there is none, because the parameter turns a bifurcation into a limit of the load.
    """
    x, factor = critical.state.x, critical.factor
    machine, solver, rates = critical.machine, critical.solver, critical.rates
    V, W, _ = solver.null

    def change(of: Callable[[LinearState], Array], way: Array) -> Array:
        return difference(
            lambda h: of(changed(critical.state, parameter, parameter.value + h, machine.moved(x, h * way))),
            STEP * parameter.scale,
        )

    # the forces along a way that closes what the parameter opens: on it the left null vector distinguishes them
    n, closing = critical.state.n, np.zeros(len(V))
    opened = change(machine.residual_forces, closing)[n:]
    closing[:n] = np.linalg.lstsq(machine.bordered(critical.state)[n:, :n], opened, rcond=CARRIED)[0]
    _, unreached = solver.solve(change(machine.residual_forces, closing))
    if rates.limit:
        return -factor * float(unreached[0] / rates.unreached[0])
    if float(np.abs(unreached).max()) * parameter.scale > SYMMETRIC * rates.size:
        raise ValueError(
            f"parameter '{parameter.name}' turns the bifurcation at the critical load into a limit of the load, "
            f"which has no derivative by it there"
        )
    way = machine.answer(solver, lambda way: change(machine.residual_forces, way))
    softened = _mean(W, change(machine.bordered, way), V)
    return -factor * softened / rates.softening
