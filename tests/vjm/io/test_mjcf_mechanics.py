"""What an MJCF file says of inertia, drives and loops counts in the machine: against MuJoCo and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.imported_mjcf import MM, built, imported, mujoco_masses
from scipy.linalg import null_space

from vjm.design.linear_state import question, state_of
from vjm.design.modes import mass_matrix, modes
from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.robot_document import PLACEHOLDER
from vjm.io.robot_file import Description, import_robot
from vjm.io.robot_text import mjcf_text
from vjm.io.robot_text import urdf_leaves_out as left_out
from vjm.machine.rigid_mechanism import Closing
from vjm.model.mechanism import Mechanism

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'vjm-stiffness[mjcf]'")

# of the largest entry: rounding over some ten products of frames; of frequencies half as much
ROUNDING = 1e-11
LUMP = '<inertial pos="{p}" mass="{m}" diaginertia="{i} {i} {i}"/>'


@pytest.mark.parametrize("ratio", [1.0, -2.5, 0.3])
def test_the_armature_of_a_follower_counts_with_the_square_of_its_ratio(tmp_path, ratio):
    """f = √(k / (m₁ + a₁ + r² (m₂ + a₂))) / 2π of two slides."""
    m, a = (0.05, 0.08), (0.1, 0.2)
    text = "".join(
        f'<body name="b{k}"><joint name="j{k}" type="slide" axis="0 1 0" armature="{a[k]}"/>'
        f"{LUMP.format(p='0 0 0', m=m[k], i=1e-5)}</body>"
        for k in range(2)
    )
    machine = built(
        tmp_path,
        f'<mujoco><worldbody>{text}</worldbody><equality><joint joint1="j1" joint2="j0" '
        f'polycoef="0 {ratio} 0 0 0"/></equality></mujoco>',
    )
    moved = m[0] + a[0] + ratio**2 * (m[1] + a[1])
    exact = np.sqrt(MM / PLACEHOLDER["slides"] / moved) / (2.0 * np.pi)
    assert modes(machine).frequencies == pytest.approx([exact], rel=ROUNDING)


# three hinges and a slide behind one another, of which two follow the first and the second
FOLLOWERS = """<mujoco><compiler angle="radian"/><worldbody>
<body name="a" pos="0 0 .2"><joint name="q0" axis="0 0 1" armature=".03"/>{a}
<body name="b" pos=".3 0 0" euler=".3 .1 0"><joint name="q1" axis="0 1 0" armature=".02"/>{b}
<body name="c" pos=".25 .1 0"><joint name="q2" axis="1 1 0" armature=".5"/>{b}
<body name="d" pos=".1 0 .2"><joint name="q3" type="slide" axis="0 0 1" armature="2"/>{a}
</body></body></body></body></worldbody>
<equality><joint joint1="q2" joint2="q0" polycoef=".1 -1.5 0 0 0"/><joint joint1="{first}" joint2="{second}"
polycoef="0 {ratio} 0 0 0"/></equality></mujoco>""".replace("{a}", LUMP.format(p=".1 0 .05", m=2, i=0.01)).replace(
    "{b}", LUMP.format(p="0 .1 0", m=1.2, i=0.02)
)


@pytest.mark.parametrize(("first", "second", "ratio"), [("q3", "q1", 0.2), ("q1", "q3", 5.0)])
@pytest.mark.parametrize("path", ["read", "written and read"])
def test_the_mass_matrix_of_followers_is_mujocos(tmp_path, first, second, ratio, path):
    """T' M T with MuJoCo's M of all joints and the followers' rates T, with the master before or behind."""
    text = FOLLOWERS.format(first=first, second=second, ratio=ratio)
    machine = built(tmp_path, text)
    if path != "read":
        machine = built(tmp_path, mjcf_text(machine))
    free = ["q0", second]
    at = {"q0": 0.3, second: 0.2 if second == "q1" else 200.0}
    state = state_of(question(machine, {joint.name: at[joint.name] for joint in machine.held_joints}))
    q = {"q0": 0.3, second: 0.2, "q2": 0.1 - 1.5 * 0.3, first: ratio * 0.2}
    _, _, M = mujoco_masses(text, [q[f"q{k}"] for k in range(4)])
    T = np.zeros((4, 2))
    T[0, 0], T[2, 0] = 1.0, -1.5
    T[int(second[1]), 1], T[int(first[1]), 1] = 1.0, ratio
    exact = T.T @ M @ T
    # of joints that turn in kg m², of those that slide in kg
    order = [free.index(joint.name) for joint in machine.held_joints]
    units = np.array([1.0 if joint.slides else MM for joint in machine.held_joints])
    exact = exact[np.ix_(order, order)] * np.outer(units, units)
    assert np.abs(mass_matrix(state) - exact).max() < ROUNDING * np.abs(exact).max()


