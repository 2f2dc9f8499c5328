"""What a test's files say when they are right."""

from pathlib import Path

import numpy as np
import pytest
from helpers.command import GAUGE_SHEET

from vjm_updating.experiment import Kind, read_measurement
from vjm_updating.inference.observed import smoothed

from .conftest import Draft


def test_a_measurement_is_what_its_files_say(draft: Draft):
    found = draft.read()
    assert found.imposed
    assert found.engine.label == "vjm-8"
    assert found.readings.channels == ("ux_mm", "fx_N", "mx_Nmm")
    assert len(found.readings) == 26
    assert found.readings.row[0] == 2  # the header is line 1
    assert set(found.readings.posture) == {"A", "B"}
    np.testing.assert_allclose(found.readings.pose[12], [-2.0, 0, 0, 0, 0, 0])
    assert found.readings.wrench[12, 0] < -6000.0
    assert np.isnan(found.readings.wrench[:, 1]).all()  # no column: not measured


def test_nuisances_are_those_that_have_a_sigma(draft: Draft):
    found = {(n.kind, n.subject): n.sigma for n in draft.read().nuisances}
    assert found == {
        (Kind.ZERO, "ux_mm"): 0.002,
        (Kind.SCALE, "ux_mm"): 0.001,
        (Kind.ZERO, "fx_N"): 3.0,
        (Kind.SCALE, "fx_N"): 0.003,
        (Kind.LENGTH, "link"): 0.2,
        (Kind.MODULUS, "foot"): 0.02,
        (Kind.MODULUS, "link"): 0.02,
    }


def test_a_blank_is_a_missed_sample(draft: Draft):
    draft.rows[3][3] = ""
    readings = draft.read().readings
    assert np.isnan(readings.wrench[3, 0])
    assert not np.isnan(readings.wrench[3, 3])


def test_comments_and_spaces_are_let_through(draft: Draft):
    draft.rows[0][0] = " 0.0 "
    data, sheet = draft.write()
    data.write_text("# taken on a cold day\n" + data.read_text())
    assert len(read_measurement(data, sheet).readings) == 26


@pytest.mark.parametrize(
    ("line", "part", "key", "value"),
    [
        ("actuator_compliance_mm_per_N = 2e-6", "actuator", "compliance_mm_per_N", 2e-6),
        ("length_mm = 305.0", "link", "length_mm", 305.0),
        ('"parts.foot.length_mm" = 150.0', "foot", "length_mm", 150.0),
        ("foot.section.EA_N = 8e7", "foot", ("section", "EA_N"), 8e7),
        ("parts.5.section.EIz_Nmm2 = 4.0e7", "link", ("section", "EIz_Nmm2"), 4.0e7),
        ("EIz_Nmm2 = 4.1e7", "link", ("section", "EIz_Nmm2"), 4.1e7),
        ("section.EIz_Nmm2 = 4.2e7", "link", ("section", "EIz_Nmm2"), 4.2e7),
    ],
)
def test_the_sheet_overrides_the_model(draft: Draft, line: str, part: str, key, value: float):
    draft.sheet = draft.sheet.replace("link_segments = 8", f"link_segments = 8\n{line}")
    document = draft.read().document
    found = next(p for p in document["parts"] if p["name"] == part)
    for step in (key,) if isinstance(key, str) else key:
        found = found[step]
    assert found == value


def test_one_segment_is_the_papers_spring(draft: Draft):
    draft.sheet = draft.sheet.replace("link_segments = 8", "link_segments = 1\nfoot_segments = 4")
    engine = draft.read().engine
    assert engine.segments is None
    assert engine.foot_segments == 4


@pytest.mark.parametrize(
    ("section", "area"),
    [
        ('section = "square_tube"\nwidth_mm = 6.35\nwall_mm = 1.5875', 6.35**2 - (6.35 - 2 * 1.5875) ** 2),
        ('section = "round_bar"\ndiameter_mm = 6.35', 0.25 * np.pi * 6.35**2),
    ],
)
def test_another_section_replaces_the_models(draft: Draft, section: str, area: float):
    draft.sheet = f"""
[test]
model = "pinned-column"
[model]
{section}
[postures]
straight = []
[instrument.fx_N]
noise = 1.0
"""
    draft.header = ["posture", "ux_mm", "fx_N"]
    draft.rows = [["straight", f"{-0.001 * k}", f"{-7.0 * k}"] for k in range(20)]
    found = draft.read()
    (beam,) = found.chain.beams
    assert beam.section is not None
    # E times the area, with rounding
    assert beam.section.EA == pytest.approx(68948.0 * area, rel=1e-12)
    assert list(found.chain.postures["straight"]) == [0.0, 0.0]


def test_a_posture_may_name_its_joints_as_in_a_model_file(draft: Draft):
    row = draft.read().chain.postures["B"]
    given = "B = {q4 = 0.0, q2 = 0.5235987755982988, q1 = 0.0, q3 = -0.5235987755982988}"
    draft.sheet = draft.sheet.replace("B = [0.0, 0.5235987755982988, -0.5235987755982988, 0.0]", given)
    assert list(draft.read().chain.postures["B"]) == list(row)
    draft.sheet = draft.sheet.replace("q4 = 0.0", "q5 = 0.0")
    with pytest.raises(ValueError, match=r"posture 'B': no joint 'q5' to be given; it has q1, q2, q3, q4"):
        draft.read()


