"""A part's compliance from its drawing: ``compliance = { from = "foot.step", ... }``.

Here are a part's matrix from its drawing, computed once and kept beside it; and what to know of such a part:
whether a beam is like it, and whether it may buckle by itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pydantic
from pydantic import Field, model_validator

from vjm.io.errors import ModelFileError, printed, validated
from vjm.io.fields import Density, Matrix6, Table, VectorMM
from vjm.io.findings import Grade
from vjm.io.provenance import Provenance, digest, suite
from vjm.io.schema import MAY_BE_RIGID, BeamTable, Form, ModelFile, known_keys, nearest_beam
from vjm.io.solid_provider import provided
from vjm.rotations import Array

LIKE = 0.05
"""Scaled difference of the nearest beam's compliance up to which it stands for the part."""
STUBBY = 20.0
"""Length over the larger radius of gyration below which plane sections do not stay plane: a depth of L/6."""
THIN = 15.0
"""Radius of gyration over the walls' thickness from which on a wall may buckle before the part does."""


def drawings(model: ModelFile) -> Iterator[tuple[Grade, str, str]]:
    """Parts from drawings."""
    for table in model.parts:
        if not isinstance(table, BeamTable) or table.drawing is None or table.compliance is None:
            continue
        where, near = f"part '{table.name}', compliance", nearest_beam(table.part())
        i, j = near.entry
        miss = f"the nearest beam misses ({i},{j}) by {printed(100.0 * near.worst, 2)} % of √(c_ii c_jj)"
        alike = near.worst <= LIKE
        if table.drawing.bodies > 1 and not table.drawing.bonded:
            text = bonded_bodies(table.drawing.bodies)
            yield Grade.DOUBTFUL, where, f"{text}: bonded = true in its table says that this is meant"
        if table.section is None:
            yield Grade.NOTED, where, _one_spring(table.drawing.buckling_N, miss, alike)
        elif not alike:
            yield (
                Grade.DOUBTFUL,
                f"{where}.as_beam",
                f"{miss}: leave as_beam out, or give root_mm and end_offset_mm",
            )
        if table.section is not None and near.length < STUBBY * near.gyration:
            yield (
                Grade.DOUBTFUL, f"{where}.as_beam",
                f"too stubby for a beam: {printed(near.length, 3)} mm long with a radius of gyration of "
                f"{printed(near.gyration, 3)} mm: leave as_beam out",
            )  # fmt: skip
        if alike and near.gyration > THIN * table.drawing.thickness_mm:
            yield (
                Grade.DOUBTFUL, where,
                f"walls of about {printed(table.drawing.thickness_mm, 3)} mm at a radius of gyration of "
                f"{printed(near.gyration, 3)} mm may buckle by themselves, which no spring or beam knows",
            )  # fmt: skip


def bonded_bodies(count: int) -> str:
    """What is said of a drawing with more than one body."""
    return f"{count} bodies, bonded, one material"


def _one_spring(force: float | None, miss: str, alike: bool) -> str:
    beam = "as_beam = true lets it" if alike else f"no uniform beam in this geometry is like the part ({miss})"
    if force is None:
        own = f"whether the part may is undecided, as it bends otherwise than a column of its own sections; {beam}"
        return f"one spring does not buckle by itself; {own}"
    return (
        f"one spring does not buckle by itself. The part as a column of its own sections, free at its tip, does at "
        f"{printed(force, 3)} N of compression; {beam}"
    )


PLACE = 1e-3
"""Distance of the drawing's tip from the table's over their distance from the base, up to which they agree."""


NOT_COMPUTED = {"from_", "density_kg_per_m3", "yield_stress_MPa", "as_beam", "root_mm", "bonded"}
"""Keys on which the computation does not depend."""


