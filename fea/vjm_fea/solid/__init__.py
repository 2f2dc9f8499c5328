"""Parts as solids: from a drawing to a mesh of quadratic tetrahedra, linear elasticity, and a 6×6 compliance.

Needs the extra ``vjm-stiffness[solid]``. Nothing here loads gmsh, scikit-fem or a solver before it is used: `load`
does, and `work_apart` is the child process where they work.
"""

from __future__ import annotations

import importlib
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from vjm.child_process import ChildLimits, Progress, free_ram, installed, run_in_child

EXTRA = "pip install 'vjm-stiffness[solid]'"
SYSTEM = "Debian: apt-get install libglu1-mesa libgl1 libxcursor1 libxft2 libxinerama1"
"""What gmsh's wheel needs of the system."""
SILENT = 1800.0
"""Seconds that a library may work without a sign. A mesh of 300,000 unknowns and its solution, as many as are taken
unless more are asked for, take a minute. The time grows with less than the square of the unknowns, so that 1.5
million have room."""

Result = TypeVar("Result")


def load(name: str) -> Any:  # noqa: ANN401
    """A library of the extra.

    Raises:
        ImportError: it is not installed, or a system library that it needs is not; one line with the remedy.
    """
    try:
        library = importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise _missing(error) from error
    except (ImportError, OSError) as error:
        remedy = SYSTEM if name == "gmsh" else EXTRA
        raise ImportError(f"{name} does not load, {' '.join(str(error).split())}: {remedy}") from error
    if name == "skfem":
        # it tells of every change of layout in working memory
        logging.getLogger("skfem").setLevel(logging.ERROR)
    return library


def work_apart(
    function: Callable[..., Result], *arguments: object, path: Path, progress: Progress | None = None
) -> Result:
    """The result of a function that works on a drawing by the extra's libraries, in a child process with limits.

    Raises:
        ImportError: as `load`, of gmsh or scikit-fem.
        vjm.child_process.ChildError: a library was silent beyond `SILENT`, or crashed.
        MemoryError: it needs more than the machine had to spare.
        Exception: what ``function`` raises.
    """
    for name in ("gmsh", "skfem"):
        try:
            installed(name)
        except ModuleNotFoundError as error:
            raise _missing(error) from error
    limits = ChildLimits(SILENT, free_ram(), "simplify the drawing, or ask for less by --largest")
    return run_in_child(
        function, *arguments, what=f"{path.name}: the work on its solid", limits=limits, progress=progress
    )


def _missing(error: ModuleNotFoundError) -> ImportError:
    return ImportError(f"solid parts need {error.name}, which is not installed: {EXTRA}")
