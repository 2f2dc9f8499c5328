"""Every element and attribute of the URDF's specification is read, or said to be left out."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import pytest

from vjm.io.errors import ModelFileError
from vjm.io.urdf import import_urdf

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
