"""Changes in the course of a file: the tracker's frame, a marker, the zero of a joint or of a load cell.

From a row on readings lie off by what a few numbers say: six of the tracker, three of a marker, one of a zero. They
are looked for one after another by the likelihood of Student's distribution, which a single outlier does not
carry. What changes slowly is no change. So beside every step stand a cubic of the row, of the same numbers, and an
even change of all that was fitted. A step counts where it makes the readings likelier by more than its numbers, its
place and its kind cost.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.polynomial.legendre import legvander

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.observation.significance import accident
from vjm_updating.poses.families import DRIVES, ZEROS
from vjm_updating.poses.state import FittedState
from vjm_updating.poses.study import TAIL, Study

DEGREE = numerical(3)
"""Of the polynomials of the row by which a quantity may change slowly."""
FEWEST = numerical(3)
"""Readings before and after a change, and between two."""
RIDGE = numerical(1e-10)
"""Of a normal matrix with a diagonal of one."""
MOST = numerical(8)
"""Changes that are looked for."""
PEAKS = numerical(2)
"""Places of each kind that are looked at closely."""
ROUNDS = numerical(6)
"""Of the weights of Student's distribution."""


class ChangeKind(StrEnum):
    """What changes: all readings along the axes of the file, these with a turn, a marker on its body, a zero."""

    SHIFT = "shift"
    FRAME = "tracker frame"
    MARKER = "marker"
    JOINT_ZERO = "joint zero"
    LOAD_ZERO = "load zero"


@dataclass(frozen=True)
class ChangePoint:
    """A change.

    Attributes:
        kind: of what changes.
        name: of the marker, the joint or the point of load; else empty.
        where: number of the first posture after it.
        size: ``(d,)`` by how much: mm, of a tracker's frame rad too, of a zero rad or mm, of a load N and N mm.
        gain: of twice the logarithm of the likelihood, less what it costs.
        share: of the squared residual that it explains.
    """

    kind: ChangeKind
    name: str
    where: int
    size: Array
    gain: float
    share: float


def changes(study: Study, state: FittedState) -> list[ChangePoint]:
    """Changes that the readings show beside a state, in their order; none where that is not known.

    They are sought in readings of all three coordinates.
    """
    whole = np.asarray(np.isfinite(state.at.residual[..., :3]).all(axis=2))
    if not study.ordered or np.count_nonzero(whole.any(axis=1)) < 4 * FEWEST:
        return []
    search = _ChangeSearch(study, state)
    found = search.grown()
    return [search.change(found, i) for i in np.argsort([where for _, where in found])]


def _kinds(study: Study, state: FittedState) -> Iterator[tuple[ChangeKind, str, Array]]:
    """Kinds, names and motions ``(g, k, 3, d)`` of the readings by what may change, per mm or rad."""
    at, markers = state.at, study.data.markers
    everything = np.broadcast_to(np.eye(3), (*at.residual.shape[:2], 3, 3))
    yield ChangeKind.SHIFT, "", everything
    if study.turns_with_tracker:
        yield ChangeKind.FRAME, "", np.concatenate([everything, at.nuisance[..., :3, :3]], axis=3)
        for i, marker in enumerate(markers):
            own = np.zeros_like(everything)
            own[:, i] = at.nuisance[:, i, :3, 6 + 3 * i : 9 + 3 * i]
            yield ChangeKind.MARKER, marker, own
    for family, kind in (("joint_offset", ChangeKind.JOINT_ZERO), ("instrument_zero", ChangeKind.LOAD_ZERO)):
        for subject in dict.fromkeys(m.subject for m in study.members if m.family == family):
            members = [i for i, m in enumerate(study.members) if m.family == family and m.subject == subject]
            yield kind, subject, at.member[..., :3, members] / [study.members[i].scale for i in members]


