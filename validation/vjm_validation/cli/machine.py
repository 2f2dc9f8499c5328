"""The commands that show what a machine is.

``validate check`` lists errors and doubts of its file, ``validate show`` writes a view in space or draws a part's
faces, ``validate postures`` finds joint coordinates for a pose of the tool, ``validate explore`` opens a page with
sliders.
"""

from __future__ import annotations

import json as json_module
import socket
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm.io.errors import printed
from vjm.io.files import check_outputs, write_whole
from vjm.io.findings import refuse
from vjm.io.machine_file import load_model
from vjm.io.model_report import check
from vjm.plain_numbers import plain_number
from vjm.postures import tool_postures
from vjm_output import terminal
from vjm_output.documents import doubt_rows
from vjm_output.optional_drawing import why_not_rendered
from vjm_output.terminal import TerminalTable
from vjm_validation.cli import BAD_INPUT, OK, UsageError
from vjm_validation.cli.options import (
    EndFrame,
    EngineChoice,
    Json,
    Model,
    Posture,
    Strict,
    acceleration,
    considered,
    six_or_none,
    warn,
)
from vjm_validation.load_any_model import in_postures, loaded


def check_(model: Model, *, strict: Strict = False) -> int:
    """List every error of a model file, or say what machine it describes and what is doubtful about it."""
    model_check = check(model)
    for line in model_check.errors:
        terminal.error(line)
    if model_check.errors:
        return BAD_INPUT
    refuse(model_check.findings, strict=strict)
    warn(model_check.findings)
    console = terminal.console()
    console.print(terminal.two_columns(f"{model_check.name}: {model_check.title}", _merged(model_check.summary)))
    return OK


def _merged(rows: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Rows of one name under each other."""
    table: dict[str, str] = {}
    for name, value in rows:
        table[name] = f"{table[name]}\n{value}" if name in table else value
    return table


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
    from vjm_updating.identify.solid_part import numbered_faces

    check_outputs({"--out": file})
    write_whole(file, numbered_faces(faces))
    terminal.console().print(f"picture: {file}", soft_wrap=True, highlight=False)
    return 0


def postures_(
    model: Model,
    *,
    tool: Annotated[
        str,
        Parameter(
            help="x,y,z in mm, in the world, and perhaps a rotation vector rx,ry,rz in rad; without it the tool "
            "may turn freely.",
        ),
    ],
    end: EndFrame = "",
    json: Json = False,
    strict: Strict = False,
) -> int:
    """Find the joint coordinates that put the tool where it is wanted, without load; lines for [postures]."""
    pose = _numbers(tool)
    machine = load_model(model)
    doubts = considered(model, strict)
    rows = tool_postures(machine, pose[:3], pose[3:] or None, end=end)
    if json:
        said = [row.model_dump() for row in doubt_rows(doubts)]
        document = {"model": machine.name, "postures": rows, "doubts": said}
        sys.stdout.write(json_module.dumps(document, indent=2) + "\n")
        return OK
    console = terminal.console()
    for i, row in enumerate(rows, start=1):
        values = ", ".join(f"{name} = {value:.9g}" for name, value in row.items())
        console.print(f"tool-{i} = {{ {values} }}", soft_wrap=True, highlight=False)
    return OK


def _numbers(text: str) -> list[float]:
    try:
        values = [plain_number(word) for word in text.split(",")]
    except ValueError:
        raise UsageError(f"--tool: '{text}' is not three or six numbers separated by commas") from None
    if len(values) not in (3, 6) or not np.all(np.isfinite(values)):
        raise UsageError(f"--tool: needs three or six finite numbers, got '{text}'")
    return values


GRAVITY = "0,0,-9.81"


def explore_(
    model: Model,
    beside: Annotated[
        str | None, Parameter(help="A second machine, beside the first one and under the same load.")
    ] = None,
    *,
    posture: Posture = None,
    wrench: Annotated[
        str | None, Parameter(help="fx,fy,fz,mx,my,mz in N and N mm on the free end, to begin with.")
    ] = None,
    gravity: Annotated[str, Parameter(help="gx,gy,gz in m/s² of the box `weight of the parts`.")] = GRAVITY,
    end: EndFrame = "",
    segments: Annotated[
        str, Parameter(help="Springs in every beam that has no number of its own, or by part: link=16,foot=4.")
    ] = "2",
    port: Annotated[
        int | None, Parameter(help="On this computer; the first free one from 8080 on by default.")
    ] = None,
    strict: Strict = False,
) -> int:
    """Turn a machine in one's hands: a page with sliders for posture, load and sizes, in a browser."""
    options = EngineChoice(segments).checked
    on_end = six_or_none("--wrench", wrench)
    weight = acceleration(gravity or GRAVITY)
    assert weight is not None
    if port is not None:
        _refuse_taken(port)
    # first what is missing: the page's library is an extra
    import viser  # noqa: F401

    from vjm_validation.explore.page import serve
    from vjm_validation.explore.state import Explorer, beside_file

    considered(model, strict)
    explorer = Explorer(model, posture, wrench=on_end, gravity=weight, end=end, options=options, segments=segments)
    second = None
    if beside is not None:
        considered(beside, strict)
        second = beside_file(explorer, beside, Explorer(beside, gravity=weight, options=options, segments=segments))

    def said(address: str) -> None:
        terminal.console().print(f"open {address} in a browser; Ctrl-C ends it", soft_wrap=True)

    serve(explorer, port, Path.cwd(), said, second)
    return OK


def _refuse_taken(port: int) -> None:
    """Refuse a port that is none, or is in use.

    Raises:
        UsageError: it is.
    """
    if not 1 <= port <= 65535:
        raise UsageError(f"--port {port}: give a number from 1 to 65535")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            raise UsageError(f"--port {port}: cannot be used ({error.strerror}): give another one") from None
