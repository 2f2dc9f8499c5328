"""Trees: against an independent solver, Pinocchio's statics and closed forms."""

from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from helpers.random_machines import GRAVITY, random_machine
from helpers.virtual_work import Statics

import vjm
from vjm.engines import VjmEngine
from vjm.machine.equilibria import equilibria, unloaded_frames
from vjm.model.load_case import Load
from vjm.model.machine import USUAL_SEGMENTS, Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, JointCoupling, PointSpring, RigidOffset, Section
from vjm.rotations import AXES, frame, rotation_from_vector, translation
from vjm.statics import loaded_stiffness, solve_under_wrench

WEIGHT = (0.0, 0.0, -9.81)


def close_to_own_statics(seed: int) -> None:
    """An equilibrium and its compliance against the independent solver's; both to 1e-7 of their size."""
    chain, values = random_machine(seed)
    loads = (Load((20.0, -35.0, 12.0, 0.0, 0.0, 0.0), chain.parts[-1].name),)
    found = equilibria(Mechanism(chain.split()), values, gravity=GRAVITY, loads=loads)
    assert found.converged.all()
    # from there, as soft machines have several equilibria; it moves on unless this is one
    own = Statics(chain, values, gravity=GRAVITY, loads=loads).solve(found.x[0])
    assert bool(found.stable[0]) == (own.negative == 0)
    moved = max(float(np.abs(found.deflection[0, :, :3]).max()), 1e-3)
    for k, end in enumerate(chain.ends):
        # both solve to rounding: 1e-12 of positions of a metre
        assert found.position[0, k] == pytest.approx(own.ends[end][:3, 3], abs=1e-7 * moved)
        C, size = own.compliance[end], np.repeat([1.0, 300.0], 3)
        expected = C * size[:, None] * size
        bound = 1e-7 * np.abs(expected).max()
        assert found.compliance[0, k] * size[:, None] * size == pytest.approx(expected, abs=bound)


@pytest.mark.parametrize("seed", range(12))
def test_random_machines_against_the_independent_solver(seed: int):
    close_to_own_statics(seed)


@pytest.mark.slow
def test_five_hundred_random_machines_against_the_independent_solver():
    for seed in range(500):
        close_to_own_statics(seed)


def arm(count: int = 6, compliance: float = 1e-8, lateral: float = 0.0, seed: int = 3) -> Machine:
    """A serial arm with random links."""
    rng = np.random.default_rng(seed)
    parts: list = []
    for i in range(count):
        axis = AXES["zyx"[int(rng.integers(3))]]
        parts.append(Joint(f"q{i}", axis, compliance=compliance, lateral=(lateral, lateral)))
        T = frame(rotation_from_vector(rng.normal(size=3)), rng.uniform(-300, 300, 3))
        parts.append(RigidOffset(f"l{i}", T, float(rng.uniform(1, 9)), rng.uniform(-100, 100, 3)))
    return Machine("arm", tuple(parts))


def test_torques_are_pinocchios():
    chain = arm(compliance=1e-18)
    model = pinocchio.Model()
    model.gravity.linear = np.array(WEIGHT)
    parent, placement = 0, pinocchio.SE3.Identity()
    for part in chain.parts:
        if isinstance(part, Joint):
            parent = model.addJoint(parent, pinocchio.JointModelRevoluteUnaligned(part.axis), placement, part.name)
            placement = pinocchio.SE3.Identity()
        else:
            inertia = pinocchio.Inertia(part.mass, 1e-3 * placement.act(part.centre), np.eye(3))
            model.appendBodyToJoint(parent, inertia, pinocchio.SE3.Identity())
            placement = placement * pinocchio.SE3(part.transform[:3, :3], 1e-3 * part.transform[:3, 3])
    q = np.random.default_rng(1).uniform(-3, 3, (5, 6))
    found = equilibria(Mechanism(chain.split()), q, gravity=WEIGHT)
    data = model.createData()
    for row, torque in zip(q, found.torques, strict=True):
        # N m to N mm; the arm bends by 1e-12, which is what its torques differ by
        expected = 1e3 * pinocchio.computeGeneralizedGravity(model, data, row)
        assert torque == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())


def test_a_serial_arm_is_the_chains_virtual_joint_model():
    chain = arm(lateral=3e-9)
    names = [joint.name for joint in chain.held_joints]
    q = np.random.default_rng(2).uniform(-2, 2, 6)
    wrench = np.array([120.0, -80.0, 200.0, 3e4, -2e4, 1e4])
    found = equilibria(Mechanism(chain.split()), q, wrench=wrench)
    model = Mechanism(chain.locked(dict(zip(names, q, strict=True))))
    at = solve_under_wrench(model, wrench, np.zeros(model.size))
    # two solvers to 1e-11 of the scaled residual
    assert found.x[0] == pytest.approx(at.x, abs=1e-9 * np.abs(at.x).max())
    K = loaded_stiffness(at)
    scale = np.sqrt(np.outer(np.diag(K), np.diag(K)))
    assert found.stiffness[0, 0] / scale == pytest.approx(K / scale, abs=1e-8)


