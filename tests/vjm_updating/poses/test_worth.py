"""A model file is written where it is better than no calibration; grids are held out by level."""

import tomllib
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from helpers.command import validate
from helpers.from_files import calibrate_poses, diagnose_poses, prepared
from helpers.weighed_arm import GRAVITY, OWN, compliant, drawn, files, measured
from hidden_effects.poses.injector import Hidden, measure
from hidden_effects.poses.plan import NOISE
from hidden_effects.poses.robots import HEAVY, UR10, document

from vjm.io.files import toml_text
from vjm.io.model_file import load_chain
from vjm.machine.equilibria import equilibria, unloaded_frames
from vjm.model.mechanism import Mechanism
from vjm.rotations import rotation_vector
from vjm_updating.poses.document import lines
from vjm_updating.poses.held_out import by_machine
from vjm_updating.poses.identifiability import estimates
from vjm_updating.poses.machine import LATERAL
from vjm_updating.poses.pose_study import kabsch
from vjm_updating.poses.selection import with_needed
from vjm_updating.poses.state import Hypothesis, folds_of, levels_of
from vjm_updating.poses.written import written
from vjm_validation.cli.main import run

SPRINGS = ("actuator_compliance",)
COMMAND = ("--fit", "frame_error")


def test_levels_are_values_that_come_back():
    rng = np.random.default_rng(2)
    grid = np.repeat(np.linspace(-1.0, 1.0, 6), 8) + 1e-3 * rng.standard_normal(48)
    mixed = rng.permutation(48)
    assert np.array_equal(levels_of(grid[mixed]), np.repeat(np.arange(6), 8)[mixed])
    for seed in range(200):
        assert levels_of(np.random.default_rng(seed).uniform(-1.0, 1.0, 60)) is None
    assert levels_of(np.zeros(20)) is None  # does not change
    # each joint alone from home: most postures have one value, and the others one each
    assert levels_of(np.concatenate([np.zeros(40), np.linspace(0.1, 1.0, 8)])) is None
    assert levels_of(np.array([0.0, 0.0, 1.0, 1.0, 1.0, 2.0])) is None  # one that is met once


def test_whole_levels_are_held_out():
    levels = np.linspace(-1.0, 1.0, 7)
    q = np.stack([v.ravel() for v in np.meshgrid(levels, levels)], axis=1)
    q = np.column_stack([q, np.random.default_rng(1).uniform(-1.0, 1.0, 49)])
    folds = folds_of(q, {"first": q[:, 0], "second": q[:, 1], "third": q[:, 2], "x": np.repeat(levels, 7)})
    assert list(folds.levels) == ["first", "second", "x"]
    for i, fold in zip((0, 1, 1), folds.levels.values(), strict=True):
        assert len(set(fold.tolist())) == 5
        for level in levels:
            assert len(set(fold[q[:, i] == level].tolist())) == 1
    # at random each level of the first joint is in several parts
    assert all(len(set(folds.random[q[:, 0] == level].tolist())) > 1 for level in levels)
    assert not folds_of(q[:, 2:], {"third": q[:, 2]}).levels


@pytest.mark.slow
def test_a_grid_says_its_levels_and_not_at_random(tmp_path):
    """A joint's gear errs by a third wave, and two are fitted: they meet it at five angles, and nowhere else."""
    rng = np.random.default_rng(7)
    q = rng.uniform(-2.0, 2.0, (150, 6))
    between = q.copy()
    q[:, 1] = rng.choice(np.linspace(-1.6, 1.6, 5), 150)
    between[:, 1] *= 0.8

    def errs(q):
        turned = q.copy()
        turned[:, 1] += 1e-3 * np.cos(3.0 * q[:, 1])
        return measured(Hidden.nothing(6), turned)

    other = files(tmp_path / "between", between, errs(between))
    found = calibrate_poses(
        *files(tmp_path, q, errs(q)), tmp_path / "out", families=("gear_error",), beside=[other], page=True
    )
    assert found.grid == ["joint-2"]
    # at random it seems better than it was, and is worse between the levels
    assert found.after.random_mm < found.before.random_mm
    assert found.after.beside_mm[0] > found.before.beside_mm[0]
    assert found.after.level_mm > found.before.level_mm
    assert "held out by level" in [row.where for row in found.written.compared]
    page = (tmp_path / "out/calibration.html").read_text()
    assert "grid of joint-2" in page
    assert "held out by level" in page


