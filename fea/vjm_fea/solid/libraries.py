"""The libraries of the extra ``solid``, loaded when first used, and what to do where one is missing."""

from __future__ import annotations

import importlib
import logging
import threading
from collections.abc import Callable
from typing import Any, TypeVar

EXTRA = "pip install 'vjm-stiffness[solid]'"
SYSTEM = "Debian: apt-get install libglu1-mesa libgl1 libxcursor1 libxft2 libxinerama1"
"""What gmsh's wheel needs of the system."""

Result = TypeVar("Result")


def load(name: str) -> Any:  # noqa: ANN401
    """A library of the extra.

    Raises:
        ImportError: it is not installed, or a system library that it needs is not; one line with the remedy.
    """
    try:
        library = importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise ImportError(f"solid parts need {error.name}, which is not installed: {EXTRA}") from error
    except (ImportError, OSError) as error:
        remedy = SYSTEM if name == "gmsh" else EXTRA
        raise ImportError(f"{name} does not load, {' '.join(str(error).split())}: {remedy}") from error
    if name == "skfem":
        # it tells of every change of memory layout
        logging.getLogger("skfem").setLevel(logging.ERROR)
    return library


def interruptible(call: Callable[[], Result]) -> Result:
    """Run a long call of a foreign library in a thread, so that Ctrl-C is answered at once.

    The library itself cannot be stopped: its thread ends with the process, or when the call returns.
    """
    results: list[Result] = []
    failures: list[BaseException] = []

    def work() -> None:
        try:
            results.append(call())
        except BaseException as error:  # handed to the caller below
            failures.append(error)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join()
    if failures:
        raise failures[0]
    return results[0]