def test_split_beams_are_the_chains():
    section = Section(EA=7e6, GJ=2e8, EIy=3e8, EIz=2e8)
    chain = Machine("beams", (Beam("upper", 500.0, section=section), Beam("fore", 400.0, section=section)))
    chain = chain.refined({"upper": 4, "fore": 6})
    wrench = np.array([-50.0, 300.0, -200.0, 0.0, 0.0, 0.0])
    found = equilibria(Mechanism(chain.split()), np.zeros((1, 0)), wrench=wrench)
    model = Mechanism(chain)
    at = solve_under_wrench(model, wrench, np.zeros(model.size))
    # both to 1e-11 of the scaled residual, over 60 coordinates
    assert found.x[0] == pytest.approx(at.x, abs=1e-8 * np.abs(at.x).max())


def test_followers_and_end_moments_have_their_tangent():
    chain = arm(lateral=2e-9)
    loads = (Load((40.0, 90.0, -60.0, 2e4, -3e4, 5e3), "l3", follower=True),)
    model, q = Mechanism(chain.split()), np.random.default_rng(5).uniform(-2, 2, 6)
    wrench = np.array([10.0, -20.0, 30.0, 1e4, 2e4, -1e4])
    found = equilibria(model, q, gravity=WEIGHT, wrench=wrench, loads=loads)
    for i in range(6):
        size = np.where(np.arange(6) < 3, 1.0, 300.0)[i]
        ahead, behind = (
            equilibria(model, q, gravity=WEIGHT, wrench=wrench + s * size * np.eye(6)[i], loads=loads)
            for s in (1.0, -1.0)
        )
        shift = (ahead.position - behind.position)[0, 0] / (2.0 * size)
        # central difference over 1 N: its error is the cube of 1e-4 rad
        assert found.compliance[0, 0, :3, i] == pytest.approx(shift, abs=2e-8 * np.abs(shift).max())


def test_a_sprung_column_buckles_at_its_closed_form():
    # three links of a mm on springs of k N mm/rad under a dead axial load: P a / k is the smallest eigenvalue of
    # the springs' matrix over that of the load, 0.1981 for three links (a discrete cantilever column)
    k, a = 2e5, 100.0
    stiff = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]]) * k
    critical = float(np.linalg.eigvalsh(stiff / a)[0])
    parts: list = []
    for i in range(3):
        parts += [Joint(f"q{i}", AXES["z"], compliance=1.0 / k), RigidOffset(f"l{i}", translation([a, 0, 0]))]
    model = Mechanism(Machine("column", tuple(parts)).split())
    for factor, stable in ((1.0 - 1e-9, True), (1.0 + 1e-9, False)):
        found = equilibria(model, np.zeros(3), wrench=np.array([-factor * critical, 0, 0, 0, 0, 0]))
        assert bool(found.stable[0]) is stable


def test_a_preload_holds_a_pendulum_and_its_spring_is_in_the_stiffness():
    # a bar of 100 mm with 2 kg at its end, held level by a preload: the torque is the weight's exactly
    k, torque = 5e4, 2.0 * 9.81 * 100.0
    parts = (
        Joint("q", AXES["y"], passive=True, compliance=1.0 / k, preload=-torque),
        RigidOffset("bar", translation([100.0, 0.0, 0.0]), 2.0, np.array([100.0, 0.0, 0.0])),
    )
    found = equilibria(Mechanism(Machine("held", parts).split()), np.zeros(1), gravity=WEIGHT)
    assert np.abs(found.x).max() < 1e-15
    assert found.compliance[0, 0, 2, 2] == pytest.approx(100.0**2 / k, rel=1e-12)


def test_a_passive_pendulum_hangs():
    parts = (
        Joint("q", AXES["y"], passive=True),
        RigidOffset("rod", translation([0.0, 0.0, -200.0]), 1.5, np.array([0.0, 0.0, -200.0])),
    )
    found = equilibria(Mechanism(Machine("pendulum", parts).split()), np.array([0.7]), gravity=WEIGHT)
    assert found.position[0, 0] == pytest.approx([0.0, 0.0, -200.0], abs=1e-9)
    # m g / l
    assert 1.0 / found.compliance[0, 0, 0, 0] == pytest.approx(1.5 * 9.81 / 200.0, rel=1e-12)


