"""The command ``validate identify``."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter

from vjm.io.files import check_writable, write_whole
from vjm.io.model_file import build_chain, read_document
from vjm.model.machine import one_digest
from vjm.rotations import Array
from vjm_fea.solid.compliance import RootSupport
from vjm_fea.solid.elasticity import IsotropicMaterial
from vjm_fea.solid.identify import ACCURACY, LARGEST, SolidTask, identify
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_output.optional_drawing import why_not_rendered
from vjm_updating.identify import report as words
from vjm_updating.identify import solid_part
from vjm_updating.identify.command import identify_matrix, identify_part, identify_path
from vjm_updating.identify.experiments import build_path, is_path
from vjm_updating.identify.matrix_file import matrix_names
from vjm_updating.identify.report import IdentificationDocument
from vjm_updating.identify.solid_part import solid_document, stress_document
from vjm_validation.cli.options import considered
from vjm_validation.cli.pages import IMAGE_OUTPUT, ImageOutput
from vjm_validation.cli.tables import POSE_AXES, WRENCH_AXES, matrix_table
from vjm_validation.page_content import Content

if TYPE_CHECKING:
    from vjm_output.plots import Picture

# --- The options of ``validate identify --solid`` that describe the part ------------------------------------------

FACE = "by number, name, a point on it (x,y,z) or a box around it (x,y,z:x,y,z), mm; repeat for more faces"


@Parameter(name="*", group="A solid part")
@dataclass(frozen=True)
class SolidOptions:
    """A part as a drawing."""

    solid: Annotated[
        Path | None, Parameter(help="A drawing: STEP, BREP, closed STL or gmsh mesh; needs vjm-stiffness[solid].")
    ] = None
    youngs: Annotated[float | None, Parameter(help="Young's modulus, MPa.")] = None
    poisson: Annotated[float | None, Parameter(help="Poisson's ratio.")] = None
    density: Annotated[float | None, Parameter(help="kg/m³, for the mass.")] = None
    base: Annotated[tuple[str, ...], Parameter(help=f"Faces that are held, {FACE}.", negative="")] = ()
    tip: Annotated[tuple[str, ...], Parameter(help="Faces that are loaded, in the same way.", negative="")] = ()
    at: Annotated[
        str | None,
        Parameter(help="Point x,y,z in mm at which the compliance is read; else the tip's centre of area."),
    ] = None
    base_held: Annotated[
        RootSupport, Parameter(help="clamped: no point of the base moves; mean: it is still in the mean only.")
    ] = RootSupport.CLAMPED
    unit_mm: Annotated[float, Parameter(help="mm of one unit of the drawing; STEP says its unit itself.")] = 1.0
    bonded: Annotated[
        bool, Parameter(negative="", help="Bodies that touch are meant to be one, of one material.")
    ] = False
    accuracy: Annotated[float, Parameter(help="Half-interval in percent at which the refinement ends.")] = (
        100.0 * ACCURACY
    )
    largest: Annotated[int, Parameter(help="Unknowns of the finest mesh at most.")] = LARGEST

    wrench: Annotated[
        str | None, Parameter(help="fx,fy,fz,mx,my,mz in N and N mm at the tip: says the von Mises stress.")
    ] = None
    yield_stress: Annotated[float | None, Parameter(help="MPa; says at how many times the wrench it yields.")] = (
        None
    )
    pictures: Annotated[
        Path | None, Parameter(help="Folder for pictures of stress and deflected shape under each unit wrench.")
    ] = None

    def loads(self) -> Array | None:
        """The wrench ``(6,)`` that was given.

        Raises:
            ValueError: it is none.
        """
        if self.yield_stress is not None and not 0.0 < self.yield_stress < 1e4:
            raise ValueError(
                f"--yield-stress: {self.yield_stress:g} MPa is no solid's: give MPa, 250 for mild steel"
            )
        if self.wrench is None:
            if self.yield_stress is not None:
                raise ValueError("--yield-stress: goes with --wrench")
            return None
        return numbers(self.wrench, 6, "--wrench", "fx,fy,fz,mx,my,mz in N and N mm")

    def task(self) -> SolidTask:
        """The part to be identified.

        Raises:
            ValueError: an option is missing or no number that it may be.
        """
        assert self.solid is not None
        for name, value in (("--youngs", self.youngs), ("--poisson", self.poisson)):
            if value is None:
                raise ValueError(f"{name}: a solid needs its material: give --youngs MPa and --poisson")
        for name, faces in (("--base", self.base), ("--tip", self.tip)):
            if not faces:
                raise ValueError(f"{name}: which face? `validate show {self.solid}` draws them numbered")
        if not 1e-3 <= self.accuracy <= 20.0:
            raise ValueError(f"--accuracy: {self.accuracy:g} % must be from 0.001 to 20")
        if not 1e-6 <= self.unit_mm <= 1e6:
            raise ValueError(f"--unit-mm: {self.unit_mm:g} must be above 0: 1000 for metres, 25.4 for inches")
        if self.largest < 3000:
            raise ValueError(f"--largest: {self.largest} unknowns are no mesh: give 3000 or more")
        assert self.youngs is not None
        assert self.poisson is not None
        return SolidTask(
            path=self.solid,
            material=IsotropicMaterial(self.youngs, self.poisson, 1e-9 * (self.density or 0.0)),
            base=self.base,
            tip=self.tip,
            point=None if self.at is None else numbers(self.at, 3, "--at", "x,y,z in mm"),
            held=self.base_held,
            unit_mm=self.unit_mm,
            accuracy=0.01 * self.accuracy,
            largest=self.largest,
        )

    @property
    def others_given(self) -> bool:
        """Whether options of a part are given that only go with ``--solid``."""
        return bool(self.youngs or self.poisson or self.base or self.tip)


def numbers(text: str, count: int, option: str, form: str) -> Array:
    """Numbers ``(count,)`` from a text with commas.

    Raises:
        ValueError: they are none, or another count.
    """
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (count,) or not np.isfinite(values).all():
        raise ValueError(f"{option}: '{text}' is not {form}")
    return values


# ------------------------------------------------------------------------------------------------------------------


NO_SOLID = SolidOptions()


def identify_(
    model: Annotated[
        str | None, Parameter(help="A model of the library, or a path to a model file or a beam-path file.")
    ] = None,
    *,
    part: Annotated[
        str | None,
        Parameter(help="A part of the model, or first..last for parts in series without passive joints."),
    ] = None,
    matrix: Annotated[
        str | None,
        Parameter(
            help=f"A 6×6 matrix: {', '.join(matrix_names())}, or a file, see docs/compliance-matrix-file.md."
        ),
    ] = None,
    part_of: SolidOptions = NO_SOLID,
    output: ImageOutput = IMAGE_OUTPUT,
) -> int:
    """A part's 6×6 compliance from virtual experiments, and the uniform beam behind a compliance."""
    if part_of.solid is not None:
        if model is not None or part is not None or matrix is not None:
            raise ValueError("--solid: takes a drawing alone: leave the model, --part and --matrix out")
        if output.plot is not None or output.report is not None:
            raise ValueError("--plot, --report: a drawing has --pictures FOLDER instead")
        return identify_solid(part_of, json=output.json)
    if part_of.others_given:
        raise ValueError("--youngs, --poisson, --base and --tip go with --solid DRAWING")
    output.check()
    document = _document(model, part, matrix, output.strict)
    output.show(document, lambda: _content(document), lambda console: words.show(console, document))
    return 0


