"""The commands on loaded equilibria.

``validate stiffness`` gives stiffness matrices and compliance shares, ``validate modes`` natural frequencies,
``validate compensate`` the joint coordinates that put the loaded tool where it should be along a path.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from vjm.analysis import stiffness
from vjm.design.modes import modes
from vjm.design.shares import shares as shares_of
from vjm.engines import EngineOptions, VjmEngine, engine_by_name
from vjm_output import terminal
from vjm_output.documents import doubt_rows
from vjm_validation.cli import OK, UsageError, tables
from vjm_validation.cli.contents import modes_content
from vjm_validation.cli.options import (
    ENGINE_CHOICE,
    NO_LOADS,
    ActingLoads,
    EndFrame,
    EngineChoice,
    GravityOption,
    Model,
    Posture,
    Segments,
    Wrench,
    acceleration,
    beyond_calibration,
    considered,
    positive,
    segments_of,
    six_or_none,
    within_reach,
)
from vjm_validation.cli.pages import OUTPUT, Output
from vjm_validation.compensation import CompensationDocument, compensation, read_tool_path, write_commands
from vjm_validation.design_documents import (
    modes_document,
    shares_lines,
    shares_row,
    shares_table,
    stiffness_document,
)
from vjm_validation.documents import StiffnessDocument
from vjm_validation.load_any_model import in_postures, loaded
from vjm_validation.page_content import Content, ReportTable

if TYPE_CHECKING:
    from vjm_output.plots import Picture


def stiffness_(
    model: Model,
    *,
    posture: Posture = None,
    wrench: Annotated[
        str | None,
        Parameter(help="fx,fy,fz,mx,my,mz in N and N mm on the free end-effector."),
    ] = None,
    displacement: Annotated[str | None, Parameter(help="ux,uy,uz,rx,ry,rz in mm and rad, imposed.")] = None,
    acting: ActingLoads = NO_LOADS,
    end: EndFrame = "",
    shares: Annotated[
        bool,
        Parameter(
            negative="", help="What each joint, beam, spring and bearing adds; in all postures if none is given."
        ),
    ] = False,
    engine: Annotated[str, Parameter(help="See `validate list`.")] = "vjm",
    springs: EngineChoice = ENGINE_CHOICE,
    output: Output = OUTPUT,
) -> int:
    """The loaded equilibrium: deflection, wrench, 6×6 stiffness (18) and the unloaded one, stability."""
    if wrench is not None and displacement is not None:
        raise UsageError("give --wrench or --displacement, not both: one imposes the other")
    if shares and wrench is None and displacement is None and acting == NO_LOADS:
        raise UsageError("--shares: say under which load: give --wrench, --displacement, --gravity or --load")
    output.check()
    chain = loaded(model, shear=springs.sheared)
    doubts = considered(model, output.strict, weighed=bool(acting.gravity))
    solver = springs.engine(engine, chain)
    chain, labels = in_postures(chain, (posture,) if posture else ())
    imposed = six_or_none("--displacement", displacement)
    if imposed is not None:
        within_reach("--displacement", chain, imposed)
    on_end, loads, weight = six_or_none("--wrench", wrench), acting.parsed, acting.acceleration
    result = stiffness(
        chain, labels[0], displacement=imposed, wrench=on_end, engine=solver, gravity=weight, loads=loads, end=end
    )
    rows = []
    if shares:
        if not isinstance(solver, VjmEngine):
            raise UsageError(f"--shares: {solver.label} has no springs of which to tell: take vjm or vjm-paper")
        rows = [
            shares_row(
                shares_of(
                    chain, label, displacement=imposed, wrench=on_end, gravity=weight, loads=loads, end=end,
                    engine=solver,
                )
            )
            for label in labels
        ]  # fmt: skip
    document = stiffness_document(result).model_copy(
        update={"doubts": doubt_rows(doubts), "shares": rows, "loads": acting.words(wrench)}
    )

    def told(console: Console) -> None:
        tables.stiffness(console, document)
        for row in document.shares:
            console.print(shares_table(row).for_terminal())
            for line in shares_lines(row):
                console.print(line, soft_wrap=True)

    output.show(document, lambda: _stiffness_content(document), told)
    return OK


def _stiffness_content(document: StiffnessDocument) -> Content:
    def draw() -> list[Picture]:
        from vjm_validation.report.command_pages import shares_picture, stiffness_picture

        # what is asked for comes first: it is what --plot writes
        pictures = [shares_picture(document.model, document.shares)] if document.shares else []
        if document.stiffness_loaded is not None and document.stiffness_unloaded is not None:
            matrices = np.array([document.stiffness_loaded, document.stiffness_unloaded])
            pictures.append(stiffness_picture(document.model, *matrices))
        return pictures

    state = "of unknown stability: this engine does not examine it" if document.stable is None else "stable"
    return Content(
        f"{document.model}, posture {document.posture}, {document.engine}: stiffness",
        [
            f"The loaded equilibrium is {state}.",
            *document.events,
            *(line for row in document.shares for line in shares_lines(row)),
        ],
        [*tables.stiffness_tables(document), *map(shares_table, document.shares)],
        draw,
    )


def modes_(
    model: Model,
    *,
    posture: Posture = None,
    number: Annotated[int, Parameter(help="How many frequencies.")] = 6,
    wrench: Wrench = None,
    displacement: Annotated[
        str | None,
        Parameter(help="ux,uy,uz,rx,ry,rz in mm and rad at which the end is held; zeros hold it as it is."),
    ] = None,
    acting: ActingLoads = NO_LOADS,
    end: EndFrame = "",
    springs: EngineChoice = ENGINE_CHOICE,
    output: Output = OUTPUT,
) -> int:
    """Natural frequencies and shapes of the loaded machine; divergence and flutter."""
    positive("--number", number)
    if displacement is not None and (wrench is not None or acting != NO_LOADS or end):
        raise UsageError("--displacement holds the end: leave out --wrench, --gravity, --load and --end")
    output.check()
    machine = loaded(model, shear=springs.sheared)
    doubts = considered(model, output.strict, weighed=bool(acting.gravity))
    solver = springs.lumped(machine)
    machine, (label, *_) = in_postures(machine, (posture,) if posture else ())
    held = six_or_none("--displacement", displacement)
    if held is not None:
        within_reach("--displacement", machine, held)
    result = modes(
        machine, label, number=number, wrench=six_or_none("--wrench", wrench), displacement=held,
        gravity=acting.acceleration, loads=acting.parsed, end=end, engine=solver,
    )  # fmt: skip
    document = modes_document(result).model_copy(
        update={"doubts": doubt_rows(doubts), "loads": acting.words(wrench)}
    )
    output.show(document, lambda: modes_content(result, document, number))
    return OK


def compensate_(
    model: Model,
    path: Annotated[
        Path, Parameter(help="CSV: x_mm,y_mm,z_mm[,rx_rad,ry_rad,rz_rad][,fx_N..mz_Nmm]; of a platform from home.")
    ],
    *,
    posture: Posture = None,
    gravity: GravityOption = "",
    end: EndFrame = "",
    engine: Annotated[str, Parameter(help="vjm, vjm-paper or vjm-<n>.")] = "vjm",
    segments: Segments = None,
    out: Annotated[Path | None, Parameter(help="CSV of the coordinates by each model.")] = None,
    output: Output = OUTPUT,
) -> int:
    """Find the joint coordinates that put the loaded tool where it should be, along a path."""
    machine = loaded(model)
    doubts = considered(model, output.strict, weighed=bool(gravity))
    number, parts = segments_of(segments)
    solver = engine_by_name(engine, EngineOptions(number, parts=parts), machine)
    if not isinstance(solver, VjmEngine):
        raise UsageError(f"--engine {engine}: compensation takes vjm, vjm-paper or vjm-<n>")
    if posture is not None:
        machine, (posture,) = in_postures(machine, (posture,))
    output.check(out=out)
    if out is not None and out.suffix != ".csv":
        raise UsageError(f"--out {out}: write a name that ends in .csv")
    wanted = read_tool_path(path)
    document = compensation(machine, solver, wanted, gravity=acceleration(gravity), posture=posture or "", end=end)
    commanded = np.array(document.commands["loaded"])
    doubts += beyond_calibration(machine, dict(zip(document.joints, commanded.T, strict=True)), output.strict)
    document = document.model_copy(update={"doubts": doubt_rows(doubts)})
    if not gravity and not np.any(wanted.wrenches):
        terminal.error(
            "note: no load acts along the path: give it columns fx_N to mz_Nmm, or the machine --gravity"
        )
    if out is not None:
        write_commands(document, out)
    output.show(document, lambda: _compensation_content(document))
    if out is not None and not output.json:
        terminal.console().print(f"{out}", soft_wrap=True)
    return OK


def _compensation_content(document: CompensationDocument) -> Content:
    def draw() -> list[Picture]:
        from vjm_validation.report.command_pages import compensation_picture

        return [compensation_picture(document)]

    left = document.left
    rows = [(name, *(f"{v:.4g}" for v in (e.largest_mm, e.mean_mm, e.largest_rad))) for name, e in left.items()]
    verdict = (
        f"The loaded model leaves {left['loaded'].largest_mm:.3g} mm, the linear "
        f"{left['linear'].largest_mm:.3g} mm, the rigid {left['rigid'].largest_mm:.3g} mm."
    )
    commands = tuple((str(k + 1), *(f"{v:.9g}" for v in row)) for k, row in enumerate(document.commands["loaded"]))
    return Content(
        f"{document.model}, {document.engine}: error of the loaded end at {document.poses} poses",
        [verdict],
        [
            ReportTable(
                "Error of the loaded end",
                ("joints by the model", "largest, mm", "mean, mm", "largest, rad"),
                tuple(rows),
            ),
            ReportTable("Joints by the loaded model", ("pose", *document.joints), commands, printed=False),
        ],
        draw,
    )
