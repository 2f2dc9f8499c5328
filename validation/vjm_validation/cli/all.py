"""The command ``validate all``."""

from __future__ import annotations

import shlex
import time
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Annotated

from cyclopts import Parameter

from vjm.io.errors import did_you_mean
from vjm.io.files import locked
from vjm_output import terminal
from vjm_validation.cli import tables
from vjm_validation.cli.options import (
    Jobs,
    positive,
    processes,
)
from vjm_validation.cli.status import INTERRUPTED, NOT_ACCEPTED, OK, UsageError
from vjm_validation.studies.run_all import COMPARISONS, Options, run_all
from vjm_validation.verification.library import library as cases


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
    known = {*COMPARISONS, *(case.name for case in cases())}
    unknown = [name for name in only if name not in known]
    if unknown:
        hint = did_you_mean(unknown[0], known)
        raise UsageError(
            f"--only: no comparison '{unknown[0]}'{hint} (there are {', '.join(COMPARISONS)}, "
            "and the cases of `validate list`)"
        )
    positive("--steps", steps)
    folder = out or FilePath("reports") / "runs" / time.strftime("%Y%m%d-%H%M%S")
    options = Options(folder, processes(jobs), quick, only, steps, _command(quick, only, steps))
    try:
        with locked(folder), terminal.progress() as progress:
            summary = run_all(options, progress)
    except KeyboardInterrupt:
        terminal.error(
            f"interrupted; what is finished is in {folder}: `validate all --out {folder}` goes on from there"
        )
        return INTERRUPTED
    console = terminal.console()
    console.print(tables.acceptance_table(summary))
    console.print(f"report: {folder / 'index.html'}", soft_wrap=True)
    return OK if all(row.passed is not False for row in summary.acceptance) else NOT_ACCEPTED


def _command(quick: bool, only: Sequence[str], steps: int | None) -> str:
    words = ["validate", "all"]
    words += ["--quick"] if quick else []
    words += [f"--steps={steps}"] if steps else []
    words += ["--only", *only] if only else []
    return shlex.join(words)
