"""The command ``validate all``."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Annotated

from cyclopts import Parameter

from vjm.io.errors import did_you_mean
from vjm.io.files import locked
from vjm.io.findings import Finding
from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_validation.cli import INTERRUPTED, NOT_ACCEPTED, OK, UsageError, tables
from vjm_validation.cli.options import (
    GravityOption,
    Jobs,
    Strict,
    acceleration,
    considered,
    positive,
    processes,
)
from vjm_validation.load_any_model import DIRECTIONS, in_postures, loaded, parsed_directions
from vjm_validation.report.page import chromium, print_page
from vjm_validation.runs import COMPARISONS
from vjm_validation.runs.own_machine import run_own
from vjm_validation.runs.paper import Options, Summary, run_all
from vjm_validation.studies.own_machine import OwnMachineSummary, Request
from vjm_validation.verification.library import library as cases


def all_(
    model: Annotated[
        str | None,
        Parameter(help="Your own machine: a model of the library, or a path to a file. Without: the paper."),
    ] = None,
    *,
    posture: Annotated[
        tuple[str, ...], Parameter(consume_multiple=True, help="Of MODEL: labels; all by default.")
    ] = (),
    direction: Annotated[
        tuple[str, ...],
        Parameter(
            allow_leading_hyphen=True,
            help="Of MODEL: such as x,-z or dx,dy,dz; may be repeated; x,-x,y,-y,z,-z by default.",
        ),
    ] = (),
    force: Annotated[
        float | None, Parameter(help="On MODEL's free end, N; by default what moves it by 0.5 % of its size.")
    ] = None,
    to: Annotated[
        float | None,
        Parameter(help="Of MODEL with passive joints: imposed displacement, mm; 1.3 % of its longest part."),
    ] = None,
    gravity: GravityOption = "",
    out: Annotated[
        FilePath | None, Parameter(help="Folder of the run; a run of the paper that was cut off goes on there.")
    ] = None,
    jobs: Jobs = 0,
    quick: Annotated[bool, Parameter(negative="", help="Postures A and B only, no reach of the rounding.")] = False,
    only: Annotated[
        tuple[str, ...],
        Parameter(consume_multiple=True, help="Comparisons and verification cases, see `validate list`."),
    ] = (),
    steps: Annotated[int | None, Parameter(help="Equal steps of every path; 4000 is the paper's grid.")] = None,
    strict: Strict = False,
    pdf: Annotated[bool, Parameter(negative="", help="Print the report to report.pdf too, by Chromium.")] = False,
    json: Annotated[bool, Parameter(negative="", help="Print summary.json and nothing else.")] = False,
) -> int:
    """Run every comparison of the paper and write the report, or that of a machine of your own."""
    if pdf and not chromium():
        raise UsageError("--pdf: no Chromium is installed: install it, or print the page from a browser")
    folder = out or FilePath("reports") / "runs" / time.strftime("%Y%m%d-%H%M%S")
    if model is not None:
        if quick or only or steps:
            raise UsageError("--quick, --only and --steps are for the paper's report: leave them out with a MODEL")
        for name, value in (("--force", force), ("--to", to)):
            if value is not None and not 0.0 < value < float("inf"):
                raise UsageError(f"{name}: must be positive, not {value:g}; --direction gives the sign")
        # what is wrong with the file is said of the file, before what is doubtful
        in_postures(loaded(model), posture)
        doubts = considered(model, strict, weighed=bool(gravity))
        return _own(
            Request(
                model, posture, parsed_directions(direction), force, to, acceleration(gravity), jobs=processes(jobs)
            ),
            folder,
            doubts,
            pdf=pdf,
            json=json,
        )
    if posture or direction or force is not None or to is not None or gravity:
        raise UsageError("--posture, --direction, --force, --to and --gravity are for a MODEL: name one")
    known = {*COMPARISONS, *(case.name for case in cases())}
    unknown = [name for name in only if name not in known]
    if unknown:
        hint = did_you_mean(unknown[0], known)
        raise UsageError(
            f"--only: no comparison '{unknown[0]}'{hint} (there are {', '.join(COMPARISONS)}, "
            "and the cases of `validate list`)"
        )
    positive("--steps", steps)
    options = Options(folder, processes(jobs), quick, only, steps, _command(quick, only, steps))
    try:
        with locked(folder), terminal.progress(quiet=json) as progress:
            summary = run_all(options, progress)
    except KeyboardInterrupt:
        terminal.error(
            f"interrupted; what is finished is in {folder}: `validate all --out {folder}` goes on from there"
        )
        return INTERRUPTED
    return _said(summary, folder, pdf=pdf, json=json)


def _own(request: Request, folder: FilePath, doubts: Sequence[Finding], *, pdf: bool, json: bool) -> int:
    words = ["validate", "all", request.model]
    words += ["--posture", *request.postures] if request.postures else []
    words += [f"--direction={each}" for each in request.directions] if request.directions != DIRECTIONS else []
    words += [f"--force={request.force:g}"] if request.force else []
    words += [f"--to={request.reach:g}"] if request.reach else []
    words += [f"--gravity={','.join(f'{g:g}' for g in request.gravity)}"] if request.gravity else []
    with locked(folder), terminal.progress(quiet=json) as progress:
        summary = run_own(request, folder, shlex.join(words), progress, doubts)
    return _said(summary, folder, pdf=pdf, json=json)


def _said(summary: Summary | OwnMachineSummary, folder: FilePath, *, pdf: bool, json: bool) -> int:
    if pdf:
        print_page(folder / "index.html", folder / "report.pdf")
    if json:
        sys.stdout.write(as_json(summary))
    else:
        console = terminal.console()
        console.print(tables.acceptance_table(summary.acceptance))
        console.print(f"report: {folder / 'index.html'}", soft_wrap=True)
        if pdf:
            console.print(f"printed: {folder / 'report.pdf'}", soft_wrap=True)
    from vjm_validation.acceptance import accepted

    if not any(row.passed is not None for row in summary.acceptance):
        terminal.error("nothing was checked: no requirement was looked at, so that this run is no pass")
    return OK if accepted(summary.acceptance) else NOT_ACCEPTED


def _command(quick: bool, only: Sequence[str], steps: int | None) -> str:
    words = ["validate", "all"]
    words += ["--quick"] if quick else []
    words += [f"--steps={steps}"] if steps else []
    words += ["--only", *only] if only else []
    return shlex.join(words)
