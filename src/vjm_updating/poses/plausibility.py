"""Data that are not what their columns say: units, joints' order and signs, markers, repeated postures, torques."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import numpy as np

from vjm.io.findings import Finding, Grade, refuse, worst_first
from vjm.io.model_plausibility import model_findings
from vjm.rotations import Array
from vjm.tree.equilibria import unloaded_frames
from vjm_updating.poses.alignment import align
from vjm_updating.poses.measurement import PoseMeasurement
from vjm_updating.poses.study import Study

LARGEST_TURN = 4.0 * np.pi
"""rad: no joint of a robot turns further."""
LOOKED_AT, IMPLAUSIBLE = 0.008, 0.03
"""Mean error of the rigid robot over its reach from which on changes of the data are tried, and from which on it
is doubted though none of them explains it. A wrist's sign may cost no more than a hundredth."""
MUCH_BETTER = 0.5
"""Share of that error that a change of the data must leave at most to be named."""
MANY_PAIRS = 400
MOST_TRIED = 120
"""Postures on which changes of the data are tried."""
FEWEST = 8
FEWEST_TORQUES = 12
LEAST_FOLLOWED = 0.5
"""Share of a measured torque's variance that the model's must explain for its factor to mean anything."""
ALIKE = (0.5, 2.0)
"""Factors between measured and modelled torques that unknown masses can make."""


class ColumnsMistaken(Finding):
    """Columns are not what they say: whatever is fitted to them means nothing before they are mended."""


class RobotMisses(Finding):
    """The rigid robot misses, and no change of the data explains it."""


def considered(measurement: PoseMeasurement, study: Study, *, strict: bool = False) -> list[Finding]:
    """What is implausible about a test and its model, refusals first, unless it is refused for that.

    Args:
        measurement: the test.
        study: the same, aligned.
        strict: whether what is doubtful is refused, too.

    Raises:
        ImplausibleError: naming the first reason.
    """
    rules = (joints_and_markers, repeated, few, torques)
    found = [finding for rule in rules for finding in rule(study)]
    name = f"{measurement.sheet.file}, model {measurement.sheet.test.model}"
    result = worst_first(
        [*found, *(model_findings(measurement.document, name) if measurement.model_sha256 else [])]
    )
    refuse(result, strict=strict)
    return result


def mistaken(findings: Iterable[Finding]) -> bool:
    """Whether columns are not what they say, so that whatever is fitted to them means nothing."""
    return any(isinstance(one, ColumnsMistaken) for one in findings)


def missed(findings: Iterable[Finding]) -> bool:
    """Whether the rigid robot misses by so much that what is fitted must explain it wholly to be believed."""
    return any(isinstance(one, RobotMisses) for one in findings)


def check_units(measurement: PoseMeasurement) -> None:
    """Refuse angles in degrees and lengths in metres, with the factor.

    Raises:
        ImplausibleError: they are; one line.
    """
    refuse(units(measurement))


def units(measurement: PoseMeasurement) -> Iterator[Finding]:
    """Angles in degrees and lengths in metres, with the factor; they are seen before anything is computed."""
    data, machine = measurement.data, measurement.machine
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
    ends = unloaded_frames(machine.tree, machine.rows(data.q))[1]
    spread, expected = _spread(data.position), _spread(np.where(np.isfinite(data.position), ends, np.nan))
    if 0.0 < spread < 1e-2 * machine.tree.reach and expected > 1e-1 * machine.tree.reach:
        yield Finding(
            Grade.REFUSED,
            data.file,
            f"the markers' positions spread over {spread:.3g} mm, the robot's over {expected:.3g} mm: they are in "
            "metres; multiply them by 1000",
        )


def check_count(study: Study) -> None:
    """Refuse a test with fewer readings than its frames have unknowns.

    Raises:
        ImplausibleError: it is.
    """
    count, frames = int(study.present.sum()), study.forward().nuisances
    different = int(study.folds.posture.max()) + 1
    if study.sheet.base is None and (different < FEWEST or count <= frames):
        words = (
            f"{different} different postures with {count} readings; the frames of tracker and markers alone are "
            f"{frames} unknowns: measure at least {FEWEST} different postures, 30 are better"
        )
        refuse([Finding(Grade.REFUSED, study.data.file, words)])


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


