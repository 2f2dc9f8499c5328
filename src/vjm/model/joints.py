"""Joints that are held at a coordinate: actuated ones, sprung passive ones, and ones coupled to others.

A held joint stands at a *value* that the posture or the data give. What is elastic in it moves it from there: its
virtual springs come behind the motion by the value, ``T_Ac(q, θ)`` of the paper's (1).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vjm.rotations import Array, translation, turn


def joint_axes(axis: Array) -> Array:
    """Axes ``(3, 3)`` of a joint as columns: two across it and, last, its own.

    Across an axis x, y or z of the chain frame they are the two others in cyclic order: about z they are x and y in
    turn. Across any other they are those of the nearest axis, turned with it on the shortest way.
    """
    axis = np.asarray(axis, dtype=float)
    k = int(np.argmax(np.abs(axis)))
    nearest = np.eye(3)[k] * np.sign(axis[k])
    side = np.eye(3)[(k + 1) % 3]
    # the shortest turn from the nearest axis moves a side by its part in the plane of both axes
    side = side - (side @ axis) / (1.0 + nearest @ axis) * (nearest + axis)
    return np.column_stack([side, np.cross(axis, side), axis])


@dataclass(frozen=True)
class HeldJoint:
    """A joint that stands at a coordinate.

    Attributes:
        name: of the part.
        axis: unit vector ``(3,)`` in the chain frame.
        slides: along the axis; else it turns about it.
        limits: of its coordinate, mm or rad.
        value: coordinate at which it stands, mm or rad; None until a posture or the data give it.
    """

    name: str
    axis: Array
    slides: bool = False
    limits: tuple[float, float] | None = field(default=None, kw_only=True)
    value: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.axis))
        if not abs(length - 1.0) < 1e-9:
            raise ValueError(f"joint '{self.name}': its axis has length {length:g}; give a unit vector")

    def motion(self, value: float) -> Array:
        """Frame ``(4, 4)`` behind the joint at a coordinate, in the chain frame before it."""
        return translation(self.axis * value) if self.slides else turn(self.axis, value)

    @property
    def held_at(self) -> float:
        """The coordinate, mm or rad.

        Raises:
            ValueError: no posture has given it.
        """
        if self.value is None:
            raise ValueError(
                f"joint '{self.name}' has no coordinate yet: take the chain in a posture, chain.at(label)"
            )
        return self.value


@dataclass(frozen=True)
class ActuatedJoint(HeldJoint):
    """A drive that holds its coordinate, with springs behind it.

    Attributes:
        compliance: about or along its own axis, rad/(N mm) or mm/N; zero for a rigid drive.
        lateral: rotational compliance about the two other `joint_axes`, rad/(N mm): bearings, and the link before.
        matrix: in place of both the whole compliance ``(6, 6)`` in the axes of the chain frame behind the joint,
            in mm/N, 1/N, rad/(N mm); rigid directions have zeros in their row and column.
    """

    compliance: float = 0.0
    lateral: tuple[float, float] = (0.0, 0.0)
    matrix: Array | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if min(self.compliance, *self.lateral) < 0.0:
            raise ValueError(f"joint '{self.name}': a compliance is zero or more")
        if self.matrix is not None and (self.compliance or any(self.lateral)):
            raise ValueError(f"joint '{self.name}' has a 6×6 compliance and another one: give one of them")

    @property
    def elastic(self) -> bool:
        """Whether anything in it deflects."""
        return self.matrix is not None or self.compliance > 0.0 or any(self.lateral)


@dataclass(frozen=True)
class SprungJoint(HeldJoint):
    """A passive joint with a spring about or along its axis.

    Attributes:
        stiffness: N mm/rad or N/mm.
        preload: torque in N mm or force in N by which the spring drives the joint to larger coordinates where
            the posture has it; ``rest`` says the same by a coordinate.
        rest: coordinate at which the spring is free of stress; None: that of the posture.
    """

    stiffness: float = 1.0
    preload: float = 0.0
    rest: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.stiffness < float("inf"):
            raise ValueError(f"joint '{self.name}': stiffness must be positive and finite, not {self.stiffness}")
        if self.rest is not None and self.preload:
            raise ValueError(f"joint '{self.name}' has a rest position and a preload, which say the same: give one")

    @property
    def stretch(self) -> float:
        """How far from the posture's coordinate the spring is free of stress, mm or rad."""
        return self.preload / self.stiffness if self.rest is None else self.rest - self.held_at


