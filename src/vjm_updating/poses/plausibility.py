"""Data that are not what their columns say: units, order and signs of joints, markers, repeated postures."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm.tree.equilibria import unloaded_frames
from vjm_updating.experiment.readings import DataError
from vjm_updating.poses.alignment import align
from vjm_updating.poses.measurement import PoseMeasurement
from vjm_updating.poses.study import Study

LARGEST_TURN = 4.0 * np.pi
"""rad: no joint of a robot turns further."""
IMPLAUSIBLE = 0.03
"""Mean error of the rigid robot over its reach from which on the data are looked at twice."""
MUCH_BETTER = 0.5
"""Share of that error that a change of the data must leave at most to be named."""
MANY_PAIRS = 400
MOST_TRIED = 120
"""Postures on which changes of the data are tried."""
FEWEST = 8


@dataclass(frozen=True)
class DataProblem:
    """What is thought wrong with the data.

    Attributes:
        name: such as ``joint_sign.elbow``.
        words: what to do.
        before: mean error of the rigid robot, mm, and
        after: with the data mended.
    """

    name: str
    words: str
    before: float
    after: float


def check_units(measurement: PoseMeasurement) -> None:
    """Refuse angles in degrees and lengths in metres, with the factor.

    Raises:
        DataError: they are; one line.
    """
    data, machine, file = measurement.data, measurement.machine, measurement.data.file
    for i, (name, slides) in enumerate(zip(data.joints, machine.slides, strict=True)):
        largest = float(np.abs(data.q[:, i]).max())
        if not slides and largest > LARGEST_TURN:
            raise DataError(
                f"{file}: column {name}.q_rad reaches {largest:.4g} rad, {largest / (2 * np.pi):.3g} "
                f"turns: it is in "
                "degrees; multiply it by 0.0174533"
            )
    reach = machine.tree.reach
    spread = _spread(data.position)
    if 0.0 < spread < 1e-2 * reach and _spread(_ends(measurement)) > 1e-1 * reach:
        raise DataError(
            f"{file}: the markers' positions spread over {spread:.3g} mm, the robot's over "
            f"{_spread(_ends(measurement)):.3g} mm: they are in metres; multiply them by 1000"
        )


def check_count(study: Study) -> None:
    """Refuse a test with fewer readings than its frames have unknowns.

    Raises:
        DataError: it is.
    """
    count, frames = int(study.present.sum()), study.forward().nuisances
    different = int(study.folds.posture.max()) + 1
    if study.sheet.base is None and (different < FEWEST or count <= frames):
        raise DataError(
            f"{study.data.file}: {different} different postures with {count} readings; the frames of tracker and "
            f"markers alone are {frames} unknowns: measure at least {FEWEST} different postures, 30 are better"
        )


def _spread(position: Array) -> float:
    points = position.reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    return float(np.linalg.norm(points.std(axis=0))) if len(points) > 1 else 0.0


def _ends(measurement: PoseMeasurement) -> Array:
    tree = measurement.machine.tree
    return unloaded_frames(tree, measurement.machine.rows(measurement.data.q))[1]


def data_problems(study: Study) -> list[DataProblem]:
    """What would explain a rigid robot's large error: a joint's sign, two joints or two markers swapped.

    Empty where the error is that of a robot.
    """
    before = float(np.nanmean(study.aligned))
    if study.sheet.base is not None or before < IMPLAUSIBLE * study.machine.tree.reach:
        return []
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
    if len(names) > 1:
        found.append(
            (_error(study, data.q[:, ::-1], data.position), "joints_reversed", "reverse the joints' order")
        )
    for i, j in itertools.combinations(range(len(data.markers)), 2):
        y = data.position.copy()
        y[:, [i, j]] = y[:, [j, i]]
        a, b = data.markers[i], data.markers[j]
        found.append((_error(study, data.q, y), f"markers_swapped.{a}.{b}", f"exchange the markers {a} and {b}"))
    best = min(found, default=(np.inf, "", ""))
    if best[0] > MUCH_BETTER * base:
        return []
    error, name, remedy = best
    words = f"the rigid robot misses the markers by {base:.4g} mm; {remedy} and it is {error:.4g} mm"
    return [DataProblem(name, words, base, error)]


def _error(study: Study, q: Array, position: Array) -> float:
    R, p = unloaded_frames(study.machine.tree, study.machine.rows(q))
    sigma = np.array([table.sigma_mm for table in study.sheet.markers.values()])
    _, distance = align(R, p, position, np.full((*position.shape[:2], 3, 3), np.nan), sigma, None)
    return float(np.nanmean(distance))
