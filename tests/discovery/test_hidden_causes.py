"""One cause hidden in three postures' readings, by a law that the finder does not have.

The truth is a chain of integrated rods with other constitutive laws, or Exudyn's beams; sizes are such that the
cause is visible at the strength that is said. What is right is said in the words of
docs/measured-data.md by `judging.right`.
"""

import pytest
from hidden_effects.judging import right
from hidden_effects.plan import CAUSES, Group

HIDDEN = ("joint_friction", "actuator_backlash", "creep", "plasticity", "load_misalignment")
"""By bristles, soft walls, two terms, a gradual law, a tilt in any direction."""
EXPLAINED = ("joint_friction", "actuator_backlash")
"""Causes whose held-out postures are predicted within 1.3 times the noise; the others' laws extrapolate worse."""
EXTRAPOLATED = (*EXPLAINED, "plasticity", "load_misalignment")
"""Causes of which another posture is predicted as well as a right model could; creep by two terms of another law is
one and a half times worse."""


@pytest.mark.slow
def test_a_small_test_finds_what_is_hidden(hide_in_a_small_test):
    """Two postures of ten readings each; friction by bristles."""
    truth, found = hide_in_a_small_test(1000 + CAUSES.index("joint_friction"), Group.SINGLE, "joint_friction")
    assert truth["hidden"][0]["strength"] > 16.0
    assert right(truth, found), (found["verdict"], [c["causes"] for c in found["candidates"]], truth["admitted"])
    assert found["gain"]["after_in_sigma"] <= 1.3 < found["gain"]["before_in_sigma"]


def test_a_small_test_finds_nothing_where_nothing_is_hidden(hide_in_a_small_test):
    _, found = hide_in_a_small_test(1, Group.QUIET)
    assert (found["verdict"], found["causes"]) == ("none", [])


@pytest.mark.slow
@pytest.mark.parametrize("cause", HIDDEN)
def test_a_hidden_cause_is_found(hide, cause):
    truth, found = hide(1000 + CAUSES.index(cause), Group.SINGLE, cause)
    assert truth["hidden"][0]["strength"] > 16.0
    assert right(truth, found), (found["verdict"], [c["causes"] for c in found["candidates"]], truth["admitted"])
    gain = found["gain"]
    assert gain["after_in_sigma"] < gain["before_in_sigma"]
    if cause in EXPLAINED:
        assert gain["after_in_sigma"] <= 1.3
    if cause in EXTRAPOLATED:
        # a third beyond: what is held out together is wrong together
        assert gain["after_in_sigma"] <= 1.3 * gain["expected_in_sigma"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_where_nothing_is_hidden_nothing_is_found(hide, seed):
    _, found = hide(seed, Group.QUIET)
    assert found["verdict"] == "none"
    assert found["causes"] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "outside", [pytest.param("0", id="periodic lead screw"), pytest.param("4", id="softening with temperature")]
)
def test_a_cause_that_no_catalogue_has_is_unknown(hide, outside):
    truth, found = hide(3000 + int(outside), Group.OUTSIDE, outside, strength=40.0)
    # no cause of the catalogue can be stretched over it
    assert truth["apart"] > 8.0
    assert found["verdict"] == "unknown", found["causes"]


@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason="play and friction named, not unknown: docs/hidden-effects.md")
def test_a_dead_zone_that_hides_one_reading_is_no_accident(hide_in_a_ramp):
    truth, found = hide_in_a_ramp(3002, Group.OUTSIDE, "2", strength=15.0)
    assert truth["hidden"][0]["cause"] == "dead_zone"
    # of the first step of some 120 N it hides a part, and nothing of the second
    assert truth["hidden"][0]["size"] < 130.0
    assert truth["apart"] > 8.0
    assert found["verdict"] == "unknown", found["causes"]


@pytest.mark.slow
def test_two_causes_are_both_found(hide):
    truth, found = hide(4001, Group.PAIR, "joint_friction", "actuator_compliance")
    assert right(truth, found), (found["verdict"], [c["causes"] for c in found["candidates"]])


@pytest.mark.slow
def test_a_design_that_cannot_separate_says_so_and_what_would(hide_in_a_ramp):
    truth, found = hide_in_a_ramp(5001, Group.SINGLE, "actuator_backlash")
    # in posture A the link lies along the drive: backlash in the one is backlash in the other
    assert ["joint_clearance"] in truth["admitted"]
    assert found["verdict"] == "class"
    assert {"actuator_backlash", "joint_clearance"} <= set(found["causes"])
    assert found["next_experiment"]["posture"] != "A"
    assert found["next_experiment"]["path"]