def test_places_of_the_hand_may_lie_in_a_grid(tmp_path):
    """The first joint turns about the upright axis: three postures of the others are three heights."""
    q = drawn(24, 3)[np.arange(60) % 3]
    q[:, 0] = np.random.default_rng(8).uniform(-2.0, 2.0, 60)
    q[:, 4] += 1e-4 * np.arange(60)  # the height stays to some hundredths of a millimetre
    _, study = prepared(*files(tmp_path, q, measured(compliant(), q)))
    assert {"z of target", "joint-2", "joint-6"} <= set(study.folds.levels)
    assert not {"joint-1", "x of target"} & set(study.folds.levels)


@pytest.fixture(scope="module")
def spring_files(tmp_path_factory):
    q = drawn(21, 80)
    return files(tmp_path_factory.mktemp("springs"), q, measured(compliant(), q))


def test_a_file_that_is_better_is_written(spring_files, tmp_path):
    found = calibrate_poses(*spring_files, tmp_path, families=SPRINGS)
    verdicts = {(row.where, row.against): row.verdict for row in found.written.compared}
    own = "the model with its own compliances"
    assert verdicts == {
        (where, against): "better"
        for where in ("held out by region", "at the ends")
        for against in ("the sheet's model", own)
    }
    assert found.written.refused == []
    assert lines(found)[0] == "the model file, where postures were held out: better there"
    assert load_chain(tmp_path / "calibrated-model.toml")


@pytest.mark.slow
def test_a_file_of_a_robot_that_is_right_is_refused(tmp_path):
    """Frame errors of noise: the file can only be worse. --force writes it, and it says so."""
    q = drawn(22, 40)
    where = files(tmp_path, q, measured(compliant(np.full(6, 1e-9)), q))
    sheet = where[1].read_text().replace("rigid = true", "rigid = false")
    where[1].write_text(sheet)
    words = ["calibrate", str(where[0]), "--sheet", str(where[1]), "--out", str(tmp_path / "out"), *COMMAND]
    said = [
        line for line in validate(*words, status=1).out.splitlines() if line.startswith("no model file was written")
    ]
    assert len(said) == 1
    assert "it is no better than the sheet's model: held out by region" in said[0]
    assert said[0].endswith("`validate calibrate --force` writes it all the same")
    assert not list((tmp_path / "out").glob("calibrated*"))
    out = validate(*words, "--force").out
    assert out.splitlines()[0] == "the model file, where postures were held out: no better: written by force"
    assert "written by force, not for use" in out
    for name in ("calibrated-model.toml", "calibrated.urdf", "calibrated.xml"):
        assert "Not for use: it is no better" in (tmp_path / "out" / name).read_text()
    assert load_chain(tmp_path / "out/calibrated-model.toml")
    said = validate("check", tmp_path / "out/calibrated-model.toml")
    assert "[calibrated] not_for_use: it is no better than the sheet's model" in said.out + said.err
    assert ET.parse(tmp_path / "out/calibrated.urdf").getroot().tag == "robot"
    assert ET.parse(tmp_path / "out/calibrated.xml").getroot().tag == "mujoco"


@pytest.mark.slow
def test_a_file_that_is_worse_on_another_series_is_refused(spring_files, tmp_path):
    """The other series is of a machine without the compliances that were found."""
    q = drawn(23, 80)
    other = files(tmp_path / "other", q, measured(Hidden.nothing(6), q))
    found = calibrate_poses(*spring_files, tmp_path / "out", families=SPRINGS, beside=[other])
    assert found.beside == ["readings.csv"]
    assert [row.verdict for row in found.written.compared if row.where == "on readings.csv"] == ["worse", "worse"]
    assert any(
        one.startswith("it is worse than the sheet's model: on readings.csv") for one in found.written.refused
    )
    assert not (tmp_path / "out/calibrated-model.toml").exists()
    # of the same machine it is better there
    alike = files(tmp_path / "alike", q, measured(compliant(), q))
    found = calibrate_poses(*spring_files, tmp_path / "out", families=SPRINGS, beside=[alike])
    assert {row.verdict for row in found.written.compared} == {"better"}
    assert (tmp_path / "out/calibrated-model.toml").exists()


