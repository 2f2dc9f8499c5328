"""The first command after an installation: interpreted, while another process compiles the kernels.

Compiling them takes more than half a minute of a processor, one path by the interpreter two seconds. So a command
of one path or a few runs as plain Python where no compiled kernels are kept, and `vjm.warm_up` compiles them
meanwhile, once. Should that be done first, the command begins anew with what is compiled: a long one takes no
longer than if it had waited. Both give the same numbers, but for rounding.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
ROOMS = ("kernels", "tree", "platform", "sensitivity")
"""Folders of `vjm` with kernels that others call."""
PLAIN = "NUMBA_DISABLE_JIT"
"""Numba's own switch: with it functions stay as they are written."""
HELPED = "VJM_COMPILED_BESIDE"
"""Set in a command that began anew, which does not ask for help again."""


HELPER = "import os, vjm.warm_up; os.nice(10); vjm.warm_up.main()"


@lru_cache(maxsize=16)
def digest_of(folders: tuple[Path, ...]) -> str:
    """Hash of the contents of the folders' programs."""
    found = hashlib.sha256()
    for place in dict.fromkeys(folders):
        for file in sorted(place.glob("*.py")):
            found.update(file.read_bytes())
    return found.hexdigest()


def kept_in() -> Path | None:
    """Folder in which it is noted that kernels are compiled; None where they are kept elsewhere."""
    own = os.environ.get("NUMBA_CACHE_DIR")
    folder = Path(own) if own else PACKAGE / "kernels/__pycache__"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) else None


def note(folder: Path) -> Path:
    """The file that says so, for these sources, this Numba and this Python."""
    sources = digest_of(tuple(PACKAGE / room for room in ROOMS))
    name = f"{sources}-{version('numba')}-{sys.implementation.cache_tag}"
    return folder / f"compiled-{hashlib.sha256(name.encode()).hexdigest()[:16]}"


@contextmanager
def compiling() -> Iterator[bool]:
    """Whether this process is the one to compile; that it has is noted at the end."""
    folder = kept_in()
    if folder is None:
        yield True
        return
    with open(folder / "compiling", "w", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        yield True
        if PLAIN not in os.environ:
            note(folder).touch()


def interpreted_meanwhile() -> bool:
    """Leave this process interpreted and let another one compile, where no compiled kernels are kept.

    To be called before Numba is imported.
    """
    folder = kept_in()
    if folder is None or PLAIN in os.environ or HELPED in os.environ or "numba" in sys.modules:
        return False
    if note(folder).exists():
        return False
    helper = subprocess.Popen(
        [sys.executable, "-c", HELPER], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    os.environ[PLAIN] = "1"
    # every command begins here, its help too, and few get this far
    import numpy as np

    # as the compiled kernels take it, which have no warnings
    np.seterr(all="ignore")
    threading.Thread(target=_begin_anew, args=(helper,), daemon=True).start()
    return True


def _begin_anew(helper: subprocess.Popen[bytes]) -> None:
    """The same command once more, as soon as what it needs is compiled."""
    if helper.wait() != 0:
        return
    environment = {name: value for name, value in os.environ.items() if name != PLAIN} | {HELPED: "1"}
    os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], environment)
