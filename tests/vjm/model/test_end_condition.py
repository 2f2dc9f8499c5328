"""End-effectors that are let go in some components: closed forms, and the same joints put into the chain."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES

EA, EULER, LENGTH = 1e6, 1000.0, 100.0
EI = EULER * LENGTH**2 / np.pi**2
PUSH = Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
SECTION = Section(EA, EI, 20.0 * EI, EI)


def column(*joints: str) -> Machine:
    """A bar along x, clamped or on hinges about z."""
    parts: list = [Beam("link", LENGTH, section=SECTION)]
    if "base" in joints:
        parts.insert(0, Joint("q1", AXES["z"], passive=True))
    if "tip" in joints:
        parts.append(Joint("q2", AXES["z"], passive=True))
    return Machine("column", tuple(parts), postures={"straight": np.zeros(len(joints))})


def buckling_load(euler):
    return 0.5 * EA * (1.0 - np.sqrt(1.0 - 4.0 * euler / EA))


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(
    ("joints", "free", "factor"),
    [
        ((), (), 4.0),
        ((), ("rz",), 2.0457485159),  # tan kL = kL
        ((), ("rx", "ry", "rz"), 2.0457485159),
        ((), ("y",), 1.0),
        ((), ("y", "rz"), 0.25),
        ((), COMPONENTS[1:], 0.25),
        (("base",), (), 2.0457485159),
        (("base",), ("rz",), 1.0),
    ],
)
@pytest.mark.parametrize("force", [False, True], ids=["displacement", "force"])
def test_columns_buckle_as_their_ends_are_held(joints, free, factor, force):
    """Euler's loads, whether the end is pushed by a displacement or by a dead load."""
    exact = buckling_load(factor * EULER)
    load_case = (
        LoadCase("straight", -1.2 * exact, "load", free=("x", *free), loads=(PUSH,))
        if force
        else LoadCase("straight", -1.2 * exact * LENGTH / EA, free=free)
    )
    path = VjmEngine(16).trace(column(*joints), load_case)
    assert path.critical.kind is EventKind.BIFURCATION
    # sixteen springs: tenth order, 3e-8 of two half-waves; tan kL = kL is that of ten digits and holds for the
    # extensible column too, whose shortened arc is in `buckling_load`
    assert path.critical.force == pytest.approx(exact, rel=5e-8)
    assert path.critical.point.displacement[0] == pytest.approx(-path.critical.force * LENGTH / EA, rel=4e-10)


def test_a_hinge_of_the_hand_is_a_joint_of_the_chain():
    free = VjmEngine(8).trace(column("base"), LoadCase("straight", -3.0, free=("rz",), steps=30))
    own = VjmEngine(8).trace(column("base", "tip"), LoadCase("straight", -3.0, steps=30))
    # the error measured is rounding alone
    assert free.critical.force == pytest.approx(own.critical.force, rel=1e-10)
    # the error measured is rounding alone
    assert free.force[-1] == pytest.approx(own.force[-1], rel=1e-10)
    # the bar turns in the support; the chain's own joint turns in the tool
    turned = free.displacement[-1, 5]
    assert abs(turned) > 0.1
    assert np.abs(own.displacement[-1, 3:]).max() == 0.0
    assert np.abs(free.wrench[:, 3:]).max() < 1e-6


def test_the_end_slides_where_it_is_free_and_feels_nothing_there():
    side = Load((0.0, 1.0, 0.0, 0.0, 0.0, 0.0), "link", 0.5)
    load_case = LoadCase("straight", 100.0, "load", free=("x", "rz"), loads=(side,))
    path = VjmEngine(16).trace(column("base"), load_case)
    end = path.points[-1]
    assert path.complete
    # the error measured is rounding alone
    assert end.wrench[0] == pytest.approx(0.0, abs=1e-9)
    # the error measured is rounding alone
    assert end.wrench[5] == pytest.approx(0.0, abs=1e-9)
    # a beam on two supports: half the load at either, F L²/(16 EI) at its ends and F L³/(48 EI) in the middle,
    # to the second order of the turn
    assert end.wrench[1] == pytest.approx(-50.0, rel=1e-10)
    turn = 100.0 * LENGTH**2 / (16.0 * EI)
    assert end.displacement[5] == pytest.approx(-turn, rel=turn**2)
    assert end.displacement[0] < 0.0


def test_superfluous_hinges_of_the_tool_are_left_out(chain):
    """The orthoglide's tool turns about its own last joints: a ball in the support adds one turn, not three."""
    locked, free = (
        VjmEngine(8).trace(chain, LoadCase("A", -4.0, free=turns)) for turns in ((), ("rx", "ry", "rz"))
    )
    # the error measured is rounding alone
    assert free.critical.force == pytest.approx(locked.critical.force, rel=1e-10)
    # the error measured is rounding alone
    assert free.force[-1] == pytest.approx(locked.force[-1], rel=1e-10)


def test_free_turns_take_the_stability_of_the_slanted_postures(chain):
    """Locked, postures B and D bend over; with the tool free to turn, under a dead load, they buckle."""
    push = LoadCase("B", -8000.0, "load", free=("x", "rx", "ry", "rz"), loads=(PUSH,))
    free = VjmEngine(8).trace(chain, push)
    locked = VjmEngine(8).trace(chain, LoadCase("B", -8000.0, "load", free=("x",), loads=(PUSH,)))
    assert free.critical.kind is EventKind.BIFURCATION
    assert locked.critical.kind is EventKind.STIFFNESS_KNEE
    assert free.critical.force == pytest.approx(7509.3, abs=1.0)
    # the same state is an equilibrium under the imposed displacement, and there it is stable
    driven = VjmEngine(8).trace(chain, LoadCase("B", -8.5, free=("rx", "ry", "rz")))
    assert driven.complete


def test_a_mechanism_is_refused(chain):
    with pytest.raises(ValueError, match="posture A: with y free the chain is a mechanism"):
        VjmEngine(2).trace(chain, LoadCase("A", -1.0, free=("y",)))


def test_a_tool_that_turns_by_half_a_turn_has_a_displacement():
    moment = Load((0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    load_case = LoadCase("straight", np.pi * EI / LENGTH, "load", free=("x", "y", "rz"), loads=(moment,))
    path = VjmEngine(4).trace(column(), load_case)
    assert abs(path.points[-1].displacement[5]) == pytest.approx(np.pi, abs=1e-9)


def test_the_shape_is_the_chain_s_without_the_hand(chain):
    load_case = LoadCase("B", -1.0, free=("rx", "ry", "rz"))
    path = VjmEngine(4).trace(chain, load_case)
    locked = VjmEngine(4).trace(chain, replace(load_case, free=()))
    assert path.stations == locked.stations
    assert all(point.shape.shape == (len(path.stations), 3) for point in path.points)
    assert np.array_equal(path.points[0].shape, locked.points[0].shape)
