"""The loaded stiffness of the earlier literature: Jacobians and Hessians of the unloaded posture.

The paper's references [7] and [8] account for the load in the stiffness but not in the configuration. Taken
along a path this is ``dF = K^F(J₀, H₀(F)) dt`` with the geometry frozen, and buckling where ``K − H₀(F)``
loses its definiteness on the null space of J₀. Nothing holds beyond that point.

The integration must be exact for the verdict to be the model's own. Where the mode that softens is coupled
to the driven direction (postures B and D), K^F tends to minus infinity as the eigenvalue tends to zero, so
that the force yields first and the eigenvalue never gets there. An explicit Euler integration steps across
and reports a bifurcation that its step made.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import null_space

from vjm.baselines.frozen_geometry import FrozenGeometry
from vjm.continuation.path import Equilibrium, Event, EventKind, Path
from vjm.errors import NoConvergenceError
from vjm.limits import refuse
from vjm.model.end_condition import rigid_direction
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm.threads import single_threaded

RELATIVE_TOLERANCE = 1e-8
"""Of the integration, four orders below the 1e-4 to which events are promised."""


class FrozenMachine:
    """A machine on the geometry of its unloaded posture, under any forces.

    *Forces* are ``(6 + r + s,)``: the wrench on the end-effector, the multipliers of the r independent conditions
    that close loops, and the forces of the s springs between points.

    Attributes:
        unloaded: forces, all zero.
        force_unit: of the forces: typical ones.
    """

    def __init__(self, geometry: FrozenGeometry) -> None:
        """Set a machine up.

        Raises:
            ValueError: it is rigid in some direction, or moves without straining a spring.
        """
        self._geometry, self._machine = geometry, geometry.machine()
        machine = self._machine
        if machine.rigid(machine.end):
            raise rigid_direction(machine.name)
        if machine.neutral(machine.end).shape[1]:
            raise ValueError(
                f"{machine.name}: a part of it moves without straining a spring and without the end-effector, so "
                f"that its stability is not determined; hold that part"
            )
        self._rows = np.vstack([machine.end, machine.independent])
        self._null = null_space(self._rows * machine.unit)
        self._stretching, self._springs = geometry.stretching()
        self._held = [np.zeros(0, dtype=int)] * len(geometry.closures)
        first = 0
        for i, (_, closure) in enumerate(geometry.closures):
            kept = machine.kept
            self._held[i] = kept[(kept >= first) & (kept < first + closure.rows)] - first
            first += closure.rows
        energy, length = machine.energy, machine.length
        self.force_unit = np.concatenate(
            [
                np.repeat([energy / length, energy], 3),
                energy / np.linalg.norm(machine.independent * machine.unit, axis=1),
                np.full(len(self._springs), energy / length),
            ]
        )
        self.unloaded = np.zeros(len(self.force_unit))

    def tangent(self, forces: Array) -> Array:
        """``K − H`` ``(n, n)`` by the coordinates."""
        geometry, (wrench, multipliers, pulls) = self._geometry, self._split(forces)
        reactions = self._rows.T @ forces[: len(self._rows)] - self._stretching.T @ pulls
        A = geometry.stiffness(reactions) + (self._stretching.T * self._springs) @ self._stretching
        A -= geometry.hessian(geometry.end, wrench)
        first = 0
        for ((a, b), _), held in zip(geometry.closures, self._held, strict=True):
            between = np.zeros(6)
            between[held] = multipliers[first : first + len(held)]
            first += len(held)
            A -= geometry.hessian(b, between) - geometry.hessian(a, between)
        for (a, b), row, pull in zip(geometry.point_springs, self._stretching, pulls, strict=True):
            way = geometry.place(b)[:3, 3] - geometry.place(a)[:3, 3]
            length = float(np.linalg.norm(way))
            along = np.concatenate([pull * way / length, np.zeros(3)])
            apart = (geometry.jacobian(b) - geometry.jacobian(a))[:3]
            # a line turns by what its ends part across it
            A += geometry.hessian(b, along) - geometry.hessian(a, along)
            A += pull / length * (apart.T @ apart - np.outer(row, row))
        return A

    def _split(self, forces: Array) -> tuple[Array, Array, Array]:
        rows = len(self._rows)
        return forces[:6], forces[6:rows], forces[rows:]

    def rate(self, forces: Array) -> Array:
        """Change of the forces ``(6 + r + s, 6)`` by a displacement of the end-effector."""
        machine, h = self._machine, len(self._rows)
        scale = np.concatenate([machine.scale, 1.0 / np.linalg.norm(self._rows * machine.scale, axis=1)])
        A = np.block([[self.tangent(forces), self._rows.T], [self._rows, np.zeros((h, h))]])
        n = len(machine.unit)
        imposed = np.eye(len(A), 6, -n) * scale[:, None]
        x = scale[:, None] * np.linalg.solve(A * scale[:, None] * scale, imposed)
        return np.vstack([-x[n:], self._springs[:, None] * (self._stretching @ x[:n])])

    def end_stiffness(self, forces: Array) -> Array:
        """``K^F`` ``(6, 6)`` of (18) on the frozen geometry."""
        return self.rate(forces)[:6]

    def stability(self, forces: Array) -> tuple[float, int]:
        """Smallest eigenvalue of ``K − H`` where the pose and the closures are held, and number of negative ones.

        In units of the machine's energy; nan and none where nothing is left to move.
        """
        if not self._null.shape[1]:
            return float("nan"), 0
        machine = self._machine
        A = self.tangent(forces) * machine.unit[:, None] * machine.unit / machine.energy
        values = np.linalg.eigvalsh(self._null.T @ (0.5 * (A + A.T)) @ self._null)
        return float(values[0]), int(np.count_nonzero(values < 0.0))


@dataclass(frozen=True)
class UnloadedJacobianEngine:
    """Loaded stiffness on frozen geometry, integrated to its first event: bifurcation or stiffness knee."""

    label: str = "vjm-unloaded-jacobian"
    points: int = 60

    @single_threaded
    def trace(self, chain: Machine, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Integrate the wrench along the ramp; the path stops at the first event.

        Raises:
            NoConvergenceError: the integration failed.
        """
        refuse(self.label, chain, load_case)
        started = time.perf_counter()
        posture = load_case.posture
        machine = FrozenMachine(FrozenGeometry(self.label, chain.at(posture), chain.posture(posture)))
        direction = load_case.direction

        def eigenvalue(_: float, forces: Array) -> float:
            return machine.stability(forces)[0]

        half = 0.5 * float(direction @ machine.end_stiffness(machine.unloaded) @ direction)

        def excess_stiffness(_: float, forces: Array) -> float:
            return float(direction @ machine.end_stiffness(forces) @ direction) - half

        for event in (eigenvalue, excess_stiffness):
            event.terminal = True  # type: ignore[attr-defined]
            event.direction = -1  # type: ignore[attr-defined]
        solution = solve_ivp(
            lambda _, forces: machine.rate(forces) @ direction,
            (0.0, load_case.length),
            machine.unloaded,
            rtol=RELATIVE_TOLERANCE,
            atol=RELATIVE_TOLERANCE * machine.force_unit,
            events=(eigenvalue, excess_stiffness),
            dense_output=True,
            max_step=load_case.length / 50.0,
        )
        forces_at = solution.sol
        if not solution.success or forces_at is None or solution.y_events is None:
            raise NoConvergenceError(f"{self.label}: the integration failed: {solution.message}")

        def point(s: float, forces: Array) -> Equilibrium:
            K = machine.end_stiffness(forces)
            smallest, negative = machine.stability(forces)
            return Equilibrium(
                s=s,
                displacement=load_case.displacement(s),
                wrench=forces[:6],
                tangent=float(direction @ K @ direction),
                eigenvalue=smallest,
                unstable=negative,
                iterations=0,
                residual=0.0,
                shape=np.empty((0, 3)),
                state=np.empty(0),
                stiffness=K,
            )

        events: tuple[Event, ...] = ()
        stopped = ""
        end = float(solution.t[-1])
        for kind, states in zip((EventKind.BIFURCATION, EventKind.STIFFNESS_KNEE), solution.y_events, strict=True):
            if len(states):
                force = float(direction @ states[0][:6])
                before = None
                if kind is EventKind.BIFURCATION:
                    before = point(0.99 * end, forces_at(0.99 * end)).tangent
                events = (Event(kind, end, force, stiffness_before=before),)
                stopped = f"frozen geometry says nothing beyond its first event, the {kind}"
                break
        # stop short of the event itself, where the frozen stiffness may be infinite
        last = end * (1.0 - 1e-6) if events else end
        points = tuple(point(float(s), forces_at(s)) for s in np.linspace(0.0, last, self.points))
        return Path(
            self.label, chain.name, load_case, points, events, stopped=stopped,
            seconds=time.perf_counter() - started, model_sha256=chain.sha256,
        )  # fmt: skip
