"""The `validate` command."""

from __future__ import annotations

import os
import shlex
import sys
import time
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Annotated, Literal

from cyclopts import App, CycloptsError, Parameter

from vjm import __version__
from vjm.batch import Failure, Task, trace_all
from vjm.continuation.direction import Direction, ramp_end
from vjm.continuation.path import Path
from vjm.io.errors import did_you_mean
from vjm.io.files import check_writable
from vjm.io.manipulator_file import manipulators
from vjm.io.model_file import library
from vjm.io.path_files import write_curve
from vjm.model.chain import Chain
from vjm.model.load_case import RAMP, TO_LIMIT
from vjm.model.parts import Placement
from vjm.statics.equilibrium import NoConvergenceError
from vjm.vjm_engine import VjmEngine
from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_validation.cli import tables
from vjm_validation.cli.load_case_options import parsed_load_case
from vjm_validation.documents import BucklingDocument
from vjm_validation.engines import DESCRIPTIONS, EngineOptions, engine_by_name
from vjm_validation.load_any_model import loaded, postures, stiffness_document
from vjm_validation.loaded_stiffness import under_displacement, under_wrench
from vjm_validation.metrics import PathMetrics, path_metrics
from vjm_validation.report.acceptance import FROZEN

OK, NOT_ACCEPTED, BAD_INPUT, GAVE_UP, INTERRUPTED = 0, 1, 2, 3, 130
ZERO = "0,0,0,0,0,0"

app = App(
    name="validate",
    help="Stiffness of robot manipulators under load: the virtual joint method against finite elements.",
    version=__version__,
    result_action="return_value",
)
LATER = {
    "calibrate": "Fit spring compliances to measured force-displacement readings, with their uncertainty.",
    "diagnose": "Show what the model gets wrong, name the cause, extend the model and measure the gain.",
    "identify": "A part's 6×6 compliance from virtual experiments, and the uniform beam behind a compliance.",
    "map": "Map a quantity over a manipulator's workspace: CSV, VTK, a figure and a render.",
}
"""Commands of modules that are read when they are called: what they need takes seconds to import."""
for name, text in LATER.items():
    app.command(f"vjm_validation.cli.{name}:{name}_", name=name, help=text)

Segments = Annotated[
    int | None, Parameter(name="--segments", help="Springs or elements in every beam but the foot.")
]
FootSegments = Annotated[int | None, Parameter(name="--foot-segments", help="Springs in the foot; 1 by default.")]
PlacementOption = Annotated[
    Placement,
    Parameter(name="--placement", help="Where a spring sits in its segment: end, middle, two-thirds or best."),
]
Shear = Annotated[bool, Parameter(name="--shear", negative="", help="Let finite elements shear.")]
Free = Annotated[str, Parameter(help="Components of the pose that are let go, such as rx,ry,rz.")]
Force = Annotated[
    bool, Parameter(negative="", help="Drive a dead force or moment along --axis, N or N mm, instead of the pose.")
]
Jobs = Annotated[int, Parameter(help="Processes; one a core by default.")]
Json = Annotated[bool, Parameter(name="--json", negative="", help="Print one JSON document and nothing else.")]
Posture = Annotated[
    str | None,
    Parameter(allow_leading_hyphen=True, help="Label of a posture; of a manipulator also x,y,z from home in mm."),
]
Model = Annotated[str, Parameter(help="A model of the library, or a path to a model file.")]


class UsageError(ValueError):
    """A request that makes no sense; one line that says what and where."""


