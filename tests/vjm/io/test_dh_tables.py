"""Tables of Denavit and Hartenberg: what they say, by the textbooks' own matrices, and machines that come back."""

import math

import numpy as np
import pytest
from helpers.serial_arms import end_by_hand, end_of, end_of_file, postures, random_arm, reach

from vjm.io.dh_table import dh_table, dh_text, said_parallel
from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.robot import Reading
from vjm.io.robot_file import Description, import_robot
from vjm.io.robot_text import not_in_table, serial_chain
from vjm.model.machine import Machine

AGREE = 1e-9
"""Of the reach: what a round trip may change."""
ROUNDED = 1e-12
"""Of the reach, where no large offset is in the way: a hundred products of doubles."""
METRE = 1e3
"""mm: about the reach of these arms."""
HEAD = '# convention = "{convention}"\n# units = {{ length = "{length}", angle = "{angle}" }}\n'


def imported(file, **options) -> Machine:
    return build_chain(import_robot(Description(file), **options).document, file.name)


def apart(found, exact, size: float) -> float:
    """The larger of the differences of place over the size and of direction."""
    difference = np.abs(np.asarray(found - exact, float))
    return max(difference[:3, 3].max() / size, difference[:3, :3].max())


# --- published tables -----------------------------------------------------------------------------------------

UR5E = {
    "theta": [0.0] * 6,
    "a": [0.0, -0.425, -0.3922, 0.0, 0.0, 0.0],
    "d": [0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996],
    "alpha": [math.pi / 2, 0.0, 0.0, math.pi / 2, -math.pi / 2, 0.0],
}
UR10E = UR5E | {"a": [0.0, -0.6127, -0.57155, 0.0, 0.0, 0.0], "d": [0.1807, 0.0, 0.0, 0.17415, 0.11985, 0.11655]}
"""Universal Robots, DH parameters for calculations of kinematics and dynamics; m and rad."""
PUMA = {
    "theta": [0.0] * 6,
    "a": [0.0, 0.0, 431.8, -20.32, 0.0, 0.0],
    "d": [0.0, 0.0, 124.46, 431.8, 0.0, 0.0],
    "alpha": [0.0, -90.0, 0.0, -90.0, 90.0, -90.0],
}
"""Craig, Introduction to Robotics, figure 3.21; a2, a3, d3, d4 as measured by Lee, in mm; degrees."""
STANFORD = {
    "theta": [0.0, 0.0, -90.0, 0.0, 0.0, 0.0],
    "a": [0.0] * 6,
    "d": [412.0, 154.0, 0.0, 0.0, 0.0, 263.0],
    "alpha": [-90.0, 90.0, 0.0, -90.0, 90.0, 0.0],
}
"""Paul, Robot Manipulators, the Stanford arm: its third joint slides; mm and degrees."""
PUBLISHED = {
    "ur5e": ("dh", "m", "rad", UR5E, ()),
    "ur10e": ("dh", "m", "rad", UR10E, ()),
    "puma": ("mdh", "mm", "deg", PUMA, ()),
    "stanford": ("dh", "mm", "deg", STANFORD, (2,)),
}


def rows(table):
    return [{key: table[key][k] for key in table} for k in range(6)]


def csv_of(name: str) -> str:
    convention, length, angle, table, sliding = PUBLISHED[name]
    lines = ["name,kind,a,d,alpha,theta"]
    for k, row in enumerate(rows(table)):
        kind = "prismatic" if k in sliding else "revolute"
        lines.append(",".join([f"j{k}", kind, *(repr(row[key]) for key in ("a", "d", "alpha", "theta"))]))
    return HEAD.format(convention=convention, length=length, angle=angle) + "\n".join(lines) + "\n"


def toml_of(name: str) -> str:
    convention, length, angle, table, sliding = PUBLISHED[name]
    text = f'convention = "{convention}"\nunits = {{ length = "{length}", angle = "{angle}" }}\n'
    for k, row in enumerate(rows(table)):
        text += f'[[joints]]\nname = "j{k}"\n' + ('kind = "prismatic"\n' if k in sliding else "")
        text += "".join(f"{key} = {value!r}\n" for key, value in row.items())
    return text


