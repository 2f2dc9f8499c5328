"""The linear stiffness model (5): the unloaded stiffness matrix times the displacement."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import qr

from vjm.continuation.path import Equilibrium, Path
from vjm.limits import PRESTRESS, refuse
from vjm.model.end_condition import rigid_direction
from vjm.model.load_case import COMPONENTS, LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Closure, Coupling, PointSpring
from vjm.rank import NEGLIGIBLE, rank_of
from vjm.rotations import Array
from vjm.threads import single_threaded

NEUTRAL = 1e-12
"""Stiffness of a motion, over that of the stiffest, that is none but for rounding."""


@dataclass(frozen=True)
class LinearResponse:
    """What a machine does under loads and imposed displacements, k of them side by side.

    Attributes:
        x: unknowns ``(n, k)``.
        reactions: of the held rows ``(h, k)``.
    """

    x: Array
    reactions: Array


@dataclass(frozen=True)
class LinearMachine:
    """Stiffness, conditions and places in n unknowns.

    Attributes:
        name: of the machine.
        length: mm, unit of shifts.
        unit: of each unknown ``(n,)``: ``length`` of shifts in mm, 1 of turns in rad.
        stiffness: ``(n, n)`` N, mm, rad.
        end: motion of the end-effector ``(6, n)``, world axes, mm and rad.
        conditions: rows ``(c, n)`` that are zero: closures and couplings. Some may depend on others.
        motion: motion ``(6, n)`` of a point of a part at a fraction of its length.
        weights: masses in kg, and the shifts ``(3, n)`` of their centres.
    """

    name: str
    length: float
    unit: Array
    stiffness: Array
    end: Array
    conditions: Array
    motion: Callable[[str, float], Array]
    weights: Sequence[tuple[float, Array]] = ()

    @cached_property
    def energy(self) -> float:
        """Typical stiffness of turns, N mm: the geometric mean of those that have one; of shifts where none has."""
        own = np.diag(self.stiffness) * self.unit**2
        turns, sprung = self.unit == 1.0, own > 0.0
        typical = own[sprung & turns] if np.any(sprung & turns) else own[sprung]
        return float(np.exp(np.mean(np.log(typical)))) if len(typical) else 1.0

    @cached_property
    def scale(self) -> Array:
        """Units ``(n,)`` in which each unknown's own stiffness is one, of passive joints as of the typical one."""
        own = np.diag(self.stiffness) * self.unit**2
        return self.unit / np.sqrt(np.where(own > 0.0, own, self.energy))

    @cached_property
    def kept(self) -> np.ndarray:
        """Indices ``(r,)`` of conditions that do not follow from one another.

        A loop of rigid links that moves in a plane is held several times over in the other directions.
        """
        return independent_rows(self.conditions * self.unit)

    @property
    def independent(self) -> Array:
        """These conditions ``(r, n)``."""
        return self.conditions[self.kept]

    def neutral(self, held: Array) -> Array:
        """Motions ``(n, k)`` that strain nothing and keep to the conditions and to the held rows ``(h, n)``."""
        rows = np.vstack([self.independent, held]) * self.scale
        size = np.linalg.norm(rows, axis=1, keepdims=True)
        # a row of zeros holds nothing
        rows = rows / np.where(size > 0.0, size, 1.0)
        K = self.stiffness * self.scale[:, None] * self.scale
        _, values, V = np.linalg.svd(np.vstack([K, rows]))
        rank = np.count_nonzero(values > NEUTRAL * values[0])
        return self.scale[:, None] * V[rank:].T

    def held(self, rows: Array, forces: Array, imposed: Array) -> LinearResponse:
        """What it does with some rows imposed.

        Motions that strain nothing and that nobody drives stay out: a bar between two ball joints does not turn
        about itself.

        Args:
            rows: imposed ``(h, n)``.
            forces: on the unknowns ``(n, k)``.
            imposed: values of the rows ``(h, k)``.

        Raises:
            ValueError: the machine is rigid in a direction in which it is held, or loads move it without
                straining a spring.
        """
        n, h = len(self.unit), len(rows)
        if self.rigid(rows):
            raise rigid_direction(self.name)
        neutral = self.neutral(rows)
        free = neutral / self.unit[:, None]
        works = forces * self.unit[:, None]
        least = NEGLIGIBLE * np.abs(free).max(initial=0.0) * np.abs(works).max(initial=0.0)
        if np.abs(free.T @ works).max(initial=0.0) > least:
            raise ValueError(f"{self.name}: under these loads it moves without straining a spring; hold it")
        B = np.vstack([rows, self.independent, (neutral / self.scale[:, None] ** 2).T])
        b = np.zeros((len(B), forces.shape[1]))
        b[:h] = imposed
        # entries span many decades: unknowns in units of their own stiffness, rows of their own reach
        reach = 1.0 / np.linalg.norm(B * self.scale, axis=1)
        units = np.concatenate([self.scale, reach])
        A = np.block([[self.stiffness, B.T], [B, np.zeros((len(B), len(B)))]]) * units[:, None] * units
        solved = units[:, None] * np.linalg.solve(A, units[:, None] * np.vstack([forces, b]))
        return LinearResponse(solved[:n], -solved[n : n + h])

    def rigid(self, rows: Array) -> bool:
        """Whether some of the rows ``(h, n)`` are zero, or follow from the others and the conditions."""
        both = np.vstack([self.independent, rows]) * self.unit
        size = np.linalg.norm(both, axis=1)
        if len(both) > both.shape[1] or np.any(size == 0.0):
            return True
        return rank_of(both / size[:, None]).rank < len(both)

    def end_stiffness(self) -> Array:
        """Stiffness ``(6, 6)`` of the end-effector whose pose is imposed, world axes, N, mm, rad.

        Raises:
            ValueError: the machine is rigid in some direction.
        """
        return self.held(self.end, np.zeros((len(self.unit), 6)), np.eye(6)).reactions

    def forces(self, load_case: LoadCase) -> tuple[Array, Array]:
        """Forces ``(n,)`` on the unknowns: of what acts all along, and of what the ramp multiplies.

        Without forces a load that turns with its body is the same as one that does not.

        Raises:
            ValueError: a load stands on a point that the machine does not have.
        """
        constant, ramped = np.zeros((2, len(self.unit)))
        for load in load_case.loads:
            (ramped if load.ramped else constant)[:] += self.motion(load.part, load.at).T @ np.array(load.wrench)
        if load_case.gravity is not None:
            for mass, shift in self.weights:
                weight = mass * np.array(load_case.gravity)
                (ramped if load_case.weight_ramped else constant)[:] += shift.T @ weight
        return constant, load_case.sign * ramped