@pytest.mark.slow
def test_where_a_file_holds_stands_in_it(tmp_path):
    """Of a cube in joint space: the joints' turns reach further than held-out ends tell of."""
    q = drawn(25, 80, 0.8)
    where = files(tmp_path, q, measured(compliant(20.0 * OWN), q))
    found = calibrate_poses(*where, tmp_path / "out", families=SPRINGS, force=True)
    assert set(found.written.valid_within) == {f"joint-{k}" for k in range(1, 7)}
    for k, (low, high) in enumerate(found.written.valid_within.values()):
        assert (low, high) == pytest.approx((q[:, k].min(), q[:, k].max()), abs=1e-6)
    for name in ("calibrated-model.toml", "calibrated.urdf", "calibrated.xml"):
        assert "valid within (rad, mm): joint-1 -0.7" in (tmp_path / "out" / name).read_text()
    assert any(line.startswith("warning: the model file is valid within") for line in lines(found))
    model = str(tmp_path / "out/calibrated-model.toml")
    read = load_chain(model).valid_within
    assert {name: list(ends) for name, ends in read.items()} == found.written.valid_within
    # another calibration says its own
    again = where[1].read_text().replace("model.toml", model)
    (where[1].parent / "again.toml").write_text(again)
    wide = files(tmp_path / "wide", drawn(28, 80, 3.0), measured(compliant(20.0 * OWN), drawn(28, 80, 3.0)))
    calibrate_poses(wide[0], where[1].parent / "again.toml", tmp_path / "again", families=SPRINGS, force=True)
    assert not load_chain(tmp_path / "again/calibrated-model.toml").valid_within


IN, OUT = "0.1,0.1,0.1,0.1,0.1,0.1", "0.1,0.1,-1.9,0.1,0.1,0.1"


@pytest.fixture(scope="module")
def ranged(tmp_path_factory):
    """A model file whose third joint was measured within a radian, once around too."""
    folder = tmp_path_factory.mktemp("ranged")
    content = document(UR10)
    for part in content["parts"]:
        if part["kind"] == "actuated":
            part["compliance_rad_per_Nmm"] = 1e-8
    (folder / "plain.toml").write_text(toml_text(content))
    content["calibrated"] = {"valid_within": {"joint-3": [-1.0, 1.0]}}
    (folder / "model.toml").write_text(toml_text(content))
    return folder


@pytest.mark.parametrize(
    "words",
    [
        ["curve", "{}", "--to", "0.1", "--free", "y,z,rx,ry,rz", "--posture"],
        ["map", "{}", "--grid", "joint-1=0:0.2:2", "--out", "{folder}/map-of-{name}", "--posture"],
        ["compensate", "{}", "{folder}/path.csv", "--gravity", "0,0,-9.81", "--posture"],
    ],
    ids=lambda words: words[0],
)
def test_commands_say_when_they_leave_what_was_measured(words, ranged, tmp_path, capsys):
    said = (
        "[calibrated.valid_within]: joint-3 = -1.9 rad lies 0.9 rad beyond -1 to 1, within which it was calibrated"
    )

    def of(model, posture):
        chain = load_chain(ranged / model)
        R, p = unloaded_frames(Mechanism(chain), np.array([[float(v) for v in posture.split(",")]]))
        place = np.concatenate([p[0, 0], rotation_vector(R[0, 0])])
        rows = ["x_mm,y_mm,z_mm,rx_rad,ry_rad,rz_rad", ",".join(f"{v:.12g}" for v in place)]
        (tmp_path / "path.csv").write_text("\n".join(rows) + "\n")
        ways = [w.format(ranged / model, folder=tmp_path, name=f"{model}{posture}") for w in words]
        code = run([*ways, posture])
        return code, capsys.readouterr().err

    assert said in of("model.toml", OUT)[1]
    for model, posture in (("model.toml", IN), ("plain.toml", OUT)):
        code, err = of(model, posture)
        assert code == 0
        assert "valid_within" not in err


