"""Gauges on axes that nobody drives: their noise is no displacement. Readings by virtual work, see `linear_arm`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers import linear_arm
from helpers.from_files import diagnose

from vjm_updating.experiment.data_file import WRENCH
from vjm_updating.experiment.measurement import read_measurement
from vjm_updating.inference.forward import Forward, followed_share, observe_ramps
from vjm_updating.inference.observed import Observed, observe
from vjm_updating.inference.parameters import coordinates, nuisance_coordinates

ANGLES = {"bent": (0.5, 0.9), "folded": (-0.4, 2.1)}
GAUGES = {"ux_mm": 5e-4, "uy_mm": 5e-4, "uz_mm": 5e-4}
NOISE = {name: 0.5 if name.endswith("_N") else 100.0 for name in WRENCH}
DRIVEN, REACH = (0, 2), 0.1
HEAD = """[test]
title = "an arm of one's own"
model = "{model}"
control = "{control}"
[postures]
bent = []
folded = []
[tolerance]
link_length_mm = 0.2
modulus_rel = 0.02
"""
INSTRUMENT = "[instrument.{name}]\nnoise = {noise}\nzero = {noise}\nscale = 0.003\n"


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
    instruments = (INSTRUMENT.format(name=n, noise=v) for n, v in (GAUGES | NOISE).items())
    sheet.write_text(HEAD.format(model=model, control=control) + "".join(instruments))
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
            assert np.ptp(found.pose[ray.index, k]) < 1e-12
            assert found.pose[ray.index, k].mean() == pytest.approx(read.pose[ray.index, k].mean(), abs=1e-12)
            assert (found.pose_noise[ray.index, k] == 0.0).all()
    for ray in found.rays:
        (driven,) = np.flatnonzero(ray.direction)
        np.testing.assert_array_equal(found.pose[ray.index, driven], read.pose[ray.index, driven])
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
