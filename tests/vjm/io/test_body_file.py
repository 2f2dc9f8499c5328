"""Files of bodies and joints: the same machines as chain files, written by places, and what is wrong with one."""

from pathlib import Path

import numpy as np
import pytest

import vjm
from vjm.io.body_file import JOINT_KINDS
from vjm.io.errors import ModelFileError
from vjm.io.machine_file import load_model
from vjm.machine.equilibria import equilibria
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.postures import in_posture

HEAD = """
format = 1
kind = "bodies"
name = "NAME"
title = "a machine of a test"
source = "made up"
units = { length = "mm", force = "N", angle = "rad" }
"""
TUBE = "{ EA_N = 1.4778e8, GJ_Nmm2 = 4.4897e10, EIy_Nmm2 = 5.82e10, EIz_Nmm2 = 5.82e10 }"
BAR = "{ EA_N = 8.4e7, GJ_Nmm2 = 1.8222e9, EIy_Nmm2 = 2.8e9, EIz_Nmm2 = 2.8e9 }"


def written(folder: Path, text: str, name: str = "machine") -> Path:
    file = folder / f"{name}.toml"
    file.write_text(HEAD.replace("NAME", name) + text, encoding="utf-8")
    return file


def at(point) -> str:
    return str([float(v) for v in point])


def about_y(angle, length) -> np.ndarray:
    """A link along x that is turned about y."""
    return length * np.array([np.cos(angle), 0.0, -np.sin(angle)])


def palletiser() -> str:
    """The library's, by where its pins are at home: shoulder -1.3, elbow 1.5, lever 0.2 behind it."""
    column = np.array([150.0, 0.0, 500.0])
    elbow = column + about_y(-1.3, 600.0)
    wrist, rear = elbow + about_y(0.2, 700.0), elbow - about_y(0.2, 200.0)
    lever = column - about_y(0.2, 200.0)
    tool = wrist + np.array([-np.sin(0.2), 0.0, -np.cos(0.2)]) * 50.0
    balance = column + about_y(-1.3, 150.0)
    return f"""
end = {{ body = "tool", at_mm = {at(tool)}, turns = [{{ turn_about = "y", angle_deg = {np.rad2deg(0.2)} }}] }}

[[bodies]]
name = "column"
[[bodies]]
name = "upper-arm"
mass_kg = 25.0
centre_of_mass_mm = {at(column + about_y(-1.3, 300.0))}
[[bodies]]
name = "rear"
[[bodies]]
name = "tool"
mass_kg = 30.0
centre_of_mass_mm = {at(tool)}
[[bodies]]
name = "lever"
[[bodies]]
name = "rod-foot"
[[bodies]]
name = "rod-head"

[[joints]]
name = "waist"
kind = "actuated"
between = ["ground", "column"]
at_mm = [0.0, 0.0, 0.0]
axis = "z"
compliance_rad_per_Nmm = 1e-10
[[joints]]
name = "shoulder"
kind = "actuated"
between = ["column", "upper-arm"]
at_mm = {at(column)}
axis = "y"
drawn = -1.3
compliance_rad_per_Nmm = 5e-10
[[joints]]
name = "lever-drive"
kind = "actuated"
between = ["column", "lever"]
at_mm = {at(column)}
axis = "y"
drawn = 0.2
compliance_rad_per_Nmm = 5e-10
[[joints]]
name = "elbow"
between = ["upper-arm", "rear"]
at_mm = {at(elbow)}
axis = "y"
[[joints]]
name = "rod-low"
between = ["rod-foot", "lever"]
at_mm = {at(lever)}
axis = "y"
[[joints]]
name = "rod-high"
between = ["rod-head", "rear"]
at_mm = {at(rear)}
axis = "y"

[[beams]]
name = "forearm"
between = ["rear", "tool"]
from_mm = {at(elbow)}
to_mm = {at(wrist)}
section = {TUBE}
[[beams]]
name = "rod"
between = ["rod-foot", "rod-head"]
from_mm = {at(lever)}
to_mm = {at(rear)}
section = {BAR}

[[point_springs]]
name = "compensator"
between = ["column", "upper-arm"]
points_mm = [[0.0, 0.0, 250.0], {at(balance)}]
stiffness_N_per_mm = 15.0
free_length_mm = 150.0

[postures]
low = {{ shoulder = -1.0, lever-drive = 0.4 }}
"""


