"""Natural frequencies in closed form: beams, pendulums, arms, platforms, and the loss of stability under loads."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.urdf_arm import arm, import_urdf, written
from scipy.optimize import brentq

import vjm
from vjm.design.changes import posed
from vjm.design.linear_state import loaded_posture, state_of
from vjm.design.modes import AlongMotions, ModesVerdict, eigenmodes, frequency_rates, mass_matrix, modes, total_mass
from vjm.engines import VjmEngine
from vjm.io.file_parameters import MachineFiles
from vjm.io.model_file import build_chain
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.parameters import section_value
from vjm.model.parts import Beam, Closure, Joint, RigidOffset, Section
from vjm.rotations import translation, turn

from .conftest import DENSITY, DIAMETER, LENGTH, E, rod

Y, Z = np.eye(3)[1], np.eye(3)[2]
EI, LINE = E * np.pi * DIAMETER**4 / 64.0, DENSITY * np.pi * DIAMETER**2 / 4.0
"""N mm² and kg/mm of the rod."""
UNIT = np.sqrt(1000.0 * EI / (LINE * LENGTH**4)) / (2.0 * np.pi)
"""Hz: of βL = 1."""
CANTILEVER = (1.875104068711961, 4.694091132974174, 7.854757438237612)
"""Roots of 1 + cos βL cosh βL."""
FOURTH = 1.0 / 720.0
"""Of (βL/n)⁴: relative error of ω² by cubic shapes (Strang and Fix, An Analysis of the Finite Element Method)."""


def bending(found, count):
    """Frequencies of the first ``count`` modes of bending, one of each pair of equal ones."""
    np.testing.assert_allclose(found.frequencies[::2][:count], found.frequencies[1::2][:count], rtol=1e-6)
    return found.frequencies[::2][:count]


@pytest.mark.parametrize("segments", [4, 8, 16])
def test_a_cantilever_converges_with_the_fourth_order(cantilever, segments):
    found = modes(cantilever(), engine=VjmEngine(segments))
    for frequency, beta in zip(bending(found, 2), CANTILEVER, strict=False):
        error = (frequency / UNIT) ** 2 / beta**4 - 1.0
        leading = FOURTH * (beta / segments) ** 4
        # shapes that are admissible bound it from above; the next order is (βL/n)² smaller
        assert 0.0 < error < 2.0 * leading
    assert found.verdict is ModesVerdict.STABLE


def test_a_motion_without_stiffness_hides_no_other():
    """An arm whose elbow is free, and one whose elbow has a spring of next to nothing."""

    def frequencies(stiffness):
        link = translation([300.0, 0.0, 0.0])
        elbow = Joint("elbow", Y, passive=True, compliance=1.0 / stiffness if stiffness else 0.0)
        parts = (
            Joint("waist", Z, compliance=2e-8), RigidOffset("column", translation([0.0, 0.0, 200.0])),
            Joint("shoulder", Y, compliance=3e-8), RigidOffset("upper", link, 3.0, np.array([150.0, 0.0, 0.0])),
            elbow, RigidOffset("fore", link, 2.0, np.array([200.0, 0.0, 0.0])),
        )  # fmt: skip
        return modes(vjm.build("arm", parts, {"out": {"waist": 0.0, "shoulder": 0.0, "elbow": 0.0}})).frequencies

    free, soft = frequencies(0.0), frequencies(1e-3)
    assert free[0] == 0.0
    assert 0.0 < soft[0] < 0.1
    assert len(free) == len(soft) == 3
    # a spring of 1e-3 N mm/rad beside those of 1e7 changes them by 1e-10; eigenvalues are rounded by 1e-9
    np.testing.assert_allclose(free[1:], soft[1:], rtol=1e-8)


def test_the_order_is_four(cantilever):
    coarse, fine = (
        (modes(cantilever(), engine=VjmEngine(n)).frequencies[0] / UNIT) ** 2 / CANTILEVER[0] ** 4 - 1.0
        for n in (4, 8)
    )
    assert np.log2(coarse / fine) == pytest.approx(4.0, abs=0.05)


def test_a_tip_mass(cantilever):
    """1 + cos b cosh b = (M/m) b (sin b cosh b − cos b sinh b)."""
    mass = 0.7 * LINE * LENGTH

    def characteristic(b):
        return 1.0 + np.cos(b) * np.cosh(b) - 0.7 * b * (np.sin(b) * np.cosh(b) - np.cos(b) * np.sinh(b))

    beta = brentq(characteristic, 1.0, 1.875)
    found = modes(cantilever(mass), number=2)
    assert found.frequencies[0] == pytest.approx(beta**2 * UNIT, rel=1e-6)
    assert found.mass == pytest.approx(mass + LINE * LENGTH, rel=1e-12)


def test_clamped_at_both_ends(cantilever):
    beta = brentq(lambda b: np.cos(b) * np.cosh(b) - 1.0, 4.0, 5.0)
    found = modes(cantilever(), displacement=(0.0,) * 6, number=2)
    assert found.control == "displacement"
    assert found.frequencies[0] == pytest.approx(beta**2 * UNIT, rel=FOURTH * (beta / 16) ** 4)


def pinned(section):
    """A rod on two hinges about z, the second on a slide along it."""
    parts = (
        Joint("root", Z, passive=True),
        Beam("rod", LENGTH, section=section),
        Joint("hinge", Z, passive=True),
        Joint("slide", np.eye(3)[0], slides=True, passive=True),
    )
    support = Closure("support", ("slide", ""), np.array([np.eye(4), translation((LENGTH, 0.0, 0.0))]))
    return Machine("pinned", parts, postures={"straight": np.zeros(3)}, closures=(support,))


def in_plane(found):
    """Frequencies of the modes along y; those along z are clamped here."""
    along = [np.abs(shape[:, 1]).max() > np.abs(shape[:, 2]).max() for shape in found.shapes]
    return found.frequencies[along], found.growth[along]


def test_a_pinned_column_under_load():
    """f² falls linearly, to zero at Euler's load, and is negative beyond it."""
    chain, euler = pinned(rod(stiff_along=1e6)), np.pi**2 * EI / LENGTH**2
    for share in (-0.5, 0.0, 0.3, 0.9, 0.999):
        loads = [Load((-share * euler, 0.0, 0.0, 0.0, 0.0, 0.0), "rod", 1.0)] if share else []
        frequency = in_plane(modes(chain, loads=loads))[0][0]
        # errors of ω² unloaded, (π/16)⁴/720 = 2e-6, and of the critical load, 1e-9 with 16 springs
        assert (frequency / UNIT) ** 2 / np.pi**4 == pytest.approx(1.0 - share, abs=3e-6)
    beyond = modes(chain, loads=[Load((-1.01 * euler, 0.0, 0.0, 0.0, 0.0, 0.0), "rod", 1.0)])
    assert beyond.verdict is ModesVerdict.DIVERGENCE
    rate = in_plane(beyond)[1][0]
    assert (rate / (2.0 * np.pi * UNIT)) ** 2 / np.pi**4 == pytest.approx(0.01, abs=3e-6)


