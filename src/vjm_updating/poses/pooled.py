"""Several series of one machine in one fit.

A series, or a part of one between two changes in its course, is a *group*. Its tracker's frame, its markers'
places, and the zeros of its joints and force sensors are its own; a part of a series shares those that did not
change with the part before it. The numbers of the machine are shared. So a hypothesis is fitted to all groups at
once, and each group is read by its own sheet.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from vjm.io.provenance import digest
from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.experiment.source import SheetError
from vjm_updating.poses.families import DRIFT, ZEROS, Member
from vjm_updating.poses.fit import Blocks
from vjm_updating.poses.folds import Folds, folds_of
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
from vjm_updating.poses.readings import PoseData
from vjm_updating.poses.state import Candidates, FittedState, Hypothesis
from vjm_updating.poses.study import Ranges, SeriesStudy, Study, knowable, law_shapes

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


def pooled_frames(groups: Sequence[Frames], zeros: Sequence[Array]) -> PooledFrames:
    """Frames of groups as one."""
    first = groups[0]
    return PooledFrames(first.R, first.t, first.m, first.M, tuple(groups), tuple(zeros))


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


class PooledForward:
    """The model of the readings of all groups."""

    def __init__(
        self, groups: Sequence[GroupForward], members: list[Member], markers: int, names: list[str]
    ) -> None:
        self.groups, self.members, self._markers, self._names = tuple(groups), members, markers, names

    @property
    def nuisances(self) -> int:
        """How many unknowns of the instruments there are."""
        return len(self._names)

    def nuisance_names(self) -> list[str]:
        """What each is, for people."""
        return self._names

    def evaluate(self, z: Array, frames: Frames) -> Linearised:
        """Residuals and derivatives at members ``z`` (P,), in units, and nuisances.

        Raises:
            NoConvergenceError: a posture has no equilibrium.
        """
        assert isinstance(frames, PooledFrames)
        found = []
        for one, own, zeros in zip(self.groups, frames.groups, frames.zeros, strict=True):
            there = z[one.member]
            there[one.zero] += zeros
            found.append(one.forward.evaluate(there, own))
        g, k = self.groups[-1].rows.stop, self._markers
        joints = found[0].torque.shape[1]
        residual, tilt = np.full((g, k, 6), np.nan), np.zeros((g, k, 6, 3))
        F, J = np.zeros((g, k, 6, self.nuisances)), np.zeros((g, k, 6, len(self.members)))
        torque, off = np.zeros((g, joints)), np.zeros(self.nuisances)
        for one, at, zeros in zip(self.groups, found, frames.zeros, strict=True):
            residual[one.rows, one.markers], tilt[one.rows, one.markers] = at.residual, at.tilt
            nuisance = np.concatenate([at.nuisance, at.member[..., one.zero]], axis=3)
            F[one.rows, one.markers] = _spread(nuisance, one.column, self.nuisances)
            J[one.rows, one.markers] = _spread(at.member, one.member, len(self.members))
            torque[one.rows] = at.torque
            off[one.column] = np.concatenate([at.off, zeros])
        return Linearised(residual, F, J, torque, off, tilt)

    def moved(self, frames: Frames, step: Array) -> Frames:
        """Nuisances after a step ``(n_f,)`` in the coordinates of `Linearised.nuisance`."""
        assert isinstance(frames, PooledFrames)
        groups, zeros_ = [], []
        for one, own, zeros in zip(self.groups, frames.groups, frames.zeros, strict=True):
            of_frames, of_zeros = np.split(step[one.column], [one.forward.nuisances])
            groups.append(one.forward.moved(own, of_frames))
            zeros_.append(zeros + of_zeros)
        return pooled_frames(groups, zeros_)

    def bearing(self) -> Array:
        """What makes each coordinate deflect as it is read ``(g, n_tree)``, N mm or N."""
        return np.concatenate([one.forward.bearing() for one in self.groups])

    def torques(self) -> Array:
        """Root mean square over the groups ``(n_tree,)`` of what makes each coordinate deflect as it is read."""
        return _mean_torques([one.forward for one in self.groups], [one.rows for one in self.groups])


def _mean_torques(forwards: Sequence[ReadingsForward], rows: Sequence[slice]) -> Array:
    squares = [(own.stop - own.start) * one.torques() ** 2 for one, own in zip(forwards, rows, strict=True)]
    result: Array = np.sqrt(np.sum(squares, axis=0) / rows[-1].stop)
    return result


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
        """Take groups.

        Args:
            groups: of one machine.
            series: number of the series of each group; those of one series stand in its order.
            anew: names of the nuisances and zeros of each group, see `unknowns_of`, that are not those of the
                group before it in its series; None: each group is a series.

        Raises:
            SheetError: they are of different machines.
        """
        first = groups[0]
        for other in groups[1:]:
            _check_same_machine(first, other)
        self.tests, self._groups = tuple(groups), tuple(copy(one) for one in groups)
        self.series = np.array(series)
        self.anew = tuple(anew) if anew is not None else ((),) * len(groups)
        self.baseline = f"{first.baseline}, and zeros"
        self.against, self.jump = first.against, first.jump
        self.turns_with_tracker = first.turns_with_tracker
        self.sheet, self.machine = first.sheet, first.machine
        self.outliers = tuple(outlier for one in groups for outlier in one.outliers)
        self._rows, self._markers = _places(groups)
        names = list(dict.fromkeys(name for one in groups for name in one.data.markers))
        self.data = _joined([one.data for one in groups], self._rows, self._markers, tuple(names))
        self.of_series = np.repeat(self.series, [len(one.data) for one in groups])
        forwards = [one.forward_of(one.machine, one.data) for one in groups]
        torque = _mean_torques(forwards, self._rows)
        bearing = np.concatenate([one.bearing() for one in forwards])
        self.all_members = self._pooled_members()
        self.members, self.unasked = knowable(self.all_members, self.machine, self.data, torque)
        for i, one in enumerate(self.groups):
            one.members = [own for m in self.members if (own := self._own(i, m)) is not None]
        self.pooled_forwards: dict[tuple[str, ...], PooledForward] = {}
        self._law_shapes = law_shapes(self.members, self.data, bearing)
        self.families = tuple(dict.fromkeys(member.family for member in self.members))
        self.folds = _folds(groups, self.data.q, self.of_series if len(set(self.series)) > 1 else None, self._rows)
        self.prior = self.nuisance_prior()
        self.frames, self.aligned = self.first_frames()

    @property
    def groups(self) -> tuple[SeriesStudy, ...]:
        """The test of each group."""
        return self._groups

    # --- the members of the machine, and of each group ----------------------------------------------------------

    def _pooled_members(self) -> list[Member]:
        """Members of all groups by name, of one scale; a drift is of its group."""
        found: dict[str, Member] = {}
        for i, one in enumerate(self.groups):
            for member in one.all_members:
                name = self._shared_name(i, member)
                before = found.get(name)
                if before is None or member.scale < before.scale:
                    found[name] = replace(member, name=name)
        order = {family: k for k, family in enumerate(dict.fromkeys(m.family for m in found.values()))}
        return [
            replace(m, basis=None if m.basis is None else self._pooled_basis(m))
            for m in sorted(found.values(), key=lambda m: order[m.family])
        ]

    def _shared_name(self, group: int, member: Member) -> str:
        if member.kind != DRIFT:
            return member.name
        return f"{member.name} ({self.groups[group].data.file}, part {group + 1})"

    def _pooled_basis(self, member: Member) -> Array:
        basis = np.zeros(len(self.data))
        for i, rows in enumerate(self._rows):
            own = self._own(i, member)
            if own is not None and own.basis is not None:
                basis[rows] = own.basis
        return basis

    def _own(self, group: int, member: Member) -> Member | None:
        """A group's member of a name, in the scale of all groups."""
        known = {self._shared_name(group, m): m for m in self.groups[group].all_members}
        own = known.get(member.name)
        if own is None:
            return None
        return replace(own, name=member.name, scale=member.scale, low=member.low, high=member.high)

    # --- what a study is asked ------------------------------------------------------------------------------------

    @property
    def ordered(self) -> bool:
        """Of several groups no order is asked: each was asked alone."""
        return False

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
                zeros = [
                    k for k, m in enumerate(one.members) if m.family in ZEROS and (several or zero_of(m) in changed)
                ]
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
        found: list[Frames] = []
        groups = self.forward().groups
        for i, one in enumerate(self.groups):
            found.append(self._going_on(one, found[-1], self.anew[i]) if self._goes_on(i) else one.frames)
        zeros = [np.zeros(len(group.zero)) for group in groups]
        return pooled_frames(found, zeros), self.joined_up([one.aligned for one in self.groups])

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

    def scatter(self, at: Linearised) -> Array:
        """The same, widened group by group to what the residuals' bulk shows."""
        return self.joined_up(
            [
                one.scatter(replace(at, residual=at.residual[rows][:, markers]))
                for one, rows, markers in zip(self.groups, self._rows, self._markers, strict=True)
            ]
        )

    def blocks(self, at: Linearised, z: Array, sigma: Array, hypothesis: Hypothesis) -> Blocks:
        """Normal equations of all members and nuisances at a state; a channel is one of a group."""
        made = super().blocks(at, z, sigma, hypothesis)
        group = np.repeat(np.arange(len(self.groups)), [len(one.data) for one in self.groups])
        channel = made.channel + 6 * len(self.data.markers) * group[made.posture]
        return replace(made, channel=channel, refit=REFIT)

    def at_candidates(self, state: FittedState, candidates: Candidates) -> Linearised:
        """The model at a state in readings that could be taken, with the markers of the first group."""
        assert isinstance(state.frames, PooledFrames)
        forward = self.forward(state.hypothesis.as_deflected)
        own, first = forward.groups[0], self.groups[0]
        there = state.z[own.member]
        there[own.zero] += state.frames.zeros[0]
        at = first.at_candidates(replace(state, z=there, frames=state.frames.groups[0]), candidates)
        k = len(self.data.markers)

        def wide(values: Array, count: int) -> Array:
            result = np.zeros((len(candidates), k, *values.shape[2:-1], count))
            result[:, own.markers, ..., : values.shape[-1]] = values
            return result

        zeros = np.concatenate([at.nuisance, at.member[..., own.zero]], axis=3)
        return replace(
            at, residual=wide(at.residual, 6),
            nuisance=wide(_spread(zeros, own.column, forward.nuisances), forward.nuisances),
            member=wide(_spread(at.member, own.member, len(self.members)), len(self.members)),
            tilt=wide(at.tilt, 3),
        )  # fmt: skip

    def drawn(self, rng: np.random.Generator, count: int, within: Ranges | None = None) -> Candidates:
        """Readings that could be taken, as the first group's, no further than what was measured of all reaches."""
        q = self.data.q
        ends = list(zip(q.min(axis=0).tolist(), q.max(axis=0).tolist(), strict=True))
        return self.groups[0].drawn(rng, count, ends if within is None else within)

    @property
    def points(self) -> tuple[str, ...]:
        """Points of load."""
        return self.groups[0].points

    @property
    def not_asked(self) -> tuple[str, ...]:
        """Families that the data cannot show, whatever they are."""
        return self.groups[0].not_asked

    @property
    def not_asked_for(self) -> str:
        """Why, for people."""
        return self.groups[0].not_asked_for

    def as_modelled(self, springs: Collection[tuple[str, str]]) -> PooledStudy:
        """The same tests of the machine in which some springs have the model's compliance all the same."""
        groups = [one.as_modelled(springs) for one in self.groups]
        return PooledStudy(groups, self.series.tolist(), self.anew)


