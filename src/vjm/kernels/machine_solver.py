"""States of a loaded machine one after another: equilibria, stiffness, stability, modes, linear in its springs."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vjm.kernels.arrays import BEAM_COLUMN, LINEAR, MachineArrays, Work, machine_object, work_object, workspace
from vjm.kernels.entry_points import (
    ROWS,
    ImposedRamp,
    Limits,
    ModeSearch,
    Rows,
    arnoldi,
    end_stiffness,
    generalised,
    inverse_times,
    march,
    nearest,
    plain_steps,
    positions,
    respond,
    solve_state,
)
from vjm.kernels.newton import CONVERGED, SINGULAR, UNSTABLE
from vjm.rotations import Array


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


# --- What rounding leaves of the residual of a loaded machine, from the sizes of its terms ------------------------


def rounding(arrays: MachineArrays, work: Work, x: Array, natural: Array) -> tuple[Array, Array]:
    """Bounds ``(n,)`` of the statics' rounding and ``(f,)`` of the closures', at the state where bodies are placed.

    Each row is a sum of spring forces, loads' moments or distances. The sum of their sizes, times the relative
    rounding of a number, times the number of joints that they pass, bounds what rounding leaves of it.

    Args:
        arrays: the machine.
        work: at the state.
        x: coordinates ``(n,)``.
        natural: ``(n,)`` those at which the springs are free of stress.
    """
    strain, unit = np.abs(x - natural), arrays.unit
    springs = np.zeros(len(unit))
    for block, (first, end) in enumerate(pairwise(arrays.first)):
        if arrays.kind[block] == LINEAR:
            springs[first:end] += np.abs(arrays.K[block, : end - first, : end - first]) @ strain[first:end]
        elif arrays.kind[block] == BEAM_COLUMN:
            EA, GJ, EIy, EIz, h = arrays.beam[block, :5]
            stiff = np.array([EA, 12.0 * EIz / h**2, 12.0 * EIy / h**2, GJ, EIy, EIz]) / h
            springs[first:end] += stiff * strain[first:end]
    springs[arrays.border] += np.abs(arrays.border_K) @ strain[arrays.border]
    of_law = arrays.border[arrays.border_law >= 0]
    springs[of_law] += arrays.law_most[arrays.border_law[arrays.border_law >= 0]] * strain[of_law]
    springs[arrays.border] += np.abs(arrays.coupling).T @ np.abs(work.wrench[int(arrays.size[1]) :])
    # moments are summed about the world's origin
    far = max(float(np.abs(places).max(initial=0.0)) for places in (work.p, work.point, work.place))
    force = moment = 0.0
    for wrench in (*work.acting, *np.split(work.wrench, arrays.closure_first[1:])):
        force, moment = force + float(np.abs(wrench[:3]).sum()), moment + float(np.abs(wrench[3:6]).sum())
    if len(arrays.spring):
        lengths = np.linalg.norm(work.spring_at[:, 1] - work.spring_at[:, 0], axis=1)
        force += float(arrays.spring[:, 0] @ (lengths + arrays.spring[:, 1]) + np.abs(arrays.spring[:, 2]).sum())
    loads = (force * np.maximum(far, unit) + moment) / unit
    gaps = np.full(len(work.gap), max(1.0, far))
    for first, rows in zip(arrays.closure_first, arrays.closure_rows, strict=False):
        gaps[first + 3 : first + rows] = 1.0
    count = len(arrays.parent) * np.finfo(float).eps
    return count * (springs + loads), count * gaps


# --- Eigenvalues nearest zero of a tangent that is not symmetric, or that a device holds in one motion more -------

SIZES = (8, 12, 16, 24, 32, 48)
"""Of the spaces, one after the other until the eigenvalue nearest zero is sharp."""
SHARP = 1e-8
"""Residual of that eigenvalue's inverse, over it."""
KNOWN = 1e-2
"""Residual, over the inverse, up to which an eigenvalue's sign is known; three are asked to be."""
NEUTRAL = 1e-12
"""Inverse over the largest one: zero, of motions that the constraints take away."""


