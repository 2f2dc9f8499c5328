"""Robots by the sum over chains of finite elements: the third engine, and the sum itself against one system."""

import numpy as np
import pytest

from vjm.io.manipulator_file import load_manipulator
from vjm.platform.rigid import inverse_kinematics
from vjm_fea.common.manipulator_sum import SummedPlatform
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.exudyn.manipulator_engine import ManipulatorExudynEngine, platform_stiffness
from vjm_fea.opensees.engine import OpenSeesEngine

# of vjm-8f8 along the whole robot's path; Exudyn's whole system has 8851.8, 6628.7 and 4647.2 with 8 elements
CRITICAL = {"isotropic": 8849.9, "Q1": 6627.4, "Q2": 4646.2}


@pytest.fixture(scope="module")
def machine():
    return load_manipulator("orthoglide")


def summed(machine, engine, label):
    return SummedPlatform(inverse_kinematics(machine, machine.displacement(label)), engine.problem)


@pytest.mark.parametrize("label", ["isotropic", "Q2"])
def test_the_sum_over_exudyns_chains_is_the_whole_systems_stiffness(machine, label):
    found = summed(machine, ExudynEngine(elements=4), label).rest.stiffness
    whole = platform_stiffness(ManipulatorExudynEngine(elements=4), machine, label, np.zeros(6))
    assert np.abs(found - whole).max() < 1e-6 * np.abs(whole).max()


@pytest.mark.parametrize(
    "label", ["isotropic", pytest.param("Q1", marks=pytest.mark.slow), pytest.param("Q2", marks=pytest.mark.slow)]
)
def test_opensees_buckles_the_whole_robot_where_the_others_do(machine, label):
    pytest.importorskip("openseespy", reason="OpenSeesPy is an optional extra and is not installed")
    platform = summed(machine, OpenSeesEngine(8), label)
    found = platform.critical_force(np.array([-1.0, 0.0, 0.0]), 1000.0, 12_000.0, 1e-3)
    assert found == pytest.approx(CRITICAL[label], rel=5e-3)


def test_a_robot_with_bodies_between_is_refused():
    delta = load_manipulator("delta")
    with pytest.raises(ValueError, match="all run from base to platform"):
        SummedPlatform(inverse_kinematics(delta, np.zeros(6)), ExudynEngine().problem)
