"""The command ``validate compensate``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm.engines import EngineOptions, engine_by_name
from vjm.vjm_engine import VjmEngine
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_output.terminal import TerminalTable
from vjm_validation.cli import pages
from vjm_validation.cli.doubts import Strict, beyond_calibration, considered
from vjm_validation.cli.load_case_options import GravityOption, acceleration
from vjm_validation.cli.options import Json, Model, Posture, Segments, segments_of
from vjm_validation.cli.status import OK, UsageError
from vjm_validation.compensation import CompensationDocument, compensation, write_commands
from vjm_validation.load_any_model import in_postures, loaded
from vjm_validation.tool_path import read_tool_path


def compensate_(
    model: Model,
    path: Annotated[
        Path, Parameter(help="CSV: x_mm,y_mm,z_mm[,rx_rad,ry_rad,rz_rad][,fx_N..mz_Nmm]; of a platform from home.")
    ],
    *,
    posture: Posture = None,
    gravity: GravityOption = "",
    end: Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")] = "",
    engine: Annotated[str, Parameter(help="vjm, vjm-paper or vjm-<n>.")] = "vjm",
    segments: Segments = None,
    out: Annotated[Path | None, Parameter(help="CSV of the coordinates by each model.")] = None,
    json: Json = False,
    plot: pages.Plot = None,
    report: pages.Report = None,
    strict: Strict = False,
) -> int:
    """Find the joint coordinates that put the loaded tool where it should be, along a path."""
    machine = loaded(model)
    doubts = considered(model, strict, weighed=bool(gravity))
    number, parts = segments_of(segments)
    solver = engine_by_name(engine, EngineOptions(number, parts=parts), machine)
    if not isinstance(solver, VjmEngine):
        raise UsageError(f"--engine {engine}: compensation takes vjm, vjm-paper or vjm-<n>")
    if posture is not None:
        machine, (posture,) = in_postures(machine, (posture,))
    pages.check(plot, report, out=out)
    if out is not None and out.suffix != ".csv":
        raise UsageError(f"--out {out}: write a name that ends in .csv")
    wanted = read_tool_path(path)
    document = compensation(machine, solver, wanted, gravity=acceleration(gravity), posture=posture or "", end=end)
    commanded = np.array(document.commands["loaded"])
    doubts += beyond_calibration(machine, dict(zip(document.joints, commanded.T, strict=True)), strict)
    document = document.model_copy(update={"doubts": doubt_rows(doubts)})
    if not gravity and not np.any(wanted.wrenches):
        terminal.error(
            "note: no load acts along the path: give it columns fx_N to mz_Nmm, or the machine --gravity"
        )
    if out is not None:
        write_commands(document, out)
    if json:
        sys.stdout.write(as_json(document))
        pages.draw(plot, report, lambda: _content(document), None)
        return OK
    table = TerminalTable(
        title=f"{document.model}, {document.engine}: error of the loaded end at {document.poses} poses"
    )
    for column in ("joints by the model", "largest, mm", "mean, mm", "largest, rad"):
        table.add_column(column, justify="right")
    for name, left in document.left.items():
        table.add_row(name, f"{left.largest_mm:.4g}", f"{left.mean_mm:.4g}", f"{left.largest_rad:.4g}")
    console = terminal.console()
    console.print(table)
    if out is not None:
        console.print(f"{out}", soft_wrap=True)
    pages.draw(plot, report, lambda: _content(document), console)
    return OK


def _content(document: CompensationDocument) -> pages.Content:
    from vjm_validation.report.command_figures import compensation_picture
    from vjm_validation.report.words import ReportTable

    left = document.left
    rows = [(name, *(f"{v:.4g}" for v in (e.largest_mm, e.mean_mm, e.largest_rad))) for name, e in left.items()]
    errors = ReportTable(
        "Error of the loaded end", ("joints by the model", "largest, mm", "mean, mm", "largest, rad"), tuple(rows)
    )
    commands = ReportTable(
        "Joints by the loaded model",
        ("pose", *document.joints),
        tuple((str(k + 1), *(f"{v:.9g}" for v in row)) for k, row in enumerate(document.commands["loaded"])),
    )
    title = f"{document.model}, {document.engine}: compensation along {document.poses} poses"
    verdict = (
        f"The loaded model leaves {left['loaded'].largest_mm:.3g} mm, the linear "
        f"{left['linear'].largest_mm:.3g} mm, the rigid {left['rigid'].largest_mm:.3g} mm."
    )
    return pages.Content(title, verdict, [compensation_picture(document)], [errors, commands])