def loaded(machine, posture):
    model = Mechanism(machine.split())
    return equilibria(model, model.posture(posture), gravity=(0.0, 0.0, -9.81))


def test_the_palletiser_by_its_pins_is_that_of_the_library(tmp_path):
    """Another tree, other frames and another place where its loop is cut; the same equilibria under weight."""
    own, known = load_model(written(tmp_path, palletiser())), load_model("palletiser")
    assert [closure.name for closure in own.closures] == ["rod-high-loop"]
    posed, low = in_posture(known, "waist=0,shoulder=-1.0,lever-drive=0.4")
    for label, other, machine in (("drawn", "home", known), ("low", low, posed)):
        found, wanted = loaded(own, label), loaded(machine, other)
        assert found.stable.all()
        assert wanted.stable.all()
        # numbers of the two files agree to rounding of angles in degrees
        assert found.position == pytest.approx(wanted.position, abs=1e-8)
        assert found.deflection == pytest.approx(wanted.deflection, abs=1e-9)
        assert found.stiffness == pytest.approx(wanted.stiffness, rel=1e-6, abs=1e-6 * wanted.stiffness.max())


def test_a_chain_by_its_places_is_the_library_s_chain_with_the_same_stiffness(tmp_path):
    text = f"""
end = {{ body = "tool", at_mm = [900.0, 0.0, 0.0] }}
[[bodies]]
name = "link"
[[bodies]]
name = "tool"
[[joints]]
name = "shoulder"
kind = "actuated"
between = ["link", "ground"]
at_mm = [0.0, 0.0, 0.0]
axis = "z"
compliance_rad_per_Nmm = 1e-8
[[beams]]
name = "upper"
between = ["tool", "link"]
from_mm = [900.0, 0.0, 0.0]
to_mm = [0.0, 0.0, 0.0]
section = {TUBE}
"""
    machine = load_model(written(tmp_path, text))
    found = loaded(machine, "drawn")
    # end deflection by unit forces: gear along y, bending, tension
    C = found.compliance[0, 0]
    assert C[0, 0] == pytest.approx(900.0 / 1.4778e8, rel=1e-9)
    assert C[1, 1] == pytest.approx(900.0**3 / (3.0 * 5.82e10) + 900.0**2 * 1e-8, rel=1e-9)
    assert C[2, 2] == pytest.approx(900.0**3 / (3.0 * 5.82e10), rel=1e-9)


