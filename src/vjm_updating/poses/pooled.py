"""Several series of one machine in one fit.

Also how far its numbers scatter between series, and what is known of a new one.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from vjm.io.provenance import digest
from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.poses.families import COMPLIANCE, DRIFT, ZEROS, FamilyParameter
from vjm_updating.poses.fit import NormalEquations, scaled, solve
from vjm_updating.poses.forward import (
    BASE_PLACE,
    BASE_TURN,
    MARKER_FRAME,
    MARKER_PLACE,
    Frames,
    Linearised,
    ReadingsForward,
    SeriesForward,
)
from vjm_updating.poses.measurement import PoseData
from vjm_updating.poses.state import Candidates, FittedState, Folds, Hypothesis, folds_of
from vjm_updating.poses.study import (
    EXACT,
    TAIL,
    Ranges,
    SeriesStudy,
    Study,
    check_same_machine,
    knowable,
    law_shape,
)

ZERO_BETWEEN = prior_scale(1.0)
"""Of their units, 1 mrad, 0.1 mm or a hundredth of the largest load: how far zeros of a series lie off those that
all series share, beforehand. A joint is mastered to about a milliradian. Readings tell more."""


REFIT = numerical(0.25)
"""Share of a group's readings, about, that have to be left to tell its frames and zeros where others are out."""


@dataclass(frozen=True)
class PooledFrames(Frames):
    """The nuisances of all groups; those of the first one in the place of a single test's.

    Attributes:
        groups: frames of each group.
        zeros: of each group what its zeros are off the shared ones ``(n,)``, in the members' units.
    """

    groups: tuple[Frames, ...]
    zeros: tuple[Array, ...]

    @classmethod
    def of(cls, groups: Sequence[Frames], zeros: Sequence[Array]) -> PooledFrames:
        """Frames of groups as one."""
        return cls(**vars(groups[0]), groups=tuple(groups), zeros=tuple(zeros))


@dataclass(frozen=True)
class GroupForward:
    """The model of a group's readings.

    Attributes:
        forward: with the group's own members.
        member: numbers ``(p,)`` of these among the shared ones.
        zero: places ``(n,)`` among its own members of the zeros that are not the same in all groups.
        column: numbers ``(f + n,)`` of its own nuisances and zeros among those of all groups.
        rows: of the pooled readings.
        markers: numbers ``(k,)`` among the pooled markers.
    """

    forward: SeriesForward
    member: np.ndarray
    zero: np.ndarray
    column: np.ndarray
    rows: slice
    markers: np.ndarray


class PooledForward(ReadingsForward):
    """The model of the readings of all groups."""

    def __init__(
        self, groups: Sequence[GroupForward], members: list[FamilyParameter], markers: int, names: list[str]
    ) -> None:
        self.groups, self.members, self._markers, self._names = tuple(groups), members, markers, names

    def nuisance_names(self) -> list[str]:
        """What each is, for people."""
        return self._names

    def evaluate(self, z: Array, frames: Frames) -> Linearised:
        """See `ReadingsForward`."""
        assert isinstance(frames, PooledFrames)
        evaluated = []
        for one, own, zeros in zip(self.groups, frames.groups, frames.zeros, strict=True):
            sizes = z[one.member]
            sizes[one.zero] += zeros
            evaluated.append(one.forward.evaluate(sizes, own))
        g, k = self.groups[-1].rows.stop, self._markers
        joints = evaluated[0].torque.shape[1]
        residual, tilt = np.full((g, k, 6), np.nan), np.zeros((g, k, 6, 3))
        F, J = np.zeros((g, k, 6, self.nuisances)), np.zeros((g, k, 6, len(self.members)))
        torque, off = np.zeros((g, joints)), np.zeros(self.nuisances)
        for one, linearised, zeros in zip(self.groups, evaluated, frames.zeros, strict=True):
            residual[one.rows, one.markers], tilt[one.rows, one.markers] = linearised.residual, linearised.tilt
            nuisance = np.concatenate([linearised.nuisance, linearised.member[..., one.zero]], axis=3)
            F[one.rows, one.markers] = _spread(nuisance, one.column, self.nuisances)
            J[one.rows, one.markers] = _spread(linearised.member, one.member, len(self.members))
            torque[one.rows] = linearised.torque
            off[one.column] = np.concatenate([linearised.off, zeros])
        return Linearised(residual, F, J, torque, off, tilt)

    def moved(self, frames: Frames, step: Array) -> Frames:
        """See `ReadingsForward`."""
        assert isinstance(frames, PooledFrames)
        groups, zeros_ = [], []
        for one, own, zeros in zip(self.groups, frames.groups, frames.zeros, strict=True):
            of_frames, of_zeros = np.split(step[one.column], [one.forward.nuisances])
            groups.append(one.forward.moved(own, of_frames))
            zeros_.append(zeros + of_zeros)
        return PooledFrames.of(groups, zeros_)


