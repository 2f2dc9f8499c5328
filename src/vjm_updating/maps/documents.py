"""The JSON files of a map's folder."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

from vjm_output.documents import DoubtRow


class MapDocument(BaseModel):
    """``map.json``: what was asked; two maps with the same one are the same."""

    model_config = ConfigDict(frozen=True)

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
    doubts: list[DoubtRow] = []
    """What is implausible about the model."""


class MapTaskDocument(BaseModel):
    """``tasks/*.json``: the answers at some poses, which a run that was cut off uses again."""

    model_config = ConfigDict(frozen=True)

    map: str
    """SHA-256 of the ``map.json`` that it belongs to."""
    values: list[list[float | None]]
    """One row a pose; null where there is no answer."""
    why: list[str]
    """``ok``, or why there is none."""
    names: list[tuple[str, str]]
    """Of a map of the shares: the part and the kind of what deflects, one a pose."""
