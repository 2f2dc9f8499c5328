"""Faults of the surroundings: each is one line, and nothing finished is lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
from helpers.command import in_a_process, validate

from vjm.engines import VjmEngine
from vjm.io.files import FolderInUseError, locked, write_whole
from vjm.io.model_file import load_chain
from vjm.io.path_files import load_path, save_path
from vjm.model.load_case import LoadCase
from vjm_output.terminal import LONGEST_MESSAGE, shortened

COMMAND = [sys.executable, "-c", "from vjm_validation.cli.main import main; main()"]


@pytest.fixture(scope="module")
def record(tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("records") / "path.npz"
    save_path(VjmEngine(2).trace(load_chain("pinned-column"), LoadCase("straight", -0.05)), file)
    return file


def test_a_folder_is_locked_by_one_run_at_a_time(tmp_path):
    with locked(tmp_path):
        script = (
            f"from pathlib import Path\nfrom vjm.io.files import locked\nwith locked(Path({str(tmp_path)!r})): pass"
        )
        other = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
        assert FolderInUseError.__name__ in other.stderr
        assert f"process {os.getpid()}" in other.stderr
    # free again
    with locked(tmp_path):
        pass


def test_a_second_run_into_a_folder_is_refused_in_one_line(tmp_path):
    with locked(tmp_path):
        finished = in_a_process("all", "--quick", "--only", "iterations", "--out", str(tmp_path))
    assert finished.status == 2
    assert finished.err.startswith("validate: ")
    assert "another run is writing here" in finished.err
    assert finished.err.count("\n") == 1


@pytest.mark.parametrize("seed", range(40))
def test_a_damaged_record_is_no_record(record, tmp_path, seed):
    """Any byte of the archive changed, or its end cut off: a path or one line, nothing else."""
    rng = np.random.default_rng(seed)
    raw = bytearray(record.read_bytes())
    for at in rng.integers(0, len(raw), 1 + seed % 3):
        raw[at] = int(rng.integers(256))
    damaged = tmp_path / "damaged.npz"
    damaged.write_bytes(bytes(raw[: int(rng.integers(len(raw)))] if seed % 5 == 0 else raw))
    said = "no record of a path"
    try:
        load_path(damaged)
    except ValueError as error:
        said = str(error)
    assert "no record of a path" in said


def test_an_unknown_compression_is_no_record(record, tmp_path):
    raw = bytearray(record.read_bytes())
    # the method stands ten bytes behind each entry of the central directory
    at = raw.index(b"PK\x01\x02")
    raw[at + 10] = 99
    damaged = tmp_path / "damaged.npz"
    damaged.write_bytes(bytes(raw))
    with pytest.raises(ValueError, match="no record of a path"):
        load_path(damaged)


def test_a_record_that_unpacks_to_much_more_is_refused_before_it_is_read(tmp_path, monkeypatch):
    bomb = tmp_path / "bomb.npz"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("meta.npy", bytes(10**6))
    monkeypatch.setattr("vjm.io.path_files.LARGEST_RECORD", 10**5)
    with pytest.raises(ValueError, match="unpacks to more"):
        load_path(bomb)


@pytest.mark.slow
def test_sigterm_is_an_interrupt(tmp_path):
    process = subprocess.Popen(
        [*COMMAND, "all", "--only", "chain", "--jobs", "1", "--out", str(tmp_path / "run")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 120.0
    while not list((tmp_path / "run" / "paths").glob("*.npz")) and time.monotonic() < deadline:
        time.sleep(0.2)
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 130, said
    assert "goes on from there" in said
    assert list((tmp_path / "run" / "paths").glob("*.npz"))


def test_a_reader_that_goes_away_is_no_error():
    done = subprocess.run(
        f"{sys.executable} -c 'from vjm_validation.cli.main import main; main([\"list\"])' | head -1",
        shell=True, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "Traceback" not in done.stderr
    assert "BrokenPipe" not in done.stderr


@pytest.mark.parametrize("name", ["x" * 100_000, "x" * 1000 + " " + "y" * 1000])
def test_long_input_is_not_repeated(name):
    finished = validate("curve", name, "--to", "1")
    assert finished.status == 2
    assert len(finished.err) < LONGEST_MESSAGE + 50


def test_short_messages_stay():
    assert shortened("model.toml: part 'bar': compliance is not symmetric") == (
        "model.toml: part 'bar': compliance is not symmetric"
    )


def test_absurd_numbers_of_springs_are_refused():
    finished = validate("curve", "orthoglide-chain", "--to", "1", "--segments", "1000000000")
    assert finished.status == 2
    assert "at most" in finished.err


def test_a_sheet_nested_deeply_is_one_line(tmp_path):
    sheet = tmp_path / "sheet.toml"
    sheet.write_text("[test]\nmodel = " + "[" * 100_000 + "]" * 100_000 + "\n")
    finished = validate("calibrate", str(tmp_path / "d.csv"), "--sheet", str(sheet), "--out", str(tmp_path / "o"))
    assert finished.status == 2
    assert "Traceback" not in finished.err


@pytest.mark.slow
@pytest.mark.parametrize("redirection", [">&-", ">&- 2>&-"])
def test_a_closed_output_is_no_error(redirection, tmp_path):
    program = f"{sys.executable} -c 'from vjm_validation.cli.main import main; main()'"
    words = f"new arm {tmp_path}/arm.toml {redirection}"
    done = subprocess.run(["/bin/sh", "-c", f"{program} {words}"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "arm.toml").exists()


def test_a_device_is_written_to_and_not_replaced(tmp_path):
    """A full device says so; a pipe gets the content; a link stays one."""
    with pytest.raises(OSError, match="No space left"):
        write_whole(Path("/dev/full"), "x")
    assert Path("/dev/full").is_char_device()
    pipe, got = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()))
    reader.start()
    write_whole(pipe, "content")
    reader.join(timeout=20.0)
    assert got == ["content"]
    (tmp_path / "link").symlink_to("target")
    write_whole(tmp_path / "link", "content")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "content"
