"""Solids against closed forms: Saint-Venant's and Timoshenko's beams, Golovin's curved bar, Lamé's tube."""

import numpy as np
import pytest
from helpers.solids import drawn, gmsh_or_skip, prism, solved

from vjm.io.saint_venant import rectangle_torsion
from vjm_fea.solid.compliance import PartEnds, RootSupport, TipLoad, answer, face_centre
from vjm_fea.solid.drawing import drawing
from vjm_fea.solid.elasticity import ElasticSolid, IsotropicMaterial, components

E, NU = 70000.0, 0.3
G = 0.5 * E / (1.0 + NU)
MATERIAL = IsotropicMaterial(E, NU)
EXACT = 2e-3
"""The accuracy that is promised where the theory is exact."""


@pytest.fixture(scope="module", autouse=True)
def _extra():
    gmsh_or_skip()


def meshed(path, size, base, tip):
    """The part, and its ends by predicates on the centres of faces."""
    with drawing(path) as opened:
        ends = [tuple(f.number for f in opened.faces if at(f.centre)) for at in (base, tip)]
        return ElasticSolid(opened.mesh(size, ends[0] + ends[1]), MATERIAL), ends


def bar(tmp, draw, length, size, held=RootSupport.MEAN, tip=TipLoad.SPREAD, name="bar"):
    path = drawn(tmp / f"{name}-{length:g}.step", draw)
    solid, (base, end) = meshed(path, size, lambda c: abs(c[0]) < 1e-6, lambda c: abs(c[0] - length) < 1e-6)
    return answer(solid, PartEnds(base, end, held=held), tip)


def test_prism_in_tension_and_pure_bending_is_exact(tmp_path):
    """Linear tractions at both ends are Saint-Venant's: quadratic displacements, as the elements'."""
    L, h, b = 100.0, 20.0, 10.0
    C = bar(tmp_path, lambda occ: prism(occ, L, h, b), L, 10.0).compliance
    EIy, EIz = E * h * b**3 / 12.0, E * b * h**3 / 12.0
    exact = {
        (0, 0): L / (E * b * h),
        (4, 4): L / EIy,
        (5, 5): L / EIz,
        (1, 5): L**2 / 2 / EIz,
        (2, 4): -(L**2) / 2 / EIy,
    }
    for (i, j), value in exact.items():
        assert C[i, j] == pytest.approx(value, rel=1e-9)


@pytest.mark.slow
def test_prism_in_torsion_is_saint_venants(tmp_path):
    """What the ends do is the same for two lengths: the difference is the exact twist of what lies between."""
    h, b = 20.0, 10.0
    short, long = (
        bar(tmp_path, lambda occ, L=L: prism(occ, L, h, b), L, 2.2).compliance[3, 3] for L in (40.0, 80.0)
    )
    assert (long - short) / 40.0 == pytest.approx(1.0 / (G * rectangle_torsion(h, b)), rel=EXACT)


@pytest.mark.slow
def test_prism_in_shear_is_timoshenkos(tmp_path):
    """Cowper's coefficient 10(1+ν)/(12+11ν) (J. Appl. Mech. 33, 1966), at five heights shear is 3 %."""
    L, h, b = 100.0, 20.0, 10.0
    C = bar(tmp_path, lambda occ: prism(occ, L, h, b), L, 5.0).compliance
    k = 10.0 * (1.0 + NU) / (12.0 + 11.0 * NU)
    bending = 4.0 * L**3 / (E * b * h**3)
    shear = C[1, 1] - bending
    assert shear > 0.02 * bending
    assert C[1, 1] == pytest.approx(bending + L / (k * G * b * h), rel=EXACT)


def tube(occ, L, inner=15.0, outer=20.0):
    solid = occ.addCylinder(0, 0, 0, L, 0, 0, outer)
    hole = occ.addCylinder(0, 0, 0, L, 0, 0, inner)
    occ.cut([(3, solid)], [(3, hole)])


