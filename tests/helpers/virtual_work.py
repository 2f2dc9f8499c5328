"""An independent solver for machines with branches and closed loops: virtual work, tangents by complex steps.

It shares no code with the package but the description of the parts. A `Statics` lists the one-degree joints of a
`Machine` and their frames. Its unknowns are the coordinates, the reactions of beam-column springs, the wrenches of
closures, the torques of couplings, and the wrench on an end whose pose is imposed. Newton's matrix is the exact
derivative of all equations: each unknown moves by an imaginary step, and Rodrigues' formula takes complex angles.

Dead forces, springs and weight have an `energy`, of kinematics alone: a test holds its gradient to the equations.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import brentq

from helpers.laws import law_energy, law_slope
from vjm.model.laws import Law
from vjm.model.load_case import COMPONENTS, Load
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Placement, RigidOffset, Section

TINY = 1e-30
"""Complex step: its square is lost in rounding."""
EXACT = 1e-12
"""Residual of an equilibrium, in units of the machine: rounding of sums of a hundred terms."""
LARGEST_TURN = 0.4
"""Largest step of Newton's method, rad or lengths of the machine."""
RIGID = 1e-9
"""Singular value of the motions of an end, per length and radian, that is none."""
NEAR = 1e-9
"""Difference of two fractions of a beam that are one."""


class NoEquilibriumError(ArithmeticError):
    """Newton's method did not come to an equilibrium."""


def cross(a, b):
    """Cross product along the last axis, of complex arrays too."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def dual(v):
    """Matrix of the cross product by ``v``."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def turned(axis, angle):
    """Rotations ``(..., 3, 3)`` about a unit vector by angles ``(...)``, complex or not."""
    S = dual(axis)
    angle = np.asarray(angle)[..., None, None]
    return np.eye(3) + np.sin(angle) * S + (1.0 - np.cos(angle)) * (S @ S)


def placed(R=None, p=None):
    """Frame ``(4, 4)``."""
    T = np.eye(4)
    if R is not None:
        T[:3, :3] = R
    if p is not None:
        T[:3, 3] = p
    return T


def turned_by(vector):
    """Rotation ``(3, 3)`` of a rotation vector."""
    angle = float(np.linalg.norm(vector))
    return turned(np.asarray(vector) / angle, angle) if angle else np.eye(3)


def vector_of(R):
    """Rotation vector ``(3,)`` of a rotation by less than half a turn."""
    w = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = float(np.linalg.norm(w))
    angle = np.arctan2(sine, 0.5 * (np.trace(R) - 1.0))
    return w * (angle / sine if sine else 1.0)


def cross_axes(axis):
    """The two axes across a joint's, in cyclic order, turned with the nearest axis of the frame to the joint's."""
    k = int(np.argmax(np.abs(axis)))
    nearest = np.eye(3)[k] * np.sign(axis[k])
    side = np.eye(3)[(k + 1) % 3]
    normal = np.cross(nearest, axis)
    sine = float(np.linalg.norm(normal))
    if sine:
        side = turned(normal / sine, np.arctan2(sine, nearest @ axis)) @ side
    return side, np.cross(axis, side)


def section_compliance(s: Section, length: float, at: float):
    """Compliance ``(6, 6)`` of a straight piece, read at a fraction of its length, by textbook formulas."""
    L = length
    across = (L**3 / 3 / s.EIz + L / s.GAy, L**3 / 3 / s.EIy + L / s.GAz)
    C = np.diag([L / s.EA, *across, L / s.GJ, L / s.EIy, L / s.EIz])
    C[1, 5] = C[5, 1] = L**2 / 2 / s.EIz
    C[2, 4] = C[4, 2] = -(L**2) / 2 / s.EIy
    return moved(C, [(at - 1.0) * L, 0.0, 0.0])


def moved(C, offset):
    """A compliance ``(6, 6)`` read at a point shifted by ``offset``."""
    arm = np.eye(6)
    arm[:3, 3:] = -dual(offset)
    return arm @ C @ arm.T


def beam_compliance(beam: Beam):
    """Compliance ``(6, 6)`` of a beam at its tip, own axes: as given, else of a cantilever."""
    if beam.compliance is not None:
        return beam.compliance / beam.count
    R = np.kron(np.eye(2), beam.section_frame)
    C = R @ section_compliance(beam.section, beam.length, 1.0) @ R.T
    return moved(C, beam.end_offset) / beam.count


