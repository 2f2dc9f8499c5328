"""The few points that stand for a part's stress: what they give under wrenches that were not tried."""

from pathlib import Path

import numpy as np
import pytest
from helpers.solids import drawn, gmsh_or_skip, prism

from vjm_fea.solid.compliance import PartEnds, TipLoad, answer
from vjm_fea.solid.drawing import drawing
from vjm_fea.solid.elasticity import BELOW, ElasticSolid, IsotropicMaterial, away_from_ends, stress_forms, von_mises

FOOT = Path(__file__).parents[3] / "validation/vjm_validation/examples/parts/slotted-foot.step"


@pytest.fixture(scope="module", autouse=True)
def _extra():
    gmsh_or_skip()


def loaded(path, size, base, tip):
    with drawing(path) as opened:
        ends = [tuple(f.number for f in opened.faces if abs(f.centre[0] - x) < 1e-6) for x in (base, tip)]
        solid = ElasticSolid(opened.mesh(size, ends[0] + ends[1]), IsotropicMaterial(70000.0, 0.3))
    u = answer(solid, PartEnds(*ends), TipLoad.SPREAD).displacements
    return solid, u, away_from_ends(solid, [*ends[0], *ends[1]], 8.0)


def highest(forms, wrench):
    return float(np.sqrt(np.max(np.einsum("i,kij,j->k", wrench, forms, wrench))))


def test_no_other_wrench_is_missed():
    solid, u, away = loaded(FOOT, 7.0, 0.0, 120.0)
    points, forms = stress_forms(solid, u, away)
    assert len(points) == len(forms) < 200
    rng = np.random.default_rng(7)
    for _ in range(15):
        wrench = rng.standard_normal(6) * [1000.0, 300.0, 300.0, 5000.0, 9000.0, 9000.0]
        truth = float(np.max(von_mises(solid.stress(u @ wrench))[away]))
        # as near as for those that were tried, and a little for the directions between them
        assert (1.0 - 4.0 * BELOW) * truth <= highest(forms, wrench) <= truth * (1.0 + 1e-9)


def test_a_prism_is_stressed_as_beam_theory_says(tmp_path):
    """Tension and a moment on a prism: force over area and moment over section modulus, all along."""
    path = drawn(tmp_path / "prism.step", prism)
    solid, u, away = loaded(path, 8.0, 0.0, 100.0)
    _, forms = stress_forms(solid, u, away)
    # what a clamped base adds dies out over the section's height; 1 % of it is left half a thickness away
    assert highest(forms, np.array([200.0, 0, 0, 0, 0, 0])) == pytest.approx(1.0, rel=0.06)
    assert highest(forms, np.array([0, 0, 0, 0, 0, 10.0 * 20.0**2 / 6.0])) == pytest.approx(1.0, rel=0.06)
