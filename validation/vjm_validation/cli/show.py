"""The command ``validate show``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm.io.errors import printed
from vjm.io.files import check_outputs, write_whole
from vjm_output import terminal
from vjm_output.off_screen import why_not_rendered
from vjm_output.terminal import TerminalTable
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.options import Posture
from vjm_validation.cli.status import OK, UsageError
from vjm_validation.load_any_model import in_postures, loaded


def show_(
    model: Annotated[str, Parameter(help="Model of the library, model file, or a part's STEP, BREP, STL or MSH.")],
    *,
    posture: Posture = None,
    out: Annotated[
        Path | None,
        Parameter(help="File to write, .html or .png; in this folder by default."),
    ] = None,
    strict: Strict = False,
) -> int:
    """Write a 3-D view of a machine with its axes, joints, springs and names; or draw a part's faces numbered."""
    # drawing libraries take seconds to import
    from vjm_fea.solid.faces import is_drawing

    if is_drawing(model):
        return show_drawing(Path(model), out)
    machine = loaded(model)
    considered(model, strict)
    machine, (label, *_) = in_postures(machine, (posture,) if posture else ())
    file = out or Path(f"{machine.name}-{label.replace(',', '_')}.html")
    if file.suffix not in (".html", ".png"):
        raise UsageError(f"--out: {file}: write a name that ends in .html or .png")
    check_outputs({"--out": file})
    if file.suffix == ".png" and (reason := why_not_rendered()):
        raise UsageError(f"--out: this machine cannot render pictures ({reason}): write .html instead")
    from vjm_validation.report.machine_view import geometry, page, rendered

    shown = geometry(machine, label)
    if file.suffix == ".html":
        write_whole(file, page(f"{machine.title or machine.name}, posture {label}", shown))
    else:
        write_whole(file, rendered(shown))
    terminal.console().print(f"view: {file}", soft_wrap=True)
    return OK


# --- ``validate show`` of a part's drawing: its faces numbered ----------------------------------------------------


def show_drawing(path: Path, out: Path | None, unit_mm: float = 1.0) -> int:
    """List the faces of a drawing, and draw them numbered as PNG.

    Raises:
        ValueError: no drawing, or ``out`` no name of a picture.
        OSError: it cannot be read or written.
    """
    from vjm_fea.solid.drawing import drawn_faces

    file = out or Path(f"{path.stem}-faces.png")
    if file.suffix != ".png":
        raise ValueError(f"--out: {file}: a drawing's faces are drawn as a picture: write a name that ends in .png")
    faces, volume = drawn_faces(path, unit_mm)
    table = TerminalTable(title=f"{path.name}, {printed(volume)} mm³", title_justify="left")
    for head in ("face", "name", "area, mm²", "centre, mm"):
        table.add_column(head, justify="right" if head != "name" else "left")
    for face in faces:
        centre = ", ".join(printed(0.0 if abs(v) < 1e-6 else float(v), 5) for v in face.centre)
        table.add_row(str(face.number), face.name, printed(face.area, 5), centre)
    terminal.console().print(table, highlight=False)
    reason = why_not_rendered()
    if reason:
        terminal.console().print(f"no picture: this machine cannot render ({reason})", soft_wrap=True)
        return 0
    # matplotlib is an extra, which the list does not need
    from vjm_updating.identify.solid_report import numbered_faces

    check_outputs({"--out": file})
    write_whole(file, numbered_faces(faces))
    terminal.console().print(f"picture: {file}", soft_wrap=True, highlight=False)
    return 0
