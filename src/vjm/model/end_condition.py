"""How the end-effector is held: hinges and slides between it and a support whose pose is imposed.

A component of the pose that is free has a perfect joint there, in the order: the end-effector, turned into the
world's axes; hinges through its reference point; slides; the support. So whatever is free is one more passive
joint, and equation (18), stability and the following of paths need not know of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from vjm.errors import MechanismError
from vjm.model.load_case import COMPONENTS, LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Kinematics, Mechanism
from vjm.model.parts import Joint, RigidOffset
from vjm.rank import NEGLIGIBLE, beyond, null_space, rank_of
from vjm.rotations import AXES, Array, displacement_between, frame, inverse_frame

KEPT = 64
"""Postures of models whose geometry is kept."""


@dataclass(frozen=True)
class EndCondition:
    """What lies between the end-effector and the support.

    Attributes:
        model: the chain with the support's joints at its end.
        tool: pose ``(4, 4)`` of the end-effector from which displacements count: in the unloaded posture, as
            designed.
        joints: the support's joints, from the end-effector.
    """

    model: Mechanism
    tool: Array
    joints: tuple[Joint, ...]

    def tool_pose(self, end_condition: Array, x: Array) -> Array:
        """Pose ``(4, 4)`` of the end-effector with the support at a frame ``(4, 4)`` and coordinates ``x`` (n,)."""
        if not self.joints:
            return end_condition
        T = frame(self.tool[:3, :3].T)
        for joint, value in zip(self.joints, x[self.model.passive[-len(self.joints) :]], strict=True):
            T = T @ joint.motion(value)
        return end_condition @ inverse_frame(T)

    @property
    def support(self) -> Array:
        """Pose ``(4, 4)`` of the support that holds the end-effector where `tool` has it."""
        return frame(p=self.tool[:3, 3]) if self.joints else self.tool

    def alone(self, x: Array) -> Array:
        """Of a state ``(n,)`` that of the machine without the support's joints."""
        return np.delete(x, self.model.passive[-len(self.joints) :]) if self.joints else x

    def displacement(self, end_condition: Array, x: Array) -> Array:
        """Displacement ``(6,)`` of the end-effector from its unloaded pose."""
        return displacement_from(self.tool, self.tool_pose(end_condition, x))

    def wrench(self, end_condition: Array, x: Array, wrench: Array) -> Array:
        """The support's wrench ``(6,)`` about the end-effector's reference point."""
        if not self.joints:
            return wrench
        lever = end_condition[:3, 3] - self.tool_pose(end_condition, x)[:3, 3]
        return np.concatenate([wrench[:3], wrench[3:] + np.cross(lever, wrench[:3])])


def displacement_from(tool: Array, target: Array) -> Array:
    """Displacement ``(6,)`` from one pose ``(4, 4)`` to another, of half a turn about one of its two axes."""
    try:
        return displacement_between(tool, target)
    except ValueError:
        # R + 1 = 2 a aᵀ
        dyad = target[:3, :3] @ tool[:3, :3].T + np.eye(3)
        axis = dyad[:, np.argmax(np.diag(dyad))]
        return np.concatenate([target[:3, 3] - tool[:3, 3], np.pi * axis / np.linalg.norm(axis)])


def held(model: Mechanism, load_case: LoadCase) -> EndCondition:
    """The model with the joints of what the load case leaves free.

    Hinges that the chain's own last joints make superfluous (a tool that turns about its own joint) are left out.

    Raises:
        MechanismError: the chain moves without straining a spring: the posture is singular, or what is free makes
            it a mechanism.
        RigidDirectionError: it is held in a direction in which it does not deflect.
    """
    chain = model.chain
    q = chain.posture(load_case.posture)
    tool, rank, movable = _drawn(model, load_case.posture)
    tool = chain.nominal_ends.get(load_case.posture, tool)
    if rank < len(model.passive) and not chain.closures:
        raise MechanismError(
            f"{chain.name}, posture {load_case.posture} is singular: some of its passive joints move without "
            f"moving the tool; choose another posture"
        )
    free = in_order(load_case)
    while free:
        joints = support_joints(free)
        freed = type(model)(_extended(chain, load_case.posture, tool, joints))
        loose = _loose(freed, len(joints), np.concatenate([q, np.zeros(len(joints))]))
        if loose is None:
            x = freed.configuration(freed.chain.posture(load_case.posture))
            return _checked(EndCondition(freed, tool, joints), deflects(freed, freed.kinematics(x)), load_case)
        hinge = next((name for name in free if len(name) == 2 and abs(loose[free.index(name)]) > NEGLIGIBLE), None)
        if hinge is None:
            raise MechanismError(
                f"{chain.name}, posture {load_case.posture}: with {', '.join(load_case.free)} free the chain is a "
                f"mechanism: it moves without straining a spring; hold one of them"
            )
        free.remove(hinge)
    return _checked(EndCondition(model, tool, ()), movable, load_case)


