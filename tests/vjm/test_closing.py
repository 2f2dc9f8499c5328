"""The rigid machine closes where closed forms and the legs' own kinematics have it."""

from collections.abc import Mapping

import numpy as np
import pytest

import vjm
from vjm.io.machine_file import build_machine, load_model
from vjm.io.manipulator_file import manipulators
from vjm.io.model_file import written_document
from vjm.machine.platforms import assembled
from vjm.machine.rigid_mechanism import LoopClosure, PoseError, home_label
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Closure, Joint, Part, RigidOffset
from vjm.rotations import Array, displaced, displacement_between, translation, turn

ROBOTS = [entry.name for entry in manipulators()]
SAME = 1e-9
"""rad, and lengths over the machine's: both sides stop at 1e-11, times what the worst pose amplifies."""
Z = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> tuple[Machine, LoopClosure]:
    machine = load_model(str(request.param))
    return machine, LoopClosure(machine, home_label(machine))


def test_every_pose_is_closed_and_puts_the_platform_there(robot: tuple[Machine, LoopClosure]) -> None:
    manipulator, closing = robot
    for displacement in manipulator.poses.values():
        q = closing.displaced(displacement)[None]
        gap, _, (end,), _ = closing.tree.linearised(q)
        assert np.abs(gap).max() < SAME
        assert np.abs(end - displaced(closing.end, displacement)).max() < SAME * closing.tree.length


def test_drives_bring_the_end_effector_back(robot: tuple[Machine, LoopClosure]) -> None:
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
    closing = LoopClosure(four_bar(*lengths), four_bar_angles(*lengths, 0.9))
    for crank in (0.5, 1.0, 1.6, 2.2):
        q = dict(zip(closing.tree.names, closing.held({"crank": crank}), strict=True))
        expected = four_bar_angles(*lengths, crank)
        for name, value in expected.items():
            assert (q[name] - value + np.pi) % (2.0 * np.pi) - np.pi == pytest.approx(0.0, abs=1e-9), (name, crank)


def test_four_bar_linkage_counts_its_redundant_constraints() -> None:
    lengths = (100.0, 260.0, 220.0, 300.0)
    closing = LoopClosure(four_bar(*lengths), four_bar_angles(*lengths, 0.9))
    found = closing.mobility(closing.home)
    # a planar loop closed by a weld in space: three of six rows say what the plane says already
    assert (found.freedom, found.idle_freedom, found.redundant) == (1, 0, 3)


def test_a_wanted_place_without_its_turns_is_reached() -> None:
    lengths = (100.0, 260.0, 220.0, 300.0)
    closing = LoopClosure(four_bar(*lengths), four_bar_angles(*lengths, 0.9))
    target = closing.held({"crank": 1.2})
    x = closing.tree.end_frames(target[None])[0, 0, 3] - closing.end[0, 3]
    q = closing.displaced(np.array([x, 0.0, 0.0, 0.0, 0.0, 0.0]), (True, False, False, False, False, False))
    assert q[0] == pytest.approx(1.2, abs=1e-9)


def test_what_is_out_of_reach_names_the_open_closure() -> None:
    # ground + coupler > crank + rocker: the crank cannot turn all round
    lengths = (200.0, 120.0, 150.0, 300.0)
    closing = LoopClosure(four_bar(*lengths), four_bar_angles(*lengths, 0.5))
    with pytest.raises(PoseError, match=r"closure 'loop' stays .* mm and .* rad open"):
        closing.held({"crank": 2.5})


def test_a_home_that_does_not_close_is_refused() -> None:
    lengths = (100.0, 260.0, 220.0, 300.0)
    angles = four_bar_angles(*lengths, 0.9)
    with pytest.raises(PoseError, match=r"closure 'loop' does not close at home: its frames are .* apart"):
        LoopClosure(four_bar(*lengths), {**angles, "rocker": angles["rocker"] + 0.5})


