"""The command ``validate diagnose``."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_output.optional_page import page_line
from vjm_updating.diagnosis.command import PAGE, diagnose
from vjm_updating.diagnosis.document import Diagnosis
from vjm_updating.diagnosis.summary_text import lines
from vjm_updating.poses.command import diagnose_poses
from vjm_updating.poses.document import PoseDiagnosis
from vjm_updating.poses.kinds import KINDS
from vjm_updating.poses.sheet import kind_of_sheet
from vjm_updating.poses.summary_text import lines as lines_of_poses
from vjm_validation.cli.doubts import Strict, warn
from vjm_validation.cli.effect_files import EffectFiles, tell_what_runs


def diagnose_(
    data: Annotated[Path, Parameter(help="Readings, CSV; see docs/diagnosis.md, or docs/poses.md.")],
    *,
    sheet: Annotated[Path, Parameter(help="Test sheet, TOML.")],
    out: Annotated[Path, Parameter(help="Folder for diagnosis.json, diagnosis.html, extended-model.toml.")],
    effects: EffectFiles = (),
    only: Annotated[
        tuple[str, ...], Parameter(consume_multiple=True, help="The causes that are thought possible; else all.")
    ] = (),
    without: Annotated[
        tuple[str, ...], Parameter(consume_multiple=True, help="Causes that are ruled out beforehand.")
    ] = (),
    beside: Annotated[
        tuple[tuple[Path, Path], ...],
        Parameter(
            help="DATA SHEET of another specimen: what the findings are worth there, nothing fitted anew. Of tests "
            "of poses: of another series of the machine, only frames and zeros refitted; more than once."
        ),
    ] = (),
    json: Annotated[bool, Parameter(negative="", help="Print diagnosis.json and nothing else.")] = False,
    strict: Strict = False,
) -> int:
    """Show what the model gets wrong, name the cause, extend the model and measure the gain."""
    tell_what_runs(effects)
    with ExitStack() as stack:
        display: Callable[[str, int, int], None] | None = None
        done = 0

        def tell(_: str) -> None:
            # what is refused is refused before anything is begun, in one line
            nonlocal display, done
            display = display or stack.enter_context(terminal.progress(quiet=json))
            done += 1
            display("diagnosis", done, 0)

        if kind := KINDS.get(kind_of_sheet(sheet)):
            if effects:
                raise ValueError(f"{sheet.name}: --effects is for ramps, and this is {kind}")
            document: Diagnosis | PoseDiagnosis = diagnose_poses(
                data, sheet, out, only=only, without=without, beside=beside, strict=strict, warn=warn, progress=tell
            )
        else:
            if len(beside) > 1:
                raise ValueError(f"{sheet.name}: --beside takes one other specimen of a ramp: leave the others out")
            document = diagnose(
                data,
                sheet,
                out,
                plug_ins=effects,
                only=only,
                without=without,
                beside=beside[0] if beside else None,
                strict=strict,
                warn=warn,
                progress=tell,
            )
    if json:
        sys.stdout.write(as_json(document))
        return 0
    console = terminal.console()
    for line in lines_of_poses(document) if isinstance(document, PoseDiagnosis) else lines(document):
        console.print(line, soft_wrap=True)
    console.print(page_line(out / PAGE), soft_wrap=True)
    return 0
