"""`validate identify --solid` as a user types it, and what it says to bad input."""

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.command import validate
from helpers.solids import drawn, gmsh_or_skip, prism

from vjm_validation.cli import main

PARTS = Path(__file__).parents[3] / "validation/vjm_validation/examples/parts"
TIMOSHENKO = 4 * 100.0**3 / (70000 * 10 * 20**3) + 1.2 * 2.6 * 100.0 / (70000 * 10 * 20)
"""Deflection of the prism under a force, mm/N."""
MATERIAL = ("--youngs", "70000", "--poisson", "0.3")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    gmsh_or_skip()
    folder = tmp_path_factory.mktemp("parts")
    for kind in ("step", "stl", "msh"):
        drawn(folder / f"prism.{kind}", prism)
    drawn(folder / "metres.step", lambda occ: prism(occ, 3e8, 3e7, 3e7))
    for kind in ("step", "brep", "stl", "msh"):
        drawn(folder / f"two.{kind}", lambda occ: (prism(occ, 20.0), occ.addBox(50, 0, 0, 10, 10, 10)))
    triangles = (folder / "prism.stl").read_text().split("facet normal")
    (folder / "open.stl").write_text("facet normal".join([triangles[0], *triangles[2:]]))
    (folder / "empty.step").write_text("")
    (folder / "words.step").write_text("no drawing\n")
    return folder


def run(folder, name, *options, base="0,0,0", tip="100,0,0"):
    ends = ("--base", base, "--tip", tip, "--largest", "60000")
    return validate("identify", "--solid", str(folder / name), *MATERIAL, *ends, *options)


@pytest.mark.slow
def test_a_prism_as_json(folder):
    done = run(folder, "prism.step", "--json", "--density", "2700", "--accuracy", "2")
    assert done.status == 0, done.err
    document = json.loads(done.out)
    assert document["mass_kg"] == pytest.approx(2.7e-6 * 100 * 20 * 10)
    assert document["centre_of_mass_mm"] == pytest.approx([50.0, 0.0, 0.0], abs=1e-6)
    assert document["accuracy_reached"] <= document["accuracy_asked"]
    rigid, spread = (np.array(bound["compliance"]) for bound in document["bounds"])
    # the spread wrench's compliance is the larger one, in every direction
    scale = np.sqrt(np.diag(rigid))
    assert np.linalg.eigvalsh((spread - rigid) / np.outer(scale, scale))[0] > -document["accuracy_reached"]
    # a clamped end takes a little of beam theory's length away
    assert spread[1, 1] == pytest.approx(TIMOSHENKO, rel=0.02)
    (beam,) = document["beams"][-1:]
    assert beam["met"]
    assert beam["length_mm"] == pytest.approx(100.0, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["prism.stl", "prism.msh"])
