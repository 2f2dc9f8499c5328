"""Equilibria of a machine along the rays of a test, tabulated once and looked up at any displacement near them.

Between two equilibria the wrench is the cubic through both with their tangents, ``K^F d``; behind a bifurcation it
is a cubic in the root of the distance, as the branch itself is. Off the ray the loaded stiffness leads on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np

from vjm.continuation.load_grid import BranchChange, trace_grid
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array
from vjm.statics.equilibrium import MAX_ITERATIONS, TOLERANCE
from vjm_updating.constants import numerical
from vjm_updating.mechanisms.history_kernel import Packed, interpolated, looked_up, on_chords
from vjm_updating.mechanisms.modified_chain import KEPT, AxialSigns, ModifiedChain, bowed
from vjm_updating.mechanisms.relaxation_kernel import HalfRayPath

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
        posture: label.
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
        problem: whose equilibria they are.
        stopped: why it ends before its end; empty where it does not.
        turns: where it changes its branch.
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
        result: Array = self.slope * factor[:, None]
        return result

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
        for k, (x, F) in enumerate(zip(self.x, self.wrench, strict=True)):
            for j, q in enumerate(own):
                torque = np.zeros(model.size)
                torque[q] = 1.0
                dx, dF = model.compiled.response(x, F, torque, np.zeros(6))
                A[k, :, j], B[k, :, j] = dx[own], dF
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
        found: tuple[Array, Array] = looked_up(
            self._packed,
            self._first,
            self._bifurcation,
            self.both,
            self.measure,
            self.along,
            np.ascontiguousarray(u),
        )
        return found

    def yielding(self, u: Array) -> tuple[Array, Array, Array, Array]:
        """Rotations of the passive joints at displacements ``(n, 6)``, see `PathTable.yielding`.

        Returns:
            Joint coordinates ``(n, n_q)``; their change by torques ``(n, n_q, n_q)``; the wrench's ``(n, 6, n_q)``;
            coordinates where the ray begins ``(n, n_q)``.
        """
        nodes, s = self._nodes, np.einsum("ni,ni->n", u, self.measure)
        found = on_chords(self._packed[0], self._first, self._bifurcation, self.both, s, nodes)
        n, q = len(u), self._tables[0].yielding[0].shape[1]
        free, give, bear = np.split(found, [q, q + q * q], axis=1)
        rest = nodes[self._first[np.where(s >= 0.0, self.both[:, 0], self.both[:, 1])], :q]
        return free, give.reshape(n, q, q), bear.reshape(n, 6, q), rest

    @cached_property
    def _nodes(self) -> Array:
        """What `PathTable.yielding` has of all tables, side by side ``(m, k)``."""
        parts = zip(*(table.yielding for table in self._tables), strict=True)
        return np.concatenate([np.concatenate(part).reshape(-1, part[0][0].size) for part in parts], axis=1)


def tabulate(machine: ModifiedChain, half: HalfRay, pulls: bool | AxialSigns) -> PathTable:
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


def first_force(machine: ModifiedChain, posture: str, direction: Array) -> Array:
    """Force ``(3,)`` per unit of a ramp along ``direction`` (6,) with which the nominal machine begins it."""
    return first_wrench(machine, posture, direction)[:3]


def first_wrench(machine: ModifiedChain, posture: str, direction: Array) -> Array:
    """Wrench ``(6,)`` per unit of a ramp along ``direction`` (6,) with which the nominal machine begins it."""
    plain = ModifiedChain(machine.nominal, machine.engine)
    result: Array = tabulate(plain, HalfRay.of(posture, direction, BEGUN), ()).slope[0]
    return result


def beside(machine: ModifiedChain, half: HalfRay, pulls: bool | AxialSigns, table: PathTable) -> PathTable | None:
    """The equilibria of a machine that differs from a table's by next to nothing, at the same places.

    Each by Newton's method from the table's own, so that no path is traced and no bifurcation looked for: enough
    for a derivative, which is one of the implicit function.

    Returns:
        None where the machine is not that near: it has other coordinates, or equilibria of other stability.
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


def _problem(machine: ModifiedChain, half: HalfRay, pulls: bool | AxialSigns) -> LumpedProblem:
    gravity = machine.weighing
    load_case = LoadCase(half.posture, half.reach, half.direction, branch=half.branch, gravity=gravity)
    standing, model = LoadCase(half.posture, 1.0, gravity=gravity), machine.model(half.posture, pulls)
    return _standing(model, standing, machine.bow, machine.engine.label).along(load_case)


@lru_cache(maxsize=KEPT)
def _standing(
    model: Mechanism, load_case: LoadCase, bow: tuple[tuple[str, float, float], ...], label: str
) -> LumpedProblem:
    """A machine in a posture, which all of its rays share: bowed or loaded, it is a model of its own."""
    return LumpedProblem(model, load_case, label, bowed(model, load_case.posture, bow) if bow else None)


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
    found = list(zip(grid[:good], ahead.x, ahead.wrench, ahead.stiffness, strict=False))
    slope = problem.rate(problem.configuration(problem.point(last, x, F)))
    for s in grid[good:]:
        at = last
        step = s - at
        while at < s - 1e-12 * s:
            to = min(at + step, s)
            there, wrench, _, _, why = model.compiled.newton(
                problem.target(to), x + slope[0] * (to - at), F + slope[1] * (to - at), 0.0, TOLERANCE, 20
            )
            if why or model.compiled.visit(there, wrench) != 0:
                step *= 0.5
                if step < 1e-3 * (s - last):
                    stopped = f"no stable equilibrium found beyond {at:.6g}"
                    break
                continue
            x, F, at = there, wrench, to
            slope = problem.rate(problem.configuration(problem.point(to, x, F)))
        if stopped:
            break
        last = s
        found.append((s, x, F, model.compiled.end_stiffness(x, F)))
    s_, x_, F_, K_ = (np.array(column) for column in zip(*found, strict=True))
    return s_, x_, F_, K_, stopped
