"""MJCF files in and out, against MuJoCo's own kinematics; skipped where MuJoCo is not installed."""

import numpy as np
import pytest
from helpers.imported_mjcf import imported
from helpers.same_machine import masses, same
from helpers.urdf_arm import arm, import_urdf, joint, written

from vjm.io.errors import ModelFileError
from vjm.io.inertia import inertia_matrix
from vjm.io.machine_file import load_model
from vjm.io.manipulator_file import machines, manipulators
from vjm.io.model_file import build_chain
from vjm.io.robot_text import mjcf_leaves_out as left_out
from vjm.io.robot_text import mjcf_text
from vjm.machine.equilibria import unloaded_frames
from vjm.machine.rigid_mechanism import LoopClosure
from vjm.model.mechanism import Mechanism

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'vjm-stiffness[mjcf]'")

# two hinges of one body about their own points, references, degrees and radians, a slide, a follower of a follower
ODD = """<mujoco model="odd"><compiler angle="{angle}" autolimits="true"/><worldbody>
<body name="a" pos=".1 .2 .3" euler="{e}"><joint name="j1" axis="0 0 2" pos=".05 .02 0" range="{low} {high}"/>
<joint name="j2" axis="0 1 1" pos="0 .1 0" ref="{ref}"/><geom size=".1" mass="2" pos=".1 0 0"/>
<body name="b" pos=".5 0 0"><joint name="s" type="slide" axis="1 0 0" ref=".1" range="-1 1"/>
<geom size=".1" mass="1"/>
<body name="c" pos="0 .5 0" quat=".7 .1 .2 .3"><joint name="f" axis="1 0 0"/><geom size=".1" mass="1"/>
<body name="d" pos="0 .5 .1"><joint name="g" axis="0 0 1"/><inertial pos=".1 0 .2" mass="3" diaginertia="1 1 1"/>
</body></body></body></body></worldbody>
<equality><joint joint1="f" joint2="s" polycoef=".2 3 0 0 0"/><joint joint1="g" joint2="f" polycoef="0 -1 0 0 0"/>
</equality></mujoco>"""
RADIANS = {"angle": "radian", "e": ".1 .2 .3", "low": "-1", "high": "2", "ref": ".3"}
DEGREES = {"angle": "degree", "e": "5 10 15", "low": "-50", "high": "100", "ref": "20"}
# rounding over some ten frames of 1 m, mm; the worst is 7e-13
FRAMES = 1e-11


