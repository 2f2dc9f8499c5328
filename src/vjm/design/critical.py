"""The smallest factor on the loads at which a machine loses its stability, and how it changes with a parameter.

The path of the loaded machine is followed to its first critical point. That is then solved for exactly: the
equilibrium ``r(x, f, p) = 0``, ``g(x, p) = 0`` and a tangent ``B`` with ``wᵀ B v = 0``. Here ``v`` and ``w`` are
its null vectors. Where these keep holding, ``f' = -(wᵀ B_p v) / (wᵀ B_f v)`` with the changes of the state in both
derivatives; at a limit of the load it becomes ``f' = -(wᵀ r_p) / (wᵀ r_f)``.

The events of a path whose end is held in a ramp of poses change alike. There f is a factor on the displacement; at
a limit or a stiffness knee v and w are what the ramp, and its transposed, brings about, and ``wᵀ B v`` is its
stiffness.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy.linalg import eigvals

from vjm.continuation.path import EventKind, Path
from vjm.design.changes import ByParameter, Directions, difference, placed
from vjm.design.linear_state import LinearState, Question, TangentSystem, loading, state_of
from vjm.design.modes import REAL
from vjm.errors import NoConvergenceError
from vjm.model.end_condition import held
from vjm.model.load_case import COMPONENTS, LOAD, TO_LIMIT, Load, LoadCase
from vjm.model.mechanism import Mechanism
from vjm.model.parameters import Parameter
from vjm.rank import NEGLIGIBLE, SUM_ROUNDING, null_space
from vjm.rotations import Array

REACHES = (1.05, 3.0)
"""Times the factor at which the unloaded machine would lose its stability if it did not deflect before, or would
deflect by its own size: so far a path is followed, and then further if it has no critical point. Most machines lose
their stability earlier."""
SMALL = 1e-4
"""Largest turn, or shift over the characteristic length, of a state that is differenced along a direction."""
KEPT = 8
"""Critical points that are remembered: each parameter of a machine asks for the same one."""
ITERATIONS = 20
"""Of Newton's method, which starts at a point of a path and needs three or four."""
SOLVED = 1e-11
"""Relative change of the factor at which Newton's method ends."""
INVERSE_STEPS = 3
"""Of inverse iteration, each of which takes a singular value over the next, squared, from the error."""
ASIDE = 1e-2
"""rad, or over the characteristic length: how far along its mode a state beside a bifurcation may lie to be taken
back. Solvers leave up to 3e-4 of a mode that nothing holds; whether the state is symmetric then its forces tell."""
SYMMETRIC = 1e-6
"""Of a null vector's work by the loads, over the loads' size, below which a critical point is a bifurcation."""


class NoCriticalLoadError(ValueError):
    """A machine loses its stability at no factor on its loads, as far as was looked.

    Attributes:
        beyond: a critical factor, if there is one, is larger.
    """

    def __init__(self, said: str, beyond: float) -> None:
        """Say it."""
        super().__init__(said)
        self.beyond = beyond


@dataclass(frozen=True)
class _LoadedMachine(Directions):
    """A machine whose state and loads are moved about.

    Attributes:
        asked: with the loads in full.
        x0: ``(size,)`` unloaded.
    """

    asked: Question
    x0: Array

    @property
    def model(self) -> Mechanism:
        """Its springs."""
        return self.base.model

    @cached_property
    def load_size(self) -> float:
        """Largest generalised force, scaled, that the loads could have on a coordinate."""
        length = self.model.characteristic_length
        wrenches = np.array([load.wrench for load in self.asked.acting]).reshape(-1, 6)
        size = np.sum(np.linalg.norm(wrenches * np.repeat([length, 1.0], 3), axis=1))
        return float(size * np.max(self.base.unit / self.model.coordinate_scale[: self.base.n]))

    def at(self, x: Array, factor: float) -> LinearState:
        asked = under(self.asked, factor)
        return LinearState(asked, self.model, x, np.zeros(6), loading(asked, self.model, self.x0), np.zeros(6))

    def bordered(self, state: LinearState) -> Array:
        """Tangent ``(n + r, n + r)`` with the closures' derivative, scaled."""
        return state.bordered(state.tangent, self.base.combinations, self.base.scale)

    def bordering(self, motions: Array) -> Array:
        """Motions ``(n, k)`` as directions ``(n + r, k)``, scaled."""
        rest = np.zeros((len(self.zero) - self.base.n, motions.shape[1]))
        return np.vstack([motions / self.base.unit[:, None], rest])

    def size(self, way: Array) -> float:
        """How far a direction moves the machine at most: turns in rad, shifts over the characteristic length."""
        n = self.base.n
        return float(np.abs(self.base.unit * way[:n] / self.model.coordinate_scale[:n]).max())

    def step(self, way: Array, share: float) -> float:
        """Length at which a direction moves the machine by `SMALL`, and the loads by as much of themselves."""
        size = max(self.size(way), share)
        return SMALL / size if size else 0.0

    def along(self, x: Array, factor: float, way: Array, share: float, of: Callable[[LinearState], Array]) -> Array:
        """Derivative of something by a direction, along which the factor grows by a share of itself."""

        def at(h: float) -> Array:
            return of(self.at(self.moved(x, h * way), factor * (1.0 + h * share) if factor else h * share))

        return difference(at, self.step(way, share))