class SolidTable(Table):
    """A compliance from a drawing, in its axes, which are the part's own axes, at the tip's centre of area."""

    from_: str = Field(alias="from", min_length=1, description="the drawing, relative to the model file")
    youngs_modulus_MPa: float = Field(gt=0.0)  # noqa: N815
    poissons_ratio: float = Field(ge=0.0, lt=0.5)
    base: list[str] | str = Field(description="faces that are held: numbers, names, points or boxes, as text")
    tip: list[str] | str = Field(description="faces that are loaded")
    tip_moves: Literal["rigid", "spread"] = Field("rigid", description="as one body, or loaded by a traction")
    base_held: Literal["clamped", "mean"] = "clamped"
    unit_mm: float = Field(1.0, gt=0.0, description="mm of one unit of the drawing")
    accuracy_percent: float = Field(0.5, ge=0.01, le=20.0)
    density_kg_per_m3: Density | None = Field(None, description="gives the part its weight")
    yield_stress_MPa: float | None = Field(  # noqa: N815
        None, gt=0.0, description="lets commands say where the part would yield"
    )
    bonded: bool = Field(False, description="bodies that touch are meant to be one, of one material")
    as_beam: bool = Field(
        False, description="a uniform beam of the table's geometry in its place, which can buckle by itself"
    )
    root_mm: VectorMM = Field(
        [0.0, 0.0, 0.0], description="where the part begins, own axes from the base: what is before is rigid"
    )

    @model_validator(mode="after")
    def _plausible_yield(self) -> SolidTable:
        E, limit = self.youngs_modulus_MPa, self.yield_stress_MPa
        if limit is not None and limit > 0.1 * E:
            raise ValueError(
                f"has yield_stress_MPa = {printed(limit)}, above a tenth of youngs_modulus_MPa = {printed(E)}: is "
                "one of them in another unit? Write both in MPa"
            )
        return self

    def made_of(self, drawing: bytes) -> Provenance:
        """What a result is made of: the drawing, all settings that the computation needs, and this program.

        The versions of what meshes and solves are left out: the result's interval covers what they change, and who
        has none of them can read what another has computed.
        """
        settings = self.model_dump(exclude=NOT_COMPUTED)
        return Provenance({"drawing": digest(drawing)} | suite()).asked(**settings)


class SolidResult(pydantic.BaseModel):
    """What is kept beside a drawing."""

    drawing: str
    compliance: Matrix6
    interval: Matrix6
    """Half of it, of every entry."""
    reach_mm: VectorMM
    """From the base's centre of area to the tip's."""
    unknowns: int
    """Of the finest mesh."""
    volume_mm3: float
    centre_of_mass_mm: VectorMM
    """From the base's centre of area."""
    thickness_mm: float
    bodies: int
    """That the drawing holds, bonded where they touch."""
    buckling_N: float | None  # noqa: N815
    """Compression under which it buckles as a column of its own sections, free at its tip; None where undecided."""
    stress_at_mm: list[VectorMM]
    """From the base's centre of area."""
    stress_forms: list[Form]
    """See `vjm.io.schema.DrawnTable`."""


def solid_key_schema() -> dict[str, Any]:
    """JSON Schema of the key's table."""
    return SolidTable.model_json_schema(by_alias=True)


def expanded(content: Mapping[str, Any], folder: Path, file: str) -> tuple[dict[str, Any], dict[str, str]]:
    """A model document with every compliance from a drawing as numbers, and the SHA-256 of each drawing by name.

    Raises:
        ModelFileError: a wrong table, no such drawing, or no matrix from it.
    """
    parts = content.get("parts")
    if not isinstance(parts, list):
        return dict(content), {}
    _check_rest(content, parts, file)
    drawings: dict[str, str] = {}
    return {**content, "parts": [_part(part, drawings, folder, file, i) for i, part in enumerate(parts)]}, drawings


def _check_rest(content: Mapping[str, Any], parts: list[Any], file: str) -> None:
    """Refuse what is wrong with a document beside its drawings, before any of these is computed.

    A part has any section here in the place of its drawing.
    """
    drawn = [isinstance(part, dict) and isinstance(part.get("compliance"), dict) for part in parts]
    if not any(drawn):
        return
    stiff = {"EA_N": 1e7, "GJ_Nmm2": 1e9, "EIy_Nmm2": 1e9, "EIz_Nmm2": 1e9}
    rest = [
        {"section": stiff} | {key: value for key, value in part.items() if key != "compliance"} if own else part
        for part, own in zip(parts, drawn, strict=True)
    ]
    validated(ModelFile, {**content, "parts": rest}, file, known_keys, {MAY_BE_RIGID})


