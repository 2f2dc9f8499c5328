"""Tables of a model file that are no beams.

They are rigid links, payloads, drives, joints, springs and their laws, frames held together, coupled joints, poses
and the workspace.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias, Union, get_type_hints

import numpy as np
from pydantic import Discriminator, Field, Tag, create_model, field_validator, model_validator

from vjm.io import checks
from vjm.io.catalogues import COLUMN_OF_NAME, catalogue
from vjm.io.errors import did_you_mean, validated
from vjm.io.fields import Axis, Label, Matrix6, PartName, Table, Turns, VectorMM, rotation
from vjm.io.inertia import InertiaKgMM2, inertia_matrix
from vjm.model import parts
from vjm.model.joint_limits import LARGEST_TURN, said_beyond, said_turned
from vjm.model.laws import LAWS, Law, OneSided, StrainWave
from vjm.model.parts import Closure, Coupling, Joint, JointCoupling, PointSpring
from vjm.rotations import Array, frame

CATALOGUE_UNITS = {
    **{f"{name}_1e4Nm_per_rad": (name, 1e7) for name in ("K1", "K2", "K3")},
    **{f"{name}_Nm": (name, 1e3) for name in ("T1", "T2")},
}
"""Keys of strain wave gears in the units of their catalogues: which number, and the factor to N mm and rad."""


class LawTable(Table):
    """A law by its numbers, those of what turns or of what slides."""

    law_class: ClassVar[type[Law]]
    source: str = ""

    def law(self, *, slides: bool) -> Law:
        """The law of a joint that turns, or of what slides or stretches.

        Raises:
            ValueError: a number is missing, stands twice or has another unit, or the numbers make no law.
        """
        made = self.law_class
        keys, others = made.keys(slides=slides), made.keys(slides=not slides)
        given: dict[str, Any] = {}
        for key, value in self.model_dump(exclude_none=True, exclude={"kind", "source"}).items():
            name, factor = CATALOGUE_UNITS.get(key, ("", 1.0))
            if key in made.words():
                name = key
            elif not name:
                name = next(name for name in keys if key in (keys[name], others[name]))
            if key not in (keys.get(name), name) and (slides or key not in CATALOGUE_UNITS):
                other = "turns" if slides else "slides or stretches"
                raise ValueError(f"law.{key} has the unit of what {other}: give {keys[name]}")
            if name in given:
                raise ValueError(f"law.{key}: {name} stands twice: give it once")
            given[name] = tuple(value) if isinstance(value, list) else value * factor if factor != 1.0 else value
        # a number that has a default is an attribute of the class
        missing = next((key for name, key in keys.items() if name not in given and not hasattr(made, name)), None)
        if missing is not None:
            raise ValueError(f"law.{missing} is missing: a law of kind '{made.kind}' needs it")
        try:
            return made(**given)
        except ValueError as error:
            raise ValueError(f"law: {error}") from None


def _table_of(law: type[Law]) -> type[LawTable]:
    """The table of a law: each number in the units of what turns and of what slides."""
    fields: dict[str, Any] = {"kind": (Literal[law.kind], ...)}
    hints = get_type_hints(law)
    numbers = [law.keys(slides=False), law.keys(slides=True)]
    for name in numbers[0]:
        many = "tuple" in str(hints[name])
        for keys in numbers:
            fields[keys[name]] = (list[float] | None if many else float | None, None)
    if law is StrainWave:
        fields |= {
            key: (float | None, Field(None, description="as catalogues write it")) for key in CATALOGUE_UNITS
        }
    fields |= dict.fromkeys(law.words(), (str | None, None))
    made: type[LawTable] = create_model(f"{law.__name__}Table", __base__=LawTable, __doc__=law.__doc__, **fields)
    made.law_class = law
    return made


LAW_TABLES: Mapping[str, type[LawTable]] = {kind: _table_of(law) for kind, law in LAWS.items()}
"""By the laws' kinds."""