@pytest.mark.parametrize("text", [csv_of, toml_of], ids=["csv", "toml"])
@pytest.mark.parametrize("name", PUBLISHED)
def test_a_published_table_is_the_machine_of_the_textbooks_matrices(tmp_path, name, text):
    convention, length, angle, table, sliding = PUBLISHED[name]
    file = tmp_path / f"robot.{'csv' if text is csv_of else 'toml'}"
    file.write_text(text(name))
    machine = imported(file)
    mm, rad = 1e3 if length == "m" else 1.0, math.pi / 180.0 if angle == "deg" else 1.0
    plain = [
        {key: value * (rad if key in ("theta", "alpha") else mm) for key, value in row.items()}
        for row in rows(table)
    ]
    slides = [k in sliding for k in range(6)]
    size = sum(abs(row["a"]) + abs(row["d"]) for row in plain)
    for q in postures(machine, np.random.default_rng(1), 20):
        by_hand = end_by_hand(convention, plain, [q[f"j{k}"] for k in range(6)], slides)
        assert apart(end_of(machine, q), by_hand, size) < ROUNDED


def test_the_ur5e_stretched_out_is_where_its_table_s_sums_say(tmp_path):
    """At zero: x is a2 + a3, y is −(d4 + d6), z is d1 − d5."""
    file = tmp_path / "ur5e.csv"
    file.write_text(csv_of("ur5e"))
    machine = imported(file)
    found = end_of(machine, dict.fromkeys((f"j{k}" for k in range(6)), 0.0))[:3, 3]
    assert found == pytest.approx([-817.2, -232.9, 62.8], abs=METRE * ROUNDED)


@pytest.mark.parametrize("name", ["ur5e", "ur10e", "puma"])
def test_a_published_table_is_written_as_it_is_published(tmp_path, name):
    convention, length, angle, table, _ = PUBLISHED[name]
    (tmp_path / "robot.toml").write_text(toml_of(name))
    chain = serial_chain(imported(tmp_path / "robot.toml"))
    found = dh_table(chain, convention)
    mm, rad = 1e3 if length == "m" else 1.0, math.pi / 180.0 if angle == "deg" else 1.0
    for key, unit in (("a", mm), ("d", mm), ("alpha", rad), ("theta", rad)):
        given = [value * unit for value in table[key]]
        assert [getattr(row, key) for row in found.rows] == pytest.approx(given, abs=METRE * ROUNDED), key
    assert found.base.is_identity
    assert found.tool.is_identity


# --- round trips ----------------------------------------------------------------------------------------------


@pytest.mark.quick_cases(20)
@pytest.mark.parametrize("seed", range(100))
@pytest.mark.parametrize("convention", ["dh", "mdh"])
def test_a_random_machine_comes_back(tmp_path, seed, convention):
    """The file's own numbers, by the textbooks' matrices, and the machine that is read of it."""
    machine = random_arm(seed)
    rng = np.random.default_rng(seed)
    file = tmp_path / ("arm.csv" if seed % 2 else "arm.toml")
    table = dh_table(serial_chain(machine), convention)
    file.write_text(dh_text(table, "made up", file.suffix))
    back, size = imported(file), reach(machine)
    assert {j.name: (j.slides, j.limits) for j in back.moving} == {
        j.name: (j.slides, j.limits) for j in machine.moving
    }
    # a common normal of axes that are not nearly parallel is ten distances away at most, each way
    assert max(abs(row.a) + abs(row.d) for row in table.rows) < 20.0 * size
    for q in postures(machine, rng, 5):
        exact = end_of(machine, q)
        assert apart(end_of_file(file, q), exact, size) < AGREE
        assert apart(end_of(back, q), exact, size) < AGREE


