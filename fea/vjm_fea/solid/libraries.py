"""The libraries of the extra ``solid``, loaded when first used, and what to do where one is missing."""

from __future__ import annotations

import importlib
import logging
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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
        # it tells of every change of layout in working memory
        logging.getLogger("skfem").setLevel(logging.ERROR)
    return library


@contextmanager
def kept_signals() -> Iterator[None]:
    """Put Python's answers to Ctrl-C and to a polite end back, which gmsh replaces by its own at its start.

    A signal that comes meanwhile waits until then.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = (signal.SIGINT, signal.SIGTERM)
    waiting = hasattr(signal, "pthread_sigmask")  # not on Windows
    before = signal.pthread_sigmask(signal.SIG_BLOCK, numbers) if waiting else set()
    handlers = {number: signal.getsignal(number) for number in numbers}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            if handler is not None:
                signal.signal(number, handler)
        if waiting:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


_left: list[threading.Event] = []


def left_running() -> bool:
    """Whether a call that was interrupted still runs: its library cannot be freed, nor the process end softly."""
    return not all(done.is_set() for done in _left)


def interruptible(call: Callable[[], Result]) -> Result:
    """Run a long call of a foreign library in a thread, so that Ctrl-C is answered at once.

    The library itself cannot be stopped: its thread ends with the process, or when the call returns. Until then
    nothing may be asked of it, see `left_running`.
    """
    results: list[Result] = []
    failures: list[BaseException] = []

    def work() -> None:
        try:
            results.append(call())
        except BaseException as error:  # handed to the caller below
            failures.append(error)
        finally:
            done.set()

    done = threading.Event()
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    try:
        done.wait()
    except BaseException:
        # (a thread whose join was interrupted counts as dead, which it is not)
        _left.append(done)
        raise
    if failures:
        raise failures[0]
    return results[0]
