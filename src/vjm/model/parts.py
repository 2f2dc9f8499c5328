"""The parts of a machine: joints, passive, held or coupled; rigid offsets and beams; and what closes its loops."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from enum import StrEnum
from functools import cached_property, reduce
from operator import add
from typing import TypeVar, assert_never

import numpy as np

from vjm.model.laws import Law, OneSided
from vjm.rotations import Array, frame, rotate_matrix6, shift_compliance, translation, turn

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
        """About or along its own axis, of a law where it is stiffest, and about the two others, see `lateral`."""
        own = self.compliance if self.law is None else 1.0 / self.law.largest_stiffness
        return own, *self.lateral

    def with_compliance(self, which: int, value: float) -> Joint:
        """The same joint with another value of one of its `compliances`, counted from zero.

        A law becomes softer or stiffer as a whole.
        """
        if which == 0 and self.law is not None:
            return replace(self, law=self.law.softer(value / self.compliances[0]))
        own, first, second = (value if i == which else c for i, c in enumerate(self.compliances))
        return replace(self, compliance=own if self.law is None else 0.0, lateral=(first, second))

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

    @cached_property
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


@dataclass(frozen=True)
class Closure:
    """Two frames of a machine that are held together, which closes a loop.

    A hinge, a slide or a universal joint between them is a passive joint before one of the two frames.

    Attributes:
        name: for people; unique among the closures.
        parts: names of the parts behind whose ends the two frames lie; empty for the base.
        frames: ``(2, 4, 4)`` mm, from the frame behind each part's end; from the world for the base. The ends
            themselves if left out.
        turns: whether one frame may turn against the other in all directions, as in a ball joint; else both are
            welded together.

    Example:
        >>> import vjm
        >>> [closure.name for closure in vjm.load("palletiser").closures]
        ['parallelogram']
    """

    name: str
    parts: tuple[str, str]
    frames: Array = field(default_factory=lambda: np.stack([np.eye(4)] * 2))
    turns: bool = False

    @property
    def rows(self) -> int:
        """Number of components that it holds: six of a weld, three of a ball joint."""
        return 3 if self.turns else 6


@dataclass(frozen=True)
class Coupling:
    """A rigid transmission between passive joints: ``Σ weight · coordinate = total``.

    Attributes:
        name: for people; unique among the couplings.
        terms: names of passive joints and their weights.
        total: of the weighted coordinates, rad or mm.

    Example:
        >>> import vjm
        >>> half = vjm.Coupling("equal", (("left", 1.0), ("right", -1.0)))
        >>> half.total
        0.0
    """

    name: str
    terms: tuple[tuple[str, float], ...]
    total: float = 0.0


SHORTEST_FREE = 1e-2
"""mm: least free length of a beam that comes out of its root; the stiffness of a shorter one would have no end."""


class Placement(StrEnum):
    """Where the virtual spring sits in its segment of a beam, and which law it has there."""

    END = "end"
    """At the far end, as the paper writes (21), by (22)."""
    MIDDLE = "middle"
    """At the elastic centre of the segment, where a uniform beam's compliance is diagonal, by (22)."""
    TWO_THIRDS = "two-thirds"
    """By (22) where the errors of end and middle in the critical load, +2 : −1 in 1/n², cancel."""
    BEST = "best"
    """At the middle with the beam-column's load-dependent compliance, its shifts in the half-turned axes."""

    @property
    def fraction(self) -> float:
        """Distance from the segment's root over its length."""
        return {"end": 1.0, "middle": 0.5, "two-thirds": 2.0 / 3.0, "best": 0.5}[self.value]


