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
from vjm_updating.calibration.command import PAGE, STAGES, calibrate, prepare
from vjm_updating.calibration.document import Calibration
from vjm_updating.calibration.summary_text import tables
from vjm_updating.joint.command import calibrate_joint
from vjm_updating.poses.command import calibrate_poses
from vjm_updating.poses.kinds import KINDS
from vjm_updating.poses.sheet import kind_of_sheet
from vjm_updating.poses.summary_text import lines as lines_of_poses
from vjm_validation.cli.doubts import Strict, warn
from vjm_validation.cli.status import NOT_ACCEPTED, OK


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
            "actuator.compliance; by default one factor for every elastic part. Of tests of poses "
            "or deflections: families, see docs/poses.md.",
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
    force: Annotated[
        bool,
        Parameter(
            negative="",
            help="Write the calibrated model also where it does not explain the readings, or these are mistaken.",
        ),
    ] = False,
    json: Annotated[bool, Parameter(negative="", help="Print calibration.json and nothing else.")] = False,
    strict: Strict = False,
) -> int:
    """Fit spring compliances to measured force-displacement readings, with their uncertainty."""
    if kind_of_sheet(sheet) == "joint":
        return _by_joint(data, sheet, out, [*fit, *next_, *([figure] if figure else [])], force=force, json=json,
                         strict=strict)  # fmt: skip
    if kind := KINDS.get(kind_of_sheet(sheet)):
        if force:
            raise ValueError(
                f"--force: {sheet.name} is {kind}, whose model is written unless no machine is so: leave it out"
            )
        return _by_poses(kind, data, sheet, out, fit, next_, figure, json=json, strict=strict)
    task = prepare(data, sheet, fit, next_, strict=strict, force=force)
    warn(task.findings)
    with terminal.progress(quiet=json) as progress:
        document = calibrate(
            task, out, figure=figure, force=force, progress=lambda done: progress("calibration", done, STAGES)
        )
    status = OK if document.calibrated_model else NOT_ACCEPTED
    if json:
        sys.stdout.write(as_json(document))
        return status
    console = terminal.console()
    for item in tables(document):
        console.print(item, soft_wrap=isinstance(item, str))
    console.print(page_line(out / PAGE), soft_wrap=True)
    if status != OK:
        console.print(_not_written(document, data, sheet, out), soft_wrap=True)
    return status


def _by_joint(
    data: Path, sheet: Path, out: Path, options: list[str], *, force: bool, json: bool, strict: bool
) -> int:
    if options:
        raise ValueError(
            f"{sheet.name}: is a test of one joint: stiffness, hardening, backlash and friction are looked for; "
            "leave --fit, --next and --figure out"
        )
    with terminal.progress(quiet=json) as progress:
        done = 0

        def tell(_: str) -> None:
            nonlocal done
            done += 1
            progress("calibration", done, 0)

        document = calibrate_joint(data, sheet, out, force=force, strict=strict, warn=warn, progress=tell)
    status = OK if document.calibrated_model else NOT_ACCEPTED
    if json:
        sys.stdout.write(as_json(document))
        return status
    console = terminal.console()
    for item in tables(document):
        console.print(item, soft_wrap=isinstance(item, str))
    if status != OK:
        console.print(_not_written(document, data, sheet, out), soft_wrap=True)
    return status


def _not_written(document: Calibration, data: Path, sheet: Path, out: Path) -> str:
    look = shlex.join(["validate", "diagnose", str(data), "--sheet", str(sheet), "--out", str(out)])
    remedies = ["--force writes it all the same"]
    if not document.fit.fits:
        remedies.insert(0, f"`{look}` looks for what it lacks")
    return f"No calibrated model was written: {'; '.join([*document.unfit, *remedies])}."


def _by_poses(
    kind: str,
    data: Path,
    sheet: Path,
    out: Path,
    fit: tuple[str, ...],
    next_: tuple[str, ...],
    figure: str,
    *,
    json: bool,
    strict: bool,
) -> int:
    if figure or len(next_) > 1:
        raise ValueError(f"{sheet.name}: is {kind}, which has no --figure, and --next takes one CSV file")
    with terminal.progress(quiet=json) as progress:
        done = 0

        def tell(_: str) -> None:
            nonlocal done
            done += 1
            progress("calibration", done, 0)

        candidates = Path(next_[0]) if next_ else None
        document = calibrate_poses(
            data, sheet, out, families=fit, candidates=candidates, strict=strict, warn=warn, progress=tell
        )
    status = NOT_ACCEPTED if document.written.refused else OK
    if json:
        sys.stdout.write(as_json(document))
        return status
    console = terminal.console()
    for line in lines_of_poses(document):
        console.print(line, soft_wrap=True)
    console.print(page_line(out / PAGE), soft_wrap=True)
    return status
