"""Pictures of a part: every panel shows something, and each load its own deflected shape."""

import io
from pathlib import Path

import numpy as np
import pytest
from helpers.solids import drawn, gmsh_or_skip, prism
from matplotlib.image import imread

from vjm_fea.solid.compliance import TipLoad
from vjm_fea.solid.drawing import drawing
from vjm_fea.solid.elasticity import IsotropicMaterial
from vjm_fea.solid.identify import SolidTask, identify
from vjm_output.optional_drawing import why_not_rendered
from vjm_updating.identify.solid_part import face_numbers, load_pictures, numbered_faces, wrench_picture

FOLDER = Path(__file__).parents[3] / "validation/vjm_validation/examples/parts"


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    gmsh_or_skip()
    reason = why_not_rendered()
    if reason:
        pytest.skip(f"this machine cannot render: {reason}")
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


def test_opposite_wrenches_bend_to_opposite_sides(found):
    up, down = (
        pixels(wrench_picture(found, TipLoad.SPREAD, np.array([0.0, 0.0, f, 0.0, 0.0, 0.0]))) for f in (1.0, -1.0)
    )
    assert inked(up) > 0.05
    assert np.mean((up < 0.97) != (down < 0.97)) > 0.02


@pytest.mark.slow
def test_faces_are_drawn_with_their_numbers():
    gmsh_or_skip()
    reason = why_not_rendered()
    if reason:
        pytest.skip(f"this machine cannot render: {reason}")
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
