"""``validate all``: every comparison on the paper's chain.

It goes from the model file to the report and to ``summary.json``, the numbers of the run.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path as FilePath

from pydantic import Field

from vjm.batch import beside, map_all
from vjm.continuation.path import EventKind, Path
from vjm.engines import engine_by_name
from vjm.io.files import check_writable, write_whole
from vjm.io.model_file import load_chain
from vjm.io.model_plausibility import findings_of
from vjm.io.provenance import OtherInputsError, Provenance, digest
from vjm.model.load_case import Direction, ramp_end
from vjm.model.machine import Machine
from vjm_fea.opensees.beams import available
from vjm_output import terminal
from vjm_output.documents import Row, as_json, versions
from vjm_validation.acceptance import (
    AcceptanceRow,
    agreement_rows,
    discovery_rows,
    end_rows,
    model_rows,
    robot_rows,
    solver_rows,
    verification_rows,
)
from vjm_validation.metrics import PathMetrics, path_metrics
from vjm_validation.runs import COMPARISONS
from vjm_validation.studies import robots
from vjm_validation.studies.chain import (
    ENGINES,
    SECOND,
    Discovery,
    DiscoveryStudy,
    EndConditionStudy,
    Key,
    LumpingStudy,
    PathStore,
    Run,
    chain_tasks,
    end_condition_study,
    lumping_study,
    run_sweep,
)
from vjm_validation.studies.robots import Robots
from vjm_validation.studies.table2 import (
    TABLE_II,
    PublishedFigure,
    published_figures,
    reach,
)
from vjm_validation.verification.judging import VerificationRow
from vjm_validation.verification.study import verify


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
    robots: Robots | None = None
    """Whole robots beside Exudyn's; null where they were left out."""
    discovery: Discovery | None = None
    """A diagnosis of finite elements' data under the paper's model; null where it was left out."""
    verification: list[VerificationRow]
    """Cases with known answers, on every engine."""
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


def discard_outdated(folder: FilePath, made_of: Provenance) -> None:
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
        for shown in (path for pattern in SHOWN for path in folder.glob(pattern)):
            shown.unlink()


def summarise(
    run: Run,
    *,
    command: str,
    made_of: Provenance,
    published: Sequence[PublishedFigure],
    verification: Sequence[VerificationRow],
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
        verification: cases with known answers.
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
        end_conditions=_end_condition_rows(run),
        imperfections=_imperfections(run),
        robots=run.robots.rows if run.robots is not None else None,
        discovery=run.discovery.rows if run.discovery is not None else None,
        verification=list(verification),
        acceptance=list(acceptance),
        timings=Timings(paths={k.stem: p.seconds for k, p in run.paths.items()}, engines=engines, total=seconds),
        versions=versions(),
        made_of=dict(made_of.inputs),
        hashes={name: digest(content) for name, content in sorted(curves.items())},
        notes=list(notes),
    )


def _end_condition_rows(run: Run) -> list[EndConditionRow]:
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


MODEL = "orthoglide-chain"
STUDIED_POSTURE = "A"
END_ENGINES = ("vjm-16f16", "exudyn")
"""Of the end conditions: the lumped one first."""


@dataclass(frozen=True)
class Options:
    """What ``validate all`` was asked for.

    Attributes:
        out: the run's folder.
        jobs: processes.
        quick: without the reach of the rounding, postures A and B only.
        only: names of comparisons and of verification cases; empty for all comparisons.
        steps: equal steps of every path; None where they adapt.
        command: how to run it again.
    """

    out: FilePath
    jobs: int = 1
    quick: bool = False
    only: tuple[str, ...] = ()
    steps: int | None = None
    command: str = "validate all"

    def wants(self, comparison: str) -> bool:
        """Whether a comparison is asked for."""
        return not self.only or comparison in self.only

    @property
    def cases(self) -> tuple[str, ...]:
        """Verification cases that are asked for by name; none where all of them are."""
        named = tuple(name for name in self.only if name not in COMPARISONS)
        return () if "verification" in self.only else named


Progress = Callable[[str, int, int], None]
"""Called with a stage's name, how much of it is done, and of how much."""


