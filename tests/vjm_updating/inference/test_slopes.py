"""Derivatives of predicted readings by the machine's nuisances against differences of whole paths."""

import numpy as np
import pytest
from helpers.file_texts import instruments_text, model_text, part_text, section_of, table_text

from vjm_updating.diagnosis.kinds import kind_of
from vjm_updating.experiment import read_measurement
from vjm_updating.experiment.data_file import WRENCH
from vjm_updating.inference.fitting import LeastSquaresProblem, whitening_of
from vjm_updating.inference.parameters import nuisance_coordinates

TUBES = {"upper": (500.0, 100.0, 4.0), "fore": (400.0, 80.0, 3.0)}
"""Length, width and wall, mm."""


@pytest.fixture(scope="module")
def problem(tmp_path_factory) -> LeastSquaresProblem:
    """Ramps of an arm of two tubes whose joints are soft: a length's tolerance changes its forces by little."""
    folder = tmp_path_factory.mktemp("slopes")
    parts = []
    for joint, (tube, (length, width, wall)) in zip(("shoulder", "elbow"), TUBES.items(), strict=True):
        parts += [
            part_text("actuated", joint, axis="z", compliance_rad_per_Nmm=5e-8),
            part_text("beam", tube, length_mm=length, section=section_of("square_tube", width, wall)),
        ]
    (folder / "two.toml").write_text(model_text("two", *parts, postures={"P": {"shoulder": -0.5, "elbow": 1.2}}))
    way = [0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0]
    cells = ",".join(["0.0"] * 6)
    rows = [f"{ux},0.0,{cells}" for ux in way] + [f"0.0,{2.0 * uz},{cells}" for uz in way]
    (folder / "data.csv").write_text("\n".join([f"ux_mm,uz_mm,{','.join(WRENCH)}", *rows]))
    cell = {name: (1.0, 1.5, 0.003) if name[0] == "f" else (150.0, 250.0, 0.003) for name in WRENCH}
    (folder / "sheet.toml").write_text(
        table_text("test", title="two tubes", model="two.toml")
        + table_text("postures", P=())
        + table_text("tolerance", link_length_mm=0.2, modulus_rel=0.02)
        + instruments_text(ux_mm=(0.001, 0.002, 0.001), uz_mm=(0.001, 0.002, 0.001), **cell)
    )
    measurement = read_measurement(folder / "data.csv", folder / "sheet.toml")
    kind = kind_of(measurement)
    observed = kind.observe(measurement)
    nuisances, forward = tuple(nuisance_coordinates(observed)), kind.forward(observed)
    evaluation = forward.evaluate(nuisances, np.zeros(len(nuisances)), ())
    return LeastSquaresProblem(forward, nuisances, whitening_of(observed, evaluation))


@pytest.mark.parametrize("name", [f"{what} {tube}" for what in ("modulus", "length") for tube in TUBES])
def test_a_derivative_is_the_difference_of_whole_paths(problem, name):
    unknowns, z = problem.nuisances, np.zeros(len(problem.nuisances))
    place = [c.name for c in unknowns].index(name)
    J = problem.slopes(unknowns, problem.evaluate(unknowns, z, ()), ())[:, :, place]
    up, down = (problem.evaluate(unknowns, sign * np.eye(len(z))[place], ()).residual for sign in (1.0, -1.0))
    exact = 0.5 * np.where(problem.whitening.present, up - down, 0.0)
    assert np.abs(exact).max() > 0.1
    # 0.03 sigma to one side against one sigma to both: with 2 % of modulus a sigma they differ by some 3e-4,
    # as tables do that are interpolated; without a step of Newton's method all of it is wrong
    np.testing.assert_allclose(J, exact, atol=2e-3 * np.abs(exact).max())