@dataclass(frozen=True)
class _HeldMachine(_LoadedMachine):
    """One whose end is held; its states have the wrench ``(6,)`` on the end behind them.

    Attributes:
        displacement: ``(6,)`` of the end at the factor one.
    """

    displacement: Array

    def at(self, x: Array, factor: float) -> LinearState:
        return placed(self.asked, x, factor * self.displacement)

    def held_by(self, way: Array) -> Array:
        """Change ``(6,)`` of the wrench on the end along a direction."""
        return self.moved(np.zeros(self.model.size + 6), way)[-6:]


def _machine(asked: Question, state: LinearState) -> _LoadedMachine:
    return _LoadedMachine(state, asked, state.model.configuration(state.model.chain.posture(asked.posture)))


def _linear_factor(asked: Question, first: LinearState) -> float:
    """Factor at which the tangent, changing as it begins to, is singular.

    Where it does not become so, the factor at which the deflection, growing as it begins to, is as large as the
    machine.

    Raises:
        NoCriticalLoadError: the loads neither deflect the machine nor take stiffness from it.
        ValueError: it moves without straining a spring.
    """
    machine = _machine(asked, first)
    forces = machine.along(first.x, 0.0, machine.zero, 1.0, machine.lacks)
    way, unreached = first.solver.solve(forces)
    if np.abs(unreached).max(initial=0.0) > NEGLIGIBLE * np.linalg.norm(forces):
        raise ValueError(
            f"{asked.machine.name}, posture {asked.posture}: under these loads it moves without straining a "
            f"spring: it has no critical load"
        )
    unit, Z = first.unit[:, None], first.neutral / first.unit[:, None]
    geometric = machine.along(first.x, 0.0, way, 1.0, lambda state: state.tangent)
    A, G = first.on_motions(first.tangent), first.on_motions(geometric)
    if Z.size:
        # what neither springs nor loads feel would be singular at any factor
        felt = (geometric * unit * unit.T) @ Z
        Z = Z @ null_space(felt / max(np.linalg.norm(geometric * unit * unit.T), np.finfo(float).tiny))
        N = null_space(Z.T @ (first.motions / unit))
        A, G = N.T @ A @ N, N.T @ G @ N
    factors: Any
    with np.errstate(divide="ignore", invalid="ignore"):
        # the pencil costs six times as much, and is needed where motions have no stiffness without the loads
        factors = eigvals(A, -G) if Z.size else 1.0 / eigvals(np.linalg.solve(A, -G))
    straight = np.isfinite(factors) & (np.abs(factors.imag) <= REAL * np.abs(factors))
    real = factors.real[straight & (factors.real > 0.0)]
    if len(real):
        return float(real.min())
    if np.linalg.norm(forces) <= SUM_ROUNDING / SMALL * machine.load_size:
        raise NoCriticalLoadError(
            f"{asked.machine.name}, posture {asked.posture}: the loads move nothing and take no stiffness from the "
            f"machine: it has no critical load in this direction",
            np.inf,
        )
    return 1.0 / machine.size(way)


