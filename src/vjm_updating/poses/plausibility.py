"""Data of poses and deflections that are not what their columns say: units, signs, axes, joints, markers, torques.

Also single rows that are not, while the other rows are.
"""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from scipy.special import stdtrit

from vjm.errors import NoConvergenceError
from vjm.io.findings import Finding, Grade, refuse, worst_first
from vjm.io.model_plausibility import model_findings
from vjm.machine.equilibria import unloaded_frames
from vjm.rotations import Array
from vjm_updating.constants import definition, numerical, physical_bound, stated_level
from vjm_updating.experiment.comparison import instead, machines, ratio_of, thousandfold, units_between
from vjm_updating.experiment.data_file import WRENCH, beyond_turn
from vjm_updating.experiment.implausible_readings import MISTAKES, OF_WHOLE, ReadColumns, column_findings, no_room
from vjm_updating.experiment.mistakes import (
    LEAST_ROWS,
    LENGTHS,
    ODDS,
    RIGHT,
    UNITS,
    ColumnsMistaken,
    Mistake,
    axes,
    mistaken_stretches,
    multiplied,
    reordered,
    shifted,
    swapped,
)
from vjm_updating.experiment.plausibility import said
from vjm_updating.inference.significance import CUT, FALSE_ALARMS, MEDIAN_TO_SIGMA, more_than_noise
from vjm_updating.poses.deflections import (
    COMPLIANCES,
    SHIFT,
    DeflectionData,
    DeflectionForward,
    DeflectionStudy,
    springs_to,
)
from vjm_updating.poses.families import LARGEST, LAWS, MILLIRADIAN, SECOND
from vjm_updating.poses.fit import solve
from vjm_updating.poses.forward import Frames, PoseForward
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.measurement import (
    DESCRIPTIONS,
    POSITION,
    TEMPERATURE,
    PoseData,
    PoseSheet,
    RobotMeasurement,
)
from vjm_updating.poses.pose_study import PoseStudy, align
from vjm_updating.poses.state import RANDOM, FittedState
from vjm_updating.poses.study import TAIL, Study

# --- How data of a robot may be mistaken: joints, markers, axes, units, rows --------------------------------------

QUARTERS = {"a quarter turn": 0.5 * np.pi, "a quarter turn back": -0.5 * np.pi, "half a turn": np.pi}
"""rad: what lies between the zeros of two conventions that describe one robot."""
MOST_TRIED = numerical(120)
"""Postures on which changes of the data are tried."""
NOISE_DISTANCE = definition(float(np.sqrt(8.0 / np.pi)))
"""Mean distance over the standard deviation of a coordinate, of three normal errors."""
D = TypeVar("D", bound=PoseData)
F = TypeVar("F")


def joints_meant(data: PoseData, machine: PoseMachine) -> Iterator[Mistake]:
    """Joints with other signs and zeros, or two columns exchanged."""
    joints = list(zip(data.joints, machine.slides, strict=True))
    for name, slides in joints:
        yield Mistake(f"joint_sign.{name}", remedy=f"multiply {name} by −1", factors={name: -1.0})
        for words, angle in QUARTERS.items() if not slides else ():
            remedy = f"turn the zero of {name} by {words} (add {angle:.6g} rad)"
            yield Mistake(f"joint_zero.{name}", remedy=remedy, added={name: angle})
    for (a, slides), (b, also) in itertools.combinations(joints, 2):
        if slides == also:
            remedy = f"exchange the columns of {a} and {b}"
            yield Mistake(f"joints_swapped.{a}.{b}", remedy=remedy, order=swapped((a, b)))


def in_units(what: str, vectors: Iterable[tuple[str, ...]]) -> Iterator[Mistake]:
    """Positions, displacements or loads in another unit of the table, by their columns."""
    for one in multiplied([name for own in vectors for name in own], UNITS, ""):
        (quantity, _, unit), factor = one.words.partition(" in "), next(iter(one.factors.values()))
        meant = what if quantity == "displacements" else quantity
        remedy = f"the {meant} are in {unit}: multiply them by {factor:g}"
        yield replace(one, words=f"{what}_in_{unit.split()[0]}", remedy=remedy)


def spread_of(position: Array) -> float:
    """How far positions ``(…, 3)`` lie from their mean, root mean square, mm; 0 where fewer than two were seen."""
    points = position.reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    return float(np.linalg.norm(points.std(axis=0))) if len(points) > 1 else 0.0


PARTS = numerical(8)
"""Of a file, with each of which the search for rows that are right begins."""
ROUNDS = numerical(10)
"""After which the rows that are right have been found, at most."""