def independent_rows(rows: Array) -> np.ndarray:
    """Indices, increasing, of rows ``(c, n)`` of which none is zero or follows from the others.

    Example:
        >>> len(independent_rows(np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 3.0]])))
        2
    """
    size = np.linalg.norm(rows, axis=1)
    # what differences of two motions leave of one that is none is rounding
    own = np.flatnonzero(size > NEGLIGIBLE * size.max(initial=0.0))
    if not len(own):
        return own
    unit_rows = rows[own] / size[own, None]
    _, order = qr(unit_rows.T, mode="r", pivoting=True)
    return np.asarray(own[np.sort(order[: rank_of(unit_rows).rank])])


def refuse_open(engine: str, chain: Machine, closure: Closure, first: Array, second: Array) -> None:
    """For closures that the posture does not close, which would be under stress.

    Args:
        engine: its label.
        chain: the machine.
        closure: which.
        first: one of its frames ``(4, 4)``, world.
        second: the other.

    Raises:
        ValueError: it is open by more than what rounding leaves.
    """
    gap = float(np.linalg.norm(second[:3, 3] - first[:3, 3]))
    turned = 0.0 if closure.turns else float(np.abs(second[:3, :3] - first[:3, :3]).max())
    if gap > NEGLIGIBLE * chain.characteristic_length or turned > NEGLIGIBLE:
        raise PRESTRESS.refusal(
            engine, f"closure '{closure.name}', open by {gap:.3g} mm and {turned:.3g} rad in this posture"
        )


def refuse_uncoupled(engine: str, coupling: Coupling, coordinates: Mapping[str, float]) -> None:
    """For couplings that the posture does not keep to, which would be under stress.

    Args:
        engine: its label.
        coupling: which.
        coordinates: of the passive joints, mm or rad, by name.

    Raises:
        ValueError: the weighted coordinates add up to another total, by more than what rounding leaves.
    """
    values = [weight * coordinates[name] for name, weight in coupling.terms]
    off = sum(values) - coupling.total
    if abs(off) > NEGLIGIBLE * max(1.0, *(abs(value) for value in values)):
        raise PRESTRESS.refusal(engine, f"coupling '{coupling.name}', off its total by {off:.3g} in this posture")


def refuse_stretched(engine: str, chain: Machine, spring: PointSpring, length: float) -> None:
    """For springs between points that pull or push in the posture.

    Args:
        engine: its label.
        chain: the machine.
        spring: which.
        length: at which it is, mm.

    Raises:
        ValueError: its force is more than what rounding of the length leaves.
    """
    force = float(spring.pull(length))
    stiffness = spring.stiffness if spring.law is None else spring.law.largest_stiffness
    if abs(force) > NEGLIGIBLE * stiffness * chain.characteristic_length:
        raise PRESTRESS.refusal(engine, f"spring '{spring.name}', which bears {force:.3g} N")


