"""Units of a whole file: robots written anew in mm and g are recognised, and read as they were by ``--units``."""

import re
from decimal import Context, Decimal
from pathlib import Path

import numpy as np
import pytest
from helpers.as_pinocchio import ROBOTS
from helpers.command import refused, validate
from helpers.urdf_arm import arm, imported, joint, link, refusal, said, written

from vjm.analysis import stiffness
from vjm.io.bounded_xml import read_xml
from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.robot import FileUnits, Reading
from vjm.io.robot_document import Imported
from vjm.io.robot_file import Description, import_robot, parsed_units, units_note
from vjm.io.urdf import urdf_robot

ARMS = {
    "panda": "panda_description/urdf/panda.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "z1": "z1_description/urdf/z1.urdf",
    "so100": "so_arm_description/urdf/so100.urdf",
    "tiago": "tiago_description/robots/tiago.urdf",
    "talos": "talos_data/robots/talos_full_v2.urdf",
    "hand": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "icub": "icub_description/robots/icub.urdf",
}
UNITS = ("mm,kg", "mm,g", "cm,kg", "cm,g", "in,kg", "m,g", "m,kg,kg*mm2", "m,g,g*mm2")
METRES, KILOGRAMS = {"m": "1", "cm": "0.01", "in": "0.0254", "mm": "0.001"}, {"kg": "1", "g": "0.001"}
LONG = Context(prec=60)
"""Of quotients by 0.0254: read back, they are the same doubles."""


def in_si(units: str) -> tuple[Decimal, Decimal, Decimal]:
    """Units of lengths, masses and moments in m, kg and kg m²."""
    length, mass, *moments = units.split(",")
    heavy, long = moments[0].removesuffix("2").split("*") if moments else (mass, length)
    return Decimal(METRES[length]), Decimal(KILOGRAMS[mass]), Decimal(KILOGRAMS[heavy]) * Decimal(METRES[long]) ** 2


def scaled(text: str, unit: Decimal) -> str:
    return " ".join(str(LONG.divide(Decimal(word), unit)) for word in text.split())


