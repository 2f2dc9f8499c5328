"""A lumped model in compiled form: equilibria, stiffness, stability and modes at a cost linear in its springs."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vjm.kernels import BEAM_COLUMN, LINEAR, PASSIVE, Arrays, buffers, positions, work_of
from vjm.rotations import Array
from vjm.solving import CONVERGED, SINGULAR, UNSTABLE, end_stiffness, march, newton, respond, smallest
from vjm.springs import BeamColumnSpring, LinearSpring

if TYPE_CHECKING:
    from vjm.lumped import LumpedModel

EIGENVALUE_TOLERANCE = 1e-9
"""Relative change at which an inverse iteration ends."""
EIGENVALUE_ITERATIONS = 200
SUBSPACE = 4
"""Vectors of an inverse iteration: its error falls with the ratio of the first eigenvalue to the fifth."""


class March(NamedTuple):
    """What a march along a grid found.

    Attributes:
        good: number of points that are stable equilibria.
        why: it ended there: ``unstable`` where the next point, which is given too, is an unstable equilibrium;
            empty at the grid's end.
        x: coordinates ``(g, n)``.
        wrench: ``(g, 6)``.
        stiffness: K^F ``(g, 6, 6)``.
        residual: scaled ``(g,)``.
        iterations: ``(g,)``.
    """

    good: int
    why: str
    x: Array
    wrench: Array
    stiffness: Array
    residual: Array
    iterations: np.ndarray


class Compiled:
    """The kernels at work on one lumped model; takes and returns N, mm, rad.

    It keeps the factors of the last state that it saw, so that all that is asked about one state costs one
    factorisation.
    """

    def __init__(self, model: LumpedModel) -> None:
        self.coordinate_unit = model.coordinate_scale
        self.wrench_unit = model.wrench_scale
        self.energy = float(model.wrench_scale[3])
        self._length = model.chain.characteristic_length
        self.arrays = _arrays(model)
        self.buffers = buffers(self.arrays)
        work = work_of(self.buffers.integers[:4], self.buffers.work_integers, self.buffers.work_numbers)
        self._step, self._right, self._residual, self._gap = work.step, work.right, work.residual, work.gap
        self._zero_gap = np.zeros(6)
        self._negative = -1
        self._remember(np.full(model.size, np.nan), np.full(6, np.nan))
        self._anywhere = self._packed(np.eye(4))
        self._station_joint = np.array([s.joint for s in model.stations], dtype=np.int64)
        self._station_position = np.array([s.position for s in model.stations]).reshape(-1, 3) / self._length
        width = max(min(SUBSPACE, model.size - 6), 0)
        self._starts = self._some_vectors(width)
        self._modes = self._starts.copy()

    def _some_vectors(self, count: int) -> Array:
        """Unit vectors ``(count, n)`` with a share of every mode, always the same, so that results repeat."""
        vectors = np.random.default_rng(0).standard_normal((count, len(self.coordinate_unit)))
        return vectors / np.linalg.norm(vectors, axis=1)[:, None]

    def newton(
        self, target: Array, x: Array, wrench: Array, tolerance: float, max_iterations: int
    ) -> tuple[Array, Array, float, int, str]:
        """Equilibrium with the end-effector at the frame ``target`` (4, 4).

        Returns:
            Coordinates ``(n,)``, wrench ``(6,)``, scaled residual, iterations, and why it failed or nothing.
        """
        x, force = x / self.coordinate_unit, wrench / self.wrench_unit
        to = self._packed(target)
        how, iterations, error, self._negative = newton(*self.buffers, to, x, force, tolerance, max_iterations)
        x, wrench = x * self.coordinate_unit, force * self.wrench_unit
        self._remember(x, wrench)
        why = {CONVERGED: "", SINGULAR: "at a singular state"}.get(how, f"after {iterations} iterations")
        if why and not np.isfinite(error):
            why = "outside the neighbourhood of the target pose"
        return x, wrench, float(error), int(iterations), why

    def march(
        self, pose: Array, direction: Array, s: Array, x: Array, wrench: Array, tolerance: float, most: int
    ) -> March:
        """Equilibria along a grid of displacements from its first point, which is given.

        Args:
            pose: unloaded frame ``(4, 4)`` of the end-effector.
            direction: displacement ``(6,)`` per unit of s.
            s: ``(g,)``.
            x: coordinates ``(n,)`` at the first point.
            wrench: ``(6,)`` there.
            tolerance: scaled residual.
            most: Newton iterations at a point.
        """
        g, n = len(s), len(x)
        X, F, K = np.empty((g, n)), np.empty((g, 6)), np.empty((g, 6, 6))
        error, iterations, negative = np.zeros(g), np.zeros(g, dtype=np.int64), np.zeros(g, dtype=np.int64)
        stiffness_unit = self.wrench_unit[:, None] * self.wrench_unit / self.energy
        X[0], F[0], K[0] = x / self.coordinate_unit, wrench / self.wrench_unit, 0.0
        how, good = march(
            *self.buffers, np.ascontiguousarray(pose[:3, :3]), pose[:3, 3] / self._length,
            np.concatenate([direction[:3] / self._length, direction[3:]]), np.ascontiguousarray(s, dtype=float), 1,
            tolerance, most, X, F, K, error, iterations, negative,
        )  # fmt: skip
        self._remember(np.full(n, np.nan), np.full(6, np.nan))  # the factors are those of another state now
        done = min(good + (how == UNSTABLE), g)
        K[:done] *= stiffness_unit
        K[0] = self.end_stiffness(x, wrench)
        why = {CONVERGED: "", UNSTABLE: "unstable"}.get(how, f"Newton did not converge in {most} steps")
        return March(
            good, why, X[:done] * self.coordinate_unit, F[:done] * self.wrench_unit, K[:done], error[:done],
            iterations[:done],
        )  # fmt: skip

    def _remember(self, x: Array, wrench: Array) -> None:
        """Which state the factors belong to."""
        # copies: the caller may write to its own
        self._x, self._wrench, self._force = x.copy(), wrench.copy(), wrench / self.wrench_unit

    def _packed(self, target: Array) -> Array:
        """A frame ``(4, 4)`` as the kernels take it: ``(12,)`` rotation row by row, then scaled position."""
        return np.concatenate([target[:3, :3].ravel(), target[:3, 3] / self._length])

    def _factor(self, x: Array, wrench: Array, to: Array) -> float:
        """Factor at a state as it is; its scaled residual against the packed frame ``to``."""
        self._remember(x, wrench)
        _, _, error, self._negative = newton(*self.buffers, to, x / self.coordinate_unit, self._force, np.inf, 0)
        return float(error)

    def visit(self, x: Array, wrench: Array) -> int:
        """Factor at a state unless it is the last one; number of negative eigenvalues, −1 where singular."""
        if not (np.array_equal(x, self._x) and np.array_equal(wrench, self._wrench)):
            self._factor(x, wrench, self._anywhere)
        return self._negative

    def _must_visit(self, x: Array, wrench: Array) -> None:
        if self.visit(x, wrench) < 0:
            raise np.linalg.LinAlgError("the equilibrium is singular")

    def residual(self, x: Array, wrench: Array, target: Array) -> tuple[Array, Array, float]:
        """What statics and geometry lack at a state, which is factored on the way.

        Returns:
            ``K (θ(Jᵀ F) − θ)`` ``(n,)`` and the missing displacement ``(6,)``, see `vjm.equilibrium.residual`, and
            the largest of them, scaled.
        """
        error = self._factor(x, wrench, self._packed(target))
        statics = self._residual * self.energy / self.coordinate_unit
        return statics, self._gap * np.repeat([self._length, 1.0], 3), error

    def end_stiffness(self, x: Array, wrench: Array) -> Array:
        """``K^F`` (18) ``(6, 6)``.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        self._must_visit(x, wrench)
        K = np.empty((6, 6))
        end_stiffness(*self.buffers, self._force, K)
        return K * self.wrench_unit[:, None] * self.wrench_unit / self.energy

    def smallest(self, x: Array, wrench: Array) -> float:
        """Eigenvalue nearest zero of the second variation on the null space of J, units of the model's energy."""
        self._must_visit(x, wrench)
        return float(self._nearest(1)[0])

    def _nearest(self, wanted: int) -> Array:
        """The few eigenvalues nearest zero at the present state, so many good; their motions are in ``_modes``."""
        if not np.all(np.isfinite(self._modes)):
            self._modes[:] = self._starts
        # the last modes are near, and a share of the others keeps them from missing one that has come nearer
        self._modes /= np.linalg.norm(self._modes, axis=1)[:, None]
        self._modes += 0.01 * self._starts
        values = np.zeros(len(self._modes))
        if not smallest(*self.buffers, self._modes, values, wanted, EIGENVALUE_TOLERANCE, EIGENVALUE_ITERATIONS):
            raise np.linalg.LinAlgError("the equilibrium is singular to the last digit")
        return values

    def response(self, x: Array, wrench: Array, load: Array, gap: Array) -> tuple[Array, Array]:
        """Solve ``(K − H) δx − Jᵀ δF = load`` (n,), ``J δx = gap`` (6,) at a state.

        Returns:
            ``δx`` ``(n,)`` and ``δF`` ``(6,)``.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        self._must_visit(x, wrench)
        gap = gap / np.repeat([self._length, 1.0], 3)
        respond(*self.buffers, load * self.coordinate_unit / self.energy, gap)
        force = self._right[:6].copy()
        force[3:] -= 0.5 * np.cross(self._force[3:], gap[3:])
        return self._step * self.coordinate_unit, force * self.wrench_unit

    def modes(self, x: Array, wrench: Array, count: int) -> tuple[Array, Array]:
        """Eigenvalues nearest zero of the second variation on the null space of J, by inverse iteration.

        Args:
            x: coordinates ``(n,)``.
            wrench: ``(6,)``.
            count: how many; fewer are returned where the null space is smaller.

        Returns:
            Eigenvalues ``(count,)``, nearest zero first, in units of the model's energy, and motions
            ``(n, count)`` of unit length in the model's coordinate units.
        """
        free = len(x) - 6
        count = min(count, free)
        if count < 1:
            return np.empty(0), np.empty((len(x), 0))
        self._must_visit(x, wrench)
        if count < len(self._modes):
            values = self._nearest(count)[:count]
            V = self._modes[:count].T / np.linalg.norm(self._modes[:count], axis=1)
            return values, V * self.coordinate_unit[:, None]
        # more vectors than eigenvalues are wanted: the error falls with the ratio to the first one left out
        width = min(count + 2, free)
        V = self._some_vectors(width).T
        old = np.full(count, np.inf)
        for _ in range(EIGENVALUE_ITERATIONS):
            V, _ = np.linalg.qr(self._inverse(V))
            image = self._inverse(V)
            if not np.all(np.isfinite(image)):
                raise np.linalg.LinAlgError("the equilibrium is singular to the last digit")
            inverse, turn = np.linalg.eigh(0.5 * (V.T @ image + image.T @ V))
            nearest = np.argsort(-np.abs(inverse))
            values = 1.0 / inverse[nearest[:count]]
            V = image @ turn[:, nearest]
            if np.all(np.abs(values - old) <= EIGENVALUE_TOLERANCE * np.abs(values)):
                break
            old = values
        V = V[:, :count] / np.linalg.norm(V[:, :count], axis=0)
        return values, V * self.coordinate_unit[:, None]

    def shape(self, x: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""
        points = np.empty((len(self._station_joint), 3))
        positions(
            self.buffers.integers, self.buffers.numbers, x / self.coordinate_unit, self._station_joint,
            self._station_position, points,
        )  # fmt: skip
        return points * self._length

    def _inverse(self, vectors: Array) -> Array:
        """The inverse second variation on the null space of J, times vectors ``(n, k)``, scaled."""
        result = np.empty_like(vectors)
        for k, vector in enumerate(vectors.T):
            respond(*self.buffers, np.ascontiguousarray(vector), self._zero_gap)
            result[:, k] = self._step
        return result


def _arrays(model: LumpedModel) -> Arrays:
    """The model in dimensionless arrays."""
    length = model.chain.characteristic_length
    coordinate, energy = model.coordinate_scale, float(model.wrench_scale[3])
    joint_coordinate = np.argmax(model.drive != 0.0, axis=1) if len(model.drive) else np.zeros(0)
    block_of = np.empty(model.size, dtype=int)
    kind: list[int] = []
    first: list[int] = []
    K: list[Array] = []
    beam: list[Array] = []
    springs = iter(model.blocks)
    c = 0
    passive = set(model.passive.tolist())
    while c < model.size:
        k6, b7, width = np.zeros((6, 6)), np.zeros(7), 1
        if c in passive:
            this = PASSIVE
        else:
            spring, where = next(springs)
            width = where.stop - where.start
            unit = coordinate[where]
            k6[:width, :width] = np.linalg.inv(spring.unloaded) * unit[:, None] * unit / energy
            this = BEAM_COLUMN if isinstance(spring, BeamColumnSpring) else LINEAR
            if isinstance(spring, BeamColumnSpring):
                s, h = spring.section, spring.length
                force, moment = energy / length, energy * length
                b7[:] = (
                    s.EA / force, s.GJ / moment, s.EIy / moment, s.EIz / moment, h / length,
                    h / s.GAy * force / length, h / s.GAz * force / length,
                )  # fmt: skip
            elif not isinstance(spring, LinearSpring):
                raise TypeError(f"{type(spring).__name__} has no kernel")
        block_of[c : c + width] = len(kind)
        kind.append(this)
        first.append(c)
        K.append(k6)
        beam.append(b7)
        c += width
    joint_block = block_of[joint_coordinate.astype(int)] if model.size else np.zeros(0, dtype=int)
    along = np.array([_along(axis) for axis in model.axis], dtype=np.int64)
    R0 = np.ascontiguousarray(model.before[:, :3, :3])
    p0 = model.before[:, :3, 3] / length
    return Arrays(
        rotary=model.joint_rotary.astype(np.int64),
        axis=np.ascontiguousarray(model.axis),
        along=along,
        moved=np.any(model.before != np.eye(4), axis=(1, 2)).astype(np.int64),
        R0=R0,
        p0=np.ascontiguousarray(p0),
        coordinate=joint_coordinate.astype(np.int64),
        factor=model.drive[np.arange(len(model.drive)), joint_coordinate.astype(int)].copy(),
        kind=np.array(kind, dtype=np.int64),
        first=np.array([*first, model.size], dtype=np.int64),
        joints=np.searchsorted(joint_block, np.arange(len(kind) + 1)).astype(np.int64),
        K=np.array(K).reshape(-1, 6, 6),
        beam=np.array(beam).reshape(-1, 7),
        R_tail=np.ascontiguousarray(model.tail[:3, :3]),
        p_tail=model.tail[:3, 3] / length,
    )


def _along(axis: Array) -> int:
    """0, 1, 2 for the unit vectors x, y, z, else −1."""
    return next((k for k in range(3) if np.array_equal(axis, np.eye(3)[k])), -1)
