"""SDF files: the machine of one is what Pinocchio reads of the same robot's URDF; what is refused and said."""

from pathlib import Path

import numpy as np
import pytest
from helpers.as_described import OfPinocchio, Outcome, compared
from helpers.as_pinocchio import ROBOTS
from helpers.as_sdf import SdfOf
from scipy.spatial.transform import Rotation

from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.robot import Reading
from vjm.io.robot_document import Imported
from vjm.io.robot_file import Description, import_robot
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm_validation.cli.main import run

TURNED, PLACED = 1e-14, 1e-11
"""What some ten products of doubles leave: of a rotation, and of a place up to a metre away, mm."""
ROUNDED = 1e-15
"""Relative: two products of doubles."""

ARMS = (
    "panda_description/urdf/panda.urdf",
    "ur_description/urdf/ur10_robot.urdf",
    "z1_description/urdf/z1.urdf",
    "so_arm_description/urdf/so100.urdf",
    "talos_data/robots/talos_left_arm.urdf",
)
CASSIE = ROBOTS / "cassie_description/robots"
HEAVY = (
    "<inertial><mass>2</mass><inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial>"  # a cube
)


def link(name: str, pose: str = "", inertial: str = HEAVY, more: str = "") -> str:
    return f'<link name="{name}">{pose}{inertial}{more}</link>\n'


def joint(
    name: str, parent: str, child: str, kind: str = "revolute", axis: str = "<axis><xyz>0 0 1</xyz></axis>"
) -> str:
    return f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>{axis}</joint>\n'


BASE = joint("base", "world", "l0", "fixed", "") + link("l0")


def read(folder: Path, model: str, tip: str | None = None, *, version: str = "1.11", **how) -> Imported:
    """The import of a model's content, which builds."""
    file = folder / "arm.sdf"
    file.write_text(f'<sdf version="{version}">\n<model name="arm">\n{model}</model></sdf>', encoding="utf-8")
    found = import_robot(Description(file), tip, Reading(**how))
    build_chain(found.document, file.name)
    return found


def refused(folder: Path, model: str, tip: str | None = None, **how) -> str:
    with pytest.raises(ModelFileError) as caught:
        read(folder, model, tip, **how)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def said(found: Imported) -> str:
    return "\n".join(found.notes.lines())


def machine(found: Imported) -> Machine:
    return build_chain(found.document, "arm.sdf")


def tip_frame(found: Imported, **q: float) -> np.ndarray:
    """The end's frame ``(4, 4)``, mm, at coordinates of joints by name; others are at zero."""
    one = machine(found)
    # a joint on a spring moves by itself
    passive = np.array([q.get(joint.name, 0.0) for joint in one.joints])
    model = Mechanism(one.locked({joint.name: q.get(joint.name, 0.0) for joint in one.held_joints}))
    return model.kinematics(model.configuration(passive)).end


@pytest.mark.parametrize("minor", [4, 6, 11])
@pytest.mark.parametrize("file", ARMS)
def test_a_robot_of_an_sdf_file_is_that_of_its_urdf(tmp_path, file, minor):
    """Frames, axes, torques under weight and mass matrix, in random postures."""
    sdf = tmp_path / "robot.sdf"
    sdf.write_text(SdfOf(ROBOTS / file, 3, minor=minor).text(), encoding="utf-8")
    assert compared(sdf, OfPinocchio, ROBOTS / file) == Outcome("right")


def parts(found: Imported) -> dict[str, dict]:
    return {part["name"]: part for part in found.document["parts"]}