def near_zero(
    model: MachineArrays, work: Work, start: Array, device: Array, held: Array
) -> tuple[Array, Array] | None:
    """Eigenvalues nearest zero with the present factors, by Arnoldi's method with the inverse.

    Args:
        model: the machine.
        work: factored at a state.
        start: vector ``(n,)`` with a share of every mode.
        device: see `vjm.kernels.entry_points.arnoldi`; empty without.
        held: likewise.

    Returns:
        Complex eigenvalues ``(k,)`` whose sign is known, nearest zero first, and the real part ``(n,)`` of the
        first one's motion; None where the largest space did not tell.
    """
    n = len(start)
    sizes = sorted({min(size, n) for size in SIZES})
    H, basis = np.zeros((sizes[-1] + 1, sizes[-1])), np.empty((sizes[-1] + 1, n))
    basis[0] = start / np.linalg.norm(start)
    done = 0
    for size in sizes:
        reached = arnoldi(model, work, device, held, done, basis, H[:, :size])
        if not np.all(np.isfinite(H[: reached + 1, :reached])):
            return None
        inverse, vectors = np.linalg.eig(H[:reached, :reached])
        exhausted = reached < size
        left = 0.0 if exhausted else abs(H[reached, reached - 1])
        order = np.argsort(-np.abs(inverse))
        inverse, vectors = inverse[order], vectors[:, order]
        felt = np.abs(inverse) > NEUTRAL * np.abs(inverse[0])
        lacking = left * np.abs(vectors[-1, felt]) / np.abs(inverse[felt])
        if lacking[0] < SHARP and np.all(lacking[:3] < KNOWN):
            known = np.flatnonzero(felt)[lacking < KNOWN]
            return 1.0 / inverse[known], vectors[:, 0].real @ basis[:reached]
        if exhausted:
            return None
        done = reached
    return None


EIGENVALUE_TOLERANCE = 1e-9
"""Relative error of an eigenvalue at which its iteration ends."""
EIGENVALUE_ITERATIONS = 200
EIGENVALUE_RESTARTS = 20
BLOCKS = 6
"""Of the space in which several eigenvalues are looked for."""
BASIS = 16
"""Vectors of Lanczos's method: from a neighbour's mode it takes five."""
SHARE = 0.01
"""Of all modes in the vector that it starts from."""
NOTHING = np.empty(0)