def _null(machine: _LoadedMachine, state: LinearState, count: int) -> tuple[Array, Array]:
    """Right and left null vectors ``(n + r, count)`` of the bordered tangent, scaled; none is neutral.

    They are its smallest singular vectors, by inverse iteration; each left one is turned to its right one.
    """
    neutral, B = machine.bordering(state.neutral), machine.bordered(state)
    # a tangent may be singular to the last digit: what is added changes null vectors by rounding. The unloaded one
    # counts for the size, since of a machine with one motion the critical one is zero
    size = np.linalg.norm(machine.bordered(machine.base))
    system = TangentSystem(B + SUM_ROUNDING * size * np.eye(len(B)), neutral, neutral)
    V = W = np.random.default_rng(0).standard_normal((len(machine.zero), count))
    for _ in range(INVERSE_STEPS):
        W = np.linalg.qr(system.solve(V, transposed=True)[0])[0]
        V = np.linalg.qr(system.solve(W)[0])[0]
    turn, _, to = np.linalg.svd(W.T @ V)
    return V, W @ turn @ to


class _Critical:
    """The bordered tangent with null vectors as further borders, by which singular systems are solved.

    Attributes:
        V: right null vectors ``(n + r, k)``.
        W: left ones.
        missing: ``(k, k)`` what is missing to a singular tangent.
    """

    def __init__(self, machine: _LoadedMachine, state: LinearState, V: Array, W: Array) -> None:
        neutral, k = machine.bordering(state.neutral), V.shape[1]
        self._system = TangentSystem(machine.bordered(state), np.hstack([W, neutral]), np.hstack([V, neutral]))
        right, missing = self._system.null()
        left, _ = self._system.null(transposed=True)
        self.count = k
        self.V, self.W, self.missing = right[:, :k], left[:, :k], missing[:k, :k]

    def solve(self, right: Array) -> tuple[Array, Array]:
        """A direction ``(n + r,)``, and the part of the right side ``(k,)`` that the tangent does not reach."""
        way, unreached = self._system.solve(right)
        return way, unreached[: self.count]


@dataclass(frozen=True)
class _Rates:
    """What the condition of a critical point is made of, by the logarithm of the factor.

    Attributes:
        unreached: ``(k,)`` part of the loads that the tangent does not reach.
        size: of the loads' forces; of what they could be where they move nothing.
        softening: mean change of the tangent along its null vectors, the state moving with the loads.
        bending: the same by the null vector itself.
        way: in which the state moves with the loads ``(n + r,)``.
    """

    unreached: Array
    size: float
    softening: float
    bending: float
    way: Array

    @property
    def limit(self) -> bool:
        """Whether the loads have a limit there, and no branch begins."""
        return float(np.abs(self.unreached).max()) > SYMMETRIC * self.size


def _rates(machine: _LoadedMachine, x: Array, factor: float, solver: _Critical) -> _Rates:
    V, W = solver.V, solver.W
    first = machine.along(x, factor, machine.zero, 1.0, machine.lacks)
    # loads that move nothing leave rounding on the coordinates, and steps of differences enlarge it
    largest = factor * machine.load_size
    forces = np.where(np.abs(first) > SUM_ROUNDING / SMALL * largest, first, 0.0)
    _, unreached = solver.solve(forces)
    way = machine.followed(solver.solve, lambda way: machine.along(x, factor, way, 1.0, machine.lacks), first)
    stiffness = machine.stiffness(W, V)
    softening = float(machine.along(x, factor, way, 1.0, stiffness)[0])
    bending = float(machine.along(x, factor, V[:, 0], 0.0, stiffness)[0]) if V.shape[1] == 1 else 0.0
    return _Rates(unreached, float(np.linalg.norm(forces)) or largest, softening, bending, way)


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
    solver: _Critical
    rates: _Rates

    @property
    def limit(self) -> bool:
        """Whether the loads have a maximum there; else a branch begins."""
        return self.rates.limit


def critical_state(asked: Question) -> CriticalState:
    """The first critical point as the wrench and the loads grow; the weight stays.

    Raises:
        NoCriticalLoadError: none is critical up to the last of `REACHES`.
        ValueError: there is no load that could grow.
        NoConvergenceError: the path to it could not be followed.
    """
    answer = _remembered(asked)
    if isinstance(answer, NoCriticalLoadError):
        raise answer
    return answer


@lru_cache(maxsize=KEPT)
def _remembered(asked: Question) -> CriticalState | NoCriticalLoadError:
    """The same, or that there is none, for which the path is as long."""
    try:
        return _first_critical(asked)
    except NoCriticalLoadError as none:
        return none