@pytest.mark.slow
def test_thick_tube(tmp_path):
    """Tension, torsion and pure bending of a round tube are exact; what is left is how well the mesh is round."""
    L, r, R = 120.0, 15.0, 20.0
    C = bar(tmp_path, lambda occ: tube(occ, L), L, 7.0, name="tube").compliance
    longer = bar(tmp_path, lambda occ: tube(occ, 200.0), 200.0, 7.0, name="tube").compliance
    EI = E * np.pi * (R**4 - r**4) / 4.0
    exact = [L / (E * np.pi * (R**2 - r**2)), L / (G / E * 2.0 * EI), L / EI, L / EI]
    assert np.diag(C)[[0, 3, 4, 5]] == pytest.approx(exact, rel=EXACT)
    m = r / R
    k = 6 * (1 + NU) * (1 + m**2) ** 2 / ((7 + 6 * NU) * (1 + m**2) ** 2 + (20 + 12 * NU) * m**2)  # Cowper's
    # an even shear traction makes the ends oval, at both lengths alike: the difference is the beam's
    deflection = (200.0**3 - L**3) / 3 / EI + (200.0 - L) / (k * G * np.pi * (R**2 - r**2))
    assert np.diag(longer - C)[[1, 2]] == pytest.approx([deflection] * 2, rel=EXACT)


def test_tapered_cantilever(tmp_path):
    """Height from 20 to 10 mm over 400 mm: ∫(L−s)²/EI + 1/kGA and its like, a taper of 0.7° to either side."""
    L, b = 400.0, 8.0

    def draw(occ):
        corners = [(0, -10), (L, -5), (L, 5), (0, 10)]
        points = [occ.addPoint(x, y, -0.5 * b) for x, y in corners]
        lines = [occ.addLine(points[i], points[(i + 1) % 4]) for i in range(4)]
        face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
        occ.extrude([(2, face)], 0, 0, b)

    C = bar(tmp_path, draw, L, 6.0, name="taper").compliance
    s = (np.polynomial.legendre.leggauss(30)[0] + 1.0) * 0.5 * L
    w = np.polynomial.legendre.leggauss(30)[1] * 0.5 * L
    h = 20.0 - 10.0 * s / L
    k = 10.0 * (1.0 + NU) / (12.0 + 11.0 * NU)
    EI, A = E * b * h**3 / 12.0, b * h
    assert C[0, 0] == pytest.approx(np.sum(w / (E * A)), rel=EXACT)
    assert C[5, 5] == pytest.approx(np.sum(w / EI), rel=EXACT)
    assert C[1, 5] == pytest.approx(np.sum(w * (L - s) / EI), rel=EXACT)
    assert C[1, 1] == pytest.approx(np.sum(w * ((L - s) ** 2 / EI + 1.0 / (k * G * A))), rel=EXACT)
    assert C[4, 4] == pytest.approx(np.sum(w * 12.0 / (E * h * b**3)), rel=EXACT)


@pytest.mark.slow
def test_curved_bar_is_golovins(tmp_path):
    """Pure bending of a circular bar (Timoshenko and Goodier, §29): the turn of the angle between two arcs.

    ``φ/α = −4 m / (E t N') · (b² − a²) · ...``: with N = (b²−a²)² − 4a²b² ln²(b/a), the turn by unit angle of a
    moment M is ``8 M (b² − a²)/(E t N)``.
    """
    a, b, t = 40.0, 60.0, 6.0

    def arc(angle):
        def draw(occ):
            face = occ.addRectangle(a, -0.5 * t, 0, b - a, t)
            occ.revolve([(2, face)], 0, 0, 0, 0, 1, 0, np.deg2rad(angle))

        path = drawn(tmp_path / f"arc-{angle}.step", draw)
        turn = np.deg2rad(angle)
        middle = 0.5 * (a + b)
        end = np.array([middle * np.cos(turn), middle * np.sin(turn)])
        solid, (base, tip) = meshed(
            path, 5.0, lambda c: np.allclose(c[:2], [middle, 0.0], atol=1e-6) and abs(c[2]) < 1e-6,
            lambda c: np.hypot(np.hypot(c[0], c[2]) - middle, abs(np.arctan2(abs(c[2]), c[0])) - turn) < 1e-6,
        )  # fmt: skip
        assert end.shape == (2,)
        return answer(solid, PartEnds(base, tip, held=RootSupport.MEAN), TipLoad.SPREAD).compliance[4, 4]

    N = (b**2 - a**2) ** 2 - 4.0 * a**2 * b**2 * np.log(b / a) ** 2
    exact = 8.0 * (b**2 - a**2) / (E * t * N)
    # straight beams of the mean radius' length would say 3 % more
    assert (arc(120) - arc(60)) / np.deg2rad(60.0) == pytest.approx(exact, rel=EXACT)


