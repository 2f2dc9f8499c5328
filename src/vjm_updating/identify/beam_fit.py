"""The uniform beam nearest to a compliance matrix, and all beams that meet its entries.

Beams are points of a space in which a matrix can be fitted; what the rounding of the entries leaves open is a
set of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, least_squares, minimize

from vjm.model.parts import Beam, Section
from vjm.rotations import Array, rotation_from_vector
from vjm_updating.constants import definition, numerical, tuned

Numbers = NDArray[Any]
"""An array of real numbers, or of complex ones for derivatives."""
UPPER = definition(np.triu_indices(6))
"""The 21 entries of a symmetric matrix, row by row."""
COMPLEX_STEP = numerical(1e-30)
UNSEEN = numerical(1e-3)
"""Share of the smallest rounding half-width below which a compliance counts as none: no entry shows it."""
AT_THE_BOUND = numerical(0.7)
"""Logarithm over its lower bound up to which an optimiser has left a coordinate there."""


class Form(StrEnum):
    """What kind of beam."""

    STRAIGHT = "straight"
    """Straight, rigid in shear."""
    SHEARED = "straight, with shear"
    OFFSET = "with a rigid offset at its end"
    """Rigid in shear: with the offset free, its length and its two shear stiffnesses answer two entries only."""


@dataclass(frozen=True)
class Target:
    """A symmetric compliance to fit.

    Attributes:
        matrix: ``(6, 6)``, mm, N, rad.
        half: ``(6, 6)`` half the interval for which each entry stands; infinite where an entry is left out.
    """

    matrix: Array
    half: Array

    @cached_property
    def middle(self) -> Array:
        """Arm ``(3,)`` from the elastic centre to the tip: C_uφ C_φφ⁻¹ = −p̃, as nearly as it is skew."""
        S = self.matrix[:3, 3:] @ np.linalg.inv(self.matrix[3:, 3:])
        return 0.5 * np.array([S[1, 2] - S[2, 1], S[2, 0] - S[0, 2], S[0, 1] - S[1, 0]])

    @cached_property
    def size(self) -> float:
        """A length in mm that goes with the matrix: of a cantilever it is L/√3."""
        return float(np.sqrt(np.trace(self.matrix[:3, :3]) / np.trace(self.matrix[3:, 3:])))


@dataclass(frozen=True)
class Space:
    """The beams of one form, as vectors: turn (3), ln L, offset over size (3), ln a, t, c_y, c_z, ln s_y, s_z.

    Attributes:
        target: what they are measured against.
        form: of the beams.
        axes: rotation ``(3, 3)`` to the section's axes from which the turn counts.
    """

    target: Target
    form: Form
    axes: Array

    @property
    def _offsets(self) -> int:
        return 3 if self.form is Form.OFFSET else 0

    @cached_property
    def _least(self) -> Array:
        """Smallest shift by a force and turn by a moment ``(2,)`` that are looked for."""
        return UNSEEN * np.min(np.diag(self.target.half).reshape(2, 3), axis=1)

    def shows(self, compliance: float, *, turn: bool) -> bool:
        """Whether some entry tells a compliance, shift by force or turn by moment, from none."""
        return bool(compliance > np.exp(AT_THE_BOUND) * self._least[int(turn)])

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates: turns of less than 180° and numbers that some entry could still show."""
        size = self.target.size
        largest = np.max(np.diag(self.target.matrix).reshape(2, 3), axis=1)
        shift, turn = np.log(np.column_stack([self._least, 10.0 * largest]))
        rows = [[-10.0, 10.0]] * 3 + [list(np.log([1e-2 * size, 1e2 * size]))] + [[-10.0, 10.0]] * self._offsets
        rows += [list(shift)] + [list(turn)] * 3 + [list(shift)] * (2 if self.form is Form.SHEARED else 0)
        low, high = np.array(rows).T
        return low, high

    def start(self, length: float, arm: Array) -> Array:
        """Point with these axes, this length in mm and this arm ``(3,)`` from middle to tip, nearest the target."""
        R = self.axes
        G = np.zeros((6, 6))
        G[:3, :3] = G[3:, 3:] = R.T
        p = np.array([[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]])
        G[:3, 3:] = R.T @ p
        a, y, z, t, cy, cz = np.diag(G @ self.target.matrix @ G.T)
        tiny = 1e-300
        parts: list[Any] = [np.zeros(3), np.log(length)]
        if self.form is Form.OFFSET:
            parts.append((arm - 0.5 * length * R[:, 0]) / self.target.size)
        parts.append(np.log(np.maximum([a, t, cy, cz], tiny)))
        if self.form is Form.SHEARED:
            excess = np.array([y - length**2 * cz / 12.0, z - length**2 * cy / 12.0])
            parts.append(np.log(np.maximum(excess, tiny)))
        low, high = self.bounds
        inside = 1e-3 * (high - low)
        return np.clip(np.hstack(parts), low + inside, high - inside)

    def _compliances(self, x: Numbers) -> Numbers:
        """Compliances ``(k, 6, 6)`` of points ``(k, n)``, real or complex."""
        R = self.axes @ _rotations(x[:, :3])
        k, m = len(x), 4 + self._offsets
        L = np.exp(x[:, 3])
        p = 0.5 * L[:, None] * R[:, :, 0]
        if self.form is Form.OFFSET:
            p = p + x[:, 4:7] * self.target.size
        a, t, cy, cz = np.exp(x[:, m : m + 4]).T
        s = np.exp(x[:, m + 4 :]).T if self.form is Form.SHEARED else np.zeros((2, k))
        D = np.stack([a, L**2 * cz / 12.0 + s[0], L**2 * cy / 12.0 + s[1], t, cy, cz], axis=1)
        G = np.zeros((k, 6, 6), dtype=x.dtype)
        G[:, :3, :3] = G[:, 3:, 3:] = R
        G[:, :3, 3:] = -_skews(p) @ R
        return (G * D[:, None, :]) @ np.swapaxes(G, 1, 2)

    def residuals(self, x: Array) -> Array:
        """Misfit ``(21,)`` of the entries `UPPER` in rounding half-widths."""
        C = self._compliances(x[None])[0]
        return ((C - self.target.matrix) / self.target.half)[UPPER]

    def slopes(self, x: Array) -> Array:
        """Derivative ``(21, n)`` of `residuals`, by complex steps, exact to rounding."""
        C = self._compliances(x + 1j * COMPLEX_STEP * np.eye(len(x)))
        return (np.imag(C) / COMPLEX_STEP / self.target.half)[:, *UPPER].T

    def direction(self, x: Array) -> tuple[Array, Array]:
        """Direction ``(3,)`` of the beam at a point, and its derivative ``(3, n)``."""
        steps = x + 1j * COMPLEX_STEP * np.eye(len(x))
        D = np.imag(self.axes @ _rotations(steps[:, :3])[:, :, :1])[:, :, 0].T / COMPLEX_STEP
        return self.axes @ _rotations(x[None, :3])[0][:, 0], D

    def point(self, beam: Beam) -> Array:
        """Coordinates of a beam whose section's axes are this space's."""
        assert beam.section is not None
        s, L = beam.section, beam.length
        parts: list[Any] = [np.zeros(3), np.log(L)]
        if self.form is Form.OFFSET:
            parts.append(beam.end_offset / self.target.size)
        stiffnesses = [s.EA, s.GJ, s.EIy, s.EIz, *([s.GAy, s.GAz] if self.form is Form.SHEARED else [])]
        with np.errstate(divide="ignore"):
            parts.append(np.log(L / np.array(stiffnesses)))
        return np.clip(np.hstack(parts), *self.bounds)

    def beam(self, x: Array) -> Beam:
        """The beam at a point; a shear stiffness that no entry shows is infinite."""
        m = 4 + self._offsets
        L = float(np.exp(x[3]))
        offset = x[4:7] * self.target.size if self.form is Form.OFFSET else np.zeros(3)
        a, t, cy, cz, *shear = np.exp(x[m:]).tolist()
        GA = [L / s if self.shows(s, turn=False) else float("inf") for s in shear]
        R = self.axes @ _rotations(x[None, :3])[0]
        return Beam(
            "beam", L, section_frame=R, end_offset=offset, section=Section(L / a, L / t, L / cy, L / cz, *GA)
        )


