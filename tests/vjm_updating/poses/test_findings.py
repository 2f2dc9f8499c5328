"""What data of poses can know, and what they say of it: robots by the energy minimiser."""

import math
import warnings

import numpy as np
import pytest
from helpers.from_files import calibrate_poses, diagnose_poses, prepared
from helpers.weighed_arm import GRAVITY, OWN, compliant, drawn, files, measured
from hidden_effects.poses.injector import Hidden, rest
from hidden_effects.poses.plan import NOISE
from hidden_effects.poses.robots import UR10, document

from vjm.io.model_file import build_chain, load_chain
from vjm.machine.equilibria import equilibria
from vjm.model.mechanism import Mechanism
from vjm.rotations import rotation_from_vector
from vjm_updating.poses.changes import changes
from vjm_updating.poses.families import LARGEST_COMPLIANCE
from vjm_updating.poses.held_out import as_good, chance, ends_of, halves
from vjm_updating.poses.identifiability import estimates
from vjm_updating.poses.plausibility import factor_between
from vjm_updating.poses.run import pose_findings
from vjm_updating.poses.selection import Selection, select_families, step_of, with_needed
from vjm_updating.poses.state import Hypothesis
from vjm_updating.poses.study import worst_over_mean
from vjm_updating.poses.verdict import at_bounds, contrasts, judge


@pytest.mark.parametrize(
    ("q", "worst"),
    [
        (np.linspace(-np.pi, np.pi, 400, endpoint=False), 1.0),  # an orthogonal basis: the same everywhere
        (np.linspace(0.0, np.pi, 4001), 9.65),
        (np.linspace(-1.0, 1.0, 4001), 59.05),
    ],
)
def test_a_wave_is_known_where_the_angles_cover_the_turn(q, worst):
    # by quadrature: M = mean of b bᵀ with b = (1, sin, cos); the largest bᵀ M⁻¹ b / 3
    b = np.stack([np.ones_like(q), np.sin(q), np.cos(q)])
    M = np.array([[np.trapezoid(x * y, q) / np.ptp(q) for x in b] for y in b])
    turn = np.linspace(0.0, 2.0 * np.pi, 2000)
    B = np.stack([np.ones_like(turn), np.sin(turn), np.cos(turn)])
    exact = float((B * np.linalg.solve(M, B)).sum(axis=0).max()) / 3.0
    assert worst_over_mean(q) == pytest.approx(exact, rel=0.01)  # sums of 400 and more points
    assert exact == pytest.approx(worst, rel=0.02)


def test_functions_of_an_angle_that_covers_little_of_its_turn_are_not_asked(tmp_path):
    q = drawn(8, 60) * [1.5, 1.0, 0.5, 1.0, 1.0, 1.0]
    where = files(tmp_path, q, measured(Hidden.nothing(6), q))
    _, study = prepared(*where)
    asked = {m.subject for m in study.members if m.family in ("gear_error", "encoder_scale")}
    assert asked == {"joint-1", "joint-2", "joint-4", "joint-5", "joint-6"}
    reason = {one.name: one.reason for one in study.unasked}
    assert "cover too little of a turn" in reason["gear_error.joint-3"]
    narrow = files(tmp_path / "narrow", 0.3 * drawn(8, 60), measured(Hidden.nothing(6), 0.3 * drawn(8, 60)))
    with pytest.raises(ValueError, match=r"these postures cannot know 'gear_error': its angles, .* leave it out"):
        diagnose_poses(*narrow, tmp_path / "out", only=("gear_error",))


def test_a_joint_whose_torque_does_not_change_is_not_asked(springs):
    _, _, study, _ = springs
    asked = {m.subject for m in study.members if m.family == "actuator_compliance"}
    reason = {one.name: one.reason for one in study.unasked}
    torque = bearing_of(study).std(axis=0)
    # the vertical axis: differences of the energy err by 1e-9 of 1e5 N mm
    assert [f"joint-{k + 1}" in asked for k in range(6)] == [bool(one > 1e-3) for one in torque]
    assert "joint-1" not in asked
    assert "its torque does not change" in reason["actuator_compliance.joint-1"]


