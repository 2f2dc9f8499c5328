"""Robots that rest where their energy is smallest, diagnosed: causes, bad data, calibration. Independent truth."""

import jsonschema
import numpy as np
import pytest
from helpers.from_files import calibrate_poses, diagnose_poses, prepared
from helpers.urdf_arm import import_urdf
from hidden_effects.poses.injector import Hidden, measure, rest
from hidden_effects.poses.plan import NOISE, Planned, save, write
from hidden_effects.poses.robots import SEVEN, UR10, document, sheet_text

from vjm.io.files import toml_text
from vjm.io.model_file import build_chain, load_chain
from vjm.machine.equilibria import equilibria, unloaded_frames
from vjm.model.mechanism import Mechanism
from vjm.rotations import rotation_from_vector
from vjm_updating.poses.pose_study import align
from vjm_updating.poses.state import Hypothesis
from vjm_validation.schemas import schemas

GRAVITY = (0.0, 0.0, -9.81)


def files(folder, robot, q, y, order="as taken"):
    folder.mkdir(exist_ok=True)
    (folder / "model.toml").write_text(toml_text(document(robot)))
    (folder / "sheet.toml").write_text(sheet_text(robot, NOISE, order))
    save(folder / "readings.csv", q, y)
    return folder / "readings.csv", folder / "sheet.toml"


@pytest.fixture(scope="module")
def postures():
    return np.random.default_rng(8).uniform(-2.0, 2.0, (120, 6))


@pytest.fixture(scope="module")
def compliant(postures):
    hidden = Hidden.nothing(6)
    hidden.own = np.array([1.0, 1.2, 1.5, 3.0, 3.0, 3.0]) * 1e-8
    return hidden, measure(UR10, hidden, postures, NOISE, np.random.default_rng(9))


def test_the_minimiser_agrees_with_the_tree(postures, compliant):
    content = document(UR10)
    for part, c in zip((p for p in content["parts"] if p["kind"] == "actuated"), compliant[0].own, strict=True):
        part["compliance_rad_per_Nmm"] = float(c)
    model = Mechanism(build_chain(content, "model").split())
    found = equilibria(model, postures[:10], gravity=GRAVITY, compliance=False)
    truth = rest(UR10, compliant[0], postures[:10])
    # differences of the energy err by 1e-9 of the torque, deflections of 1e-3 rad by 1e-9 mm at a metre; descent
    # stops at 1e-9 rad, 1e-6 mm
    assert np.abs(found.position[:, 0] - truth[:, :3, 3]).max() < 2e-6


@pytest.fixture(scope="module")
def diagnosed(postures, compliant, tmp_path_factory):
    folder = tmp_path_factory.mktemp("compliant")
    return diagnose_poses(*files(folder, UR10, postures, compliant[1]), folder / "out", page=True), folder / "out"


def test_joint_compliance_is_named_and_its_size_found(diagnosed, compliant):
    found, _ = diagnosed
    assert found.verdict == "named"
    assert found.causes == ["actuator_compliance"]
    truth = dict(zip((f"actuator_compliance.joint-{i}" for i in range(1, 7)), compliant[0].own, strict=True))
    known = [row for row in found.families[0].members if row.identifiable]
    assert {"actuator_compliance.joint-2", "actuator_compliance.joint-3"} <= {row.name for row in known}
    for row in known:
        # four standard deviations: one of six members in 3,000 tests
        assert abs(row.value - truth[row.name]) < 4.0 * row.std + 1e-10
    # a vertical axis bears nothing: the data say nothing of it
    assert "actuator_compliance.joint-1" not in {row.name for row in known}
    # the noise is 0.05 mm a coordinate, 0.08 mm of distance in the mean
    assert found.after.region_mm == pytest.approx(NOISE * np.sqrt(8.0 / np.pi), rel=0.1)
    assert found.before.region_mm > 5.0 * found.after.region_mm


