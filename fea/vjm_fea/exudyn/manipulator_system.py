"""A whole manipulator in a pose as one system of Exudyn: all legs meshed between the ground and the bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.continuation.path import StationLabel
from vjm.model.chain import Chain
from vjm.model.parts import PassiveJoint
from vjm.platform.closure import RigidPose
from vjm.platform.manipulator import BASE, PLATFORM, Leg
from vjm.rotations import Array, frame
from vjm_fea.common.mesh import Mesh
from vjm_fea.exudyn.joint_kinds import crossing
from vjm_fea.exudyn.system import ExudynSystem

LOCKED = (1, 1, 1, 1, 1, 1)
CLOSED = 1e-7
"""mm that a leg's end may miss its place by and still be one with it: the closure's own rounding. More is an error
of assembly, which a joint pulls shut."""


@dataclass(frozen=True)
class Hinge:
    """A passive joint between the ground and a node, for a coupling.

    Attributes:
        node: that turns.
        axis: ``(3,)`` world.
        weight: in the coupling.
        rest: its turn in the reference configuration beyond that at home, rad.
    """

    node: int
    axis: Array
    weight: float
    rest: float


class ManipulatorSystem(ExudynSystem):
    """The assembled system; the platform is its end-effector.

    Attributes:
        couplings: hinges of each coupling.
    """

    def __init__(self, pose: RigidPose, mesh: Mesh, end_condition: Sequence[PassiveJoint] = ()) -> None:
        """Assemble a manipulator.

        Args:
            pose: rigid and closed, in which it is free of stress but for its errors.
            mesh: of its beams.
            end_condition: joints between the platform and the support of the end-effector.

        Raises:
            ValueError: a beam without a section.
        """
        robot = pose.manipulator
        self._begin(mesh)
        self._bodies = {BASE: self._ground}
        for name in robot.bodies:
            # in the world's axes, as an end-effector's node is
            T = frame(p=pose.frame(name)[:3, 3])
            self._bodies[name] = self._carrier(self._node(T), T)
        self.couplings: list[list[Hinge]] = [[] for _ in robot.couplings]
        for i, leg in enumerate(robot.legs):
            self._add_leg(pose, leg, i)
        self._frame = pose.frames[0]
        self._rigid = self._bodies[PLATFORM]
        self._finish(robot.name, end_condition)

    def _add_leg(self, pose: RigidPose, leg: Leg, index: int) -> None:
        robot = pose.manipulator
        chain = robot.built(leg)
        coordinate = float(pose.drives[index]) + robot.offsets.get(leg.name, 0.0)
        start = pose.frame(leg.start) @ leg.driven_root(coordinate)
        self._frame, self._rigid = start @ chain.base, self._bodies[leg.start]
        first = len(self.stations)
        self._string(chain, pose.q[index], self._hinge_of(pose, leg, index))
        self._close(leg, pose.frame(leg.end) @ leg.attachment)
        for k in range(first, len(self.stations)):
            station = self.stations[k]
            label = StationLabel(f"{leg.name}/{station.label.part}", station.label.fraction)
            self.stations[k] = replace(station, label=label)

    def _string(self, chain: Chain, q: Array, hinges: dict[str, tuple[int, float, float]]) -> None:
        """The parts of a chain one after another."""
        angles = iter(np.asarray(q, dtype=float))
        parts = list(chain.parts)
        while parts:
            part = parts.pop(0)
            behind = parts[0] if parts else None
            if not isinstance(part, PassiveJoint):
                self._add(part)
                continue
            if part.name in hinges:
                self._add_coupled(part, next(angles), *hinges[part.name])
            elif isinstance(behind, PassiveJoint) and crossing(part, behind):
                parts.pop(0)
                self._add_universal(part, next(angles), behind, next(angles))
            else:
                self._add_joint(part, next(angles))

    def _hinge_of(self, pose: RigidPose, leg: Leg, index: int) -> dict[str, tuple[int, float, float]]:
        """Coupled joints of a leg: number of the coupling, weight, turn from home."""
        found = {}
        names = [joint.name for joint in leg.chain.joints]
        for k, coupling in enumerate(pose.manipulator.couplings):
            for name, joint, weight in coupling.terms:
                if name == leg.name:
                    j = names.index(joint)
                    found[joint] = (k, weight, float(pose.q[index][j] - leg.posture[j]))
        return found

    def _add_coupled(self, joint: PassiveJoint, angle: float, coupling: int, weight: float, rest: float) -> None:
        if self._rigid.node >= 0 or self._open is not None:
            raise ValueError(f"joint '{joint.name}': Exudyn couples hinges on the base only")
        axis = self._frame[:3, :3] @ joint.axis
        self._add_joint(joint, angle)
        # the node behind has to be there before it can be coupled
        self.couplings[coupling].append(Hinge(self._at().node, axis, weight, rest))

    def _close(self, leg: Leg, place: Array) -> None:
        """Join what the last part ends on to the body."""
        body = self._bodies[leg.end]
        gap = self._frame - place
        if np.abs(gap[:3]).max() > CLOSED:
            end = self._at()
            self._joint(self._marker(end, self._frame), self._marker(body, place), LOCKED)
        elif self._open is not None:
            connect, self._open = self._open, None
            self._rigid = body
            connect(self._marker(body, self._open_at))
            waiting, self._waiting = self._waiting, []
            for mark in waiting:
                mark()
        else:
            self._locked.append((body.node, self._at().node))