def test_a_zero_length_spring_balances_a_link_in_every_posture():
    # the gravity compensator of the lamps: m g l = k a b with a spring of free length zero
    a, b, l_mm, mass = 150.0, 200.0, 500.0, 6.0
    spring = PointSpring("lamp", ("", "link"), np.array([[0, 0, a], [0, 0, b]]), mass * 9.81 * l_mm / (a * b))
    parts = (
        Joint("q", AXES["y"], compliance=1e-7),
        RigidOffset("link", translation([0, 0, l_mm]), mass, np.array([0, 0, l_mm])),
    )
    model = Mechanism(Machine("lamp", parts, point_springs=(spring,)).split())
    found = equilibria(model, np.linspace(-2.5, 2.5, 7)[:, None], gravity=WEIGHT)
    # N mm, of a weight's torque of 29430
    assert np.abs(found.torques).max() < 1e-9
    assert np.abs(found.deflection).max() < 1e-12
    assert 1.0 / np.linalg.norm(found.compliance[:, 0, :3, :3], axis=(1, 2)) * l_mm**2 * 1e-7 == pytest.approx(1.0)


def test_a_coupling_as_bent_passes_on_what_bends():
    def machine(as_deflected: bool) -> Mechanism:
        parts = (
            Joint("tilt", AXES["y"], compliance=1e-6),
            RigidOffset("a", translation([0, 0, 300.0])),
            Joint("chest", AXES["y"], coupling=JointCoupling((("tilt", -1.0),), as_deflected=as_deflected)),
            RigidOffset("b", translation([0, 0, 300.0]), 4.0, np.array([0, 0, 300.0])),
        )
        return Mechanism(Machine("torso", parts).split())

    bent, commanded = (equilibria(machine(b), np.array([0.5]), gravity=WEIGHT) for b in (True, False))
    assert bent.deflection[0, 0, 3:] == pytest.approx(np.zeros(3), abs=1e-15)
    assert commanded.deflection[0, 0, 4] == pytest.approx(commanded.x[0, 0], rel=1e-12)
    # upright chest: a parallelogram, so the weight's torque on the tilt has the first link's lever alone
    lever = 300.0 * np.sin(0.5 + bent.x[0, 0])
    assert bent.torques[0, 0] == pytest.approx(-4.0 * 9.81 * lever, rel=1e-12)
    lever = 300.0 * (np.sin(0.5 + commanded.x[0, 0]) + np.sin(commanded.x[0, 0]))
    assert commanded.torques[0, 0] == pytest.approx(-4.0 * 9.81 * lever, rel=1e-12)


def test_two_hands_on_one_torso_bend_it_together():
    def side(sign: int, name: str) -> list:
        return [
            Joint(f"{name}-shoulder", AXES["x"], compliance=1e-7),
            RigidOffset(f"{name}-arm", translation([0.0, 300.0 * sign, 0.0]), 3.0),
        ]

    parts = (Joint("pan", AXES["x"], compliance=1e-7), RigidOffset("torso", translation([0, 0, 600.0])))
    tree = Machine(
        "two", (*parts, *side(1, "left"), *side(-1, "right")), after={"right-shoulder": "torso"},
        ends={"left": "left-arm", "right": "right-arm"},
    )  # fmt: skip
    q = np.array([0.0, 0.4, 0.4])
    found = equilibria(Mechanism(tree.split()), q, gravity=WEIGHT)
    alone = equilibria(Mechanism(Machine("one", (*parts, *side(1, "left"))).split()), q[:2], gravity=WEIGHT)
    both = equilibria(Mechanism(tree.split()), np.array([0.0, 0.4, -0.4]), gravity=WEIGHT)
    # mirrored arms leave the torso straight; one arm alone bends it
    assert abs(both.x[0, 0]) < 1e-18
    assert abs(alone.x[0, 0]) > 1e-4
    assert found.torques.shape == (1, 3)
    R, p = unloaded_frames(Mechanism(tree.split()), q)
    assert p[0, 0] == pytest.approx([0.0, 300 * np.cos(0.4), 600 + 300 * np.sin(0.4)])
    assert R.shape == (1, 2, 3, 3)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Mechanism(Machine("rigid", (RigidOffset("a"),))).arrays(), "nothing deflects"),
        (lambda: Joint("c", AXES["z"], coupling=JointCoupling((("c", 1.0),))), "coupled to itself"),
        (lambda: Joint("a", np.zeros(3)), "axis has length 0"),
        (lambda: Mechanism(arm().split()).command_rows(np.zeros((2, 5))), "a column for each of its 6 joints"),
        (lambda: Mechanism(arm().split()).command_rows(np.full((2, 6), np.nan)), "row 0 of q is not finite"),
        (lambda: equilibria(Mechanism(arm().split()), np.zeros(6), wrench=np.zeros(5)), "wrench has the shape"),
        (lambda: Machine("t", (RigidOffset("a"),), after={"a": "b"}), "begins after 'b'"),
        (lambda: Mechanism(arm()).command, "no coordinate yet"),
    ],
)
def test_what_makes_no_sense_is_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()