class CatalogueLaw(Table):
    """A law that is a row of a catalogue."""

    catalogue: str = Field(description="a catalogue of the library, or a file .toml or .csv")
    row: str = Field(description="the row's name")

    def law(self, *, slides: bool) -> Law:
        """The law of the row.

        Raises:
            ValueError: there is no such row, or it makes no law.
        """
        rows = {str(row.get(COLUMN_OF_NAME)): dict(row) for row in catalogue(self.catalogue)}
        if self.row not in rows:
            hint = did_you_mean(self.row, rows)
            raise ValueError(f"law.row: '{self.catalogue}' has no row '{self.row}'{hint}")
        values = {key: value for key, value in rows[self.row].items() if key != COLUMN_OF_NAME}
        where = f"law: row '{self.row}' of '{self.catalogue}'"
        table = LAW_TABLES.get(str(values.get("kind")))
        if table is None:
            raise ValueError(f"{where} is no law: its kind must be one of {', '.join(LAW_TABLES)}")
        made = validated(table, values, where)
        try:
            return made.law(slides=slides)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None


def _kind_of(raw: object) -> str | None:
    if isinstance(raw, CatalogueLaw) or (isinstance(raw, dict) and "catalogue" in raw):
        return "catalogue"
    return raw.get("kind") if isinstance(raw, dict) else getattr(raw, "kind", None)


if TYPE_CHECKING:
    AnyLaw = LawTable | CatalogueLaw
else:
    AnyLaw = Annotated[
        Union[  # noqa: UP007  (of as many tables as there are laws)
            tuple(Annotated[table, Tag(kind)] for kind, table in {**LAW_TABLES, "catalogue": CatalogueLaw}.items())
        ],
        Discriminator(_kind_of),
    ]
"""What a file may say of a law."""


Poses: TypeAlias = dict[Label, Annotated[list[float], Field(min_length=3, max_length=6)]]
"""Displacements by label: x, y, z in mm, and perhaps turns in rad."""


class FrameTable(Table):
    """A frame: shifted first, then turned."""

    position_mm: VectorMM = Field([0.0, 0.0, 0.0])
    turns: Turns = Field([])

    @property
    def frame(self) -> Array:
        """The frame ``(4, 4)``, mm."""
        return frame(rotation(self.turns), self.position_mm)


class ClosureTable(Table):
    """Two frames of a machine that are held together, which closes a loop."""

    name: PartName
    source: str = ""
    between: Annotated[list[str], Field(min_length=2, max_length=2, description="two parts; '' is the base")]
    frames: Annotated[list[FrameTable], Field(min_length=2, max_length=2)] = Field(
        [FrameTable(), FrameTable()], description="from behind each part's end; from the world for the base"
    )
    holds: Literal["weld", "ball"] = Field("weld", description="all six components, or the place alone")

    def closure(self) -> Closure:
        """The closure that the table describes."""
        frames = np.array([one.frame for one in self.frames])
        return Closure(self.name, (self.between[0], self.between[1]), frames, turns=self.holds == "ball")


class TermTable(Table):
    """A joint's share in a coupling."""

    joint: PartName
    weight: float


class CouplingTable(Table):
    """A rigid transmission between passive joints: their weighted sum stays."""

    name: PartName
    source: str = ""
    terms: list[TermTable] = Field(min_length=2)
    total: float | None = Field(None, description="of the weighted coordinates, rad or mm; else that at home")

    def coupling(self, postures: Mapping[str, Mapping[str, float]]) -> Coupling:
        """The coupling that the table describes, of coordinates by label and joint, home first."""
        total, home = self.total, next(iter(postures.values()))
        if total is None:
            total = sum(term.weight * home.get(term.joint, 0.0) for term in self.terms)
        return Coupling(self.name, tuple((term.joint, term.weight) for term in self.terms), total)


class Workspace(Table):
    """A box of places of the end-effector: from home where the file gives poses, else in the world."""

    source: str = ""
    min_mm: VectorMM
    max_mm: VectorMM

    @property
    def corners(self) -> Array:
        """Corners ``(2, 3)``, mm."""
        return np.array([self.min_mm, self.max_mm])

    @model_validator(mode="after")
    def _ordered(self) -> Workspace:
        for axis, low, high in zip("xyz", self.min_mm, self.max_mm, strict=True):
            if low > high:
                raise ValueError(f"min_mm = {low:g} along {axis} is above max_mm = {high:g}: are they swapped?")
        return self