def worst(text: str, found, tip: str) -> float:
    """Largest difference of a body's frame from MuJoCo's in 20 postures, mm."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    ours = Mechanism(build_chain(found.document, "m.toml").split())
    coupled = [part for part in found.document["parts"] if part["kind"] == "coupled"]
    rng, most = np.random.default_rng(0), 0.0
    for _ in range(20):
        q = {name: rng.uniform(-1.0, 1.0) for name in ours.joints}
        value = dict(q)
        for part in coupled:
            ((master, ratio),) = part["to"].items()
            value[part["name"]] = ratio * value[master] + part.get("offset_rad", 0.0)
        for i in range(model.njnt):
            slides = int(model.jnt_type[i]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
            # what is off the way to the tip does not move it
            data.qpos[model.jnt_qposadr[i]] = value.get(model.joint(i).name, 0.0) / (1e3 if slides else 1.0)
        mujoco.mj_kinematics(model, data)
        R, p = unloaded_frames(ours, ours.command_rows(q)[0])
        body = data.body(tip)
        most = max(most, np.abs(p[0, 0] - 1e3 * body.xpos).max(), np.abs(R[0, 0] - body.xmat.reshape(3, 3)).max())
    return most


@pytest.mark.parametrize("words", [RADIANS, DEGREES], ids=["radian", "degree"])
@pytest.mark.parametrize("tip", ["b", "d"])
def test_a_robot_is_read_as_mujoco_reads_it(tmp_path, words, tip):
    text = ODD.format(**words)
    found = imported(tmp_path, text, tip)
    assert worst(text, found, tip) < FRAMES
    assert found.document["parts"][-1]["name"] == f"{tip}-mass"


def test_masses_limits_and_couplings_are_those_of_the_file(tmp_path):
    found = imported(tmp_path, ODD.format(**RADIANS))
    parts = {part["name"]: part for part in found.document["parts"]}
    assert parts["j1"]["limits_rad"] == [-1.0, 2.0]
    assert parts["s"]["limits_mm"] == [-1000.0, 1000.0]
    # 0.2 + 3 (s − 0.1) rad, s in m; its follower turns against it
    assert (parts["f"]["to"], parts["f"]["offset_rad"]) == ({"s": 0.003}, pytest.approx(-0.1, abs=1e-15))
    assert (parts["g"]["to"], parts["g"]["offset_rad"]) == ({"s": -0.003}, pytest.approx(0.1, abs=1e-15))
    assert parts["d-mass"]["mass_kg"] == 3.0
    assert parts["d-mass"]["centre_of_mass_mm"] == [100.0, 0.0, 200.0]
    assert "shapes (3)" in " ".join(found.left_out)
    # what stands between two joints of one body is no link of the file
    assert found.notes.doubtful == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>",
            "is free, and a machine",
        ),
        ("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>", "MuJoCo does not read it"),
        ("<mujoco><worldbody/></mujoco>", "no joint moves"),
        ("<mujoco><nonsense/></mujoco>", "MuJoCo does not read it"),
    ],
)
def test_a_refusal_is_one_line(tmp_path, text, says):
    with pytest.raises(ModelFileError) as caught:
        imported(tmp_path, text)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_moments_of_inertia_are_those_of_the_box(tmp_path):
    """m (b² + c²) / 12 about each axis of a box, which stands turned in its body by a quarter about z."""
    a, b, c, mass = 0.2, 0.1, 0.05, 3.0
    found = imported(
        tmp_path,
        f"""<mujoco model="one"><worldbody><body name="box"><joint name="hinge" axis="0 0 1"/>
        <geom type="box" size="{a / 2} {b / 2} {c / 2}" mass="{mass}" pos=".1 0 0" euler="0 0 90"/>
        </body></worldbody></mujoco>""",
    )
    (link,) = [part for part in found.document["parts"] if "mass_kg" in part]
    along_y, along_x, along_z = (1e6 * mass / 12.0 * (p**2 + q**2) for p, q in ((b, c), (a, c), (a, b)))
    np.testing.assert_allclose(
        link["inertia_kg_mm2"], [along_x, along_y, along_z, 0.0, 0.0, 0.0], rtol=1e-12, atol=1e-9 * along_z
    )


def test_the_armature_of_a_joint_is_the_inertia_of_its_rotor(tmp_path):
    text = ODD.format(**RADIANS)
    text = text.replace('name="j1"', 'name="j1" armature=".3"').replace('name="s"', 'name="s" armature="2"')
    found = imported(tmp_path, text)
    keys = {
        key: part[key] for part in found.document["parts"] for key in ("rotor_kg_mm2", "rotor_kg") if key in part
    }
    assert keys == pytest.approx({"rotor_kg_mm2": 3e5, "rotor_kg": 2.0})
    built = build_chain(found.document, "m.toml")
    assert {part.name: part.rotor for part in built.moving if part.rotor} == pytest.approx({"j1": 3e5, "s": 2.0})


ODD_MOMENTS = [
    ('diaginertia="1 1 9"', [10 / 3, 10 / 3, 20 / 3]),
    # -1 and 1 about x and y, and 1 about z: a rod along x has the nearest
    ('fullinertia="-1 1 1 0 0 0"', [0.0, 1.0, 1.0]),
]


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("given", "moments"), ODD_MOMENTS)
def test_an_inertia_that_no_body_has_becomes_the_nearest(tmp_path, given, moments):
    """Of that body alone, and said; left out or refused where that is asked."""
    text = ODD.format(**RADIANS)
    odd = text.replace('diaginertia="1 1 1"', given, 1)
    assert odd != text
    found, known = imported(tmp_path, odd), imported(tmp_path, text).document["parts"]
    changed = [(a, b) for a, b in zip(found.document["parts"], known, strict=True) if a != b]
    ((part, before),) = changed
    now = np.linalg.eigvalsh(inertia_matrix(part["inertia_kg_mm2"]))
    # the 1e-12 of their size that MuJoCo's rounding asks for beside a zero moment is far below 1 g at 1 mm
    assert now == pytest.approx(1e6 * np.array(moments), rel=1e-9, abs=1e-3)
    (said,) = [line for line in found.notes.changed if "which no body has" in line]
    assert "kg m², which no body has, became" in said
    without = imported(tmp_path, odd, repairs="left out").document["parts"]
    parts = [{k: v for k, v in p.items() if p is not before or k != "inertia_kg_mm2"} for p in known]
    assert without == parts
    with pytest.raises(ModelFileError, match="has moments of inertia that no body has: correct them"):
        imported(tmp_path, odd, repairs="refused")


def test_what_is_not_read_is_said_to_be_left_out(tmp_path):
    text = ODD.format(**RADIANS).replace(
        "</equality>", '<connect name="loop" active="false" body1="a" anchor="0 0 0"/></equality>'
    )
    said = "\n".join(imported(tmp_path, text.replace('name="g"', 'name="g" damping="1"')).left_out)
    assert "the equality 'loop' (connect)" in said
    assert "damping of joints" in said


@pytest.mark.parametrize("name", ["ur10", "planar-2r"])
def test_a_library_machine_comes_back(tmp_path, name):
    chain = load_model(name)
    back = build_chain(imported(tmp_path, mjcf_text(chain)).document, "m.toml")
    # metres are binary numbers in MuJoCo
    same(chain, back, digits=1e-15)
    assert [mass for mass, _ in masses(back)] == [mass for mass, _ in masses(chain)]
    centres = [centre for _, centre in masses(chain)]
    assert [centre for _, centre in masses(back)] == [pytest.approx(centre, abs=1e-12) for centre in centres]


def test_a_coupling_comes_back(tmp_path):
    follower = joint("j2", "l1", "l2", "prismatic", more='<mimic joint="j1" multiplier="0.07" offset="0.1"/>')
    chain = build_chain(import_urdf(written(tmp_path, arm(j2=follower))).document, "m.toml")
    same(chain, build_chain(imported(tmp_path, mjcf_text(chain)).document, "m.toml"), digits=1e-15)


def test_springs_hold_what_the_machine_holds():
    """A load turns MuJoCo's joints by what the compliances say: τ = k (q − q₀)."""
    chain = load_model("ur10")
    model = mujoco.MjModel.from_xml_string(mjcf_text(chain))
    for part in chain.held_joints:
        # rad/(N mm) to N m/rad
        stiffness = 1e-3 / part.compliance
        assert model.joint(part.name).stiffness[0] == pytest.approx(stiffness, rel=1e-15)
    rest = next(iter(chain.held.values()))
    assert {name: model.qpos_spring[model.joint(name).qposadr[0]] for name in rest} == pytest.approx(dict(rest))
    assert "what is elastic" not in " ".join(left_out(chain))
    said = " ".join(left_out(load_model("orthoglide-chain")))
    assert "what is elastic in" in said
    assert "have no mass: MuJoCo takes no zero" in said


