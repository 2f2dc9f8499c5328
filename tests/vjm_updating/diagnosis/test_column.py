"""Real columns, where their data lie beside the project, and the column's mechanics."""

import copy
import json
import re
from pathlib import Path

import numpy as np
import pytest
from helpers.command import validate
from helpers.file_texts import instruments_text, table_text
from helpers.from_files import diagnose
from scipy.optimize import brentq

from vjm.engines import VjmEngine
from vjm.io.model_file import build_chain, load_chain, read_document
from vjm.io.shapes import SHAPES, Shape
from vjm.model.load_case import Load, LoadCase, PointControl
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_updating.diagnosis.column import ColumnForward, column_effects, observe_column, zeros_before_loading
from vjm_updating.diagnosis.document import ValueRow
from vjm_updating.diagnosis.kinds import direct, kind_of
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.diagnosis.run import transfer
from vjm_updating.experiment import Readings, read_measurement
from vjm_updating.inference.fitting import best_fit
from vjm_updating.mechanisms.column import column_force, yield_curve

MEASURED = Path(__file__).parents[4] / "shared" / "measured"
SHEET = (
    table_text("test", model="pinned-column", control="mid.uy_mm")
    + table_text("points.mid", body="link", at=0.5)
    + instruments_text(fx_N=(1.0, 3.0, 0.01), **{"mid.uy_mm": (0.01, 0.05)})
    + table_text("tolerance", link_length_mm=1.0, modulus_rel=0.03)
)
real = pytest.mark.skipif(
    not MEASURED.is_dir(), reason="the measured columns are not redistributed with the project"
)


MATERIAL = {"youngs_modulus_MPa": 7e4, "poissons_ratio": 0.33, "yield_stress_MPa": 250.0}


def section(shape: str, **sides: float) -> dict:
    return {"shape": shape, **{f"{key}_mm": value for key, value in sides.items()}, **MATERIAL}


def made(table: dict) -> Shape:
    return SHAPES[table["shape"]].model_validate(table)


BAR = made(section("rectangle", width=25.0, thickness=3.2))


def test_small_deflections_of_a_bowed_column_are_amplified():
    L, EI = 300.0, 4.7e6
    euler = np.pi**2 * EI / L**2
    w = np.array([0.05, 0.2, 0.5])
    # w = a P/(P_E − P), to first order in the slope
    np.testing.assert_allclose(column_force(w, L, EI, 0.4), euler * w / (w + 0.4), rtol=1e-4)


def test_the_elastica_rises_with_the_square():
    L, EI = 300.0, 4.7e6
    euler = np.pi**2 * EI / L**2
    w = np.array([3.0, 6.0, 12.0])
    # P/P_E = 1 + (π w/L)²/8 (Timoshenko and Gere, eq. 2-23 to second order)
    rise = column_force(w, L, EI) / euler - 1.0
    np.testing.assert_allclose(rise, (np.pi * w / L) ** 2 / 8.0, rtol=0.02)


@pytest.mark.parametrize("held", [0.0, 0.4, 4.0, 4000.0])
def test_pins_that_resist_turning(held):
    """Between free and clamped ends: tan μ = −2μ/κ, P = 4μ² EI/L², κ the springs' stiffness over EI/L."""
    L, EI = 300.0, 4.7e6
    mu = brentq(lambda m: held * np.sin(m) + 2.0 * m * np.cos(m), 0.5 * np.pi, np.pi)
    # the rule's own error for a clamped column; a deflection of a hundredth of a millimetre adds 1e-9
    found = column_force(np.array([0.01]), L, EI, restraint=held * EI / L)
    assert found[0] == pytest.approx(4.0 * mu**2 * EI / L**2, rel=2e-5)


def test_a_rectangle_yields_to_one_and_a_half():
    moment, curvature = yield_curve(BAR, 4000.0, 0.5)
    k = curvature > 1.1
    # M/M_p = 1.5 − 0.5/κ² beyond first yield where the knee is sharp
    np.testing.assert_allclose(moment[k], 1.5 - 0.5 / curvature[k] ** 2, atol=2e-3)


