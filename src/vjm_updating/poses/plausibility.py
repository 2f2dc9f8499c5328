"""Data that are not what their columns say: units, joints' order and signs, markers, repeated postures, torques."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.special import stdtrit

from vjm.io.findings import Finding, Grade, refuse, worst_first
from vjm.io.model_plausibility import model_findings
from vjm.rotations import Array
from vjm.tree.equilibria import unloaded_frames
from vjm_updating.constants import physical_bound, stated_level
from vjm_updating.experiment.channels import beyond_turn
from vjm_updating.experiment.implausible_columns import MISTAKES, OF_WHOLE, ReadColumns, column_findings
from vjm_updating.experiment.implausible_rows import no_room
from vjm_updating.experiment.mistakes import LENGTHS, columns_mistaken
from vjm_updating.observation.significance import FALSE_ALARMS
from vjm_updating.poses.alignment import align
from vjm_updating.poses.families import SECOND
from vjm_updating.poses.fit import solve
from vjm_updating.poses.folds import RANDOM
from vjm_updating.poses.forward import Frames
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.measurement import DESCRIPTIONS, RobotMeasurement
from vjm_updating.poses.mistaken_rows import (
    Beside,
    Change,
    D,
    RobotMisses,
    changes_of_poses,
    joints_and_markers,
    mistaken_rows,
    rigid_error,
    rigid_spread,
    spread_of,
)
from vjm_updating.poses.pose_study import PoseStudy
from vjm_updating.poses.readings import POSITION, TEMPERATURE, PoseData
from vjm_updating.poses.state import FittedState
from vjm_updating.poses.study import Study

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
    """What is implausible about a test and its model, refusals first, unless it is refused for that.

    Args:
        measurement: the test.
        study: the same, aligned.
        strict: whether what is doubtful is refused, too.

    Raises:
        ImplausibleError: naming the first reason.
    """
    rules = (outliers, repeated, few, torques, temperature, gravity)
    # rows that were left out as outliers may be a stretch that is mistaken
    beside = BesideRigid(study, measurement.data)
    found = [] if study.sheet.base is not None else [*mistaken_rows(beside)]
    found = found or [*joints_and_markers(study)]
    found += [
        *columns_of(beside, POSITION, named=bool(found)),
        *(one for rule in rules for one in rule(study)),
    ]
    return judged(measurement, found, strict=strict)


def columns_of(beside: Beside[D], names: tuple[str, ...], *, named: bool) -> Iterator[Finding]:
    """Mistakes in positions or displacements, see `vjm_updating.experiment.implausible_columns`.

    Args:
        beside: what was read, beside the machine.
        names: of its columns.
        named: whether a mistake in all of the file is named: another order, or zero, would say it once more.
    """
    data = beside.data
    g, labels = len(data), tuple(f"{marker}.{name}" for marker in data.markers for name in names)
    predicted = data.position - beside.left(data, beside.right)
    noise = np.median(data.sigma.reshape(g, -1), axis=0)
    yield from column_findings(
        ReadColumns(
            data.file, data.row, labels, data.position.reshape(g, -1), noise, predicted.reshape(g, -1),
            np.zeros(g, dtype=int), np.arange(g),
        ), MISTAKES, () if named else OF_WHOLE,
    )  # fmt: skip


class BesideRigid(Beside[PoseData]):
    """Positions beside the rigid robot, with the frames of the tracker and the markers fitted."""

    def __init__(self, study: PoseStudy, data: PoseData) -> None:
        super().__init__(data, study.forward().nuisances)
        self.study, self.framed = study, lru_cache(maxsize=1)(self._framed)

    def changes(self) -> Iterator[Change[PoseData]]:
        """See `Beside`."""
        return changes_of_poses(self.study, self.data, np.arange(len(self.data)))

    def left(self, data: PoseData, rows: np.ndarray) -> Array:
        """See `Beside`."""
        frames = self.framed(tuple(rows.tolist()))
        R, p = self._ends(data)
        seen = (p + np.einsum("gkab,kb->gka", R, frames.m)) @ frames.R.T + frames.t
        return data.position - seen

    def _framed(self, rows: tuple[int, ...]) -> Frames:
        own, (R, p) = list(rows), self._ends(self.data)
        sigma = np.array([table.sigma_mm for table in self.study.sheet.markers.values()])
        return align(R[own], p[own], self.data.position[own], self.data.orientation[own], sigma, None)[0]

    def _ends(self, data: PoseData) -> tuple[Array, Array]:
        R, p = unloaded_frames(self.study.machine.tree, self.study.machine.rows(data.q))
        return R, p


def judged(measurement: RobotMeasurement, found: Iterable[Finding], *, strict: bool) -> list[Finding]:
    """Findings with those of the model file, refusals first, unless the test is refused for one.

    Raises:
        ImplausibleError: naming the first reason.
    """
    model, name = measurement.model, f"{measurement.sheet.file}, model {measurement.sheet.test.model}"
    described = Path(measurement.sheet.test.model).suffix in DESCRIPTIONS
    of_model = [] if described else model_findings(model.document, name)
    doubts = (Finding(Grade.DOUBTFUL, name, doubt) for doubt in model.doubts)
    notes = (Finding(Grade.NOTED, name, note) for note in model.notes)
    result = worst_first([*found, *doubts, *of_model, *notes])
    refuse(result, strict=strict)
    return result


def mistaken(findings: Iterable[Finding]) -> bool:
    """Whether columns are not what they say, so that whatever is fitted to them means nothing."""
    return bool(columns_mistaken(findings))


def missed(findings: Iterable[Finding]) -> bool:
    """Whether the rigid robot misses by so much that what is fitted must explain it wholly to be believed."""
    return any(isinstance(one, RobotMisses) for one in findings)


def check_units(measurement: RobotMeasurement) -> None:
    """Refuse angles in degrees and lengths in metres, with the factor.

    Raises:
        ImplausibleError: they are; one line.
    """
    refuse(units(measurement))


def units(measurement: RobotMeasurement) -> Iterator[Finding]:
    """Angles in degrees and lengths in another unit, with the factor; they are seen before anything is computed."""
    data, machine = measurement.data, measurement.model.machine
    yield from coordinates(data, machine)
    spread, expected = spread_of(data.position), rigid_spread(machine, data)
    if spread == 0.0 and expected > 0.0:
        yield Finding(Grade.REFUSED, data.file, "the markers' positions are all the same: nothing moved")
    if 0.0 < spread < 1e-2 * machine.tree.reach and expected > 1e-1 * machine.tree.reach:
        seen = f"the markers' positions spread over {spread:.3g} mm, the robot's over {expected:.3g} mm: "
        sheet, times = measurement.sheet, expected / spread

        def left(factor: float) -> float:
            return rigid_error(machine, sheet, replace(data, position=data.position * factor))

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
    found = solve(replace(blocks, N=blocks.N * np.outer(sign, sign), b=blocks.b * sign, lower=lower), families)
    without = max(
        solve(blocks, [f for f in families if f != own]).log_evidence, solve(blocks, families).log_evidence
    )
    if found.log_evidence - without > 0.5 * REVERSED**2:
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
