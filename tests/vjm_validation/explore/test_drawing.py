"""What is drawn of a machine is where the machine is, and as thick as its file says."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.io.shapes import SHAPES
from vjm_validation.explore.drawing import BEAM, BODY, HELD, MachineDrawing, ellipsoid, profile
from vjm_validation.explore.state import Explorer

STEEL = {"youngs_modulus_MPa": 210000.0, "poissons_ratio": 0.3}
SECTIONS = (
    {"shape": "rectangle", "width_mm": 40.0, "thickness_mm": 10.0},
    {"shape": "square_tube", "width_mm": 40.0, "wall_mm": 3.0},
    {"shape": "rectangular_tube", "width_mm": 60.0, "thickness_mm": 40.0, "wall_mm": 3.0},
    {"shape": "i_beam", "width_mm": 60.0, "height_mm": 80.0, "flange_mm": 6.0, "web_mm": 4.0},
    {"shape": "round_bar", "diameter_mm": 20.0},
    {"shape": "round_tube", "diameter_mm": 50.0, "wall_mm": 4.0},
)


def drawn(model, **options):
    explorer = Explorer(model, **options)
    answer = explorer.answer(explorer.start)
    return explorer, answer, MachineDrawing(answer.rest, answer.loaded, answer.modes, explorer.files.sections())


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section["shape"])
def test_the_end_of_a_beam_has_the_area_of_its_section(section):
    shape = SHAPES[section["shape"]].model_validate(section | STEEL)
    own = profile(shape)
    points = np.concatenate(own.outlines)
    a, b, c = (points[own.caps[:, k]] for k in range(3))
    (u, v), (p, q) = (b - a).T, (c - a).T
    area = 0.5 * np.abs(u * q - v * p).sum()
    # a circle is drawn with 24 corners, which takes 1.2 % of its area
    assert area == pytest.approx(shape.area, rel=0.012 if "round" in section["shape"] else 1e-12)
    np.testing.assert_allclose(np.ptp(points, axis=0), shape.sides, rtol=1e-12)


def test_the_tubes_of_an_arm_have_the_sides_that_its_file_says():
    _, _, drawing = drawn("planar-2r", posture="stretched")
    beams = drawing.surfaces[BEAM].at(drawing.rest)
    # the arm lies along x: upper 60 by 60 over 500 mm, fore 40 by 40 behind it
    upper, fore = beams[beams[:, 0] < 499.0], beams[beams[:, 0] > 501.0]
    np.testing.assert_allclose(np.abs(upper[:, 1:]).max(axis=0), [30.0, 30.0])
    np.testing.assert_allclose(np.abs(fore[:, 1:]).max(axis=0), [20.0, 20.0])
    assert beams[:, 0].max() == pytest.approx(900.0)


@pytest.mark.parametrize("model", ["ur10", "delta", "hexapod", "palletiser"])
def test_the_drawn_end_moves_by_the_deflection(model):
    explorer = Explorer(model)
    setting = replace(
        explorer.start, load=tuple(0.2 * each.high if k == 2 else 0.0 for k, each in enumerate(explorer.load))
    )
    answer = explorer.answer(setting)
    drawing = MachineDrawing(answer.rest, answer.loaded, answer.modes, explorer.files.sections())
    np.testing.assert_allclose(drawing.end_moved, answer.deflection[:3], atol=1e-9 * explorer.extent)
    # what is drawn moves as the machine does: no point by more than the end's scale, and something does move
    size = np.linalg.norm(drawing.points(1.0) - drawing.rest, axis=1)
    assert 0.5 * np.linalg.norm(answer.deflection[:3]) < size.max() < 10.0 * np.linalg.norm(answer.deflection[:3])


def test_joints_of_a_robot_are_marked_where_pinocchio_has_them():
    pinocchio = pytest.importorskip("pinocchio", reason="Pinocchio is missing")
    _, _, drawing = drawn("ur10")
    marks = drawing.surfaces[HELD].at(drawing.rest).reshape(6, -1, 3).mean(axis=1)
    # the maker's Denavit-Hartenberg table, all joints at zero
    table = [(127.3, 0, 0.5), (0, -612.0, 0), (0, -572.3, 0), (163.941, 0, 0.5), (115.7, 0, -0.5), (92.2, 0, 0)]
    T, expected = pinocchio.SE3.Identity(), []
    for d, a, turn in table:
        expected.append(T.translation.copy())
        T = T * pinocchio.SE3(pinocchio.utils.rotate("x", turn * np.pi), np.array([a, 0.0, d]))
    np.testing.assert_allclose(marks, expected, atol=1e-3)


def test_a_platform_is_drawn_to_all_its_legs():
    explorer, answer, drawing = drawn("hexapod")
    assert len(answer.loaded.model.chain.closures) == 5
    assert BODY in drawing.surfaces
    assert np.isfinite(drawing.surfaces[BODY].at(drawing.rest)).all()
    assert explorer.posed


def test_the_first_mode_of_an_arm_is_drawn_with_its_largest_motion_as_one():
    _, answer, drawing = drawn("planar-2r")
    assert answer.frequency > 0.0
    assert np.linalg.norm(drawing.mode, axis=1).max() == pytest.approx(1.0)


def test_the_ellipsoid_has_the_stiffnesses_as_half_axes():
    axes = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    stiff = np.array([1.0, 2.0, 8.0])
    mesh = ellipsoid(np.array([10.0, 0.0, 0.0]), stiff, axes, 4.0)
    own = (mesh.vertices - [10.0, 0.0, 0.0]) @ axes
    np.testing.assert_allclose(np.abs(own).max(axis=0), [0.5, 1.0, 4.0], rtol=1e-12)
    # an end that is rigid in a direction: as long as the largest
    rigid = ellipsoid(np.zeros(3), np.array([1.0, 2.0, np.inf]), np.eye(3), 4.0)
    np.testing.assert_allclose(np.abs(rigid.vertices).max(axis=0), [2.0, 4.0, 4.0], rtol=1e-12)
