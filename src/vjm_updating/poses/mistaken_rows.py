"""Rows of a test of a robot that are not what their columns say, while the other rows are.

Each possible mistake is put right and compared with the nominal machine, whose frames or springs are fitted
to the rows that are right. All mistakes are judged by the same readings: what is put right by a factor k has a
density that is k times as large. `vjm_updating.experiment.mistakes` has the most probable sequence.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from vjm.io.findings import Finding, Grade
from vjm.rotations import Array
from vjm.tree.equilibria import unloaded_frames
from vjm_updating.constants import definition, numerical
from vjm_updating.experiment.mistakes import LEAST_ROWS, LENGTHS, ODDS, ColumnsMistaken, most_probable, rarity
from vjm_updating.experiment.readings import runs
from vjm_updating.observation.significance import CUT, MEDIAN_TO_SIGMA, more_than_noise
from vjm_updating.poses.alignment import align
from vjm_updating.poses.families import LARGEST, MILLIRADIAN
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.pose_study import PoseStudy
from vjm_updating.poses.readings import PoseData
from vjm_updating.poses.sheet import RobotSheet
from vjm_updating.poses.study import TAIL, Study

# --- Changes of data that would explain what a rigid robot misses: signs, zeros, exchanged columns, units, rows----

FARTHEST = LARGEST["joint_offset"] * MILLIRADIAN
"""Mean error of the rigid robot over its reach, above which no zero of a joint can be the cause."""
QUARTERS = {"a quarter turn": 0.5 * np.pi, "a quarter turn back": -0.5 * np.pi, "half a turn": np.pi}
"""rad: what lies between the zeros of two conventions that describe one robot."""
FARTHEST_ROWS = numerical(5)
"""By how many rows readings may stand from where they belong."""
MOST_TRIED = numerical(120)
"""Postures on which changes of the data are tried."""
NOISE_DISTANCE = definition(float(np.sqrt(8.0 / np.pi)))
"""Mean distance over the standard deviation of a coordinate, of three normal errors."""
D = TypeVar("D", bound=PoseData)


@dataclass(frozen=True)
class Change(Generic[D]):
    """A way in which data may have been mistaken.

    Attributes:
        data: as they were meant.
        name: of the mistake.
        remedy: what to do, for people.
        factor: what readings are multiplied by.
    """

    data: D
    name: str
    remedy: str
    factor: float = 1.0


class RobotMisses(Finding):
    """The rigid robot misses, and no change of the data explains it."""


def joints_and_markers(study: PoseStudy) -> Iterator[Finding]:
    """What would explain a rigid robot's error: signs, zeros, columns exchanged, a unit, a row's shift.

    A change is named where it explains more of the squared error than it leaves, and what it leaves is a robot's.
    """
    keep = np.linspace(0, len(study.data) - 1, min(len(study.data), MOST_TRIED)).astype(int)
    data, reach = study.data.only(keep), study.machine.tree.reach
    seen = np.isfinite(data.position)
    noise = NOISE_DISTANCE * float(np.median(data.sigma[seen]))
    before = float(np.nanmean(study.aligned))
    if study.sheet.base is not None or not more_than_noise(before / noise, float(seen.sum())):
        return

    def left(changed: PoseData) -> float:
        return rigid_error(study.machine, study.sheet, changed)

    base, spread = left(data), rigid_spread(study.machine, data)
    error, name, remedy = best_change(changes_of_poses(study, study.data, keep), left)
    # positions in a smaller unit miss by less, though they follow the robot no better: it must do so, too
    least = min(base, spread)
    if error > FARTHEST * reach or 2.0 * error**2 > least**2:
        times = spread_of(data.position) / spread
        scaled = left(replace(data, position=data.position / times)) if times > 0.0 else np.inf
        if scaled <= FARTHEST * reach and 2.0 * scaled**2 <= least**2:
            words = (
                f"positions_scaled: the rigid robot misses the markers by {base:.4g} mm; the positions spread "
                f"{times:.3g} times as far as the robot's, which no unit explains. With that undone it is "
                f"{scaled:.4g} mm"
            )
            yield ColumnsMistaken(Grade.DOUBTFUL, data.file, words)
        elif before > FARTHEST * reach:
            words = (
                f"rigid_robot: misses the markers by {before:.4g} mm, {before / reach:.0%} of its reach. No "
                "joint's sign or zero, no two joints or markers exchanged, no unit and no other order explains it. "
                "Look at the model, the joints' names and units, the part behind which each marker rides"
            )
            yield RobotMisses(Grade.DOUBTFUL, data.file, words)
        return
    words = f"{name}: the rigid robot misses the markers by {base:.4g} mm; {remedy} and it is {error:.4g} mm"
    times = error / noise
    if more_than_noise(times, float(seen.sum())):
        words += f", still {times:.1f} times what the noise makes: that is not all that is wrong"
    yield ColumnsMistaken(Grade.DOUBTFUL, data.file, words)


def changes_of_poses(study: PoseStudy, data: PoseData, keep: np.ndarray) -> Iterator[Change[PoseData]]:
    """All mistakes that some rows of poses may have, the simplest first."""
    kept = data.only(keep)
    yield from joints_meant(study, kept)
    yield from _order_of_joints(study, kept)
    yield from _of_positions(data, keep)


def best_change(changes: Iterable[Change[D]], left: Callable[[D], float]) -> tuple[float, str, str]:
    """The change of data of the least residual; of those that do as well the simplest, which comes first.

    Args:
        changes: data as they may have been meant, a name, and what to do.
        left: residual of a robot by data.

    Returns:
        The residual, the name, and what to do.
    """
    found = [(left(change.data), change.name, change.remedy) for change in changes]
    return next(one for one in found if one[0] <= 1.02 * min(found)[0])


def joints_meant(study: Study, data: D) -> Iterator[Change[D]]:
    """Joints with other signs and zeros, or two columns exchanged."""
    for i, name in enumerate(data.joints):
        one = np.eye(len(data.joints))[i]
        turned = replace(data, q=data.q * (1.0 - 2.0 * one))
        yield Change(turned, f"joint_sign.{name}", f"multiply {name} by −1")
        for words, angle in QUARTERS.items() if not study.machine.slides[i] else ():
            remedy = f"turn the zero of {name} by {words} (add {angle:.6g} rad)"
            yield Change(replace(data, q=data.q + angle * one), f"joint_zero.{name}", remedy)
    for i, j in itertools.combinations(range(len(data.joints)), 2):
        if study.machine.slides[i] == study.machine.slides[j]:
            a, b = data.joints[i], data.joints[j]
            remedy = f"exchange the columns of {a} and {b}"
            yield Change(replace(data, q=exchanged(data.q, i, j)), f"joints_swapped.{a}.{b}", remedy)


def exchanged(values: Array, i: int, j: int) -> Array:
    """Values ``(g, n, …)`` with two columns in each other's place."""
    order = np.arange(values.shape[1])
    order[[i, j]] = j, i
    result: Array = values[:, order]
    return result


