"""Calibration of an arm with several links: each has its tolerances."""

from __future__ import annotations

from pathlib import Path

from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm.model.parameters import compliance_factor
from vjm.vjm_engine import VjmEngine
from vjm_updating.calibrate.problem import Problem, problem_of
from vjm_updating.experiment import read_measurement

SOFTER = {"upper": 1.1, "fore": 0.95}
"""Compliances over nominal."""
SHEET = """[test]
model = "planar-2r"
[model]
link_segments = 4
[tolerance]
link_length_mm = 0.5
modulus_rel = 0.02
[instrument.uz_mm]
noise = 0.001
[instrument.fz_N]
noise = 0.05
[instrument.mx_Nmm]
noise = 20.0
[instrument.my_Nmm]
noise = 20.0
"""


def measured(folder: Path) -> Problem:
    """Out of its plane in two postures, without errors, with links softer and stiffer than drawn."""
    chain, engine = load_chain("planar-2r"), VjmEngine.of(4, 1)
    for name, factor in SOFTER.items():
        chain = compliance_factor(chain, name).apply(chain, factor)
    rows = ["posture,uz_mm,fz_N,mx_Nmm,my_Nmm"]
    for posture in ("bent", "folded"):
        path = engine.trace(chain, LoadCase(posture, 3.0, "z", steps=10))
        rows += [
            f"{posture},{s:.9f},{w[2]:.9f},{w[3]:.9f},{w[4]:.9f}" for s, w in zip(path.s, path.wrench, strict=True)
        ]
    data, sheet = folder / "data.csv", folder / "sheet.toml"
    data.write_text("\n".join(rows) + "\n")
    sheet.write_text(SHEET)
    return problem_of(read_measurement(data, sheet), ["upper.factor", "fore.factor"])


def test_every_link_has_a_length_of_its_own(tmp_path: Path):
    problem = measured(tmp_path)
    names = [unknown.name for unknown in problem.unknowns.all]
    assert [name for name in names if name.startswith("length")] == ["length upper", "length fore"]
