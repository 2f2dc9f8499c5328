"""The command ``validate sensitivity``."""

from __future__ import annotations

import sys
from typing import Annotated

from cyclopts import Parameter

from vjm.design.sensitivity import DesignQuantity, sensitivities
from vjm.design.sweep import AskedQuantity
from vjm.engines import engine_by_name
from vjm.io.file_parameters import MachineFiles
from vjm.model.parts import Placement
from vjm.vjm_engine import VjmEngine
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_validation.cli import pages
from vjm_validation.cli.design_space import refuse_nothing
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
)
from vjm_validation.cli.status import NOT_ACCEPTED, OK
from vjm_validation.design_documents import (
    SENSITIVITY_HEADER,
    SOUGHT,
    print_sensitivity,
    sensitivity_cells,
    sensitivity_document,
    sensitivity_lines,
)
from vjm_validation.documents import SensitivityDocument
from vjm_validation.load_any_model import in_postures


def sensitivity_(
    model: Model,
    *,
    of: Annotated[
        DesignQuantity, Parameter(help="deflection, stiffness, critical, frequency or mass.")
    ] = DesignQuantity.DEFLECTION,
    by: Annotated[
        tuple[str, ...],
        Parameter(
            consume_multiple=True,
            help="Numbers of parts, such as upper.section.width_mm,elbow.compliance_rad_per_Nmm; of a part that "
            "legs share chain.part.key; all by default.",
        ),
    ] = (),
    along: Annotated[
        str,
        Parameter(help="x, y, z, rx, ry, rz: of a deflection by default its largest shift, of a stiffness x."),
    ] = "",
    posture: Posture = None,
    wrench: Annotated[str | None, Parameter(help="fx,fy,fz,mx,my,mz in N and N mm on the free end.")] = None,
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
    """What a deflection, a stiffness, a critical load, a frequency or the mass depends on, and what to change."""
    refuse_nothing(wrench is not None or load, gravity, [AskedQuantity(of)])
    pages.check(plot, report)
    files = MachineFiles.read(model, sheared=with_shear(shear))
    doubts = considered(model, strict, weighed=bool(gravity))
    machine = files.machine()
    solver = engine_by_name("vjm", engine_options(segments, foot_segments, placement), machine)
    assert isinstance(solver, VjmEngine)
    label = next(iter(machine.postures))
    if posture is not None:
        _, (label,) = in_postures(machine, (posture,))
    found = sensitivities(
        files, [key.strip() for text in by for key in text.split(",") if key.strip()], of=of, along=along,
        posture=label, wrench=None if wrench is None else six("--wrench", wrench), gravity=acceleration(gravity),
        loads=[parsed_load(text) for text in load], end=end, engine=solver, factors=SOUGHT,
    )  # fmt: skip
    result = sensitivity_document(found).model_copy(update={"doubts": doubt_rows(doubts)})
    if json:
        sys.stdout.write(as_json(result))
    else:
        print_sensitivity(terminal.console(), result)
    pages.draw(plot, report, lambda: _content(result), None if json else terminal.console())
    return NOT_ACCEPTED if any(row.verification.doubtful for row in found.rows) else OK


def _content(document: SensitivityDocument) -> pages.Content:
    from vjm_validation.report.design_figures import tornado_picture
    from vjm_validation.report.words import ReportTable

    verdict, *others = sensitivity_lines(document)
    table = ReportTable("Derivatives", SENSITIVITY_HEADER, tuple(sensitivity_cells(document)))
    title = f"{document.model}, posture {document.posture}: what its {document.quantity} depends on"
    return pages.Content(title, verdict, [tornado_picture(document)], [table], others)
