"""Matrix structural analysis: linear two-node beams, the foot as its matrix, joints as releases.

Assembled from textbook 12×12 beam stiffnesses, independently of the virtual joint method's Jacobians.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import assert_never

import numpy as np

from vjm.baselines.linear import straight_path
from vjm.continuation.path import Path
from vjm.model.chain import Chain
from vjm.model.end_condition import DEPENDENT, rigid_direction
from vjm.model.joints import ActuatedJoint, CoupledJoint, HeldJoint, SprungJoint, joint_axes
from vjm.model.load_case import LoadCase, refuse_unless_pose_only
from vjm.model.parts import Actuator, Beam, Mount, PassiveJoint, RigidOffset, Section
from vjm.rotations import Array, frame, rotate_matrix6, skew, translation, turn
from vjm.threads import single_threaded


def beam_element(section: Section, length: float) -> Array:
    """Stiffness ``(12, 12)`` of a straight beam between two nodes, section axes, x from node 1 to node 2.

    Timoshenko's with ``Φ = 12 EI/(GA L²)``, Bernoulli's where GA is infinite; Przemieniecki, *Theory of Matrix
    Structural Analysis* (1968), eq. (5.116).
    """
    K = np.zeros((12, 12))
    L = length

    def add(dofs: list[int], block: list[list[float]]) -> None:
        K[np.ix_(dofs, dofs)] += np.array(block)

    a, t = section.EA / L, section.GJ / L
    add([0, 6], [[a, -a], [-a, a]])
    add([3, 9], [[t, -t], [-t, t]])
    for EI, GA, v, r, sign in (
        (section.EIz, section.GAy, 1, 5, 1.0),
        (section.EIy, section.GAz, 2, 4, -1.0),
    ):
        phi = 12.0 * EI / (GA * L**2)
        b = EI / ((1.0 + phi) * L**3)
        m = sign * 6.0 * L * b
        near, far = (4.0 + phi) * L**2 * b, (2.0 - phi) * L**2 * b
        add(
            [v, r, v + 6, r + 6],
            [
                [12.0 * b, m, -12.0 * b, m],
                [m, near, -m, far],
                [-12.0 * b, -m, 12.0 * b, -m],
                [m, far, -m, near],
            ],
        )
    return K


def rigid_arm(offset: Array) -> Array:
    """Displacement transport ``(6, 6)``: of a point ``offset`` (3,) away on a rigid body, from the body's."""
    A = np.eye(6)
    A[:3, 3:] = -skew(offset)
    return A


@dataclass
class _Assembly:
    """Displacements of the node reached so far as a linear function of the free unknowns, and their energy."""

    T: Array
    """World frame ``(4, 4)`` of the node."""
    at: Array = field(default_factory=lambda: np.zeros((6, 0)))
    """Displacement of the node by the unknowns ``(6, n)``."""
    K: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """Stiffness of the unknowns ``(n, n)``."""
    own: dict[str, int] = field(default_factory=dict)
    """The unknown of a joint's spring about or along its own axis, by the joint's name."""

    def free(self, directions: Array, stiffness: Array | None = None) -> None:
        """Let the node move further along directions ``(6, k)``, with a spring ``(k, k)`` or without."""
        k = directions.shape[1]
        self.at = np.hstack([self.at, directions])
        self.K = np.pad(self.K, (0, k))
        if stiffness is not None and k:
            self.K[-k:, -k:] = stiffness

    def release(self, axis: Array, *, slides: bool, compliance: float | None = None) -> None:
        """Let the node slide along or turn about an axis (3,) of the chain frame, with a spring or without."""
        world, nothing = self.T[:3, :3] @ axis, np.zeros(3)
        motion = np.concatenate([world, nothing] if slides else [nothing, world])
        self.free(motion[:, None], None if compliance is None else np.array([[1.0 / compliance]]))

    def move(self, transform: Array) -> None:
        """Go to another node of the same rigid body."""
        T = self.T @ transform
        self.at = rigid_arm(T[:3, 3] - self.T[:3, 3]) @ self.at
        self.T = T

    def element(self, K: Array, axes: Array, transform: Array) -> None:
        """Add a two-node element ``(12, 12)`` given in ``axes`` (3, 3), and go to its far node."""
        turned = np.zeros((12, 12))
        turned[:6, :6] = rotate_matrix6(K[:6, :6], axes)
        turned[6:, 6:] = rotate_matrix6(K[6:, 6:], axes)
        turned[:6, 6:] = rotate_matrix6(K[:6, 6:], axes)
        turned[6:, :6] = turned[:6, 6:].T
        near = np.hstack([self.at, np.zeros((6, 6))])
        far = np.zeros_like(near)
        far[:, -6:] = np.eye(6)
        both = np.vstack([near, far])
        self.K = np.pad(self.K, (0, 6)) + both.T @ turned @ both
        self.at = far
        self.T = self.T @ transform


