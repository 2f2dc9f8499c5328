"""Causes in the instruments, and what is none of them."""

import csv
import json
import math

import numpy as np
import pytest
from helpers.from_files import DIAGNOSIS as DOCUMENT
from helpers.from_files import DIAGNOSIS_PAGE as PAGE
from helpers.from_files import diagnose
from scipy.integrate import solve_ivp

from vjm.io.findings import ImplausibleError
from vjm_updating.diagnosis.discrepancy import Misfit
from vjm_updating.diagnosis.ramp_kind import ramp_effects
from vjm_updating.diagnosis.run import unless_unexplained
from vjm_updating.diagnosis.verdict import Verdict
from vjm_updating.experiment import read_measurement
from vjm_updating.experiment.mistakes import CLOCK, EXCHANGE, SIGN, UNIT, Mistake, corrected, mistakes_of
from vjm_updating.experiment.plausibility import plausibility
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.instruments import ThermalDrift, lagging
from vjm_updating.inference.significance import FALSE_ALARMS

SHIFT = 0.04
"""mm by which the gauge was set differently in the second posture: half of it are ten sigma of its zero, of which
the other channels' zeros take three. Of half of that nobody could say that no zero was so far off."""
LAG, PER_K = 15.0, 12.0
"""s by which a gauge lags behind the room, and N by which it is wrong for each kelvin."""
PAUSE = 3000.0
"""s between the postures, in which a drift would go on unseen."""


@pytest.mark.slow
def test_a_gauge_that_is_set_anew_in_every_posture_is_no_drift_from_within_the_test(make, tmp_path, monkeypatch):
    # half the shift before the first reading, nothing in the middle: a clock does not run so
    files = make.made_up(tmp_path / "made", {}, 3, monkeypatch, per=6)
    lines = files.data.read_text().splitlines()
    names = lines[0].split(",")
    at, where = names.index("ux_mm"), names.index("posture")
    rows = [line.split(",") for line in lines[1:]]
    for row in rows:
        row[at] = f"{float(row[at]) + (SHIFT if row[where] == 'B' else -SHIFT) / 2:.6f}"
        row[0] = f"{float(row[0]) + (PAUSE if row[where] == 'B' else 0.0):.3f}"
    files.data.write_text("\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n")
    found = diagnose(files.data, files.sheet, tmp_path / "out")
    assert found.verdict == "unknown", [c.causes for c in found.candidates]


def test_a_clock_runs_from_before_the_test_and_a_temperature_from_either_side():
    by_clock, by_temperature = (ThermalDrift(part="ux_mm", by=by).quantities()[1] for by in ("s", "K"))
    assert by_clock.low == 0.0
    # the temperature at which a gauge read true may be one of those of the test
    assert by_temperature.low < -0.5


def test_a_gauge_drifts_by_some_hundredths_of_its_range_in_a_test(make, tmp_path, monkeypatch):
    files = make.made_up(tmp_path, {}, 3, monkeypatch)
    observed = observe_ramps(read_measurement(files.data, files.sheet))
    force = np.linalg.norm(np.nan_to_num(observed.measured[:, :3]), axis=1).max()
    moment = np.abs(np.nan_to_num(observed.measured[:, 3:])).max()
    # a gauge of forces and moments has a range of moments of a tenth of a metre times its forces, at least
    ranges = {"mm": np.abs(observed.imposed[:, :3]).max(), "N": force, "Nmm": max(moment, 100.0 * force)}
    drifts = [e for e in ramp_effects(observed) if isinstance(e, ThermalDrift)]
    assert {d.by for d in drifts} == {"s"}
    assert {d.part for d in drifts} == {*observed.pose_channels, *observed.wrench_channels}
    for drift in drifts:
        own = drift.quantities()[0].spread * np.ptp(observed.clock)
        # rounding of a product
        assert own == pytest.approx(0.02 * ranges[drift.part.rpartition("_")[2]], rel=1e-12)


@pytest.mark.parametrize("lag", [0.5, 20.0, 300.0])
def test_what_warms_late_follows_its_own_equation(lag):
    rng = np.random.default_rng(5)
    # a pause and two readings at once among them
    clock = np.cumsum(np.concatenate([[0.0], rng.uniform(1.0, 4.0, 40), [900.0, 0.0], rng.uniform(1.0, 4.0, 20)]))
    room = np.cumsum(rng.normal(0.0, 0.1, len(clock)))
    room[42] = room[41]
    room -= room[0]
    instants, at = np.unique(clock, return_inverse=True)
    felt = solve_ivp(
        lambda t, x: (np.interp(t, clock, room) - x) / lag,
        (0.0, clock[-1]),
        [0.0],
        t_eval=instants,
        method="LSODA",
        max_step=0.1,
        rtol=1e-9,
        atol=1e-11,
    )
    # a step's tolerance adds up over a few thousand: ten times what it comes to
    assert np.allclose(lagging(room, clock, lag), felt.y[0][at], rtol=0.0, atol=1e-7)
    assert np.array_equal(lagging(room, clock, 0.0), room)


