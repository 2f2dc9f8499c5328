"""The finder, as a user runs it: ``validate diagnose`` on two files, and what it writes."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import signal
import time
from collections.abc import Iterator, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import FrameType
from typing import Any

from vjm.io.files import write_whole

PATIENCE = 240.0
"""Seconds of a processor that a diagnosis may take before it counts as failed."""
DOCUMENT = "diagnosis.json"


class TooLongError(Exception):
    """A diagnosis did not end."""


@cache
def identity() -> str:
    """Digest of the sources by which readings are diagnosed."""
    own = Path(__file__).parent
    mechanics = find_spec("vjm")
    assert mechanics is not None
    assert mechanics.origin is not None
    digest = hashlib.sha256()
    for package in (Path(mechanics.origin).parent, own.parent):
        for file in sorted(package.rglob("*.py")):
            if own not in file.parents:
                digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def diagnosed(data: Path, sheet: Path, out: Path, options: Sequence[str] = ()) -> dict[str, Any]:
    """What the finder says of a test; read from its folder if this very finder has said it before.

    Returns:
        ``diagnosis.json``, with ``took`` and ``busy``, seconds by the clock and of a processor, and ``finder``, its
        `identity`; or ``error`` with one line where there is none.
    """
    marked = out / "run.json"
    if marked.is_file():
        took: dict[str, Any] = json.loads(marked.read_text(encoding="utf-8"))
        document = out / DOCUMENT
        if took.get("finder") == identity():
            return json.loads(document.read_text(encoding="utf-8")) | took if "error" not in took else took
        marked.unlink()
    begun, busy = time.perf_counter(), time.process_time()
    error = _run(["diagnose", str(data), "--sheet", str(sheet), "--out", str(out), *options])
    took = {"took": time.perf_counter() - begun, "busy": time.process_time() - busy, "finder": identity()}
    took |= {"error": error} if error else {}
    if not error and not (out / DOCUMENT).is_file():
        took["error"] = "no diagnosis.json was written"
    write_whole(marked, json.dumps(took))
    # the page is large and told again by the numbers
    for name in ("diagnosis.html",):
        (out / name).unlink(missing_ok=True)
    return diagnosed(data, sheet, out, options)


def _run(arguments: Sequence[str]) -> str:
    """Run the command in this process; empty, or what went wrong."""
    # imported late: who only makes sets needs no finder
    from vjm_validation.cli.main import run

    said = io.StringIO()
    try:
        with _patience(), contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
            status = run(arguments)
    except TooLongError:
        return f"no end after {PATIENCE:g} s"
    except Exception as error:
        # a finder that breaks is a finding, not the end of the campaign
        return f"{type(error).__name__}: {' '.join(str(error).split())}"[:500]
    text = " ".join(said.getvalue().split())
    return f"status {status}: {text}"[:500] if status not in (0, 1) else ""


@contextlib.contextmanager
def _patience() -> Iterator[None]:
    def enough(_: int, __: FrameType | None) -> None:
        raise TooLongError

    before = signal.signal(signal.SIGPROF, enough)
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def understands(option: str) -> bool:
    """Whether the command knows an option."""
    said = io.StringIO()
    from vjm_validation.cli.main import run

    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        run(["diagnose", "--help"])
    return option in said.getvalue()
