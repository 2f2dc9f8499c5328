"""How long a calibration takes, from the files to the page: 3 postures, 200 readings each, 6 channels."""

import time
from dataclasses import replace

import numpy as np
from helpers.from_files import calibrate

from vjm.continuation.load_grid import trace_grid
from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase

ENGINE = VjmEngine(8, 8)
RAMPS = {"A": (4.0, -4.0), "B": (4.0, -12.0), "C": (4.0, -3.0)}
NOISE = {"fx_N": 2.0, "fy_N": 2.0, "fz_N": 2.0, "mx_Nmm": 300.0, "my_Nmm": 300.0, "mz_Nmm": 300.0}
SOFTER = {"EA": 0.95, "EIz": 0.94, "GJ": 1.05}
"""The true bar's stiffnesses over nominal."""
LIMIT_S = 10.0


def readings(chain):
    """Lines of a data file: the model's own wrenches with noise in both displacement and force."""
    rng = np.random.default_rng(1)
    bar = next(beam for beam in chain.beams if beam.name == "link")
    section = replace(bar.section, **{name: getattr(bar.section, name) * f for name, f in SOFTER.items()})
    true = replace(chain, parts=tuple(replace(p, section=section) if p is bar else p for p in chain.parts))
    yield ",".join(["posture", "ux_mm", *NOISE])
    for posture, ends in RAMPS.items():
        for to in ends:
            found = trace_grid(ENGINE.problem(true, LoadCase(posture, to)), np.linspace(0.0, abs(to), 101))
            assert not found.stopped
            # without the unloaded one
            for s, wrench in zip(found.s[1:101], found.wrench[1:101], strict=True):
                values = [np.sign(to) * s + 1e-3 * rng.standard_normal()]
                values += list(wrench + np.array(list(NOISE.values())) * rng.standard_normal(6))
                yield ",".join([posture, *(f"{value:.6f}" for value in values)])


def sheet(chain):
    lines = ['[test]\nmodel = "orthoglide-chain"\n[model]\nlink_segments = 8\nfoot_segments = 8\n[postures]']
    lines += [f"{label} = {chain.posture(label).tolist()}" for label in RAMPS]
    lines += ["[tolerance]\nlink_length_mm = 0.2\nmodulus_rel = 0.02"]
    lines += ["[instrument.ux_mm]\nnoise = 0.001\nzero = 0.002\nscale = 0.001"]
    lines += [f"[instrument.{name}]\nnoise = {noise}\nzero = 3.0\nscale = 0.003" for name, noise in NOISE.items()]
    return "\n".join(lines) + "\n"


def test_time_of_a_calibration(chain, tmp_path, record):
    data, page = tmp_path / "data.csv", tmp_path / "sheet.toml"
    data.write_text("\n".join(readings(chain)) + "\n")
    page.write_text(sheet(chain))
    names = ("link.section", "foot.factor")
    # what is compiled and imported once is not the calibration's
    calibrate(data, page, tmp_path / "first", ("foot.factor", "link.factor"))
    started = time.perf_counter()
    document = calibrate(data, page, tmp_path / "out", names)
    value = time.perf_counter() - started
    assert document.fit.readings == 3 * 200 * 6
    for row in document.parameters:
        truth = SOFTER.get(row.name.partition(".")[2], 1.0)
        assert abs(row.value / row.nominal - truth) < 4.0 * row.std / row.nominal
    record("calibrate_600_readings_s", value, "s", f"<= {LIMIT_S:g}", value <= LIMIT_S)
