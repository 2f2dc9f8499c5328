"""The machine as two rods between crossing joints: the numbers of a chain, and what may differ from them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hidden_effects.chain_kernel import TERMS
from hidden_effects.history_kernel import march
from hidden_effects.rod_kernel import COLUMNS, DRIVE, FOOT, LINEAR, LINK, ROD
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, JointKind
from vjm.rotations import Array, rotate_matrix6, rotation_from_vector

LINK_STEPS, FOOT_STEPS = 16, 6
"""Of the integration, fourth order: the critical force is then right to 2e-5, as a test measures."""
KEPT = 16
"""Histories whose wrenches are remembered."""


class NoTruthError(ArithmeticError):
    """The simulator did not come to the end of a history."""


@dataclass(frozen=True)
class TrueMachine:
    """What the machine does that its drawing does not say; as drawn where nothing is given.

    Attributes:
        chain: as drawn: base, drive, foot, two joints, link, two joints.
        lumped_foot: the foot is one spring by (22) instead of a rod.
        foot_factor: compliance of the foot over that drawn.
        link_factor: of the link.
        link_longer: mm.
        foot_pull: compliance of the foot in pull over that in push, less one.
        link_pull: of the link.
        pull_force: N over which a compliance that differs between pull and push changes from one to the other.
        bow: deflection of the unloaded link along its two section axes ``(2, k)`` mm: half sine, whole sine, ….
        base: compliance ``(6, 6)`` of what carries the base, at its root, world axes.
        laws: elements in series ``(3, COLUMNS)`` at drive, foot and link, see `rod_kernel.stretch`.
        joints: friction ``(4, 2)`` of each joint: N mm/rad before it slips, N mm at which it slips.
        creep: ``(4, TERMS)``: share of each part's compliance that comes late (drive: mm/N), and when, in s.
        weight: kg of foot and link.
        down: direction ``(3,)`` of the weight.
        side: to which side it buckles.
    """

    chain: Machine
    lumped_foot: bool = False
    foot_factor: float = 1.0
    link_factor: float = 1.0
    link_longer: float = 0.0
    foot_pull: float = 0.0
    link_pull: float = 0.0
    pull_force: float = 50.0
    bow: Array = field(default_factory=lambda: np.zeros((2, 2)))
    base: Array = field(default_factory=lambda: np.zeros((6, 6)))
    laws: Array = field(default_factory=lambda: np.zeros((3, COLUMNS)))
    joints: Array = field(default_factory=lambda: np.zeros((4, 2)))
    creep: Array = field(default_factory=lambda: np.zeros((4, TERMS)))
    weight: tuple[float, float] = (0.0, 0.0)
    down: tuple[float, float, float] = (0.0, 0.0, 0.0)
    side: float = 1.0

    def with_law(self, part: int, **columns: float) -> TrueMachine:
        """The same with entries of one part's law replaced, by the names of the columns in `rod_kernel`."""
        from hidden_effects import rod_kernel

        laws = self.laws.copy()
        for name, value in columns.items():
            laws[part, getattr(rod_kernel, name.upper())] = value
        return replace(self, laws=laws)

    # --- history --------------------------------------------------------------------------------------------

    def readings(self, posture: str, poses: Array, times: Array | None = None) -> Array:
        """Wrenches ``(n, 6)`` at the end along a history that starts unloaded at rest.

        Args:
            posture: label.
            poses: displacements ``(n, 6)`` from this machine's own unloaded pose, mm and rad.
            times: ``(n,)`` s, the first since it was at rest; every second where not given.

        Raises:
            NoTruthError: the solver gave up on the way.
        """
        spans = np.ones(len(poses)) if times is None else np.diff(times, prepend=0.0)
        foot, link = self._strains()
        q0, soft = self.chain.posture(posture), self._soft()
        result, reached = _marched((
            np.ascontiguousarray(poses, dtype=float), spans, np.asarray(q0, dtype=float), self._home(q0),
            self._packed(), self._laws(), self._friction(), self.creep, foot, link, soft[0], soft[1], self.side,
        ))  # fmt: skip
        if reached < len(poses):
            raise NoTruthError(f"posture {posture}: no equilibrium at reading {reached + 1} of {len(poses)}")
        wrench: Array = result[:, :6].copy()
        return wrench

    @property
    def drive(self) -> float:
        """Linear compliance of the drive, mm/N, what was added to the drawing's included."""
        return self._drive.compliance + float(self.laws[DRIVE, LINEAR])

    # --- numbers --------------------------------------------------------------------------------------------

    @property
    def _foot(self) -> Beam:
        return next(part for part in self.chain.beams if part.name == "foot")

    @property
    def _link(self) -> Beam:
        return next(part for part in self.chain.beams if part.name == "link")

    @property
    def _drive(self) -> Joint:
        return next(
            part for part in self.chain.parts if isinstance(part, Joint) and part.kind is JointKind.ACTUATOR
        )

    @property
    def _axes(self) -> Array:
        return np.array([joint.axis for joint in self.chain.joints])

    def _laws(self) -> Array:
        laws = self.laws.copy()
        laws[DRIVE, LINEAR] += self._drive.compliance
        return laws

    def _friction(self) -> Array:
        joints = np.zeros((4, 4))
        joints[:, :2] = self.joints
        return joints

    def _rods(self) -> Array:
        rods = np.zeros((2, ROD))
        for row, beam, factor, pull, mass, steps in (
            (0, self._foot, self.foot_factor, self.foot_pull, self.weight[0], FOOT_STEPS),
            (1, self._link, self.link_factor, self.link_pull, self.weight[1], LINK_STEPS),
        ):
            s, length = beam.effective_section(), beam.length + (self.link_longer if row else 0.0)
            weight = 9.80665 * mass / length
            rods[row] = length, s.EA, s.GJ, s.EIy, s.EIz, weight, factor, pull, self.pull_force, steps
        if self.lumped_foot:
            rods[0, 0] = 0.0
        return rods

    def _soft(self) -> Array:
        rods = self._rods()
        soft: Array = rods[:, 6, None] / rods[:, 1:5]
        return soft

    def _strains(self) -> tuple[Array, Array]:
        """Intrinsic strains of foot and link: the bow's curvature."""
        link = np.zeros((2 * LINK_STEPS + 1, 4))
        length = self._link.length + self.link_longer
        s = np.linspace(0.0, 1.0, 2 * LINK_STEPS + 1)
        for k in range(self.bow.shape[1]):
            wave = (k + 1) * np.pi
            curvature = -((wave / length) ** 2) * np.sin(wave * s)
            # a deflection along y bends about z, one along z about −y
            link[:, 3] += self.bow[0, k] * curvature
            link[:, 2] -= self.bow[1, k] * curvature
        return np.zeros((2 * FOOT_STEPS + 1, 4)), link

    def _slopes(self) -> tuple[Array, Array]:
        """Turns ``(3, 3)`` from the chord to the bowed link's root, and from its end back to the chord."""
        length = self._link.length + self.link_longer
        start, end = np.zeros(2), np.zeros(2)
        for k in range(self.bow.shape[1]):
            wave = (k + 1) * np.pi
            start += self.bow[:, k] * wave / length
            end += self.bow[:, k] * wave / length * np.cos(wave)
        return rotation_from_vector([0.0, -start[1], start[0]]), rotation_from_vector([0.0, end[1], -end[0]])

    def _packed(self) -> tuple[Any, ...]:
        foot, link = self._foot, self._link
        foot_in, link_in = foot.section_in_chain[:3, :3], link.section_in_chain[:3, :3]
        into, out = self._slopes()
        own = foot.tip_compliance() if self.lumped_foot else foot.beam_compliance()
        arm = foot.tip if self.lumped_foot else foot.section_frame.T @ foot.end_offset
        return (
            np.ascontiguousarray(self.chain.base), np.ascontiguousarray(self.base), np.ascontiguousarray(foot_in),
            np.ascontiguousarray(foot_in.T), np.ascontiguousarray(arm), own * self.foot_factor,
            np.ascontiguousarray(foot.own_frame), np.ascontiguousarray(link_in @ into),
            np.ascontiguousarray(out @ link_in.T), self._axes, self._rods(), np.array(self.down, dtype=float),
            np.array(self._drive.axis, dtype=float),
        )  # fmt: skip

    def _home(self, q: Array) -> Array:
        """Frame ``(4, 4)`` of the unloaded, weightless end at joint angles ``(4,)``."""
        T = self.chain.base.copy()
        T[:3, 3] += T[:3, :3] @ self._foot.tip
        turns = [rotation_from_vector(axis * angle) for axis, angle in zip(self._axes, q, strict=True)]
        R = T[:3, :3] @ turns[0] @ turns[1]
        T[:3, 3] += R @ self._chord()
        T[:3, :3] = R @ turns[2] @ turns[3]
        return T

    def _chord(self) -> Array:
        """Vector ``(3,)`` between the joints of the unloaded link: a bowed one spans less than its length."""
        link_in, length = self._link.section_in_chain[:3, :3], self._link.length + self.link_longer
        straight: Array = length * link_in[:, 0]
        if not self.bow.any():
            return straight
        (into, _), (_, strain) = self._slopes(), self._strains()
        h, R, p = length / (2 * LINK_STEPS), into, np.zeros(3)
        for i in range(2 * LINK_STEPS):
            half = rotation_from_vector(0.25 * h * (strain[i, 1:] + strain[i + 1, 1:]))
            p = p + h * (R @ half)[:, 0]
            R = R @ half @ half
        chord: Array = link_in @ p
        return chord


_MARCHED: dict[bytes, tuple[Array, int]] = {}


def _marched(given: tuple[Any, ...]) -> tuple[Array, int]:
    """`march`, once for what an instrument's fault leaves as it is."""
    parts = [part for one in given for part in (one if isinstance(one, tuple) else (one,))]
    key = b"".join(np.asarray(part, dtype=float).tobytes() for part in parts)
    if key not in _MARCHED:
        if len(_MARCHED) >= KEPT:
            _MARCHED.pop(next(iter(_MARCHED)))
        _MARCHED[key] = march(*given)
    return _MARCHED[key]


def rotated(matrix: Array, R: Array) -> Array:
    """A compliance ``(6, 6)`` in other axes."""
    result: Array = rotate_matrix6(matrix, R)
    return result


__all__ = ["DRIVE", "FOOT", "LINK", "Machine", "NoTruthError", "rotated"]
