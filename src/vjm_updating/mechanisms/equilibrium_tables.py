"""Equilibria of a machine along rays of displacements and of loads, tabulated once and looked up near them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from vjm.continuation.load_grid import BranchChange, trace_grid
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium
from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.mechanism import Gravity, Kinematics, Mechanism
from vjm.model.springs import Spring
from vjm.rotations import Array, displacement_between, skew, translation
from vjm.statics import MAX_ITERATIONS, TOLERANCE
from vjm_updating.constants import numerical
from vjm_updating.mechanisms.history_kernels import HalfRayPath, Packed, interpolated, looked_up, on_chords
from vjm_updating.mechanisms.modified_chain import KEPT, AxialSigns, ModifiedMachine, bowed, springs_of

NODES = numerical(16)
"""Equilibria along half a ray, where its tangents hardly turn."""
FEW, ALIKE = numerical(4), numerical(1e-3)
"""Steps along half a ray that is hardly curved, an even number; there half of them give the same stiffness but for
so much of its largest entry."""
FINE = numerical(0.05)
"""Error in N between two equilibria, estimated from their tangents, above which there are more."""
MOST = numerical(12)
"""Into which one step is divided at most."""
NEAR = numerical(np.array([0.1, 0.03, 0.01, 0.003, 0.001]))
"""Distances from a bifurcation, relative, at which there are equilibria in any case."""
SHORTER, FINER = numerical(12), numerical(4)
"""How often, and into how many, the step is divided at which a path through given places stops."""
BEGUN = numerical(1e-3, "mm")
"""mm of a ramp that tells what a load does to each part at first."""
SLOPE, CORRECTIONS = numerical(1e-7), numerical(4)
"""Scaled residual, and steps of Newton's method at most, of equilibria from which derivatives are made: a machine
that differs by a part in a thousand takes one step."""


@dataclass(frozen=True)
class HalfRay:
    """A ramp to be tabulated.

    Attributes:
        direction: ``(6,)`` displacement per unit of the ramp.
        reach: its end, positive.
        branch: +1 or −1, of two mirrored ones.
        places: at which there are to be equilibria, so that nothing is interpolated there.
    """

    posture: str
    direction: tuple[float, ...]
    reach: float
    branch: int = 1
    places: tuple[float, ...] = ()

    @classmethod
    def of(
        cls, posture: str, direction: Array, reach: float, branch: int = 1, places: tuple[float, ...] = ()
    ) -> HalfRay:
        """One along a direction ``(6,)``, without the rounding that would make two of it."""
        return cls(posture, tuple(float(v) for v in np.round(direction, 15)), reach, branch, places)


@dataclass(frozen=True)
class PathTable:
    """Equilibria of one half-ray.

    Attributes:
        s: path parameters ``(m,)``, from zero.
        wrench: ``(m, 6)``.
        slope: its derivative by s ``(m, 6)``.
        stiffness: K^F ``(m, 6, 6)``.
        x: coordinates ``(m, n)``.
        bifurcation: path parameter at which it changes its branch; infinite where it does not.
        stopped: why it ends before its end; empty where it does not.
        springs: what a beam's springs do along it, of those that have been asked for.
    """

    s: Array
    wrench: Array
    slope: Array
    stiffness: Array
    x: Array
    bifurcation: float
    problem: LumpedProblem
    stopped: str
    turns: tuple[BranchChange, ...] = ()
    springs: dict[str, HalfRayPath] = field(default_factory=dict, compare=False)

    def at(self, s: Array) -> tuple[Array, Array]:
        """Wrenches ``(k, 6)`` and stiffnesses ``(k, 6, 6)``; straight on beyond the ends."""
        wrench, stiffness = np.empty((len(s), 6)), np.empty((len(s), 6, 6))
        for k, place in enumerate(s):
            interpolated(self.packed, 0, len(self.s), self.bifurcation, float(place), wrench[k], stiffness[k])
        return wrench, stiffness

    @property
    def packed(self) -> Packed:
        """As the kernels take it."""
        return self.s, self.wrench, self.slope, self._own_slope, self.stiffness

    @cached_property
    def _own_slope(self) -> Array:
        """Derivative by the coordinate in which a piece is interpolated."""
        behind = self.s >= self.bifurcation
        factor = np.where(behind, 2.0 * np.sqrt(np.maximum(self.s - self.bifurcation, 0.0)), 1.0)
        return self.slope * factor[:, None]

    @cached_property
    def yielding(self) -> tuple[Array, Array, Array]:
        """Rotations of the passive joints under torques of their own, the end-effector held, at the nodes.

        Returns:
            Joint coordinates ``(m, n_q)``; their change by a torque on each ``(m, n_q, n_q)``, rad/(N mm); the
            wrench's ``(m, 6, n_q)``.
        """
        model = self.problem.model
        own = model.passive
        A = np.zeros((len(self.s), len(own), len(own)))
        B = np.zeros((len(self.s), 6, len(own)))
        torques, none = np.eye(model.size)[own], np.zeros((len(own), 6))
        for k, (x, F) in enumerate(zip(self.x, self.wrench, strict=True)):
            dx, dF = model.compiled.responses(x, F, torques, none)
            A[k], B[k] = dx[:, own].T, dF.T
        return self.x[:, own], A, B


class Sheaf:
    """Tables side by side, to be looked up by readings on different rays.

    Attributes:
        both: numbers ``(n, 2)`` of each reading's tables, along its ray and against it.
        measure: ``(n, 6)``; a displacement times it is its place on the ray.
        along: direction ``(n, 6)`` of the ray.
    """

    def __init__(self, tables: Sequence[PathTable], both: np.ndarray, measure: Array, along: Array) -> None:
        self.both, self.measure, self.along = both, measure, along
        self._tables = tuple(tables)
        columns = zip(*(table.packed for table in tables), strict=True)
        s, wrench, slope, own, stiffness = (np.concatenate(column) for column in columns)
        self._packed: Packed = (s, wrench, slope, own, stiffness)
        self._first = np.cumsum([0, *(len(table.s) for table in tables)])
        self._bifurcation = np.array([table.bifurcation for table in tables])

    def at(self, u: Array) -> tuple[Array, Array]:
        """Wrenches ``(n, 6)`` and stiffnesses ``(n, 6, 6)`` at displacements ``(n, 6)``; linear off the rays."""
        return looked_up(
            self._packed,
            self._first,
            self._bifurcation,
            self.both,
            self.measure,
            self.along,
            np.ascontiguousarray(u),
        )

    def yielding(self, u: Array) -> tuple[Array, Array, Array, Array]:
        """Rotations of the passive joints at displacements ``(n, 6)``, see `PathTable.yielding`.

        Returns:
            Joint coordinates ``(n, n_q)``; their change by torques ``(n, n_q, n_q)``; the wrench's ``(n, 6, n_q)``;
            coordinates where the ray begins ``(n, n_q)``.
        """
        nodes, s = self._nodes, np.einsum("ni,ni->n", u, self.measure)
        values = on_chords(self._packed[0], self._first, self._bifurcation, self.both, s, nodes)
        n, q = len(u), self._tables[0].yielding[0].shape[1]
        free, give, bear = np.split(values, [q, q + q * q], axis=1)
        rest = nodes[self._first[np.where(s >= 0.0, self.both[:, 0], self.both[:, 1])], :q]
        return free, give.reshape(n, q, q), bear.reshape(n, 6, q), rest

    @cached_property
    def _nodes(self) -> Array:
        """What `PathTable.yielding` has of all tables, side by side ``(m, k)``."""
        parts = zip(*(table.yielding for table in self._tables), strict=True)
        return np.concatenate([np.concatenate(part).reshape(-1, part[0][0].size) for part in parts], axis=1)


def tabulate(machine: ModifiedMachine, half: HalfRay, pulls: bool | AxialSigns) -> PathTable:
    """The stable equilibria of a machine along half a ray.

    Raises:
        NoConvergenceError: the machine does not stand unloaded, or there is none at all.
        ValueError: what is built into the machine needs other springs.
    """
    problem = _problem(machine, half, pulls)
    gravity = problem.load_case.gravity
    # what bends from the start has a knee in place of a bifurcation, and a march may step across it
    bent = gravity is not None or bool(machine.bow)
    known: tuple[BranchChange, ...] = ()
    if not half.places:
        table = _trace(problem, np.linspace(0.0, half.reach, FEW + 1), loaded=bent)
        if _smooth(table, half.reach):
            return table
        known = table.turns
    grid = np.linspace(0.0, half.reach, NODES + 1)
    if half.places:
        grid = np.unique(np.concatenate([grid, half.places]))
        # two equal displacements are one
        grid = grid[np.concatenate([[True], np.diff(grid) > 1e-12 * half.reach])]
    table = _trace(problem, grid, loaded=bent, known=known)
    if gravity is None and bent and table.s[-1] < grid[-1]:
        # a bow in one plane leaves a bifurcation in the other
        bent, table = False, _trace(problem, grid, loaded=False)
    for _ in range(SHORTER):
        if not half.places or table.s[-1] >= half.places[-1]:
            break
        # where little breaks a symmetry the path turns sharply: a long step leaves it for the other branch
        last, to = table.s[-1], grid[np.searchsorted(grid, table.s[-1], side="right")]
        shorter = np.linspace(max(2.0 * last - to, 0.0), to, 2 * FINER + 1)
        grid = np.unique(np.concatenate([grid, shorter]))
        table = _trace(problem, grid, loaded=bent)
    finer = np.concatenate([_refined(table), grid[grid > table.s[-1]]])
    if np.isfinite(table.bifurcation):
        # towards a bifurcation the stiffness across the ray has a pole
        near = table.bifurcation * (1.0 + np.concatenate([-NEAR, NEAR]))
        finer = np.unique(np.concatenate([finer, near[near < half.reach]]))
    return table if np.array_equal(finer, grid) else _trace(problem, finer, loaded=bent, known=table.turns)


def first_force(machine: ModifiedMachine, posture: str, direction: Array) -> Array:
    """Force ``(3,)`` per unit of a ramp along ``direction`` (6,) with which the nominal machine begins it."""
    return first_wrench(machine, posture, direction)[:3]


def first_wrench(machine: ModifiedMachine, posture: str, direction: Array) -> Array:
    """Wrench ``(6,)`` per unit of a ramp along ``direction`` (6,) with which the nominal machine begins it."""
    plain = ModifiedMachine(machine.nominal, machine.engine)
    return tabulate(plain, HalfRay.of(posture, direction, BEGUN), ()).slope[0]


def beside(machine: ModifiedMachine, half: HalfRay, pulls: bool | AxialSigns, table: PathTable) -> PathTable | None:
    """The equilibria of a machine that differs from a table's by next to nothing, at the same places.

    Each by Newton's method from the table's own, so that no path is traced and no bifurcation looked for: enough
    for a derivative, which is one of the implicit function. None where the machine is not that near: it has other
    coordinates, or equilibria of other stability.
    """
    problem = _problem(machine, half, pulls)
    if problem.model.size != table.x.shape[1]:
        return None
    # what is not interpolated is differentiated as exactly as it is solved
    enough = TOLERANCE if half.places else SLOPE
    x, F, K, negative = problem.model.compiled.correct(
        problem.target(0.0), problem.load_case.direction, table.s, table.x, table.wrench, enough, CORRECTIONS
    )
    # before a bifurcation the path goes on where it has become unstable, behind it the branch must still be there
    if len(x) < len(table.s) or negative[(table.s > table.bifurcation) | np.isinf(table.bifurcation)].any():
        return None
    own = K @ problem.load_case.direction
    return PathTable(table.s, F, own, K, x, table.bifurcation, problem, table.stopped, table.turns)


def _problem(machine: ModifiedMachine, half: HalfRay, pulls: bool | AxialSigns) -> LumpedProblem:
    gravity = machine.weighing
    problem = _standing(
        machine.model(half.posture, pulls), half.posture, gravity, machine.bow, machine.engine.label
    )
    return problem.along(_load_case(half.posture, half.reach, half.direction, half.branch, gravity))


@lru_cache(maxsize=KEPT)
def _standing(
    model: Mechanism, posture: str, gravity: Gravity | None, bow: tuple[tuple[str, float, float], ...], label: str
) -> LumpedProblem:
    """A machine in a posture, which all of its rays share: bowed or loaded, it is a model of its own."""
    load_case = LoadCase(posture, 1.0, gravity=gravity)
    return LumpedProblem(model, load_case, label, bowed(model, posture, bow) if bow else None)


@lru_cache(maxsize=KEPT)
def _load_case(
    posture: str, reach: float, direction: tuple[float, ...], branch: int, gravity: Gravity | None
) -> LoadCase:
    """The ramp of a half-ray, which all machines share."""
    return LoadCase(posture, reach, direction, branch=branch, gravity=gravity)


def _smooth(table: PathTable, reach: float) -> bool:
    """Whether so few equilibria are enough: every second one is found from the others, wrench and stiffness.

    The error of a cubic falls sixteenfold, that of a straight line fourfold, where intervals are halved.
    """
    if table.turns or len(table.s) <= FEW or table.s[-1] < reach:
        return False
    even, odd = slice(None, None, 2), slice(1, None, 2)
    half = replace(
        table, s=table.s[even], wrench=table.wrench[even], slope=table.slope[even], stiffness=table.stiffness[even],
        x=table.x[even], springs={},
    )  # fmt: skip
    wrench, stiffness = half.at(table.s[odd])
    unit = np.repeat([1.0, table.problem.model.characteristic_length], 3)
    K = table.stiffness / np.outer(unit, unit)
    missed = np.abs(stiffness / np.outer(unit, unit) - K[odd])
    return bool((np.abs(wrench - table.wrench[odd]) / unit).max() < FINE and missed.max() < ALIKE * np.abs(K).max())


def _refined(table: PathTable) -> Array:
    """A grid with more points where the tangents turn."""
    s = table.s
    h = np.diff(s)
    error = np.abs(np.diff(table.slope[:, :3], axis=0)).max(axis=1) * h / 8.0
    count = np.clip(np.ceil((error / FINE / 20.0) ** 0.5), 1, MOST).astype(int)
    if (count == 1).all():
        return s
    pieces = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(s[:-1], s[1:], count, strict=True)]
    return np.concatenate([*pieces, s[-1:]])


def _trace(problem: LumpedProblem, grid: Array, *, loaded: bool, known: tuple[BranchChange, ...] = ()) -> PathTable:
    direction = problem.load_case.direction
    if loaded:
        s, x, F, K, stopped = _trace_loaded(problem, grid)
        turns: tuple[BranchChange, ...] = ()
    else:
        path = trace_grid(problem, grid, known)
        s, x, F, K, stopped, turns = path.s, path.x, path.wrench, path.stiffness, path.stopped, path.turns
    bifurcation = min((turn.s for turn in turns), default=np.inf)
    keep = np.isfinite(K).all(axis=(1, 2))
    s, x, F, K = s[keep], x[keep], F[keep], K[keep]
    if len(s) < 2:
        raise NoConvergenceError(f"posture {problem.load_case.posture}: no equilibrium was found: {stopped}")
    return PathTable(s, F, K @ direction, K, x, bifurcation, problem, stopped, turns)


def _trace_loaded(problem: LumpedProblem, grid: Array) -> tuple[Array, Array, Array, Array, str]:
    """The equilibria of a chain that carries weights: it has no bifurcation, but may have a stiffness knee.

    Where the compiled march stumbles, each point is gone to from the last, by steps that become shorter.
    """
    model = problem.model
    rest = problem.at_rest()
    ahead = model.compiled.march(
        problem.target(0.0), problem.load_case.direction, grid, rest.x, rest.wrench, TOLERANCE, MAX_ITERATIONS
    )
    if not ahead.why:
        return grid, ahead.x, ahead.wrench, ahead.stiffness, ""
    good = ahead.good
    x, F, last, stopped = ahead.x[good - 1], ahead.wrench[good - 1], float(grid[good - 1]), ""
    states = list(zip(grid[:good], ahead.x, ahead.wrench, ahead.stiffness, strict=False))
    slope = problem.rate(problem.configuration(problem.point(last, x, F)))
    for s in grid[good:]:
        reached = last
        step = s - reached
        while reached < s - 1e-12 * s:
            to = min(reached + step, s)
            next_x, wrench, _, _, why = model.compiled.newton(
                problem.target(to), x + slope[0] * (to - reached), F + slope[1] * (to - reached), 0.0, TOLERANCE, 20
            )
            if why or model.compiled.factorise(next_x, wrench) != 0:
                step *= 0.5
                if step < 1e-3 * (s - last):
                    stopped = f"no stable equilibrium found beyond {reached:.6g}"
                    break
                continue
            x, F, reached = next_x, wrench, to
            slope = problem.rate(problem.configuration(problem.point(to, x, F)))
        if stopped:
            break
        last = s
        states.append((s, x, F, model.compiled.end_stiffness(x, F)))
    s_, x_, F_, K_ = (np.array(column) for column in zip(*states, strict=True))
    return s_, x_, F_, K_, stopped


LOAD_NODES = numerical(8)
"""Steps along half a ramp at most, half where it is smooth. Both cubics err by a step's fourth power."""
CORNERS = numerical(8)
"""How often steps are halved beside a corner of a law."""
LOAD_ALIKE, TINY = numerical(1e-3), numerical(1e-9)
"""Of the largest value, by which one may be off that is found from every second equilibrium: all of them make a
sixteenth of it. And what is nothing beside the largest value of all."""
LOAD_CORRECTIONS = numerical(4)
"""Steps of Newton's method to a spring's reaction."""
HALVINGS = numerical(6)
"""Of a step at which Newton's method fails."""