def test_springs_hold_joints_as_the_format_says(tmp_path):
    spring = "<dynamics><spring_stiffness>50</spring_stiffness><spring_reference>0.2</spring_reference></dynamics>"
    axis = f"<axis><xyz>0 1 0</xyz>{spring}</axis>"
    found = read(tmp_path, BASE + link("l1") + link("l2") + joint("a", "l0", "l1", axis=axis)
                 + joint("b", "l1", "l2", "prismatic", axis))  # fmt: skip
    a, b = parts(found)["a"], parts(found)["b"]
    # 50 N m/rad and 50 N/m
    assert (a["stiffness_Nmm_per_rad"], a["rest_rad"]) == (5e4, 0.2)
    assert (b["stiffness_N_per_mm"], b["rest_mm"]) == (0.05, 200.0)
    assert found.document["postures"]["home"] == {"a": 0.2, "b": 200.0}
    assert "changed: springs alone hold a, b: an SDF file names no drives" in said(found)
    soft = axis.replace(">50<", ">1e-9<")
    found = read(tmp_path, BASE + link("l1") + joint("a", "l0", "l1", axis=soft))
    assert "left out: the spring of joint 'a', which is softer than any spring of a model file" in said(found)
    assert "a stiffness is not below zero" in refused(
        tmp_path, BASE + link("l1") + joint("a", "l0", "l1", axis=axis.replace(">50<", ">-50<"))
    )


def test_a_universal_joint_turns_about_its_first_axis_and_then_the_second(tmp_path):
    axes = "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>"
    cross = link("l1", "<pose>0.1 0 0 0 0 0</pose>") + joint("u", "l0", "l1", "universal", axes)
    end = link("l2", "<pose>0.1 0.2 0 0 0 0</pose>") + joint("end", "l1", "l2", "fixed", "")
    found = read(tmp_path, BASE + cross + end)
    assert list(found.joints) == ["u-1", "u-2"]
    assert "joint 'u' has the type universal: the joints u-1, u-2 stand in its place, one after the other" in said(
        found
    )
    T = tip_frame(found, **{"u-1": 0.3, "u-2": -0.4})
    R = (Rotation.from_rotvec([0.3, 0.0, 0.0]) * Rotation.from_rotvec([0.0, -0.4, 0.0])).as_matrix()
    np.testing.assert_allclose(T[:3, :3], R, atol=TURNED)
    np.testing.assert_allclose(T[:3, 3], [100.0, 0.0, 0.0] + R @ [0.0, 200.0, 0.0], atol=PLACED)


def test_a_ball_joint_is_three_revolutes(tmp_path):
    found = read(tmp_path, BASE + link("l1", "<pose>0 0 0.1 0 0 0.5</pose>") + joint("s", "l0", "l1", "ball", ""))
    assert list(found.joints) == ["s-x", "s-y", "s-z"]
    T = tip_frame(found, **{"s-x": 0.3, "s-y": -0.4, "s-z": 0.2})
    R = Rotation.from_euler("z", 0.5) * Rotation.from_euler("XYZ", [0.3, -0.4, 0.2])
    np.testing.assert_allclose(T[:3, :3], R.as_matrix(), atol=TURNED)


def test_frames_and_models_in_a_model(tmp_path):
    """A hand is a model of its own, placed by one of its frames in a frame of the arm."""
    hand = (
        '<model name="hand" placement_frame="grip"><pose relative_to="flange">0 0 0 0 0 0</pose>'
        '<frame name="grip"><pose relative_to="palm">0 0 -0.05 0 0 0</pose></frame>'
        + link("palm") + link("finger", "<pose>0 0 0.1 0 0 0</pose>")
        + joint("slide", "palm", "finger", "prismatic", "<axis><xyz>1 0 0</xyz></axis>") + "</model>"
    )  # fmt: skip
    flange = '<frame name="flange" attached_to="l1"><pose>0 0 0.3 0 0 0</pose></frame>'
    turning = joint("a", "l0", "l1") + link("l1", "<pose>0 0 0.5 0 0 0</pose>")
    mount = joint("mount", "flange", "hand::grip", "fixed", "")
    found = read(tmp_path, BASE + turning + flange + hand + mount)
    # 500 to the link, 300 to the flange, 50 from the grip to the palm, 100 to the finger; 20 sideways
    T = tip_frame(found, **{"hand--slide": 20.0, "a": 0.3})
    np.testing.assert_allclose(T[:3, 3], [20.0 * np.cos(0.3), 20.0 * np.sin(0.3), 950.0], atol=PLACED)
    assert "joint 'hand::slide' is called 'hand--slide'" in said(found)


