"""``summary.json``: the numbers of a run, and the schema that they keep to."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from pydantic import Field

from vjm.continuation.path import EventKind
from vjm.io.provenance import OtherInputsError, Provenance, digest
from vjm.statics.equilibrium import TOLERANCE
from vjm_output import terminal
from vjm_output.documents import Row, versions
from vjm_validation.acceptance import AcceptanceRow
from vjm_validation.metrics import PathMetrics, path_metrics
from vjm_validation.studies.discovery_results import Discovery
from vjm_validation.studies.iterations import LIMIT, LOOSE, NOISE, STEP_MM
from vjm_validation.studies.printed_matrices import PrintedMatrices
from vjm_validation.studies.robots import Robots
from vjm_validation.studies.study_results import Run
from vjm_validation.studies.table2 import PublishedFigure
from vjm_validation.verification.judging import TriangulationRow, VerificationRow
from vjm_validation.verification.study import Verification


class LumpingRow(Row):
    """Critical force of one lumped bar, or null where the path has no bifurcation."""

    posture: str
    direction: str
    placement: str
    springs: int
    F_cr: float | None
    reference: float | None


class EndConditionRow(Row):
    """Compression of one posture under one end condition, N and mm, magnitudes along x."""

    posture: str
    condition: str
    engine: str
    critical: EventKind | None
    F_cr: float | None
    d_cr: float | None
    F_max: float
    """Largest force on the path, which under a dead load ends where that has a maximum or a minimum."""
    stopped: str


class ImperfectionRow(Row):
    """Largest dead load on a hinged end-effector that a chain with an imperfection bears."""

    posture: str
    size: float
    """mm, of the deflection in the shape of the buckling mode."""
    F_max: float
    limit: bool
    """Whether that is a limit point; else the force grows to the path's end."""


class IterationRow(Row):
    """Iterations to one equilibrium on the paper's path; null where the solver did not get there."""

    posture: str
    direction: str
    s: float
    force: float
    contraction: float
    """By what (13) multiplies a small error there."""
    predicted: float | None
    """F/F_cr, before a bifurcation."""
    paper: int | None
    """By (13) from the neighbouring point."""
    paper_loose: int | None
    disturbed: int | None
    """By (13) from a disturbed start."""
    disturbed_loose: int | None
    newton: int | None
    """By Newton-Raphson from the neighbouring point."""
    newton_loose: int | None


class Iterations(Row):
    """How many iterations the paper's (13) and Newton-Raphson take along the paper's paths."""

    tolerance: float = TOLERANCE
    """Scaled residual to which an equilibrium is found."""
    loose_tolerance: float = LOOSE
    """The same for the columns that end in ``_loose``."""
    limit: int = LIMIT
    """Iterations after which a solver has failed."""
    step: float = STEP_MM
    """Distance of the start from the point sought."""
    noise: float = NOISE
    """Standard deviation of the disturbed start, in units of the model's coordinates."""
    rows: list[IterationRow]


class Timings(Row):
    """Seconds of wall time."""

    paths: dict[str, float]
    """Of each path, by the name of its files."""
    engines: dict[str, float]
    """Of all paths of an engine."""
    total: float


class Summary(Row):
    """The content of ``summary.json``; N, mm."""

    command: str
    """How to run it again."""
    chain: dict[str, dict[str, dict[str, PathMetrics]]]
    """By posture, ``tension`` or ``compression``, and engine label."""
    published: list[PublishedFigure]
    lumping: list[LumpingRow]
    end_conditions: list[EndConditionRow]
    imperfections: list[ImperfectionRow]
    matrices: PrintedMatrices | None
    """The printed matrices as beams and Table II; null where they were left out."""
    robots: Robots | None = None
    """Whole robots beside Exudyn's; null where they were left out."""
    discovery: Discovery | None = None
    """A diagnosis of finite elements' data under the paper's model; null where it was left out."""
    iterations: Iterations | None
    """Null where they were left out."""
    verification: list[VerificationRow]
    """Cases with known answers, on every engine."""
    triangulation: list[TriangulationRow] = Field(default_factory=list)
    """The paper's chain on every pair of engines."""
    acceptance: list[AcceptanceRow]
    timings: Timings
    versions: dict[str, str]
    made_of: dict[str, str]
    """All that determines the run: SHA-256 of files by name, options and versions."""
    hashes: dict[str, str]
    """SHA-256 of every curve file, by name."""
    notes: list[str] = Field(default_factory=list)
    """What was left out of this run, and why."""