@dataclass(frozen=True)
class Gauge:
    """What one channel reads.

    Attributes:
        component: of the displacement, 0 to 5.
        body: part that carries the point; empty for the end-effector.
        fraction: fraction of the part's elastic length.
    """

    channel: str
    component: int
    body: str = ""
    fraction: float = 1.0


@dataclass(frozen=True)
class LoadedEquilibria:
    """Equilibria at k loads, ``s`` times a direction.

    Attributes:
        s: ``(k,)``, from zero.
        reading: of the gauges ``(k, m)``, mm, rad.
        compliance: its derivative by the load on the end-effector ``(k, m, 6)``.
        carried: derivative of the readings by what the held components are moved ``(k, m, 6)``; zero for free ones.
        wrench: load and support's reaction on the end-effector ``(k, 6)``, N, N mm.
        stiffness: its derivative by what the held components are moved ``(k, 6, 6)``.
        by_beam: of the readings ``(k, m, b)``, by the logarithm of each beam's compliance.
        direction: ``(6,)`` load per unit of s.
    """

    s: Array
    reading: Array
    compliance: Array
    carried: Array
    wrench: Array
    stiffness: Array
    by_beam: Array
    direction: Array

    def at(self, s: Array) -> tuple[Array, ...]:
        """All of them at places ``(n,)``, in the order of the attributes; straight on beyond the end."""
        inside = np.clip(s, 0.0, self.s[-1])
        m = self.reading.shape[1]
        reading = self._reading(inside)
        edges = np.cumsum([m * 6, m * 6, 6, 36])
        parts = np.split(self._others(inside), edges, axis=1)
        n = len(s)
        compliance = parts[0].reshape(n, m, 6)
        reading = reading + (compliance @ self.direction) * (s - inside)[:, None]
        wrench = parts[2] + (s - inside)[:, None] * self.direction
        carried, stiffness = parts[1].reshape(n, m, 6), parts[3].reshape(n, 6, 6)
        return reading, compliance, carried, wrench, stiffness, parts[4].reshape(n, m, -1)

    @property
    def smooth(self) -> bool:
        """Whether every second equilibrium is found from the others, readings and compliance."""
        columns = "s", "reading", "compliance", "carried", "wrench", "stiffness", "by_beam"
        return not replace(self, **{name: getattr(self, name)[::2] for name in columns}).off(self)[1::2].any()

    def off(self, finer: LoadedEquilibria) -> np.ndarray:
        """Which equilibria ``(k,)`` of another table are not found from this one, readings and compliance."""
        reading, compliance, *_ = self.at(finer.s)
        return np.any(
            [
                (
                    np.abs(a - b) > LOAD_ALIKE * np.maximum(np.abs(b).max(axis=0), TINY * np.abs(b).max())
                ).reshape(len(b), -1).any(axis=1)
                for a, b in ((reading, finer.reading), (compliance, finer.compliance))
            ],
            axis=0,
        )  # fmt: skip

    @cached_property
    def _reading(self) -> CubicHermiteSpline:
        return CubicHermiteSpline(self.s, self.reading, self.compliance @ self.direction)

    @cached_property
    def _others(self) -> CubicSpline:
        k = len(self.s)
        stacked = (self.compliance, self.carried, self.wrench, self.stiffness, self.by_beam)
        return CubicSpline(self.s, np.hstack([values.reshape(k, -1) for values in stacked]))


