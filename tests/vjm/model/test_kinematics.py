"""Kinematics of random chains against finite differences and against Pinocchio, an independent library."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, JointCoupling, RigidOffset
from vjm.rotations import AXES, displacement_between

STEP = 1e-5
"""Of finite differences, in units of the coordinates: truncation STEP²/6 = 2e-11, rounding 2e-16/STEP = 2e-11."""
DIFFERENCE = 1e-9
"""Relative error allowed to central differences: some 25 times the sum of truncation and rounding above."""


def reach(model, x):
    """Bound in mm for every lever in the chain, and the unit of length of its derivatives."""
    k = model.kinematics(x)
    origins = k.behind[:, :3, 3]
    return model.chain.characteristic_length + np.abs(origins).max() + np.abs(k.end[:3, 3]).max()


def central_difference(function, x, unit):
    """Derivative by each coordinate, in units of the coordinates: last axis."""
    columns = []
    for i in range(len(x)):
        dx = np.zeros(len(x))
        dx[i] = STEP * unit[i]
        columns.append((function(x + dx) - function(x - dx)) / (2.0 * STEP))
    return np.stack(columns, axis=-1)


def work_scale(model, x, wrench):
    """Bound in N mm for the wrench's work over unit coordinates."""
    return 3.0 * (np.abs(wrench[:3]).max() * reach(model, x) + np.abs(wrench[3:]).max())


@given(data=st.data())
def test_jacobian_is_the_derivative_of_the_pose(loaded_states, data):
    model, x, _ = data.draw(loaded_states)
    k = model.kinematics(x)
    unit = model.coordinate_scale

    def pose(x):
        return displacement_between(k.end, model.kinematics(x).end)

    error = np.abs(central_difference(pose, x, unit) - k.jacobian * unit)
    assert error[:3].max() < DIFFERENCE * reach(model, x)
    assert error[3:].max() < DIFFERENCE


@given(data=st.data())
def test_force_hessian_is_the_derivative_of_the_joint_forces(loaded_states, data):
    model, x, wrench = data.draw(loaded_states)
    unit = model.coordinate_scale

    def joint_forces(x):
        return unit * (model.kinematics(x).jacobian.T @ wrench)

    H = model.kinematics(x).force_hessian(wrench) * unit[:, None] * unit
    error = np.abs(central_difference(joint_forces, x, unit) - H)
    assert error.max() < DIFFERENCE * work_scale(model, x, wrench)


@given(data=st.data())
def test_force_part_of_the_hessian_is_symmetric(loaded_states, data):
    model, x, wrench = data.draw(loaded_states)
    H = model.kinematics(x).force_hessian(np.concatenate([wrench[:3], np.zeros(3)]))
    unit = model.coordinate_scale
    H *= unit[:, None] * unit
    # both triangles are filled from the same products
    assert np.abs(H - H.T).max() <= 1e-15 * work_scale(model, x, wrench)


@given(data=st.data())
def test_hessian_is_symmetric_where_the_end_effector_stays(loaded_states, data):
    model, x, wrench = data.draw(loaded_states)
    k = model.kinematics(x)
    unit = model.coordinate_scale
    H = k.force_hessian(wrench) * unit[:, None] * unit
    scaled = k.jacobian * unit / np.repeat([reach(model, x), 1.0], 3)[:, None]
    _, singular, rows = np.linalg.svd(scaled)
    N = rows[np.count_nonzero(singular > 1e-9) :].T
    reduced = N.T @ H @ N
    # rounding of H, its products and, through the smallest singular value, of the null space
    tolerance = 1e-13 * work_scale(model, x, wrench) / singular[singular > 1e-9].min()
    assert reduced.size == 0 or np.abs(reduced - reduced.T).max() < tolerance


def test_moments_make_the_whole_hessian_asymmetric(chain):
    model = Mechanism(chain)
    H = model.kinematics(model.configuration(chain.posture("D"))).force_hessian(np.array([0, 0, 0, 1.0, 2.0, 3.0]))
    # a moment of 1 to 3 N mm on joints at right angles: differences of the order of the moment itself
    assert np.abs(H - H.T).max() > 0.5


@given(data=st.data())
def test_shape_rate_is_the_derivative_of_the_shape(loaded_states, data):
    model, x, _ = data.draw(loaded_states)
    unit = model.coordinate_scale
    k = model.kinematics(x)
    velocity = unit * np.random.default_rng(1).uniform(-1.0, 1.0, model.size)
    ahead, behind = (model.shape(model.kinematics(x + t * velocity)) for t in (STEP, -STEP))
    difference = (ahead - behind) / (2.0 * STEP)
    # all joints move at once: the third derivative grows with the cube of the summed angular velocities
    turning = 1.0 + np.abs(velocity[model.rotary]).sum()
    sliding = reach(model, x) + np.abs(velocity[~model.rotary]).sum()
    tolerance = STEP**2 * turning**3 * sliding + 1e-15 / STEP * sliding
    assert np.abs(difference - model.shape_rate(k, velocity)).max() < tolerance


def test_shape_of_the_unloaded_chain_is_its_drawing(chain):
    model = Mechanism(chain)
    points = model.shape(model.kinematics(model.configuration(chain.posture("A"))))
    # the foot's tip is the origin and the link points along x; roundings of lengths below 1000 mm
    labels = [(s.part, s.fraction) for s in model.stations]
    assert points[labels.index(("foot", 1.0))] == pytest.approx([0, 0, 0], abs=1e-12)
    assert points[labels.index(("link", 1.0))] == pytest.approx([310, 0, 0], abs=1e-12)
    foot = next(beam for beam in chain.beams if beam.name == "foot")
    assert points[labels.index(("foot", 0.0))] == pytest.approx(-foot.tip, abs=1e-12)


