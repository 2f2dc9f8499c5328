"""The commands that trace equilibrium paths.

``validate curve`` shows one, ``validate buckling`` the stiffness and critical points of several. Beside a path
stands where it flutters and where springs pass from region to region of their laws.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from vjm import __version__
from vjm.batch import Failure, Task, trace_all
from vjm.continuation.path import EventKind, Path
from vjm.engines import Engine, VjmEngine, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.io.machine_file import part_tables
from vjm.io.path_files import write_curve
from vjm.model.load_case import COMPONENTS, LOAD, RAMP, TO_LIMIT, Direction, ramp_end
from vjm.model.machine import Machine
from vjm.model.parts import Placement
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_validation.cli import UsageError, pages, tables
from vjm_validation.cli.options import (
    Axis,
    FootSegments,
    Force,
    Free,
    GravityOption,
    Json,
    LoadOption,
    Model,
    PlacementOption,
    Posture,
    Segments,
    Shear,
    Strict,
    along_paths,
    beyond_calibration,
    considered,
    engine_options,
    gave_up,
    parsed_load_case,
    positive,
    processes,
    with_shear,
    within_reach,
)
from vjm_validation.documents import BucklingDocument, curve_document
from vjm_validation.load_any_model import in_postures, loaded
from vjm_validation.metrics import PathMetrics, path_metrics, yield_rows


def path_words(machine: Machine, traced: Sequence[tuple[Engine, Path]]) -> list[str]:
    """What is to be said beside paths; a line for each answer.

    Args:
        machine: of the paths.
        traced: each path with its engine.
    """
    return _flutter_words(machine, traced) + [
        line for engine, path in traced for line in _law_words(machine, engine, path)
    ]


def _law_words(machine: Machine, engine: Engine, path: Path) -> list[str]:
    """Where springs pass from region to region of their laws, and where these are at the end of a path."""
    if not isinstance(engine, VjmEngine):
        return []
    last = path.points[-1]
    return [
        *map(str, path.law_changes),
        *(f"at {last.ramp:.6g} {state}" for state in engine.problem(machine, path.load_case).law_states(last)),
    ]


def _flutter_words(machine: Machine, traced: Sequence[tuple[Engine, Path]]) -> list[str]:
    """Where paths under loads without a potential flutter, or why that is not known; a line for each answer.

    Args:
        machine: of the paths.
        traced: each path with its engine.
    """
    without = [(engine, path) for engine, path in traced if not path.load_case.conservative]
    if not without:
        return []
    bifurcates = any(event.kind is EventKind.BIFURCATION for _, path in without for event in path.events)
    statics = "the losses of stability above are the static ones" if bifurcates else "no static loss of stability"
    several = len(without) > 1
    lines = []
    for engine, path in without:
        where = f"{path.engine}, posture {path.load_case.posture}: " if several else ""
        lines.append(
            f"{where}followers and moments have no potential: {statics}; {_flutter(machine, engine, path)}"
        )
    return list(dict.fromkeys(lines))


def _flutter(machine: Machine, engine: Engine, path: Path) -> str:
    if not isinstance(engine, VjmEngine):
        return "flutter is examined by the engine vjm only"
    # what few paths need takes SciPy's linear algebra, half a second
    from vjm.design.modes import flutter_along

    try:
        flutter = flutter_along(machine, engine, path)
    except ValueError as error:
        return f"flutter is not examined: {error}"
    unit = "" if path.load_case.load_driven else f" {path.load_case.driven.along}"
    if np.isnan(flutter.begins):
        return f"no flutter at the {flutter.examined} stable points of the path"
    if np.isnan(flutter.before):
        return f"flutter already at {flutter.begins:.6g}{unit}"
    return f"flutter begins between {flutter.before:.6g} and {flutter.begins:.6g}{unit}"


def curve_(
    model: Model,
    *,
    to: Annotated[float, Parameter(help="End of the ramp, mm or rad; -4 is compression for posture A.")],
    posture: Posture = None,
    axis: Axis = "x",
    steps: Annotated[int | None, Parameter(help="Equal steps; adaptive by default.")] = None,
    engine: Annotated[str, Parameter(help="See `validate list`.")] = "vjm",
    segments: Segments = None,
    foot_segments: FootSegments = None,
    placement: PlacementOption = Placement.BEST,
    shear: Shear = None,
    branch: Annotated[
        Literal["+", "-", "0"],
        Parameter(
            allow_leading_hyphen=True, help="Which of two mirrored branches; 0 stays where stability is lost."
        ),
    ] = "+",
    free: Free = "",
    force: Force = False,
    load: LoadOption = (),
    gravity: GravityOption = "",
    control: Annotated[
        str,
        Parameter(help="What the path follows: ramp, arc, limit (arc to its first limit), part@fraction:dx,dy,dz."),
    ] = "ramp",
    imperfection: Annotated[
        float, Parameter(help="mm of bow in the shape of the buckling mode, free of stress.")
    ] = 0.0,
    csv: Annotated[FilePath | None, Parameter(help="Write the path to this file.")] = None,
    json: Json = False,
    plot: pages.Plot = None,
    report: pages.Report = None,
    strict: Strict = False,
) -> int:
    """Trace one load path and show it."""
    positive("--steps", steps)
    chain = loaded(model, shear=with_shear(shear))
    doubts = considered(model, strict, weighed=bool(gravity))
    chain, (label, *_) = in_postures(chain, (posture,) if posture else ())
    doubts += beyond_calibration(chain, {k: np.array([v]) for k, v in chain.held.get(label, {}).items()}, strict)
    load_case = parsed_load_case(
        label, to, axis=axis, force=force, steps=steps, branch={"+": 1, "-": -1, "0": 0}[branch], free=free,
        loads=load, gravity=gravity, control=control, imperfection=imperfection,
    )  # fmt: skip
    within_reach("--to", chain, load_case.displacement(load_case.length).tolist())
    solver = engine_by_name(engine, engine_options(segments, foot_segments, placement), chain)
    pages.check(plot, report, csv=csv)
    with terminal.progress(quiet=json) as progress:
        path = solver.trace(chain, load_case, lambda done: progress("path", round(100 * done), 100))
    doubts += along_paths(chain, [(solver, path)], strict)
    if csv is not None:
        write_curve(path, csv)
    if json:
        sys.stdout.write(as_json(curve_document(path, doubts)))
        pages.draw(plot, report, lambda: _curve_content(path), None)
        return gave_up([path])
    console = terminal.console()
    console.print(tables.path_table(path))
    for line in tables.event_lines(path):
        console.print(line, soft_wrap=True)
    for line in path_words(chain, [(solver, path)]):
        console.print(line, soft_wrap=True)
    if csv is not None:
        console.print(f"path: {csv}", soft_wrap=True)
    pages.draw(plot, report, lambda: _curve_content(path), console)
    return gave_up([path])


def _curve_content(path: Path) -> pages.Content:
    from vjm_validation.report.command_pages import path_pictures
    from vjm_validation.report.words import ReportTable

    rows = [
        (f"{p.ramp:.6g}", f"{force:.6g}", f"{p.tangent:.6g}", *(f"{u:.6g}" for u in p.displacement + 0.0))
        for p, force in zip(path.points, path.force, strict=True)
    ]
    header = ("ramp", path.load_case.driven.name, "stiffness", "ux", "uy", "uz", "rx", "ry", "rz")
    table = ReportTable("Every point of the path; N, mm, rad", header, tuple(rows), words=0)
    verdict, *rest = tables.event_lines(path)
    title = f"{path.model}, posture {path.load_case.posture}, {path.engine}"
    return pages.Content(
        title,
        f"{verdict[:1].upper()}{verdict[1:]}.",
        path_pictures([path]),
        [table],
        [*rest, *map(str, path.law_changes)],
    )


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
    metrics: dict[str, dict[str, dict[str, PathMetrics]]] = {}
    paths: list[Path] = []
    for (label, way, solver), path in zip(cases, results, strict=True):
        if isinstance(path, Failure):
            no_solution = path.kind == NoConvergenceError.__name__
            raise NoConvergenceError(path.message) if no_solution else UsageError(path.message)
        paths.append(path)
        metrics.setdefault(label, {}).setdefault(str(way), {})[solver.label] = path_metrics(path)
    traced = [(solver, path) for (_, _, solver), path in zip(cases, paths, strict=True)]
    doubts += along_paths(chain, traced, strict)
    yields = yield_rows(chain, part_tables(model), [(a, str(b), c) for a, b, c in cases], paths)
    document = BucklingDocument(
        model=chain.name, model_sha256=chain.sha256, version=__version__, chain=metrics, yields=yields,
        doubts=doubt_rows(doubts),
    )  # fmt: skip
    if json:
        sys.stdout.write(as_json(document))
    else:
        terminal.console().print(tables.metrics_table(document, paths[0].load_case.driven))
        why = dict.fromkeys(line for path in paths for line in tables.blanks(path))
        for line in (*why, *path_words(chain, traced), *(row.words for row in yields)):
            terminal.console().print(line, soft_wrap=True)
    pages.draw(plot, report, lambda: _buckling_content(paths, document), None if json else terminal.console())
    return gave_up(paths)


def _buckling_content(paths: list[Path], document: BucklingDocument) -> pages.Content:
    from vjm_output.number_text import number
    from vjm_validation.report.command_pages import path_pictures
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