@pytest.mark.parametrize(
    ("table", "factor"),
    [
        (section("square_tube", width=20.0, wall=2.0), (20.0**3 - 16.0**3) / 4 / ((20.0**4 - 16.0**4) / 120)),
        (section("rectangular_tube", width=60.0, thickness=40.0, wall=4.0),
         (60.0 * 40.0**2 - 52.0 * 32.0**2) / 4 / ((60.0 * 40.0**3 - 52.0 * 32.0**3) / 240)),
        (section("round_bar", diameter=20.0), 16 / (3 * np.pi)),
        (section("round_tube", diameter=20.0, wall=2.0),
         16 / (3 * np.pi) * (1 - 0.8**3) / (1 - 0.8**4)),
        (section("i_beam", width=100.0, height=200.0, flange=8.5, web=5.6),
         (100.0 * 8.5 * 191.5 + 5.6 * 183.0**2 / 4) / ((100.0 * 200.0**3 - 94.4 * 183.0**3) / 1200)),
    ],
    ids=lambda value: value["shape"] if isinstance(value, dict) else "",
)  # fmt: skip
def test_every_shape_yields_to_its_plastic_modulus(table, factor):
    """Plastic over elastic section modulus, with an elastic core of a sixtieth of the depth left."""
    moment, _ = yield_curve(made(table), 4000.0, 0.5)
    # (60/0.5)^(1/4000) of hardening; fibres are 1 % of a band apart
    assert moment[-1] == pytest.approx(1.0012 * factor, rel=2e-3)


def test_a_rounded_knee_follows_its_power():
    n, offset = 6.0, 0.6
    moment, curvature = yield_curve(BAR, n, offset)
    # far out the elastic strain is nothing beside the set: σ ~ ε^(1/n), of which M is 3/(2 + 1/n) over a rectangle
    far = curvature[-1]
    expected = 3.0 / (2.0 + 1.0 / n) * (far / offset) ** (1.0 / n)
    assert moment[-1] == pytest.approx(expected, rel=0.03)
    # and small bending is elastic
    near = curvature < 0.3
    np.testing.assert_allclose(moment[near], curvature[near], rtol=2e-3)


def test_yield_turns_the_force_down():
    L, EI = 300.0, 4.7e6
    w = np.linspace(1.0, 50.0, 50)
    plain = column_force(w, L, EI, 2.0)
    yields = column_force(w, L, EI, 2.0, 12_000.0, BAR, 400.0)
    first = int(np.argmax(plain - yields > 1e-6 * plain))
    # deflections are a millimetre apart, over which the moment grows by some 3 %
    assert plain[first] * (w[first] + 2.0) == pytest.approx(12_000.0, rel=0.03)
    assert np.all(np.diff(yields[-20:]) < 0.0)


def cropped(name: str, to: float, folder: Path) -> Path:
    """The marks of a measured column up to a deflection."""
    lines = (MEASURED / f"{name}.csv").read_text().splitlines()
    column = lines[0].split(",").index("mid.uy_mm")
    data = folder / "data.csv"
    data.write_text("\n".join([lines[0], *(row for row in lines[1:] if float(row.split(",")[column]) < to)]) + "\n")
    return data


@real
def test_the_bar_is_bowed_and_yields(tmp_path):
    found = diagnose(MEASURED / "column_bar_1.csv", MEASURED / "column_bar_1.toml", tmp_path)
    assert (found.verdict, found.causes) == ("named", ["link_bow", "plasticity"])
    # a few per cent of stiffness beside the bow, or none: the bar cannot tell, and the bow's law may be so far off
    words = {row.cause: row.word for row in found.findings.causes}
    assert words["link_compliance"] == "may act"
    # an error of zero is distinguished by the marks behind the yield: thirty to one; up to 19 mm they fit alike
    assert {"link_bow", "plasticity", "instrument_zero"} in [set(other.causes) for other in found.alternatives]
    assert all({"link_bow", "plasticity"} <= set(other.causes) for other in found.alternatives)
    stress = found.parameters["plasticity.yield_stress_MPa"].value
    # the handbook's minimum is 241 MPa; bars are sold with up to a fifth more
    assert 230.0 < stress < 300.0
    assert found.gain.split == "marks"
    assert found.gain.rmse_after < 5.0
    assert found.gain.rmse_after < 0.1 * found.gain.rmse_before
    (row,) = found.critical
    # the load turns at 503 N; Euler's is 515, and yield takes the rest
    assert row.measured_N == pytest.approx(503.0, abs=1.0)
    assert abs(row.after_N - row.measured_N) < 0.6 * abs(row.before_N - row.measured_N)


