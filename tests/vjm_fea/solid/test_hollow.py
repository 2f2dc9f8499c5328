"""Volume, areas and centres of hollow parts from every kind of drawing, against closed forms."""

import numpy as np
import pytest
from helpers.solids import drawn, gmsh_or_skip

from vjm_fea.solid.drawing import drawing

KINDS = ("step", "brep", "stl", "msh")
OUTER, INNER, LENGTH = 20.0, 17.0, 200.0


def tube(occ):
    """Open at both ends, along x."""
    hole = occ.addCylinder(0, 0, 0, LENGTH, 0, 0, INNER)
    occ.cut([(3, occ.addCylinder(0, 0, 0, LENGTH, 0, 0, OUTER))], [(3, hole)])


def shell(occ):
    """A box with a cavity that no edge joins to the outside."""
    occ.cut([(3, occ.addBox(0, 0, 0, 60, 40, 30))], [(3, occ.addBox(5, 5, 5, 50, 30, 20))])


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_tube(kind, tmp_path):
    """Drawings are exact; a mesh of elements of 8 mm cuts 16 chords at least off a circle, 2.6 % of its area."""
    gmsh_or_skip()
    exact = kind in ("step", "brep")
    with drawing(drawn(tmp_path / f"tube.{kind}", tube)) as opened:
        volume, faces = opened.volume, opened.faces
    ring = np.pi * (OUTER**2 - INNER**2)
    allowed = 1e-9 if exact else 0.026
    assert volume == pytest.approx(ring * LENGTH, rel=allowed)
    areas = sorted(face.area for face in faces)
    expected = [ring, ring, 2 * np.pi * INNER * LENGTH, 2 * np.pi * OUTER * LENGTH]
    assert areas == pytest.approx(expected, rel=allowed)
    ends = [face.centre for face in faces if face.area < 2 * ring]
    assert sorted(end[0] for end in ends) == pytest.approx([0.0, LENGTH], abs=1e-9)
    # symmetric but for where a mesh's nodes lie
    assert np.abs([face.centre[1:] for face in faces]).max() < (1e-9 if exact else 0.2)


@pytest.mark.parametrize("kind", KINDS)
def test_a_box_with_a_cavity(kind, tmp_path):
    gmsh_or_skip()
    with drawing(drawn(tmp_path / f"shell.{kind}", shell)) as opened:
        assert opened.volume == pytest.approx(60 * 40 * 30 - 50 * 30 * 20, rel=1e-9)
        areas = sum(face.area for face in opened.faces)
    assert areas == pytest.approx(2 * (60 * 40 + 60 * 30 + 40 * 30 + 50 * 30 + 50 * 20 + 30 * 20), rel=1e-9)
