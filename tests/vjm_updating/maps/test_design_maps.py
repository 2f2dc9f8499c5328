"""Maps of the lowest natural frequency and of the largest compliance share: by hand, and point by point."""

import csv
import json
from importlib import resources
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from helpers.command import json_of, validate
from helpers.maps import mapped
from scipy.optimize import brentq

import vjm
from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.parts import Joint, RigidOffset
from vjm.rotations import AXES, translation
from vjm_updating.maps.evaluate import MapQuantity
from vjm_updating.maps.output import write_map
from vjm_updating.maps.run import MapResult
from vjm_validation.schemas import schemas

FREQUENCY, SHARES = MapQuantity.FREQUENCY, MapQuantity.SHARES
SPRINGS = VjmEngine(4)
G = 9.81


def link(name: str, length: float, mass: float = 0.0) -> RigidOffset:
    """A rod along x with a point mass at its end."""
    return RigidOffset(name, translation([length, 0.0, 0.0]), mass, np.array([length, 0.0, 0.0]))


def arm(compliances: tuple[float, ...], *masses: float, length: float = 400.0) -> Machine:
    """Rigid links on gears about z, drawn straight along x."""
    parts = tuple(
        part
        for i, (compliance, mass) in enumerate(zip(compliances, masses, strict=True))
        for part in (Joint(f"j{i}", AXES["z"], compliance=compliance), link(f"l{i}", length, mass))
    )
    held = {"straight": {f"j{i}": 0.0 for i in range(len(masses))}}
    return Machine("arm", parts, postures={"straight": np.zeros(0)}, held=held)


# --- the lowest frequency -------------------------------------------------------------------------------------


def test_a_tip_mass_on_two_gears_over_the_elbow():
    """Of a point mass alone ω² = 1/(m λ), with λ the largest compliance of the tip against a force."""
    c, length, m = 1e-7, 400.0, 2.0
    found = mapped(arm((c, c), 0.0, m), SPRINGS, FREQUENCY, "j1=0.2:2.8:5", "straight")
    assert list(found.why) == ["ok"] * 5
    for q, (frequency,) in zip(found.map.points.q[:, 1], found.values, strict=True):
        J = length * np.array([[-np.sin(q), -np.sin(q)], [1.0 + np.cos(q), np.cos(q)]])
        stiffest = 1.0 / (m * c * np.linalg.eigvalsh(J @ J.T)[1])
        assert frequency == pytest.approx(np.sqrt(1000.0 * stiffest) / (2.0 * np.pi), rel=1e-9)


def test_a_mass_on_a_sprung_bar_under_its_weight():
    """A bar at angle q from the vertical sags to q + θ with k θ = m g L sin(q + θ); k − m g L cos(q + θ) is left.

    Upright it falls where k is below m g L: that point has no value.
    """
    length, m = 400.0, 2.0
    torque = m * G * length
    k = 0.9 * torque
    found = mapped(
        arm((1.0 / k,), m, length=length), SPRINGS, FREQUENCY, "j0=0:3:4", "straight", gravity=(-G, 0.0, 0.0)
    )
    assert list(found.why) == ["the equilibrium is unstable", "ok", "ok", "ok"]
    assert np.isnan(found.values[0, 0])
    for q, (frequency,) in zip(found.map.points.q[1:, 0], found.values[1:], strict=True):
        sag = brentq(lambda sag, q=q: k * sag - torque * np.sin(q + sag), 0.0, np.pi)
        left = k - torque * np.cos(q + sag)
        exact = np.sqrt(1000.0 * left / (m * length**2)) / (2.0 * np.pi)
        assert frequency == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize(("load", "flutters"), [(0.999, False), (1.001, True)])
def test_beyond_zieglers_load_a_point_says_flutter(load: float, flutters: bool):
    """Links with masses 2m and m under a follower: P l/c = 7/2 − √2 (Ziegler 1952), wherever the first stands."""
    c, length, m = 1e5, 200.0, 0.5
    force = load * (3.5 - np.sqrt(2.0)) * c / length
    pushed = Load((-force, 0.0, 0.0, 0.0, 0.0, 0.0), "l1", follower=True)
    found = mapped(
        arm((1.0 / c, 1.0 / c), 2.0 * m, m, length=length), SPRINGS, FREQUENCY, "j1=0,j0=0", "straight",
        loads=(pushed,),
    )  # fmt: skip
    assert list(found.why) == ["the equilibrium is unstable: flutter" if flutters else "ok"]
    assert np.isnan(found.values[0, 0]) == flutters


