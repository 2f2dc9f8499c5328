"""Beam paths in TOML: pieces with a section at the root, perhaps another one at the end, and turns between them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Literal

import pydantic
from pydantic import Field, model_validator

from vjm.io.errors import ModelFileError, one_line
from vjm.io.schema import Label, Turn, Turns, Units, rotation
from vjm.io.sections import LengthMM, StiffnessSection, Table
from vjm.io.shapes import SHAPES, AnySection
from vjm.model import parts
from vjm_updating.identify.beam_path import BeamPath, BeamPathPiece


class PieceTable(Table):
    """A straight piece; between two sections of one shape every dimension runs linearly."""

    source: str = ""
    length_mm: LengthMM
    turns: Turns = Field([], description="from the axes of the piece before, x along the piece")
    section: AnySection = Field(description="at the root; all along where there is no end_section")
    end_section: AnySection | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> PieceTable:
        if self.end_section is not None:
            if type(self.end_section) is not type(self.section):
                raise ValueError("has a section and an end_section of different shapes: give both the same keys")
            for key, value in self.section:
                if (value is None) != (getattr(self.end_section, key) is None):
                    raise ValueError(f"has {key} in one of section and end_section only: give it in both")
        return self

    def section_at(self, fraction: float) -> parts.Section:
        """The section at a fraction of the length."""
        if self.end_section is None:
            return self.section.stiffness()
        between = {
            key: (1.0 - fraction) * value + fraction * getattr(self.end_section, key)
            for key, value in self.section
            if isinstance(value, float)
        }
        return self.section.model_copy(update=between).stiffness()

    def piece(self) -> BeamPathPiece:
        """The piece that the table describes."""
        return BeamPathPiece(self.length_mm, self.section_at, rotation(self.turns))


class PathFile(Table):
    """A beam path, clamped at the root of its first piece."""

    format: Literal[1]
    name: Label
    title: str = Field(min_length=1)
    source: str = Field(min_length=1)
    units: Units
    pieces: list[PieceTable] = Field(min_length=1)

    def path(self) -> BeamPath:
        """The path that the file describes."""
        return BeamPath(self.name, tuple(piece.piece() for piece in self.pieces))


_TABLES: dict[str, type[Table]] = {
    "": PathFile,
    "piece": PieceTable,
    "units": Units,
    "turn": Turn,
    "stiffness": StiffnessSection,
    **SHAPES,
}


def is_path(content: Mapping[str, Any]) -> bool:
    """Whether a TOML document is a beam path and not a model."""
    return "pieces" in content


def build_path(content: Mapping[str, Any], file: str) -> BeamPath:
    """The path of a TOML document.

    Raises:
        ModelFileError: one line that names the file, the key and the remedy.
    """
    try:
        return PathFile.model_validate(content).path()
    except pydantic.ValidationError as error:
        raise ModelFileError(f"{file}: {one_line(error, content, _keys)}") from error


def _keys(table: str) -> Iterable[str]:
    # what a section's table must not hold may belong above it
    return list(_TABLES["piece" if table == "beam" else table].model_fields)