def test_chance_is_that_of_mean_squares():
    rng = np.random.default_rng(4)
    squares = rng.chisquare(10.0, 4000) / 10.0
    # quantiles of chi² with ten degrees of freedom over ten, by tables
    assert chance(1.831, squares) == pytest.approx(0.05, rel=0.1)
    assert chance(2.959, squares) == pytest.approx(0.001, rel=0.3)


def bearing_of(study):
    """Torques of the weight on the joints ``(g, 6)``: differences of the minimiser's potential."""
    from hidden_effects.poses.injector import frames

    result = []
    for i in range(6):
        sides = []
        for step in (1e-5, -1e-5):
            q = study.data.q.copy()
            q[:, i] += step
            sides.append(frames(UR10, Hidden.nothing(6), q, np.zeros((len(q), 21)))[1])
        result.append((sides[0] - sides[1]) / 2e-5)
    return np.column_stack(result)


def test_compliances_are_bounded_by_what_is_built(springs):
    _, _, study, _ = springs
    kind = {"actuator_compliance": "drive", "lateral_compliance": "bearing", "base_compliance": "bearing"}
    for member in study.members:
        if member.family in kind:
            value, unit, reason = LARGEST_COMPLIANCE[kind[member.family]]
            assert (member.value(member.high), member.unit) == (pytest.approx(value, rel=1e-12), unit)
            assert reason


def test_a_joint_that_wants_to_be_stiffer_than_rigid_is_a_finding(springs, tmp_path):
    _, _, study, state = springs
    assert not list(at_bounds(study, estimates(study, state)))
    q = drawn(8)
    where = files(tmp_path, q, measured(compliant([0.0, 1.5e-8, -1e-8, 0.0, 0.0, 0.0]), q))
    _, study = prepared(*where)
    state = study.gauss_newton(Hypothesis(("actuator_compliance",)))
    said = list(at_bounds(study, estimates(study, state)))
    assert [one.where for one in said] == ["readings.csv, actuator_compliance.joint-3"]
    assert "stiffer than rigid" in said[0].description
    row = next(row for row in estimates(study, state) if row.name == "actuator_compliance.joint-3")
    assert (row.value, row.interval95[0]) == (0.0, 0.0)
    assert row.interval95[1] > 0.0