def _first_critical(asked: Question) -> CriticalState:
    if not asked.acting:
        raise ValueError("no load can grow to a critical one: give a wrench or a load")
    first = state_of(under(asked, 0.0))
    linear = _linear_factor(asked, first.in_contact if first.free else first)
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
            raise NoConvergenceError(
                f"{where}: no critical load up to {max(p.ramp for p in path.points):.6g} times the loads, where "
                f"their path ended: {path.stopped}"
            )
    else:
        raise NoCriticalLoadError(f"{where}: no critical load up to {case.to:.4g} times the loads", case.to)
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
        solver = _Critical(machine, state, V, W)
        rates = _rates(machine, x, factor, solver)
        if count == 1 and (symmetric := _symmetric(machine, x, factor, solver, rates)) is not None:
            x, state, solver = symmetric
            rates = _rates(machine, x, factor, solver)
        right, left, missing = solver.V, solver.W, solver.missing
        way, unreached = solver.solve(machine.lacks(state))
        softened = machine.along(x, factor, way, 0.0, machine.stiffness(left, right))
        excess = float(np.trace(missing)) / count - float(softened[0])
        if rates.limit:
            grown, share = -float(unreached[0] / rates.unreached[0]), 0.0
            if rates.bending:
                share = (excess - grown * rates.softening) / rates.bending
        else:
            grown, share = excess / rates.softening, 0.0
        loads = machine.along(x, factor, machine.zero, 1.0, machine.lacks)
        with_loads, _ = solver.solve(loads)
        x = machine.moved(x, way + grown * with_loads + share * right[:, 0])
        factor *= 1.0 + grown
        state, V, W = machine.at(x, factor), right, left
        if not np.isfinite(factor) or factor <= 0.0:
            break
        if abs(grown) < SOLVED:
            solver = _Critical(machine, state, V, W)
            return CriticalState(state, factor, machine, solver, _rates(machine, x, factor, solver))
    raise NoConvergenceError(
        f"{where}: the critical load near {factor:.5g} times the loads could not be solved for"
    )


def _symmetric(
    machine: _LoadedMachine, x: Array, factor: float, solver: _Critical, rates: _Rates
) -> tuple[Array, LinearState, _Critical] | None:
    """The state without its part along the mode of a bifurcation; None where there is no bifurcation beside it.

    By a part a of the mode the loads do the work ``−a A_λ`` on it, with the softening A_λ. Where a bifurcation is,
    the state from which that part is taken away is an equilibrium.
    """
    part = float(rates.unreached[0]) / rates.softening if rates.softening else 0.0
    if not part or machine.size(part * solver.V[:, 0]) > ASIDE:
        return None
    moved = machine.moved(x, part * solver.V[:, 0])
    state = machine.at(moved, factor)
    beside = _Critical(machine, state, solver.V, solver.W)
    _, left = beside.solve(machine.lacks(state))
    return (moved, state, beside) if abs(float(left[0])) <= NEGLIGIBLE * rates.size else None


def critical_derivative(critical: CriticalState, parameter: Parameter) -> float:
    """Derivative of the critical factor by a parameter, per its unit; of equal ones the mean.

    Args:
        critical: the critical point.
        parameter: of the machine.

    Raises:
        ValueError: there is none, because the parameter turns a bifurcation into a limit of the load.
    """
    factor, machine, solver, rates = critical.factor, critical.machine, critical.solver, critical.rates
    change = ByParameter(machine, critical.state, critical.state.x, parameter)
    unreached = _unreached(change, solver)
    if rates.limit:
        return -factor * float(unreached[0] / rates.unreached[0])
    if float(np.abs(unreached).max()) * parameter.scale > SYMMETRIC * rates.size:
        raise ValueError(
            f"parameter '{parameter.name}' turns the bifurcation at the critical load into a limit of the load, "
            f"which has no derivative by it there"
        )
    softened = change.along(machine.stiffness(solver.W, solver.V), change.way(solver.solve))
    return -factor * float(softened[0]) / rates.softening


def _unreached(change: ByParameter, solver: _Critical) -> Array:
    """Forces ``(k,)`` of a parameter that the tangent does not reach.

    They are those along a way that closes what the parameter opens: on it the left null vector distinguishes them.

    Raises:
        ValueError: no way closes it.
    """
    machine, n, closing = change.directions, change.state.n, change.directions.zero
    rows = change.state.rows(machine.base.combinations) * machine.base.unit
    closing[:n] = np.linalg.lstsq(machine.base.scale[n:, None] * rows, change.first[n:], rcond=None)[0]
    return solver.solve(change.missing(closing))[1]


