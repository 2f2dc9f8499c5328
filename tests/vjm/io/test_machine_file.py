"""Machines of the library with closed loops stand where closed forms of their kinematics have them."""

import math
from pathlib import Path

import numpy as np
import pytest
from helpers.file_texts import model_text, part_text, table_text

from vjm.engines import VjmEngine
from vjm.io.errors import ModelFileError
from vjm.io.files import toml_text
from vjm.io.machine_file import load_model, machine_document
from vjm.io.manipulator_file import machines
from vjm.io.model_file import load_chain
from vjm.machine.rigid_mechanism import LoopClosure, RigidMechanism, home_label
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import RigidOffset
from vjm.postures import Posture, in_posture
from vjm.rotations import Array, rotation_from_vector, turn

SAME = 1e-8
"""mm: loops close to 1e-11 of some hundred mm, and angles and lengths of the files have nine digits."""


def end_of(machine: Machine, posture: Posture) -> Array:
    """Frame ``(4, 4)`` of the end-effector in a posture."""
    machine, label = in_posture(machine, posture)
    tree = RigidMechanism(machine)
    result: Array = tree.end_frames(tree.posture(label)[None])[0]
    return result


@pytest.mark.parametrize(
    ("name", "freedom", "redundant"),
    # by Kutzbach and Grübler, 36, 12, 10 and 6 joints and 5, 2, 3 and 1 loops of six rows: a planar loop has three
    # rows more than it needs, a tripteron one for each turn
    [("hexapod", 6, 0), ("tripteron", 3, 3), ("double-pantograph", 1, 9), ("palletiser", 3, 3)],
)
def test_mobility(name: str, freedom: int, redundant: int) -> None:
    machine = load_model(name)
    closing = LoopClosure(machine, home_label(machine))
    found = closing.mobility(closing.home)
    assert (found.freedom, found.redundant, found.idle, found.loose.shape[1]) == (freedom, redundant, (), 0)


def test_every_machine_of_the_library_is_tested() -> None:
    assert {entry.name for entry in machines()} == {
        "hexapod",
        "tripteron",
        "double-pantograph",
        "palletiser",
        "planar-cables",
    }


def test_hexapod_has_the_lengths_between_its_joints() -> None:
    machine = load_model("hexapod")
    base, top = np.radians([-10, 10, 110, 130, 230, 250]), np.radians([-50, 50, 70, 170, 190, 290])
    feet = 500.0 * np.column_stack([np.cos(base), np.sin(base), np.zeros(6)])
    heads = 250.0 * np.column_stack([np.cos(top), np.sin(top), np.zeros(6)])
    for label, d in machine.poses.items():
        places = np.array([0.0, 0.0, 500.0]) + d[:3] + heads @ rotation_from_vector(d[3:]).T
        lengths = np.linalg.norm(places - feet, axis=1) - 600.0
        assert [machine.held[label][leg] for leg in "abcdef"] == pytest.approx(lengths, abs=SAME), label


def test_tripteron_moves_along_each_drive_alone() -> None:
    machine = load_model("tripteron")
    for drives in ((80.0, -50.0, 30.0), (-90.0, 0.0, 0.0), (10.0, 20.0, -95.0)):
        end = end_of(machine, dict(zip("xyz", drives, strict=True)))
        assert end[:3, 3] == pytest.approx(drives, abs=SAME)
        assert np.abs(end[:3, :3] - np.eye(3)).max() < SAME


def test_double_pantograph_lifts_by_pythagoras() -> None:
    machine = load_model("double-pantograph")
    for foot in (250.0, 418.0, 540.0):
        end = end_of(machine, {"drive": foot})
        # each stage is as high as a bar of 600 mm over its feet; the platform is 20 mm above the upper hinges
        height = 2.0 * np.sqrt(600.0**2 - foot**2) + 20.0
        assert end[:3, 3] == pytest.approx([foot - 200.0, 0.0, height], abs=SAME)
        assert np.abs(end[:3, :3] - np.eye(3)).max() < SAME


