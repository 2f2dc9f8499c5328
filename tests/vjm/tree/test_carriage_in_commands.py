"""A machine with a carriage in the commands of robots: postures, compensation."""

import numpy as np
import pytest
from helpers.riding import EI, LENGTH, cantilever, on_rails

import vjm
from vjm.machine.inverse_kinematics import ReachError


def test_a_carriage_is_put_where_the_loaded_tool_should_be():
    """Along a cantilever under gravity-free load nothing sags along the beam; a soft drive gives c F along it."""
    c, force = 1e-4, 300.0
    machine = cantilever(compliance=c)
    places = [(100.0, 0.0, 0.0), (900.0, 0.0, 0.0)]
    found = vjm.compensate(machine, places, wrenches=[(force, 0.0, 0.0, 0.0, 0.0, 0.0)] * 2)
    assert found.q[:, 0] == pytest.approx([100.0, 900.0], abs=1e-9)
    # the drive deflects by c F, the beam before the carriage stretches by F x/EA = 3e-6 x
    stretched = force / 1e8
    exact = [(x - c * force) / (1.0 + stretched) for x in (100.0, 900.0)]
    assert found.q_loaded[:, 0] == pytest.approx(exact, abs=1e-6)
    assert found.largest_mm["loaded"] < 1e-6


def test_the_sag_of_a_bridge_is_put_right_by_what_moves_across_it():
    """A ram on the carriage takes out F x³/3EI of the cantilever that carries it."""
    force = 50.0
    base = cantilever()
    ram = vjm.Joint("w", vjm.axis("z"), slides=True, limits=(-100.0, 100.0))
    machine = vjm.build("crane", [*base.parts, ram], {"there": {"x": 400.0, "w": 0.0}})
    places = [(x, 0.0, 0.0) for x in (0.0, 250.0, 731.0, LENGTH)]
    found = vjm.compensate(machine, places, wrenches=[(0.0, 0.0, -force, 0.0, 0.0, 0.0)] * 4)
    exact = [force * x**3 / (3.0 * EI) for x, _, _ in places]
    # second order: the slope's square
    assert found.q_loaded[:, found.joints.index("w")] == pytest.approx(exact, rel=1e-4, abs=1e-9)
    assert found.largest_mm["loaded"] < 1e-6


def test_a_gantry_reaches_places_and_says_which_it_does_not():
    """Its ram hangs 300 mm below the bridge, u along the rails and w along the bridge give the place."""
    machine = on_rails()
    places = [(0.0, 0.0, -300.0), (300.0, 400.0, -300.0), (800.0, LENGTH, -300.0)]
    for place in places:
        (found,) = vjm.tool_postures(machine, place)
        assert (found["u"], found["w"]) == pytest.approx(place[:2], abs=1e-9)
    found = vjm.compensate(machine, places[1:2], wrenches=[(60.0, 40.0, -200.0, 0.0, 0.0, 0.0)])
    # only the sag remains, which neither drive moves
    assert np.abs(found.loaded[0, :2]).max() < 1e-6 < -found.loaded[0, 2]
    with pytest.raises(ReachError, match="u = 900 exceeds its limit 800"):
        vjm.compensate(machine, [(900.0, 400.0, -300.0)])
