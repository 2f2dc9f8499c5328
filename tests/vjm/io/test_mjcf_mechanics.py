"""What an MJCF file says of inertia, drives and loops counts in the machine: against MuJoCo and closed forms."""

import numpy as np
import pytest
from helpers.imported_mjcf import MM, built, imported, mujoco_masses
from scipy.linalg import eigh, null_space

from vjm.design.linear_state import loaded_posture, state_of
from vjm.design.modes import mass_matrix, modes
from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.robot_document import PLACEHOLDER
from vjm.io.robot_file import Description, import_robot
from vjm.io.robot_text import mjcf_text
from vjm.io.robot_text import urdf_leaves_out as left_out
from vjm.machine.rigid_mechanism import LoopClosure
from vjm.model.mechanism import Mechanism

pytestmark = pytest.mark.usefixtures("readers_in_this_process")

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
    state = state_of(loaded_posture(machine, {joint.name: at[joint.name] for joint in machine.held_joints}))
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
    closing = LoopClosure(machine, "home")
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


# Springs of joints and tendons and the gains of servos in MJCF files: stiffness against MuJoCo's own forces.


STEP = 1e-4
"""rad or m: springs are linear, so that central differences of their forces are rounded alone, to some 1e-11."""
SPRUNG_LUMP = '<inertial pos=".1 .02 .05" mass="2" diaginertia=".01 .02 .015"/>'
# a spring of its own, a follower of j0 with a spring and a servo, a slide with a servo, a tendon over two
MACHINE = f"""<mujoco><compiler angle="radian"/><worldbody>
<body name="a"><joint name="j0" axis="0 0 1" {{j0}} armature=".02"/>{SPRUNG_LUMP}
<body name="b" pos=".3 0 0" euler=".3 .1 0"><joint name="j1" axis="0 1 0" {{j1}}/>{SPRUNG_LUMP}
<body name="c" pos=".2 .1 0"><joint name="j2" axis="1 1 0" {{j2}}/>{SPRUNG_LUMP}
<body name="d" pos=".1 0 .2"><joint name="j3" type="slide" axis="0 0 1" {{j3}}/>{SPRUNG_LUMP}
</body></body></body></body></worldbody>
<equality><joint joint1="j2" joint2="j0" polycoef=".1 -1.5 0 0 0"/></equality>{{more}}</mujoco>"""
SPRUNG_TENDON = (
    '<tendon><fixed name="t" stiffness="40" springlength=".2"><joint joint="{a}" coef=".5"/>{b}</fixed></tendon>'
)
SERVOS = "".join(f'<position joint="j{k}" kp="{10.0 ** (4 - k)}" kv="3"/>' for k in range(4))
CASES = {
    "springs alone": {"j0": 'stiffness="50" springref=".2"', "j1": 'stiffness="80" springref="-.3"'}
    | {"j3": 'stiffness="900" springref=".02"'},
    "a follower's spring": {
        "j0": 'stiffness="50" springref=".2"', "j1": 'stiffness="9"', "j2": 'stiffness="70" springref="-.4"',
        "j3": 'stiffness="30"',
    },
    "a tendon over a joint and what follows it": {
        "j1": 'stiffness="9"', "j3": 'stiffness="30"',
        "more": SPRUNG_TENDON.format(a="j0", b='<joint joint="j2" coef="2"/>'),
    },
    "a tendon on a slide": {
        "j0": 'stiffness="50"', "j1": 'stiffness="9"',
        "more": SPRUNG_TENDON.format(a="j3", b=""),
    },
    "servos": {"more": f"<actuator>{SERVOS}</actuator>"},
    "servos with gears and springs": {
        "j1": 'stiffness="70"', "j2": 'stiffness="15"',
        "more": SPRUNG_TENDON.format(a="j1", b="")
        + '<actuator><position joint="j0" kp="300" gear="3"/><intvelocity joint="j1" kp="20"/>'
        '<general joint="j3" biastype="affine" gainprm="50" biasprm="1 -50 -2"/>'
        '<position tendon="t" kp="11"/></actuator>',
    },
    "motors beside springs": {
        "j0": 'stiffness="50" springref=".2"', "j1": 'stiffness="9" springref=".1"', "j3": 'stiffness="30"',
        "more": '<actuator><motor joint="j0"/><motor joint="j1"/><motor joint="j3"/></actuator>',
    },
}  # fmt: skip


def filled(case: dict[str, str]) -> str:
    return MACHINE.format(**(dict.fromkeys(("j0", "j1", "j2", "j3", "more"), "") | case))


