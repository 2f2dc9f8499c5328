"""Natural frequencies and shapes of a loaded machine about its equilibrium.

Its masses are the consistent ones. Here are also the derivatives by parameters, and where a path begins to flutter.

Beams have the masses of their segments' shapes, rigid bodies their inertias.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, assert_never

import numpy as np
from scipy.linalg import LinAlgError, cholesky, eig, eigh, solve, solve_triangular

from vjm.continuation.path import Equilibrium, Path
from vjm.design.changes import STEP, changed, difference, placed, state_rate
from vjm.design.linear_state import LinearState, Question, loaded_posture, state_of
from vjm.engines import VjmEngine
from vjm.model.end_condition import held
from vjm.model.load_case import COMPONENTS, Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity, Kinematics, Mechanism
from vjm.model.parameters import Parameter
from vjm.model.parts import Beam, Joint, Part, RigidOffset, Section
from vjm.outcome import Outcome
from vjm.postures import Posture
from vjm.rank import SUM_ROUNDING
from vjm.rotations import Array, cross, rotation_vectors, rotations_from_vectors, skew, translation
from vjm.threads import single_threaded

if TYPE_CHECKING:
    from vjm.outcome import Axes


GAUSS = np.polynomial.legendre.leggauss(4)
"""Points and weights that integrate squares of cubic shapes exactly."""


@dataclass(frozen=True)
class AlongMotions:
    """A machine that moves with some motions of its coordinates, which are its only ones.

    Attributes:
        state: of the machine.
        motions: ``(n, k)`` of its coordinates.
    """

    state: LinearState
    motions: Array

    @property
    def n(self) -> int:
        """Number of the motions."""
        return self.motions.shape[1]

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
        """Velocity at the origin and turning ``(m + 1, k, 6)`` of the base and of what is behind each joint."""
        k, model = self.kinematics, self.model
        rates = np.array([k.drive.joints(_padded(self.state, motion)) for motion in self.motions.T]).T
        turning = model.joint_rotary[:, None]
        shifts = np.where(turning, cross(k.behind[1:, :3, 3], k.axes), k.axes)
        own = np.concatenate([shifts, np.where(turning, k.axes, 0.0)], axis=1)[:, None] * rates[:, :, None]
        result = np.zeros((len(own) + 1, self.n, 6))
        for joint, before in enumerate(model.parent):
            result[joint + 1] = result[before + 1] + own[joint]
        return result

    def at(self, joint: int, offset: Array) -> Kinematics:
        """A point ``offset`` (3,) mm behind a joint, −1 for the ground, with its velocities ``(6, k)``."""
        end = self.kinematics.behind[joint + 1] @ translation(offset)
        (velocities,) = self.point_jacobians(np.array([joint]), offset[None])
        return replace(self.kinematics, end=end, jacobian=velocities)

    def point_jacobians(self, joints: np.ndarray, offsets: Array) -> Array:
        """Velocities ``(p, 6, k)`` of points ``(p, 3)`` mm behind joints ``(p,)``."""
        behind, twists = self.kinematics.behind[joints + 1], self._twists[joints + 1]
        places = (behind[:, :3, :3] @ offsets[:, :, None])[:, None, :, 0] + behind[:, None, :3, 3]
        shifts = twists[..., :3] + cross(twists[..., 3:], places)
        return np.concatenate([shifts, twists[..., 3:]], axis=2).swapaxes(1, 2)


MovingState: TypeAlias = LinearState | AlongMotions
"""A machine whose points move with some coordinates."""


def shapes(section: Section | None, length: float, share: float) -> Array:
    """Shift and turn ``(6, 12)`` of a cross-section by those of both ends of a beam, section axes, mm and rad.

    Args:
        section: of all members; None: rigid in shear.
        length: mm.
        share: fraction of the length.

    Example:
        >>> shapes(None, 2.0, 0.5)[1, [1, 5, 7, 11]].tolist()  # deflection along y at the middle
        [0.5, 0.25, 0.5, -0.25]
    """
    s, h = share, length
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
    return 0.5 * (M + M.T)


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
    return part.mass * J[:3].T @ J[:3] + J[3:].T @ inertia @ J[3:]


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
    return joint.rotor * np.outer(rate, rate)


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


MM_PER_M = 1000.0
"""N/mm over kg is 1000 of 1/s²."""
ALIKE = 1e-6
"""Difference of two motions of one mode, of the larger, that is taken for rounding: modes have some nine digits."""
NEAR = 1e-9
"""First shift over the mean of the tangent's eigenvalues: below what is wanted."""
REAL = 1e-7
"""Imaginary part over the magnitude up to which an eigenvalue is real: two that nearly meet split by the root of
rounding."""
HEAVIEST = 1e-12
"""Square of the lowest frequency over that of a motion, below which what moves is rounding: it has no mass."""
POWERS = 20
"""Steps to the largest singular value."""
SHIFTS = 40
"""Fourfold enlargements of the shift of a tangent that is not positive definite: more than double precision has."""


