"""Intervals of extrapolated compliances: they hold what much finer meshes say, entry by entry."""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers.solids import gmsh_or_skip

from vjm_fea.solid.compliance import TipLoad
from vjm_fea.solid.drawing import drawing
from vjm_fea.solid.elasticity import IsotropicMaterial
from vjm_fea.solid.identify import HIGHEST, SolidTask, identify, limit

FOLDER = Path(__file__).parents[3] / "validation/vjm_validation/examples/parts"


def outside(name, largest, first=8000, tips=(TipLoad.RIGID, TipLoad.SPREAD)):
    """Entries whose interval from the first three meshes, or more, does not meet that of all meshes."""
    gmsh_or_skip()
    task = SolidTask(
        FOLDER / f"{name}.step", IsotropicMaterial(70000.0, 0.33), ("base",), ("tip",), accuracy=1e-9,
        largest=largest,
        first=first, tips=tips,
    )  # fmt: skip
    found = identify(task)
    assert len(found.sizes) >= 4
    assert found.unknowns[-1] > 2 * found.unknowns[2]
    missed = []
    for tip, bound in found.bounds.items():
        truth = bound.limit
        for n in range(3, len(found.sizes)):
            early = limit(found.sizes[:n], bound.meshes[:n])
            far = np.abs(early.compliance - truth.compliance) > early.interval + truth.interval
            missed += [(tip.value, n, i + 1, j + 1) for i, j in zip(*np.nonzero(np.triu(far)), strict=True)]
            # the finest mesh itself, too: what is beyond it is smaller than what is before
            far = np.abs(early.compliance - bound.meshes[-1]) > early.interval + truth.interval
            missed += [(tip.value, n, i + 1, j + 1) for i, j in zip(*np.nonzero(np.triu(far)), strict=True)]
    return missed


@pytest.mark.slow
def test_intervals_of_a_bracket_hold():
    assert outside("l-bracket", 36_000, first=2000, tips=(TipLoad.SPREAD,)) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "first"),
    # of the tube four meshes are within the limit where the first is coarser
    [("slotted-foot", 8000), ("l-bracket", 8000), ("flanged-tube", 5000)],
)
def test_intervals_of_the_shipped_parts_hold(name, first):
    assert outside(name, 250_000, first) == []


@pytest.mark.parametrize("order", [1.09, 2.0, 3.7])
def test_a_known_order_is_extrapolated_exactly(order):
    """c(h) = c + a hᵖ in every entry: the limit is c, the order p."""
    exact = np.diag([3.0, 2.0, 1.0, 0.3, 0.2, 0.1])
    exact[1, 5] = exact[5, 1] = 0.2
    change = np.abs(exact) * 0.05
    sizes = [9.0, 6.0, 4.0]
    found = limit(sizes, [exact + change * (h / 9.0) ** order for h in sizes])
    assert order < HIGHEST
    assert found.order[1, 5] == pytest.approx(order, rel=1e-6)
    assert found.compliance == pytest.approx(exact, abs=1e-9)
    # and 1.25 times what the extrapolation changed is the half-interval
    assert found.interval[1, 1] == pytest.approx(1.25 * change[1, 1] * (4.0 / 9.0) ** order, rel=1e-6)


def test_meshes_that_agree_by_chance_are_not_believed():
    """Of the slotted foot's entry (2,6): 0.6505, 0.65098, 0.65104 on three meshes, and 0.6514 in the limit."""
    own = np.diag([3.0, 2.0, 1.0, 0.3, 0.2, 0.1])
    found = limit([11.3, 7.55, 5.04], [c / 0.651037 * own for c in (0.650514, 0.650975, 0.651037)])
    assert found.compliance[0, 0] - 3.0 * 0.65144 / 0.651037 == pytest.approx(0.0, abs=found.interval[0, 0])


def test_changes_of_two_signs_are_no_order():
    exact = np.diag([3.0, 2.0, 1.0, 0.3, 0.2, 0.1])
    found = limit([9.0, 6.0, 4.0], [exact, 1.02 * exact, 1.01 * exact])
    assert np.isnan(found.order[0, 0])
    assert found.interval[0, 0] == pytest.approx(3.0 * 0.02 * 3.0, rel=1e-9)
    assert found.compliance == pytest.approx(1.01 * exact)


# The parts that are shipped: the drawings are what the script makes, and their names lie where they say.

PLANES = {
    "slotted-foot": {"base": (0, 0.0), "tip": (0, 120.0)},
    "l-bracket": {"base": (0, 100.0), "tip": (2, 70.0)},
    "flanged-tube": {"base": (0, 0.0), "tip": (0, 200.0)},
}


@pytest.fixture(scope="module", autouse=True)
def _extra():
    gmsh_or_skip()


def test_drawings_are_what_the_script_makes(tmp_path):
    from helpers.make_parts import make  # imports gmsh

    make(tmp_path)
    for name in PLANES:
        assert (tmp_path / f"{name}.step").read_text() == (FOLDER / f"{name}.step").read_text()


@pytest.mark.parametrize("name", PLANES)
def test_names_lie_where_they_say(name):
    """By what gmsh reads, and by the plane that the STEP text itself gives the face."""
    text = (FOLDER / f"{name}.step").read_text()
    with drawing(FOLDER / f"{name}.step") as opened:
        named = {face.name: face for face in opened.faces if face.name}
    assert set(named) == {"base", "tip"}
    for label, (axis, place) in PLANES[name].items():
        face = named[label]
        assert face.low[axis] == pytest.approx(place, abs=1e-6)
        assert face.high[axis] == pytest.approx(place, abs=1e-6)
        plane = re.search(rf"ADVANCED_FACE\('{label}',\([^)]*\),(#\d+)", text).group(1)
        position = re.search(rf"{plane} = PLANE\('',(#\d+)\)", text).group(1)
        point = re.search(rf"{position} = AXIS2_PLACEMENT_3D\('',(#\d+)", text).group(1)
        numbers = re.search(rf"{point} = CARTESIAN_POINT\('',\(([^)]*)\)", text).group(1)
        assert float(numbers.split(",")[axis]) == pytest.approx(place, abs=1e-6)
