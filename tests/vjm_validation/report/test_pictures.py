"""What the figures and renders draw."""

import io
import json
import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from helpers.command import refused, validate
from PIL import Image

from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.machine.equilibria import unloaded_frames
from vjm.model.load_case import Direction, LoadCase
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Placement
from vjm_output import optional_drawing, plots
from vjm_output.number_text import number
from vjm_output.plots import PAGE_WIDTH, Margins, drawing_of, figure
from vjm_validation.report.chapter_figures import MARKS, PLACES, converged, lumping_pictures
from vjm_validation.report.figures import (
    Window,
    difference_to,
    reference_force,
    stiffness_with_drops,
    worst_difference,
)
from vjm_validation.report.machine_view import BODY, ELASTIC_JOINT, PASSIVE, geometry, labels
from vjm_validation.report.scenes import (
    Camera,
    Skeleton,
    magnification,
    picture_axes,
    radii_of,
    robot_renders,
    robot_skeleton,
    skeleton,
)
from vjm_validation.studies.chain import Key
from vjm_validation.studies.robots import Robots, RobotStudy

PULLED, PUSHED = Direction.TENSION, Direction.COMPRESSION


def path_of(run, direction, label):
    return run.paths[Key("A", direction, label)]


def test_difference_to_itself_is_zero_and_scales_with_the_norm(run):
    path = path_of(run, PUSHED, "exudyn")
    assert worst_difference(path, path) == 0.0
    stiffer = replace(
        path, points=tuple(replace(p, wrench=1.02 * p.wrench) for p in path.points),
        events=tuple(replace(e, force=1.02 * e.force) for e in path.events),
    )  # fmt: skip
    s, difference = difference_to(stiffer, path)
    at = np.searchsorted(s, path.critical.s)
    assert difference[at] == pytest.approx(0.02, rel=1e-6)


def test_difference_sees_the_kink_of_either_path(run):
    """A path without its points around the bifurcation still has it as an event: no false difference there."""
    path = path_of(run, PUSHED, "exudyn")
    event = path.critical
    near = [p for p in path.points if abs(p.s - event.s) > 0.1]
    assert len(near) < len(path.points)
    assert worst_difference(replace(path, points=tuple(near)), path) < 2e-3


def test_norm_is_the_critical_force_else_the_largest(run):
    pushed, pulled = path_of(run, PUSHED, "exudyn"), path_of(run, PULLED, "exudyn")
    assert reference_force(pushed) == pushed.critical.force
    assert reference_force(pulled) == np.max(pulled.force)


def test_stiffness_drops_straight_at_a_bifurcation(run):
    path = path_of(run, PUSHED, "exudyn")
    force, stiffness = stiffness_with_drops(path)
    at = np.flatnonzero(force == path.critical.force)
    assert len(at) == 2
    assert stiffness[at[0]] == path.critical.stiffness_before
    assert stiffness[at[1]] == path.critical.stiffness_after


def test_window_shows_the_plateau_and_the_critical_point(run):
    paths = {label: path_of(run, PULLED, label) for label in ("vjm-paper", "exudyn")}
    window = Window.around(paths)
    paper = paths["vjm-paper"]
    assert paper.critical.s < window.s < paper.s[-1]
    assert paper.force[-1] < window.force < paths["exudyn"].force[-1]


def test_magnification_keeps_the_machine_recognisable():
    points = np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0]])

    def moved(by):
        return Skeleton(points, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, by]]), ((0, 2, False),), (), beads=False)

    assert magnification([moved(50.0)]) == 1
    assert magnification([moved(5.0)]) == 10
    assert magnification([moved(0.01)]) == 1000