LOOP = """<mujoco><compiler angle="radian"/><worldbody>
<body name="crank"><joint name="drive" axis="0 1 0" armature=".01"/>{lump}
<body name="coupler" pos="0 0 .2"><joint name="knee" axis="0 1 0" armature="{knee}"/>{lump}</body></body>
<body name="rocker" pos=".3 0 0"><joint name="pivot" axis="0 1 0" armature="{pivot}"/>{lump}</body></worldbody>
<equality><connect body1="coupler" body2="rocker" anchor=".3 0 .1"/></equality>
<actuator><motor joint="drive"/></actuator></mujoco>""".replace("{lump}", LUMP.format(p=".05 0 .1", m=1, i=0.002))


@pytest.mark.parametrize(("knee", "pivot"), [(0.0, 0.0), (0.05, 0.0), (0.0, 0.03), (0.02, 0.04)])
def test_the_armature_of_passive_joints_in_a_loop_counts(tmp_path, knee, pivot):
    """f = √(k / (t' M t)) / 2π with the rates t that MuJoCo's constraint leaves, the drive's being one."""
    text = LOOP.format(knee=knee, pivot=pivot)
    machine = built(tmp_path, text)
    assert [joint.name for joint in machine.joints] == ["knee", "pivot"]
    model, data, M = mujoco_masses(text)
    J = data.efc_J.reshape(data.nefc, model.nv)[: data.ne]
    (t,) = null_space(J, rcond=1e-9).T
    t = t / t[0]
    exact = np.sqrt(1e-3 / PLACEHOLDER["turns"] / (t @ M @ t)) / (2.0 * np.pi)
    assert modes(machine).frequencies[0] == pytest.approx(exact, rel=1e-9)
    again = built(tmp_path, mjcf_text(machine))
    assert modes(again).frequencies[0] == pytest.approx(exact, rel=1e-9)


def test_a_urdf_says_that_it_has_no_rotors(tmp_path):
    said = " ".join(left_out(built(tmp_path, FOLLOWERS.format(first="q3", second="q1", ratio=0.2))))
    assert "the inertia of the rotors of q0, q1, q2, q3" in said


GRIPPER = """<mujoco model="arm"><compiler angle="radian"/><worldbody>
<body name="upper" pos="0 0 .2"><joint name="shoulder" axis="0 1 0"/>{lump}
<body name="hand" pos=".3 0 0"><joint name="wrist" axis="0 1 0"/>{lump}{fingers}</body></body></worldbody>
{more}</mujoco>""".replace("{lump}", LUMP.format(p=".05 0 .1", m=1, i=0.002))
FINGERS = """<body name="rd" pos=".05 -.03 0"><joint name="right" axis="0 0 -1"/>{lump}
<body name="rf" pos=".04 0 0"><joint name="finger" axis="0 0 1"/>{lump}</body></body>
<body name="rk" pos=".06 -.015 0"><joint name="knuckle" axis="0 0 -1"/>{lump}</body>
<body name="ld" pos=".05 .03 0"><joint name="left" axis="0 0 1"/>{lump}</body>""".replace(
    "{lump}", LUMP.format(p=".02 0 0", m=0.05, i=1e-5)
)
TENDON = """<tendon><fixed name="split"><joint joint="right" coef=".5"/><joint joint="left" coef=".5"/></fixed>
</tendon><equality><connect body1="rf" body2="rk" anchor=".01 .015 0"/>{follows}</equality>
<actuator><motor joint="shoulder"/><motor joint="wrist"/><general tendon="split"/></actuator>"""
FOLLOWS = '<joint joint1="left" joint2="right"/>'


