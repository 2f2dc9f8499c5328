"""Tests by force in which the whole pose is read, under weight and with beams that creep: against closed forms."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from bench import INERTIA, LENGTH, MODULUS, Tube, write
from test_loads import FREE, GAUGES, MID, TIP, chain_of

from vjm.engines import VjmEngine
from vjm_updating.calibration.fit import problem_of
from vjm_updating.diagnosis.kinds import LoadTest, kind_of
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.load_forward import LoadForward
from vjm_updating.inference.observed import observe_loads
from vjm_updating.inference.parameters import coordinates, nuisance_coordinates, start
from vjm_updating.mechanisms.equilibrium_tables import HalfRay, load_table
from vjm_updating.mechanisms.modified_chain import ModifiedMachine


def test_readings_count_from_the_pose_without_the_machines_weight():
    """A uniform load w of a tube in a clamp: ``w L⁴/8 + c w L³/2`` at the tip, and what deflects there turns."""
    mass = 1.7
    machine = ModifiedMachine(chain_of(), VjmEngine.of(48, 1), weight=(("tube", mass),))
    weighed = load_table(machine, HalfRay.of("bench", np.array([0, 0, 1.0, 0, 0, 0]), 100.0), (), FREE, GAUGES)
    w, bend, clamp = mass * 9.80665 / LENGTH, 1.0 / (MODULUS * INERTIA), 1e-9
    tip = w * LENGTH**4 / 8.0 * bend + clamp * w * LENGTH**3 / 2.0
    turn = w * LENGTH**3 / 6.0 * bend + clamp * w * LENGTH**2 / 2.0
    # 48 springs, the weight at their middles: an error of some 1/48²; shear is 1.5 N of 5 MN
    np.testing.assert_allclose(weighed.reading[0, [0, 2]], [-tip, turn], rtol=1e-3)


def test_a_beam_whose_stress_relaxes_deflects_more_under_a_load(tmp_path):
    """A load put on in a second and held: ``φ/(1 − φ)`` of the deflection comes later, by ``τ/(1 − φ)``."""
    data, sheet = write(tmp_path, Tube(), MID, 4)
    readings = data.read_text().splitlines()
    clock = np.concatenate([[0.0, 1.0], np.linspace(2.0, 400.0, 30)])
    lines = ["time_s," + readings[0], *(f"{t:.3f},bench,{100.0 * (t > 0.0)},0,0" for t in clock)]
    data.write_text("\n".join(lines) + "\n")
    observed = observe_loads(read_measurement(data, sheet))
    forward, nuisances = LoadForward(observed), nuisance_coordinates(observed)
    phi, tau = 0.1, 60.0
    effect = next(e for e in LoadTest().effects(observed) if e.label == "creep.link")
    found = coordinates(nuisances, (effect,))
    z = start(found, (effect,), np.zeros(len(nuisances)), [[phi, tau, 0.0, 10.0]])
    crept = (
        forward.evaluate(found, z, (effect,)).prediction - forward.evaluate(nuisances, 0.0 * z[:-4], ()).prediction
    )
    delay = tau / (1.0 - phi)
    # of a ramp of a second the mean of what each of its parts does
    held = 1.0 - np.exp(-(clock[1:] - 1.0) / delay) * delay * (1.0 - np.exp(-1.0 / delay))
    own = [Tube(clamp=0.0).read(name, np.array(100.0), np.array(0.0)) for name in MID[1:]]
    # the tip moves by some 2e-4 of the length along a circle
    np.testing.assert_allclose(crept[1:], phi / (1.0 - phi) * np.outer(held, own), rtol=1e-3)


def test_loads_are_imposed_on_what_bears_them_even_where_the_whole_pose_is_read(tmp_path):
    """A machine with free joints stands by what holds it: there displacements say what it does."""
    held = "x", "y", "rx", "ry", "rz"
    data, sheet = write(tmp_path, Tube(), TIP, 4, held=held)
    assert isinstance(kind_of(read_measurement(data, sheet)), LoadTest)
    model = tmp_path / "tube.toml"
    hinged = model.read_text().replace(
        "[postures]", '[[parts]]\nkind = "joint"\nname = "tip"\naxis = "y"\n\n[postures]'
    )
    model.write_text(hinged.replace("bench = []", "bench = [0.0]"))
    assert not isinstance(kind_of(read_measurement(data, sheet)), LoadTest)


@pytest.mark.parametrize("free", [FREE, tuple(name for name in FREE if name != "ry")])
@pytest.mark.parametrize("segments", [1, 12])
def test_a_softer_beam_is_the_derivative_of_readings(free, segments):
    """Of one spring the strains grow with the square of the pull: its reaction is found from its law."""
    step, load = 1e-4, HalfRay.of("bench", np.array([0.6, 0.0, 0.8, 0.0, 0.0, 0.0]), 5000.0)
    machine = ModifiedMachine(chain_of(), VjmEngine.of(segments, 1))
    there = [
        load_table(m, load, (), free, GAUGES)
        for m in (machine, *(machine.times("tube", np.exp(h)) for h in (step, -step)))
    ]
    difference = (there[1].reading[-1] - there[2].reading[-1]) / (2.0 * step)
    # reason: a central difference of a step of 1e-4 errs by its square
    np.testing.assert_allclose(there[0].by_beam[-1, :, 0], difference, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("names", [(), ("tube.EIz",)])
def test_slopes_by_moduli_are_differences(names, tmp_path):
    """Of a calibration that looks for one bending stiffness the modulus is that of the others."""
    measurement = read_measurement(*write(tmp_path, Tube(), MID, 4))
    if names:
        problem = problem_of(measurement, names)
        forward, found, z = problem.forward(problem.observed), problem.unknowns.all, problem.unknowns.start
    else:
        forward = LoadForward(observe_loads(measurement))
        found = tuple(nuisance_coordinates(forward.observed))
        z = np.zeros(len(found))
    i = next(i for i, c in enumerate(found) if c.kind == "modulus")
    at, step = forward.evaluate(found, z, ()), np.zeros(len(z))
    assert (at.exact(i) is None) == bool(names)
    if not names:
        step[i] = 1e-3
        ahead, back = (forward.evaluate(found, z + sign * step, ()).residual for sign in (1.0, -1.0))
        # reason: a central difference of a thousandth of a sigma of two per cent errs by its square
        np.testing.assert_allclose(at.exact(i), (ahead - back) / 2e-3, rtol=1e-6, atol=1e-12)