class Beside(ABC, Generic[D, F]):
    """Readings of a test beside the nominal machine, of which frames or springs are fitted.

    Attributes:
        data: as read.
        least: number of rows to which frames or springs can be fitted.
        vectors: columns of each marker, three.
        columns: of ``q``, ``position`` and ``load`` of data, by the attribute's name.
        misses: what misses the readings, in words.
        farthest: mean error in mm above which no mistake explains what is missed.
    """

    misses: str
    farthest: float = np.inf

    def __init__(self, data: D, least: int, columns: tuple[str, ...]) -> None:
        self.data, self.least = data, least
        self.vectors = [tuple(f"{marker}.{column}" for column in columns) for marker in data.markers]
        self.columns = {"q": data.joints, "position": tuple(name for own in self.vectors for name in own)}
        self._to_rows: tuple[bytes, F] | None = None

    @abstractmethod
    def ways(self, *, whole: bool) -> Iterator[Mistake]:
        """Mistakes that rows may have, the simplest first; ``whole`` says whether all of the file have it."""

    def meant(self, way: Mistake, data: D, keep: np.ndarray) -> D:
        """Some rows of the data, by their indices, as they were meant."""
        if way.rows:
            return replace(data, position=reordered(self.data.position, np.arange(len(self.data)) + way.rows)[keep])
        right: dict[str, Any] = {}
        for name, columns in self.columns.items():
            if way.columns & set(columns):
                values = getattr(data, name)
                right[name] = way.put_right(values.reshape(len(data), -1), columns).reshape(values.shape)
        return replace(data, **right)

    @abstractmethod
    def fitted(self, data: D, rows: np.ndarray) -> F:
        """Frames or springs that bring the machine to some rows of data, by their indices."""

    @abstractmethod
    def residual(self, data: D, fitted: F) -> Array:
        """What the machine with these frames or springs misses of data ``(g, k, 3)`` mm."""

    def stands(self, data: D) -> bool:
        """Whether the machine can be in the postures of data."""
        return True

    def spread(self, data: D) -> float:
        """How far the readings of such a machine spread, mm: an error that is no smaller explains nothing."""
        return np.inf

    def unexplained(self, data: D, error: float) -> Iterator[Finding]:
        """What is said of an error in mm that no mistake explains."""
        return iter(())

    def left(self, data: D, rows: np.ndarray) -> Array:
        """Residuals ``(g, k, 3)`` mm of all rows of data, with what is fitted to some rows as they were read."""
        if self._to_rows is None or self._to_rows[0] != rows.tobytes():
            self._to_rows = rows.tobytes(), self.fitted(self.data, rows)
        return self.residual(data, self._to_rows[1])

    def error(self, data: D) -> float:
        """Mean distance in mm of readings from the machine fitted to all; infinite where it does not stand."""
        if not self.stands(data):
            return np.inf
        fitted = self.fitted(data, np.arange(len(data)))
        squares = self.residual(data, fitted) ** 2
        seen = np.isfinite(squares)
        free = 1.0 - self.used(fitted) / max(int(seen.sum()), 1)
        mean = float(np.sqrt(np.nansum(squares, axis=2))[seen.any(axis=2)].mean())
        return mean / np.sqrt(free) if free > 0.0 else np.inf

    def used(self, fitted: F) -> int:
        """Numbers by which readings are brought nearer, which counts where they are many."""
        return 0

    def by_laws(self) -> float:
        """The mean error in mm that other laws of the machine leave of all readings as they are."""
        return np.inf

    @cached_property
    def right(self) -> np.ndarray:
        """Indices of the rows on which most agree, by least trimmed squares (Rousseeuw, JASA 79, 1984).

        It begins with each part of the file, since mistakes stand in blocks. From a fit to some rows the half that
        it misses least is fitted next, until that half stays.
        """
        g = len(self.data)
        half = max(g // 2 + 1, min(self.least, g))
        best, best_rows = np.inf, np.arange(g)
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
                best, best_rows = size, rows
        return np.sort(self._near(best_rows))

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


def mistaken_everywhere(beside: Beside[D, F]) -> Iterator[Finding]:
    """What explains the machine's error in all of a file: signs, zeros, exchanged columns, a unit, shifted rows.

    It is named where it explains more of the squared error than it leaves, and what it leaves is a machine's.
    Other laws of the machine must leave more of the readings as they are. Else these explain them.
    """
    g = len(beside.data)
    keep = np.linspace(0, g - 1, min(g, MOST_TRIED)).astype(int)
    data = beside.data.only(keep)
    base, seen = beside.error(data), np.isfinite(data.position)
    noise = NOISE_DISTANCE * float(np.median(data.sigma[..., :3][seen]))
    if not more_than_noise(base / noise, float(seen.sum())):
        return
    tried = [(beside.error(beside.meant(way, data, keep)), way) for way in beside.ways(whole=True)]
    least = min(error for error, _ in tried)
    # of those that do as well the simplest, which comes first
    error, way = next(one for one in tried if one[0] <= 1.02 * least)
    if beside.by_laws() <= error:
        return
    # positions in a smaller unit miss by less, though they follow the machine no better: it must do so, too
    if error > beside.farthest or 2.0 * error**2 > min(base, beside.spread(data)) ** 2:
        yield from beside.unexplained(data, base)
        return
    words = f"{way.words}: {beside.misses} by {base:.4g} mm; {way.remedy} and it is {error:.4g} mm"
    if more_than_noise(error / noise, float(seen.sum())):
        words += f", still {error / noise:.1f} times what the noise makes: that is not all that is wrong"
    yield ColumnsMistaken(Grade.DOUBTFUL, data.file, words)


def mistaken_rows(beside: Beside[D, F]) -> Iterator[Finding]:
    """Rows in another unit, with another sign, exchanged or shifted, while the other rows fit.

    There are none where other laws of the machine bring all rows as near.
    """
    g, rows = len(beside.data), beside.right
    # what is as near as the other rows is a matter of the machine
    if g <= beside.least + LEAST_ROWS or g - len(rows) < LEAST_ROWS:
        return
    if beside.by_laws() <= beside.error(beside.data.only(rows)):
        return
    ways = [RIGHT, *beside.ways(whole=False)]
    left = [beside.left(beside.meant(way, beside.data, np.arange(g)), rows) for way in ways]
    scale = scale_of(beside.off(left[0])[rows])
    # negative logarithms of the probability of rows by Student's distribution, but for a constant
    scaled = [(one / (scale * beside.data.sigma[..., :3])) ** 2 for one in left]
    levels = np.array([np.nansum(0.5 * (TAIL + 1.0) * np.log1p(one / TAIL), axis=(1, 2)) for one in scaled])
    read = np.isfinite(left[0]).sum(axis=(1, 2))
    factors = np.array([abs(way.factors.get(beside.vectors[0][0], 1.0)) for way in ways])
    levels -= read * np.log(factors)[:, None]
    # what another row's readings say of a row at the end of the file is not known
    levels[[np.isfinite(one).sum(axis=(1, 2)) != read for one in left]] = np.inf
    levels[1:] = np.where(np.isfinite(levels[1:]), levels[1:], levels[0] + np.log(ODDS))
    posture = np.unique(np.round(beside.data.q, 6), axis=0, return_inverse=True)[1].reshape(-1)

    def squares(begin: int, end: int) -> Array:
        """Mean squares of what was read; infinite where nothing was."""
        known = [one[begin:end][np.isfinite(one[begin:end])] for one in left]
        return np.array([float(np.mean(one**2)) if len(one) else np.inf for one in known])

    def judged(begin: int, end: int) -> tuple[np.ndarray, Array]:
        cost = levels[:, begin:end].sum(axis=1)
        gained = (cost[0] - cost) / (end - begin)
        # put right, more of the squares is explained than is left, in the readings' own unit
        own = squares(begin, end)
        possible = (gained > np.log(ODDS)) & (2.0 * own / np.minimum(factors, 1.0) ** 2 <= own[0])
        # and most rows are as near as right ones
        possible &= [float(np.median(beside.off(one)[begin:end])) < CUT * scale for one in left]
        # more than half of the rows are no stretch beside the others
        far = end - begin - int(np.sum((rows >= begin) & (rows < end)))
        possible &= min(far, _samples(posture, begin, end)) >= LEAST_ROWS and 2 * (end - begin) <= g
        return possible, cost

    for begin, end, costs in mistaken_stretches(levels, judged):
        first, *others = [ways[w] for w in costs]
        own, lines = squares(begin, end), beside.data.row[begin:end]
        words = (
            f"{first.words}: {np.sqrt(own[0]):.4g} mm are left there, while other rows fit; "
            f"{first.remedy.rstrip(',')} there, and it is {np.sqrt(own[list(costs)].min()):.4g} mm"
            + "".join(f"; or {way.words}: {way.remedy.rstrip(',')}" for way in others)
        )
        yield ColumnsMistaken(Grade.DOUBTFUL, f"{beside.data.file}: rows {lines[0]} to {lines[-1]}", words)


def _samples(posture: np.ndarray, begin: int, end: int) -> int:
    """Of how many samples a stretch is: what a machine errs in one posture, it errs in all of its rows."""
    inside = posture[begin:end]
    whole = not np.isin(np.delete(posture, slice(begin, end)), inside).any()
    return len(np.unique(inside)) if whole else end - begin


FARTHEST = LARGEST["joint_offset"] * MILLIRADIAN
"""Mean error of the rigid robot over its reach, above which no zero of a joint can be the cause."""
LARGEST_TURN = physical_bound(4.0 * np.pi, "rad")
"""rad: no joint of a robot turns further."""
EARTH = physical_bound((9.5, 10.5), "m/s²")
"""m/s²: what rounds to 10, as some write it; at sea level it is 9.78 to 9.83."""
SPRINGS = "actuator_compliance"
REVERSED = stated_level(8.0)
"""Standard deviations by which springs must deflect against the weight before gravity is doubted."""
ALIKE = physical_bound((0.5, 2.0))
"""Factors between measured and modelled torques that unknown masses can make."""


def considered(measurement: RobotMeasurement, study: PoseStudy, *, strict: bool = False) -> list[Finding]:
    """What is implausible about a test and its model; see `judged`."""
    rules = (outliers, repeated, few, torques, temperature, gravity)
    # rows that were left out as outliers may be a stretch that is mistaken
    beside, known = (BesideRigid(study.machine, study.sheet, data) for data in (measurement.data, study.data))
    findings = [] if study.sheet.base is not None else [*mistaken_rows(beside)] or [*mistaken_everywhere(known)]
    findings += [
        *columns_of(beside, named=bool(findings)),
        *(one for rule in rules for one in rule(study)),
    ]
    return judged(measurement, findings, strict=strict)


def columns_of(beside: Beside[D, F], *, named: bool) -> Iterator[Finding]:
    """Mistakes in positions or displacements, see `vjm_updating.experiment.implausible_readings`.

    Where a mistake in all of the file is ``named``, another order, or zero, would say it once more.
    """
    data = beside.data
    g = len(data)
    predicted = data.position - beside.left(data, beside.right)
    noise = np.median(data.sigma.reshape(g, -1), axis=0)
    yield from column_findings(
        ReadColumns(
            data.file, data.row, beside.columns["position"], data.position.reshape(g, -1), noise,
            predicted.reshape(g, -1), np.zeros(g, dtype=int), np.arange(g),
        ), MISTAKES, () if named else OF_WHOLE,
    )  # fmt: skip


class RobotMisses(Finding):
    """The rigid robot misses, and no change of the data explains it.

    What is fitted must explain it wholly to be believed.
    """


class BesideRigid(Beside[PoseData, Frames]):
    """Positions beside the rigid robot, with the frames of the tracker and the markers fitted."""

    misses = "the rigid robot misses the markers"

    def __init__(self, machine: PoseMachine, sheet: PoseSheet, data: PoseData) -> None:
        super().__init__(data, PoseForward(machine, data, sheet.test.gravity).nuisances, POSITION)
        self.machine, self.farthest = machine, FARTHEST * machine.tree.reach
        self.sigma = np.array([table.sigma_mm for table in sheet.markers.values()])

    def ways(self, *, whole: bool) -> Iterator[Mistake]:
        """See `Beside`."""
        data, names, vectors = self.data, self.data.joints, self.vectors
        yield from joints_meant(data, self.machine)
        if len(names) > 1 and len(set(self.machine.slides)) == 1:
            reverse = dict(zip(names, names[::-1], strict=True))
            yield Mistake("joints_reversed", remedy="reverse the joints' order", order=reverse)
            for by in range(1, len(names)):
                words = f"the column of {names[by]} is that of {names[0]}, and so on around"
                order = dict(zip(names, names[by:] + names[:by], strict=True))
                yield Mistake(f"joints_shifted.{by}", remedy=words, order=order)
        for (a, own), (b, others) in itertools.combinations(zip(data.markers, vectors, strict=True), 2):
            order = swapped(*zip(own, others, strict=True))
            yield Mistake(f"markers_swapped.{a}.{b}", remedy=f"exchange the markers {a} and {b}", order=order)
        words = "the tracker's axes are left-handed: exchange two of them or reverse one,"
        yield Mistake("tracker_mirrored", remedy=words, factors={own[0]: -1.0 for own in vectors})
        yield from in_units("positions", vectors)
        seen = np.asarray(np.isfinite(data.position).any(axis=(0, 1)))
        yield from axes("position_axes", "positions", seen, vectors)
        yield from shifted(len(data) - 1, "positions")

    def fitted(self, data: PoseData, rows: np.ndarray) -> Frames:
        """See `Beside`."""
        R, p = self._ends(data)
        return align(R[rows], p[rows], data.position[rows], data.orientation[rows], self.sigma, None)[0]

    def residual(self, data: PoseData, fitted: Frames) -> Array:
        """See `Beside`."""
        R, p = self._ends(data)
        seen = (p + np.einsum("gkab,kb->gka", R, fitted.m)) @ fitted.R.T + fitted.t
        return data.position - seen

    def stands(self, data: PoseData) -> bool:
        """Whether no joint is off its beam."""
        return not self.machine.moves or bool(np.all(self.machine.tree.limits.kept(self.machine.rows(data.q))))

    def spread(self, data: PoseData) -> float:
        """Spread of the rigid robot's ends where markers were seen, mm."""
        return spread_of(np.where(np.isfinite(data.position), self._ends(data)[1], np.nan))

    def unexplained(self, data: PoseData, error: float) -> Iterator[Finding]:
        """Positions of another scale that is no unit's, and a robot that is not this one."""
        spread = self.spread(data)
        times = spread_of(data.position) / spread
        scaled = self.error(replace(data, position=data.position / times)) if times > 0.0 else np.inf
        if scaled <= self.farthest and 2.0 * scaled**2 <= min(error, spread) ** 2:
            words = (
                f"positions_scaled: {self.misses} by {error:.4g} mm; the positions spread {times:.3g} times as far "
                f"as the robot's, which no unit explains. With that undone it is {scaled:.4g} mm"
            )
            yield ColumnsMistaken(Grade.DOUBTFUL, data.file, words)
        elif error > self.farthest:
            words = (
                f"rigid_robot: misses the markers by {error:.4g} mm, {error / self.machine.tree.reach:.0%} of its "
                "reach. No joint's sign or zero, no two joints or markers exchanged, no unit and no other order "
                "explains it. Look at the model, the joints' names and units, the part behind which each marker "
                "rides"
            )
            yield RobotMisses(Grade.DOUBTFUL, data.file, words)

    def _ends(self, data: PoseData) -> tuple[Array, Array]:
        return unloaded_frames(self.machine.tree, self.machine.rows(data.q))


def judged(measurement: RobotMeasurement, findings: Iterable[Finding], *, strict: bool) -> list[Finding]:
    """Findings with those of the model file, refusals first; ``strict`` refuses what is doubtful, too.

    Raises:
        ImplausibleError: naming the first reason.
    """
    model, name = measurement.model, f"{measurement.sheet.file}, model {measurement.sheet.test.model}"
    described = Path(measurement.sheet.test.model).suffix in DESCRIPTIONS
    of_model = [] if described else model_findings(model.document, name, may_be_rigid=measurement.sheet.test.rigid)
    doubts = (Finding(Grade.DOUBTFUL, name, doubt) for doubt in model.doubts)
    notes = (Finding(Grade.NOTED, name, note) for note in model.notes)
    result = worst_first([*findings, *doubts, *of_model, *notes])
    refuse(result, strict=strict)
    return result


def units(measurement: RobotMeasurement) -> Iterator[Finding]:
    """Angles in degrees and lengths in another unit, with the factor; they are seen before anything is computed."""
    data, machine = measurement.data, measurement.model.machine
    yield from coordinates(data, machine)
    assert isinstance(measurement.sheet, PoseSheet)
    rigid = BesideRigid(machine, measurement.sheet, data)
    spread, expected = spread_of(data.position), rigid.spread(data)
    if spread == 0.0 and expected > 0.0:
        yield Finding(Grade.REFUSED, data.file, "the markers' positions are all the same: nothing moved")
    if 0.0 < spread < 1e-2 * machine.tree.reach and expected > 1e-1 * machine.tree.reach:
        seen = f"the markers' positions spread over {spread:.3g} mm, the robot's over {expected:.3g} mm: "
        times = expected / spread

        def left(factor: float) -> float:
            return rigid.error(replace(data, position=data.position * factor))

        unit = min(LENGTHS, key=lambda name: left(LENGTHS[name]))
        # a unit explains them where the robot's own size does no better
        if left(LENGTHS[unit]) ** 2 <= 2 * left(times) ** 2:
            words = f"they are in {unit}; multiply them by {LENGTHS[unit]:g}"
        else:
            words = f"{times:.3g} times as much, which no unit explains; look at the export and the model"
        yield Finding(Grade.REFUSED, data.file, seen + words)


def coordinates(data: PoseData, machine: PoseMachine) -> Iterator[Finding]:
    """Joints' angles in degrees, and beams that would be out by more than they have."""
    for i, (name, slides) in enumerate(zip(data.joints, machine.slides, strict=True)):
        largest = float(np.abs(data.q[:, i]).max())
        if not slides and largest > LARGEST_TURN:
            why = beyond_turn(largest, LARGEST_TURN, "Multiply it by 0.0174533")
            words = f"column {name}.q_rad reaches {largest:.4g} rad, {largest / (2 * np.pi):.3g} turns: {why}"
            yield Finding(Grade.REFUSED, data.file, words)
    for name, beam in machine.chain.pushing.items():
        q = data.q[:, data.joints.index(name)]
        if q.min() <= 0.0 or q.max() > beam.length:
            first = int(np.argmax((q <= 0.0) | (q > beam.length)))
            where = f"{data.file}, row {data.row[first]}, column {name}.q_mm"
            words = f"= {q[first]:.4g} is outside 0 to {beam.length:.4g} mm, the whole of '{beam.name}': "
            yield Finding(Grade.REFUSED, where, words + "give mm of it that are out")


def check_count(study: PoseStudy) -> None:
    """Refuse a test that has fewer readings, while a part is held out, than the frames and joints have unknowns.

    Raises:
        ImplausibleError: it is.
    """
    frames, joints = study.forward().nuisances, len(study.data.joints)
    different = int(study.folds.posture.max()) + 1
    each = study.present.sum() / len(study.data)
    fewest = next(n for n in itertools.count(2) if (n - math.ceil(n / RANDOM)) * each > frames + joints)
    if study.sheet.base is None and different < fewest:
        words = (
            f"{different} different postures with {each:.3g} readings each; the frames of tracker and markers are "
            f"{frames} unknowns, and each joint has one. Measure at least {fewest} different postures, or better 30"
        )
        refuse([Finding(Grade.REFUSED, study.data.file, words)])


def outliers(study: Study) -> Iterator[Finding]:
    """Positions that are left out."""
    for first in study.outliers[:1]:
        more = f" (and {len(study.outliers) - 1} more)" if len(study.outliers) > 1 else ""
        words = f"{first.marker} is {first.distance:.4g} mm off what the other rows say: an outlier, left out{more}"
        yield Finding(Grade.NOTED, f"{study.data.file}, row {first.row}", words)


def repeated(study: Study) -> Iterator[Finding]:
    """Postures that were measured more than once: they tell noise, and no more of the robot."""
    different = int(study.folds.posture.max()) + 1
    if different < len(study.data):
        words = f"{len(study.data)} rows are {different} different postures; the same ones are held out together"
        yield Finding(Grade.NOTED, study.data.file, words)


def few(study: Study) -> Iterator[Finding]:
    """Families of more members than there are readings beyond the frames."""
    count = int(study.present.sum()) - study.forward().nuisances
    sizes = {family: sum(m.family == family for m in study.members) for family in study.families}
    if large := [f"{family} ({size})" for family, size in sizes.items() if size > count]:
        words = f"{count} readings beyond the frames are fewer than the members of {', '.join(large)}: "
        yield Finding(Grade.NOTED, study.data.file, words + "what they do not tell stays at its prior")


def temperature(study: PoseStudy) -> Iterator[Finding]:
    """Temperatures that no room has."""
    if study.data.temperature is not None:
        yield from no_room(study.data.temperature, f"{study.data.file}: column {TEMPERATURE}")


def gravity(study: Study) -> Iterator[Finding]:
    """A gravity that is none of the Earth's."""
    size = float(np.linalg.norm(study.sheet.test.gravity))
    if not EARTH[0] <= size <= EARTH[1]:
        words = f"is {size:.4g} m/s², the Earth's is 9.81: write it in m/s², in the axes of the robot's base"
        yield Finding(Grade.DOUBTFUL, f"{study.sheet.file}: [test] gravity", words)


def weight_reversed(study: Study, state: FittedState) -> Iterator[Finding]:
    """Joints that deflect against the weight: gravity or the coordinates' sense is the other one.

    Compares the evidence of joint compliance with that of the same springs under the weight reversed, to first
    order, beside all else that the hypothesis holds.
    """
    if SPRINGS not in study.families:
        return
    own = study.number(SPRINGS)
    # functions of posture or clock can imitate a weight of either sense
    held = [family for family in state.hypothesis.families if family not in SECOND]
    families = sorted({*map(study.number, held), own})
    sign = np.where(state.blocks.family == own, -1.0, 1.0)
    blocks = state.blocks
    lower = np.where(sign < 0.0, np.maximum(blocks.lower, 0.0), blocks.lower)
    solution = solve(replace(blocks, N=blocks.N * np.outer(sign, sign), b=blocks.b * sign, lower=lower), families)
    without = max(
        solve(blocks, [f for f in families if f != own]).log_evidence, solve(blocks, families).log_evidence
    )
    if solution.log_evidence - without > 0.5 * REVERSED**2:
        where, words = study.against
        yield Finding(Grade.DOUBTFUL, f"{study.sheet.file}: {where}", words)


def torques(study: PoseStudy) -> Iterator[Finding]:
    """Measured torques that are those of the model by a factor: another sign, unit or gear ratio."""
    data = study.data
    if not np.isfinite(data.torque).any():
        return
    expected = study.holding_torques()
    for i, name in enumerate(data.joints):
        own = np.isfinite(data.torque[:, i])
        x, y = expected[own, i], data.torque[own, i]
        factor, low, high = factor_between(x, y, FALSE_ALARMS / len(data.joints))
        alike = low <= ALIKE[1] and high >= ALIKE[0]
        if low <= 0.0 or (alike and factor > 0.0):
            continue
        unit = "N" if study.machine.slides[i] else "N mm"
        sign = "the sign is the other one" if alike else f"give {unit} at the joint"
        where, words = (
            f"{data.file}, column {name}.tau_{unit.replace(' ', '')}",
            "times what holds the model's weight",
        )
        yield Finding(Grade.DOUBTFUL, where, f"is {factor:.3g} {words}: {sign}")


def factor_between(x: Array, y: Array, chance: float) -> tuple[float, float, float]:
    """Factor from one quantity to another, both with errors, and the least and the largest that its size may be.

    Errors of ``x`` make the slope of ``y`` on it too small, those of ``y`` make the other regression's too large.
    The factor lies between the two (Frisch, Statistical Confluence Analysis, 1934), each with its standard error.

    Args:
        x: values ``(n,)``.
        y: values ``(n,)`` beside them.
        chance: that the factor has the other sign, or its size is outside.

    Returns:
        The slope, and the two sizes; the least is not above 0 where the sign is not known.
    """
    if len(x) < 3 or not np.ptp(x) > 0.0 or not np.ptp(y) > 0.0:
        return 0.0, 0.0, np.inf
    followed = min(float(np.corrcoef(x, y)[0, 1]) ** 2, 1.0)
    slope = float(np.cov(x, y)[0, 1] / np.var(x, ddof=1))
    if followed == 0.0:
        return slope, 0.0, np.inf
    error = -float(stdtrit(len(x) - 2, 0.5 * chance)) * np.sqrt((1.0 / followed - 1.0) / (len(x) - 2))
    return slope, abs(slope) * (1.0 - error), abs(slope) / followed * (1.0 + error)


# --- Deflections that are not what their columns say, and too few of them -----------------------------------------

STEEL = definition(2.1e5, "N/mm²")
SLENDER = physical_bound(10.0)
"""Length over thickness of the solid steel rod that no serial arm is stiffer than."""
SAGS = physical_bound(0.01)
"""Of its distance from the base: what the weight of a kilogram moves no arm by."""
KILOGRAM = definition(9.81, "N")


def deflection_units(data: DeflectionData, machine: PoseMachine) -> list[Finding]:
    """Angles in degrees and displacements in metres, with the factor."""
    return [*coordinates(data, machine), *impossible_size(data, machine)]


def check_deflection_count(study: DeflectionStudy) -> None:
    """Refuse a test with fewer different readings than joints.

    Raises:
        ImplausibleError: it is.
    """
    rows = np.column_stack([study.data.q, study.data.load.reshape(len(study.data), -1)])
    different, joints = len(np.unique(np.round(rows, 6), axis=0)), len(study.data.joints)
    if different < joints:
        words = (
            f"{different} different readings are fewer than the {joints} joints: measure at least {joints} "
            "postures or loads, 20 are better"
        )
        refuse([Finding(Grade.REFUSED, study.data.file, words)])


def deflections_considered(
    measurement: RobotMeasurement, study: DeflectionStudy, *, strict: bool = False
) -> list[Finding]:
    """What is implausible about a test and its model; see `judged`."""
    rules = (another_unit, outliers, few, gravity)
    findings = [*impossible_size(study.data, study.machine), *(one for rule in rules for one in rule(study))]
    data = measurement.data
    assert isinstance(data, DeflectionData)
    # rows that were left out as outliers may be a stretch that is mistaken
    beside = BesideSprings(study, data)
    mistaken = [*mistaken_rows(beside)] or [*mistaken_everywhere(BesideSprings(study, study.data))]
    findings += [*mistaken, *columns_of(beside, named=bool(mistaken))]
    return judged(measurement, findings, strict=strict)


class BesideSprings(Beside[DeflectionData, Array]):
    """Displacements beside those of springs of the joints and of their bearings, none negative.

    The joints' springs may have laws beside, families of `LAWS`: cracked, hardening, with backlash.
    """

    misses = "the model with springs in its joints misses the displacements"

    def __init__(self, study: DeflectionStudy, data: DeflectionData, laws: tuple[str, ...] = ()) -> None:
        super().__init__(data, len(data.joints), SHIFT)
        self.columns["load"] = tuple(f"{point}.{name}" for point in data.loads for name in WRENCH)
        self.study = study
        self.members = [member for member in study.members if member.family in (*COMPLIANCES[:2], *laws)]
        self._known: list[tuple[Array, Array, tuple[Array, Array, Array]]] = []

    def ways(self, *, whole: bool) -> Iterator[Mistake]:
        """See `Beside`; springs of any size explain another unit of all. Axes that are found cannot be wrong."""
        data, sheet = self.data, self.study.sheet
        if not whole:
            yield from in_units("displacements", self.vectors)
            there = zip(self.columns["load"], data.given.ravel().tolist(), strict=True)
            yield from in_units("loads", [tuple(name for name, given in there if given)])
        words = "reverse the sign of the displacements, which are unloaded minus loaded, or that of the loads,"
        yield Mistake("sign_reversed", remedy=words, factors=dict.fromkeys(self.columns["position"], -1.0))
        if sheet.tracker.axes == "base":
            seen = np.asarray(np.isfinite(data.position).any(axis=(0, 1)))
            yield from axes("displacement_axes", "displacements", seen, self.vectors)
        for j, point in enumerate(data.loads):
            own, given = self.columns["load"][6 * j : 6 * j + 6], data.given[j].reshape(2, 3).any(axis=0)
            yield from axes(f"load_axes.{point}", f"columns of {point}", given, [own[:3]], [own[3:]])
            other = "tool" if sheet.loads[point].axes == "base" else "base"
            remedy = f"write axes = '{other}' in [loads.{point}]"
            yield Mistake(f"load_axes.{point}.{other}", remedy=remedy, axes=point)
        yield from joints_meant(data, self.study.machine)
        yield from shifted(len(data) - 1, "displacements")

    def meant(self, way: Mistake, data: DeflectionData, keep: np.ndarray) -> DeflectionData:
        """See `Beside`; a load in the tool's axes turns with the robot."""
        if not way.axes:
            return super().meant(way, data, keep)
        point, load, tree = data.loads.index(way.axes), data.load.copy(), self.study.machine.tree
        R = unloaded_frames(tree, self.study.machine.rows(data.q))[0][:, len(data.markers) + point]
        if self.study.sheet.loads[way.axes].axes == "tool":
            R = np.swapaxes(R, 1, 2)
        for half in (slice(0, 3), slice(3, 6)):
            load[:, point, half] = np.einsum("gab,gb->ga", R, load[:, point, half])
        return replace(data, load=load)

    def fitted(self, data: DeflectionData, rows: np.ndarray) -> Array:
        """See `Beside`: sizes ``(P,)`` of the springs."""
        moved, J, lower = self._moved(data)
        y = (data.position - moved)[rows]
        seen = np.isfinite(y)
        sigma = data.sigma[rows][seen]
        return springs_to(J[rows][seen] / sigma[:, None], y[seen] / sigma, lower)

    def used(self, fitted: Array) -> int:
        """See `Beside`: as many springs as readings explain any."""
        return int(np.count_nonzero(fitted))

    def by_laws(self) -> float:
        """See `Beside`."""
        return BesideSprings(self.study, self.data, LAWS).error(self.data)

    def residual(self, data: DeflectionData, fitted: Array) -> Array:
        """See `Beside`."""
        moved, J, _ = self._moved(data)
        return data.position - moved - J @ fitted

    def stands(self, data: DeflectionData) -> bool:
        """Whether the machine has an equilibrium in each posture."""
        return bool(np.isfinite(self._moved(data)[0]).all())

    def _moved(self, data: DeflectionData) -> tuple[Array, Array, Array]:
        """Displacements ``(g, k, 3)`` mm without springs, by each spring ``(g, k, 3, P)``, its least ``(P,)``."""
        # changes of the displacements alone leave postures and loads as they are
        for q, load, displacements in self._known:
            if q is data.q and load is data.load:
                return displacements
        every = replace(data, position=np.zeros_like(data.position))
        try:
            forward = self.study.of_others(self.members, self.study.machine, every)
            linearised = forward.evaluate(np.zeros(len(self.members)), self.study.frames)
            displacement, J = -linearised.residual[..., :3], linearised.member[..., :3, :]
        except NoConvergenceError:
            shape = data.position.shape
            displacement, J = np.full(shape, np.inf), np.zeros((*shape, len(self.members)))
        lower = np.array([member.low for member in self.members])
        own = {member.subject: i for i, member in enumerate(self.members) if member.family == COMPLIANCES[0]}
        for i, law in enumerate(self.members):
            if law.family == LAWS[0] and law.subject in own:
                # a spring for either side, neither below its least
                spring = own[law.subject]
                half = J[..., i] * (self.members[spring].scale / law.scale)
                J[..., i], J[..., spring] = 0.5 * (J[..., spring] - half), 0.5 * (J[..., spring] + half)
                lower[i] = lower[spring]
        # what has either sign is the difference of two that have none
        either = np.isinf(lower)
        J, lower = np.concatenate([J, -J[..., either]], axis=-1), np.where(either, 0.0, lower)
        displacements = displacement, J, np.concatenate([lower, np.zeros(int(either.sum()))])
        self._known.append((data.q, data.load, displacements))
        return displacements


def impossible_size(data: DeflectionData, machine: PoseMachine) -> Iterator[Finding]:
    """Loads over displacements of a robot stiffer than solid steel, or of one that would fall."""
    if not np.nan_to_num(data.position).any():
        yield Finding(Grade.REFUSED, data.file, "the displacements are all zero: nothing moved")
        return
    place = unloaded_frames(machine.tree, machine.rows(data.q))[1][:, : len(data.markers)]
    force, moment = (np.linalg.norm(half, axis=2).sum(axis=1) for half in (data.load[..., :3], data.load[..., 3:]))
    size = np.linalg.norm(np.nan_to_num(data.position), axis=2)
    # of the marker that moves most: its distance from the base, and the stiffnesses that a robot may have there
    j = int(np.argmax(size.max(axis=0)))
    reach = float(np.nanmedian(np.linalg.norm(place[:, j], axis=1)))
    least, most = KILOGRAM / (SAGS * reach), 3.0 * STEEL * np.pi / 64.0 * reach / SLENDER**4
    loaded = (force + moment > 0.0) & np.isfinite(data.position[:, j]).all(axis=1)
    if not loaded.any() or not size[loaded, j].any():
        return
    acts = force[loaded] + moment[loaded] / max(reach, 1.0)
    stiffness = float(acts.sum() / size[loaded, j].sum())
    if least <= stiffness <= most:
        return
    softer = {f"displacements in {unit}": (f, stiffness / f) for unit, f in LENGTHS.items()}
    forces = {words: (f, stiffness * f) for words, f, _ in UNITS if words.startswith("forces")}
    units = [
        f"the {words} (multiply them by {f:g})"
        for words, (f, meant) in (softer | forces if stiffness > most else forces | softer).items()
        if least <= meant <= most
    ]
    why = f"are {' or '.join(units)}?" if units else "no unit explains it"
    words = f"the loads over the displacements are {stiffness:.3g} N/mm. "
    if stiffness > most:
        words += f"A solid steel rod as long, {reach:.4g} mm, and a tenth of it thick has {most:.3g}: {why}"
        yield Finding(Grade.REFUSED, data.file, words)
    else:
        words += f"A kilogram would move the robot by {KILOGRAM / stiffness:.3g} mm. {why[0].upper()}{why[1:]}"
        yield ColumnsMistaken(Grade.DOUBTFUL, data.file, words)


def another_unit(study: DeflectionStudy) -> Iterator[Finding]:
    """Displacements that are as many times what the model predicts, where it deflects, as no machine's are.

    A factor of a thousand is refused. Any other one is a machine that much softer as well as another unit.
    """
    forward = DeflectionForward(study.machine, study.data, study.sheet)
    try:
        linearised = forward.evaluate(np.zeros(len(forward.members)), study.frames)
    except NoConvergenceError:
        return  # said by the fit
    read = study.data.position
    predicted = read - linearised.residual[..., :3]
    seen = np.isfinite(predicted)
    if not seen.any():
        return
    ratio = ratio_of(read[seen], predicted[seen])
    are = f"the displacements are about {said(abs(ratio[1]))} what the model predicts"
    units = units_between(ratio, SHIFT[0], WRENCH[0])
    if thousandfold(ratio):
        asked = ", or ".join(instead(unit, of, unit.partition(" ")[0]) for unit, of in units.items())
        yield Finding(Grade.REFUSED, study.data.file, f"{are}, a factor 1000: are {asked}? Convert them")
    elif units and ratio[0] > 0.0 and not any(map(machines, ratio)):
        words = (
            f"they may be in another unit ({', or '.join(units)}), or the machine differs so much from its model"
        )
        yield Finding(Grade.DOUBTFUL, study.data.file, f"{are}: {words}")
