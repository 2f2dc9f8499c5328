"""The command ``validate show``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def show_(
    model: Annotated[str, Parameter(help="A part's drawing: STEP, BREP, closed STL or gmsh mesh.")],
    *,
    out: Annotated[
        Path | None, Parameter(help="Picture to write; PART-faces.png in this folder by default.")
    ] = None,
) -> int:
    """Draw a part's faces numbered."""
    # the drawing libraries take seconds to import
    from vjm_validation.cli.show_drawing import is_drawing, show_drawing

    if is_drawing(model):
        return show_drawing(Path(model), out)
    raise ValueError(f"{model}: no kind of drawing that is known: give a .step, .stp, .brep, .stl or .msh file")