class CalibratedTable(Table):
    """What a calibration says of the file that it wrote."""

    not_for_use: list[str] = Field([], description="why it was written by force alone")
    valid_within: dict[PartName, Annotated[list[float], Field(min_length=2, max_length=2)]] = Field(
        {},
        description="ranges of joints, rad or mm, beyond which nothing tells how good it is",
    )

    @model_validator(mode="after")
    def _ordered(self) -> CalibratedTable:
        for joint, (low, high) in self.valid_within.items():
            if low > high:
                raise ValueError(
                    f"valid_within of '{joint}' begins at {low:g}, above its end {high:g}: are they swapped?"
                )
        return self


def displacement(label: str, numbers: list[float]) -> Array:
    """The displacement ``(6,)`` of a pose, mm and rad.

    Raises:
        ValueError: it has neither three nor six numbers, or a turn is likely in degrees.
    """
    if len(numbers) not in (3, 6):
        raise ValueError(f"pose '{label}' must have 3 entries (mm) or 6 (mm, rad), got {len(numbers)}")
    far = next((turn for turn in numbers[3:] if abs(turn) > LARGEST_TURN), None)
    if far is not None:
        raise ValueError(f"pose '{label}': a turn of {far:g} rad is beyond ±2π: is it in degrees?")
    return np.array(numbers + [0.0] * (6 - len(numbers)), dtype=float)


HEAVIEST = 1e7
"""kg: the heaviest machines that dig weigh 1.4e7 in all. What weighs too much for its size is doubted anyway."""
Mass = Annotated[float, Field(ge=0.0, le=HEAVIEST, description="kg")]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
CABLE_TRANSITION = 1e-6
"""Strain of a cable over which it becomes taut: a thousandth of what a cable of steel has at work, 0.1 %."""
Compliance = Annotated[float, Field(ge=0.0, le=1e3)]


class PartTable(Table):
    """What every part may have."""

    name: PartName
    source: str = ""
    after: str | None = Field(
        None, description="name of the part behind which this one begins, '' for the base; else the part before it"
    )


CALIBRATED = "calibrated: "
"""Begins the source of a part that a calibration made: its numbers were fitted, and no one typed them."""


class Offset(PartTable):
    """A rigid piece: shifted first, then turned."""

    kind: Literal["offset", "link"]
    translation_mm: Annotated[list[float], Field(min_length=3, max_length=3)] = Field([0.0, 0.0, 0.0])
    turns: Turns = Field([])
    mass_kg: Mass = 0.0
    centre_of_mass_mm: VectorMM | None = Field(None, description="in the frame where the piece begins")
    inertia_kg_mm2: InertiaKgMM2 | None = None

    @model_validator(mode="after")
    def _weighed(self) -> Offset:
        if self.inertia_kg_mm2 is not None and not self.mass_kg:
            raise ValueError("has inertia_kg_mm2 but no mass_kg: add it")
        if self.mass_kg and self.centre_of_mass_mm is None:
            raise ValueError("has mass_kg but no centre_of_mass_mm: add it, mm from where the part begins")
        return self

    def part(self) -> parts.RigidOffset:
        """The part that the table describes."""
        centre = None if self.centre_of_mass_mm is None else np.array(self.centre_of_mass_mm, dtype=float)
        return parts.RigidOffset(
            self.name,
            frame(rotation(self.turns), self.translation_mm),
            self.mass_kg,
            centre if self.mass_kg else None,
            None if self.inertia_kg_mm2 is None else inertia_matrix(self.inertia_kg_mm2),
        )


