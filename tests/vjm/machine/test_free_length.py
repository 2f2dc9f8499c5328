"""A beam whose free length is a joint's coordinate: against a beam of that length, closed forms, differences."""

import copy

import numpy as np
import pytest

from vjm.io.model_file import ModelFileError, build_chain
from vjm.kernels.derivatives import frame_derivatives
from vjm.machine.equilibria import equilibria, unloaded_frames
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, JointCoupling, RigidOffset, Section
from vjm.rotations import AXES, translation

EI, MASS, WHOLE = 1.0e8, 0.5, 2100.0
DOCUMENT = {
    "format": 1, "name": "boom", "title": "A boom", "source": "made up",
    "units": {"length": "mm", "force": "N", "angle": "rad"},
    "parts": [
        {"kind": "actuated", "name": "extension", "axis": "x", "motion": "slides",
         "lateral_rad_per_Nmm": [1e-7, 2e-7],
         "compliance_mm_per_N": 1e-3},
        {"kind": "beam", "name": "boom", "length_mm": WHOLE, "free_length": "extension", "mass_kg": MASS,
         "section": {"EA_N": 1e6, "GJ_Nmm2": 1e8, "EIy_Nmm2": EI, "EIz_Nmm2": 1.3e8, "GAy_N": 4e5}},
        {"kind": "link", "name": "tip", "translation_mm": [10.0, 0.0, 0.0], "mass_kg": 0.2,
         "centre_of_mass_mm": [5.0, 0.0, 0.0]},
    ],
    "postures": {"out": {"extension": 1500.0}},
}  # fmt: skip
GRAVITY = (0.0, 0.0, -9.81)
WRENCH = np.array([-15.0, 2.0, -3.0, 400.0, 0.0, 300.0])
LENGTHS = np.array([[257.0], [1500.0], [2013.0]])


@pytest.fixture(scope="module")
def chain():
    return build_chain(DOCUMENT, "boom.toml")


def test_it_is_the_beam_of_that_length(chain):
    model = Mechanism(chain.split())
    found = equilibria(model, LENGTHS, gravity=GRAVITY, wrench=WRENCH)
    for k, length in enumerate(LENGTHS[:, 0]):
        same = equilibria(
            Mechanism(chain.locked({"extension": length}).refined(4).split()),
            np.zeros((1, 1)),
            gravity=GRAVITY,
            wrench=WRENCH,
        )
        # the same springs by the other way of making them: rounding of 2 m
        assert np.abs(found.position[k] - same.position[0]).max() < 1e-11
        assert found.compliance[k, 0] == pytest.approx(same.compliance[0, 0], rel=1e-9, abs=1e-15)
    unloaded = equilibria(model, LENGTHS).position[:, 0, 0]
    assert unloaded == pytest.approx(LENGTHS[:, 0] + 10.0, abs=1e-9)


def test_small_loads_deflect_it_as_the_textbook_says():
    content = copy.deepcopy(DOCUMENT)
    content["parts"] = content["parts"][:2]
    content["parts"][0] = {"kind": "actuated", "name": "extension", "axis": "x", "motion": "slides"}
    model = Mechanism(build_chain(content, "boom.toml").split())
    found = equilibria(model, LENGTHS, wrench=np.array([0.0, 0.0, -1e-3, 0.0, 0.0, 0.0]))
    # the shortening of the deflected beam is of the second order, 1e-8 of this
    assert found.deflection[:, 0, 2] == pytest.approx(-1e-3 * LENGTHS[:, 0] ** 3 / (3.0 * EI), rel=1e-6)
    weight = equilibria(model, LENGTHS, gravity=(0.0, 0.0, -9.81e-4))
    w = 9.81e-4 * MASS / WHOLE
    # where the halves' weights act the segments' ends are exact; the second order is 1e-11 of this
    assert weight.deflection[:, 0, 2] == pytest.approx(-w * LENGTHS[:, 0] ** 4 / (8.0 * EI), rel=2e-10)


def test_derivatives_by_its_length_are_the_differences_of_equilibria(chain):
    model, step = Mechanism(chain.split()), 0.05

    def position(q):
        return equilibria(model, q, gravity=GRAVITY, wrench=WRENCH, compliance=False).position

    found = equilibria(model, LENGTHS, gravity=GRAVITY, wrench=WRENCH, compliance=False)
    exact = frame_derivatives(
        model.arrays(GRAVITY, moments=True),
        model.values(LENGTHS),
        model.naturals(LENGTHS),
        WRENCH[None, None],
        found.x,
    )
    by_length = sum(share * exact.value[:, :, :3, joint] for joint, share in model.shares("extension").items())
    # Richardson: the remainder is the rounding of 2 m over a step, 1e-11
    fine, coarse = ((position(LENGTHS + h) - position(LENGTHS - h)) / (2.0 * h) for h in (step, 2.0 * step))
    assert np.abs(by_length - (4.0 * fine - coarse) / 3.0).max() < 1e-9


def _turning(content):
    content["parts"][0] |= {"motion": "turns", "compliance_mm_per_N": 0.0}
    content["postures"]["out"]["extension"] = 1.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["parts"][1].update(free_length="extent"), "'extent' is no actuated joint before it"),
        (_turning, "free_length = 'extension' is no actuated joint before it that slides"),
        (lambda d: d["parts"][1].update(bow_mm=[1.0, 0.0]), "neither bow_mm nor a compliance"),
        (lambda d: d["postures"]["out"].update(extension=2200.0), "2200 exceeds its limit 2100 by 100 mm"),
        (lambda d: d["postures"]["out"].update(extension=0.0), "extension = 0 is below its limit 0.01 by 0.01 mm"),
        (lambda d: d["parts"].insert(2, d["parts"][1] | {"name": "other"}), "pushes out another beam too"),
    ],
)  # fmt: skip
def test_what_cannot_be_pushed_out_is_refused(change, said):
    content = copy.deepcopy(DOCUMENT)
    change(content)
    with pytest.raises(ModelFileError, match=said) as caught:
        build_chain(content, "boom.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("locked", [False, True])
def test_what_follows_a_joint_that_pushes_a_beam_out_stands_where_that_brings_it(locked: bool):
    """A joint that turns by 1e-3 rad a mm has turned by half a radian 500 mm out; a link of 100 mm lies behind."""
    parts = (
        Joint("out", AXES["x"], True),
        Beam("boom", 1000.0, section=Section(1e7, 1e9, 1e9, 1e9), free_length="out"),
        Joint("follower", AXES["z"], coupling=JointCoupling((("out", 1e-3),))),
        RigidOffset("tool", translation([100.0, 0.0, 0.0])),
    )
    machine = Machine("boom", parts, postures={"p": np.zeros(0)}, held={"p": {"out": 500.0}})
    model = Mechanism((machine.at("p") if locked else machine).split())
    place = [500.0 + 100.0 * np.cos(0.5), 100.0 * np.sin(0.5), 0.0]
    # a few turns and shifts of 500 mm in doubles
    assert unloaded_frames(model, model.posture("p"))[1][0, 0] == pytest.approx(place, abs=1e-11)
    if locked:
        assert model.kinematics(np.zeros(model.size)).end[:3, 3] == pytest.approx(place, abs=1e-11)
