"""The displacement as a test was driven, at a steady rate from turn to turn: its gauge's noise is not steady.

A stiff machine makes newtons of a gauge's tenths of a micrometre: in a test that imposes displacements most of what
is not known of the forces is the gauge's noise. But a drive goes from turn to turn at a steady rate, or holds. What
a gauge reads beside straight lines in time is then its own noise, which is seen and need not be allowed for; what
remains of it are errors of the lines. Where the drive had gone so indeed, the forces would follow; they are asked.

A drive that goes by steps of its own may still hold: then this holds of the readings while it does.
This is regression with errors in a variable whose true values have a structure (Fuller 1987, Measurement error
models, §1.1 and 2.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.observation.significance import (
    CUT,
    FALSE_ALARMS,
    NOISE_KNOWN,
    NORMAL_95,
    chi2_isf,
    level,
    median_sigma,
)

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
        result: Array = straight + (self.moved * (read - straight).T).T
        return result

    def errors(self, rho: float) -> Array:
        """What is not known of the lines ``(n, s)``: independent errors of unit size, for noise of unit size.

        Args:
            rho: autocorrelation of neighbouring readings.
        """
        order = np.arange(len(self.sequence))
        together = self.sequence[:, None] == self.sequence
        R = np.where(together, rho ** np.abs(order[:, None] - order), 0.0)
        C = self.lines.T @ R @ self.lines
        result: Array = self.lines @ np.linalg.cholesky(C + 1e-12 * np.eye(len(C)))
        return result


def steady(
    sequence: np.ndarray, when: Array, read: Array, sigma: float, wrench: Array, noise: Array
) -> RampRegression | None:
    """The lines of a test that was driven steadily, or of its holds; None where its forces do not say so.

    Args:
        sequence: number ``(n,)`` of each reading's sequence.
        when: clock ``(n,)``, or the order of the readings.
        read: displacement ``(n,)`` as its gauge read it.
        sigma: of one such reading.
        wrench: forces and moments ``(n, 6)``, nan where there is none.
        noise: of one ``(6,)``.
    """
    if sigma <= 0.0 or np.bincount(sequence).max() > MOST:
        return None
    parts = pieces(sequence, when, read, sigma)
    holds = [(own, slanted) for own, slanted in parts if not slanted and len(own) >= LEAST]
    for known, asked in ((parts, [p for p in parts if p[1]]), (holds, holds)):
        found = _believed(known, asked, sequence, when, read, sigma, wrench / noise)
        if found is not None:
            return found
    return None


def steadiest(
    sequence: np.ndarray, times: Sequence[Array], read: Array, sigma: float, wrench: Array, noise: Array
) -> RampRegression | None:
    """The lines over the time, of several, over which they are the straightest; None where none is believed.

    A drive may go at a steady rate while readings are taken now and then, or by even steps that take their time:
    lines are then straight over the clock, or over the order of the readings. Over the other one they are only
    nearly so, and forces do not always tell.

    Args:
        sequence: number ``(n,)`` of each reading's sequence.
        times: a clock ``(n,)``, the order of the readings.
        read: displacement ``(n,)`` as its gauge read it.
        sigma: of one such reading.
        wrench: forces and moments ``(n, 6)``, nan where there is none.
        noise: of one ``(6,)``.
    """
    found = [steady(sequence, when, read, sigma, wrench, noise) for when in times]
    price = float(np.log(len(read))) * (1.0 + ASSUMED_AUTOCORRELATION) / (1.0 - ASSUMED_AUTOCORRELATION)

    def cost(path: RampRegression) -> tuple[bool, float]:
        off = (read - path.lines @ (path.lines.T @ read))[path.moved < 1.0] / sigma
        return not path.throughout, float(off @ off) + price * path.lines.shape[1]

    return min((path for path in found if path is not None), key=cost, default=None)


def pieces(sequence: np.ndarray, when: Array, read: Array, sigma: float) -> list[Piece]:
    """Readings between turns, and whether the displacement changes there.

    Of all cuts of a sequence the one with the least squares and the least price (Bellman's principle). A
    parameter's price is Schwarz's: the logarithm of the readings, times what an autocorrelation adds to a mean's
    variance. A sequence is always cut where the displacement passes zero: ramps to either side are programmed from
    there, and their rates differ.

    Args:
        sequence: number ``(n,)`` of each reading's sequence.
        when: clock ``(n,)``.
        read: displacement ``(n,)``.
        sigma: of one reading.
    """
    found: list[Piece] = []
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
        found += cuts[::-1]
    return found


def _sides(sequence: np.ndarray, read: Array, sigma: float) -> list[np.ndarray]:
    """Readings of each sequence on one side of zero, in order; those within noise of it are of the side before."""
    found = []
    for number in np.unique(sequence):
        own = np.flatnonzero(sequence == number)
        side = np.where(np.abs(read[own]) > level(len(own)) * sigma, np.sign(read[own]), 0.0)
        told = np.flatnonzero(side)
        turns = told[1:][side[told[1:]] != side[told[:-1]]]
        found += np.split(own, turns)
    return found


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
            there, known = ~np.isnan(f), ~np.isnan(all_f)
            if there.sum() < LEAST:
                continue
            stiffness = float(np.polyfit(read[steep][known], all_f[known], 1)[0])
            left = _beside(when[own][there], f[there])
            usual = max(median_sigma(left), 1.0)
            follow = stiffness * off[there]
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
    result: Array = values - Q @ (Q.T @ values)
    return result