class PayloadTable(PartTable):
    """A mass on the body that the part before it ends on."""

    kind: Literal["payload"]
    mass_kg: Mass
    centre_of_mass_mm: VectorMM
    inertia_kg_mm2: InertiaKgMM2 | None = None

    def part(self) -> parts.RigidOffset:
        """The part that the table describes."""
        return parts.RigidOffset(
            self.name, np.eye(4), self.mass_kg, np.array(self.centre_of_mass_mm, dtype=float),
            None if self.inertia_kg_mm2 is None else inertia_matrix(self.inertia_kg_mm2),
        )  # fmt: skip


def _own_law(law: AnyLaw | None, table: PartTable, *keys: str, slides: bool) -> Law | None:
    """The law that a table says, if it says one; keys are those that say the same by one number."""
    for key in keys:
        if law is not None and getattr(table, key):
            raise ValueError(f"has a law and {key}, which say the same: give one of them")
    return None if law is None else law.law(slides=slides)


class ActuatorTable(PartTable):
    """A drive, held at its coordinate."""

    kind: Literal["actuator"]
    axis: Axis
    compliance_mm_per_N: Compliance = 0.0  # noqa: N815
    law: AnyLaw | None = Field(None, description="of its spring along its axis, in place of the compliance")

    @model_validator(mode="after")
    def _one_spring(self) -> ActuatorTable:
        _own_law(self.law, self, "compliance_mm_per_N", slides=True)
        return self

    def part(self) -> Joint:
        """The part that the table describes."""
        law = _own_law(self.law, self, slides=True)
        return Joint(self.name, self.axis, slides=True, fixed=True, compliance=self.compliance_mm_per_N, law=law)


class MountTable(PartTable):
    """What carries the chain and deflects along one axis or about it: a frame, a guide."""

    kind: Literal["mount"]
    axis: Axis
    compliance_mm_per_N: Compliance | None = Field(None, description="along its axis")  # noqa: N815
    compliance_rad_per_Nmm: Compliance | None = Field(  # noqa: N815
        None, description="about its axis through the chain frame's origin, of a mount that turns"
    )
    law: AnyLaw | None = Field(None, description="of its spring, in place of a compliance")
    motion: Literal["turns", "slides"] | None = Field(
        None, description="about its axis, or along it: of a mount with a law"
    )

    @model_validator(mode="after")
    def _one_way(self) -> MountTable:
        if self.law is not None:
            if self.motion is None:
                raise ValueError('has a law: add motion = "turns" or motion = "slides"')
            _own_law(self.law, self, "compliance_mm_per_N", "compliance_rad_per_Nmm", slides=self.slides)
            return self
        if self.motion is not None:
            raise ValueError("has motion, which is for a law: the compliance's key says how it moves")
        if (self.compliance_mm_per_N is None) == (self.compliance_rad_per_Nmm is None):
            has = "has no compliance" if self.compliance_mm_per_N is None else "slides and turns"
            raise ValueError(
                f"{has}: give compliance_mm_per_N, or compliance_rad_per_Nmm if it turns about its axis"
            )
        return self

    @property
    def slides(self) -> bool:
        """Whether it deflects along its axis."""
        return self.compliance_rad_per_Nmm is None if self.motion is None else self.motion == "slides"

    def part(self) -> Joint:
        """The part that the table describes."""
        compliance = self.compliance_mm_per_N if self.slides else self.compliance_rad_per_Nmm
        law = _own_law(self.law, self, slides=self.slides)
        return Joint(
            self.name, self.axis, self.slides, passive=True, fixed=True, compliance=compliance or 0.0, law=law
        )


