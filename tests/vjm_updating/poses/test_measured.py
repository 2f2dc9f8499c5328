"""Measured robots: the shipped UR10, and those that are not redistributed, where they are."""

from pathlib import Path

import numpy as np
import pytest
from helpers.from_files import diagnose_poses, prepared
from helpers.justin import SHEET, document
from helpers.measured import needed
from helpers.serial_arms import end_of, end_of_file, postures
from helpers.ur10_parts import CUBE, JOINTS, judged

from vjm.io.files import toml_text
from vjm.io.machine_file import load_model
from vjm.io.model_file import load_chain
from vjm.machine.equilibria import equilibria
from vjm.model.mechanism import Mechanism
from vjm_updating.inference.significance import Worth
from vjm_updating.poses.pose_study import PoseStudy, kabsch
from vjm_updating.poses.selection import select_families
from vjm_updating.poses.verdict import judge
from vjm_validation.cli.main import main

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "validation/vjm_validation/examples/ur10-poses"


@pytest.fixture(scope="module")
def ur10(tmp_path_factory):
    out = tmp_path_factory.mktemp("ur10")
    return diagnose_poses(EXAMPLE / "readings.csv", EXAMPLE / "sheet.toml", out), out


@pytest.mark.slow
def test_the_shipped_ur10(ur10):
    # the noise of the tracker is a tenth of the residual: said, not explained
    found, _ = ur10
    assert found.verdict == "partly"
    # waves of angles that cover a third of a turn hold nowhere else: they are not asked, and not named
    assert found.causes == ["frame_error", "actuator_compliance"]
    asked = {t.name for row in found.selection for t in row.tried}
    assert "gear_error" in asked  # of the elbow, which covers the turn
    unknown = {row.name for row in found.not_known}
    assert {"gear_error.shoulder-pan", "gear_error.shoulder-lift", "actuator_compliance.wrist-1"} <= unknown
    assert found.after.region_mm < 0.40
    assert found.after.ends_mm < 0.40
    assert found.before.region_mm > 1.2


@pytest.mark.slow
def test_the_ur10s_compliance_and_what_its_weight_does_not_show(ur10):
    found, out = ur10
    rows = {row.name: row for family in found.families for row in family.members}
    compliances = {name for name in rows if name.startswith("actuator_compliance")}
    assert compliances == {"actuator_compliance.shoulder-lift", "actuator_compliance.elbow"}
    for name in compliances:
        assert rows[name].identifiable
        # 1.1e-5 rad/(N m), by our own quick fits of another series; series differ by a quarter
        assert rows[name].interval95[0] < 1.25e-8 < rows[name].interval95[1] * 1.02
    # what these postures cannot know keeps the value of the library
    file, library = (
        {part.name: part.compliance for part in load_chain(model).held_joints}
        for model in (out / "extended-model.toml", "ur10")
    )
    kept = ("shoulder-pan", "wrist-1", "wrist-2", "wrist-3")
    assert [file[name] for name in kept] == [library[name] for name in kept]
    assert found.written.file_mm == pytest.approx(found.written.refitted_mm, rel=0.01)  # weights of outliers


def series(name):
    """A series of the UR10 with the example's sheet."""
    return needed(name), EXAMPLE / "sheet.toml"


@pytest.mark.slow
@pytest.mark.parametrize(("on", "beside"), [("ur10_ipa.csv", "ur10_ipa_d.csv"), ("ur10_ipa_d.csv", "ur10_ipa.csv")])
def test_what_is_found_on_one_series_of_the_ur10_holds_on_the_other(on, beside, tmp_path):
    found = diagnose_poses(*series(on), tmp_path, beside=[series(beside)])
    assert found.verdict == "partly"
    assert {"frame_error", "actuator_compliance"} <= set(found.causes)
    errors = [row.beside_mm[0] for row in found.selection]
    # no step predicts the other series better than the last, but for a few per cent that decide nothing
    assert errors[-1] < 1.02 * min(errors)
    assert errors[-1] < 0.7 * errors[0]
    # 0.45 and 0.49 mm were reached by frame errors with joint compliances on other series of the same robot
    assert errors[-1] < 0.42
    _, other = prepared(*series(beside))
    chain = load_chain(tmp_path / "extended-model.toml")
    assert by_the_file(chain, other) < 0.45  # only the frames fitted: 0.437 and 0.444


def by_the_file(chain, study):
    """Mean distance of a series by a model file, only tracker and target fitted, by Kabsch's method."""
    ends = equilibria(Mechanism(chain.split()), study.data.q, gravity=(0.0, 0.0, -9.81), compliance=False)
    p, R, y, m = ends.position[:, 0], ends.rotation[:, 0], study.data.position[:, 0], np.zeros(3)
    seen = np.isfinite(y).all(axis=1)
    p, R, y = p[seen], R[seen], y[seen]
    for _ in range(300):
        Q, t = kabsch(p + R @ m, y)
        m = np.einsum("gba,gb->a", R, (y - t) @ Q - p) / len(p)
    return float(np.linalg.norm(y - (p + R @ m) @ Q.T - t, axis=1).mean())