def rms_by(model, study):
    """Root mean square of what a model file misses of a test, its frames fitted."""
    return float(np.sqrt(np.mean(by_machine(study, load_chain(model))[0] ** 2)))


TOO_SURE = pytest.mark.xfail(
    strict=True, reason="over the whole range 0.78 mm are promised and 1.01 mm are missed, by 800 postures"
)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [201, pytest.param(202, marks=TOO_SURE), 203])
def test_a_file_from_a_small_region_does_not_go_far_outside_of_it(seed, tmp_path, monkeypatch):
    """Gears err by a third wave, which no family has: in a small region the frames' errors take it up."""
    rng = np.random.default_rng(seed)
    phase, hidden = rng.uniform(0.0, 6.0, 6), compliant()
    hidden.tilt = rng.normal(0.0, 3e-4, (6, 2))

    def read(name, q):
        return files(tmp_path / name, q, measured(hidden, q + 1e-3 * np.cos(3.0 * q + phase)))

    here = read("here", drawn(seed, 80, 0.35) + np.array([0.3, -1.0, 1.2, -1.5, -1.4, 0.2]))
    families = ("frame_error", "actuator_compliance")
    with monkeypatch.context() as without:
        without.setattr("vjm_updating.poses.written.supported", lambda study, state, model: (state, None))
        alone = calibrate_poses(*here, tmp_path / "alone", families=families, force=True)
    assert alone.written.whole_range is None
    found = calibrate_poses(*here, tmp_path / "out", families=families, force=True, page=True)
    ranged = found.written.whole_range
    assert ranged.changed_mm < 0.7 * ranged.asked_mm
    assert set(ranged.unsupported) <= {m.name for family in found.families for m in family.members}
    assert ranged.unsupported
    assert any(line.startswith("that range asks for other postures: held near") for line in lines(found))
    assert "How well the file is known over the workspace" in (tmp_path / "out/calibration.html").read_text()
    _, there = prepared(*read("there", drawn(seed + 1000, 80, 2.5)))
    before = rms_by(tmp_path / "here/model.toml", there)
    after = rms_by(tmp_path / "out/calibrated-model.toml", there)
    # of what the postures alone make worse there
    assert after - before < 0.5 * (rms_by(tmp_path / "alone/calibrated-model.toml", there) - before)
    # postures over the whole range outweigh the prior
    wide = calibrate_poses(
        *read("wide", drawn(seed, 80, 3.1)), tmp_path / "wide-out", families=families, force=True
    )
    spread = wide.written.whole_range
    assert spread.changed_mm > 0.85 * spread.asked_mm
    after = rms_by(tmp_path / "wide-out/calibrated-model.toml", there)
    assert after < before
    # what no family has counts in the error that is promised; 80 postures know it within a quarter (three sigma)
    assert after < 1.25 * np.hypot(spread.error_mm, np.sqrt(3.0) * NOISE)


def test_a_number_that_ends_at_its_bound_is_named_and_not_written(tmp_path):
    """A wrist more compliant than any drive that is built, on a machine that says 1e-9."""
    content = document(UR10)
    for part in content["parts"]:
        if part["kind"] == "actuated":
            part["compliance_rad_per_Nmm"] = 1e-9
    own = OWN.copy()
    own[4] = 3e-5
    q = drawn(204, 80)
    where = files(tmp_path, q, measured(compliant(own), q), content=content)
    found = calibrate_poses(*where, tmp_path / "out", families=SPRINGS, force=True)
    assert found.written.at_bound == ["actuator_compliance.joint-5"]
    (row,) = [m for family in found.families for m in family.members if m.name == "actuator_compliance.joint-5"]
    assert (row.at_bound, row.in_file) == (True, None)
    assert row.value == pytest.approx(1e-5)
    parts = {part.name: part for part in load_chain(tmp_path / "out/calibrated-model.toml").held_joints}
    assert parts["joint-5"].compliance == 1e-9
    assert any("joint-5 ended at the bound of what is built" in line for line in lines(found))


