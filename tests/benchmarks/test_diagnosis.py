"""How long a diagnosis takes, from the files to the page: 3 postures, 200 readings each, 6 channels."""

import time

import numpy as np
from helpers.from_files import diagnose
from hidden_effects.causes import catalogue
from hidden_effects.noise import with_nuisances
from hidden_effects.rig import drawn
from hidden_effects.virtual_rig import WRENCH, Design, Known, Sequence, data_text, read, sheet_text

INSTRUMENTS = {"ux_mm": Known(0.001, 0.002, 0.001)} | {
    name: Known(2.0, 3.0, 0.003) if name[0] == "f" else Known(150.0, 300.0, 0.003) for name in WRENCH
}
RAMPS = {"A": (1.2, -1.9), "B": (2.8, -2.8), "D": (2.3, -2.3)}
LIMIT_S = 30.0


def design() -> Design:
    """Pull, push and back in three postures."""
    sequences, start = [], 0.0
    for posture, (pull, push) in RAMPS.items():
        ux = np.concatenate([np.linspace(0.0, pull, 50), np.linspace(pull, push, 100), np.linspace(push, 0.0, 50)])
        time_ = start + 3.0 * np.arange(200)
        sequences.append(Sequence(posture, ux, time_, np.full(200, 21.0)))
        start = float(time_[-1]) + 300.0
    return Design(seed=4 * 10**6, kind="three postures", sequences=tuple(sequences), instruments=INSTRUMENTS,
                  drive=5e-5, autocorrelation=0.4, outliers=0.004, missing=0.01, quantum=0.25)  # fmt: skip


def test_time_of_a_diagnosis(tmp_path, record):
    made, rng = design(), np.random.default_rng(5)
    rig, _ = with_nuisances(drawn(made), made, rng)
    backlash = next(f for f in catalogue(made, 4000.0) if f.cause == "actuator_backlash")
    rig = backlash.members[0](rig, 0.01)
    seen, _ = read(made, rig.response(made), rng)
    (tmp_path / "sheet.toml").write_text(sheet_text(made, "600 readings"))
    (tmp_path / "data.csv").write_text(data_text(made, seen.ux, seen.forces))
    files = tmp_path / "data.csv", tmp_path / "sheet.toml"
    # what is compiled and imported once is not the diagnosis'
    diagnose(*files, tmp_path / "first", only=["actuator_backlash"])
    started = time.perf_counter()
    document = diagnose(*files, tmp_path / "out")
    value = time.perf_counter() - started
    assert document.noise.readings == 600
    assert "actuator_backlash" in document.causes
    record("diagnose_600_readings_s", value, "s", f"<= {LIMIT_S:g}", value <= LIMIT_S)