class ModesVerdict(StrEnum):
    """What the modes say of the equilibrium."""

    STABLE = "stable"
    """All eigenvalues are positive."""
    NEUTRAL = "neutral"
    """A motion has no stiffness."""
    DIVERGENCE = "divergence"
    """An eigenvalue is negative: the machine moves away."""
    FLUTTER = "flutter"
    """Two eigenvalues are complex: the machine oscillates with a growing amplitude."""


@dataclass(frozen=True, repr=False)
class Modes(Outcome):
    """Natural frequencies and shapes of a machine in one posture.

    Attributes:
        model: name.
        model_sha256: hash of its file.
        engine: label.
        posture: label.
        end: name of the end frame; empty where the machine names none.
        control: ``displacement`` where the end is held, else ``wrench``.
        displacement: ``(6,)`` of the end from the unloaded posture, mm and rad.
        frequencies: ``(k,)`` Hz, the lowest first; of a growing motion without oscillation it is zero.
        growth: ``(k,)`` 1/s by which the amplitude of a mode grows; zero for a stable one.
        motions: ``(n, k)`` of the coordinates; complex under flutter.
        shape: ``(s, 3)`` mm where the stations stand.
        shapes: ``(k, s, 3)`` motions of the stations, the largest being one; their real part under flutter.
        stations: the part and the fraction of each station.
        lines: pairs ``(l, 2)`` of stations between which the machine's parts lie.
        mass: kg of all parts.
        massless: beams that have no mass.

    Example:
        >>> import vjm
        >>> f"{vjm.modes(vjm.load('planar-2r'), 'stretched', number=1).frequencies[0]:.2f} Hz"
        '4.37 Hz'
    """

    model: str
    model_sha256: str
    engine: str
    posture: str
    end: str
    control: str
    displacement: Array
    frequencies: Array
    growth: Array
    motions: Any
    shape: Array
    shapes: Array
    stations: tuple[tuple[str, float], ...]
    lines: tuple[tuple[int, int], ...]
    mass: float
    massless: tuple[str, ...]

    @property
    def verdict(self) -> ModesVerdict:
        """Whether the equilibrium is stable, as far as these modes tell."""
        growing = self.growth > 0.0
        if np.any(growing & (self.frequencies > 0.0)):
            return ModesVerdict.FLUTTER
        if np.any(growing):
            return ModesVerdict.DIVERGENCE
        return ModesVerdict.NEUTRAL if np.any(self.frequencies == 0.0) else ModesVerdict.STABLE

    def table(self) -> list[dict[str, Any]]:
        """One row a mode: its number, Hz, growth in 1/s, and the part that moves most."""
        return [
            {"mode": k + 1, "frequency_Hz": f, "growth_per_s": g, "largest_at": self.largest(k)}
            for k, (f, g) in enumerate(zip(self.frequencies.tolist(), self.growth.tolist(), strict=True))
        ]

    def largest(self, mode: int) -> str:
        """Where a mode moves most: a part and the fraction of its length; empty where no station moves."""
        moved = np.linalg.norm(self.shapes[mode], axis=1)
        if not moved.any():
            return ""
        part, fraction = self.stations[_largest(moved)]
        return f"{part}@{fraction:.3g}"

    def plot(self, ax: Axes | None = None) -> Axes:
        """A bar for each mode, as long as its frequency.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.outcome import bars

        return bars([str(k + 1) for k in range(len(self.frequencies))], self.frequencies, "frequency, Hz", ax)

    def __repr__(self) -> str:
        words = ", ".join(f"{f:.5g}" for f in self.frequencies)
        return f"<Modes {self.model}, posture {self.posture}, {self.engine}: {self.verdict}\n {words} Hz>"


@single_threaded
def modes(
    machine: Machine,
    posture: Posture = "",
    *,
    number: int = 6,
    wrench: Sequence[float] | None = None,
    displacement: Sequence[float] | None = None,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
    engine: VjmEngine | None = None,
) -> Modes:
    """The lowest natural frequencies of a machine about its loaded equilibrium, and the shapes of its motions.

    Beams vibrate with their section's mass, its rotary inertia included, rigid bodies with their mass and their
    moments of inertia. Drives are held. There is no damping.

    Args:
        machine: see `vjm.load`.
        posture: label or coordinates, see `vjm.in_posture`; the first one if left out.
        number: how many frequencies.
        wrench: ``(6,)`` on the free end, dead, N and N mm, world axes.
        displacement: ``(6,)`` at which the end is held instead, mm and rad; zeros hold it where it is.
        gravity: ``(3,)`` m/s², world axes: the parts have their weight.
        loads: on parts, in full; followers too.
        end: name of the end frame whose displacement is told; the first if left out.
        engine: how beams become springs; as the engine ``vjm`` if left out.

    Raises:
        ValueError: fewer than one frequency, no part that moves has a mass, or a motion without mass is unstable.
        NoConvergenceError: there is no equilibrium under the loads.

    Example:
        >>> import vjm
        >>> vjm.modes(vjm.load("planar-2r"), "stretched", number=2)
        <Modes planar-2r, posture stretched, vjm-16: stable
         4.3722, 31.44 Hz>
    """
    if number < 1:
        raise ValueError(f"number must be at least 1, not {number}")
    asked = loaded_posture(
        machine, posture, displacement=displacement, wrench=wrench, gravity=gravity, loads=loads, end=end,
        engine=engine,
    )  # fmt: skip
    return modes_of(state_of(asked), number)


def modes_of(state: LinearState, number: int) -> Modes:
    """The lowest natural frequencies about an equilibrium that is known; see `modes`.

    Raises:
        ValueError: as `modes`.
    """
    asked = state.question
    values, motions = eigenmodes(state, number)
    omega = np.sqrt(values.astype(complex))
    frequencies, growth = omega.real / (2.0 * np.pi), np.abs(omega.imag)
    shapes = [
        _scaled(state.model.shape_rate(state.kinematics, _padded(state, motion))) for motion in motions.T.real
    ]
    return Modes(
        asked.machine.name, asked.machine.sha256, asked.engine.label, asked.posture, asked.end,
        "wrench" if asked.displacement is None else "displacement", state.moved, frequencies, growth, motions,
        state.model.shape(state.kinematics), np.array(shapes).reshape(len(values), -1, 3),
        tuple((station.part, station.fraction) for station in state.model.stations),
        station_lines(state), total_mass(asked), massless(state),
    )  # fmt: skip


def station_lines(state: LinearState) -> tuple[tuple[int, int], ...]:
    """Stations between which parts lie: along each part, and from the last station before it to its first."""
    last: dict[str, int] = {}
    lines: list[tuple[int, int]] = []
    # what rides on a beam does not hang together with where the beam begins
    riding = {joint.name for joint in state.model.chain.riders.values()}
    for name, behind in state.model.chain.predecessors.items():
        own = [k for k, station in enumerate(state.model.stations) if station.part == name]
        row = [last[behind], *own] if behind in last and name not in riding else own
        lines += pairwise(row)
        if row:
            last[name] = row[-1]
    return tuple(lines)


def _padded(state: LinearState, motion: Array) -> Array:
    """A motion ``(n,)`` with the wrenches' places, which do not move."""
    return np.concatenate([motion, np.zeros(state.model.size - state.n)])