@lru_cache(maxsize=KEPT)
def _drawn(model: Mechanism, posture: str) -> tuple[Array, int, bool]:
    """A model in a posture as drawn.

    Returns:
        Pose ``(4, 4)`` of the end-effector, how many independent motions the passive joints give it, and whether it
        deflects in every direction.
    """
    kinematics = model.kinematics(model.configuration(model.chain.posture(posture)))
    return kinematics.end, rank_of(_felt(model, kinematics)).rank, deflects(model, kinematics)


def deflects(model: Mechanism, k: Kinematics) -> bool:
    """Whether the end-effector deflects in every direction: else the wrench that holds it is not determined."""
    return rank_of(beyond(model.pose_rows(k), model.closing_rows(k))).rank == 6


class RigidDirectionError(ValueError):
    """A machine is held in a direction in which it does not deflect."""


def rigid_direction(where: str) -> RigidDirectionError:
    """What is said of a machine that is held in a direction in which it does not deflect."""
    return RigidDirectionError(
        f"{where} cannot move in every direction in which it is held: the wrench there is not determined. "
        "Leave rigid directions free, such as `validate curve --free y,rx,rz`"
    )


def _checked(end_condition: EndCondition, deflects: bool, load_case: LoadCase) -> EndCondition:
    if deflects:
        return end_condition
    raise rigid_direction(f"{end_condition.model.chain.name}, posture {load_case.posture}")


def in_order(load_case: LoadCase) -> list[str]:
    """The free components: hinges first. Of three hinges the one along the ramp is in the middle.

    Three hinges lock where the middle one turns by a right angle, and a chain twists less than it bends.
    """
    turns: list[str] = [name for name in ("ry", "rx", "rz") if name in load_case.free]
    if len(turns) == 3 and isinstance(load_case.axis, str) and load_case.axis in COMPONENTS:
        middle = "r" + load_case.axis[-1]
        turns.remove(middle)
        turns.insert(1, middle)
    return turns + [name for name in "xyz" if name in load_case.free]


def support_joints(free: Sequence[str]) -> tuple[Joint, ...]:
    """A perfect joint for each free component of the end-effector's pose, along the world's axes."""
    return tuple(Joint(f"support-{name}", AXES[name[-1]], len(name) == 1, passive=True) for name in free)


def _extended(chain: Machine, posture: str, tool: Array, joints: Sequence[Joint]) -> Machine:
    axes = RigidOffset("support-axes", frame(tool[:3, :3].T))
    q = np.concatenate([chain.posture(posture), np.zeros(len(joints))])
    return replace(chain, parts=(*chain.parts, axes, *joints), postures={posture: q})


def _loose(model: Mechanism, joints: int, q: Array) -> Array | None:
    """A motion ``(joints,)`` of the support's joints that strains no spring; None where there is none.

    It is zero where such a motion moves the chain's points: no hinge is to blame for a mechanism.
    """
    k = model.kinematics(model.configuration(q))
    own = model.passive
    length = model.chain.characteristic_length
    motions = null_space(_felt(model, k)).T
    if model.chain.closures:
        # a rod that turns between two balls is no mechanism of the end-effector: the support's joints move by none
        motions = motions[np.abs(motions[:, -joints:]).max(axis=1, initial=0.0) > NEGLIGIBLE]
    if not len(motions):
        return None
    for motion in motions:
        velocity = np.zeros(model.size)
        velocity[own] = motion * model.coordinate_scale[own]
        if np.abs(model.shape_rate(k, velocity)).max() > NEGLIGIBLE * length:
            return np.zeros(joints)
    return motions[0][-joints:]


def _felt(model: Mechanism, k: Kinematics) -> Array:
    """Derivative by the passive joints of the pose, of what stretches and of what closes, dimensionless."""
    return np.vstack([model.pose_rows(k), model.stretching_rows(k), model.closing_rows(k)])[:, model.passive]
