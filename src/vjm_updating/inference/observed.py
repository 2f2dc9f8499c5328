"""The readings of a test as calibration and diagnosis take them: arrays in the order of time, rays, noise.

The displacement and the temperature are taken without the noise of their own instruments: the displacement as
the test was driven, at a steady rate from turn to turn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from scipy.optimize import minimize_scalar

from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.experiment import Kind, Measurement, Readings
from vjm_updating.experiment.comparison import OfJoint, Ray, channels_of, gauges_of, imposed_loads, rays
from vjm_updating.experiment.data_file import POSE, TEMPERATURE, TIME, WRENCH, unit_of
from vjm_updating.experiment.implausible_readings import rounded
from vjm_updating.inference.noise import AutoregressiveNoise, Noise, noise_of, rounding_step, uncorrelated_noise
from vjm_updating.inference.significance import (
    CUT,
    FALSE_ALARMS,
    NOISE_KNOWN,
    NORMAL_95,
    chi2_isf,
    level,
    median_sigma,
)
from vjm_updating.mechanisms.joint_motions import motions_of_readings
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, links_of
from vjm_updating.mechanisms.series_elements import History

ASSUMED_AUTOCORRELATION = prior_scale(0.8)
"""Autocorrelation of a gauge's neighbouring readings, at most."""
MOST = numerical(2000)
"""Readings of a sequence up to which lines are sought."""
POLYNOMIAL_ORDER = numerical(3)
"""Order of the polynomials in time that forces may follow along a line, whatever the machine."""
LEAST = numerical(POLYNOMIAL_ORDER + 3)
"""Readings of a piece from which on it tells anything."""
Piece = tuple[np.ndarray, bool]
"""Readings between turns, and whether the displacement changes there."""


@dataclass(frozen=True)
class RampRegression:
    """Straight lines in time, from turn to turn.

    Attributes:
        lines: orthonormal basis ``(n, s)`` of displacements that are straight between the turns; zero for readings
            of which nothing is known but what was read.
        sequence: number ``(n,)`` of each reading's sequence.
        moved: share ``(n,)`` of what the gauge reads beside the lines that the drive did move; one for those.
    """

    lines: Array
    sequence: np.ndarray
    moved: Array

    @property
    def throughout(self) -> bool:
        """Whether the test was driven steadily from its beginning to its end, and not only while it was held."""
        return bool((self.moved < 1.0).all())

    def regressed(self, read: Array) -> Array:
        """What the drive did ``(n, …)``, of a displacement as read; what a gauge's drift then adds to that."""
        straight = self.lines @ (self.lines.T @ read)
        return straight + (self.moved * (read - straight).T).T

    def errors(self, rho: float) -> Array:
        """What is not known of the lines ``(n, s)``: independent errors of unit size, for noise of unit size.

        ``rho`` is the autocorrelation of neighbouring readings.
        """
        if rho not in self._errors:
            order = np.arange(len(self.sequence))
            together = self.sequence[:, None] == self.sequence
            R = np.where(together, (rho**order)[np.abs(order[:, None] - order)], 0.0)
            C = self.lines.T @ R @ self.lines
            self._errors.clear()
            self._errors[rho] = self.lines @ np.linalg.cholesky(C + 1e-12 * np.eye(len(C)))
        return self._errors[rho]

    @cached_property
    def _errors(self) -> dict[float, Array]:
        """The last of `errors`, by the autocorrelation: every fit asks for those of one noise."""
        return {}


def steady(
    sequence: np.ndarray, when: Array, read: Array, sigma: float, wrench: Array, noise: Array
) -> RampRegression | None:
    """The lines of a test that was driven steadily, or of its holds; None where its forces do not say so.

    Of each reading ``sequence`` (n,) has the number of its sequence, and ``when`` (n,) its clock or order. ``read``
    (n,) is the displacement by a gauge of noise ``sigma``. ``wrench`` (n, 6) is nan where there is none.
    """
    if sigma <= 0.0 or np.bincount(sequence).max() > MOST:
        return None
    parts = pieces(sequence, when, read, sigma)
    holds = [(own, slanted) for own, slanted in parts if not slanted and len(own) >= LEAST]
    for known, asked in ((parts, [p for p in parts if p[1]]), (holds, holds)):
        regression = _believed(known, asked, sequence, when, read, sigma, wrench / noise)
        if regression is not None:
            return regression
    return None


