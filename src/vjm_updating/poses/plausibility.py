"""Data that are not what their columns say: units, joints' order and signs, markers, repeated postures, torques."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from scipy.special import stdtrit

from vjm.io.findings import Finding, Grade, refuse, worst_first
from vjm.io.model_plausibility import model_findings
from vjm.rotations import Array
from vjm.tree.equilibria import unloaded_frames
from vjm_updating.constants import definition, numerical, physical_bound, stated_level
from vjm_updating.experiment.implausible_rows import no_room
from vjm_updating.experiment.mistakes import ColumnsMistaken, columns_mistaken
from vjm_updating.observation.distributions import chi2_sf
from vjm_updating.observation.significance import FALSE_ALARMS, NOISE_KNOWN
from vjm_updating.poses.alignment import align
from vjm_updating.poses.families import LARGEST, MILLIRADIAN, SECOND
from vjm_updating.poses.fit import solve
from vjm_updating.poses.folds import RANDOM
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.measurement import RobotMeasurement
from vjm_updating.poses.pose_study import PoseStudy
from vjm_updating.poses.readings import TEMPERATURE, PoseData
from vjm_updating.poses.state import FittedState
from vjm_updating.poses.study import Study

LARGEST_TURN = physical_bound(4.0 * np.pi, "rad")
"""rad: no joint of a robot turns further."""
FARTHEST = LARGEST["joint_offset"] * MILLIRADIAN
"""Mean error of the rigid robot over its reach, above which no zero of a joint can be the cause."""
LENGTHS = {"metres": 1000.0, "feet": 304.8, "inches": 25.4, "centimetres": 10.0, "micrometres": 1e-3}
"""mm in each unit that positions may be in by mistake."""
QUARTERS = {"a quarter turn": 0.5 * np.pi, "a quarter turn back": -0.5 * np.pi, "half a turn": np.pi}
"""rad: what lies between the zeros of two conventions that describe one robot."""
MOST_TRIED = numerical(120)
"""Postures on which changes of the data are tried."""
EARTH = physical_bound((9.5, 10.5), "m/s²")
"""m/s²: what rounds to 10, as some write it; at sea level it is 9.78 to 9.83."""
SPRINGS = "joint_compliance"
REVERSED = stated_level(8.0)
"""Standard deviations by which springs must deflect against the weight before gravity is doubted."""
NOISE_DISTANCE = definition(float(np.sqrt(8.0 / np.pi)))
"""Mean distance over the standard deviation of a coordinate, of three normal errors."""
ALIKE = physical_bound((0.5, 2.0))
"""Factors between measured and modelled torques that unknown masses can make."""


class RobotMisses(Finding):
    """The rigid robot misses, and no change of the data explains it."""


def considered(measurement: RobotMeasurement, study: PoseStudy, *, strict: bool = False) -> list[Finding]:
    """What is implausible about a test and its model, refusals first, unless it is refused for that.

    Args:
        measurement: the test.
        study: the same, aligned.
        strict: whether what is doubtful is refused, too.

    Raises:
        ImplausibleError: naming the first reason.
    """
    rules = (joints_and_markers, outliers, repeated, few, torques, temperature, gravity)
    found = [finding for rule in rules for finding in rule(study)]
    return judged(measurement, found, strict=strict)


def judged(measurement: RobotMeasurement, found: Iterable[Finding], *, strict: bool) -> list[Finding]:
    """Findings with those of the model file, refusals first, unless the test is refused for one.

    Raises:
        ImplausibleError: naming the first reason.
    """
    model, name = measurement.model, f"{measurement.sheet.file}, model {measurement.sheet.test.model}"
    of_model = model_findings(model.document, name) if model.sha256 else []
    doubts = (Finding(Grade.DOUBTFUL, name, doubt) for doubt in model.doubts)
    result = worst_first([*found, *doubts, *of_model])
    refuse(result, strict=strict)
    return result


def mistaken(findings: Iterable[Finding]) -> bool:
    """Whether columns are not what they say, so that whatever is fitted to them means nothing."""
    return bool(columns_mistaken(findings))


def more_than_noise(times: float, freedom: float) -> bool:
    """Whether readings scatter so many times as far as a sheet's noise that it is no accident.

    The square is a mean of so many; the noise itself is known to `NOISE_KNOWN`.
    """
    return bool(chi2_sf(times**2 * freedom / NOISE_KNOWN, freedom) < FALSE_ALARMS)


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
    """Angles in degrees and lengths in metres, with the factor; they are seen before anything is computed."""
    data, machine = measurement.data, measurement.model.machine
    yield from coordinates(data, machine)
    ends = unloaded_frames(machine.tree, machine.rows(data.q))[1]
    spread, expected = _spread(data.position), _spread(np.where(np.isfinite(data.position), ends, np.nan))
    if spread == 0.0 and expected > 0.0:
        yield Finding(Grade.REFUSED, data.file, "the markers' positions are all the same: nothing moved")
    if 0.0 < spread < 1e-2 * machine.tree.reach and expected > 1e-1 * machine.tree.reach:
        unit = min(LENGTHS, key=lambda name: abs(np.log(expected / spread / LENGTHS[name])))
        yield Finding(
            Grade.REFUSED,
            data.file,
            f"the markers' positions spread over {spread:.3g} mm, the robot's over {expected:.3g} mm: they are in "
            f"{unit}; multiply them by {LENGTHS[unit]:g}",
        )


def coordinates(data: PoseData, machine: PoseMachine) -> Iterator[Finding]:
    """Joints' angles in degrees, and beams that would be out by more than they have."""
    for i, (name, slides) in enumerate(zip(data.joints, machine.slides, strict=True)):
        largest = float(np.abs(data.q[:, i]).max())
        if not slides and largest > LARGEST_TURN:
            yield Finding(
                Grade.REFUSED,
                data.file,
                f"column {name}.q_rad reaches {largest:.4g} rad, {largest / (2 * np.pi):.3g} turns: it is in "
                "degrees; multiply it by 0.0174533",
            )
    for name, beam in machine.chain.pushing.items():
        q = data.q[:, data.joints.index(name)]
        if q.min() <= 0.0 or q.max() > beam.length:
            row = int(data.row[int(np.argmax((q <= 0.0) | (q > beam.length)))])
            yield Finding(
                Grade.REFUSED,
                f"{data.file}, row {row}, column {name}.q_mm",
                f"= {q[data.row == row][0]:.4g} is outside 0 to {beam.length:.4g} mm, the whole of '{beam.name}': "
                "give mm of it that are out",
            )


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
    if not study.outliers:
        return
    first = study.outliers[0]
    others = len(study.outliers) - 1
    yield Finding(
        Grade.NOTED,
        f"{study.data.file}, row {first.row}",
        f"{first.marker} is {first.distance:.4g} mm off what the other rows say: an outlier, left out"
        f"{f' (and {others} more)' if others else ''}",
    )


