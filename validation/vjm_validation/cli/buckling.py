"""The command ``validate buckling``."""

from __future__ import annotations

import sys
from typing import Annotated, Literal

from cyclopts import Parameter

from vjm import __version__
from vjm.batch import Failure, Task, trace_all
from vjm.continuation.direction import Direction, ramp_end
from vjm.continuation.path import Path
from vjm.engines import engine_by_name
from vjm.errors import NoConvergenceError
from vjm.io.machine_file import part_tables
from vjm.model.load_case import COMPONENTS, LOAD, RAMP, TO_LIMIT
from vjm.model.parts import Placement
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_validation.cli import pages, tables
from vjm_validation.cli.doubts import Strict, along_paths, considered
from vjm_validation.cli.load_case_options import GravityOption, LoadOption, parsed_load_case
from vjm_validation.cli.options import (
    Axis,
    FootSegments,
    Force,
    Free,
    Json,
    Model,
    PlacementOption,
    Segments,
    Shear,
    engine_options,
    gave_up,
    processes,
    with_shear,
    within_reach,
)
from vjm_validation.cli.path_words import path_words
from vjm_validation.cli.status import UsageError
from vjm_validation.documents import BucklingDocument
from vjm_validation.load_any_model import in_postures, loaded
from vjm_validation.metrics import PathMetrics, path_metrics
from vjm_validation.yielding import yield_rows


def buckling_(
    model: Model,
    *,
    posture: Annotated[tuple[str, ...], Parameter(consume_multiple=True, help="Labels; all by default.")] = (),
    direction: Annotated[
        Literal["+", "-"] | None,
        Parameter(allow_leading_hyphen=True, help="Tension or compression; both by default."),
    ] = None,
    engine: Annotated[tuple[str, ...], Parameter(consume_multiple=True, help="See `validate list`.")] = ("vjm",),
    segments: Segments = None,
    foot_segments: FootSegments = None,
    placement: PlacementOption = Placement.BEST,
    shear: Shear = None,
    to: Annotated[
        float | None,
        Parameter(
            help="How far to go, mm or rad, with --force N or N mm. The default along x, y, z is 4 mm, or 14 where "
            "that says more."
        ),
    ] = None,
    axis: Axis = "x",
    free: Free = "",
    force: Force = False,
    gravity: GravityOption = "",
    load: LoadOption = (),
    jobs: Annotated[int, Parameter(help="Processes; 0 is one a core.")] = 1,
    json: Json = False,
    plot: pages.Plot = None,
    report: pages.Report = None,
    strict: Strict = False,
) -> int:
    """Stiffness, critical points and post-buckling stiffness."""
    if to is not None and not to > 0.0:
        raise UsageError(f"--to: the reach must be positive, not {to}; --direction gives the sign")
    if to is None and (force or axis not in COMPONENTS[:3]):
        unit = "N or N mm" if force else "mm or rad, or which load factor"
        raise UsageError(f"--to: with {'--force' if force else f'--axis {axis}'} say up to how many {unit}")
    pages.check(plot, report)
    chain = loaded(model, shear=with_shear(shear))
    doubts = considered(model, strict, weighed=bool(gravity))
    options = engine_options(segments, foot_segments, placement)
    solvers = [engine_by_name(name, options, chain) for name in engine]
    directions = (
        [Direction.TENSION if direction == "+" else Direction.COMPRESSION] if direction else list(Direction)
    )
    chain, labels = in_postures(chain, posture)
    cases = [(label, way, solver) for label in labels for way in directions for solver in solvers]
    tasks = []
    for label, way, solver in cases:
        end = way.sign * to if to is not None else ramp_end(chain, label, way)
        load_case = parsed_load_case(
            label, end, axis=axis, force=force, free=free, gravity=gravity, loads=load,
            control=TO_LIMIT if force or axis == LOAD else RAMP,
        )  # fmt: skip
        within_reach("--to", chain, load_case.displacement(load_case.length).tolist())
        tasks.append(Task(solver, chain, load_case))
    with terminal.progress(quiet=json) as progress:
        results = trace_all(
            tasks, min(processes(jobs), len(tasks)), lambda done, total: progress("paths", done, total)
        )
    found: dict[str, dict[str, dict[str, PathMetrics]]] = {}
    paths: list[Path] = []
    for (label, way, solver), path in zip(cases, results, strict=True):
        if isinstance(path, Failure):
            no_solution = path.kind == NoConvergenceError.__name__
            raise NoConvergenceError(path.message) if no_solution else UsageError(path.message)
        paths.append(path)
        found.setdefault(label, {}).setdefault(str(way), {})[solver.label] = path_metrics(path)
    traced = [(solver, path) for (_, _, solver), path in zip(cases, paths, strict=True)]
    doubts += along_paths(chain, traced, strict)
    yields = yield_rows(chain, part_tables(model), [(a, str(b), c) for a, b, c in cases], paths)
    document = BucklingDocument(
        model=chain.name, model_sha256=chain.sha256, version=__version__, chain=found, yields=yields,
        doubts=doubt_rows(doubts),
    )  # fmt: skip
    if json:
        sys.stdout.write(as_json(document))
    else:
        terminal.console().print(tables.metrics_table(document, paths[0].load_case.driven))
        why = dict.fromkeys(line for path in paths for line in tables.blanks(path))
        for line in (*why, *path_words(chain, traced), *(row.words for row in yields)):
            terminal.console().print(line, soft_wrap=True)
    pages.draw(plot, report, lambda: _content(paths, document), None if json else terminal.console())
    return gave_up(paths)


def _content(paths: list[Path], document: BucklingDocument) -> pages.Content:
    from vjm_output.number_text import number
    from vjm_validation.report.command_figures import path_pictures
    from vjm_validation.report.words import ReportTable

    numbers = ("K0", "K1", "F_cr", "d_cr", "K2", "F_end", "d_end", "K3")
    driven = paths[0].load_case.driven
    units = ", ".join(word for word in (driven.unit or driven.name, driven.along) if word)
    rows = [
        (posture, direction, engine, str(m.critical or "none"), *(number(getattr(m, name), 5) for name in numbers))
        for posture, directions in document.chain.items()
        for direction, engines in directions.items()
        for engine, m in engines.items()
    ]
    table = ReportTable(
        f"{units}, magnitudes. K0: unloaded stiffness; K1 and K2: at 0.99 and 1.01 of the critical displacement; "
        "K3: at the end of the path",
        ("posture", "direction", "engine", "critical", *numbers), tuple(rows), words=4,
    )  # fmt: skip
    sharp = sum(row[3] != "none" for row in rows)
    verdict = f"{sharp} of {len(rows)} paths have a critical point."
    return pages.Content(
        f"{document.model}: buckling",
        verdict,
        path_pictures(paths),
        [table],
        [row.words + "." for row in document.yields],
    )