@dataclass(frozen=True)
class CoupledJoint(HeldJoint):
    """A joint that follows others: ``value = offset + Σ ratio · value of the other``.

    Attributes:
        ratios: names of held joints and the ratios to them.
        offset: mm or rad.
        as_bent: the coupling passes on what the other joints' springs add about their own axes too, as a belt or
            gears between the joints' shafts do; else only what they are commanded, as a controller does. Neither
            passes on the bending of links. A parallel linkage does: it is a manipulator of legs.
        compliance: of its own about or along its axis, rad/(N mm) or mm/N.
        lateral: as for an `ActuatedJoint`.
    """

    ratios: tuple[tuple[str, float], ...] = ()
    offset: float = 0.0
    as_bent: bool = True
    compliance: float = 0.0
    lateral: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        names = [name for name, _ in self.ratios]
        if not names or len(set(names)) < len(names):
            raise ValueError(f"joint '{self.name}' must be coupled to other joints, each named once")
        if self.name in names:
            raise ValueError(f"joint '{self.name}' is coupled to itself: name another joint")
        if min(self.compliance, *self.lateral) < 0.0:
            raise ValueError(f"joint '{self.name}': a compliance is zero or more")


@dataclass(frozen=True)
class ElementarySpring:
    """One direction in which a joint deflects, behind those before it.

    Attributes:
        axis: unit vector ``(3,)`` in the chain frame.
        slides: along it; else it turns about it.
        compliance: mm/N or rad/(N mm).
        stretch: coordinate at which it is free of stress.
    """

    axis: Array
    slides: bool
    compliance: float
    stretch: float = 0.0


def elementary_springs(joint: HeldJoint, engine: str) -> list[ElementarySpring]:
    """What deflects in a held joint one direction after the other, for engines that set up joints one by one.

    Raises:
        ValueError: its springs are coupled with each other or with another joint's.
    """
    match joint:
        case SprungJoint():
            return [ElementarySpring(joint.axis, joint.slides, 1.0 / joint.stiffness, joint.stretch)]
        case CoupledJoint(as_bent=True):
            raise ValueError(
                f"joint '{joint.name}': {engine} does not pass on what bends in the joints that it is coupled to; "
                f"write coupling = 'as commanded'"
            )
        case ActuatedJoint(matrix=matrix) if matrix is not None:
            if np.any(matrix - np.diag(np.diag(matrix))):
                raise ValueError(
                    f"joint '{joint.name}': {engine} takes a 6×6 compliance of a joint only if diagonal"
                )
            return [
                ElementarySpring(np.eye(3)[k % 3], k < 3, float(c))
                for k, c in enumerate(np.diag(matrix))
                if c > 0.0
            ]
        case ActuatedJoint() | CoupledJoint():
            axes = joint_axes(joint.axis).T
            found = [ElementarySpring(axes[k], False, c) for k, c in enumerate(joint.lateral) if c > 0.0]
            own = ElementarySpring(joint.axis, joint.slides, joint.compliance)
            return [*found, own] if joint.compliance > 0.0 else found
        case _:
            raise ValueError(f"joint '{joint.name}': {engine} does not know its kind")


@dataclass(frozen=True)
class PointSpring:
    """A spring between a point of one part and a point of another, such as a gravity compensator.

    A point of a beam goes with the cross-section at which it lies, the one that is as far along the beam. Before
    the root that is the root's, behind the end the end's.

    Attributes:
        name: for people.
        parts: names of the two parts; an empty one is the base.
        points: ``(2, 3)`` mm, in the frames where the parts begin (joints: behind them), the world for the base.
        stiffness: N/mm.
        free_length: mm.
        preload: N, at the free length; it pulls the points together.
    """

    name: str
    parts: tuple[str, str]
    points: Array
    stiffness: float
    free_length: float = 0.0
    preload: float = 0.0