def as_people_write_it(beam: Beam) -> Beam:
    """The same compliance in other words: of all its writings, the one that is easiest to picture.

    The beam that runs back from its far end has the same compliance with another offset: the shorter offset is
    taken. A quarter turn swaps y and z: they are taken nearest to the matrix's own.
    """
    assert beam.section is not None
    R, s = beam.section_frame, beam.section
    offset = beam.end_offset
    back = offset + beam.length * R[:, 0]
    if np.linalg.norm(back) < np.linalg.norm(offset):
        offset, R = back, R * np.array([-1.0, 1.0, -1.0])
    quarters = [R @ rotation_from_vector([0.5 * np.pi * k, 0.0, 0.0]) for k in range(4)]
    k = int(np.argmax([Q[1, 1] + Q[2, 2] for Q in quarters]))
    if k % 2:
        s = replace(s, EIy=s.EIz, EIz=s.EIy, GAy=s.GAz, GAz=s.GAy)
    return replace(beam, section_frame=quarters[k], end_offset=offset, section=s)


def _rotations(w: Numbers) -> Numbers:
    """Rotations ``(k, 3, 3)`` of twice Gibbs' vectors ``(k, 3)``: rational, so that a complex step goes through."""
    h = 0.5 * w
    S = _skews(h)
    scale = 2.0 / (1.0 + np.sum(h * h, axis=1))
    return np.eye(3) + scale[:, None, None] * (S + S @ S)