def steadiest(
    sequence: np.ndarray, times: Sequence[Array], read: Array, sigma: float, wrench: Array, noise: Array
) -> RampRegression | None:
    """The lines over the time, of several, over which they are the straightest; None where none is believed.

    A drive may go at a steady rate while readings are taken now and then, or by even steps that take their time:
    lines are then straight over the clock, or over the order of the readings. Over the other one they are only
    nearly so, and forces do not always tell. ``times`` are a clock (n,) and the order of the readings; other
    arguments are as of `steady`.
    """
    regressions = [steady(sequence, when, read, sigma, wrench, noise) for when in times]
    price = float(np.log(len(read))) * (1.0 + ASSUMED_AUTOCORRELATION) / (1.0 - ASSUMED_AUTOCORRELATION)

    def cost(path: RampRegression) -> tuple[bool, float]:
        off = (read - path.lines @ (path.lines.T @ read))[path.moved < 1.0] / sigma
        return not path.throughout, float(off @ off) + price * path.lines.shape[1]

    return min((path for path in regressions if path is not None), key=cost, default=None)


def pieces(sequence: np.ndarray, when: Array, read: Array, sigma: float) -> list[Piece]:
    """Readings between turns, and whether the displacement changes there.

    Of all cuts of a sequence the one with the least squares and the least price (Bellman's principle). A
    parameter's price is Schwarz's: the logarithm of the readings, times what an autocorrelation adds to a mean's
    variance. A sequence is always cut where the displacement passes zero: ramps to either side are programmed from
    there, and their rates differ. Arguments are as of `steady`.
    """
    parts: list[Piece] = []
    for own in _sides(sequence, read, sigma):
        t, u = when[own] - when[own[0]], read[own] / sigma
        t = t / max(float(t[-1]), 1e-300)
        m = len(t)
        powers = np.column_stack([np.ones(m), t, t * t, u, u * u, t * u])
        sums = np.vstack([np.zeros(6), np.cumsum(powers, axis=0)])
        price = float(np.log(m)) * (1.0 + ASSUMED_AUTOCORRELATION) / (1.0 - ASSUMED_AUTOCORRELATION)
        least, start, slanted = np.zeros(m + 1), np.zeros(m + 1, dtype=int), np.zeros(m + 1, dtype=bool)
        for end in range(1, m + 1):
            n, st, stt, su, suu, stu = (sums[end] - sums[:end]).T
            flat = np.maximum(suu - su * su / n, 0.0)
            spread, along = stt - st * st / n, stu - st * su / n
            line = flat - along**2 / np.maximum(spread, 1e-12)
            costs = np.array([least[:end] + flat + price, least[:end] + np.maximum(line, 0.0) + 2.0 * price])
            costs[1, spread <= 1e-12] = np.inf
            kind, k = np.unravel_index(int(np.argmin(costs)), costs.shape)
            least[end], start[end], slanted[end] = costs[kind, k], k, kind == 1
        end, cuts = m, []
        while end > 0:
            cuts.append((own[start[end] : end], bool(slanted[end])))
            end = int(start[end])
        parts += cuts[::-1]
    return parts


def _sides(sequence: np.ndarray, read: Array, sigma: float) -> list[np.ndarray]:
    """Readings of each sequence on one side of zero, in order; those within noise of it are of the side before."""
    sides = []
    for number in np.unique(sequence):
        own = np.flatnonzero(sequence == number)
        side = np.where(np.abs(read[own]) > level(len(own)) * sigma, np.sign(read[own]), 0.0)
        clear = np.flatnonzero(side)
        turns = clear[1:][side[clear[1:]] != side[clear[:-1]]]
        sides += np.split(own, turns)
    return sides


def basis(parts: Sequence[Piece], when: Array) -> Array:
    """Orthonormal columns ``(n, s)``: of every piece a level, and a slope where the displacement changes."""
    columns = []
    for own, slanted in parts:
        for k in range(2 if slanted else 1):
            column = np.zeros(len(when))
            column[own] = (when[own] - when[own].mean()) ** k
            columns.append(column / np.linalg.norm(column))
    return np.column_stack(columns)


