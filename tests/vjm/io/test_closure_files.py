"""Model files of machines with closed loops."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from vjm.io.errors import ModelFileError
from vjm.io.model_file import load_chain
from vjm.model.machine import Machine
from vjm.postures import in_posture

FOUR_BAR = """
format = 1
name = "four-bar"
title = "a parallelogram of four bars"
source = "made up"

[units]
length = "mm"
force = "N"
angle = "rad"

[[parts]]
name = "crank"
kind = "actuated"
axis = "z"
compliance_rad_per_Nmm = 1e-8

[[parts]]
name = "crank-arm"
kind = "link"
translation_mm = [100.0, 0.0, 0.0]

[[parts]]
name = "knee"
kind = "joint"
axis = "z"

[[parts]]
name = "coupler"
kind = "link"
translation_mm = [300.0, 0.0, 0.0]

[[parts]]
name = "rocker-foot"
kind = "link"
after = ""
translation_mm = [300.0, 0.0, 0.0]

[[parts]]
name = "rocker"
kind = "joint"
axis = "z"

[[parts]]
name = "rocker-arm"
kind = "link"
translation_mm = [100.0, 0.0, 0.0]

[[parts]]
name = "pin"
kind = "joint"
axis = "z"

[[parts]]
name = "tool"
kind = "link"
after = "coupler"

[[closures]]
name = "loop"
between = ["coupler", "pin"]

[postures]
home = { crank = 0.9, knee = -0.902, rocker = 0.899, pin = -0.9 }

[poses]
moved = [MOVED]
"""


MOVED = [100.0 * (math.cos(1.2) - math.cos(0.9)), 100.0 * (math.sin(1.2) - math.sin(0.9)), 0.0]
FOUR_BAR = FOUR_BAR.replace("[MOVED]", str(MOVED))


def written(folder: Path, text: str = FOUR_BAR) -> Path:
    path = folder / "machine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def standing(chain: Machine, label: str) -> dict[str, float]:
    passive = dict(zip((joint.name for joint in chain.joints), chain.posture(label).tolist(), strict=True))
    return {**chain.held[label], **passive}


def angles(crank: float) -> dict[str, float]:
    """Of a parallelogram: the coupler keeps its direction."""
    return {"crank": crank, "knee": -crank, "rocker": crank, "pin": -crank}


def test_rounded_home_is_closed_with_its_drive_where_it_is(tmp_path: Path) -> None:
    chain = load_chain(written(tmp_path))
    assert standing(chain, "home") == pytest.approx(angles(0.9), abs=1e-9)


def test_pose_becomes_a_posture(tmp_path: Path) -> None:
    # 100 (cos 1.2 - cos 0.9) and 100 (sin 1.2 - sin 0.9) are along x and y
    shift = 100.0 * (np.array([np.cos(1.2), np.sin(1.2)]) - np.array([np.cos(0.9), np.sin(0.9)]))
    chain = load_chain(written(tmp_path))
    assert chain.poses["moved"][:2] == pytest.approx(shift, abs=1e-12)
    assert standing(chain, "moved") == pytest.approx(angles(1.2), abs=1e-8)


def test_posture_by_the_drive_brings_the_passive_joints(tmp_path: Path) -> None:
    chain, label = in_posture(load_chain(written(tmp_path)), {"crank": 1.1})
    assert standing(chain, label) == pytest.approx(angles(1.1), abs=1e-9)
    again, label = in_posture(chain, "crank=1.1")
    assert standing(again, label) == pytest.approx(angles(1.1), abs=1e-9)


def test_posture_by_the_end_effector_brings_the_drive(tmp_path: Path) -> None:
    x, y = 100.0 * (np.cos(0.7) - np.cos(0.9)), 100.0 * (np.sin(0.7) - np.sin(0.9))
    chain, label = in_posture(load_chain(written(tmp_path)), (float(x), float(y), 0.0))
    assert standing(chain, label) == pytest.approx(angles(0.7), abs=1e-8)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'between = ["coupler", "pin"]',
            'between = ["coupler", "pim"]',
            "closure 'loop' holds 'pim', which is no part",
        ),
        (
            'between = ["coupler", "pin"]',
            'between = ["coupler"]',
            "closure 'loop': between must have at least 2 entries",
        ),
        ('name = "loop"', 'name = "loop"\nholds = "glue"', "closure 'loop': holds must be 'weld' or 'ball'"),
        ('name = "loop"', 'name = "loop"\nfame = 1', "closure 'loop': unknown key 'fame'"),
        ("rocker = 0.899", "rocker = 1.9", "posture 'home': four-bar: closure 'loop' does not close at home"),
        (
            "moved = [",
            "far = [0.0, 0.0, 50.0]\nmoved = [",
            "pose 'far': four-bar: the pose 0,0,50,0,0,0 is out of reach",
        ),
        ("moved = [", "home = [", "'home' is a posture and a pose: rename one"),
        ('[[closures]]\nname = "loop"\nbetween = ["coupler", "pin"]', "", "has [poses] but no [[closures]]"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in FOUR_BAR
    with pytest.raises(ModelFileError) as error:
        load_chain(written(tmp_path, FOUR_BAR.replace(old, new)))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_what_is_no_pose_is_refused(tmp_path: Path) -> None:
    chain = load_chain(written(tmp_path))
    with pytest.raises(ValueError, match="2 coordinates are no pose of it: give x,y,z"):
        in_posture(chain, "1,2")
    with pytest.raises(ValueError, match="no held joint 'knee'; held joints are crank"):
        in_posture(chain, "crank=1,knee=2")


def test_coupling_keeps_its_sum_of_home(tmp_path: Path) -> None:
    coupled = (
        '[[couplings]]\nname = "belt"\nterms = [\n  { joint = "rocker", weight = 1.0 },\n'
        '  { joint = "pin", weight = 1.0 },\n]\n'
    )
    chain = load_chain(
        written(tmp_path, FOUR_BAR.replace("[postures]", coupled + "\n[postures]").replace("0.899", "0.9"))
    )
    assert chain.couplings[0].total == pytest.approx(0.0, abs=1e-12)
    chain, label = in_posture(chain, {"crank": 1.1})
    assert standing(chain, label) == pytest.approx(angles(1.1), abs=1e-9)
