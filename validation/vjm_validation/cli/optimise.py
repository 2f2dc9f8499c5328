"""The command ``validate optimise``."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm import __version__
from vjm.design.best_machine import best_machine, objective_of
from vjm.design.optimum import Optimum, limits_of, told_row
from vjm.design.sweep import swept
from vjm.io.catalogues import catalogue, catalogues
from vjm.io.file_parameters import MachineFiles
from vjm.io.files import check_outputs
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_output.terminal import TerminalTable
from vjm_validation.cli.design_space import Postures, Wrenches, design_space, ranges_of, refuse_nothing
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.load_case_options import GravityOption, LoadOption
from vjm_validation.cli.options import Json, Model, Segments
from vjm_validation.cli.status import INTERRUPTED, NOT_ACCEPTED, OK, UsageError
from vjm_validation.sweep_documents import OptimumDocument, OptimumLimit, OptimumNumber, OptimumPart

CATALOGUE = "=catalogue:"
"""Between the key of a section and the name of a catalogue."""


def optimise_(
    model: Model,
    *,
    minimise: Annotated[str, Parameter(help="mass or deflection, perhaps with a component: deflection.z.")] = "",
    maximise: Annotated[str, Parameter(help="critical, frequency or stiffness.z.")] = "",
    such_that: Annotated[str, Parameter(help="Bounds: 'deflection<=0.2; critical>=3*load; frequency>=20'.")] = "",
    vary: Annotated[
        tuple[str, ...],
        Parameter(
            consume_multiple=True,
            help="Numbers of parts with their bounds: KEY=a:b. Sections from a catalogue: KEY=catalogue:tubes.csv, "
            f"a .toml file or one of {', '.join(catalogues())}.",
        ),
    ] = (),
    starts: Annotated[int, Parameter(help="Starts of the optimiser.")] = 3,
    posture: Postures = (),
    wrench: Wrenches = (),
    gravity: GravityOption = "",
    load: LoadOption = (),
    end: Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")] = "",
    segments: Segments = None,
    out: Annotated[Path | None, Parameter(help="Write the best machine's model file, .toml.")] = None,
    state: Annotated[
        Path | None, Parameter(help="Keep what was computed there; the same command goes on after an interrupt.")
    ] = None,
    json: Json = False,
    strict: Strict = False,
) -> int:
    """Find the numbers of a model file within bounds that make a machine best and keep limits."""
    try:
        objective = objective_of(minimise, maximise)
    except ValueError as error:
        raise UsageError(re.sub(r"\b(m..imise)", r"--\1", str(error))) from None
    limits = limits_of(such_that)
    listed = [text for text in vary if CATALOGUE in text]
    chosen = {key.strip(): catalogue(name) for key, _, name in (text.partition(CATALOGUE) for text in listed)}
    if len(chosen) < len(listed):
        raise UsageError("--vary: a part stands twice: give one catalogue")
    ranges = ranges_of([text for text in vary if text not in listed], counted=False, needed=not chosen)
    bounds = {key: (low, high) for key, (low, high, _) in ranges.items()}
    if starts < 1:
        raise UsageError(f"--starts {starts}: take one at least")
    refuse_nothing(wrench or load, gravity, [objective, *(limit.of for limit in limits)])
    if out is not None:
        if out.suffix != ".toml":
            raise UsageError(f"--out {out}: write a name that ends in .toml")
        check_outputs({"--out": out})
    if state is not None:
        check_outputs({"--state": state})
    space = design_space(
        model, list(ranges), postures=posture, wrenches=wrench, gravity=gravity, loads=load, end=end,
        segments=segments,
    )  # fmt: skip
    doubts = considered(model, strict, weighed=bool(gravity))
    found: Optimum | None = None
    try:
        with terminal.progress(quiet=json) as progress:

            def tell(count: int, best: float | None) -> None:
                known = "none keeps the limits yet" if best is None else f"best {objective} {best:.6g}"
                progress("machines", count, 0, known)

            found = best_machine(space, bounds, chosen, objective, limits, starts, tell, state)
    except KeyboardInterrupt:
        # which the block raises once more at its end, where the best so far is known
        if found is None:
            terminal.error(f"interrupted before any machine was computed{_goes_on(state)}")
            return INTERRUPTED
    before = float(swept(space, space.present[None], [objective]).worst[0, 0])
    best = found.best
    assert isinstance(best, MachineFiles)
    machine = space.files.machine()
    document = OptimumDocument(
        model=machine.name,
        model_sha256=machine.sha256,
        version=__version__,
        postures=list(dict.fromkeys(case.posture for case in space.cases)),
        wrenches=list(dict.fromkeys(case.wrench_text for case in space.cases if case.wrench_text)),
        objective=str(objective),
        unit=objective.unit,
        before=before if np.isfinite(before) else None,
        value=found.objective,
        kept=found.kept,
        numbers=[
            OptimumNumber(key=key, unit=unit, before=float(old), value=float(new), at_bound=row["at_bound"])
            for row, key, unit, old, new in zip(
                found.table(), space.keys, space.units, space.present, found.values, strict=False
            )
        ],
        parts=[OptimumPart(key=key, row=dict(row)) for key, row in found.chosen.items()],
        limits=[
            OptimumLimit(limit=str(limit), value=float(value), active=abs(limit.margin(float(value))) < 1e-4)
            for limit, value in zip(limits, found.quantities, strict=True)
        ],
        starts=found.starts,
        agreeing=found.agreeing,
        machines=found.evaluations,
        interrupted=found.interrupted,
        doubts=doubt_rows(doubts),
    )
    written: list[Path] = []
    if out is not None:
        bounded = "; ".join(str(limit) for limit in limits)
        what = f"{objective}, such that {bounded}" if bounded else f"{objective}, with no limits"
        head = f"# Optimised from {best.document.file} by `validate optimise`: {what}.\n"
        written = best.write(out, head, f"{best.document.content['title']}, optimised")
    if json:
        sys.stdout.write(as_json(document))
    else:
        _print(document, written)
    if found.interrupted:
        terminal.error(f"interrupted: this is the best machine so far{_goes_on(state)}")
        return INTERRUPTED
    return OK if found.kept else NOT_ACCEPTED


def _goes_on(state: Path | None) -> str:
    return "" if state is None else f"; what was computed is in {state}: the same command goes on"


def _print(document: OptimumDocument, written: Sequence[Path]) -> None:
    console = terminal.console()
    cases = len(document.postures) * max(len(document.wrenches), 1)
    where = f"posture {document.postures[0]}" if cases == 1 else f"the worst of {cases} cases"
    table = TerminalTable(title=f"{document.model}, {where}: best {document.objective}", title_justify="left")
    for name in ("number", "unit", "before", "best", ""):
        table.add_column(name, justify="right")
    for row in document.numbers:
        table.add_row(
            row.key, row.unit, f"{row.before:.6g}", f"{row.value:.6g}", "at its bound" if row.at_bound else ""
        )
    for part in document.parts:
        table.add_row(part.key, "", "", told_row(part.row), "of the catalogue")
    console.print(table)
    was = "no answer" if document.before is None else f"{document.before:.6g}"
    console.print(f"{document.objective}: {document.value:.6g} {document.unit}, before {was}", soft_wrap=True)
    for limit in document.limits:
        state = "reached" if limit.active else "kept" if document.kept else ""
        console.print(f"{limit.limit}: {limit.value:.6g} {state}".rstrip(), soft_wrap=True)
    if not document.kept:
        console.print("No machine within the bounds was found that keeps all limits; this one misses them least.")
    there = f"{document.agreeing} of {document.starts} starts ended there; " if document.starts else ""
    console.print(f"{there}{document.machines} machines were computed.", soft_wrap=True)
    for file in written:
        console.print(f"{file}", soft_wrap=True)