class _ChangeSearch:
    """Readings, what is fitted to them in any case, and the motions by what may change."""

    def __init__(self, study: Study, state: FittedState) -> None:
        seen = np.isfinite(state.at.residual[..., :3]).all(axis=2)
        self.posture = np.nonzero(seen)[0]
        n, P = state.blocks.nuisances, len(study.members)
        drives = [n + i for i, m in enumerate(study.members) if m.family == DRIVES]
        changing = np.union1d(state.solution.active, np.array(drives, dtype=int))
        # a zero that is off in all of the file is no change, though a step near its beginning is nearly the same
        zeros = [n + i for i, m in enumerate(study.members) if m.family in ZEROS]
        own = np.union1d(changing, np.array(zeros, dtype=int))
        members = changing[changing >= n]
        J = np.concatenate([state.at.nuisance, state.at.member], axis=3)[..., :3, :][seen]
        course = np.linspace(-1.0, 1.0, len(study.data))[self.posture][:, None, None]
        y = state.at.residual[..., :3][seen]
        sigma = state.sigma[..., :3][seen] * np.sqrt(state.weight[seen])[:, None]
        self.y = y / sigma
        # readings do not scatter less than their instruments do
        self.least = float(np.median((study.stated()[..., :3][seen] / sigma) ** 2))
        # members, zeros, drives of either sign, and members that change evenly in the course of the file
        self.base = np.concatenate([J[..., own], course * J[..., members]], axis=2) / sigma[..., None]
        sizes = np.ones(n + P)
        for family, size in state.solution.sizes.items():
            sizes[state.blocks.family == family] = max(size, 1.0)
        self.root = np.concatenate([np.where(own < n, 1e-9, 1.0 / sizes[own]), 1.0 / sizes[members]])
        self.off = np.concatenate([-state.solution.z[own] * (own >= n), np.zeros(len(members))])
        self.kinds = [(kind, name, E[seen] / sigma[..., None]) for kind, name, E in _kinds(study, state)]
        self.count = len(study.data)
        slowly = legvander(np.linspace(-1.0, 1.0, self.count), DEGREE)[:, 1:]
        self.slow: Array = np.asarray(slowly[self.posture], dtype=float)
        self._without: dict[tuple[tuple[tuple[int, int], ...], int], float] = {}

    def grown(self) -> list[tuple[int, int]]:
        """Kinds and places of changes, each the best beside the others."""
        found: list[tuple[int, int]] = []
        while len(found) < MOST and (best := self._best(found)) is not None:
            found.append(best)
            for i in range(len(found)):
                others = found[:i] + found[i + 1 :]
                found[i] = self._best(others) or found[i]
        # what one beside it has made needless
        while found:
            worth = [self._gain(found[:i] + found[i + 1 :], one) for i, one in enumerate(found)]
            if min(worth) > 0.0:
                break
            del found[int(np.argmin(worth))]
        return found

    def change(self, found: list[tuple[int, int]], i: int) -> ChangePoint:
        """One of the changes that were found, with its size beside the others."""
        kind, where = found[i]
        columns = [self._step(*one) for one in found]
        z = self._fit(columns)[1]
        first = self.base.shape[2] + sum(c.shape[2] for c in columns[:i])
        gain = self._gain(found[:i] + found[i + 1 :], found[i])
        # of the size that the likelihood gives the residual with and without it
        less = self._fit([*columns[:i], *columns[i + 1 :]])[0] - self._fit(columns)[0]
        share = 1.0 - float(np.exp(min(less, 0.0) / (3 * len(self.y))))
        return ChangePoint(*self.kinds[kind][:2], where, z[first : first + columns[i].shape[2]], gain, share)

    def _step(self, kind: int, where: int) -> Array:
        result: Array = self.kinds[kind][2] * (self.posture >= where)[:, None, None]
        return result

    def _slow(self, kind: int) -> Array:
        E = self.kinds[kind][2]
        result: Array = (E[..., None] * self.slow[:, None, None, :]).reshape(*E.shape[:2], -1)
        return result

    def _cost(self, kind: int) -> float:
        d = self.kinds[kind][2].shape[2]
        return d * float(np.log(3 * len(self.y))) + 2.0 * float(np.log(self.count * len(self.kinds))) + accident()

    def _best(self, found: list[tuple[int, int]]) -> tuple[int, int] | None:
        """The change that is worth the most beside others; none where no place that may have one is worth its cost.

        Such places are those where a step takes most of the residual, with the weights of Student's distribution,
        and without any. For several changes in a file hide one another.
        """
        steps, tried = [self._step(*one) for one in found], []
        for kind in range(len(self.kinds)):
            columns = [*steps, self._slow(kind)]
            numbers = self.base.shape[2] + sum(one.shape[2] for one in (*columns, self.kinds[kind][2]))
            if numbers >= 3 * len(self.y):
                continue
            w, left = self._fit(columns)[2:]
            for weight in (w, np.ones_like(w)):
                gains = self._gains(kind, columns, weight, left)
                for _, one in found:
                    gains[max(one - FEWEST + 1, 0) : one + FEWEST] = 0.0
                for _ in range(PEAKS):
                    where = int(np.argmax(gains))
                    if gains[where] <= 0.0:
                        break
                    tried.append((kind, where))
                    gains[max(where - FEWEST + 1, 0) : where + FEWEST] = 0.0
        worth = {one: self._gain(found, one) for one in dict.fromkeys(tried)}
        best = max(worth, key=lambda one: worth[one], default=None)
        return best if best is not None and worth[best] > 0.0 else None

    def _gains(self, kind: int, columns: list[Array], w: Array, left: Array) -> Array:
        """Squared residual ``(g,)`` that a step of a kind from each posture on takes, at given weights."""
        root = np.sqrt(w)[:, None, None]
        A = np.concatenate([self.base, *columns], axis=2) * root
        E, y = self.kinds[kind][2] * root, left * root[..., 0]
        Q = np.linalg.qr(A.reshape(-1, A.shape[2]))[0].reshape(A.shape)
        d = E.shape[2]
        own = (np.einsum("raq,rad->rqd", Q, E), np.einsum("rae,rad->red", E, E), np.einsum("rad,ra->rd", E, y))
        parts = np.concatenate([one.reshape(len(E), -1) for one in own], axis=1)
        by = np.zeros((self.count + 1, parts.shape[1]))
        np.add.at(by, self.posture, parts)
        after = np.cumsum(by[::-1], axis=0)[::-1]
        q = A.shape[2]
        G, H, v = np.split(after, [q * d, q * d + d * d], axis=1)
        G, H = G.reshape(-1, q, d), H.reshape(-1, d, d)
        gains = np.zeros(self.count)
        for c in range(FEWEST, self.count - FEWEST + 1):
            M = H[c] - G[c].T @ G[c]
            scale = 1.0 / np.sqrt(np.maximum(np.diag(H[c]), np.finfo(float).tiny))
            M = M * np.outer(scale, scale)
            gains[c] = float(v[c] * scale @ np.linalg.lstsq(M, v[c] * scale, rcond=1e-6)[0])
        return gains

    def _gain(self, found: list[tuple[int, int]], new: tuple[int, int]) -> float:
        """Twice the logarithm of the likelihood that a change adds beside others, less its cost."""
        columns = [*(self._step(*one) for one in found), self._slow(new[0])]
        key = (tuple(found), new[0])
        if key not in self._without:
            self._without[key] = self._fit(columns)[0]
        without = self._without[key]
        with_it, _, _, left = self._fit([*columns, self._step(*new)])
        return (with_it - without) * self._independent(left) - self._cost(new[0])

    def _independent(self, left: Array) -> float:
        """Share of the readings that are independent, by how far residuals lie from those one and two before them.

        Of a first-order process the second squared distance is 1 + ρ times the first; changes are in few of either.
        """
        one, two = (float(np.median(np.sum((left[k:] - left[:-k]) ** 2, axis=1))) for k in (1, 2))
        rho = min(max(two / max(one, np.finfo(float).tiny) - 1.0, 0.0), 1.0)
        return (1.0 - rho) / (1.0 + rho)

    def _fit(self, columns: list[Array]) -> tuple[float, Array, Array, Array]:
        """Twice the logarithm of Student's likelihood by columns beside the base, numbers, weights, residual."""
        A = np.concatenate([self.base, *columns], axis=2)
        r, p = len(self.y), A.shape[2]
        root = np.concatenate([self.root, np.full(p - len(self.root), 0.0)])
        off = np.concatenate([self.off * self.root, np.zeros(p - len(self.root))])
        w, spread = np.ones(r), 1.0
        for _ in range(ROUNDS):
            by = np.sqrt(w)[:, None, None]
            X = np.vstack([(A * by).reshape(3 * r, p), np.diag(root) * np.sqrt(spread)])
            scale = 1.0 / np.maximum(np.linalg.norm(X, axis=0), np.finfo(float).tiny)
            t = np.concatenate([(self.y * by[..., 0]).reshape(-1), off * np.sqrt(spread)])
            N = (X * scale).T @ (X * scale) + RIDGE * np.eye(p)
            z = np.linalg.solve(N, (X * scale).T @ t) * scale
            left = self.y - A @ z
            square = np.sum(left**2, axis=1)
            spread = max(float(np.sum(w * square) / (3 * r)), self.least)
            w = (TAIL + 3.0) / (TAIL + square / spread)
        log_likelihood = -(TAIL + 3.0) * float(np.sum(np.log1p(square / spread / TAIL))) - 3 * r * np.log(spread)
        return log_likelihood, z, w, left