@app.command(name="all")
def all_(
    *,
    out: Annotated[
        FilePath | None, Parameter(help="Folder of the run; a run that was cut off goes on there.")
    ] = None,
    jobs: Jobs = 0,
    quick: Annotated[bool, Parameter(negative="", help="Postures A and B only, no reach of the rounding.")] = False,
    only: Annotated[
        tuple[str, ...],
        Parameter(consume_multiple=True, help="Comparisons and verification cases, see `validate list`."),
    ] = (),
    steps: Annotated[int | None, Parameter(help="Equal steps of every path; 4000 is the paper's grid.")] = None,
) -> int:
    """Run every comparison and write the report."""
    # all comparisons take a second to import, which no other command should wait for
    from vjm_validation.studies.run_all import COMPARISONS, Options, run_all
    from vjm_validation.verification.library import library as cases

    known = {*COMPARISONS, *(case.name for case in cases())}
    unknown = [name for name in only if name not in known]
    if unknown:
        hint = did_you_mean(unknown[0], known)
        raise UsageError(
            f"--only: no comparison '{unknown[0]}'{hint} (there are {', '.join(COMPARISONS)}, "
            "and the cases of `validate list`)"
        )
    _positive("--steps", steps)
    folder = out or FilePath("reports") / "runs" / time.strftime("%Y%m%d-%H%M%S")
    options = Options(folder, _jobs(jobs), quick, only, steps, _command(quick, only, steps))
    try:
        with terminal.progress() as progress:
            summary = run_all(options, progress)
    except KeyboardInterrupt:
        terminal.error(
            f"interrupted; what is finished is in {folder}: `validate all --out {folder}` goes on from there"
        )
        return INTERRUPTED
    console = terminal.console()
    console.print(tables.acceptance_table(summary))
    console.print(f"report: {folder / 'index.html'}", soft_wrap=True)
    return OK if all(row.passed for row in summary.acceptance) else NOT_ACCEPTED


def _command(quick: bool, only: Sequence[str], steps: int | None) -> str:
    words = ["validate", "all"]
    words += ["--quick"] if quick else []
    words += [f"--steps={steps}"] if steps else []
    words += ["--only", *only] if only else []
    return shlex.join(words)


@app.command(name="list")
def list_() -> int:
    """Show the models, engines, comparisons and verification cases that there are."""
    from vjm_validation.studies.run_all import COMPARISONS
    from vjm_validation.verification.library import library as cases

    console = terminal.console()
    console.print(terminal.two_columns("Models", {entry.name: entry.title for entry in library()}))
    console.print(terminal.two_columns("Manipulators", {entry.name: entry.title for entry in manipulators()}))
    console.print(terminal.two_columns("Engines", DESCRIPTIONS))
    console.print(terminal.two_columns("Comparisons of `validate all`", COMPARISONS))
    console.print(terminal.two_columns("Verification cases", {case.name: case.file.title for case in cases()}))
    return OK


@app.command
def curve(
    model: Model,
    *,
    to: Annotated[float, Parameter(help="End of the ramp, mm or rad; -4 is compression for posture A.")],
    posture: Posture = None,
    axis: Annotated[
        str,
        Parameter(help="x, y, z, rx, ry, rz, a direction dx,dy,dz, or load: the factor on every --load."),
    ] = "x",
    steps: Annotated[int | None, Parameter(help="Equal steps; adaptive by default.")] = None,
    engine: Annotated[str, Parameter(help="See `validate list`.")] = "vjm",
    segments: Segments = None,
    foot_segments: FootSegments = None,
    placement: PlacementOption = Placement.BEST,
    shear: Shear = False,
    branch: Annotated[
        Literal["+", "-", "0"],
        Parameter(
            allow_leading_hyphen=True, help="Which of two mirrored branches; 0 stays where stability is lost."
        ),
    ] = "+",
    free: Free = "",
    force: Force = False,
    load: Annotated[
        tuple[str, ...],
        Parameter(
            allow_leading_hyphen=True,
            help="[part@fraction:]fx,fy,fz[,mx,my,mz][:follower][:constant], N and N mm; may be repeated.",
        ),
    ] = (),
    gravity: Annotated[
        str, Parameter(allow_leading_hyphen=True, help="gx,gy,gz in m/s2: the parts get their weight.")
    ] = "",
    control: Annotated[
        str,
        Parameter(help="What the path follows: ramp, arc, limit (arc to its first limit), part@fraction:dx,dy,dz."),
    ] = "ramp",
    imperfection: Annotated[
        float, Parameter(help="mm of bow in the shape of the buckling mode, free of stress.")
    ] = 0.0,
    csv: Annotated[FilePath | None, Parameter(help="Write the path to this file.")] = None,
) -> int:
    """Walk one load path and show it."""
    _positive("--steps", steps)
    chain, whole = loaded(model)
    label = postures(chain, (posture,) if posture else ())[0]
    load_case = parsed_load_case(
        label, to, axis=axis, force=force, steps=steps, branch={"+": 1, "-": -1, "0": 0}[branch], free=free,
        loads=load, gravity=gravity, control=control, imperfection=imperfection,
    )  # fmt: skip
    _within_reach("--to", chain, load_case.displacement(load_case.length).tolist())
    solver = whole(engine_by_name(engine, _options(segments, foot_segments, placement, shear), chain))
    if csv is not None:
        check_writable(csv.parent)
    with terminal.progress() as progress:
        path = solver.trace(chain, load_case, lambda done: progress("path", round(100 * done), 100))
    if csv is not None:
        write_curve(path, csv)
    console = terminal.console()
    console.print(tables.path_table(path))
    for line in tables.event_lines(path):
        console.print(line, soft_wrap=True)
    if csv is not None:
        console.print(f"path: {csv}", soft_wrap=True)
    return _gave_up([path])


