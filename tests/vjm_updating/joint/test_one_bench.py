"""One bench, written as a test of a joint, of loads and of deflections: one answer.

The truth is written here: closed forms of the turn by the torque. Formulas and file formats share nothing with the
finder.
"""

import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from helpers.file_texts import instruments_text, table_text
from helpers.small_machines import lever

from vjm.io.files import toml_text
from vjm.model.laws import Polynomial, StrainWave
from vjm_updating import calibrate, diagnose, load_data
from vjm_updating.data_set import as_joint_test
from vjm_updating.diagnosis.document import Diagnosis, ValueRow
from vjm_updating.inference.fitting import ENOUGH, ROUNDING
from vjm_updating.inference.observed import observe_joint

LEVER, MODELLED, SOFT, NOISE, PLAY, BEND, MOST = 350.0, 1e-7, 1.4e-7, 0.002, 4e-4, 0.5, 90.0
MODEL = lever(LEVER, MODELLED, mass_kg=3.0, centre_of_mass_mm=[175.0, 0.0, 0.0])
JOINT = (
    'kind = "joint"\n'
    + table_text("test", model="arm.toml", joint="elbow")
    + table_text("lever", force_mm=LEVER, gauge_mm=LEVER)
    + instruments_text(deflection_mm=(NOISE,), force_N=(0.001,))
)
LOADS = (
    table_text("test", model="arm.toml", control="force")
    + table_text("postures", home={"elbow": 0.0})
    + instruments_text(fy_N=(0.001,), uy_mm=(NOISE,))
)
DEFLECTIONS = (
    'kind = "deflections"\n'
    + table_text("test", model="arm.toml", order="as taken")
    + table_text("loads.tool", on="lever")
    + table_text("markers.tip", on="lever", sigma_mm=0.01)
    + table_text("tracker", noise_mm=NOISE, sigma_rad=1e-4)
)
END = 2.0 * np.sqrt(ENOUGH * ROUNDING)
"""Standard deviations by which two fits may differ: each ends where less than so many squares are left to gain."""
TURNS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "nothing": lambda torque: MODELLED * torque,
    "soft": lambda torque: SOFT * torque,
    "backlash": lambda torque: SOFT * torque + np.sign(torque) * PLAY / 2.0,
    # a compliance that falls with the square of the torque
    "hardening": lambda torque: SOFT * torque * (1.0 - BEND / 3.0 * (torque / (MOST * LEVER)) ** 2),
}
FOUND = {
    "nothing": (),
    "soft": ("actuator_compliance",),
    "backlash": ("actuator_backlash", "actuator_compliance"),
    "hardening": ("actuator_hardening",),
}
BY_NOISE = ("soft", 23)
"""The one draw of 150 in which noise makes another cause of the class the likelier: it fits 5.4 squares better."""


