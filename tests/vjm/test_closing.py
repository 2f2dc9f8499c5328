"""The rigid machine closes where closed forms and the legs' own kinematics have it."""

from __future__ import annotations

import numpy as np
import pytest

from vjm.io.machine_file import load_model
from vjm.io.manipulator_file import manipulators
from vjm.machine.rigid_mechanism import Closing, PoseError, home_label
from vjm.model.machine import Machine
from vjm.model.parts import Closure, Joint, RigidOffset
from vjm.rotations import displaced, translation

ROBOTS = [entry.name for entry in manipulators()]
SAME = 1e-9
"""rad, and lengths over the machine's: both sides stop at 1e-11, times what the worst pose amplifies."""
Z = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> tuple[Machine, Closing]:
    machine = load_model(str(request.param))
    return machine, Closing(machine, home_label(machine))


def test_every_pose_is_closed_and_puts_the_platform_there(robot: tuple[Machine, Closing]) -> None:
    manipulator, closing = robot
    for displacement in manipulator.poses.values():
        q = closing.displaced(displacement)[None]
        gap, _, (end,), _ = closing.tree.linearised(q)
        assert np.abs(gap).max() < SAME
        assert np.abs(end - displaced(closing.end, displacement)).max() < SAME * closing.tree.length


def test_drives_bring_the_end_effector_back(robot: tuple[Machine, Closing]) -> None:
    manipulator, closing = robot
    drives = [n for n, p in zip(closing.tree.names, closing.tree.passive, strict=True) if not p]
    if not drives:
        # of the parallelogram nothing gives the passive joints but home
        assert np.array_equal(closing.held({}), closing.home)
        return
    for displacement in manipulator.poses.values():
        q = closing.displaced(displacement)
        again = closing.held({name: float(q[closing.tree.names.index(name)]) for name in drives})
        ends = closing.tree.end_frames(np.array([q, again]))
        assert np.abs(ends[0] - ends[1]).max() < SAME * closing.tree.length


def four_bar(crank: float, coupler: float, rocker: float, ground: float) -> Machine:
    """A planar four-bar linkage in the plane z = 0, driven at its crank; the end-effector is the coupler's end."""
    parts = (
        Joint("crank", Z),
        RigidOffset("crank-arm", translation([crank, 0.0, 0.0])),
        Joint("knee", Z, passive=True),
        RigidOffset("coupler", translation([coupler, 0.0, 0.0])),
        RigidOffset("rocker-foot", translation([ground, 0.0, 0.0])),
        Joint("rocker", Z, passive=True),
        RigidOffset("rocker-arm", translation([rocker, 0.0, 0.0])),
        Joint("pin", Z, passive=True),
        RigidOffset("tool"),
    )
    closure = Closure("loop", ("coupler", "pin"), np.array([np.eye(4), np.eye(4)]))
    return Machine("four-bar", parts, after={"rocker-foot": "", "tool": "coupler"}, closures=(closure,))


def four_bar_angles(a: float, b: float, c: float, d: float, crank: float) -> dict[str, float]:
    """All angles of the open four-bar linkage in closed form: the law of cosines at the diagonal."""
    x, y = a * np.cos(crank) - d, a * np.sin(crank)
    diagonal = np.hypot(x, y)
    # the corner lies above the line from the rocker's foot to the knee
    rocker = np.arctan2(y, x) - np.arccos((diagonal**2 + c**2 - b**2) / (2.0 * diagonal * c))
    corner = np.array([d + c * np.cos(rocker), c * np.sin(rocker)])
    coupler = np.arctan2(corner[1] - a * np.sin(crank), corner[0] - a * np.cos(crank))
    return {"crank": crank, "knee": coupler - crank, "rocker": rocker, "pin": coupler - rocker}