def _order_of_joints(study: PoseStudy, data: PoseData) -> Iterator[Change[PoseData]]:
    """Places and order of the joints' columns."""
    names = data.joints
    if len(names) > 1 and len(set(study.machine.slides)) == 1:
        yield Change(replace(data, q=data.q[:, ::-1]), "joints_reversed", "reverse the joints' order")
        for by in range(1, len(names)):
            words = f"the column of {names[by]} is that of {names[0]}, and so on around"
            yield Change(replace(data, q=np.roll(data.q, -by, axis=1)), f"joints_shifted.{by}", words)


def _of_positions(data: PoseData, keep: np.ndarray) -> Iterator[Change[PoseData]]:
    """Markers, axes, units and rows of the positions; of some rows of the data."""
    kept = data.only(keep)
    y = kept.position
    for i, j in itertools.combinations(range(len(data.markers)), 2):
        a, b = data.markers[i], data.markers[j]
        remedy = f"exchange the markers {a} and {b}"
        yield Change(replace(kept, position=exchanged(y, i, j)), f"markers_swapped.{a}.{b}", remedy)
    words = "the tracker's axes are left-handed: exchange two of them or reverse one,"
    yield Change(replace(kept, position=y * [-1.0, 1.0, 1.0]), "tracker_mirrored", words)
    yield from positions_in_units(kept, "positions")
    for order, sign, name, words in axes(np.asarray(np.isfinite(y).any(axis=(0, 1)))):
        yield Change(replace(kept, position=y[..., order] * sign), f"position_axes.{name}", f"{words} positions")
    for change in shifted_rows(data, "positions"):
        yield replace(change, data=change.data.only(keep))


