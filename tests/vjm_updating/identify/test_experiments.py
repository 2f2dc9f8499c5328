"""Compliances from virtual experiments, against closed forms."""

import io
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.solids import drawn, gmsh_or_skip, prism
from matplotlib.image import imread

from vjm.io.errors import ModelFileError
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.rotations import AXES, frame, rotation_from_vector
from vjm_fea.solid.compliance import TipLoad
from vjm_fea.solid.drawing import drawing
from vjm_fea.solid.elasticity import IsotropicMaterial
from vjm_fea.solid.identify import SolidTask, identify
from vjm_updating.identify.command import identify_part
from vjm_updating.identify.experiments import BeamPath, BeamPathPiece, build_path, is_path, measure, part_specimen
from vjm_updating.identify.solid_part import face_numbers, load_pictures, numbered_faces, wrench_picture
from vjm_validation.exact.linear import Bar, l_frame_in_plane, l_frame_out_of_plane

from .paths import L_FRAME, TAPER
from .textbook import cantilever, rotation, turned, with_rigid_arm

MESHES = (8, 16, 32)


def scaled(difference, C):
    return np.max(np.abs(difference) / np.sqrt(np.outer(np.diag(C), np.diag(C))))


def alone(*parts) -> Machine:
    return Machine("made-up", parts)


@pytest.mark.slow
def test_the_bars_matrix_comes_back(chain):
    document = identify_part(chain, "link")
    C = np.array(document.compliance)
    # the library's bar by hand, one member, its stiff plane the own x–z plane
    expected = cantilever(310.0, 6.7391304e6, 1.0689655e7, 2.0666667e8, 4.3055556e7)
    assert scaled(C - expected, expected) < 1e-8
    assert document.experiments.positive_definite
    assert np.array_equal(C, C.T)
    # (20) as printed: all of it but the stiff plane, which 310 mm do not give
    (printed,) = [one for one in document.references if one.name == "model file"]
    assert set(printed.outside) == {"(3,3)", "(3,5)"}
    assert printed.outside["(3,3)"] == pytest.approx((0.04805 - 0.051) / 0.5e-3, abs=1e-4)
    (beam,) = document.beams
    assert beam.met
    # the extrapolated matrix is exact to 1e-11 or so
    assert beam.length_mm == pytest.approx(310.0, rel=1e-9)
    assert beam.EIz_Nmm2 == pytest.approx(4.3055556e7, rel=2e-9)


