"""By how much the markers move under a known wrench, and exact derivatives of that by every member and nuisance.

Two equilibria of the machine, both under its weight, one under the wrench too. With p, R the marker's frame loaded
and p₀, R₀ unloaded, the prediction is ``Q (p + R m − p₀ − R₀ m)`` and the rotation from R₀ to R, both in the axes Q
of what reads them. What shifts or turns both equilibria alike, such as the tracker's origin and the joints' zeros,
is not in a difference. Nuisances are Q and what the marker's place in its body is off, m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vjm.io.fields import rotation
from vjm.rotations import Array, rotation_from_vector, rotation_vector
from vjm_updating.constants import numerical
from vjm_updating.deflections.readings import DeflectionData
from vjm_updating.deflections.sheet import DeflectionLoadTable, DeflectionSheet
from vjm_updating.poses.families import Member
from vjm_updating.poses.forward import LARGEST_TURN, Frames, Linearised, PoseForward, turn_between
from vjm_updating.poses.machine import PoseMachine

LOAD = "load"
"""What a member acts on that is a load's zero; its index is 6 times the point's number and the component's."""
PUSHES = numerical(1e-3)
"""Of the largest load: by what it is changed for a difference, whose error is that share squared of it."""


class DeflectionForward:
    """The model of a test of deflections.

    Attributes:
        loaded: the machine under weight and wrenches.
        unloaded: the same under its weight.
    """

    def __init__(self, machine: PoseMachine, data: DeflectionData, sheet: DeflectionSheet) -> None:
        """Take a test.

        Args:
            machine: its first end frames are the markers', then come the points of load.
            data: the readings.
            sheet: of the test.
        """
        self.data, self._sheet = data, sheet
        self._loads, self._tracker, gravity = tuple(sheet.loads.values()), sheet.tracker, sheet.test.gravity
        k = len(data.markers)
        none = replace(data, wrench=np.zeros((len(data), k + len(self._loads), 6)))
        self.unloaded = PoseForward(machine, none, gravity)
        R, _ = self.unloaded.unloaded()
        wrench = none.wrench.copy()
        wrench[:, k:] = in_base(data.load, R[:, k:], self._loads)
        self._wrench, self._points = wrench, R[:, k:]
        self.loaded = PoseForward(machine, replace(none, wrench=wrench), gravity)

    @property
    def members(self) -> list[Member]:
        """Numbers that a hypothesis may change."""
        return self.unloaded.members

    @members.setter
    def members(self, members: list[Member]) -> None:
        # what follows the load acts in the loaded state only
        still = np.zeros(len(self.data))
        self.loaded.members = members
        self.unloaded.members = [m if m.basis is None else replace(m, basis=still) for m in members]

    @property
    def machine(self) -> PoseMachine:
        """The machine, extended."""
        return self.loaded.machine

    @property
    def nuisances(self) -> int:
        """How many there are: three turns of the axes, three shifts a marker."""
        return 3 + 3 * len(self.data.markers)

    def nuisance_names(self) -> list[str]:
        """What each nuisance is, for people."""
        return ["axes of the displacements"] * 3 + [
            f"place of marker {marker}" for marker in self.data.markers for _ in range(3)
        ]

    def bearing(self) -> Array:
        """What the loads alone bring on each coordinate ``(g, n_tree)``, N mm or N."""
        return self.loaded.bearing() - self.unloaded.bearing()

    def torques(self) -> Array:
        """Root mean square ``(n_tree,)`` of what the loads alone bring on each coordinate."""
        result: Array = np.sqrt(np.mean(self.bearing() ** 2, axis=0))
        return result

    def evaluate(self, z: Array, frames: Frames) -> Linearised:
        """Residuals and derivatives at members ``z`` (P,), in units, and nuisances.

        Raises:
            NoConvergenceError: a reading has no equilibrium.
        """
        k = len(self.data.markers)
        self.loaded.wrench = self._under(z)
        R, p, columns, forces = self.loaded.end_frames(z)
        self._by_loads(z, columns)
        R0, p0, columns0, forces0 = self.unloaded.end_frames(z)
        arm, arm0 = (np.einsum("gkab,kb->gka", F[:, :k], frames.m) for F in (R, R0))
        moved = _velocity(columns[:, :k], arm) - _velocity(columns0[:, :k], arm0)
        Q = frames.R
        J = np.concatenate([Q @ moved, Q @ (columns[:, :k, 3:] - columns0[:, :k, 3:])], axis=2)
        seen = (p[:, :k] + arm - p0[:, :k] - arm0) @ Q.T
        turned = Q @ (R[:, :k] @ np.swapaxes(R0[:, :k], -1, -2)) @ Q.T
        residual = np.full((len(self.data), k, 6), np.nan)
        residual[..., :3] = self.data.position - seen
        residual[..., 3:] = turn_between(turned, self.data.orientation)
        none = np.broadcast_to(np.eye(3), turned.shape)
        by_turn = np.concatenate([seen, turn_between(none, turned)], axis=2)
        F = np.zeros((*residual.shape, self.nuisances))
        tilt = np.zeros((*residual.shape, 3))
        place = p[:, :k] + arm
        for a in range(3):
            e = np.eye(3)[a]
            F[..., :3, a], F[..., 3:, a] = np.cross(e, by_turn[..., :3]), np.cross(e, by_turn[..., 3:])
            tilt[..., :3, a], tilt[..., 3:, a] = np.cross(e, place) @ Q.T, Q[:, a]
        for j in range(k):
            F[:, j, :3, 3 + 3 * j : 6 + 3 * j] = Q @ (R[:, j] - R0[:, j])
        torque = self.machine.tree.torques(forces - forces0)[:, self.loaded.given]
        turn = rotation_vector(Q) if self._tracker.axes == "base" else np.zeros(3)
        off = np.concatenate([turn, frames.m.reshape(-1)])
        return Linearised(residual, F, J, torque, off, tilt)

    def _under(self, z: Array) -> Array:
        """Wrenches ``(g, e, 6)`` with the zeros that members ``z`` take from those that were read."""
        wrench = self._wrench.copy()
        for size, member in zip(z, self.members, strict=True):
            if member.kind == LOAD and size != 0.0:
                wrench[:, len(self.data.markers) :] += size * member.scale * self._direction(member)
        return wrench

    def _direction(self, member: Member) -> Array:
        """Wrenches ``(g, l, 6)`` in the base's axes of one N or N mm that a sensor's zero adds."""
        load = np.zeros_like(self.data.load)
        load[:, member.index // 6, member.index % 6] = 1.0
        return in_base(load, self._points, self._loads)

    def _by_loads(self, z: Array, columns: Array) -> None:
        """Write the velocities of the end frames by zeros of loads into ``columns`` (g, e, 6, P)."""
        k, around = len(self.data.markers), self.loaded.wrench
        for i, member in enumerate(self.members):
            if member.kind != LOAD:
                continue
            half = slice(0, 3) if member.index % 6 < 3 else slice(3, 6)
            step = PUSHES * float(np.abs(self.data.load[:, member.index // 6, half]).max())
            ends = []
            for side in (1.0, -1.0):
                self.loaded.wrench = around.copy()
                self.loaded.wrench[:, k:] += side * step * self._direction(member)
                ends.append(self.loaded.placed(z))
            (R, p), (R0, p0) = ends
            none = np.broadcast_to(np.eye(3), R.shape)
            turned = turn_between(none, R @ np.swapaxes(R0, -1, -2))
            columns[..., i] = member.scale / (2.0 * step) * np.concatenate([p - p0, turned], axis=2)
        self.loaded.wrench = around

    def moved(self, frames: Frames, step: Array) -> Frames:
        """Nuisances after a step ``(n_f,)`` in the coordinates of `Linearised.nuisance`."""
        turn, size = step[:3], float(np.linalg.norm(step[:3]))
        if size > LARGEST_TURN:
            turn = turn * (LARGEST_TURN / size)
        return Frames(rotation_from_vector(turn) @ frames.R, frames.t, frames.m + step[3:].reshape(-1, 3), frames.M)

    def with_machine(self, machine: PoseMachine) -> DeflectionForward:
        """The same test of another machine with the same members."""
        other = DeflectionForward(machine, self.data, self._sheet)
        other.members = self.loaded.with_machine(machine).members
        return other


def in_base(load: Array, R: Array, tables: Sequence[DeflectionLoadTable]) -> Array:
    """Wrenches ``(g, l, 6)`` in the base's axes from those in their tables' axes.

    A tool's axes are those of the unloaded robot: it turns by some mrad under the load.

    Args:
        load: ``(g, l, 6)``.
        R: ``(g, l, 3, 3)`` frames of the points, unloaded.
        tables: of the points.
    """
    result = load.copy()
    for j, table in enumerate(tables):
        if table.axes == "tool":
            axes = R[:, j] @ rotation(table.turns)
            for half in (slice(0, 3), slice(3, 6)):
                result[:, j, half] = np.einsum("gab,gb->ga", axes, load[:, j, half])
    return result


def _velocity(columns: Array, arm: Array) -> Array:
    """Velocities ``(g, k, 3, P)`` of points at ``arm`` (g, k, 3) behind frames that move by ``columns``."""
    turning = np.swapaxes(columns[..., 3:, :], -1, -2)
    by_turn = np.swapaxes(np.cross(turning, arm[..., None, :]), -1, -2)
    result: Array = columns[..., :3, :] + by_turn
    return result