# --- Events of a path on which the whole pose of the end is imposed -----------------------------------------------

KINK = "two modes become unstable together: which of them is first has a kink here"


@dataclass(frozen=True)
class EventRates:
    """How the critical point of a path moves with p parameters.

    Attributes:
        force: derivatives ``(p,)`` of the driven force, N (N mm for a driven rotation) per unit of each parameter.
        s: derivatives ``(p,)`` of the displacement, mm (rad).
        reasons: why there is no derivative, which then is nan; empty where there is one.
    """

    force: Array
    s: Array
    reasons: tuple[str, ...]


def event_rates(asked: Question, path: Path, parameters: Sequence[Parameter], unloaded: Array) -> EventRates:
    """How the critical point of a path moves with parameters, of a machine of any kind.

    At a bifurcation there is a derivative by what keeps the symmetry that lets two branches cross. What breaks it
    breaks the bifurcation up: the load at which the path turns aside changes by its power 2/3.

    Args:
        asked: the machine of the path in its posture, its end held.
        path: of a ramp of the whole imposed pose, with an event.
        parameters: of the machine.
        unloaded: derivatives ``(p,)`` of the stiffness along the ramp without load, of which a knee has the half.

    Raises:
        ValueError: the load case is another one, or the event has no state.
        numpy.linalg.LinAlgError: a limit or a knee is critical for an end that is held, too.
    """
    case, event, model = path.load_case, path.critical, asked.model
    if not case.pose_only:
        raise ValueError(
            "derivatives are of ramps of the whole imposed pose only: no loads, free components, imperfections "
            "or other control than the ramp"
        )
    if event is None or event.point is None:
        raise ValueError(f"posture {case.posture}: the path has no critical point with a state")
    if len(event.point.state) != model.size + 7:
        raise ValueError(f"the path of {path.engine} is not of this engine and machine: its states are others")
    force, s, reasons = np.full(len(parameters), np.nan), np.full(len(parameters), np.nan), [""] * len(parameters)
    if event.multiplicity > 1:
        return EventRates(force, s, (KINK,) * len(parameters))
    x, imposed = event.point.state[:-1], case.displacement(event.s)
    state, drawn = placed(asked, x, imposed), model.configuration(model.chain.posture(case.posture))
    machine = _HeldMachine(state, asked, drawn, imposed)
    solver: _Critical | TangentSystem
    if event.kind is EventKind.BIFURCATION:
        solver = _Critical(machine, state, *_null(machine, state, 1))
        rates = _rates(machine, x, 1.0, solver)
        if (symmetric := _symmetric(machine, x, 1.0, solver, rates)) is not None:
            x, state, solver = symmetric
            rates = _rates(machine, x, 1.0, solver)
        follows, softening, size = rates.way, rates.softening, rates.size
        stiffness = machine.stiffness(solver.W, solver.V)
    else:
        solver, size = state.solver, np.inf
        ramp = machine.along(x, 1.0, machine.zero, 1.0, machine.lacks)
        V, W = (solver.solve(ramp[:, None], transposed=turned)[0] / event.s for turned in (False, True))
        follows = machine.followed(solver.solve, lambda way: machine.along(x, 1.0, way, 1.0, machine.lacks), ramp)
        stiffness = machine.stiffness(W, V)
        softening = float(machine.along(x, 1.0, follows, 1.0, stiffness)[0])
    for i, parameter in enumerate(parameters):
        change = ByParameter(machine, state, x, parameter)
        try:
            if isinstance(solver, _Critical):
                share = float(np.abs(_unreached(change, solver)).max()) * parameter.scale / size
                if share > SYMMETRIC:
                    raise ValueError(
                        f"breaks the symmetry: by its scale it loads the mode with {share:.1e} of the ramp's load"
                    )
            way = change.way(solver.solve)
        except ValueError as error:
            reasons[i] = " ".join(str(error).split())
            continue
        softened = float(change.along(stiffness, way)[0])
        if event.kind is EventKind.STIFFNESS_KNEE:
            softened -= 0.5 * unloaded[i]
        grown = -softened / softening
        s[i] = event.s * grown
        force[i] = case.direction @ machine.held_by(way + grown * follows)
    return EventRates(force, s, tuple(reasons))
