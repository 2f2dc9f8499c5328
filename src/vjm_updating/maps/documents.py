"""The JSON files of a map's folder."""

from __future__ import annotations

from pydantic import Field

from vjm_output.documents import DoubtRow, Row


class MapDocument(Row):
    """``map.json``: what was asked."""

    model: str
    model_sha256: str
    version: str
    engine: str
    quantity: str
    columns: list[str]
    """Of ``map.csv``, between the place and its status."""
    grid: dict[str, list[float]]
    """Values of joints, mm or rad, or of the end's x, y and z, mm: from home for a machine with poses."""
    posture: str
    """That gives what the grid leaves out."""
    end: str
    """Name of the end frame; empty for the first."""
    wrench: list[float]
    """On the end, N and N mm."""
    gravity: list[float] | None
    """m/s²."""
    loads: list[str]
    """On parts."""
    most_N: float  # noqa: N815
    """Largest force tried for a critical one."""
    made_of: dict[str, str]
    """All that determines the answers: SHA-256 of files by name, options and versions."""
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""