def test_results_hold_to_the_schema_and_can_be_read_back(diagnosed, postures, compliant):
    found, out = diagnosed
    jsonschema.validate(found.model_dump(mode="json"), schemas()["pose-diagnosis.schema.json"])
    assert "Verdict <b>named</b>" in (out / "diagnosis.html").read_text()
    model = Mechanism(load_chain(out / "extended-model.toml").split())
    truth = rest(UR10, compliant[0], postures[:20])[:, :3, 3]
    place = equilibria(model, postures[:20], gravity=GRAVITY, compliance=False).position[:, 0]
    # frames are no part of the model: distances between postures are compared
    error = np.linalg.norm(np.diff(place, axis=0), axis=1) - np.linalg.norm(np.diff(truth, axis=0), axis=1)
    assert np.abs(error).max() < 0.3
    urdf = Mechanism(build_chain(import_urdf(out / "calibrated.urdf").document, "urdf").split())
    q = postures[:5]
    there = unloaded_frames(urdf, q)[1][:, 0]
    assert np.abs(there - unloaded_frames(model, q)[1][:, 0]).max() < 1e-6  # 1e-9 mm of rounding, six digits of π/2


def test_next_postures_promise_something(diagnosed):
    rows = diagnosed[0].next_postures
    assert [row.criterion for row in rows] == ["D", "I"]
    assert all(0.2 < row.members < 1.0 and 0.2 < row.prediction < 1.0 for row in rows)
    assert rows[0].members <= rows[1].members + 1e-9
    assert rows[1].prediction <= rows[0].prediction + 1e-2
    # the residual is noise, and postures are proposed: the last line does not deny them
    assert diagnosed[0].remainder.kind == "none"
    assert "The postures that are proposed" in diagnosed[0].next
    assert "Nothing calls" not in diagnosed[0].next


@pytest.mark.slow
def test_a_first_joints_offset_and_the_base_are_one(postures, compliant, tmp_path):
    found = calibrate_poses(
        *files(tmp_path, UR10, postures, compliant[1]),
        tmp_path / "out",
        families=("joint_offset", "actuator_compliance"),
    )
    rows = {row.name: row for family in found.families for row in family.members}
    assert "turn of the base frame" in rows["joint_offset.joint-1"].one_with
    assert any(name.startswith("place of marker") for name in rows["joint_offset.joint-6"].one_with)
    assert rows["joint_offset.joint-3"].one_with == []
    jsonschema.validate(found.model_dump(mode="json"), schemas()["pose-calibration.schema.json"])


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("cause", ["none", "lateral_compliance", "gear_error", "approach"])
def test_single_causes(cause, tmp_path):
    causes = () if cause == "none" else (cause,)
    found = diagnose_poses(*write(Planned(0, "single", SEVEN, causes, 77), tmp_path), tmp_path / "out")
    assert (found.verdict, tuple(found.causes)) == ("named" if causes else "none", causes)


def test_what_is_far_below_the_noise_of_the_sheet_has_no_cause(tmp_path, postures):
    """A compliance that moves the hand by a thirtieth of the sheet's noise, in readings that have none."""
    hidden = Hidden.nothing(6)
    hidden.own = np.full(6, 2e-11)
    y = measure(UR10, hidden, postures, 0.0, np.random.default_rng(0))
    found = diagnose_poses(*files(tmp_path, UR10, postures, y), tmp_path / "out")
    assert (found.verdict, found.causes) == ("none", [])


@pytest.mark.slow
def test_causes_outside_the_catalogue_are_not_explained(tmp_path):
    found = diagnose_poses(*write(Planned(0, "outside", SEVEN, ("rubber",), 5), tmp_path), tmp_path / "out")
    assert found.verdict in ("unknown", "partly")
    assert found.remainder.significant