def test_shear_and_rotary_inertia():
    """A thick pinned beam after Timoshenko: a square equation for each wave number."""
    side, nu = 100.0, 0.3
    area, second = side**2, side**4 / 12.0
    shear = 5.0 / 6.0 * E / (2.0 * (1.0 + nu)) * area
    section = Section(E * area, E * second, E * second, E * second, shear, shear, DENSITY * area)
    coarse, fine = (in_plane(modes(pinned(section), number=8, engine=VjmEngine(n)))[0][0] for n in (16, 32))
    k, m, J = np.pi / LENGTH, DENSITY * area, DENSITY * second
    K = np.array([[shear * k**2, -shear * k], [-shear * k, E * second * k**2 + shear]])
    exact = np.linalg.eigvals(np.linalg.solve(np.diag([m, J]), K)).min() * 1000.0
    exact = np.sqrt(exact) / (2.0 * np.pi)
    # a segment's shear force is constant: with shear the order is two
    assert np.log2((coarse - exact) / (fine - exact)) == pytest.approx(2.0, abs=0.05)
    assert (4.0 * fine - coarse) / 3.0 == pytest.approx(exact, rel=1e-6)
    # both make a difference that is seen: without them it is 1.7 % higher
    assert np.sqrt(E * second * 1000.0 / (m * LENGTH**4)) * np.pi**2 / (2.0 * np.pi) > 1.016 * exact


