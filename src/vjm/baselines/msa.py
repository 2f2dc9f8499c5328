"""Matrix structural analysis: linear two-node beams, the foot as its matrix, joints as releases.

Assembled from textbook 12×12 beam stiffnesses, independently of the virtual joint method's Jacobians.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from vjm.baselines.linear import straight_path
from vjm.continuation.path import Path
from vjm.model.chain import Chain
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

    def free(self, directions: Array, stiffness: float = 0.0) -> None:
        """Let the node move further along directions ``(6, k)``, each with the stiffness of a spring."""
        k = directions.shape[1]
        self.at = np.hstack([self.at, directions])
        self.K = np.pad(self.K, (0, k))
        if stiffness:
            self.K[-k:, -k:] = stiffness * np.eye(k)

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
        chain: the machine; the part named ``foot`` enters as its 6×6 matrix, every other beam as an element
            where its section is known.
        posture: passive coordinates ``(n_q,)`` rad.
    """
    assembly = _Assembly(chain.base.copy())
    q = iter(posture)
    for part in chain.parts:
        match part:
            case RigidOffset():
                assembly.move(part.transform)
            case PassiveJoint():
                world_axis = assembly.T[:3, :3] @ part.axis
                assembly.free(np.concatenate([np.zeros(3), world_axis])[:, None])
                assembly.T = assembly.T @ turn(part.axis, next(q))
            case Actuator() | Mount():
                if part.compliance > 0.0:
                    along, about = assembly.T[:3, :3] @ part.axis, np.zeros(3)
                    if isinstance(part, Mount) and not part.slides:
                        along, about = about, along
                    assembly.free(np.concatenate([along, about])[:, None], 1.0 / part.compliance)
            case Beam():
                _add_beam(assembly, part)
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


def _add_beam(assembly: _Assembly, beam: Beam) -> None:
    beam.refuse_bow("msa")
    if beam.section is not None and beam.own_segments != 1:
        axes = assembly.T[:3, :3] @ beam.own_frame @ beam.section_frame
        along = beam.own_frame @ beam.section_frame @ np.array([beam.length, 0.0, 0.0])
        element = beam_element(beam.effective_section(), beam.length)
        assembly.element(element, axes, translation(along))
        assembly.move(translation(beam.tip - along))
        return
    K = np.linalg.inv(beam.tip_compliance())
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
        K = msa_stiffness(chain, chain.posture(load_case.posture))
        return straight_path(self.label, chain, load_case, K, time.perf_counter() - started)