def _spread(columns: Array, to: np.ndarray, count: int) -> Array:
    """Columns ``(…, p)`` at their places among ``count``; zeros at the others."""
    result = np.zeros((*columns.shape[:-1], count))
    result[..., to] = columns
    return result


class PooledStudy(Study):
    """Several groups of readings of one machine.

    Attributes:
        tests: the groups as they were given.
        series: number ``(n,)`` of the series that each group belongs to.
        of_series: the same ``(g,)`` of each reading.
        anew: names of the unknowns of each group that the one before it in the series does not have alike.
    """

    def __init__(
        self, groups: Sequence[SeriesStudy], series: Sequence[int], anew: Sequence[Collection[str]] | None = None
    ) -> None:
        """Take groups of one machine, and the number of the series of each; those of one stand in its order.

        ``anew`` are names of the nuisances and zeros of each group, see `unknowns_of`, that are not those of the
        group before it in its series; None: each group is a series.

        Raises:
            SheetError: they are of different machines.
        """
        first = groups[0]
        for other in groups[1:]:
            check_same_machine(other, first, "several series are", alike=True)
        self.tests, self._groups = tuple(groups), tuple(copy(one) for one in groups)
        self.series = np.array(series)
        self.anew = tuple(anew) if anew is not None else ((),) * len(groups)
        self.baseline = f"{first.baseline}, and zeros"
        self.against, self.jump, self.points = first.against, first.jump, first.points
        self.not_asked, self.not_asked_for = first.not_asked, first.not_asked_for
        self.turns_with_tracker = first.turns_with_tracker
        self.sheet, self.machine = first.sheet, first.machine
        self.outliers = tuple(outlier for one in groups for outlier in one.outliers)
        names = list(dict.fromkeys(name for one in groups for name in one.data.markers))
        ends = np.cumsum([len(one.data) for one in groups]).tolist()
        self._rows = [slice(end - len(one.data), end) for one, end in zip(groups, ends, strict=True)]
        self._markers = [np.array([names.index(name) for name in one.data.markers]) for one in groups]
        self.data = _joined([one.data for one in groups], self._rows, self._markers, tuple(names))
        self.of_series = np.repeat(self.series, [len(one.data) for one in groups])
        forwards = [one.forward_of(one.machine, one.data) for one in groups]
        squares = [len(one.data) * own.torques() ** 2 for one, own in zip(groups, forwards, strict=True)]
        torque: Array = np.sqrt(np.sum(squares, axis=0) / len(self.data))
        bearing = np.concatenate([one.bearing() for one in forwards])
        self.all_members = self._pooled_members()
        self.members, self.unasked = knowable(self.all_members, self.machine, self.data, torque)
        for i, one in enumerate(self.groups):
            one.members = [own for m in self.members if (own := self._own(i, m)) is not None]
        self.pooled_forwards: dict[tuple[str, ...], PooledForward] = {}
        self._law_shapes = [law_shape(member, self.data, bearing) for member in self.members]
        self.families = tuple(dict.fromkeys(member.family for member in self.members))
        self.folds = _folds(groups, self.data.q, self.of_series if len(set(self.series)) > 1 else None, self._rows)
        self.prior = self.nuisance_prior()
        self.frames, self.aligned = self.first_frames()

    @property
    def groups(self) -> tuple[SeriesStudy, ...]:
        """The test of each group."""
        return self._groups

    # --- the members of the machine, and of each group ----------------------------------------------------------

    def _pooled_members(self) -> list[FamilyParameter]:
        """Members of all groups by name, of one scale; a drift is of its group."""
        members: dict[str, FamilyParameter] = {}
        for i, one in enumerate(self.groups):
            for member in one.all_members:
                name = self._shared_name(i, member)
                before = members.get(name)
                if before is None or member.scale < before.scale:
                    members[name] = replace(member, name=name)
        order = {family: k for k, family in enumerate(dict.fromkeys(m.family for m in members.values()))}
        return [
            replace(m, basis=None if m.basis is None else self._pooled_basis(m))
            for m in sorted(members.values(), key=lambda m: order[m.family])
        ]

    def _shared_name(self, group: int, member: FamilyParameter) -> str:
        if member.kind != DRIFT:
            return member.name
        return f"{member.name} ({self.groups[group].data.file}, part {group + 1})"

    def _pooled_basis(self, member: FamilyParameter) -> Array:
        basis = np.zeros(len(self.data))
        for i, rows in enumerate(self._rows):
            own = self._own(i, member)
            if own is not None and own.basis is not None:
                basis[rows] = own.basis
        return basis

    def _own(self, group: int, member: FamilyParameter) -> FamilyParameter | None:
        """A group's member of a name, in the scale of all groups."""
        known = {self._shared_name(group, m): m for m in self.groups[group].all_members}
        own = known.get(member.name)
        if own is None:
            return None
        return replace(own, name=member.name, scale=member.scale, low=member.low, high=member.high)

    # --- what a study is asked ------------------------------------------------------------------------------------

    def forward(self, as_deflected: tuple[str, ...] = ()) -> PooledForward:
        """The model with some couplings the other way than the model file has them."""
        key = tuple(sorted(as_deflected))
        if key not in self.pooled_forwards:
            number = {m.name: k for k, m in enumerate(self.members)}
            groups: list[GroupForward] = []
            names: list[str] = []
            before: dict[tuple[str, int], int] = {}
            several, changed = len(set(self.series.tolist())) > 1, {name for own in self.anew for name in own}
            for i, (one, rows, markers) in enumerate(zip(self.groups, self._rows, self._markers, strict=True)):
                forward = one.forward_of(one.machine, one.data)
                forward.members = one.members
                if self._goes_on(i):
                    forward.centre = groups[-1].forward.centre
                else:
                    before = {}
                own = forward if not key else forward.with_machine(one.machine_of(key))
                zeros = [k for k, m in enumerate(one.members) if m.set_anew and (several or zero_of(m) in changed)]
                unknowns = unknowns_of(own, [one.members[k] for k in zeros])
                for unknown in unknowns:
                    if unknown not in before or unknown[0] in self.anew[i]:
                        before[unknown] = len(names)
                        names.append(f"{unknown[0]} ({one.data.file})")
                groups.append(
                    GroupForward(
                        own, np.array([number[m.name] for m in one.members], dtype=int),
                        np.array(zeros, dtype=int), np.array([before[one] for one in unknowns]), rows, markers,
                    )
                )  # fmt: skip
            self.pooled_forwards[key] = PooledForward(groups, self.members, len(self.data.markers), names)
        return self.pooled_forwards[key]

    def _goes_on(self, group: int) -> bool:
        """Whether a group is a further part of the series of the one before it."""
        return group > 0 and self.series[group] == self.series[group - 1]

    def nuisance_prior(self) -> Array:
        """Standard deviations ``(n_f,)`` of frames, markers' places and zeros, group by group."""
        forward = self.forward()
        result = np.empty(forward.nuisances)
        for group, one in zip(forward.groups, self.groups, strict=True):
            result[group.column] = np.concatenate([one.prior, np.full(len(group.zero), ZERO_BETWEEN)])
        return result

    def first_frames(self) -> tuple[Frames, Array]:
        """Those of the groups; a part of a series has what did not change of the part before it."""
        frames: list[Frames] = []
        groups = self.forward().groups
        for i, one in enumerate(self.groups):
            frames.append(self._going_on(one, frames[-1], self.anew[i]) if self._goes_on(i) else one.frames)
        zeros = [np.zeros(len(group.zero)) for group in groups]
        return PooledFrames.of(frames, zeros), self.joined_up([one.aligned for one in self.groups])

    @staticmethod
    def _going_on(one: SeriesStudy, before: Frames, anew: Collection[str]) -> Frames:
        """First guess of the nuisances of a part of a series from those of the part before it."""
        R, t = before.R, before.t
        if BASE_TURN in anew:
            R, t = one.frames.R, one.frames.t
        elif BASE_PLACE in anew:
            t = one.frames.t + (one.frames.R - R) @ one.forward().centre
        m, M = before.m.copy(), before.M.copy()
        for k, marker in enumerate(one.data.markers):
            if f"{MARKER_PLACE} {marker}" in anew:
                m[k] = one.frames.m[k]
            if f"{MARKER_FRAME} {marker}" in anew:
                M[k] = one.frames.M[k]
        return Frames(R, t, m, M)

    def joined_up(self, values: Sequence[Array]) -> Array:
        """What each group has of its readings ``(g_i, k_i, …)`` as one array ``(g, k, …)``, nan where none is."""
        result = np.full((len(self.data), len(self.data.markers), *values[0].shape[2:]), np.nan)
        for value, rows, markers in zip(values, self._rows, self._markers, strict=True):
            result[rows, markers] = value
        return result

    def stated(self) -> Array:
        """Standard deviations ``(g, k, 6)`` of the readings as the sheets and the files give them."""
        return self.joined_up([one.stated() for one in self.groups])

    def scatter(self, linearised: Linearised) -> Array:
        """The same, widened group by group to what the residuals' bulk shows."""
        return self.joined_up(
            [
                one.scatter(replace(linearised, residual=linearised.residual[rows][:, markers]))
                for one, rows, markers in zip(self.groups, self._rows, self._markers, strict=True)
            ]
        )

    def blocks(self, linearised: Linearised, z: Array, sigma: Array, hypothesis: Hypothesis) -> NormalEquations:
        """Normal equations of all members and nuisances at a state; a channel is one of a group."""
        made = super().blocks(linearised, z, sigma, hypothesis)
        group = np.repeat(np.arange(len(self.groups)), [len(one.data) for one in self.groups])
        channel = made.channel + 6 * len(self.data.markers) * group[made.posture]
        return replace(made, channel=channel, refit=REFIT)

    def at_candidates(self, state: FittedState, candidates: Candidates) -> Linearised:
        """The model at a state in readings that could be taken, with the markers of the first group."""
        assert isinstance(state.frames, PooledFrames)
        forward = self.forward(state.hypothesis.as_deflected)
        own, first = forward.groups[0], self.groups[0]
        sizes = state.z[own.member]
        sizes[own.zero] += state.frames.zeros[0]
        linearised = first.at_candidates(replace(state, z=sizes, frames=state.frames.groups[0]), candidates)
        k = len(self.data.markers)

        def wide(values: Array, count: int) -> Array:
            result = np.zeros((len(candidates), k, *values.shape[2:-1], count))
            result[:, own.markers, ..., : values.shape[-1]] = values
            return result

        zeros = np.concatenate([linearised.nuisance, linearised.member[..., own.zero]], axis=3)
        return replace(
            linearised, residual=wide(linearised.residual, 6),
            nuisance=wide(_spread(zeros, own.column, forward.nuisances), forward.nuisances),
            member=wide(_spread(linearised.member, own.member, len(self.members)), len(self.members)),
            tilt=wide(linearised.tilt, 3),
        )  # fmt: skip

    def drawn(self, rng: np.random.Generator, count: int, within: Ranges | None = None) -> Candidates:
        """Readings that could be taken, as the first group's, no further than what was measured of all reaches."""
        q = self.data.q
        ends = list(zip(q.min(axis=0).tolist(), q.max(axis=0).tolist(), strict=True))
        return self.groups[0].drawn(rng, count, ends if within is None else within)

    def as_modelled(self, springs: Collection[tuple[str, str]]) -> PooledStudy:
        """The same tests of the machine in which some springs have the model's compliance all the same."""
        groups = [one.as_modelled(springs) for one in self.groups]
        return PooledStudy(groups, self.series.tolist(), self.anew)


