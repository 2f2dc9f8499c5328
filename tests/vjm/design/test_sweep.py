"""Sweeps, Pareto fronts and optima: closed forms of a cantilever, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import vjm
from vjm.design.optimum import limits_of, optimised
from vjm.design.space import DesignCase, DesignSpace
from vjm.design.sweep import asked, pareto, swept
from vjm.io.file_parameters import MachineFiles

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
DOWN = (DesignCase("here", (0.0, -FORCE, 0.0, 0.0, 0.0, 0.0)),)


def space(folder: Path, shape: str, sizes: str, keys: tuple[str, ...], cases: tuple[DesignCase, ...] = DOWN):
    file = folder / "bar.toml"
    file.write_text(BAR.replace("SHAPE", shape).replace("SIZES", sizes), encoding="utf-8")
    return DesignSpace(MachineFiles.read(file), keys, cases, engine=vjm.VjmEngine(4))


def second_moment(diameter, inner=0.0):
    return np.pi / 64.0 * (diameter**4 - inner**4)


def mass(diameter, inner=0.0):
    return 1e-9 * DENSITY * LENGTH * np.pi / 4.0 * (diameter**2 - inner**2)


def test_a_sweep_has_the_deflection_and_the_mass_of_each_bar(tmp_path):
    bars = space(tmp_path, "round_bar", "diameter_mm = 30.0", ("bar.section.diameter_mm",))
    diameters = np.array([20.0, 30.0, 40.0])
    found = swept(bars, diameters[:, None], [asked("mass"), asked("deflection.y"), asked("deflection")])
    values = found.worst
    assert found.why == [[""], [""], [""]]
    linear = FORCE * LENGTH**3 / (3.0 * E * second_moment(diameters))
    assert values[:, 0] == pytest.approx(mass(diameters), rel=1e-12)
    # large deflections: the square of deflection over length
    assert values[:, 1] == pytest.approx(linear, rel=2.0 * (linear[0] / LENGTH) ** 2)
    assert np.all(values[:, 2] >= values[:, 1])
    assert found.front.all()
    frame = found.to_frame()
    assert frame["bar.section.diameter_mm"].tolist() == diameters.tolist()
    assert frame["mass"].to_numpy() == pytest.approx(values[:, 0], rel=1e-15)


def test_what_has_no_answer_says_why_and_stops_no_other(tmp_path):
    tubes = space(tmp_path, "round_tube", "diameter_mm = 30.0\nwall_mm = 2.0", ("bar.section.wall_mm",))
    found = swept(tubes, np.array([[2.0], [20.0]]), [asked("mass")])
    values, why = found.worst, found.why
    assert values[0, 0] == pytest.approx(mass(30.0, 26.0), rel=1e-12)
    assert np.isnan(values[1, 0])
    assert "wall" in why[1][0]
    assert pareto(values, [asked("mass")]).tolist() == [True, False]


def test_the_lightest_bar_of_a_deflection_has_the_diameter_of_the_closed_form(tmp_path):
    """δ = F L³ / 3 E I and I = π d⁴/64 give d = (64 F L³ / 3 π E δ)^¼."""
    bars = space(tmp_path, "round_bar", "diameter_mm = 60.0", ("bar.section.diameter_mm",))
    most = 0.5
    found = optimised(
        bars, np.array([[10.0, 100.0]]), asked("mass"),
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
        tubes, np.array([[20.0, widest], [0.2, 8.0]]), asked("mass"),
        limits_of(f"deflection.y<={most}"), starts=3,
    )  # fmt: skip
    needed = FORCE * LENGTH**3 / (3.0 * E * most)
    inner = (widest**4 - 64.0 * needed / np.pi) ** 0.25
    assert found.kept
    assert found.values == pytest.approx([widest, 0.5 * (widest - inner)], rel=2e-5)


def test_limits_that_no_machine_keeps_are_said(tmp_path):
    bars = space(tmp_path, "round_bar", "diameter_mm = 30.0", ("bar.section.diameter_mm",))
    found = optimised(
        bars, np.array([[10.0, 20.0]]), asked("mass"),
        limits_of("deflection<=0.01"), starts=1,
    )  # fmt: skip
    assert not found.kept


def test_no_optimum_is_worse_than_the_start_or_beyond_its_limit(tmp_path):
    """Whatever the optimiser comes to: here it is stopped at its first step, from a start that keeps the limit."""
    bars = space(tmp_path, "round_bar", "diameter_mm = 60.0", ("bar.section.diameter_mm",))
    limits = limits_of("deflection.y<=0.5")
    seen = []

    def stop(count, best):
        seen.append(best)
        if len(seen) == 4:
            raise KeyboardInterrupt

    found = optimised(bars, np.array([[10.0, 100.0]]), asked("mass"), limits, 2, stop)
    assert found.interrupted
    assert found.kept
    assert found.objective == min(seen) <= mass(60.0)
    whole = optimised(bars, np.array([[10.0, 100.0]]), asked("mass"), limits, 2)
    assert not whole.interrupted
    again = swept(bars, whole.values[None], [asked("mass"), asked("deflection.y")]).worst[0]
    # computed again, not a digit beyond
    assert again[1] <= 0.5
    assert again[0] == pytest.approx(whole.objective, rel=1e-12)


@pytest.mark.slow
def test_the_worst_of_two_loads_counts(tmp_path):
    """Two loads across each other and the two sides of a rectangle: each side is what a load needs."""
    keys = ("bar.section.width_mm", "bar.section.thickness_mm")
    loads = (
        DesignCase("here", (0.0, -FORCE, 0.0, 0.0, 0.0, 0.0)),
        DesignCase("here", (0.0, 0.0, -0.25 * FORCE, 0.0, 0.0, 0.0)),
    )
    bars = space(tmp_path, "rectangle", "width_mm = 30.0\nthickness_mm = 20.0", keys, loads)
    found = swept(bars, np.array([[30.0, 20.0]]), [asked("deflection"), asked("mass")])
    y, z = found.values[0, :, 0]
    assert y != pytest.approx(z, rel=0.1)
    assert found.worst[0, 0] == max(y, z)
    most = 0.5
    best = optimised(
        bars, np.array([[5.0, 90.0], [5.0, 90.0]]), asked("mass"), limits_of(f"deflection<={most}"), starts=2
    )
    # b³h and bh³ are as the loads are: the sides are as their roots
    both = swept(bars, best.values[None], [asked("deflection")]).values[0, :, 0]
    assert both == pytest.approx([most, most], rel=1e-5)
    assert max(best.values) / min(best.values) == pytest.approx(2.0, rel=1e-4)
    # the same two loads with the deflection as what is least under a mass
    least = optimised(
        bars,
        np.array([[5.0, 90.0], [5.0, 90.0]]),
        asked("deflection"),
        limits_of(f"mass<={best.objective}"),
        starts=1,
    )
    assert least.objective == pytest.approx(most, rel=1e-5)
    assert least.values == pytest.approx(best.values, rel=1e-3)


def test_a_column_that_bears_a_factor_on_its_load(tmp_path):
    """F = π² E I / 4 L² of a cantilever gives d = (256 F L² / π³ E)^¼."""
    down = (DesignCase("here", (-FORCE, 0.0, 0.0, 0.0, 0.0, 0.0)),)
    bars = space(tmp_path, "round_bar", "diameter_mm = 30.0", ("bar.section.diameter_mm",), down)
    factor = 3.0
    found = optimised(
        bars, np.array([[8.0, 14.0]]), asked("mass"), limits_of(f"critical>={factor:g}*load"), starts=1
    )
    diameter = (256.0 * factor * FORCE * LENGTH**2 / (np.pi**3 * E)) ** 0.25
    assert found.kept
    # shear and the shortening take F/GA and F/EA, some 1e-5, of the load
    assert found.values[0] == pytest.approx(diameter, rel=1e-4)


def test_a_sweep_from_python_over_postures():
    found = vjm.sweep(
        "delta", {"delta-rod.rod.section.EA_N": [9e6, 18e6]}, ["deflection.z"],
        cases=vjm.LoadCases(["home", "10,0,-20"], [(0.0, 0.0, -100.0, 0.0, 0.0, 0.0)], engine=vjm.VjmEngine(2)),
    )  # fmt: skip
    assert found.values.shape == (2, 2, 1)
    assert not any(text for texts in found.why for text in texts)
    # stiffer rods, less deflection, in every posture
    assert np.all(found.values[1] < found.values[0])
    assert [row["posture"] for row in found.table()] == ["home", "10,0,-20"] * 2


def test_only_critical_loads_are_told_in_loads():
    with pytest.raises(ValueError, match="only a critical load is told in loads"):
        limits_of("deflection<=3*load")


@pytest.mark.parametrize("text", ["weight<=3", "deflection<3", "mass<=0", "frequency.x>=2", "deflection.w<=1"])
def test_what_is_no_bound_is_refused(text):
    with pytest.raises(ValueError, match=text.split("<")[0].split(">")[0].split(".")[0]):
        limits_of(text)