ZERO = "zero: "
"""Begins the name of what a zero of a group is off the shared one; its member's name follows."""


def zero_of(member: Member) -> str:
    """Name of what a zero of a group is off the shared one."""
    return f"{ZERO}{member.name}"


def unknowns_of(forward: ReadingsForward, zeros: Sequence[Member]) -> list[tuple[str, int]]:
    """Nuisances and zeros of a group: the name of each, and which it is among those of the name."""
    names = [*forward.nuisance_names(), *map(zero_of, zeros)]
    return [(name, names[:i].count(name)) for i, name in enumerate(names)]


def _check_same_machine(first: SeriesStudy, other: SeriesStudy) -> None:
    """Refuse a series of another machine."""
    if other.data.joints != first.data.joints:
        raise SheetError(
            f"{other.sheet.file}: several series are of the same machine: its joints are "
            f"{', '.join(other.data.joints)}, those of {first.sheet.file} are {', '.join(first.data.joints)}"
        )
    if other.machine.springs != first.machine.springs or type(other) is not type(first):
        raise SheetError(
            f"{other.sheet.file}: several series are of the same machine and kind of test: its kind, its model, or "
            f"'rigid', is another than that of {first.sheet.file}"
        )


def _places(groups: Sequence[SeriesStudy]) -> tuple[list[slice], list[np.ndarray]]:
    """Rows and markers of each group among all."""
    names = list(dict.fromkeys(name for one in groups for name in one.data.markers))
    rows, start = [], 0
    for one in groups:
        rows.append(slice(start, start + len(one.data)))
        start += len(one.data)
    return rows, [np.array([names.index(name) for name in one.data.markers]) for one in groups]


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
