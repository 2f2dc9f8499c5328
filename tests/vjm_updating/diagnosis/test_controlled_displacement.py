"""A diagnosis of a test that was driven steadily: what it takes for the displacement, and for its errors."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import linear_arm
from helpers.file_texts import instruments_text, table_text
from helpers.from_files import diagnose

from vjm_updating.diagnosis.experiment import propose
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.experiment import measurement as reading
from vjm_updating.experiment.data_file import WRENCH
from vjm_updating.experiment.measurement import read_measurement
from vjm_updating.inference.fitting import best_fit
from vjm_updating.inference.forward import Forward, followed_share, observe_ramps
from vjm_updating.inference.instruments import ThermalDrift
from vjm_updating.inference.observed import Observed, observe
from vjm_updating.inference.parameters import coordinates, nuisance_coordinates, start
from vjm_updating.mechanisms.drives import ActuatorCompliance
from vjm_updating.mechanisms.hysteresis import Creep

PER = 12


def true_displacement(make) -> np.ndarray:
    return np.array([row[3] for row in make.load_case(("A", "B"), 1.5, PER)])


@pytest.fixture(scope="module")
def files(make, tmp_path_factory):
    """A test with nothing hidden, driven along straight lines."""
    with pytest.MonkeyPatch.context() as patch:
        return make.made_up(tmp_path_factory.mktemp("steady"), {}, 5, patch, per=PER)


def test_what_the_gauge_reads_beside_lines_is_its_noise(make, files):
    observed = observe_ramps(reading.read_measurement(files.data, files.sheet))
    off = observed.readings.pose[:, 0] - true_displacement(make)
    left = observed.imposed[:, 0] - true_displacement(make)
    assert (observed.steady[0].moved == 0.0).all()
    # of the noise that is left which looks like lines; the file has six digits
    lines = observed.steady[0].lines
    assert np.abs(left - lines @ (lines.T @ off)).max() < 1e-6
    # of independent noise that is the share of the lines' parameters, known to √(2/s), a quarter of it
    share = lines.shape[1] / len(left)
    assert share < 0.3
    assert np.sum(left**2) == pytest.approx(share * np.sum(off**2), rel=0.3)


def test_of_a_gauge_that_drifts_the_drive_is_left(files):
    observed = observe_ramps(reading.read_measurement(files.data, files.sheet))
    # the reading's drift went through the same lines as its noise
    clock = observed.clock
    drift = 2e-5 * clock
    text = files.data.read_text().splitlines()
    at = text[0].split(",").index("ux_mm")
    rows = [line.split(",") for line in text[1:]]
    for row, more in zip(rows, drift, strict=True):
        row[at] = f"{float(row[at]) + more:.6f}"
    moved = files.data.with_name("drifting.csv")
    moved.write_text("\n".join([text[0], *(",".join(row) for row in rows)]) + "\n")
    drifting = observe_ramps(reading.read_measurement(moved, files.sheet))
    assert 0 in drifting.steady
    effect = ThermalDrift(part="ux_mm", by="s", span=float(np.ptp(clock)), since=0.0)
    nuisances = nuisance_coordinates(drifting)
    found = coordinates(nuisances, (effect,))
    z = start(found, (effect,), np.zeros(len(nuisances)), [[2e-5, 0.0]])
    place = Forward(drifting).evaluate(found, z, (effect,)).place[:, 0]
    expected = drifting.steady[0].regressed(observed.readings.pose[:, 0])
    # the file has six digits
    assert np.abs(place - expected).max() < 1e-6


@pytest.mark.slow
def test_noise_of_the_gauge_makes_no_drift_of_a_steady_ramp(make, tmp_path, monkeypatch):
    """A drift with the clock takes a steady ramp's place, and forces then need none of the gauge's noise."""
    hidden = {"actuator_compliance": (4e-5,)}
    files = make.made_up(tmp_path / "made", hidden, 2, monkeypatch, per=45, postures=("A",))
    names, *lines = files.data.read_text().splitlines()
    rows = [line.split(",") for line in lines[:45]]
    rng = np.random.default_rng(6)
    for row in rows:
        row[3] = f"{float(row[3]) + 0.01 * rng.standard_normal():.6f}"
    files.data.write_text("\n".join([names, *(",".join(row) for row in rows)]) + "\n")
    files.sheet.write_text(files.sheet.read_text().replace("noise = 0.001", "noise = 0.01"))
    found = diagnose(files.data, files.sheet, tmp_path / "out")
    assert not any("thermal_drift" in c.causes for c in found.candidates)


@pytest.mark.slow
def test_the_next_experiment_counts_on_being_driven_as_steadily(make, tmp_path, monkeypatch):
    files = make.made_up(tmp_path / "made", {"actuator_hardening": (1.5,)}, 4, monkeypatch, per=PER)
    prepared = prepare(observe_ramps(reading.read_measurement(files.data, files.sheet)))
    start_ = np.zeros(len(prepared.fitter.nuisances))
    fits = []
    # a base's six compliances could make up for the actuator's along the one line of the test: no test tells them
    for cause, values in (("actuator_compliance", [3e-5]), ("link_compliance", [1.05])):
        effect = next(e for e in prepared.effects if e.cause == cause)
        fits.append(best_fit(prepared.fitter, (effect,), start_, [values]))
    told = propose(prepared.fitter, fits)
    observed = prepared.fitter.forward.observed
    assert 0 in observed.steady
    prepared.fitter.forward.observed = replace(observed, steady={})
    blind = propose(prepared.fitter, fits)
    assert told is not None
    assert blind is not None
    assert told.path == blind.path
    assert told.strength > blind.strength


# Gauges on axes that nobody drives: their noise is no displacement. Readings by virtual work, see `linear_arm`.


ANGLES = {"bent": (0.5, 0.9), "folded": (-0.4, 2.1)}
GAUGES = {"ux_mm": 5e-4, "uy_mm": 5e-4, "uz_mm": 5e-4}
NOISE = {name: 0.5 if name.endswith("_N") else 100.0 for name in WRENCH}
DRIVEN, REACH = (0, 2), 0.1


def measured(folder: Path, seed: int, *, wander: float = 0.0, control: str = "displacement") -> tuple[Path, Path]:
    """Data and sheet of an arm as drawn, driven along x and along z in turn; idle axes move by ``wander`` mm."""
    rng = np.random.default_rng(seed)
    links = linear_arm.arm("upper", "fore")
    to = np.linspace(0.0, REACH, 8)
    s = np.concatenate([to, to[-2::-1], -to[1:], -to[-2::-1]])
    zero = {name: sigma * rng.standard_normal() for name, sigma in (GAUGES | NOISE).items()}
    rows = [f"time_s,posture,{','.join(GAUGES)},{','.join(WRENCH)}"]
    clock = 0.0
    for posture, angles in ANGLES.items():
        K = np.linalg.inv(linear_arm.Arm(links, angles).compliance())
        for axis in DRIVEN:
            for at in s:
                u = wander * rng.standard_normal(6) * [1, 1, 1, 0, 0, 0]
                u[axis] = at
                read = [u[i] + zero[n] + GAUGES[n] * rng.standard_normal() for i, n in enumerate(GAUGES)]
                read += [v + zero[n] + NOISE[n] * rng.standard_normal() for n, v in zip(NOISE, K @ u, strict=True)]
                rows.append(f"{clock},{posture},{','.join(f'{v:.6f}' for v in read)}")
                clock += 2.0
            clock += 60.0
    model, data, sheet = folder / "arm.toml", folder / "data.csv", folder / "sheet.toml"
    model.write_text(linear_arm.model(links, ANGLES))
    data.write_text("\n".join(rows) + "\n")
    sheet.write_text(
        table_text("test", title="an arm of one's own", model=str(model), control=control)
        + table_text("postures", bent=[], folded=[])
        + table_text("tolerance", link_length_mm=0.2, modulus_rel=0.02)
        + instruments_text(**{n: (v, v, 0.003) for n, v in (GAUGES | NOISE).items()})
    )
    return data, sheet


def observed(files: tuple[Path, Path]) -> Observed:
    return observe_ramps(read_measurement(*files))


def test_an_idle_axis_stands_at_its_mean(tmp_path: Path) -> None:
    files = measured(tmp_path, 0)
    found, read = observed(files), observe(read_measurement(*files))
    assert sorted(found.steady) == [0, 1, 2]
    for k in range(3):
        own = [ray for ray in found.rays if ray.direction[k] == 0.0]
        # each of two postures is driven along x and along z: y is idle on all four rays, x and z on two
        assert len(own) == (4 if k == 1 else 2)
        for ray in own:
            assert np.ptp(found.imposed[ray.index, k]) < 1e-12
            assert found.imposed[ray.index, k].mean() == pytest.approx(read.imposed[ray.index, k].mean(), abs=1e-12)
            assert (found.pose_noise[ray.index, k] == 0.0).all()
    for ray in found.rays:
        (driven,) = np.flatnonzero(ray.direction)
        np.testing.assert_array_equal(found.imposed[ray.index, driven], read.imposed[ray.index, driven])
        np.testing.assert_array_equal(found.pose_noise[ray.index, driven], read.pose_noise[ray.index, driven])


def test_one_that_wanders_is_as_read(tmp_path: Path) -> None:
    assert not observed(measured(tmp_path, 0, wander=3e-3)).steady


@pytest.mark.parametrize(("wander", "share"), [(0.0, 0.0), (5e-4, 0.5), (3e-3, 36.0 / 37.0)])
def test_forces_tell_how_much_of_a_gauge_is_displacement(tmp_path: Path, wander: float, share: float) -> None:
    """Of a gauge with noise s on an axis that moves by w, w² of w² + s² is displacement."""
    shares = []
    for seed in range(4):
        read = observe(read_measurement(*measured(tmp_path, seed, wander=wander)))
        nuisances = nuisance_coordinates(read)
        at = Forward(read).evaluate(coordinates(nuisances, ()), np.zeros(len(nuisances)), ())
        shares += [followed_share(read, at, k) for k in range(3)]
    # twelve of a standard deviation of some 0.12 each
    assert np.mean(shares) == pytest.approx(share, abs=0.1)


def test_under_force_every_axis_moves(tmp_path: Path) -> None:
    assert not observed(measured(tmp_path, 0, control="force")).steady


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_noise_of_idle_gauges_makes_no_cause(tmp_path: Path, seed: int) -> None:
    found = diagnose(*measured(tmp_path, seed), tmp_path / "out")
    assert found.verdict == "none"
    assert not found.findings.groups
    assert all(row.word == "may act" for row in found.findings.causes)


# A beam that relaxes beside other elements, by what predicts the readings.


DRIVE = 5e-5
"""mm/N."""


@pytest.mark.parametrize("part", ["foot", "link"])
def test_a_drive_in_series_is_the_drive_in_a_chain_that_relaxes(make, tmp_path, monkeypatch, part):
    # ones, of which no unit can be told
    monkeypatch.setattr(reading, "check_units", lambda *args: None)
    rows = make.load_case(("A", "B"), 1.5, 8)
    true = np.array([row[3] for row in rows])
    softer = make.SHEET.replace("[model]\n", f"[model]\nactuator_compliance_mm_per_N = {DRIVE}\n")

    def force(sheet, hypothesis, values):
        files = make.write(tmp_path, rows, np.ones((len(rows), 6)), true, sheet)
        found = coordinates([], hypothesis)
        at = Forward(observe_ramps(reading.read_measurement(files.data, files.sheet)))
        return at.evaluate(found, start(found, hypothesis, np.zeros(0), values), hypothesis).prediction[:, 0]

    creep, values = Creep(part), (0.05, 20.0, 0.25, 10.0)
    built_in = force(softer, (creep,), [values])
    relaxes = force(softer, (), []) - built_in
    in_series = force(make.SHEET, (creep, ActuatorCompliance()), [values, (DRIVE,)])
    assert np.abs(relaxes).max() > 5.0
    # measured 2e-5: rounds of what relaxes and of the drive, whose last change is of the third order in their sizes
    np.testing.assert_allclose(in_series, built_in, rtol=0.0, atol=1e-4 * np.abs(relaxes).max())