@pytest.mark.quick_cases(20)
@pytest.mark.parametrize("seed", range(100))
@pytest.mark.parametrize("convention", ["dh", "mdh"])
def test_a_random_machine_comes_back_with_offsets_that_cancel(tmp_path, seed, convention):
    """Without β; where digits would be lost the table is refused."""
    machine = random_arm(seed)
    chain, size = serial_chain(machine), reach(machine)
    try:
        table = dh_table(chain, convention, "offsets")
    except ValueError as error:
        assert "so nearly parallel" in str(error)  # noqa: PT017 - some machines only are refused
        sines = [math.hypot(*step[:2, 2]) for step in chain.steps[1:-1]]
        assert any(1e-14 < sine < 1e-3 for sine in sines)
        return
    assert not any(row.beta for row in table.rows)
    file = tmp_path / "arm.csv"
    file.write_text(dh_text(table, "", ".csv"))
    back = imported(file)
    # the frames that are read stand within ten distances of one another, each way, and the machine's own
    assert reach(back) < 30.0 * size
    for q in postures(machine, np.random.default_rng(seed), 5):
        exact = end_of(machine, q)
        assert apart(end_of_file(file, q), exact, size) < AGREE
        assert apart(end_of(back, q), exact, size) < AGREE


def test_half_of_the_random_machines_have_nearly_parallel_axes():
    chains = [serial_chain(random_arm(seed)) for seed in range(100)]
    nearly = [any(1e-12 < math.hypot(*step[:2, 2]) < 0.1 for step in chain.steps[1:-1]) for chain in chains]
    assert sum(nearly) > 40
    assert sum(any(joint.slides for joint in chain.joints) for chain in chains) > 40


# --- large offsets that cancel --------------------------------------------------------------------------------

FAR = """# convention = "dh"
# units = { length = "m", angle = "rad" }
a,d,alpha,theta
0,0.16,1.5707963267948966,0
-0.425,AWAY,TILT,0
-0.392,BACK,0,0
0,0.1,1.5707963267948966,0
"""


def far(away: float, tilt: float) -> str:
    return FAR.replace("AWAY", repr(away)).replace("BACK", repr(-away)).replace("TILT", repr(tilt))


def test_offsets_that_cancel_are_moved_along_the_axes_and_said(tmp_path):
    file = tmp_path / "far.csv"
    # the axes are 1.2e-3 rad from parallel, and so 0.3 m apart at the far place
    file.write_text(far(250.0, 1.2e-3))
    found = import_robot(Description(file))
    machine = build_chain(found.document, file.name)
    assert machine.characteristic_length < 2000.0
    (said,) = [line for line in found.notes.changed if "nearly parallel" in line]
    assert said.startswith("offsets of 250 m lead along nearly parallel axes and back: the frames of joint-3")
    assert "Motions are the same" in said
    table = [
        dict(zip(("a", "d", "alpha", "theta"), values, strict=True))
        for values in (
            (0.0, 160.0, math.pi / 2, 0.0), (-425.0, 250e3, 1.2e-3, 0.0), (-392.0, -250e3, 0.0, 0.0),
            (0.0, 100.0, math.pi / 2, 0.0),
        )
    ]  # fmt: skip
    for values in np.random.default_rng(3).uniform(-3, 3, (20, 4)):
        q = {f"joint-{k + 1}": float(value) for k, value in enumerate(values)}
        by_hand = end_by_hand("dh", table, list(values), [False] * 4)
        assert apart(end_of(machine, q), by_hand, 1000.0) < ROUNDED


def test_offsets_that_leave_few_digits_are_doubted(tmp_path):
    file = tmp_path / "far.csv"
    file.write_text(far(5e6, 1e-8))
    (said, *_) = import_robot(Description(file)).notes.doubtful
    assert said == "offsets so long have no more digits than to 1.1e-6 mm"


def test_a_table_of_the_machine_s_size_keeps_its_frames(tmp_path):
    file = tmp_path / "near.csv"
    file.write_text(far(0.05, 1e-3))
    found = import_robot(Description(file))
    assert found.notes.changed == []
    steps = [part["translation_mm"] for part in found.document["parts"] if part["kind"] == "link"]
    assert [0.05e3, -0.05e3] == [steps[1][2], steps[2][2]]


def test_offsets_that_do_not_cancel_are_refused_as_another_unit(tmp_path):
    file = tmp_path / "far.csv"
    file.write_text(far(250.0, 0.0).replace("-250.0", "250.0"))
    with pytest.raises(ModelFileError, match=r"a step of 250 m .* and none leads back: are lengths in mm"):
        import_robot(Description(file))


