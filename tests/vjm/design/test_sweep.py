"""Sweeps, Pareto fronts and optima: closed forms of a cantilever, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from vjm.design.sweep import asked, limits_of, optimised, pareto, swept
from vjm_validation.cli.design_space import Loading, design_space

FORCE, LENGTH, E, G, DENSITY = 100.0, 500.0, 70000.0, 26000.0, 2700.0
BAR = f"""
format = 1
name = "bar"
title = "A cantilever"
source = "made up"
units = {{ length = "mm", force = "N", angle = "rad" }}

[[parts]]
kind = "beam"
name = "bar"
length_mm = {LENGTH}

[parts.section]
shape = "SHAPE"
SIZES
youngs_modulus_MPa = {E}
shear_modulus_MPa = {G}
density_kg_per_m3 = {DENSITY}

[postures]
here = {{}}
"""
DOWN = Loading((0.0, -FORCE, 0.0, 0.0, 0.0, 0.0), None, (), "")


def space(folder: Path, shape: str, sizes: str, keys: tuple[str, ...], loading: Loading = DOWN):
    file = folder / "bar.toml"
    file.write_text(BAR.replace("SHAPE", shape).replace("SIZES", sizes), encoding="utf-8")
    return design_space(str(file), keys, None, None, loading)


def second_moment(diameter, inner=0.0):
    return np.pi / 64.0 * (diameter**4 - inner**4)


def mass(diameter, inner=0.0):
    return 1e-9 * DENSITY * LENGTH * np.pi / 4.0 * (diameter**2 - inner**2)


def test_a_sweep_has_the_deflection_and_the_mass_of_each_bar(tmp_path):
    bars = space(tmp_path, "round_bar", "diameter_mm = 30.0", ("bar.section.diameter_mm",))
    diameters = np.array([20.0, 30.0, 40.0])
    values, why = swept(bars.at, diameters[:, None], [asked("mass"), asked("deflection.y"), asked("deflection")])
    assert why == ["", "", ""]
    linear = FORCE * LENGTH**3 / (3.0 * E * second_moment(diameters))
    assert values[:, 0] == pytest.approx(mass(diameters), rel=1e-12)
    # large deflections: the square of deflection over length
    assert values[:, 1] == pytest.approx(linear, rel=2.0 * (linear[0] / LENGTH) ** 2)
    assert np.all(values[:, 2] >= values[:, 1])
    assert pareto(values, [asked("mass"), asked("deflection.y"), asked("deflection")]).all()


def test_what_has_no_answer_says_why_and_stops_no_other(tmp_path):
    tubes = space(tmp_path, "round_tube", "diameter_mm = 30.0\nwall_mm = 2.0", ("bar.section.wall_mm",))
    values, why = swept(tubes.at, np.array([[2.0], [20.0]]), [asked("mass")])
    assert values[0, 0] == pytest.approx(mass(30.0, 26.0), rel=1e-12)
    assert np.isnan(values[1, 0])
    assert "wall" in why[1]
    assert pareto(values, [asked("mass")]).tolist() == [True, False]


def test_the_lightest_bar_of_a_deflection_has_the_diameter_of_the_closed_form(tmp_path):
    """δ = F L³ / 3 E I and I = π d⁴/64 give d = (64 F L³ / 3 π E δ)^¼."""
    bars = space(tmp_path, "round_bar", "diameter_mm = 60.0", ("bar.section.diameter_mm",))
    most = 0.5
    found = optimised(
        bars.at, bars.parameters, np.array([[10.0, 100.0]]), bars.present, asked("mass"),
        limits_of(f"deflection.y<={most}"), starts=2,
    )  # fmt: skip
    diameter = (64.0 * FORCE * LENGTH**3 / (3.0 * np.pi * E * most)) ** 0.25
    assert found.kept
    assert found.agreeing == 2
    # deflections are large by the square of 0.5 mm over 500 mm
    assert found.values[0] == pytest.approx(diameter, rel=5e-6)
    assert found.objective == pytest.approx(mass(diameter), rel=1e-5)


def test_the_lightest_tube_is_as_wide_and_thin_as_its_bounds_let_it(tmp_path):
    """The wall at the largest diameter that has the second moment which the deflection needs."""
    keys = ("bar.section.diameter_mm", "bar.section.wall_mm")
    tubes = space(tmp_path, "round_tube", "diameter_mm = 40.0\nwall_mm = 5.0", keys)
    most, widest = 0.5, 60.0
    found = optimised(
        tubes.at, tubes.parameters, np.array([[20.0, widest], [0.2, 8.0]]), tubes.present, asked("mass"),
        limits_of(f"deflection.y<={most}"), starts=3,
    )  # fmt: skip
    needed = FORCE * LENGTH**3 / (3.0 * E * most)
    inner = (widest**4 - 64.0 * needed / np.pi) ** 0.25
    assert found.kept
    assert found.values == pytest.approx([widest, 0.5 * (widest - inner)], rel=2e-5)


def test_limits_that_no_machine_keeps_are_said(tmp_path):
    bars = space(tmp_path, "round_bar", "diameter_mm = 30.0", ("bar.section.diameter_mm",))
    found = optimised(
        bars.at, bars.parameters, np.array([[10.0, 20.0]]), bars.present, asked("mass"),
        limits_of("deflection<=0.01"), starts=1,
    )  # fmt: skip
    assert not found.kept


@pytest.mark.parametrize("text", ["weight<=3", "deflection<3", "mass<=0", "frequency.x>=2", "deflection.w<=1"])
def test_what_is_no_bound_is_refused(text):
    with pytest.raises(ValueError, match=text.split("<")[0].split(">")[0].split(".")[0]):
        limits_of(text)
