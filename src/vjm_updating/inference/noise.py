"""The noise of readings: each channel's own, the displacement's share in the force, and its autocorrelation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vjm.kernels.compilation import entry
from vjm.rotations import Array
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.data_file import POSE, WRENCH

# --- Noise of two parts, one white and one autocorrelated, made white: Kalman's filter, compiled ------------------
#
# Of a channel's samples ``y`` the autocorrelated part is expected at ``m = p x`` from its estimate ``x`` at the
# sample before, ``p`` being the autocorrelation over the gap. What is new is ``(y − m) / s``, of unit variance. The
# estimate goes on to ``m + g (y − m)``. Without a white part it is the sample itself (Anderson and Moore 1979,
# Optimal filtering, section 4.1).


@entry
def gains(before: np.ndarray, power: Array, share: Array) -> tuple[Array, Array]:
    """Standard deviations ``(n, m)`` of what is new, and gains ``(n, m)``.

    The sample before has the index ``before`` (n, m), −1 where there is none, and the autocorrelation over the gap
    to it is ``power`` (n, m). Of each channel's variance a ``share`` (m,) is autocorrelated.
    """
    n, m = before.shape
    size, gain = np.empty((n, m)), np.empty((n, m))
    left = np.empty((n, m))
    for c in range(m):
        for k in range(n):
            b = before[k, c]
            unsure = share[c]
            if b >= 0:
                unsure = power[k, c] ** 2 * left[b, c] + share[c] * (1.0 - power[k, c] ** 2)
            total = unsure + 1.0 - share[c]
            size[k, c] = np.sqrt(total)
            gain[k, c] = unsure / total
            left[k, c] = unsure * (1.0 - share[c]) / total
    return size, gain


@entry
def innovations(y: Array, before: np.ndarray, power: Array, size: Array, gain: Array) -> Array:
    """What is new ``(n, m, t)`` in samples ``(n, m, t)``, white and of unit variance."""
    n, m, t = y.shape
    result, estimate = np.empty((n, m, t)), np.empty((n, m, t))
    for k in range(n):
        for c in range(m):
            b = before[k, c]
            for j in range(t):
                expected = power[k, c] * estimate[b, c, j] if b >= 0 else 0.0
                new = y[k, c, j] - expected
                estimate[k, c, j] = expected + gain[k, c] * new
                result[k, c, j] = new / size[k, c]
    return result


@entry
def transposed(new: Array, before: np.ndarray, power: Array, size: Array, gain: Array) -> tuple[Array, Array]:
    """The transposed filter applied to ``(n, m)``, and squares ``(n, m)`` of the filter's columns."""
    n, m = new.shape
    result, squares = np.empty((n, m)), np.empty((n, m))
    back, later = np.zeros((n, m)), np.zeros((n, m))
    for k in range(n - 1, -1, -1):
        for c in range(m):
            result[k, c] = gain[k, c] * back[k, c] + new[k, c] / size[k, c]
            squares[k, c] = gain[k, c] ** 2 * later[k, c] + 1.0 / size[k, c] ** 2
            b = before[k, c]
            if b >= 0:
                kept = 1.0 - gain[k, c]
                back[b, c] += power[k, c] * (kept * back[k, c] - new[k, c] / size[k, c])
                later[b, c] += power[k, c] ** 2 * (kept**2 * later[k, c] + 1.0 / size[k, c] ** 2)
    return result, squares


@dataclass(frozen=True)
class Noise:
    """1-sigma errors of one reading, quantisation included.

    Attributes:
        pose: of what was imposed ``(6,)``, mm, rad.
        wrench: of what was read ``(m,)``, or of each reading ``(n, m)``, in its unit; 1 where there is no channel.
        quantum: step of each channel whose readings are rounded to one.
    """

    pose: Array
    wrench: Array
    quantum: dict[str, float]


def noise_of(
    measurement: Measurement, imposed: tuple[str, ...] = POSE, read: tuple[str, ...] = WRENCH, stepped: str = ""
) -> Noise:
    """Noise of a measurement's channels.

    Six columns were ``imposed``, m were ``read``; ``stepped`` is one of these that was imposed in steps all the
    same.

    Raises:
        ValueError: a channel that was read has none at all.
    """
    sheet, readings = measurement.sheet, measurement.readings
    sigma, quantum = {}, {}
    for name in (*imposed, *read):
        if name not in readings.values:
            continue
        noise = sheet.errors(name).noise
        step = rounding_step(readings.values[name]) if noise > 0.0 or name in read else 0.0
        # a rounded reading is off by up to half a step, evenly
        rounding = step / np.sqrt(12.0)
        if name in (*imposed, stepped) and rounding > noise:
            # no gauge is better than its own rounding: these are the test's own steps, read to the last digit
            step = rounding = 0.0
        if step > 0.1 * noise:
            quantum[name] = step
        sigma[name] = float(np.hypot(noise, rounding))
        if name in read and sigma[name] == 0.0:
            raise ValueError(f"{sheet.file}: [instrument.{name}] noise is zero: give the spread of one reading")
    return Noise(
        np.array([sigma.get(name, 0.0) for name in imposed]),
        np.array([sigma.get(name, 1.0) for name in read]),
        quantum,
    )


