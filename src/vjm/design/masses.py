"""The consistent mass matrix of a machine: beams by their segments' shapes, rigid bodies by their inertias."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, assert_never

import numpy as np

from vjm.design.linear_state import LinearState, Question
from vjm.model.joints import Joint
from vjm.model.kinematics import Kinematics
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Part, RigidOffset, Section
from vjm.rotations import Array, cross, rotation_vectors, rotations_from_vectors, skew, translation

GAUSS = np.polynomial.legendre.leggauss(4)
"""Points and weights that integrate squares of cubic shapes exactly."""


class MovingState(Protocol):
    """A machine whose points move with some coordinates; see `vjm.design.linear_state.LinearState`."""

    @property
    def model(self) -> Mechanism:
        """Its springs and joints."""

    @property
    def kinematics(self) -> Kinematics:
        """Where it stands."""

    @property
    def n(self) -> int:
        """Number of coordinates."""

    def at(self, joint: int, offset: Array) -> Kinematics:
        """A point behind a joint, with its motion by the coordinates."""

    def point_jacobians(self, joints: np.ndarray, offsets: Array) -> Array:
        """Motions ``(k, 6, n)`` by the coordinates of points ``(k, 3)`` mm behind joints ``(k,)``."""


@dataclass(frozen=True)
class AlongMotion:
    """A machine that moves with one motion of its coordinates, which is its only one.

    Attributes:
        state: of the machine.
        motion: ``(n,)`` of its coordinates.
    """

    state: LinearState
    motion: Array
    n: int = 1

    @property
    def model(self) -> Mechanism:
        """Its springs and joints."""
        return self.state.model

    @property
    def kinematics(self) -> Kinematics:
        """Where it stands."""
        return self.state.kinematics

    @cached_property
    def _twists(self) -> Array:
        """Velocity at the origin and turning ``(m + 1, 6)`` of the base and of what is behind each joint."""
        k, model = self.kinematics, self.model
        padded = np.concatenate([self.motion, np.zeros(model.size - len(self.motion))])
        rates = k.drive.joints(padded)[:, None]
        turning = model.joint_rotary[:, None]
        shifts = np.where(turning, cross(k.behind[1:, :3, 3], k.axes), k.axes) * rates
        own = np.concatenate([shifts, np.where(turning, k.axes, 0.0) * rates], axis=1)
        result = np.zeros((len(own) + 1, 6))
        for joint, before in enumerate(model.parent):
            result[joint + 1] = result[before + 1] + own[joint]
        return result

    def at(self, joint: int, offset: Array) -> Kinematics:
        """A point ``offset`` (3,) mm behind a joint, −1 for the ground, with its velocity ``(6, 1)``."""
        end = self.kinematics.behind[joint + 1] @ translation(offset)
        twist = self._twists[joint + 1]
        velocity = np.concatenate([twist[:3] + cross(twist[3:], end[:3, 3]), twist[3:]])
        return replace(self.kinematics, end=end, jacobian=velocity[:, None])

    def point_jacobians(self, joints: np.ndarray, offsets: Array) -> Array:
        """Velocities ``(k, 6, 1)`` of points ``(k, 3)`` mm behind joints ``(k,)``."""
        behind, twists = self.kinematics.behind[joints + 1], self._twists[joints + 1]
        places = (behind[:, :3, :3] @ offsets[:, :, None])[:, :, 0] + behind[:, :3, 3]
        velocities = twists[:, :3] + cross(twists[:, 3:], places)
        return np.concatenate([velocities, twists[:, 3:]], axis=1)[:, :, None]


def shapes(section: Section | None, length: float, at: float) -> Array:
    """Shift and turn ``(6, 12)`` of a cross-section by those of both ends of a beam, section axes, mm and rad.

    Args:
        section: of all members; None: rigid in shear.
        length: mm.
        at: fraction of the length.

    Example:
        >>> shapes(None, 2.0, 0.5)[1, [1, 5, 7, 11]].tolist()  # deflection along y at the middle
        [0.5, 0.25, 0.5, -0.25]
    """
    s, h = at, length
    N = np.zeros((6, 12))
    # along and about the beam: straight lines
    N[[0, 3], [0, 3]], N[[0, 3], [6, 9]] = 1.0 - s, s
    for shift, turn, sign, stiff, shear in ((1, 5, 1.0, "EIz", "GAy"), (2, 4, -1.0, "EIy", "GAz")):
        phi = 0.0 if section is None else 12.0 * getattr(section, stiff) / (getattr(section, shear) * h**2)
        over = 1.0 / (1.0 + phi)
        bow = 0.5 * phi * (s - s**2)
        N[shift, shift] = (1.0 - 3.0 * s**2 + 2.0 * s**3 + phi * (1.0 - s)) * over
        N[shift, shift + 6] = (3.0 * s**2 - 2.0 * s**3 + phi * s) * over
        N[shift, turn] = sign * h * (s - 2.0 * s**2 + s**3 + bow) * over
        N[shift, turn + 6] = sign * h * (s**3 - s**2 - bow) * over
        N[turn, shift] = sign * 6.0 * (s**2 - s) / h * over
        N[turn, shift + 6] = -N[turn, shift]
        N[turn, turn] = (1.0 - 4.0 * s + 3.0 * s**2 + phi * (1.0 - s)) * over
        N[turn, turn + 6] = (3.0 * s**2 - 2.0 * s + phi * s) * over
    return N


def mass_matrix(state: MovingState) -> Array:
    """Mass matrix ``(n, n)`` in the coordinates of an equilibrium, kg times squares of mm.

    A beam's segments move as their end frames say, with the cubic shapes of a beam without load in between; its
    cross-sections have their own rotary inertia. A rigid body moves with its mass at its centre, and so does a part
    whose mass has no section along which to lie. A drive's rotor resists the motion of its joint alone.

    Raises:
        ValueError: a part with a mass along it does not deflect, so that its cross-sections have no axes.
    """
    M = np.zeros((state.n, state.n))
    for part in state.model.chain.parts:
        M += sum(_contributions(state, part), np.zeros((state.n, state.n)))
    result: Array = 0.5 * (M + M.T)
    return result


def massless(state: LinearState) -> tuple[str, ...]:
    """Names of the beams without a mass: they count as if they had none."""
    return tuple(beam.name for beam in state.model.chain.beams if not beam.mass)


def total_mass(asked: Question) -> float:
    """Mass of all parts, kg, what stands on the base included; loads and equilibrium do not change it."""
    return sum(part.mass for part in asked.model.chain.parts if isinstance(part, Beam | RigidOffset))


def _contributions(state: MovingState, part: Part) -> Iterator[Array]:
    match part:
        case RigidOffset():
            if part.mass:
                yield _rigid(state, part)
        case Beam():
            if part.mass:
                yield from _beam(state, part)
        case Joint():
            if part.rotor:
                yield _rotor(state, part)
        case _:
            assert_never(part)


def _rigid(state: MovingState, part: RigidOffset) -> Array:
    site = state.model.built.begins[part.name]
    k = state.at(site.joint, (site.frame @ np.append(part.centre_of_mass, 1.0))[:3])
    J = k.jacobian[:, : state.n]
    inertia = np.zeros((3, 3))
    if part.inertia is not None:
        R = k.end[:3, :3] @ site.frame[:3, :3]
        inertia = R @ part.inertia @ R.T
    result: Array = part.mass * J[:3].T @ J[:3] + J[3:].T @ inertia @ J[3:]
    return result


def _rotor(state: MovingState, joint: Joint) -> Array:
    """Of a drive's rotor: its reflected inertia times the square of the joint's own rate."""
    built = state.model.built
    before, behind = built.roots[joint.name], built.begins[joint.name]
    own = state.at(behind.joint, behind.frame[:3, 3])
    T = state.kinematics.behind[before.joint + 1]
    # the same point, as the body before the joint carries it
    carried = state.at(before.joint, T[:3, :3].T @ (own.end[:3, 3] - T[:3, 3]))
    rows = slice(0, 3) if joint.slides else slice(3, 6)
    axis = T[:3, :3] @ before.frame[:3, :3] @ joint.axis
    rate = axis @ (own.jacobian - carried.jacobian)[rows, : state.n]
    result: Array = joint.rotor * np.outer(rate, rate)
    return result


def _beam(state: MovingState, beam: Beam) -> Iterator[Array]:
    ends, lengths = _segments(state, beam)
    if beam.section is None:
        own = beam.section_frame.T @ (np.zeros(3) if beam.centre is None else beam.centre)
        rates = shapes(None, lengths[0], float(own[0]) / beam.length) @ ends[0]
        across = np.array([0.0, own[1], own[2]])
        shift = rates[:3] - skew(across) @ rates[3:]
        yield beam.own_mass * shift.T @ shift
        return
    section = beam.effective_section()
    # of a homogeneous section the radii of gyration follow from its stiffnesses
    round_y, round_z = section.EIy / section.EA, section.EIz / section.EA
    inertia = section.mass * np.array([1.0, 1.0, 1.0, round_y + round_z, round_y, round_z])
    for length in dict.fromkeys(lengths):
        alike = ends[np.array(lengths) == length]
        moved = _segment_matrix(section, length, inertia) @ alike
        yield alike.reshape(-1, state.n).T @ moved.reshape(-1, state.n)


def _segment_matrix(section: Section, length: float, inertia: Array) -> Array:
    """Mass matrix ``(12, 12)`` of a segment in the motions of its two ends, ``inertia`` (6,) being that of 1 mm."""
    own = np.zeros((12, 12))
    for point, weight in zip(*GAUSS, strict=True):
        N = shapes(section, length, 0.5 * (1.0 + point))
        own += 0.5 * length * weight * N.T @ (inertia[:, None] * N)
    return own


def _segments(state: MovingState, beam: Beam) -> tuple[Array, list[float]]:
    """Motions ``(k, 12, n)`` of both ends of a beam's segments in section axes, and lengths ``(k,)`` in mm.

    The section axes are half-way between those of the two ends. A beam of one spring is one segment.

    Raises:
        ValueError: it has no spring.
    """
    model, built = state.model, state.model.built
    pieces = [piece for piece in built.pieces if piece.part == beam.name]
    span = built.spans[beam.name]
    if not len(span):
        raise ValueError(f"part '{beam.name}' has a mass but is rigid: write it as a link with mass_kg")
    whole = beam.segments is None
    lengths = [beam.length] if whole else built.lengths[beam.name]
    own = beam.section_frame if whole else np.eye(3)
    # first and last joint of each spring
    coordinate = np.array(built.coordinate)
    joints = np.flatnonzero((coordinate >= span.start) & (coordinate < span.stop))
    begin, end = joints.reshape(len(lengths), -1)[:, [0, -1]].T
    behind, parent = state.kinematics.behind[:, :3, :3], np.asarray(model.parent)[begin]
    before = behind[parent + 1] @ np.array([built.before[j][:3, :3] for j in begin]) @ own
    turned = rotation_vectors(behind[end + 1] @ own @ before.swapaxes(1, 2))
    axes = rotations_from_vectors(0.5 * turned) @ before
    first, second = pieces[0 : 2 * len(lengths) : 2], pieces[1 : 2 * len(lengths) : 2]
    stops = [one.root - beam.end_offset if whole else one.at(one.stop) for one in second]
    rates = [
        state.point_jacobians(np.array([one.joint for one in of]), np.array(places)).reshape(len(lengths), 2, 3, -1)
        for of, places in ((first, [one.root for one in first]), (second, stops))
    ]
    ends = axes.swapaxes(1, 2)[:, None] @ np.concatenate(rates, axis=1)
    return ends.reshape(len(lengths), 12, -1), list(lengths)