@pytest.mark.slow
def test_the_foots_matrix_comes_back_to_every_printed_digit(chain):
    document = identify_part(chain, "foot")
    C = np.array(document.compliance)
    R = rotation_from_vector([0.0, 0.0, math.radians(50.3)])
    expected = with_rigid_arm(turned(cantilever(146.5, 7.5e7, 6.40e8, 6.32e8, 1.744e9), R), [17.57, -8.74, 0.0])
    assert scaled(C - expected, expected) < 1e-7
    (printed,) = [one for one in document.references if one.name == "model file"]
    assert printed.digits == 2
    assert printed.outside == {}
    assert [beam.met for beam in document.beams] == [False, False, True]
    # the extrapolated matrix is exact to 1e-7 at most: 3e-7 mm
    assert document.beams[-1].offset_mm == pytest.approx([17.57, -8.74, 0.0], abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_the_stated_uncertainty_covers_the_truth(seed):
    rng = np.random.default_rng(seed)
    L, R, Q = rng.uniform(80.0, 400.0), rotation(rng), rotation(rng)
    arm = 0.2 * L * rng.standard_normal(3)
    section = (5e6, 3e7, 10.0 ** rng.uniform(7, 8.5), 10.0 ** rng.uniform(7, 8.5), 1e5, 2e5)
    body = alone(Beam("b", L, own_frame=Q, section_frame=R, end_offset=arm, section=Section(*section)))
    found = measure(part_specimen(body, "b"))
    expected = with_rigid_arm(turned(cantilever(L, *section), R), arm)
    # the closed form is itself exact to rounding
    assert np.all(np.abs(found.compliance - expected) <= found.uncertainty + 1e-9 * np.max(np.abs(expected)))
    assert scaled(found.uncertainty, expected) < 1e-5


@pytest.mark.slow
def test_the_plain_element_is_of_second_order_and_extrapolated():
    section = Section(5e6, 3e7, 2e8, 4e7, 2e6, 2e6)
    specimen = part_specimen(alone(Beam("b", 300.0, section=section)), "b")
    found = measure(specimen, MESHES, corrected=False)
    # of a uniform beam nothing but the second order is left: 2e-8
    assert found.order == pytest.approx(2.0, abs=1e-6)
    assert found.extrapolated
    expected = cantilever(300.0, 5e6, 3e7, 2e8, 4e7, 2e6, 2e6)
    assert scaled(found.compliance - expected, expected) < 1e-7
    assert np.all(np.abs(found.compliance - expected) <= found.uncertainty + 1e-15)
    # without extrapolation the finest mesh would be off by 1/(4 · 32²)
    assert scaled(found.discretisation, expected) < 1e-4


@pytest.mark.slow
def test_parts_in_series_add_up():
    first = (5e6, 3e7, 2e8, 4e7)
    second = (2e6, 1e7, 3e7, 5e7)
    Q = rotation_from_vector([0.0, 0.7, 0.0])
    body = alone(
        Beam("upper", 200.0, section=Section(*first), count=2),
        RigidOffset("corner", frame(Q, [30.0, 10.0, 0.0])),
        Beam("lower", 120.0, section=Section(*second)),
    )
    found = measure(part_specimen(body, "upper..lower"))
    rest = np.array([30.0, 10.0, 0.0]) + Q @ [120.0, 0.0, 0.0]
    expected = with_rigid_arm(0.5 * cantilever(200.0, *first), rest) + turned(cantilever(120.0, *second), Q)
    assert scaled(found.compliance - expected, expected) < 1e-6


@pytest.mark.slow
def test_a_frame_with_a_corner_is_castiglianos():
    path = build_path(tomllib.loads(L_FRAME), "l-frame.toml")
    found = measure(path.specimen(), (4, 8, 16))
    C, open_ = found.compliance, found.uncertainty
    first = Bar(200.0, EI=4e8, EA=1e7, GA=3e6, GJ=3e8)
    second = Bar(150.0, EI=2e8, EA=5e6, GA=2e6, GJ=1e8)
    for freedoms, exact in (
        ([0, 1, 5], l_frame_in_plane(first, second)),
        ([2, 3, 4], l_frame_out_of_plane(first, second)),
    ):
        block = np.ix_(freedoms, freedoms)
        assert C[block] == pytest.approx(exact, rel=1e-6, abs=1e-14)
        assert np.all(np.abs(C[block] - exact) <= open_[block] + 1e-9 * np.max(exact))


@pytest.mark.slow
def test_a_taper_is_the_integral_of_its_width():
    # the width runs from b0 to b1 at constant thickness t: EI about z is linear too, and with u from the tip and
    # b = b1 + p u the unit loads' integrals ∫ u^k/(E t³ b/12) du are elementary
    E, t, L = 70000.0, 12.0, 240.0
    b0, b1 = 60.0, 20.0
    p, log = (b0 - b1) / L, math.log(b0 / b1)
    per_width = E * t**3 / 12.0
    turn = log / p / per_width
    mixed = (L / p - b1 / p**2 * log) / per_width
    shift = (L**2 / (2 * p) - b1 * L / p**2 + b1**2 / p**3 * log) / per_width
    path = build_path(tomllib.loads(TAPER), "taper.toml")
    found = measure(path.specimen(), MESHES)
    assert found.order == pytest.approx(2.0, abs=0.1)
    C = found.compliance
    # what extrapolation leaves: 5e-7, and 3e-6 across
    assert C[0, 0] == pytest.approx(log / p / (E * t), rel=1e-5)
    assert C[5, 5] == pytest.approx(turn, rel=1e-5)
    assert C[1, 5] == pytest.approx(mixed, rel=1e-5)
    assert C[1, 1] == pytest.approx(shift, rel=1e-5)
    # the other plane, ∫ (L−x)²/(E t b³/12): by quadrature, the torsion is Saint-Venant's series and left to theory
    x, w = np.polynomial.legendre.leggauss(60)
    s = 0.5 * L * (x + 1.0)
    stiff = E * t * (b0 - p * s) ** 3 / 12.0
    assert C[2, 2] == pytest.approx(np.sum(0.5 * L * w * (L - s) ** 2 / stiff), rel=1e-5)
    assert np.all(np.abs(C - path.compliance()) <= found.uncertainty + 1e-9 * np.max(C))


def test_an_arc_of_many_pieces_is_the_quarter_circle():
    # Castigliano, bending only: π R³/4EI radially at the tip, (3π/4 − 2) R³/EI tangentially
    n, radius, EI = 60, 100.0, 1e8
    chord = 2.0 * radius * math.sin(math.pi / (4 * n))
    section = Section(1e12, 1e12, 1e12, EI)
    step = math.pi / (2 * n)
    turns = [rotation_from_vector([0.0, 0.0, 0.5 * step]), rotation_from_vector([0.0, 0.0, step])]
    path = BeamPath("arc", tuple(BeamPathPiece(chord, lambda _: section, turns[min(k, 1)]) for k in range(n)))
    C = path.compliance()
    # leaves along x, ends along y: a force along x is radial at the tip, one along y tangential
    assert C[0, 0] == pytest.approx(math.pi / 4 * radius**3 / EI, rel=1e-3)
    assert C[1, 1] == pytest.approx((3 * math.pi / 4 - 2) * radius**3 / EI, rel=1e-3)
    assert C[5, 5] == pytest.approx(math.pi / 2 * radius / EI, rel=1e-3)


REFUSED = {
    "no": ("has no part 'no'", "no"),
    "joint": ("is a passive joint, which moves freely", "q"),
    "across": ("'q' is a passive joint", "first..second"),
    "backwards": ("write first..second", "second..first"),
    "drive": ("nothing in it is a beam", "drive"),
    "matrix": ("has no section", "third"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_parts_that_cannot_be_tested_are_refused(name):
    section = Section(5e6, 3e7, 2e8, 4e7)
    first = Beam("first", 100.0, section=section)
    body = alone(
        Joint("drive", AXES["x"], slides=True, fixed=True),
        first,
        Joint("q", AXES["y"], passive=True),
        replace(first, name="second"),
        Beam("third", 100.0, compliance=cantilever(100.0, 5e6, 3e7, 2e8, 4e7)),
    )
    message, part = REFUSED[name]
    with pytest.raises(ValueError, match=message):
        identify_part(body, part)


PATHS = {
    "no pieces": (lambda d: d.update(pieces=[]), "pieces must have at least 1 entry"),
    "a wrong key": (lambda d: d["pieces"][0].update(lenght_mm=3.0), "unknown key 'lenght_mm'; did you mean"),
    "metres": (lambda d: d["pieces"][0].update(length_mm=0.02), "is it in metres"),
    "no section": (lambda d: d["pieces"][0].pop("section"), "section is missing"),
    "a wrong key of a bar": (
        lambda d: d["pieces"][0].update(
            section={"shape": "round_bar", "diametre_mm": 5.0, "youngs_modulus_MPa": 7e4, "poissons_ratio": 0.3}
        ),
        "unknown key 'diametre_mm' in section; did you mean 'diameter_mm'",
    ),
    "inches": (lambda d: d["units"].update(length="in"), "must be 'mm'"),
    "two shapes": (
        lambda d: d["pieces"][0]["end_section"].update(poissons_ratio=None, shear_modulus_MPa=3e4),
        "poissons_ratio|different|must be",
    ),
}


@pytest.mark.parametrize("name", PATHS)
def test_paths_that_make_no_sense_are_refused_in_one_line(name):
    content = tomllib.loads(TAPER)
    change, message = PATHS[name]
    change(content)
    assert is_path(content)
    with pytest.raises(ModelFileError, match=message) as caught:
        build_path(content, "p.toml")
    assert str(caught.value).startswith("p.toml: ")


# Pictures of a part: every panel shows something, and each load its own deflected shape.


FOLDER = Path(__file__).parents[3] / "validation/vjm_validation/examples/parts"


@pytest.fixture(scope="module")
def found(rendering, tmp_path_factory):
    gmsh_or_skip()
    path = drawn(tmp_path_factory.mktemp("prism") / "prism.step", prism)
    task = SolidTask(
        path, IsotropicMaterial(70000.0, 0.3), ("0,0,0",), ("100,0,0",), accuracy=0.2, largest=20_000, first=1500,
        tips=(TipLoad.SPREAD,),
    )  # fmt: skip
    return identify(task)


def pixels(content):
    """Grey values from zero to one."""
    return imread(io.BytesIO(content), format="png")[..., :3].mean(axis=2)


def panels(image, rows=2, columns=3):
    return [part for band in np.array_split(image, rows) for part in np.array_split(band, columns, axis=1)]


def inked(image):
    """Share of a picture that is not white."""
    return float(np.mean(image < 0.97))


@pytest.mark.slow
def test_each_of_six_loads_has_its_own_shape(found):
    six = panels(pixels(load_pictures(found, TipLoad.SPREAD)))
    assert len(six) == 6
    for panel in six:
        # the part fills a tenth of its panel or more
        assert inked(panel) > 0.05
    size = np.min([panel.shape for panel in six], axis=0)
    shapes = [panel[: size[0], : size[1]] < 0.97 for panel in six]
    for i in range(6):
        for j in range(i):
            apart = np.mean(shapes[i] != shapes[j])
            assert apart > 0.005, f"loads {j + 1} and {i + 1} look alike"


@pytest.mark.slow
def test_opposite_wrenches_bend_to_opposite_sides(found):
    up, down = (
        pixels(wrench_picture(found, TipLoad.SPREAD, np.array([0.0, 0.0, f, 0.0, 0.0, 0.0]))) for f in (1.0, -1.0)
    )
    assert inked(up) > 0.05
    assert np.mean((up < 0.97) != (down < 0.97)) > 0.02


@pytest.mark.slow
@pytest.mark.usefixtures("rendering")
def test_faces_are_drawn_with_their_numbers():
    gmsh_or_skip()
    with drawing(FOLDER / "l-bracket.step") as opened:
        image = pixels(numbered_faces(opened.faces))
    left, right = np.array_split(image, 2, axis=1)
    assert inked(left) > 0.05
    assert inked(right) > 0.05


def test_the_number_of_a_tubes_inside_stands_on_its_inside(tmp_path):
    """From an end only a part of it is seen, and nothing lies between it and the viewer."""
    gmsh_or_skip()

    def tube(occ):
        hole = occ.addCylinder(0, 0, 0, 40, 0, 0, 15)
        occ.cut([(3, occ.addCylinder(0, 0, 0, 40, 0, 0, 20))], [(3, hole)])

    with drawing(drawn(tmp_path / "tube.step", tube)) as opened:
        faces = opened.faces
    inside = min((face for face in faces if np.ptp(face.triangles[..., 0]) > 1.0), key=lambda face: face.area)
    toward = np.array([1.0, -1.4, 0.9]) / np.linalg.norm([1.0, -1.4, 0.9])
    places, texts = face_numbers(faces, toward)
    assert len(texts) == len(set(texts)) == 3
    place = places[texts.index(str(inside.number))]
    # the way back along the view first meets the inside, at 15 mm from the axis
    back = place - 0.02 * np.linalg.norm([40.0, 40.0, 40.0]) * toward
    assert np.hypot(back[1], back[2]) == pytest.approx(15.0, abs=0.6)
    assert back @ [0.0, toward[1], toward[2]] < 0.0
    # from across, it is not seen at all
    assert str(inside.number) not in face_numbers(faces, np.array([0.0, -1.0, 0.0]))[1]