@dataclass(frozen=True)
class Section:
    """Stiffness of a beam's cross-section about its own axes, x along the beam.

    Attributes:
        EA: axial stiffness, N.
        GJ: torsional stiffness, N mm².
        EIy: bending stiffness about y (deflection along z), N mm².
        EIz: bending stiffness about z (deflection along y), N mm².
        GAy: shear stiffness for deflection along y, N; infinite where shear is neglected.
        GAz: the same along z.
        mass: kg per mm of length.

    Example:
        >>> import vjm
        >>> vjm.Section(EA=1e7, GJ=1e9, EIy=2e9, EIz=2e9).EIy
        2000000000.0
    """

    EA: float
    GJ: float
    EIy: float
    EIz: float
    GAy: float = float("inf")
    GAz: float = float("inf")
    mass: float = 0.0

    def __post_init__(self) -> None:
        for name in ("EA", "GJ", "EIy", "EIz"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise ValueError(f"a section's {name} must be positive and finite, not {getattr(self, name)}")
        for name in ("GAy", "GAz"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"a section's {name} must be positive or infinite, not {getattr(self, name)}")
        if not 0.0 <= self.mass < float("inf"):
            raise ValueError(f"a section's mass must be zero or more, not {self.mass}")

    def times(self, count: int) -> Section:
        """Section of ``count`` equal members side by side that share every load component."""
        return Section(
            self.EA * count, self.GJ * count, self.EIy * count, self.EIz * count,
            self.GAy * count, self.GAz * count, self.mass * count,
        )  # fmt: skip

    @property
    def shears(self) -> bool:
        """Whether it states a shear stiffness."""
        return bool(np.isfinite(self.GAy) or np.isfinite(self.GAz))

    def compliance_at_middle(self, length: float) -> Array:
        """Compliance ``(6, 6)`` of a straight piece of ``length`` mm, read at its middle, where it is diagonal.

        Bernoulli and Timoshenko beam theory: with the wrench at the middle of the piece its two ends turn by
        ``m h/EI`` and part by ``f h³/(12 EI) + f h/GA``.
        """
        h = length
        return np.diag(
            [
                h / self.EA,
                h**3 / (12.0 * self.EIz) + h / self.GAy,
                h**3 / (12.0 * self.EIy) + h / self.GAz,
                h / self.GJ,
                h / self.EIy,
                h / self.EIz,
            ]
        )

    def compliance(self, length: float, at: float = 1.0) -> Array:
        """Compliance ``(6, 6)`` of a straight piece, its root fixed, read at the fraction ``at`` of its length.

        ``at=1`` is the cantilever of the textbooks: L³/3EI, L²/2EI, L/EI.
        """
        return shift_compliance(self.compliance_at_middle(length), [(at - 0.5) * length, 0.0, 0.0])


@dataclass(frozen=True)
class RigidOffset:
    """A rigid piece: a link, a tool, or a payload where its transform is the identity.

    Attributes:
        transform: constant ``(4, 4)``, mm.
        mass: kg.
        centre: of mass ``(3,)`` mm, where the piece begins; None: half-way along the transform's shift.
        inertia: about that centre ``(3, 3)`` kg mm², axes of the frame where the piece begins; None: a point mass.

    Example:
        >>> import vjm
        >>> vjm.RigidOffset("tool", vjm.translation((0, 0, 100)), mass=2.0).mass
        2.0
    """

    name: str
    transform: Array = field(default_factory=lambda: np.eye(4))
    mass: float = 0.0
    centre: Array | None = None
    inertia: Array | None = None

    @property
    def centre_of_mass(self) -> Array:
        """``(3,)`` mm, in the frame where the piece begins."""
        return 0.5 * self.transform[:3, 3] if self.centre is None else self.centre


@dataclass(frozen=True)
class Beam:
    """An elastic part: a straight uniform beam, perhaps with a rigid arm at its end, or a 6×6 compliance.

    Attributes:
        own_frame: rotation ``(3, 3)`` from the part's own axes, in which all else is given, to the chain frame.
        section_frame: rotation ``(3, 3)`` from the section's axes (x along the beam) to the own axes.
        length: of the elastic beam, mm.
        end_offset: rigid arm from the beam's end to the part's tip, own axes, ``(3,)`` mm.
        section: of one member, where the part is known as a beam.
        compliance: of one member at its tip, own axes, ``(6, 6)`` in mm/N, rad/N, rad/(N mm), where known.
        count: equal members side by side that share every load (a parallelogram as a bar of double stiffness).
        segments: None: one virtual spring with ``compliance`` at the tip; n: the section in n segments.
        placement: where a segment's spring sits.
        bow: mid-span amplitudes ``(2,)`` along the section's y and z, mm, of a half sine wave that the beam is when
            it bears nothing. Its two ends keep the directions that they have without it.
        free_length: name of the sliding joint whose coordinate is how much of the beam is free, as of a boom that
            comes out of its root; ``length`` is then the whole. Empty where all of it always is.
        own_segments: springs that the model file asks for, None where it leaves that to the engine.
        own_mass: kg, of all members, of a part without a section.
        centre: of that mass ``(3,)`` mm, own axes, from the root.

    Example:
        >>> import vjm
        >>> bar = vjm.Beam("bar", 500.0, section=vjm.shape("round_bar", diameter_mm=20.0).stiffness())
        >>> vjm.build("bar", [bar]).beams[0].length
        500.0
    """

    name: str
    length: float
    own_frame: Array = field(default_factory=lambda: np.eye(3))
    section_frame: Array = field(default_factory=lambda: np.eye(3))
    end_offset: Array = field(default_factory=lambda: np.zeros(3))
    section: Section | None = None
    compliance: Array | None = None
    count: int = 1
    segments: int | None = None
    placement: Placement = Placement.BEST
    bow: tuple[float, float] = (0.0, 0.0)
    own_segments: int | None = None
    free_length: str = ""
    own_mass: float = 0.0
    centre: Array | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.length < float("inf"):
            raise ValueError(f"part '{self.name}': its length must be positive and finite, not {self.length}")

    @property
    def tip(self) -> Array:
        """Vector ``(3,)`` from root to tip in the chain frame, mm."""
        own = self.section_frame @ np.array([self.length, 0.0, 0.0]) + self.end_offset
        return self.own_frame @ own

    @property
    def section_in_chain(self) -> Array:
        """Frame ``(4, 4)`` of the section's axes at the root, in the chain frame."""
        return frame(self.own_frame @ self.section_frame)

    def effective_section(self) -> Section:
        """Section of all members together.

        Raises:
            ValueError: the part is known by its compliance matrix only.
        """
        if self.section is None:
            enough = "give it a section, or take vjm or vjm-paper, for which its matrix is enough"
            if self.own_segments != 1:
                enough = "give it segments = 1 or a section, or take vjm-paper, for which its matrix is enough"
            raise ValueError(f"part '{self.name}' has no section: it cannot be split or meshed; {enough}")
        return self.section.times(self.count)

    @property
    def mass(self) -> float:
        """Of all members, kg; zero where it is not known."""
        return self.own_mass if self.section is None else self.section.mass * self.count * self.length

    @property
    def centre_of_mass(self) -> Array:
        """``(3,)`` mm from the root, chain frame; half-way along the section where nothing else is said."""
        # of a boom that comes out of its root, all of it lies behind
        half = -0.5 if self.free_length else 0.5
        own = self.section_frame @ np.array([half * self.length, 0.0, 0.0]) if self.centre is None else self.centre
        return self.own_frame @ own

    def fraction_of(self, point: Array) -> float:
        """Where along the beam a point ``(3,)`` mm lies, in the chain frame at its root: from 0 to 1.

        Before the root it is the root's, behind the end the end's, see `vjm.model.parts.PointSpring`.
        """
        along = float(self.section_in_chain[:3, 0] @ point) / self.length
        return min(max(along, 0.0), 1.0)

    @property
    def end_slope(self) -> Array:
        """Turn ``(3,)`` in rad, section axes, of the root's tangent by the bow; the tip's is its opposite.

        ``v = a sin(πs/L)`` begins with the slope ``a π/L``; a slope along z is a turn about −y.
        """
        y, z = self.bow
        return np.array([0.0, -z, y]) * (np.pi / self.length)

    def beam_compliance(self) -> Array:
        """Compliance ``(6, 6)`` of all members at the tip, own axes, from the section by beam theory."""
        at_end = rotate_matrix6(self.effective_section().compliance(self.length), self.section_frame)
        return shift_compliance(at_end, self.end_offset)

    def tip_compliance(self) -> Array:
        """Compliance ``(6, 6)`` of all members at the tip, own axes: the given matrix, else beam theory."""
        return self.beam_compliance() if self.compliance is None else self.compliance / self.count


Part = RigidOffset | Joint | Beam
"""Anything that a chain is made of."""


def deflects(part: Part) -> bool:
    """Whether anything in a part deflects."""
    match part:
        case Beam():
            return True
        case Joint():
            return part.elastic
        case RigidOffset():
            return False
        case _:
            assert_never(part)