class MovingTable(PartTable):
    """What joints have: an axis, how they move, limits, and the inertia of what is geared to them."""

    axis: Axis
    motion: Literal["turns", "slides"] = Field("turns", description="about the axis, or along it")
    limits_rad: Pair | None = None
    limits_mm: Pair | None = None
    rides_on: PartName | None = Field(
        None, description="beam along which it slides; its coordinate is where on the beam it is, from the root"
    )
    rotor_kg_mm2: float = Field(
        0.0, ge=0.0, le=1e12, description="inertia of the rotor times the squared gear ratio, for frequencies"
    )
    rotor_kg: float = Field(0.0, ge=0.0, le=1e6, description="the same of a joint that slides")
    law: AnyLaw | None = Field(
        None, description="of its spring about or along its axis, in place of a constant stiffness or compliance"
    )

    @field_validator("limits_rad", "limits_mm")
    @classmethod
    def _ordered(cls, limits: list[float] | None) -> list[float] | None:
        if limits is not None and limits[0] >= limits[1]:
            raise ValueError(f"= {limits} must be [lower, upper]")
        return limits

    @model_validator(mode="after")
    def _begins(self) -> MovingTable:
        if self.rides_on is not None and self.after is not None:
            raise ValueError("has after and rides_on: it begins on the beam, leave after out")
        return self

    @property
    def slides(self) -> bool:
        """Whether it slides along its axis."""
        return self.motion == "slides"

    @property
    def limits(self) -> tuple[float, float] | None:
        """Of the coordinate, mm or rad."""
        pair = self.limits_mm if self.slides else self.limits_rad
        return None if pair is None else (pair[0], pair[1])

    @property
    def rotor(self) -> float:
        """Inertia of what is geared to it, kg mm² where it turns, kg where it slides."""
        return self.rotor_kg if self.slides else self.rotor_kg_mm2

    @property
    def own_law(self) -> Law | None:
        """The law of its spring."""
        return _own_law(self.law, self, slides=self.slides)

    def refuse_two_springs(self, *keys: str) -> None:
        """Refuse a law beside what says the same by one number, and a law that is none.

        Raises:
            ValueError: naming both.
        """
        _own_law(self.law, self, *keys, slides=self.slides)

    def refuse_other_motion(self, *keys: tuple[str, str]) -> None:
        """Refuse keys of the other kind of motion; pairs are the key of a joint that turns and of one that slides.

        Raises:
            ValueError: one is given.
        """
        for turning, sliding in (("limits_rad", "limits_mm"), ("rotor_kg_mm2", "rotor_kg"), *keys):
            wrong, right = (turning, sliding) if self.slides else (sliding, turning)
            if getattr(self, wrong):
                raise ValueError(f"has {wrong}, but it {self.motion}: give {right}")


class ElasticJointTable(MovingTable):
    """A joint that is elastic about or along its axis, and across it."""

    compliance_rad_per_Nmm: Compliance = Field(0.0, description="about its axis, where it turns")  # noqa: N815
    compliance_mm_per_N: Compliance = Field(0.0, description="along its axis, where it slides")  # noqa: N815
    lateral_rad_per_Nmm: Pair = Field(  # noqa: N815
        [0.0, 0.0], description="about the two other axes in cyclic order: x and y of a joint about z"
    )

    @model_validator(mode="after")
    def _one_spring(self) -> ElasticJointTable:
        self.refuse_other_motion(("compliance_rad_per_Nmm", "compliance_mm_per_N"))
        if min(self.lateral_rad_per_Nmm) < 0.0:
            raise ValueError(f"has lateral_rad_per_Nmm = {self.lateral_rad_per_Nmm}: a compliance is zero or more")
        self.refuse_two_springs("compliance_rad_per_Nmm", "compliance_mm_per_N")
        return self

    @property
    def own(self) -> float:
        """Compliance about or along its axis."""
        return self.compliance_mm_per_N if self.slides else self.compliance_rad_per_Nmm


class ActuatedTable(ElasticJointTable):
    """A joint with a drive that holds the posture's coordinate; elastic about or along its axis, or all round."""

    kind: Literal["actuated"]
    compliance: Matrix6 | None = Field(
        None, description="in place of these: 6×6 in the chain frame behind the joint, mm/N, 1/N, rad/(N mm)"
    )

    @field_validator("compliance")
    @classmethod
    def _definite(cls, rows: list[list[float]] | None) -> list[list[float]] | None:
        return None if rows is None else checks.checked_part_compliance(np.array(rows, dtype=float)).tolist()

    @model_validator(mode="after")
    def _sane(self) -> ActuatedTable:
        if self.compliance is not None and (self.own or any(self.lateral_rad_per_Nmm)):
            raise ValueError("has a 6×6 compliance and another one: give one of them")
        if self.law is not None:
            # what couples its axis with others is refused here, where the file is known
            self.part()
        return self

    def part(self) -> Joint:
        """The part that the table describes."""
        first, second = self.lateral_rad_per_Nmm
        matrix = None if self.compliance is None else np.array(self.compliance, dtype=float)
        return Joint(
            self.name, self.axis, self.slides, compliance=self.own, lateral=(first, second), matrix=matrix,
            limits=self.limits, rotor=self.rotor, rides_on=self.rides_on or "", law=self.own_law,
        )  # fmt: skip