@pytest.mark.slow
@pytest.mark.parametrize("half", [0, 1])
def test_the_verdict_does_not_depend_on_the_part_of_the_series(half):
    whole = prepared(*series("ur10_ipa_d.csv"))[1]
    count = len(whole.data)
    part = PoseStudy(whole.sheet, whole.machine, whole.data.only((np.arange(count) < count // 2) == (half == 0)))
    verdict = judge(select_families(part), [], [], fitted=False)
    assert verdict.kind == "partly"
    assert "frame_error" in verdict.causes
    # base and drives deflect nearly alike
    assert {"actuator_compliance", "base_compliance"}.intersection(verdict.causes)


def status(*arguments):
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    return end.value.code


def test_the_command_writes_its_files(tmp_path, capsys):
    arguments = [str(EXAMPLE / "readings.csv"), "--sheet", str(EXAMPLE / "sheet.toml"), "--out", str(tmp_path)]
    assert status("calibrate", *arguments, "--fit", "frame_error", "actuator_compliance") == 0
    assert "actuator_compliance.shoulder-lift" in capsys.readouterr().out
    names = {"calibration.json", "calibration.html", "calibrated-model.toml", "calibrated.urdf", "calibrated.xml"}
    assert {path.name for path in tmp_path.iterdir()} == names
    # what a controller takes is one command away
    capsys.readouterr()
    model, table = tmp_path / "calibrated-model.toml", tmp_path / "table.csv"
    assert status("export", str(model), "--format", "dh", "--out", str(table)) == 0
    assert "stands in the rows of shoulder-lift, elbow" in capsys.readouterr().out
    machine = load_model(model)
    for q in postures(machine, np.random.default_rng(0), 5):
        assert np.abs(end_of_file(table, q).astype(float) - end_of(machine, q)).max() < 1e-9
    assert status("calibrate", *arguments, "--fit", "frame_eror") == 2
    assert "frame_error" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("part", [JOINTS, CUBE])
def test_a_file_of_a_part_of_the_ur10s_postures_is_better_in_the_rest(part, tmp_path):
    _, found, there = judged(part, "readings.csv", tmp_path)
    assert found.written.valid_within
    assert [row.verdict for row in there] == [Worth.BETTER, Worth.BETTER]


@pytest.mark.slow
def test_the_whole_ur10_series(tmp_path):
    found = diagnose_poses(needed("ur10_ipa.csv"), _whole_sheet(tmp_path), tmp_path / "out")
    assert found.after.region_mm < 0.40


def _whole_sheet(folder):
    text = (EXAMPLE / "sheet.toml").read_text()
    (folder / "sheet.toml").write_text(text)
    return folder / "sheet.toml"


def test_springs_that_a_coupled_joint_follows_bend_as_their_derivatives_say(tmp_path):
    """Justin's chest keeps upright by two joints below, and passes on what these bend by."""
    (tmp_path / "justin.toml").write_text(toml_text(document()))
    (tmp_path / "sheet.toml").write_text(SHEET)
    joints = [f"{arm}_{k}" for arm in ("right", "left") for k in range(1, 8)]
    joints = ["torso_pan", "torso_tilt_1", "torso_tilt_2", *joints]
    names = [*(f"{name}.q_rad" for name in joints), *(f"{m}.{a}_mm" for m in ("right", "left") for a in "xyz")]
    rng = np.random.default_rng(5)
    q, y = rng.uniform(-0.8, 0.8, (30, len(joints))), rng.uniform(-500.0, 500.0, (30, 6))
    rows = [",".join(f"{v:.9f}" for v in row) for row in np.hstack([q, y])]
    (tmp_path / "readings.csv").write_text("\n".join([",".join(names), *rows]) + "\n")
    _, study = prepared(tmp_path / "readings.csv", tmp_path / "sheet.toml")
    forward, none = study.forward(("chest",)), np.zeros(len(study.members))
    at = forward.evaluate(none, study.frames)
    followed = [i for i, m in enumerate(study.members) if m.name.startswith("actuator_compliance.torso_tilt")]
    assert len(followed) == 2
    for i in followed:
        z = none.copy()
        z[i] = 1e-2
        change = -(forward.evaluate(z, study.frames).residual - at.residual)[..., :3] / z[i]
        # to second order in the turns, some 1e-2 of a milliradian
        assert np.nanmax(np.abs(change)) > 0.1
        assert np.nanmax(np.abs(change - at.member[..., :3, i])) < 1e-3 * np.nanmax(np.abs(change))


@pytest.mark.slow
def test_the_selection_of_justin(tmp_path):
    (tmp_path / "justin.toml").write_text(toml_text(document()))
    (tmp_path / "sheet.toml").write_text(SHEET)
    _, study = prepared(needed("justin.csv"), tmp_path / "sheet.toml")
    last = select_families(study).state
    named = {"frame_error", "actuator_compliance", "lateral_compliance", "coupling.chest"}
    assert named <= set(last.hypothesis.names)
    assert last.errors.means[1] < 2.9
    assert last.errors.means[2] < 2.9
    compliances = [
        z for z, member in zip(last.z, study.members, strict=True) if member.family.endswith("_compliance")
    ]
    assert np.min(compliances) >= -1e-6
