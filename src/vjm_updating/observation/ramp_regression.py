"""The displacement as a test was steered, at a steady rate from turn to turn: its gauge's noise is not steady.

A stiff machine makes newtons of a gauge's tenths of a micrometre: in a test that imposes displacements most of what
is not known of the forces is the gauge's noise. But a drive goes from turn to turn at a steady rate, or holds. What
a gauge reads beside straight lines in time is then its own noise, which is seen and need not be allowed for; what
remains of it are errors of the lines. Where the drive had gone so indeed, the forces would follow; they are asked.
This is regression with errors in a variable whose true values have a structure (Fuller 1987, Measurement error
models, §1.1 and 2.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from vjm.rotations import Array
from vjm_updating.observation.significance import CUT, FALSE_ALARMS, NOISE_KNOWN, NORMAL_95, level

MEMORY = 0.8
"""Autocorrelation of a gauge's neighbouring readings, at most."""
MOST = 2000
"""Readings of a sequence up to which lines are sought."""
BENT = 3
"""Order of the polynomials in time that forces may follow along a line, whatever the machine."""
FOLLOWED = 0.5
"""Share of what a gauge shows beside the lines that forces may follow at most."""


@dataclass(frozen=True)
class Steady:
    """Straight lines in time, from turn to turn.

    Attributes:
        lines: orthonormal basis ``(n, s)`` of displacements that are straight between the turns.
        sequence: number ``(n,)`` of each reading's sequence.
        moved: share of what the gauge reads beside the lines that the drive did move.
    """

    lines: Array
    sequence: np.ndarray
    moved: float

    def steered(self, read: Array) -> Array:
        """What the drive did ``(n, …)``, of a displacement as read; what a gauge's drift then adds to that."""
        straight = self.lines @ (self.lines.T @ read)
        result: Array = straight + self.moved * (read - straight)
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
) -> Steady | None:
    """The lines of a test that was steered steadily; None where its forces do not say so.

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
    share = _followed(parts, when, read, wrench / noise)
    if share is None or share >= FOLLOWED:
        return None
    found = Steady(basis(parts, when), sequence, share)
    beside = (read - found.lines @ (found.lines.T @ read)) / sigma
    # else it does something else than to be noisy
    squares = beside**2 / NOISE_KNOWN
    free = len(squares) * (1.0 - MEMORY**2) / (1.0 + MEMORY**2)
    regular = float(squares.max()) < level(len(squares)) ** 2
    return found if regular and float(squares.mean()) < float(chi2.isf(FALSE_ALARMS, free)) / free else None


def pieces(sequence: np.ndarray, when: Array, read: Array, sigma: float) -> list[tuple[np.ndarray, bool]]:
    """Readings between turns, and whether the displacement changes there.

    Of all ways to cut a sequence the one with the least squares and the least price (Bellman's principle). A
    parameter's price is Schwarz's: the logarithm of the readings, times what a memory adds to a mean's variance.

    Args:
        sequence: number ``(n,)`` of each reading's sequence.
        when: clock ``(n,)``.
        read: displacement ``(n,)``.
        sigma: of one reading.
    """
    found: list[tuple[np.ndarray, bool]] = []
    for number in np.unique(sequence):
        own = np.flatnonzero(sequence == number)
        t, u = when[own] - when[own[0]], read[own] / sigma
        t = t / max(float(t[-1]), 1e-300)
        m = len(t)
        powers = np.column_stack([np.ones(m), t, t * t, u, u * u, t * u])
        sums = np.vstack([np.zeros(6), np.cumsum(powers, axis=0)])
        price = float(np.log(m)) * (1.0 + MEMORY) / (1.0 - MEMORY)
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


def basis(parts: Sequence[tuple[np.ndarray, bool]], when: Array) -> Array:
    """Orthonormal columns ``(n, s)``: of every piece a level, and a slope where the displacement changes."""
    columns = []
    for own, slanted in parts:
        for k in range(2 if slanted else 1):
            column = np.zeros(len(when))
            column[own] = (when[own] - when[own].mean()) ** k
            columns.append(column / np.linalg.norm(column))
    return np.column_stack(columns)


def _followed(parts: Sequence[tuple[np.ndarray, bool]], when: Array, read: Array, forces: Array) -> float | None:
    """Share of what a gauge reads beside lines that forces ``(n, 6)``, over their noise, follow; None: untold."""
    followed = whole = unsure = 0.0
    for own, slanted in parts:
        if not slanted or len(own) < BENT + 3:
            continue
        off = _beside(when[own], read[own])
        for f in forces[own].T:
            there = ~np.isnan(f)
            if there.sum() < BENT + 3:
                continue
            stiffness = float(np.polyfit(read[own][there], f[there], 1)[0])
            left = _beside(when[own][there], f[there])
            usual = max(1.4826 * float(np.median(np.abs(left))), 1.0)
            follow = stiffness * off[there]
            followed += float(follow @ np.clip(left, -CUT * usual, CUT * usual))
            whole += float(follow @ follow)
            unsure += float(follow @ follow) * usual**2
    # where noise alone could be taken for that share, forces tell nothing
    if FOLLOWED * whole < NORMAL_95 * whole**0.5 or whole == 0.0:
        return None
    return followed / whole if followed > NORMAL_95 * unsure**0.5 else 0.0


def _beside(when: Array, values: Array) -> Array:
    """Values ``(m,)`` less a polynomial in time."""
    t = when - when.mean()
    Q, _ = np.linalg.qr(np.vander(t / np.abs(t).max(), BENT + 1))
    result: Array = values - Q @ (Q.T @ values)
    return result