class JointTable(MovingTable):
    """A passive joint, free or with a spring."""

    kind: Literal["joint"]
    stiffness_Nmm_per_rad: float = Field(0.0, ge=0.0, le=1e15)  # noqa: N815
    stiffness_N_per_mm: float = Field(0.0, ge=0.0, le=1e12)  # noqa: N815
    preload_Nmm: float = Field(  # noqa: N815
        0.0, ge=-1e12, le=1e12, description="torque towards larger coordinates where the posture has the joint"
    )
    preload_N: float = Field(0.0, ge=-1e9, le=1e9)  # noqa: N815
    rest_rad: float | None = Field(None, description="coordinate at which the spring is free of stress")
    rest_mm: float | None = None

    @model_validator(mode="after")
    def _sane(self) -> JointTable:
        self.refuse_other_motion(
            ("stiffness_Nmm_per_rad", "stiffness_N_per_mm"), ("preload_Nmm", "preload_N"), ("rest_rad", "rest_mm")
        )
        prestressed = bool(self.preload_Nmm or self.preload_N) + (self.rest is not None)
        self.refuse_two_springs("stiffness_Nmm_per_rad", "stiffness_N_per_mm")
        if prestressed and not self.stiffness and self.law is None:
            key = "stiffness_N_per_mm" if self.slides else "stiffness_Nmm_per_rad"
            raise ValueError(f"has a preload or a rest position but no spring: add {key}")
        if prestressed > 1:
            raise ValueError("has a rest position and a preload, which say the same: give one")
        return self

    @property
    def stiffness(self) -> float:
        """Of its spring, zero where it has none."""
        return self.stiffness_N_per_mm if self.slides else self.stiffness_Nmm_per_rad

    @property
    def rest(self) -> float | None:
        """Where its spring is free of stress."""
        return self.rest_mm if self.slides else self.rest_rad

    def part(self) -> Joint:
        """The part that the table describes."""
        return Joint(
            self.name, self.axis, self.slides, passive=True,
            compliance=1.0 / self.stiffness if self.stiffness else 0.0,
            preload=self.preload_N if self.slides else self.preload_Nmm, rest=self.rest, limits=self.limits,
            rotor=self.rotor, rides_on=self.rides_on or "", law=self.own_law,
        )  # fmt: skip


class CoupledTable(ElasticJointTable):
    """A joint whose coordinate follows from others'."""

    kind: Literal["coupled"]
    to: dict[PartName, float] = Field(min_length=1, description="ratios to other joints by their names")
    offset_rad: float = 0.0
    offset_mm: float = 0.0
    coupling: Literal["as deflected", "as commanded"] = Field(
        "as deflected",
        description=(
            "whether what the others' springs add about their own axes is passed on, as by a belt between the "
            "joints' shafts. The bending of links is not passed on."
        ),
    )

    @model_validator(mode="after")
    def _sane(self) -> CoupledTable:
        self.refuse_other_motion(("offset_rad", "offset_mm"))
        if self.name in self.to:
            raise ValueError("is coupled to itself: name another joint")
        return self

    def part(self) -> Joint:
        """The part that the table describes."""
        first, second = self.lateral_rad_per_Nmm
        offset = self.offset_mm if self.slides else self.offset_rad
        return Joint(
            self.name, self.axis, self.slides, compliance=self.own, lateral=(first, second), limits=self.limits,
            rotor=self.rotor, rides_on=self.rides_on or "",
            coupling=JointCoupling(tuple(self.to.items()), offset, self.coupling == "as deflected"),
            law=self.own_law,
        )  # fmt: skip


