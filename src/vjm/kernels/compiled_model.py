"""A lumped model in compiled form: equilibria, stiffness, stability and modes at a cost linear in its springs."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from vjm.kernels.entry_points import (
    CONVERGED,
    SINGULAR,
    UNSTABLE,
    end_stiffness,
    load_forces,
    nearest,
    newton,
    place_loads,
    respond,
)
from vjm.kernels.grid_points import correct, march
from vjm.kernels.march import March
from vjm.kernels.near_zero import near_zero
from vjm.kernels.packed_model import PackedModel, buffers, work_of
from vjm.kernels.recursion import positions
from vjm.kernels.state_solver import BodySolver
from vjm.rotations import Array

EIGENVALUE_TOLERANCE = 1e-9
"""Relative error of an eigenvalue at which its iteration ends."""
EIGENVALUE_ITERATIONS = 200
EIGENVALUE_RESTARTS = 20
BASIS = 16
"""Vectors of Lanczos's method: from a neighbour's mode it takes five."""
SHARE = 0.01
"""Of all modes in the vector that it starts from."""
_NOTHING = np.empty(0)


class CompiledModel(BodySolver):
    """The kernels at work on one lumped model."""

    def __init__(
        self,
        arrays: PackedModel,
        constant: Array,
        ramped: Array,
        scales: tuple[Array, Array],
        length: float,
        stations: tuple[np.ndarray, Array],
    ) -> None:
        """Bind the kernels to a model's arrays.

        Args:
            arrays: the model, packed.
            constant: wrenches ``(l, 6)`` on the loaded points, N, N mm.
            ramped: the same per unit of the load factor.
            scales: units of the coordinates ``(n,)`` and of the wrench ``(6,)``.
            length: unit of the translations, mm.
            stations: of the points that show the shape, the joint before each ``(k,)`` and the position ``(k, 3)``
                behind that joint, mm.
        """
        super().__init__(*scales)
        self._length = length
        self._gap_unit = np.repeat([length, 1.0], 3)
        self.arrays = arrays
        self.buffers = buffers(arrays)
        self._work = work_of(self.buffers.integers[:6], self.buffers.work_integers, self.buffers.work_numbers)
        self._constant, self._ramped = constant / self.wrench_unit, ramped / self.wrench_unit
        self._zero_gap = np.zeros(6)
        self._anywhere = self._packed(np.eye(4))
        self._station_joint, self._station_position = stations[0], stations[1] / length
        size = len(self.coordinate_unit)
        self._start = _some_vectors(1, size)[0]
        self._mode = self._start.copy()
        self._basis = np.empty((max(min(BASIS, size - 6), 1), size))

    def newton(
        self, target: Array, x: Array, wrench: Array, load: float, tolerance: float, max_iterations: int
    ) -> tuple[Array, Array, float, int, str]:
        """Equilibrium with the end-effector at the frame ``target`` (4, 4) under the load factor ``load``.

        Returns:
            Coordinates ``(n,)``, wrench ``(6,)``, scaled residual, iterations, and why it failed or nothing.
        """
        x, force = x / self.coordinate_unit, wrench / self.wrench_unit
        to = self._packed(target)
        self._apply_loads(load)
        how, iterations, error, self._negative = newton(*self.buffers, to, x, force, tolerance, max_iterations)
        x, wrench = x * self.coordinate_unit, force * self.wrench_unit
        self._remember(x, wrench, load)
        why = {CONVERGED: "", SINGULAR: "at a singular state"}.get(how, f"after {iterations} iterations")
        if why and not np.isfinite(error):
            why = "outside the neighbourhood of the target pose"
        return x, wrench, float(error), int(iterations), why

    def march(
        self, pose: Array, direction: Array, s: Array, x: Array, wrench: Array, tolerance: float, most: int,
        origin: float = -np.inf,
    ) -> March:  # fmt: skip
        """Equilibria along a grid of displacements from its first point, which is given; constant loads act.

        Args:
            pose: unloaded frame ``(4, 4)`` of the end-effector.
            direction: displacement ``(6,)`` per unit of s.
            s: ``(g,)``.
            x: coordinates ``(n,)`` at the first point.
            wrench: ``(6,)`` there.
            tolerance: scaled residual.
            most: Newton iterations at a point.
            origin: place of the bifurcation at which the branch begins, if it does.

        Raises:
            ValueError: loads of the model grow with the ramp, turn with its bodies, or are moments.
            numpy.linalg.LinAlgError: the first point is a critical one.
        """
        self._must_be_constant()
        self._apply_loads(0.0)
        g, n = len(s), len(x)
        X, F, K = np.empty((g, n)), np.empty((g, 6)), np.empty((g, 6, 6))
        error, iterations, negative = np.zeros(g), np.zeros(g, dtype=np.int64), np.zeros(g, dtype=np.int64)
        stiffness_unit = self.wrench_unit[:, None] * self.wrench_unit / self.energy
        X[0], F[0] = x / self.coordinate_unit, wrench / self.wrench_unit
        how, good = march(
            *self.buffers, np.ascontiguousarray(pose[:3, :3]), pose[:3, 3] / self._length,
            np.concatenate([direction[:3] / self._length, direction[3:]]), np.ascontiguousarray(s, dtype=float),
            float(origin), 1, tolerance, most, X, F, K, error, iterations, negative,
        )  # fmt: skip
        self._forget()  # the factors are those of another state now
        if not good:
            raise np.linalg.LinAlgError("the first equilibrium is singular")
        done = min(good + (how == UNSTABLE), g)
        K[:done] *= stiffness_unit
        why = {CONVERGED: "", UNSTABLE: "unstable"}.get(how, f"Newton did not converge in {most} steps")
        return March(
            good, why, X[:done] * self.coordinate_unit, F[:done] * self.wrench_unit, K[:done], error[:done],
            iterations[:done],
        )  # fmt: skip

    def correct(
        self, pose: Array, direction: Array, s: Array, x: Array, wrench: Array, tolerance: float, most: int
    ) -> tuple[Array, Array, Array, np.ndarray]:
        """Equilibria at displacements of a ramp, each from a state near by, as of a model that differs a little.

        Args:
            pose: unloaded frame ``(4, 4)`` of the end-effector.
            direction: displacement ``(6,)`` per unit of s.
            s: ``(g,)``.
            x: coordinates ``(g, n)`` to start from.
            wrench: ``(g, 6)``.
            tolerance: scaled residual.
            most: Newton iterations at a point.

        Returns:
            Of the ``k ≤ g`` points before the first at which Newton's method fails: coordinates ``(k, n)``,
            wrenches ``(k, 6)``, stiffnesses ``(k, 6, 6)``, and numbers of negative eigenvalues ``(k,)``.

        Raises:
            ValueError: as for `march`.
        """
        self._must_be_constant()
        self._apply_loads(0.0)
        X, F = x / self.coordinate_unit, wrench / self.wrench_unit
        K, negative = np.empty((len(s), 6, 6)), np.zeros(len(s), dtype=np.int64)
        found = correct(
            *self.buffers, np.ascontiguousarray(pose[:3, :3]), pose[:3, 3] / self._length,
            np.concatenate([direction[:3] / self._length, direction[3:]]), np.ascontiguousarray(s, dtype=float),
            tolerance, most, X, F, K, negative,
        )  # fmt: skip
        self._forget()
        # what lies beyond was never written
        X, F, K = X[:found] * self.coordinate_unit, F[:found] * self.wrench_unit, K[:found] / self.energy
        return X, F, K * self.wrench_unit[:, None] * self.wrench_unit, negative[:found]

    def _must_be_constant(self) -> None:
        if len(self.arrays.turning) or self._ramped.any():
            raise ValueError("a grid is marched under constant forces that keep their direction")

    def _remember(self, x: Array, wrench: Array, load: float) -> None:
        super()._remember(x, wrench, load)
        self._force = wrench / self.wrench_unit

    def _apply_loads(self, load: float) -> None:
        if len(self._constant):
            self._work.load[:] = self._constant + load * self._ramped

    def _packed(self, target: Array) -> Array:
        """A frame ``(4, 4)`` as the kernels take it: ``(12,)`` rotation row by row, then scaled position."""
        return np.concatenate([target[:3, :3].ravel(), target[:3, 3] / self._length])

    def _factor(self, x: Array, wrench: Array, load: float, to: Array) -> float:
        """Factor at a state as it is; its scaled residual against the packed frame ``to``."""
        self._remember(x, wrench, load)
        self._apply_loads(load)
        _, _, error, self._negative = newton(*self.buffers, to, x / self.coordinate_unit, self._force, np.inf, 0)
        return float(error)

    def visit(self, x: Array, wrench: Array, load: float = 0.0) -> int:
        """Factor at a state unless it is the last one; number of negative eigenvalues, −1 where singular."""
        if not self._is_last(x, wrench, load):
            self._factor(x, wrench, load, self._anywhere)
        return self._negative

    def residual(self, x: Array, wrench: Array, target: Array, load: float = 0.0) -> tuple[Array, Array, float]:
        """What statics and geometry lack at a state, which is factored on the way.

        Returns:
            ``K (θ(Jᵀ F) − θ)`` ``(n,)`` and the missing displacement ``(6,)``, see
            `vjm.statics.equilibrium.residual`, and the largest of them, scaled.
        """
        error = self._factor(x, wrench, load, self._packed(target))
        statics = self._work.residual * self.energy / self.coordinate_unit
        return statics, self._work.gap * self._gap_unit, error

    def load_forces(self, x: Array, wrench: Array, load: float, wrenches: Array) -> Array:
        """Generalised forces ``(n,)`` of ``wrenches`` (l, 6) on the loaded points; world axes, at a state."""
        self._must_visit(x, wrench, load)
        return self._load_forces(wrenches / self.wrench_unit) * self.energy / self.coordinate_unit

    def ramped(self, x: Array, wrench: Array, load: float) -> Array:
        """Generalised forces ``(n,)`` of the ramped loads, per unit of the load factor, at a state."""
        self._must_visit(x, wrench, load)
        wrenches = self._ramped
        if self.arrays.follows.any():
            # known in their bodies' axes: turned as the kernel turns what acts, which is then put back
            self._work.load[:] = wrenches
            place_loads(*self.buffers, x / self.coordinate_unit)
            wrenches = self._work.acting.copy()
            self._apply_loads(load)
            place_loads(*self.buffers, x / self.coordinate_unit)
        return self._load_forces(wrenches) * self.energy / self.coordinate_unit

    def _load_forces(self, wrenches: Array) -> Array:
        forces = np.empty(len(self.coordinate_unit))
        load_forces(*self.buffers, np.ascontiguousarray(wrenches), forces)
        return forces

    def acting(self, x: Array, wrench: Array, load: float) -> Array:
        """Wrenches ``(l, 6)`` on the loaded points, N, N mm, world axes, at a state."""
        self.visit(x, wrench, load)
        return self._work.acting * self.wrench_unit

    def points(self, x: Array, wrench: Array, load: float) -> Array:
        """Positions ``(l, 3)`` of the loaded points, mm, world, at a state."""
        self.visit(x, wrench, load)
        return self._work.point * self._length

    def end_stiffness(self, x: Array, wrench: Array, load: float = 0.0) -> Array:
        """``K^F`` (18) ``(6, 6)``.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        self._must_visit(x, wrench, load)
        K = np.empty((6, 6))
        end_stiffness(*self.buffers, self._force, K)
        return K * self.wrench_unit[:, None] * self.wrench_unit / self.energy

    def smallest(self, x: Array, wrench: Array, load: float = 0.0) -> float:
        """Eigenvalue nearest zero of the second variation on the null space of J, units of the model's energy.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point to the last digit.
        """
        self._must_visit(x, wrench, load)
        if not np.all(np.isfinite(self._mode)):
            self._mode[:] = self._start
        # the last mode is near, and a share of the others keeps it from missing one that has come nearer
        self._mode += SHARE * np.linalg.norm(self._mode) * self._start
        value = float(nearest(*self.buffers, self._mode, self._basis, EIGENVALUE_TOLERANCE, EIGENVALUE_RESTARTS))
        if np.isnan(value):
            raise np.linalg.LinAlgError("the equilibrium is singular to the last digit")
        return value

    def near_zero(
        self, x: Array, wrench: Array, load: float, device: Array | None
    ) -> tuple[Array, int | None, bool] | None:
        """See `vjm.kernels.state_solver.StateSolver.near_zero`."""
        self._must_visit(x, wrench, load)
        negative, forces, held = self._negative, _NOTHING, _NOTHING
        if device is not None:
            forces = device * self.coordinate_unit / self.energy
            respond(*self.buffers, forces, self._zero_gap)
            held = self._work.step.copy()
            work = float(forces @ held)
            if work == 0.0:
                return None
            # a constraint takes a negative eigenvalue away where the motion that it stops had brought it
            negative -= work < 0.0
            forces = forces / work
        odd = negative % 2 == 1
        symmetric = not len(self.arrays.turning)
        if not symmetric:
            odd ^= bool(self._work.determinant[0] < 0.0)
        if not np.all(np.isfinite(self._mode)):
            self._mode[:] = self._start
        start = self._mode / np.linalg.norm(self._mode) + SHARE * self._start
        found = near_zero(self.buffers, start, forces, held)
        if found is None:
            return None
        self._mode[:] = found.motion
        return found.values, negative if symmetric else None, odd

    def response(
        self, x: Array, wrench: Array, statics: Array, gap: Array, load: float = 0.0
    ) -> tuple[Array, Array]:
        """Solve ``(K − H) δx − Jᵀ δF = statics`` (n,), ``J δx = gap`` (6,) at a state.

        Returns:
            ``δx`` ``(n,)`` and ``δF`` ``(6,)``.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        self._must_visit(x, wrench, load)
        gap = gap / self._gap_unit
        respond(*self.buffers, np.ascontiguousarray(statics * self.coordinate_unit / self.energy), gap)
        step, force = self._work.step.copy(), self._work.right[:6].copy()
        m, r = self._force[3:], gap[3:]
        # the moment turns with nothing, see `vjm.kernels.entry_points`; np.cross would take as long as the solution
        force[3] -= 0.5 * (m[1] * r[2] - m[2] * r[1])
        force[4] -= 0.5 * (m[2] * r[0] - m[0] * r[2])
        force[5] -= 0.5 * (m[0] * r[1] - m[1] * r[0])
        return step * self.coordinate_unit, force * self.wrench_unit

    def modes(
        self, x: Array, wrench: Array, count: int, load: float = 0.0, tolerance: float = EIGENVALUE_TOLERANCE
    ) -> tuple[Array, Array]:
        """Eigenvalues nearest zero of the second variation on the null space of J, by inverse iteration.

        Args:
            x: coordinates ``(n,)``.
            wrench: ``(6,)``.
            count: how many; fewer are returned where the null space is smaller.
            load: factor on the ramped loads.
            tolerance: change of the eigenvalues, over the largest of them, at which the iteration ends.

        Returns:
            Eigenvalues ``(count,)``, nearest zero first, in units of the model's energy, and motions
            ``(n, count)`` of unit length in the model's coordinate units.
        """
        free = len(x) - 6
        count = min(count, free)
        if count < 1:
            return np.empty(0), np.empty((len(x), 0))
        self._must_visit(x, wrench, load)
        # more vectors than eigenvalues are wanted: the error falls with the ratio to the first one left out
        width = min(count + 2, free)
        V = _some_vectors(width, len(self.coordinate_unit)).T
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
            # of one that is zero there are no digits
            if np.abs(values - old).max() <= tolerance * np.abs(values).max():
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
            result[:, k] = self._work.step
        return result


@lru_cache(maxsize=16)
def _some_vectors(count: int, size: int) -> Array:
    """Unit vectors ``(count, size)`` with a share of every mode, always the same, so that results repeat."""
    vectors = np.random.default_rng(0).standard_normal((count, size))
    vectors /= np.linalg.norm(vectors, axis=1)[:, None]
    vectors.flags.writeable = False
    return vectors
