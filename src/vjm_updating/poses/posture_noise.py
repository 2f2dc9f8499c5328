"""Noise of postures: scatter of each reading, and what the model lacks, which is the same in like postures.

What no family explains of a robot comes back where its posture does. Readings near by then say the same twice, and
evidence that counts them as independent is too large, and intervals too narrow. A share of the variance of each
channel is therefore correlated by ``exp(−|q − q'|²/2 r²)``, with the postures' distance over all joints. Share and
reach are those of the largest likelihood (Kennedy and O'Hagan, J. R. Statist. Soc. B 63, 425, 2001).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.poses.fit import Blocks, PoseSolution

REACHES = numerical((0.1, 0.2, 0.4, 0.8, 1.6), "rad")
"""That are tried. A larger one is a constant over the postures of most tests, which the frames take up."""
SHARES = numerical(tuple(float(v) for v in np.linspace(0.0, 0.95, 20)))
WAVE_SIZES = numerical(tuple(float(v) for v in np.geomspace(1e-3, 3.0, 40)), "mrad")
"""Standard deviations of a gear's waves that are tried."""
MOST = numerical(400)
"""Postures from which share and reach are taken; of more, so many are drawn."""
SEED = numerical(0)
METRE = numerical(1000.0, "mm/rad")
"""mm of a sliding joint that count as a radian."""
ROUNDING = numerical(1e-10)


@dataclass(frozen=True, eq=False)
class PostureNoise:
    """Correlation of readings.

    Attributes:
        share: of the variance, that is correlated.
        reach: of the correlation, rad.
        factors: of channels that were read in the same postures their rows ``(c, m)``, and Cholesky's factor
            ``(m, m)`` of their correlation.
        waves: ``(rows, w)`` what errors of the gears do to the whitened readings, at their standard deviation.
            A diagnosis asks for gears' errors as a family, and only its intervals count them.
    """

    share: float = 0.0
    reach: float = REACHES[0]
    factors: tuple[tuple[np.ndarray, Array], ...] = ()
    waves: Array | None = None

    def whitened(self, blocks: Blocks) -> Blocks:
        """Normal equations of the readings made independent; those of parts held out are of the readings as is."""
        if not self.factors and self.waves is None:
            return blocks
        both = self.independent(np.concatenate([blocks.J, blocks.y[:, None]], axis=1))
        J, y = both[:, :-1], both[:, -1]
        return replace(blocks, N=J.T @ J, b=J.T @ y, c=float(y @ y), J=J, y=y)

    def independent(self, columns: Array) -> Array:
        """Columns ``(rows, n)`` of whitened readings, made independent."""
        result = columns.copy()
        for rows, L in self.factors:
            flat = np.moveaxis(columns[rows], 1, 0).reshape(len(L), -1)  # (m, c n)
            free = solve_triangular(L, flat, lower=True).reshape(len(L), len(rows), -1)
            result[rows] = np.moveaxis(free, 1, 0)
        if self.waves is not None:
            U, s, _ = np.linalg.svd(replace(self, waves=None).independent(self.waves), full_matrices=False)
            result -= U @ ((1.0 - 1.0 / np.sqrt(1.0 + s**2))[:, None] * (U.T @ result))
        return result

    def spread(self, blocks: Blocks) -> Array:
        """``JᵀKJ`` (P, P) with the derivatives J of the readings and their correlation K."""
        J = blocks.J.copy()
        for rows, L in self.factors:
            J[rows] = L.T @ blocks.J[rows]
        return blocks.spread(J, np.zeros((len(J), 0)) if self.waves is None else self.waves)


def noise_of(blocks: Blocks, solution: PoseSolution, place: Array) -> PostureNoise:
    """The noise that the residuals of a fit show.

    Args:
        blocks: of independent readings.
        solution: the fit.
        place: ``(g, n)`` coordinates of the postures, rad, see `places`.
    """
    residual = blocks.y - blocks.J[:, solution.active] @ solution.z[solution.active]
    groups = [(rows, place[blocks.posture[rows[0]]]) for rows in _alike(blocks)]
    share, reach = likeliest([(residual[rows], x) for rows, x in groups])
    if not share:
        return PostureNoise()
    factors = [(rows, factor_of(x, share, reach)) for rows, x in groups]
    return PostureNoise(share, reach, tuple(factors))