@pytest.mark.parametrize(
    ("model", "posture", "grid", "loads"),
    [
        ("planar-2r", "bent", "elbow=0.5:1.5:2", [Load((0.0, -40.0, 0.0, 0.0, 0.0, 0.0), "fore", 0.5)]),
        ("palletiser", "home", "shoulder=-1.3:-1.25:2", []),
        ("hexapod", "home", "x=-20:20:2,y=5", []),
    ],
)
def test_a_frequency_is_that_of_modes_in_the_posture_there(model, posture, grid, loads):
    machine = load_model(model)
    asked = {"gravity": (0.0, -G, 0.0), "loads": tuple(loads)}
    words = (machine, SPRINGS, FREQUENCY, grid, posture)
    found = mapped(*words, wrench=(3.0, 2.0, 1.0, 0.0, 0.0, 0.0), **asked)
    assert list(found.why) == ["ok", "ok"]
    for there, (frequency,) in zip(postures_of(found), found.values, strict=True):
        alone = vjm.modes(machine, there, number=1, wrench=(3.0, 2.0, 1.0, 0.0, 0.0, 0.0), **asked, engine=SPRINGS)
        assert frequency == pytest.approx(alone.frequencies[0], rel=1e-8)


def postures_of(found: MapResult) -> list[dict[str, float]]:
    """Coordinates of the driven joints of each point, by name: what `vjm.in_posture` takes."""
    driven = {joint.name: found.joints[joint.name] for joint in found.map.setting.machine.held_joints}
    return [{name: float(values[k]) for name, values in driven.items()} for k in range(len(found.why))]


# --- the largest share ----------------------------------------------------------------------------------------


def test_the_largest_share_of_two_gears_is_that_of_the_larger_torque():
    """With equal compliances a gear's share is the square of its torque over the sum of squares."""
    found = mapped(
        arm((1e-8, 1e-8), 0.0, 0.0), SPRINGS, SHARES, "j1=0.2:2.8:6", "straight", wrench=(0.0, 10.0, 0, 0, 0, 0)
    )
    for q, (share,), name in zip(found.map.points.q[:, 1], found.values, found.names, strict=True):
        torques = np.array([1.0 + np.cos(q), np.cos(q)]) ** 2
        assert name == (f"j{np.argmax(torques)}", "joint")
        assert share == pytest.approx(torques.max() / torques.sum(), rel=1e-9)
    assert {part for part, _ in found.names} == {"j0", "j1"}


@pytest.mark.parametrize(
    ("model", "posture", "grid", "wrench"),
    [
        ("planar-2r", "bent", "elbow=0.5:2.3:4", (0.0, -30.0, 0.0)),
        ("ur10", "work", "elbow=1:2:3", (20.0, 0.0, -50.0)),
        ("palletiser", "home", "shoulder=-1.3:-1.25:2", (0.0, 0.0, -50.0)),
        ("orthoglide", "isotropic", "x=-40:40:2,y=20", (50.0, 20.0, 0.0)),
    ],
)
def test_a_share_is_the_largest_of_shares_in_the_posture_there(model, posture, grid, wrench):
    machine, acting = load_model(model), (*wrench, 0.0, 0.0, 0.0)
    of_platform = model == "orthoglide"
    found = mapped(machine, SPRINGS, SHARES, grid, posture, wrench=acting)
    assert set(found.why) == {"ok"}
    places = ["-40,20,0", "40,20,0"] if of_platform else postures_of(found)
    for there, (share,), name in zip(places, found.values, found.names, strict=True):
        alone = vjm.shares(vjm.load(model), there, wrench=acting, engine=SPRINGS)
        worst = int(np.argmax(alone.energies))
        assert share == pytest.approx(alone.energies[worst], rel=1e-8)
        assert name == (alone.rows[worst].part, alone.rows[worst].kind)


# --- files and the command ------------------------------------------------------------------------------------