def test_more_load_than_an_arm_bears_is_found_in_steps_or_said():
    # a soft arm: a radian and more of deflection, where Newton from the unloaded posture needs steps
    chain = arm(compliance=2e-6)
    found = equilibria(Mechanism(chain.split()), np.random.default_rng(9).uniform(-2, 2, (20, 6)), gravity=WEIGHT)
    assert found.converged.any()
    assert np.isnan(found.position[~found.converged]).all()


@pytest.mark.parametrize("force", [0.0, 200.0])
def test_compliance_is_that_of_the_equilibrium_itself(force):
    model = VjmEngine().model(vjm.load("ur10"))
    q = np.random.default_rng(1).uniform(-2.0, 2.0, (50, len(model.joints)))
    loads = {"gravity": (0.0, 0.0, -9.81), "wrench": np.array([0.5 * force, 0.0, -force, 0.0, 0.0, 0.0])}
    found = equilibria(model, q, **loads)
    # from there the first step is rounding: linearised at the very state
    there = equilibria(model, q, start=found.x, **loads)
    largest = np.abs(there.compliance).max(axis=(2, 3), keepdims=True)
    assert np.all(np.abs(found.compliance - there.compliance) < 1e-9 * largest)
    assert np.all(np.abs(found.x - there.x) < 1e-12)


# How beams become springs in batches over postures: as engine ``vjm`` splits them, by one rule.


LENGTH, EI = 1000.0, 1e9
SECTION = Section(EA=1e9, GJ=1e9, EIy=EI, EIz=EI)


def two_beams(**changes) -> Machine:
    parts = (
        Joint("q", AXES["y"]),
        Beam("upper", 0.5 * LENGTH, section=SECTION),
        Beam("fore", 0.5 * LENGTH, section=SECTION),
    )
    chain = Machine("arm", parts, postures={"p": np.zeros(0)}, held={"p": {"q": 0.0}})
    return replace(chain, **changes)


def test_a_moment_bends_the_arm_to_an_arc():
    """``κ = M/EI`` all along: the tip at ``(sin φ, 1 − cos φ) L/φ``. One spring a beam is 4 % off."""
    phi = 0.9
    moment = np.array([0.0, 0.0, 0.0, 0.0, -phi * EI / LENGTH, 0.0])
    exact = LENGTH * np.array([np.sin(phi) / phi - 1.0, 0.0, (1.0 - np.cos(phi)) / phi])
    found, single = (
        equilibria(Mechanism(two_beams().split() if split else two_beams()), np.zeros(1), wrench=moment).deflection[
            0, 0, :3
        ]
        for split in (True, False)
    )
    # of the springs' second order in h: φ²/(24 · 32²), 3e-5
    assert np.abs(found - exact).max() < 1e-4 * np.abs(exact).max()
    assert np.abs(single - exact).max() > 0.02 * np.abs(exact).max()


def own_number(chain: Machine) -> Machine:
    parts = tuple(replace(part, own_segments=5) if part.name == "fore" else part for part in chain.parts)
    return replace(chain, parts=parts)


@pytest.mark.parametrize(("chain", "numbers"), [
    (two_beams(), (USUAL_SEGMENTS, USUAL_SEGMENTS)),
    (two_beams(link_segments=3), (3, 3)),
    (two_beams(link_segments=1), (None, None)),
    (own_number(two_beams(link_segments=3)), (3, 5)),
    (own_number(two_beams()), (USUAL_SEGMENTS, 5)),
    (two_beams().refined({"upper": 2}), (2, USUAL_SEGMENTS)),
])  # fmt: skip
def test_batches_and_the_engine_split_alike(chain: Machine, numbers):
    model = Mechanism(chain.split())
    assert tuple(beam.segments for beam in model.chain.beams) == numbers
    wrench = (0.0, 50.0, -300.0, 1e4, 0.0, 0.0)
    batch = equilibria(model, model.posture("p"), wrench=np.array(wrench)).deflection[0, 0]
    if chain.beams[0].segments is None:
        assert batch == pytest.approx(vjm.stiffness(chain, "p", wrench=wrench).displacement, rel=1e-12)


def test_a_beam_without_a_section_stays_the_spring_that_is_given():
    bar = Beam("bar", 300.0, compliance=np.diag([1e-6, 1e-4, 1e-4, 1e-8, 1e-8, 1e-8]))
    model = Mechanism(Machine("matrix", (Joint("q", AXES["y"]), bar)).split())
    assert model.chain.beams[0].segments is None
    assert model.size == 6