@app.command
def buckling(
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
    shear: Shear = False,
    to: Annotated[
        float | None, Parameter(help="How far to go, mm, with --force N; 4 mm by default, 14 where that says more.")
    ] = None,
    free: Free = "",
    force: Force = False,
    jobs: Annotated[int, Parameter(help="Processes; 0 is one a core.")] = 1,
    json: Json = False,
) -> int:
    """Stiffness, critical points and post-buckling stiffness."""
    if to is not None and not to > 0.0:
        raise UsageError(f"--to: the reach must be positive, not {to}; --direction gives the sign")
    if force and to is None:
        raise UsageError("--to: with --force say up to how many N")
    chain, whole = loaded(model)
    options = _options(segments, foot_segments, placement, shear)
    solvers = [whole(engine_by_name(name, options, chain)) for name in engine]
    directions = (
        [Direction.TENSION if direction == "+" else Direction.COMPRESSION] if direction else list(Direction)
    )
    labels = postures(chain, posture)
    cases = [(label, way, solver) for label in labels for way in directions for solver in solvers]
    tasks = []
    for label, way, solver in cases:
        end = way.sign * to if to is not None else ramp_end(chain, label, way)
        load_case = parsed_load_case(label, end, force=force, free=free, control=TO_LIMIT if force else RAMP)
        _within_reach("--to", chain, load_case.displacement(load_case.length).tolist())
        tasks.append(Task(solver, chain, load_case))
    with terminal.progress(quiet=json) as progress:
        results = trace_all(tasks, min(_jobs(jobs), len(tasks)), lambda done, total: progress("paths", done, total))
    found: dict[str, dict[str, dict[str, PathMetrics]]] = {}
    paths: list[Path] = []
    for (label, way, solver), path in zip(cases, results, strict=True):
        if isinstance(path, Failure):
            gave_up = path.kind == NoConvergenceError.__name__
            raise NoConvergenceError(path.message) if gave_up else UsageError(path.message)
        paths.append(path)
        found.setdefault(label, {}).setdefault(str(way), {})[solver.label] = path_metrics(path)
    document = BucklingDocument(model=chain.name, model_sha256=chain.sha256, version=__version__, chain=found)
    if json:
        sys.stdout.write(as_json(document))
    else:
        terminal.console().print(tables.metrics_table(document))
    return _gave_up(paths)


