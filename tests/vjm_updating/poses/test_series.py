"""Several series in one fit: frames of their own, shared numbers, their scatter; series that are cut at changes."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.command import refused, validate
from helpers.from_files import prepared
from helpers.weighed_arm import compliant, drawn, files, measured
from hidden_effects.poses.changes import run as run_changes
from hidden_effects.poses.injector import Hidden, rest
from hidden_effects.poses.robots import UR10
from hidden_effects.poses.series import run as run_robot
from hidden_effects.poses.series import scored

from vjm_updating import calibrate, diagnose, load_data
from vjm_updating.inference.significance import Worth
from vjm_updating.poses.changes import ChangeKind, ChangePoint, cut
from vjm_updating.poses.document import lines, of_asked
from vjm_updating.poses.pooled import PooledStudy, ScatteredBlocks, between
from vjm_updating.poses.state import Hypothesis

SPRINGS = ("actuator_compliance",)


def made(folder, seed, count=50, moved=None):
    """A series with its own tracker; from ``moved`` on the marker stands elsewhere."""
    q = drawn(seed, count)
    y = measured(compliant(), q, seed)
    if moved is not None:
        # the same robot, the marker 3 mm further along the tracker's axes: its frame has moved
        y[moved:] += [3.0, -2.0, 1.0]
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return files(folder, q, y @ turned.T + [100.0 * seed, 5.0, -300.0])


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    folder = tmp_path_factory.mktemp("two")
    return [made(folder / "a", 31), made(folder / "b", 32, 40)]


@pytest.mark.slow
def test_series_have_frames_of_their_own_and_share_the_machine(two):
    found = calibrate([load_data(*one) for one in two], fit=SPRINGS).figures
    assert [(row.file, row.postures) for row in found.series] == [
        ("readings.csv (1)", 50),
        ("readings.csv (2)", 40),
    ]
    assert found.after.series_mm < 0.3 * found.before.series_mm
    where = {row.where: row.verdict for row in found.written.compared if row.against == "the sheet's model"}
    assert where["held out by series"] == Worth.BETTER
    assert not found.written.refused
    for member in found.families[0].members:
        true = dict(zip([f"joint-{i}" for i in range(1, 7)], compliant().own, strict=True))
        assert member.interval95[0] <= true[member.name.partition(".")[2]] <= member.interval95[1]
        assert member.interval95[0] <= member.within_series95[0]
        assert member.within_series95[1] <= member.interval95[1]
    assert any("of a new series" in line and "these 2" in line for line in lines(found))


@pytest.mark.slow
def test_one_series_says_that_a_prior_stands_for_the_scatter(two):
    found = calibrate(load_data(*two[0]), fit=SPRINGS).figures
    assert found.after.series_mm is None
    assert any("is a prior's" in line for line in lines(found))
    known = [m for m in found.families[0].members if m.identifiable]
    assert all(m.scatter > 0.0 for m in known)


@pytest.mark.slow
def test_frames_of_one_series_have_no_scatter_that_one_series_cannot_know(two):
    found = calibrate(load_data(*two[0]), fit=("frame_error",)).figures
    assert all(m.interval95 == m.within_series95 and m.scatter == 0.0 for m in found.families[0].members)


def test_deviations_are_integrated_out_as_a_dense_covariance_does_it(two):
    """``Jᵀ (1 + Σ G T Gᵀ)⁻¹ J`` with the dense covariance of all readings, whole and without a region."""
    studies = [prepared(*one)[1] for one in two]
    study = PooledStudy(studies, [0, 1])
    state, scatter = between(study, study.gauss_newton(Hypothesis(SPRINGS)))
    blocks = state.blocks
    assert isinstance(blocks, ScatteredBlocks)
    assert set(scatter.chance) == set(SPRINGS)
    variance = np.zeros(len(blocks.b))
    variance[blocks.nuisances :][[m.family in SPRINGS for m in study.members]] = 0.3
    own = replace(blocks, variance=variance)
    for without in (np.zeros(len(blocks.y), dtype=bool), blocks.posture < 7):
        J, y, series = blocks.J[~without], blocks.y[~without], blocks.series[~without]
        K = np.eye(len(y))
        for s in (0, 1):
            G = J[:, variance > 0.0] * (series == s)[:, None]
            K += G @ (0.3 * G.T)
        N, b, c = own.integrated(without)
        dense = np.linalg.solve(K, np.column_stack([J, y]))
        scale = np.sqrt(np.maximum(np.diag(N), 1e-300))
        assert np.abs((N - J.T @ dense[:, :-1]) / np.outer(scale, scale)).max() < 1e-9  # rounding of 200 numbers
        assert np.allclose(b, J.T @ dense[:, -1], atol=1e-9 * scale * np.linalg.norm(y))
        assert y @ y - c == pytest.approx(y @ dense[:, -1], rel=1e-9)


def test_scatter_is_that_of_balanced_groups():
    """Of n series with one number each and much data, τ² is nearly the variance of the numbers."""
    from vjm_updating.poses import pooled as module

    rng = np.random.default_rng(4)
    values = rng.normal(0.0, 0.5, 200)
    total = 1e-4 + np.array(module.RATIOS)[:, None] ** 2
    log = -0.5 * np.sum(np.log(total) + values**2 / total, axis=1)
    chance = module._chance(log, module.CHANGES)
    ratios = np.array(module.RATIOS)
    assert ratios[np.argmax(chance)] == ratios[np.argmin(np.abs(ratios - values.std()))]


@pytest.mark.slow
def test_a_series_is_cut_where_the_tracker_moved(tmp_path):
    where = made(tmp_path, 33, 70, moved=30)
    result = calibrate(load_data(*where), fit=SPRINGS)
    (change,) = result.figures.changes
    assert (change.row, change.fitted) == (32, True)
    assert [row.postures for row in result.figures.series] == [30, 40]
    assert result.figures.after.series_mm is None  # the parts are of one series
    assert result.figures.after.fitted_mm < 0.15  # noise of 0.05 mm a coordinate
    assert result.models["calibrated-model.toml"]


@pytest.mark.parametrize(
    ("change", "anew"),
    [
        ((ChangeKind.JOINT_ZERO, "joint-3", 30, np.array([2e-3]), 99.0, 0.5), 2),
        ((ChangeKind.SHIFT, "", 30, np.ones(3), 99.0, 0.5), 3),
        ((ChangeKind.FRAME, "", 30, np.ones(6), 99.0, 0.5), 6),
        ((ChangeKind.MARKER, "target", 30, np.ones(3), 99.0, 0.5), 3),
    ],
)
def test_a_part_has_only_what_changed_as_its_own(tmp_path, change, anew):
    """Six of the tracker and three of the marker are one series'; a zero is each part's, off the shared one."""
    study = prepared(*made(tmp_path, 36, 70))[1]
    parts, left_out = cut(study, [ChangePoint(study, *change)])
    assert isinstance(parts, PooledStudy)
    assert not left_out
    assert parts.forward().nuisances == 9 + anew
    # where nothing changed in truth, the parts predict what the whole does, and derivatives agree with differences
    state, whole = parts.gauss_newton(Hypothesis()), study.gauss_newton(Hypothesis())
    # further numbers save squared errors, weighed by other weights, and not quite mean distances
    assert state.errors.means[0] <= 1.001 * whole.errors.means[0]
    forward, z = parts.forward(), state.z
    at = forward.evaluate(z, state.frames)
    for u in range(forward.nuisances):
        step = np.zeros(forward.nuisances)
        step[u] = 1e-5
        moved = [forward.evaluate(z, forward.moved(state.frames, way * step)).residual for way in (1.0, -1.0)]
        slope = (moved[1] - moved[0]) / 2e-5
        seen = np.isfinite(slope)
        # central: 1e-10 of third derivatives, and 1e-13 of a metre over the step
        assert np.abs(slope - at.nuisance[..., u])[seen].max() < 1e-6 * (1.0 + np.abs(at.nuisance[..., u]).max())


@pytest.mark.slow
def test_a_change_that_is_fitted_leaves_the_verdict(tmp_path):
    found = diagnose(load_data(*made(tmp_path, 34, 90, moved=40)), only=SPRINGS).figures
    assert found.verdict == "named"
    assert found.causes == ["actuator_compliance"]
    assert [change.fitted for change in found.changes] == [True]


@pytest.mark.slow
def test_errors_are_predicted_where_they_are_asked_for(two, tmp_path):
    near = tmp_path / "near.csv"
    header = ",".join(f"joint-{i}.q_rad" for i in range(1, 7))
    near.write_text(f"{header}\n0.1,0.4,-0.3,0.2,0.1,0\n0.1,0.4,-0.3,0.2,0.1,3.5\n")
    asked = calibrate([load_data(*one) for one in two], fit=SPRINGS, asked=near).figures.asked_for
    assert [row.supported for row in asked.places] == [True, False]
    assert "joint-6" in asked.places[1].reason
    assert asked.with_mm < asked.without_mm
    # the weight of the tool bends the model's rigid joints by the hidden compliances: a millimetre or so
    assert asked.with_mm < asked.most_mm


@pytest.mark.slow
def test_a_place_has_one_likely_configuration(two):
    end = rest(UR10, Hidden.nothing(6), np.array([[0.1, 0.4, -0.3, 0.2, 0.1, 0.0]]))[0, :3, 3]
    place = ",".join(f"{axis}={v:.0f}" for axis, v in zip("xyz", end, strict=True))
    found = calibrate([load_data(*one) for one in two], fit=SPRINGS, asked=place).figures
    row = found.asked_for
    assert row.asked == sum(one.likely for one in row.places) == 1 < len(row.places)
    (said,) = of_asked(found)
    assert "nearest to a measured posture" in said


@pytest.mark.parametrize("seed", [5007, 5012])
def test_three_changes_in_a_file_are_found(tmp_path, seed):
    """Of a load cell's zero in 5007; of a marker, a joint's zero and the tracker in 5012."""
    hidden, found = run_changes(seed, tmp_path)
    assert len(hidden) == 3
    assert scored([row for row, _ in hidden], [row for row, _ in found]) == (3, 0)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--for", "x=100"], "y, z is missing"),
        (["--for", "x=100,y=ten,z=3"], "'y=ten' is no place"),
        (["--for", "x=90000,y=0,z=0"], "no posture reaches there"),
    ],
)
def test_places_that_cannot_be_used(two, tmp_path, words, said):
    data, sheet = two[0]
    assert said in validate("calibrate", data, "--sheet", sheet, "--out", tmp_path / "o", *words, status=2).err
    assert not (tmp_path / "o").exists()


def test_sheets_are_one_or_as_many_as_the_series(two, tmp_path):
    data = [str(one[0]) for one in two]
    sheets = [str(two[0][1])] * 3
    assert "3 sheets for 2 data files" in refused("calibrate", *data, "--sheet", *sheets, "--out", tmp_path / "o")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [930001, 930002])
def test_a_file_by_series_is_not_worse_on_another_one(tmp_path, seed):
    outcome = run_robot(seed, tmp_path, 2)
    assert outcome.worth != Worth.WORSE
