"""URDFs: every robot of a public collection against Pinocchio; limits, names, mimics and tips of made-up ones."""

import html
import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from helpers.as_pinocchio import FRAMES, ROBOTS, TORQUES, Compared, agrees
from helpers.urdf_arm import LIMIT, arm, import_urdf, imported, joint, link, parts, refusal, said, written

from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.model_plausibility import model_findings
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
    assert [one for one in model_findings(document, "robot") if "degrees" in one.description] == []


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


# URDFs as people have them: what does not matter, what is refused, and what is said of the rest.


# --- what is not used does not matter -------------------------------------------------------------------------

SHAPE = "<visual><geometry>{}</geometry></visual>"


@pytest.mark.parametrize(
    "changes",
    [
        {"more": '<xacro:foo a="1"/>'},
        {"more": '<gazebo><sim:plugin a="1"/></gazebo>'},
        {"l1": link("l1", more=SHAPE.format('<capsule radius="1" length="x"/>'))},
        {"l1": link("l1", more=SHAPE.format('<box size="1"/><sphere radius="-1"/>'))},
        {"l1": link("l1", more=SHAPE.format('<mesh filename="a&b.dae" scale="0.001"/>'))},
        {"l1": link("l1", more=SHAPE.format("<box/>") + "<visual><material><color/></material></visual>")},
        {"l1": link("l1", more='<collision><origin xyz="nan a"/></collision>')},
        {"more": '<transmission name="t"><joint name="j1"/><actuator/></transmission>'},
        {"header": '\n  <!-- by hand -- not by xacro -->\n<?xml version="1.0"?>\n'},
        {"header": '\ufeff<?xml version="1.0" encoding="utf-8" standalone="yes"?>\n'},
        {"header": ""},
        {"robot": '<robot name="arm" version="1.1" xmlns:xacro="http://a.b">'},
        {"robot": '<!DOCTYPE robot><robot name="arm" xmlns="http://a.b">'},
        {"j2": joint("j2", "l1", "l2", more='<limit lower="-2" upper="2"/>')},
        {"j2": joint("j2", "l1", "l2", more='<limit lower="-2" upper="2" effort="inf" velocity="x"/>')},
        {"j2": joint("j2", "l1", "l2", more=LIMIT + '<dynamics damping="x"/><safety_controller/>')},
    ],
)
def test_what_is_not_used_does_not_matter(tmp_path, changes):
    sound = agrees(tmp_path, arm())
    assert imported(tmp_path, arm(**changes)).document["parts"] == sound.document["parts"]


@pytest.mark.parametrize(
    ("inertia", "said"),
    [
        ("", None),
        ('<inertia ixx="0" iyy="0" izz="0"/>', None),
        ('<inertia ixx="1" iyy="nan"/>', "moments of inertia, left out"),
        ('<inertia ixx="a"/>', "moments of inertia, left out"),
        ('<inertia ixx="1" iyy="1" izz="3"/>', "link 'l2' has moments of inertia that no body has: left out"),
        ('<inertia ixx="-1" iyy="1" izz="1"/>', "link 'l2' has moments of inertia that no body has: left out"),
    ],
)
def test_moments_of_inertia_that_are_none_are_left_out_and_said(tmp_path, inertia, said):
    sound = agrees(tmp_path, arm()).document["parts"]
    found = imported(tmp_path, arm(l2=link("l2", inertia=inertia)), repairs="left out")
    without = [
        {key: value for key, value in part.items() if part["name"] != "l2-mass" or key != "inertia_kg_mm2"}
        for part in sound
    ]
    assert found.document["parts"] == without != sound
    assert any(said in line for line in found.notes.doubtful) if said else not found.notes.doubtful


