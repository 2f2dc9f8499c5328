"""The command ``validate calibrate``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_updating.calibrate.command import PAGE, STAGES, calibrate, prepare
from vjm_updating.calibrate.summary_text import tables
from vjm_validation.cli.doubts import Strict, warn


def calibrate_(
    data: Annotated[Path, Parameter(help="Readings, CSV; see docs/calibration.md.")],
    *,
    sheet: Annotated[Path, Parameter(help="Test sheet, TOML.")],
    out: Annotated[Path, Parameter(help="Folder for calibration.json, calibrated-model.toml, calibration.html.")],
    fit: Annotated[
        tuple[str, ...],
        Parameter(
            consume_multiple=True,
            help="What to look for: part.factor, part.section, part.EIz, part.diagonal, part.C11, part.matrix, "
            "actuator.compliance; by default one factor for every elastic part.",
        ),
    ] = (),
    next_: Annotated[
        tuple[str, ...],
        Parameter(
            name="--next",
            consume_multiple=True,
            help="Feasible next ramps, POSTURE:END or POSTURE:AXIS:END in mm or rad, such as D:-12 or B:y:2.",
        ),
    ] = (),
    figure: Annotated[
        str, Parameter(help="Predicted figure to make certain next, such as D:compression:F_cr.")
    ] = "",
    json: Annotated[bool, Parameter(negative="", help="Print calibration.json and nothing else.")] = False,
    strict: Strict = False,
) -> int:
    """Fit spring compliances to measured force-displacement readings, with their uncertainty."""
    task = prepare(data, sheet, fit, next_, strict=strict)
    warn(task.findings)
    with terminal.progress(quiet=json) as progress:
        document = calibrate(task, out, figure=figure, progress=lambda done: progress("calibration", done, STAGES))
    if json:
        sys.stdout.write(as_json(document))
        return 0
    console = terminal.console()
    for item in tables(document):
        console.print(item, soft_wrap=isinstance(item, str))
    console.print(f"page: {out / PAGE}", soft_wrap=True)
    return 0