def test_many_poses_close_from_their_neighbours() -> None:
    closing = LoopClosure(load_model("orthoglide"), "isotropic")
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
    closing = LoopClosure(load_model("delta"), "home")
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
    closing = LoopClosure(load_model("orthoglide"), "isotropic")
    shifts = np.zeros((60, 6))
    shifts[:, :3] = np.linspace(0.0, 230.0, 60)[:, None]
    _, why = closing.all_displaced(shifts)
    assert [not said for said in why] == (shifts[:, 0] < 310.0 / np.sqrt(3.0)).tolist()


# A closure of two parts' ends, as a five-bar linkage has it: against its virtual work.


CRANK, ROD, APART, SOFT, FORCE = 200.0, 300.0, 200.0, 1e-7, 1.0


def test_a_closure_without_frames_holds_the_parts_ends_together():
    section = vjm.shape("square_tube", width_mm=40.0, wall_mm=3.0).stiffness()
    about = vjm.axis("z")

    def arm_of(side):
        knee = vjm.Joint(f"{side}-knee", about, passive=True)
        crank, rod = (
            vjm.Beam(f"{side}-{name}", size, section=section) for name, size in (("a", CRANK), ("b", ROD))
        )
        return [vjm.Joint(side, about, compliance=SOFT), crank, knee, rod]

    angle = 2.0
    rise = np.arccos((0.5 * APART - CRANK * np.cos(angle)) / ROD)
    posture = {"left": angle, "left-knee": rise - angle, "right": np.pi - angle, "right-knee": angle - rise}
    parts = [*arm_of("left"), vjm.RigidOffset("apart", vjm.translation([APART, 0.0, 0.0])), *arm_of("right")]
    tips = vjm.Closure("tips", ("left-b", "right-b"), turns=True)
    machine = vjm.build("five-bar", parts, {"drawn": posture}, after={"apart": ""}, closures=[tips])
    moved = vjm.stiffness(machine, "drawn", wrench=(0.0, -FORCE, 0.0, 0.0, 0.0, 0.0)).displacement
    # dx = 0 gives the rods' turn by the cranks', and virtual work the motors' torque
    turn = -CRANK * np.sin(angle) / (ROD * np.sin(rise))
    torque = 0.5 * FORCE * (CRANK * np.cos(angle) + ROD * np.cos(rise) * turn)
    along = 0.5 * FORCE / np.sin(rise)
    energy = (
        SOFT * torque**2
        + (torque / CRANK) ** 2 * CRANK**3 / (3.0 * section.EIz)
        + along**2 * ROD / section.EA
        + (along * np.cos(rise - angle)) ** 2 * CRANK / section.EA
    )
    # large deflections change 2.6e-3 mm of 200 mm by 1e-5 and more
    assert moved[1] == pytest.approx(-2.0 * energy / FORCE, rel=1e-4)


# A manipulator of legs as one machine: its loops close, and every point of it is where the legs put it.

CLOSES = 1e-10
"""rad, and lengths over the characteristic one: the closing stops at 1e-11, and a few gaps add up along a leg."""


def frames_behind(machine: Machine, label: str) -> dict[str, Array]:
    """Frame ``(4, 4)`` behind each part of the rigid machine, by the parts' own motions one after the other."""
    values = dict(zip((joint.name for joint in machine.joints), machine.posture(label), strict=True))
    values |= machine.held[label]
    frames, before = {"": machine.base}, ""
    for part in machine.parts:
        frames[part.name] = frames[machine.after.get(part.name, before)] @ through(part, values)
        before = part.name
    return frames


def through(part: Part, values: Mapping[str, float]) -> Array:
    """Frame ``(4, 4)`` behind a rigid part from before it, joints at coordinates by name."""
    if isinstance(part, RigidOffset):
        return part.transform
    if isinstance(part, Beam):
        return translation(part.tip)
    if part.fixed:
        return np.eye(4)
    value = values[part.name]
    return translation(value * part.axis) if part.slides else turn(part.axis, value)