def _believed(
    known: Sequence[Piece], asked: Sequence[Piece], sequence: np.ndarray, when: Array, read: Array, sigma: float,
    forces: Array,
) -> RampRegression | None:  # fmt: skip
    """The lines of some pieces, where forces ``(n, 6)``, over their noise, along others do not follow the gauge."""
    share = _followed(asked, sequence, when, read, forces)
    # of a drive that went straight the share is 0, of one that went where its gauge says 1: the nearer is likelier
    if share is None or share >= 1.0 - share:
        return None
    lines, on = basis(known, when), np.concatenate([own for own, _ in known])
    moved = np.ones(len(read))
    moved[on] = share
    # else it does something else than to be noisy
    regular = is_noise((read - lines @ (lines.T @ read))[on] / sigma)
    return RampRegression(lines, sequence, moved) if regular else None


def is_noise(off: Array) -> bool:
    """Whether readings beside their lines ``(m,)``, over the gauge's noise, are no more than that."""
    squares = off**2 / NOISE_KNOWN
    free = len(squares) * (1.0 - ASSUMED_AUTOCORRELATION**2) / (1.0 + ASSUMED_AUTOCORRELATION**2)
    regular = float(squares.max()) < level(len(squares)) ** 2
    return regular and float(squares.mean()) < chi2_isf(FALSE_ALARMS, free) / free


def _followed(
    parts: Sequence[Piece], sequence: np.ndarray, when: Array, read: Array, forces: Array
) -> float | None:
    """Share of what a gauge reads beside lines that forces ``(n, 6)``, over their noise, follow; None: untold."""
    followed = whole = unsure = 0.0
    for own, slanted in parts:
        if len(own) < LEAST:
            continue
        off = _beside(when[own], read[own])
        # a hold says nothing of the stiffness, the readings before and behind it do
        near = np.arange(max(own[0] - LEAST, 0), min(own[-1] + LEAST + 1, len(read)))
        steep = own if slanted else near[sequence[near] == sequence[own[0]]]
        for f, all_f in zip(forces[own].T, forces[steep].T, strict=True):
            present, known = ~np.isnan(f), ~np.isnan(all_f)
            if present.sum() < LEAST:
                continue
            stiffness = float(np.polyfit(read[steep][known], all_f[known], 1)[0])
            left = _beside(when[own][present], f[present])
            usual = max(median_sigma(left), 1.0)
            follow = stiffness * off[present]
            followed += float(follow @ np.clip(left, -CUT * usual, CUT * usual))
            whole += float(follow @ follow)
            unsure += float(follow @ follow) * usual**2
    # forces tell nothing where the intervals about both shares, of a standard deviation 1/√whole, overlap
    if whole**0.5 < 2.0 * NORMAL_95:
        return None
    return followed / whole if followed > NORMAL_95 * unsure**0.5 else 0.0


def _beside(when: Array, values: Array) -> Array:
    """Values ``(m,)`` less a polynomial in time."""
    t = when - when.mean()
    Q, _ = np.linalg.qr(np.vander(t / np.abs(t).max(), POLYNOMIAL_ORDER + 1))
    return values - Q @ (Q.T @ values)


SLOWEST, FASTEST = numerical(-18.0), numerical(6.0)
"""Logarithm of the walk's variance per reading over the noise's, between which it is looked for: below, hundreds of
readings have one temperature; above, the noise does not count."""


def smoothed(temperature: Array, noise: float) -> Array:
    """The most probable temperatures behind noisy readings: a random walk seen with noise.

    The walk's variance per reading is the most likely one. The smoother is that of Rauch, Tung and Striebel (AIAA
    J. 3 (1965) 1445) for the local level model. Readings of the ``temperature`` (n,) are in the order in which they
    were taken, °C, each of a standard deviation ``noise``, K; zero leaves them as they are.
    """
    if noise <= 0.0 or len(temperature) < 2:
        return temperature
    seen = temperature / noise
    best = minimize_scalar(lambda ratio: _filtered(seen, np.exp(ratio))[2], bounds=(SLOWEST, FASTEST))
    walk = float(np.exp(best.x))
    level, variance, _ = _filtered(seen, walk)
    for k in range(len(level) - 2, -1, -1):
        level[k] += variance[k] / (variance[k] + walk) * (level[k + 1] - level[k])
    return noise * level


