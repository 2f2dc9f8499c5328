"""Changes in the course of a file: the tracker's frame, a marker, the zero of a joint or of a load cell.

A series is cut at them: each part has what changed as numbers of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import assert_never

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.linalg import solve_triangular

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.inference.significance import (
    PairedGain,
    Worth,
    accident,
    median_sigma,
    more_than_noise,
    paired_gain,
)
from vjm_updating.poses.families import DRIVES, LOAD, ZEROS
from vjm_updating.poses.fit import factor_of, likeliest, places
from vjm_updating.poses.forward import BASE_PLACE, BASE_TURN, MARKER_FRAME, MARKER_PLACE
from vjm_updating.poses.pooled import PooledStudy, unknowns_of, zero_of
from vjm_updating.poses.state import FittedState, Hypothesis, folds_of
from vjm_updating.poses.study import TAIL, SeriesStudy, Study

DEGREE = numerical(3)
"""Of the polynomials of the row by which a quantity may change slowly."""
FEWEST = numerical(3)
"""Readings before and after a change, and between two."""
MADE_UP = numerical(1e-6)
"""Squared share of a step that what is fitted beside it leaves, below which this is rounding."""
RIDGE = numerical(1e-10)
"""Of a normal matrix with a diagonal of one."""
MOST = numerical(8)
"""Changes that are looked for."""
PEAKS = numerical(2)
"""Places of each kind that are looked at, and"""
CLOSELY = numerical(4)
"""of these, of all kinds, those that are fitted."""
ROUNDS, SETTLED = numerical(10), numerical(0.01)
"""Of the weights of Student's distribution; change of twice the logarithm of the likelihood that ends them."""


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
        study: the series in the course of which it is.
        kind: of what changes.
        name: of the marker, the joint or the point of load; else empty.
        where: number of the first posture after it.
        size: ``(d,)`` by how much: mm, of a tracker's frame rad too, of a zero rad or mm, of a load N and N mm.
        gain: of twice the logarithm of the likelihood, less what it costs.
        share: of the squared residual that it explains.
    """

    study: SeriesStudy
    kind: ChangeKind
    name: str
    where: int
    size: Array
    gain: float
    share: float


def changes(study: SeriesStudy, state: FittedState) -> list[ChangePoint]:
    """Changes that the readings show beside a state, in their order; none where that is not known.

    They are sought in readings of all three coordinates.
    """
    seen = np.asarray(np.isfinite(state.linearised.residual[..., :3]).all(axis=2))
    if not study.ordered or np.count_nonzero(seen.any(axis=1)) < 4 * FEWEST:
        return []
    search = _ChangeSearch(study, state, seen)
    steps = search.needed(search.grown([]))
    for _ in range(MOST):
        # what was hidden by one that has gone
        last, steps = steps, search.needed(search.grown(steps)) if steps else steps
        if steps == last:
            break
    if steps:
        search.count_alike(steps)
        steps = search.holding(search.needed(steps))
    return [search.change(steps, i) for i in np.argsort([where for _, where in steps])]


def _kinds(study: SeriesStudy, state: FittedState) -> Iterator[tuple[ChangeKind, str, Array]]:
    """Kinds, names and motions ``(g, k, 3, d)`` of the readings by what may change, per mm or rad."""
    linearised, markers = state.linearised, study.data.markers
    everything = np.broadcast_to(np.eye(3), (*linearised.residual.shape[:2], 3, 3))
    yield ChangeKind.SHIFT, "", everything
    if study.turns_with_tracker:
        yield ChangeKind.FRAME, "", np.concatenate([everything, linearised.nuisance[..., :3, :3]], axis=3)
        for i, marker in enumerate(markers):
            own = np.zeros_like(everything)
            own[:, i] = linearised.nuisance[:, i, :3, 6 + 3 * i : 9 + 3 * i]
            yield ChangeKind.MARKER, marker, own
    # a zero of the displacements is the shift above
    zeros = [(i, m) for i, m in enumerate(study.members) if m.set_anew]
    for family, kind in (("joint_offset", ChangeKind.JOINT_ZERO), ("instrument_zero", ChangeKind.LOAD_ZERO)):
        for subject in dict.fromkeys(m.subject for _, m in zeros if m.family == family):
            members = [i for i, m in zeros if m.family == family and m.subject == subject]
            yield kind, subject, linearised.member[..., :3, members] / [study.members[i].scale for i in members]


class _ChangeSearch:
    """Readings, what is fitted to them in any case, and the motions by what may change."""

    def __init__(self, study: SeriesStudy, state: FittedState, seen: np.ndarray) -> None:
        self.study, self.posture = study, np.nonzero(seen)[0]
        n, P = state.blocks.nuisances, len(study.members)
        drives = [n + i for i, m in enumerate(study.members) if m.family == DRIVES]
        changing = np.union1d(state.solution.active, np.array(drives, dtype=int))
        # a zero that is off in all of the file is no change, though a step near its beginning is nearly the same
        zeros = [n + i for i, m in enumerate(study.members) if m.family in ZEROS]
        own = np.union1d(changing, np.array(zeros, dtype=int))
        members = changing[changing >= n]
        J = np.concatenate([state.linearised.nuisance, state.linearised.member], axis=3)[..., :3, :][seen]
        course = np.linspace(-1.0, 1.0, len(study.data))[self.posture][:, None, None]
        y = state.linearised.residual[..., :3][seen]
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
        self.off = np.zeros(len(self.root))
        self.off[: len(own)] = -state.solution.z[own] * (own >= n)
        self.kinds = [(kind, name, E[seen] / sigma[..., None]) for kind, name, E in _kinds(study, state)]
        self.count, self.q = len(study.data), study.data.q
        slowly = legvander(np.linspace(-1.0, 1.0, self.count), DEGREE)[:, 1:]
        self.slow: Array = np.asarray(slowly[self.posture], dtype=float)
        self._without: dict[tuple[tuple[tuple[int, int], ...], int], _Fit] = {}
        turning = np.array([name in study.machine.turning for name in study.data.joints])
        self.places, self.marker = places(study.data.q, turning), np.nonzero(seen)[1]
        self.factors: list[tuple[np.ndarray, Array]] = []

    def grown(self, steps: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Kinds and places of changes, each the best beside the others, more than those that are known.

        Readings count as independent here, for one of several changes alone explains little; see `needed`.
        """
        while len(steps) < MOST and (best := self._best(steps)) is not None:
            steps = sorted([*steps, best], key=lambda one: one[1])
            new = steps.index(best)
            steps = self._anew(steps, range(max(new - 1, 0), min(new + 2, len(steps))))
        return steps

    def _anew(self, steps: list[tuple[int, int]], which: Iterable[int]) -> list[tuple[int, int]]:
        """Changes, some of them sought anew beside the others."""
        result = list(steps)
        for i in which:
            result[i] = self._best(result[:i] + result[i + 1 :]) or result[i]
        return result

    def needed(self, steps: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Of changes those that are worth their cost beside the others."""
        while steps:
            worth = [self._gain(steps[:i] + steps[i + 1 :], one) for i, one in enumerate(steps)]
            if min(worth) > 0.0:
                break
            least = int(np.argmin(worth))
            steps = steps[:least] + steps[least + 1 :]
            if not self.factors:
                steps = self._anew(steps, range(len(steps)))
        return steps

    def count_alike(self, steps: list[tuple[int, int]]) -> None:
        """Make readings of like postures independent, which are correlated as far as what changes leave is."""
        fit = self._fit([self._step(*one) for one in steps])
        left = fit.left * np.sqrt(fit.weight)[:, None]
        markers = [np.flatnonzero(self.marker == k) for k in np.unique(self.marker)]
        groups = [(left[own].T, self.places[self.posture[own]]) for own in markers]
        share, reach = likeliest(groups)
        if share:
            self.factors = [(own, factor_of(x, share, reach)) for own, (_, x) in zip(markers, groups, strict=True)]
            self.y, self.base = self._independent_of(self.y[..., None])[..., 0], self._independent_of(self.base)
            self._without.clear()

    def holding(self, steps: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Of changes those that hold in all regions of their part; all of them where they leave noise alone."""
        steps = sorted(steps, key=lambda one: one[1])
        while steps:
            left = self._fit([self._step(*one) for one in steps]).left
            if not more_than_noise(median_sigma(left) / self.least**0.5, left.size):
                break
            failed = {}
            for i in range(len(steps)):
                gain = self._by_region(steps, i)
                if gain is not None and gain.worth is not Worth.BETTER:
                    failed[i] = gain.mean
            if not failed:
                break
            steps.pop(min(failed, key=lambda i: failed[i]))
        return steps

    def _by_region(self, steps: list[tuple[int, int]], i: int) -> PairedGain | None:
        """What a change saves of the errors in the shorter part beside it, each region predicted by the others."""
        kind, where = steps[i]
        ends = [0, *(one for _, one in steps), self.count]
        parts = (slice(ends[i], where), slice(where, ends[i + 2]))
        part = min(parts, key=lambda one: one.stop - one.start)
        block = np.full(self.count, -1)
        block[part] = folds_of(self.q[part], {}).region
        others = self._beside(steps[:i] + steps[i + 1 :], kind)
        step = self._step(kind, where)
        weight = self._fit([*others, step]).weight
        errors = [self._predicted(columns, weight, block[self.posture]) for columns in (others, [*others, step])]
        return paired_gain(errors[0][:, None], errors[1][:, None], block[self.posture], weight[:, None])

    def _predicted(self, columns: list[Array], weight: Array, block: np.ndarray) -> Array:
        """Errors ``(r,)`` of readings whose block is no −1, predicted without the block; nan of others."""
        result = np.full(len(self.y), np.nan)
        for k in range(int(block.max()) + 1):
            held = block == k
            left = self._fit(columns, np.where(held, 0.0, weight), rounds=1).left
            result[held] = np.linalg.norm(left[held], axis=1)
        return result

    def _independent_of(self, columns: Array) -> Array:
        """Columns ``(r, 3, n)`` of readings made independent."""
        result = columns.copy()
        for own, L in self.factors:
            result[own] = solve_triangular(L, columns[own].reshape(len(own), -1), lower=True).reshape(
                len(own), 3, -1
            )
        return result

    def change(self, steps: list[tuple[int, int]], i: int) -> ChangePoint:
        """One of the changes that were found, with its size beside the others."""
        kind, where = steps[i]
        columns = [self._step(*one) for one in steps]
        fit = self._fit(columns)
        first = self.base.shape[2] + sum(c.shape[2] for c in columns[:i])
        gain = self._gain(steps[:i] + steps[i + 1 :], steps[i])
        # of the size that the likelihood gives the residual with and without it
        less = self._fit([*columns[:i], *columns[i + 1 :]]).twice_log - fit.twice_log
        share = 1.0 - float(np.exp(min(less, 0.0) / (3 * len(self.y))))
        size = fit.z[first : first + columns[i].shape[2]]
        return ChangePoint(self.study, *self.kinds[kind][:2], where, size, gain, share)

    def _step(self, kind: int, where: int) -> Array:
        return self.kinds[kind][2] * (self.posture >= where)[:, None, None]

    def _beside(self, steps: list[tuple[int, int]], kind: int) -> list[Array]:
        """Columns beside a change of a kind: those of others, and of the same numbers that change slowly."""
        E = self.kinds[kind][2]
        slowly: Array = (E[..., None] * self.slow[:, None, None, :]).reshape(*E.shape[:2], -1)
        return [*(self._step(*one) for one in steps), slowly]

    def _fit_without(self, steps: list[tuple[int, int]], kind: int) -> _Fit:
        """The fit of `_beside`."""
        key = (tuple(steps), kind)
        if key not in self._without:
            self._without[key] = self._fit(self._beside(steps, kind))
        return self._without[key]

    def _cost(self, kind: int) -> float:
        d = self.kinds[kind][2].shape[2]
        return d * float(np.log(3 * len(self.y))) + 2.0 * float(np.log(self.count * len(self.kinds))) + accident()

    def _best(self, steps: list[tuple[int, int]]) -> tuple[int, int] | None:
        """The change that is worth the most beside others; none where no place that may have one is worth its cost.

        Such places are those where a step takes most of the residual, with the weights of Student's distribution,
        and without any. For several changes in a file hide one another.
        """
        weighted: list[tuple[float, tuple[int, int]]] = []
        plain: list[tuple[float, tuple[int, int]]] = []
        for kind in range(len(self.kinds)):
            columns = self._beside(steps, kind)
            numbers = self.base.shape[2] + sum(one.shape[2] for one in (*columns, self.kinds[kind][2]))
            if numbers >= 3 * len(self.y):
                continue
            fit = self._fit_without(steps, kind)
            share = 1.0 / fit.spread
            for tried, weight in ((weighted, fit.weight), (plain, np.ones_like(fit.weight))):
                gains = share * self._gains(kind, columns, weight, fit.left) - self._cost(kind)
                for _, one in steps:
                    gains[max(one - FEWEST + 1, 0) : one + FEWEST] = 0.0
                for _ in range(PEAKS):
                    where = int(np.argmax(gains))
                    if gains[where] <= 0.0:
                        break
                    tried.append((float(gains[where]), (kind, where)))
                    gains[max(where - FEWEST + 1, 0) : where + FEWEST] = 0.0
        best = [one for tried in (weighted, plain) for _, one in sorted(tried, reverse=True)[:CLOSELY]]
        worth = {one: self._likelier(steps, one)[0] - self._cost(one[0]) for one in dict.fromkeys(best)}
        if not worth:
            return None
        kind, where = max(worth, key=lambda one: worth[one])
        last = -1
        while last != where:
            # weights that rows of the wrong side of a change have hide its place
            last = where
            free = [w for w in range(where - FEWEST, where + FEWEST + 1) if self._may_be(w, steps)]
            new = [(kind, w) for w in free if (kind, w) not in worth]
            worth |= {one: self._likelier(steps, one)[0] - self._cost(kind) for one in new}
            where = max([where, *free], key=lambda w: worth[kind, w])
        return (kind, where) if worth[kind, where] > 0.0 else None

    def _may_be(self, where: int, steps: list[tuple[int, int]]) -> bool:
        """Whether a change may be at a posture: not too near to the ends and to other changes."""
        apart = all(abs(where - one) >= FEWEST for _, one in steps)
        return apart and FEWEST <= where <= self.count - FEWEST

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
        places = slice(FEWEST, self.count - FEWEST + 1)
        G, H, v = np.split(after[places], [q * d, q * d + d * d], axis=1)
        G, H = G.reshape(-1, q, d), H.reshape(-1, d, d)
        M = H - np.swapaxes(G, 1, 2) @ G
        scale = 1.0 / np.sqrt(np.maximum(np.diagonal(H, axis1=1, axis2=2), np.finfo(float).tiny))
        M, v = M * scale[:, :, None] * scale[:, None, :], v * scale
        gains = np.zeros(self.count)
        size, axes = np.linalg.eigh(M)
        # what the base makes up says nothing
        inverse = np.where(size > MADE_UP, 1.0 / np.maximum(size, MADE_UP), 0.0)
        gains[places] = np.einsum("cd,cd->c", inverse, np.einsum("cde,cd->ce", axes, v) ** 2)
        return gains

    def _gain(self, steps: list[tuple[int, int]], new: tuple[int, int]) -> float:
        """Twice the logarithm of the likelihood that a change adds beside others, less its cost."""
        likelier, fit = self._likelier(steps, new)
        return likelier * fit.too_small * self._independent(fit.left) - self._cost(new[0])

    def _likelier(self, steps: list[tuple[int, int]], new: tuple[int, int]) -> tuple[float, _Fit]:
        """Twice the logarithm of the likelihood of independent readings that a change adds, and the fit with it."""
        without = self._fit_without(steps, new[0])
        fit = self._fit([*self._beside(steps, new[0]), self._step(*new)], without.weight)
        return fit.twice_log - without.twice_log, fit

    def _independent(self, left: Array) -> float:
        """Share of the readings that are independent, by how far residuals lie from those one and two before them.

        Of a first-order process the second squared distance is 1 + ρ times the first; changes are in few of either.
        """
        one, two = (float(np.median(np.sum((left[k:] - left[:-k]) ** 2, axis=1))) for k in (1, 2))
        rho = min(max(two / max(one, np.finfo(float).tiny) - 1.0, 0.0), 1.0)
        return (1.0 - rho) / (1.0 + rho)

    def _fit(self, columns: list[Array], weight: Array | None = None, rounds: int = ROUNDS) -> _Fit:
        """The most probable fit of columns beside the base under Student's distribution, from given weights on."""
        r = len(self.y)
        own = [self._independent_of(np.concatenate(columns, axis=2))] if columns else []
        A = np.concatenate([self.base, *own], axis=2).reshape(3 * r, -1)
        root2, off = np.zeros(A.shape[1]), np.zeros(A.shape[1])
        root2[: len(self.root)], off[: len(self.root)] = self.root**2, self.root**2 * self.off
        w, spread, last, y = np.ones(r) if weight is None else weight, 1.0, -np.inf, self.y.reshape(-1)
        for _ in range(rounds):
            by = np.sqrt(np.repeat(w, 3))
            X = A * by[:, None]
            N = X.T @ X
            N[np.diag_indices_from(N)] += root2 * spread
            scale = 1.0 / np.sqrt(np.maximum(np.diag(N), np.finfo(float).tiny))
            N = N * np.outer(scale, scale)
            N[np.diag_indices_from(N)] += RIDGE
            z = np.linalg.solve(N, scale * (X.T @ (y * by) + off * spread)) * scale
            left = (y - A @ z).reshape(r, 3)
            square = np.sum(left**2, axis=1)
            mean = float(np.sum(w * square) / (3 * r))
            spread = max(mean, self.least)
            w = (TAIL + 3.0) / (TAIL + square / spread)
            now = -(TAIL + 3.0) * float(np.sum(np.log1p(square / spread / TAIL))) - 3 * r * float(np.log(spread))
            if abs(now - last) < SETTLED:
                break
            last = now
        # numbers that are fitted take up as many readings, those with a prior their share; they leave less
        fitted = len(z) - float(np.sum(root2 * spread * scale**2 * np.diag(np.linalg.inv(N))))
        unbiased = mean / max(1.0 - fitted / (3 * r), np.finfo(float).tiny)
        return _Fit(now, z, w, left, spread, spread / max(unbiased, self.least))


@dataclass(frozen=True)
class _Fit:
    """A fit.

    Attributes:
        twice_log: twice the logarithm of Student's likelihood.
        z: ``(p,)`` numbers.
        weight: ``(r,)`` of Student's distribution.
        left: ``(r, 3)`` residual.
        spread: its variance.
        too_small: this variance over that without bias, at most one.
    """

    twice_log: float
    z: Array
    weight: Array
    left: Array
    spread: float
    too_small: float


READINGS = numerical(2.0)
"""Numbers that a part has to have for each unknown of its own; of fewer it says nothing of the machine."""


def found_changes(study: Study, state: FittedState) -> list[ChangePoint]:
    """Changes in the course of each series; none of a test that was cut.

    A series of several is fitted alone, by the families of the state.
    """
    if not isinstance(study, PooledStudy):
        return [change for one in study.groups for change in changes(one, state)]
    series_changes = []
    for one in study.tests:
        if one.ordered:
            families = tuple(name for name in state.hypothesis.families if name in one.families)
            alone = one.gauss_newton(Hypothesis(families, state.hypothesis.as_deflected))
            series_changes += changes(one, alone)
    return series_changes


def cut(study: Study, series_changes: Sequence[ChangePoint]) -> tuple[Study, list[tuple[int, int]]]:
    """The test with its series cut at the changes: a part has what changed as its own, and the rest as before.

    Parts with too few readings are left out. It is the same test where no part has enough.

    Returns:
        The test; first and last row of each part that was left out.
    """
    tests = study.tests if isinstance(study, PooledStudy) else study.groups
    groups, series, anew, left_out = [], [], [], []
    for number, one in enumerate(tests):
        own = [change for change in series_changes if change.study is one]
        changed: set[str] = set()
        for first, last in pairwise([0, *sorted({c.where for c in own}), len(one.data)]):
            for change in own:
                if change.where == first:
                    changed.update(changed_by(change))
            part = _part(one, first, last)
            if part is None:
                left_out.append((int(one.data.row[first]), int(one.data.row[last - 1])))
            else:
                groups.append(part)
                series.append(number)
                anew.append(tuple(changed))
                changed = set()
    if not groups or not series_changes:
        return study, []
    return (groups[0] if len(groups) == 1 else PooledStudy(groups, series, anew)), left_out


def changed_by(change: ChangePoint) -> list[str]:
    """Names of the nuisances and zeros that a change changes, see `vjm_updating.poses.pooled.unknowns_of`."""
    study = change.study
    zeros = [m for m in study.members if m.set_anew]
    match change.kind:
        case ChangeKind.SHIFT:
            if study.turns_with_tracker:
                return [BASE_PLACE]
            # no unknown of displacements shifts them all: anything may have changed
            return [name for name, _ in unknowns_of(study.forward(), zeros)]
        case ChangeKind.FRAME:
            return [BASE_TURN, BASE_PLACE]
        case ChangeKind.MARKER:
            return [f"{MARKER_PLACE} {change.name}", f"{MARKER_FRAME} {change.name}"]
        case ChangeKind.JOINT_ZERO:
            return [zero_of(m) for m in zeros if m.family == "joint_offset" and m.subject == change.name]
        case ChangeKind.LOAD_ZERO:
            return [zero_of(m) for m in zeros if m.kind == LOAD and m.subject == change.name]
        case _:
            assert_never(change.kind)


def _part(study: SeriesStudy, first: int, last: int) -> SeriesStudy | None:
    """Some neighbouring readings of a test; None where they are too few for frames and zeros of their own."""
    if (first, last) == (0, len(study.data)):
        return study
    seen = int(study.present[first:last].sum())
    unknowns = study.forward().nuisances + sum(m.set_anew for m in study.members)
    if seen < READINGS * unknowns:
        return None
    keep = np.arange(first, last)
    return type(study)(study.sheet, study.machine, study.data.only(keep), study.outliers)
