"""The parts of a chain: rigid offsets, beams and joints.

Parts are the machine, not a model of it: the virtual joint method and every finite element engine read the
same parts. A chain strings them from base to tool; each part begins at the *chain frame* where the one
before it ends.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import assert_never

import numpy as np

from vjm.model.joints import Joint
from vjm.rotations import Array, frame, rotate_matrix6, shift_compliance

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
        result: Array = self.own_frame @ own
        return result

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
        result: Array = self.own_frame @ own
        return result

    def fraction_of(self, point: Array) -> float:
        """Where along the beam a point ``(3,)`` mm lies, in the chain frame at its root: from 0 to 1.

        Before the root it is the root's, behind the end the end's, see `vjm.model.joints.PointSpring`.
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

    def refuse_bow(self, engine: str) -> None:
        """For engines whose beams are straight.

        Raises:
            ValueError: this one is bowed.
        """
        if any(self.bow):
            raise ValueError(
                f"part '{self.name}' has a bow, which {engine} does not know: take vjm with 2 springs or more"
            )

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
