"""The finder, as a user runs it: ``validate diagnose`` on two files, and what it writes."""

import ast
import contextlib
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
from vjm.io.provenance import Provenance, digest

PATIENCE = 240.0
"""Seconds of a processor that a diagnosis may take before it counts as failed."""
DOCUMENT = "diagnosis.json"
RAMPS, POSES = "vjm_updating.diagnosis.run", "vjm_updating.poses.run"
"""Modules that diagnose."""
PAGES = ("page", "figures", "summary_text")
"""Names of modules that draw and write what was found."""


class TooLongError(Exception):
    """A diagnosis did not end."""


@cache
def identity(entry: str = RAMPS) -> str:
    """Digest of the sources by which a module works: what it imports of the suite and of this bench.

    Modules that only draw and write are left out, so that a caption does not discard a campaign.
    """
    return Provenance(
        {f"{file.parent.name}/{file.name}": digest(file.read_bytes()) for file in _sources(entry)}
    ).key[:16]


def _sources(entry: str) -> set[Path]:
    """Files of a module and of all that it imports of the suite, but for its pages."""
    found: dict[str, Path] = {}
    waiting = [entry]
    while waiting:
        name = waiting.pop()
        if name in found or name.startswith("vjm_output") or name.rpartition(".")[2] in PAGES:
            continue
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            continue
        found[name] = Path(spec.origin)
        waiting += _imported(found[name])
    return set(found.values())


def _imported(file: Path) -> Iterator[str]:
    """Modules of the suite that a source imports, wherever in it the import stands."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            if name.startswith(("vjm", "hidden_effects")) and _is_module(name):
                yield name


def _is_module(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def diagnosed(
    data: Path, sheet: Path, out: Path, options: Sequence[str] = (), *, entry: str = RAMPS
) -> dict[str, Any]:
    """What the finder says of a test; read from its folder if this very finder has said it before.

    Returns:
        ``diagnosis.json``, with ``took`` and ``busy``, seconds by the clock and of a processor, and ``finder``, its
        `identity`; or ``error`` with one line where there is none.
    """
    marked = out / "run.json"
    # the sheet's model may lie beside it
    files = {file.name: digest(file.read_bytes()) for file in (data, *sorted(sheet.parent.glob("*.toml")))}
    key = Provenance(files).asked(sheet=sheet.name, options=options, finder=identity(entry)).key
    said = kept(out)
    if said is not None:
        if said.get("key") == key:
            return said
        marked.unlink()
    begun, busy = time.perf_counter(), time.process_time()
    error = _run(["diagnose", str(data), "--sheet", str(sheet), "--out", str(out), *options])
    took: dict[str, Any] = {"took": time.perf_counter() - begun, "busy": time.process_time() - busy}
    took |= {"finder": identity(entry), "key": key} | ({"error": error} if error else {})
    if not error and not (out / DOCUMENT).is_file():
        took["error"] = "no diagnosis.json was written"
    write_whole(marked, json.dumps(took))
    # the page is large and told again by the numbers
    for name in ("diagnosis.html",):
        (out / name).unlink(missing_ok=True)
    return diagnosed(data, sheet, out, options, entry=entry)


def kept(out: Path) -> dict[str, Any] | None:
    """What any version of the finder has said into a folder, as `diagnosed` returns it; None where none has."""
    marked = out / "run.json"
    if not marked.is_file():
        return None
    took: dict[str, Any] = json.loads(marked.read_text(encoding="utf-8"))
    return took if "error" in took else json.loads((out / DOCUMENT).read_text(encoding="utf-8")) | took


def _run(arguments: Sequence[str]) -> str:
    """Run the command in this process; empty, or what went wrong."""
    # imported late: who only makes sets needs no diagnosis
    from vjm_validation.cli import INTERRUPTED
    from vjm_validation.cli.main import run

    said = io.StringIO()
    try:
        with _patience(), contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
            status = run(arguments)
    except TooLongError:
        return f"no end after {PATIENCE:g} s"
    except Exception as error:
        # a diagnosis that breaks is a finding, not the end of the campaign
        return f"{type(error).__name__}: {' '.join(str(error).split())}"[:500]
    if status == INTERRUPTED:
        # the campaign ends too: this set has no answer that could be kept
        raise KeyboardInterrupt
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