def repeated(study: Study) -> Iterator[Finding]:
    """Postures that were measured more than once: they tell noise, and no more of the robot."""
    different = int(study.folds.posture.max()) + 1
    if different < len(study.data):
        yield Finding(
            Grade.NOTED,
            study.data.file,
            f"{len(study.data)} rows are {different} different postures; the same ones are held out together",
        )


def few(study: Study) -> Iterator[Finding]:
    """Families of more members than there are readings beyond the frames."""
    count = int(study.present.sum()) - study.forward().nuisances
    sizes = {family: sum(m.family == family for m in study.members) for family in study.families}
    large = [f"{family} ({size})" for family, size in sizes.items() if size > count]
    if large:
        yield Finding(
            Grade.NOTED,
            study.data.file,
            f"{count} readings beyond the frames are fewer than the members of {', '.join(large)}: what they do "
            "not tell stays at its prior",
        )


def temperature(study: PoseStudy) -> Iterator[Finding]:
    """Temperatures that no room has."""
    if study.data.temperature is not None:
        yield from no_room(study.data.temperature, f"{study.data.file}: column {TEMPERATURE}")


def gravity(study: Study) -> Iterator[Finding]:
    """A gravity that is none of the Earth's."""
    size = float(np.linalg.norm(study.sheet.test.gravity))
    if not EARTH[0] <= size <= EARTH[1]:
        yield Finding(
            Grade.DOUBTFUL,
            f"{study.sheet.file}: [test] gravity",
            f"is {size:.4g} m/s², the Earth's is 9.81: write it in m/s², in the axes of the robot's base",
        )


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
        yield Finding(
            Grade.DOUBTFUL,
            f"{data.file}, column {name}.tau_{unit.replace(' ', '')}",
            f"is {factor:.3g} times what holds the model's weight: {sign}",
        )


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


