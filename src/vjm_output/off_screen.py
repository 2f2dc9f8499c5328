"""Whether this machine can render three-dimensional pictures without a screen."""

from __future__ import annotations

import subprocess
import sys

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
