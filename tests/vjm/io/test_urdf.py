"""URDFs: every robot of a public collection against Pinocchio; limits, names, mimics and tips of made-up ones."""

from __future__ import annotations

import html
import math
from pathlib import Path

import pytest
from helpers.as_pinocchio import FRAMES, ROBOTS, TORQUES, Compared, agrees
from helpers.urdf_arm import LIMIT, arm, imported, joint, link, parts, refusal, said, written

from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.model_plausibility import model_findings
from vjm.io.urdf import import_urdf
from vjm.machine.equilibria import unloaded_frames
from vjm.model.mechanism import Mechanism

FILES = sorted(file.relative_to(ROBOTS).as_posix() for file in ROBOTS.rglob("*.urdf"))
REFUSED = {
    "alex_psyonic_hands.urdf": "mimics 'index_q1', which is no joint",
    "iris_simple.urdf": "no joint moves",
    "quadrotor_base.urdf": "no joint moves",
    "ur3.urdf": "has no <link>",
}
CASES = Path(__file__).parents[4] / "shared/cases/urdf"


# --- robots that people have ----------------------------------------------------------------------------------


@pytest.mark.quick_cases(13)
@pytest.mark.parametrize("file", FILES)
def test_a_public_robot_is_read_as_pinocchio_reads_it(file):
    if (name := Path(file).name) in REFUSED:
        with pytest.raises(ModelFileError, match=REFUSED[name]):
            import_urdf(ROBOTS / file)
        return
    found = Compared(ROBOTS / file, import_urdf(ROBOTS / file))
    assert found.frames < FRAMES
    assert found.rotations < 1e-12
    assert found.torques < TORQUES


def test_a_way_to_one_link_is_read_of_a_robot_that_is_refused():
    file = next(ROBOTS.rglob("alex_psyonic_hands.urdf"))
    ends = [link for link in ("LEFT_GRIPPER_Z_LINK", "HEAD_LINK") if f'"{link}"' in file.read_text()]
    for end in ends:
        assert Compared(file, import_urdf(file, end), weighed=False).frames < FRAMES


# --- limits, axes, rotations ----------------------------------------------------------------------------------


def test_a_second_inertial_is_read_as_pinocchio_reads_it(tmp_path):
    agrees(tmp_path, arm(l2=link("l2", more='<inertial><mass value="9"/></inertial>')))


@pytest.mark.parametrize(
    ("kind", "given", "limits"),
    [
        ("revolute", 'lower="-inf" upper="inf"', None),
        ("revolute", 'lower="-1e30" upper="1.7976931348623157e308"', None),
        ("revolute", 'lower="-1e400" upper="+INF"', None),
        ("revolute", 'lower="-1"', [-1.0, 0.0]),
        ("revolute", 'upper="1"', [0.0, 1.0]),
        ("revolute", 'lower="-inf" upper="1"', [-1e5, 1.0]),
        ("revolute", "", None),
        ("prismatic", 'lower="-0.07" upper=" 0.14 "', [-70.0, 140.0]),
        ("prismatic", 'lower="-1e16" upper="1e16"', None),
        ("continuous", 'lower="-1" upper="1"', None),
    ],
)
def test_limits_are_those_of_the_file_and_huge_ones_are_none(tmp_path, kind, given, limits):
    found = imported(tmp_path, arm(j2=joint("j2", "l1", "l2", kind, more=f"<limit {given}/>")))
    j2 = parts(found)["j2"]
    assert j2.get("limits_mm" if kind == "prismatic" else "limits_rad") == limits


def test_a_joint_that_cannot_move_stands_at_its_equal_limits(tmp_path):
    found = imported(tmp_path, arm(j2=joint("j2", "l1", "l2", more='<limit lower="0.4" upper="0.4"/>')))
    assert found.document["postures"]["home"] == {"j1": 0.0, "j2": 0.4}


