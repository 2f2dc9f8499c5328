"""How the kernels are compiled: once, kept on disk, and with a way in from Python only where Python calls.

Numba's cache looks at the file of the function itself, not at those that it calls. An installation writes all files
anew; who edits a kernel in place has to empty ``__pycache__``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])
# its type stubs lack the options that follow
njit: Any = numba.njit


def kernel(function: Function) -> Function:
    """Compile what only kernels call: unpacking its arguments from Python would take longest to compile."""
    options = {"cache": True, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    compiled: Function = njit(**options)(function)
    return compiled


def entry(function: Function) -> Function:
    """Compile what Python calls."""
    compiled: Function = njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)(function)
    return compiled