ZERO = "zero: "
"""Begins the name of what a zero of a group is off the shared one; its member's name follows."""


def zero_of(member: FamilyParameter) -> str:
    """Name of what a zero of a group is off the shared one."""
    return f"{ZERO}{member.name}"


def unknowns_of(forward: ReadingsForward, zeros: Sequence[FamilyParameter]) -> list[tuple[str, int]]:
    """Nuisances and zeros of a group: the name of each, and which it is among those of the name."""
    names = [*forward.nuisance_names(), *map(zero_of, zeros)]
    return [(name, names[:i].count(name)) for i, name in enumerate(names)]


def _joined(
    data: Sequence[PoseData], rows: Sequence[slice], markers: Sequence[np.ndarray], names: tuple[str, ...]
) -> PoseData:
    """Readings of all groups; nan where a group has no such marker."""
    g, k = rows[-1].stop, len(names)

    def of_markers(key: str, blank: float) -> Array:
        first = getattr(data[0], key)
        result = np.full((g, k, *first.shape[2:]), blank)
        for one, own, places in zip(data, rows, markers, strict=True):
            values = getattr(one, key)
            # the wrenches of deflections are at points of load behind the markers
            result[own, places] = values[:, : len(places)]
        return result

    warm = [one.temperature for one in data if one.temperature is not None]
    return PoseData(
        file=", ".join(dict.fromkeys(one.file for one in data)),
        sha256=digest("".join(dict.fromkeys(one.sha256 for one in data)).encode()),
        row=np.concatenate([one.row for one in data]), joints=data[0].joints,
        q=np.concatenate([one.q for one in data]), markers=names, position=of_markers("position", np.nan),
        orientation=of_markers("orientation", np.nan), tilt=of_markers("tilt", np.nan),
        sigma=of_markers("sigma", np.nan), wrench=of_markers("wrench", 0.0),
        torque=np.concatenate([one.torque for one in data]), time=None,
        temperature=np.concatenate(warm) if len(warm) == len(data) else None,
        left_out=sum({one.file: one.left_out for one in data}.values()),
    )  # fmt: skip