@pytest.mark.parametrize("axis", ["0 0 2", "1 1 1", "0 -1 0", "1e-200 0 2e-200", "-3 4 12", "0 1e300 1e300"])
@pytest.mark.parametrize("kind", ["revolute", "prismatic", "continuous"])
def test_axes_of_any_length(tmp_path, axis, kind):
    x, y, z = (float(v) for v in axis.split())
    most = max(map(abs, (x, y, z)))
    unit = [v / most / math.hypot(x / most, y / most, z / most) for v in (x, y, z)]
    like = arm(j2=joint("j2", "l1", "l2", kind, axis=" ".join(map(repr, unit))))
    agrees(tmp_path, arm(j2=joint("j2", "l1", "l2", kind, axis=axis)), like)


@pytest.mark.parametrize(
    "rpy", ["90 0 0", "1.5707963267948966 1.5707963267948966 0", "3.14159 0 -3.14159", "0 -9 1e3"]
)
def test_rotations_of_any_size(tmp_path, rpy):
    agrees(tmp_path, arm(j2=joint("j2", "l1", "l2", origin=f'<origin xyz="0.3 0 0" rpy="{rpy}"/>')))


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2"])
def test_quaternions_of_later_versions(tmp_path, version):
    robot = f'<robot name="arm" version="{version}">'
    limit = '<limit lower="-2" upper="2" effort="1" velocity="1"/>'
    quat = 'quat_xyzw="0.1 0.2 -0.3 0.9273618495495703"'
    turned = joint("j2", "l1", "l2", origin=f'<origin xyz="0.3 0 0" {quat}/>', more=limit)
    agrees(tmp_path, arm(robot=robot, j2=turned))


# --- names ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "Gelenkärm",
        "關節",
        "a b",
        "a.b",
        "a/b",
        "1st",
        "'q'",
        "&quot;q&quot;",
        "ø",
        "-",
        "🤖",
        "a\x7fb",
        "a&#10;b",
        "[bold]",
        "a\u202eb",
    ],
)
def test_any_name_is_read(tmp_path, name):
    text = arm(j2=joint(name, "l1", "l2"), l2=link("l2"), robot=f'<robot name="{name}">')
    found = imported(tmp_path, text)
    assert len(found.document["postures"]["home"]) == 2
    assert "the robot" in said(found)
    plain = "".join(c if c.isprintable() else " " for c in html.unescape(name))
    assert f"joint '{plain}' is called" in said(found)


def test_names_that_meet_when_changed_stay_apart(tmp_path):
    found = imported(tmp_path, arm(j1=joint("a b", "base", "l1"), j2=joint("a.b", "l1", "l2")))
    assert found.joints == {"a b": "a-b", "a.b": "a-b-2"}


def test_joints_keep_their_names_whatever_else_wants_them(tmp_path):
    found = imported(tmp_path, arm(
        robot='<robot name="j2">', j1=joint("l1-mass", "base", "l1"), j2=joint("j2", "l1", "l2"),
        jt=joint("j2-origin", "l2", "tool", "fixed"),
    ))  # fmt: skip
    assert found.joints == {"l1-mass": "l1-mass", "j2": "j2"}


# --- mimics ---------------------------------------------------------------------------------------------------

FINGER = '<limit lower="-9" upper="9" effort="1" velocity="1"/>'


def fingers(*names_and_mimics: tuple[str, str, str]) -> str:
    return "".join(
        link(f"{name}-link") + joint(name, "l2", f"{name}-link", kind, more=FINGER + mimic)
        for name, kind, mimic in names_and_mimics
    )