@dataclass(frozen=True)
class BeamColumn:
    """The law of a beam-column segment, ``docs/virtual-springs.md``: coordinates from reactions."""

    section: Section
    length: float

    def __call__(self, tau):
        """Coordinates ``(k, 6)`` under reactions ``(k, 6)``."""
        s, h = self.section, self.length
        N, Qy, Qz, T, My, Mz = tau.T
        cz, cz1, dy, dy1 = self._plane(N, s.EIz, s.GAy)
        cy, cy1, dz, dz1 = self._plane(N, s.EIy, s.GAz)
        shortening = 0.5 * (cz1 * Mz**2 + dy1 * Qy**2 + cy1 * My**2 + dz1 * Qz**2)
        return np.stack([h * N / s.EA + shortening, dy * Qy, dz * Qz, h * T / s.GJ, cy * My, cz * Mz], axis=1)

    def _plane(self, N, EI, GA):
        """Both compliances of a plane with their derivatives by N."""
        h, EA = self.length, self.section.EA
        stretch, slope = 1 + N / EA - N / GA, 1 / EA - 1 / GA
        z, z1 = -N * stretch * h**2 / (4 * EI), -(stretch + N * slope) * h**2 / (4 * EI)
        eta, eta1 = N**2 * h**2 / (4 * EI) * slope, N * h**2 / (2 * EI) * slope
        phi, phi_z = self._root(z, 14 / 15, -68 / 105, 9467 / 14175, -2 / 3)
        psi, psi_z = self._root(z, 34 / 105, 124 / 945, 5777 / 72765, 2 / 5)
        r = np.sqrt(-np.where(z.real < -0.02, z, -1.0))
        G, G_z = r / np.tanh(r), -(1 / np.tanh(r) - r / np.sinh(r) ** 2) / (2 * r)
        zz = -(r**2)
        exact, exact_z = 3 * (1 - G) / (zz * G), -3 * G_z / (zz * G**2) - 3 * (1 - G) / (zz**2 * G)
        psi, psi_z = np.where(z.real < -0.02, exact, psi), np.where(z.real < -0.02, exact_z, psi_z)
        k, k1 = EI / h * (1 / phi + eta), EI / h * (-phi_z * z1 / phi**2 + eta1)
        d = h**3 / (12 * EI) * psi * stretch**2 + h / GA
        d1 = h**3 / (12 * EI) * (psi_z * z1 * stretch**2 + 2 * psi * stretch * slope)
        return 1 / k, -k1 / k**2, d, d1

    @staticmethod
    def _root(z, a, b, c, e):
        root = np.sqrt(1 + a * z**2 + b * z**3 + c * z**4)
        return root + e * z, (2 * a * z + 3 * b * z**2 + 4 * c * z**3) / (2 * root) + e


@dataclass(frozen=True)
class Site:
    """A frame ``(4, 4)`` behind a one-degree joint, −1 for the world."""

    joint: int
    T: np.ndarray

    def behind(self, T):
        """The frame that stands at ``T`` from it."""
        return Site(self.joint, self.T @ T)


@dataclass(frozen=True)
class Stretch:
    """A straight stretch of a part from one fraction of it to another, and the part's first frame carried by it."""

    start: float
    stop: float
    site: Site
    along: np.ndarray
    carried: Site


@dataclass
class Spring:
    """Coordinates of one law: a stiffness matrix with its natural coordinates, a beam-column segment, or a law."""

    first: int
    law: np.ndarray | BeamColumn | Law
    natural: np.ndarray


@dataclass(frozen=True)
class Solution:
    """An equilibrium.

    Attributes:
        x: all coordinates ``(n,)``, parts in their order: what springs add, and where passive joints stand.
        parts: the coordinates by the names of the parts that have some.
        ends: end frames ``(4, 4)`` by name.
        displacements: ``(6,)`` of the ends from the posture as drawn, world axes.
        wrench: ``(6,)`` on the end-effector, at its reference point: the applied one, or what holds it.
        closures: force and moment on the second frame of each closure by its name; a ball's force.
        couplings: torque of each coupling on its sum.
        stiffness: K^F ``(6, 6)`` by end: derivative of the wrench by the end's motion, other ends being free;
            infinite where fewer than six springs move the end.
        compliance: its inverse where the ends are free.
        negative: number of negative eigenvalues of the second variation on what the constraints leave free.
        smallest: the smallest of these eigenvalues, in units of the machine.
        torques: what holds each actuated and sprung joint, by name.
        residual: largest, in units of the machine.
    """

    x: np.ndarray
    parts: Mapping[str, np.ndarray]
    ends: Mapping[str, np.ndarray]
    displacements: Mapping[str, np.ndarray]
    wrench: np.ndarray
    closures: Mapping[str, np.ndarray]
    couplings: Mapping[str, float]
    stiffness: Mapping[str, np.ndarray]
    compliance: Mapping[str, np.ndarray]
    negative: int
    smallest: float
    torques: Mapping[str, float]
    residual: float


@dataclass
class State:
    """Frames and equations at rows of unknowns."""

    R: np.ndarray
    p: np.ndarray
    forces: np.ndarray = field(default_factory=lambda: np.zeros(0))
    equations: np.ndarray = field(default_factory=lambda: np.zeros(0))