def _folds(groups: Sequence[SeriesStudy], q: Array, series: np.ndarray | None, rows: Sequence[slice]) -> Folds:
    """Folds of all groups: regions of all postures ``(g, n)``; what two groups have alike is held out together."""
    levels = {}
    for name in dict.fromkeys(name for one in groups for name in one.folds.levels):
        level = np.full(rows[-1].stop, -1)
        for one, own in zip(groups, rows, strict=True):
            if name in one.folds.levels:
                level[own] = one.folds.levels[name]
        levels[name] = level
    return replace(folds_of(q, {}), levels=levels, series=series)


CHANGES, STAYS = prior_scale(0.1), prior_scale(0.003)
"""Scales of τ. Springs and gears change with temperature, wear and load. A strain wave gear is 1.6 times as stiff
under its full torque as under a small one (makers' catalogues). So a linear spring that was fitted under another
tool is another one by a tenth. Geometry and weights change as lengths do with temperature. 10 K stretch a metre of
steel by 0.1 mm, where frames err by millimetres."""
RATIOS = numerical(tuple(float(v) for v in np.geomspace(1e-3, 3.0, 16)))
"""Of τ, that are tried."""
SWEEPS = numerical(2)
"""Of the families, each with the others' τ held."""
SEED = numerical(13)
TOLD = numerical(1e-6)
"""Of the prior's information, that the data add: less is rounding."""


