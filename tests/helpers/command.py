"""The command as a user runs it."""

import io
import json
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from helpers.file_texts import instruments_text, table_text
from vjm_validation.cli.main import run


@dataclass(frozen=True)
class Finished:
    status: int
    out: str
    err: str


GAUGE_SHEET = (
    table_text("test", model="pinned-column", control="mid.uy_mm")
    + table_text("postures", straight=[])
    + table_text("points.mid", body="link", at=0.5)
    + instruments_text(fx_N=(1.0,), **{"mid.uy_mm": (0.4,)})
)
"""A column controlled by a gauge at its middle."""


def validate(*words: object, status: int | None = 0) -> Finished:
    """Run the command in this process, which has its modules loaded already; its status must be as expected."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        found = run([str(word) for word in words])
    assert status in (None, found), f"status {found}: {err.getvalue()}"
    return Finished(found, out.getvalue(), err.getvalue())


def json_of(*words: object, status: int = 0) -> Any:
    """What the command prints with ``--json``, parsed."""
    return json.loads(validate(*words, "--json", status=status).out)


def refused(*words: object, status: int = 2) -> str:
    """The one line in which the command says why it has no answer; it prints nothing else."""
    finished = validate(*words, status=status)
    (line,) = finished.err.strip().splitlines()
    assert finished.out == ""
    return line


def in_a_process(*arguments: str, cwd: Path | None = None) -> Finished:
    """Run the command as a user does, in a process of its own."""
    command = [sys.executable, "-c", "from vjm_validation.cli.main import main; main()", *arguments]
    # no display, as on a server: rendering must not need one
    environment = {k: v for k, v in os.environ.items() if k != "DISPLAY"}
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=cwd, env=environment, timeout=1800, check=False
    )
    return Finished(done.returncode, done.stdout, done.stderr)
