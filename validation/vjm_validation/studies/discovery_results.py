"""What the suite's own discovery is as rows and curves, see `vjm_validation.studies.link_lumping_discovery`."""

from __future__ import annotations

from dataclasses import dataclass

from vjm.continuation.path import Path
from vjm.rotations import Array
from vjm_output.documents import Row
from vjm_updating.diagnosis.document import CriticalPointRow, FoldRow

CAUSE = "link_lumping"
"""What the data hold and the sheet lacks."""


class Discovery(Row):
    """The discovery as ``summary.json`` has it; N."""

    verdict: str
    causes: list[str]
    confidence: float
    held_out: list[FoldRow]
    """Tension predicted from compression, and compression from tension."""
    critical: list[CriticalPointRow]
    truth_N: float | None  # noqa: N815
    """Critical force in compression of the finite elements that made the data, which no reading reached."""
    readings: int
    seconds: float
    """Of the diagnosis."""

    @property
    def error(self) -> float:
        """Of compression held out, over its force."""
        fold = next((fold for fold in self.held_out if fold.name == "compression"), None)
        return float("inf") if fold is None else fold.rmse_after / fold.force

    @property
    def tension(self) -> CriticalPointRow:
        """Critical forces in tension."""
        return next(row for row in self.critical if row.direction == "tension")

    @property
    def compression(self) -> CriticalPointRow:
        """And in compression."""
        return next(row for row in self.critical if row.direction == "compression")


@dataclass(frozen=True)
class DiscoveryStudy:
    """Rows and curves.

    Attributes:
        rows: what was found.
        page: the diagnosis, relative to the run's folder.
        displacement: as read ``(n,)`` mm.
        force: as read ``(n,)`` N.
        nominal: the sheet's model, in tension and compression.
        extended: the extended model file, likewise.
    """

    rows: Discovery
    page: str
    displacement: Array
    force: Array
    nominal: tuple[Path, Path]
    extended: tuple[Path, Path]