def positions_in_units(data: D, what: str) -> Iterator[Change[D]]:
    """Positions or displacements in another unit of length."""
    for unit, factor in LENGTHS.items():
        words = f"the {what} are in {unit}: multiply them by {factor:g}"
        yield Change(replace(data, position=data.position * factor), f"{what}_in_{unit.split()[0]}", words, factor)


def shifted_rows(data: D, what: str) -> Iterator[Change[D]]:
    """Positions or displacements that stand some rows from where they belong."""
    g = len(data)
    for by in [sign * count for count in range(1, min(FARTHEST_ROWS, g - 1) + 1) for sign in (-1, 1)]:
        at = np.arange(g) + by
        inside = (at >= 0) & (at < g)
        moved = np.where(inside[:, None, None], data.position[np.clip(at, 0, g - 1)], np.nan)
        rows = "one row" if abs(by) == 1 else f"{abs(by)} rows"
        early = f"{rows} too early: move them down" if by < 0 else f"{rows} too late: move them up"
        remedy = f"the {what} stand {early} by {'one' if abs(by) == 1 else abs(by)},"
        yield Change(replace(data, position=moved), f"{what}_shifted.{by}", remedy)


def axes(there: np.ndarray) -> Iterator[tuple[list[int], Array, str, str]]:
    """Exchanged, cycled and reversed axes: their order, signs ``(3,)``, a name, what to do.

    Args:
        there: ``(3,)`` which axes have columns: what is not there was not mistaken.
    """
    x = "xyz"
    for i, j in itertools.combinations(np.flatnonzero(there).tolist(), 2):
        order = list(range(3))
        order[i], order[j] = j, i
        yield order, np.ones(3), f"{x[i]}{x[j]}_exchanged", f"exchange {x[i]} and {x[j]} of the"
    for order in ([1, 2, 0], [2, 0, 1]) if there.all() else ():
        name = "".join(x[i] for i in order)
        yield order, np.ones(3), name, f"take {', '.join(name)} for x, y, z in the"
    for i in np.flatnonzero(there).tolist():
        sign = np.where(np.arange(3) == i, -1.0, 1.0)
        yield list(range(3)), sign, f"{x[i]}_reversed", f"reverse {x[i]} of the"
    if there.sum() > 1:
        yield list(range(3)), -np.ones(3), "reversed", "reverse the sign of the"


def rigid_spread(machine: PoseMachine, data: PoseData) -> float:
    """Spread of the rigid robot's ends where markers were seen, mm."""
    ends = unloaded_frames(machine.tree, machine.rows(data.q))[1]
    return spread_of(np.where(np.isfinite(data.position), ends, np.nan))


def rigid_error(machine: PoseMachine, sheet: RobotSheet, data: PoseData) -> float:
    """Mean distance of the markers from the rigid robot's ends, mm; inf where a joint is off its beam."""
    rows = machine.rows(data.q)
    if machine.moves and not np.all(machine.tree.limits.kept(rows)):
        return np.inf
    R, p = unloaded_frames(machine.tree, rows)
    sigma = np.array([table.sigma_mm for table in sheet.markers.values()])
    _, distance = align(R, p, data.position, np.full((*data.position.shape[:2], 3, 3), np.nan), sigma, None)
    return float(np.nanmean(distance))