def _spread(position: Array) -> float:
    points = position.reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    return float(np.linalg.norm(points.std(axis=0))) if len(points) > 1 else 0.0


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
    base = _error(study, data.q, data.position)
    changes = itertools.chain(_of_joints(study, data), _of_positions(study, data, keep))
    found = [(_error(study, q, position), name, remedy) for q, position, name, remedy in changes]
    error, name, remedy = min(found, default=(np.inf, "", ""))
    # positions in a smaller unit miss by less, though they follow the robot no better: it must do so, too
    ends = unloaded_frames(study.machine.tree, study.machine.rows(data.q))[1]
    spread = _spread(np.where(seen, ends, np.nan))
    if error > FARTHEST * reach or 2.0 * error**2 > min(base, spread) ** 2:
        if before > FARTHEST * reach:
            words = (
                f"rigid_robot: misses the markers by {before:.4g} mm, {before / reach:.0%} of its reach. No "
                "joint's sign or zero, no two joints or markers exchanged, no unit and no other order explains it. "
                "Look at the model, the joints' names and units, the part behind which each marker rides"
            )
            yield RobotMisses(Grade.DOUBTFUL, study.data.file, words)
        return
    words = f"{name}: the rigid robot misses the markers by {base:.4g} mm; {remedy} and it is {error:.4g} mm"
    times = error / noise
    if more_than_noise(times, float(seen.sum())):
        words += f", still {times:.1f} times what the noise makes: that is not all that is wrong"
    yield ColumnsMistaken(Grade.DOUBTFUL, study.data.file, words)


Change = tuple[Array, Array, str, str]
"""Joint coordinates and positions as they may have been meant, a name, and what to do."""


def joints_meant(study: Study, data: PoseData) -> Iterator[tuple[Array, str, str]]:
    """Coordinates ``(g, n)`` with other signs and zeros, or two columns exchanged; a name, and what to do."""
    for i, name in enumerate(data.joints):
        q = data.q.copy()
        q[:, i] *= -1.0
        yield q, f"joint_sign.{name}", f"multiply {name} by −1"
        for words, angle in QUARTERS.items() if not study.machine.slides[i] else ():
            q = data.q.copy()
            q[:, i] += angle
            yield q, f"joint_zero.{name}", f"turn the zero of {name} by {words} (add {angle:.6g} rad)"
    for i, j in itertools.combinations(range(len(data.joints)), 2):
        if study.machine.slides[i] == study.machine.slides[j]:
            q = data.q.copy()
            q[:, [i, j]] = q[:, [j, i]]
            a, b = data.joints[i], data.joints[j]
            yield q, f"joints_swapped.{a}.{b}", f"exchange the columns of {a} and {b}"


def _of_joints(study: PoseStudy, data: PoseData) -> Iterator[Change]:
    """Signs, zeros, places and order of the joints' columns."""
    names, y = data.joints, data.position
    for q, name, words in joints_meant(study, data):
        yield q, y, name, words
    if len(names) > 1 and len(set(study.machine.slides)) == 1:
        yield data.q[:, ::-1], y, "joints_reversed", "reverse the joints' order"
        for by in range(1, len(names)):
            words = f"the column of {names[by]} is that of {names[0]}, and so on around"
            yield np.roll(data.q, -by, axis=1), y, f"joints_shifted.{by}", words


def _of_positions(study: PoseStudy, data: PoseData, keep: np.ndarray) -> Iterator[Change]:
    """Markers, axes, units and rows of the positions."""
    for i, j in itertools.combinations(range(len(data.markers)), 2):
        y = data.position.copy()
        y[:, [i, j]] = y[:, [j, i]]
        a, b = data.markers[i], data.markers[j]
        yield data.q, y, f"markers_swapped.{a}.{b}", f"exchange the markers {a} and {b}"
    words = "the tracker's axes are left-handed: exchange two of them or reverse one,"
    yield data.q, data.position * [-1.0, 1.0, 1.0], "tracker_mirrored", words
    for unit, factor in LENGTHS.items():
        words = f"the positions are in {unit}: multiply them by {factor:g}"
        yield data.q, data.position * factor, f"positions_in_{unit}", words
    for by, words in ((-1, "one row too early: move them down"), (1, "one row too late: move them up")):
        inside = (keep + by >= 0) & (keep + by < len(study.data))
        moved = study.data.position[np.clip(keep + by, 0, len(study.data) - 1)]
        y = np.where(inside[:, None, None], moved, np.nan)
        yield data.q, y, f"positions_shifted.{by}", f"the positions stand {words} by one,"


def _error(study: PoseStudy, q: Array, position: Array) -> float:
    R, p = unloaded_frames(study.machine.tree, study.machine.rows(q))
    sigma = np.array([table.sigma_mm for table in study.sheet.markers.values()])
    _, distance = align(R, p, position, np.full((*position.shape[:2], 3, 3), np.nan), sigma, None)
    return float(np.nanmean(distance))