def test_a_gripper_driven_by_a_tendon_has_one_drive(tmp_path):
    machine = built(tmp_path, GRIPPER.format(fingers=FINGERS, more=TENDON.format(follows=FOLLOWS)))
    assert [joint.name for joint in machine.held_joints] == ["shoulder", "wrist", "right"]
    assert [joint.name for joint in machine.joints] == ["finger", "knuckle"]
    assert {joint.name: joint.coupling.ratios for joint in machine.moving if joint.coupling} == {
        "left": (("right", 1.0),)
    }
    assert len(modes(machine).frequencies) == 3


def test_a_tendon_over_joints_of_their_own_is_refused(tmp_path):
    with pytest.raises(ModelFileError, match=r"robot.xml: one tendon drives the joints right, left, which move"):
        imported(tmp_path, GRIPPER.format(fingers=FINGERS, more=TENDON.format(follows="")))


def test_a_drive_of_a_follower_drives_what_it_follows(tmp_path):
    """The actuator stands at the follower: both are driven, and neither is passive."""
    follows = '<joint joint1="drive" joint2="turntable" polycoef="0 2 0 0 0"/></equality>'
    text = LOOP.replace("</equality>", follows).replace(
        "</worldbody>",
        f'<body name="table"><joint name="turntable" axis="0 1 0"/>{LUMP.format(p="0 0 0", m=1, i=0.01)}</body>'
        "</worldbody>",
    )
    machine = built(tmp_path, text.format(knee=0, pivot=0))
    assert [joint.name for joint in machine.held_joints] == ["turntable"]
    assert {joint.name for joint in machine.joints} == {"knee", "pivot"}


@pytest.mark.parametrize("follows", ["", FOLLOWS], ids=["not buildable", "buildable"])
def test_a_loop_beyond_the_tip_does_not_decide(tmp_path, follows):
    """The arm is read as it is without its gripper; what is left out is said, with its mass."""
    found = imported(tmp_path, GRIPPER.format(fingers=FINGERS, more=TENDON.format(follows=follows)), "hand")
    alone = imported(tmp_path, GRIPPER.format(fingers="", more=""), "hand")
    assert found.document == alone.document
    said = " ".join(found.left_out)
    assert "closed loops that do not move 'hand': rf-to-rk" in said
    assert "bodies that are not on the way to 'hand': rd, rf, rk, ld, 0.2 kg together" in said


def test_a_loop_that_moves_the_tip_is_kept(tmp_path):
    """Of two loops the one before the tip is kept, and the one beyond is not."""
    hand = (
        f'<body name="hand" pos="0 0 .05"><joint name="wrist" axis="0 0 1"/>{LUMP.format(p="0 0 0", m=1, i=0.01)}'
    )
    text = LOOP.format(knee=0, pivot=0).replace("</body></body>", f"{hand}{FINGERS}</body></body></body>", 1)
    text = text.replace("</equality>", '<connect body1="rf" body2="rk" anchor=".01 .015 0"/></equality>')
    text = text.replace("</actuator>", '<motor joint="wrist"/></actuator>')
    found = imported(tmp_path, text, "hand")
    machine = build_chain(found.document, "m.toml")
    assert [closure.name for closure in machine.closures] == ["coupler-to-rocker"]
    assert {joint.name for joint in machine.moving} == {"drive", "knee", "wrist", "pivot"}
    assert "closed loops that do not move 'hand': rf-to-rk" in " ".join(found.left_out)