def test_limits(tmp_path):
    def limits(text: str, kind: str = "revolute") -> Imported:
        axis = f"<axis><xyz>0 0 1</xyz><limit>{text}</limit></axis>"
        return read(tmp_path, BASE + link("l1") + joint("a", "l0", "l1", kind, axis))

    assert parts(limits("<lower>-1</lower><upper>2</upper>"))["a"]["limits_rad"] == [-1.0, 2.0]
    assert parts(limits("<lower>-1</lower><upper>2</upper>", "prismatic"))["a"]["limits_mm"] == [-1e3, 2e3]
    none = limits("<lower>-1e16</lower><upper>1e16</upper>")
    assert "limits_rad" not in parts(none)["a"]
    assert "limits" not in said(none)
    turned = limits("<lower>2</lower><upper>-1</upper>")
    assert parts(turned)["a"]["limits_rad"] == [-1.0, 2.0]
    assert "joint 'a' has the limits 2 to -1 rad, reversed: they were exchanged" in said(turned)
    assert "continuous, and has none" in said(limits("<lower>-1</lower><upper>2</upper>", "continuous"))


def test_what_stands_without_a_joint(tmp_path):
    one = link("l0", "<pose>0 0 1 0 0 0</pose>") + link("l1", "<pose>0 0 1 0 0 0</pose>") + joint("a", "l0", "l1")
    found = read(tmp_path, one)
    assert "changed: no joint holds 'l0': it stands where the file shows it" in said(found)
    np.testing.assert_allclose(tip_frame(found)[:3, 3], [0.0, 0.0, 1e3])
    why = refused(tmp_path, one + link("loose"))
    assert "has 2 links without a parent (l0, loose)" in why
    assert "--fix-base holds all of them" in why
    assert read(tmp_path, one + link("loose"), fix_base=True).notes.changed.count(
        "no joint holds 'loose': it stands where the file shows it"
    )
    assert "links that are not on the way to 'l1': loose" in said(read(tmp_path, one + link("loose"), "l1"))


@pytest.mark.parametrize(
    ("model", "says"),
    [
        (joint("a", "l0", "l9"), "line 5: joint 'a' names the link 'l9', which is not there"),
        (
            "<include><uri>model://hand</uri></include>" + joint("a", "l0", "hand::palm"),
            "which is not there; the <include> of line 5 is not read",
        ),
        (joint("a", "l0", "l1", "gearbox") + link("l1"), "joint 'a' is a gearbox: write a joint that turns"),
        (joint("a", "l0", "l1", "revolut") + link("l1"), "did you mean 'revolute'?"),
        (joint("a", "l0", "world"), "has the world as its child: exchange parent and child"),
        (joint("a", "l0", "l1", axis="<axis><xyz>0 0 0</xyz></axis>") + link("l1"), "an axis of length zero"),
        (joint("a", "l0", "l1", axis="<axis><xyz>0 0,1 0</xyz></axis>") + link("l1"), "<xyz>0 0,1 0</xyz>"),
        (
            joint("a", "l0", "l1", axis='<axis><xyz expressed_in="l7">0 0 1</xyz></axis>') + link("l1"),
            "has its axis expressed in 'l7', which is not there",
        ),
        (joint("a", "l0", "l1") + link("l1", "<pose>0 0 1</pose>"), "<pose>0 0 1</pose>: give 6 numbers"),
        (
            joint("a", "l0", "l1") + link("l1", '<pose relative_to="l2"/>'),
            "link 'l1' is placed in the frame 'l2', which is not there",
        ),
        (
            joint("a", "l0", "l1") + link("l1", '<pose relative_to="f"/>')
            + '<frame name="f"><pose relative_to="l1"/></frame>',
            "is placed in itself, by way of other frames",
        ),
        (joint("a", "l0", "l1") + joint("b", "l0", "l1") + link("l1"), "has two parents, the joints 'a' and 'b'"),
        (joint("a", "l0", "l1") + link("l1", inertial=HEAVY.replace(">2<", ">-2<")), "has a mass of -2 kg"),
        (link("world"), "a link is called 'world', which is the world: rename"),
        ("", "no joint moves"),
    ],
)  # fmt: skip
def test_a_refusal_is_one_line(tmp_path, model, says):
    assert says in refused(tmp_path, BASE + model)


