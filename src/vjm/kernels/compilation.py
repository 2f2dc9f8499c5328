"""How the kernels are compiled: once, kept on disk, and with a way in from Python only where Python calls.

Numba's cache looks at the file of the function itself, not at those that it calls. A kernel that is kept would go
on with what another one was before an upgrade. So each is kept together with a hash of all files with kernels.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import event as events
from numba.core.runtime.nrt import rtsys

from vjm.kernels.compiling import watchers

KERNELS = Path(__file__).parent
Function = TypeVar("Function", bound=Callable[..., Any])
# its type stubs lack the options that follow, and what tells of events
njit: Any = numba.njit
register: Any = events.register
unliteral: Any = numba.types.unliteral


def kernel(function: Function) -> Function:
    """Compile what only kernels call: unpacking its arguments from Python would take longest to compile."""
    options = {"cache": True, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return _kept_with_all_sources(njit(**options)(function), function)


def entry(function: Function) -> Function:
    """Compile what Python calls."""
    return _kept_with_all_sources(njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)(function), function)


def _kept_with_all_sources(compiled: Function, function: Function) -> Function:
    """Let the cache of a function hold only as long as every file does that it may have code from.

    A constant argument makes no variant of its own, which would be compiled beside the others with all it calls.
    """
    template: Callable[..., object] = getattr(compiled, "get_call_template")  # noqa: B009

    def without_literals(args: tuple[object, ...], named: dict[str, object]) -> object:
        plain = {name: unliteral(kind) for name, kind in named.items()}
        return template(tuple(map(unliteral, args)), plain)

    vars(compiled)["get_call_template"] = without_literals
    cache = getattr(compiled, "_cache", None)
    kept = getattr(cache, "_cache_file", None)
    if kept is not None:
        folder = Path(function.__code__.co_filename).parent
        kept._source_stamp = (kept._source_stamp, digest_of((KERNELS, folder)))
        vars(cache)["load_overload"] = _loading(cache)
    return compiled


def _loading(cache: Any) -> Callable[[object, object], object]:  # noqa: ANN401  (Numba's, which has no types)
    """What loads a kernel that is kept, without all that compiling one takes.

    Numba reads its translation of every type and function before it looks on the disk: SciPy's linear algebra and
    a second of a processor. A kernel that is kept needs what counts its arrays only. Where none is kept, the
    compiler reads the translations itself.
    """

    def load(signature: object, context: object) -> object:
        rtsys.initialize(context)
        with cache._guard_against_spurious_io_errors():
            return cache._load_overload(signature, context)

    return load


@lru_cache(maxsize=16)
def digest_of(folders: tuple[Path, ...]) -> str:
    """Hash of the contents of the folders' programs that are compiled, which all import this one or Numba."""
    digest = hashlib.sha256()
    for place in dict.fromkeys(folders):
        for file in sorted(place.glob("*.py")):
            content = file.read_bytes()
            if b"kernels.compilation" in content or b"numba" in content:
                digest.update(content)
    return digest.hexdigest()


class _Announcer(events.Listener):
    """Tells the watchers of each kernel that is compiled; what is loaded from the disk makes no such event."""

    def on_start(self, event: events.Event) -> None:
        for watcher in watchers:
            watcher(event.data["dispatcher"].py_func.__name__)

    def on_end(self, event: events.Event) -> None:
        """Nothing: each kernel is told when it begins."""


register("numba:compile", _Announcer())
