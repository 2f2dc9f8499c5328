"""NAFEMS benchmarks of solids: LE10, the thick plate under pressure, and LE11, the taper under temperature.

NAFEMS, *The Standard NAFEMS Benchmarks*, TNSB rev. 3 (1990): LE10, σ_yy at D −5.38 MPa; LE11, σ_zz at A −105 MPa.
"""

import numpy as np
import pytest
from helpers.solids import drawn, gmsh_or_skip, solved

from vjm_fea.solid.drawing import drawing
from vjm_fea.solid.elasticity import ElasticSolid, IsotropicMaterial

E, NU = 210_000.0, 0.3
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def _extra():
    gmsh_or_skip()


def at(solid, point):
    return int(np.argmin(np.linalg.norm(solid.mesh.points - np.asarray(point), axis=1)))


def faces(opened, where):
    return [f.number for f in opened.faces if where(f.triangles.reshape(-1, 3))]


def test_le10_thick_plate(tmp_path):
    """A quarter of an elliptic plate, 3.25 by 2.75 m outside, 2 by 1 m inside, 0.6 m thick, under 1 MPa."""

    def draw(occ):
        outer = occ.addDisk(0, 0, 0, 3250, 2750)
        inner = occ.addDisk(0, 0, 0, 2000, 1000)
        ring, _ = occ.cut([(2, outer)], [(2, inner)])
        quarter, _ = occ.intersect(ring, [(2, occ.addRectangle(0, 0, 0, 4000, 4000))])
        # two layers: the rim is held vertically along its middle line, which is then an edge
        lower = occ.extrude(quarter, 0, 0, 300)
        upper = occ.extrude([pair for pair in lower if pair[0] == 2][:1], 0, 0, 300)
        occ.fragment([pair for pair in lower if pair[0] == 3], [pair for pair in upper if pair[0] == 3])

    path = drawn(tmp_path / "le10.step", draw)
    with drawing(path) as opened:
        x0, y0 = (faces(opened, lambda p, k=k: np.ptp(p[:, k]) < 1e-6 and abs(p[0, k]) < 1e-6) for k in (0, 1))
        top = faces(opened, lambda p: np.ptp(p[:, 2]) < 1e-6 and p[0, 2] > 599.0)
        rim = faces(opened, lambda p: np.allclose((p[:, 0] / 3250) ** 2 + (p[:, 1] / 2750) ** 2, 1.0, atol=1e-3))
        solid = ElasticSolid(opened.mesh(150.0), IsotropicMaterial(E, NU))
    nodes, z = solid.mesh.face_nodes, solid.mesh.points[:, 2]
    on_rim = nodes(rim)
    middle = on_rim[np.abs(z[on_rim] - 300.0) < 1e-6]
    held = np.concatenate([3 * nodes(x0), 3 * nodes(y0) + 1, 3 * on_rim, 3 * on_rim + 1, 3 * middle + 2])
    u = solved(solid, solid.pressure(top, 1.0), np.unique(held))
    stress = solid.stress(u)[at(solid, (2000, 0, 600))]
    assert stress[1, 1] == pytest.approx(-5.38, rel=0.01)


def test_le11_taper_under_temperature(tmp_path):
    """A hollow sphere, taper and cylinder of revolution, a quarter, T = r + z in m and K, α 2.3e-4 /K."""
    alpha = 2.3e-4

    def draw(occ):
        def at(r, z):
            return occ.addPoint(1000.0 * r, 0.0, 1000.0 * z)

        middle, slope = at(0, 0), np.sqrt(0.5)
        inner = [at(1.0, 0.0), at(slope, slope), at(slope, 1.79)]
        outer = [at(1.0, 1.79), at(1.0, 1.39), at(1.4 * np.cos(np.pi / 6), 0.7), at(1.4, 0.0)]
        lines = [
            occ.addCircleArc(inner[0], middle, inner[1]), occ.addLine(inner[1], inner[2]),
            occ.addLine(inner[2], outer[0]), occ.addLine(outer[0], outer[1]), occ.addLine(outer[1], outer[2]),
            occ.addCircleArc(outer[2], middle, outer[3]), occ.addLine(outer[3], inner[0]),
        ]  # fmt: skip
        face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
        occ.revolve([(2, face)], 0, 0, 0, 0, 0, 1, np.pi / 2)

    path = drawn(tmp_path / "le11.step", draw)
    with drawing(path) as opened:
        x0, y0 = (faces(opened, lambda p, k=k: np.ptp(p[:, k]) < 1e-6 and abs(p[0, k]) < 1e-6) for k in (0, 1))
        ends = faces(opened, lambda p: np.ptp(p[:, 2]) < 1e-6)
        solid = ElasticSolid(opened.mesh(120.0, ends), IsotropicMaterial(E, NU))
    x = solid.mesh.points
    heat = alpha * (np.hypot(x[:, 0], x[:, 1]) + x[:, 2]) / 1000.0
    lam, mu = solid.material.lame
    elements, basis = solid.mesh.elements, solid.basis
    field = sum(np.asarray(basis.basis[j][0]) * heat[elements[:, j], None] for j in range(10))
    F = np.zeros((len(x), 3))
    for j in range(10):
        values = np.einsum("amq,mq->ma", basis.basis[j][0].grad, (3.0 * lam + 2.0 * mu) * field * basis.dx)
        np.add.at(F, elements[:, j], values)
    nodes = solid.mesh.face_nodes
    held = np.unique(np.concatenate([3 * nodes(x0), 3 * nodes(y0) + 1, 3 * nodes(ends) + 2]))
    stress = solid.stress(solved(solid, F.ravel(), held), heat)
    assert stress[at(solid, (1000, 0, 0))][2, 2] == pytest.approx(-105.0, rel=0.01)