def of_mujoco(text: str, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Torques, stiffness and masses in the coordinates j0, j1, j3, SI; j2 follows j0."""
    model, data, M = mujoco_masses(text, q)
    model.opt.gravity[:] = 0.0
    T = np.zeros((4, 3))
    T[0, 0], T[1, 1], T[3, 2], T[2, 0] = 1.0, 1.0, 1.0, -1.5

    def torque(move):
        data.qpos[:] = q + T @ move
        # integrators stand where servos are sent: nothing of it changes with the coordinates
        mujoco.mj_forward(model, data)
        return T.T @ (data.qfrc_passive + data.qfrc_actuator)

    steps = STEP * np.eye(3)
    K = -np.stack([torque(step) - torque(-step) for step in steps], axis=1) / (2.0 * STEP)
    return torque(np.zeros(3)), K, T.T @ M @ T


@pytest.mark.parametrize("path", ["read", "written and read"])
@pytest.mark.parametrize("case", CASES)
def test_what_holds_joints_is_as_stiff_as_mujoco_has_it(tmp_path, case, path):
    """The three frequencies at home; where nothing drives the joints, MuJoCo is at rest there too."""
    text = filled(CASES[case])
    found = imported(tmp_path, text)
    home = found.document["postures"]["home"]
    q = np.array([home["j0"], home["j1"], 0.1 - 1.5 * home["j0"], home["j3"] / MM])
    torque, K, M = of_mujoco(text, q)
    holds = np.diag(K) > 0.0
    assert found.to_fill_in == [name for name, held in zip(("j0", "j1", "j3"), holds, strict=True) if not held]
    # what has neither spring nor servo has the placeholder
    placeholders = np.array([1e5, 1e5, 1e7])
    K = K + np.diag(np.where(holds, 0.0, placeholders))
    machine = built(tmp_path, text)
    if path != "read":
        machine = built(tmp_path, mjcf_text(machine))
    exact = np.sqrt(eigh(K, M, eigvals_only=True)) / (2.0 * np.pi)
    assert modes(machine).frequencies == pytest.approx(exact, rel=1e-8)
    sprung = [joint.name for joint in machine.held_joints if joint.passive]
    driven = "<actuator>" in text
    assert sprung == ([] if driven else [n for n, held in zip(("j0", "j1", "j3"), holds, strict=True) if held])
    if not driven:
        assert np.abs(torque).max() < 1e-9 * np.diag(K).max()


SPRUNG_LOOP = f"""<mujoco><compiler angle="radian"/><worldbody>
<body name="crank"><joint name="drive" axis="0 1 0" {{drive}}/>{SPRUNG_LUMP}
<body name="coupler" pos="0 0 .2"><joint name="knee" axis="0 1 0" {{knee}}/>{SPRUNG_LUMP}</body></body>
<body name="rocker" pos=".3 0 0"><joint name="pivot" axis="0 1 0" {{pivot}}/>{SPRUNG_LUMP}</body></worldbody>
<equality><connect body1="coupler" body2="rocker" anchor=".3 0 .1"/></equality>
<actuator>{{servo}}</actuator></mujoco>"""


@pytest.mark.parametrize("path", ["read", "written and read"])
@pytest.mark.parametrize("servo", ['<position joint="drive" kp="500"/>', '<motor joint="drive"/>', ""])
def test_springs_in_a_loop_hold_it(tmp_path, servo, path):
    """f = √(t' K t / t' M t) / 2π with the rates t that MuJoCo's constraint leaves."""
    springs = np.array([40.0 if "500" in servo else 0.0, 70.0, 20.0])
    drive, knee, pivot = (f'stiffness="{k}"' for k in springs)
    text = SPRUNG_LOOP.format(servo=servo, drive=drive, knee=knee, pivot=pivot)
    machine = built(tmp_path, text)
    if path != "read":
        machine = built(tmp_path, mjcf_text(machine))
    assert [joint.name for joint in machine.held_joints if joint.passive] == ["knee", "pivot"]
    model, data, M = mujoco_masses(text)
    (t,) = null_space(data.efc_J.reshape(data.nefc, model.nv)[: data.ne], rcond=1e-9).T
    added = 500.0 if "500" in servo else 1e-3 / PLACEHOLDER["turns"] if servo else 0.0
    exact = np.sqrt((t**2 @ springs + t[0] ** 2 * added) / (t @ M @ t)) / (2.0 * np.pi)
    assert modes(machine).frequencies[0] == pytest.approx(exact, rel=1e-9)


def test_what_is_written_is_read_to_the_last_digits(tmp_path):
    """A sprung joint, a drive with a compliance and one along a slide: stiffness, rest and home."""
    machine = built(tmp_path, filled(CASES["servos"]))
    again = built(tmp_path, mjcf_text(machine))
    for one, other in zip(machine.moving, again.moving, strict=True):
        assert other.compliance == pytest.approx(one.compliance, rel=1e-15)
    machine = built(tmp_path, filled(CASES["springs alone"]))
    again = built(tmp_path, mjcf_text(machine))
    assert [one.rest for one in again.joints] == pytest.approx([one.rest for one in machine.joints], rel=1e-15)
    assert [one.stiffness for one in again.joints] == pytest.approx(
        [j.stiffness for j in machine.joints], rel=1e-15
    )
    assert [one.name for one in again.joints] == [one.name for one in machine.joints]


def test_gains_and_springs_are_said(tmp_path):
    notes = imported(tmp_path, filled(CASES["servos with gears and springs"])).notes
    assert "servos' position gains: j0 (kp 300, gear 3), j1 (kp 20), j3 (kp 50, kv 2), j1 (kp 11)" in " ".join(
        notes.changed
    )
    assert not [line for line in notes.left_out if "actuators" in line or "tendons" in line]
    notes = imported(tmp_path, filled(CASES["springs alone"])).notes
    assert "no actuator drives j0, j1, j3: springs alone hold them" in notes.changed


@pytest.mark.parametrize(
    ("case", "says"),
    [
        (
            {"more": SPRUNG_TENDON.format(a="j0", b='<joint joint="j1" coef="2"/>')},
            "holds a sum of joints that move indep",
        ),
        (
            {"more": SPRUNG_TENDON.format(a="j1", b="").replace('".2"', '"-.2 .3"')},
            "which is slack from -0.2 to 0.3",
        ),
        ({"j1": 'stiffness="1 2 3"'}, "the spring of joint 'j1', which is not linear"),
        ({"j1": 'stiffness="1e-7"'}, "the spring of joint 'j1', which is softer than any spring"),
        (
            {"more": '<actuator><general name="g" joint="j1" biastype="affine" biasprm="0 4 0"/></actuator>'},
            "the position gain of actuator 'g', which pushes away",
        ),
    ],
)
def test_what_no_model_has_is_left_out_and_said(tmp_path, case, says):
    found = imported(tmp_path, filled(case))
    assert says in " ".join(found.left_out)
    assert found.to_fill_in == ["j0", "j1", "j3"]


def test_springs_beyond_the_tip_do_not_matter(tmp_path):
    found = imported(tmp_path, filled(CASES["a tendon on a slide"]), "b")
    parts = {part["name"]: part for part in found.document["parts"]}
    assert parts["j1"]["stiffness_Nmm_per_rad"] == 9000.0
    assert "j3" not in parts
    assert not [line for line in found.notes.lines() if "spring of" in line]


FLOATS = f"""<mujoco><worldbody><body name="trunk" pos="1 2 3" euler="30 0 0"><freejoint name="root"/>{SPRUNG_LUMP}
<body name="leg" pos=".1 0 0"><joint axis="0 1 0"/>{SPRUNG_LUMP}</body></body></worldbody></mujoco>"""


def test_a_free_base_is_fixed_where_the_file_shows_it(tmp_path):
    """The machine is that of the same file without the free joint."""
    with pytest.raises(ModelFileError, match=r"joint 'root' is free, and a machine .*: --fix-base fixes it"):
        imported(tmp_path, FLOATS)
    found = imported(tmp_path, FLOATS, fix_base=True)
    assert "the body 'trunk' is free: it stands where the file shows it" in found.notes.changed
    named = FLOATS.replace("<joint axis", "<joint name='leg-joint-1' axis")
    alone = imported(tmp_path, named.replace('<freejoint name="root"/>', ""), fix_base=True)
    assert found.document == alone.document


def test_a_body_that_a_simulation_moves_by_hand_closes_no_loop(tmp_path):
    hand = '<body name="hand" mocap="true"/></worldbody>'
    grip = '<equality><weld name="grip" body1="hand" body2="d"/></equality>'
    found = imported(tmp_path, filled({"more": grip}).replace("</worldbody>", hand))
    assert "closures" not in found.document
    assert "the equality 'grip' (weld)" in found.left_out
