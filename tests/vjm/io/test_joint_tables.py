"""Model files of arms and trees: what they say, and what is refused in one line."""

import copy
import tomllib

import numpy as np
import pytest

from vjm.io.model_file import ModelFileError, build_chain
from vjm.machine.equilibria import equilibria
from vjm.model.mechanism import Mechanism

TEXT = """
format = 1
name = "torso"
title = "Torso with two arms"
source = "made up"
units = { length = "mm", force = "N", angle = "rad" }
[[parts]]
kind = "actuated"
name = "tilt"
axis = "y"
compliance_rad_per_Nmm = 1e-8
lateral_rad_per_Nmm = [2e-9, 0.0]
limits_rad = [-2.0, 2.0]
[[parts]]
kind = "link"
name = "spine"
translation_mm = [0.0, 0.0, 300.0]
mass_kg = 5.0
centre_of_mass_mm = [0.0, 10.0, 150.0]
[[parts]]
kind = "coupled"
name = "chest"
axis = "y"
to = { tilt = -1.0 }
[[parts]]
kind = "actuated"
name = "left"
axis = "x"
motion = "slides"
compliance_mm_per_N = 1e-4
[[parts]]
kind = "link"
name = "left-arm"
translation_mm = [0.0, 200.0, 0.0]
[[parts]]
kind = "payload"
name = "cup"
mass_kg = 1.0
centre_of_mass_mm = [0.0, 0.0, 50.0]
[[parts]]
kind = "joint"
name = "right"
axis = "x"
after = "chest"
stiffness_Nmm_per_rad = 5e5
preload_Nmm = 1e3
[[parts]]
kind = "link"
name = "right-arm"
translation_mm = [0.0, -200.0, 0.0]
mass_kg = 2.0
centre_of_mass_mm = [0.0, -100.0, 0.0]
[postures]
home = { tilt = 0.5, left = 20.0, right = 0.0 }
row = [0.5, 20.0, 0.0]
[[point_springs]]
name = "balance"
between = ["", "spine"]
points_mm = [[0.0, 0.0, -100.0], [0.0, 0.0, 100.0]]
stiffness_N_per_mm = 2.0
free_length_mm = 50.0
[ends]
left-hand = "left-arm"
right-hand = "right-arm"
"""
CONTENT = tomllib.loads(TEXT)


def test_a_file_of_a_tree_is_the_machine_that_it_says():
    chain = build_chain(CONTENT, "m.toml")
    tilt, chest, right = (next(part for part in chain.parts if part.name == n) for n in ("tilt", "chest", "right"))
    assert [joint.kind for joint in (tilt, chest, right)] == ["actuated", "coupled", "sprung"]
    assert (tilt.compliance, tilt.lateral, tilt.limits) == (1e-8, (2e-9, 0.0), (-2.0, 2.0))
    assert chest.coupling.as_deflected
    assert right.preload == 1e3
    model = Mechanism(chain.split())
    assert model.joints == ("tilt", "left", "right")
    assert model.ends == ("left-hand", "right-hand")
    assert model.posture("home") == pytest.approx(model.posture("row"))
    found = equilibria(model, model.posture("home"), gravity=(0.0, 0.0, -9.81))
    assert found.found.all()
    # 8 kg and a spring of some 300 N tilt the torso by thousandths
    assert 1e-4 < np.abs(found.x).max() < 1.0