@real
@pytest.mark.slow
def test_marks_of_the_bar_are_predicted_within_5_newtons(tmp_path):
    data = cropped("column_bar_1", 19.2, tmp_path)
    found = diagnose(data, MEASURED / "column_bar_1.toml", tmp_path / "out")
    assert found.verdict == "class"
    # the rows before loading bound the cell's zero, which is no cause beside the bow
    assert {"link_bow", "end_restraint"} in [set(c.causes) for c in found.candidates]
    assert {"link_bow", "link_compliance"} in [set(c.causes) for c in found.candidates]
    # every third mark in turn, but the first and the last; what is asked is 5 N, what was aimed at 3 N
    assert found.gain.rmse_after < 4.0
    assert all(fold.rmse_after < 5.0 for fold in found.gain.folds)
    assert sum(fold.readings for fold in found.gain.folds) == 11


@real
@pytest.mark.slow
def test_the_tube_yields_gradually_from_the_start(tmp_path):
    data = cropped("column_tube_1", 26.0, tmp_path)
    found = diagnose(data, MEASURED / "column_tube_1.toml", tmp_path / "out")
    # the rows before loading bound the ruler's zero, which was one with a bow before
    assert "plasticity" in found.causes
    assert "instrument_zero" not in found.causes
    # its knee is round, that of the bar sharp
    assert found.parameters["plasticity.exponent"].value < 15.0
    # 1 % of its load; whoever goes by a ruler's marks to a tenth of a millimetre has 1 N
    assert found.gain.rmse_after < 8.0
    assert found.gain.rmse_before > 80.0


def made_column(
    folder: Path, bow: float, zero: float = 0.0, wrong: dict[int, float] | None = None
) -> tuple[Path, Path]:
    """Data and sheet of an elastic column whose load cell has an error of zero."""
    deflection = np.array([0.2, *np.arange(1.0, 15.0)])
    load = column_force(deflection, 299.085, 68948.0 * 25.4 * 3.175**3 / 12.0, bow) - zero
    for mark, error in (wrong or {}).items():
        load[mark] += error
    rows = [
        f"{2.0 * k:.1f},straight,{-f:.3f},{w:.3f}" for k, (w, f) in enumerate(zip(deflection, load, strict=True))
    ]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "data.csv").write_text("\n".join(["time_s,posture,fx_N,mid.uy_mm", *rows]) + "\n")
    (folder / "sheet.toml").write_text(SHEET)
    return folder / "data.csv", folder / "sheet.toml"


