"""A part as it is drawn: limits kept, flat faces of an STL anew, bodies counted, buckling by its own sections."""

import os
import signal

import numpy as np
import pytest
from helpers.solids import drawn, gmsh_or_skip, prism
from scipy.optimize import brentq

from vjm_fea.solid.compliance import TipLoad
from vjm_fea.solid.drawing import drawing
from vjm_fea.solid.elasticity import ElasticSolid, IsotropicMaterial
from vjm_fea.solid.identify import SolidTask, column, identify, sections_along
from vjm_updating.identify.solid_part import solid_document

ALUMINIUM = IsotropicMaterial(70000.0, 0.33)
ROOT, TIP, LENGTH = 20.0, 12.0, 200.0
"""Radii of a cone from base to tip, and its length, mm."""
BOX = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    gmsh_or_skip()
    folder = tmp_path_factory.mktemp("parts")
    corners = np.array([[x, y, z] for x in (0.0, 100.0) for y in (-10.0, 10.0) for z in (-5.0, 5.0)])
    lines = ["solid box"]
    for a, b, c, d in BOX:
        for triangle in ((a, b, c), (a, c, d)):
            vertices = [f"vertex {' '.join(map(str, corners[node]))}" for node in triangle]
            lines += ["facet normal 0 0 0", "outer loop", *vertices, "endloop", "endfacet"]
    (folder / "box.stl").write_text("\n".join([*lines, "endsolid box"]) + "\n")
    drawn(folder / "box.msh", prism)
    drawn(folder / "cone.step", lambda occ: occ.addCone(0, 0, 0, LENGTH, 0, 0, ROOT, TIP))
    drawn(folder / "touching.step", lambda occ: (prism(occ, 50.0), occ.addBox(50, -10, -5, 50, 20, 10)))
    drawn(folder / "overlapping.step", lambda occ: (prism(occ, 60.0), occ.addBox(50, -10, -5, 50, 20, 10)))
    drawn(folder / "three.brep", lambda occ: [occ.addBox(20 * k, 0, 0, 20, 20, 10) for k in range(3)])
    return folder


def task(path, base, tip, **options):
    return SolidTask(path, ALUMINIUM, (base,), (tip,), tips=(TipLoad.SPREAD,), **options)


@pytest.mark.slow
def test_a_coarse_stl_is_meshed_anew_within_the_limit(folder):
    """Twelve triangles; Timoshenko's cantilever, of which a clamped base takes one per cent."""
    found = identify(task(folder / "box.stl", "0,0,0", "100,0,0", accuracy=0.02, largest=60000))
    assert found.stopped == "accuracy"
    assert found.relative <= 0.02
    assert max(found.unknowns) <= 60000
    C = found.bounds[TipLoad.SPREAD].limit.compliance
    E, G, A, Iz = 70000.0, 70000.0 / 2.66, 200.0, 10.0 * 20.0**3 / 12.0
    assert C[1, 1] == pytest.approx(100.0**3 / (3 * E * Iz) + 100.0 / (G * A * 5 / 6), rel=0.02)
    assert found.volume == pytest.approx(20000.0, rel=1e-9)
    assert found.bodies == 1