def test_palletiser_turns_its_forearm_from_the_shoulder() -> None:
    machine = load_model("palletiser")
    for waist, shoulder, lever in ((0.0, -1.3, 0.2), (0.7, -1.0, 0.4), (-1.2, -1.6, -0.3)):
        end = end_of(machine, {"waist": waist, "shoulder": shoulder, "lever-drive": lever})
        y = np.array([0.0, 1.0, 0.0])
        upper, fore = (turn(y, angle)[:3, :3] for angle in (shoulder, lever))
        place = np.array([150.0, 0.0, 500.0]) + upper @ [600.0, 0.0, 0.0] + fore @ [700.0, 0.0, -50.0]
        about = turn(np.array([0.0, 0.0, 1.0]), waist)[:3, :3]
        assert end[:3, 3] == pytest.approx(about @ place, abs=SAME)
        assert np.abs(end[:3, :3] - about @ fore).max() < SAME


def test_masses_of_a_platform_are_kept() -> None:
    machine = load_model("hexapod")
    platform = machine.parts[-1]
    assert isinstance(platform, RigidOffset)
    assert (platform.mass, platform.centre_of_mass.tolist()) == (20.0, [0.0, 0.0, 10.0])


RIGID_BAR = model_text(
    "rigid-bar",
    part_text("joint", "near", axis="z"),
    part_text("link", "bar", translation_mm=[310.0, 0.0, 0.0]),
    part_text("joint", "far", axis="z"),
    postures={"A": [0.0, 0.0]},
)
ASIDE, AHEAD = {"position_mm": [0.0, 40.0, 0.0]}, {"position_mm": [310.0, 0.0, 0.0]}
MIXED = model_text(
    "mixed",
    table_text("platform", **AHEAD),
    table_text("[bodies]", name="middle", mass_kg=3.0, centre_of_mass_mm=[5.0, 0.0, 0.0]),
    table_text(
        "[legs]", name="one", chain="orthoglide-bar", ends_on="middle", base=ASIDE, attachment=ASIDE, posture="A"
    ),
    table_text("[legs]", name="two", chain="rigid-bar", ends_on="middle", posture="A"),
    table_text(
        "[legs]", name="on", chain="rigid-bar", starts_on="middle", drive="bar", drive_turns_about="y",
        posture=[0.0, 0.0], attachment=AHEAD,
    ),
    table_text("poses", home=[0.0, 0.0, 0.0]),
    kind="manipulator",
)  # fmt: skip


def mixed(folder: Path, old: str = "", new: str = "") -> Path:
    assert old in MIXED
    source = (
        Path(str(__import__("vjm").__file__)).parent / "models" / "manipulators" / "chains" / "orthoglide-bar.toml"
    )
    (folder / "orthoglide-bar.toml").write_bytes(source.read_bytes())
    (folder / "rigid-bar.toml").write_text(RIGID_BAR, encoding="utf-8")
    path = folder / "mixed.toml"
    path.write_text(MIXED.replace(old, new) if old else MIXED, encoding="utf-8")
    return path