# a crank with a parallelogram of two rods; its knee follows its hand, which has no drive
PASSIVE = """<mujoco model="loop"><compiler angle="radian"/><worldbody>
<body name="a"><joint name="ja" axis="0 1 0"/>{lump}
<body name="b" pos="0 0 .2"><joint name="jb" axis="0 1 0"/>{lump}
<body name="c" pos=".1 0 .2"><joint name="jc" axis="0 1 0"/>{lump}</body></body></body>
<body name="d" pos=".3 0 0"><joint name="jd" axis="0 1 0"/>{lump}
<body name="e" pos="0 0 .3"><joint name="je" axis="0 1 0"/>{lump}</body></body></worldbody>
<actuator><motor joint="ja"/><motor joint="jd"/></actuator>
<equality><joint joint1="jb" joint2="jc" polycoef="0 -1 0 0 0"/><connect body1="e" body2="c" anchor="-.2 0 .1"/>
</equality></mujoco>""".replace("{lump}", LUMP.format(p="0 0 .1", m=1, i=0.01))


def test_a_passive_joint_behind_its_follower_is_read(tmp_path):
    """The machine's other postures keep MuJoCo's constraints, the coupling's and the loop's."""
    machine = built(tmp_path, PASSIVE)
    assert [joint.name for joint in machine.held_joints] == ["ja", "jd"]
    closing = Closing(machine, "home")
    q = dict(zip(closing.tree.names, closing.held({"ja": 0.1, "jd": -0.05}).tolist(), strict=True))
    model = mujoco.MjModel.from_xml_string(PASSIVE)
    data = mujoco.MjData(model)
    data.qpos[:] = [q[model.joint(i).name] for i in range(model.njnt)]
    mujoco.mj_forward(model, data)
    assert data.ne == 4
    # m and rad; ours stop at 1e-11 of the machine's length
    assert np.abs(data.efc_pos[: data.ne]).max() < 1e-9
    assert q["jb"] == pytest.approx(-q["jc"], abs=1e-12)
    assert abs(q["jb"]) > 0.01


def test_joints_of_a_tree_without_a_drive_are_said(tmp_path):
    text = FOLLOWERS.format(first="q3", second="q1", ratio=0.2)
    found = imported(tmp_path, text.replace("</mujoco>", '<actuator><motor joint="q2"/></actuator></mujoco>'))
    assert "no actuator drives q1, q3: they stand as driven" in " ".join(found.notes.changed)


def test_a_body_that_weighs_too_much_is_doubted_by_name(tmp_path):
    text = FOLLOWERS.format(first="q3", second="q1", ratio=0.2).replace('mass="1.2"', 'mass="12000"')
    said = "link 'b' has a mass of 12000 kg, above 10000 kg: is it in g?"
    assert said in imported(tmp_path, text).notes.doubtful


BALL = """<mujoco><worldbody><body name="a" pos="0 0 0.1"><joint name="j" axis="0 1 0"/><geom size="0.1"/>
<body name="b" pos="0.3 0 0" euler="10 20 30">{joints}<geom size="0.1" pos="0 0.2 0"/></body></body></worldbody>
</mujoco>"""


def test_a_ball_is_three_hinges_about_perpendicular_axes(tmp_path):
    given = 'pos="0.01 0.02 0" stiffness="7" armature="0.3"'
    hinges = "".join(
        f'<joint name="s-{name}" axis="{axis}" {given}/>'
        for name, axis in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"), strict=True)
    )
    documents = []
    for joints in (hinges, f'<joint name="s" type="ball" {given} range="0 1" limited="true"/>'):
        (tmp_path / "m.xml").write_text(BALL.format(joints=joints))
        found = import_robot(Description(tmp_path / "m.xml"))
        build_chain(found.document, "m.xml")
        documents.append(found.document)
    assert documents[0]["postures"] == documents[1]["postures"]
    moving = [[part for part in one["parts"] if part["kind"] in ("joint", "actuated")] for one in documents]
    plain = [[{k: v for k, v in part.items() if k != "after"} for part in parts] for parts in moving]
    assert plain[0] == plain[1]
    assert [part["name"] for part in moving[0]] == ["j", "s-x", "s-y", "s-z"]
    assert moving[1][1]["stiffness_Nmm_per_rad"] == 7e3
    said = "\n".join(found.notes.lines())
    assert "joint 's' is a ball: the joints s-x, s-y, s-z stand in its place, one after the other" in said
    assert "the limit of joint 's', a ball" in said


# --- equalities of joints and of fixed tendons ------------------------------------------------------------------