class Statics:
    """The equations of a machine in a posture under loads.

    Args:
        chain: the machine; its beams are split as its parts say, see `Machine.refined`.
        values: coordinates of its held and passive joints by name, mm and rad.
        gravity: m/s².
        loads: on parts, in full.
        wrenches: dead wrenches ``(6,)`` on ends by name; the end-effector's name is empty.
        imposed: displacement ``(6,)`` of the end-effector that is imposed; None where it is free.
    """

    def __init__(
        self,
        chain: Machine,
        values: Mapping[str, float],
        *,
        gravity=None,
        loads: Sequence[Load] = (),
        wrenches: Mapping[str, Sequence[float]] | None = None,
        imposed: Sequence[float] | None = None,
    ) -> None:
        self.chain, self.values = chain, dict(values)
        self.parent: list[int] = []
        self.before: list[np.ndarray] = []
        self.axis: list[np.ndarray] = []
        self.slides: list[bool] = []
        self.constant: list[float] = []
        self.drive: list[list[tuple[int, float]]] = []
        self.start: list[float] = []
        self.turns: list[bool] = []
        self.springs: list[Spring] = []
        self.spans: dict[str, range] = {}
        self.begin: dict[str, Site] = {"": Site(-1, np.eye(4))}
        self.end: dict[str, Site] = {"": Site(-1, chain.base)}
        self.stretches: dict[str, list[Stretch]] = {}
        self.masses: list[tuple[Site, float]] = []
        self.stands: dict[str, int] = {}
        self.own: dict[str, tuple[int, float]] = {}
        last = ""
        for part in chain.parts:
            self._at = self.end[chain.after.get(part.name, last)]
            if isinstance(part, Joint) and part.rides_on:
                self._at = self.carrying(part.rides_on, part.axis * self.values[part.name])
            self._drawn = np.eye(4)
            self.begin[part.name] = self._at
            first = len(self.start)
            self._add(part)
            self.spans[part.name] = range(first, len(self.start))
            self.end[part.name] = self._at
            last = part.name
        self.n = len(self.start)
        self.ends = {"": self.end[last]} | {name: self.end[behind] for name, behind in chain.ends.items()}
        self.laws = [s for s in self.springs if isinstance(s.law, BeamColumn)]
        self.n_tau = 6 * len(self.laws)
        self.n_closed = sum(c.rows for c in chain.closures)
        self.n_coupled = len(chain.couplings)
        self.held = imposed is not None
        self.size = self.n + self.n_tau + self.n_closed + self.n_coupled + 6 * self.held
        self.joints = [(p, a, s) for p, a, s in zip(self.parent, self.axis, self.slides, strict=True)]
        self.D = np.zeros((len(self.parent), self.n))
        for joint, terms in enumerate(self.drive):
            for coordinate, factor in terms:
                self.D[joint, coordinate] += factor
        drawn = np.zeros((1, self.size))
        drawn[0, : self.n] = self.start
        at = self._place(drawn[:, : self.n])
        self.drawn = {name: self._frame(at, site) for name, site in self.ends.items()}
        self.drawn_lengths = [self._stretched(at, spring)[2][0] for spring in chain.point_springs]
        self._load(at, gravity, loads, wrenches or {})
        self.imposed = np.zeros(6) if imposed is None else np.asarray(imposed, dtype=float)
        self._scale()

    # --- the machine as one-degree joints ------------------------------------------------------------------

    def _move(self, T) -> None:
        self._at = self._at.behind(T)
        self._drawn = self._drawn @ T

    def _joint(self, axis, slides, terms=(), constant=0.0) -> int:
        self.parent.append(self._at.joint)
        self.before.append(self._at.T)
        self.axis.append(np.asarray(axis, dtype=float))
        self.slides.append(bool(slides))
        self.constant.append(float(constant))
        self.drive.append(list(terms))
        self._at = Site(len(self.parent) - 1, np.eye(4))
        return self._at.joint

    def _coordinates(self, count, turns, start=0.0) -> int:
        first = len(self.start)
        self.start += [start] * count
        self.turns += list(turns)
        return first

    def _own_coordinate(self, axis, slides, stiffness=None, natural=0.0) -> int:
        c = self._coordinates(1, [not slides])
        self._joint(axis, slides, [(c, 1.0)])
        if stiffness is not None:
            self.springs.append(Spring(c, np.array([[stiffness]]), np.array([natural])))
        return c

    def _spring6(self, C) -> None:
        gives = np.flatnonzero(C.any(axis=0))
        first = self._coordinates(len(gives), gives >= 3)
        for i, k in enumerate(gives):
            self._joint(np.eye(3)[k % 3], k < 3, [(first + i, 1.0)])
        if len(gives):
            self.springs.append(Spring(first, np.linalg.inv(C[np.ix_(gives, gives)]), np.zeros(len(gives))))

    def _stretch(self, part, start, stop, along, mass=0.0, centre=None) -> None:
        """``centre``: from where the stretch begins."""
        carried = self._at.behind(np.linalg.inv(self._drawn))
        self.stretches.setdefault(part, []).append(Stretch(start, stop, self._at, np.asarray(along), carried))
        if mass:
            self.masses.append((self._at.behind(placed(p=centre)), mass))

    def _add(self, part) -> None:
        name = part.name
        if isinstance(part, RigidOffset):
            along = part.transform[:3, 3]
            self._stretch(name, 0.0, 1.0, along, part.mass, 0.5 * along if part.centre is None else part.centre)
            self._move(part.transform)
        elif isinstance(part, Beam):
            self._add_beam(part)
        elif part.free:
            start = float(self.values[name])
            c = self._coordinates(1, [not part.slides], start)
            self._joint(part.axis, part.slides, [(c, 1.0)])
            self.own[name] = c, start
            self.begin[name] = self._at
        elif part.fixed:
            self._add_springs(part)
        else:
            self._add_held(part)

    def _add_held(self, part: Joint) -> None:
        name = part.name
        if (coupling := part.coupling) is not None:
            self.values[name] = coupling.offset + sum(r * self.values[other] for other, r in coupling.ratios)
        value = self.values[name]
        self._stretch(name, 0.0, 0.0, np.zeros(3))
        if name not in {beam.free_length for beam in self.chain.beams}:
            self._drawn = self._drawn @ (
                placed(p=part.axis * value) if part.slides else placed(turned(part.axis, value))
            )
            self.stands[name] = self._joint(part.axis, part.slides, constant=value)
        if coupling is not None and coupling.as_deflected:
            for other, ratio in coupling.ratios:
                if other in self.own:
                    c, start = self.own[other]
                    self._joint(part.axis, part.slides, [(c, ratio)], -ratio * start)
        self._add_springs(part)
        self._stretch(name, 1.0, 1.0, np.zeros(3))
        self.begin[name] = self._at
        self._drawn = np.eye(4)

    def _add_springs(self, part: Joint) -> None:
        if part.matrix is not None:
            self._spring6(part.matrix)
        for axis, compliance in zip(cross_axes(part.axis), part.lateral, strict=True):
            if compliance:
                self._own_coordinate(axis, False, 1.0 / compliance)
        if part.compliance:
            natural = part.preload * part.compliance if part.rest is None else part.rest - self.values[part.name]
            own = self._own_coordinate(part.axis, part.slides, 1.0 / part.compliance, natural)
            self.own[part.name] = own, 0.0
        elif part.law is not None:
            natural = 0.0 if part.rest is None else part.rest - self.values[part.name]
            if part.preload:
                # its slope at the rest that balances the preload; bisection asks for nothing else
                natural = brentq(lambda rest: law_slope(part.law, -rest) + part.preload, -1e3, 1e3, xtol=1e-16)
            self.own[part.name] = self._own_coordinate(part.axis, part.slides), 0.0
            self.springs.append(Spring(self.own[part.name][0], part.law, np.array([natural])))

    def _add_beam(self, beam: Beam) -> None:
        if beam.free_length:
            beam = replace(beam, length=float(self.values[beam.free_length]), free_length="")
        name, own = beam.name, placed(beam.own_frame)
        if any(beam.bow):
            raise TypeError("no statics of a bowed beam")
        section_frame = placed(beam.own_frame @ beam.section_frame)
        if beam.segments is None:
            along = section_frame[:3, 0] * beam.length
            centre = 0.5 * along if beam.centre is None else beam.own_frame @ beam.centre
            mass = beam.own_mass if beam.section is None else beam.section.mass * beam.count * beam.length
            self._stretch(name, 0.0, 1.0, along, mass, centre)
            tip = beam.own_frame @ (beam.section_frame @ [beam.length, 0.0, 0.0] + beam.end_offset)
            self._move(placed(p=tip) @ own)
            self._spring6(beam_compliance(beam))
            # as drawn, the section ends before the rigid arm
            self._stretch(name, 1.0, 1.0, np.zeros(3))
            self._move(own.T)
            return
        s = beam.section
        several = Section(*(getattr(s, k) * beam.count for k in ("EA", "GJ", "EIy", "EIz", "GAy", "GAz", "mass")))
        along = np.array([beam.length, 0.0, 0.0])
        self._move(section_frame)
        riding = [self.values[part.name] for part in self.chain.parts if getattr(part, "rides_on", "") == name]
        cuts = [0.0, *(x / beam.length for x in riding if NEAR < x / beam.length < 1.0 - NEAR), 1.0]
        for root, far in pairwise(cuts):
            self._segments(beam, several, along, root, far)
        self._move(placed(beam.section_frame.T) @ placed(p=beam.end_offset) @ own.T)

    def _segments(self, beam: Beam, several: Section, along, root: float, far: float) -> None:
        """Those between two fractions of a beam."""
        n, at = beam.segments, beam.placement.fraction
        h = (far - root) * beam.length / n
        for i in range(n):
            # the halves' weights act at a third of their length from the ends where the spring is in the middle
            lever = 1.0 / 3.0 if at == 0.5 else 0.5
            for a, b, share in ((0.0, at, lever), (at, 1.0, 1.0 - lever)):
                length = (b - a) * h
                if a:
                    if beam.placement is Placement.BEST:
                        self._symmetric(BeamColumn(several, h))
                    else:
                        self._spring6(section_compliance(several, h, at))
                centre = [share * length, 0.0, 0.0]
                start, stop = (root + (far - root) * (i + c) / n for c in (a, b))
                self._stretch(beam.name, start, stop, along, several.mass * length, centre)
                self._move(placed(p=[length, 0.0, 0.0]))

    def _symmetric(self, law) -> None:
        first = self._coordinates(6, [False] * 3 + [True] * 3)
        for k in range(3):
            self._joint(np.eye(3)[k], False, [(first + 3 + k, 0.5)])
        for k in range(3):
            self._joint(np.eye(3)[k], True, [(first + k, 1.0)])
        for k in (2, 1, 0):
            self._joint(np.eye(3)[k], False, [(first + 3 + k, 0.5)])
        self.springs.append(Spring(first, law, np.zeros(6)))

    def point_of(self, part: str, at: float) -> Site:
        """The body that carries a point of a part, and the point on it."""
        if part in self.ends:
            return self.ends[part]
        for s in reversed(self.stretches[part]):
            if s.start - NEAR <= at <= s.stop + NEAR:
                return s.site.behind(placed(p=(at - s.start) * s.along))
        raise ValueError(f"no point at {at} of '{part}'")

    def carrying(self, part: str, point) -> Site:
        """The frame where a part begins as the body carries it on which a point of the part lies."""
        beam = next((beam for beam in self.chain.beams if beam.name == part), None)
        if beam is None:
            return self.begin[part]
        along = (beam.own_frame @ beam.section_frame)[:, 0]
        fraction = min(max(float(along @ point) / beam.length, 0.0), 1.0)
        for s in reversed(self.stretches[part]):
            if s.start - NEAR <= fraction <= s.stop + NEAR:
                return s.carried
        raise ValueError(f"no point at {fraction} of '{part}'")

    # --- loads and units -----------------------------------------------------------------------------------

    def _load(self, at, gravity, loads, wrenches) -> None:
        """Sites, forces and moments of all loads; of followers in the axes of their bodies."""
        self.dead: list[tuple[Site, np.ndarray, bool]] = []
        if gravity is not None:
            for site, mass in self.masses:
                self.dead.append((site, np.array([*(mass * np.asarray(gravity, dtype=float)), 0, 0, 0]), False))
        for load in loads:
            site, wrench = self.point_of(load.part, load.at), np.array(load.wrench)
            if load.follower:
                R = self._frame(at, Site(site.joint, np.eye(4)))[:3, :3]
                wrench = np.concatenate([R.T @ wrench[:3], R.T @ wrench[3:]])
            self.dead.append((site, wrench, load.follower))
        self.applied = {name: np.zeros(6) for name in self.ends} | {
            name: np.asarray(w, dtype=float) for name, w in wrenches.items()
        }
        for name, wrench in self.applied.items():
            self.dead.append((self.ends[name], wrench, False))
        self.conservative = not any(f or w[3:].any() for _, w, f in self.dead)

    def _scale(self) -> None:
        lengths = [float(np.linalg.norm(T[:3, 3])) for T in self.before]
        self.length = max(lengths, default=0.0) or 1.0
        stiffness = []
        for s in self.springs:
            turns = np.array(self.turns[s.first : s.first + len(s.natural)])
            if isinstance(s.law, BeamColumn):
                stiffness.append(s.law.section.EIz / s.law.length)
            elif not isinstance(s.law, Law):
                stiffness += list(np.diag(s.law) * np.where(turns, 1.0, self.length**2))
        stiffness += [s.stiffness * self.length**2 for s in self.chain.point_springs if s.law is None]
        self.energy_unit = float(np.exp(np.mean(np.log(stiffness)))) if stiffness else 1.0
        force, moment = self.energy_unit / self.length, self.energy_unit
        unit = list(np.where(self.turns, 1.0, self.length))
        row = [self.energy_unit / u for u in unit]
        for _ in self.laws:
            unit += [force] * 3 + [moment] * 3
            row += [self.length] * 3 + [1.0] * 3
        for c in self.chain.closures:
            unit += [force] * 3 + ([] if c.turns else [moment] * 3)
            row += [self.length] * 3 + ([] if c.turns else [1.0] * 3)
        passive = {part.name: part for part in self.chain.joints}
        for coupling in self.chain.couplings:
            size = max(abs(w) * (self.length if passive[name].slides else 1.0) for name, w in coupling.terms)
            unit.append(self.energy_unit / size)
            row.append(size)
        if self.held:
            unit += [force] * 3 + [moment] * 3
            row += [self.length] * 3 + [1.0] * 3
        self.unit, self.row = np.array(unit, dtype=float), np.array(row, dtype=float)

    # --- kinematics and equations ---------------------------------------------------------------------------

    def _place(self, x) -> State:
        """Frames behind the world (index 0) and behind each joint at rows ``(k, n)``."""
        k, m = len(x), len(self.parent)
        R, p = np.zeros((m + 1, k, 3, 3), dtype=x.dtype), np.zeros((m + 1, k, 3), dtype=x.dtype)
        R[0] = np.eye(3)
        values = x @ self.D.T + np.array(self.constant)
        for j in range(m):
            i, B, axis = self.parent[j] + 1, self.before[j], self.axis[j]
            p[j + 1] = p[i] + R[i] @ B[:3, 3]
            r = R[i] @ B[:3, :3]
            if self.slides[j]:
                p[j + 1] += (r @ axis) * values[:, j, None]
                R[j + 1] = r
            else:
                R[j + 1] = r @ turned(axis, values[:, j])
        return State(R, p)

    def _frame(self, at: State, site: Site):
        """Frame ``(4, 4)`` of the first row."""
        j = site.joint + 1
        return placed(at.R[j, 0].real, at.p[j, 0].real) @ site.T

    def _position(self, at: State, site: Site):
        j = site.joint + 1
        return at.p[j] + at.R[j] @ site.T[:3, 3]

    def _rotation(self, at: State, site: Site):
        return at.R[site.joint + 1] @ site.T[:3, :3]

    def _stretched(self, at: State, spring):
        """Sites of a point spring, the unit vector between its points, and its length."""
        sites = [
            self.carrying(part, point).behind(placed(p=point))
            for part, point in zip(spring.parts, np.asarray(spring.points, dtype=float), strict=True)
        ]
        a, b = (self._position(at, site) for site in sites)
        length = np.sqrt(np.sum((b - a) ** 2, axis=1))
        return sites, (b - a) / length[:, None], length

    def _closure_sites(self, closure) -> list[Site]:
        return [
            (self.end[part] if part else self.begin[""]).behind(T)
            for part, T in zip(closure.parts, np.asarray(closure.frames, dtype=float), strict=True)
        ]

    @staticmethod
    def _spin(A):
        """Vector of the skew part of matrices ``(k, 3, 3)``."""
        return 0.5 * np.stack([A[:, 2, 1] - A[:, 1, 2], A[:, 0, 2] - A[:, 2, 0], A[:, 1, 0] - A[:, 0, 1]], axis=1)

    def _equations(self, y, share=1.0) -> State:
        """All equations at rows of unknowns ``(k, size)``; forces, gaps and displacements times ``share``."""
        k, n = len(y), self.n
        x = y[:, :n]
        at = self._place(x)
        F, M = (np.zeros((len(self.parent) + 1, k, 3), dtype=y.dtype) for _ in range(2))

        def act(site, force, moment=None):
            j = site.joint + 1
            F[j] += force
            M[j] += cross(self._position(at, site), np.broadcast_to(force, (k, 3)))
            if moment is not None:
                M[j] += moment

        for site, wrench, follows in self.dead:
            force, moment = share * wrench[:3], share * wrench[3:]
            if follows:
                R = at.R[site.joint + 1]
                force, moment = R @ force, R @ moment
            act(site, force, moment)
        for spring, drawn in zip(self.chain.point_springs, self.drawn_lengths, strict=True):
            (a, b), along, length = self._stretched(at, spring)
            pull = spring.stiffness * (length - spring.free_length) + spring.preload
            pull = pull - (1.0 - share) * (spring.stiffness * (drawn - spring.free_length) + spring.preload)
            act(a, pull[:, None] * along)
            act(b, -pull[:, None] * along)
        rest = y[:, n + self.n_tau :]
        gaps = []
        for closure in self.chain.closures:
            a, b = self._closure_sites(closure)
            lam, rest = rest[:, : closure.rows], rest[:, closure.rows :]
            moment = None if closure.turns else lam[:, 3:]
            act(b, lam[:, :3], moment)
            act(a, -lam[:, :3], None if moment is None else -moment)
            gaps.append(self._position(at, b) - self._position(at, a))
            if not closure.turns:
                gaps.append(self._spin(self._rotation(at, b) @ np.swapaxes(self._rotation(at, a), 1, 2)))
        torque, rest = rest[:, : self.n_coupled], rest[:, self.n_coupled :]
        coupled = np.zeros((k, n), dtype=y.dtype)
        for i, coupling in enumerate(self.chain.couplings):
            total = -coupling.total
            for name, weight in coupling.terms:
                c, _ = self.own[name]
                coupled[:, c] += weight * torque[:, i]
                total = total + weight * x[:, c]
            gaps.append(total[:, None])
        if self.held:
            site = self.ends[""]
            act(site, rest[:, :3], rest[:, 3:])
            there = self.drawn[""][:3, 3] + share * self.imposed[:3]
            R = turned_by(share * self.imposed[3:]) @ self.drawn[""][:3, :3]
            gaps.append(self._position(at, site) - there)
            gaps.append(self._spin(self._rotation(at, site) @ R.T))
        # of each joint: what acts on all bodies behind it
        forces = np.zeros((k, len(self.parent)), dtype=y.dtype)
        for j in range(len(self.parent) - 1, -1, -1):
            w = at.R[j + 1] @ self.axis[j]
            what = F[j + 1] if self.slides[j] else M[j + 1] - cross(at.p[j + 1], F[j + 1])
            forces[:, j] = np.sum(w * what, axis=1)
            F[self.parent[j] + 1] += F[j + 1]
            M[self.parent[j] + 1] += M[j + 1]
        acting = forces @ self.D + coupled
        balance, strains, taken = -acting, [], n
        for spring in self.springs:
            where = slice(spring.first, spring.first + len(spring.natural))
            if isinstance(spring.law, BeamColumn):
                tau = y[:, taken : taken + 6]
                taken += 6
                balance[:, where] += tau
                strains.append(x[:, where] - spring.law(tau))
            else:
                balance[:, where] += (x[:, where] - share * spring.natural) @ spring.law
        at.forces, at.equations = forces, np.concatenate([balance, *strains, *gaps], axis=1)
        return at

    def energy(self, x):
        """Potential energy at rows ``(k, n)`` of springs, with laws or without, and dead forces alone."""
        assert self.conservative
        assert not self.laws
        at = self._place(x)
        energy = np.zeros(len(x), dtype=x.dtype)
        for spring in self.springs:
            d = x[:, spring.first : spring.first + len(spring.natural)] - spring.natural
            if isinstance(spring.law, Law):
                energy = energy + law_energy(spring.law, d[:, 0])
            else:
                energy = energy + 0.5 * np.einsum("ki,ij,kj->k", d, spring.law, d)
        for spring in self.chain.point_springs:
            _, _, length = self._stretched(at, spring)
            stretch, law = length - spring.free_length, spring.law
            energy = energy + (0.5 * spring.stiffness * stretch**2 if law is None else law_energy(law, stretch))
            energy = energy + spring.preload * length
        for site, wrench, _ in self.dead:
            energy = energy - self._position(at, site) @ wrench[:3]
        return energy

    def position(self, x, end: str):
        """Positions ``(k, 3)`` of an end at rows ``(k, n)``."""
        return self._position(self._place(x), self.ends[end])

    # --- equilibrium ---------------------------------------------------------------------------------------

    def _linearised(self, y, share=1.0):
        """Scaled equations and matrix, and the frames with all steps."""
        steps = y + 1j * TINY * np.diag(self.unit)
        at = self._equations(steps, share)
        M = at.equations.imag.T / TINY / self.row[:, None]
        return at.equations[0].real / self.row, M, at

    def first_step(self) -> tuple[float, float, np.ndarray]:
        """Of the posture as drawn: how regular it is, and how far the first step of Newton's method goes.

        Returns:
            Smallest eigenvalue of the second variation without loads, in units of the machine; smallest singular
            value of the constraints, their rows of length one; turns in rad and shifts per length ``(n,)``.
        """
        y = np.zeros(self.size)
        y[: self.n] = self.start
        _, M, _ = self._linearised(y, 0.0)
        H, J = self._condensed(M)
        length = np.linalg.norm(J, axis=1)[:, None]
        # a row that no motion changes holds nothing, as one that others hold too
        J = J / np.where(length > 0.0, length, 1.0)
        values = np.linalg.svd(J, compute_uv=False) if len(J) else np.ones(1)
        if len(J) > self.n or not values[-1] > 0.0:
            return 0.0, 0.0, np.zeros(self.n)
        N = null_space(J) if len(J) else np.eye(self.n)
        least = np.linalg.eigvalsh(N.T @ (0.5 * (H + H.T)) @ N).min(initial=np.inf)
        r, M, _ = self._linearised(y)
        step = np.linalg.lstsq(M, r, rcond=None)[0]
        return float(least), float(values[-1]), -step[: self.n]

    def _newton(self, y, share):
        """Equilibrium near ``y``; the last residual is that of rounding."""
        before = np.inf
        for _ in range(40):
            r, M, _ = self._linearised(y, share)
            if not np.all(np.isfinite(r)) or not np.all(np.isfinite(M)):
                return None
            try:
                step = -np.linalg.solve(M, r)
            except np.linalg.LinAlgError:
                return None
            size = float(np.abs(step[: self.n]).max(initial=0.0))
            y = y + self.unit * step * min(1.0, LARGEST_TURN / max(size, 1e-300))
            if size < 1e-9 or (size < 1e-6 and size > 0.5 * before):
                return y
            before = size
        return None

    def equilibrium(self, start=None):
        """Unknowns ``(size,)`` in equilibrium; loads are put on in steps where Newton's method asks for it."""
        y = np.zeros(self.size)
        y[: self.n] = self.start if start is None else start
        found = self._newton(y, 1.0)
        if found is None:
            found, done, step = y, 0.0, 0.25
            while done < 1.0:
                share = min(done + step, 1.0)
                there = self._newton(found, share)
                if there is not None:
                    found, done = there, share
                    continue
                step *= 0.5
                if step < 1.0 / 64.0:
                    raise NoEquilibriumError(f"{self.chain.name}: none beyond {done} of the loads")
        return found

    def residual_at(self, y) -> float:
        """Largest equation over the largest of what it sums, in units of the machine."""
        r, M, _ = self._linearised(y)
        moved = y.copy()
        moved[: self.n] -= self.start
        return float(np.abs(r).max() / max(1.0, np.abs(M * (moved / self.unit)).max()))

    def _end_rows(self, at: State, site: Site):
        """Motion ``(6, size)`` of an end by the scaled unknowns."""
        R = self._rotation(at, site)
        spin = self._spin((R.imag / TINY) @ R[0].real.T)
        return np.concatenate([self._position(at, site).imag / TINY, spin], axis=1).T

    def solve(self, start=None) -> Solution:
        """The equilibrium with its stiffness; an error where it is not found, or not to rounding."""
        y = self.equilibrium(start)
        residual = self.residual_at(y)
        if residual > EXACT:
            raise NoEquilibriumError(f"{self.chain.name}: residual {residual:.1e}")
        _, M, steps = self._linearised(y)
        at = self._equations(y[None])
        n, free = self.n, self.size - 6 * self.held
        both = {name: self._of_end(M, steps, site) for name, site in self.ends.items() if not (self.held and name)}
        H, closed = self._condensed(M)
        N = null_space(closed) if len(closed) else np.eye(n)
        reduced = N.T @ (0.5 * (H + H.T)) @ N
        values = np.linalg.eigvalsh(reduced)
        closures, couplings, rest = {}, {}, y[n + self.n_tau :]
        for closure in self.chain.closures:
            closures[closure.name], rest = rest[: closure.rows], rest[closure.rows :]
        for i, coupling in enumerate(self.chain.couplings):
            couplings[coupling.name] = float(rest[i])
        ends = {name: self._frame(at, site) for name, site in self.ends.items()}
        displacements = {
            name: np.concatenate(
                [T[:3, 3] - self.drawn[name][:3, 3], vector_of(T[:3, :3] @ self.drawn[name][:3, :3].T)]
            )
            for name, T in ends.items()
        }
        return Solution(
            x=y[:n],
            parts={name: y[span.start : span.stop] for name, span in self.spans.items() if len(span)},
            ends=ends,
            displacements=displacements,
            wrench=y[free:] if self.held else self.applied[""],
            closures=closures,
            couplings=couplings,
            stiffness={name: K for name, (K, _) in both.items()},
            compliance={} if self.held else {name: C for name, (_, C) in both.items()},
            negative=int(np.count_nonzero(values < 0.0)),
            smallest=float(values[0]) if len(values) else np.inf,
            torques=self._torques(at.forces[0]),
            residual=residual,
        )

    def stiffness_as_drawn(self, end: str = ""):
        """K^F ``(6, 6)`` of an end in the posture as drawn, whether that is an equilibrium or not."""
        y = np.zeros(self.size)
        y[: self.n] = self.start
        _, M, steps = self._linearised(y)
        return self._of_end(M, steps, self.ends[end])[0]

    def _of_end(self, M, steps: State, site: Site):
        """K^F of an end and its compliance ``(6, 6)``; nan where a passive joint leaves none."""
        free, unit = self.size - 6 * self.held, np.repeat([self.length, 1.0], 3)
        H, closed = self._condensed(M[:free, :free])
        # motions that keep to the constraints, whatever their rank: reactions do no work in them
        N = null_space(closed, rcond=RIGID) if len(closed) else np.eye(self.n)
        H, J = N.T @ H @ N, self._end_rows(steps, site)[:, : self.n] / unit[:, None] @ N
        K, C = np.full((6, 6), np.inf), np.full((6, 6), np.nan)
        if np.linalg.matrix_rank(J, tol=RIGID) == 6:
            held = np.linalg.inv(np.block([[H, -J.T], [J, np.zeros((6, 6))]]))[len(H) :, len(H) :]
            K = held * self.energy_unit / unit[:, None] / unit
        if not self.held and np.abs(np.linalg.eigvals(H)).min(initial=np.inf) > RIGID:
            C = J @ np.linalg.solve(H, J.T) * unit[:, None] * unit / self.energy_unit
        return K, C

    def _condensed(self, M):
        """Scaled second derivatives ``(n, n)`` without reactions of springs, and the constraints' rows."""
        n, t = self.n, self.n_tau
        H = M[:n, :n]
        if t:
            H = H - M[:n, n : n + t] @ np.linalg.solve(M[n : n + t, n : n + t], M[n : n + t, :n])
        return H, M[n + t :, :n]

    def _torques(self, forces) -> dict[str, float]:
        share: dict[str, dict[str, float]] = {}
        torques: dict[str, float] = {}
        for part in self.chain.parts:
            if not isinstance(part, Joint) or not part.held:
                continue
            share[part.name] = {part.name: 1.0}
            if part.coupling is not None:
                share[part.name] = {}
                for other, ratio in part.coupling.ratios if part.coupling.as_deflected else ():
                    for name, s in share.get(other, {}).items():
                        share[part.name][name] = share[part.name].get(name, 0.0) + ratio * s
            if part.name in self.stands:
                for name, s in share[part.name].items():
                    torques[name] = torques.get(name, 0.0) - s * float(forces[self.stands[part.name]])
        return torques


def posture_values(chain: Machine, label: str) -> dict[str, float]:
    """Coordinates of held and passive joints in a posture by name."""
    passive = zip((joint.name for joint in chain.joints), chain.postures[label], strict=True)
    return dict(chain.held.get(label, {})) | {name: float(value) for name, value in passive}


def with_support(chain: Machine, values: Mapping[str, float], free: Sequence[str], middle: str = ""):
    """The machine with hinges and slides, `middle` one of three, to a support behind its end; its coordinates."""
    tool = Statics(chain, values).drawn[""]
    hinges = [name for name in ("ry", "rx", "rz") if name in free]
    if len(hinges) == 3 and middle in COMPONENTS:
        hinges.remove("r" + middle[-1])
        hinges.insert(1, "r" + middle[-1])
    order = [*hinges, *(name for name in "xyz" if name in free)]
    joints = [
        Joint(f"support-{name}", np.eye(3)["xyz".index(name[-1])], slides=len(name) == 1, passive=True)
        for name in order
    ]
    axes = RigidOffset("support-axes", placed(tool[:3, :3].T))
    return replace(chain, parts=(*chain.parts, axes, *joints)), {**values, **{j.name: 0.0 for j in joints}}
