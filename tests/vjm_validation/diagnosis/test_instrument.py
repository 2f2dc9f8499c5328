"""Causes in the instruments, and what is none of them."""

from __future__ import annotations

from vjm_validation.diagnosis.command import diagnose
from vjm_validation.diagnosis.instrument import ThermalDrift

SHIFT = 0.04
"""mm by which the gauge was set differently in the second posture: half of it are ten sigma of its zero, of which
the other channels' zeros take three. Of half of that nobody could say that no zero was so far off."""
PAUSE = 3000.0
"""s between the postures, in which a drift would go on unseen."""


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