def _filtered(seen: Array, walk: float) -> tuple[Array, Array, float]:
    """Kalman's filter for noise of unit variance: levels ``(n,)``, variances, minus twice the log likelihood."""
    level, variance, misfit = seen.copy(), np.ones(len(seen)), 0.0
    for k in range(1, len(seen)):
        ahead = variance[k - 1] + walk
        innovation = seen[k] - level[k - 1]
        misfit += float(np.log(ahead + 1.0) + innovation**2 / (ahead + 1.0))
        level[k] = level[k - 1] + ahead / (ahead + 1.0) * innovation
        variance[k] = ahead / (ahead + 1.0)
    return level, variance, misfit


SCORED = ("N", "mm", "Nmm", "rad")
"""Units of channels, those first whose errors say most of a machine."""


@dataclass(frozen=True)
class Observed:
    """n readings of m channels against what was imposed.

    Of a ramp displacements are imposed and the wrench is read; of a test by force it is the reverse.

    Attributes:
        imposed: displacements ``(n, 6)``, mm, rad: as read, or where they are `straightened` as commanded; of a
            test by force the loads, N, N mm.
        measured: as read ``(n, m)``, N, N mm; nan where there is no reading, or an outlier; of a test by force the
            displacements, mm, rad.
        rays: of the readings, by posture and run.
        clock: s since the first reading ``(n,)``, or None.
        warmth: K above the first reading ``(n,)``, or None.
        slots: index of the displacement that each of its channels is; of a test by force, of the load.
        columns: names of the m channels of ``measured``.
        outliers: number of samples left out as outliers.
        steady: how displacements were commanded, by their index among the six; of others what was read.
        zeros: bounds of a channel's zero, in its own unit, where readings without load show it.
    """

    measurement: Measurement
    readings: Readings
    imposed: Array
    measured: Array
    noise: Noise
    rays: tuple[Ray, ...]
    clock: Array | None
    warmth: Array | None
    slots: Mapping[str, int]
    columns: tuple[str, ...] = WRENCH
    outliers: int = 0
    steady: Mapping[int, RampRegression] = field(default_factory=dict)
    zeros: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @classmethod
    def of(
        cls, measurement: Measurement, readings: Readings, imposed: Array, read: Array, noise: Noise,
        own_rays: tuple[Ray, ...], slots: Mapping[str, int], columns: tuple[str, ...] = WRENCH,
    ) -> Observed:  # fmt: skip
        """Some readings, with their clock and temperature since the first of them."""
        clock, warmth = since_first(readings.values.get(TIME)), since_first(temperature_of(measurement, readings))
        return cls(measurement, readings, imposed, read, noise, own_rays, clock, warmth, slots, columns)

    @property
    def present(self) -> np.ndarray:
        """Which samples count ``(n, m)``."""
        return ~np.isnan(self.measured)

    @property
    def wrench_channels(self) -> list[str]:
        """Columns of ``wrench`` that were read."""
        return [name for i, name in enumerate(self.columns) if self.present[:, i].any()]

    @property
    def scored(self) -> tuple[list[int], str]:
        """Channels whose errors are told in one number, and their unit: those read of the first of `SCORED`."""
        read = {name: unit_of(name) for name in self.wrench_channels}
        unit = next(unit for unit in SCORED if unit in read.values())
        return [i for i, name in enumerate(self.columns) if read.get(name) == unit], unit

    @property
    def pose_channels(self) -> list[str]:
        """Columns of the displacement that were read."""
        return list(self.slots)

    @property
    def pose_noise(self) -> Array:
        """Standard deviation ``(n, 6)`` of each displacement, what is not known of straight lines aside."""
        result = np.tile(self.noise.pose, (len(self.imposed), 1))
        for k, own in self.steady.items():
            result[:, k] *= np.sqrt(own.moved)
        return result

    @cached_property
    def autoregression(self) -> AutoregressiveNoise:
        """Who precedes whom; no autocorrelation yet."""
        return uncorrelated_noise(self.readings.sequence, self.present)

    @cached_property
    def unloaded(self) -> History:
        """Clock, postures, lines of links, levers of the base, motions by joints, all of the unloaded machine."""
        machine, labels = self._machine, self.readings.posture.tolist()

        def each(of: Callable[[str], Array]) -> Array:
            known = {label: of(label) for label in dict.fromkeys(labels)}
            return np.array([known[label] for label in labels])

        links = links_of(machine.nominal)
        lines = {link: each(partial(machine.line, part=link)) for link in links}
        begins = np.ones(len(labels), dtype=bool)
        begins[1:] = self.readings.posture[1:] != self.readings.posture[:-1]
        return History(
            np.zeros(len(labels)) if self.clock is None else self.clock,
            begins,
            lines[links[-1]] if links else np.zeros((len(labels), 3)),
            each(machine.lever),
            lines,
            motions_of_readings(machine, labels, ())[0],
            warmth=self.warmth,
        )

    @cached_property
    def history(self) -> History:
        """The same of the machine displaced as it was, where displacements were imposed."""
        rays = [
            (ray.posture, ray.direction, ray.measure, ray.index, self.imposed[ray.index] @ ray.measure)
            for ray in self.rays
        ]
        motions, loaded = motions_of_readings(self._machine, self.readings.posture.tolist(), rays)
        lever = self.unloaded.lever + self.imposed[:, :3]
        return replace(self.unloaded, lever=lever, joints=motions, loaded=loaded)

    @property
    def _machine(self) -> ModifiedMachine:
        return ModifiedMachine(self.measurement.chain, self.measurement.engine)

    def without(self, outliers: np.ndarray) -> Observed:
        """The same with samples ``(n, 6)`` left out."""
        return replace(self, measured=np.where(outliers, np.nan, self.measured), outliers=int(outliers.sum()))