def test_four_bar_linkage_is_that_of_the_law_of_cosines() -> None:
    lengths = (100.0, 260.0, 220.0, 300.0)
    closing = Closing(four_bar(*lengths), four_bar_angles(*lengths, 0.9))
    for crank in (0.5, 1.0, 1.6, 2.2):
        q = dict(zip(closing.tree.names, closing.held({"crank": crank}), strict=True))
        expected = four_bar_angles(*lengths, crank)
        for name, value in expected.items():
            assert (q[name] - value + np.pi) % (2.0 * np.pi) - np.pi == pytest.approx(0.0, abs=1e-9), (name, crank)


def test_four_bar_linkage_counts_its_redundant_constraints() -> None:
    lengths = (100.0, 260.0, 220.0, 300.0)
    closing = Closing(four_bar(*lengths), four_bar_angles(*lengths, 0.9))
    found = closing.mobility(closing.home)
    # a planar loop closed by a weld in space: three of six rows say what the plane says already
    assert (found.freedom, found.idle_freedom, found.redundant) == (1, 0, 3)


def test_a_wanted_place_without_its_turns_is_reached() -> None:
    lengths = (100.0, 260.0, 220.0, 300.0)
    closing = Closing(four_bar(*lengths), four_bar_angles(*lengths, 0.9))
    target = closing.held({"crank": 1.2})
    x = closing.tree.end_frames(target[None])[0, 0, 3] - closing.end[0, 3]
    q = closing.displaced(np.array([x, 0.0, 0.0, 0.0, 0.0, 0.0]), (True, False, False, False, False, False))
    assert q[0] == pytest.approx(1.2, abs=1e-9)


def test_what_is_out_of_reach_names_the_open_closure() -> None:
    # ground + coupler > crank + rocker: the crank cannot turn all round
    lengths = (200.0, 120.0, 150.0, 300.0)
    closing = Closing(four_bar(*lengths), four_bar_angles(*lengths, 0.5))
    with pytest.raises(PoseError, match=r"closure 'loop' stays .* mm and .* rad open"):
        closing.held({"crank": 2.5})


def test_a_home_that_does_not_close_is_refused() -> None:
    lengths = (100.0, 260.0, 220.0, 300.0)
    angles = four_bar_angles(*lengths, 0.9)
    with pytest.raises(PoseError, match=r"closure 'loop' does not close at home: its frames are .* apart"):
        Closing(four_bar(*lengths), {**angles, "rocker": angles["rocker"] + 0.5})


def test_many_poses_close_from_their_neighbours() -> None:
    closing = Closing(load_model("orthoglide"), "isotropic")
    shifts = np.zeros((200, 6))
    shifts[:, :3] = np.random.default_rng(1).uniform(-5.0, 5.0, (200, 3))
    wanted = np.tile(closing.end, (200, 1, 1))
    wanted[:, :3, 3] += shifts[:, :3]
    start = np.tile(closing.home, (200, 1))
    q, left = closing.solve(start, np.zeros(start.shape[1], dtype=bool), wanted)
    assert left.max() < 1e-11
    for i in (0, 7, 150):
        assert np.abs((q[i] - closing.displaced(shifts[i])) / closing.tree.unit).max() < SAME


def test_poses_from_neighbours_are_those_from_home() -> None:
    closing = Closing(load_model("delta"), "home")
    shifts = np.zeros((40, 6))
    shifts[:, :3] = np.random.default_rng(2).uniform(-120.0, 120.0, (40, 3))
    # one that no arm reaches
    shifts[7, :3] = 5000.0
    q, why = closing.all_displaced(shifts)
    assert [k for k, said in enumerate(why) if said] == [7]
    assert "is out of reach" in why[7]
    for i in (0, 11, 39):
        assert np.abs((q[i] - closing.displaced(shifts[i])) / closing.tree.unit).max() < SAME


def test_neighbours_do_not_lead_past_a_singularity() -> None:
    # beyond the singular point L/√3 = 178.98 the Orthoglide's platform answers its drives the other way
    closing = Closing(load_model("orthoglide"), "isotropic")
    shifts = np.zeros((60, 6))
    shifts[:, :3] = np.linspace(0.0, 230.0, 60)[:, None]
    _, why = closing.all_displaced(shifts)
    assert [not said for said in why] == (shifts[:, 0] < 310.0 / np.sqrt(3.0)).tolist()
