import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from vjm.chain import Chain
from vjm.io.model_file import load_chain


@dataclass(frozen=True)
class Finished:
    status: int
    out: str
    err: str


GAUGE_SHEET = """
[test]
model = "pinned-column"
control = "mid.uy_mm"
[postures]
straight = []
[points.mid]
body = "link"
at = 0.5
[instrument.fx_N]
noise = 1.0
[instrument."mid.uy_mm"]
noise = 0.4
"""
"""A column steered by a gauge at its middle."""


def validate(*arguments: str, cwd: Path | None = None) -> Finished:
    """Run the command as a user does, in a process of its own."""
    command = [sys.executable, "-c", "from vjm_validation.cli import main; main()", *arguments]
    # no display, as on a server: rendering must not need one
    environment = {k: v for k, v in os.environ.items() if k != "DISPLAY"}
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=cwd, env=environment, timeout=1800, check=False
    )
    return Finished(done.returncode, done.stdout, done.stderr)


@pytest.fixture(scope="session")
def chain() -> Chain:
    return load_chain("orthoglide-chain")


@pytest.fixture(scope="session")
def whole_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Finished]:
    """`validate all`, whole, once for all tests that look at what it wrote."""
    folder = tmp_path_factory.mktemp("run")
    return folder, validate("all", "--out", str(folder), "--jobs", "2")


@pytest.fixture(scope="session")
def summary(whole_run: tuple[Path, Finished]) -> dict:
    folder, _ = whole_run
    return json.loads((folder / "summary.json").read_text())