def test_only_a_temperature_lags_and_only_a_clock_says_so():
    names = [[q.name for q in drift.quantities()][2:] for drift in (
        ThermalDrift(part="ux_mm", by="K", duration=200.0),
        ThermalDrift(part="ux_mm", by="K"),
        ThermalDrift(part="ux_mm", by="s", duration=200.0),
    )]  # fmt: skip
    assert names == [["lag_s"], [], []]


@pytest.mark.slow
def test_a_gauge_that_warms_later_than_the_room_is_one_drift(make, tmp_path, monkeypatch):
    files = make.made_up(tmp_path / "made", {}, 3, monkeypatch, per=6)
    header, *lines = files.data.read_text().splitlines()
    rows = [line.split(",") for line in lines]
    time = np.array([float(row[0]) for row in rows])
    fine = np.arange(time[0], time[-1], 0.05)
    room = 0.8 * np.sin(fine / 13.0) + 0.5 * np.sin(fine / 41.0)
    # what it feels is the room's past, weighed by how long ago it was; before the first reading nothing changed
    past = np.arange(0.0, 12.0 * LAG, 0.05)
    weights = np.exp(-past / LAG)
    before = np.full(len(past) - 1, room[0])
    felt = np.convolve(np.concatenate([before, room]), weights / weights.sum(), mode="valid")
    force = header.split(",").index("fx_N")
    for row, off, warm in zip(rows, np.interp(time, fine, felt), np.interp(time, fine, room), strict=True):
        row[force] = f"{float(row[force]) + PER_K * off:.4f}"
        row.append(f"{21.0 + warm:.3f}")
    lines = [f"{header},temperature_C", *(",".join(row) for row in rows)]
    files.data.write_text("\n".join(lines) + "\n")
    found = diagnose(files.data, files.sheet, tmp_path / "out")
    assert found.verdict == "named"
    assert found.causes == ["thermal_drift"]
    for name, true in (("fx_N.per_K", PER_K), ("lag_s", LAG)):
        low, high = found.parameters[f"thermal_drift.{name}"].interval95
        # the lag is not made up: a drift without one lies outside
        assert 0.2 * true < low < true < high


# A mistake of the instruments never stands alone where more than noise is left.


POUNDS = Mistake(
    cause=UNIT, where=np.ones(3, dtype=bool), factors={"fx_N": 4.448}, parameters={f"{UNIT}.fx_N": 4.448}
)
QUIET = Verdict("none", (), (), 0.8, (), Misfit(0.5, 0.0, ""))


def left(p=1.0, prior_p=1.0):
    return Verdict(
        "none", (), (), 0.8, (), Misfit(p, 40.0, "fx_N: shape", prior_p, "modulus link 5.1 sigma from the sheet's")
    )


def test_a_mistake_that_leaves_noise_is_the_finding():
    assert unless_unexplained(QUIET, [POUNDS]) is QUIET


def test_without_a_mistake_nothing_changes():
    verdict = left(p=0.1 * FALSE_ALARMS)
    assert unless_unexplained(verdict, []) is verdict


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        (left(p=0.1 * FALSE_ALARMS), "leaves fx_N: shape"),
        (left(prior_p=0.1 * FALSE_ALARMS), "takes modulus link 5.1 sigma"),
    ],
)
def test_a_mistake_that_leaves_more_is_a_guess(verdict, words):
    found = unless_unexplained(verdict, [POUNDS])
    assert found.kind == "unknown"
    assert not found.members
    assert words in found.doubt
    assert found.confidence == pytest.approx(0.5)


@pytest.mark.slow
def test_pounds_beside_what_no_cause_explains(make, tmp_path, monkeypatch):
    """Forces in pounds from the middle on, and a wave of twenty sigma that no catalogue has."""
    made = make.made_up(tmp_path, {}, 8, monkeypatch)
    head, *rows = made.data.read_text().splitlines()
    names = head.split(",")
    fx, force = (
        names.index("fx_N"),
        [k for k, name in enumerate(names) if name in ("fx_N", "fy_N", "fz_N", "my_Nmm", "mz_Nmm")],
    )
    lines = [head]
    for k, row in enumerate(rows):
        cells = row.split(",")
        cells[fx] = repr(float(cells[fx]) + 40.0 * math.sin(0.9 * k))
        for c in force:
            cells[c] = repr(float(cells[c]) / (4.4482216152605 if k >= 60 else 1.0))
        lines.append(",".join(cells))
    made.data.write_text("\n".join(lines) + "\n")
    document = diagnose(made.data, made.sheet, tmp_path / "out")
    assert document.verdict == "unknown"
    assert "another unit" in document.residual
    assert document.alternatives
    assert all(UNIT in row.causes for row in document.alternatives)


# Mistakes of the instruments are named as such, undone, and no physics is found in their place.