def msa_stiffness(chain: Chain, posture: Array) -> Array:
    """Stiffness ``(6, 6)`` at the end-effector by matrix structural analysis, N, mm, rad, world axes.

    Args:
        chain: the machine, its held joints at the coordinates of a posture; the part named ``foot`` enters as its
            6×6 matrix, every other beam as an element where its section is known.
        posture: passive coordinates ``(n_q,)`` rad or mm.

    Raises:
        ValueError: branches or springs between points, a spring that is under stress in the posture, or a rigid
            direction.
    """
    chain.refuse_tree("msa")
    chain.refuse_prestress("msa")
    assembly = _Assembly(chain.base.copy())
    q = iter(posture)
    for part in chain.parts:
        match part:
            case RigidOffset():
                assembly.move(part.transform)
            case PassiveJoint():
                assembly.release(part.axis, slides=part.slides)
                value = next(q)
                assembly.move(translation(part.axis * value) if part.slides else turn(part.axis, value))
            case Actuator() | Mount():
                if part.compliance > 0.0:
                    slides = isinstance(part, Actuator) or part.slides
                    assembly.release(part.axis, slides=slides, compliance=part.compliance)
            case ActuatedJoint() | SprungJoint() | CoupledJoint():
                assembly.move(part.motion(part.held_at))
                _add_joint(assembly, part)
            case Beam():
                _add_beam(assembly, part)
            case _:
                assert_never(part)
    unit = np.repeat([chain.characteristic_length, 1.0], 3)
    sizes = np.linalg.svd(assembly.at / unit[:, None], compute_uv=False)
    if len(sizes) < 6 or not sizes[5] > DEPENDENT * sizes[0]:
        raise rigid_direction(chain.name)
    n = assembly.K.shape[0]
    # imposed end displacement: the multiplier is the wrench
    scale = np.sqrt(np.where(np.diag(assembly.K) > 0.0, np.diag(assembly.K), 1.0))
    A = np.block([[assembly.K, assembly.at.T], [assembly.at, np.zeros((6, 6))]])
    units = np.concatenate([1.0 / scale, np.linalg.norm(assembly.at / scale, axis=1) ** -1.0])
    A = A * units[:, None] * units
    b = np.zeros((n + 6, 6))
    b[n:] = np.diag(units[n:])
    K: Array = -(units[:, None] * np.linalg.solve(A, b))[n:]
    return K


def _add_joint(assembly: _Assembly, joint: ActuatedJoint | SprungJoint | CoupledJoint) -> None:
    """What deflects in a held joint, as releases with springs."""
    match joint:
        case SprungJoint():
            _add_own(assembly, joint, 1.0 / joint.stiffness)
        case ActuatedJoint(matrix=matrix) if matrix is not None:
            gives = matrix.any(axis=0)
            directions = np.asarray(np.kron(np.eye(2), assembly.T[:3, :3])[:, gives], dtype=float)
            stiffness: Array = np.asarray(np.linalg.inv(matrix[np.ix_(gives, gives)]), dtype=float)
            assembly.free(directions, stiffness)
        case ActuatedJoint() | CoupledJoint():
            if isinstance(joint, CoupledJoint) and joint.as_bent:
                _pass_on(assembly, joint)
            for axis, compliance in zip(joint_axes(joint.axis).T, joint.lateral, strict=False):
                if compliance > 0.0:
                    assembly.release(axis, slides=False, compliance=compliance)
            if joint.compliance > 0.0:
                _add_own(assembly, joint, joint.compliance)
        case _:
            assert_never(joint)


def _add_own(assembly: _Assembly, joint: HeldJoint, compliance: float) -> None:
    assembly.release(joint.axis, slides=joint.slides, compliance=compliance)
    assembly.own[joint.name] = len(assembly.K) - 1


def _pass_on(assembly: _Assembly, joint: CoupledJoint) -> None:
    """Move the node by the ratio times what the springs of the other joints do about their own axes."""
    world = assembly.T[:3, :3] @ joint.axis
    rows = slice(0, 3) if joint.slides else slice(3, 6)
    for name, ratio in joint.ratios:
        if name in assembly.own:
            assembly.at[rows, assembly.own[name]] += ratio * world


def _add_beam(assembly: _Assembly, beam: Beam) -> None:
    beam.refuse_bow("msa")
    if beam.section is not None and beam.own_segments != 1:
        axes = assembly.T[:3, :3] @ beam.own_frame @ beam.section_frame
        along = beam.own_frame @ beam.section_frame @ np.array([beam.length, 0.0, 0.0])
        element = beam_element(beam.effective_section(), beam.length)
        assembly.element(element, axes, translation(along))
        assembly.move(translation(beam.tip - along))
        return
    compliance = beam.tip_compliance()
    if not np.diag(compliance).all():
        raise ValueError(
            f"part '{beam.name}' is rigid in a direction, which msa's element cannot be: take vjm for it"
        )
    K = np.linalg.inv(compliance)
    axes = assembly.T[:3, :3] @ beam.own_frame
    arm = rigid_arm(beam.own_frame.T @ beam.tip)
    element = np.block([[arm.T @ K @ arm, -arm.T @ K], [-K @ arm, K]])
    assembly.element(element, axes, frame(p=beam.tip))


@dataclass(frozen=True)
class MsaEngine:
    """Matrix structural analysis of the unloaded posture: a straight line."""

    label: str = "msa"

    @single_threaded
    def trace(self, chain: Chain, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Straight line with the stiffness of `msa_stiffness`."""
        refuse_unless_pose_only(self.label, load_case)
        started = time.perf_counter()
        K = msa_stiffness(chain.at(load_case.posture), chain.posture(load_case.posture))
        return straight_path(self.label, chain, load_case, K, time.perf_counter() - started)