def scale_of(family: str) -> float:
    """Scale of the prior of τ."""
    return STAYS if family in EXACT else CHANGES


@dataclass(frozen=True)
class Scatter:
    """Scatter between series.

    Attributes:
        tau: of each member ``(P,)`` the standard deviation at the posterior mode of τ, in its units.
        chance: by family the probabilities ``(r,)`` of τ at `RATIOS`.
        reach: ``(P,)`` what τ is a share of, in the members' units.
    """

    tau: Array
    chance: Mapping[str, Array]
    reach: Array

    def draws(self, family: str, place: int, count: int) -> Array:
        """Deviations ``(count,)`` of a member in a new series, in its units, by its family and its number."""
        if family not in self.chance:
            return np.zeros(count)
        rng = np.random.default_rng(SEED)
        ratio = rng.choice(RATIOS, count, p=self.chance[family])
        return ratio * self.reach[place] * rng.standard_normal(count)


@dataclass(frozen=True)
class ScatteredBlocks(NormalEquations):
    """Normal equations with the deviations of series integrated out.

    Attributes:
        series: ``(rows,)`` of each reading.
        variance: ``(P,)`` of the unknowns' deviations over that of the whitened readings; zero where there is none.
        without_prior: normal matrix ``(P, P)`` without what was added to it since.
    """

    series: np.ndarray | None = None
    variance: Array | None = None
    without_prior: Array | None = None

    def less(self, rows: np.ndarray) -> tuple[Array, Array]:
        """Normal equations without some of the readings."""
        assert self.without_prior is not None
        N, b, _ = self.integrated(rows)
        return self.N - self.without_prior + N, b

    @cached_property
    def _sums(self) -> dict[int, tuple[Array, Array]]:
        """Normal equations of each series."""
        assert self.series is not None
        sums = {}
        for s in np.unique(self.series):
            J, y = self.J[self.series == s], self.y[self.series == s]
            sums[int(s)] = J.T @ J, J.T @ y
        return sums

    def integrated(self, without: np.ndarray) -> tuple[Array, Array, float]:
        """Normal equations without some of the readings, the deviations integrated out; what these take of c."""
        assert self.series is not None
        assert self.variance is not None
        own = np.flatnonzero(self.variance)
        N, b, c = np.zeros_like(self.N), np.zeros_like(self.b), 0.0
        for s, (N_s, b_s) in self._sums.items():
            J, y = self.J[without & (self.series == s)], self.y[without & (self.series == s)]
            N_s, b_s = N_s - J.T @ J, b_s - J.T @ y
            less = cho_factor(np.diag(1.0 / self.variance[own]) + N_s[np.ix_(own, own)], lower=True)
            N += N_s - N_s[:, own] @ cho_solve(less, N_s[own])
            deviation = cho_solve(less, b_s[own])
            b += b_s - N_s[:, own] @ deviation
            c += float(b_s[own] @ deviation)
        return N, b, c

    def spread(self, correlated: Array, common: Array) -> Array:
        """``JᵀW (K + D Dᵀ + G T Gᵀ) W J`` with the weights W left, as `NormalEquations.spread`."""
        assert self.series is not None
        assert self.variance is not None
        own = np.flatnonzero(self.variance)
        total, by_common = np.zeros_like(self.N), np.zeros((len(self.N), common.shape[1]))
        for s in np.unique(self.series):
            rows = self.series == s
            J = self.J[rows]
            N_s, K_s = J.T @ J, correlated[rows].T @ correlated[rows]
            less = cho_factor(np.diag(1.0 / self.variance[own]) + N_s[np.ix_(own, own)], lower=True)
            # W J = J − G A with A below, so that JᵀW K W J is made of JᵀKJ alone
            A = cho_solve(less, N_s[own])
            cut = np.eye(len(N_s))
            cut[own] -= A
            total += cut.T @ K_s @ cut
            by_common += cut.T @ (J.T @ common[rows])
            by = (N_s @ cut)[own]
            total += by.T @ (self.variance[own, None] * by)
        return total + by_common @ by_common.T


