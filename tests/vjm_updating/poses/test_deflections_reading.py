"""Files of deflections that cannot be used or are not what they say: one line with file, place and remedy."""

import json

import numpy as np
import pytest
from helpers.command import refused, validate
from helpers.deflections import compliant, displacement, drawn, moved
from helpers.file_texts import part_text, table_text
from helpers.from_files import calibrate_poses, diagnose_poses
from helpers.small_machines import GRIPPER, lever
from hidden_effects.poses import deflections
from hidden_effects.poses.deflections import columns_of, files, sheet_text
from hidden_effects.poses.robots import UR10, document

from vjm.io.files import toml_text
from vjm.io.findings import ImplausibleError
from vjm_updating import load_data
from vjm_updating.poses.kinds import read_test
from vjm_validation.cli.main import main


@pytest.fixture(scope="module")
def good():
    q, force = drawn(21, postures=20)
    d = displacement(compliant(), q, force) + np.random.default_rng(4).normal(0.0, 0.01, force.shape)
    return columns_of(q, force, d)


def without(columns, *names):
    return {name: values for name, values in columns.items() if name not in names}


def renamed(columns, old, new, factor=1.0):
    return {
        new if name == old else name: values * (factor if name == old else 1.0) for name, values in columns.items()
    }


def scaled(columns, part, factor):
    return {name: values * (factor if part in name else 1.0) for name, values in columns.items()}


