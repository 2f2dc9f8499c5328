"""The command ``validate calibrate``."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_output.optional_page import page_line
from vjm_updating import calibrate, load_data
from vjm_updating.calibration.document import Calibration
from vjm_updating.calibration.summary_text import tables
from vjm_updating.data_set import FREQUENCIES
from vjm_validation.cli.doubts import Strict
from vjm_validation.cli.measured_data import Beside, Readings, Sheets, load_series, telling
from vjm_validation.cli.status import NOT_ACCEPTED, OK

PAGE = "calibration.html"


def calibrate_(
    data: Readings,
    *,
    sheet: Sheets,
    out: Annotated[Path, Parameter(help="Folder for calibration.json, calibrated-model.toml, calibration.html.")],
    fit: Annotated[
        tuple[str, ...],
        Parameter(
            consume_multiple=True,
            help="What to look for: part.factor, part.section, part.EIz, part.diagonal, part.C11, part.matrix, "
            "actuator.compliance, of frequencies also part.mass; by default one factor for every elastic part. "
            "Of tests of poses or deflections: families, see docs/poses.md.",
        ),
    ] = (),
    next_: Annotated[
        tuple[str, ...],
        Parameter(
            name="--next",
            consume_multiple=True,
            help="Feasible next ramps, POSTURE:END or POSTURE:AXIS:END in mm or rad, such as D:-12 "
            "or B:y:2. Of tests of "
            "poses or deflections: a CSV file of postures, of deflections also loads.",
        ),
    ] = (),
    figure: Annotated[
        str, Parameter(help="Predicted figure to make certain next, such as D:compression:F_cr.")
    ] = "",
    beside: Beside = (),
    for_: Annotated[
        str,
        Parameter(
            name="--for",
            help="Of tests of poses or deflections, where the file will be used: x=400,y=0:200,z=300 in mm of the "
            "end in the base's axes, or a CSV file of postures. The error there is predicted.",
        ),
    ] = "",
    force: Annotated[
        bool,
        Parameter(
            negative="",
            help="Write the calibrated model also where it does not explain the readings, these are mistaken, or "
            "it is no better than the model before it. The file says so.",
        ),
    ] = False,
    json: Annotated[bool, Parameter(negative="", help="Print calibration.json and nothing else.")] = False,
    strict: Strict = False,
) -> int:
    """Fit compliances to measured displacements, poses or natural frequencies, with their uncertainty."""
    with telling("calibration", out, quiet=json) as (told, tell):
        tests = load_series(data, sheet)
        result = calibrate(
            tests,
            fit=fit,
            next_tests=next_,
            figure=figure,
            asked=for_ if "=" in for_ else Path(for_) if for_ else "",
            beside=[load_data(*files) for files in beside],
            force=force,
            strict=strict,
            warn=told,
            progress=tell,
        )
        result.write(out)
    found = result.found
    status = OK if any(result.models.values()) else NOT_ACCEPTED
    if json:
        sys.stdout.write(as_json(found))
        return status
    console = terminal.console()
    items = tables(found) if isinstance(found, Calibration) else result.lines()
    for item in items:
        console.print(item, soft_wrap=isinstance(item, str))
    if result.draw is not None:
        console.print(page_line(out / PAGE), soft_wrap=True)
    if status != OK and isinstance(found, Calibration):
        look = ["validate", "diagnose", *map(str, data), "--sheet", *map(str, sheet), "--out", str(out)]
        # frequencies have no causes
        frequencies = tests[0].kind == FREQUENCIES
        console.print(_not_written(found, "" if frequencies else shlex.join(look)), soft_wrap=True)
    return status


def _not_written(document: Calibration, look: str) -> str:
    """Why no model was written, and what to do: ``look`` is the command that says more, if there is one."""
    remedies = ["--force writes it all the same"]
    if look and not document.fit.fits:
        remedies.insert(0, f"`{look}` looks for what it lacks")
    return f"No calibrated model was written: {'; '.join([*document.unfit, *remedies])}."