def _scaled(shape: Array) -> Array:
    """Motions of the stations ``(s, 3)``, the largest being one, its largest component positive."""
    if not shape.size or not shape.any():
        return shape
    size = np.linalg.norm(shape, axis=1).max()
    return shape / size * np.sign(shape.ravel()[_largest(np.abs(shape.ravel()))])


def _largest(sizes: Array) -> int:
    """Index of the largest, the first of those that are as large: stations at one place move alike."""
    return int(np.argmax(sizes > (1.0 - ALIKE) * sizes.max()))


def eigenmodes(state: LinearState, number: int) -> tuple[Any, Any]:
    """Squares ``(k,)`` of angular frequencies, 1/s², the smallest first, and motions ``(n, k)``.

    Those of a tangent that is not symmetric may be complex; of two conjugate ones that with a positive imaginary
    part is given. What has no stiffness has a zero, what has no mass no frequency.

    Raises:
        ValueError: no part that moves has a mass, or a motion without mass is unstable.
    """
    A, M = state.on_motions(state.tangent), state.on_motions(mass_matrix(state))
    if not np.abs(M).max(initial=0.0) > 0.0:
        raise ValueError(
            f"{state.model.name}: no part that moves has a mass: give its links mass_kg, or its sections a density"
        )
    try:
        values, V = _symmetric(A, M, number) if state.conservative else _general(A, M, number)
    except LinAlgError:
        raise ValueError(
            f"{state.model.name}, posture {state.question.posture}: a motion without mass has no stiffness, and so "
            f"no frequency: give the parts that move in it a mass"
        ) from None
    # an eigenvalue of which the tangent's rounding is larger is none
    work = np.abs(values) * np.real(np.sum(V.conj() * (M @ V), axis=0))
    values[work < SUM_ROUNDING * _norm(A) * np.sum(np.abs(V) ** 2, axis=0)] = 0.0
    return MM_PER_M * values, state.of_motions(V)


