"""Natural frequencies and shapes of a loaded machine about its equilibrium.

Small motions obey ``M ẍ + (K − H) x = 0`` on what the closures leave: the tangent stiffness with the loads'
geometric terms, and the consistent mass matrix. A frequency that falls to zero is a loss of stability. Under
followers and moments the tangent is not symmetric: two frequencies that meet become complex, which is flutter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import LinAlgError, cholesky, eig, eigh, solve, solve_triangular

from vjm.design.linear_state import LinearState, question, state_of
from vjm.design.masses import mass_matrix, massless, total_mass
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.outcome import Outcome
from vjm.postures import Posture
from vjm.rank import SUM_ROUNDING
from vjm.rotations import Array
from vjm.threads import single_threaded
from vjm.vjm_engine import VjmEngine

if TYPE_CHECKING:
    from vjm.notebook import Axes

MM_PER_M = 1000.0
"""N/mm over kg is 1000 of 1/s²."""
NEAR = 1e-9
"""First shift over the mean of the tangent's eigenvalues: below what is wanted."""
REAL = 1e-7
"""Imaginary part over the magnitude up to which an eigenvalue is real: two that nearly meet split by the root of
rounding."""
HEAVIEST = 1e-12
"""Square of the lowest frequency over that of a motion, below which what moves is rounding: it has no mass."""
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
        part, fraction = self.stations[int(np.argmax(moved))]
        return f"{part}@{fraction:.3g}"

    def plot(self, ax: Axes | None = None) -> Axes:
        """A bar for each mode, as long as its frequency.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.notebook import bars

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
    asked = question(
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
    found: list[tuple[int, int]] = []
    # what rides on a beam does not hang together with where the beam begins
    riding = {joint.name for joint in state.model.chain.riders.values()}
    for name, behind in state.model.chain.predecessors.items():
        own = [k for k, station in enumerate(state.model.stations) if station.part == name]
        row = [last[behind], *own] if behind in last and name not in riding else own
        found += pairwise(row)
        if row:
            last[name] = row[-1]
    return tuple(found)


def _padded(state: LinearState, motion: Array) -> Array:
    """A motion ``(n,)`` with the wrenches' places, which do not move."""
    return np.concatenate([motion, np.zeros(state.model.size - state.n)])


def _scaled(shape: Array) -> Array:
    """Motions of the stations ``(s, 3)``, the largest being one, its largest component positive."""
    if not shape.size or not shape.any():
        return shape
    size = np.linalg.norm(shape, axis=1).max()
    return shape / size * np.sign(shape.ravel()[np.argmax(np.abs(shape))])


def eigenmodes(state: LinearState, number: int) -> tuple[Any, Any]:
    """Squares ``(k,)`` of angular frequencies, 1/s², the smallest first, and motions ``(n, k)``.

    Those of a tangent that is not symmetric may be complex; of two conjugate ones that with a positive imaginary
    part is given. What has no stiffness has a zero, what has no mass no frequency.

    Raises:
        ValueError: no part that moves has a mass, or a motion without mass is unstable.
    """
    N = state.motions
    A = N.T @ state.tangent @ N
    M = N.T @ mass_matrix(state) @ N
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
    values[work < SUM_ROUNDING * np.linalg.norm(A, 2) * np.sum(np.abs(V) ** 2, axis=0)] = 0.0
    return MM_PER_M * values, N @ V


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
    try:
        # a shift of the size of the smallest one takes no digits of it
        return _shifted(A, M, 2.0 * max(-float(values[0]), 0.0) or float(values[0]), number)
    except LinAlgError:
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