def between(study: Study, state: FittedState) -> tuple[FittedState, Scatter]:
    """The fit with the deviations of series integrated out, and their scatter. Of one series the fit stays."""
    families, n = state.hypothesis.families, state.blocks.nuisances
    reach = _reach(study, state)
    if isinstance(state.blocks, ScatteredBlocks):
        return state, Scatter(reach * 0.0, {}, reach)
    if not isinstance(study, PooledStudy) or study.folds.series is None:
        # the prior alone, and nothing of what is geometry
        asked = [name for name in families if name not in EXACT]
        chance = {name: _chance(np.zeros(len(RATIOS)), scale_of(name)) for name in asked}
        own = np.array([scale_of(m.family) if m.family in asked else 0.0 for m in study.members])
        return state, Scatter(own * reach, chance, reach)
    series = study.of_series[state.blocks.posture]
    ratio, chance = _ScatterSearch(study, state, series, reach).run()
    tau = np.array([ratio.get(m.family, 0.0) for m in study.members]) * reach
    own = np.array([m.family not in ZEROS for m in study.members])
    variance = np.zeros(len(state.blocks.b))
    variance[n:] = np.where(own, (tau / state.solution.noise) ** 2, 0.0)
    variance[np.setdiff1d(np.arange(len(variance)), state.solution.active)] = 0.0
    made = _scattered(state.blocks, series, variance)
    solution = solve(made, study.numbers(state.hypothesis), state.solution.sizes)
    errors = study.errors(made, solution, state.sigma)
    fit = replace(state, z=solution.z[n:], blocks=made, solution=solution, errors=errors)
    return fit, Scatter(tau, chance, reach)