def _part(part: Any, drawings: dict[str, str], folder: Path, file: str, place: int) -> Any:  # noqa: ANN401
    table = part.get("compliance") if isinstance(part, dict) else None
    if not isinstance(table, dict):
        return part
    named = f"'{part['name']}'" if "name" in part else place + 1
    where = f"{file}: part {named}: compliance"
    known = [field.alias or name for name, field in SolidTable.model_fields.items()]
    solid = validated(SolidTable, table, where, lambda _: known)
    try:
        raw = (folder / solid.from_).read_bytes()
    except OSError as error:
        raise ModelFileError(f"{where}: from = '{solid.from_}': cannot be read: {error.strerror}") from error
    drawings[solid.from_] = digest(raw)
    result = _result(folder / solid.from_, raw, solid, where)
    source = part.get("compliance_source") or f"{solid.from_} by solid finite elements, {result.unknowns} unknowns"
    places = (np.array(result.stress_at_mm).reshape(-1, 3) - np.array(solid.root_mm)).tolist()
    drawn = {"file": solid.from_, "bonded": solid.bonded, "stress_at_mm": places}
    drawn |= result.model_dump(include={"thickness_mm", "bodies", "stress_forms", "buckling_N"}, exclude_none=True)
    drawn |= solid.model_dump(include={"yield_stress_MPa"}, exclude_none=True)
    numbers = {**part, "compliance": result.compliance, "compliance_source": source, "drawing": drawn}
    _check_tip(numbers, np.array(result.reach_mm), np.array(solid.root_mm), where)
    if solid.as_beam:
        numbers["section"] = _as_beam(numbers, where)
    return _with_weight(numbers, solid, result, where)


def _as_beam(part: Mapping[str, Any], where: str) -> dict[str, float]:
    """The table of the nearest beam's section; empty where the part itself is wrong, which is said elsewhere."""
    for key in ("section", "segments"):
        if key in part:
            raise ModelFileError(f"{where}: as_beam = true: the part has {key} already: leave one of them out")
    try:
        section = nearest_beam(BeamTable.model_validate(part).part()).section
    except pydantic.ValidationError:
        return {}
    table = {"EA_N": section.EA, "GJ_Nmm2": section.GJ, "EIy_Nmm2": section.EIy, "EIz_Nmm2": section.EIz}
    shear = {"GAy_N": section.GAy, "GAz_N": section.GAz}
    return table | {key: value for key, value in shear.items() if np.isfinite(value)}


def _with_weight(part: dict[str, Any], solid: SolidTable, result: SolidResult, where: str) -> dict[str, Any]:
    """The part with its mass: spread along a section where it has one, else at its centre."""
    if solid.density_kg_per_m3 is None:
        return part
    if "mass_kg" in part or (isinstance(part.get("section"), dict) and "density_kg_per_m3" in part["section"]):
        raise ModelFileError(f"{where}: density_kg_per_m3: the part has a mass already: leave one of them out")
    # of one member, as the drawing is
    part["mass_kg"] = 1e-9 * solid.density_kg_per_m3 * result.volume_mm3 * int(part.get("count", 1))
    if "section" not in part:
        part["centre_of_mass_mm"] = (np.array(result.centre_of_mass_mm) - np.array(solid.root_mm)).tolist()
    return part


def kept_file(drawing: Path, made_of: Provenance) -> Path:
    """Where the result of a drawing is kept: beside it."""
    return drawing.with_name(f"{drawing.name}.{made_of.key[:12]}.json")


def _result(drawing: Path, raw: bytes, solid: SolidTable, where: str) -> SolidResult:
    made_of = solid.made_of(raw)
    kept = kept_file(drawing, made_of)
    if (content := made_of.kept(kept)) is not None:
        return SolidResult.model_validate(content)
    compute = provided()
    if compute is None:
        raise ModelFileError(
            f"{where}: {kept.name} is not beside the drawing: run `validate check` on this file, which computes it"
        )
    try:
        result = compute(drawing, solid)
    except (ValueError, ImportError, MemoryError) as error:
        raise ModelFileError(f"{where}: {error}") from error
    try:
        made_of.keep(kept, result.model_dump())
    except OSError as error:
        raise ModelFileError(f"{where}: {kept}: cannot be written: {error.strerror}") from error
    return result


def _check_tip(part: Mapping[str, Any], reach: Array, root: Array, where: str) -> None:
    """Refuse a table whose tip is elsewhere than the drawing's."""
    try:
        beam = BeamTable.model_validate(part).part()
    except pydantic.ValidationError:
        return  # said where the whole file is checked
    own = root + beam.own_frame.T @ beam.tip
    if float(np.linalg.norm(own - reach)) > PLACE * float(np.linalg.norm(reach)):
        keys = "section_axes, end_offset_mm and root_mm" if root.any() else "section_axes and end_offset_mm"
        raise ModelFileError(
            f"{where}: the drawing's tip lies at {_listed(reach)} mm from its base. "
            f"length_mm, {keys} put it at {_listed(own)} in the part's own axes: make them equal"
        )


def _listed(vector: Array) -> str:
    return "[" + ", ".join(printed(0.0 if abs(value) < 1e-6 else float(value), 5) for value in vector) + "]"
