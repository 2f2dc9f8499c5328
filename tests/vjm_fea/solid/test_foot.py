"""The suite's own foot as a solid of the same bending stiffness: vjm with its 6×6 against Exudyn's beam."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.solids import drawn, gmsh_or_skip, prism

from vjm.engines import VjmEngine
from vjm.io.saint_venant import rectangle_torsion
from vjm.model.load_case import LoadCase
from vjm.model.parts import Section
from vjm.rotations import rotate_matrix6, shift_compliance
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.solid.compliance import PartEnds, RootSupport, TipLoad, answer
from vjm_fea.solid.drawing import drawing
from vjm_fea.solid.elasticity import ElasticSolid, IsotropicMaterial

E, NU = 70000.0, 0.33
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def feet(orthoglide, tmp_path_factory):
    """The chain with a solid rectangular foot: as a beam, and with the solid's compliance."""
    gmsh_or_skip()
    (foot,) = [part for part in orthoglide.parts if part.name == "foot"]
    L, EIy, EIz = foot.length, foot.section.EIy, foot.section.EIz
    height = (12.0 * EIz / E / np.sqrt(EIy / EIz)) ** 0.25
    width = height * np.sqrt(EIy / EIz)
    path = drawn(tmp_path_factory.mktemp("foot") / "foot.step", lambda occ: prism(occ, L, height, width))
    with drawing(path) as opened:
        base, tip = ([f.number for f in opened.faces if abs(f.centre[0] - x) < 1e-6] for x in (0.0, L))
        solid = ElasticSolid(opened.mesh(5.0, [*base, *tip]), IsotropicMaterial(E, NU))
    C = answer(solid, PartEnds(tuple(base), tuple(tip), held=RootSupport.MEAN), TipLoad.SPREAD).compliance
    G = 0.5 * E / (1.0 + NU)
    shear = 5.0 / 6.0 * G * width * height
    section = Section(E * width * height, G * rectangle_torsion(height, width), EIy, EIz, shear, shear)
    own = shift_compliance(rotate_matrix6(C, foot.section_frame), foot.end_offset)

    def chain(one):
        return replace(orthoglide, parts=tuple(one if part is foot else part for part in orthoglide.parts))

    as_beam = chain(replace(foot, section=section, compliance=None, own_segments=None))
    return as_beam, chain(replace(foot, section=section, compliance=own, own_segments=1))


@pytest.mark.parametrize("posture", "AB")
def test_force_of_a_pulled_chain(feet, posture):
    """Where one spring is as good as a beam: 0.02 mm; what is left is how the solid's ends deform."""
    beam, solid = feet
    case = LoadCase(posture, 0.02)
    fe = ExudynEngine(shear=True).trace(beam, case)
    vjm = VjmEngine(16, 1).trace(solid, case)
    assert vjm.force[-1] == pytest.approx(fe.force[-1], rel=5e-3)
    # and the foot does matter
    rigid = replace(solid, parts=tuple(
        replace(part, compliance=1e-3 * part.compliance) if part.name == "foot" else part for part in solid.parts
    ))  # fmt: skip
    assert abs(VjmEngine(16, 1).trace(rigid, case).force[-1] / fe.force[-1] - 1.0) > 0.05