def _skews(v: Numbers) -> Numbers:
    x, y, z = v.T
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2)


RANDOM_STARTS = numerical(12)
KEPT = numerical(4)
"""Local minima of the sum of squares from which the worst entry is minimised."""
MET = numerical(1.0 + 1e-6)
"""Worst misfit in rounding half-widths up to which every entry counts as met."""


@dataclass(frozen=True)
class BeamFit:
    """A beam and how it meets the target.

    Attributes:
        space: where it was sought.
        x: its coordinates there.
    """

    space: Space
    x: Array

    @property
    def beam(self) -> Beam:
        """The beam itself."""
        return self.space.beam(self.x)

    @property
    def misfit(self) -> Array:
        """Of every entry ``(6, 6)`` in rounding half-widths, the beam's minus the target's; zero where left out."""
        result = np.zeros((6, 6))
        result[UPPER] = self.space.residuals(self.x)
        return result + np.triu(result, 1).T

    @property
    def worst(self) -> float:
        """Largest misfit, in rounding half-widths."""
        return float(np.max(np.abs(self.space.residuals(self.x))))

    @property
    def squares(self) -> float:
        """Sum of squared misfits over the 21 entries."""
        r = self.space.residuals(self.x)
        return float(r @ r)

    @property
    def met(self) -> bool:
        """Whether every entry is met within its interval."""
        return self.worst <= MET


@dataclass(frozen=True)
class FormSearch:
    """What a search over one form of beam found.

    Attributes:
        nearest: the beam of least squares.
        levelled: beams whose worst entry is a local minimum, best first.
    """

    nearest: BeamFit
    levelled: tuple[BeamFit, ...]

    @property
    def worst(self) -> float:
        """The smallest possible misfit of the worst entry, in half-widths: above one, no beam meets all."""
        return self.levelled[0].worst

    @property
    def met(self) -> bool:
        """Whether some beam meets every entry."""
        return self.levelled[0].met

    @property
    def beam(self) -> BeamFit:
        """The beam to name: the nearest, or where only another one meets every entry, that one."""
        return self.levelled[0] if self.met and not self.nearest.met else self.nearest


def search(target: Target, form: Form) -> FormSearch:
    """The nearest beam of a form, and the one whose worst entry is best.

    Both are sought from beams that the matrix itself suggests, and from random ones.
    """
    fits = []
    for space, x in _starts(target, form):
        solution = least_squares(
            space.residuals, x, space.slopes, bounds=space.bounds, max_nfev=60, xtol=1e-10, ftol=1e-10
        )
        fits.append((float(solution.cost), BeamFit(space, np.asarray(solution.x))))
    best: list[BeamFit] = []
    for _, fit in sorted(fits, key=lambda pair: pair[0]):
        # of fits of one quality one is enough
        if not best or abs(fit.squares - best[-1].squares) > 0.01 * best[-1].squares + 1e-9:
            best.append(fit)
    levelled = sorted(map(_levelled, best[:KEPT]), key=lambda fit: fit.worst)
    return FormSearch(best[0], tuple(levelled))


def _levelled(fit: BeamFit) -> BeamFit:
    """The worst misfit minimised from a fit: min w with −w ≤ r ≤ w."""
    space, n = fit.space, len(fit.x)
    worst = max(fit.worst, 1e-12)
    low, high = space.bounds

    def margins(y: Array) -> tuple[Array, Array]:
        r, J = space.residuals(y[:n]) / worst, space.slopes(y[:n]) / worst
        ones = np.ones((len(J), 1))
        return np.concatenate([y[n] - r, y[n] + r]), np.vstack([np.hstack([-J, ones]), np.hstack([J, ones])])

    goal = np.append(np.zeros(n), 1.0)
    y = _smallest(
        lambda y: (float(y[n]), goal),
        np.append(fit.x, 1.0),
        (np.append(low, 0.0), np.append(high, np.inf)),
        margins,
        iterations=200,
        tolerance=1e-8,
    )
    other = BeamFit(space, y[:n])
    return other if other.worst < fit.worst else fit