def identify_solid(options: SolidOptions, *, json: bool) -> int:
    """A part's compliance from its drawing."""
    task, wrench = options.task(), options.loads()
    reason = why_not_rendered() if options.pictures is not None else ""
    if reason:
        raise ValueError(f"--pictures: this machine cannot render pictures ({reason}): leave it out")
    if options.pictures is not None:
        check_writable(options.pictures)
    with terminal.progress(quiet=json) as progress:
        compliance = identify(task, progress)
    stress = None if wrench is None else stress_document(compliance, wrench, options.yield_stress)
    document = solid_document(compliance, stress, bonded=options.bonded)
    if json:
        sys.stdout.write(as_json(document))
    else:
        solid_part.show(terminal.console(), document)
    if options.pictures is not None:
        # matplotlib is an extra, which numbers do not need
        from vjm_updating.identify.solid_part import load_pictures, wrench_picture

        files = {f"{task.path.stem}-{tip}.png": load_pictures(compliance, tip) for tip in compliance.bounds}
        if wrench is not None:
            files[f"{task.path.stem}-wrench.png"] = wrench_picture(
                compliance, next(reversed(compliance.bounds)), wrench
            )
        for name, content in files.items():
            write_whole(options.pictures / name, content)
            if not json:
                terminal.console().print(f"picture: {options.pictures / name}", soft_wrap=True, highlight=False)
    return 0


def _content(document: IdentificationDocument) -> Content:
    compliance = np.array(document.compliance)

    def draw() -> list[Picture]:
        from vjm_validation.report.command_pages import compliance_picture

        return [compliance_picture(document.name, compliance)]

    met = [beam.form for beam in document.beams if beam.met]
    verdict = f"A uniform beam is behind it: {', '.join(met)}." if met else "No uniform beam meets all entries."
    table = matrix_table("Compliance; mm/N, rad/N, rad/(N mm)", compliance, POSE_AXES, WRENCH_AXES)
    return Content(f"{document.name}: compliance", [verdict], [table], draw)


def _document(model: str | None, part: str | None, matrix: str | None, strict: bool) -> IdentificationDocument:
    if (model is None) == (matrix is None):
        raise ValueError("give either a model with --part, or --matrix FILE")
    if matrix is not None:
        if part is not None:
            raise ValueError("--part: names a part of a model, and --matrix needs none: leave one out")
        return identify_matrix(matrix)
    assert model is not None
    document = read_document(model)
    if is_path(document.content):
        if part is not None:
            raise ValueError(f"--part: {document.file} is a beam path, which is taken whole: leave it out")
        return identify_path(build_path(document.content, document.file), one_digest(document.files))
    chain = build_chain(document.content, document.file, document.files)
    doubts = considered(model, strict)
    if part is None:
        raise ValueError(f"--part: which one? {chain.name} has {', '.join(beam.name for beam in chain.beams)}")
    return identify_part(chain, part).model_copy(update={"doubts": doubt_rows(doubts)})