def run_all(options: Options, progress: Progress) -> Summary:
    """Run the comparisons and write the run's folder.

    What an earlier, interrupted run in the same folder has finished is used again.

    Raises:
        OSError: the folder cannot be written to.
    """
    started = time.perf_counter()
    check_writable(options.out)
    chain = load_chain(MODEL)
    postures = ["A", "B"] if options.quick else list(chain.postures)
    run = Run(chain)
    made_of = Provenance.of(chain.files, command=options.command)
    discard_outdated(options.out, made_of)
    notes: list[str] = []
    store = PathStore(options.out)

    agreement: list[AcceptanceRow] = []
    verification: list[VerificationRow] = []
    published: list[PublishedFigure] = []
    discovers = options.wants("discovery") and not options.quick
    with beside(partial(_discovery, options.out), options.jobs if discovers else 1) as awaited:
        if options.wants("chain"):
            run.paths = _paths(chain, postures, options, store, progress)
            agreement = agreement_rows(run.paths, second=options.wants("verification"))
            if agreement:
                held = sum(row.passed is True for row in agreement)
                progress("springs agree with finite elements", held, len(agreement))
        else:
            notes.append("the chain's paths were left out by --only")
        if options.wants("link_lumping"):
            run.lumping = _lumping(run, options.jobs, progress)
        if options.wants("end_conditions"):
            run.end_conditions = _end_conditions(chain, postures, options, progress)
        if options.wants("robots") and not options.quick:
            run.robots = robots.robot_study(options.jobs, partial(progress, "robots"))
        if options.wants("table2"):
            published = _table2(chain, options, progress)
            if options.quick:
                notes.append("--quick: without the rounding's reach, whole robots, the discovery, postures C and D")
        if options.wants("verification") or options.cases:
            verification = verify(
                chain,
                cases=options.cases,
                quick=options.quick,
                jobs=options.jobs,
                folder=options.out,
                progress=progress,
            )
            if options.quick:
                notes.append("--quick: verification without the cases that take long")
        if discovers:
            progress("discovery", 0, 1)
            run.discovery = awaited()
            progress("discovery", 1, 1)

    acceptance = [
        *model_rows(findings_of(MODEL)),
        *solver_rows(run.paths),
        *agreement,
        *end_rows(run.end_conditions),
        *robot_rows(run.robots),
        *discovery_rows(run.discovery),
        *verification_rows(verification),
    ]
    run.summary = summarise(
        run,
        command=options.command,
        made_of=made_of,
        published=published,
        verification=verification,
        acceptance=acceptance,
        curves={key.stem + ".csv": store.curve(key).read_bytes() for key in run.paths},
        seconds=time.perf_counter() - started,
        notes=notes,
    ).model_dump(mode="json")
    progress("report", 0, 1)
    from vjm_validation.report.page import write_report  # matplotlib and pyvista take seconds to import

    write_report(run, options.out)
    summary = Summary.model_validate(run.summary)
    write_whole(options.out / "summary.json", as_json(summary))
    progress("report", 1, 1)
    return summary


def _paths(
    chain: Machine, postures: Sequence[str], options: Options, store: PathStore, progress: Progress
) -> dict[Key, Path]:
    engines = (*ENGINES, SECOND) if options.wants("verification") and available() else ENGINES
    tasks = chain_tasks(chain, postures, engines, options.steps)
    finished = 0

    def done(key: Key, path: Path) -> None:
        nonlocal finished
        finished += 1
        progress("paths", finished, len(tasks))

    progress("paths", 0, len(tasks))
    return run_sweep(tasks, store, options.jobs, done)


def _discovery(out: FilePath) -> DiscoveryStudy:
    """One long computation, which has a process of its own."""
    from vjm_validation.studies import link_lumping_discovery  # reads the whole diagnosis, as no other comparison

    return link_lumping_discovery.study(out)


def _lumping(run: Run, jobs: int, progress: Progress) -> tuple[LumpingStudy, ...]:
    asked: list[tuple[Direction, float | None]] = []
    for direction in Direction:
        elements = run.paths.get(Key(STUDIED_POSTURE, direction, "exudyn-footspring"))
        event = elements.critical if elements is not None else None
        asked.append((direction, event.force if event is not None else None))
    progress("link lumping", 0, len(asked))
    return tuple(map_all(partial(_lumped, run.chain), asked, jobs, partial(progress, "link lumping")))


def _lumped(chain: Machine, asked: tuple[Direction, float | None]) -> LumpingStudy:
    return lumping_study(chain, STUDIED_POSTURE, *asked)


def _end_conditions(
    chain: Machine, postures: Sequence[str], options: Options, progress: Progress
) -> EndConditionStudy:
    reaches = {posture: abs(ramp_end(chain, posture, Direction.COMPRESSION)) for posture in postures}
    engines = [engine_by_name(name) for name in END_ENGINES]
    return end_condition_study(chain, reaches, engines, options.jobs, partial(progress, "end conditions"))


def _table2(chain: Machine, options: Options, progress: Progress) -> list[PublishedFigure]:
    if options.quick:
        return published_figures(chain)
    progress("rounding", 0, len(TABLE_II))
    intervals = map_all(partial(reach, chain), list(TABLE_II), options.jobs, partial(progress, "rounding"))
    return published_figures(chain, dict(zip(TABLE_II, intervals, strict=True)))