def linear_machine(label: str, chain: Machine, posture: Array) -> LinearMachine:
    """A machine in a posture as a linear one of the springs that its beams are split into.

    Args:
        label: of the engine.
        chain: its held joints at the coordinates of the posture.
        posture: passive coordinates ``(n_q,)`` rad or mm.

    Raises:
        ValueError: see `vjm.limits`; a closure, coupling or spring is under stress in the posture.
    """
    refuse(label, chain)
    model = Mechanism(chain)
    n, k = model.coordinates, model.kinematics(model.configuration(posture))
    lengths = model.spring_lengths(model.configuration(posture)).tolist()
    for spring, length in zip(chain.point_springs, lengths, strict=True):
        refuse_stretched(label, chain, spring, length)
    for closure, joints, frames in zip(chain.closures, model.closure_joints, model.closure_frames, strict=True):
        refuse_open(label, chain, closure, *(k.behind[joints + 1] @ frames))
    coordinates = dict(zip((joint.name for joint in chain.joints), posture.tolist(), strict=True))
    for coupling in chain.couplings:
        refuse_uncoupled(label, coupling, coordinates)
    rows = model.stretching(k)[:, :n]
    tangents = [float(spring.tangent(length)) for spring, length in zip(chain.point_springs, lengths, strict=True)]
    return LinearMachine(
        chain.name,
        chain.characteristic_length,
        model.coordinate_scale[:n],
        model.stiffness[:n, :n] + (rows.T * tangents) @ rows,
        k.jacobian[:, :n],
        model.closing(k)[:, :n],
        lambda part, at: model.at_point(k, *model.find(part, at)).jacobian[:, :n],
        [
            (piece.mass, model.at_point(k, piece.joint, piece.centre_of_mass).jacobian[:3, :n])
            for piece in model.pieces
            if piece.mass > 0.0
        ],
    )


def straight_path(label: str, chain: Machine, load_case: LoadCase, machine: LinearMachine, started: float) -> Path:
    """Path of a linear model: a straight line, with no stability to speak of.

    Args:
        label: of the engine.
        chain: the machine.
        load_case: the ramp.
        machine: the machine in the load case's posture.
        started: when, by `time.perf_counter`.

    Raises:
        ValueError: the machine is rigid in a direction in which it is held, or it moves without straining a spring.
    """
    held = np.array([name not in load_case.free for name in COMPONENTS])
    constant, ramped = machine.forces(load_case)
    forces = np.column_stack([constant, ramped])
    imposed = np.column_stack([np.zeros(6), load_case.direction])[held]
    response = machine.held(machine.end[held], forces, imposed)
    ends, wrenches = machine.end @ response.x, np.zeros((6, 2))
    wrenches[held] = response.reactions
    for load in load_case.loads:
        if not load.part:
            wrenches[:, int(load.ramped)] += (load_case.sign if load.ramped else 1.0) * np.array(load.wrench)
    K = _support_stiffness(machine, held)
    if load_case.load_driven:
        work = float(ramped @ response.x[:, 1])
        tangent = 1.0 / work if work else float("inf")
    else:
        tangent = float(load_case.direction @ K @ load_case.direction)
    points = []
    for s in np.linspace(0.0, load_case.length, (load_case.steps or 1) + 1):
        along = np.array([1.0, s])
        points.append(
            Equilibrium(
                s=float(s),
                displacement=np.where(held, load_case.displacement(s), ends @ along),
                wrench=wrenches @ along,
                tangent=tangent,
                eigenvalue=float("nan"),
                unstable=-1,
                iterations=0,
                residual=0.0,
                shape=np.empty((0, 3)),
                state=np.empty(0),
                stiffness=K,
            )
        )
    seconds = time.perf_counter() - started
    return Path(label, chain.name, load_case, tuple(points), seconds=seconds, model_sha256=chain.sha256)


def _support_stiffness(machine: LinearMachine, held: np.ndarray) -> Array:
    """Stiffness ``(6, 6)`` of the support, zero where it holds nothing; of a free end-effector that of its own.

    The latter is infinite where the machine is rigid in some direction.
    """
    n = len(machine.unit)
    if held.any():
        K, count = np.zeros((6, 6)), int(np.count_nonzero(held))
        K[np.ix_(held, held)] = machine.held(machine.end[held], np.zeros((n, count)), np.eye(count)).reactions
        return K
    if machine.rigid(machine.end):
        return np.full((6, 6), np.inf)
    return machine.end_stiffness()


@dataclass(frozen=True)
class LinearEngine:
    """``F = K Δt`` (5), with the chain's printed compliance matrices, and its loads on the same stiffness."""

    label: str = "vjm-linear"

    @single_threaded
    def trace(self, chain: Machine, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Straight line through the unloaded state; it knows no critical points."""
        refuse(self.label, chain, load_case)
        started = time.perf_counter()
        machine = linear_machine(self.label, chain.at(load_case.posture), chain.posture(load_case.posture))
        return straight_path(self.label, chain, load_case, machine, started)