@pytest.mark.parametrize(
    ("encoding", "declared", "note"),
    [
        ("utf-8", "", ""),
        ("utf-8-sig", "utf-8", ""),
        ("utf-16", "utf-16", ""),
        ("utf-16-le", "utf-16", ""),
        ("latin-1", "ISO-8859-1", ""),
        ("koi8-r", "koi8-r", ""),
        ("latin-1", "", "line 2): read as cp1252"),
        ("latin-1", "utf-8", "as its header declares (utf-8) (line 2): read as cp1252"),
        ("utf-8", "us-ascii", "declares (us-ascii) (line 2): read as utf-8"),
        ("utf-8", "no-such", "declares (no-such) (line 1): read as utf-8"),
        ("utf-16", "utf-8", "declares (utf-8): read as utf-16"),
    ],
)
def test_every_encoding_is_read_and_a_wrong_one_named(tmp_path, encoding, declared, note):
    letter = "я" if encoding == "koi8-r" else "ü"
    said_so = f' encoding="{declared}"' if declared else ""
    header = f'<?xml version="1.0"{said_so}?>\n'
    found = imported(tmp_path, arm(header=header, robot=f'<robot name="a{letter}">'), encoding=encoding)
    assert found.document["title"].startswith(f"a{letter},")
    assert [line for line in found.notes.doubtful if "encoded" in line] == found.notes.doubtful
    assert note in said(found)
    assert bool(note) == bool(found.notes.doubtful)