def test_what_stands_for_nearly_parallel_axes_is_said():
    count = 0
    for seed in range(100):
        chain = serial_chain(random_arm(seed))
        sines = [math.hypot(*step[:2, 2]) for step in chain.steps[1:]]
        nearly = [joint.name for joint, sine in zip(chain.joints, sines, strict=True) if 1e-12 < sine < 0.1]
        said = said_parallel(dh_table(chain, "dh"))
        assert said == (
            [f"beta, Hayati's angle, stands in the rows of {', '.join(nearly)}: their axes are nearly parallel"]
            if nearly
            else []
        )
        count += len(nearly)
    assert count > 50


# --- what is read, and what is refused ------------------------------------------------------------------------

TOML = """convention = "mdh"
units = { length = "mm", angle = "deg" }
name = "two"

[base]
xyz = [0.0, 0.0, 100.0]
rpy = [0.0, 0.0, 90.0]

[tool]
xyz = [0.0, 0.0, 50.0]

[[joints]]
name = "hip"
a = 0.0
d = 0.0
alpha = 0.0
theta = 0.0
limits = [-90.0, 90.0]

[[joints]]
name = "rail"
kind = "prismatic"
a = 300.0
d = 20.0
alpha = -90.0
theta = 0.0
beta = 1.0
limits = [0.0, 400.0]
"""


def test_limits_base_tool_and_the_stiffness_beside_it_are_read(tmp_path):
    (tmp_path / "two.toml").write_text(TOML)
    (tmp_path / "two.stiffness.toml").write_text("[joints.hip]\nstiffness_Nm_per_rad = 31000.0\n")
    found = import_robot(Description(tmp_path / "two.toml"))
    assert found.to_fill_in == ["rail"]
    machine = build_chain(found.document, "two.toml")
    hip, rail = machine.moving
    assert hip.limits == pytest.approx((-math.pi / 2, math.pi / 2))
    assert (rail.limits, rail.slides) == ((0.0, 400.0), True)
    assert hip.compliance == pytest.approx(1.0 / 31e6)
    # the base's x is the world's y, the hip turns it to −x; the rail's axis leans by beta towards the link
    lean = math.radians(1.0)
    out = 300.0 + (20.0 + 100.0 + 50.0) * math.sin(lean)
    found_end = end_of(machine, {"hip": math.pi / 2, "rail": 100.0})[:3, 3]
    assert found_end == pytest.approx([-out, -170.0 * math.cos(lean), 100.0], abs=METRE * ROUNDED)


def changed(old: str, new: str) -> str:
    assert TOML.count(old) >= 1
    return TOML.replace(old, new, 1)


def test_a_joint_may_be_called_as_a_frame_is(tmp_path):
    (tmp_path / "two.toml").write_text(TOML.replace('"rail"', '"tool"').replace('"hip"', '"robot-base"'))
    machine = imported(tmp_path / "two.toml")
    assert [joint.name for joint in machine.moving] == ["robot-base", "tool"]
    assert [part.name for part in machine.parts][-1] == "tool-frame"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (changed('convention = "mdh"\n', ""), "convention is missing: add it"),
        (changed('"mdh"', '"craig"'), "convention must be 'dh' or 'mdh', got 'craig'"),
        (changed('length = "mm"', 'length = "cm"'), "[units]: length must be 'mm' or 'm', got 'cm'"),
        (changed('units = { length = "mm", angle = "deg" }\n', ""), "units is missing: add it"),
        (changed("alpha = 0.0", "aplha = 0.0"), "joint 'hip': unknown key 'aplha'; did you mean 'alpha'?"),
        (changed("d = 0.0\n", ""), "joint 'hip': d is missing: add it"),
        (changed("d = 0.0", 'd = "0"'), "joint 'hip': d must be a number, got '0'"),
        (changed('"rail"', '"hip"'), "two joints are called 'hip': rename one"),
        (changed("[-90.0, 90.0]", "[-90.0]"), "joint 'hip': limits must have at least 2 entries, got 1"),
        ('convention = "dh"\nunits = { length = "mm", angle = "rad" }\njoints = []', "joints must have at least 1"),
        ('format = 1\nname = "a"\nparts = []', "is a model file: all commands read it as it is"),
        ("convention = dh", "(at line 1, column 14)"),
    ],
)  # fmt: skip
def test_a_wrong_toml_is_refused_in_one_line(tmp_path, text, said):
    refused(tmp_path / "arm.toml", text, said)