FORCES = tuple(f"hook.f{axis}_N" for axis in "xyz")
JOINTS = tuple(f"joint-{i}.q_rad" for i in range(1, 7))
REFUSED = {
    "no wrench": (lambda c: without(c, *FORCES), {}, "column 'hook.fx_N' is missing: add the wrench at 'hook'"),
    "no displacement": (
        lambda c: without(c, *(f"target.d{a}_mm" for a in "xyz")), {}, "column 'target.dx_mm' is missing: add it",
    ),
    "no load at all": (lambda c: scaled(c, "hook.", 0.0), {}, "no row has a load: write the wrench in the columns"),
    "a joint is missing": (lambda c: without(c, "joint-3.q_rad"), {}, "column 'joint-3.q_rad' is missing"),
    "metres in the name": (
        lambda c: renamed(c, "target.dx_mm", "target.dx_m"), {}, "'target.dx_m' must be in mm: multiply it by 1000",
    ),
    "a position": (lambda c: renamed(c, "target.dx_mm", "target.x_mm"), {}, "column 'target.x_mm' is not known"),
    "kilonewtons in the name": (
        lambda c: renamed(c, "hook.fx_N", "hook.fx_kN"), {}, "'hook.fx_kN' must be in N: multiply it by 1000 and",
    ),
    "another load": (
        lambda c: renamed(c, "hook.fx_N", "hok.fx_N"), {}, "add [loads.hok] or delete it; did you mean 'hook'?",
    ),
    "another marker": (lambda c: renamed(c, "target.dx_mm", "ball.dx_mm"), {}, "no marker 'ball': add"),
    "metres": (lambda c: scaled(c, "target.", 1e-3), {}, "in m (multiply them by 1000)"),
    "a scale of no unit": (lambda c: scaled(c, "target.", 1e-9), {}, ": no unit explains it"),
    "nothing moved": (lambda c: scaled(c, "target.", 0.0), {}, "the displacements are all zero: nothing moved"),
    "degrees": (lambda c: scaled(c, "q_rad", 57.29578), {}, "is it in degrees? Multiply it by 0.0174533"),
    "too few": (
        lambda c: {name: values[:3] for name, values in c.items()}, {}, "3 different readings are fewer",
    ),
    "a wrong part": (lambda c: c, {"loads": 'on = "link-9"'}, "on = 'link-9' is no part of the model"),
    "turns of the base's axes": (
        lambda c: c, {"loads": 'turns = [{ turn_about = "z", angle_deg = 30.0 }]'}, "turns are for axes = 'tool'",
    ),
    "a word that is none": (lambda c: c, {"tracker": "noise_mm_per_kN = 1.0"}, "unknown key 'noise_mm_per_kN'"),
    "rotations in degrees": (
        lambda c: c | {f"target.r{a}_rad": c["joint-1.q_rad"] for a in "xyz"}, {}, "in degrees? Name them",
    ),
    "half a rotation": (
        lambda c: c | {"target.rx_rad": 1e-3 * c["joint-1.q_rad"]}, {}, "column 'target.ry_rad' is missing: a",
    ),
    "a negative scatter": (
        lambda c: c | {"target.dx_std_mm": -np.ones(40)}, {}, "row 2, column target.dx_std_mm: a",
    ),
    "an unknown posture": (
        lambda c: without(c, *JOINTS) | {"posture": ["zero"] * 39 + ["zerro"]}, {},
        "row 41, column posture: unknown posture 'zerro' (the model has zero): write one of them; did you mean",
    ),
    "postures and coordinates": (
        lambda c: c | {"posture": ["zero"] * 40}, {}, "column 'posture' stands beside coordinates of joints",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_used_is_refused_in_one_line(case, good, tmp_path, capsys):
    spoil, sheet, words = REFUSED[case]
    data, page = files(tmp_path, spoil(good), sheet_text(**sheet))
    with pytest.raises(SystemExit) as end:
        main(["calibrate", str(data), "--sheet", str(page), "--out", str(tmp_path / "out")])
    assert end.value.code == 2
    said = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
    assert len(said) == 1
    assert words in said[0]
    assert data.name in said[0] or page.name in said[0]
    assert not (tmp_path / "out").exists()


def exchanged(columns, a, b):
    return columns | {a: columns[b], b: columns[a]}


DOUBTFUL = {
    "sign": (lambda c: scaled(c, "target.d", -1.0), "sign_reversed"),
    "sign of the force": (lambda c: scaled(c, "hook.", -1.0), "sign_reversed"),
    "displacement's axes": (
        lambda c: exchanged(c, "target.dy_mm", "target.dz_mm"),
        "displacement_axes.yz_exchanged",
    ),
    "one axis reversed": (lambda c: scaled(c, "target.dx", -1.0), "displacement_axes.x_reversed"),
    "force's axes": (lambda c: exchanged(c, "hook.fx_N", "hook.fz_N"), "load_axes.hook.xz_exchanged"),
    "a joint's sign": (lambda c: scaled(c, "joint-2.", -1.0), "joint_sign.joint-2"),
    "joints exchanged": (
        lambda c: exchanged(c, "joint-2.q_rad", "joint-3.q_rad"),
        "joints_swapped.joint-2.joint-3",
    ),
    "kilonewtons": (lambda c: scaled(c, "hook.", 1e-3), "Are the forces in kN"),
}


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("case", DOUBTFUL)
def test_columns_that_are_mistaken_are_named(case, good, tmp_path):
    spoil, words = DOUBTFUL[case]
    found = read_test(*files(tmp_path, spoil(good))).considered(False)
    assert [one.grade for one in found if words in one.description] == ["doubtful"], [
        one.description for one in found
    ]


def test_nothing_is_fitted_to_mistaken_columns(good, tmp_path):
    pair = files(tmp_path, scaled(good, "target.d", -1.0))
    found = diagnose_poses(*pair, tmp_path / "out")
    assert (found.verdict, found.causes) == ("unknown", [])
    said = [row.found for row in found.doubts if "sign_reversed" in row.found]
    assert len(said) == 1
    assert said[0] in found.written.refused[0]
    assert not [*tmp_path.glob("*/*-model.toml"), *tmp_path.glob("*/*.urdf"), *tmp_path.glob("*/calibrated.xml")]
    with pytest.raises(ImplausibleError, match=r"sign_reversed.*no machine is calibrated by that"):
        calibrate_poses(*pair, tmp_path / "fitted")
    assert not (tmp_path / "fitted").exists()


def test_a_family_that_a_difference_does_not_show_is_refused(good, tmp_path):
    with pytest.raises(
        ValueError, match="'frame_error' is not seen in these data: they move the loaded and the unl"
    ):
        calibrate_poses(*files(tmp_path, good), tmp_path / "out", families=("frame_error",))


def test_good_columns_raise_no_doubt(good, tmp_path):
    found = calibrate_poses(*files(tmp_path, good), tmp_path / "out")
    assert [row.found for row in found.doubts if row.grade != "noted"] == []


def test_a_tool_sensor_read_as_the_bases_is_named(good, tmp_path):
    q = np.column_stack([good[f"joint-{i}.q_rad"] for i in range(1, 7)])
    force = np.column_stack([good[name] for name in FORCES])
    R = moved(compliant(), q, force)[0][:, :3, :3]
    in_tool = np.einsum("gba,gb->ga", R, force)
    columns = good | dict(zip(FORCES, in_tool.T, strict=True))
    found = read_test(*files(tmp_path, columns)).considered(False)
    assert any("write axes = 'tool' in [loads.hook]" in one.description for one in found)


@pytest.mark.slow
def test_blanks_are_left_out_and_one_coordinate_is_enough(good, tmp_path):
    holed = {name: values.copy() for name, values in good.items()}
    holed["hook.fx_N"][3] = np.nan
    holed["target.dx_mm"][5] = np.nan
    pair = files(tmp_path, holed)
    pair[0].write_text(pair[0].read_text().replace("nan", ""))
    study = read_test(*pair).study
    assert (len(study.data), study.data.left_out) == (39, 1)
    assert np.isnan(study.data.position).sum() == 1
    gauge = files(tmp_path / "gauge", without(good, "target.dx_mm", "target.dy_mm"))
    assert calibrate_poses(*gauge, tmp_path / "out").postures == 40


def test_postures_by_name_and_noise_that_grows_with_the_load(tmp_path):
    force = np.array([[100.0, 0.0, 0.0], [0.0, 100.0, 0.0], [0.0, 0.0, -100.0], [300.0, 0.0, 400.0],
                      [0.0, -200.0, 0.0], [0.0, 80.0, 60.0]])  # fmt: skip
    d = displacement(compliant(), np.zeros((6, 6)), force)
    columns = without(columns_of(np.zeros((6, 6)), force, d), *JOINTS)
    sheet = sheet_text(tracker="noise_mm_per_N = 1e-4\nnoise_rad = 1e-5\nnoise_rad_per_N = 1e-7")
    data = read_test(*files(tmp_path, {"posture": ["zero"] * 6} | columns, sheet)).study.data
    assert not data.q.any()
    size = np.linalg.norm(force, axis=1)
    assert data.sigma[:, 0, 0] == pytest.approx(np.hypot(0.01, 1e-4 * size))
    assert data.sigma_turn[:, 0] == pytest.approx(np.hypot(1e-5, 1e-7 * size))


@pytest.mark.slow
def test_a_misread_displacement_is_left_out_and_said(good, tmp_path):
    spoilt = {name: values.copy() for name, values in good.items()}
    spoilt["target.dz_mm"][7] += 40.0
    found = calibrate_poses(*files(tmp_path, spoilt), tmp_path / "out", families=("actuator_compliance",))
    assert found.postures == 39
    (said,) = (row for row in found.doubts if "an outlier, left out" in row.found)
    assert said.where == "readings.csv, row 9"
    for row, truth in zip(found.families[0].members, compliant().own, strict=True):
        assert abs(row.value - truth) < 4.0 * row.std


def test_a_mimic_stands_beside_its_master_and_keeps_its_limits(tmp_path):
    """A spring c turns the upper link by c r F, so that a force F across it moves its end by c r² F."""
    (tmp_path / "robot.urdf").write_text(GRIPPER)
    sheet = tmp_path / "sheet.toml"
    sheet.write_text(
        'kind = "deflections"\n[test]\nmodel = "robot.urdf"\nrigid = true\ngravity = [0.0, 0.0, 0.0]\n'
        "[loads.hook]\n[markers.target]\n[tracker]\nnoise_mm = 0.01\n"
    )
    q = np.linspace(-1.0, 1.0, 12)
    # the hand keeps its direction: it moves as the upper link's end, 400 mm out, under 100 N downwards
    by = 1e-8 * 400.0**2 * 100.0 * np.cos(q)
    rows = [
        f"{a:.6f},{0.1 - a:.6f},-100,{-s * np.sin(a):.6f},{-s * np.cos(a):.6f}" for a, s in zip(q, by, strict=True)
    ]
    data = tmp_path / "readings.csv"
    header = "lift.q_rad,level.q_rad,hook.fz_N,target.dx_mm,target.dz_mm\n"
    data.write_text(header + "\n".join(rows) + "\n")
    test = read_test(data, sheet)
    assert test.study.data.joints == ("lift",)
    assert test.study.data.q[:, 0] == pytest.approx(q, abs=1e-6)  # six digits were written
    following = tmp_path / "next.csv"
    following.write_text("lift.q_rad\n-2.8\n")
    assert test.candidates(following).q[0, 0] == -2.8
    following.write_text("lift.q_rad\n-2.8\n-2.95\n")
    with pytest.raises(ValueError, match=r"next\.csv: posture 2: out of reach: level = 3.05 exceeds its limit 3"):
        test.candidates(following)
    rows[4] = rows[4].replace(f"{0.1 - q[4]:.6f}", f"{0.3 - q[4]:.6f}")
    data.write_text(header + "\n".join(rows) + "\n")
    with pytest.raises(ValueError, match=r"readings\.csv: row 6, column 'level\.q_rad': .* of lift: correct"):
        read_test(data, sheet)


@pytest.mark.slow
def test_the_file_is_fitted_without_what_it_leaves_out(tmp_path):
    # a first joint and a base that turn about one upright axis are one
    hidden = compliant()
    hidden.base = np.array([2e-9, 4e-9, 0.0])
    q, force = drawn(21, postures=40)
    d = displacement(hidden, q, force) + np.random.default_rng(4).normal(0.0, 0.01, force.shape)
    pair = files(tmp_path, columns_of(q, force, d))
    found = calibrate_poses(*pair, tmp_path / "out", families=("actuator_compliance", "base_compliance"))
    rows = {row.name: row for family in found.families for row in family.members}
    assert not rows["base_compliance.base.z"].identifiable
    assert "base-turn-z" not in (tmp_path / "out/calibrated-model.toml").read_text()
    # the joint alone does what both did; the file is evaluated anew, by its own machine
    assert found.written.file_mm == pytest.approx(found.written.judged_mm, rel=0.02)


# Deflections of a robot whose model deflects: another unit is said where the size speaks for it.


SHEET_COMPLIANCE, ROUGHLY = 1e-9, 2.6e-8
"""rad/(N mm) of the file, and what the injector's joints have in the mean."""


@pytest.mark.parametrize(
    ("factor", "words"), [(1.0, ""), (1 / 25.4, "displacements in inches"), (0.1, "displacements in cm")]
)
def test_another_unit_of_all_displacements_is_said_as_possible(factor, words, tmp_path):
    data, sheet = deflections.write(0, tmp_path)[1]
    stated = toml_text(document(UR10)).replace(str(SHEET_COMPLIANCE), str(ROUGHLY))
    (tmp_path / "model.toml").write_text(stated, encoding="utf-8")
    sheet.write_text(sheet.read_text().replace("rigid = true", ""), encoding="utf-8")
    header, *rows = data.read_text().splitlines()
    seen = [k for k, name in enumerate(header.split(",")) if name.startswith("target.d")]
    lines = [header]
    for row in rows:
        cells = row.split(",")
        for k in seen:
            cells[k] = repr(factor * float(cells[k]))
        lines.append(",".join(cells))
    data.write_text("\n".join(lines) + "\n", encoding="utf-8")
    said = [str(one) for one in load_data(data, sheet).considered() if "another unit" in str(one)]
    assert len(said) == bool(words)
    assert all(words in line for line in said)


# Deflections of one posture, of which nothing can be held out, and of axes that were not read.


COMPLIANCE, LEVER, NOISE, PLAY = 1.3e-7, 400.0, 0.003, 3e-4
MODEL = lever(LEVER, 1e-7)
WRIST = (
    part_text("actuated", "wrist", axis="z", compliance_rad_per_Nmm=1e-8)
    + "[postures]\nhome = { elbow = 0.0, wrist = 0.0"
)
SHEET = (
    'kind = "deflections"\n'
    + table_text("test", model="arm.toml", order="as taken")
    + table_text("loads.tool", on="lever")
    + table_text("markers.tip", on="lever", sigma_mm=0.01)
    + table_text("tracker", noise_mm=0.003, sigma_rad=1e-4)
)
FORCE = np.array([*range(10, 101, 10), *range(90, 0, -10), *range(-10, -101, -10), *range(-90, 0, 10)], dtype=float)


def write(folder, columns, sheet=SHEET):
    (folder / "arm.toml").write_text(MODEL)
    (folder / "sheet.toml").write_text(sheet)
    data = folder / "readings.csv"
    lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    data.write_text("\n".join(lines) + "\n")
    return data, folder / "sheet.toml"


def deflection(play=0.0, seed=3):
    """Of the tip, mm: a compliance and half a play to either side."""
    turn = COMPLIANCE * LEVER * FORCE + 0.5 * play * np.sign(FORCE)
    return LEVER * np.sin(turn) + NOISE * np.random.default_rng(seed).standard_normal(len(FORCE))


@pytest.mark.slow
def test_one_posture_is_said_not_to_be_held_out(tmp_path):
    shift = deflection()
    data, sheet = write(tmp_path, {"posture": ["home"] * len(FORCE), "tool.fy_N": FORCE, "tip.dy_mm": shift})
    # a second joint, or this is a test of the only one
    (tmp_path / "arm.toml").write_text(MODEL.replace("[postures]\nhome = { elbow = 0.0", WRIST))
    out = tmp_path / "out"
    said = validate("diagnose", data, "--sheet", sheet, "--out", out).out
    assert "not held out, for all readings are of one posture" in said
    assert "of the error held out" not in said
    assert "explained: 0%" not in said
    document = json.loads((out / "diagnosis.json").read_text())
    assert document["explained"] is None
    assert {row["random_mm"] for row in document["selection"]} == {None}
    assert {row["region_mm"] for row in document["selection"]} == {None}
    # the compliance alone was wrong: what the fit leaves is the mean size of normal noise, √(2/π) σ
    assert document["after"]["fitted_mm"] == pytest.approx(np.sqrt(2.0 / np.pi) * NOISE, rel=0.3)
    saved = 1.0 - document["after"]["fitted_mm"] / document["before"]["fitted_mm"]
    assert document["findings"]["explained"] == pytest.approx(saved)
    page = (out / "diagnosis.html").read_text()
    assert "not held out, for all readings are of one posture" in page
    assert "% of the mean distance held out" not in page
    # whether a model is written is the model's own worth
    said = validate("calibrate", data, "--sheet", sheet, "--out", out, status=None).out
    assert "not held out, for all readings are of one posture" in said


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_an_axis_that_was_not_read_is_not_exchanged(tmp_path, axis):
    """A play that springs do not explain: no exchange with a column that is not there may seem to explain all."""
    text, k = MODEL, "xyz".index(axis)
    about, along = "xyz"[(k + 2) % 3], "xyz"[(k + 1) % 3]
    arm = [0.0, 0.0, 0.0]
    arm["xyz".index(along)] = LEVER
    # the joint turns the lever so that its tip goes along the axis
    text = text.replace('axis = "z"', f'axis = "{about}"').replace(f"[{LEVER}, 0.0, 0.0]", str(arm))
    way = np.cross(np.eye(3)["xyz".index(about)], np.eye(3)["xyz".index(along)])[k]
    shift = way * deflection(play=20.0 * PLAY)
    columns = {
        "posture": ["home"] * len(FORCE),
        f"tool.f{axis}_N": way * FORCE * way,
        f"tip.d{axis}_mm": way * shift,
    }
    data, sheet = write(tmp_path, columns)
    (tmp_path / "arm.toml").write_text(text)
    said = " ".join(map(str, load_data(data, sheet).considered()))
    assert "exchange" not in said
    assert "_axes" not in said
    # columns that are there are exchanged in a test in which they were mistaken
    other = "xyz"[(k + 1) % 3]
    mistaken = {
        "posture": ["home"] * len(FORCE),
        f"tool.f{axis}_N": FORCE,
        f"tip.d{other}_mm": deflection(),
        f"tip.d{axis}_mm": np.zeros(len(FORCE)),
    }
    data, sheet = write(tmp_path, mistaken)
    (tmp_path / "arm.toml").write_text(text)
    assert "exchange" in " ".join(map(str, load_data(data, sheet).considered()))


@pytest.mark.parametrize(("factor", "unit"), [(1e-3, "in m instead of mm"), (1e3, "in µm instead of mm")])
def test_a_dial_on_one_axis_in_metres_is_refused(tmp_path, factor, unit):
    """As in a test by loads or of the joint: the model deflects by a thousand times as much, or a thousandth."""
    columns = {"posture": ["home"] * len(FORCE), "tool.fy_N": FORCE, "tip.dy_mm": factor * deflection()}
    data, sheet = write(tmp_path, columns)
    for command in ("calibrate", "diagnose"):
        said = refused(command, data, "--sheet", sheet, "--out", tmp_path / "out")
        assert unit in said
        assert "times what the model predicts" in said
    assert not (tmp_path / "out").exists()


def test_a_reading_of_which_a_part_is_blank_keeps_the_rest(tmp_path):
    """An exchange of x and z leaves what was read of y, where x and z were not read."""
    shift = deflection(play=20.0 * PLAY)
    there = [f"{value}" if k % 2 else "" for k, value in enumerate(np.zeros(len(FORCE)))]
    columns = {
        "posture": ["home"] * len(FORCE), "tool.fy_N": FORCE,
        "tip.dx_mm": there, "tip.dy_mm": shift, "tip.dz_mm": there,
    }  # fmt: skip
    data, sheet = write(tmp_path, columns)
    assert "exchange" not in " ".join(map(str, load_data(data, sheet).considered()))