def test_halves_cover_and_a_change_between_them_is_a_drift(springs, tmp_path):
    _, _, study, state = springs
    still = halves(study, state, estimates(study, state))
    # 60 halvings of one test, of two members and more: not independent
    assert still.random > 0.8
    assert not still.differ
    q, y = study.data.q, study.data.position[:, 0]
    softer = compliant(2.0 * OWN)
    y = np.where(np.arange(len(q))[:, None] < len(q) // 2, y, measured(softer, q))
    _, changed = prepared(*files(tmp_path, q, y))
    later = changed.gauss_newton(Hypothesis(("actuator_compliance",)))
    found = halves(changed, later, estimates(changed, later))
    assert found.differ
    assert found.file < found.random
    name, by = next(iter(found.members.items()))
    assert name in ("actuator_compliance.joint-2", "actuator_compliance.joint-3")
    assert by > 3.0  # softer in the second half


def test_where_a_drift_is_found_the_remainder_and_the_next_step_follow_it(springs, tmp_path):
    _, _, study, _ = springs
    q, course = study.data.q, np.linspace(0.0, 1.0, len(study.data))[:, None]
    # the joints soften evenly in the course of the file; deflections of milliradians are linear in them
    y = (1.0 - course) * study.data.position[:, 0] + course * measured(compliant(2.0 * OWN), q)
    found = diagnose_poses(*files(tmp_path, q, y), tmp_path / "out", only=("actuator_compliance",))
    assert [row.found for row in found.doubts if row.found.startswith("drift")]
    assert found.remainder.kind == "drift"
    # noise is a twentieth; outliers' weights, and joints that are not asked, take up some of the rest
    assert found.remainder.share > 0.75
    assert found.next.startswith("The halves of the file differ")


def test_one_side_is_asked_of_drives_that_are_needed(springs):
    _, _, study, whole = springs
    state = with_needed(study, whole)
    asked = {one.name for one in contrasts(study, state) if one.kind == "one side"}
    own = {
        m.subject
        for m in study.members
        if m.family == "actuator_compliance" and m.name not in state.hypothesis.kept
    }
    assert asked == {f"size of the torque of {joint}, not its sign" for joint in own}
    assert {"joint-2", "joint-3"} <= own
    assert "joint-1" not in own  # upright


def test_ends_are_fifths_of_every_range(springs):
    _, _, study, _ = springs
    ends = ends_of(study)
    assert len(ends) == 2 * 6 + 2  # and the order of the file
    for own, column in zip(ends[:12:2], study.data.q.T, strict=True):
        assert own.mean() == pytest.approx(0.2, abs=0.011)  # of 100 postures
        assert column[own].max() < column[~own].min()


def test_masses_do_not_stand_for_the_compliances_that_they_act_through(tmp_path):
    content = document(UR10)
    for part, wrong in zip(
        (p for p in content["parts"] if "mass_kg" in p), (1.0, 0.6, 1.4, 0.7, 1.4, 0.7), strict=False
    ):
        part["mass_kg"] *= wrong
    q = drawn(8, 150)
    _, study = prepared(*files(tmp_path, q, measured(compliant(2.0 * OWN), q), content=content))
    state = study.gauss_newton(Hypothesis(("actuator_compliance", "gravity")))
    # at the compliant state the masses' columns make up for the compliances; on a rigid machine they have none
    without = Hypothesis(("gravity",))
    assert as_good(study.tried(state, without)[1], state.errors, state.sigma)
    found = select_families(study, ["actuator_compliance", "gravity"])
    assert "actuator_compliance" in found.state.hypothesis.families
    assert sum(h.probability for h in found.weighed() if "actuator_compliance" not in h.places) < 1e-6


@pytest.mark.slow
def test_without_gravity_nothing_bends_and_nothing_warns(tmp_path):
    hidden = Hidden.nothing(6)
    hidden.shift = np.random.default_rng(2).normal(0.0, 0.5, (6, 3))
    q = drawn(8, 60)
    where = files(tmp_path, q, measured(hidden, q), gravity="0.0")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = diagnose_poses(*where, tmp_path / "out", only=("frame_error", "joint_offset"))
    assert found.causes == ["frame_error"]
    _, study = prepared(*where)
    assert not [m for m in study.members if m.kind == "compliance"]
    usual = calibrate_poses(*where, tmp_path / "usual")
    assert [family.name for family in usual.families] == ["frame_error"]
    assert "actuator_compliance.joint-2" in {row.name for row in usual.not_known}
    same = diagnose_poses(*where, tmp_path / "same", only=("frame_error",), without=("actuator_compliance",))
    assert same.causes == ["frame_error"]


SPRING = {
    "name": "compensator", "between": ["", "link-2"], "points_mm": [[150.0, 0.0, 250.0], [-250.0, 0.0, 80.0]],
    "stiffness_N_per_mm": 20.0, "free_length_mm": 300.0, "preload_N": 400.0,
}  # fmt: skip


def by_the_tree(content, q, seed=9):
    """Positions of the target on the machine of a document, as read."""
    found = equilibria(Mechanism(build_chain(content, "model").split()), q, gravity=GRAVITY, compliance=False)
    place = found.position[:, 0] + found.rotation[:, 0] @ [40.0, -25.0, 60.0]
    view = rotation_from_vector([0.3, -0.2, 1.1])
    return place @ view.T + [900.0, -2000.0, 400.0] + np.random.default_rng(seed).normal(0.0, NOISE, (len(q), 3))


@pytest.fixture(scope="module")
def compensated():
    """A robot with compliant joints and a spring between its base and its second link."""
    content = document(UR10) | {"point_springs": [SPRING]}
    for part, c in zip((p for p in content["parts"] if p["kind"] == "actuated"), OWN, strict=True):
        part["compliance_rad_per_Nmm"] = float(c)
    q = drawn(21, 100, 2.4)
    return q, by_the_tree(content, q)


def test_a_spring_between_points_of_the_model_is_known(compensated, tmp_path):
    q, y = compensated
    content = document(UR10) | {"point_springs": [SPRING]}
    where = files(tmp_path, q, y, content=content)
    found = calibrate_poses(*where, tmp_path / "out", families=("actuator_compliance",))
    # the noise alone makes 0.08 mm; 100 readings of three numbers
    assert found.after.random_mm == pytest.approx(NOISE * math.sqrt(8.0 / math.pi), rel=0.15)
    assert found.written.file_mm == pytest.approx(found.after.fitted_mm, rel=0.05)
    row = next(row for row in found.families[0].members if row.name == "actuator_compliance.joint-2")
    assert row.interval95[0] < OWN[1] < row.interval95[1]
    spring = load_chain(tmp_path / "out/calibrated-model.toml").point_springs[0]
    assert (spring.stiffness, spring.preload) == (20.0, 400.0)


@pytest.mark.slow
def test_a_spring_that_the_model_lacks_is_not_taken_for_the_gears(compensated, tmp_path):
    found = diagnose_poses(*files(tmp_path, *compensated), tmp_path / "out")
    assert found.verdict != "named"
    named = [name for row in found.alternatives for name in row]
    assert "point_spring.joint-2" in named or found.verdict in ("unknown", "partly")
    assert "no further test is needed" not in found.next


def test_a_spring_between_points_shares_the_probability_of_the_gears_that_it_stands_for(compensated, tmp_path):
    _, study = prepared(*files(tmp_path, *compensated))
    selection = Selection(study, study.families)
    selection.steps = [
        step_of(study, "", study.gauss_newton(Hypothesis(names)))
        for names in ((), ("actuator_compliance", "gear_error"))
    ]
    found = pose_findings(selection, judge(selection, [], [], fitted=False))
    spring = "point_spring.joint-2"
    rows = {row.cause: row.probability for row in found.causes}
    assert rows[spring] == rows["gear_error"]


@pytest.mark.slow
def test_a_mistaken_sign_does_not_stand_alone_where_more_is_wrong(tmp_path):
    hidden = compliant(5.0 * OWN)
    q = drawn(8, 60)
    flipped = q * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]
    found = diagnose_poses(*files(tmp_path / "more", flipped, measured(hidden, q)), tmp_path / "out")
    said = next(row.found for row in found.doubts if row.found.startswith("joint_sign.joint-3"))
    assert "that is not all that is wrong" in said
    alone = files(tmp_path / "alone", flipped, measured(Hidden.nothing(6), q))
    found = diagnose_poses(*alone, tmp_path / "out")
    said = next(row.found for row in found.doubts if row.found.startswith("joint_sign.joint-3"))
    assert "that is not all" not in said


