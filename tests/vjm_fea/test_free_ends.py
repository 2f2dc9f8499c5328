"""K^F of an end-effector that nothing holds, under forces and moments, by every engine that traces it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vjm
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.parts import Beam

WRENCHES = {
    "none": (0.0,) * 6,
    "force": (0.0, 0.0, 100.0, 0.0, 0.0, 0.0),
    "moment": (0.0, 0.0, 0.0, 1e4, 2e4, 0.0),
    "both": (30.0, -20.0, 50.0, 1e4, 0.0, 5e3),
}


def apart(found, expected) -> float:
    size = np.sqrt(np.abs(np.diag(expected)))
    return float(np.abs((found - expected) / size[:, None] / size).max())


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("wrench", WRENCHES)
@pytest.mark.parametrize(("model", "posture", "engine"), [
    ("ur10", "work", "exudyn"), ("planar-2r", "bent", "exudyn"), ("planar-2r", "bent", "opensees"),
])  # fmt: skip
def test_elements_and_springs_agree(model: str, posture: str, engine: str, wrench: str):
    """6e-7 was measured under loads: 16 elements and 16 springs a beam are that near to each other."""
    found, expected = (
        vjm.stiffness(vjm.load(model), posture, wrench=WRENCHES[wrench], engine=each) for each in (engine, "vjm")
    )
    assert apart(found.unloaded, expected.unloaded) < 1e-7
    assert apart(found.loaded, expected.loaded) < 2e-5
    assert found.displacement == pytest.approx(expected.displacement, rel=1e-4, abs=2e-6)


@pytest.mark.slow
def test_a_platform_too():
    robot = vjm.load("orthoglide")
    # elements know no printed matrices: those of the sections instead
    robot = replace(robot, parts=tuple(
        replace(part, compliance=None, own_segments=None) if isinstance(part, Beam) else part
        for part in robot.parts
    ))  # fmt: skip
    found, expected = (
        vjm.stiffness(robot, "isotropic", wrench=WRENCHES["both"], engine=each, options=vjm.EngineOptions(6))
        for each in ("exudyn", "vjm")
    )
    # six elements and six springs a beam: 2e-6 was measured under the load, and 6e-10 without
    assert apart(found.loaded, expected.loaded) < 5e-5
    assert apart(found.unloaded, expected.unloaded) < 2e-8


@pytest.mark.parametrize("wrench", ["force", "moment", "both"])
def test_a_path_ends_with_the_same_stiffness(wrench: str):
    chain = vjm.load("planar-2r")
    case = LoadCase("bent", 1.0, "load", loads=(Load(WRENCHES[wrench]),), free=COMPONENTS, steps=2)
    expected = vjm.stiffness(chain, "bent", wrench=WRENCHES[wrench])
    point = vjm.trace(chain, case).points[-1]
    # two solvers of the same equations: the path's has the pose of a support among them, 5e-9 mm off
    assert apart(point.stiffness, expected.loaded) < 1e-8
    assert point.displacement == pytest.approx(expected.displacement, rel=1e-8, abs=5e-8)


def test_what_cannot_move_is_infinitely_stiff():
    """The stretched UR10: six joints do not deflect in all directions there."""
    chain = vjm.load("ur10")
    case = LoadCase("stretched", 1.0, "load", loads=(Load(WRENCHES["force"]),), free=COMPONENTS, steps=1)
    for engine in ("vjm", "exudyn"):
        assert np.all(np.isinf(vjm.trace(chain, case, engine=engine).points[0].stiffness))


STRESSED = """
format = 1
name = "stressed"
title = "A slide whose spring is under stress"
source = "made up"
units = { length = "mm", force = "N", angle = "rad" }
postures.bent = { turn = 0.3, slide = 20.0 }

[[parts]]
kind = "actuated"
name = "turn"
axis = "y"
compliance_rad_per_Nmm = 1e-7

[[parts]]
kind = "beam"
name = "upper"
length_mm = 300.0

[parts.section]
shape = "round_tube"
diameter_mm = 50.0
wall_mm = 3.0
youngs_modulus_MPa = 70000.0
poissons_ratio = 0.33

[[parts]]
kind = "joint"
name = "slide"
axis = "z"
motion = "slides"
stiffness_N_per_mm = 100.0
rest_mm = 10.0
"""


def test_without_a_load_a_stressed_machine_moves_its_free_end(tmp_path):
    """The slide's spring is 10 mm from its rest: at its end nothing holds it, so that it goes there."""
    (tmp_path / "stressed.toml").write_text(STRESSED)
    machine = vjm.load(str(tmp_path / "stressed.toml"))
    for engine in ("exudyn", "vjm"):
        found = vjm.stiffness(machine, "bent", wrench=(0.0,) * 6, engine=engine)
        assert np.all(found.wrench == 0.0)
        # along the slide, which the turn of 0.3 rad about y has tilted: the shaft bears no force
        expected = 10.0 * np.array([-np.sin(0.3), 0.0, -np.cos(0.3)])
        # 1e-8 mm is what the load that stands for none, 1e-9 N, and both solvers' residuals come to
        assert found.displacement[:3] == pytest.approx(expected, abs=1e-7), engine