def likeliest(groups: Sequence[tuple[Array, Array]]) -> tuple[float, float]:
    """Share and reach of the correlation of like postures; a share of zero where none is seen.

    Args:
        groups: of channels that were read in the same postures the residuals ``(c, m)`` and the places ``(m, n)``.
    """
    best, share, reach = 0.0, 0.0, REACHES[0]
    for tried in REACHES:
        gain = np.zeros(len(SHARES))
        square, count = np.zeros(len(SHARES)), 0
        for residual, x in groups:
            few = np.sort(np.random.default_rng(SEED).permutation(len(x))[:MOST])
            size, axes = np.linalg.eigh(_correlation(x[few], tried))
            power = np.sum((residual[:, few] @ axes) ** 2, axis=0)
            variance = 1.0 + np.outer(SHARES, np.maximum(size, 0.0) - 1.0)
            gain -= 0.5 * len(residual) * np.log(variance).sum(axis=1)
            square += (power / variance).sum(axis=1)
            count += residual.shape[0] * len(few)
        # the size of the noise is that of each share's own largest likelihood
        gain -= 0.5 * count * np.log(square)
        gain -= gain[0]
        k = int(np.argmax(gain))
        if gain[k] > best:
            best, share, reach = float(gain[k]), SHARES[k], tried
    return (share, reach) if best > np.log(len(REACHES)) else (0.0, REACHES[0])


def gear_waves(blocks: Blocks, solution: PoseSolution, columns: Array) -> Array | None:
    """What errors of the gears do to the readings, of the size that the residuals of a fit show; None of none.

    A gear errs by many waves a turn, which are the same wherever a joint takes the same angle, whatever the others
    do. Waves of all joints are taken to be of one standard deviation: that of the largest likelihood, the unknowns
    fitted beside them.

    Args:
        blocks: of independent readings.
        solution: the fit.
        columns: ``(rows, w)`` what waves of one milliradian do to the whitened readings.
    """
    J, noise = blocks.J[:, solution.active], solution.noise
    left = (blocks.y - J @ solution.z[solution.active]) / noise
    Q = np.linalg.qr(J)[0]
    D = (columns - Q @ (Q.T @ columns)) / noise
    size2, axes = np.linalg.eigh(D.T @ D)
    power, size2 = ((D @ axes).T @ left) ** 2, np.maximum(size2, 0.0)
    a2 = np.array(WAVE_SIZES)[:, None] ** 2
    gain = 0.5 * np.sum(a2 * power / (1.0 + a2 * size2) - np.log1p(a2 * size2), axis=1)
    best = int(np.argmax(gain))
    if gain[best] <= np.log(len(WAVE_SIZES)):
        return None
    result: Array = columns * WAVE_SIZES[best]
    return result


def places(q: Array, turning: np.ndarray) -> Array:
    """Postures ``(g, n)`` in rad: of those coordinates that do not turn ``(n,)`` a metre is one.

    Args:
        q: coordinates ``(g, n)``, rad and mm.
        turning: which of them turn ``(n,)``.
    """
    return np.where(turning, q, q / METRE)


def factor_of(x: Array, share: float, reach: float) -> Array:
    """Cholesky's factor ``(m, m)`` of the correlation of readings in postures ``(m, n)``, rad."""
    result: Array = cholesky((1.0 - share + ROUNDING) * np.eye(len(x)) + share * _correlation(x, reach), lower=True)
    return result


def _correlation(x: Array, reach: float) -> Array:
    square = np.sum(x**2, axis=1)
    distance2 = np.maximum(square[:, None] + square - 2.0 * x @ x.T, 0.0)
    result: Array = np.exp(-0.5 * distance2 / reach**2)
    return result


def _alike(blocks: Blocks) -> list[np.ndarray]:
    """Rows ``(c, m)`` of the channels that were read in the same postures, for each such set of postures."""
    found: dict[bytes, list[np.ndarray]] = {}
    for channel in np.unique(blocks.channel):
        rows = np.flatnonzero(blocks.channel == channel)
        found.setdefault(blocks.posture[rows].tobytes(), []).append(rows)
    return [np.array(rows) for rows in found.values()]