@pytest.mark.slow
def test_findings_are_judged_on_another_series(tmp_path):
    first, other = drawn(8), drawn(31, 60)
    where = files(tmp_path / "a", first, measured(compliant(), first))
    beside = files(tmp_path / "b", other, measured(compliant(), other, seed=3))
    found = diagnose_poses(*where, tmp_path / "out", only=("actuator_compliance", "frame_error"), beside=[beside])
    assert (found.verdict, found.causes) == ("named", ["actuator_compliance"])
    assert found.beside == ["readings.csv"]
    before, after = (found.selection[k].beside_mm[0] for k in (0, -1))
    floor = NOISE * math.sqrt(8.0 / math.pi)
    # members of 100 readings, predicted on 60 others
    assert after == pytest.approx(floor, rel=0.15)
    assert before > 3.0 * after
    stiffer = files(tmp_path / "c", other, measured(Hidden.nothing(6), other, seed=3))
    found = diagnose_poses(*where, tmp_path / "out", only=("actuator_compliance",), beside=[stiffer])
    assert found.causes == []
    assert [row.name for row in found.refused] == ["actuator_compliance"]
    assert found.refused[0].reason.startswith("the other series are predicted worse with it, by")


def test_rest_of_an_own_truth():
    # the minimiser of this file's truths and the tree agree, compliance and all
    q = drawn(5, 5)
    content = document(UR10)
    for part, c in zip((p for p in content["parts"] if p["kind"] == "actuated"), OWN, strict=True):
        part["compliance_rad_per_Nmm"] = float(c)
    there = equilibria(Mechanism(build_chain(content, "model").split()), q, gravity=GRAVITY, compliance=False)
    # differences of the energy err by 1e-9 of the torque
    assert np.abs(there.position[:, 0] - rest(UR10, compliant(), q)[:, :3, 3]).max() < 2e-6


