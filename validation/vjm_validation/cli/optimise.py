"""The command ``validate optimise``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from vjm import __version__
from vjm.design.sweep import SMALLER_IS_BETTER, asked, limits_of, optimised, swept
from vjm.io.files import check_writable, write_whole
from vjm.io.toml_text import toml_text
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_validation.cli.design_space import Loading, design_space, ranges_of
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.load_case_options import GravityOption, LoadOption
from vjm_validation.cli.options import Json, Model, Posture, Segments
from vjm_validation.cli.status import NOT_ACCEPTED, OK, UsageError
from vjm_validation.sweep_documents import OptimumDocument, OptimumLimit, OptimumNumber


def optimise_(
    model: Model,
    *,
    minimise: Annotated[str, Parameter(help="mass or deflection, perhaps with a component: deflection.z.")] = "",
    maximise: Annotated[str, Parameter(help="frequency or stiffness, perhaps with a component: stiffness.z.")] = "",
    such_that: Annotated[str, Parameter(help="Bounds: 'deflection<=0.2; frequency>=20'.")] = "",
    vary: Annotated[
        tuple[str, ...], Parameter(consume_multiple=True, help="Numbers of parts with their bounds: KEY=a:b.")
    ] = (),
    starts: Annotated[int, Parameter(help="Starts of the optimiser.")] = 3,
    posture: Posture = None,
    wrench: Annotated[str | None, Parameter(help="fx,fy,fz,mx,my,mz in N and N mm on the free end.")] = None,
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
        raise UsageError("say one: --minimise mass or deflection, or --maximise frequency or stiffness")
    limits = limits_of(such_that)
    ranges = ranges_of(vary, counted=False)
    if starts < 1:
        raise UsageError(f"--starts {starts}: take one at least")
    loading = Loading.of(wrench, gravity, load, end)
    loading.refuse_deflection_of_nothing([objective, *(limit.of for limit in limits)])
    if out is not None:
        if out.suffix != ".toml":
            raise UsageError(f"--out {out}: write a name that ends in .toml")
        check_writable(out.parent)
    space = design_space(str(model), list(ranges), posture, segments, loading)
    doubts = considered(model, strict, weighed=loading.gravity is not None)
    bounds = np.array([pair[:2] for pair in ranges.values()])
    found = optimised(space.at, space.parameters, bounds, space.present, objective, limits, starts)
    before, why = swept(space.at, space.present[None], [objective, *(limit.of for limit in limits)])
    document = OptimumDocument(
        model=str(space.document.content["name"]),
        model_sha256=space.document.sha256,
        version=__version__,
        posture=space.posture,
        objective=str(objective),
        unit=objective.unit,
        before=None if why[0] else float(before[0, 0]),
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
        doubts=doubt_rows(doubts),
    )
    if out is not None:
        content = space.changed(found.values).content
        content["title"] = f"{content['title']}, optimised"
        head = (
            f"# Optimised from {space.document.file} by `validate optimise`: {objective}, such that {such_that}.\n"
        )
        write_whole(out, head + toml_text(content))
    if json:
        sys.stdout.write(as_json(document))
    else:
        _print(document, out)
    return OK if found.kept else NOT_ACCEPTED


def _print(document: OptimumDocument, out: Path | None) -> None:
    console = terminal.console()
    table = Table(
        title=f"{document.model}, posture {document.posture}: best {document.objective}", title_justify="left"
    )
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
    if out is not None:
        console.print(f"{out}", soft_wrap=True)
