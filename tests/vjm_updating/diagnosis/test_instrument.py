"""Causes in the instruments, and what is none of them."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.from_files import diagnose
from scipy.integrate import solve_ivp

from vjm_updating.diagnosis.ramp_kind import ramp_effects
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.instruments import ThermalDrift, lagging

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
    force = np.linalg.norm(np.nan_to_num(observed.wrench[:, :3]), axis=1).max()
    moment = np.abs(np.nan_to_num(observed.wrench[:, 3:])).max()
    # a gauge of forces and moments has a range of moments of a tenth of a metre times its forces, at least
    ranges = {"mm": np.abs(observed.pose[:, :3]).max(), "N": force, "Nmm": max(moment, 100.0 * force)}
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