def load_table(
    machine: ModifiedMachine, half: HalfRay, pulls: bool | AxialSigns, free: Sequence[str], gauges: Sequence[Gauge]
) -> LoadedEquilibria:
    """The stable equilibria of a machine along half a ramp of loads.

    ``half`` has the posture, the load's direction and how far it goes, N or N mm. Components of the end-effector's
    pose that are not ``free`` are held; ``pulls`` says what the load does to parts that differ between pull and
    push.

    Raises:
        NoConvergenceError: it does not bear the loads.
        ValueError: what is free makes it a mechanism, or what is held cannot move.
    """
    load = Load(half.direction)
    load_case = LoadCase(
        half.posture, half.reach, "load", free=tuple(free), loads=(load,), gravity=machine.weighing
    )
    model = machine.model(half.posture, pulls)
    bow = bowed(model, half.posture, machine.bow) if machine.bow else None
    if bow is not None:
        # the support's joints come behind the machine's own coordinates, before what closures bear
        support = LumpedProblem(model, load_case, "").model.size - model.size
        bow = np.insert(bow, model.coordinates, np.zeros(support))
    problem = LumpedProblem(model, load_case, machine.engine.label, bow)
    held = [k for k, name in enumerate(COMPONENTS) if name not in free]
    # displacements count from the pose without any load, that of its own weight included
    weightless = LumpedProblem(model, replace(load_case, gravity=None), "", bow) if machine.weighing else problem
    start = weightless.unloaded().state
    k = problem.model.kinematics(start[: problem.model.size])
    # gauges of one point share its motion
    places = dict.fromkeys([("", 1.0), *((gauge.body, gauge.fraction) for gauge in gauges)])
    probes = {place: _Probe(problem.model, k, *model.find(*place)) for place in places}
    own = {where.start: spring for spring, where in problem.model.blocks}
    springs = {
        beam.name: [(own[where.start], where) for where in springs_of(model, beam.name)]
        for beam in model.chain.beams
    }
    points: dict[float, Equilibrium] = {0.0: problem.unloaded()}
    nodes = {0.0: _node(problem, points[0.0], probes, gauges, held, springs)}

    def tabulated(s: list[float]) -> LoadedEquilibria:
        """Of the states at ``s``, ascending, each gone to from that before it."""
        for before, place in pairwise(s):
            if place not in points:
                points[place] = _reached(problem, points[before], place)
                nodes[place] = _node(problem, points[place], probes, gauges, held, springs)
        read, by_load, by_pose, wrench, K, by_beam = map(np.array, zip(*(nodes[place] for place in s), strict=True))
        return LoadedEquilibria(np.array(s), read, by_load, by_pose, wrench, K, by_beam, np.array(half.direction))

    for steps in (LOAD_NODES // 2, LOAD_NODES):
        s = np.linspace(0.0, half.reach, steps + 1).tolist()
        table = tabulated(s)
        if table.smooth:
            return table
    # laws of joints have corners: steps are halved where the middle of one is not what its ends let expect
    poor = list(pairwise(s)) if machine.nominal.laws else []
    for _ in range(CORNERS):
        halves = [(a, 0.5 * (a + b), b) for a, b in poor]
        s = sorted([*s, *(middle for _, middle, _ in halves)])
        finer = tabulated(s)
        off = dict(zip(s, table.off(finer).tolist(), strict=True))
        poor = [half for a, middle, b in halves if off[middle] for half in ((a, middle), (middle, b))]
        table = finer
        if not poor:
            break
    return table


class _Probe:
    """A point of the machine: its displacement, and what coordinates do to it."""

    def __init__(self, model: Mechanism, start: Kinematics, joint: int, offset: Array) -> None:
        self.joint, self.offset = joint, translation(offset)
        self.model = model
        self.start = self.frame(start)

    def frame(self, k: Kinematics) -> Array:
        """Where it is ``(4, 4)``."""
        return k.behind[self.joint + 1] @ self.offset

    def displacement(self, k: Kinematics) -> Array:
        """From its unloaded place ``(6,)``, mm, rad."""
        return displacement_between(self.start, self.frame(k))

    def jacobian(self, k: Kinematics) -> Array:
        """Velocity and angular velocity ``(6, n)`` by the coordinates' velocities."""
        return self.model.motion(k, self.joint, self.frame(k)[:3, 3])


def _reached(problem: LumpedProblem, point: Equilibrium, to: float) -> Equilibrium:
    """The equilibrium at a load, gone to from one before it by steps that become shorter where they fail."""
    step = to - point.s
    for _ in range(2**HALVINGS):
        try:
            next_point = problem.solve(min(point.s + step, to), point)
        except NoConvergenceError:
            next_point = None
        if next_point is None or next_point.unstable:
            step *= 0.5
            if step < (to - point.s) / 2**HALVINGS:
                break
            continue
        point = next_point
        if point.s >= to * (1.0 - 1e-12):
            return point
    raise NoConvergenceError(
        f"posture {problem.load_case.posture}: no stable equilibrium beyond {point.s:.4g} of a load of {to:.4g}"
    )


def _node(
    problem: LumpedProblem,
    point: Equilibrium,
    probes: Mapping[tuple[str, float], _Probe],
    gauges: Sequence[Gauge],
    held: Sequence[int],
    springs: Mapping[str, Sequence[tuple[Spring, slice]]],
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Readings, and what loads, the held components and the beams' compliances do to them, at one equilibrium."""
    state = problem.configuration(point)
    k, compiled = problem.model.kinematics(state.x), problem.model.compiled
    m, n = len(gauges), problem.model.size
    moved, carried, stiffness = np.zeros((n, 6)), np.zeros((n, 6)), np.zeros((6, 6))
    seen = {place: (probe.displacement(k), probe.jacobian(k)) for place, probe in probes.items()}
    J = seen["", 1.0][1].copy()
    for u, own in seen.values():
        # the rotation vector's rate is the angular velocity but for half their product, and the square of the turn
        own[3:] -= 0.5 * skew(u[3:]) @ own[3:]
    none = np.zeros(n)
    for c in range(6):
        moved[:, c] = compiled.response(state.x, state.wrench, J[c], np.zeros(6), state.load)[0]
    for c in held:
        carried[:, c], stiffness[:, c] = compiled.response(state.x, state.wrench, none, np.eye(6)[c], state.load)
    applied = compiled.load_forces(
        state.x, state.wrench, state.load, compiled.acting(state.x, state.wrench, state.load)
    )
    stress = problem.model.reactions(k, state.wrench) + applied[:n]
    softer = np.zeros((n, len(springs)))
    for i, own_springs in enumerate(springs.values()):
        # under a larger compliance it deflects as under a larger force
        force = np.zeros(n)
        for spring, where in own_springs:
            force[where] = stress[where]
            if problem.model.chain.closes:
                # what loops bear acts on springs, too
                force[where] = _reaction(spring, (state.x - problem.model.natural)[where], force[where])
        softer[:, i] = compiled.response(state.x, state.wrench, force, np.zeros(6), state.load)[0]
    reading, by_beam = np.zeros(m), np.zeros((m, len(springs)))
    by_load, by_pose = np.zeros((m, 6)), np.zeros((m, 6))
    for i, gauge in enumerate(gauges):
        u, own = seen[gauge.body, gauge.fraction]
        reading[i] = u[gauge.component]
        by_load[i], by_pose[i], by_beam[i] = (own[gauge.component] @ by for by in (moved, carried, softer))
    return reading, by_load, by_pose, point.wrench, stiffness, by_beam


def _reaction(spring: Spring, strain: Array, force: Array) -> Array:
    """Of a spring with a strain ``(n,)``, whose law is known the other way round, from a ``force`` near it."""
    for _ in range(LOAD_CORRECTIONS):
        force = force + np.linalg.solve(spring.compliance(force), strain - spring.strain(force))
    return force