@pytest.mark.slow
def test_what_was_weighed_down_is_said_with_its_rows(tmp_path):
    q = drawn(26, 100)
    y = measured(compliant(), q)
    y[40:43] += [3.0, -2.0, 1.0]
    y[70] += [0.0, 0.0, 2.5]
    found = calibrate_poses(*files(tmp_path, q, y), tmp_path / "out", families=SPRINGS, page=True)
    runs = [(row.first_row, row.last_row, row.readings) for row in found.weighed_down]
    assert runs == [(42, 44, 3), (72, 72, 1)]  # lines of the file
    assert found.weighed_down[0].off_mm == pytest.approx([14.0**0.5] * 2, rel=0.2)
    (said,) = [line for line in lines(found) if line.startswith("weighed down")]
    assert "4 of 100 readings: rows 42 to 44 of target (3" in said
    assert "row 72 of target (2" in said
    assert (
        "Weighed down, for they lie far off: 4 of 100 readings" in (tmp_path / "out/calibration.html").read_text()
    )


@pytest.mark.slow
def test_unknown_is_not_followed_by_names(tmp_path):
    """Gears of a third wave, which follows an angle and which no family has."""
    q = drawn(27, 150)
    turned = q.copy()
    turned[:, 1] += 2e-3 * np.cos(3.0 * q[:, 1])
    hidden = compliant(6.0 * OWN)
    test = files(tmp_path, q, measured(hidden, turned))
    found = diagnose_poses(*test, tmp_path / "out", only=SPRINGS, page=True)
    assert (found.verdict, found.causes) == ("unknown", ["actuator_compliance"])
    assert lines(found)[0] == "verdict: unknown"
    assert not any(line.startswith("actuator_compliance") for line in lines(found))
    assert any(line.startswith("no answer, guesses of the catalogue") for line in lines(found))
    assert "Guesses are actuator_compliance" in (tmp_path / "out/diagnosis.html").read_text()


# Which drives are needed, and what is written: the file is what was judged. Robots by the energy minimiser.


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4])
def test_soft_drives_of_a_wrist_are_known(seed, tmp_path):
    """Fifty times as soft as those of the shoulder, under a thirtieth of its torque."""
    rng = np.random.default_rng(seed)
    hidden = Hidden.nothing(6)
    hidden.own = 4e-10 * rng.uniform(0.6, 1.4, 6) * np.array(HEAVY.softer)
    hidden.tilt = rng.normal(0.0, 1e-3, (6, 2))
    q = drawn(seed, 120, HEAVY.reach)
    where = files(tmp_path, q, measure(HEAVY, hidden, q, NOISE, rng), content=document(HEAVY))
    found = diagnose_poses(*where, tmp_path / "out")
    assert (found.verdict, set(found.causes)) == ("named", {"frame_error", "actuator_compliance"})
    rows = {row.name: row for family in found.families for row in family.members}
    for k in (4, 5):
        row = rows[f"actuator_compliance.joint-{k}"]
        assert row.identifiable
        # four standard deviations: one of four numbers in 4,000 tests
        assert abs(row.value - hidden.own[k - 1]) < 4.0 * row.std
        assert row.value > 20.0 * rows["actuator_compliance.joint-2"].value


