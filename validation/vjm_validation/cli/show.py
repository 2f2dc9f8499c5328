"""The command ``validate show``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm.io.files import check_outputs, write_whole
from vjm_output import terminal
from vjm_output.off_screen import why_not_rendered
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
    from vjm_validation.cli.show_drawing import show_drawing

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