def test_branches_are_read_off_the_history(draft: Draft):
    s = np.concatenate([np.linspace(0, -2, 9), np.full(4, -2.0), np.linspace(-1.75, 1, 12), np.full(3, 1.0)])
    draft.header = ["posture", "ux_mm", "fx_N"]
    draft.rows = [["A", f"{v}", f"{3000.0 * v}"] for v in s]
    draft.sheet = draft.sheet.split("[instrument.mx_Nmm]")[0]
    found = draft.read().readings.ways("ux_mm", 0.001)
    # out, held, back to zero, out to the other side, held
    assert found.tolist() == [0.0] + [1.0] * 8 + [0.0] * 4 + [-1.0] * 8 + [1.0] * 4 + [0.0] * 3


def test_noise_makes_no_branches(draft: Draft):
    rng = np.random.default_rng(3)
    draft.header = ["posture", "ux_mm", "fx_N"]
    s = np.concatenate([np.linspace(0.0, -2.0, 81), np.full(40, -2.0)]) + 0.001 * rng.standard_normal(121)
    draft.rows = [["A", f"{v}", f"{3000.0 * v}"] for v in s]
    draft.sheet = draft.sheet.split("[instrument.mx_Nmm]")[0]
    found = draft.read().readings.ways("ux_mm", 0.001)
    assert np.count_nonzero(found[1:81] == 1.0) >= 79
    assert np.count_nonzero(found[81:] == 0.0) >= 39


MARKS = GAUGE_SHEET + 'held = "target"\n'


def test_a_mark_that_was_the_control_keeps_what_settled(draft: Draft):
    draft.sheet = MARKS
    draft.header = ["posture", "fx_N", "mid.uy_mm"]
    groups = [(0.0, (-3.0, -5.0)), (1.5, (-300.0, -400.0, -420.0)), (3.0, (-460.0, -470.0))]
    # on the way, then at the mark, and at last a stale row
    groups.append((4.5, (-470.0, -476.0, -481.0, -480.0, -482.0, -336.0)))
    draft.rows = [["straight", str(f), str(mark)] for mark, forces in groups for f in forces]
    found = draft.read()
    assert not found.imposed
    settled = found.readings.settled("mid.uy_mm")
    assert list(settled.values["mid.uy_mm"]) == [0.0, 1.5, 3.0, 4.5]
    assert list(settled.values["fx_N"]) == [-5.0, -420.0, -470.0, -480.0]


def test_force_control_takes_measured_displacements(draft: Draft):
    draft.sheet = draft.sheet.replace('title = "two postures pushed"', 'control = "force"')
    assert draft.read().sheet.test.control == "force"


@pytest.mark.parametrize("name", ["column_bar_1", "column_tube_1"])
def test_the_measured_columns_are_read(name: str):
    folder = Path(__file__).parents[4] / "shared/measured"
    if not (folder / f"{name}.csv").exists():
        pytest.skip("the class data are not redistributed: put them into ../shared/measured beside the checkout")
    found = read_measurement(folder / f"{name}.csv", folder / f"{name}.toml")
    settled = found.readings.settled("mid.uy_mm")
    marks = settled.values["mid.uy_mm"]
    # a ruler of 1/16 in
    np.testing.assert_allclose(marks / 1.5875, np.round(marks / 1.5875), atol=1e-3)
    assert len(marks) > 30


# A noisy thermometer: what is smoothed away, and what stays.


NOISE = 0.05


def test_without_noise_the_readings_stay():
    readings = np.array([21.0, 21.3, 20.9])
    assert smoothed(readings, 0.0) is readings


def test_a_constant_temperature_becomes_nearly_constant():
    readings = 21.0 + NOISE * np.random.default_rng(3).standard_normal(400)
    assert np.std(smoothed(readings, NOISE)) < 0.5 * NOISE


def test_the_error_of_a_slow_course_falls():
    """A day's course of 2 K: the smoothed temperature is at least twice as near to it as the readings are."""
    truth = 21.0 + np.sin(np.linspace(0.0, np.pi, 400)) * 2.0
    readings = truth + NOISE * np.random.default_rng(5).standard_normal(400)
    error = np.sqrt(np.mean((smoothed(readings, NOISE) - truth) ** 2))
    assert error < 0.5 * NOISE


def test_it_is_the_least_squares_solution_of_a_random_walk():
    """The smoother solves min Σ (x − y)² + Σ Δx²/q for one q, the walk's variance over the noise's."""
    y = np.cumsum(np.random.default_rng(7).standard_normal(60)) * 0.3 + 20.0
    found = smoothed(y, NOISE)
    D = np.diff(np.eye(60), axis=0)
    # q from the solution's own normal equations, its first row; then all other rows must hold
    q = (found[1] - found[0]) / (found[0] - y[0])
    dense = np.linalg.solve(np.eye(60) + D.T @ D / q, y)
    # rounding, magnified by the difference of neighbours from which q is taken
    # the same sum in another order: rounding
    assert found == pytest.approx(dense, rel=1e-13)