def _smallest(
    objective: Callable[[Array], tuple[float, Array]],
    start: Array,
    bounds: tuple[Array, Array],
    margins: Callable[[Array], tuple[Array, Array]],
    *,
    iterations: int,
    tolerance: float,
) -> Array:
    """A local minimum ``(n,)`` by sequential quadratic programming, or the last point before it gave up.

    Margins ``(m,)``, of which the derivatives ``(m, n)`` are given, too, must not be negative.
    """
    constraints: Any = {"type": "ineq", "fun": lambda x: margins(x)[0], "jac": lambda x: margins(x)[1]}
    solution = minimize(
        objective,
        start,
        jac=True,
        method="SLSQP",
        bounds=Bounds(*bounds),
        constraints=constraints,
        options={"maxiter": iterations, "ftol": tolerance},
    )
    return np.array(solution.x, dtype=float)


def _starts(target: Target, form: Form) -> Iterator[tuple[Space, Array]]:
    """Beams to begin from."""
    rng = np.random.default_rng(20090)
    arm, size = target.middle, target.size
    reach = float(np.linalg.norm(arm))
    principal = np.linalg.eigh(target.matrix[3:, 3:])[1]
    principal = principal * np.sign(np.linalg.det(principal))
    if form is Form.OFFSET:
        for first in range(3):
            axes = np.roll(principal, -first, axis=1)
            # where two turning compliances are equal their axes are not distinguishable: begin between them too
            for about in (None, 0, 1, 2):
                for angle in (0.0,) if about is None else (0.4, 0.8, 1.2):
                    turn = np.zeros(3) if about is None else angle * np.eye(3)[about]
                    space = Space(target, form, axes @ rotation_from_vector(turn))
                    yield space, space.start(max(2.0 * reach, size), arm)
    else:
        for angle in (0.0, 0.4, 0.8, 1.2):
            for along in (arm, *principal.T, *-principal.T):
                if np.linalg.norm(along) > 0.0:
                    axes = _axes_along(along) @ rotation_from_vector([angle, 0.0, 0.0])
                    length = 2.0 * reach if along is arm else 1.7 * size
                    yield (
                        Space(target, form, axes),
                        Space(target, form, axes).start(length, 0.5 * length * axes[:, 0]),
                    )
    for _ in range(RANDOM_STARTS):
        axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        axes = axes * np.sign(np.linalg.det(axes))
        space = Space(target, form, axes)
        length = 1.7 * size * float(np.exp(rng.uniform(-1.0, 1.0)))
        yield space, space.start(length, arm if form is Form.OFFSET else 0.5 * length * axes[:, 0])