@pytest.mark.parametrize(
    "text",
    [
        arm(j2=joint("j2", "l1", "l2", more=LIMIT + '<mimic joint="j1"/>')),
        arm(j2=joint("j2", "l1", "l2", "continuous", more='<mimic joint="j1" multiplier="-2" offset="0.1"/>')),
        arm(j2=joint("j2", "l1", "l2", "prismatic", more='<mimic joint="j1" multiplier="-3" offset="1"/>' + LIMIT)),
        arm(j2=joint("j2", "l1", "l2", more=LIMIT + '<mimic joint="j1" multiplier="0" offset="0.4"/>')),
        # the master behind its follower
        arm(j1=joint("j1", "base", "l1", more=LIMIT + '<mimic joint="j2" multiplier="-0.5" offset="0.2"/>')),
        # the master on a later branch, and a chain of three over it
        arm(more=fingers(("a", "prismatic", '<mimic joint="b" multiplier="-1"/>'), ("b", "prismatic", ""))),
        arm(more=fingers(
            ("a", "revolute", '<mimic joint="b" multiplier="2" offset="0.1"/>'),
            ("b", "prismatic", '<mimic joint="c" multiplier="-0.3" offset="0.2"/>'), ("c", "revolute", ""),
        )),
        # a chain that ends behind its follower
        arm(j1=joint("j1", "base", "l1", more=LIMIT + '<mimic joint="a"/>'),
            more=fingers(("a", "revolute", '<mimic joint="j2" multiplier="3"/>'))),
    ],
)  # fmt: skip
def test_mimics_in_any_order(tmp_path, text):
    agrees(tmp_path, text)


def test_a_limit_that_is_not_given_is_zero_and_said(tmp_path):
    (tmp_path / "robot.urdf").write_text(arm(j2=joint("j2", "l1", "l2", more='<limit upper="1.5"/>')))
    found = import_urdf(tmp_path / "robot.urdf")
    (limits,) = [part["limits_rad"] for part in found.document["parts"] if part["name"] == "j2"]
    assert limits == [0.0, 1.5]
    assert "joint 'j2' gives no lower limit: 0, as the format has it" in found.notes.doubtful


def test_a_limit_on_one_side_only_is_no_angle_in_degrees(tmp_path):
    (tmp_path / "robot.urdf").write_text(arm(j2=joint("j2", "l1", "l2", more='<limit lower="-1" upper="INF"/>')))
    document = import_urdf(tmp_path / "robot.urdf").document
    (limits,) = [part["limits_rad"] for part in document["parts"] if part["name"] == "j2"]
    assert limits[0] == -1.0
    assert [one for one in model_findings(document, "robot") if "degrees" in one.found] == []


@pytest.mark.parametrize(
    ("limits", "offset", "home"),
    # the follower's limits, as it stands at offset + master; the master's own are ±2
    [("-0.1 0.1", 0.5, -0.4), ("0.2 0.6", 0.0, 0.2), ("-1 1", 0.3, 0.0)],
)
def test_home_keeps_the_limits_of_what_follows(tmp_path, limits, offset, home):
    low, high = limits.split()
    follower = f'<mimic joint="j1" multiplier="1" offset="{offset}"/><limit lower="{low}" upper="{high}"/>'
    text = arm(
        j1=joint("j1", "base", "l1", more='<limit lower="-2" upper="2"/>'),
        j2=joint("j2", "l1", "l2", more=follower),
    )
    (tmp_path / "robot.urdf").write_text(text)
    document = import_urdf(tmp_path / "robot.urdf").document
    assert document["postures"]["home"] == {"j1": pytest.approx(home, abs=1e-12)}
    build_chain(document, "robot")


def test_limits_that_leave_no_posture_are_refused(tmp_path):
    follower = '<mimic joint="j1" offset="5"/><limit lower="-0.1" upper="0.1"/>'
    text = arm(
        j1=joint("j1", "base", "l1", more='<limit lower="-2" upper="2"/>'),
        j2=joint("j2", "l1", "l2", more=follower),
    )
    (tmp_path / "robot.urdf").write_text(text)
    with pytest.raises(
        ModelFileError, match="joint 'j1': its limits and those of the joints that follow it leave no"
    ):
        import_urdf(tmp_path / "robot.urdf")


