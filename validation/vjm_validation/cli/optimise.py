"""The command ``validate optimise``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm import __version__
from vjm.design.optimum import Optimum, QuantityLimit, limits_of, optimised
from vjm.design.space import DesignSpace
from vjm.design.sweep import SMALLER_IS_BETTER, AskedQuantity, asked, swept
from vjm.errors import NoConvergenceError
from vjm.io.files import check_outputs
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_output.terminal import TerminalTable
from vjm_validation.cli.design_space import Postures, Wrenches, design_space, ranges_of, refuse_nothing
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.load_case_options import GravityOption, LoadOption
from vjm_validation.cli.options import Json, Model, Segments
from vjm_validation.cli.status import INTERRUPTED, NOT_ACCEPTED, OK, UsageError
from vjm_validation.sweep_documents import OptimumDocument, OptimumLimit, OptimumNumber

AGAIN = 1e-5
"""Relative difference of a quantity computed again: results are told to five digits."""


def optimise_(
    model: Model,
    *,
    minimise: Annotated[str, Parameter(help="mass or deflection, perhaps with a component: deflection.z.")] = "",
    maximise: Annotated[str, Parameter(help="critical, frequency or stiffness.z.")] = "",
    such_that: Annotated[str, Parameter(help="Bounds: 'deflection<=0.2; critical>=3*load; frequency>=20'.")] = "",
    vary: Annotated[
        tuple[str, ...], Parameter(consume_multiple=True, help="Numbers of parts with their bounds: KEY=a:b.")
    ] = (),
    starts: Annotated[int, Parameter(help="Starts of the optimiser.")] = 3,
    posture: Postures = (),
    wrench: Wrenches = (),
    gravity: GravityOption = "",
    load: LoadOption = (),
    end: Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")] = "",
    segments: Segments = None,
    out: Annotated[Path | None, Parameter(help="Write the best machine's model file, .toml.")] = None,
    json: Json = False,
    strict: Strict = False,
) -> int:
    """Find the numbers of a model file within bounds that make a machine best and keep limits."""
    objective = asked(minimise or maximise)
    if bool(minimise) == bool(maximise) or (objective.quantity in SMALLER_IS_BETTER) != bool(minimise):
        raise UsageError("say one: --minimise mass or deflection, or --maximise critical, frequency or stiffness")
    limits = limits_of(such_that)
    ranges = ranges_of(vary, counted=False)
    if starts < 1:
        raise UsageError(f"--starts {starts}: take one at least")
    refuse_nothing(wrench or load, gravity, [objective, *(limit.of for limit in limits)])
    if out is not None:
        if out.suffix != ".toml":
            raise UsageError(f"--out {out}: write a name that ends in .toml")
        check_outputs({"--out": out})
    space = design_space(
        model, list(ranges), postures=posture, wrenches=wrench, gravity=gravity, loads=load, end=end,
        segments=segments,
    )  # fmt: skip
    doubts = considered(model, strict, weighed=bool(gravity))
    bounds = np.array([pair[:2] for pair in ranges.values()])
    found: Optimum | None = None
    try:
        with terminal.progress(quiet=json) as progress:

            def tell(count: int, best: float | None) -> None:
                known = "none keeps the limits yet" if best is None else f"best {objective} {best:.6g}"
                progress("machines", count, 0, known)

            found = optimised(space, bounds, objective, limits, starts, tell)
    except KeyboardInterrupt:
        # which the block raises once more at its end, where the best so far is known
        if found is None:
            terminal.error("interrupted before any machine was computed")
            return INTERRUPTED
    found = _computed_again(space, objective, limits, found)
    before = float(swept(space, space.present[None], [objective]).worst[0, 0])
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
            OptimumNumber(
                key=key, unit=unit, before=float(old), value=float(new), at_bound=bool(np.isclose(new, pair).any())
            )
            for key, unit, old, new, pair in zip(
                space.keys, space.units, space.present, found.values, bounds, strict=True
            )
        ],
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
        head = f"# Optimised from {space.files.document.file} by `validate optimise`: {what}.\n"
        title = f"{space.files.document.content['title']}, optimised"
        written = space.changed(found.values).write(out, head, title)
    if json:
        sys.stdout.write(as_json(document))
    else:
        _print(document, written)
    if found.interrupted:
        terminal.error("interrupted: this is the best machine so far")
        return INTERRUPTED
    return OK if found.kept else NOT_ACCEPTED


def _computed_again(
    space: DesignSpace, objective: AskedQuantity, limits: Sequence[QuantityLimit], found: Optimum
) -> Optimum:
    """What was found, with the values that a sweep gives of the machine: nothing of the search is in them.

    Raises:
        NoConvergenceError: they are others than those of the search.
    """
    value, *quantities = swept(space, found.values[None], [objective, *(limit.of for limit in limits)]).worst[0]
    for name, again, was in zip(
        (objective, *limits), (value, *quantities), (found.objective, *found.quantities), strict=True
    ):
        if not abs(again - was) <= AGAIN * abs(was):
            raise NoConvergenceError(
                f"computed again, the best machine has {again:.6g} instead of {was:.6g} ({name}): none is given"
            )
    kept = all(limit.margin(each) >= 0.0 for limit, each in zip(limits, quantities, strict=True))
    return replace(found, objective=float(value), quantities=np.array(quantities), kept=kept)


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
    console.print(table)
    was = "no answer" if document.before is None else f"{document.before:.6g}"
    console.print(f"{document.objective}: {document.value:.6g} {document.unit}, before {was}", soft_wrap=True)
    for limit in document.limits:
        state = "reached" if limit.active else "kept" if document.kept else ""
        console.print(f"{limit.limit}: {limit.value:.6g} {state}".rstrip(), soft_wrap=True)
    if not document.kept:
        console.print("No machine within the bounds was found that keeps all limits; this one misses them least.")
    console.print(
        f"{document.agreeing} of {document.starts} starts ended there; {document.machines} machines were computed.",
        soft_wrap=True,
    )
    for file in written:
        console.print(f"{file}", soft_wrap=True)
