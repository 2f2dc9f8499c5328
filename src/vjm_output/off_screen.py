"""Three-dimensional pictures without a screen: what draws them, and whether this machine can."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from typing import Any

PROBE = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Sphere(), color="red")
assert plotter.screenshot(return_img=True).std() > 1.0
"""
PROBE_SECONDS = 60.0


def why_not_rendered() -> str:
    """Why this machine cannot render off the screen, empty where it can.

    Asked of a process of its own: a missing graphics library may end a process without an exception.
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