def test_a_rod_vibrates_along_itself():
    """f = √(E/ρ)/4L, with linear shapes: error (π/2n)²/24 of f."""
    chain = Machine("rod", (Beam("rod", LENGTH, section=rod()),), postures={"straight": np.zeros(0)})
    found = modes(chain, number=40)
    along = [k for k, shape in enumerate(found.shapes) if np.abs(shape[:, 0]).max() > 0.9]
    exact = np.sqrt(1000.0 * E / DENSITY) / (4.0 * LENGTH)
    assert found.frequencies[along[0]] / exact - 1.0 == pytest.approx((np.pi / 32.0) ** 2 / 24.0, rel=0.05)


def test_the_lowest_torsion_has_the_polar_inertia():
    """f = √(GJ/ρI_p)/4L."""
    chain = Machine("rod", (Beam("rod", LENGTH, section=rod()),), postures={"straight": np.zeros(0)})
    state = state_of(loaded_posture(chain))
    # turns about x alone: of a chain of torsion springs they are decoupled
    n = np.arange(3, state.n, 6)
    M, K = mass_matrix(state)[np.ix_(n, n)], state.tangent[np.ix_(n, n)]
    values = np.linalg.eigvals(np.linalg.solve(M, K)) * 1000.0
    exact = np.sqrt(1000.0 * E / 2.6 / DENSITY) / (4.0 * LENGTH)
    assert np.sqrt(values.real.min()) / (2.0 * np.pi) == pytest.approx(
        exact * (1.0 + (np.pi / 32) ** 2 / 24), rel=1e-5
    )


# --- rigid bodies ---------------------------------------------------------------------------------------------


def link(name, length, mass):
    """A massless rod along x with a point mass at its end."""
    return RigidOffset(name, translation((length, 0.0, 0.0)), mass, np.array([length, 0.0, 0.0]))


def test_an_arm_of_two_joints_by_hand():
    c, l1, l2, m1, m2, bend = (1e-7, 3e-7), 400.0, 300.0, 2.0, 1.5, 0.8
    parts = (
        Joint("shoulder", Z, compliance=c[0]), link("upper", l1, m1),
        Joint("elbow", Z, compliance=c[1]), link("fore", l2, m2),
    )  # fmt: skip
    arm = Machine("2r", parts, postures={"bent": np.zeros(0)}, held={"bent": {"shoulder": 0.3, "elbow": bend}})
    found = modes(arm, "bent")
    cross = m2 * l1 * l2 * np.cos(bend)
    M = np.array(
        [[(m1 + m2) * l1**2 + m2 * l2**2 + 2 * cross, m2 * l2**2 + cross], [m2 * l2**2 + cross, m2 * l2**2]]
    )
    exact = np.sort(np.linalg.eigvals(np.linalg.solve(M, np.diag(1.0 / np.array(c)))).real) * 1000.0
    np.testing.assert_allclose(found.frequencies, np.sqrt(exact) / (2.0 * np.pi), rtol=1e-11)


@pytest.mark.parametrize("slides", [False, True])
def test_a_rotor_resists_the_motion_of_its_joint_alone(slides):
    """Two springs in a row, each with a mass behind it; the outer drive's rotor feels the difference of rates."""
    c, m, rotor = (2e-4, 5e-4), (2.0, 1.5), (0.4, 0.7)
    unit = 1.0 if slides else 1e6
    inertia = None if slides else tuple(np.diag([1.0, 1.0, unit * each]) for each in m)
    bodies = [
        RigidOffset(name, np.eye(4), m[k] if slides else 1.0, np.zeros(3), None if inertia is None else inertia[k])
        for k, name in enumerate("ab")
    ]
    joints = [Joint(n, Z, slides, compliance=c[k] / unit, rotor=rotor[k] * unit) for k, n in enumerate("io")]
    parts = (joints[0], bodies[0], joints[1], bodies[1])
    chain = Machine("row", parts, postures={"home": np.zeros(0)}, held={"home": {"i": 0.0, "o": 0.0}})
    M = np.array([[sum(m) + rotor[0], m[1]], [m[1], m[1] + rotor[1]]])
    exact = np.sort(np.linalg.eigvals(np.linalg.solve(M, np.diag(1.0 / np.array(c)))).real) * 1000.0
    np.testing.assert_allclose(modes(chain, "home").frequencies, np.sqrt(exact) / (2.0 * np.pi), rtol=1e-11)


