"""A manipulator: legs, each a chain, between a fixed base, a rigid platform and other rigid bodies.

A leg begins on the base or on a body and ends on a body; the platform is the body whose pose is asked for. A
parallelogram is two legs between two bodies, so that closed loops need nothing of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from vjm.model.chain import Chain
from vjm.model.joint_limits import said_beyond
from vjm.model.joints import Joint, JointKind
from vjm.model.parts import RigidOffset
from vjm.plain_numbers import plain_number
from vjm.rotations import Array, translation, turn

BASE, PLATFORM = "base", "platform"
"""Names of the body that stands still and of the one whose pose is asked for."""


@dataclass(frozen=True)
class Drive:
    """The actuated coordinate of a leg.

    Attributes:
        part: name of the part that it moves, with all behind it. Only what is rigid lies before it, and an
            actuator's own compliance along the same axis.
        axis: unit vector ``(3,)`` in the part's chain frame.
        slides: along the axis, mm; else it turns about it, rad.
        limits: smallest and largest coordinate.
    """

    part: str
    axis: Array
    slides: bool = True
    limits: tuple[float, float] = (-np.inf, np.inf)

    @property
    def unit(self) -> str:
        """``mm`` or ``rad``."""
        return "mm" if self.slides else "rad"

    def motion(self, coordinate: float) -> Array:
        """Frame ``(4, 4)`` by which the coordinate, mm or rad, moves what lies behind."""
        return translation(coordinate * self.axis) if self.slides else turn(self.axis, coordinate)


@dataclass(frozen=True)
class Leg:
    """One chain of a manipulator.

    Attributes:
        name: unique.
        chain: its parts, as designed.
        start: body on which it begins.
        end: body on which it ends.
        root: frame ``(4, 4)`` of the chain's world in the starting body, mm.
        attachment: frame ``(4, 4)`` of the chain's end in the body that it ends on, mm.
        drive: its actuated coordinate, if it has one.
        coordinate: of the drive at home, mm or rad.
        posture: passive coordinates ``(n_q,)`` at home, rad.
    """

    name: str
    chain: Chain
    start: str = BASE
    end: str = PLATFORM
    root: Array = field(default_factory=lambda: np.eye(4))
    attachment: Array = field(default_factory=lambda: np.eye(4))
    drive: Drive | None = None
    coordinate: float = 0.0
    posture: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if len(self.posture) != len(self.chain.joints):
            raise ValueError(
                f"leg '{self.name}': {len(self.posture)} coordinates for {len(self.chain.joints)} passive joints"
            )
        if self.start == self.end:
            raise ValueError(f"leg '{self.name}' begins and ends on '{self.start}': it would hold nothing")
        if self.drive is not None:
            self.seat  # noqa: B018  it says what is wrong with the drive

    @property
    def seat(self) -> Array:
        """Frame ``(4, 4)`` in the starting body where the drive acts.

        Raises:
            ValueError: there is no such part, or something deflects before it.
        """
        assert self.drive is not None
        T = self.root @ self.chain.base
        for part in self.chain.parts:
            if part.name == self.drive.part:
                if isinstance(part, RigidOffset):
                    T = T @ part.transform
                return T
            if not isinstance(part, RigidOffset):
                raise ValueError(
                    f"leg '{self.name}': part '{part.name}' lies before the drive '{self.drive.part}' but is not "
                    f"rigid. Put the drive first, or leave `drive` out, which holds the leg at its length"
                )
            T = T @ part.transform
        known = ", ".join(part.name for part in self.chain.parts)
        raise ValueError(f"leg '{self.name}': no part '{self.drive.part}' to drive (there are {known})")

    def driven_root(self, coordinate: float) -> Array:
        """Frame ``(4, 4)`` of the chain's world in the starting body, the drive at a coordinate.

        What lies before the drive is rigid, so moving all that lies behind is moving the chain's world.
        """
        if self.drive is None:
            return self.root
        seat = self.seat
        return seat @ self.drive.motion(coordinate) @ np.linalg.inv(seat) @ self.root


@dataclass(frozen=True)
class LegCoupling:
    """A rigid transmission between passive joints: the weighted sum of their turns from home is zero.

    Attributes:
        name: unique.
        terms: name of a leg, name of a passive joint of it, weight.
    """

    name: str
    terms: tuple[tuple[str, str, float], ...]


@dataclass(frozen=True)
class Manipulator:
    """Legs on a platform.

    Attributes:
        name: of the model.
        legs: those that define a body's place at home come before those that begin on it.
        home: frame ``(4, 4)`` of the platform at home, mm.
        poses: displacement ``(6,)`` of the platform from home by label, mm, rad.
        couplings: between passive joints.
        errors: by leg and part, by how many mm a beam was built too long.
        offsets: by leg, what its drive's coordinate is off, mm or rad.
        workspace: corners ``(2, 3)`` of a box of displacements from home in which the machine works, mm.
        title: one line for people.
        source: where the numbers come from.
        sha256: of the model files, empty where there were none.
    """

    name: str
    legs: tuple[Leg, ...]
    home: Array = field(default_factory=lambda: np.eye(4))
    poses: Mapping[str, Array] = field(default_factory=dict)
    couplings: tuple[LegCoupling, ...] = ()
    errors: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    offsets: Mapping[str, float] = field(default_factory=dict)
    workspace: Array | None = None
    title: str = ""
    source: str = ""
    sha256: str = ""

    def __repr__(self) -> str:
        legs = ", ".join(leg.name for leg in self.legs)
        return f"<Manipulator {self.name}: legs {legs}; poses {', '.join(self.poses) or 'none'}>"

    def __post_init__(self) -> None:
        self._check_names()
        self._check_graph()

    def _check_names(self) -> None:
        names = [leg.name for leg in self.legs]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{self.name}: leg '{twice[0]}' stands twice: rename one")
        for name in (*self.errors, *self.offsets):
            self.leg(name)
        for name, parts in self.errors.items():
            beams = [beam.name for beam in self.leg(name).chain.beams]
            for part in parts:
                if part not in beams:
                    raise ValueError(
                        f"leg '{name}' has no beam '{part}' to be too long (it has {', '.join(beams)})"
                    )
        for name in self.offsets:
            if self.leg(name).drive is None:
                raise ValueError(f"leg '{name}' has no drive that could be off")
        for coupling in self.couplings:
            for leg, joint, _ in coupling.terms:
                joints = [part.name for part in self.leg(leg).chain.joints]
                if joint not in joints:
                    raise ValueError(f"coupling '{coupling.name}': leg '{leg}' has no joint '{joint}'")

    def _check_graph(self) -> None:
        known = {BASE}
        for leg in self.legs:
            if leg.end == BASE:
                raise ValueError(f"leg '{leg.name}' ends on the base: turn it round")
            if leg.start not in known:
                raise ValueError(
                    f"leg '{leg.name}' begins on '{leg.start}', where no leg before it ends: "
                    "it is not connected to the base"
                )
            known.add(leg.end)
        if PLATFORM not in known:
            raise ValueError(f"{self.name}: no leg ends on the platform")
        if sum(PLATFORM in (leg.start, leg.end) for leg in self.legs) < 2:
            raise ValueError(
                f"{self.name}: only leg '{self.legs[-1].name}' holds the platform: that is a chain and no "
                "manipulator; add legs or give the chain file itself"
            )
        for body in self.bodies[1:]:
            if sum(body in (leg.start, leg.end) for leg in self.legs) < 2:
                loose = next(leg.name for leg in self.legs if body in (leg.start, leg.end))
                raise ValueError(
                    f"leg '{loose}' is an open chain: nothing else holds the body '{body}' on which it ends"
                )

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the moving bodies, the platform first."""
        ends = dict.fromkeys(leg.end for leg in self.legs)
        return (PLATFORM, *(name for name in ends if name != PLATFORM))

    @property
    def postures(self) -> Mapping[str, Array]:
        """Its poses, under the name that they have for a chain."""
        return self.poses

    def posture(self, label: str) -> Array:
        """`displacement`, as a chain's posture is asked for.

        Raises:
            KeyError: no such pose.
        """
        try:
            return self.displacement(label)
        except ValueError as error:
            raise KeyError(str(error)) from None

    @property
    def characteristic_length(self) -> float:
        """The longest part's length in mm."""
        return max(leg.chain.characteristic_length for leg in self.legs)

    @property
    def shears(self) -> bool:
        """Whether a beam states a shear stiffness."""
        return any(leg.chain.shears for leg in self.legs)

    def rigid_in_shear(self) -> Manipulator:
        """The same machine with the shear of its sections neglected; given matrices stay as they are."""
        return replace(self, legs=tuple(replace(leg, chain=leg.chain.rigid_in_shear()) for leg in self.legs))

    def leg(self, name: str) -> Leg:
        """The leg of a name.

        Raises:
            ValueError: there is none.
        """
        for leg in self.legs:
            if leg.name == name:
                return leg
        raise ValueError(f"{self.name}: no leg '{name}' (it has {', '.join(leg.name for leg in self.legs)})")

    def displacement(self, label: str) -> Array:
        """Displacement ``(6,)`` of a pose from home by its label, or by ``x,y,z`` or ``x,y,z,rx,ry,rz`` in mm, rad.

        Raises:
            ValueError: no such pose.
        """
        if label in self.poses:
            return self.poses[label]
        try:
            numbers = np.array([plain_number(word) for word in label.split(",")])
        except ValueError:
            numbers = np.zeros(0)
        if len(numbers) not in (3, 6) or not np.all(np.isfinite(numbers)):
            raise ValueError(
                f"{self.name}: no pose '{label}': give {', '.join(self.poses) or 'coordinates'}, or x,y,z in mm"
            )
        return np.concatenate([numbers, np.zeros(6 - len(numbers))])

    def beyond_limits(self, drives: Array) -> str:
        """Which of the legs' drives ``(l,)``, mm or rad, are beyond their limits and by how much, or nothing."""
        said = [
            said_beyond(f"the drive of leg '{leg.name}'", float(value), leg.drive.limits, leg.drive.unit)
            for leg, value in zip(self.legs, drives, strict=True)
            if leg.drive is not None
        ]
        return "; ".join(text for text in said if text)

    def with_errors(self, errors: Mapping[str, Mapping[str, float]]) -> Manipulator:
        """The same machine with beams that were built too long, by leg and part, mm."""
        return replace(self, errors=errors)

    def with_offsets(self, offsets: Mapping[str, float]) -> Manipulator:
        """The same machine with drives that are off, by leg, mm or rad."""
        return replace(self, offsets=offsets)

    def with_actuator_compliance(self, compliance: float) -> Manipulator:
        """The same machine with a ``compliance`` of every sliding drive, mm/N."""
        legs = (replace(leg, chain=leg.chain.with_actuator_compliance(compliance)) for leg in self.legs)
        return replace(self, legs=tuple(legs))


Machine: TypeAlias = Chain | Manipulator
"""What a model file describes: a serial chain or tree of parts, or legs on a platform."""


def drive_of(chain: Chain, part: str, turns_about: Array | None, limits: tuple[float, float]) -> Drive:
    """The drive at a part: along an actuator's axis, or about an axis where one is given.

    Raises:
        ValueError: the part is no actuator and no axis is given.
    """
    if turns_about is not None:
        return Drive(part, turns_about, False, limits)
    actuators = {p.name: p for p in chain.parts if isinstance(p, Joint) and p.kind is JointKind.ACTUATOR}
    if part not in actuators:
        known = ", ".join(actuators) or "none"
        raise ValueError(
            f"drive '{part}' is no actuator of {chain.name} (it has {known}): name one, or give drive_turns_about"
        )
    return Drive(part, actuators[part].axis, True, limits)
