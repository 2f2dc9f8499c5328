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


def test_the_compensator_bears_the_weight_that_a_hand_computes():
    """Level: 1.5 kN m of weight at the shoulder, 6.4 kN of pull at 86 mm, and the turns of both drives."""
    machine, g = vjm.load("compensated-arm"), 9.81

    def pull(length):
        u = length - 250.0
        return 4000.0 + 5.7143 * u + 8.1633e-3 * u**2 + 1.16618e-5 * u**3

    def torques(turn):
        """At shoulder and elbow, towards larger coordinates, downwards: from weights, pull, and drives."""
        a, b = np.cos(turn[0]), np.cos(turn[0] + turn[1])
        elbow = g * (35.0 * 300.0 + 50.0 * 800.0) * b
        shoulder = g * (60.0 * 400.0 + 85.0 * 900.0) * a + elbow
        # the point on the upper arm, from the shoulder, x and z
        point, anchor = 300.0 * np.array([a, -np.sin(turn[0])]), np.array([-200.0, 150.0])
        way = anchor - point
        force = pull(np.linalg.norm(way)) * way / np.linalg.norm(way)
        shoulder += point[1] * force[0] - point[0] * force[1]
        return np.array([shoulder, elbow])

    compliance = np.array([4e-10, 8e-10])
    turn = np.zeros(2)
    # each turn changes the torques by 1e-3 of itself
    for _ in range(20):
        turn = compliance * torques(turn)
    found = vjm.stiffness(machine, "level", wrench=(0.0,) * 6, gravity=(0.0, 0.0, -g))
    held = torques(turn)
    assert found.torques["shoulder"] == pytest.approx(-held[0], rel=1e-9)
    assert found.torques["elbow"] == pytest.approx(-held[1], rel=1e-9)
    assert found.displacement[4] == pytest.approx(turn.sum(), rel=1e-9)
    sunk = -900.0 * np.sin(turn[0]) - 800.0 * np.sin(turn.sum())
    assert found.displacement[2] == pytest.approx(sunk, rel=1e-9)
    # without it the shoulder bears 1.6 times as much, to what a millimetre of sag changes
    relieved = 300.0 * pull(522.0) * 150.0 / 522.0
    assert (held[0] + relieved) / held[0] == pytest.approx(1.59, abs=0.005)


def vjm_components():
    """All components of a pose."""
    return ("x", "y", "z", "rx", "ry", "rz")