def test_moments_of_inertia_turn_with_their_body():
    """A body on a torsion spring about z, its own axes turned: I about z of the world counts."""
    inertia = np.array([[900.0, 50.0, 20.0], [50.0, 700.0, -30.0], [20.0, -30.0, 400.0]])
    turned = turn((1.0, 0.0, 0.0), 0.7)
    parts = (
        Joint("spring", Z, compliance=1e-6),
        RigidOffset("turned", turned),
        RigidOffset("body", np.eye(4), 3.0, np.zeros(3), inertia),
    )
    chain = Machine("body", parts, postures={"home": np.zeros(0)}, held={"home": {"spring": 0.4}})
    axis = turned[:3, :3].T @ Z
    exact = np.sqrt(1000.0 * 1e6 / (axis @ inertia @ axis)) / (2.0 * np.pi)
    assert modes(chain, "home").frequencies == pytest.approx([exact], rel=1e-12)


def test_a_pendulum_turns_under_its_weight():
    """f = √(g/l): no spring, only the weight's geometric stiffness."""
    parts = (
        Joint("hinge", Y, passive=True),
        link("rod", 500.0, 2.0),
        Joint("far", Y, passive=True, compliance=1e-06),
        link("bob", 1.0, 1e-9),
    )
    chain = Machine("pendulum", parts, postures={"down": np.array([0.5 * np.pi])}, held={"down": {"far": 0.0}})
    found = modes(chain, "down", gravity=(0.0, 0.0, -9.81), number=1)
    assert found.frequencies[0] == pytest.approx(np.sqrt(9810.0 / 500.0) / (2.0 * np.pi), rel=1e-8)
    still = modes(chain, "down", number=1)
    assert still.frequencies[0] == 0.0
    assert still.verdict is ModesVerdict.NEUTRAL


def test_a_machine_on_a_soft_frame_moves_with_its_whole_mass(six_joints):
    """Every part's mass counts once along every axis."""
    heavy = tuple(
        replace(part, mass=1.3, centre=np.array([10.0, 5.0, -3.0])) if isinstance(part, RigidOffset) else part
        for part in six_joints.parts
    )
    for axis in np.eye(3):
        chain = replace(
            six_joints, parts=(Joint("frame", axis, slides=True, passive=True, fixed=True, compliance=1.0), *heavy)
        )
        state = state_of(loaded_posture(chain, "bent"))
        M = mass_matrix(state)
        assert M[0, 0] == pytest.approx(total_mass(state.question), rel=1e-12)
        assert np.linalg.eigvalsh(M).min() > -1e-12 * np.abs(M).max()


def test_the_mass_matrix_is_the_kinetic_energy_of_moving_points(six_joints):
    """Against masses moved by differences of positions, beams as many points along their straight segments."""
    chain = replace(six_joints, parts=tuple(p for p in six_joints.parts if not isinstance(p, Beam)))
    heavy = replace(
        chain,
        parts=tuple(
            replace(p, mass=1.3, centre=np.array([10.0, 5.0, -3.0])) if isinstance(p, RigidOffset) else p
            for p in chain.parts
        ),
    )
    state = state_of(loaded_posture(heavy, "bent"))
    rate, h = np.random.default_rng(1).standard_normal(state.n), 1e-5
    energy = 0.0
    for part in heavy.parts:
        if isinstance(part, RigidOffset):
            places = []
            for s in (h, -h):
                k = state.model.kinematics(state.x + s * rate)
                site = state.model.built.begins[part.name]
                places.append((k.behind[site.joint + 1] @ site.frame @ np.append(part.centre, 1.0))[:3])
            energy += 0.5 * part.mass * np.sum(((places[0] - places[1]) / (2.0 * h)) ** 2)
    assert 0.5 * rate @ mass_matrix(state) @ rate == pytest.approx(energy, rel=1e-8)


TURNED = '<origin xyz="0.15 0.01 0.02" rpy="0.4 -0.3 1.1"/>'