# --- nothing in silence ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"l2": link("l2", "-5")}, "line 5: link 'l2' has a mass of -5 kg"),
        ({"l2": link("l2", "nan")}, 'link \'l2\' has <mass value="nan">'),
        ({"l2": link("l2", "inf")}, "which is not finite"),
        ({"l2": link("l2", "2,5")}, "which is no number: give a number"),
        ({"l2": link("l2", "1_0")}, "which is no number"),
        ({"l2": link("l2", "２")}, "which is no number"),
        ({"l2": link("l2", "0x2")}, "which is no number"),
        ({"l2": link("l2", "")}, "which is no number"),
        ({"l2": link("l2", "${m}")}, "unexpanded xacro; expand it by --xacro"),
        ({"l2": link("l2").replace('value="2"', 'valeu="2"')}, "has <mass> without value"),
        ({"l2": link("l2", "2e7")}, "above 1e7 kg: is it in g?"),
        ({"base": link("base", "-1")}, "link 'base' has a mass of -1 kg"),
        ({"l2": link("l2").replace("0.15 0.01", "0.15")}, "give 3 numbers with blanks between them"),
        ({"more": link("l1")}, "2 links are called 'l1' (lines 4, 10)"),
        ({"more": link("l3") + joint("j1", "l1", "l3")}, "2 joints are called 'j1' (lines 7, 11)"),
        ({"j2": joint("j2", "l1", "l2", "hinge")}, "line 8: joint 'j2' has the type 'hinge': give one of revolute"),
        ({"j2": joint("j2", "l1", "l2", "Revolute")}, "did you mean 'revolute'"),
        ({"j2": joint("j2", "l1", "l2", "")}, "has the type ''"),
        ({"j2": joint("j2", "l1", "l2", "floating")}, "joint 'j2' is floating"),
        ({"j2": joint("j2", "l1", "l2", "planar")}, "joint 'j2' is planar"),
        ({"j2": joint("j2", "l1", "l2", more='<limit lower="1"/>')}, "reversed (upper is not given, and so 0)"),
        ({"j2": joint("j2", "l1", "l2", more='<limit lower="nan" upper="1"/>')}, '<limit lower="nan">'),
        ({"j2": joint("j2", "l1", "l2", more='<limit lower="a" upper="1"/>')}, "which is no number"),
        ({"j2": joint("j2", "l1", "l2", axis="0 0 0")}, "axis of length zero"),
        ({"j2": joint("j2", "l1", "l2", axis="0 1")}, "give 3 numbers"),
        ({"j2": joint("j2", "l1", "l2", axis="0 nan 1")}, "give a number"),
        ({"j2": joint("j2", "l1", "l2", origin='<origin xyz="0 0 inf"/>')}, "which is not finite"),
        ({"j2": joint("j2", "l1", "l2", origin='<origin xyz="300 0 0"/>')}, "beyond 100 m: is it in mm?"),
        ({"j2": joint("j2", "l1", "l2", origin='<origin rpy="0,0,1"/>')}, "blanks between"),
        ({"j2": joint("j2", "l1", "l9")}, "names the link 'l9', which is not there"),
        ({"j2": joint("j2", "l1", "l2").replace('<child link="l2"/>', "")}, "joint 'j2' names no child"),
        ({"j2": joint("j2", "l2", "l2")}, "its own ancestor"),
        ({"j1": joint("j1", "l2", "l1")}, "its own ancestor"),
        ({"more": joint("j0", "tool", "base")}, "every link hangs on another"),
        ({"more": link("l3")}, "has 2 links without a parent (base, l3)"),
        ({"more": joint("j3", "base", "l2")}, "link 'l2' has two parents, the joints 'j2' and 'j3'"),
        ({"more": joint("", "l2", "l3") + link("l3")}, "a joint has no name"),
        ({"more": '<link/>'}, "a link has no name"),
        ({"j2": joint("j2", "l1", "l2", more='<mimic joint="j2"/>')}, "joint 'j2' mimics itself"),
        ({"j2": joint("j2", "l1", "l2", more='<mimic joint="j"/>')}, "mimics 'j', which is no joint"),
        ({"j2": joint("j2", "l1", "l2", more='<mimic joint="j1" multiplier="nan"/>')}, '<mimic multiplier="nan">'),
        (
            {k: joint(k, *way, more=f'<mimic joint="{m}"/>') for k, way, m in
             (("j1", ("base", "l1"), "j2"), ("j2", ("l1", "l2"), "j1"))},
            "joint 'j1' mimics itself by way of j2",
        ),
        ({"robot": '<!DOCTYPE r [<!ENTITY a "aaa">]>\n<robot name="&a;">'}, "declares the entity 'a'"),
        ({"robot": '<sdf><robot name="arm">', "end": "</robot></sdf>"}, "is no URDF, which begins with <robot>"),
        ({"end": ""}, "is no XML that can be read"),
        ({"more": "<a>" * 150 + "</a>" * 150}, "nested deeper than 100"),
        ({"j1": joint("j1", "base", "l1", "fixed"), "j2": joint("j2", "l1", "l2", "fixed")}, "no joint moves"),
    ],
)  # fmt: skip
def test_a_refusal_names_line_and_remedy(tmp_path, changes, says):
    assert says in refusal(tmp_path, arm(**changes))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"more": "<lnik/>"}, "left out: not understood: <lnik> in <robot> (line 10)"),
        ({"more": "<xacro:gripper/>"}, "not understood: <xacro:gripper> in <robot>"),
        ({"more": "<xacro:gripper/>"}, "doubtful: the file holds xacro that is not expanded (line 10)"),
        ({"l1": link("${p}"), "j1": joint("j1", "base", "${p}"), "j2": joint("j2", "${p}", "l2")}, "not expanded"),
        ({"j2": joint("j2", "l1", "l2").replace("<limit", '<limit lowr="1"')}, 'lowr="…" in <limit> (line 8)'),
        ({"l2": '<link name="l2"/>'}, "doubtful: moving links without mass: l2"),
        ({"l2": link("l2", "0")}, "links whose <inertial> gives no mass: l2"),
        ({"l2": link("l2").replace('<mass value="2"/>', "")}, "links whose <inertial> gives no mass: l2"),
        ({"l2": link("l2", more='<inertial><mass value="9"/></inertial>')}, "<link> has another <inertial>"),
        ({"j2": joint("j2", "l1", "l2", more='<limit lower="0" upper="0"/>')}, "its limits are equal (0 rad)"),
        ({"j2": joint("j2", "l1", "l2", more='<limit lower="-180" upper="90"/>')}, "are they in degrees?"),
        ({"j2": joint("j2", "l1", "l2", more="")}, "joint 'j2' is revolute and has no <limit>"),
        ({"j2": joint("j2", "l1", "l2", "prismatic", more="")}, "joint 'j2' is prismatic and has no <limit>"),
        ({"j2": joint("j2", "l1", "l2", "continuous")}, "limits of joint 'j2': it is continuous"),
        ({"j2": joint("j2", "l1", "l2", axis="")}, "joint 'j2' gives no axis: x"),
        ({"j2": joint("j2", "l1", "l2", origin='<origin rpy="90 0 0"/>')}, 'rpy "90 0 0" is beyond a whole turn'),
        ({"j2": joint("j2", "l1", "l2", more='<mimic joint="j1" offset="90"/>')}, "is beyond a whole turn"),
        ({"j2": joint("j.2", "l1", "l2")}, "changed: joint 'j.2' is called 'j-2'"),
        ({"robot": "<robot>"}, "changed: the robot has no name: called 'arm'"),
        ({"robot": '<robot name="arm" version="2.7">'}, "version '2.7' is not known"),
        ({"j2": joint("j2", "l1", "l2", more='<limit lower="-1e9" upper="1e16"/>')}, "limits are beyond 100000"),
        ({"j2": joint("j2", "l1", "l2", more='<limit lower="-inf" upper="1"/>')}, "its limit beyond 100000 rad"),
    ],
)  # fmt: skip
def test_what_is_odd_is_said_in_the_list_and_in_the_file(tmp_path, changes, says):
    found = imported(tmp_path, arm(**changes))
    assert says in said(found)
    assert says in found.text()
    assert says not in said(imported(tmp_path, arm()))


