"""``compliance = { from = "foot.step", ... }``: a part's matrix from its drawing, computed once and kept beside it.

Whoever computes is registered, see `vjm.io.solid_provider`: the finite elements are another package's.
What is kept is found by the content of the drawing and by everything else that the matrix depends on.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pydantic
from pydantic import Field

from vjm.io.errors import ModelFileError, one_line, printed
from vjm.io.fields import Matrix6, VectorMM
from vjm.io.files import write_whole
from vjm.io.schema import BeamTable
from vjm.io.sections import Table
from vjm.io.solid_provider import provided
from vjm.rotations import Array

PLACE = 1e-3
"""Distance of the drawing's tip from the table's over their distance from the base, up to which they agree."""


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

    def key(self, drawing: bytes) -> str:
        """What tells this matrix from others: the drawing's content and all settings but the file's name."""
        settings = json.dumps(self.model_dump(exclude={"from_"}), sort_keys=True)
        return hashlib.sha256(hashlib.sha256(drawing).digest() + settings.encode()).hexdigest()


class SolidResult(pydantic.BaseModel):
    """What is kept beside a drawing."""

    format: Literal[1] = 1
    key: str
    drawing: str
    compliance: Matrix6
    interval: Matrix6
    """Half of it, of every entry."""
    reach_mm: VectorMM
    """From the base's centre of area to the tip's."""
    unknowns: int
    """Of the finest mesh."""


def solid_key_schema() -> dict[str, Any]:
    """JSON Schema of the key's table."""
    return SolidTable.model_json_schema(by_alias=True)


def expanded(content: Mapping[str, Any], folder: Path, file: str) -> dict[str, Any]:
    """A model document with every compliance from a drawing as numbers.

    Args:
        content: as TOML gives it; not changed.
        folder: of the model file.
        file: its name, for messages.

    Raises:
        ModelFileError: a wrong table, no such drawing, or no matrix from it.
    """
    parts = content.get("parts")
    if not isinstance(parts, list):
        return dict(content)
    return {**content, "parts": [_part(part, content, folder, file, i) for i, part in enumerate(parts)]}


def _part(part: Any, content: Mapping[str, Any], folder: Path, file: str, place: int) -> Any:  # noqa: ANN401
    table = part.get("compliance") if isinstance(part, dict) else None
    if not isinstance(table, dict):
        return part
    where = (
        f"{file}: part '{part['name']}': compliance" if "name" in part else f"{file}: part {place + 1}: compliance"
    )
    try:
        solid = SolidTable.model_validate(table)
    except pydantic.ValidationError as error:
        known = [field.alias or name for name, field in SolidTable.model_fields.items()]
        raise ModelFileError(f"{where}: {one_line(error, table, lambda _: known)}") from error
    result = _result(folder / solid.from_, solid, where)
    source = part.get("compliance_source") or f"{solid.from_} by solid finite elements, {result.unknowns} unknowns"
    numbers = {**part, "compliance": result.compliance, "compliance_source": source}
    _check_tip(numbers, np.array(result.reach_mm), where)
    return numbers


def _result(drawing: Path, solid: SolidTable, where: str) -> SolidResult:
    try:
        raw = drawing.read_bytes()
    except OSError as error:
        raise ModelFileError(f"{where}: from = '{solid.from_}': cannot be read: {error.strerror}") from error
    key = solid.key(raw)
    kept = drawing.with_name(f"{drawing.name}.{key[:12]}.json")
    try:
        result = SolidResult.model_validate_json(kept.read_bytes())
        if result.key == key:
            return result
    except (OSError, pydantic.ValidationError):
        pass  # not computed yet, or not by this version
    compute = provided()
    if compute is None:
        raise ModelFileError(
            f"{where}: {kept.name} is not beside the drawing: run `validate check` on this file, which computes it"
        )
    try:
        result = compute(drawing, solid, key)
    except (ValueError, ImportError, MemoryError) as error:
        raise ModelFileError(f"{where}: {error}") from error
    try:
        write_whole(kept, result.model_dump_json(indent=1) + "\n")
    except OSError as error:
        raise ModelFileError(f"{where}: {kept}: cannot be written: {error.strerror}") from error
    return result


def _check_tip(part: Mapping[str, Any], reach: Array, where: str) -> None:
    """Refuse a table whose tip is elsewhere than the drawing's."""
    try:
        beam = BeamTable.model_validate(part).part()
    except pydantic.ValidationError:
        return  # said where the whole file is checked
    own = beam.own_frame.T @ beam.tip
    if float(np.linalg.norm(own - reach)) > PLACE * float(np.linalg.norm(reach)):
        raise ModelFileError(
            f"{where}: the drawing's tip lies at {_listed(reach)} mm from its base, and length_mm, section_axes "
            f"and end_offset_mm put it at {_listed(own)} in the part's own axes: make them equal"
        )


def _listed(vector: Array) -> str:
    return "[" + ", ".join(printed(0.0 if abs(value) < 1e-6 else float(value), 5) for value in vector) + "]"