@pytest.mark.parametrize("name", ["turned.urdf", "ur10_robot.urdf", "xarm7.urdf", "icub.urdf"])
def test_the_mass_matrix_of_a_urdf_is_pinocchio_s(tmp_path, name):
    """Joint space inertia by Pinocchio's composite rigid body algorithm, every joint being elastic."""
    pinocchio = pytest.importorskip(
        "pinocchio", reason="Pinocchio, whose mass matrices are the reference, is not installed"
    )
    if name == "turned.urdf":
        inertia = '<inertia ixx="0.02" ixy="0.002" ixz="-0.001" iyy="0.03" iyz="0.003" izz="0.025"/>'
        own = "<inertial>" + TURNED + f'<mass value="2"/>{inertia}</inertial>'
        file = written(tmp_path, arm(l1=f'<link name="l1">{own}</link>', l2=f'<link name="l2">{own}</link>'))
    else:
        from helpers.as_pinocchio import ROBOTS

        file = next(iter(sorted(ROBOTS.rglob(name))), None)
        assert file is not None, f"example-robot-data has no {name}"
    found = import_urdf(file)
    chain = build_chain(found.document, "m.toml")
    state = state_of(loaded_posture(chain))
    robot = pinocchio.buildModelFromUrdf(str(file))
    data, q = robot.createData(), pinocchio.neutral(robot)
    rows = []
    for joint in robot.names[1:]:
        label = found.joints[joint]
        i = robot.getJointId(joint)
        q[robot.joints[i].idx_q] = chain.held["home"][label]
        rows.append(
            (
                robot.joints[i].idx_v,
                state.model.built.spans[label].start,
                1e3 if chain_slides(chain, label) else 1.0,
            )
        )
    theirs, ours, unit = (np.array(column) for column in zip(*rows, strict=True))
    M = pinocchio.crba(robot, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    # kg m² to kg mm²; of a joint that slides per mm
    expected = M[np.ix_(theirs, theirs)] * 1e6 / np.outer(unit, unit)
    np.testing.assert_allclose(
        mass_matrix(state)[np.ix_(ours, ours)], expected, atol=1e-10 * np.abs(expected).max()
    )


def chain_slides(chain, name):
    return next(part.slides for part in chain.parts if part.name == name)


def test_a_platform_on_massless_legs():
    """Its platform's mass on the stiffness that the platform's own solver gives."""
    mass, machine = 4.0, vjm.load("orthoglide")
    *legs, platform = machine.parts
    heavy = replace(machine, parts=(*legs, replace(platform, mass=mass, centre=np.zeros(3))))
    found = modes(heavy, "isotropic")
    # turns have no inertia here: they follow the force without a moment
    C = np.linalg.inv(vjm.stiffness(machine, "isotropic").unloaded)[:3, :3]
    exact = np.sqrt(1000.0 / mass / np.linalg.eigvalsh(C)[::-1]) / (2.0 * np.pi)
    np.testing.assert_allclose(found.frequencies, exact, rtol=1e-9)
    assert set(found.massless) == {beam.name for beam in machine.beams}


# --- followers ------------------------------------------------------------------------------------------------


def flutter_load(chain, part, low, high, **asked):
    """Load at which two frequencies become complex, N."""

    def grows(load):
        return modes(
            chain, loads=[Load((-load, 0.0, 0.0, 0.0, 0.0, 0.0), part, 1.0, follower=True)], **asked
        ).verdict

    assert grows(low) is ModesVerdict.STABLE
    assert grows(high) is ModesVerdict.FLUTTER
    while high - low > 1e-5 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if grows(middle) is ModesVerdict.STABLE else (low, middle)
    return 0.5 * (low + high)


def test_becks_column_flutters(cantilever):
    """P L²/EI = 20.05095 (Beck 1952; Bolotin, Nonconservative Problems of the Theory of Elastic Stability)."""
    load = flutter_load(cantilever(), "rod", 19.9 * EI / LENGTH**2, 20.2 * EI / LENGTH**2, number=4)
    assert load * LENGTH**2 / EI == pytest.approx(20.05095, rel=1e-4)


def test_zieglers_column_flutters():
    """Two links of length l with springs c, masses 2m and m: P l/c = 7/2 − √2 (Ziegler 1952)."""
    c, length, m = 1e5, 200.0, 0.5
    parts = (
        Joint("first", Z, passive=True, compliance=1.0 / c), link("lower", length, 2.0 * m),
        Joint("second", Z, passive=True, compliance=1.0 / c), link("upper", length, m),
    )  # fmt: skip
    chain = Machine(
        "ziegler", parts, postures={"straight": np.zeros(0)}, held={"straight": {"first": 0.0, "second": 0.0}}
    )
    load = flutter_load(chain, "upper", 2.0 * c / length, 2.2 * c / length)
    assert load * length / c == pytest.approx(3.5 - np.sqrt(2.0), rel=1e-5)


# --- refusals -------------------------------------------------------------------------------------------------


def test_without_a_mass_there_is_no_frequency():
    with pytest.raises(ValueError, match="no part that moves has a mass"):
        modes(vjm.load("orthoglide"))


def test_a_number_below_one_is_refused(cantilever):
    with pytest.raises(ValueError, match="number must be at least 1"):
        modes(cantilever(), number=0)


def test_what_has_neither_mass_nor_stiffness_is_refused():
    parts = (
        Joint("spin", np.eye(3)[0], passive=True),
        Joint("spring", Z, compliance=1e-6),
        link("rod", 100.0, 1.0),
    )
    chain = Machine(
        "spins",
        (*parts, Joint("idle", np.eye(3)[0], passive=True)),
        postures={"home": np.zeros(2)},
        held={"home": {"spring": 0.0}},
    )
    with pytest.raises(ValueError, match="a motion without mass has no stiffness"):
        modes(chain, "home")


@pytest.mark.parametrize("name", ["planar-2r", "ur10", "palletiser"])
def test_the_mass_of_one_motion_is_that_of_the_matrix(name):
    """Of beams, rigid bodies and rotors, which resist the turn of a joint alone."""
    machine = vjm.load(name)
    parts = (replace(p, rotor=5e4) if isinstance(p, Joint) and not p.fixed else p for p in machine.parts)
    state = state_of(loaded_posture(replace(machine, parts=tuple(parts)), gravity=(0.0, 0.0, -9.81)))
    motions = np.random.default_rng(3).normal(size=(state.n, 2)) * state.unit[:, None]
    whole = motions.T @ mass_matrix(state) @ motions
    # two orders of the same sums
    assert mass_matrix(AlongMotions(state, motions)) == pytest.approx(whole, rel=1e-10)


# Derivatives of natural frequencies: against differences, and in closed form where modes are equal.


STEP = 1e-4
"""Of a parameter, for differences of frequencies: their error is its square, 1e-8, and rounding over it."""


@pytest.mark.parametrize(
    ("model", "keys", "gravity"),
    [
        ("ur10", ("elbow.compliance_rad_per_Nmm", "link-2.mass_kg", "link-3.translation_mm.1"), True),
        ("planar-2r", ("upper.section.wall_mm", "tool.mass_kg", "upper.length_mm"), True),
        ("hexapod", ("ups-strut.slide.compliance_mm_per_N", "ups-strut.strut.length_mm"), False),
    ],
)
def test_rates_are_those_of_differences(model, keys, gravity):
    files = MachineFiles.read(model)
    machine = files.machine()
    posture = next(iter(machine.postures))
    asked = loaded_posture(machine, posture, gravity=(0.0, 0.0, -9.81) if gravity else None, engine=VjmEngine(4))
    state = state_of(asked)
    values, motions = eigenmodes(state, 4)
    parameters = [files.parameter(key, posture) for key in keys]
    rates = frequency_rates(state, parameters, values, motions)
    for parameter, rate in zip(parameters, rates.T, strict=True):
        ends = []
        for sign in (1.0, -1.0):
            there = posed(asked, parameter, parameter.value * (1.0 + sign * STEP))
            ends.append(np.sqrt(eigenmodes(state_of(replace(asked, machine=there)), 4)[0]) / (2.0 * np.pi))
        differences = (ends[0] - ends[1]) / (2.0 * STEP)
        np.testing.assert_allclose(rate * parameter.value, differences, rtol=1e-6, atol=1e-6 * np.sqrt(values[0]))


def test_equal_frequencies_part(cantilever):
    """A round rod that is made stiffer about one axis: of each pair one mode follows √EI, the other one stays."""
    chain = cantilever()
    asked = loaded_posture(chain, "", engine=VjmEngine(8))
    state = state_of(asked)
    values, motions = eigenmodes(state, 4)
    frequency = np.sqrt(values) / (2.0 * np.pi)
    stiff = section_value(chain, "rod", "EIz")
    rates = frequency_rates(state, [stiff], values, motions)[:, 0] * stiff.value
    # rotary inertia, which follows EI/EA, is made a millionth of a rod's (d/L)²
    np.testing.assert_allclose(rates[[1, 3]], 0.5 * frequency[[1, 3]], rtol=1e-6)
    np.testing.assert_allclose(rates[[0, 2]], 0.0, atol=1e-6 * frequency[0])