def _reach(study: Study, state: FittedState) -> Array:
    """What τ is a share of ``(P,)``: of a spring its compliance, root mean square; of others the family's size."""
    solution, n = state.solution, state.blocks.nuisances
    variance = np.zeros(len(state.blocks.b))
    variance[solution.active] = np.diag(solution.covariance)
    result = np.zeros(len(study.members))
    for i, m in enumerate(study.members):
        if m.kind == COMPLIANCE:
            result[i] = np.hypot(m.value(float(solution.z[n + i])) / m.scale, np.sqrt(variance[n + i]))
        elif m.family in state.hypothesis.families:
            result[i] = max(solution.sizes[study.number(m.family)], RATIOS[0])
    return result


def _scattered(blocks: NormalEquations, series: np.ndarray, variance: Array) -> ScatteredBlocks:
    made = ScatteredBlocks(**vars(blocks), series=series, variance=variance)
    N, b, c = made.integrated(np.zeros(len(series), dtype=bool))
    parts = []
    for fold in blocks.fold:
        of_row, own = fold[blocks.posture], []
        for k in range(int(fold.max()) + 1):
            N_k, b_k, _ = made.integrated(of_row == k)
            own.append((N - N_k, b - b_k))
        parts.append(own)
    return replace(made, N=N, b=b, c=blocks.c - c, parts=tuple(parts), without_prior=N)


