"""The finder, as a user runs it: ``validate diagnose`` on two files, and what it writes."""

from __future__ import annotations

import contextlib
import io
import json
import signal
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

from vjm.io.files import write_whole

PATIENCE = 180
"""Seconds that a diagnosis may take before it counts as failed."""
DOCUMENT = "diagnosis.json"


class TooLongError(Exception):
    """A diagnosis did not end."""


def diagnosed(data: Path, sheet: Path, out: Path, options: Sequence[str] = ()) -> dict[str, Any]:
    """What the finder says of a test; read from its folder if it has said it before.

    Returns:
        ``diagnosis.json``, with ``took`` in seconds; or ``error`` with one line where there is none.
    """
    marked = out / "run.json"
    if marked.is_file():
        took: dict[str, Any] = json.loads(marked.read_text(encoding="utf-8"))
        document = out / DOCUMENT
        return json.loads(document.read_text(encoding="utf-8")) | took if "error" not in took else took
    begun = time.perf_counter()
    error = _run(["diagnose", str(data), "--sheet", str(sheet), "--out", str(out), *options])
    took = {"took": time.perf_counter() - begun} | ({"error": error} if error else {})
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
    from vjm_validation.cli import run

    said = io.StringIO()
    try:
        with _patience(), contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
            status = run(arguments)
    except TooLongError:
        return f"no end after {PATIENCE} s"
    except Exception as error:
        # a finder that breaks is a finding, not the end of the campaign
        return f"{type(error).__name__}: {' '.join(str(error).split())}"[:500]
    text = " ".join(said.getvalue().split())
    return f"status {status}: {text}"[:500] if status not in (0, 1) else ""


@contextlib.contextmanager
def _patience() -> Iterator[None]:
    def enough(_: int, __: FrameType | None) -> None:
        raise TooLongError

    before = signal.signal(signal.SIGALRM, enough)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def understands(option: str) -> bool:
    """Whether the command knows an option."""
    said = io.StringIO()
    from vjm_validation.cli import run

    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        run(["diagnose", "--help"])
    return option in said.getvalue()