def test_other_kinds_of_drawing(folder, name):
    done = run(folder, name, "--json", "--accuracy", "2")
    assert done.status == 0, done.err
    spread = np.array(json.loads(done.out)["bounds"][1]["compliance"])
    assert spread[1, 1] == pytest.approx(TIMOSHENKO, rel=0.02)


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("open.stl", {}, "the surface is not closed: 3 edges"),
        ("metres.step", {}, "km long: is the file in other units, metres taken for millimetres"),
        *[(f"two.{kind}", {}, "2 bodies that do not touch") for kind in ("step", "brep", "stl", "msh")],
        ("empty.step", {}, "the file is empty"),
        ("words.step", {}, "words.step: "),
        ("absent.step", {}, "no such file"),
        ("prism.step", {"tip": "0,1,0"}, "face 1 is both"),
        ("prism.step", {"tip": "9"}, "there is no face 9: the drawing has faces 1 to 6"),
        ("prism.step", {"tip": "flange"}, "no face is named 'flange': its faces have no names"),
        ("prism.step", {"tip": "100,30,0"}, "no face at [100, 30, 0]: the nearest, 2, is 20 mm away"),
        ("prism.step", {"tip": "100,10,0"}, "lies on the edge between faces"),
        ("prism.step", {"tip": "10,10,10:20,20,20"}, "no face lies wholly in the box"),
        ("prism.step", {"tip": "50,10,0"}, "the faces meet at an edge"),
    ],
)
def test_bad_drawings_and_faces(folder, capfd, name, options, words):
    ends = {"base": "0,0,0", "tip": "100,0,0"} | options
    given = ["--base", ends["base"], "--tip", ends["tip"]]
    capfd.readouterr()
    assert main.run(["identify", "--solid", str(folder / name), *MATERIAL, *given]) == 2
    out, err = capfd.readouterr()
    assert words in err
    assert out == ""
    lines = [line for line in err.splitlines() if line and not line.startswith("mesh")]
    assert len(lines) == 1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--poisson", "0.5"), "--poisson: 0.5 must be from 0 to below 0.5: at 0.5 nothing is compressible"),
        (("--youngs", "7e10"), "--youngs: 7e+10 MPa is no solid's"),
        (("--density", "2.7"), "--density: 2.7 kg/m³ is no solid's"),
        (("--at", "1,2"), "--at: '1,2' is not x,y,z in mm"),
        (("--part", "foot"), "--solid: takes a drawing alone"),
    ],
)
def test_bad_numbers(folder, capsys, options, words):
    given = [*_without(options[0]), *options, "--base", "1", "--tip", "2"]
    assert main.run(["identify", "--solid", str(folder / "prism.step"), *given]) == 2
    out, err = capsys.readouterr()
    assert words in err
    assert out == ""
    assert len(err.strip().splitlines()) == 1


def _without(name):
    pairs = list(zip(MATERIAL[::2], MATERIAL[1::2], strict=True))
    return [word for pair in pairs if pair[0] != name for word in pair]


@pytest.mark.slow
@pytest.mark.parametrize("command", ["identify", "check"])
def test_an_interrupt_leaves_nothing_behind(tmp_path, command):
    """Whatever a library is doing: status 130, one line, no file."""
    gmsh_or_skip()
    for name in ("l-bracket.step", "bracket-arm.toml"):
        shutil.copy(PARTS / name, tmp_path)
    file = tmp_path / "bracket-arm.toml"
    file.write_text(file.read_text().replace("accuracy_percent = 2.0", "accuracy_percent = 0.01"))
    ends = ["--base", "base", "--tip", "tip", "--accuracy", "0.01", "--pictures", ".", "--json"]
    words = ["identify", "--solid", "l-bracket.step", *MATERIAL, *ends]
    # a shell starts its background jobs with this signal ignored, and so would be what a test in one starts
    handled = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    code = f"{handled}; from vjm_validation.cli.main import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *(words if command == "identify" else ["check", file.name])],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 120
    while not any("libgmsh" in maps for maps in _maps_of_children(process.pid)):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.1)
    time.sleep(4.0 if command == "identify" else 2.0)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=120)
    assert list(_maps_of_children(process.pid)) == []
    assert process.returncode == 130, err
    assert (out, err) == ("", "validate: interrupted\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bracket-arm.toml", "l-bracket.step"]


def _maps_of_children(pid):
    """What libraries the processes that a process started have loaded."""
    children = Path(f"/proc/{pid}/task/{pid}/children")
    for child in children.read_text().split() if children.exists() else []:
        try:
            yield Path(f"/proc/{child}/maps").read_text()
        except OSError:  # it ended meanwhile
            continue


def test_the_command_starts_without_the_extra():
    """Neither the command's help nor a plain identification loads gmsh, scikit-fem or the solver."""
    code = (
        "import sys; from vjm_validation.cli import identify, main; "
        "print([m for m in ('gmsh', 'skfem', 'pypardiso', 'pyvista') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
