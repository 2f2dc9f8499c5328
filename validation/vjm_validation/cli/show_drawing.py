"""``validate show`` of a part's drawing: its faces numbered."""

from __future__ import annotations

from pathlib import Path

from vjm.io.errors import printed
from vjm.io.files import check_outputs, write_whole
from vjm_fea.solid.drawing import drawn_faces
from vjm_output import terminal
from vjm_output.off_screen import why_not_rendered
from vjm_output.terminal import TerminalTable


def show_drawing(path: Path, out: Path | None, unit_mm: float = 1.0) -> int:
    """List the faces of a drawing, and draw them numbered as PNG.

    Raises:
        ValueError: no drawing, or ``out`` no name of a picture.
        OSError: it cannot be read or written.
    """
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