class MachineSolver:
    """The kernels at work on one machine, whose end-effector is held by the first closure; N, mm, rad.

    A state is the coordinates with the inner closures' wrenches ``x`` (n + f,), the wrench ``(6,)`` that holds the
    end-effector, world axes, and the factor ``load`` on the ramped loads. The factors of the last state are kept:
    all that is asked about one state costs one factorisation.

    Attributes:
        coordinate_unit: units ``(n + f,)`` of the coordinates.
        energy: unit of energy, N mm.
    """

    def __init__(
        self,
        arrays: MachineArrays,
        command: Array,
        natural: Array,
        constant: Array,
        ramped: Array,
        coordinate_unit: Array,
        stations: tuple[np.ndarray, Array],
    ) -> None:
        """Bind the kernels to a machine's arrays.

        Args:
            arrays: the machine; its first closure is the end-effector's, with the ground as partner.
            command: ``(m,)`` values at which its joints stand.
            natural: ``(n,)`` coordinates at which its springs are free of stress.
            constant: wrenches ``(l, 6)`` on the loaded points, N, N mm; of followers in their bodies' axes.
            ramped: the same per unit of the load factor.
            coordinate_unit: of the coordinates ``(n + f,)``, of which the last f are the inner closures' wrenches.
            stations: the joint before each ``(k,)`` and its position ``(k, 3)`` behind that joint, mm.
        """
        self.coordinate_unit, self.energy = coordinate_unit, float(arrays.energy[0])
        self._negative = -1
        self._forget()
        own = {name: getattr(arrays, name).copy() for name in ("closure_R", "closure_p", "load")}
        self.arrays, self._natural = arrays._replace(**own), np.ascontiguousarray(natural, dtype=float)
        self._constant, self._ramped, self._stations = constant, ramped, stations
        self._work = workspace(self.arrays)
        # the same as kernels take them
        self._objects = machine_object(self.arrays), work_object(self._work)
        self._n, self._command = len(natural), command
        self._end_wrench = np.zeros((len(arrays.end_joint), 6))
        self._gap = np.zeros(int(arrays.size[2]))
        self._start = _some_vectors(1, self._n)[0]
        self._mode = self._start.copy()
        # closures that others imply take no motion away, and nothing feels idle ones
        redundant, idle = arrays.spare.tolist()
        self._free = self._n - len(self._gap) + redundant - idle
        # one vector more than there are motions: the first one is none of them
        self._basis = np.empty((min(BASIS, max(self._free, 1) + 1), self._n))

    # --- a state ------------------------------------------------------------------------------------------

    def _remember(self, x: Array, wrench: Array, load: float) -> None:
        """Which state the factors belong to."""
        # bytes: the caller may write to its own arrays, and these are compared fastest
        self._state, self._load = (x.tobytes(), wrench.tobytes()), load

    def _is_last(self, x: Array, wrench: Array, load: float) -> bool:
        """Whether the factors are those of a state."""
        return load == self._load and (x.tobytes(), wrench.tobytes()) == self._state

    def _forget(self) -> None:
        self._remember(np.full(len(self.coordinate_unit), np.nan), np.full(6, np.nan), np.nan)

    def _must_visit(self, x: Array, wrench: Array, load: float) -> None:
        if self.factorise(x, wrench, load) < 0:
            raise np.linalg.LinAlgError("the equilibrium is singular")

    def _begin(self, x: Array, wrench: Array, load: float, target: Array | None) -> Array:
        """Set loads, closures' wrenches and the imposed frame; the coordinates ``(n,)``."""
        self._work.wrench[:6], self._work.wrench[6:] = wrench, x[self._n :]
        if len(self._constant):
            loads = self._constant + load * self._ramped
            self.arrays.load[:], self._work.body[:] = loads, loads
        if target is not None:
            self.arrays.closure_R[0, 0], self.arrays.closure_p[0, 0] = target[:3, :3], target[:3, 3]
        return np.ascontiguousarray(x[: self._n], dtype=float).copy()

    def _found(self, x: Array) -> tuple[Array, Array]:
        """Coordinates with the inner closures' wrenches ``(n + f,)``, and the end-effector's wrench ``(6,)``."""
        return np.concatenate([x, self._work.wrench[6:]]), self._work.wrench[:6].copy()

    def newton(
        self, target: Array, x: Array, wrench: Array, load: float, tolerance: float, max_iterations: int
    ) -> tuple[Array, Array, float, int, str]:
        """Equilibrium with the end-effector at the frame ``target`` (4, 4) under the load factor ``load``.

        Returns:
            Coordinates ``(n + f,)``, wrench ``(6,)``, scaled residual, iterations, and why it failed or nothing.
        """
        coordinates = self._begin(x, wrench, load, target)
        how, iterations, error, self._negative = solve_state(
            *self._objects, self._command, self._natural, coordinates, self._end_wrench, tolerance, max_iterations
        )
        x, wrench = self._found(coordinates)
        self._remember(x, wrench, load)
        why = {CONVERGED: "", SINGULAR: "at a singular state"}.get(how, f"after {iterations} iterations")
        if error < tolerance:
            # a critical state is an equilibrium, too
            why = ""
        if why and not np.isfinite(error):
            why = "outside the neighbourhood of the target pose"
        elif why and how != SINGULAR:
            statics, gap, error = self.residual(x, wrench, target, load)
            why = "" if self.rounded(x, statics, gap) else why
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
            x: coordinates ``(n + f,)`` at the first point.
            wrench: ``(6,)`` there.
            tolerance: scaled residual.
            most: Newton iterations at a point.
            origin: place of the bifurcation at which the branch begins, if it does.

        Raises:
            ValueError: loads of the machine grow with the ramp, turn with its bodies, or are moments.
            numpy.linalg.LinAlgError: the first point is a critical one.
        """
        g = len(s)
        X, F = np.empty((g, self._n)), np.empty((g, len(self._gap)))
        X[0], F[0] = x[: self._n], np.concatenate([wrench, x[self._n :]])
        how, good, K, error, iterations, _ = self._march(pose, direction, s, X, F, tolerance, most, origin, True)
        if not good:
            raise np.linalg.LinAlgError("the first equilibrium is singular")
        done = min(good + (how == UNSTABLE), g)
        why = {CONVERGED: "", UNSTABLE: "unstable"}.get(how, f"Newton did not converge in {most} steps")
        return March(
            good, why, np.hstack([X, F[:, 6:]])[:done], F[:done, :6], K[:done], error[:done], iterations[:done]
        )

    def correct(
        self, pose: Array, direction: Array, s: Array, x: Array, wrench: Array, tolerance: float, most: int
    ) -> tuple[Array, Array, Array, np.ndarray]:
        """Equilibria at displacements of a ramp, each from a state near by, as of a model that differs a little.

        Args:
            pose: unloaded frame ``(4, 4)`` of the end-effector.
            direction: displacement ``(6,)`` per unit of s.
            s: ``(g,)``.
            x: coordinates ``(g, n + f)`` to start from.
            wrench: ``(g, 6)``.
            tolerance: scaled residual.
            most: Newton iterations at a point.

        Returns:
            Of the ``k ≤ g`` points before the first at which Newton's method fails: coordinates ``(k, n + f)``,
            wrenches ``(k, 6)``, stiffnesses ``(k, 6, 6)``, and numbers of negative eigenvalues ``(k,)``.

        Raises:
            ValueError: as for `march`.
        """
        X, F = np.ascontiguousarray(x[:, : self._n]).copy(), np.hstack([wrench, x[:, self._n :]])
        _, count, K, _, _, negative = self._march(pose, direction, s, X, F, tolerance, most, -np.inf, False)
        return np.hstack([X, F[:, 6:]])[:count], F[:count, :6], K[:count], negative[:count]

    def _march(
        self, pose: Array, direction: Array, s: Array, X: Array, F: Array, tolerance: float, most: int,
        origin: float, along: bool,
    ) -> tuple[int, int, Array, Array, np.ndarray, np.ndarray]:  # fmt: skip
        if len(self.arrays.turning) or self._ramped.any():
            raise ValueError("a grid is marched under constant forces that keep their direction")
        self._begin(np.concatenate([X[0], F[0, 6:]]), F[0, :6], 0.0, None)
        K, error = np.empty((len(s), 6, 6)), np.zeros(len(s))
        iterations, negative = np.zeros(len(s), dtype=np.int64), np.zeros(len(s), dtype=np.int64)
        how, good = march(
            *self._objects, self._command, self._natural, self._end_wrench,
            np.ascontiguousarray(pose[:3, :3]), np.ascontiguousarray(pose[:3, 3]),
            np.ascontiguousarray(direction, dtype=float), np.ascontiguousarray(s, dtype=float), float(origin),
            along, tolerance, most, X, F, K, error, iterations, negative,
        )  # fmt: skip
        self._forget()  # the factors are those of another state now
        return how, good, K, error, iterations, negative

    def plain_steps(
        self, pose: Array, direction: Array, s: Array, x: Array, wrench: Array, kept: tuple[Array, Array, Array],
        limits: Limits, origin: float, step: float,
    ) -> tuple[Rows, float]:  # fmt: skip
        """Follow a path of displacements as long as its steps leave nothing to look into.

        Args:
            pose: unloaded frame ``(4, 4)`` of the end-effector.
            direction: displacement ``(6,)`` per unit of s.
            s: its last points ``(g,)``, at most three.
            x: their coordinates ``(g, n + f)``.
            wrench: ``(g, 6)``.
            kept: their eigenvalues ``(g,)``, tangents ``(g,)`` and shapes ``(g, k, 3)``, without what is not shown.
            limits: of the steps.
            origin: place of the bifurcation at which the branch begins, if it does; −inf if not.
            step: to begin with.

        Returns:
            The points behind them, and the next step.

        Raises:
            ValueError: loads of the machine grow with the ramp, turn with its bodies, or are moments.
        """
        if len(self.arrays.turning) or self._ramped.any():
            raise ValueError("plain steps are taken under constant forces that keep their direction")
        g, n, f = len(s), self._n, len(self._gap)
        k = kept[2].shape[1]
        shapes = {"x": (n,), "wrench": (f,), "stiffness": (6, 6), "shape": (k, 3), "rate": (n,)}
        rows = Rows._make(
            np.empty((ROWS, *shapes.get(name, ())), dtype=np.int64 if name == "iterations" else float)
            for name in Rows._fields
        )
        rows.s[:g], rows.x[:g], rows.wrench[:g] = s, x[:, :n], np.hstack([wrench, x[:, n:]])
        rows.eigenvalue[:g], rows.tangent[:g], rows.shape[:g] = kept
        self._begin(x[-1], wrench[-1], 0.0, None)
        if not np.all(np.isfinite(self._mode)):
            self._mode[:] = self._start
        modes = ModeSearch(self._mode, SHARE * self._start, self._basis, EIGENVALUE_TOLERANCE, EIGENVALUE_RESTARTS)
        ramp = ImposedRamp(
            np.ascontiguousarray(pose[:3, :3]), np.ascontiguousarray(pose[:3, 3]),
            np.ascontiguousarray(direction, dtype=float),
        )  # fmt: skip
        count, step = plain_steps(
            *self._objects, self._command, self._natural, self._end_wrench, ramp, modes,
            self._stations[0][:k], np.ascontiguousarray(self._stations[1][:k]), limits, origin, g, step, rows,
        )  # fmt: skip
        self._forget()  # the factors are those of another state now
        return Rows._make(column[g:count] for column in rows), step

    def _factor(self, x: Array, wrench: Array, load: float, target: Array | None) -> float:
        """Factor at a state as it is; its scaled residual."""
        self._remember(x, wrench, load)
        coordinates = self._begin(x, wrench, load, target)
        _, _, error, self._negative = solve_state(
            *self._objects, self._command, self._natural, coordinates, self._end_wrench, np.inf, 0
        )
        return float(error)

    def factorise(self, x: Array, wrench: Array, load: float = 0.0) -> int:
        """Factor at a state unless it is the last one; number of negative eigenvalues, −1 where singular."""
        if not self._is_last(x, wrench, load):
            self._factor(x, wrench, load, None)
        return self._negative

    def residual(self, x: Array, wrench: Array, target: Array, load: float = 0.0) -> tuple[Array, Array, float]:
        """What statics and the inner closures ``(n + f,)`` and the end-effector ``(6,)`` lack, and the largest."""
        error = self._factor(x, wrench, load, target)
        return np.concatenate([self._work.r, self._work.gap[6:]]), self._work.gap[:6].copy(), error

    def rounded(self, x: Array, statics: Array, gap: Array) -> bool:
        """Whether the residual that `residual` has just found is no more than the rounding of its terms.

        Each row is a sum of spring forces, loads' moments or distances. The sum of their sizes, times the machine's
        relative rounding, times the number of joints that they pass, bounds what rounding leaves of it.

        Args:
            x: coordinates ``(n,)`` of the state.
            statics: ``(n,)`` and
            gap: ``(6,)`` as `residual` gives them.
        """
        forces, gaps = rounding(self.arrays, self._work, x[: self._n], self._natural)
        return bool(
            np.all(np.abs(statics) <= np.concatenate([forces, gaps[6:]])) and np.all(np.abs(gap) <= gaps[:6])
        )

    # --- solutions ----------------------------------------------------------------------------------------

    def response(
        self, x: Array, wrench: Array, statics: Array, gap: Array, load: float = 0.0
    ) -> tuple[Array, Array]:
        """Change of the coordinates ``(n,)`` and of the wrench ``(6,)`` that ``statics`` and ``gap`` ask for.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        steps, wrenches = self.responses(x, wrench, statics[None], gap[None], load)
        return steps[0], wrenches[0]

    def responses(
        self, x: Array, wrench: Array, statics: Array, gap: Array, load: float = 0.0
    ) -> tuple[Array, Array]:
        """The same ``(k, n)`` and ``(k, 6)`` of k right sides at once.

        Raises:
            numpy.linalg.LinAlgError: as there.
        """
        self._must_visit(x, wrench, load)
        steps, change = np.empty((len(gap), self._n)), np.empty((len(gap), len(self._gap)))
        forces = np.ascontiguousarray(statics[:, : self._n], dtype=float)
        gaps = np.hstack([gap, statics[:, self._n :]])
        for k in range(len(gap)):
            respond(*self._objects, forces[k], gaps[k], change[k])
            steps[k] = self._work.step
        return np.hstack([steps, change[:, 6:]]), change[:, :6]

    def end_stiffness(self, x: Array, wrench: Array, load: float = 0.0) -> Array:
        """``K^F`` (18) ``(6, 6)``, N/mm, N, N mm.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        self._must_visit(x, wrench, load)
        K = np.empty((6, 6))
        end_stiffness(*self._objects, K)
        return K

    # --- loads --------------------------------------------------------------------------------------------

    def load_forces(self, x: Array, wrench: Array, load: float, wrenches: Array) -> Array:
        """Generalised forces ``(n + f,)`` of ``wrenches`` (l, 6) on the loaded points; world axes, at a state."""
        self.factorise(x, wrench, load)
        return self._generalised(wrenches)

    def _generalised(self, wrenches: Array) -> Array:
        forces = np.empty(self._n)
        generalised(*self._objects, np.ascontiguousarray(wrenches), forces)
        return np.concatenate([forces, np.zeros(len(self.coordinate_unit) - self._n)])

    def ramped(self, x: Array, wrench: Array, load: float) -> Array:
        """Generalised forces ``(n,)`` of the ramped loads, per unit of the load factor, at a state."""
        self.factorise(x, wrench, load)
        wrenches = self._ramped.copy()
        for k in np.flatnonzero(self.arrays.follows):
            R = self._work.R[self.arrays.load_joint[k]]
            wrenches[k] = np.concatenate([R @ wrenches[k, :3], R @ wrenches[k, 3:]])
        return self._generalised(wrenches)

    def acting(self, x: Array, wrench: Array, load: float) -> Array:
        """Wrenches ``(l, 6)`` on the loaded points, N, N mm, world axes, at a state."""
        self.factorise(x, wrench, load)
        return self._work.acting.copy()

    def points(self, x: Array, wrench: Array, load: float) -> Array:
        """Positions ``(l, 3)`` of the loaded points, mm, world, at a state."""
        self.factorise(x, wrench, load)
        return self._work.point.copy()

    def shape(self, x: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""
        out = np.empty((len(self._stations[0]), 3))
        coordinates = np.ascontiguousarray(x[: self._n], dtype=float)
        positions(*self._objects, self._command, coordinates, *self._stations, out)
        if x.tobytes() != self._state[0]:
            self._forget()  # the bodies stand elsewhere now
        return out

    # --- stability ----------------------------------------------------------------------------------------

    def smallest(self, x: Array, wrench: Array, load: float = 0.0) -> float:
        """Eigenvalue nearest zero of the second variation on what is free, units of the model's energy.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point to the last digit.
        """
        self._must_visit(x, wrench, load)
        if not np.all(np.isfinite(self._mode)):
            self._mode[:] = self._start
        # the last mode is near, and a share of the others keeps it from missing one that has come nearer
        self._mode += SHARE * np.linalg.norm(self._mode) * self._start
        value = nearest(*self._objects, self._mode, self._basis, EIGENVALUE_TOLERANCE, EIGENVALUE_RESTARTS)
        if np.isinf(value):
            raise np.linalg.LinAlgError("the equilibrium is singular to the last digit")
        if np.isnan(value):
            # two of opposite sign are equally near: the whole spectrum tells
            S = self._inverse(np.eye(self._n))
            inverse = np.linalg.eigvalsh(0.5 * (S + S.T))
            value = 1.0 / inverse[np.argmax(np.abs(inverse))]
        return float(value)

    def near_zero(
        self, x: Array, wrench: Array, load: float, device: Array | None
    ) -> tuple[Array, int | None, bool] | None:
        """Eigenvalues nearest zero where the tangent is not symmetric, or a device holds one motion more.

        Args:
            x: coordinates ``(n,)``.
            wrench: ``(6,)``.
            load: factor on the ramped loads.
            device: generalised forces ``(n,)`` of the device.

        Returns:
            Complex eigenvalues ``(k,)``, nearest zero first; how many of all are negative, where that is counted;
            and whether their number is odd. None where the solver does not tell: then the whole spectrum does.
        """
        self._must_visit(x, wrench, load)
        negative, forces, held = self._negative, NOTHING, NOTHING
        unit = self.coordinate_unit[: self._n]
        if device is not None:
            forces = device[: self._n] * unit / self.energy
            held = self._inverse(forces[:, None])[:, 0]
            work = float(forces @ held)
            if work == 0.0:
                return None
            # a constraint takes a negative eigenvalue away where the motion that it stops had brought it
            negative -= work < 0.0
            forces = forces / work
        odd = negative % 2 == 1
        symmetric = not len(self.arrays.turning)
        if not symmetric:
            odd ^= bool(self._work.state[3])
        if not np.all(np.isfinite(self._mode)):
            self._mode[:] = self._start
        start = self._mode / np.linalg.norm(self._mode) + SHARE * self._start
        spectrum = near_zero(*self._objects, start, forces, held)
        if spectrum is None:
            return None
        values, self._mode[:] = spectrum
        return values, negative if symmetric else None, odd

    def modes(
        self, x: Array, wrench: Array, count: int, load: float = 0.0, tolerance: float = EIGENVALUE_TOLERANCE
    ) -> tuple[Array, Array]:
        """Eigenvalues nearest zero ``(count,)`` of the second variation on what the closures leave, and motions.

        By Lanczos's method with blocks on the inverse (Golub and Underwood 1977), begun anew from its motions where
        the space is large. Fewer are returned where less is free.

        Args:
            x: coordinates ``(n + f,)``.
            wrench: ``(6,)``.
            count: how many.
            load: factor on the ramped loads.
            tolerance: change of the eigenvalues, over the largest of them, at which the iteration ends.

        Returns:
            Eigenvalues, nearest zero first, in units of the energy, and motions ``(n + f, count)`` of unit length
            in the coordinates' units; the inner closures' wrenches in them are zero.
        """
        free = self._free
        count = min(count, free)
        if count < 1:
            return np.empty(0), np.empty((len(self.coordinate_unit), 0))
        self._must_visit(x, wrench, load)
        # more vectors than eigenvalues are wanted: one start sees no two that are equal
        width = min(count + 2, free)
        most = min(BLOCKS * width, free)
        motion = V = self._inverse(_some_vectors(width, self._n).T)
        old, values = np.full(count, np.inf), np.empty(0)
        basis = image = nothing = np.empty((self._n, 0))
        for _ in range(EIGENVALUE_ITERATIONS):
            if basis.shape[1] + width > most:
                V, basis, image = motion, nothing, nothing
            # twice: once leaves what rounding makes of vectors that are nearly parallel
            V = np.linalg.qr(V - basis @ (basis.T @ V))[0]
            V = np.linalg.qr(V - basis @ (basis.T @ V))[0]
            basis, V = np.hstack([basis, V]), self._inverse(V)
            image = np.hstack([image, V])
            if not np.all(np.isfinite(V)):
                raise np.linalg.LinAlgError("the equilibrium is singular to the last digit")
            projected = basis.T @ image
            inverse, turn = np.linalg.eigh(0.5 * (projected + projected.T))
            nearest_zero = np.argsort(-np.abs(inverse))
            # what the closures take away in this state has an inverse of zero
            nearest_zero = nearest_zero[inverse[nearest_zero] != 0.0][:width]
            if not len(nearest_zero):
                raise np.linalg.LinAlgError("the equilibrium is singular to the last digit")
            values = 1.0 / inverse[nearest_zero[:count]]
            motion = image @ turn[:, nearest_zero]
            # of one that is zero there are no digits
            if len(values) == len(old) and np.abs(values - old).max() <= tolerance * np.abs(values).max():
                break
            old = values
        motions = np.zeros((len(self.coordinate_unit), len(values)))
        unit = self.coordinate_unit[: self._n, None]
        motion = motion[:, : len(values)]
        motions[: self._n] = motion / np.linalg.norm(motion, axis=0) * unit
        return values, motions

    def _inverse(self, vectors: Array) -> Array:
        """The inverse second variation on what the closures leave, times vectors ``(n, k)``, scaled."""
        rows = np.ascontiguousarray(vectors.T)
        result = np.empty_like(rows)
        inverse_times(*self._objects, rows, result)
        return result.T

    def inverse(self, x: Array, wrench: Array, load: float = 0.0) -> Array:
        """The inverse second variation on the null space of J ``(n, n)``, dense and scaled, at a state.

        With loads that turn it is that of the whole tangent, which is not symmetric.
        """
        self._must_visit(x, wrench, load)
        return self._inverse(np.eye(self._n))


@lru_cache(maxsize=16)
def _some_vectors(count: int, size: int) -> Array:
    """Unit vectors ``(count, size)`` with a share of every mode, always the same, so that results repeat."""
    vectors = np.random.default_rng(0).standard_normal((count, size))
    vectors /= np.linalg.norm(vectors, axis=1)[:, None]
    vectors.flags.writeable = False
    return vectors