def test_what_is_left_out_is_said(tmp_path):
    more = '<sensor name="s" type="imu"/><visual name="v"><geometry/></visual><wheel/>'
    heard = said(read(tmp_path, BASE + link("l1", more=more) + link("l2", inertial="") + joint("a", "l0", "l1")
                      + joint("b", "l1", "l2") + '<plugin name="p" filename="p.so"><kp>3</kp></plugin>'
                      + '<include><uri>model://hand</uri></include>'))  # fmt: skip
    assert "what controllers and simulators take: <sensor>, <plugin>, <kp>" in heard
    assert "other files, which are not read: import them by themselves: <include>, <uri>" in heard
    assert "not understood: <wheel> in <link>" in heard
    assert "links without <inertial>: l2; simulators take 1 kg, here they weigh nothing" in heard


def test_a_bomb_and_worlds(tmp_path):
    file = tmp_path / "arm.world"
    file.write_text('<!DOCTYPE s [<!ENTITY a "x"><!ENTITY b "&a;&a;">]><sdf version="1.11">&b;</sdf>')
    with pytest.raises(ModelFileError, match="declares the entity 'a', which is not read"):
        import_robot(Description(file))
    model = f'<model name="arm">{BASE}{link("l1")}{joint("a", "l0", "l1")}</model>'
    ground = '<model name="ground"><static>true</static><link name="plane"/></model>'
    file.write_text(f'<sdf version="1.6"><world name="w">{ground}{model}</world></sdf>')
    assert "models that are static: ground" in said(import_robot(Description(file)))
    file.write_text(f'<sdf version="1.6"><world name="w">{model}{model}</world></sdf>')
    with pytest.raises(ModelFileError, match=r"has 2 models \(arm, arm\): write a file with one"):
        import_robot(Description(file))
    with pytest.raises(ModelFileError, match=r"includes .*model://cassie: give the file of that model"):
        import_robot(Description(CASSIE / "cassie.world"))


def test_real_files_with_loops_and_gearboxes_are_refused_and_a_way_through_one_is_read(tmp_path, capsys):
    def imported(name: str, *words: str) -> int:
        return run(["import", str(CASSIE / name), "--out", str(tmp_path / f"{len(words)}-{name}.toml"), *words])

    assert imported("cassie.sdf") == 2
    assert "joint 'left-roll-joint' is a gearbox" in capsys.readouterr().err
    assert imported("cassie_simple.sdf") == 2
    assert "link 'left-achilles-rod' has two parents" in capsys.readouterr().err
    assert imported("cassie_simple.sdf", "--tip", "left-foot-crank") == 0
    heard = capsys.readouterr().out
    assert "left out: links that are not on the way to 'left-foot-crank'" in heard


def test_the_rotor_of_drake_is_reflected_to_its_joint(tmp_path):
    axis = (
        "<axis><xyz>0 0 1</xyz></axis><drake:rotor_inertia>2e-5</drake:rotor_inertia>"
        "<drake:gear_ratio>100</drake:gear_ratio>"
    )
    found = read(tmp_path, BASE + link("l1") + joint("a", "l0", "l1", axis=axis))
    assert parts(found)["a"]["rotor_kg_mm2"] == pytest.approx(0.2e6, rel=ROUNDED)
    assert "joint 'a' has the inertia of its rotor, 2e-5 kg m² times the squared gear ratio 100, 0.2 kg m²" in said(
        found
    )