def rounding_step(values: Array) -> float:
    """Step to which readings ``(n,)`` are rounded; 0 where none is read twice, as of readings that are not."""
    known = values[~np.isnan(values)]
    levels = np.unique(known)
    if len(levels) < 2 or len(levels) == len(known):
        return 0.0
    gaps = np.diff(levels)
    step = float(gaps.min())
    # files round too: a multiple may be off by a few of the last digits
    return step if float(np.max(np.abs(gaps / step - np.round(gaps / step)))) < 0.05 else 0.0


def whiten(pose: Array, wrench: Array, sensitivity: Array, present: np.ndarray) -> Array:
    """Inverse Cholesky factors ``(n, 6, 6)`` of the readings' covariances.

    ``pose`` (n, 6), and ``wrench`` (6,) or (n, 6), are standard deviations, ``sensitivity`` (n, 6, 6) is K^F as the
    channels read it, scale errors included. Channels that were not ``present`` (n, 6) become independent of all.
    """
    K = np.nan_to_num(sensitivity)
    own = range(wrench.shape[-1])
    C = np.einsum("kij,kj,klj->kil", K, pose**2, K) + np.eye(len(own)) * (wrench**2)[..., None, :]
    C = np.where(present[:, :, None] & present[:, None, :], C, 0.0)
    C[:, own, own] = np.where(present, C[:, own, own], 1.0)
    size = np.sqrt(C[:, own, own])
    L = np.linalg.cholesky(C / size[:, :, None] / size[:, None, :] + 1e-12 * np.eye(len(own)))
    return np.linalg.inv(L) / size[:, None, :]


@dataclass(frozen=True)
class AutoregressiveNoise:
    """Autocorrelation within each sequence of readings: a white part, and one of first order.

    Attributes:
        rho: ``(6,)`` autocorrelation of that part, from one reading to the next.
        white: share ``(6,)`` of a whitened channel's variance that is white.
        before: ``(n, 6)`` index of the channel's previous sample in its sequence, −1 where there is none.
        gap: ``(n, 6)`` readings that it lies back.
    """

    rho: Array
    white: Array
    before: np.ndarray
    gap: np.ndarray

    @property
    def neighbours(self) -> Array:
        """Correlation ``(6,)`` of neighbouring readings' errors."""
        return (1.0 - self.white) * self.rho

    def of(self, channels: np.ndarray) -> AutoregressiveNoise:
        """The noise of some ``channels``, indices ``(c,)``, alone."""
        before, gap = self.before[:, channels], self.gap[:, channels]
        return AutoregressiveNoise(self.rho[channels], self.white[channels], before, gap)

    def remove(self, whitened: Array) -> Array:
        """What is new in ``(n, 6, …)``, of unit variance and white."""
        flat = np.ascontiguousarray(whitened.reshape(*self.before.shape, -1), dtype=float)
        return innovations(flat, self.before, *self._filter).reshape(whitened.shape)

    def back(self, new: Array) -> tuple[Array, Array]:
        """The transposed of `remove` applied to ``(n, 6)``, and the squares ``(n, 6)`` of its columns."""
        return transposed(np.ascontiguousarray(new), self.before, *self._filter)

    @property
    def determinant(self) -> Array:
        """Logarithm of the determinant of each channel's correlation ``(6,)``."""
        return 2.0 * np.log(self._filter[1]).sum(axis=0)

    @cached_property
    def _filter(self) -> tuple[Array, Array, Array]:
        power = np.where(self.before >= 0, self.rho ** np.maximum(self.gap, 1), 0.0)
        return power, *gains(self.before, power, 1.0 - self.white)


def uncorrelated_noise(sequence: np.ndarray, present: np.ndarray) -> AutoregressiveNoise:
    """No autocorrelation yet, but who precedes whom.

    ``sequence`` (n,) has the number of each reading's sequence; ``present`` (n, 6) channels were read.
    """
    n, m = present.shape
    before, gap = np.full((n, m), -1), np.zeros((n, m), dtype=int)
    for c in range(m):
        last = -1
        for k in range(n):
            if not present[k, c]:
                continue
            if last >= 0 and sequence[last] == sequence[k]:
                before[k, c], gap[k, c] = last, k - last
            last = k
    return AutoregressiveNoise(np.zeros(m), np.zeros(m), before, gap)