def test_rigid_legs_and_a_leg_behind_a_loop_load(tmp_path: Path) -> None:
    machine = load_model(mixed(tmp_path))
    assert [closure.name for closure in machine.closures] == ["two"]
    assert machine.after["on/root"] == "one/attachment"
    # the bars are 40 mm apart, the middle body's frame is at their far ends
    carrier = next(part for part in machine.parts if part.name == "one/attachment")
    assert isinstance(carrier, RigidOffset)
    # its centre of mass lies at 5, 0, 0 in the body, and the leg's end at 0, 40, 0
    assert (carrier.mass, carrier.centre_of_mass.tolist()) == (3.0, [5.0, -40.0, 0.0])
    end = end_of(machine, "home")
    assert end[:3, 3] == pytest.approx([310.0, 0.0, 0.0], abs=SAME)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "posture = [0.0, 0.0]",
            "posture = [0.0]",
            "leg 'on': 1 coordinates for 2 joints (near, far): give one each",
        ),
        ('drive = "bar"', 'drive = "rod"', "leg 'on': no part 'rod' to drive (there are near, bar, far)"),
        ('name = "middle"', 'name = "muddle"', "mixed: body 'muddle' has a mass, but no leg ends on it"),
        (
            'starts_on = "middle"',
            'starts_on = "nowhere"',
            "leg 'on' begins on 'nowhere', where no leg before it ends",
        ),
        (
            "position_mm = [310.0, 0.0, 0.0]\n[[bodies]]",
            "position_mm = [320.0, 0.0, 0.0]\n[[bodies]]",
            "the end-effector stays",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(ModelFileError) as error:
        load_model(mixed(tmp_path, old, new))
    assert str(error.value).startswith("mixed.toml: ")
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_home_beyond_a_drives_limits_is_refused(tmp_path: Path) -> None:
    limited = 'drive = "bar"\ndrive_limits = [0.1, 0.5]'
    with pytest.raises(ModelFileError, match=r"posture 'home': out of reach: on = .* is below its limit 0\.1"):
        load_model(mixed(tmp_path, 'drive = "bar"', limited))


def test_a_leg_that_is_rigid_is_no_machine_by_itself(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match=r"rigid-bar\.toml: nothing deflects"):
        load_chain(mixed(tmp_path).parent / "rigid-bar.toml")


@pytest.mark.parametrize("name", ["delta", "hexapod"])
def test_a_machine_of_legs_is_written_as_one_file(name: str, tmp_path: Path) -> None:
    """Legs, drives, masses and loops of the manipulator file are those of the one file."""
    given, file = load_model(name), tmp_path / "one.toml"
    file.write_text(toml_text(machine_document(name).content))
    one = load_chain(file)
    assert [part.name for part in one.parts] == [part.name for part in given.parts]
    for label in given.postures:
        ends = [
            tree.end_frames(tree.posture(label)[None])[0] for tree in (RigidMechanism(given), RigidMechanism(one))
        ]
        np.testing.assert_allclose(ends[1], ends[0], atol=1e-9)
    path, again = (VjmEngine(2).trace(chain, LoadCase("side", 0.1, steps=1)) for chain in (given, one))
    np.testing.assert_allclose(again.points[-1].wrench, path.points[-1].wrench, rtol=1e-9, atol=1e-6)
    assert [getattr(part, "mass", 0.0) for part in one.parts] == [
        getattr(part, "mass", 0.0) for part in given.parts
    ]


# Model files of machines with closed loops.


MOVED = [100.0 * (math.cos(1.2) - math.cos(0.9)), 100.0 * (math.sin(1.2) - math.sin(0.9)), 0.0]
FOUR_BAR = model_text(
    "four-bar",
    part_text("actuated", "crank", axis="z", compliance_rad_per_Nmm=1e-8),
    part_text("link", "crank-arm", translation_mm=[100.0, 0.0, 0.0]),
    part_text("joint", "knee", axis="z"),
    part_text("link", "coupler", translation_mm=[300.0, 0.0, 0.0]),
    part_text("link", "rocker-foot", after="", translation_mm=[300.0, 0.0, 0.0]),
    part_text("joint", "rocker", axis="z"),
    part_text("link", "rocker-arm", translation_mm=[100.0, 0.0, 0.0]),
    part_text("joint", "pin", axis="z"),
    part_text("link", "tool", after="coupler"),
    table_text("[closures]", name="loop", between=["coupler", "pin"]),
    table_text("poses", moved=MOVED),
    postures={"home": {"crank": 0.9, "knee": -0.902, "rocker": 0.899, "pin": -0.9}},
)


def written(folder: Path, text: str = FOUR_BAR) -> Path:
    path = folder / "machine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def standing(chain: Machine, label: str) -> dict[str, float]:
    passive = dict(zip((joint.name for joint in chain.joints), chain.posture(label).tolist(), strict=True))
    return {**chain.held[label], **passive}


def angles(crank: float) -> dict[str, float]:
    """Of a parallelogram: the coupler keeps its direction."""
    return {"crank": crank, "knee": -crank, "rocker": crank, "pin": -crank}


def test_rounded_home_is_closed_with_its_drive_where_it_is(tmp_path: Path) -> None:
    chain = load_chain(written(tmp_path))
    assert standing(chain, "home") == pytest.approx(angles(0.9), abs=1e-9)


def test_pose_becomes_a_posture(tmp_path: Path) -> None:
    # 100 (cos 1.2 - cos 0.9) and 100 (sin 1.2 - sin 0.9) are along x and y
    shift = 100.0 * (np.array([np.cos(1.2), np.sin(1.2)]) - np.array([np.cos(0.9), np.sin(0.9)]))
    chain = load_chain(written(tmp_path))
    assert chain.poses["moved"][:2] == pytest.approx(shift, abs=1e-12)
    assert standing(chain, "moved") == pytest.approx(angles(1.2), abs=1e-8)


def test_posture_by_the_drive_brings_the_passive_joints(tmp_path: Path) -> None:
    chain, label = in_posture(load_chain(written(tmp_path)), {"crank": 1.1})
    assert standing(chain, label) == pytest.approx(angles(1.1), abs=1e-9)
    again, label = in_posture(chain, "crank=1.1")
    assert standing(again, label) == pytest.approx(angles(1.1), abs=1e-9)


def test_posture_by_the_end_effector_brings_the_drive(tmp_path: Path) -> None:
    x, y = 100.0 * (np.cos(0.7) - np.cos(0.9)), 100.0 * (np.sin(0.7) - np.sin(0.9))
    chain, label = in_posture(load_chain(written(tmp_path)), (float(x), float(y), 0.0))
    assert standing(chain, label) == pytest.approx(angles(0.7), abs=1e-8)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'between = ["coupler", "pin"]',
            'between = ["coupler", "pim"]',
            "closure 'loop' holds 'pim', which is no part",
        ),
        (
            'between = ["coupler", "pin"]',
            'between = ["coupler"]',
            "closure 'loop': between must have at least 2 entries",
        ),
        ('name = "loop"', 'name = "loop"\nholds = "glue"', "closure 'loop': holds must be 'weld' or 'ball'"),
        ('name = "loop"', 'name = "loop"\nfame = 1', "closure 'loop': unknown key 'fame'"),
        ("rocker = 0.899", "rocker = 1.9", "posture 'home': four-bar: closure 'loop' does not close at home"),
        (
            "moved = [",
            "far = [0.0, 0.0, 50.0]\nmoved = [",
            "pose 'far': four-bar: the pose 0,0,50,0,0,0 is out of reach",
        ),
        ("moved = [", "home = [", "'home' is a posture and a pose: rename one"),
        ('[[closures]]\nname = "loop"\nbetween = ["coupler", "pin"]', "", "has [poses] but no [[closures]]"),
    ],
)
def test_what_is_wrong_with_a_loop_is_said_in_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in FOUR_BAR
    with pytest.raises(ModelFileError) as error:
        load_chain(written(tmp_path, FOUR_BAR.replace(old, new)))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_what_is_no_pose_is_refused(tmp_path: Path) -> None:
    chain = load_chain(written(tmp_path))
    with pytest.raises(ValueError, match="2 coordinates are no pose of it: give x,y,z"):
        in_posture(chain, "1,2")
    with pytest.raises(ValueError, match="no held joint 'knee'; held joints are crank"):
        in_posture(chain, "crank=1,knee=2")


def test_coupling_keeps_its_sum_of_home(tmp_path: Path) -> None:
    coupled = (
        '[[couplings]]\nname = "belt"\nterms = [\n  { joint = "rocker", weight = 1.0 },\n'
        '  { joint = "pin", weight = 1.0 },\n]\n'
    )
    chain = load_chain(
        written(tmp_path, FOUR_BAR.replace("[postures]", coupled + "\n[postures]").replace("0.899", "0.9"))
    )
    assert chain.couplings[0].total == pytest.approx(0.0, abs=1e-12)
    chain, label = in_posture(chain, {"crank": 1.1})
    assert standing(chain, label) == pytest.approx(angles(1.1), abs=1e-9)