# a four-bar linkage: ground 300, crank 100, coupler 260, rocker 220 mm, drawn where it closes
FOUR_BAR = """<mujoco model="four-bar"><compiler autolimits="true"/><worldbody>
<body name="crank" euler="0 0 {crank:.17g}"><joint name="drive" axis="0 0 1"/>
<geom size=".01" mass="1" pos=".05 0 0"/>
<body name="coupler" pos=".1 0 0" euler="0 0 {knee:.17g}"><joint name="knee" axis="0 0 1"/>
<geom size=".01" mass="1" pos=".1 0 0"/></body></body>
<body name="rocker" pos=".3 0 0" euler="0 0 {rocker:.17g}"><joint name="pivot" axis="0 0 1"/>
<geom size=".01" mass="1" pos=".1 0 0"/></body></worldbody>
<equality>{held}</equality><actuator><motor joint="drive"/></actuator></mujoco>"""
CRANK = np.radians(30.0)
KNEE = 100.0 * np.array([np.cos(CRANK), np.sin(CRANK)])
TO_PIVOT = np.array([300.0, 0.0]) - KNEE
DISTANCE = float(np.linalg.norm(TO_PIVOT))
# by the law of cosines, with the angle between the coupler and the line from the knee to the pivot
COUPLER = np.arctan2(*TO_PIVOT[::-1]) + np.arccos((DISTANCE**2 + 260.0**2 - 220.0**2) / (2.0 * DISTANCE * 260.0))
ROCKER = np.arctan2(*(260.0 * np.array([np.cos(COUPLER), np.sin(COUPLER)]) - TO_PIVOT)[::-1])