@pytest.mark.parametrize("kind", ["cylinder", "hole", "hollow"])
def test_an_stl_keeps_its_faces_and_its_volume(tmp_path, kind):
    gmsh_or_skip()

    def draw(occ):
        body = occ.addCylinder(0, 0, 0, 40, 0, 0, 10) if kind == "cylinder" else occ.addBox(0, 0, 0, 60, 30, 20)
        if kind == "hole":
            occ.cut([(3, body)], [(3, occ.addCylinder(30, 15, -1, 0, 0, 22, 6))])
        if kind == "hollow":
            occ.cut([(3, body)], [(3, occ.addBox(5, 5, 5, 50, 20, 10))])

    with drawing(drawn(tmp_path / "part.stl", draw)) as opened:
        triangles = np.concatenate([face.triangles for face in opened.faces])
        mesh = opened.mesh(6.0, [opened.faces[0].number])
    # Gauss: a third of the flux of the place through the triangles; a hollow's face inwards
    flux = np.abs(np.einsum("kd,kd->k", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2]))) / 6.0
    assert opened.volume == pytest.approx(ElasticSolid(mesh, ALUMINIUM).volume, rel=1e-9)
    assert opened.volume < flux.sum() + 1e-6
    if kind == "hollow":
        assert opened.volume == pytest.approx(26000.0, rel=1e-9)
    assert set(mesh.faces) == {face.number for face in opened.faces}
    for face in opened.faces:
        corners = mesh.points[mesh.faces[face.number]]
        area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        assert area.sum() == pytest.approx(face.area, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("largest", [20000, 60000])
def test_a_mesh_that_can_only_be_split_keeps_the_limit(folder, largest):
    found = identify(task(folder / "box.msh", "0,0,0", "100,0,0", accuracy=1e-4, largest=largest))
    assert found.stopped == "size"
    assert max(found.unknowns) <= largest
    # eight times as many, but for the borders, would have been too many
    assert found.unknowns[-1] * 9 > largest


def test_a_part_whose_first_mesh_is_too_large_is_refused(folder):
    # splitting begins with the file's own mesh
    with pytest.raises(
        ValueError,
        match=r"box.msh: the file's own mesh has \d+ unknowns: allow them by `validate identify --largest",
    ):
        identify(task(folder / "box.msh", "0,0,0", "100,0,0", largest=1000))


@pytest.mark.parametrize(("name", "count"), [("touching.step", 2), ("overlapping.step", 2), ("three.brep", 3),
                                             ("cone.step", 1)])  # fmt: skip
def test_bodies_are_counted(folder, name, count):
    with drawing(folder / name) as opened:
        assert opened.bodies == count


def cone_force(E):
    """Cantilever held at its wide end: tan κ(1/a − 1/b) = −κ/b, P = κ² EI_tip/a⁴, with x from the cone's apex."""
    a = TIP * LENGTH / (ROOT - TIP)
    b = a + LENGTH
    turn = 1.0 / a - 1.0 / b
    kappa = brentq(lambda k: np.sin(k * turn) + k / b * np.cos(k * turn), 0.51 * np.pi / turn, 0.99 * np.pi / turn)
    return kappa**2 * E * np.pi * TIP**4 / 4.0 / a**4


def test_a_cone_buckles_as_its_sections_do(folder):
    with drawing(folder / "cone.step") as opened:
        solid = ElasticSolid(opened.mesh(6.0), ALUMINIUM)
    sections = sections_along(solid, np.zeros(3), np.array([LENGTH, 0.0, 0.0]))
    assert sections.straight
    radius = ROOT + (TIP - ROOT) * sections.x / LENGTH
    # elements on round faces have curved edges, whose points meet a hat of 10 mm unevenly: 3e-3
    assert sections.second[:, 0, 0] == pytest.approx(np.pi * radius**4 / 4.0, rel=1e-2)
    assert sections.second[:, 0, 1] == pytest.approx(0.0, abs=1e-2 * np.pi * ROOT**4 / 4.0)
    assert sections.area == pytest.approx(np.pi * radius**2, rel=1e-2)
    # beam theory's own compliance
    s, w = np.polynomial.legendre.leggauss(30)
    x, w = 0.5 * LENGTH * (s + 1.0), 0.5 * LENGTH * w
    f = w / (ALUMINIUM.youngs_modulus * np.pi * (ROOT + (TIP - ROOT) * x / LENGTH) ** 4 / 4.0)
    turn, move, both = f.sum(), (f * (LENGTH - x) ** 2).sum(), (f * (LENGTH - x)).sum()
    C = np.diag([1e-6, move, move, 1e-9, turn, turn])
    C[1, 5] = C[5, 1] = both
    C[2, 4] = C[4, 2] = -both
    found = column(sections, ALUMINIUM.youngs_modulus, C)
    assert found.misfit < 1e-3
    assert found.force == pytest.approx(cone_force(ALUMINIUM.youngs_modulus), rel=1e-3)
    # a part that bends a tenth more than its sections do
    soft = column(sections, ALUMINIUM.youngs_modulus, 1.1 * C)
    assert soft.misfit == pytest.approx(0.1 / 1.1, abs=2e-3)


@pytest.mark.slow
def test_what_is_said_of_a_cone_is_said_of_the_part(folder):
    """It is 200 mm long and six times as long as it is deep, though a uniform beam like it is shorter."""
    found = identify(task(folder / "cone.step", "0,0,0", "200,0,0", accuracy=0.02, largest=60000))
    document = solid_document(found)
    assert document.beams[-1].length_mm < 180.0
    assert not [text for text in document.warnings if "stubby" in text]
    # elastic bending of a solid part is 1 % stiffer where its base is clamped
    assert document.buckling_N == pytest.approx(cone_force(70000.0), rel=0.01)
    assert document.bodies == 1


@pytest.mark.slow
def test_a_compliance_that_is_not_known_leaves_buckling_undecided(folder):
    """Two meshes show no order: three times what they differ is the interval."""
    found = identify(task(folder / "cone.step", "0,0,0", "200,0,0", accuracy=1e-3, largest=20000))
    assert found.stopped == "size"
    assert len(found.unknowns) < 3
    assert found.relative + found.column.misfit > 0.05
    document = solid_document(found)
    assert document.buckling_N is None
    assert [text for text in document.findings if "undecided" in text]


@pytest.mark.slow
def test_bonded_bodies_are_a_finding_and_a_warning_unless_they_are_meant(folder):
    found = identify(task(folder / "touching.step", "0,0,0", "100,0,0", accuracy=0.2, largest=12000))
    document = solid_document(found)
    assert "2 bodies, bonded, one material" in document.findings
    assert [text for text in document.warnings if text.startswith("2 bodies, bonded")]
    meant = solid_document(found, bonded=True)
    assert "2 bodies, bonded, one material" in meant.findings
    assert not [text for text in meant.warnings if "bonded" in text]
    # five times as long as it is deep
    assert [text for text in document.warnings if "100.0 mm from base to tip" in text or "100 mm from" in text]


# Volume, areas and centres of hollow parts from every kind of drawing, against closed forms.


KINDS = ("step", "brep", "stl", "msh")
OUTER, INNER, HOLLOW_LENGTH = 20.0, 17.0, 200.0


def tube(occ):
    """Open at both ends, along x."""
    hole = occ.addCylinder(0, 0, 0, HOLLOW_LENGTH, 0, 0, INNER)
    occ.cut([(3, occ.addCylinder(0, 0, 0, HOLLOW_LENGTH, 0, 0, OUTER))], [(3, hole)])


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
    assert volume == pytest.approx(ring * HOLLOW_LENGTH, rel=allowed)
    areas = sorted(face.area for face in faces)
    expected = [ring, ring, 2 * np.pi * INNER * HOLLOW_LENGTH, 2 * np.pi * OUTER * HOLLOW_LENGTH]
    assert areas == pytest.approx(expected, rel=allowed)
    ends = [face.centre for face in faces if face.area < 2 * ring]
    assert sorted(end[0] for end in ends) == pytest.approx([0.0, HOLLOW_LENGTH], abs=1e-9)
    # symmetric but for where a mesh's nodes lie
    assert np.abs([face.centre[1:] for face in faces]).max() < (1e-9 if exact else 0.2)


@pytest.mark.parametrize("kind", KINDS)
def test_a_box_with_a_cavity(kind, tmp_path):
    gmsh_or_skip()
    with drawing(drawn(tmp_path / f"shell.{kind}", shell)) as opened:
        assert opened.volume == pytest.approx(60 * 40 * 30 - 50 * 30 * 20, rel=1e-9)
        areas = sum(face.area for face in opened.faces)
    assert areas == pytest.approx(2 * (60 * 40 + 60 * 30 + 40 * 30 + 50 * 30 + 50 * 20 + 30 * 20), rel=1e-9)


# What gmsh changes in the process that loads it.


@pytest.mark.skipif(not hasattr(signal, "SIGPIPE"), reason="this system has no SIGPIPE")
def test_a_closed_pipe_is_an_error_of_python_after_gmsh(tmp_path):
    """`gmsh.initialize` makes SIGPIPE end the process; a drawing that was read leaves it ignored."""
    gmsh_or_skip()
    with drawing(drawn(tmp_path / "beam.step", prism)) as opened:
        assert opened.volume == pytest.approx(100.0 * 20.0 * 10.0)
    reader, writer = os.pipe()
    os.close(reader)
    child = os.fork()
    if not child:
        try:
            os.write(writer, b"x")
        except BrokenPipeError:
            os._exit(7)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    os.close(writer)
    assert os.waitstatus_to_exitcode(status) == 7
