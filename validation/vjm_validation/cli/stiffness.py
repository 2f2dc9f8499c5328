"""The command ``validate stiffness``."""

from __future__ import annotations

import sys
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm.analysis import stiffness
from vjm.engine import Engine
from vjm.engines import engine_by_name
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.model.parts import Placement
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_validation.cli import pages, tables
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.load_case_options import GravityOption, LoadOption, acceleration, parsed_load
from vjm_validation.cli.options import (
    FootSegments,
    Json,
    Model,
    PlacementOption,
    Posture,
    Segments,
    Shear,
    engine_options,
    six,
    with_shear,
    within_reach,
)
from vjm_validation.cli.status import OK, UsageError
from vjm_validation.documents import SharesRow, StiffnessDocument
from vjm_validation.load_any_model import in_postures, loaded
from vjm_validation.loaded_stiffness import stiffness_document


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
    found = stiffness(
        chain, label, displacement=imposed, wrench=on_end, engine=solver, gravity=weight, loads=acting, end=end
    )
    rows = _shares(chain, labels, imposed, on_end, weight, acting, end, solver) if shares else []
    document = stiffness_document(found).model_copy(update={"doubts": doubt_rows(doubts), "shares": rows})
    if json:
        sys.stdout.write(as_json(document))
    else:
        tables.stiffness(terminal.console(), document)
        if rows:
            from vjm_validation.design_documents import print_shares

            print_shares(terminal.console(), rows)
    pages.draw(plot, report, lambda: _content(document), None if json else terminal.console())
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
    from vjm.vjm_engine import VjmEngine
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


def _content(document: StiffnessDocument) -> pages.Content:
    from vjm_validation.report.command_figures import stiffness_picture
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
        from vjm_validation.report.design_figures import shares_picture

        # what is asked for comes first: it is what --plot writes
        pictures = [shares_picture(document.model, document.shares), *pictures]
        for row in document.shares:
            title = f"Shares in the deflection, posture {row.posture}"
            shown.append(ReportTable(title, SHARES_HEADER, tuple(shares_cells(row)), words=2))
            sentences += shares_lines(row)
    state = "of unknown stability: this engine does not examine it" if document.stable is None else "stable"
    title = f"{document.model}, posture {document.posture}, {document.engine}: stiffness"
    return pages.Content(title, f"The loaded equilibrium is {state}.", pictures, shown, sentences)