# Every element and attribute of the URDF's specification is read, or said to be left out.


# after the pages robot, link, joint, material, sensor, transmission, gazebo and model_state of the format's
# description, and what urdfdom's versions 1.1 and 1.2 add
EVERYTHING = """<robot name="all" version="1.2">
<material name="blue"><color rgba="0 0 1 1"/><texture filename="b.png"/></material>
<link name="base" type="root"/>
<link name="l1">
  <inertial><origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/><mass value="2"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  <visual name="v"><origin xyz="0 0 0" rpy="0 0 0"/>
    <geometry><mesh filename="a.stl" scale="1 1 1"/></geometry><material name="blue"/></visual>
  <collision name="c"><origin xyz="0 0 0" rpy="0 0 0"/><geometry><box size="1 1 1"/></geometry>
    <verbose value="Verbose"/></collision>
  <collision><geometry><cylinder radius="1" length="1"/><sphere radius="1"/>
    <capsule radius="1" length="1"/></geometry></collision>
  <self_collision_checking><origin xyz="0 0 0"/><geometry><capsule radius="1" length="1"/></geometry>
    </self_collision_checking>
</link>
<link name="l2"><inertial><origin xyz="0 0 0.1" quat_xyzw="0 0 0 1"/><mass value="1"/></inertial></link>
<joint name="j1" type="revolute"><origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/>
  <parent link="base"/><child link="l1"/>
  <axis xyz="0 0 1"/><calibration reference_position="0" rising="0.1" falling="0.2"/>
  <dynamics damping="0.1" friction="0.2"/>
  <limit lower="-1" upper="1.5" effort="3" velocity="4" acceleration="5" deceleration="6" jerk="7"/>
  <safety_controller soft_lower_limit="-0.9" soft_upper_limit="0.9" k_position="1" k_velocity="2"/></joint>
<joint name="j2" type="prismatic"><origin xyz="0 0 0" quat_xyzw="0.6 0 0 0.8"/><parent link="l1"/><child link="l2"/>
  <axis xyz="1 0 0"/><limit lower="-1" upper="1.5" effort="1" velocity="1"/>
  <mimic joint="j1" multiplier="2" offset="0.1"/></joint>
<link name="l3"/>
<joint name="jf" type="fixed"><parent link="l2"/><child link="l3"/><axis xyz="0 0 1"/>
  <limit lower="0" upper="0" effort="0" velocity="0"/><mimic joint="j1"/></joint>
<transmission name="t"><type>SimpleTransmission</type>
  <joint name="j1"><hardwareInterface>EffortJointInterface</hardwareInterface></joint>
  <actuator name="m1"><mechanicalReduction>50</mechanicalReduction></actuator></transmission>
<sensor name="eye" type="camera" id="1" update_rate="20"><parent link="l1"/><origin xyz="0 0 0" rpy="0 0 0"/>
  <camera><image width="1" height="1" format="R8" hfov="1" near="0.1" far="9"/></camera>
  <ray><horizontal samples="1" resolution="1" min_angle="-1" max_angle="1"/><vertical samples="1"/></ray></sensor>
<model_state model="all" time_stamp="0.1">
  <joint_state joint="j1" position="1" velocity="0" effort="0"/></model_state>
<gazebo reference="l1"><plugin name="p" filename="p.so"/><mu1>0.2</mu1></gazebo>
<ros2_control name="c" type="system"><hardware><param name="a">1</param></hardware></ros2_control>
</robot>
"""
PLACES = [
    (index, key)
    for index, element in enumerate(ET.fromstring(EVERYTHING).iter())
    for key in (None, *element.attrib)
]


