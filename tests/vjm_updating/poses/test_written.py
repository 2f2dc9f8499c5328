"""Which drives are needed, and what is written: the file is what was judged. Robots by the energy minimiser."""

import numpy as np
import pytest
from helpers.from_files import calibrate_poses, diagnose_poses, prepared
from helpers.weighed_arm import GRAVITY, OWN, compliant, drawn, files, measured
from hidden_effects.poses.injector import Hidden, measure
from hidden_effects.poses.plan import NOISE
from hidden_effects.poses.robots import HEAVY, UR10, document

from vjm.io.model_file import load_chain
from vjm.machine.equilibria import equilibria
from vjm.model.mechanism import Mechanism
from vjm_updating.poses.identifiability import estimates
from vjm_updating.poses.machine import LATERAL
from vjm_updating.poses.pose_study import kabsch
from vjm_updating.poses.selection import with_needed
from vjm_updating.poses.state import Hypothesis
from vjm_updating.poses.written import written


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


def test_drives_that_are_not_needed_keep_the_models_value(springs, tmp_path):
    """Rigid wrists: the readings are as probable without them, and what is held out is predicted as well."""
    q = drawn(8)
    where = files(tmp_path, q, measured(compliant([0.0, 1.2e-8, 1.5e-8, 0.0, 0.0, 0.0]), q))
    _, study = prepared(*where)
    whole = study.settle(Hypothesis(("actuator_compliance",)))
    kept = with_needed(study, whole).hypothesis.kept
    # of the noise one in some may be taken for a drive that is needed
    assert kept
    assert {name.partition(".")[2] for name in kept} <= {"joint-4", "joint-5", "joint-6"}
    less = study.settle(Hypothesis(("actuator_compliance",), kept=kept))
    # no worse by more than the standard error of the paired differences, some half a per cent
    assert less.errors.means[1] < 1.01 * whole.errors.means[1]
    for name in ("joint-2", "joint-3"):
        without = study.settle(Hypothesis(("actuator_compliance",), kept=(*kept, f"actuator_compliance.{name}")))
        assert without.errors.means[1] > 1.5 * whole.errors.means[1], name
    found = calibrate_poses(*where, tmp_path / "out", families=("actuator_compliance",))
    reasons = {row.name: row.reason for row in found.not_known}
    assert all(reasons[name] == "the readings are as probable without it" for name in kept)
    joints = {part.name: part.compliance for part in load_chain(tmp_path / "out/calibrated-model.toml").held_joints}
    assert {joints[name.partition(".")[2]] for name in kept} == {1e-9}  # the model's own


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
    state = study.settle(Hypothesis(chosen))
    out = written(measurement, study, study.settle(Hypothesis()), state, estimates(study, state))
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