# --- Pinocchio ------------------------------------------------------------------------------------


class PinocchioChain:
    """The same parts as a Pinocchio model, built from the parts and not from the lumped model."""

    def __init__(self, chain):
        self.model = pin.Model()
        self.pending = pin.SE3(chain.base)
        self.parent = 0
        for part in chain.parts:
            self.add(part)
        inertia = pin.Inertia.Zero()
        self.end = self.model.addFrame(
            pin.Frame("end", self.parent, 0, self.pending, pin.FrameType.OP_FRAME, inertia)
        )
        self.data = self.model.createData()

    def add(self, part):
        match part:
            case RigidOffset():
                self.pending = self.pending * pin.SE3(part.transform)
            case Joint(free=True):
                self.joint(pin.JointModelRevoluteUnaligned(*part.axis))
            case Joint(fixed=True, slides=True):
                if part.compliance > 0.0:
                    self.joint(pin.JointModelPrismaticUnaligned(*part.axis))
            case Beam():
                self.beam(part)

    def beam(self, beam):
        own = pin.SE3(beam.own_frame, np.zeros(3))
        if beam.segments is None:
            self.pending = self.pending * pin.SE3(np.eye(3), beam.tip) * own
            self.spring()
            self.pending = self.pending * own.inverse()
            return
        section = pin.SE3(beam.section_frame, np.zeros(3))
        fraction = {"end": 1.0, "middle": 0.5, "two-thirds": 2.0 / 3.0, "best": 0.5}[beam.placement.value]
        h = beam.length / beam.segments
        self.pending = self.pending * own * section
        for _ in range(beam.segments):
            self.pending = self.pending * pin.SE3(np.eye(3), np.array([fraction * h, 0, 0]))
            (self.symmetric_spring if beam.placement.value == "best" else self.spring)()
            self.pending = self.pending * pin.SE3(np.eye(3), np.array([(1 - fraction) * h, 0, 0]))
        self.pending = self.pending * section.inverse() * pin.SE3(np.eye(3), beam.end_offset) * own.inverse()

    def spring(self):
        for kind in (pin.JointModelPrismaticUnaligned, pin.JointModelRevoluteUnaligned):
            for axis in np.eye(3):
                self.joint(kind(*axis))

    def symmetric_spring(self):
        for axis in np.eye(3):
            self.joint(pin.JointModelRevoluteUnaligned(*axis))
        for axis in np.eye(3):
            self.joint(pin.JointModelPrismaticUnaligned(*axis))
        for axis in np.eye(3)[::-1]:
            self.joint(pin.JointModelRevoluteUnaligned(*axis))

    def joint(self, joint):
        self.parent = self.model.addJoint(self.parent, joint, self.pending, f"j{self.model.njoints}")
        self.pending = pin.SE3.Identity()

    def pose(self, x):
        pin.framesForwardKinematics(self.model, self.data, x)
        return self.data.oMf[self.end].homogeneous

    def jacobian(self, x):
        return pin.computeFrameJacobian(self.model, self.data, x, self.end, pin.LOCAL_WORLD_ALIGNED)

    def force_hessian(self, x, wrench):
        """Columns: time derivative of Jᵀ F at unit velocity of each joint."""
        columns = []
        for velocity in np.eye(self.model.nv):
            pin.computeJointJacobiansTimeVariation(self.model, self.data, x, velocity)
            pin.updateFramePlacements(self.model, self.data)
            dJ = pin.getFrameJacobianTimeVariation(self.model, self.data, self.end, pin.LOCAL_WORLD_ALIGNED)
            columns.append(dJ.T @ wrench)
        return np.array(columns).T


ROUNDING = 1e-12
"""Relative disagreement of two libraries over chains of up to some eighty joints: 80² roundings of 2e-16."""


@given(data=st.data())
def test_pose_and_jacobian_agree_with_pinocchio(loaded_states, data):
    model, x, _ = data.draw(loaded_states)
    k, other = model.kinematics(x), PinocchioChain(model.chain)
    size = reach(model, x)
    joints = model.drive.joints(x)
    pose_error = np.abs(k.end - other.pose(joints))
    assert pose_error[:3, :3].max() < ROUNDING
    assert pose_error[:3, 3].max() < ROUNDING * size
    jacobian_error = np.abs(k.jacobian - model.drive.gathered(other.jacobian(joints)))
    assert jacobian_error[:3].max() < ROUNDING * size
    assert jacobian_error[3:].max() < ROUNDING


@given(data=st.data())
def test_force_hessian_agrees_with_pinocchio(loaded_states, data):
    model, x, wrench = data.draw(loaded_states)
    H = PinocchioChain(model.chain).force_hessian(model.drive.joints(x), wrench)
    error = model.kinematics(x).force_hessian(wrench) - model.drive.gathered(model.drive.gathered(H).T).T
    assert np.abs(error).max() < ROUNDING * work_scale(model, x, wrench)


@given(data=st.data())
def test_reactions_at_many_configurations_are_those_at_each(loaded_states, data):
    model, x, wrench = data.draw(loaded_states)
    states, wrenches = np.stack([x, 0.5 * x]), np.stack([wrench, -wrench])
    each = [model.reactions(model.kinematics(q), F) for q, F in zip(states, wrenches, strict=True)]
    error = np.abs(model.end_reactions(states, wrenches) - np.array(each)) * model.coordinate_scale
    assert error.max() < ROUNDING * work_scale(model, x, wrench)


# One class of joint: what its data make of it, and data that contradict each other.


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