def test_skeleton_opens_the_gap_of_the_paper_s_spring(run):
    path = path_of(run, PULLED, "vjm-paper")
    lines = skeleton(run.chain, path, path.points[-1])
    gap = lines.positions(1.0)[-1] - lines.positions(1.0)[-2]
    assert np.linalg.norm(gap) > 20.0
    rest = lines.positions(0.0)
    assert np.linalg.norm(rest[-1] - rest[-2]) == pytest.approx(0.0, abs=1e-9)
    link = lines.positions(1.0)[-2] - lines.positions(1.0)[-3]
    assert np.linalg.norm(link) == pytest.approx(310.0)
    assert lines.pieces == ((0, 2, False), (1, 4, True), (3, 5, False), (4, 6, True))


def test_skeleton_of_beams_is_thin_on_the_rigid_arm_and_has_the_joints(run):
    path = path_of(run, PUSHED, "exudyn")
    lines = skeleton(run.chain, path, path.points[-1])
    assert [thin for *_, thin in lines.pieces] == [False, True, False]
    foot_tip, tool = lines.points[list(lines.joints)]
    np.testing.assert_allclose(tool - foot_tip, [310.0, 0.0, 0.0], atol=1e-9)


def test_camera_faces_the_sideways_motion_with_the_tool_on_the_right(run):
    path = path_of(run, PUSHED, "exudyn")
    lines = skeleton(run.chain, path, path.points[-1])
    right, up = picture_axes([lines])
    camera = Camera.framing(right, up, [lines], 5)
    np.testing.assert_allclose([right @ right, up @ up, right @ up], [1.0, 1.0, 0.0], atol=1e-12)
    assert (lines.points[-1] - lines.points[0]) @ right > 0.0
    seen = lines.positions(5) - camera.focus
    assert np.max(np.abs(seen @ right)) <= camera.half_width + 1e-9
    assert np.max(np.abs(seen @ up)) <= camera.half_height + 1e-9


@pytest.mark.parametrize(
    ("program", "reason"),
    [("import os; os.abort()", "exit status -6"), ("raise ImportError('no libGL')", "no libGL"),
     ("import time; time.sleep(60)", "TimeoutExpired")],
)  # fmt: skip
def test_a_machine_that_cannot_render_is_found_out_in_another_process(monkeypatch, program, reason):
    monkeypatch.setattr(optional_drawing, "PROBE", program)
    monkeypatch.setattr(optional_drawing, "PROBE_SECONDS", 1.0)
    assert reason in optional_drawing.why_not_rendered.__wrapped__()


def pictures(run):
    return {picture.name: picture for picture in lumping_pictures(run)}


def test_every_placement_has_a_name_and_a_mark_of_its_own():
    assert set(PLACES) == set(MARKS) == set(Placement)
    assert len({*PLACES.values()}) == len({*MARKS.values()}) == len(Placement)


def test_convergence_is_measured_by_the_suite_s_own_converged_force(run):
    compression = run.lumping[1]
    n, force = converged(compression)
    assert (n, force) == (16, dict(row[1:] for row in compression.rows if row[0] == "best")[16])
    caption = pictures(run)["lumping_convergence"].caption
    assert f"against {force:.6g} N, to which the suite's rule itself has converged with 16 springs" in caption
    assert "The black line is how far the finite elements are from it: 3.0×10⁻⁸." in caption