@pytest.mark.parametrize("held", [
    '<connect name="pin" body1="coupler" body2="rocker" anchor=".26 0 0"/>',
    '<weld name="pin" body1="coupler" body2="rocker" relpose=".26 0 0 1 0 0 0" anchor=".22 0 0"/>',
])  # fmt: skip
def test_what_holds_bodies_together_closes_a_loop(tmp_path, held):
    """A pin leaves a four-bar linkage its one freedom; a weld of two bars none."""
    pin = "connect" in held
    # the weld's rotation: from the coupler's direction to the rocker's
    turn = 0.5 * (ROCKER - COUPLER)
    held = held.replace("1 0 0 0", f"{np.cos(turn):.17g} 0 0 {np.sin(turn):.17g}")
    angles = {"crank": CRANK, "knee": COUPLER - CRANK, "rocker": ROCKER}
    drawn = {name: float(np.degrees(angle)) for name, angle in angles.items()}
    found = imported(tmp_path, FOUR_BAR.format(**drawn, held=held))
    machine = build_chain(found.document, "m.toml")
    assert [joint.name for joint in machine.joints] == ["knee", "pivot"]
    closing = LoopClosure(machine, "home")
    assert closing.mobility(closing.home).freedom == (1 if pin else 0)
    # rad; angles of the file have sixteen digits, and loops close to 1e-11
    assert closing.home == pytest.approx(np.zeros(3), abs=1e-9)


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize("name", [entry.name for entry in (*machines(), *manipulators())])
def test_a_machine_with_closed_loops_goes_to_mujoco_and_comes_back(tmp_path, name):
    machine = load_model(name)
    text = mjcf_text(machine)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    assert [model.key(k).name for k in range(model.nkey)] == list(machine.postures)
    for k in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, k)
        mujoco.mj_forward(model, data)
        gaps = data.efc_pos[: data.ne]
        # MuJoCo's own gaps, m and rad; ours stop at 1e-11 of the machine's length
        assert 3 * len(machine.closures) <= len(gaps)
        assert np.abs(gaps).max(initial=0.0) < 1e-9
    back = build_chain(imported(tmp_path, text).document, "m.toml")
    assert len(back.held_joints) == len(machine.held_joints) or not machine.held_joints
    home = next(iter(machine.postures))
    found, expected = LoopClosure(back, "home"), LoopClosure(machine, home)
    assert np.abs(found.end - expected.end).max() < 1e-8
    if machine.held_joints and not machine.couplings:
        assert found.mobility(found.home).freedom == expected.mobility(expected.home).freedom
    elif machine.couplings:
        assert "the couplings of passive joints" in " ".join(left_out(machine))


MESHES = """<mujoco><asset><mesh name="m" file="none.stl"/><texture name="t" type="2d" file="none.png"/>
<material name="u" texture="t"/></asset><worldbody><geom type="plane" size="1 1 1" material="u"/>
<body name="a"><joint name="j" axis="0 1 0"/>{own}<geom type="mesh" mesh="m" material="u" {shape}/></body>
</worldbody></mujoco>"""
BALL, HEAVY = '<geom size=".1"/>', '<inertial mass="2" pos=".3 0 0" diaginertia=".1 .1 .1"/>'


@pytest.mark.parametrize(
    ("own", "shape", "mass"),
    [
        (HEAVY, "", 2.0),
        (BALL, 'mass="0"', 1000.0 * 4.0 / 3.0 * np.pi * 0.1**3),
        (BALL, 'density="0"', 1000.0 * 4.0 / 3.0 * np.pi * 0.1**3),
        (BALL, 'group="7"', 1000.0 * 4.0 / 3.0 * np.pi * 0.1**3),
    ],
)
def test_files_of_shapes_without_mass_may_be_missing(tmp_path, own, shape, mass):
    found = imported(tmp_path, MESHES.format(own=own, shape=shape))
    (part,) = [part for part in found.document["parts"] if "mass_kg" in part]
    assert part["mass_kg"] == pytest.approx(mass, rel=1e-12)
    assert "meshes, of files that are not there: the masses follow from none of them" in found.left_out


@pytest.mark.parametrize(
    ("own", "option"), [("", ""), (BALL, ""), (HEAVY, '<compiler inertiafromgeom="true"/>')], ids=str
)
def test_a_mesh_that_a_mass_follows_from_must_be_there(tmp_path, own, option):
    text = MESHES.format(own=own, shape="").replace("<asset>", f"{option}<asset>")
    with pytest.raises(ModelFileError, match=r"'none\.stl'\. Put it there, or give every body an <inertial>"):
        imported(tmp_path, text)