def _norm(A: Array) -> float:
    """Largest singular value, by the power method: what is rounding needs one digit of it."""
    v, size = np.ones(len(A)), 0.0
    for _ in range(POWERS):
        v = A.T @ (A @ (v / max(np.linalg.norm(v), np.finfo(float).tiny)))
        size = float(np.sqrt(np.linalg.norm(v)))
    return size


def _symmetric(A: Array, M: Array, number: int) -> tuple[Array, Array]:
    """Eigenvalues of a symmetric tangent, the smallest first.

    Raises:
        LinAlgError: a motion without mass has no stiffness.
    """
    A = 0.5 * (A + A.T)
    shift = NEAR * abs(float(np.trace(A))) / float(np.trace(M))
    for _ in range(SHIFTS):
        try:
            values, V = _shifted(A, M, shift, number)
        except LinAlgError:
            shift *= 4.0
            continue
        break
    else:
        raise LinAlgError
    for own in values.tolist():
        try:
            # a shift of the size of the smallest one takes no digits of it
            nearer, motions = _shifted(A, M, max(-2.0 * float(values[0]), own), number)
        except LinAlgError:
            continue
        # beside one that is zero to rounding all others would seem to have no mass
        if len(nearer) == len(values):
            return nearer, motions
    return values, V


def _shifted(A: Array, M: Array, shift: float, number: int) -> tuple[Array, Array]:
    """By ``1/(λ + σ)``, the largest of which are the most exact; motions without mass drop out as zeros."""
    L = cholesky(A + shift * M, lower=True)
    half = solve_triangular(L, M, lower=True)
    S = solve_triangular(L, half.T, lower=True)
    k = min(number, len(S))
    inverse, V = eigh(0.5 * (S + S.T), subset_by_index=[len(S) - k, len(S) - 1])
    felt = inverse > HEAVIEST * inverse[-1]
    inverse, V = inverse[felt][::-1], V[:, felt][:, ::-1]
    return 1.0 / inverse - shift, solve_triangular(L.T, V, lower=False)


def _general(A: Array, M: Array, number: int) -> tuple[Any, Any]:
    """Eigenvalues of a tangent that is not symmetric, the smallest first.

    Raises:
        LinAlgError: the tangent is singular.
    """
    inverse, V = eig(solve(A, M))
    felt = np.abs(inverse) > HEAVIEST * np.abs(inverse).max()
    values, V = 1.0 / inverse[felt], V[:, felt]
    values = np.where(np.abs(values.imag) <= REAL * np.abs(values), values.real, values)
    once = values.imag >= 0.0
    values, V = values[once], V[:, once]
    nearest = np.argsort(np.abs(values))[:number]
    return values[nearest], V[:, nearest]