def test_a_factor_between_two_quantities_with_errors():
    """Drawn with errors in both it lies between its bounds; what few or unlike readings say is not known."""
    rng, inside, known = np.random.default_rng(8), 0, 0
    for _ in range(400):
        true = rng.normal(0.0, 1.0, 40)
        x, y = true + rng.normal(0.0, 0.6, 40), -3.0 * (true + rng.normal(0.0, 0.6, 40))
        slope, low, high = factor_between(x, y, 0.05)
        inside += low <= 3.0 <= high
        known += slope < 0.0 < low
    assert inside >= 0.95 * 400
    assert known == 400
    # of numbers that have nothing to do with each other one in twenty has a sign; four standard errors of that
    unlike = [factor_between(*rng.normal(0.0, 1.0, (2, 12)), 0.05)[1] > 0.0 for _ in range(400)]
    assert 20 - 4 * 4.4 < sum(unlike) < 20 + 4 * 4.4
    assert factor_between(np.ones(2), np.ones(2), 0.05)[1:] == (0.0, np.inf)
    slope, low, high = factor_between(np.arange(5.0), 2.0 * np.arange(5.0), 0.05)
    assert (slope, low, high) == pytest.approx((2.0, 2.0, 2.0))


@pytest.mark.slow
def test_several_changes_of_a_file_are_named(tmp_path):
    """The zero of a joint, the tracker, and back: each with its row and size, in a calibration and its document."""
    q = drawn(601, 120)
    turned = q + np.where(np.arange(120) >= 30, 2e-3, 0.0)[:, None] * np.eye(6)[2]
    step = np.array([2.0, -1.5, 1.0])
    y = (
        measured(compliant(), turned)
        + np.where((np.arange(120) >= 60) & (np.arange(120) < 95), 1.0, 0.0)[:, None] * step
    )
    y[10] += [8.0, 0.0, 0.0]  # an outlier is no change
    found = calibrate_poses(*files(tmp_path, q, y), tmp_path / "out", families=("actuator_compliance",), force=True)
    assert [(one.kind, one.name) for one in found.changes] == [
        ("joint zero", "joint-3"),
        ("shift", ""),
        ("shift", ""),
    ]
    assert [one.row for one in found.changes] == pytest.approx([32, 62, 97], abs=3)  # lines of the file
    zero, there, back = found.changes
    # an offset of a joint is turned the other way than its command
    assert abs(zero.size[0]) == pytest.approx(2e-3, rel=0.2)
    assert there.size == pytest.approx(step, abs=0.3)
    assert back.size == pytest.approx(-step, abs=0.3)
    said = [row.found.partition(":")[0] for row in found.doubts]
    assert {"zero_moved", "tracker_jump"} <= set(said)


@pytest.mark.parametrize("seed", range(602, 608))
def test_no_change_is_invented(seed, tmp_path):
    """Gears err by a third wave, which is not asked, and two readings are outliers."""
    rng = np.random.default_rng(seed)
    q = drawn(seed, int(rng.integers(60, 160)))
    y = measured(compliant(), q + 1e-4 * np.cos(3.0 * q + rng.uniform(0.0, 6.0, 6)), seed)
    y[rng.choice(len(q), 2, replace=False)] += rng.normal(0.0, 5.0, (2, 3))
    _, study = prepared(*files(tmp_path, q, y))
    assert changes(study, study.gauss_newton(Hypothesis(("actuator_compliance",)))) == []
