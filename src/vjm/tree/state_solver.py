"""States of a loaded machine with branches or point springs: Newton's matrix with the end-effector held, dense."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh, qr
from scipy.linalg.lapack import dgetrf, dgetrs

from vjm.kernels.state_solver import BodySolver
from vjm.rotations import Array, displacement_between, frame
from vjm.tree.arrays import TreeArrays
from vjm.tree.entry_points import linearize


class TreeSolver(BodySolver):
    """See `BodySolver`; the second variation on the null space of J is diagonalised where it is asked for."""

    def __init__(
        self,
        arrays: TreeArrays,
        natural: Array,
        constant: Array,
        ramped: Array,
        scales: tuple[Array, Array],
        stations: tuple[np.ndarray, Array],
    ) -> None:
        """Bind the kernels to a machine's arrays.

        Args:
            arrays: the machine, with one end frame and no held joints.
            natural: ``(n,)`` coordinates at which its springs are free of stress.
            constant: wrenches ``(l, 6)`` on the loaded points, N, N mm; of followers in their bodies' axes.
            ramped: the same per unit of the load factor.
            scales: units of the coordinates ``(n,)`` and of the wrench ``(6,)``.
            stations: the joint before each ``(k,)`` and its position ``(k, 3)`` behind that joint, mm.
        """
        super().__init__(*scales)
        self._arrays, self._natural = arrays, np.ascontiguousarray(natural, dtype=float)
        self._constant, self._ramped, self._stations = constant, ramped, stations
        self._unit = np.concatenate([self.coordinate_unit, self.wrench_unit]) / np.sqrt(self.energy)

    # --- a state ------------------------------------------------------------------------------------------

    def _look(self, x: Array, wrench: Array, load: float) -> None:
        """Linearise and factor at a state unless it is the last one."""
        if self._is_last(x, wrench, load):
            return
        self._remember(x, wrench, load)
        n, m, count = len(x), len(self._arrays.parent), len(self._constant)
        loads = self._constant + load * self._ramped
        self._r, self._t, self._A = np.zeros(n), np.zeros(n), np.zeros((n, n))
        self._J, self._acting, self._points = (
            np.zeros((1 + count, 6, n)),
            np.zeros((count, 6)),
            np.zeros((1 + count, 3)),
        )
        self._R, self._p = np.zeros((m + 1, 3, 3)), np.zeros((m + 1, 3))
        linearize(
            self._arrays._replace(load=loads), self._natural, np.ascontiguousarray(x), wrench[None].copy(), loads,
            self._r, self._t, self._A, self._J, self._acting, self._points, self._R, self._p,
        )  # fmt: skip
        J = self._J[0]
        M = np.block([[self._A, -J.T], [J, np.zeros((6, 6))]]) * self._unit[:, None] * self._unit
        self._values: Array | None = None
        self._negative = -1
        if not np.all(np.isfinite(M)):
            return
        self._lu, self._swaps, zero_pivot = dgetrf(M)
        if not zero_pivot:
            self._negative = 0

    def residual(self, x: Array, wrench: Array, target: Array, load: float = 0.0) -> tuple[Array, Array, float]:
        """What statics and geometry lack; relative to the forces on the coordinates where these are large."""
        self._look(x, wrench, load)
        try:
            gap = displacement_between(frame(self._R[-1], self._p[-1]), target)
        except ValueError:
            return self._r, np.zeros(6), np.inf
        heavy = max(
            1.0,
            float(np.max(np.abs(wrench / self.wrench_unit))),
            float(np.max(np.abs(self._t * self.coordinate_unit))) / self.energy,
        )
        lacking = max(np.abs(self._r * self.coordinate_unit).max(), np.abs(gap * self.wrench_unit).max())
        return self._r, gap, float(lacking) / self.energy / heavy

    def newton(
        self, target: Array, x: Array, wrench: Array, load: float, tolerance: float, max_iterations: int
    ) -> tuple[Array, Array, float, int, str]:
        """Equilibrium with the end-effector at the frame ``target`` (4, 4), see `StateSolver.newton`."""
        return self._newton(target, x, wrench, load, tolerance, max_iterations)

    # --- solutions ----------------------------------------------------------------------------------------

    def _solved(self, right: Array) -> Array:
        """Motions and wrenches ``(n + 6, …)`` that a right side brings at the state at hand.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        if self._negative < 0:
            raise np.linalg.LinAlgError("the equilibrium is singular")
        unit = self._unit.reshape(-1, *[1] * (right.ndim - 1))
        result: Array = unit * dgetrs(self._lu, self._swaps, unit * right)[0].reshape(right.shape)
        return result

    def response(
        self, x: Array, wrench: Array, statics: Array, gap: Array, load: float = 0.0
    ) -> tuple[Array, Array]:
        """See `StateSolver.response`."""
        self._look(x, wrench, load)
        found = self._solved(np.concatenate([statics, gap]))
        return found[:-6], found[-6:]

    def end_stiffness(self, x: Array, wrench: Array, load: float = 0.0) -> Array:
        """``K^F`` (18) ``(6, 6)``, see `StateSolver.end_stiffness`."""
        self._look(x, wrench, load)
        return self._solved(np.eye(len(x) + 6)[:, -6:])[-6:]

    def inverse(self, x: Array, wrench: Array, load: float = 0.0) -> Array:
        """See `StateSolver.inverse`."""
        self._look(x, wrench, load)
        n = len(x)
        forces = np.zeros((n + 6, n))
        forces[:n] = np.diag(self.energy / self.coordinate_unit)
        result: Array = self._solved(forces)[:n] / self.coordinate_unit[:, None]
        return result

    # --- loads --------------------------------------------------------------------------------------------

    def load_forces(self, x: Array, wrench: Array, load: float, wrenches: Array) -> Array:
        """Generalised forces ``(n,)`` of ``wrenches`` (l, 6) on the loaded points; world axes, at a state."""
        self._look(x, wrench, load)
        result: Array = np.einsum("kai,ka->i", self._J[1:], wrenches)
        return result

    def ramped(self, x: Array, wrench: Array, load: float) -> Array:
        """Generalised forces ``(n,)`` of the ramped loads, per unit of the load factor, at a state."""
        self._look(x, wrench, load)
        wrenches = self._ramped.copy()
        for k in np.flatnonzero(self._arrays.follows):
            R = self._R[self._arrays.load_joint[k]]
            wrenches[k] = np.concatenate([R @ wrenches[k, :3], R @ wrenches[k, 3:]])
        return self.load_forces(x, wrench, load, wrenches)

    def acting(self, x: Array, wrench: Array, load: float) -> Array:
        """Wrenches ``(l, 6)`` on the loaded points, N, N mm, world axes, at a state."""
        self._look(x, wrench, load)
        return self._acting

    def points(self, x: Array, wrench: Array, load: float) -> Array:
        """Positions ``(l, 3)`` of the loaded points, mm, world, at a state."""
        self._look(x, wrench, load)
        return self._points[1:]

    def shape(self, x: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""
        if self._state[0] != x.tobytes():
            self._look(x, np.zeros(6), 0.0)
        joint, position = self._stations
        # of the base, −1, the frame is the world's
        R, p = np.concatenate([self._R[:-1], np.eye(3)[None]]), np.concatenate([self._p[:-1], np.zeros((1, 3))])
        result: Array = np.einsum("kab,kb->ka", R[joint], position) + p[joint]
        return result

    # --- stability ----------------------------------------------------------------------------------------

    def _diagonalise(self) -> None:
        """Eigenvalues and motions of the second variation on the null space of J, scaled, at the state at hand."""
        if self._values is not None:
            return
        J = self._J[0] * self.coordinate_unit / np.repeat([self.energy / self.wrench_unit[0], 1.0], 3)[:, None]
        N = qr(J.T, check_finite=False)[0][:, 6:]
        A = 0.5 * (self._A + self._A.T) * self.coordinate_unit[:, None] * self.coordinate_unit / self.energy
        self._values, V = eigh(N.T @ A @ N, check_finite=False)
        self._motions = N @ V

    def visit(self, x: Array, wrench: Array, load: float = 0.0) -> int:
        """Number of negative eigenvalues at a state, −1 where it is singular."""
        self._look(x, wrench, load)
        if self._negative < 0:
            return -1
        self._diagonalise()
        assert self._values is not None
        return int(np.count_nonzero(self._values < 0.0))

    def smallest(self, x: Array, wrench: Array, load: float = 0.0) -> float:
        """Eigenvalue nearest zero of the second variation, units of the energy."""
        return float(self.modes(x, wrench, 1, load)[0][0])

    def modes(
        self, x: Array, wrench: Array, count: int, load: float = 0.0, tolerance: float = 0.0
    ) -> tuple[Array, Array]:
        """Eigenvalues nearest zero ``(count,)`` and their motions ``(n, count)`` of unit length when scaled."""
        self._must_visit(x, wrench, load)
        assert self._values is not None
        order = np.argsort(np.abs(self._values))[:count]
        return self._values[order], self._motions[:, order] * self.coordinate_unit[:, None]