def test_convergence_without_a_fine_model_is_measured_by_the_finite_elements(run):
    tension, compression = run.lumping
    coarse = tuple(row for row in compression.rows if row[1] < 16)
    run.lumping = (tension, replace(compression, rows=coarse))
    assert converged(run.lumping[1]) is None
    caption = pictures(run)["lumping_convergence"].caption
    assert f"against that of the finite elements ({number(compression.reference)} N)" in caption
    run.lumping = (tension, replace(compression, rows=coarse, reference=None))
    assert set(pictures(run)) == {"link_lumping"}
    run.lumping = ()
    assert pictures(run) == {}


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (2, 2), (4, 3)])
def test_margins_hold_what_stands_around_the_axes(rows, columns):
    height = 2.2 * rows
    with figure(height, columns, rows=rows, margins=Margins(between=0.72)) as (fig, axes):
        for ax in axes:
            ax.plot([-2.5, 2.5], [-12345.0, 12345.0])
            ax.set(title="posture A, as drawn", xlabel="ux, mm", ylabel="fx, N")
            ax.tick_params(labelbottom=True)
        boxes = [ax.get_tightbbox() for ax in axes]
    inches = [box.transformed(fig.dpi_scale_trans.inverted()) for box in boxes]
    # text ends on whole pixels, a hundred to the inch
    for box in inches:
        assert -0.01 <= box.x0 <= box.x1 <= PAGE_WIDTH + 0.01
        assert -0.01 <= box.y0 <= box.y1 <= height + 0.01
    assert not any(a.overlaps(b) for k, a in enumerate(inches) for b in inches[:k])


@pytest.fixture(scope="module")
def pressed():
    """The Orthoglide, coarsely, and a stand-in under the finite elements' label."""
    machine, case = load_model("orthoglide"), LoadCase("isotropic", -1.0, "x", steps=2)
    engines = {"vjm-16f16": VjmEngine(2, 2), "exudyn": VjmEngine(3, 3)}
    return {
        ("isotropic", -1, label): replace(engine.trace(machine, case), engine=label)
        for label, engine in engines.items()
    }


def test_a_robot_is_drawn_leg_by_leg_to_one_platform(pressed):
    path = pressed["isotropic", -1, "vjm-16f16"]
    drawn = robot_skeleton(path, path.points[-1])
    # all of the legs' parts, without what holds them
    own = [i for i, s in enumerate(path.stations) if s.part.partition("/")[2] not in ("", "root", "attachment")]
    rows = len(own)
    np.testing.assert_array_equal(drawn.moved[:rows], (path.points[-1].shape - path.points[0].shape)[own])
    legs = [part.partition("/")[0] for part in drawn.parts]
    for first, last, _ in drawn.pieces:
        assert len(set(legs[first:last])) == 1
    # every row of a leg is on a line, and three arms meet at the platform, which has moved by the displacement
    on_lines = {row for first, last, _ in drawn.pieces for row in range(first, last)}
    assert on_lines == set(range(len(drawn.parts)))
    arms = [i for i, leg in enumerate(legs) if leg == "platform"][1::2]
    assert len(arms) == 3
    np.testing.assert_allclose(drawn.moved[arms], 3 * [[-1.0, 0.0, 0.0]], atol=1e-9)


@pytest.mark.slow
@pytest.mark.usefixtures("rendering")
def test_a_robot_turns_with_the_radii_of_its_parts(pressed):
    study = RobotStudy(Robots(stiffness=[], critical=[], misfit=[], mobility=[]), pressed)
    (picture,) = robot_renders(study)
    shown = json.loads(picture.scene)
    assert [model["name"] for model in shown["models"]] == ["exudyn", "vjm-16f16"]
    assert shown["s"][-1] == 1.0
    radii = {round(radius, 3) for _, _, radius in shown["models"][0]["pieces"]}
    leg = load_model("orthoglide-chain")
    assert {round(radius, 3) for radius in radii_of(leg).values()} <= radii
    assert np.asarray(Image.open(io.BytesIO(picture.content))).min() < 100


def test_a_figure_with_lines_is_drawn_as_svg_and_as_png_when_asked(monkeypatch):
    drawn, places = [], []
    make = plots.png
    monkeypatch.setattr(plots, "png", lambda fig: drawn.append(fig) or make(fig))
    for label in ("force", None):
        with figure(2.0, 1) as (fig, (ax,)):
            ax.plot([0.0, 1.0], [0.0, 1e5], label=label)
            ax.set_ylabel("a label of\ntwo lines")
            content = drawing_of(fig)
        assert (content.vector is not None) == (label is not None)
        assert drawn == []
        assert content.png[1:4] == b"PNG"
        assert content.png is content.png
        assert drawn.pop() is fig
        places.append(ax.get_position().bounds)
    # room is made for the labels either way, the same
    assert places[0] == pytest.approx(places[1], abs=1e-3)
    assert places[0][0] > 0.06


