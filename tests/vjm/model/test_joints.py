"""One class of joint: what its data make of it, and data that contradict each other."""

import numpy as np
import pytest

from vjm.model.parts import Joint, JointCoupling
from vjm.rotations import AXES

Z = AXES["z"]
FOLLOWS = JointCoupling((("other", 2.0),))


@pytest.mark.parametrize(
    ("data", "kind", "free", "held", "elastic"),
    [
        ({"passive": True}, "free", True, False, False),
        ({"passive": True, "compliance": 1e-7}, "sprung", False, True, True),
        ({}, "actuated", False, True, False),
        ({"lateral": (0.0, 1e-9)}, "actuated", False, True, True),
        ({"matrix": 1e-9 * np.eye(6)}, "actuated", False, True, True),
        ({"coupling": FOLLOWS}, "coupled", False, True, False),
        ({"fixed": True, "compliance": 1e-7}, "actuator", False, False, True),
        ({"fixed": True, "passive": True}, "mount", False, False, False),
    ],
)
def test_its_data_say_what_a_joint_is(data, kind, free, held, elastic):
    joint = Joint("q", Z, **data)
    assert (joint.kind, joint.free, joint.held, joint.elastic) == (kind, free, held, elastic)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"compliance": -1e-9}, "zero or more"),
        ({"compliance": float("nan")}, "zero or more"),
        ({"lateral": (0.0, float("inf"))}, "finite"),
        ({"compliance": 1e-9, "matrix": np.eye(6)}, "and another one"),
        ({"passive": True, "lateral": (1e-9, 0.0)}, "own axis alone"),
        ({"fixed": True, "matrix": np.eye(6)}, "own axis alone"),
        ({"passive": True, "preload": 1.0}, "no spring"),
        ({"compliance": 1e-9, "rest": 0.0}, "no spring"),
        ({"passive": True, "compliance": 1e-9, "rest": 0.1, "preload": 1.0}, "say the same"),
        ({"coupling": JointCoupling(())}, "each named once"),
        ({"coupling": FOLLOWS, "passive": True}, "neither passive nor fixed"),
        ({"coupling": FOLLOWS, "matrix": np.eye(6)}, "no 6×6"),
    ],
)
def test_data_that_contradict_each_other_are_refused(data, said):
    with pytest.raises(ValueError, match=said):
        Joint("q", Z, **data)


def test_a_stiffness_comes_back_as_it_was_written():
    for stiffness in (33e6, 7.7, 0.1, 123456.789, 1.7e9, 3.0):
        assert Joint("q", Z, passive=True, compliance=1.0 / stiffness).stiffness == stiffness


def test_a_follower_stands_where_its_ratios_put_it():
    coupling = JointCoupling((("a", 2.0), ("b", -0.5)), offset=0.25)
    assert coupling.value({"a": 0.5, "b": 3.0, "c": 9.0}) == -0.25
    rows = {"a": np.array([1.0, 0.0]), "b": np.array([0.0, 1.0])}
    np.testing.assert_array_equal(coupling.summed(rows), [2.0, -0.5])
