"""The parts that are shipped: the drawings are what the script makes, and their names lie where they say."""

import re
from pathlib import Path

import pytest
from helpers.solids import gmsh_or_skip

from vjm_fea.solid.drawing import drawing

FOLDER = Path(__file__).parents[3] / "validation/vjm_validation/examples/parts"
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
