"""Beams that turn corners and taper: straight pieces one behind the other, and their file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pydantic
from pydantic import Field, model_validator

from vjm.io.errors import ModelFileError, one_line
from vjm.io.schema import Label, Turn, Turns, Units, rotation
from vjm.io.sections import LengthMM, StiffnessSection, Table
from vjm.io.shapes import SHAPES, AnySection
from vjm.model import parts
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Part, RigidOffset, Section
from vjm.rotations import Array, frame, rotate_matrix6, shift_compliance
from vjm_updating.constants import numerical
from vjm_updating.identify.experiments import POSTURE, Specimen

# --- A beam that turns corners and tapers: straight pieces one behind the other, each with sections of its own ----

PANELS, POINTS = numerical(16), numerical(8)
"""Gauss's rule along a piece: to rounding for any taper that a machine has."""


@dataclass(frozen=True)
class BeamPathPiece:
    """A straight piece.

    Attributes:
        length: mm.
        section: at a fraction of the length, 0 at the root and 1 at the end.
        turn: rotation ``(3, 3)`` of its axes, x along the piece, against those of the piece before it.
    """

    length: float
    section: Callable[[float], Section]
    turn: Array = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True)
class BeamPath:
    """Pieces from a clamped root to a tip.

    Attributes:
        name: for people.
        pieces: one behind the other; the first one's turn counts from the axes of the compliance.
    """

    name: str
    pieces: tuple[BeamPathPiece, ...]

    def chain(self, steps: int) -> Machine:
        """The path with every piece in ``steps`` uniform beams, each with the section at its middle.

        The compliance errs by 1/steps², as the midpoint rule does, and not at all where no piece tapers.
        """
        parts: list[Part] = []
        for i, piece in enumerate(self.pieces):
            parts.append(RigidOffset(f"turn{i}", frame(piece.turn)))
            parts += [
                Beam(f"piece{i}-{k}", piece.length / steps, section=piece.section((k + 0.5) / steps))
                for k in range(steps)
            ]
        return Machine(self.name, tuple(parts), postures={POSTURE: np.zeros(0)})

    def compliance(self) -> Array:
        """Compliance ``(6, 6)`` at the tip, base axes: beam theory's integral ``∫ Gᵀ c(s) G ds`` along the path."""
        where, R, p = [], np.eye(3), np.zeros(3)
        for piece in self.pieces:
            R = R @ piece.turn
            where.append((R, p))
            p = p + piece.length * R[:, 0]
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        C = np.zeros((6, 6))
        for piece, (R, root) in zip(self.pieces, where, strict=True):
            for panel in range(PANELS):
                for node, weight in zip(nodes, weights, strict=True):
                    at = (panel + 0.5 * (node + 1.0)) / PANELS
                    s = piece.section(at)
                    c = np.diag(1.0 / np.array([s.EA, s.GAy, s.GAz, s.GJ, s.EIy, s.EIz]))
                    ds = 0.5 * weight * piece.length / PANELS
                    C += shift_compliance(rotate_matrix6(ds * c, R), p - root - at * piece.length * R[:, 0])
        return C

    def specimen(self) -> Specimen:
        """The path to make experiments on: the mesh and the taper's steps are refined together."""
        return Specimen(self.name, "the path's own", lambda n: (self.chain(n), 1), self.compliance())


# --- Beam paths in TOML: pieces with a section at the root, perhaps another one at the end, and turns between them-


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
