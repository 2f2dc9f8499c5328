"""The library's machines whose springs have laws, against what a hand computes of them."""

from __future__ import annotations

import numpy as np
import pytest

import vjm


def test_the_scara_turns_by_its_catalogues_slopes():
    """A force of 100 N across the stretched arm: 60 N m at the shoulder, 25 N m at the elbow."""
    found = vjm.stiffness(vjm.load("scara"), "stretched", wrench=(0.0, 100.0, 0.0, 0.0, 0.0, 0.0))
    shoulder = 29.0 / 6.7e4 + (60.0 - 29.0) / 11.0e4
    elbow = 14.0 / 1.0e4 + (25.0 - 14.0) / 1.3e4
    # the levers shorten by the square of a milliradian
    assert found.displacement[5] == pytest.approx(shoulder + elbow, rel=1e-5)
    assert found.displacement[1] == pytest.approx(600.0 * shoulder + 250.0 * elbow, rel=1e-5)
    # at the load the second slopes count, N mm/rad
    compliance = 600.0**2 / 11.0e7 + 250.0**2 / 1.3e7
    assert found.loaded_compliance[1, 1] == pytest.approx(compliance, rel=1e-4)
    assert found.unloaded_compliance[1, 1] == pytest.approx(600.0**2 / 6.7e7 + 250.0**2 / 1.0e7, rel=1e-9)
    assert "joint 'elbow' is between T1 and T2" in found.laws[1]


def test_the_cable_robot_has_the_stiffness_of_its_lines():
    """Four cables of 20 N/mm under 80 N, along (900, 740) over 1165.16 mm."""
    found = vjm.stiffness(vjm.load("planar-cables"))
    length = np.hypot(900.0, 740.0)
    k, t = 20.0, 80.0
    along, across = 900.0 / length, 740.0 / length
    K = np.linalg.inv(found.loaded_compliance[np.ix_([0, 2], [0, 2])])
    # a strain of 1e-6 rounds the law: 1e-3 mm of 4
    assert K[0, 0] == pytest.approx(4.0 * (k * along**2 + t / length * across**2), rel=1e-9)
    assert K[1, 1] == pytest.approx(4.0 * (k * across**2 + t / length * along**2), rel=1e-9)
    assert all(pull == pytest.approx(80.0, rel=1e-9) for pull in found.pulls.values())
    assert "4 of 4 cables are taut, and force-closed" in found.laws[-1]


def test_a_cable_of_the_robot_slackens_where_a_hand_computes_it():
    """Pulled down the lower cables give up their 4 mm: the platform has sunk by 6.3 mm, to first order."""
    machine = vjm.load("planar-cables")
    load = vjm.Load((0.0, 0.0, -1.0, 0.0, 0.0, 0.0))
    path = vjm.trace(machine, vjm.LoadCase("drawn", 400.0, "load", free=vjm_components(), loads=(load,)))
    lower = [change for change in path.law_changes if change.name.startswith("lower")]
    assert {change.region for change in lower} == {"slack"}
    # both at one place, which is one point of the path
    assert np.all(np.diff(path.s) > 0.0)
    # the exact length between the points is the free one
    sunk = 740.0 - np.sqrt(1161.1609330903607**2 - 900.0**2)
    for change in lower:
        assert change.point.displacement[2] == pytest.approx(-sunk, rel=1e-6)


def vjm_components():
    """All components of a pose."""
    return ("x", "y", "z", "rx", "ry", "rz")