@app.command
def stiffness(
    model: Model,
    *,
    posture: Posture = None,
    wrench: Annotated[
        str | None,
        Parameter(allow_leading_hyphen=True, help="fx,fy,fz,mx,my,mz in N and N mm on the free end-effector."),
    ] = None,
    displacement: Annotated[
        str | None, Parameter(allow_leading_hyphen=True, help="ux,uy,uz,rx,ry,rz in mm and rad, imposed.")
    ] = None,
    engine: Annotated[str, Parameter(help="vjm-paper, vjm, or vjm-<n>f<m>.")] = "vjm",
    segments: Segments = None,
    foot_segments: FootSegments = None,
    placement: PlacementOption = Placement.BEST,
    json: Json = False,
) -> int:
    """The loaded equilibrium: deflection, wrench, 6×6 stiffness (18) and the unloaded one, stability."""
    if wrench is not None and displacement is not None:
        raise UsageError("give --wrench or --displacement, not both: one imposes the other")
    chain, _ = loaded(model)
    solver = engine_by_name(engine, _options(segments, foot_segments, placement, shear=False), chain)
    if not isinstance(solver, VjmEngine):
        raise UsageError(f"--engine {engine}: `validate stiffness` needs vjm-paper, vjm or vjm-<n>f<m>")
    label = postures(chain, (posture,) if posture else ())[0]
    if not isinstance(chain, Chain):
        control, values = ("wrench", wrench) if wrench is not None else ("displacement", displacement)
        numbers = _six(f"--{control}", values or ZERO)
        if control == "displacement":
            _within_reach("--displacement", chain, numbers)
        document = stiffness_document(chain, solver, label, control, numbers)
    elif wrench is not None:
        document = under_wrench(chain, solver, label, _six("--wrench", wrench))
    else:
        imposed = _six("--displacement", displacement or ZERO)
        _within_reach("--displacement", chain, imposed)
        document = under_displacement(chain, solver, label, imposed)
    if json:
        sys.stdout.write(as_json(document))
    else:
        tables.stiffness(terminal.console(), document)
    return OK


def _options(segments: int | None, foot_segments: int | None, placement: Placement, shear: bool) -> EngineOptions:
    _positive("--segments", segments)
    _positive("--foot-segments", foot_segments)
    return EngineOptions(segments, foot_segments, placement, shear)


def _positive(name: str, value: int | None) -> None:
    if value is not None and value < 1:
        raise UsageError(f"{name}: must be at least 1, not {value}")


def _jobs(jobs: int) -> int:
    if jobs < 0:
        raise UsageError(f"--jobs: must be at least 1, not {jobs}")
    return jobs or len(os.sched_getaffinity(0))


def _six(name: str, text: str) -> list[float]:
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        raise UsageError(f"{name}: '{text}' is not six numbers separated by commas") from None
    if len(values) != 6:
        raise UsageError(f"{name}: needs six numbers separated by commas, got {len(values)}")
    if not all(abs(value) < float("inf") for value in values):
        raise UsageError(f"{name}: must be finite, got '{text}'")
    return values


def _within_reach(name: str, chain: Chain, displacement: Sequence[float]) -> None:
    """Refuse displacements that leave the machine's own size: no spring is linear there."""
    size, reach = max(abs(v) for v in displacement[:3]), chain.characteristic_length
    if size > reach:
        raise UsageError(f"{name}: {size:g} mm is out of reach: {chain.name}'s longest part has {reach:g} mm")
    turn = max(abs(v) for v in displacement[3:])
    if turn > 3.0:
        raise UsageError(f"{name}: {turn:g} rad is out of reach: rotations end short of half a turn, at 3 rad")


def _gave_up(paths: Sequence[Path]) -> int:
    """Say where paths ended early; an engine that stops at its first event by its nature has not given up."""
    early = [path for path in paths if not path.complete and path.engine != FROZEN]
    for path in early:
        terminal.error(f"{path.engine}, posture {path.load_case.posture}: {path.stopped}")
    return GAVE_UP if early else OK


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command and exit with its status."""
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status; errors become one line."""
    try:
        result = app(arguments, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        terminal.error(" ".join(str(error).split()))
        return BAD_INPUT
    except NoConvergenceError as error:
        terminal.error(str(error))
        return GAVE_UP
    except (ValueError, OSError, ImportError) as error:
        terminal.error(terminal.one_line(error))
        return BAD_INPUT
    except KeyboardInterrupt:
        terminal.error("interrupted")
        return INTERRUPTED
    return result if isinstance(result, int) else OK