def test_ids_of_figures_on_one_page_differ():
    ids = []
    for label in ("one", "two"):
        with figure(2.0, 1) as (fig, (ax,)):
            ax.plot([0.0, 1.0], label=label)
            ids.append(set(re.findall(r'\bid="([^"]*)"', drawing_of(fig).vector.svg)))
    assert len(ids[0]) > 5
    assert ids[0].isdisjoint(ids[1])


# Views of machines: what is drawn lies where the kinematics has it.


@pytest.mark.parametrize(("model", "posture"), [("ur10", "work"), ("planar-2r", "bent"), ("orthoglide-chain", "D")])
def test_the_tool_is_drawn_where_it_is(model, posture):
    chain = load_model(model)
    tree = Mechanism(chain.split())
    _, p = unloaded_frames(tree, tree.posture(posture))
    shown = geometry(chain, posture)
    assert shown.ends[0][1][:3, 3] == pytest.approx(p[0, 0], abs=1e-9)
    names = {name for name, _ in labels(shown)}
    assert {part.name for part in chain.joints} | {part.name for part in chain.held_joints} <= names
    for joint in shown.joints:
        assert np.linalg.norm(joint.axis) == pytest.approx(1.0, abs=1e-12)


def test_a_platform_s_legs_meet_it():
    shown = geometry(load_model("orthoglide"), "Q2")
    tips = [line.points[1] for line in shown.lines if line.name.endswith("/link")]
    platform = shown.ends[0][1][:3, 3]
    # its legs are attached at one point
    assert np.abs(np.array(tips) - platform).max() < 1e-6
    assert not [line for line in shown.lines if line.kind == BODY]
    assert {joint.kind for joint in shown.joints} >= {PASSIVE}
    # the delta's rods end beside its platform's centre
    delta = load_model("delta")
    assert BODY in {line.kind for line in geometry(delta, next(iter(delta.poses))).lines}


def test_a_page_holds_the_machine(tmp_path):
    file = tmp_path / "view.html"
    validate("show", "ur10", "--posture", "work", "--out", file)
    page = file.read_text()
    scene = json.loads(re.search(r"const scene = (.*);", page).group(1))
    assert {"elbow", "link-3", "tool"} <= {label["text"] for label in scene["labels"]}
    assert ELASTIC_JOINT in page
    assert "http" not in page


@pytest.mark.usefixtures("rendering")
def test_a_picture_shows_more_than_white(tmp_path):
    file = tmp_path / "view.png"
    validate("show", "planar-2r", "--out", file)
    from matplotlib.image import imread

    assert imread(file)[..., :3].std() > 0.03


@pytest.mark.parametrize(
    ("words", "said"), [(["--out", "view.jpg"], "ends in .html or .png"), (["--posture", "Z"], "no posture 'Z'")]
)
def test_bad_words_are_refused(words, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said in refused("show", "ur10", *words)
    assert not list(tmp_path.iterdir())


QUIET = """
import sys
import pyvista
from vjm_output.optional_drawing import plotter
drawn = plotter((64, 48))
drawn.add_mesh(pyvista.Sphere())
sys.stdout.write(str(drawn.screenshot(return_img=True).shape))
"""


@pytest.mark.usefixtures("rendering")
def test_drawing_without_a_screen_says_nothing_of_one():
    """VTK looks for an X server first; whoever runs a command without one has nothing to do about it."""
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    done = subprocess.run(
        [sys.executable, "-c", QUIET], capture_output=True, text=True, env=environment, check=True
    )
    assert (done.stdout, done.stderr) == ("(48, 64, 3)", "")
