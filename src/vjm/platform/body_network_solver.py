"""Linear algebra of a loaded manipulator: Newton's matrix on its bodies with the legs' K_i^F (18) as their springs.

The unknowns are the legs' coordinates and end wrenches, the bodies' displacements and the couplings' torques. Each
leg is condensed onto its ends by its own factors; what is left is a matrix of six rows a body,

    M = Σ_i  E_iᵀ K_i^F E_i + the turning of the legs' wrenches with the bodies,

which for legs from the base to the platform is the paper's ``K^F = Σ K_i^F`` at the platform's reference point.
By Haynsworth's theorem the number of unstable modes is the sum of those of the legs, their ends held, and of those
of M.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from vjm.kernels.machine_solver import EIGENVALUE_TOLERANCE
from vjm.kernels.state_solver import StateSolver
from vjm.model.lumped import LumpedModel
from vjm.platform.leg_topology import Edge, Layout, Universal, Visited, add_leg, carried, pose_error, turn_rate
from vjm.rotations import Array, frame, inverse_frame, rotation_from_vector, skew
from vjm.statics.equilibrium import scaled_norm

FEW = 20
"""Vectors of Lanczos's method."""


class NetworkSolver(StateSolver):
    """All legs at work together, in the form in which one chain is; takes and returns N, mm, rad.

    Args:
        models: lumped legs.
        edges: how they lie.
        layout: of the coordinates.
        places0: frames ``(b, 4, 4)`` from which the bodies' displacements count.
        held: ``(6,)`` which components of the platform's pose are imposed.
        constant: dead wrench ``(6,)`` on the platform at its reference point.
        ramped: the same, per unit of the load factor.
        torques: of each coupling its legs, joints' coordinates, weights and values at rest.
        scales: units of the coordinates ``(n,)`` and of the platform's wrench ``(6,)``.
    """

    def __init__(
        self,
        models: Sequence[LumpedModel],
        edges: Sequence[Edge],
        layout: Layout,
        places0: Array,
        held: Array,
        constant: Array,
        ramped: Array,
        torques: Sequence[Sequence[tuple[int, int, float, float]]],
        scales: tuple[Array, Array],
    ) -> None:
        self.models, self.edges, self.layout, self.places0 = models, edges, layout, places0
        self.held = held
        self._joint = Universal(held, places0[0]) if np.count_nonzero(held[3:]) == 1 else None
        self._axes = np.eye(3)
        super().__init__(*scales)
        self._dead, self._per_load, self._torques = constant, ramped, torques
        b, c = 6 * len(places0), len(torques)
        free = np.ones(b + c, dtype=bool)
        free[:6] = np.logical_not(held)
        self._free = np.flatnonzero(free)
        self._held = np.flatnonzero(held)
        self._mode = np.zeros(0)

    # --- a state ------------------------------------------------------------------------------------------

    def frames(self, x: Array) -> Array:
        """Frames ``(b, 4, 4)`` of the bodies at coordinates ``x`` (n,)."""
        moves = x[self.layout.bodies].reshape(-1, 6)
        return np.array(
            [frame(rotation_from_vector(d[3:]) @ T[:3, :3], T[:3, 3] + d[:3])
             for T, d in zip(self.places0, moves, strict=True)]
        )  # fmt: skip

    def _look(self, x: Array, wrench: Array, load: float) -> None:
        """Linearise every leg and assemble the bodies' matrix and what their balance lacks."""
        if self._is_last(x, wrench, load):
            return
        self._remember(x, wrench, load)
        self._legs: list[Visited] = []
        T = self.frames(x)
        b, c = 6 * len(T), len(self._torques)
        M, balance = np.zeros((b + c, b + c)), np.zeros(b + c)
        if self._joint is not None:
            self._axes = self._joint.axes(T[0])
        balance[:6] = self.held_wrench(wrench) + self._dead + load * self._per_load
        negative, singular = 0, False
        torque = x[self.layout.couplings]
        for i, (model, edge) in enumerate(zip(self.models, self.edges, strict=True)):
            world = (np.eye(4) if edge.start < 0 else T[edge.start]) @ edge.root
            place = T[edge.end] @ edge.place
            own, F = x[self.layout.legs[i]], x[self.layout.wrenches[i]]
            statics, gap, error = model.compiled.residual(own, F, inverse_frame(world) @ place)
            found = model.compiled.visit(own, F)
            if found < 0:
                singular = True
                break
            negative += found
            felt = []
            for k, terms in enumerate(self._torques):
                for leg, joint, weight, _ in terms:
                    if leg == i:
                        statics = statics.copy()
                        statics[joint] += weight * torque[k]
                        error = scaled_norm(model, statics, gap, F)
                        unit = np.zeros(len(own))
                        unit[joint] = weight
                        felt.append((k, joint, weight, *model.compiled.response(own, F, unit, np.zeros(6))))
            turned = np.kron(np.eye(2), world[:3, :3])
            W = turned @ F
            K = turned @ model.compiled.end_stiffness(own, F) @ turned.T
            end = place[:3, 3]
            at_end = carried(end - T[edge.end][:3, 3])
            at_start = carried(end - T[edge.start][:3, 3]) if edge.start >= 0 else np.zeros((6, 6))
            self._legs.append(Visited(statics, gap, error, turned, K, at_end, at_start, W, felt))
            add_leg(M, balance, edge, self._legs[-1], len(T))
        self._M, self._balance = M, balance
        self._free_M = self._in_joint_axes(M, wrench)
        if singular:
            self._negative = -1
            return
        for k, terms in enumerate(self._torques):
            for leg, joint, weight, rest in terms:
                balance[b + k] += weight * (x[self.layout.legs[leg]][joint] - rest)
        self._negative = self._inertia(negative)

    def held_wrench(self, wrench: Array) -> Array:
        """Of a wrench ``(6,)`` that holds the platform what its joint can bear, at the state that was seen last."""
        if self._joint is None:
            return wrench
        return np.concatenate([wrench[:3], self._joint.borne(self._axes, wrench[3:])])

    def _in_joint_axes(self, M: Array, wrench: Array) -> Array:
        """The bodies' matrix with the platform's turns along the axes of the joint that carries it."""
        if self._joint is None:
            return M
        result = M.copy()
        result[3:6, 3:6] += self._joint.turning(self._axes, wrench[3:])
        result[3:6] = self._axes.T @ result[3:6]
        result[:, 3:6] = result[:, 3:6] @ self._axes
        return result

    def _inertia(self, negative: int) -> int:
        """Number of negative eigenvalues of the whole, from the legs' and the bodies' matrix; −1 where singular."""
        if not len(self._free):
            return negative
        A = self._scaled_bodies()
        values = np.linalg.eigvalsh(A)
        if not np.all(np.isfinite(values)) or np.abs(values).min() <= 1e-14 * np.abs(values).max():
            return -1
        return negative + int(np.count_nonzero(values < 0.0)) - len(self._torques)

    def _scaled_bodies(self) -> Array:
        """The free bodies' symmetric matrix, its diagonal ±1.

        Bodies between are held far more stiffly than the platform: beside them a soft one would seem critical.
        """
        unit = self._body_unit[self._free]
        A = (
            0.5
            * (self._free_M + self._free_M.T)[np.ix_(self._free, self._free)]
            * unit[:, None]
            * unit
            / self.energy
        )
        size = np.sqrt(np.abs(np.diag(A)))
        size[size == 0.0] = 1.0
        result: Array = A / size[:, None] / size
        return result

    @property
    def _body_unit(self) -> Array:
        """Units of the bodies' displacements and of the couplings' torques."""
        return np.concatenate([self.coordinate_unit[self.layout.bodies], np.full(len(self._torques), self.energy)])

    def visit(self, x: Array, wrench: Array, load: float = 0.0) -> int:
        """Linearise at a state; number of negative eigenvalues of the whole, −1 where singular."""
        self._look(x, wrench, load)
        return self._negative

    def residual(self, x: Array, wrench: Array, target: Array, load: float = 0.0) -> tuple[Array, Array, float]:
        """What statics and geometry lack: ``(n,)``, the platform's missing displacement ``(6,)``, and the largest.

        The statics' part of a leg's wrench is the gap at its end.
        """
        self._look(x, wrench, load)
        gap = pose_error(self.frames(x)[0], target, self.held)
        if self._joint is not None:
            gap[3:] = 0.0
            gap[3 + self._joint.held] = self._joint.pose_error(self.frames(x)[0])
        heavy = max(1.0, float(np.max(np.abs(wrench / self.wrench_unit))))
        error = float(np.max(np.abs(gap * self.wrench_unit))) / self.energy
        statics = np.zeros(self.layout.size)
        if self._negative < 0 and len(self._legs) < len(self.models):
            return statics, gap, np.inf
        for i, leg in enumerate(self._legs):
            statics[self.layout.legs[i]] = leg.statics
            statics[self.layout.wrenches[i]] = leg.gap
            heavy = max(heavy, float(np.max(np.abs(leg.wrench / self.wrench_unit))))
            error = max(error, leg.error)
        bodies = self._balance.copy()
        statics[self.layout.bodies], statics[self.layout.couplings] = (
            bodies[: len(bodies) - len(self._torques)],
            bodies[len(bodies) - len(self._torques) :],
        )
        lacking = statics[self.layout.bodies].reshape(-1, 6) / self.wrench_unit
        error = max(error, float(np.max(np.abs(lacking))) / heavy)
        if len(self._torques):
            error = max(error, float(np.max(np.abs(statics[self.layout.couplings]))))
        return statics, gap, error

    # --- solutions ----------------------------------------------------------------------------------------

    def response(
        self, x: Array, wrench: Array, statics: Array, gap: Array, load: float = 0.0
    ) -> tuple[Array, Array]:
        """Motion ``(n,)`` and change of the platform's held wrench ``(6,)`` that ``statics`` and ``gap`` ask for.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        self._must_visit(x, wrench, load)
        dx, motions, dF = self._solve(x, statics, gap, self._free_M)
        for k, d in enumerate(x[self.layout.bodies].reshape(-1, 6)):
            motions[6 * k + 3 : 6 * k + 6] = np.linalg.solve(turn_rate(d[3:]), motions[6 * k + 3 : 6 * k + 6])
        dx[self.layout.bodies] = motions
        return dx, dF

    def _solve(self, x: Array, statics: Array, gap: Array, M: Array) -> tuple[Array, Array, Array]:
        """`response` with the bodies' motions as shifts and small turns; ``dx`` lacks them."""
        layout, b = self.layout, 6 * len(self.places0)
        right = np.concatenate([statics[layout.bodies], statics[layout.couplings]])
        for i, (model, edge, leg) in enumerate(zip(self.models, self.edges, self._legs, strict=True)):
            own, F = x[layout.legs[i]], x[layout.wrenches[i]]
            dx, dF = model.compiled.response(own, F, statics[layout.legs[i]], statics[layout.wrenches[i]])
            dW = leg.world @ dF
            right[6 * edge.end : 6 * edge.end + 6] -= leg.at_end.T @ dW
            if edge.start >= 0:
                right[6 * edge.start : 6 * edge.start + 6] += leg.at_start.T @ dW
            for k, joint, weight, _, _ in leg.torques:
                right[b + k] += weight * dx[joint]
        right[3:6] = self._axes.T @ right[3:6]
        motions = np.zeros(len(right))
        motions[self._held] = gap[self._held]
        free = self._free
        if len(free):
            lacking = right - M @ motions
            unit = self._body_unit[free]
            A = M[np.ix_(free, free)] * unit[:, None] * unit
            motions[free] = unit * np.linalg.solve(A, unit * lacking[free])
        dwrench = np.zeros(6)
        dwrench[self._held] = (M @ motions - right)[self._held]
        dwrench[3:], motions[3:6] = self._axes @ dwrench[3:], self._axes @ motions[3:6]
        result = np.zeros(layout.size)
        for i, (model, edge, leg) in enumerate(zip(self.models, self.edges, self._legs, strict=True)):
            own, F = x[layout.legs[i]], x[layout.wrenches[i]]
            twist = leg.at_end @ motions[6 * edge.end : 6 * edge.end + 6]
            if edge.start >= 0:
                twist = twist - leg.at_start @ motions[6 * edge.start : 6 * edge.start + 6]
            reactions = statics[layout.legs[i]]
            for k, joint, weight, _, _ in leg.torques:
                reactions = reactions.copy()
                reactions[joint] += weight * motions[b + k]
            result[layout.legs[i]], result[layout.wrenches[i]] = model.compiled.response(
                own, F, reactions, statics[layout.wrenches[i]] + leg.world.T @ twist
            )
        result[layout.couplings] = motions[b:]
        return result, motions[:b], dwrench

    def newton(
        self, target: Array, x: Array, wrench: Array, load: float, tolerance: float, max_iterations: int
    ) -> tuple[Array, Array, float, int, str]:
        """Equilibrium with the platform at the frame ``target`` (4, 4), see `StateSolver.newton`."""
        try:
            return self._newton(target, x, wrench, load, tolerance, max_iterations)
        except np.linalg.LinAlgError:
            # on the way: a body has turned full circle
            return x, wrench, float("inf"), max_iterations, "at a singular state"

    def end_stiffness(self, x: Array, wrench: Array, load: float = 0.0) -> Array:
        """``K^F`` ``(6, 6)`` of the platform, its whole pose imposed: the sum over the legs at its reference point.

        Raises:
            numpy.linalg.LinAlgError: the state is critical with the platform held.
        """
        self._look(x, wrench, load)
        if len(self._legs) < len(self.models):
            raise np.linalg.LinAlgError("a leg is singular")
        K = self._M[:6, :6].copy()
        if len(self._M) > 6:
            K -= self._M[:6, 6:] @ np.linalg.solve(self._M[6:, 6:], self._M[6:, :6])
        return K

    def leg_stiffness(self, x: Array, wrench: Array, load: float = 0.0) -> Array:
        """Each leg's own ``K_i^F`` ``(l, 6, 6)`` at the reference point of the body that it ends on, world axes."""
        self._look(x, wrench, load)
        result = []
        for leg in self._legs:
            E, f = leg.at_end, leg.wrench[:3]
            K = E.T @ leg.K @ E
            K[3:, 3:] += skew(f) @ -E[:3, 3:]
            result.append(K)
        return np.array(result)

    def leg_wrenches(self, x: Array, wrench: Array, load: float = 0.0) -> Array:
        """Wrench ``(l, 6)`` that each leg bears at its end, about that end, N, N mm, world axes."""
        self._look(x, wrench, load)
        return np.array([leg.wrench for leg in self._legs])

    def ramped(self, x: Array, wrench: Array, load: float) -> Array:
        """The ramped wrench on the platform among the coordinates' forces ``(n,)``."""
        result = np.zeros(self.layout.size)
        result[self.layout.platform] = self._per_load
        return result

    # --- stability ----------------------------------------------------------------------------------------

    def smallest(self, x: Array, wrench: Array, load: float = 0.0) -> float:
        """Eigenvalue nearest zero of the whole's second variation, units of the energy."""
        values, _ = self.modes(x, wrench, 1, load)
        return float(values[0])

    def modes(
        self, x: Array, wrench: Array, count: int, load: float = 0.0, tolerance: float = EIGENVALUE_TOLERANCE
    ) -> tuple[Array, Array]:
        """Eigenvalues nearest zero and their motions ``(n, count)``, of unit length in the coordinates' units."""
        self._must_visit(x, wrench, load)
        layout = self.layout
        moving = np.concatenate([np.arange(layout.legs[-1].stop), layout.bodies.start + self._free_bodies])
        unit = self.coordinate_unit[moving]
        symmetric = 0.5 * (self._free_M + self._free_M.T)
        turns = slice(layout.platform.start + 3, layout.platform.stop)

        def inverse(v: Array) -> Array:
            forces = np.zeros(layout.size)
            forces[moving] = v.ravel() * self.energy / unit
            forces[turns] = self._axes @ forces[turns]
            dx, motions, _ = self._solve(x, forces, np.zeros(6), symmetric)
            dx[layout.bodies] = motions
            dx[turns] = self._axes.T @ dx[turns]
            return dx[moving] / unit

        n = len(moving)
        count = min(count, n - 2)
        start = self._mode if len(self._mode) == n else np.zeros(n)
        start = start + 0.01 * np.random.default_rng(0).standard_normal(n)
        try:
            inverses, V = eigsh(
                LinearOperator((n, n), matvec=inverse, dtype=float), k=count, v0=start,
                ncv=min(n - 1, max(FEW, 2 * count + 1)),
                tol=1e-10 if tolerance < 1e-6 else 1e-6,
            )  # fmt: skip
        except ArpackError as error:
            raise np.linalg.LinAlgError(str(error)) from error
        order = np.argsort(-np.abs(inverses))
        inverses, V = inverses[order], V[:, order]
        if not np.all(np.isfinite(inverses)) or inverses[0] == 0.0:
            raise np.linalg.LinAlgError("the equilibrium is singular to the last digit")
        self._mode = V[:, 0]
        motions = np.zeros((layout.size, count))
        motions[moving] = V * unit[:, None]
        motions[turns] = self._axes @ motions[turns]
        return 1.0 / inverses, motions

    @property
    def _free_bodies(self) -> np.ndarray:
        """Of the free rows those of bodies."""
        return self._free[self._free < 6 * len(self.places0)]

    def shape(self, x: Array) -> Array:
        """Positions ``(k, 3)`` of all legs' stations, mm, world."""
        T = self.frames(x)
        points = []
        for own, model, edge in zip(self.layout.legs, self.models, self.edges, strict=True):
            world = (np.eye(4) if edge.start < 0 else T[edge.start]) @ edge.root
            points.append(model.compiled.shape(x[own]) @ world[:3, :3].T + world[:3, 3])
        return np.vstack(points)