SHOWN = ("summary.json", "index.html", "report.pdf", "findings.md", "curves/*.csv", "figures/*.*", "renders/*.*")
"""What a run shows at its end."""


def discard_outdated(folder: Path, made_of: Provenance) -> None:
    """Remove what an earlier run of other inputs shows in a folder, before another one is begun there."""
    file = folder / SHOWN[0]
    if not file.exists():
        return
    try:
        earlier = json.loads(file.read_bytes())["made_of"]
    except (ValueError, LookupError, TypeError):
        earlier = None
    try:
        made_of.check(earlier, f"{file}: is of another run", "it is made anew")
    except OtherInputsError as error:
        terminal.error(str(error))
        for shown in (found for pattern in SHOWN for found in folder.glob(pattern)):
            shown.unlink()


def summarise(
    run: Run,
    *,
    command: str,
    made_of: Provenance,
    published: Sequence[PublishedFigure],
    verification: Verification,
    acceptance: Sequence[AcceptanceRow],
    curves: dict[str, bytes],
    seconds: float,
    notes: Sequence[str] = (),
) -> Summary:
    """Gather a run's numbers.

    Args:
        run: its paths and studies.
        command: how to run it again.
        made_of: all that determines it.
        published: figures of Table II.
        verification: cases with known answers, and three engines side by side.
        acceptance: rows that decide the exit status.
        curves: content of the curve files by name.
        seconds: wall time of the run so far.
        notes: what was left out, and why.
    """
    chain: dict[str, dict[str, dict[str, PathMetrics]]] = {}
    engines: dict[str, float] = {}
    for key, path in run.paths.items():
        chain.setdefault(key.posture, {}).setdefault(str(key.direction), {})[key.engine] = path_metrics(path)
        engines[key.engine] = engines.get(key.engine, 0.0) + path.seconds
    return Summary(
        command=command,
        chain=chain,
        published=list(published),
        lumping=[
            LumpingRow(
                posture=study.posture,
                direction=study.direction,
                placement=placement,
                springs=n,
                F_cr=force,
                reference=study.reference,
            )
            for study in run.lumping
            for placement, n, force in study.rows
        ],
        end_conditions=_end_conditions(run),
        imperfections=_imperfections(run),
        matrices=run.matrices,
        robots=run.robots.rows if run.robots is not None else None,
        discovery=run.discovery.rows if run.discovery is not None else None,
        iterations=_iterations(run),
        verification=verification.rows,
        triangulation=verification.triangulation,
        acceptance=list(acceptance),
        timings=Timings(paths={k.stem: p.seconds for k, p in run.paths.items()}, engines=engines, total=seconds),
        versions=versions(),
        made_of=dict(made_of.inputs),
        hashes={name: digest(content) for name, content in sorted(curves.items())},
        notes=list(notes),
    )


def _end_conditions(run: Run) -> list[EndConditionRow]:
    if run.end_conditions is None:
        return []
    rows = []
    for (posture, condition, engine), path in run.end_conditions.paths.items():
        m = path_metrics(path)
        rows.append(
            EndConditionRow(
                posture=posture, condition=condition, engine=engine, critical=m.critical, F_cr=m.F_cr, d_cr=m.d_cr,
                F_max=max([float(path.force.max()), *(event.force for event in path.events)]), stopped=m.stopped,
            )
        )  # fmt: skip
    return rows


def _imperfections(run: Run) -> list[ImperfectionRow]:
    if run.end_conditions is None:
        return []
    return [
        ImperfectionRow(posture=posture, size=float(size), F_max=float(force), limit=bool(limit))
        for posture, curve in run.end_conditions.imperfections.items()
        for size, force, limit in zip(curve.size, curve.force, curve.limit, strict=True)
    ]


def _iterations(run: Run) -> Iterations | None:
    rows = [
        IterationRow(posture=study.posture, direction=study.direction, **asdict(point))
        for study in run.iterations
        for point in study.points
    ]
    return Iterations(rows=rows) if rows else None