def test_a_mimic_of_a_joint_off_the_way(tmp_path):
    text = arm(
        j1=joint("j1", "base", "l1", more=LIMIT + '<mimic joint="b" multiplier="3" offset="0.1"/>'),
        more=fingers(("a", "revolute", ""), ("b", "prismatic", '<mimic joint="a" multiplier="0.5"/>')),
    )
    found = imported(tmp_path, text, "tool")
    compared = Compared(written(tmp_path, text), found, weighed=False)
    assert compared.frames < FRAMES
    assert set(compared.there) == {"j1", "j2"}
    assert "joint 'a', which joint 'j1' mimics, is not on the way to 'tool'" in said(found)
    # 3 (0.5 a) + 0.1
    assert (parts(found)["j1"]["to"], parts(found)["j1"]["offset_rad"]) == ({"a": 1.5}, pytest.approx(0.1))


# --- the way to a tip -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "elsewhere",
    [
        link("cam") + joint("fc", "l1", "cam", "planar"),
        link("cam") + joint("fc", "l1", "cam", "floating"),
        link("cam") + joint("fc", "l1", "cam", "no-such"),
        link("cam") + joint("fc", "l1", "cam", "fixed") + joint("fd", "l2", "cam", "fixed"),
        link("cam"),
        link("cam", "nan")
        + joint("fc", "l1", "cam", origin='<origin xyz="a"/>', more='<limit lower="2" upper="1"/>'),
        link("cam") + link("cam") + "<link/><joint/>",
        link("cam") + link("dam") + joint("fc", "cam", "dam") + joint("fd", "dam", "cam"),
        link("cam") + joint("j1", "l1", "cam"),
        link("cam") + joint("fc", "l1", "cam", more='<mimic joint="fc"/>'),
        joint("fc", "l1", "nowhere"),
    ],
)
def test_nothing_but_the_way_to_the_tip_is_looked_at(tmp_path, elsewhere):
    text = arm(more=elsewhere)
    refused = refusal(tmp_path, text)
    found = imported(tmp_path, text, "tool")
    assert found.document["parts"] == imported(tmp_path, arm(), "tool").document["parts"]
    assert ("cam" in said(found)) == ("cam" in elsewhere)
    if "without a parent" in refused or "is planar" in refused or "two parents" in refused:
        assert "--tip tool" in refused


@pytest.mark.parametrize(
    ("changes", "tip", "says"),
    [
        ({}, "toll", "no link 'toll'; did you mean 'tool'"),
        ({}, "base", "no joint moves on the way to 'base'"),
        ({"more": joint("j3", "base", "l2")}, "tool", "link 'l2' has two parents"),
        ({"more": link("l1")}, "tool", "2 links are called 'l1'"),
        (
            {"j1": joint("j1", "base", "l1", "planar"), "more": link("x") + joint("jx", "base", "x")},
            "tool",
            "--tip x",
        ),
        ({"j1": joint("j1", "l2", "l1")}, "tool", "its own ancestor"),
    ],
)
def test_what_is_wrong_on_the_way_is_refused(tmp_path, changes, tip, says):
    assert says in refusal(tmp_path, arm(**changes), tip)


def test_the_ends_of_a_tree_are_named_and_an_only_one_is_the_tip(tmp_path):
    assert imported(tmp_path, arm()).ends == []
    found = imported(tmp_path, arm(more=fingers(("a", "revolute", ""), ("b", "revolute", ""))))
    assert found.ends == ["tool", "a-link", "b-link"]
    model = Mechanism(build_chain(found.document, "arm.toml").split())
    assert model.ends == ("tool", "a-link", "b-link")


# --- the given cases ------------------------------------------------------------------------------------------