HEADED = HEAD.format(convention="dh", length="mm", angle="deg")
GOOD = HEADED + "name,a,d,alpha,theta,lower,upper\nhip,1,2,3,4,-9,9\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (GOOD.replace("alpha", "twist"), "line 3: unknown column 'twist'; known are name, kind, a, d"),
        (GOOD.replace("theta,", ""), "line 3: the column theta is missing: add it"),
        (GOOD.replace("lower", "a"), "line 3: the column a stands twice"),
        (HEADED + "name;a;d;alpha;theta\nhip;1;2;3;4\n", "with commas between them"),
        (GOOD.replace("1,2", "1"), "line 4: has 6 cells, and the table has 7 columns"),
        (GOOD.replace("1,2", "1,x"), "line 4: d is 'x', which is no number"),
        (GOOD.replace("1,2", "1,nan"), "joint 'hip': d must be finite"),
        (GOOD.replace("1,2", "1,"), "line 4: d is empty: give a number"),
        (GOOD.replace("-9,9", ",9"), "line 4: has one limit of two"),
        (GOOD.replace('# convention = "dh"\n', ""), "convention is missing: add it"),
        (GOOD.replace('"dh"', "dh"), "the comment lines at its head: not valid TOML: Invalid value (at line 1"),
        ('# convention = "dh"\n', "has no columns: give a, d, alpha, theta"),
        ("\ufffe\udcff", "is no text: save it as UTF-8"),
    ],
)  # fmt: skip
def test_a_wrong_csv_is_refused_in_one_line(tmp_path, text, said):
    refused(tmp_path / "arm.csv", text, said)


def refused(file, text, said):
    file.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(ModelFileError) as error:
        import_robot(Description(file))
    assert said in str(error.value)
    assert str(error.value).startswith(file.name)
    assert "\n" not in str(error.value)


def test_a_file_that_is_not_there_and_a_tip_are_refused(tmp_path):
    with pytest.raises(ModelFileError, match=r"none\.csv: cannot be read"):
        import_robot(Description(tmp_path / "none.csv"))
    (tmp_path / "arm.csv").write_text(GOOD)
    with pytest.raises(ModelFileError, match="has one end: leave out --tip"):
        import_robot(Description(tmp_path / "arm.csv"), "tool")
    with pytest.raises(ModelFileError, match="--ur-type goes with a controller's"):
        import_robot(Description(tmp_path / "arm.csv", ur_type="ur5e"))


def test_reversed_limits_are_repaired_or_refused(tmp_path):
    file = tmp_path / "arm.csv"
    file.write_text(GOOD.replace("-9,9", "9,-9"))
    assert imported(file).moving[0].limits == pytest.approx((-math.pi / 20, math.pi / 20))
    assert imported(file, reading=Reading(repairs="left out")).moving[0].limits is None
    with pytest.raises(ModelFileError, match=r"joint 'hip' has the limits .* reversed: give lower below upper"):
        imported(file, reading=Reading(repairs="refused"))


def test_angles_in_another_unit_are_doubted(tmp_path):
    file = tmp_path / "arm.csv"
    file.write_text(GOOD.replace("deg", "rad").replace("1,2,3,4", "1,2,90,4"))
    (said, *_) = import_robot(Description(file)).notes.doubtful
    assert said == "joint 'hip': alpha = 90 rad is beyond a whole turn: is it in another unit?"


# --- what a table does not hold -------------------------------------------------------------------------------


def test_what_a_table_does_not_hold_is_said():
    from helpers.random_machines import random_machine

    machine, _ = random_machine(3)
    chain = serial_chain(machine)
    lines = "\n".join(not_in_table(machine, chain))
    on_way = {joint.name for joint in chain.joints}
    for joint in machine.moving:
        assert joint.name in on_way or joint.name in lines
    assert "what is elastic in" in lines