def result(tmp_path, text):
    file = tmp_path / "all.urdf"
    file.write_text(text)
    try:
        found = import_urdf(file)
    except ModelFileError as error:
        return str(error), ""
    return found.document, "\n".join(found.notes.lines())


def changed(value: str) -> str:
    """Another value of the same kind."""
    numbers = re.sub(r"[-+]?[0-9][0-9.]*", lambda number: repr(float(number.group()) + 0.01), value)
    return numbers if numbers != value else f"{value}x"


@pytest.mark.parametrize(("index", "key"), PLACES)
def test_everything_in_the_specification_is_read_or_said_to_be_left_out(tmp_path, index, key):
    root = ET.fromstring(EVERYTHING)
    element = list(root.iter())[index]
    document, said = result(tmp_path, EVERYTHING)
    listed = [f"<{element.tag}>" in said, key is not None and re.search(rf"\b{key}\b", said) is not None]
    if key is not None:
        element.set(key, changed(element.get(key)))
    elif element is not root:
        parent = next(one for one in root.iter() if element in one)
        parent.remove(element)
    read = result(tmp_path, ET.tostring(root, encoding="unicode"))[0] != document
    # a fixed joint's own elements, and those inside of an element that is not read, are listed with it
    assert read or any(listed) or element is root


def test_what_is_read_is_not_listed_and_what_is_not_is(tmp_path):
    said = result(tmp_path, EVERYTHING)[1]
    assert "not understood" not in said
    for word in ("<parent>", "<child>", "<mass>", "lower", "upper", "multiplier", "offset"):
        # a sensor's parent is listed with it
        assert (word in said) == (word == "<parent>")


@pytest.mark.parametrize(
    "where", ["robot", "link", "joint", "inertial", "origin", "mass", "axis", "limit", "mimic"]
)
def test_an_element_and_an_attribute_that_nobody_knows_are_said(tmp_path, where):
    root = ET.fromstring(EVERYTHING)
    # not in the sensor or the shapes, which are left out as a whole
    inside = {"robot": ".", "link": "link[@name='l1']", "inertial": "link/inertial", "mass": "link/inertial/mass"}
    owner = root.find(inside.get(where, "joint[@name='j2']" + ("" if where == "joint" else f"/{where}")))
    owner.set("novel", "1")
    ET.SubElement(owner, "unheard")
    said = result(tmp_path, ET.tostring(root, encoding="unicode"))[1]
    assert f'novel="…" in <{where}>' in said
    assert f"<unheard> in <{where}>" in said