def torques(study: Study) -> Iterator[Finding]:
    """Measured torques that are those of the model by a factor: another sign, unit or gear ratio."""
    data = study.data
    if not np.isfinite(data.torque).any():
        return
    expected = study.holding_torques()
    for i, name in enumerate(data.joints):
        own = np.isfinite(data.torque[:, i])
        x, y = expected[own, i], data.torque[own, i]
        if own.sum() < FEWEST_TORQUES or not np.ptp(x) > 0.0 or not np.ptp(y) > 0.0:
            continue
        followed = float(np.corrcoef(x, y)[0, 1] ** 2)
        factor = float(np.cov(x, y)[0, 1] / np.var(x, ddof=1))
        if followed < LEAST_FOLLOWED or ALIKE[0] <= factor <= ALIKE[1]:
            continue
        unit = "N" if study.machine.slides[i] else "N mm"
        sign = "the sign is the other one" if -ALIKE[1] <= factor <= -ALIKE[0] else f"give {unit} at the joint"
        yield Finding(
            Grade.DOUBTFUL,
            f"{data.file}, column {name}.tau_{unit.replace(' ', '')}",
            f"is {factor:.3g} times what holds the model's weight: {sign}",
        )


def _spread(position: Array) -> float:
    points = position.reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    return float(np.linalg.norm(points.std(axis=0))) if len(points) > 1 else 0.0


def joints_and_markers(study: Study) -> Iterator[Finding]:
    """What would explain a rigid robot's large error: a joint's sign, two joints or two markers swapped.

    None where the error is that of a robot.
    """
    before = float(np.nanmean(study.aligned))
    if study.sheet.base is not None or before < LOOKED_AT * study.machine.tree.reach:
        return
    keep = np.linspace(0, len(study.data) - 1, min(len(study.data), MOST_TRIED)).astype(int)
    data = study.data.only(keep)
    base = _error(study, data.q, data.position)
    found: list[tuple[float, str, str]] = []
    names = data.joints
    for i, name in enumerate(names):
        q = data.q.copy()
        q[:, i] *= -1.0
        found.append((_error(study, q, data.position), f"joint_sign.{name}", f"multiply {name} by −1"))
    for i, j in list(itertools.combinations(range(len(names)), 2))[:MANY_PAIRS]:
        if study.machine.slides[i] == study.machine.slides[j]:
            q = data.q.copy()
            q[:, [i, j]] = q[:, [j, i]]
            found.append(
                (_error(study, q, data.position), f"joints_swapped.{names[i]}.{names[j]}",
                 f"exchange the columns of {names[i]} and {names[j]}")
            )  # fmt: skip
    if len(names) > 1 and len(set(study.machine.slides)) == 1:
        found.append(
            (_error(study, data.q[:, ::-1], data.position), "joints_reversed", "reverse the joints' order")
        )
        for by in range(1, len(names)):
            q = np.roll(data.q, -by, axis=1)
            words = f"the column of {names[by]} is that of {names[0]}, and so on around"
            found.append((_error(study, q, data.position), f"joints_shifted.{by}", words))
    for i, j in itertools.combinations(range(len(data.markers)), 2):
        y = data.position.copy()
        y[:, [i, j]] = y[:, [j, i]]
        a, b = data.markers[i], data.markers[j]
        found.append((_error(study, data.q, y), f"markers_swapped.{a}.{b}", f"exchange the markers {a} and {b}"))
    mirrored = _error(study, data.q, data.position * [-1.0, 1.0, 1.0])
    words = "the tracker's axes are left-handed: exchange two of them or reverse one,"
    found.append((mirrored, "tracker_mirrored", words))
    best = min(found, default=(np.inf, "", ""))
    if best[0] > MUCH_BETTER * base:
        if before < IMPLAUSIBLE * study.machine.tree.reach:
            return
        words = (
            f"rigid_robot: misses the markers by {before:.4g} mm, {before / study.machine.tree.reach:.0%} of its "
            "reach, and no joint's sign, no two joints or markers exchanged and no other order explain it: look at "
            "the model, the joints' names and units, the part behind which each marker rides"
        )
        yield RobotMisses(Grade.DOUBTFUL, study.data.file, words)
        return
    error, name, remedy = best
    words = f"{name}: the rigid robot misses the markers by {base:.4g} mm; {remedy} and it is {error:.4g} mm"
    yield ColumnsMistaken(Grade.DOUBTFUL, study.data.file, words)


def _error(study: Study, q: Array, position: Array) -> float:
    R, p = unloaded_frames(study.machine.tree, study.machine.rows(q))
    sigma = np.array([table.sigma_mm for table in study.sheet.markers.values()])
    _, distance = align(R, p, position, np.full((*position.shape[:2], 3, 3), np.nan), sigma, None)
    return float(np.nanmean(distance))
