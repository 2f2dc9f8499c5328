"""An arc in straight sides: its corners lie on it, and in a plane it is as flexible to the fourth order."""

import numpy as np
import pytest

from vjm.baselines import MsaEngine
from vjm.model.load_case import LoadCase
from vjm_validation.verification.library import ArcTable, case_by_name
from vjm_validation.verification.runner import arc_chain, place, unloaded_position

ARC = ArcTable.model_validate(
    {
        "radius_mm": 100.0,
        "angle_deg": 90.0,
        "section": {"EA_N": 1e8, "GJ_Nmm2": 1e6, "EIy_Nmm2": 1e6, "EIz_Nmm2": 1e6},
    }
)


@pytest.mark.parametrize("sides", [1, 3, 8])
def test_the_end_lies_on_the_arc(sides):
    assert unloaded_position(arc_chain("arc", ARC, sides)) == pytest.approx([100.0, -100.0, 0.0], abs=1e-9)


def test_its_flexibility_converges_with_the_fourth_order():
    # Castigliano for a quarter circle under a force at its end: moments F R cos φ along x, F R (1 − sin φ) along y
    R, EI, EA = 100.0, 1e6, 1e8
    ring = R**3 / EI
    stretch = R / EA
    exact = np.array(
        [
            [ring * np.pi / 4.0 + stretch * np.pi / 4.0, 0.0],
            [0.0, ring * (0.75 * np.pi - 2.0) + stretch * np.pi / 4.0],
        ]
    )
    errors = []
    for sides in (4, 8, 16):
        chain = arc_chain("arc", ARC, sides)
        path = MsaEngine().trace(chain, LoadCase("straight", 1e-3))
        C = np.linalg.inv(path.points[0].stiffness)
        errors.append(max(abs(C[i, i] / exact[i, i] - 1.0) for i in (0, 1)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.2)
    assert errors[-1] < 1e-5


def test_points_of_an_arc_are_its_corners():
    assert place("arc", 0.5, 8) == ("corner-4", 0.0)
    assert place("bar", 0.3, 8) == ("bar", 0.3)
    with pytest.raises(ValueError, match="no corner"):
        place("arc", 0.5, 5)


def test_a_chain_of_a_case_has_its_posture():
    from vjm_validation.verification.runner import chain_of

    chain = chain_of(case_by_name("column-pinned"), 4)
    assert chain.posture("straight").tolist() == [0.0, 0.0]
