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
    """Of ``map.csv``, between the pose and its status."""
    grid_mm: list[list[float]]
    """Coordinates along x, y and z, from home."""
    wrench: list[float]
    """On the platform, N and N mm."""
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
