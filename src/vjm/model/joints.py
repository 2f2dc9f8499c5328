"""Joints: passive ones, ones held at a coordinate, and ones coupled to others.

A held joint stands at a *value* that the posture or the data give. What is elastic in it moves it from there: its
virtual springs come behind the motion by the value, ``T_Ac(q, θ)`` of the paper's (1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, replace
from enum import StrEnum
from functools import reduce
from operator import add
from typing import TypeVar

import numpy as np

from vjm.model.laws import Law, OneSided
from vjm.rotations import Array, translation, turn

Value = TypeVar("Value", float, Array)


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


class JointKind(StrEnum):
    """What a joint is by its data; see `Joint`."""

    FREE = "free"
    """Passive without a spring: the equilibrium finds its coordinate."""
    SPRUNG = "sprung"
    """Passive with a spring about or along its axis."""
    ACTUATED = "actuated"
    """Driven to the coordinate that the posture gives."""
    COUPLED = "coupled"
    """Its coordinate follows from those of others."""
    ACTUATOR = "actuator"
    """A drive that stands still in every posture, and deflects."""
    MOUNT = "mount"
    """No drive: what carries the chain, and deflects."""


@dataclass(frozen=True)
class JointCoupling:
    """What a joint follows: ``value = offset + Σ ratio · value of the other``.

    Attributes:
        ratios: names of other joints and the ratios to them.
        offset: mm or rad.
        as_deflected: the coupling passes on what the other joints' springs add about their own axes too, as a belt
            or gears between the joints' shafts do; else only what they are commanded, as a controller does. Neither
            passes on the deflection of links. A parallel linkage does: it is a manipulator of legs.

    Example:
        >>> import vjm
        >>> vjm.JointCoupling((("elbow", -1.0),), 0.5).value({"elbow": 0.2})
        0.3
    """

    ratios: tuple[tuple[str, float], ...]
    offset: float = 0.0
    as_deflected: bool = True

    def summed(self, values: Mapping[str, Value]) -> Value:
        """``Σ ratio · value of the other``, by the names of joints."""
        result: Value = reduce(add, (ratio * values[name] for name, ratio in self.ratios))
        return result

    def value(self, values: Mapping[str, float]) -> float:
        """The coordinate that follows from others by name, mm or rad."""
        return self.offset + self.summed(values)


@dataclass(frozen=True)
class Joint:
    """A joint: an axis, turning or sliding, at a coordinate, with what deflects in it.

    Driven joints stand at the coordinate that a posture or a coupling gives, and so do passive ones with a spring.
    What deflects comes behind the motion by that coordinate.

    Attributes:
        name: of the part.
        axis: unit vector ``(3,)`` in the chain frame.
        slides: along the axis; else it turns about it, through the chain frame's origin.
        passive: nothing drives it: it moves freely, without friction and backlash, or on a spring where it has a
            compliance.
        fixed: it has no coordinate, stands still in every posture and only deflects: a drive before the joints, or,
            where it is passive, what carries the chain, a frame or a guide.
        compliance: about or along its own axis, rad/(N mm) or mm/N; zero for a rigid drive, and for a passive joint
            without a spring.
        lateral: rotational compliance about the two other `joint_axes`, rad/(N mm): bearings, and the link before.
        matrix: in place of both the whole compliance ``(6, 6)`` in the axes of the chain frame behind the joint,
            in mm/N, 1/N, rad/(N mm); rigid directions have zeros in their row and column.
        preload: torque in N mm or force in N by which the spring of a passive joint drives it to larger coordinates
            where the posture has it; ``rest`` says the same by a coordinate.
        rest: coordinate at which that spring is free of stress; None: that of the posture.
        coupling: what the joint follows, if anything.
        rotor: what is geared to it adds to the inertia against its motion, kg mm² where it turns and kg where it
            slides: a rotor's own times the square of the gear ratio. Any joint that moves may have one, coupled
            and passive ones too. It moves with what lies behind the joint's springs.
        limits: of its coordinate, mm or rad.
        rides_on: name of the beam along which it slides, empty where it rides on none. Its coordinate is where on
            the beam it is, from the root. It begins where the beam does, carried by the cross-section there.
        law: of its spring about or along its own axis, in place of the compliance. Beside a matrix it is of the
            axis in which that has zeros.
        value: coordinate at which it stands, mm or rad; None until a posture or the data give it.

    Example:
        >>> elbow = Joint("elbow", np.array([0.0, 0.0, 1.0]), passive=True, compliance=1e-6, preload=2e3)
        >>> elbow.kind, elbow.stretch
        (<JointKind.SPRUNG: 'sprung'>, 0.002)
    """

    name: str
    axis: Array
    slides: bool = False
    _: KW_ONLY
    passive: bool = False
    fixed: bool = False
    compliance: float = 0.0
    lateral: tuple[float, float] = (0.0, 0.0)
    matrix: Array | None = None
    preload: float = 0.0
    rest: float | None = None
    coupling: JointCoupling | None = None
    rotor: float = 0.0
    limits: tuple[float, float] | None = None
    rides_on: str = ""
    law: Law | None = None
    value: float | None = None

    def __post_init__(self) -> None:
        where, length = f"joint '{self.name}'", float(np.linalg.norm(self.axis))
        if not abs(length - 1.0) < 1e-9:
            raise ValueError(f"{where}: its axis has length {length:g}; give a unit vector")
        if not all(0.0 <= compliance < float("inf") for compliance in (self.compliance, *self.lateral)):
            raise ValueError(f"{where}: a compliance is zero or more, and finite")
        if not 0.0 <= self.rotor < float("inf") or (self.rotor and self.fixed):
            raise ValueError(f"{where}: a rotor's inertia is zero or more, finite, and of a joint that moves")
        if self.matrix is not None and (self.compliance or any(self.lateral)):
            raise ValueError(f"{where} has a 6×6 compliance and another one: give one of them")
        if (self.passive or self.fixed) and (self.matrix is not None or any(self.lateral)):
            raise ValueError(f"{where} deflects about or along its own axis alone: give it one compliance")
        if self.law is not None and self.compliance:
            raise ValueError(f"{where} has a law and a compliance, which say the same: give one of them")
        if self.law is not None and self.matrix is not None and self._coupled_with_own_axis:
            raise ValueError(
                f"{where} has a law about or along its own axis, and its 6×6 compliance deflects there too. A law "
                "is of one axis alone: give zeros in that axis's row and column"
            )
        if (self.rest is not None or self.preload) and self.kind is not JointKind.SPRUNG:
            raise ValueError(f"{where} has a preload or a rest position but no spring: make it passive, elastic")
        if self.rest is not None and self.preload:
            raise ValueError(f"{where} has a rest position and a preload, which say the same: give one")
        if self.coupling is not None:
            self._check_coupling(where, [name for name, _ in self.coupling.ratios])

    def _check_coupling(self, where: str, names: list[str]) -> None:
        if not names or len(set(names)) < len(names):
            raise ValueError(f"{where} must be coupled to other joints, each named once")
        if self.name in names:
            raise ValueError(f"{where} is coupled to itself: name another joint")
        if self.passive or self.fixed or self.matrix is not None:
            raise ValueError(f"{where} is coupled: it is neither passive nor fixed, and has no 6×6 compliance")

    @property
    def _coupled_with_own_axis(self) -> bool:
        """Whether its 6×6 compliance has an entry about or along its own axis."""
        assert self.matrix is not None
        own = np.zeros(6)
        own[slice(0, 3) if self.slides else slice(3, 6)] = self.axis
        return bool((self.matrix @ own).any() or (own @ self.matrix).any())

    @property
    def kind(self) -> JointKind:
        """What it is, by its data."""
        if self.coupling is not None:
            return JointKind.COUPLED
        if self.fixed:
            return JointKind.MOUNT if self.passive else JointKind.ACTUATOR
        if self.passive:
            return JointKind.SPRUNG if self.sprung else JointKind.FREE
        return JointKind.ACTUATED

    @property
    def what(self) -> str:
        """The word for it: a fixed one is an actuator or a mount."""
        return str(self.kind) if self.fixed else "joint"

    @property
    def free(self) -> bool:
        """Whether it moves freely: the equilibrium finds its coordinate."""
        return self.kind is JointKind.FREE

    @property
    def held(self) -> bool:
        """Whether it stands at a coordinate that a posture, the data or a coupling give."""
        return not self.fixed and not self.free

    @property
    def sprung(self) -> bool:
        """Whether it has a spring about or along its own axis alone."""
        return self.compliance > 0.0 or self.law is not None

    @property
    def elastic(self) -> bool:
        """Whether anything in it deflects."""
        return self.matrix is not None or self.sprung or any(self.lateral)

    @property
    def compliances(self) -> tuple[float, float, float]:
        """About or along its own axis, and about the two others, see `lateral`."""
        return self.compliance, *self.lateral

    def with_compliance(self, which: int, value: float) -> Joint:
        """The same joint with another value of one of its `compliances`, counted from zero."""
        own, first, second = (value if i == which else c for i, c in enumerate(self.compliances))
        return replace(self, compliance=own, lateral=(first, second))

    @property
    def stiffness(self) -> float:
        """Of its spring about or along its own axis, N mm/rad or N/mm; infinite where it has none.

        To the 15 digits that a float keeps of any decimal number, so that a stiffness of a file is as it was there.
        """
        return float(f"{1.0 / self.compliance:.15g}") if self.compliance > 0.0 else float("inf")

    @property
    def stretch(self) -> float:
        """How far from the posture's coordinate its own spring is free of stress, mm or rad."""
        if self.rest is not None:
            return self.rest - self.held_at
        if self.law is None or not self.preload:
            return self.preload * self.compliance
        return -self.law.deflection(-self.preload)

    @property
    def bearings(self) -> list[tuple[Array, float]]:
        """The axes ``(3,)`` across its own about which it deflects, with the compliances, rad/(N mm)."""
        across = zip(joint_axes(self.axis).T[:2], self.lateral, strict=True)
        return [(axis, compliance) for axis, compliance in across if compliance > 0.0]

    @property
    def passes_on(self) -> tuple[tuple[str, float], ...]:
        """Names of joints and the ratios by which it moves with what their springs add about their own axes."""
        return self.coupling.ratios if self.coupling is not None and self.coupling.as_deflected else ()

    def motion(self, value: float) -> Array:
        """Frame ``(4, 4)`` behind the joint at a coordinate, in the chain frame before it."""
        return translation(self.axis * value) if self.slides else turn(self.axis, value)

    @property
    def held_at(self) -> float:
        """The coordinate, mm or rad; zero where it is fixed.

        Raises:
            ValueError: no posture has given it.
        """
        if self.fixed:
            return 0.0
        if self.value is None:
            raise ValueError(
                f"joint '{self.name}' has no coordinate yet: take the chain in a posture, chain.at(label)"
            )
        return self.value


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
        law: of the pull by the length beyond the free length, in place of the stiffness.

    Example:
        >>> import vjm
        >>> vjm.PointSpring("cable", ("upper", "fore"), ((0, 0, 0), (0, 50, 0)), 20.0).parts
        ('upper', 'fore')
    """

    name: str
    parts: tuple[str, str]
    points: Array
    stiffness: float = 0.0
    free_length: float = 0.0
    preload: float = 0.0
    law: Law | None = None

    def __post_init__(self) -> None:
        if self.law is not None and self.stiffness:
            raise ValueError(
                f"spring '{self.name}' has a law and a stiffness, which say the same: give one of them"
            )

    @property
    def cable(self) -> bool:
        """Whether it only pulls."""
        return isinstance(self.law, OneSided) and self.law.acts == "above"

    def pull(self, length: Array | float) -> Array:
        """Forces in N at lengths in mm; they pull the points together."""
        stretch = np.asarray(length - self.free_length, dtype=float)
        return (self.stiffness * stretch if self.law is None else self.law.force(stretch)) + self.preload

    def tangent(self, length: Array | float) -> Array:
        """Stiffnesses along it at lengths in mm, N/mm."""
        stretch = np.asarray(length - self.free_length, dtype=float)
        return np.full_like(stretch, self.stiffness) if self.law is None else self.law.tangent(stretch)

    def energy(self, length: Array | float) -> Array:
        """Energies in N mm at lengths in mm, zero at the free length."""
        stretch = np.asarray(length - self.free_length, dtype=float)
        own = 0.5 * self.stiffness * stretch**2 if self.law is None else self.law.energy(stretch)
        return own + self.preload * stretch