LINE = """<mujoco model="line"><compiler angle="radian"/><worldbody>
<body name="a"><joint name="j1" axis="0 1 0" ref=".2"/><inertial mass="1" pos=".1 0 0" diaginertia=".1 .1 .1"/>
<body name="b" pos="1 0 0"><joint name="j2" axis="0 0 1" pos=".1 0 0" ref="-.1"/>
<inertial mass="1" pos=".1 0 0" diaginertia=".1 .1 .1"/>
<body name="c" pos="1 0 0"><joint name="s" type="slide" axis="1 1 0" ref=".3"/>
<inertial mass="1" pos=".1 0 0" diaginertia=".1 .1 .1"/></body></body></body></worldbody>
<tendon><fixed name="t"><joint joint="j1" coef="2"/><joint joint="s" coef="-3"/></fixed>
<fixed name="u"><joint joint="s" coef="4"/></fixed>
<fixed name="v"><joint joint="j1" coef="1"/><joint joint="j2" coef="1"/><joint joint="s" coef="1"/></fixed></tendon>
<equality>{held}</equality></mujoco>"""


@pytest.mark.parametrize(
    "held",
    [
        '<joint joint1="j2" polycoef=".3 0 0 0 0"/>',
        '<joint joint1="s" polycoef=".05 5 0 0 0"/>',
        '<joint joint1="j2" joint2="s" polycoef=".1 2 0 0 0"/><joint joint1="s" polycoef=".05 0 0 0 0"/>',
        '<tendon tendon1="t" polycoef=".2 0 0 0 0"/>',
        '<tendon tendon1="t" tendon2="u" polycoef=".2 3 0 0 0"/>',
        '<tendon tendon1="u" polycoef=".2 3 0 0 0"/>',
    ],
)
def test_an_equality_holds_joints_as_mujoco_has_it(tmp_path, held):
    """Where MuJoCo's own residual of the equalities is zero, found by Newton's method, our tool is MuJoCo's."""
    file = tmp_path / "line.xml"
    file.write_text(LINE.format(held=held))
    found = import_robot(Description(file))
    assert not any("equality" in line for line in found.left_out)
    machine = build_chain(found.document, file.name)
    model = mujoco.MjModel.from_xml_path(str(file))
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    free = [joint.name for joint in machine.held_joints if joint.coupling is None]
    assert len(free) == model.nv - model.neq
    for _ in range(3):
        data.qpos[:] = rng.uniform(-0.5, 0.5, model.nv)
        own = {name: float(data.joint(name).qpos[0]) for name in free}
        for _ in range(3):
            # straight lines: the first step is exact
            mujoco.mj_forward(model, data)
            J = data.efc_J.reshape(-1, model.nv)[: model.neq]
            moved = [model.joint(name).id for name in ("j1", "j2", "s") if name not in free]
            data.qpos[moved] -= np.linalg.lstsq(J[:, moved], data.efc_pos[: model.neq], rcond=None)[0]
        mujoco.mj_forward(model, data)
        assert np.abs(data.efc_pos[: model.neq]).max() < 1e-12
        slides = {joint.name: joint.slides for joint in machine.held_joints}
        q = {name: value * (1e3 if slides[name] else 1.0) for name, value in own.items()}
        mechanism = Mechanism(machine.locked(q))
        end = mechanism.kinematics(mechanism.configuration(np.zeros(0))).end
        assert end[:3, 3] == pytest.approx(1e3 * data.body("c").xpos, abs=1e-9)
        assert end[:3, :3] == pytest.approx(data.body("c").xmat.reshape(3, 3), abs=1e-12)


@pytest.mark.parametrize(
    "held",
    [
        '<joint joint1="j2" joint2="s" polycoef="0 1 1 0 0"/>', '<tendon tendon1="v" polycoef="0 0 0 0 0"/>',
        '<joint joint1="j2" joint2="s" active="false"/>',
    ],
)  # fmt: skip
def test_an_equality_that_no_machine_has_is_left_out_and_named(tmp_path, held):
    file = tmp_path / "line.xml"
    file.write_text(LINE.format(held=held))
    found = import_robot(Description(file))
    assert sum("the equality" in line for line in found.left_out) == 1
    assert len(found.joints) == 3
