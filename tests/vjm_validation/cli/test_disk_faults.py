"""Full disks, read-only folders and kill -9: nothing is half-written, nothing finished is lost."""

import errno
import fcntl
import importlib
import json
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
from helpers.command import in_a_process, refused, validate

from vjm.engines import VjmEngine
from vjm.io import solid_provider
from vjm.io.files import UNFINISHED, FolderInUseError, locked, write_together, write_whole
from vjm.io.model_file import load_chain
from vjm.io.path_files import load_path, save_path
from vjm.model.load_case import LoadCase
from vjm_output.terminal import LONGEST_MESSAGE, shortened

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


def test_what_a_killed_process_left_of_a_file_goes_with_the_next_writing(tmp_path):
    """Also where it was killed: its lock went with it. What another process still writes stays."""
    for name in (".a.json.1.unfinished", ".a.json.2.unfinished", ".b.json.3.unfinished"):
        (tmp_path / name).write_text("half")
    with (tmp_path / ".a.json.2.unfinished").open() as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        write_whole(tmp_path / "a.json", "whole")
    assert {file.name for file in tmp_path.iterdir()} == {"a.json", ".a.json.2.unfinished", ".b.json.3.unfinished"}


def test_a_full_disk_is_one_line_and_leaves_no_curve(tmp_path, monkeypatch):
    full_from(monkeypatch, 1)
    file = tmp_path / "curve.csv"
    said = validate("curve", "pinned-column", "--to", "-0.01", "--segments", "2", "--csv", file, status=2).err
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
    refused(*MAP, "--out", tmp_path / "out")
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


# Faults of the surroundings: each is one line, and nothing finished is lost.


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
        said = refused("all", "--quick", "--only", "link_lumping", "--out", tmp_path)
    assert said.startswith("validate: ")
    assert "another run is writing here" in said


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
    assert len(refused("curve", name, "--to", "1")) < LONGEST_MESSAGE + 50


def test_short_messages_stay():
    assert shortened("model.toml: part 'bar': compliance is not symmetric") == (
        "model.toml: part 'bar': compliance is not symmetric"
    )


def test_absurd_numbers_of_springs_are_refused():
    finished = validate("curve", "orthoglide-chain", "--to", "1", "--segments", "1000000000", status=2)
    assert "at most" in finished.err


def test_a_sheet_nested_deeply_is_one_line(tmp_path):
    sheet = tmp_path / "sheet.toml"
    sheet.write_text("[test]\nmodel = " + "[" * 100_000 + "]" * 100_000 + "\n")
    finished = validate("calibrate", tmp_path / "d.csv", "--sheet", sheet, "--out", tmp_path / "o", status=2)
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


# What a command cannot write is said before it computes anything, and nothing is left behind.


ARM, WRENCH = "planar-2r", ["--wrench", "0,-50,0,0,0,0"]
LATER = "computed all the same"
COMMANDS = {
    "curve": ("vjm.engines.VjmEngine.trace", ["curve", "orthoglide-chain", "--to", "-1"], ("--csv", "--report")),
    "buckling": ("vjm.engines.VjmEngine.trace", ["buckling", "orthoglide-chain"], ("--plot", "--report")),
    "stiffness": ("vjm.analysis.under_wrench", ["stiffness", ARM, *WRENCH], ("--plot", "--report")),
    "modes": ("vjm.design.modes.eigenmodes", ["modes", ARM], ("--plot", "--report")),
    "sensitivity": (
        "vjm_validation.cli.design.sensitivities",
        ["sensitivity", ARM, "--posture", "bent", *WRENCH],
        ("--plot", "--report"),
    ),
    "sweep": (
        "vjm_validation.cli.design.swept",
        ["sweep", ARM, "--vary", "upper.length_mm=400:600:2", *WRENCH],
        ("--csv", "--report"),
    ),
    "optimise": (
        "vjm_validation.cli.design.best_machine",
        ["optimise", ARM, "--minimise", "mass", "--vary", "upper.length_mm=400:600"],
        ("--out",),
    ),
    "compensate": (
        "vjm_validation.cli.equilibrium.compensation",
        ["compensate", ARM, "PATH"],
        ("--out", "--report"),
    ),
    "map": ("vjm_validation.cli.map.run_map", ["map", ARM, "--grid", "elbow=0:1:2"], ("--plot", "--report")),
    "show": ("vjm_validation.report.machine_view.geometry", ["show", ARM], ("--out",)),
    "export": ("vjm.robots.urdf_text", ["export", "ur10"], ("--urdf", "--mjcf")),
}
"""What a command computes, its words, and options that name files."""
ENDINGS = {"--csv": "csv", "--plot": "png", "--report": "html", "--urdf": "urdf", "--mjcf": "xml"}
OUT = {"optimise": "toml", "compensate": "csv", "show": "html"}