def spread_of(position: Array) -> float:
    """How far positions ``(…, 3)`` lie from their mean, root mean square, mm; 0 where fewer than two were seen."""
    points = position.reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    return float(np.linalg.norm(points.std(axis=0))) if len(points) > 1 else 0.0


PARTS = numerical(8)
"""Of a file, with each of which the search for rows that are right begins."""
ROUNDS = numerical(10)
"""After which the rows that are right have been found, at most."""


class Beside(ABC, Generic[D]):
    """Readings of a test beside the nominal machine.

    Attributes:
        data: as read.
        least: number of rows to which frames or springs can be fitted.
    """

    def __init__(self, data: D, least: int) -> None:
        self.data, self.least = data, least

    @abstractmethod
    def changes(self) -> Iterator[Change[D]]:
        """Mistakes that rows may have, the simplest first."""

    @abstractmethod
    def left(self, data: D, rows: np.ndarray) -> Array:
        """Residuals ``(g, k, 3)`` mm of all rows of data, with what is fitted to some rows as they were read.

        Args:
            data: the test's, or as they may have been meant.
            rows: indices of those that are right.
        """

    @cached_property
    def right(self) -> np.ndarray:
        """Indices of the rows on which most agree, by least trimmed squares (Rousseeuw, JASA 79, 1984).

        It begins with each part of the file, since mistakes stand in blocks. From a fit to some rows the half that
        it misses least is fitted next, until that half stays.
        """
        g = len(self.data)
        half = max(g // 2 + 1, min(self.least, g))
        best, found = np.inf, np.arange(g)
        for begin in np.linspace(0, g, PARTS, endpoint=False).astype(int).tolist():
            rows = np.arange(begin, min(begin + max(g // PARTS, self.least), g))
            for _ in range(ROUNDS):
                off = self.off(self.left(self.data, rows))
                order = np.argsort(off, kind="stable")[:half]
                if set(order.tolist()) == set(rows.tolist()):
                    break
                rows = order
            size = float(np.sum(self.off(self.left(self.data, rows))[rows] ** 2))
            if size < best:
                best, found = size, rows
        return np.sort(self._near(found))

    def _near(self, rows: np.ndarray) -> np.ndarray:
        """All rows that lie no further off than normal errors of the size that some have."""
        off = self.off(self.left(self.data, rows))
        near = np.flatnonzero(off < CUT * scale_of(off))
        return near if len(near) >= self.least else rows

    def off(self, left: Array) -> Array:
        """How far off rows ``(g,)`` are, root mean square over the readings' sigmas; nan where none is read."""
        squares = (left / self.data.sigma[..., :3]) ** 2
        read = np.isfinite(squares).sum(axis=(1, 2))
        return np.sqrt(np.where(read > 0, np.nansum(squares, axis=(1, 2)) / np.maximum(read, 1), np.nan))


def scale_of(off: Array) -> float:
    """Of rows that are off so far ``(g,)``, over the readings' standard deviations; at least 1."""
    return max(MEDIAN_TO_SIGMA * float(np.median(off)), 1.0)


@dataclass(frozen=True)
class MistakenStretch:
    """Rows that have one mistake.

    Attributes:
        begin, end: the first row, and the one behind the last.
        ways: numbers of the changes that are about as probable, the best first.
        before, after: root mean square of the residual as read and put right, mm.
    """

    begin: int
    end: int
    ways: tuple[int, ...]
    before: float
    after: float


def mistaken_rows(beside: Beside[D]) -> Iterator[Finding]:
    """Rows in another unit, with another sign, exchanged or shifted, while the other rows fit."""
    g = len(beside.data)
    # what is as near as the other rows is a matter of the machine
    if g <= beside.least + LEAST_ROWS or g - len(beside.right) < LEAST_ROWS:
        return
    changes = list(beside.changes())
    for one in _stretches(beside, changes, beside.right):
        ways = [changes[w - 1] for w in one.ways]
        rows = beside.data.row[one.begin : one.end]
        others = "".join(f"; or {way.name}: {way.remedy.rstrip(',')}" for way in ways[1:])
        words = (
            f"{ways[0].name}: {one.before:.4g} mm are left there, while other rows fit; "
            f"{ways[0].remedy.rstrip(',')} there, and it is {one.after:.4g} mm{others}"
        )
        yield ColumnsMistaken(Grade.DOUBTFUL, f"{beside.data.file}: rows {rows[0]} to {rows[-1]}", words)


def _stretches(beside: Beside[D], changes: Sequence[Change[D]], rows: np.ndarray) -> Iterator[MistakenStretch]:
    left = [beside.left(beside.data, rows), *(beside.left(change.data, rows) for change in changes)]
    g = len(beside.data)
    scale = scale_of(beside.off(left[0])[rows])
    levels = np.array([_level(one / (scale * beside.data.sigma[..., :3])) for one in left])
    read = np.isfinite(left[0]).sum(axis=(1, 2))
    posture = np.unique(np.round(beside.data.q, 6), axis=0, return_inverse=True)[1].reshape(-1)
    for w, change in enumerate(changes, start=1):
        levels[w] -= read * np.log(change.factor)
        # what another row's readings say of a row at the end of the file is not known
        unknown = np.isfinite(left[w]).sum(axis=(1, 2)) != read
        levels[w, unknown] = np.inf
    levels[1:] = np.where(np.isfinite(levels[1:]), levels[1:], levels[0] + np.log(ODDS))
    path = most_probable(levels, rarity(len(changes)), np.zeros(len(levels), dtype=bool))
    for begin, end in runs(path):
        # more than half of the rows are no stretch beside the others
        far = end - begin - int(np.sum((rows >= begin) & (rows < end)))
        if path[begin] == 0 or min(far, _samples(posture, begin, end)) < LEAST_ROWS or 2 * (end - begin) > g:
            continue
        cost = levels[:, begin:end].sum(axis=1)
        gained = (cost[0] - cost) / (end - begin)
        squares = np.array([_squares(one[begin:end]) for one in left])
        factors = np.array([1.0, *(change.factor for change in changes)])
        # put right, more of the squares is explained than is left, in the readings' own unit
        possible = (gained > np.log(ODDS)) & (2.0 * squares / np.minimum(factors, 1.0) ** 2 <= squares[0])
        # and most rows are as near as right ones
        possible &= [float(np.median(beside.off(one)[begin:end])) < CUT * scale for one in left]
        possible[0] = False
        if not possible.any():
            continue
        ranked = np.where(possible, cost, np.inf)
        ways = np.flatnonzero(ranked <= ranked.min() + np.log(ODDS))
        yield MistakenStretch(
            begin, end, tuple(ways[np.argsort(ranked[ways], kind="stable")].tolist()),
            float(np.sqrt(squares[0])), float(np.sqrt(squares[ways].min())),
        )  # fmt: skip


def _samples(posture: np.ndarray, begin: int, end: int) -> int:
    """Of how many samples a stretch is: what a machine errs in one posture, it errs in all of its rows."""
    inside = posture[begin:end]
    whole = not np.isin(np.delete(posture, slice(begin, end)), inside).any()
    return len(np.unique(inside)) if whole else end - begin


def _level(scaled: Array) -> Array:
    """Negative logarithms ``(g,)`` of the probability of rows by Student's distribution, but for a constant."""
    result: Array = np.nansum(0.5 * (TAIL + 1.0) * np.log1p(scaled**2 / TAIL), axis=(1, 2))
    return result


def _squares(left: Array) -> float:
    """Mean square of what was read; infinite where nothing was."""
    known = left[np.isfinite(left)]
    return float(np.mean(known**2)) if len(known) else np.inf