def test_a_body_on_three_ball_rods_is_held_by_the_sum_of_their_stiffnesses(tmp_path):
    """Six struts with balls at both ends, three pairs: K = Σ k u uᵀ for the place; rods may spin."""
    rng = np.random.default_rng(4)
    tops = [
        100.0 * np.array([np.cos(a), np.sin(a), 0.0]) + [0, 0, 400.0]
        for a in np.deg2rad([0, 60, 120, 180, 240, 300])
    ]
    feet = [300.0 * np.array([np.cos(a), np.sin(a), 0.0]) for a in np.deg2rad([50, 10, 170, 130, 290, 250])]
    text = 'end = { body = "top", at_mm = [0.0, 0.0, 400.0] }\n[[bodies]]\nname = "top"\n'
    K = np.zeros((6, 6))
    for i, (foot, top) in enumerate(zip(feet, tops, strict=True)):
        EA = float(rng.uniform(1e6, 2e6))
        text += f"""
[[bodies]]
name = "foot{i}"
[[bodies]]
name = "head{i}"
[[joints]]
name = "low{i}"
kind = "universal"
axes = ["x", "y"]
between = ["ground", "foot{i}"]
at_mm = {at(foot)}
[[beams]]
name = "rod{i}"
between = ["foot{i}", "head{i}"]
from_mm = {at(foot)}
to_mm = {at(top)}
section = {{ EA_N = {EA}, GJ_Nmm2 = 1e9, EIy_Nmm2 = 1e9, EIz_Nmm2 = 1e9 }}
[[joints]]
name = "high{i}"
kind = "ball"
between = ["head{i}", "top"]
at_mm = {at(top)}
"""
        u = (top - foot) / np.linalg.norm(top - foot)
        J = np.concatenate([u, np.cross(top - [0, 0, 400.0], u)])
        K += EA / np.linalg.norm(top - foot) * np.outer(J, J)
    machine = load_model(written(tmp_path, text))
    found = loaded(machine, "drawn")
    assert len(machine.closures) == 5
    assert found.stiffness[0, 0] == pytest.approx(K, rel=1e-9, abs=1e-9 * np.abs(K).max())


