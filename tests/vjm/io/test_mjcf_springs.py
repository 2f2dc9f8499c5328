"""Springs of joints and tendons and the gains of servos in MJCF files: stiffness against MuJoCo's own forces."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.imported_mjcf import MM, built, imported, mujoco_masses
from scipy.linalg import eigh, null_space

from vjm.design.modes import modes
from vjm.io.errors import ModelFileError
from vjm.io.robot_document import PLACEHOLDER
from vjm.io.robot_text import mjcf_text

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'vjm-stiffness[mjcf]'")

STEP = 1e-4
"""rad or m: springs are linear, so that central differences of their forces are rounded alone, to some 1e-11."""
LUMP = '<inertial pos=".1 .02 .05" mass="2" diaginertia=".01 .02 .015"/>'
# a spring of its own, a follower of j0 with a spring and a servo, a slide with a servo, a tendon over two
MACHINE = f"""<mujoco><compiler angle="radian"/><worldbody>
<body name="a"><joint name="j0" axis="0 0 1" {{j0}} armature=".02"/>{LUMP}
<body name="b" pos=".3 0 0" euler=".3 .1 0"><joint name="j1" axis="0 1 0" {{j1}}/>{LUMP}
<body name="c" pos=".2 .1 0"><joint name="j2" axis="1 1 0" {{j2}}/>{LUMP}
<body name="d" pos=".1 0 .2"><joint name="j3" type="slide" axis="0 0 1" {{j3}}/>{LUMP}
</body></body></body></body></worldbody>
<equality><joint joint1="j2" joint2="j0" polycoef=".1 -1.5 0 0 0"/></equality>{{more}}</mujoco>"""
TENDON = (
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
        "more": TENDON.format(a="j0", b='<joint joint="j2" coef="2"/>'),
    },
    "a tendon on a slide": {
        "j0": 'stiffness="50"', "j1": 'stiffness="9"',
        "more": TENDON.format(a="j3", b=""),
    },
    "servos": {"more": f"<actuator>{SERVOS}</actuator>"},
    "servos with gears and springs": {
        "j1": 'stiffness="70"', "j2": 'stiffness="15"',
        "more": TENDON.format(a="j1", b="")
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


LOOP = f"""<mujoco><compiler angle="radian"/><worldbody>
<body name="crank"><joint name="drive" axis="0 1 0" {{drive}}/>{LUMP}
<body name="coupler" pos="0 0 .2"><joint name="knee" axis="0 1 0" {{knee}}/>{LUMP}</body></body>
<body name="rocker" pos=".3 0 0"><joint name="pivot" axis="0 1 0" {{pivot}}/>{LUMP}</body></worldbody>
<equality><connect body1="coupler" body2="rocker" anchor=".3 0 .1"/></equality>
<actuator>{{servo}}</actuator></mujoco>"""


@pytest.mark.parametrize("path", ["read", "written and read"])
@pytest.mark.parametrize("servo", ['<position joint="drive" kp="500"/>', '<motor joint="drive"/>', ""])
def test_springs_in_a_loop_hold_it(tmp_path, servo, path):
    """f = √(t' K t / t' M t) / 2π with the rates t that MuJoCo's constraint leaves."""
    springs = np.array([40.0 if "500" in servo else 0.0, 70.0, 20.0])
    drive, knee, pivot = (f'stiffness="{k}"' for k in springs)
    text = LOOP.format(servo=servo, drive=drive, knee=knee, pivot=pivot)
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
            {"more": TENDON.format(a="j0", b='<joint joint="j1" coef="2"/>')},
            "holds a sum of joints that move indep",
        ),
        ({"more": TENDON.format(a="j1", b="").replace('".2"', '"-.2 .3"')}, "which is slack from -0.2 to 0.3"),
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


FLOATS = f"""<mujoco><worldbody><body name="trunk" pos="1 2 3" euler="30 0 0"><freejoint name="root"/>{LUMP}
<body name="leg" pos=".1 0 0"><joint axis="0 1 0"/>{LUMP}</body></body></worldbody></mujoco>"""


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