def never(*_: object, **__: object) -> object:
    raise AssertionError(LATER)


@pytest.fixture
def quiet(monkeypatch):
    def without(command):
        place = COMMANDS[command][0]
        owner, name = place.rsplit(".", 1)
        try:
            module = importlib.import_module(owner)
        except ImportError:
            package, kind = owner.rsplit(".", 1)
            module = getattr(importlib.import_module(package), kind)
        monkeypatch.setattr(module, name, never)

    return without


@pytest.mark.parametrize("command", COMMANDS)
def test_files_that_cannot_be_written_are_refused_first(command, tmp_path, quiet):
    quiet(command)
    _, words, options = COMMANDS[command]
    (tmp_path / "file").write_text("no folder")
    (tmp_path / "path.csv").write_text("x_mm,y_mm,z_mm\n600,300,0\n")
    words = [str(tmp_path / "path.csv") if word == "PATH" else word for word in words]
    for option in options:
        ending = ENDINGS.get(option, OUT.get(command))
        below, folder = tmp_path / "file" / f"x.{ending}", tmp_path / f"folder.{ending}"
        folder.mkdir(exist_ok=True)
        for place, said in ((below, "a folder is needed there"), (folder, "give the name of a file")):
            more = ["--force"] if command == "export" else []
            error = refused(*words, f"{option}={place}", *more)
            assert said in error
            assert LATER not in error
    # one file is not two
    if len(options) == 2 and "--csv" not in options:
        ending = "html" if command == "export" else "png"
        twice = [f"{option}={tmp_path / f'x.{ending}'}" for option in options]
        if command not in ("compensate",):
            assert "give another name" in refused(*words, *twice)
    left = {path.name for path in tmp_path.iterdir()} - {f"folder.{e}" for e in (*ENDINGS.values(), "toml")}
    assert left == {"file", "path.csv"}


@pytest.mark.parametrize("command", ["calibrate", "diagnose", "simulate"])
def test_the_folder_of_a_test_is_tried_before_its_files_are_read(command, tmp_path):
    (tmp_path / "file").write_text("no folder")
    out = ["--out", str(tmp_path / "file" / "out")]
    missing = str(tmp_path / "missing.csv")
    words = (
        [ARM, "--test", missing, "--hide", "link_bow"] if command == "simulate" else [missing, "--sheet", missing]
    )
    assert "a folder is needed there" in refused(command, *words, *out)
    # and a folder that can be made is not made for a test that is refused
    validate(command, *words, "--out", tmp_path / "new", status=2)
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("key", ["source", "title", "name", "units", "postures"])
def test_a_model_without_a_key_is_refused_before_its_drawing_is_computed(key, tmp_path, monkeypatch):
    monkeypatch.setattr(solid_provider, "_computers", [never])
    lines = {
        "format": "format = 1",
        "name": 'name = "bracket"',
        "title": 'title = "bracket"',
        "source": 'source = "test"',
        "units": 'units = { length = "mm", force = "N", angle = "rad" }',
        "postures": "postures = { home = [] }",
    }
    part = (
        '[[parts]]\nkind = "beam"\nname = "foot"\nlength_mm = 95.0\n'
        'compliance = { from = "foot.step", youngs_modulus_MPa = 7e4, poissons_ratio = 0.33, '
        'base = "a", tip = "b" }\n'
    )
    (tmp_path / "foot.step").write_text("a drawing")
    model = tmp_path / "bracket.toml"
    model.write_text("\n".join(line for name, line in lines.items() if name != key) + "\n" + part)
    for words in (["check"], ["stiffness"], ["sensitivity", "--of", "mass"], ["modes"]):
        said = refused(words[0], model, *words[1:])
        assert f"{key} is missing: add it" in said
        assert "bracket.toml" in said