def gaps(machine: Machine, label: str) -> Array:
    """Gap ``(c, 6)`` of each closure, lengths over the machine's, and rad."""
    frames = frames_behind(machine, label)
    rows = []
    for closure in machine.closures:
        a, b = (frames[part] @ T for part, T in zip(closure.parts, closure.frames, strict=True))
        rows.append(displacement_between(b, a) / np.repeat([machine.characteristic_length, 1.0], 3))
    return np.array(rows)


def apart(machine: Machine, first: Array, second: Array) -> float:
    """How far two frames are apart: rad, or lengths over the machine's."""
    gap = displacement_between(first, second) / np.repeat([machine.characteristic_length, 1.0], 3)
    return float(np.abs(gap).max())


@pytest.fixture(scope="module", params=ROBOTS)
def machine(request: pytest.FixtureRequest) -> Machine:
    return load_model(str(request.param))


def test_loops_close_in_every_pose(machine: Machine) -> None:
    for label in machine.postures:
        assert np.abs(gaps(machine, label)).max() < CLOSES, label


def test_platform_is_where_the_pose_has_it(machine: Machine) -> None:
    table = written_document(machine.name).content.get("platform", {})
    home = translation(table.get("position_mm", [0.0, 0.0, 0.0]))
    assert not table.get("turns")
    for label, displacement in machine.poses.items():
        end = frames_behind(machine, label)[machine.parts[-1].name]
        assert apart(machine, end, displaced(home, displacement)) < CLOSES, label


def test_a_beam_too_long_leaves_a_gap_of_its_error() -> None:
    nominal = load_model("orthoglide")
    machine = assembled(nominal, {"y/link": 0.5})
    assert np.abs(gaps(nominal, "isotropic")).max() < CLOSES
    open_by = gaps(machine, "isotropic")
    names = [closure.name for closure in machine.closures]
    assert np.linalg.norm(open_by[names.index("y"), :3]) * machine.characteristic_length == pytest.approx(
        0.5, rel=1e-6
    )
    assert np.abs(np.delete(open_by, names.index("y"), axis=0)).max() < CLOSES


def test_a_drive_that_is_off_stands_at_another_coordinate() -> None:
    nominal = load_model("orthoglide")
    machine = assembled(nominal, off={"x": -0.25})
    for label in nominal.poses:
        assert machine.held[label]["x"] - nominal.held[label]["x"] == pytest.approx(-0.25, abs=1e-12)
        assert machine.held[label]["y"] == nominal.held[label]["y"]
    open_by = np.linalg.norm(gaps(machine, "isotropic")[:, :3], axis=1) * machine.characteristic_length
    # the drive carries the platform on its leg, so that both other legs stay short
    assert open_by == pytest.approx([0.25, 0.25], rel=1e-6)


def test_coupled_joints_keep_their_sum() -> None:
    machine = load_model("par2")
    (coupling,) = machine.couplings
    names = [joint.name for joint in machine.joints]
    for label in machine.postures:
        q = machine.posture(label)
        total = sum(weight * q[names.index(joint)] for joint, weight in coupling.terms)
        assert total == pytest.approx(coupling.total, abs=1e-10), label


def test_a_leg_keeps_the_numbers_of_springs_of_its_file() -> None:
    """Of two chains with other numbers a machine cannot say one for all its beams."""
    document = written_document("orthoglide")
    chain = written_document("orthoglide-chain")
    three = chain._replace(content=chain.content | {"springs": {"link_segments": 3}})
    legs = [dict(leg) for leg in document.content["legs"]]
    legs[0]["chain"] = "three"
    content = document.content | {"legs": legs}
    machine = build_machine(document._replace(content=content), {"orthoglide-chain": chain, "three": three})
    original = {beam.name: beam.own_segments for beam in load_model("orthoglide-chain").beams}
    beams = {beam.name: beam.own_segments for beam in machine.beams}
    assert {name: beams[f"x/{name}"] for name in original} == {n: k or 3 for n, k in original.items()}