@pytest.mark.slow
def test_drives_that_are_not_needed_keep_the_models_value(springs, tmp_path):
    """Rigid wrists: the readings are as probable without them, and what is held out is predicted as well."""
    q = drawn(8)
    where = files(tmp_path, q, measured(compliant([0.0, 1.2e-8, 1.5e-8, 0.0, 0.0, 0.0]), q))
    _, study = prepared(*where)
    whole = study.gauss_newton(Hypothesis(("actuator_compliance",)))
    kept = with_needed(study, whole).hypothesis.kept
    # of the noise one in some may be taken for a drive that is needed
    assert kept
    assert {name.partition(".")[2] for name in kept} <= {"joint-4", "joint-5", "joint-6"}
    less = study.gauss_newton(Hypothesis(("actuator_compliance",), kept=kept))
    # no worse by more than the standard error of the paired differences, some half a per cent
    assert less.errors.means[1] < 1.01 * whole.errors.means[1]
    for name in ("joint-2", "joint-3"):
        without = study.gauss_newton(
            Hypothesis(("actuator_compliance",), kept=(*kept, f"actuator_compliance.{name}"))
        )
        assert without.errors.means[1] > 1.5 * whole.errors.means[1], name
    found = calibrate_poses(*where, tmp_path / "out", families=("actuator_compliance",))
    reasons = {row.name: row.reason for row in found.not_known}
    assert all(reasons[name] == "the readings are as probable without it" for name in kept)
    joints = {part.name: part.compliance for part in load_chain(tmp_path / "out/calibrated-model.toml").held_joints}
    assert {joints[name.partition(".")[2]] for name in kept} == {1e-9}  # the model's own


@pytest.mark.slow
def test_what_is_not_learnt_keeps_the_models_own_value(springs, tmp_path):
    where, _, study, _ = springs
    found = calibrate_poses(*where, tmp_path, families=("actuator_compliance",))
    asked = {m.subject for m in study.members if m.family == "actuator_compliance"}
    learnt = {row.name.partition(".")[2]: row for row in found.families[0].members if row.identifiable}
    joints = {part.name: part.compliance for part in load_chain(tmp_path / "calibrated-model.toml").held_joints}
    for name, compliance in joints.items():
        if name not in learnt:
            assert compliance == 1e-9, name  # the model's own
        else:
            assert compliance == pytest.approx(learnt[name].in_file, rel=1e-12)
            # others keep the model's compliance in the file, and were rigid when they were judged
            assert abs(compliance - learnt[name].value) < learnt[name].std
            # four standard deviations: one of four members in 4,000 tests
            assert abs(compliance - OWN[int(name[-1]) - 1]) < 4.0 * learnt[name].std
    assert {"joint-2", "joint-3"} <= set(learnt) <= asked


