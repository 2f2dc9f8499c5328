"""Noise of postures: scatter of each reading, and what the model lacks, which is the same in like postures.

What no family explains of a robot comes back where its posture does. Readings near by then say the same twice, and
evidence that counts them as independent is too large, and intervals too narrow. A share of the variance of each
channel is therefore correlated by ``exp(−|q − q'|²/2 r²)``, with the postures' distance over all joints. Share and
reach are those of the largest likelihood (Kennedy and O'Hagan, J. R. Statist. Soc. B 63, 425, 2001).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.poses.fit import Blocks, PoseSolution

REACHES = numerical((0.1, 0.2, 0.4, 0.8, 1.6), "rad")
"""That are tried. A larger one is a constant over the postures of most tests, which the frames take up."""
SHARES = numerical(tuple(float(v) for v in np.linspace(0.0, 0.95, 20)))
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
    """

    share: float = 0.0
    reach: float = REACHES[0]
    factors: tuple[tuple[np.ndarray, Array], ...] = ()

    def whitened(self, blocks: Blocks) -> Blocks:
        """Normal equations of the readings made independent; those of parts held out are of the readings as is."""
        if not self.factors:
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
        return result

    def spread(self, blocks: Blocks) -> Array:
        """``JᵀKJ`` (P, P) with the derivatives J of the readings and their correlation K."""
        if not self.factors:
            return blocks.N
        J = blocks.J.copy()
        for rows, L in self.factors:
            J[rows] = L.T @ blocks.J[rows]
        return J.T @ J


def noise_of(blocks: Blocks, solution: PoseSolution, place: Array) -> PostureNoise:
    """The noise that the residuals of a fit show.

    Args:
        blocks: of independent readings.
        solution: the fit.
        place: ``(g, n)`` coordinates of the postures, rad, see `places`.
    """
    residual = blocks.y - blocks.J[:, solution.active] @ solution.z[solution.active]
    groups = [(rows, place[blocks.posture[rows[0]]]) for rows in _alike(blocks)]
    best, share, reach = 0.0, 0.0, REACHES[0]
    for tried in REACHES:
        gain = np.zeros(len(SHARES))
        square, count = np.zeros(len(SHARES)), 0
        for rows, x in groups:
            few = np.sort(np.random.default_rng(SEED).permutation(len(x))[:MOST])
            size, axes = np.linalg.eigh(_correlation(x[few], tried))
            power = np.sum((residual[rows[:, few]] @ axes) ** 2, axis=0)
            variance = 1.0 + np.outer(SHARES, np.maximum(size, 0.0) - 1.0)
            gain -= 0.5 * len(rows) * np.log(variance).sum(axis=1)
            square += (power / variance).sum(axis=1)
            count += len(rows) * len(few)
        # the size of the noise is that of each share's own largest likelihood
        gain -= 0.5 * count * np.log(square)
        gain -= gain[0]
        k = int(np.argmax(gain))
        if gain[k] > best:
            best, share, reach = float(gain[k]), SHARES[k], tried
    if best <= np.log(len(REACHES)):
        return PostureNoise()
    factors = [
        (rows, cholesky((1.0 - share + ROUNDING) * np.eye(len(x)) + share * _correlation(x, reach), lower=True))
        for rows, x in groups
    ]
    return PostureNoise(share, reach, tuple(factors))


def places(q: Array, turning: np.ndarray) -> Array:
    """Postures ``(g, n)`` in rad: of those coordinates that do not turn ``(n,)`` a metre is one.

    Args:
        q: coordinates ``(g, n)``, rad and mm.
        turning: which of them turn ``(n,)``.
    """
    return np.where(turning, q, q / METRE)


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