@pytest.mark.parametrize(
    ("shape", "depth"),
    [
        ("section = 'round_bar'\ndiameter_mm = 8.0", 8.0),
        ("section = 'round_tube'\ndiameter_mm = 10.0\nwall_mm = 1.0", 10.0),
        ("section = 'i_beam'\nwidth_mm = 10.0\nheight_mm = 8.0\nflange_mm = 1.0\nweb_mm = 1.0", 8.0),
        ("section = 'rectangular_tube'\nwidth_mm = 12.0\nthickness_mm = 8.0\nwall_mm = 1.0", 8.0),
    ],
)
def test_a_column_of_any_shape_may_yield(tmp_path, shape, depth):
    data, sheet = made_column(tmp_path, 1.5)
    sheet.write_text(f"[model]\n{shape}\nyield_stress_MPa = 150.0\n{sheet.read_text()}")
    measurement = read_measurement(data, sheet)
    observed = observe_column(measurement)
    assert "plasticity" in [effect.cause for effect in column_effects(observed)]
    # beam theory: P/A + P w/S reaches the yield stress in the middle
    beam = measurement.chain.beams[0]
    area, inertia = beam.section.EA / 68948.0, beam.section.EIz / 68948.0
    w = np.linspace(0.05, 14.0, 2000)
    P = column_force(w, beam.length, beam.section.EIz)
    first = int(np.argmax(P / area + P * w * 0.5 * depth / inertia >= 150.0))
    assert first > 0
    said = ColumnForward(observed).handbook_yield()
    found = [float(one) for one in re.findall(r"from ([\d.]+) mm and ([\d.e+]+) N", said)[0]]
    # the command looks every 0.06 mm, where the force hardly grows
    assert found[0] == pytest.approx(w[first], abs=0.07)
    assert found[1] == pytest.approx(P[first], rel=2e-3)


@pytest.mark.parametrize(
    ("first", "bounds"),
    # a cell that reads −26 N without load; a file that begins at a loaded mark; one that has a single row there
    [([0.0] * 8, {"fx_N": (-29.0, 3.0)}), ([0.0], {}), ([0.2] * 8, {})],
)
def test_rows_before_loading_bound_the_cells_zero(first, bounds):
    marks = np.array([*first, 1.5, 3.0])
    n, step = len(marks), 1.5 if first[0] == 0.0 else 1.4
    force = np.array([0.0, *[-26.0] * 6, -300.0, -450.0, -460.0])[-n:]
    readings = Readings(
        "data.csv", np.arange(n), np.full(n, "straight"), np.ones(n, dtype=int), {"mid.uy_mm": marks, "fx_N": force}
    )
    assert zeros_before_loading(readings, "mid.uy_mm", 1.0) == bounds | {"mid.uy_mm": (-step, step)}


def test_a_mark_is_predicted_by_the_others_alone(tmp_path):
    """Held-out errors are those of refits in full: a wrong mark stands out by all of its error."""
    files = made_column(tmp_path, 1.5, wrong={7: 40.0})
    prepared = prepare(observe_column(read_measurement(*files)))
    bow = next(effect for effect in prepared.effects if effect.cause == "link_bow")
    fit = best_fit(prepared.fitter, (bow,), np.zeros(len(prepared.fitter.nuisances)), [[1.0]])
    kind = kind_of(prepared.all.measurement)
    gain = kind.hold_out(prepared.fitter, prepared.null)(fit)
    assert [fold.name for fold in gain.folds] == ["marks 2, 5, 8, …", "marks 3, 6, 9, …", "marks 4, 7, 10, …"]
    # of thirteen marks one is off by 40 N; the others are exact, and what it does to their refits is a few per cent
    assert gain.rmse_after == pytest.approx(40.0 / 13.0**0.5, rel=0.05)
    first, *others = gain.folds
    assert first.rmse_after == pytest.approx(40.0 / first.readings**0.5, rel=0.05)
    assert max(fold.rmse_after for fold in others) < 8.0


def test_what_belongs_to_the_rig_serves_another_specimen(tmp_path):
    """A bowed column and a straight one on one load cell: its error of zero is worth something there."""
    one, other = (made_column(tmp_path / name, bow, zero=30.0) for name, bow in (("one", 1.5), ("other", 0.0)))
    prepared = prepare(observe_column(read_measurement(*one)))
    known = {effect.label: effect for effect in prepared.effects}
    causes = (known["link_bow"], known["instrument_zero.fx_N"])
    start = np.zeros(len(prepared.fitter.nuisances))
    fit = best_fit(prepared.fitter, causes, start, [[1.5], [0.0]])
    rows = {row.what: row.rmse for row in transfer(fit, read_measurement(*other))}
    assert set(rows) == {
        "nothing: the sheet's own model",
        "link_bow",
        "instrument_zero",
        "zeros, scales and tolerances",
        "all of it",
    }
    # of a straight column an error of zero is all that there is
    assert rows["nothing: the sheet's own model"] == pytest.approx(30.0, rel=0.01)
    assert rows["instrument_zero"] < 0.5 * rows["nothing: the sheet's own model"]
    # the other's bow does not
    assert rows["link_bow"] > rows["nothing: the sheet's own model"]
    assert rows["all of it"] > rows["instrument_zero"]