def test_the_file_is_what_was_judged(tmp_path):
    q = drawn(12, 110, 2.4)
    hidden = compliant()
    hidden.wave = np.random.default_rng(4).normal(0.0, 4e-4, (6, 4))
    where = files(tmp_path, q, measured(hidden, q))
    found = calibrate_poses(*where, tmp_path / "out", families=("actuator_compliance", "gear_error"))
    assert found.written.without == ["gear_error"]
    assert found.written.judged_mm < 0.5 * found.written.refitted_mm
    # the file, by another engine: equilibria of its own machine, frames by Kabsch's method and the flange's lever
    model = Mechanism(load_chain(tmp_path / "out/calibrated-model.toml").split())
    ends = equilibria(model, q, gravity=GRAVITY, compliance=False)
    y = np.loadtxt(where[0], delimiter=",", skiprows=1)[:, 6:9]
    m = np.zeros(3)
    for _ in range(200):
        p = ends.position[:, 0] + ends.rotation[:, 0] @ m
        R, t = kabsch(p, y)
        m = m + np.einsum("gba,gb->a", ends.rotation[:, 0], (y - t) @ R - p) / len(q)
    error = float(np.linalg.norm(y - (ends.position[:, 0] + ends.rotation[:, 0] @ m) @ R.T - t, axis=1).mean())
    # weights of outliers against none: a per cent
    assert found.written.file_mm == pytest.approx(error, rel=0.02)
    assert found.written.file_mm == pytest.approx(found.written.refitted_mm, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("own", [1e-9, 2e-8], ids=["stiff", "soft"])
def test_every_value_in_a_file_of_a_rigid_sheet_is_one_that_was_judged(own, tmp_path):
    """What is not learnt is the model's in the file, and so in the fit that the file is said to be."""
    content = document(UR10)
    for part in content["parts"]:
        if part["kind"] == "actuated":
            part |= {"compliance_rad_per_Nmm": own, "lateral_rad_per_Nmm": [0.3 * own, 0.1 * own]}
    rng = np.random.default_rng(6)
    hidden = compliant()
    hidden.across, hidden.base = rng.uniform(3e-9, 9e-9, (6, 2)), rng.uniform(5e-9, 9e-9, 3)
    hidden.tilt = rng.normal(0.0, 1e-3, (6, 2))
    q = drawn(12, 120, 2.4)
    where = files(tmp_path, q, measured(hidden, q), content=content)
    chosen = (
        "frame_error", "joint_offset", "actuator_compliance", "lateral_compliance", "base_compliance", "gravity",
    )  # fmt: skip
    measurement, study = prepared(*where)
    state = study.gauss_newton(Hypothesis(chosen))
    out = written(measurement, study, study.gauss_newton(Hypothesis()), state, estimates(study, state))
    # only the frames are fitted by the file: its residuals are those of the fit to the end of its iterations
    assert out.error == pytest.approx(out.state.errors.means[0], rel=2e-3)
    (tmp_path / "file.toml").write_text(out.text)
    chain = load_chain(tmp_path / "file.toml")
    values = {f"actuator_compliance.{part.name}": part.compliance for part in chain.held_joints}
    for part in chain.held_joints:
        lateral = zip(LATERAL, part.lateral, strict=True)
        values |= {f"lateral_compliance.{part.name}.{label}": c for label, c in lateral}
    for name, value in values.items():
        family, part, *label = name.split(".")
        if part.startswith("base-turn"):
            # a turn of the base, a joint of its own in the file
            wanted = out.members[f"base_compliance.base.{part[-1]}"] if not label else 0.0
        else:
            wanted = out.members.get(
                name, own * {"actuator_compliance": 1.0, "first": 0.3, "second": 0.1}[(*label, family)[0]]
            )
        assert value == pytest.approx(wanted, rel=1e-9, abs=1e-13), name  # 1e-13: written as rigid
    assert len(values.keys() & out.members) > 5


def test_an_absurd_joint_is_not_written(tmp_path):
    q = drawn(8, 60)
    # 3e-6 rad/(N mm) under 1.5e5 N mm: half a radian, which no arm is made for
    hidden = compliant([0.0, 3e-6, 0.0, 0.0, 0.0, 0.0])
    where = files(tmp_path, q, measured(hidden, q))
    (tmp_path / "out").mkdir()
    (tmp_path / "out/calibrated-model.toml").write_text("of an earlier run")
    found = calibrate_poses(*where, tmp_path / "out", families=("actuator_compliance",))
    assert "sag" in found.written.refused[0]
    assert not (tmp_path / "out/calibrated-model.toml").exists()
    assert any("sag" in row.found for row in found.doubts)


def test_a_model_without_springs_is_calibrated_as_a_rigid_one(tmp_path):
    """Geometry is all that it has; the file has no spring either, and is the model of another test."""
    content = document(UR10)
    for part in content["parts"]:
        part.pop("compliance_rad_per_Nmm", None)
    hidden = Hidden.nothing(6)
    hidden.offset = np.random.default_rng(6).normal(0.0, 2e-3, 6)
    q = drawn(6, 60)
    found = calibrate_poses(
        *files(tmp_path / "one", q, measured(hidden, q), content=content),
        tmp_path / "out",
        families=("joint_offset",),
    )
    text = (tmp_path / "out/calibrated-model.toml").read_text()
    assert "compliance_" not in text
    assert "lateral" not in text
    (offsets,) = found.families
    for row in offsets.members:
        low, high = row.interval95
        # 95 % of six: a tenth more on either side is no miss
        assert low - 0.1 * (high - low) < hidden.offset[int(row.name[-1]) - 1] < high + 0.1 * (high - low)
    _, again = prepared(*files(tmp_path / "two", q, measured(hidden, q, 10), content=tomllib.loads(text)))
    _, before = prepared(*files(tmp_path / "three", q, measured(hidden, q, 10), content=content))
    errors = [np.nanmean(one.gauss_newton(Hypothesis(())).errors.fitted) for one in (again, before)]
    # the mean of 60 lengths of three normal errors, which scatter by 0.42 of it: a tenth is two standard deviations
    assert errors[0] < 1.1 * np.sqrt(8.0 / np.pi) * NOISE < 0.5 * errors[1]
