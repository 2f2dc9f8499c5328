"""The command ``validate explore``."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm.model.parts import Placement
from vjm_output import terminal
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.load_case_options import acceleration
from vjm_validation.cli.options import Model, Posture, engine_options, six
from vjm_validation.cli.status import OK, UsageError

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
    end: Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")] = "",
    segments: Annotated[
        str, Parameter(help="Springs in every beam that has no number of its own, or by part: link=16,foot=4.")
    ] = "2",
    port: Annotated[
        int | None, Parameter(help="On this computer; the first free one from 8080 on by default.")
    ] = None,
    strict: Strict = False,
) -> int:
    """Turn a machine in one's hands: a page with sliders for posture, load and sizes, in a browser."""
    options = engine_options(segments, None, Placement.BEST)
    on_end = None if wrench is None else six("--wrench", wrench)
    weight = acceleration(gravity or GRAVITY)
    assert weight is not None
    if port is not None:
        _refuse_taken(port)
    # first what is missing: the page's library is an extra
    import viser  # noqa: F401

    from vjm_validation.explore.beside import beside_file
    from vjm_validation.explore.page import serve
    from vjm_validation.explore.state import Explorer

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
