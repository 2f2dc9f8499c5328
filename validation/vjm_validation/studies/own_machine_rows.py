"""What a run on a user's own machine holds: the content of its ``summary.json``."""

from __future__ import annotations

from pydantic import Field

from vjm.continuation.path import EventKind
from vjm_output.documents import DoubtRow, Row
from vjm_validation.acceptance import AcceptanceRow
from vjm_validation.documents import MapRowsDocument, SensitivityDocument, SharesRow


class EndStiffnessRow(Row):
    """How stiff the free end is in one posture: force over the deflection along it, nothing else held."""

    posture: str
    end: str
    """Name of the end frame; empty where the machine names none."""
    load: str
    """``none`` or ``weight``."""
    along: list[float | None]
    """Along x, y, z in N/mm and about them in N mm/rad, world axes; null where nothing deflects."""


class LoadRow(Row):
    """One load path of one engine."""

    posture: str
    direction: str
    engine: str
    K0: float | None
    """N/mm along the direction, at its beginning; null where nothing deflects along it."""
    K_end: float | None
    """Likewise at its end."""
    force: float
    """N at its end."""
    moved: list[float]
    """Of the end-effector from the beginning of the path: mm, and rotation vector in rad, world axes."""
    difference: float | None
    """Largest difference of ``moved``, turns times the machine's size, or of the force where the pose is imposed,
    to finite elements, over its size; null for themselves and without them."""
    stopped: str
    """Why the path ends before; empty where it does not."""


class CriticalRow(Row):
    """The first critical point of one engine under a growing load."""

    posture: str
    direction: str
    engine: str
    kind: EventKind | None
    """Null: none up to the largest load tried."""
    F_cr: float | None
    """N, a magnitude."""
    d_cr: float | None
    """mm along the direction."""
    largest: float
    """N that was reached."""
    stopped: str


class ConvergenceRow(Row):
    """One quantity with a number of springs in every beam."""

    posture: str
    direction: str
    quantity: str
    """Critical force in N, or deflection in mm."""
    springs: int
    value: float
    error: float
    """Relative, to the value with the most springs."""


class FrequencyRow(Row):
    """One natural frequency in one posture."""

    posture: str
    mode: int
    """Counted from 1, the lowest first."""
    frequency_Hz: float  # noqa: N815
    growth_per_s: float
    """By which its amplitude grows; zero for a stable machine."""
    largest_at: str
    """The part, and the fraction of its length, that moves most."""


class OwnMachineSummary(Row):
    """The content of ``summary.json`` of a run on one's own machine; N, mm, rad."""

    command: str
    model: str
    control: str
    """``free``: dead forces on the free end; ``held``: its pose is imposed along the direction, the rest held."""
    gravity: list[float] | None
    """m/s²."""
    stiffness: list[EndStiffnessRow]
    loads: list[LoadRow]
    critical: list[CriticalRow]
    convergence: list[ConvergenceRow]
    elements: float | None
    """The quantity of ``convergence`` by finite elements; null without them."""
    shares: list[SharesRow]
    """Of every part in the deflection, posture by posture, under a hundredth of the force along its least stiff
    direction."""
    shares_along: dict[str, str]
    """That direction by posture."""
    modes: list[FrequencyRow]
    """The lowest natural frequencies without a force on the end, under the weight where it acts."""
    sensitivity: SensitivityDocument | None
    """Of the stiffness in the least stiff posture and direction
    to the numbers of the model file; null without one."""
    map: MapRowsDocument | None
    """Of the stiffness about one posture; null without one."""
    acceptance: list[AcceptanceRow]
    seconds: float
    versions: dict[str, str]
    made_of: dict[str, str]
    """All that determines the run: SHA-256 of files by name, options and versions."""
    hashes: dict[str, str]
    notes: list[str]
    """What was left out of this run, and why."""
    doubts: list[DoubtRow] = Field(default=[])
    """What is implausible about the model."""