def written(folder: Path, kind: str, seed: int) -> dict[str, tuple[Path, Path]]:
    """The bench's readings in three formats."""
    up = np.linspace(0.0, MOST, 13)[1:]
    force = np.concatenate([up, up[-2::-1], -up, -up[-2::-1]])
    shift = LEVER * np.sin(TURNS[kind](force * LEVER))
    shift = shift + NOISE * np.random.default_rng([seed, 31]).standard_normal(len(force))
    tables = {
        "joint": (JOINT, {"force_N": force, "deflection_mm": shift}),
        "loads": (LOADS, {"posture": ["home"] * len(force), "fy_N": force, "uy_mm": shift}),
        "deflections": (DEFLECTIONS, {"posture": ["home"] * len(force), "tool.fy_N": force, "tip.dy_mm": shift}),
    }
    (folder / "arm.toml").write_text(MODEL)
    files = {}
    for name, (sheet, columns) in tables.items():
        files[name] = folder / f"{name}.csv", folder / f"{name}.toml"
        rows = [",".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
        files[name][0].write_text("\n".join([",".join(columns), *rows]) + "\n")
        files[name][1].write_text(sheet)
    return files


def said(found: Diagnosis) -> tuple[str, list[list[str]], list[str]]:
    return found.verdict, [row.causes for row in found.candidates], [row.cause for row in found.findings.causes]


CASES = [
    pytest.param(kind, seed, marks=() if (kind, seed) == ("backlash", 0) else pytest.mark.slow)
    for kind in TURNS
    for seed in range(50)
]


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_three_formats_of_one_bench_get_one_answer(tmp_path, kind, seed):
    answers = {name: diagnose(load_data(*files)).figures for name, files in written(tmp_path, kind, seed).items()}
    first = answers["joint"]
    for other in answers.values():
        assert said(other) == said(first)
        for mine, row in zip(first.candidates, other.candidates, strict=True):
            # reason: what the deflections' sheet does not say of the load is below a millionth of the variance
            assert row.probability == pytest.approx(mine.probability, abs=0.01)
            for name, value in mine.parameters.items():
                if isinstance(value, ValueRow):
                    assert row.parameters[name].value == pytest.approx(value.value, abs=END * value.std), name
    assert first.verdict in (("none",) if kind == "nothing" else ("named", "class"))
    if kind != "nothing":
        causes = [sorted(row.causes) for row in first.candidates]
        assert sorted(FOUND[kind]) in causes
        assert causes[0] == sorted(FOUND[kind]) or (kind, seed) == BY_NOISE


def with_law(law):
    """The model with a law in the place of the elbow's compliance."""
    model = tomllib.loads(MODEL)
    part = next(part for part in model["parts"] if part["name"] == "elbow")
    del part["compliance_rad_per_Nmm"]
    part["law"] = law.table(slides=False)
    return toml_text(model)


def test_three_formats_get_one_answer_by_a_model_with_a_law(tmp_path):
    answers, k = {}, 1.0 / MODELLED
    for name, files in written(tmp_path, "soft", 3).items():
        (tmp_path / "arm.toml").write_text(with_law(StrainWave(K1=k, K2=1.1 * k, K3=1.2 * k, T1=1e4, T2=2e4)))
        answers[name] = diagnose(load_data(*files)).figures
    first = answers["joint"]
    assert first.verdict in ("named", "class")
    assert all(said(other) == said(first) for other in answers.values())


def test_a_calibration_is_compared_with_the_slope_of_the_law_at_no_load(tmp_path):
    files, k = written(tmp_path, "soft", 3)["joint"], 1.0 / MODELLED
    stiffer = Polynomial(K1=k, range=(-0.005, 0.005), K3=1e4 * k)
    (tmp_path / "arm.toml").write_text(with_law(stiffer))
    rows = {row.name: row for row in calibrate(load_data(*files)).figures.parameters}
    row, ratio = rows["elbow.stiffness"], rows["elbow.stiffness_ratio"]
    assert row.nominal == pytest.approx(k, rel=1e-9)
    assert row.over_nominal == pytest.approx(MODELLED / SOFT, rel=0.05)
    largest = stiffer.deflection(MOST * LEVER)
    # the noise of the largest load that was read: a thousandth of a N of 90
    assert ratio.nominal == pytest.approx(float(stiffer.tangent(largest)) / k, rel=1e-3)


@pytest.mark.slow
def test_three_formats_are_calibrated_alike(tmp_path):
    rows = {
        name: calibrate(load_data(*files)).figures.parameters
        for name, files in written(tmp_path, "backlash", 1).items()
    }
    names = [row.name for row in rows["joint"]]
    assert names == ["elbow.stiffness", "elbow.stiffness_ratio", "elbow.backlash", "elbow.friction"]
    for found in rows.values():
        assert [row.name for row in found] == names
        for mine, other in zip(rows["joint"], found, strict=True):
            assert other.value == pytest.approx(mine.value, abs=END * mine.std)
    backlash = rows["joint"][2]
    assert abs(backlash.value - PLAY) < 4.0 * backlash.std


def test_levers_and_signs_are_those_of_the_posture(tmp_path):
    """A load at another place than the gauge, in the tool's axes, of a joint that stands turned."""
    files = written(tmp_path, "soft", 1)
    data, sheet = files["deflections"]
    head, *rows = data.read_text().splitlines()
    # turned by −90°, the lever points along −y: a load along the tool's y, which is x, and a gauge that reads x
    data.write_text("\n".join([head.replace("dy_mm", "dx_mm"), *rows]) + "\n")
    (tmp_path / "arm.toml").write_text(MODEL.replace("elbow = 0.0 }", f"elbow = {-np.pi / 2.0} }}"))
    own = '[loads.tool]\non = "lever"\naxes = "tool"\nposition_mm = [-50.0, 0.0, 0.0]\n'
    sheet.write_text(DEFLECTIONS.replace('[loads.tool]\non = "lever"\n', own))
    found = as_joint_test(load_data(data, sheet).test)
    assert found is not None
    assert found.sheet.lever.force_mm == pytest.approx(LEVER - 50.0)
    assert found.sheet.lever.gauge_mm == pytest.approx(LEVER)
    np.testing.assert_allclose(
        found.readings.values["force_N"], load_data(*files["joint"]).test.readings.values["force_N"]
    )
    # a gauge behind the axis goes the other way
    sheet.write_text(sheet.read_text().replace("sigma_mm = 0.01", f"position_mm = [{-1.5 * LEVER}, 0.0, 0.0]"))
    behind = as_joint_test(load_data(data, sheet).test)
    assert behind is not None
    assert behind.sheet.lever.gauge_mm == pytest.approx(0.5 * LEVER)
    np.testing.assert_allclose(behind.readings.values["deflection_mm"], -found.readings.values["deflection_mm"])


@pytest.mark.parametrize(
    ("model", "sheet"),
    [
        (("compliance_rad_per_Nmm", "lateral_rad_per_Nmm = [1e-9, 1e-9]\ncompliance_rad_per_Nmm"), ("", "")),
        (("", ""), ('model = "arm.toml"', 'model = "arm.toml"\ngravity = [0.0, -9.81, 0.0]')),
        (("", ""), ('order = "as taken"', 'order = "unknown"')),
        (("", ""), ("sigma_rad = 0.0001", 'sigma_rad = 1e-4\naxes = "own"')),
    ],
    ids=["lateral", "weight", "order", "axes"],
)
def test_what_sees_more_than_one_joint_stays_what_it_is(tmp_path, model, sheet):
    data, page = written(tmp_path, "soft", 1)["deflections"]
    assert model[0] in MODEL
    assert sheet[0] in DEFLECTIONS
    (tmp_path / "arm.toml").write_text(MODEL.replace(*model))
    page.write_text(DEFLECTIONS.replace(*sheet))
    assert as_joint_test(load_data(data, page).test) is None


def test_a_unit_is_told_in_the_files_own_names(tmp_path):
    data, sheet = written(tmp_path, "soft", 1)["deflections"]
    head, *rows = data.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    data.write_text("\n".join([head, *(f"{p},{f},{float(d) / 1e3!r}" for p, f, d in cells)]) + "\n")
    with pytest.raises(ValueError, match=r"tip\.dy_mm in m instead of mm"):
        diagnose(load_data(data, sheet))


@pytest.mark.parametrize(("step", "weights"), [(1.0, True), (0.7, False), (0.12, False)])
def test_weights_are_no_rounded_readings(tmp_path, step, weights):
    """Forces in steps of 5 N: set there, or read to 5 N while the lever goes in steps of a share of that."""
    data, sheet = written(tmp_path, "soft", 1)["joint"]
    up = 5.0 * step * np.arange(1, 31)
    force = np.concatenate([up, up[-2::-1], -up, -up[-2::-1]])
    shift = SOFT * LEVER**2 * force + NOISE * np.random.default_rng(5).standard_normal(len(force))
    read = 5.0 * np.round(force / 5.0)
    rows = [f"{f},{d}" for f, d in zip(read, shift, strict=True)]
    data.write_text("\n".join(["force_N,deflection_mm", *rows]) + "\n")
    test = load_data(data, sheet)
    noise = float(observe_joint(test.test).noise.wrench[0])
    assert noise == pytest.approx(0.001 if weights else 5.0 / np.sqrt(12.0), rel=1e-6)
    assert any("were digits lost" in str(one) for one in test.considered()) != weights