GIVEN_REFUSALS = {
    "dup-link": "2 links are called 'l1'",
    "mass-nan": "link 'l1' has <mass",
    "neg-mass-tool": "link 'l2' has a mass of -5 kg",
    "unknown-type": "joint 'j2' has the type 'unknown'",
    "tip-offpath-planar": "joint 'fc' is planar",
    "tip-offpath-two-parents": "link 'cam' has two parents",
}


def test_the_given_cases():
    if not CASES.is_dir():
        pytest.skip("the cases are not redistributed: put them into ../shared/cases beside the checkout")
    files = sorted(CASES.glob("*.urdf"))
    assert len(files) >= 22
    for file in files:
        tip = "tool" if file.stem.startswith("tip-") else None
        if file.stem in GIVEN_REFUSALS:
            with pytest.raises(ModelFileError, match=GIVEN_REFUSALS[file.stem]):
                import_urdf(file)
        if file.stem in GIVEN_REFUSALS and tip is None:
            continue
        found = import_urdf(file, tip)
        # Pinocchio refuses three of them for what is not used
        if file.stem not in ("limit-no-effort", "limits-inf-both", "tip-offpath-two-parents"):
            compared = Compared(file, found, weighed=tip is None)
            assert compared.frames < FRAMES, file.stem
            assert compared.torques < TORQUES, file.stem
        assert unloaded_frames(
            Mechanism(build_chain(found.document, file.name).split()), [0.0, *[0.0] * (len(found.to_fill_in) - 1)]
        )


def test_an_inertia_of_any_kind_changes_no_torque(tmp_path):
    agrees(tmp_path, arm(l2=link("l2", inertia='<inertia ixx="1" iyy="1" izz="1"/>')), arm())


def test_a_robot_may_stand_on_a_world_that_is_no_link(tmp_path):
    """As Drake writes it; Pinocchio reads the same with the link."""
    text = arm(base=joint("stands", "world", "base", "fixed", axis="", more="") + link("base"))
    found = agrees(tmp_path, text, text.replace("</robot>", '<link name="world"/></robot>'))
    assert "no link is called 'world', on which joints stand: it is the base" in found.notes.changed
    assert "names the link 'wrld', which is not there" in refusal(tmp_path, text.replace('"world"', '"wrld"'))


@pytest.mark.parametrize(("kind", "limit"), [("revolute", LIMIT), ("continuous", ""), ("prismatic", LIMIT)])
def test_a_joint_that_mimics_a_fixed_one_stands_at_the_offset(tmp_path, kind, limit):
    """As the fixed joint with that turn or shift; by way of another joint, too."""

    def moving(name, before, after, master, numbers):
        more = f'{limit}<mimic joint="{master}" {numbers}/>'
        return joint(name, before, after, kind, '<origin xyz=".1 .2 .3"/>', "0 2 0", more)

    given = arm(
        j1=moving("j1", "base", "l1", "jt", 'multiplier="3" offset="0.4"'), j2=joint("j2", "l1", "l2"),
        jt=moving("j3", "l2", "tool", "j1", 'multiplier="-2" offset="0.1"'),
        more=link("end") + joint("jt", "tool", "end", "fixed", axis="", more=""),
    )  # fmt: skip

    def fixed(name, before, after, at):
        place = f'xyz=".1 {0.2 + at} .3"' if kind == "prismatic" else f'xyz=".1 .2 .3" rpy="0 {at} 0"'
        return joint(name, before, after, "fixed", f"<origin {place}/>", axis="", more="")

    like = arm(
        j1=fixed("j1", "base", "l1", 0.4), j2=joint("j2", "l1", "l2"), jt=fixed("j3", "l2", "tool", -0.7),
        more=link("end") + joint("jt", "tool", "end", "fixed", axis="", more=""),
    )  # fmt: skip
    found = agrees(tmp_path, given, like)
    unit = "400 mm" if kind == "prismatic" else "0.4 rad"
    assert f"joint 'j1' mimics 'jt', which is fixed: it stands at {unit}" in found.notes.changed
    assert list(found.joints) == ["j2"]