def frequency_rates(state: LinearState, parameters: Sequence[Parameter], values: Array, motions: Array) -> Array:
    """Derivatives ``(k, p)`` of natural frequencies by parameters, Hz per unit of each parameter.

    With the motion φ of a mode, ``φᵀ M φ = 1``, an eigenvalue λ changes by ``φᵀ (A' − λ M') φ`` and by what keeps φ
    on what the closures leave (Fox and Kapoor 1968). The matrices' derivatives are two central differences along
    the equilibria. Equal frequencies part by the eigenvalues of that form on their motions.

    Args:
        state: a stable equilibrium under loads that have a potential.
        parameters: of its machine.
        values: ``(k,)`` squares of angular frequencies, 1/s², see `vjm.design.modes.eigenmodes`;
            ascending and positive.
        motions: ``(n, k)`` of these modes.

    Raises:
        ValueError: a parameter has no derivative.
    """
    lam = values / MM_PER_M
    M, A, C = mass_matrix(state), state.tangent, state.rows(state.combinations)
    phi = motions / np.sqrt(np.einsum("nk,nm,mk->k", motions, M, motions))
    groups = np.split(np.arange(len(lam)), np.flatnonzero(np.diff(lam) > REAL * lam[1:]) + 1)
    inverse = np.linalg.pinv(C * state.unit)
    bears = inverse.T @ (state.unit[:, None] * (lam * (M @ phi) - A @ phi))
    result = np.zeros((len(lam), len(parameters)))
    for j, parameter in enumerate(parameters):
        dA, dM, dC = _matrices(state, parameter, phi)
        for own in groups:
            mean = float(lam[own].mean())
            # a motion that leaves what the closures allow is brought back
            back = -state.unit[:, None] * (inverse @ dC[:, own])
            B = (dA - mean * dM)[np.ix_(own, own)] + phi[:, own].T @ (A - mean * M) @ back
            B += bears[:, own].T @ dC[:, own]
            result[own, j] = np.linalg.eigvalsh(0.5 * (B + B.T)) if len(own) > 1 else B[0]
    return result * MM_PER_M / (8.0 * np.pi**2 * (np.sqrt(values) / (2.0 * np.pi)))[:, None]


def _matrices(state: LinearState, parameter: Parameter, motions: Array) -> tuple[Array, Array, Array]:
    """Total derivatives, on k motions, of tangent ``(k, k)``, mass matrix ``(k, k)`` and constraints ``(r, k)``."""
    k, rate = motions.shape[1], state_rate(state, parameter)

    def matrices(step: float) -> Array:
        moved = changed(state, parameter, parameter.value + step, state.x + step * rate)
        tangent, rows = motions.T @ moved.tangent_times(motions), moved.rows(state.combinations) @ motions
        return np.vstack([tangent, mass_matrix(AlongMotions(moved, motions)), rows])

    rows = difference(matrices, STEP * parameter.scale)
    return rows[:k], rows[k : 2 * k], rows[2 * k :]


GROWING = 1e-6
"""Imaginary over real part of a frequency from which on an oscillation grows: two that meet split by the root of
rounding."""


class Flutter(NamedTuple):
    """What the modes along a path say.

    Attributes:
        before: ramp of the last point without flutter; nan where the first one has it.
        begins: ramp of the first point with flutter; nan where none has it.
        examined: how many stable points were looked at.
    """

    before: float
    begins: float
    examined: int


@single_threaded
def flutter_along(machine: Machine, engine: VjmEngine, path: Path) -> Flutter:
    """The first point of a path at which an oscillation grows. What is statically unstable is not looked at.

    Args:
        machine: of the path.
        engine: that traced it.
        path: its end is free in all components.

    Raises:
        ValueError: the end is held, or no part that moves has a mass.

    Example:
        >>> flutter_along(chain, VjmEngine(8), path).begins  # doctest: +SKIP
        20.1
    """
    case = path.load_case
    if set(case.free) != set(COMPONENTS):
        raise ValueError("it is examined where the end is free in all six components")
    alone = engine.model(machine.at(case.posture))
    end = held(alone, case)

    def flutters(point: Equilibrium) -> bool:
        loads = tuple(
            replace(load, wrench=tuple(point.ramp * v for v in load.wrench), ramped=False) if load.ramped else load
            for load in case.loads
            if not load.ramped or point.ramp
        )
        asked = Question(machine, case.posture, engine, gravity=case.gravity, loads=loads)
        state = placed(asked, end.alone(point.state[: end.model.size]))
        omega = np.sqrt(np.asarray(eigenmodes(state, state.n)[0], dtype=complex))
        growing = (np.abs(omega.imag) > GROWING * np.abs(omega)) & (omega.real > GROWING * np.abs(omega))
        return bool(np.any(growing))

    before, examined = float("nan"), 0
    for point in path.points:
        if point.unstable == 0:
            examined += 1
            if flutters(point):
                return Flutter(before, point.ramp, examined)
            before = point.ramp
    return Flutter(before, float("nan"), examined)