@pytest.mark.slow
def test_a_belt_that_slips_is_a_change_of_its_joints_zero_and_no_cause(tmp_path):
    """No cause of the catalogue slips. The series is cut where it did, and noise remains of both parts."""
    found = diagnose_poses(*write(Planned(0, "outside", SEVEN, ("slip",), 5), tmp_path), tmp_path / "out")
    assert (found.verdict, found.causes) == ("none", [])
    (said,) = (row.found for row in found.doubts if row.grade == "doubtful")
    assert said.startswith("zero_moved: from here on joint-3 stands")
    assert not found.remainder.significant


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda q, y: (np.degrees(q), y), ["in degrees", "0.0174533"]),
        (lambda q, y: (q, y / 1000.0), ["in m;", "by 1000"]),
        (lambda q, y: (q, y / 304.8), ["in feet", "by 304.8"]),
        (lambda q, y: (q, y / 550.0), ["which no unit explains"]),
        (lambda q, y: (1e4 * q, y), ["degrees do not explain it"]),
        (lambda q, y: (q, 0.0 * y), ["all the same"]),
        (lambda q, y: (q[:6], y[:6]), ["6 different postures", "9 unknowns"]),
        (lambda q, y: (np.repeat(q[:5], 20, axis=0), np.repeat(y[:5], 20, axis=0)), ["5 different postures"]),
    ],
)
def test_impossible_data_are_refused(spoil, said, postures, compliant, tmp_path):
    with pytest.raises(ValueError, match=r"^readings\.csv: ") as caught:
        diagnose_poses(*files(tmp_path, UR10, *spoil(postures, compliant[1])), tmp_path / "out")
    for word in said:
        assert word in str(caught.value)
    assert not (tmp_path / "out").exists()


def _exchanged(q):
    q = q.copy()
    q[:, [1, 2]] = q[:, [2, 1]]
    return q


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spoil", "name"),
    [
        (lambda q, y: (q * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0], y), "joint_sign.joint-3"),
        (lambda q, y: (_exchanged(q), y), "joints_swapped.joint-2.joint-3"),
        (lambda q, y: (q + 0.5 * np.pi * np.eye(6)[2], y), "joint_zero.joint-3"),
        (lambda q, y: (q, y[:, [1, 0, 2]]), "tracker_mirrored"),
        (lambda q, y: (q, y / 10.0), "positions_in_cm"),
        (lambda q, y: (q, y / 5.0), "positions_scaled"),
        (lambda q, y: (q, 4.0 * y), "positions_scaled"),
        (lambda q, y: (q, np.roll(y, 1, axis=0)), "positions_shifted.1"),
        (lambda q, y: (q, y + np.where(np.arange(120) < 60, 0.0, 1.0)[:, None] * [1.5, -1.0, 0.5]), "tracker_jump"),
    ],
)
def test_bad_data_are_named(spoil, name, postures, compliant, tmp_path):
    found = diagnose_poses(
        *files(tmp_path, UR10, *spoil(postures, compliant[1])),
        tmp_path / "out",
        only=("actuator_compliance", "tracker_drift"),
    )
    # a series is cut at a jump, and both parts are fitted: the compliance that they have is found
    jumped = name == "tracker_jump"
    assert (found.verdict, found.causes) == (("named", ["actuator_compliance"]) if jumped else ("unknown", []))
    assert [row.found.partition(":")[0] for row in found.doubts if row.grade == "doubtful"] == [name]


@pytest.mark.slow
def test_a_jump_is_told_in_full(postures, compliant, tmp_path):
    step = np.array([1.5, -1.0, 0.5])
    y = compliant[1] + np.where(np.arange(120) < 60, 0.0, 1.0)[:, None] * step
    found = diagnose_poses(*files(tmp_path, UR10, postures, y), tmp_path / "out", only=("actuator_compliance",))
    said = next(row.found for row in found.doubts if row.found.startswith("tracker_jump"))
    told = [float(word) for word in said[said.index("(") + 1 : said.index(")")].split(",")]
    # means of 60 readings of 0.05 mm differ by 0.009 mm; frames take a part of what their means show away
    assert told == pytest.approx(step, abs=0.04)


def test_an_outlier_is_left_out_and_said(postures, compliant, diagnosed, tmp_path):
    y = compliant[1].copy()
    y[7, 0] += 1000.0
    found = diagnose_poses(*files(tmp_path, UR10, postures, y), tmp_path / "out", only=("actuator_compliance",))
    assert [(row.where, row.grade) for row in found.doubts] == [("readings.csv, row 9", "noted")]
    assert (found.verdict, found.causes) == ("named", ["actuator_compliance"])
    assert found.after.random_mm == pytest.approx(diagnosed[0].after.random_mm, rel=0.02)  # one reading of 120