@pytest.fixture(scope="module")
def quiet(make, tmp_path_factory):
    """Readings of a machine as it was drawn."""
    with pytest.MonkeyPatch.context() as patch:
        return make.made_up(tmp_path_factory.mktemp("quiet"), {}, 8, patch)


def spoilt(quiet, folder, change):
    """The data with each row changed, as a file; rows are dictionaries of numbers but for the posture."""
    with open(quiet.data, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for k, row in enumerate(rows):
        change(k, row)
    data = folder / "data.csv"
    with open(data, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return data


def times(row, name, factor):
    row[name] = repr(float(row[name]) * factor)


FORCES = ("fx_N", "my_Nmm", "mz_Nmm")


def kgf_in_b(_, row):
    for name in FORCES:
        times(row, name, 1.0 / 9.80665 if row["posture"] == "B" else 1.0)


def inches_in_a(_, row):
    times(row, "ux_mm", 1.0 / 25.4 if row["posture"] == "A" else 1.0)


def inches_from_a_row_on(k, row):
    times(row, "ux_mm", 1.0 / 25.4 if row["posture"] == "B" and k >= 130 else 1.0)


def kn_to_a_row(k, row):
    for name in FORCES:
        times(row, name, 1e-3 if k < 50 else 1.0)


def kn_from_the_second_row_of_the_last_posture_on(k, row):
    for name in FORCES:
        times(row, name, 1e-3 if k >= 89 else 1.0)


def inches_in_all(_, row):
    times(row, "ux_mm", 1.0 / 25.4)


def lbf_from_the_middle_on(k, row):
    for name in FORCES:
        times(row, name, 1.0 / 4.4482216152605 if k >= 60 else 1.0)


def sign_in_b(_, row):
    for name in FORCES:
        times(row, name, -1.0 if row["posture"] == "B" else 1.0)


def sign_from_a_row_on(k, row):
    for name in FORCES:
        times(row, name, -1.0 if row["posture"] == "A" and k >= 40 else 1.0)


def force_and_moment(_, row):
    row["fx_N"], row["my_Nmm"] = row["my_Nmm"], row["fx_N"]


def clock_set(k, row):
    row["time_s"] = repr(float(row["time_s"]) + (7200.0 if k >= 60 else 0.0))


def clock_in_ms(_, row):
    times(row, "time_s", 1000.0 if row["posture"] == "B" else 1.0)


MISTAKES = {
    "forces in kgf in B": (kgf_in_b, UNIT),
    "displacements in inches in A": (inches_in_a, UNIT),
    "inches from a row on": (inches_from_a_row_on, UNIT),
    "kN up to a row": (kn_to_a_row, UNIT),
    "kN from the last posture's second row on": (kn_from_the_second_row_of_the_last_posture_on, UNIT),
    "inches everywhere": (inches_in_all, UNIT),
    "lbf from the middle on": (lbf_from_the_middle_on, UNIT),
    "sign in B": (sign_in_b, SIGN),
    "sign from a row on": (sign_from_a_row_on, SIGN),
    "fx and my exchanged": (force_and_moment, EXCHANGE),
    "the clock set": (clock_set, CLOCK),
    "the clock in ms in B": (clock_in_ms, CLOCK),
}


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_named_and_undone(name, quiet, tmp_path):
    change, cause = MISTAKES[name]
    right = read_measurement(quiet.data, quiet.sheet)
    assert mistakes_of(plausibility(right)) == []
    wrong = read_measurement(spoilt(quiet, tmp_path, change), quiet.sheet)
    found = mistakes_of(plausibility(wrong))
    assert {mistake.cause for mistake in found} == {cause}
    again = corrected(wrong, found)
    for column, values in right.readings.values.items():
        if column != "time_s":
            # a row at the change that is unloaded, or nearly so, goes with either side
            least = 1e-9 + 0.05 * np.ptp(values)
            np.testing.assert_allclose(again.readings.values[column], values, atol=least, rtol=1e-9)
        else:
            np.testing.assert_allclose(np.diff(again.readings.values[column]), np.diff(values), atol=1e-6)


@pytest.mark.slow
def test_a_diagnosis_names_the_mistake_and_nothing_else(quiet, tmp_path):
    data = spoilt(quiet, tmp_path, kgf_in_b)
    diagnose(data, quiet.sheet, tmp_path / "out", page=True)
    found = json.loads((tmp_path / "out" / DOCUMENT).read_text())
    assert (found["verdict"], found["causes"]) == ("named", [UNIT])
    assert found["parameters"][f"{UNIT}.fx_N"]["value"] == pytest.approx(9.80665, rel=1e-12)
    assert found["gain"] is None
    assert "kgf" in found["doubts"][0]["found"]
    assert "another unit" in (tmp_path / "out" / PAGE).read_text()
    with pytest.raises(ImplausibleError, match="kgf"):
        diagnose(data, quiet.sheet, tmp_path / "strict", strict=True)
    assert not (tmp_path / "strict").exists()
