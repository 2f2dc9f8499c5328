"""OpenSeesPy as an untyped module, loaded when it is first needed: it is an optional extra."""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
from functools import cache
from pathlib import Path
from types import ModuleType

MISSING = "engine 'opensees' needs the optional extra: pip install 'vjm-stiffness[opensees]'"


@cache
def opensees() -> ModuleType:
    """The module `openseespy.opensees`.

    Raises:
        ImportError: it is not installed or does not load.
    """
    if importlib.util.find_spec("openseespy") is None:
        raise ImportError(MISSING)
    _load_blas()
    try:
        return importlib.import_module("openseespy.opensees")
    except (ImportError, RuntimeError) as failure:  # its own wrapper turns the one into the other
        raise ImportError(f"{MISSING}; it is there but does not load: {failure}") from failure


def available() -> bool:
    """Whether OpenSeesPy is installed and loads."""
    try:
        opensees()
    except ImportError:
        return False
    return True


def _load_blas() -> None:
    """Load the BLAS that the Linux wheel brings with it.

    Up to 3.7.1 the wheel's LAPACK does not find the BLAS beside it, and loading ends at "libblas.so.3: cannot open
    shared object file" where the system has none. A library that is loaded already is found by its name.
    """
    wheel = importlib.util.find_spec("openseespylinux")
    if wheel is None or wheel.origin is None:
        return
    blas = Path(wheel.origin).parent / "lib" / "libblas.so.3"
    if blas.is_file():
        ctypes.CDLL(str(blas))