def observe(measurement: Measurement) -> Observed:
    """Readings that have a displacement and a wrench: of a channel whose rows carry a mark, what settled there.

    Raises:
        ValueError: no displacement of the end-effector was read, a channel has no noise, or the displacements lie
            on no rays.
    """
    readings, sheet = measurement.readings, measurement.sheet
    if not measurement.imposed:
        raise ValueError(
            f"{readings.file}: no displacement of the end-effector was read: add a column such as {POSE[0]} beside "
            "the forces. Without one only `validate diagnose` takes a test, of a column that its middle controls"
        )
    held = next((name for name in readings.channels if sheet.errors(name).held), None)
    if held is not None:
        readings = readings.settled(held)
    pose, wrench = readings.pose, readings.wrench
    usable = np.flatnonzero(~np.isnan(pose).any(axis=1) & ~np.isnan(wrench).all(axis=1))
    readings, pose, wrench = readings.only(usable), pose[usable], wrench[usable]
    noise = noise_of(measurement)
    slots = {name: k for k, name in enumerate(POSE) if name in readings.values}
    return Observed.of(measurement, readings, pose, wrench, noise, _rays(measurement, readings, pose, noise), slots)


def straightened(observed: Observed) -> Observed:
    """The same with straight lines in place of what a gauge read, where a test went steadily.

    The lines are straight in time or over the order of the readings.

    See `vjm_updating.inference.observed`. Others stay as they are: controlled by force, with several
    displacements that were read (`vjm_updating.inference.forward` is for these), or by a drive that does not go
    straight.
    """
    driven = list(observed.slots.values())
    if observed.measurement.sheet.test.control != "displacement" or len(driven) != 1:
        return observed
    readings, noise, pose, k = observed.readings, observed.noise, observed.imposed, driven[0]
    times = [readings.row.astype(float)] if observed.clock is None else [observed.clock, readings.row.astype(float)]
    path = steadiest(readings.sequence, times, pose[:, k], float(noise.pose[k]), observed.measured, noise.wrench)
    if path is None:
        return observed
    return commanded(observed, {k: path})


def commanded(observed: Observed, steady: Mapping[int, RampRegression]) -> Observed:
    """The same with displacements, by their index, as they were commanded, and the rays of those."""
    pose = observed.imposed.copy()
    for k, path in steady.items():
        pose[:, k] = path.regressed(pose[:, k])
    commanded_rays = _rays(observed.measurement, observed.readings, pose, observed.noise)
    return replace(observed, imposed=pose, rays=commanded_rays, steady=dict(steady))