class PointSpringTable(Table):
    """A spring between a point of one part and a point of another, such as a gravity compensator."""

    name: PartName
    source: str = ""
    between: Annotated[list[str], Field(min_length=2, max_length=2, description="two parts; '' is the base")]
    points_mm: Annotated[list[VectorMM], Field(min_length=2, max_length=2)] = Field(
        description="in the frames where the parts begin (of joints behind them); the world's for the base"
    )
    stiffness_N_per_mm: float | None = Field(None, ge=0.0, le=1e9)  # noqa: N815
    free_length_mm: float = Field(0.0, ge=0.0, le=1e5)
    preload_N: float = Field(0.0, ge=-1e9, le=1e9, description="at the free length, pulling the points together")  # noqa: N815
    cable: bool = Field(False, description="it only pulls; shorter than its free length it is slack")
    law: AnyLaw | None = Field(
        None, description="of its pull by its length beyond the free length, in place of a constant stiffness"
    )

    @model_validator(mode="after")
    def _one_law(self) -> PointSpringTable:
        if (self.stiffness_N_per_mm is None) == (self.law is None):
            raise ValueError("needs either stiffness_N_per_mm or a law, and not both")
        if self.cable and (self.law is not None or not self.free_length_mm or not self.stiffness_N_per_mm):
            raise ValueError("is a cable: give stiffness_N_per_mm and free_length_mm, both above zero, and no law")
        if self.cable and self.preload_N:
            raise ValueError("is a cable and has a preload: shorten free_length_mm by preload_N over its stiffness")
        return self

    @property
    def own_law(self) -> Law | None:
        """The law of its pull; of a cable that of a spring that only pulls."""
        if self.cable and self.stiffness_N_per_mm is not None:
            return OneSided(self.stiffness_N_per_mm, CABLE_TRANSITION * self.free_length_mm)
        return None if self.law is None else self.law.law(slides=True)

    def spring(self) -> PointSpring:
        """The spring that the table describes."""
        law = self.own_law
        return PointSpring(
            self.name, (self.between[0], self.between[1]), np.array(self.points_mm, dtype=float),
            0.0 if law is not None else self.stiffness_N_per_mm or 0.0, self.free_length_mm, self.preload_N, law,
        )  # fmt: skip


def _check_coordinate(label: str, joint: MovingTable, value: float) -> None:
    """Refuse a coordinate of a posture that is in another unit or beyond the joint's limits."""
    where = f"posture '{label}':"
    if not joint.slides:
        turned = said_turned(joint.name, value, passive=isinstance(joint, JointTable))
        if turned:
            raise ValueError(f"{where} {turned}")
    if joint.limits is not None:
        said = said_beyond(joint.name, value, joint.limits, "mm" if joint.slides else "rad")
        if said:
            raise ValueError(f"{where} out of reach: {said}")


def given_coordinates(
    label: str, posture: list[float] | dict[str, float], moving: list[MovingTable]
) -> dict[str, float]:
    """Coordinates by name of the joints that a posture has to give, every one checked.

    Raises:
        ValueError: too few, too many, unknown or implausible ones.
    """
    where, names = f"posture '{label}':", [joint.name for joint in moving]
    if isinstance(posture, list):
        if len(posture) != len(moving):
            named = f" ({', '.join(names)})" if names else ""
            what = "passive joints" if all(isinstance(joint, JointTable) for joint in moving) else "joints"
            raise ValueError(f"{where} {len(posture)} coordinates for {len(moving)} {what}{named}: give one each")
        posture = dict(zip(names, posture, strict=True))
    unknown, missing = sorted(set(posture) - set(names)), [name for name in names if name not in posture]
    if unknown:
        raise ValueError(f"{where} no joint '{unknown[0]}' to be given; it has {', '.join(names) or 'none'}")
    if missing:
        raise ValueError(f"{where} no coordinate for the joint '{missing[0]}': give one")
    for joint in moving:
        _check_coordinate(label, joint, posture[joint.name])
    return posture