class _ScatterSearch:
    """Evidence of τ, family by family, from what each series says of the members."""

    def __init__(self, study: PooledStudy, state: FittedState, series: np.ndarray, reach: Array) -> None:
        n, solution = state.blocks.nuisances, state.solution
        free = np.setdiff1d(solution.active[n:], solution.at_bound)
        self.family = np.array([study.members[int(u) - n].family for u in free])
        self.reach = reach[free - n]
        self.size = {name: max(solution.sizes[study.number(name)], RATIOS[0]) for name in state.hypothesis.families}
        self.precision = 1.0 / np.array([self.size[name] for name in self.family]) ** 2
        self.information: list[tuple[Array, Array]] = []
        J, y = state.whitened.J / solution.noise, state.whitened.y / solution.noise
        bound = solution.at_bound
        y = y - J[:, bound] @ solution.z[bound]
        prior = np.diag(1.0 / state.blocks.prior**2)
        for s in np.unique(series):
            rows = series == s
            F, G, r = J[rows, :n], J[np.ix_(rows, free)], y[rows]
            A, scale = scaled(F.T @ F + prior)
            factor = cho_factor(A, lower=True)
            X = cho_solve(factor, (F.T @ np.column_stack([G, r])) * scale[:, None]) * scale[:, None]
            left = np.column_stack([G, r]) - F @ X
            M = left.T @ np.column_stack([G, r])
            self.information.append((0.5 * (M[:-1, :-1] + M[:-1, :-1].T), M[:-1, -1]))
        self.zeros = self._zeros(study, state)

    @staticmethod
    def _zeros(study: PooledStudy, state: FittedState) -> dict[str, tuple[Array, Array]]:
        """What zeros of the groups are off the shared ones by the readings alone, and variances, by family."""
        solution = state.solution
        names = study.forward(state.hypothesis.as_deflected).nuisance_names()
        zeros: dict[str, tuple[list[float], list[float]]] = {}
        for u, name in enumerate(names):
            if not name.startswith(ZERO):
                continue
            family = name.removeprefix(ZERO).partition(".")[0]
            variance = float(solution.covariance[u, u])
            # less what the prior said
            information = 1.0 / max(variance, 1e-12) - 1.0 / ZERO_BETWEEN**2
            if information > TOLD:
                values, variances = zeros.setdefault(family, ([], []))
                values.append(float(solution.z[u]) / (variance * information))
                variances.append(1.0 / information)
        return {name: (np.array(a), np.array(b)) for name, (a, b) in zeros.items()}

    def run(self) -> tuple[dict[str, float], dict[str, Array]]:
        """Posterior modes of τ by family, and probabilities at the ratios."""
        names = list(dict.fromkeys(self.family.tolist()))
        ratio = {name: scale_of(name) for name in names}
        chance: dict[str, Array] = {}
        for _ in range(SWEEPS):
            for name in names:
                if name in ZEROS:
                    continue
                tried = np.array([self._evidence(ratio | {name: r}) for r in RATIOS])
                chance[name] = _chance(tried, scale_of(name))
                ratio[name] = RATIOS[int(np.argmax(chance[name]))]
        for name, (values, variances) in self.zeros.items():
            if name not in self.size:
                continue
            total = variances + (np.array(RATIOS)[:, None] * self.size[name]) ** 2
            tried = -0.5 * np.sum(np.log(total) + values**2 / total, axis=1)
            chance[name] = _chance(tried, min(ZERO_BETWEEN / self.size[name], RATIOS[-1]))
            ratio[name] = RATIOS[int(np.argmax(chance[name]))]
        return ratio, chance

    def _evidence(self, ratio: Mapping[str, float]) -> float:
        tau = np.array([0.0 if f in ZEROS else ratio[f] for f in self.family]) * self.reach
        own = np.flatnonzero(tau)
        root = tau[own]
        A, b, total = np.diag(self.precision), np.zeros(len(tau)), 0.0
        for M, v in self.information:
            inner = np.eye(len(own)) + root[:, None] * M[np.ix_(own, own)] * root
            factor = cho_factor(inner, lower=True)
            X = root[:, None] * M[own]
            A = A + M - X.T @ cho_solve(factor, X)
            w = root * v[own]
            solved = cho_solve(factor, w)
            b = b + v - X.T @ solved
            total += 0.5 * float(w @ solved) - float(np.sum(np.log(np.diag(factor[0]))))
        B, scale = scaled(A)
        factor = cho_factor(B, lower=True)
        total += 0.5 * float((b * scale) @ cho_solve(factor, b * scale))
        return total - float(np.sum(np.log(np.diag(factor[0])))) + float(np.sum(np.log(scale)))


def _chance(log_evidence: Array, scale: float) -> Array:
    """Probabilities of τ at `RATIOS`, which are even in its logarithm, under half of Student's distribution."""
    ratio = np.array(RATIOS)
    log = log_evidence + np.log(ratio) - 0.5 * (TAIL + 1.0) * np.log1p((ratio / scale) ** 2 / TAIL)
    w = np.exp(log - log.max())
    return w / w.sum()
