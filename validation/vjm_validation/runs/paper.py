"""``validate all``: every comparison on the paper's chain, from the model file to the report."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path as FilePath

from vjm.batch import beside, map_all
from vjm.continuation.direction import Direction, ramp_end
from vjm.continuation.path import Path
from vjm.engines import engine_by_name
from vjm.io.files import check_writable, write_whole
from vjm.io.model_file import load_chain
from vjm.io.model_plausibility import findings_of
from vjm.io.provenance import Provenance
from vjm.model.machine import Machine
from vjm_output.documents import as_json
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
from vjm_validation.comparison_names import COMPARISONS
from vjm_validation.studies import parallelogram, robots
from vjm_validation.studies.discovery_results import DiscoveryStudy
from vjm_validation.studies.end_conditions import end_condition_study
from vjm_validation.studies.iterations import iteration_study
from vjm_validation.studies.lumping import lumping_study
from vjm_validation.studies.parallelogram import ParallelogramComparison
from vjm_validation.studies.printed_matrices import PrintedMatrices, printed_matrices
from vjm_validation.studies.study_results import EndConditionStudy, IterationStudy, Key, LumpingStudy, Run
from vjm_validation.studies.sweeps import ENGINES, PathStore, chain_tasks, run_sweep
from vjm_validation.studies.table2 import TABLE_II, PublishedFigure, published_figures, reach
from vjm_validation.summary import Summary, discard_outdated, summarise
from vjm_validation.verification.study import Verification, verify

MODEL = "orthoglide-chain"
STUDIED_POSTURE = "A"
LONG = ("matrices", "parallelogram", "discovery")
"""Comparisons that have a process of their own, beside those that share the others."""
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
    verification = Verification()
    published: list[PublishedFigure] = []
    long = tuple(name for name in LONG if options.wants(name) and not options.quick)
    with beside(partial(_long_studies, chain, long, options.out), options.jobs if long else 1) as awaited:
        if options.wants("chain"):
            run.paths = _paths(chain, postures, options, store, progress)
            agreement = agreement_rows(run.paths)
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
            run.robots = robots.study(options.jobs, partial(progress, "robots"))
        if options.wants("iterations"):
            run.iterations = _iterations(chain, postures, options, progress)
        if options.wants("table2"):
            published = _table2(chain, options, progress)
            if options.quick:
                notes.append(
                    "--quick: without the rounding's reach, the matrices, whole robots, the discovery, "
                    "postures C and D"
                )
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
                notes.append(
                    "--quick: verification without the cases that take long, and A and B only of the engines"
                )
        if long:
            stage = ", ".join(long)
            progress(stage, 0, len(long))
            run.matrices, run.parallelogram, run.discovery = awaited()
            progress(stage, len(long), len(long))

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
    tasks = chain_tasks(chain, postures, ENGINES, options.steps)
    finished = 0

    def done(key: Key, path: Path) -> None:
        nonlocal finished
        finished += 1
        progress("paths", finished, len(tasks))

    progress("paths", 0, len(tasks))
    return run_sweep(tasks, store, options.jobs, done)


def _long_studies(
    chain: Machine, names: Sequence[str], out: FilePath
) -> tuple[PrintedMatrices | None, ParallelogramComparison | None, DiscoveryStudy | None]:
    """Those of `LONG` that are asked for, one after another: each is one long computation."""
    matrices, pairs, found = None, None, None
    if "matrices" in names:
        matrices = printed_matrices(chain)
    if "parallelogram" in names:
        pairs = parallelogram.study()
    if "discovery" in names:
        # reads the whole diagnosis, which no other comparison needs
        from vjm_validation.studies import link_lumping_discovery as discovery

        found = discovery.study(out)
    return matrices, pairs, found


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


def _iterations(
    chain: Machine, postures: Sequence[str], options: Options, progress: Progress
) -> tuple[IterationStudy, ...]:
    progress("iterations", 0, len(postures))
    study = partial(iteration_study, chain)
    return tuple(map_all(study, postures, options.jobs, partial(progress, "iterations")))


def _table2(chain: Machine, options: Options, progress: Progress) -> list[PublishedFigure]:
    if options.quick:
        return published_figures(chain)
    progress("rounding", 0, len(TABLE_II))
    intervals = map_all(partial(reach, chain), list(TABLE_II), options.jobs, partial(progress, "rounding"))
    return published_figures(chain, dict(zip(TABLE_II, intervals, strict=True)))
