"""The command ``validate curve``."""

from __future__ import annotations

import sys
from pathlib import Path as FilePath
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from vjm.continuation.path import Path
from vjm.engines import engine_by_name
from vjm.io.path_files import write_curve
from vjm.model.parts import Placement
from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_validation.cli import pages, tables
from vjm_validation.cli.doubts import Strict, along_paths, beyond_calibration, considered
from vjm_validation.cli.load_case_options import GravityOption, LoadOption, parsed_load_case
from vjm_validation.cli.options import (
    Axis,
    FootSegments,
    Force,
    Free,
    Json,
    Model,
    PlacementOption,
    Posture,
    Segments,
    Shear,
    engine_options,
    gave_up,
    positive,
    with_shear,
    within_reach,
)
from vjm_validation.cli.path_words import path_words
from vjm_validation.documents import curve_document
from vjm_validation.load_any_model import in_postures, loaded


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
        pages.draw(plot, report, lambda: _content(path), None)
        return gave_up([path])
    console = terminal.console()
    console.print(tables.path_table(path))
    for line in tables.event_lines(path):
        console.print(line, soft_wrap=True)
    for line in path_words(chain, [(solver, path)]):
        console.print(line, soft_wrap=True)
    if csv is not None:
        console.print(f"path: {csv}", soft_wrap=True)
    pages.draw(plot, report, lambda: _content(path), console)
    return gave_up([path])


def _content(path: Path) -> pages.Content:
    from vjm_validation.report.command_figures import path_pictures
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