REFUSALS = {
    "axis of length zero": ("parts/0/axis", [0.0, 0.0, 0.0], "axis = [0.0, 0.0, 0.0] gives no direction"),
    "coupling to itself": ("parts/2/to", {"chest": 1.0}, "part 'chest': is coupled to itself: name another joint"),
    "coupling to nothing": ("parts/2/to", {"tlit": 1.0}, "joint 'chest' is coupled to 'tlit', which is no"),
    "mass without centre": ("parts/1/centre_of_mass_mm", ..., "part 'spine': has mass_kg but no centre_of_mass_mm"),
    "a parent behind it": ("parts/1/after", "right-arm", "part 'spine' begins after 'right-arm', which is no part"),
    "unknown spring key": ("point_springs/0/stifness", 1.0, "unknown key 'stifness'"),
    "spring of no part": ("point_springs/0/between", ["", "nobody"], "spring 'balance' is fixed to 'nobody'"),
    "end of no part": ("ends/left-hand", "nobody", "end frame 'left-hand' lies behind 'nobody', which is no part"),
    "missing coordinate": ("postures/home", {"tilt": 0.5, "left": 1.0}, "no coordinate for the joint 'right'"),
    "unknown coordinate": (
        "postures/home", {"tilt": 0.5, "left": 1.0, "right": 0.0, "chest": 0.1}, "no joint 'chest' to be given",
    ),
    "degrees": ("postures/home/tilt", 30.0, "tilt = 30 rad is beyond ±2π: is it in degrees?"),
    "beyond its limit": ("postures/home/tilt", 2.5, "out of reach: tilt = 2.5 exceeds its limit 2"),
    "too few": ("postures/row", [0.5, 20.0], "2 coordinates for 3 joints (tilt, left, right): give one each"),
    "compliance of the other motion": (
        "parts/0/compliance_mm_per_N", 1e-4,
        "part 'tilt': has compliance_mm_per_N, but it turns: give compliance_rad_per_Nmm",
    ),
    "preload without spring": ("parts/6/stiffness_Nmm_per_rad", 0.0, "has a preload or a rest position"),
    "two compliances": (
        "parts/0/compliance", np.eye(6).tolist(), "part 'tilt': has a 6×6 compliance and another one: give one",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("path", "value", "says"), REFUSALS.values(), ids=REFUSALS)
def test_refusal(path, value, says):
    content = copy.deepcopy(CONTENT)
    *parents, last = [int(step) if step.isdigit() else step for step in path.split("/")]
    table = content
    for step in parents:
        table = table[step]
    if value is ...:
        del table[last]
    else:
        table[last] = value
    with pytest.raises(ModelFileError) as caught:
        build_chain(content, "m.toml")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_rigid_arm_is_refused():
    content = copy.deepcopy(CONTENT)
    content["parts"] = [{"kind": "actuated", "name": "q", "axis": "z"}]
    content |= {"postures": {"home": [0.0]}, "ends": {}, "point_springs": []}
    with pytest.raises(ModelFileError, match="nothing deflects"):
        build_chain(content, "m.toml")


def test_sixty_joints_are_one_machine():
    content = copy.deepcopy(CONTENT)
    joint = {"kind": "actuated", "axis": "y", "compliance_rad_per_Nmm": 1e-9}
    link = {
        "kind": "link",
        "translation_mm": [20.0, 0.0, 0.0],
        "mass_kg": 0.1,
        "centre_of_mass_mm": [10.0, 0.0, 0.0],
    }
    content["parts"] = [part for i in range(60) for part in ({**joint, "name": f"q{i}"}, {**link, "name": f"l{i}"})]
    content |= {"postures": {"home": [0.01] * 60}, "ends": {}, "point_springs": []}
    model = Mechanism(build_chain(content, "m.toml").split())
    assert equilibria(model, model.posture("home"), gravity=(0.0, 0.0, -9.81)).found.all()


MATERIAL = {"youngs_modulus_MPa": 1000.0, "poissons_ratio": 0.0}


@pytest.mark.parametrize(
    ("shape", "A", "J", "Iy", "Iz"),
    [
        # π d²/4, π d⁴/32, π d⁴/64
        ({"shape": "round_bar", "diameter_mm": 20.0}, 314.159265, 15707.9633, 7853.98163, 7853.98163),
        ({"shape": "round_tube", "diameter_mm": 20.0, "wall_mm": 5.0}, 235.619449, 14726.2156, 7363.108, 7363.108),
        # IPE 200 without its fillets: A 2726, Iz 1.846e7, Iy 1.419e6 by hand; J by sectionproperties
        (
            {"shape": "i_beam", "width_mm": 100.0, "height_mm": 200.0, "flange_mm": 8.5, "web_mm": 5.6},
            2724.8, 50645.4, 1.4193e6, 1.8458e7,
        ),
        # 60 by 40 by 4 with sharp corners; J by sectionproperties
        (
            {"shape": "rectangular_tube", "width_mm": 60.0, "thickness_mm": 40.0, "wall_mm": 4.0},
            736.0, 369066.0, 345045.33, 178005.33,
        ),
    ],
)  # fmt: skip
def test_sections_have_the_handbooks_values(shape, A, J, Iy, Iz):
    content = copy.deepcopy(CONTENT)
    content["parts"] = [{"kind": "beam", "name": "b", "length_mm": 500.0, "section": {**shape, **MATERIAL}}]
    content |= {"postures": {"home": []}, "ends": {}, "point_springs": []}
    section = build_chain(content, "m.toml").beams[0].section
    # E = 1000, G = 500; the handbook's digits
    found = (section.EA / 1000, section.GJ / 500, section.EIy / 1000, section.EIz / 1000)
    assert found == pytest.approx((A, J, Iy, Iz), rel=2e-3)
