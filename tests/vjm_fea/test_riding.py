"""A joint that rides on a beam: the virtual joint method against two finite element engines."""

import numpy as np
import pytest
from helpers.riding import PLACES, cantilever, clamped, on_rails

import vjm
from vjm.baselines.msa import msa_stiffness
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.postures import in_posture
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.opensees import OpenSeesEngine, available

ENGINES = [
    ExudynEngine,
    pytest.param(OpenSeesEngine, marks=pytest.mark.skipif(not available(), reason="OpenSeesPy is not installed")),
]
WRENCH = (100.0, 200.0, -1500.0, 1e4, 0.0, 3e3)


def at_end(machine, posture, engine):
    """Displacement of the end under weight and a wrench."""
    there, label = in_posture(machine, posture)
    case = LoadCase(
        label, 1.0, "load", free=COMPONENTS, loads=(Load(WRENCH, ""),), gravity=(0.0, 0.0, -9.81), steps=1
    )  # fmt: skip
    return engine.trace(there, case).points[-1].displacement


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "machine",
    [cantilever(5.0, compliance=1e-5, lateral=(1e-8, 2e-8)), clamped()],
    ids=lambda machine: machine.name,
)
def test_ten_places_of_a_carriage(machine, engine):
    for place in PLACES:
        found, other = (at_end(machine, {"x": place}, each) for each in (vjm.VjmEngine(16), engine()))
        size = np.abs(found[:3]).max()
        # 16 elements on the beam: 1/16² of the second order of a bend of 0.07 rad, and of the fourth
        assert other[:3] == pytest.approx(found[:3], abs=2e-5 * size + 1e-12), place


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("posture", ["a", "b", "c"])
def test_a_bridge_on_two_elastic_rails(engine, posture):
    machine = on_rails()
    found, other = (at_end(machine, posture, each) for each in (vjm.VjmEngine(16), engine()))
    assert other[:3] == pytest.approx(found[:3], abs=2e-5 * np.abs(found[:3]).max())


@pytest.mark.parametrize("posture", ["a", "b", "c"])
def test_matrix_structural_analysis_of_the_bridge(posture):
    """Without load both are exact for beams."""
    machine = on_rails()
    found = vjm.stiffness(machine, posture, wrench=(0.0,) * 6).unloaded
    exact = msa_stiffness(machine.at(posture), machine.posture(posture))
    assert found == pytest.approx(exact, rel=1e-7, abs=1e-7 * np.abs(exact).max())