def in_units(text: str, units: str) -> str:
    """The same robot in other units, written anew number by number."""
    length, mass, moments = in_si(units)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    for element, key, unit in (
        ("origin", "xyz", length),
        ("mass", "value", mass),
        *(("inertia", key, moments) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")),
    ):
        pattern = rf"""(<{element}\b[^>]*?\b{key}\s*=\s*["'])([^"']*)"""
        text = re.sub(pattern, lambda found, u=unit: found[1] + scaled(found[2], u), text)
    sliding = r"""(<joint\b[^>]*type\s*=\s*["']prismatic.*?</joint>)"""
    ends = r"""(\b(?:lower|upper)\s*=\s*["'])([^"']*)"""
    return re.sub(
        sliding, lambda j: re.sub(ends, lambda e: e[1] + scaled(e[2], length), j[0]), text, flags=re.DOTALL
    )


def read(file: Path, units: str = "m,kg") -> Imported:
    return import_robot(Description(file), None, Reading(fix_base=True, units=parsed_units(units)))


def heard(file: Path) -> str:
    """What is said of a file, or why it is refused."""
    try:
        return said(read(file))
    except ModelFileError as error:
        return str(error)


@pytest.mark.parametrize("name", ARMS)
def test_robots_in_metres_and_kilograms_are_not_doubted(name):
    assert "--units" not in heard(ROBOTS / ARMS[name])


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("name", ARMS)
def test_robots_in_other_units_are_recognised_and_nothing_is_scaled(tmp_path, name, units):
    file = tmp_path / "robot.urdf"
    file.write_text(in_units((ROBOTS / ARMS[name]).read_text("utf-8"), units), encoding="utf-8")
    assert f"Nothing is scaled: --units {units} reads it so" in heard(file)


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("name", ["panda", "tiago"])
def test_the_option_reads_the_same_robot(tmp_path, name, units):
    file = tmp_path / Path(ARMS[name]).name
    file.write_text(in_units((ROBOTS / ARMS[name]).read_text("utf-8"), units), encoding="utf-8")
    found, usual = read(file, units), read(ROBOTS / ARMS[name])
    assert found.document == usual.document
    assert "lengths, masses and moments of inertia are in the units of --units" in said(found)
    assert "Nothing is scaled" not in said(found)


def test_units_that_do_not_fit_are_doubted(tmp_path):
    found = import_robot(Description(written(tmp_path, arm())), None, Reading(units=parsed_units("mm,kg")))
    assert "doubtful: the file seems to have the lengths in m, for as it is read its size is" in said(found)
    assert "Nothing is scaled: --units m,kg reads it so" in said(found)


def test_the_scales_of_meshes_are_told(tmp_path):
    mesh = '<visual><geometry><mesh filename="a.stl"{}/></geometry></visual>'
    text = in_units(arm(l1=link("l1", more=mesh.format(""))), "mm,kg")
    assert "None of its 1 meshes has the scale 0.001. Nothing is scaled" in heard(written(tmp_path, text))
    text = in_units(arm(l1=link("l1", more=mesh.format(' scale="0.001 0.001 0.001"'))), "mm,kg")
    assert "1 of 1 meshes have the scale 0.001, which makes m of mm" in heard(written(tmp_path, text))


def test_moments_larger_than_the_robot_are_doubted(tmp_path):
    # 2 kg at 3 m about each axis, of an arm that is less than 3 m large
    wide = '<inertia ixx="18" ixy="0" ixz="0" iyy="18" iyz="0" izz="18"/>'
    found = imported(tmp_path, arm(l2=link("l2", inertia=wide)))
    assert "radius of gyration exceeds" not in said(found)
    found = import_robot(Description(written(tmp_path, arm(l2=link("l2", inertia=wide)))))
    assert "doubtful: moments of inertia whose radius of gyration exceeds the robot, which is" in said(found)
    assert "links l2 (3 m)" in said(found)
    assert "exceeds" not in said(import_robot(Description(written(tmp_path, arm()))))


def test_an_sdf_file_has_units_too(tmp_path):
    file = tmp_path / "arm.sdf"

    def text(length: float, mass: float) -> str:
        moments = mass * length**2
        inertial = (
            f"<inertial><pose>{0.2 * length!r} 0 0 0 0 0</pose><mass>{2.0 * mass!r}</mass><inertia>"
            f"<ixx>{0.01 * moments!r}</ixx><iyy>{0.02 * moments!r}</iyy><izz>{0.02 * moments!r}</izz></inertia>"
            "</inertial>"
        )
        axis = f"<axis><xyz>0 0 1</xyz><limit><lower>0</lower><upper>{0.5 * length!r}</upper></limit></axis>"
        return (
            f'<sdf version="1.9"><model name="arm"><link name="a">{inertial}</link><link name="b">'
            f'<pose>{0.4 * length!r} 0 0 0 0 0.5</pose>{inertial}</link><joint name="j" type="prismatic">'
            f"<parent>a</parent><child>b</child>{axis}</joint></model></sdf>"
        )

    file.write_text(text(1000.0, 1000.0))
    assert "--units mm,g reads it so" in heard(file)
    found = read(file, "mm,g").document
    file.write_text(text(1.0, 1.0))
    assert read(file).document == found


def test_an_mjcf_file_is_doubted_and_has_no_option(tmp_path):
    """A rod of 1000 and 2 kg in place of 1 m; and a body whose moments are those of a far larger one."""
    body = (
        '<body name="{0}"{1}><joint name="j-{0}" axis="0 1 0"/><inertial mass="2" pos="{2} 0 0" diaginertia="{3}"/>'
    )
    rod = body.format("a", "", "{0}", "{1}") + body.format("b", ' pos="{2} 0 0"', "{0}", "{1}") + "</body></body>"
    file = tmp_path / "rods.xml"
    for values, says in (
        (("250", "1e4 1e4 1e4", "500"), "to have the lengths in mm, for as it is read its size is 750 m"),
        ((".25", "2 2 2", ".5"), "exceeds the robot, which is 0.75 m large: links a (1 m), b (1 m)"),
    ):
        file.write_text(f"<mujoco><worldbody>{rod.format(*values)}</worldbody></mujoco>")
        heard_of = heard(file)
        assert says in heard_of
        assert "--units" not in heard_of


def test_the_command_takes_and_refuses_units(tmp_path):
    file = str(written(tmp_path, in_units(arm(), "mm,g")))
    assert (
        "in the units of --units" in validate("import", file, "--units", "mm,g", "--out", tmp_path / "a.toml").out
    )
    for given, says in (
        ("inch,kg", "give lengths (m, mm, cm, in) and masses (kg, g)"),
        ("mm,kg,t", "give moments of inertia"),
    ):
        line = refused("import", file, "--units", given, "--out", tmp_path / "b.toml")
        assert says in line
    scene = tmp_path / "s.xml"
    scene.write_text('<mujoco><worldbody><body><joint/><geom size="1"/></body></worldbody></mujoco>')
    assert "MuJoCo reads it in m and kg: scale the file in place of --units" in refused(
        "import", scene, "--units", "mm,kg", "--out", tmp_path / "b.toml"
    )
    assert not (tmp_path / "b.toml").exists()


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("units", ["m,kg", *(one for one in UNITS if "*" not in one)])
def test_every_public_robot_is_recognised_or_has_two_readings(units):
    """Read as if its file were in other units; a small robot in mm and g may be a large one in cm and kg."""
    length, mass, moments = in_si(units)
    usual = FileUnits()
    read_in = FileUnits(usual.length / length, usual.mass / mass, usual.moments / moments)
    missed = []
    for file in sorted(ROBOTS.rglob("*.urdf")):
        xml = read_xml(file)
        try:
            robot = urdf_robot(xml, file.name, None, Reading(fix_base=True, units=read_in))
        except ModelFileError:
            # empty, or with joints that are not there
            continue
        if all(joint.kind == "fixed" for joint in robot.joints):
            # a body alone may be of any density
            continue
        note = units_note(robot, xml.root, usual)
        if bool(note) != (units != "m,kg") or (note and f"--units {units} " not in note):
            missed.append(f"{file.name}: {note}")
    assert missed == []


# Offsets of calibrated robots that lead along nearly parallel axes and back are read; other units are not.


# rad, by which the axes of the two middle joints miss being parallel
APART = 2e-4
LIMITS = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'


def calibrated(away: float, back: float | None = None, masses: str = "c") -> str:
    """Three joints, of which the second is placed ``away`` m along its axis and the third back again."""
    back = -away if back is None else back
    links = "".join(link(name) if name in masses else f'<link name="{name}"/>' for name in ("base", "a", "b", "c"))
    lift = f'<origin xyz="0.0001 {-away!r} 0" rpy="{np.pi / 2!r} 0 0"/>'
    elbow = f'<origin xyz="-0.4249 0 {back!r}" rpy="{APART!r} 0 0"/>'
    return (
        '<robot name="calibrated">' + links
        + joint("pan", "base", "a", origin='<origin xyz="0 0 .0891"/>', axis="0 0 1", more=LIMITS)
        + joint("lift", "a", "b", origin=lift, axis="0 0 1", more=LIMITS)
        + joint("elbow", "b", "c", origin=elbow, axis="0 0 1", more=LIMITS)
        + "</robot>"
    )  # fmt: skip


def placed(folder: Path, text: str) -> tuple[np.ndarray, np.ndarray]:
    """Where the end goes under a wrench and its weight, and its compliance."""
    chain = build_chain(imported(folder, text).document, "m.toml")
    found = stiffness(
        chain, {"pan": 0.3, "lift": 0.4, "elbow": 1.0}, wrench=(10.0, 20.0, -30.0, 0.0, 0.0, 0.0),
        gravity=(0.0, 0.0, -9.81),
    )  # fmt: skip
    assert found.loaded_compliance is not None
    return found.displacement, found.loaded_compliance


@pytest.mark.parametrize("away", [0.2, 238.4172315, -150.0, 2000.0])
def test_offsets_that_cancel_along_parallel_axes_are_read(tmp_path, away):
    """The joint's frame may stand anywhere on its axis: the machine is the same wherever it does."""
    there, here = placed(tmp_path, calibrated(away)), placed(tmp_path, calibrated(0.0))
    for found, exact in zip(there, here, strict=True):
        # lengths up to 2e6 mm have 1e-10 mm of rounding, and angles 1e-16; compliances sum some ten of such terms
        assert np.abs(found - exact).max() < 1e-8 * np.abs(exact).max()


def test_a_calibrated_offset_is_read_from_a_model_file_too(tmp_path):
    document = imported(tmp_path, calibrated(238.0)).document
    assert build_chain(document, "m.toml").characteristic_length == pytest.approx(238e3, rel=1e-3)


def test_a_mass_that_is_left_far_away_is_doubted(tmp_path):
    near, far = (said(imported(tmp_path, calibrated(238.0, back))) for back in (None, 238.0))
    assert "lies 476" in far
    assert "do the offsets lead back?" in far
    assert "do the offsets lead back?" not in near


@pytest.mark.parametrize("origin", ["300 0 0", "0 300 0", "0 0 300", "150 150 0"])
@pytest.mark.parametrize("axis", ["0 0 1", "0 1 0"])
def test_a_file_in_millimetres_is_refused(tmp_path, origin, axis):
    """Its offsets lead away: across the axes, or along one to which the next is not parallel."""
    turned = joint("j2", "l1", "l2", origin=f'<origin xyz="{origin}" rpy="0.4 0.3 0"/>', axis=axis)
    assert "the origin of joint 'j2' is" in (text := refusal(tmp_path, arm(j2=turned)))
    assert re.search(r"(300|212\.\d+) m away, beyond 100 m: is it in mm\? Give metres", text)


def test_a_centre_of_mass_in_millimetres_is_refused(tmp_path):
    far = link("l2").replace("0.15 0.01 0.02", "150 10 20")
    assert "the centre of mass of link 'l2' is" in refusal(tmp_path, arm(l2=far))


@pytest.mark.parametrize("mass", ['<mass value="0"/>', ""])
def test_moments_of_inertia_without_a_mass_are_said_to_be_left_out(tmp_path, mass):
    light = link("l2").replace('<mass value="2"/>', mass)
    assert "left out: the moments of inertia of link 'l2', which has no mass" in said(
        imported(tmp_path, arm(l2=light))
    )
    assert "the moments of inertia of link" not in said(imported(tmp_path, arm()))