@pytest.mark.slow
def test_a_weight_that_points_the_other_way_is_doubted(postures, compliant, tmp_path):
    data, sheet = files(tmp_path, UR10, postures, compliant[1])
    sheet.write_text(sheet.read_text().replace("-9.81", "9.81"))
    found = diagnose_poses(data, sheet, tmp_path / "out", only=("frame_error", "actuator_compliance"))
    assert ["against the weight" in row.found for row in found.doubts] == [True]


def test_strict_refuses_a_flipped_joint(postures, compliant, tmp_path):
    flipped = postures * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]
    with pytest.raises(
        ValueError, match=r"readings\.csv: joint_sign\.joint-3: .* multiply joint-3 by −1.*--strict"
    ):
        calibrate_poses(*files(tmp_path, UR10, flipped, compliant[1]), tmp_path / "out", strict=True)
    assert not (tmp_path / "out").exists()


def test_repeated_postures_are_held_out_together(postures, compliant, tmp_path):
    q, y = np.repeat(postures[:40], 3, axis=0), np.repeat(compliant[1][:40], 3, axis=0)
    _, study = prepared(*files(tmp_path, UR10, q, y))
    for fold in study.folds.parts:
        assert np.array_equal(fold[::3], fold[1::3])
        assert np.array_equal(fold[::3], fold[2::3])
    assert study.gauss_newton(Hypothesis()).errors.means[1] > 0.0


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("order", "name"), [([5, 4, 3, 2, 1, 0], "joints_reversed"), ([1, 2, 3, 4, 5, 0], "joints_shifted.5")]
)
def test_joints_in_another_order_are_named(order, name, postures, compliant, tmp_path):
    found = diagnose_poses(*files(tmp_path, UR10, postures[:, order], compliant[1]), tmp_path / "out")
    assert (found.verdict, found.causes) == ("unknown", [])
    assert [row.found.partition(":")[0] for row in found.doubts] == [name]


def test_another_robots_readings_are_doubted(postures, compliant, tmp_path):
    # joints 1, 2 and 3 turned about among each other: neither two exchanged nor all shifted
    found = diagnose_poses(
        *files(tmp_path, UR10, postures[:, [1, 2, 0, 3, 4, 5]], compliant[1]),
        tmp_path / "out",
        only=("frame_error",),
    )
    assert found.verdict == "unknown"
    assert [row.found.partition(":")[0] for row in found.doubts] == ["rigid_robot"]


# The frames of tracker and markers of a rigid robot, from positions that are made with known frames.


@pytest.mark.parametrize("turn", [0.1, 1.5], ids=["a small cube", "everywhere"])
def test_the_frames_are_found_that_made_the_positions(turn):
    """Where a hand turns little, the marker's place and the tracker's frame do nearly the same."""
    rng = np.random.default_rng(2)
    R = np.array([rotation_from_vector(v) for v in rng.uniform(-turn, turn, (60, 3))])[:, None]
    p = rng.uniform(-150.0, 150.0, (60, 1, 3))
    Q, t, m = (
        rotation_from_vector([0.4, -1.0, 0.8]),
        np.array([500.0, -900.0, 300.0]),
        np.array([40.0, -25.0, 60.0]),
    )
    noise = 0.05
    y = (p + np.einsum("gkab,b->gka", R, m)) @ Q.T + t + rng.normal(0.0, noise, p.shape)
    frames, distance = align(R, p, y, np.full((60, 1, 3, 3), np.nan), np.array([200.0]), None)
    # nine of 180 readings are spent on the frames; a tenth is twice the standard deviation of a root mean square
    assert np.sqrt(np.mean(distance**2) / 3.0) == pytest.approx(noise * np.sqrt(171.0 / 180.0), rel=0.1)
    # a place is seen by the turns of the hand: standard deviation of noise over turn √(60/3), four of them
    assert np.abs(frames.m[0] - m).max() < 4.0 * noise / (turn * np.sqrt(20.0))
