"""The commands on loaded equilibria.

``validate stiffness`` gives stiffness matrices and compliance shares, ``validate modes`` natural frequencies,
``validate compensate`` the joint coordinates that put the loaded tool where it should be along a path.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm.analysis import stiffness
from vjm.design.modes import Modes, modes
from vjm.engines import Engine, EngineOptions, VjmEngine, engine_by_name
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.model.parts import Placement
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_output.terminal import TerminalTable
from vjm_validation.cli import OK, UsageError, pages, tables
from vjm_validation.cli.options import (
    FootSegments,
    GravityOption,
    Json,
    LoadOption,
    Model,
    PlacementOption,
    Posture,
    Segments,
    Shear,
    Strict,
    acceleration,
    beyond_calibration,
    considered,
    engine_options,
    parsed_load,
    positive,
    segments_of,
    six,
    with_shear,
    within_reach,
)
from vjm_validation.compensation import CompensationDocument, compensation, read_tool_path, write_commands
from vjm_validation.design_documents import (
    MODES_HEADER,
    modes_cells,
    modes_document,
    modes_lines,
    print_modes,
    stiffness_document,
)
from vjm_validation.documents import ModesDocument, SharesRow, StiffnessDocument
from vjm_validation.load_any_model import in_postures, loaded


def stiffness_(
    model: Model,
    *,
    posture: Posture = None,
    wrench: Annotated[
        str | None,
        Parameter(help="fx,fy,fz,mx,my,mz in N and N mm on the free end-effector."),
    ] = None,
    displacement: Annotated[str | None, Parameter(help="ux,uy,uz,rx,ry,rz in mm and rad, imposed.")] = None,
    gravity: GravityOption = "",
    load: LoadOption = (),
    end: Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")] = "",
    shares: Annotated[
        bool,
        Parameter(
            negative="", help="What each joint, beam, spring and bearing adds; in all postures if none is given."
        ),
    ] = False,
    engine: Annotated[str, Parameter(help="See `validate list`.")] = "vjm",
    segments: Segments = None,
    foot_segments: FootSegments = None,
    placement: PlacementOption = Placement.BEST,
    shear: Shear = None,
    json: Json = False,
    plot: pages.Plot = None,
    report: pages.Report = None,
    strict: Strict = False,
) -> int:
    """The loaded equilibrium: deflection, wrench, 6×6 stiffness (18) and the unloaded one, stability."""
    if wrench is not None and displacement is not None:
        raise UsageError("give --wrench or --displacement, not both: one imposes the other")
    if shares and wrench is None and displacement is None and not gravity and not load:
        raise UsageError("--shares: say under which load: give --wrench, --displacement, --gravity or --load")
    pages.check(plot, report)
    chain = loaded(model, shear=with_shear(shear))
    doubts = considered(model, strict, weighed=bool(gravity))
    solver = engine_by_name(engine, engine_options(segments, foot_segments, placement), chain)
    chain, labels = in_postures(chain, (posture,) if posture else ())
    label = labels[0]
    imposed = None if displacement is None else six("--displacement", displacement)
    if imposed is not None:
        within_reach("--displacement", chain, imposed)
    on_end = None if wrench is None else six("--wrench", wrench)
    acting = [parsed_load(text) for text in load]
    weight = acceleration(gravity)
    loaded_stiffness = stiffness(
        chain, label, displacement=imposed, wrench=on_end, engine=solver, gravity=weight, loads=acting, end=end
    )
    rows = _shares(chain, labels, imposed, on_end, weight, acting, end, solver) if shares else []
    document = stiffness_document(loaded_stiffness).model_copy(
        update={"doubts": doubt_rows(doubts), "shares": rows}
    )
    if json:
        sys.stdout.write(as_json(document))
    else:
        tables.stiffness(terminal.console(), document)
        if rows:
            from vjm_validation.design_documents import print_shares

            print_shares(terminal.console(), rows)
    pages.draw(plot, report, lambda: _stiffness_content(document), None if json else terminal.console())
    return OK


def _shares(
    machine: Machine,
    labels: list[str],
    displacement: list[float] | None,
    wrench: list[float] | None,
    gravity: Gravity | None,
    loads: list[Load],
    end: str,
    engine: Engine,
) -> list[SharesRow]:
    """The shares in each posture.

    Raises:
        UsageError: the engine has no springs.
    """
    from vjm.design.shares import shares
    from vjm.engines import VjmEngine
    from vjm_validation.design_documents import shares_row

    if not isinstance(engine, VjmEngine):
        raise UsageError(f"--shares: {engine.label} has no springs of which to tell: take vjm or vjm-paper")
    return [
        shares_row(
            shares(
                machine, label, displacement=displacement, wrench=wrench, gravity=gravity, loads=loads, end=end,
                engine=engine,
            )
        )
        for label in labels
    ]  # fmt: skip


def _stiffness_content(document: StiffnessDocument) -> pages.Content:
    from vjm_validation.report.command_pages import stiffness_picture
    from vjm_validation.report.words import ReportTable

    rigid = document.stiffness_loaded is None or document.stiffness_unloaded is None
    if rigid:
        # infinitely stiff against some wrench: the compliance is what there is
        matrices = {"loaded": document.compliance_loaded, "unloaded": document.compliance_unloaded}
        words, rows, columns = "compliance; mm/N, 1/N, rad/(N mm)", tables.POSE_AXES, tables.WRENCH_AXES
    else:
        matrices = {
            "K^F loaded, eq. (18)": document.stiffness_loaded,
            "K unloaded, eq. (5)": document.stiffness_unloaded,
        }
        words, rows, columns = "N/mm, N/rad, N mm/rad", tables.WRENCH_AXES, tables.POSE_AXES
    shown = [
        ReportTable(
            f"{title}; {words}",
            ("", *columns),
            tuple((rows[k], *(f"{v:.6g}" for v in row)) for k, row in enumerate(matrix)),
        )
        for title, matrix in matrices.items()
        if matrix is not None
    ]
    pictures = []
    if not rigid:
        pictures = [stiffness_picture(document.model, *(np.array(matrix) for matrix in matrices.values()))]
    sentences = list(document.events)
    if document.shares:
        from vjm_validation.design_documents import SHARES_HEADER, shares_cells, shares_lines
        from vjm_validation.report.command_pages import shares_picture

        # what is asked for comes first: it is what --plot writes
        pictures = [shares_picture(document.model, document.shares), *pictures]
        for row in document.shares:
            title = f"Shares in the deflection, posture {row.posture}"
            shown.append(ReportTable(title, SHARES_HEADER, tuple(shares_cells(row)), words=2))
            sentences += shares_lines(row)
    state = "of unknown stability: this engine does not examine it" if document.stable is None else "stable"
    title = f"{document.model}, posture {document.posture}, {document.engine}: stiffness"
    return pages.Content(title, f"The loaded equilibrium is {state}.", pictures, shown, sentences)


def modes_(
    model: Model,
    *,
    posture: Posture = None,
    number: Annotated[int, Parameter(help="How many frequencies.")] = 6,
    wrench: Annotated[str | None, Parameter(help="fx,fy,fz,mx,my,mz in N and N mm on the free end.")] = None,
    displacement: Annotated[
        str | None,
        Parameter(help="ux,uy,uz,rx,ry,rz in mm and rad at which the end is held; zeros hold it as it is."),
    ] = None,
    gravity: GravityOption = "",
    load: LoadOption = (),
    end: Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")] = "",
    segments: Segments = None,
    foot_segments: FootSegments = None,
    placement: PlacementOption = Placement.BEST,
    shear: Shear = None,
    json: Json = False,
    plot: pages.Plot = None,
    report: pages.Report = None,
    strict: Strict = False,
) -> int:
    """Natural frequencies and shapes of the loaded machine; divergence and flutter."""
    positive("--number", number)
    if displacement is not None and (wrench is not None or gravity or load or end):
        raise UsageError("--displacement holds the end: leave out --wrench, --gravity, --load and --end")
    pages.check(plot, report)
    machine = loaded(model, shear=with_shear(shear))
    doubts = considered(model, strict, weighed=bool(gravity))
    solver = engine_by_name("vjm", engine_options(segments, foot_segments, placement), machine)
    assert isinstance(solver, VjmEngine)
    machine, (label, *_) = in_postures(machine, (posture,) if posture else ())
    held = None if displacement is None else six("--displacement", displacement)
    if held is not None:
        within_reach("--displacement", machine, held)
    natural_modes = modes(
        machine, label, number=number, wrench=None if wrench is None else six("--wrench", wrench),
        displacement=held, gravity=acceleration(gravity), loads=[parsed_load(text) for text in load], end=end,
        engine=solver,
    )  # fmt: skip
    document = modes_document(natural_modes).model_copy(update={"doubts": doubt_rows(doubts)})
    if json:
        sys.stdout.write(as_json(document))
    else:
        print_modes(terminal.console(), document, number)
    pages.draw(
        plot, report, lambda: _modes_content(natural_modes, document, number), None if json else terminal.console()
    )
    return OK


def _modes_content(natural_modes: Modes, document: ModesDocument, wanted: int) -> pages.Content:
    from vjm_validation.report.command_pages import modes_picture
    from vjm_validation.report.words import ReportTable

    verdict, *others = modes_lines(document, wanted)
    table = ReportTable("Natural frequencies", MODES_HEADER, tuple(modes_cells(document)))
    title = f"{document.model}, posture {document.posture}: natural frequencies"
    return pages.Content(title, verdict, [modes_picture(natural_modes)], [table], others)


def compensate_(
    model: Model,
    path: Annotated[
        Path, Parameter(help="CSV: x_mm,y_mm,z_mm[,rx_rad,ry_rad,rz_rad][,fx_N..mz_Nmm]; of a platform from home.")
    ],
    *,
    posture: Posture = None,
    gravity: GravityOption = "",
    end: Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")] = "",
    engine: Annotated[str, Parameter(help="vjm, vjm-paper or vjm-<n>.")] = "vjm",
    segments: Segments = None,
    out: Annotated[Path | None, Parameter(help="CSV of the coordinates by each model.")] = None,
    json: Json = False,
    plot: pages.Plot = None,
    report: pages.Report = None,
    strict: Strict = False,
) -> int:
    """Find the joint coordinates that put the loaded tool where it should be, along a path."""
    machine = loaded(model)
    doubts = considered(model, strict, weighed=bool(gravity))
    number, parts = segments_of(segments)
    solver = engine_by_name(engine, EngineOptions(number, parts=parts), machine)
    if not isinstance(solver, VjmEngine):
        raise UsageError(f"--engine {engine}: compensation takes vjm, vjm-paper or vjm-<n>")
    if posture is not None:
        machine, (posture,) = in_postures(machine, (posture,))
    pages.check(plot, report, out=out)
    if out is not None and out.suffix != ".csv":
        raise UsageError(f"--out {out}: write a name that ends in .csv")
    wanted = read_tool_path(path)
    document = compensation(machine, solver, wanted, gravity=acceleration(gravity), posture=posture or "", end=end)
    commanded = np.array(document.commands["loaded"])
    doubts += beyond_calibration(machine, dict(zip(document.joints, commanded.T, strict=True)), strict)
    document = document.model_copy(update={"doubts": doubt_rows(doubts)})
    if not gravity and not np.any(wanted.wrenches):
        terminal.error(
            "note: no load acts along the path: give it columns fx_N to mz_Nmm, or the machine --gravity"
        )
    if out is not None:
        write_commands(document, out)
    if json:
        sys.stdout.write(as_json(document))
        pages.draw(plot, report, lambda: _compensation_content(document), None)
        return OK
    table = TerminalTable(
        title=f"{document.model}, {document.engine}: error of the loaded end at {document.poses} poses"
    )
    for column in ("joints by the model", "largest, mm", "mean, mm", "largest, rad"):
        table.add_column(column, justify="right")
    for name, left in document.left.items():
        table.add_row(name, f"{left.largest_mm:.4g}", f"{left.mean_mm:.4g}", f"{left.largest_rad:.4g}")
    console = terminal.console()
    console.print(table)
    if out is not None:
        console.print(f"{out}", soft_wrap=True)
    pages.draw(plot, report, lambda: _compensation_content(document), console)
    return OK


def _compensation_content(document: CompensationDocument) -> pages.Content:
    from vjm_validation.report.command_pages import compensation_picture
    from vjm_validation.report.words import ReportTable

    left = document.left
    rows = [(name, *(f"{v:.4g}" for v in (e.largest_mm, e.mean_mm, e.largest_rad))) for name, e in left.items()]
    errors = ReportTable(
        "Error of the loaded end", ("joints by the model", "largest, mm", "mean, mm", "largest, rad"), tuple(rows)
    )
    commands = ReportTable(
        "Joints by the loaded model",
        ("pose", *document.joints),
        tuple((str(k + 1), *(f"{v:.9g}" for v in row)) for k, row in enumerate(document.commands["loaded"])),
    )
    title = f"{document.model}, {document.engine}: compensation along {document.poses} poses"
    verdict = (
        f"The loaded model leaves {left['loaded'].largest_mm:.3g} mm, the linear "
        f"{left['linear'].largest_mm:.3g} mm, the rigid {left['rigid'].largest_mm:.3g} mm."
    )
    return pages.Content(title, verdict, [compensation_picture(document)], [errors, commands])