def test_files_of_the_shares_name_parts_and_leave_points_without_a_value_empty(tmp_path):
    found = mapped(
        vjm.load("planar-2r"), SPRINGS, SHARES, "shoulder=0:1:2,elbow=2.4:2.8:2", "bent",
        wrench=(0.0, -10.0, 0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip
    files, left_out = write_map(found, tmp_path)
    assert [file.name for file in files] == ["map.csv", "map.png"]
    assert left_out == []
    rows = list(csv.DictReader(files[0].read_text().splitlines()[1:]))
    assert [row["status"].split(":")[0] for row in rows] == ["ok", "out of reach"] * 2
    assert [(row["part"], row["kind"]) for row in rows] == list(found.names)
    assert found.names[1] == ("", "")
    assert rows[1]["largest_share"] == ""
    assert float(rows[0]["largest_share"]) == pytest.approx(found.values[0, 0], rel=1e-8)


def test_a_figure_has_a_colour_for_each_part(tmp_path):
    """Where the elbow's share is the largest the figure has its colour, mixed with white by the share."""
    import matplotlib.image
    from matplotlib.colors import to_rgb

    from vjm_output.plots import PARTS

    found = mapped(
        vjm.load("planar-2r"), SPRINGS, SHARES, "shoulder=-0.3:0.1:2,elbow=0.5:2.4:3", "bent",
        wrench=(0.0, -10.0, 0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip
    assert [part for part, _ in found.names].count("shoulder") in (4, 5)
    assert {part for part, _ in found.names} == {"shoulder", "elbow"}
    write_map(found, tmp_path)
    pixels = matplotlib.image.imread(tmp_path / "map.png")[..., :3].reshape(-1, 3)
    for (share,), (part, _) in zip(found.values, found.names, strict=True):
        mixed = 1.0 - share * (1.0 - np.array(to_rgb(PARTS[0 if part == "shoulder" else 1])))
        # a cell has thousands of pixels, each rounded to 1/255
        assert np.count_nonzero(np.abs(pixels - mixed).max(axis=1) < 1.5 / 255.0) > 1000


@pytest.fixture(scope="module")
def delta(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library's Delta with a mass in each bar."""
    folder = tmp_path_factory.mktemp("delta")
    library = resources.files("vjm").joinpath("models", "manipulators")
    machine = library.joinpath("delta.toml").read_text("utf-8")
    for chain, length in (("delta-arm", "length_mm = 524.0\n"), ("delta-rod", "length_mm = 1244.0\n")):
        text = library.joinpath("chains", f"{chain}.toml").read_text("utf-8")
        assert text.count(length) == 1
        (folder / f"{chain}.toml").write_text(text.replace(length, f"{length}mass_kg = 0.5\n"))
        machine = machine.replace(f'chain = "{chain}"', f'chain = "{chain}.toml"')
    (folder / "delta.toml").write_text(machine)
    return folder / "delta.toml"


def test_the_command_maps_the_frequency_of_a_platform(delta, tmp_path):
    weight = ["--gravity", "0,0,-9.81", "--json"]
    words = ["map", str(delta), "--grid", "x=-100:100:2,y=0,z=-50", "--quantity", "frequency", *weight]
    document = json.loads(validate(*words, "--out", tmp_path / "map").out)
    jsonschema.validate(document, schemas()["map-rows.schema.json"])
    assert document["columns"] == ["f1_Hz"]
    assert document["parts"] == []
    for k, place in enumerate(("-100,0,-50", "100,0,-50")):
        alone = json.loads(validate("modes", delta, f"--posture={place}", "--segments", "4", *weight).out)
        assert document["values"][k] == [pytest.approx(alone["modes"][0]["frequency_Hz"], rel=1e-8)]


def test_the_command_says_which_part_is_the_worst_where(tmp_path):
    words = ["map", "planar-2r", "--posture", "bent", "--grid", "elbow=0.5:2.5:5", "--quantity", "shares"]
    page = tmp_path / "map.html"
    two = ["--wrench", "0,-10,0", "--wrench", "10,0,0", "--report", str(page)]
    said = validate(*words, *two, "--out", tmp_path / "map").out
    assert "shoulder (joint) has the largest share at 3 poses: " in said
    assert "elbow (joint) has the largest share at 2 poses: " in said
    assert (tmp_path / "map" / "side-by-side.png").stat().st_size > 5000
    assert ">part<" in page.read_text()
    document = json_of(*words, "--wrench", "0,-10,0", "--out", tmp_path / "one")
    jsonschema.validate(document, schemas()["map-rows.schema.json"])
    assert document["parts"] == ["shoulder"] * 3 + ["elbow"] * 2
    assert document["kinds"] == ["joint"] * 5


def test_points_say_why_they_have_no_value(tmp_path):
    words = ["map", "delta", "--grid", "x=0", "--quantity"]
    assert (
        "1 poses: no part that moves has a mass: give its links mass_kg"
        in validate(*words, "frequency", "--out", tmp_path / "frequency").out
    )
    assert (
        "1 poses: nothing loads it: give a wrench"
        in validate(*words, "shares", "--wrench", "0,0,0", "--out", tmp_path / "shares").out
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--quantity", "frequency", "--engine", "msa"], "--quantity frequency: msa has no natural frequencies"),
        (["--quantity", "shares", "--engine", "exudyn"], "--quantity shares: exudyn has no shares of parts"),
        (["--quantity", "frequency", "--against", "msa"], "--quantity frequency: msa has no natural frequencies"),
        (["--quantity", "shares", "--against", "vjm-8"], "--against: a map of the shares names parts"),
        (["--quantity", "shares"], "--wrench: a map of the shares needs one"),
        (["--quantity", "frequency", "--end", "hand"], "no end frame 'hand'"),
    ],
)
@pytest.mark.parametrize("model", ["planar-2r", "orthoglide"])
def test_what_a_map_does_not_take_is_refused_in_one_line(words, said, model, tmp_path):
    grid = "elbow=0:1:2" if model == "planar-2r" else "x=0:1:2"
    err = validate("map", model, "--grid", grid, *words, "--out", tmp_path / "map", status=2).err
    lines = [line for line in err.splitlines() if line.strip() and "warning:" not in line]
    assert [said in line for line in lines] == [True]
    assert not (tmp_path / "map" / "map.csv").exists()
