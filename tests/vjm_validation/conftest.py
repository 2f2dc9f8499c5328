"""Runs of `validate all` that many tests look at, and the command in this process."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from helpers.command import Finished, in_a_process

SHORT = ("--only", "chain", "link_lumping", "table2", "linear-cantilever")
"""All postures and engines on the chain, and one case with an exact answer; the other studies have tests of their
own, and tests/verification has the other cases."""


@dataclass(frozen=True)
class InterruptedRun:
    """A run that was stopped by Ctrl-C and started again by the same command."""

    folder: Path
    status: int
    err: str
    kept: dict[Path, int]
    """The curves that were there after the interrupt, and the times at which they were written."""
    unfinished: list[Path]
    """Half-written curves after the interrupt."""
    summarised: bool
    """Whether there was a summary after the interrupt."""
    again: Finished


@pytest.fixture(scope="session")
def interrupted_run(tmp_path_factory: pytest.TempPathFactory) -> InterruptedRun:
    folder = tmp_path_factory.mktemp("interrupted") / "run"
    arguments = ["all", "--out", str(folder), "--jobs", "2", *SHORT]
    command = [sys.executable, "-c", "from vjm_validation.cli.main import main; main()", *arguments]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + 120
    while len(list(folder.glob("curves/*.csv"))) < 5:
        assert process.poll() is None, "the run ended before it could be interrupted"
        assert time.monotonic() < deadline
        time.sleep(0.05)
    # as Ctrl-C does: to the whole group in the foreground
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    return InterruptedRun(
        folder,
        process.returncode,
        err,
        kept={file: file.stat().st_mtime_ns for file in folder.glob("curves/*.csv")},
        unfinished=list(folder.rglob(".*.csv.*")),
        summarised=(folder / "summary.json").exists(),
        again=in_a_process(*arguments),
    )


@pytest.fixture(scope="session")
def whole_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Finished]:
    """`validate all`, whole: ten minutes of a processor, for slow tests only."""
    folder = tmp_path_factory.mktemp("run")
    return folder, in_a_process("all", "--out", str(folder), "--jobs", "2")


@pytest.fixture(scope="session", params=["short", pytest.param("whole", marks=pytest.mark.slow)])
def finished_run(request: pytest.FixtureRequest) -> tuple[Path, Finished]:
    """What either run wrote, and how it ended."""
    if request.param == "whole":
        return request.getfixturevalue("whole_run")
    run = request.getfixturevalue("interrupted_run")
    return run.folder, run.again


@pytest.fixture(scope="session")
def summary(finished_run: tuple[Path, Finished]) -> dict:
    folder, _ = finished_run
    return json.loads((folder / "summary.json").read_text())


@pytest.fixture(scope="session")
def whole_summary(whole_run: tuple[Path, Finished]) -> dict:
    folder, _ = whole_run
    return json.loads((folder / "summary.json").read_text())
