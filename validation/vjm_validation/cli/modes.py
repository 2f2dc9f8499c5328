"""The command ``validate modes``."""

from __future__ import annotations

import sys
from typing import Annotated

from cyclopts import Parameter

from vjm.design.modes import Modes, modes
from vjm.engines import engine_by_name
from vjm.model.parts import Placement
from vjm.vjm_engine import VjmEngine
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_validation.cli import pages
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
    positive,
    six,
    with_shear,
    within_reach,
)
from vjm_validation.cli.status import OK, UsageError
from vjm_validation.design_documents import (
    MODES_HEADER,
    modes_cells,
    modes_document,
    modes_lines,
    print_modes,
)
from vjm_validation.documents import ModesDocument
from vjm_validation.load_any_model import in_postures, loaded


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
    found = modes(
        machine, label, number=number, wrench=None if wrench is None else six("--wrench", wrench),
        displacement=held, gravity=acceleration(gravity), loads=[parsed_load(text) for text in load], end=end,
        engine=solver,
    )  # fmt: skip
    document = modes_document(found).model_copy(update={"doubts": doubt_rows(doubts)})
    if json:
        sys.stdout.write(as_json(document))
    else:
        print_modes(terminal.console(), document, number)
    pages.draw(plot, report, lambda: _content(found, document, number), None if json else terminal.console())
    return OK


def _content(found: Modes, document: ModesDocument, wanted: int) -> pages.Content:
    from vjm_validation.report.design_figures import modes_picture
    from vjm_validation.report.words import ReportTable

    verdict, *others = modes_lines(document, wanted)
    table = ReportTable("Natural frequencies", MODES_HEADER, tuple(modes_cells(document)))
    title = f"{document.model}, posture {document.posture}: natural frequencies"
    return pages.Content(title, verdict, [modes_picture(found)], [table], others)