def test_a_file_of_bodies_is_loaded_like_any_other(tmp_path):
    machine = vjm.load(written(tmp_path, palletiser()))
    assert isinstance(machine, Machine)
    assert set(machine.postures) == {"drawn", "low"}
    assert machine.held["low"]["shoulder"] == -1.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('["column", "lever"]', '["colum", "lever"]', "no body 'colum'; did you mean 'column'?"),
        ('name = "rear"', 'name = "elbow"', "stands twice"),
        ('name = "lever"\n', 'name = "lever"\n[[bodies]]\nname = "loose"\n', "body 'loose' is connected to"),
        ("mass_kg = 25.0\ncentre", "mass_kg = 25.0\n#", "body 'upper-arm' has mass_kg but no centre_of_mass_mm"),
        ('"actuated"\nbetween = ["ground"', '"ball"\nbetween = ["ground"', "of kind 'ball' takes no axis"),
        ("low = { shoulder", "low = { sholder", "no joint 'sholder'; did you mean 'shoulder'?"),
        ("axis = \"y\"\ndrawn", "axis = [1.0, 1.0, 0.0]\ndrawn", "write the unit vector"),
        ("EA_N = 8.4e7", "EA_N = -8.4e7", "part 'rod'"),
        ('name = "rod-foot"', 'name = "rod-foot"\nmas_kg = 1.0', "unknown key 'mas_kg'"),
        ("{ shoulder = -1.0", "{ elbow = 1.0, shoulder = -1.0", "no held joint 'elbow'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(tmp_path, old, new, said):
    text = palletiser()
    assert old in text
    file = written(tmp_path, text.replace(old, new, 1))
    with pytest.raises(ModelFileError) as error:
        load_model(file)
    assert said in str(error.value)
    assert str(error.value).startswith("machine.toml: ")
    assert "\n" not in str(error.value)


SPINDLE = """
end = { body = "nut", at_mm = [200.0, 0.0, 0.0] }
[[bodies]]
name = "spindle"
[[bodies]]
name = "nut"
[[joints]]
name = "motor"
kind = "actuated"
between = ["ground", "spindle"]
at_mm = [0.0, 0.0, 0.0]
axis = "x"
compliance_rad_per_Nmm = 1e-6
[[joints]]
name = "guide"
between = ["ground", "nut"]
at_mm = [200.0, 0.0, 0.0]
axis = "x"
motion = "slides"
[postures]
forward = { motor = 3.0 }
[[joints]]
name = "thread"
at_mm = [200.0, 0.0, 0.0]
axis = "x"
"""


@pytest.mark.parametrize(
    "thread",
    [
        'kind = "screw"\npitch_mm = 10.0\nbetween = ["spindle", "nut"]\n',
        'kind = "screw"\npitch_mm = 10.0\nbetween = ["nut", "spindle"]\n',
        'kind = "cylindrical"\nbetween = ["spindle", "nut"]\n'
        '[[couplings]]\nname = "lead"\nterms = [{ joint = "thread-slide", weight = 1.0 }, '
        '{ joint = "thread-turn", weight = -1.5915494309189535 }]\n',
    ],
)
def test_a_nut_on_a_screw_moves_and_yields_by_its_pitch(tmp_path, thread):
    """A turn of the motor is a pitch; a motor of compliance c gives c (pitch/2π)², whoever is named first."""
    machine = load_model(written(tmp_path, SPINDLE + thread))
    found, turned = loaded(machine, "drawn"), loaded(machine, "forward")
    assert np.abs(turned.position - found.position - [-10.0 * 3.0 / (2.0 * np.pi), 0.0, 0.0]).max() < 1e-9
    # linear, but for rounding
    assert found.compliance[0, 0, 0, 0] == pytest.approx(1e-6 * (10.0 / (2.0 * np.pi)) ** 2, rel=1e-9)


def test_a_plate_on_a_plane_slides_across_its_axis_and_turns_about_it(tmp_path):
    """Two springs along x and one along y: these yield, and a force across the plane does nothing."""
    springs = "".join(
        f"[[point_springs]]\nname = 's{k}'\nbetween = ['ground', 'plate']\npoints_mm = [{first}, {last}]\n"
        f"stiffness_N_per_mm = {stiffness}\nfree_length_mm = 100.0\n"
        for k, (first, last, stiffness) in enumerate(
            [
                ("[-100.0, 50.0, 0.0]", "[0.0, 50.0, 0.0]", 2.0),
                ("[-100.0, -50.0, 0.0]", "[0.0, -50.0, 0.0]", 2.0),
                ("[0.0, -100.0, 0.0]", "[0.0, 0.0, 0.0]", 3.0),
            ]
        )
    )
    joint = "[[joints]]\nname = 'slab'\nkind = 'planar'\nbetween = ['ground', 'plate']\nat_mm = [0.0, 0.0, 0.0]\n"
    text = (
        "end = { body = 'plate', at_mm = [0.0, 0.0, 0.0] }\n[[bodies]]\nname = 'plate'\n" + joint + "axis = 'z'\n"
    )
    machine = load_model(written(tmp_path, text + springs))
    model = Mechanism(machine.split())
    found = equilibria(model, np.zeros((1, 3)), wrench=1e-3 * np.array([4.0, 3.0, 7.0, 0.0, 0.0, 5.0]))
    # springs turn by their ends' shifts over their length, which is of the second order here
    assert found.deflection[0, 0] == pytest.approx([1e-3, 1e-3, 0.0, 0.0, 0.0, 5e-7], rel=1e-4)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ('kind = "screw"', "needs pitch_mm"),
        ('kind = "cylindrical"\npitch_mm = 10.0', "takes no pitch_mm"),
        ('kind = "screw"\npitch_mm = 10.0\ndrawn = 0.1', "takes no drawn: it is drawn at zero"),
        ('kind = "screws"', "no kind of joint; did you mean 'screw'"),
    ],
)
def test_what_a_kind_of_joint_does_not_take_is_refused(tmp_path, given, said):
    with pytest.raises(ModelFileError, match=said):
        load_model(written(tmp_path, SPINDLE + given + '\nbetween = ["spindle", "nut"]\n'))


def test_the_page_on_model_files_lists_the_kinds_of_joints():
    page = (Path(__file__).parents[3] / "docs" / "model-file.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:4] for line in page.splitlines() if line.startswith("| `")]
    listed = [(name.strip(), needs.strip(), says.strip()) for name, needs, says in rows if len(says) > 0]
    for name, kind in JOINT_KINDS.items():
        assert (f"`{name}`", ", ".join(f"`{key}`" for key in kind.keys) or "–", kind.says) in listed
