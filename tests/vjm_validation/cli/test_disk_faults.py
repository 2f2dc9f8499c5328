"""Full disks, read-only folders and kill -9: nothing is half-written, nothing finished is lost."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers.command import in_a_process

from vjm.io.files import UNFINISHED, locked, write_together, write_whole
from vjm_validation.cli.main import run

COMMAND = [sys.executable, "-c", "from vjm_validation.cli.main import main; main()"]
MAP = ["map", "delta", "--grid", "x=-20:20:3,y=-20:20:2", "--jobs", "1"]
"""Two tasks, of four poses and of two."""


def full_from(monkeypatch, number: int) -> None:
    """A disk that is full from the ``number``-th file on."""
    synced = 0

    def fsync(_: int) -> None:
        nonlocal synced
        synced += 1
        if synced >= number:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("vjm.io.files.os.fsync", fsync)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_of_files_that_belong_together_a_full_disk_leaves_all_or_none(number, tmp_path, monkeypatch):
    contents = {tmp_path / name: name * 100 for name in ("a", "b", "c")}
    write_whole(tmp_path / "a", "older")
    full_from(monkeypatch, number)
    with pytest.raises(OSError, match="No space left"):
        write_together(contents)
    assert {file.name for file in tmp_path.iterdir()} == {"a"}
    assert (tmp_path / "a").read_text() == "older"


def test_a_full_disk_is_one_line_and_leaves_no_curve(tmp_path, monkeypatch, capsys):
    full_from(monkeypatch, 1)
    file = tmp_path / "curve.csv"
    assert run(["curve", "pinned-column", "--to", "-0.01", "--segments", "2", "--csv", str(file)]) == 2
    said = capsys.readouterr().err
    assert f"validate: {file}: no space left on device" in said
    assert not list(tmp_path.iterdir())


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 12 kB: a lock, a description, a task; as root only, and where one may mount."""
    folder = tmp_path / "disk"
    folder.mkdir()
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=12k", "tmpfs", str(folder)], capture_output=True, check=False
    )
    if done.returncode != 0:
        pytest.skip("no file system may be mounted here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.slow
def test_a_disk_that_fills_up_during_a_map(small_disk):
    finished = in_a_process(*MAP, "--out", str(small_disk / "map"))
    assert finished.status == 2
    assert "Traceback" not in finished.err
    assert "no space left" in finished.err
    left = [file.name for file in small_disk.rglob("*") if file.is_file()]
    assert not [name for name in left if name.endswith(UNFINISHED)]
    # what is finished is whole: the same command goes on from it elsewhere
    for task in (small_disk / "map" / "tasks").glob("*.json"):
        json.loads(task.read_text())


@pytest.mark.slow
def test_a_read_only_folder_is_one_line_before_anything_is_computed(small_disk):
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    for command in (MAP, ["all", "--quick"]):
        finished = in_a_process(*command, "--out", str(small_disk / "out"))
        assert finished.status == 2
        assert "read-only file system" in finished.err
        assert finished.err.count("\n") == 1


def test_a_file_in_the_place_of_the_folder_is_one_line(tmp_path):
    (tmp_path / "out").write_text("mine")
    finished = in_a_process(*MAP, "--out", str(tmp_path / "out"))
    assert finished.status == 2
    assert finished.err.count("\n") == 1
    assert (tmp_path / "out").read_text() == "mine"


def test_what_a_killed_process_left_is_removed_by_the_next_run(tmp_path):
    (tmp_path / "tasks").mkdir()
    (tmp_path / "tasks" / f".000001.json.abcd{UNFINISHED}").write_text("{")
    (tmp_path / "mine.txt").write_text("mine")
    with locked(tmp_path):
        assert {file.name for file in tmp_path.rglob("*") if file.is_file()} == {".lock", "mine.txt"}


def killed(arguments: list[str], until: Path, pattern: str) -> None:
    """Start a command and kill it as soon as a file of a pattern is there."""
    process = subprocess.Popen([*COMMAND, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120.0
    while not list(until.glob(pattern)) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL


@pytest.mark.slow
def test_a_map_that_was_killed_goes_on(tmp_path):
    folder = tmp_path / "map"
    killed([*MAP, "--out", str(folder)], folder, "tasks/*.json")
    kept = {file: file.stat().st_mtime_ns for file in (folder / "tasks").glob("*.json")}
    assert kept
    assert in_a_process(*MAP, "--out", str(folder)).status == 0
    # what was finished was not done again, and every pose is there
    assert all(file.stat().st_mtime_ns == at for file, at in kept.items())
    rows = (folder / "map.csv").read_text().splitlines()[2:]
    assert [row.endswith(",ok") for row in rows] == [True] * 6
    assert not list(folder.rglob(f"*{UNFINISHED}"))


@pytest.mark.slow
def test_a_run_of_all_that_was_killed_goes_on(tmp_path):
    arguments = ["all", "--quick", "--only", "chain", "--jobs", "1", "--out", str(tmp_path / "run")]
    killed(arguments, tmp_path / "run", "paths/*.npz")
    kept = {file: file.stat().st_mtime_ns for file in (tmp_path / "run" / "paths").glob("*.npz")}
    assert kept
    finished = in_a_process(*arguments)
    assert finished.status == 0, finished.err
    assert all(file.stat().st_mtime_ns == at for file, at in kept.items())
    assert (tmp_path / "run" / "index.html").exists()


@pytest.mark.slow
def test_a_diagnosis_that_was_killed_leaves_nothing_half_written(tmp_path):
    """Its files are written together at the end: all or none are there; the same command then writes them."""
    assert in_a_process("new", "sheet", str(tmp_path / "sheet.toml")).status == 0
    simulated = ["orthoglide-chain", "--test", str(tmp_path / "sheet.toml"), "--out", str(tmp_path / "test")]
    assert in_a_process("simulate", *simulated, "--seed", "7").status == 0
    files = [str(tmp_path / "test" / "readings.csv"), "--sheet", str(tmp_path / "test" / "sheet.toml")]
    arguments = ["diagnose", *files, "--only", "link_bow", "--out", str(tmp_path / "found")]
    killed(arguments, tmp_path, "found")
    left = {file.name for file in (tmp_path / "found").rglob("*") if not file.name.endswith(UNFINISHED)}
    finished = in_a_process(*arguments)
    assert finished.status == 0, finished.err
    written = {file.name for file in (tmp_path / "found").iterdir()}
    assert written >= {"diagnosis.json", "extended-model.toml", "diagnosis.html"}
    # a slow machine may have written all of them before it was killed
    assert left in (set(), written)
    assert not list((tmp_path / "found").rglob(f"*{UNFINISHED}"))
