"""The format of a model file, version 1.

Here are its tables and keys, the parts that they make, and what a drawing says of a part.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import Discriminator, Field, Tag, ValidationInfo, field_validator, model_validator

from vjm.io import checks
from vjm.io.checks import PlacedPiece, far_steps
from vjm.io.errors import printed
from vjm.io.fields import (
    LONGEST_MM,
    Axis,
    Label,
    LengthMM,
    Matrix6,
    Name,
    PartName,
    StiffnessSection,
    Table,
    Turn,
    Turns,
    VectorMM,
    rotation,
    tags_of,
)
from vjm.io.joint_tables import (
    LAW_TABLES,
    ActuatedTable,
    ActuatorTable,
    CalibratedTable,
    CatalogueLaw,
    ClosureTable,
    CoupledTable,
    CouplingTable,
    FrameTable,
    JointTable,
    MountTable,
    MovingTable,
    Offset,
    PartTable,
    PayloadTable,
    PointSpringTable,
    Poses,
    Workspace,
    displacement,
    given_coordinates,
)
from vjm.io.shapes import SHAPES, AnySection
from vjm.model import parts
from vjm.model.machine import FOOT, Machine
from vjm.model.parts import Beam, Joint, Section
from vjm.postures import assembled
from vjm.rotations import Array, rotate_matrix6, shift_compliance

UPPER = np.triu_indices(6)
Form = Annotated[list[float], Field(min_length=21, max_length=21)]


class DrawnTable(Table):
    """What is kept of a drawing in a model document; `vjm.io.solid_compliance` fills it in."""

    file: str
    thickness_mm: LengthMM = Field(description="twice the volume over the surface: of a plate, its thickness")
    bodies: int = Field(1, ge=1, description="that the drawing holds; they are bonded where they touch")
    bonded: bool = Field(False, description="whether that is meant")
    buckling_N: float | None = Field(  # noqa: N815
        None, gt=0.0, description="compression that buckles it as a column of its own sections, free at its tip"
    )
    yield_stress_MPa: float | None = Field(None, gt=0.0)  # noqa: N815
    stress_at_mm: list[VectorMM] = Field(description="own axes, from where the part begins: of every matrix below")
    stress_forms: list[Form] = Field(
        description="upper triangles, row by row, of matrices Q, in own axes, N, N mm, MPa. The highest von Mises "
        "stress under a wrench w at the tip is √(max wᵀQw)."
    )

    def forms(self) -> Array:
        """The matrices ``(k, 6, 6)``."""
        result = np.zeros((len(self.stress_forms), 6, 6))
        result[:, UPPER[0], UPPER[1]] = self.stress_forms
        upper = np.triu(result, 1)
        return result + np.swapaxes(upper, 1, 2)


@dataclass(frozen=True)
class Likeness:
    """The uniform beam in a part's own geometry that is nearest to its compliance.

    Attributes:
        section: of the beam.
        worst: the largest difference of the two compliances over √(c_ii c_jj).
        entry: where, counted from one.
        length: of the beam, mm.
    """

    section: Section
    worst: float
    entry: tuple[int, int]
    length: float

    @property
    def gyration(self) -> float:
        """The larger radius of gyration, mm."""
        return float(np.sqrt(max(self.section.EIy, self.section.EIz) / self.section.EA))


def nearest_beam(part: Beam) -> Likeness:
    """The beam that has a part's length, axes and end offset, and the diagonal of its compliance at the middle.

    There a uniform beam's compliance is diagonal. Where it shears less than none, shear is left out.
    """
    assert part.compliance is not None
    L = part.length
    at_end = rotate_matrix6(shift_compliance(part.compliance, -part.end_offset), part.section_frame.T)
    a, y, z, t, cy, cz = np.diag(shift_compliance(at_end, [-0.5 * L, 0.0, 0.0])).tolist()
    shear = [float(one) for one in (y - L**2 * cz / 12.0, z - L**2 * cy / 12.0)]
    section = Section(L / a, L / t, L / cy, L / cz, *(L / one if one > 0.0 else float("inf") for one in shear))
    theory = replace(part, section=section, compliance=None, count=1).beam_compliance()
    scale = np.sqrt(np.outer(np.diag(part.compliance), np.diag(part.compliance)))
    miss = np.abs(theory - part.compliance) / scale
    i, j = sorted(int(k) for k in np.unravel_index(np.argmax(miss), (6, 6)))
    return Likeness(section, float(miss[i, j]), (i + 1, j + 1), L)


__all__ = ["Axis", "BeamTable", "Label", "ModelFile", "Turn", "Turns", "VectorMM", "known_keys", "rotation"]


MAY_BE_RIGID = "may be rigid"
"""In the context of a validation: nothing needs to deflect."""


class BeamTable(PartTable):
    """An elastic part: a section, a compliance matrix, or both.

    The matrix is that of one member at the tip, in the own axes, rows and columns x, y, z, φx, φy, φz.
    """

    kind: Literal["beam"]
    length_mm: LengthMM
    own_axes: Turns = Field([], description="from the chain frame to the part's own axes")
    section_axes: Turns = Field([], description="from the own axes to the section's, x along the beam")
    end_offset_mm: VectorMM = Field([0.0, 0.0, 0.0], description="from the beam's end to the tip, own axes")
    count: int = Field(1, ge=1, le=1000, description="equal members that share every load")
    section: AnySection | None = None
    compliance: Matrix6 | None = Field(None, description="mm/N, 1/N, rad/(N mm)")
    compliance_source: str = ""
    bow_mm: Annotated[list[float], Field(min_length=2, max_length=2)] = Field(
        [0.0, 0.0], description="mid-span, along the section's y and z, of the half sine wave that it is unloaded"
    )
    mass_kg: float | None = Field(None, ge=0.0, le=1e4, description="of all members, in place of a density")
    centre_of_mass_mm: VectorMM | None = Field(
        None, description="of a part without a section, own axes, from where it begins"
    )
    drawing: DrawnTable | None = Field(None, description="what its drawing says beyond the compliance")
    segments: int | None = Field(
        None, ge=1, le=1000, description="springs that it is always computed with; 1: one spring at its far end"
    )
    free_length: PartName | None = Field(
        None,
        description="sliding joint whose coordinate is how much of it is out of its root; length_mm is the whole",
    )

    @field_validator("compliance")
    @classmethod
    def _compliance(cls, rows: list[list[float]] | None) -> list[list[float]] | None:
        return None if rows is None else checks.checked_part_compliance(np.array(rows, dtype=float)).tolist()

    @model_validator(mode="after")
    def _sane(self) -> BeamTable:
        if self.section is None and self.compliance is None:
            raise ValueError("needs a [parts.section], a compliance, or both")
        beam = self.part()
        if beam.section is not None:
            checks.check_section_units(beam.section, self.length_mm)
        if beam.compliance is not None:
            checks.check_compliance_units(beam)
        if beam.section is not None and beam.compliance is not None:
            checks.check_against_section(beam)
        self._check_extras()
        return self

    def _check_extras(self) -> None:
        if self.free_length is not None and (
            self.section is None or any(self.bow_mm) or self.compliance is not None
        ):
            raise ValueError("has free_length: it takes a [parts.section], and neither bow_mm nor a compliance")
        if any(self.bow_mm) and self.section is None:
            raise ValueError("has bow_mm but no [parts.section]: it is spread along a section")
        if self.mass_kg is not None and self.section is None and self.centre_of_mass_mm is None:
            raise ValueError(
                "has mass_kg but no [parts.section]: it is spread along a section; without one give "
                "centre_of_mass_mm"
            )
        if self.centre_of_mass_mm is not None and (self.section is not None or self.mass_kg is None):
            other = "no mass_kg" if self.mass_kg is None else "a [parts.section], along which the mass is spread"
            raise ValueError(f"has centre_of_mass_mm and {other}: it goes with mass_kg and a compliance alone")
        if math.hypot(*self.bow_mm) > 0.2 * self.length_mm:
            raise ValueError(
                f"has bow_mm = {self.bow_mm}, above a fifth of length_mm = {printed(self.length_mm)}: give mm"
            )
        if self.mass_kg is not None and getattr(self.section, "density_kg_per_m3", None) is not None:
            raise ValueError("has mass_kg and density_kg_per_m3, two masses: give one")

    def part(self) -> parts.Beam:
        """The part that the table describes."""
        section = None if self.section is None else self.section.stiffness()
        if section is not None and self.mass_kg is not None:
            section = replace(section, mass=self.mass_kg / self.length_mm / self.count)
        return parts.Beam(
            self.name,
            self.length_mm,
            own_frame=rotation(self.own_axes),
            section_frame=rotation(self.section_axes),
            end_offset=np.array(self.end_offset_mm, dtype=float),
            section=section,
            compliance=None if self.compliance is None else np.array(self.compliance, dtype=float),
            count=self.count,
            bow=(self.bow_mm[0], self.bow_mm[1]),
            own_segments=self.segments,
            free_length=self.free_length or "",
            own_mass=(self.mass_kg or 0.0) if section is None else 0.0,
            centre=None if self.centre_of_mass_mm is None else np.array(self.centre_of_mass_mm, dtype=float),
        )


class Units(Table):
    """The units of the file, said out loud; there is no choice."""

    length: Literal["mm"]
    force: Literal["N"]
    angle: Literal["rad"]


class Springs(Table):
    """How many springs the machine is to be computed with, unless a command says so itself."""

    link_segments: int | None = Field(
        None, ge=1, le=1000, description="every beam but the foot; 1: one spring at the far end, the paper's"
    )
    foot_segments: int | None = Field(None, ge=1, le=1000)


class Base(FrameTable):
    """Where the first part begins in the world: shifted first, then turned."""


AnyPart = Annotated[
    Offset | PayloadTable | ActuatorTable | MountTable | BeamTable | JointTable | ActuatedTable | CoupledTable,
    Field(discriminator="kind"),
]


Posture = Annotated[
    Annotated[list[float], Tag("row")] | Annotated[dict[PartName, float], Tag("table")],
    Discriminator(lambda raw: "table" if isinstance(raw, dict) else "row"),
]


class ModelFile(Table):
    """A model file: a chain from base to tool, and its postures."""

    format: Literal[1]
    name: Name
    title: str = Field(min_length=1)
    source: str = Field(min_length=1)
    units: Units
    base: Base = Base()
    springs: Springs = Springs()
    parts: list[AnyPart] = Field(min_length=1)
    postures: dict[Label, Posture] = Field(
        min_length=1, description="joint coordinates in rad or mm: by name, or of all joints base to tool"
    )
    point_springs: list[PointSpringTable] = Field([])
    ends: dict[PartName, PartName] = Field({}, description="end frames by name: the part behind which each lies")
    closures: list[ClosureTable] = Field([])
    couplings: list[CouplingTable] = Field([])
    poses: Poses = Field({}, description="of a machine with closures: the end-effector from the first posture")
    workspace: Workspace | None = None
    calibrated: CalibratedTable = CalibratedTable()

    @model_validator(mode="after")
    def _chain(self, info: ValidationInfo) -> ModelFile:
        names = [part.name for part in self.parts]
        for name in names:
            if names.count(name) > 1:
                places = " and ".join(str(i + 1) for i, other in enumerate(names) if other == name)
                raise ValueError(f"part name '{name}' stands twice, as parts {places}: rename one")
        # a leg of a machine may be rigid
        deflects = bool(self.point_springs) or any(parts.deflects(part.part()) for part in self.parts)
        if MAY_BE_RIGID not in (info.context or ()) and not deflects:
            raise ValueError(
                "nothing deflects: no part has kind = 'beam', no joint a compliance, and no spring holds a point; "
                "add one"
            )
        self._refuse_far(names)
        for part in self.parts:
            one = self.springs.foot_segments if part.name == FOOT else self.springs.link_segments
            if isinstance(part, BeamTable) and any(part.bow_mm) and (one or part.segments) == 1:
                where = "[springs] one spring" if one else "segments = 1"
                raise ValueError(f"part '{part.name}' has a bow, and {where}, which has no shape: give 2")
        for label in self.postures:
            self.given(label)
        for joint in self.calibrated.valid_within:
            if joint not in names:
                raise ValueError(f"[calibrated.valid_within] names '{joint}', which is no part: leave it out")
        if self.poses and not (self.closures or self.couplings):
            raise ValueError("has [poses] but no [[closures]]: give the joints' coordinates in [postures]")
        for label in self.poses:
            if label in self.postures and (label != next(iter(self.postures)) or any(self.poses[label])):
                raise ValueError(f"'{label}' is a posture and a pose: rename one")
        return self

    def _refuse_far(self, names: list[str]) -> None:
        """Refuse links beyond a machine's length, unless they lead along axes and back."""
        steps, before = list[PlacedPiece](), self.predecessors
        for part in self.parts:
            behind = before[part.name]
            made = part.part()
            turns = isinstance(part, MovingTable) and not part.slides
            steps.append(
                PlacedPiece(
                    part.name, behind if behind in names[: len(steps)] else "",
                    made.transform if isinstance(made, parts.RigidOffset) else np.eye(4),
                    moves=isinstance(part, MovingTable),
                    axis=part.axis if isinstance(part, MovingTable) and turns else None,
                )
            )  # fmt: skip
        for name, length in far_steps(steps):
            raise ValueError(
                f"part '{name}', translation_mm is {printed(length)} mm long, beyond {printed(LONGEST_MM)} mm: "
                "write it in mm"
            )

    @property
    def predecessors(self) -> dict[str, str]:
        """Name of the part behind which each part begins, see `Machine.predecessors`."""
        before, last = dict[str, str](), ""
        for part in self.parts:
            before[part.name] = last if part.after is None else part.after
            if isinstance(part, MovingTable) and part.rides_on is not None:
                before[part.name] = before.get(part.rides_on, last)
            last = part.name
        return before

    @property
    def _moving(self) -> list[MovingTable]:
        """The joints whose coordinates a posture has to give."""
        return [part for part in self.parts if isinstance(part, MovingTable) and not isinstance(part, CoupledTable)]

    def given(self, label: str) -> dict[str, float]:
        """Coordinates of a posture by the names of the joints, mm or rad."""
        return given_coordinates(label, self.postures[label], self._moving)

    def chain(self, files: Mapping[str, str] | None = None) -> Machine:
        """The chain that the file describes, its loops closed.

        Raises:
            ValueError: a posture leaves the passive joints dependent, or a loop does not close.
        """
        return assembled(self.as_written(files))

    def as_written(self, files: Mapping[str, str] | None = None) -> Machine:
        """The chain in the postures that the file gives, in which its loops may be open."""
        made = tuple(part.part() for part in self.parts)
        passive = [part.name for part in made if isinstance(part, Joint) and part.free]
        given = {label: self.given(label) for label in self.postures}
        return Machine(
            name=self.name,
            parts=made,
            base=self.base.frame,
            postures={label: np.array([q[name] for name in passive], dtype=float) for label, q in given.items()},
            held={label: {k: v for k, v in q.items() if k not in passive} for label, q in given.items()},
            after={part.name: part.after for part in self.parts if part.after is not None},
            point_springs=tuple(table.spring() for table in self.point_springs),
            ends=dict(self.ends),
            closures=tuple(table.closure() for table in self.closures),
            couplings=tuple(table.coupling(given) for table in self.couplings),
            poses={label: displacement(label, numbers) for label, numbers in self.poses.items()},
            workspace=None if self.workspace is None else self.workspace.corners,
            title=self.title,
            source=self.source,
            files=files or {},
            link_segments=self.springs.link_segments,
            foot_segments=self.springs.foot_segments,
            valid_within={joint: (low, high) for joint, (low, high) in self.calibrated.valid_within.items()},
        )


_TABLES: dict[str, type[Table]] = {
    "": ModelFile, "units": Units, "base": Base, "turn": Turn, "springs": Springs, "point_spring": PointSpringTable,
    "closure": ClosureTable, "coupling": CouplingTable, "calibrated": CalibratedTable,
    **{kind: part for part in get_args(get_args(AnyPart)[0]) for kind in tags_of(part, "kind")},
    "stiffness": StiffnessSection, **SHAPES, **LAW_TABLES, "catalogue": CatalogueLaw,
}  # fmt: skip


def known_keys(table: str) -> Iterable[str]:
    """The keys that a table may have, by its tag, see `vjm.io.errors.one_line`."""
    return list(_TABLES[table].model_fields)
