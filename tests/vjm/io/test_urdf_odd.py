"""URDFs as people have them: what does not matter, what is refused, and what is said of the rest."""

from __future__ import annotations

import pytest
from helpers.as_pinocchio import agrees
from helpers.urdf_arm import LIMIT, arm, imported, joint, link, refusal, said

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
