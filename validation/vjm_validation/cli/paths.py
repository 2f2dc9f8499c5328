"""The commands that trace equilibrium paths.

``validate curve`` shows one, ``validate buckling`` the stiffness and critical points of several. Beside a path
stands where it flutters and where springs pass from region to region of their laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from vjm import __version__
from vjm.batch import Failure, Task, trace_all
from vjm.continuation.path import EventKind, Path
from vjm.engines import Engine, VjmEngine
from vjm.errors import NoConvergenceError
from vjm.io.machine_file import part_tables
from vjm.io.path_files import write_curve
from vjm.model.load_case import COMPONENTS, LOAD, RAMP, TO_LIMIT, Direction, ramp_end
from vjm.model.machine import Machine
from vjm_output import terminal
from vjm_output.documents import doubt_rows
from vjm_output.number_text import number
from vjm_validation.cli import UsageError, tables
from vjm_validation.cli.options import (
    ENGINE_CHOICE,
    NO_LOADS,
    ActingLoads,
    Axis,
    EngineChoice,
    Force,
    Free,
    GravityOption,
    LoadOption,
    Model,
    Posture,
    along_paths,
    beyond_calibration,
    considered,
    gave_up,
    parsed_load_case,
    positive,
    processes,
    within_reach,
)
from vjm_validation.cli.pages import OUTPUT, Output
from vjm_validation.documents import BucklingDocument, curve_document
from vjm_validation.load_any_model import in_postures, loaded
from vjm_validation.metrics import PathMetrics, path_metrics, yield_rows
from vjm_validation.page_content import Content, ReportTable

if TYPE_CHECKING:
    from vjm_output.plots import Picture


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
    springs: EngineChoice = ENGINE_CHOICE,
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
    output: Output = OUTPUT,
) -> int:
    """Trace one load path and show it."""
    positive("--steps", steps)
    chain = loaded(model, shear=springs.sheared)
    doubts = considered(model, output.strict, weighed=bool(gravity))
    chain, (label, *_) = in_postures(chain, (posture,) if posture else ())
    doubts += beyond_calibration(
        chain, {k: np.array([v]) for k, v in chain.held.get(label, {}).items()}, output.strict
    )
    load_case = parsed_load_case(
        label, to, axis=axis, force=force, steps=steps, branch={"+": 1, "-": -1, "0": 0}[branch], free=free,
        loads=load, gravity=gravity, control=control, imperfection=imperfection,
    )  # fmt: skip
    within_reach("--to", chain, load_case.displacement(load_case.length).tolist())
    solver = springs.engine(engine, chain)
    output.check(csv=csv)
    with terminal.progress(quiet=output.json) as progress:
        path = solver.trace(chain, load_case, lambda done: progress("path", round(100 * done), 100))
    doubts += along_paths(chain, [(solver, path)], output.strict)
    if csv is not None:
        write_curve(path, csv)

    def told(console: Console) -> None:
        console.print(tables.path_table(path))
        for line in (*tables.event_lines(path), *path_words(chain, [(solver, path)])):
            console.print(line, soft_wrap=True)
        if csv is not None:
            console.print(f"path: {csv}", soft_wrap=True)

    output.show(curve_document(path, doubts), lambda: _curve_content(path), told)
    return gave_up([path])


def _curve_content(path: Path) -> Content:
    rows = [
        (f"{p.ramp:.6g}", f"{force:.6g}", f"{p.tangent:.6g}", *(f"{u:.6g}" for u in p.displacement + 0.0))
        for p, force in zip(path.points, path.force, strict=True)
    ]
    header = ("ramp", path.load_case.driven.name, "stiffness", "ux", "uy", "uz", "rx", "ry", "rz")
    verdict, *rest = tables.event_lines(path)
    return Content(
        f"{path.model}, posture {path.load_case.posture}, {path.engine}",
        [f"{verdict[:1].upper()}{verdict[1:]}.", *rest, *map(str, path.law_changes)],
        [ReportTable("Every point of the path; N, mm, rad", header, tuple(rows), words=0)],
        lambda: _pictures([path]),
    )


def _pictures(paths: Sequence[Path]) -> list[Picture]:
    from vjm_validation.report.command_pages import path_pictures

    return path_pictures(paths)


def buckling_(
    model: Model,
    *,
    posture: Annotated[tuple[str, ...], Parameter(consume_multiple=True, help="Labels; all by default.")] = (),
    direction: Annotated[
        Literal["+", "-"] | None,
        Parameter(allow_leading_hyphen=True, help="Tension or compression; both by default."),
    ] = None,
    engine: Annotated[tuple[str, ...], Parameter(consume_multiple=True, help="See `validate list`.")] = ("vjm",),
    springs: EngineChoice = ENGINE_CHOICE,
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
    acting: ActingLoads = NO_LOADS,
    jobs: Annotated[int, Parameter(help="Processes; 0 is one a core.")] = 1,
    output: Output = OUTPUT,
) -> int:
    """Stiffness, critical points and post-buckling stiffness."""
    if to is not None and not to > 0.0:
        raise UsageError(f"--to: the reach must be positive, not {to}; --direction gives the sign")
    if to is None and (force or axis not in COMPONENTS[:3]):
        unit = "N or N mm" if force else "mm or rad, or which load factor"
        raise UsageError(f"--to: with {'--force' if force else f'--axis {axis}'} say up to how many {unit}")
    output.check()
    chain = loaded(model, shear=springs.sheared)
    doubts = considered(model, output.strict, weighed=bool(acting.gravity))
    solvers = [springs.engine(name, chain) for name in engine]
    directions = (
        [Direction.TENSION if direction == "+" else Direction.COMPRESSION] if direction else list(Direction)
    )
    chain, labels = in_postures(chain, posture)
    cases = [(label, way, solver) for label in labels for way in directions for solver in solvers]
    tasks = []
    for label, way, solver in cases:
        end = way.sign * to if to is not None else ramp_end(chain, label, way)
        load_case = parsed_load_case(
            label, end, axis=axis, force=force, free=free, gravity=acting.gravity, loads=acting.load,
            control=TO_LIMIT if force or axis == LOAD else RAMP,
        )  # fmt: skip
        within_reach("--to", chain, load_case.displacement(load_case.length).tolist())
        tasks.append(Task(solver, chain, load_case))
    with terminal.progress(quiet=output.json) as progress:
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
    doubts += along_paths(chain, traced, output.strict)
    yields = yield_rows(chain, part_tables(model), [(a, str(b), c) for a, b, c in cases], paths)
    document = BucklingDocument(
        model=chain.name, model_sha256=chain.sha256, version=__version__, chain=metrics, yields=yields,
        doubts=doubt_rows(doubts), loads=acting.words(),
    )  # fmt: skip

    def told(console: Console) -> None:
        console.print(tables.metrics_table(document, paths[0].load_case.driven))
        why = dict.fromkeys(line for path in paths for line in tables.blanks(path))
        for line in (*why, *path_words(chain, traced), *(row.words for row in yields)):
            console.print(line, soft_wrap=True)

    output.show(document, lambda: _buckling_content(paths, document), told)
    return gave_up(paths)


def _buckling_content(paths: list[Path], document: BucklingDocument) -> Content:
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
    return Content(
        f"{document.model}: buckling",
        [f"{sharp} of {len(rows)} paths have a critical point.", *(row.words + "." for row in document.yields)],
        [table],
        lambda: _pictures(paths),
    )
