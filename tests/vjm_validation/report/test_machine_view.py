"""Views of machines: what is drawn lies where the kinematics has it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest

from vjm.io.machine_file import load_model
from vjm.machine.equilibria import unloaded_frames
from vjm.model.mechanism import Mechanism
from vjm_output.optional_drawing import why_not_rendered
from vjm_validation.cli.main import run
from vjm_validation.report.machine_view import BODY, ELASTIC_JOINT, PASSIVE, geometry, labels


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
    assert run(["show", "ur10", "--posture", "work", "--out", str(file)]) == 0
    page = file.read_text()
    scene = json.loads(re.search(r"const scene = (.*);", page).group(1))
    assert {"elbow", "link-3", "tool"} <= {label["text"] for label in scene["labels"]}
    assert ELASTIC_JOINT in page
    assert "http" not in page


@pytest.mark.skipif(bool(why_not_rendered()), reason="this machine cannot render")
def test_a_picture_shows_more_than_white(tmp_path):
    file = tmp_path / "view.png"
    assert run(["show", "planar-2r", "--out", str(file)]) == 0
    from matplotlib.image import imread

    assert imread(file)[..., :3].std() > 0.03


@pytest.mark.parametrize(
    ("words", "said"), [(["--out", "view.jpg"], "ends in .html or .png"), (["--posture", "Z"], "no posture 'Z'")]
)
def test_bad_words_are_refused(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["show", "ur10", *words]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


QUIET = """
import sys
import pyvista
from vjm_output.optional_drawing import plotter
drawn = plotter((64, 48))
drawn.add_mesh(pyvista.Sphere())
sys.stdout.write(str(drawn.screenshot(return_img=True).shape))
"""


@pytest.mark.skipif(bool(why_not_rendered()), reason="this machine cannot render")
def test_drawing_without_a_screen_says_nothing_of_one():
    """VTK looks for an X server first; whoever runs a command without one has nothing to do about it."""
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    done = subprocess.run(
        [sys.executable, "-c", QUIET], capture_output=True, text=True, env=environment, check=True
    )
    assert (done.stdout, done.stderr) == ("(48, 64, 3)", "")
