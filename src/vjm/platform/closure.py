"""Closure of the rigid manipulator: the gaps at the legs' ends and how they follow from its coordinates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from vjm.model.chain import Chain
from vjm.model.lumped import LumpedModel
from vjm.model.parts import Beam, RigidOffset
from vjm.platform.manipulator import BASE, Manipulator
from vjm.rotations import Array, displaced, displacement_between, skew, translation

CLOSED = 1e-11
"""Gap over the characteristic length at which the legs are closed: some hundred times rounding."""
ITERATIONS = 12


@dataclass(frozen=True)
class RigidPose:
    """The rigid manipulator in one pose.

    Attributes:
        manipulator: whose.
        frames: of the bodies ``(b, 4, 4)`` in the world, mm, platform first.
        q: passive coordinates ``(n_q,)`` of each leg, rad or mm.
        drives: coordinates ``(l,)`` of the legs' drives, mm or rad, zero where there is none.
    """

    manipulator: Manipulator
    frames: Array
    q: tuple[Array, ...]
    drives: Array

    def frame(self, body: str) -> Array:
        """Frame ``(4, 4)`` of a body in the world."""
        if body == BASE:
            return np.eye(4)
        result: Array = self.frames[self.manipulator.bodies.index(body)]
        return result


@lru_cache(maxsize=256)
def _rigid_model(key: _Key) -> LumpedModel:
    parts = tuple(
        RigidOffset(part.name, translation(part.tip)) if isinstance(part, Beam) else part
        for part in key.chain.parts
    )
    # a drive's own spring moves nothing here
    return LumpedModel(replace(key.chain, parts=parts).with_actuator_compliance(0.0))


class _Key:
    """A chain by its identity: chains hold arrays and have no hash of their own."""

    def __init__(self, chain: Chain) -> None:
        self.chain = chain

    def __hash__(self) -> int:
        return id(self.chain)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and other.chain is self.chain


class Closure:
    """Gaps of all legs and their derivatives by passive coordinates, drives and bodies, lengths over one length."""

    def __init__(self, manipulator: Manipulator) -> None:
        self.manipulator = manipulator
        self.length = manipulator.characteristic_length
        self.models = [_rigid_model(_Key(leg.chain)) for leg in manipulator.legs]
        counts = [len(leg.posture) for leg in manipulator.legs]
        self.q_at = np.concatenate([[0], np.cumsum(counts)]).astype(int)
        self.drive_at = self.q_at[-1]
        self.driven = [i for i, leg in enumerate(manipulator.legs) if leg.drive is not None]
        self.body_at = self.drive_at + len(self.driven)
        self.size = self.body_at + 6 * len(manipulator.bodies)
        self.q_units = [
            np.array([self.length if joint.slides else 1.0 for joint in leg.chain.joints])
            for leg in manipulator.legs
        ]
        """Units ``(n_q,)`` of each leg's passive coordinates: the length for slides, one radian for hinges."""
        self.rows = 6 * len(manipulator.legs) + len(manipulator.couplings)

    def linearised(self, pose: RigidPose) -> tuple[Array, Array]:
        """Gaps ``(r,)`` and their derivative ``(r, n)``, dimensionless; the platform's motion is among the n."""
        robot, L = self.manipulator, self.length
        gap, J = np.zeros(self.rows), np.zeros((self.rows, self.size))
        for i, (leg, model) in enumerate(zip(robot.legs, self.models, strict=True)):
            start, row = pose.frame(leg.start), slice(6 * i, 6 * i + 6)
            world = start @ leg.driven_root(float(pose.drives[i]))
            k = model.kinematics(model.configuration(pose.q[i]))
            end, place = world @ k.end, pose.frame(leg.end) @ leg.attachment
            unit = np.repeat([L, 1.0], 3)
            try:
                gap[row] = displacement_between(place, end) / unit
            except ValueError:
                gap[row] = np.inf
            turned = np.kron(np.eye(2), world[:3, :3])
            J[row, self.q_at[i] : self.q_at[i + 1]] = (
                turned @ k.jacobian[:, model.passive] * self.q_units[i] / unit[:, None]
            )
            if leg.drive is not None:
                seat = start @ leg.seat
                axis = seat[:3, :3] @ leg.drive.axis
                twist = np.concatenate([L * axis, np.zeros(3)])
                if not leg.drive.slides:
                    twist = np.concatenate([np.cross(axis, end[:3, 3] - seat[:3, 3]), axis])
                J[row, self.drive_at + self.driven.index(i)] = twist / unit
            for body, sign in ((leg.start, 1.0), (leg.end, -1.0)):
                if body != BASE:
                    at = self.body_at + 6 * robot.bodies.index(body)
                    motion = np.eye(6)
                    motion[:3, 3:] = -skew((end[:3, 3] - pose.frame(body)[:3, 3]) / L)
                    J[row, at : at + 6] = sign * motion
        for k_, coupling in enumerate(robot.couplings):
            row_ = 6 * len(robot.legs) + k_
            for name, joint, weight in coupling.terms:
                i = [leg.name for leg in robot.legs].index(name)
                j = [part.name for part in robot.legs[i].chain.joints].index(joint)
                J[row_, self.q_at[i] + j] = weight * self.q_units[i][j]
                gap[row_] += weight * (pose.q[i][j] - robot.legs[i].posture[j])
        return gap, J

    def largest_move(self, pose: RigidPose, to: RigidPose) -> float:
        """Largest move of a passive joint between two poses: rad, or lengths over the characteristic one."""
        moves = (
            float(np.abs((a - b) / unit).max(initial=0.0))
            for a, b, unit in zip(to.q, pose.q, self.q_units, strict=True)
        )
        return max(moves, default=0.0)

    def moved(self, pose: RigidPose, step: Array) -> RigidPose:
        """A pose after a step ``(n,)``, its lengths over the characteristic one."""
        q = tuple(
            q + step[a:b] * unit
            for q, a, b, unit in zip(pose.q, self.q_at[:-1], self.q_at[1:], self.q_units, strict=True)
        )
        drives = pose.drives.copy()
        for k, i in enumerate(self.driven):
            drive = self.manipulator.legs[i].drive
            assert drive is not None
            drives[i] += step[self.drive_at + k] * (self.length if drive.slides else 1.0)
        unit = np.repeat([self.length, 1.0], 3)
        motions = step[self.body_at :].reshape(-1, 6) * unit
        frames = np.array([displaced(T, motion) for T, motion in zip(pose.frames, motions, strict=True)])
        return replace(pose, q=q, drives=drives, frames=frames)

    def solve(self, pose: RigidPose, *, drives: bool = True) -> tuple[RigidPose, float]:
        """The closed pose near one, the platform held, and the largest gap that is left.

        Args:
            pose: to start from.
            drives: whether they move; else the platform does.
        """
        free = np.ones(self.size, dtype=bool)
        if drives:
            free[self.body_at : self.body_at + 6] = False
        else:
            free[self.drive_at : self.body_at] = False
        for _ in range(ITERATIONS):
            gap, J = self.linearised(pose)
            size = float(np.max(np.abs(gap)))
            if not np.isfinite(size) or size < CLOSED:
                return pose, size
            step = np.zeros(self.size)
            step[free] = np.linalg.lstsq(J[:, free], -gap, rcond=1e-9)[0]
            step *= min(1.0, 0.5 / max(float(np.max(np.abs(step))), 1e-300))
            pose = self.moved(pose, step)
        return pose, float(np.max(np.abs(self.linearised(pose)[0])))