def test_lames_thick_tube(tmp_path):
    """Inner radius of an open tube under inner pressure, and the hoop stress there."""
    a, b, L, p = 15.0, 30.0, 10.0, 100.0
    path = drawn(tmp_path / "lame.step", lambda occ: tube(occ, L, a, b))
    with drawing(path) as opened:
        inner = [f.number for f in opened.faces if f.area == pytest.approx(2 * np.pi * a * L, rel=0.02)]
        solid = ElasticSolid(opened.mesh(3.0), MATERIAL)
    u = freely_supported(solid, solid.pressure(inner, p))
    nodes = solid.mesh.face_nodes(inner)
    x = solid.mesh.points[nodes]
    radial = np.sum(u.reshape(-1, 3)[nodes, 1:] * x[:, 1:], axis=1) / a
    exact = p * a / (E * (b**2 - a**2)) * ((1 - NU) * a**2 + (1 + NU) * b**2)
    assert np.mean(radial) == pytest.approx(exact, rel=EXACT)
    across = np.column_stack([np.zeros(len(x)), -x[:, 2], x[:, 1]]) / a
    hoop = np.einsum("na,nab,nb->n", across, solid.stress(u)[nodes], across)
    assert np.mean(hoop) == pytest.approx(p * (b**2 + a**2) / (b**2 - a**2), rel=1e-2)


def freely_supported(solid, F):
    """Displacements under loads in balance, kept from floating as an end that is still in the mean is."""
    points = solid.mesh.points
    # on the tube: all of one point, and by symmetry nothing but a rigid motion is lost
    near = [int(np.argmin(np.linalg.norm(points - at, axis=1))) for at in ([0, 30, 0], [0, -30, 0], [0, 0, 30])]
    held = np.array([3 * near[0], 3 * near[0] + 2, 3 * near[1], 3 * near[1] + 2, 3 * near[2], 3 * near[2] + 1])
    return solved(solid, F, held)


def test_stiffness_is_scikit_fems(tmp_path):
    """Our blocks of a curved mesh against scikit-fem's own form, and no force under rigid motions."""
    import skfem
    from skfem.helpers import ddot, sym_grad, trace

    path = drawn(tmp_path / "tube.step", lambda occ: tube(occ, 30.0))
    with drawing(path) as opened:
        solid = ElasticSolid(opened.mesh(12.0), MATERIAL)
    lam, mu = MATERIAL.lame
    basis = skfem.Basis(solid.mesh.finite_elements, skfem.ElementVector(skfem.ElementTetP2()), intorder=4)

    @skfem.BilinearForm
    def form(u, v, _):
        return lam * trace(sym_grad(u)) * trace(sym_grad(v)) + 2.0 * mu * ddot(sym_grad(u), sym_grad(v))

    theirs = form.assemble(basis)
    order = np.empty(solid.mesh.unknowns, dtype=int)
    order[components(solid.mesh.elements.ravel())] = (
        basis.element_dofs.reshape(10, 3, -1).transpose(2, 0, 1).ravel()
    )
    upper = solid.stiffness()
    ours = upper + upper.T
    ours.setdiag(upper.diagonal())
    difference = theirs.tocsr()[order][:, order] - ours
    assert abs(difference).max() < 1e-12 * abs(theirs).max()
    assert face_centre(solid, [1]).shape == (3,)
