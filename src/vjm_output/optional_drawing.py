"""What is drawn only where it can be.

Here are pages where jinja2 and Matplotlib are installed, three-dimensional pictures where PyVista renders without a
screen. A command's numbers do not depend on that.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

DRAWN_BY = ("jinja2", "matplotlib")
"""Of the extra ``report``: the page's template and its figures."""


def why_not(*modules: str) -> str:
    """What to install before what needs these modules of the extra is made; empty where they are there."""
    missing = [name for name in modules if find_spec(name) is None]
    return f"it needs {' and '.join(missing)}: pip install 'vjm-stiffness[report]'" if missing else ""


def why_no_page() -> str:
    """What to install before pages are written; empty where they are."""
    return why_not(*DRAWN_BY)


def page_of(file: Path, make: Callable[[], str]) -> dict[Path, str]:
    """A page by its file, or nothing where it cannot be made; one of an earlier run is then removed.

    Args:
        file: of the page.
        make: imports what draws, and returns the page as HTML.
    """
    if why_no_page():
        file.unlink(missing_ok=True)
        return {}
    return {file: make()}


def page_line(file: Path) -> str:
    """Where the page is, or why there is none: a line for the terminal."""
    why = why_no_page()
    return f"no page: {why}" if why else f"page: {file}"


PROBE = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Sphere(), color="red")
assert plotter.screenshot(return_img=True).std() > 1.0
"""
PROBE_SECONDS = 60.0


@cache
def why_not_rendered() -> str:
    """Why this machine cannot render off the screen, empty where it can.

    Asked once, of a process of its own: a missing graphics library may end a process without an exception.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-c", PROBE], capture_output=True, text=True, timeout=PROBE_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as failure:
        return f"{type(failure).__name__} after at most {PROBE_SECONDS:g} s"
    if done.returncode == 0:
        return ""
    last = done.stderr.strip().splitlines()[-1:] or ["no message"]
    return f"exit status {done.returncode}, {last[0][:200]}"


def plotter(size: Sequence[int]) -> Any:  # noqa: ANN401
    """A `pyvista.Plotter` that draws without a screen, of a width and a height in pixels.

    VTK asks for an X server before it draws without one, and warns where there is none: its errors alone are shown.

    Raises:
        ImportError: PyVista is not installed.
    """
    import pyvista  # it takes seconds to import

    pyvista.vtk_verbosity("error")
    return pyvista.Plotter(off_screen=True, window_size=list(size))