def planned(observed: Observed, posture: str, axis: Array, ramp: Array) -> Observed:
    """Readings to be taken in one posture, in one sequence, with the instruments of the test at hand.

    Forces are zero where a channel was read. There is no clock, and displacements are as read. Of the ``axis``
    (6,), displacement per unit of the ramp, one component is 1; ``ramp`` (n,) is in mm or rad.
    """
    n = len(ramp)
    pose = ramp[:, None] * axis
    values = {name: pose[:, k] for name, k in observed.slots.items()}
    return replace(
        observed,
        readings=Readings("next", np.arange(n), np.full(n, posture), np.ones(n, dtype=int), values),
        imposed=pose,
        measured=np.where(observed.present.any(axis=0), 0.0, np.nan) * np.ones((n, 1)),
        rays=(Ray(posture, axis, axis, np.arange(n)),),
        clock=None,
        warmth=None,
        outliers=0,
        steady={},
    )


def _rays(
    measurement: Measurement, readings: Readings, imposed: Array, noise: Noise, names: tuple[str, ...] = POSE
) -> tuple[Ray, ...]:
    """Rays by posture and run: repeats may leave a bifurcation on different sides."""
    sigma = {n.subject: n.sigma for n in measurement.nuisances if n.kind is Kind.ZERO}
    zero = np.array([sigma.get(name, 0.0) for name in names])
    groups = np.array([f"{p} {r}" for p, r in zip(readings.posture, readings.run, strict=True)])
    length = measurement.chain.characteristic_length
    # a moment counts as the force that it is at the longest part's end
    grouped = rays(groups, imposed, np.hypot(noise.pose, zero), length if names is POSE else 1.0 / length)
    return tuple(Ray(r.posture.rpartition(" ")[0], r.direction, r.measure, r.index) for r in grouped)


def temperature_of(measurement: Measurement, readings: Readings) -> Array | None:
    """Temperatures ``(n,)`` of some readings without the thermometer's noise, °C; None where none were read."""
    heat = readings.values.get(TEMPERATURE)
    return None if heat is None else smoothed(heat, measurement.sheet.errors(TEMPERATURE).noise)


def since_first(values: Array | None) -> Array | None:
    """What a column ``(n,)`` gained since its first reading; None where it has gaps or does not change."""
    return None if values is None or np.isnan(values).any() or np.ptp(values) == 0.0 else values - values[0]


# --- Readings of a test of one joint: its turn or shift is what was imposed, its load what was read ---------------
#
# Errors of both are in the covariance, so that it does not matter which of the two was imposed.


def observe_joint(measurement: Measurement) -> Observed:
    """Readings that have a motion and a load.

    Raises:
        ValueError: the load's channel has no noise.
    """
    readings = measurement.readings
    motion, effort = channels_of(measurement)
    usable = np.flatnonzero(~np.isnan(readings.values[motion]) & ~np.isnan(readings.values[effort]))
    readings = readings.only(usable)
    pose = np.zeros((len(readings), 6))
    pose[:, 0] = readings.values[motion]
    x = np.eye(6)[0]
    # weights are set in steps, whichever of the two a test is said to impose
    step = rounding_step(readings.values[effort])
    stepped = "" if rounded(OfJoint(measurement), effort, step) else effort
    noise = noise_of(measurement, (motion, *[""] * 5), (effort,), stepped)
    ray, read = Ray(measurement.drive.name, x, x, np.arange(len(readings))), readings.values[effort][:, None]
    return Observed.of(measurement, readings, pose, read, noise, (ray,), {motion: 0}, (effort,))


# --- Readings of a test by force: loads on the end-effector are imposed, displacements are read at gauges ---------
#
# What is neither imposed nor read is free. An absent load is zero, and a component of the end-effector's pose that
# has no gauge moves as it will, unless the sheet says that something holds it.


def observe_loads(measurement: Measurement) -> Observed:
    """Readings that have every load that was imposed, and a displacement.

    Raises:
        ValueError: a gauge has no noise, or the loads lie on too many rays.
    """
    readings = measurement.readings
    columns = tuple(gauge.channel for gauge in gauges_of(measurement))
    imposed = imposed_loads(measurement)
    read = np.column_stack([readings.values[name] for name in columns])
    usable = np.flatnonzero(~np.isnan(imposed).any(axis=1) & ~np.isnan(read).all(axis=1))
    readings, imposed, read = readings.only(usable), imposed[usable], read[usable]
    noise = noise_of(measurement, WRENCH, columns)
    slots = {name: k for k, name in enumerate(WRENCH) if name in readings.values}
    own_rays = _rays(measurement, readings, imposed, noise, WRENCH)
    return Observed.of(measurement, readings, imposed, read, noise, own_rays, slots, columns)