def _axes_along(direction: Array) -> Array:
    """A rotation ``(3, 3)`` whose x axis lies along a vector."""
    x = direction / np.linalg.norm(direction)
    y = np.cross(np.eye(3)[int(np.argmin(np.abs(x)))], x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


STIFFNESSES = ("EA_N", "GJ_Nmm2", "EIy_Nmm2", "EIz_Nmm2", "GAy_N", "GAz_N")
"""Names in the order of a space's coordinates."""
OPEN = tuned(2.0)
"""Ratio of highest to lowest from which a stiffness counts as not identifiable."""
SLACK = numerical(1e-4)
"""Of the intervals, that an optimiser leaves."""
TRIALS = numerical(8)
"""Searches for one end."""
FIRST_RADIUS = numerical(0.2)
"""Of a search with short steps, in the logarithms and rad that the coordinates are."""
ENOUGH = numerical(1e-5)
"""Gain at which an end counts as reached, relative."""
UPRIGHT = numerical(0.98)
"""Cosine to the z axis from which an azimuth means little."""


@dataclass(frozen=True)
class Range:
    """What a quantity can be.

    Attributes:
        low: lowest value.
        high: highest value, infinite where no entry sets a limit.
    """

    low: float
    high: float

    @property
    def identifiable(self) -> bool:
        """Whether a stiffness is known to a factor of two."""
        return self.high < OPEN * self.low


Quantity: TypeAlias = Callable[[Array], tuple[float, Array]]
"""A function of a point: its value, of a stiffness its logarithm, and its gradient ``(n,)``."""


def ranges(fits: list[BeamFit]) -> dict[str, Range]:
    """Range of length, direction, offset and stiffnesses over the beams of one form that meet every entry.

    Each end is found by a local search from every given fit. What is reported is reached for certain; the set may
    be wider yet.

    Returns:
        By name with its unit: ``length_mm``, ``azimuth_deg``, ``elevation_deg``, ``offset_x_mm``, ``EA_N`` etc.
    """
    intervals: dict[str, Range] = {}
    for fit in fits:
        beam = as_people_write_it(fit.beam)
        space = Space(fit.space.target, fit.space.form, beam.section_frame)
        x = space.point(beam)
        for name, (quantity, k) in _quantities(space).items():
            if name == "azimuth_deg" and abs(beam.section_frame[2, 0]) > UPRIGHT:
                continue
            low, high = (_end(space, x, quantity, k, sign) for sign in (-1, 1))
            before = intervals.get(name, Range(np.inf, -np.inf))
            intervals[name] = Range(min(low, before.low), max(high, before.high))
    return intervals


def _quantities(space: Space) -> dict[str, tuple[Quantity, int | None]]:
    """Quantities by name; of stiffnesses their coordinates, too."""
    n = len(space.bounds[0])

    def linear(slope: Array) -> Quantity:
        return lambda x: (float(slope @ x), slope)

    def azimuth(x: Array) -> tuple[float, Array]:
        d, D = space.direction(x)
        slope = (d[0] * D[1] - d[1] * D[0]) / (d[0] ** 2 + d[1] ** 2)
        return float(np.rad2deg(np.arctan2(d[1], d[0]))), np.rad2deg(slope)

    def elevation(x: Array) -> tuple[float, Array]:
        d, D = space.direction(x)
        # rounding may leave a unit vector's entry above 1
        across = float(np.hypot(d[0], d[1]))
        return float(np.rad2deg(np.arctan2(d[2], across))), np.rad2deg(D[2] / across)

    def length(x: Array) -> tuple[float, Array]:
        L = float(np.exp(x[3]))
        return L, L * np.eye(n)[3]

    result: dict[str, tuple[Quantity, int | None]] = {
        "length_mm": (length, None), "azimuth_deg": (azimuth, None), "elevation_deg": (elevation, None)
    }  # fmt: skip
    first = 4
    if space.form is Form.OFFSET:
        for k, axis in enumerate("xyz"):
            result[f"offset_{axis}_mm"] = linear(space.target.size * np.eye(n)[4 + k]), None
        first = 7
    names = STIFFNESSES if space.form is Form.SHEARED else STIFFNESSES[:4]
    for k, name in enumerate(names, first):
        result[name] = linear(np.eye(n)[3] - np.eye(n)[k]), k
    return result


def _end(space: Space, x: Array, quantity: Quantity, k: int | None, sign: int) -> float:
    """Furthest value over the beams that meet every entry, searched from one that does."""
    point, radius = x, np.inf
    for _ in range(TRIALS):
        y = _ahead(space, point, quantity, sign, radius)
        gain = sign * (quantity(y)[0] - quantity(point)[0])
        if BeamFit(space, y).worst > 1.0 + SLACK or gain < 0.0:
            # the linear model led astray: go on with smaller steps
            radius = min(0.3 * radius, FIRST_RADIUS)
            continue
        enough = gain < ENOUGH * (1.0 + abs(quantity(y)[0]))
        point, radius = y, 3.0 * radius
        if enough:
            break
    value = quantity(point)[0]
    if k is None:
        return value
    low = space.bounds[0][k]
    return float("inf") if sign > 0 and point[k] < low + AT_THE_BOUND else float(np.exp(value))


def _ahead(space: Space, x: Array, quantity: Quantity, sign: int, radius: float) -> Array:
    """A point further on, at most ``radius`` away in every coordinate."""
    # near one whatever the quantity, so that one tolerance serves all
    unit = max(float(np.linalg.norm(quantity(x)[1])), 1e-12)
    low, high = space.bounds

    def objective(y: Array) -> tuple[float, Array]:
        value, slope = quantity(y)
        return -sign * value / unit, -sign * slope / unit

    def margins(y: Array) -> tuple[Array, Array]:
        r, J = space.residuals(y), space.slopes(y)
        return np.concatenate([1.0 - r, 1.0 + r]), np.vstack([-J, J])

    bounds = np.maximum(low, x - radius), np.minimum(high, x + radius)
    return _smallest(objective, x, bounds, margins, iterations=100, tolerance=1e-9)