@pytest.mark.slow
def test_the_command_takes_another_specimen(tmp_path):
    one, other = (made_column(tmp_path / name, bow) for name, bow in (("one", 1.5), ("other", 0.6)))
    options = [f"--sheet={one[1]}", f"--out={tmp_path / 'out'}", "--beside", str(other[0]), str(other[1])]
    validate("diagnose", one[0], *options)
    found = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert found["causes"] == ["link_bow"]
    assert [row["what"] for row in found["transfer"]][:2] == ["nothing: the sheet's own model", "link_bow"]


@pytest.mark.slow
def test_a_class_of_columns_gets_the_measurement_that_shows_most(tmp_path):
    files = made_column(tmp_path / "one", 1.5, zero=30.0)
    found = diagnose(*files, tmp_path / "out")
    step = found.next_experiment
    if found.verdict == "class":
        assert step.path
        assert step.posture == "straight"
    bow = ValueRow(value=-30.0, std=3.0, interval95=[-36.0, -24.0])
    measurement = read_measurement(*files)
    shown = direct(measurement, "A", "instrument_zero", {"instrument_zero.fx_N": bow}, 500.0)
    assert (shown.difference, shown.channel, shown.strength) == (30.0, "fx_N", 10.0)
    assert direct(measurement, "A", "link_bow", {"link_bow.amplitude_mm": bow}, 500.0) is None


# The library's pinned column by virtual springs, by finite elements and by the diagnosis's own elastica agree.


LENGTH, EI = 299.085, 68948.0 * 25.4 * 3.175**3 / 12.0
PUSH = Load((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0))


ASIDE = Load((0.0, 1e-3, 0.0, 0.0, 0.0, 0.0), "link", 0.5, ramped=False)
"""N on the middle, which deflects it by 1e-4 mm: a straight column has to know where to go."""


def squeezed(to: float, steps: int | None = None) -> LoadCase:
    """Squeezed by a force along x, controlled by the deflection of the middle, as the operator of the rig does."""
    control = PointControl("link", 0.5, (0.0, 1.0, 0.0))
    return LoadCase("straight", to, "load", steps, free=("x",), loads=(PUSH, ASIDE), control=control)


@pytest.mark.slow
@pytest.mark.parametrize(
    "engine",
    [VjmEngine(16), VjmEngine(32), ExudynEngine(elements=16)],
    ids=["springs", "more springs", "finite elements"],
)
def test_a_straight_column_behind_its_bifurcation(engine):
    path = engine.trace(load_chain("pinned-column"), squeezed(49.0, steps=200))
    assert path.complete, path.stopped
    w = np.array([2.0, 5.0, 10.0, 19.0, 30.0, 48.0])
    there = np.interp(w, path.s, path.ramp)
    # the bar's own shortening by P/EA, 9e-5, is not in the elastica
    np.testing.assert_allclose(there, column_force(w, LENGTH, EI), rtol=2e-4)


@pytest.mark.parametrize("bow", [1.0, 3.0])
def test_a_bowed_column(bow):
    document = copy.deepcopy(read_document("pinned-column").content)
    document["parts"][1]["bow_mm"] = [bow, 0.0]
    path = VjmEngine(32).trace(build_chain(document, "m.toml"), squeezed(30.0, steps=120))
    w = np.array([0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0])
    there = np.interp(w, path.s, path.ramp)
    # the polygon of springs and the chord that the bow shortens by (πa)²/4L, 0.02 mm of 299
    np.testing.assert_allclose(there, column_force(w, LENGTH, EI, bow), rtol=3e-3)
