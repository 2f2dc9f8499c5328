"""Changes of data that would explain what a rigid robot misses: signs, zeros, exchanged columns, units, rows."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import TypeAlias, TypeVar

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.findings import Finding, Grade
from vjm.rotations import Array
from vjm.tree.equilibria import unloaded_frames
from vjm_updating.constants import definition, numerical
from vjm_updating.experiment.mistakes import ColumnsMistaken
from vjm_updating.observation.significance import more_than_noise
from vjm_updating.poses.alignment import align
from vjm_updating.poses.families import LARGEST, MILLIRADIAN
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.pose_study import PoseStudy
from vjm_updating.poses.readings import PoseData
from vjm_updating.poses.sheet import RobotSheet
from vjm_updating.poses.state import Hypothesis, mean_distance
from vjm_updating.poses.study import Study

FARTHEST = LARGEST["joint_offset"] * MILLIRADIAN
"""Mean error of the rigid robot over its reach, above which no zero of a joint can be the cause."""
LENGTHS = {"metres": 1000.0, "feet": 304.8, "inches": 25.4, "centimetres": 10.0, "micrometres": 1e-3}
"""mm in each unit that positions may be in by mistake."""
QUARTERS = {"a quarter turn": 0.5 * np.pi, "a quarter turn back": -0.5 * np.pi, "half a turn": np.pi}
"""rad: what lies between the zeros of two conventions that describe one robot."""
ORDINARY = ("joint_offset", "frame_error", "actuator_compliance")
"""Families of errors that every robot has."""
MOST_TRIED = numerical(120)
"""Postures on which changes of the data are tried."""
NOISE_DISTANCE = definition(float(np.sqrt(8.0 / np.pi)))
"""Mean distance over the standard deviation of a coordinate, of three normal errors."""
D = TypeVar("D", bound=PoseData)
Change: TypeAlias = tuple[D, str, str]
"""Data as they may have been meant, a name, and what to do."""


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
    changes = itertools.chain(
        joints_meant(study, data), _order_of_joints(study, data), _of_positions(study, data, keep)
    )
    error, name, remedy = best_change(changes, left)
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
    if ordinary_error(study) <= error:
        return
    words = f"{name}: the rigid robot misses the markers by {base:.4g} mm; {remedy} and it is {error:.4g} mm"
    times = error / noise
    if more_than_noise(times, float(seen.sum())):
        words += f", still {times:.1f} times what the noise makes: that is not all that is wrong"
    yield ColumnsMistaken(Grade.DOUBTFUL, data.file, words)


def ordinary_error(study: PoseStudy) -> float:
    """Mean distance held out by region, mm, of a robot with errors as robots have them; infinite where none does.

    In a small region a robot hardly moves. There another sign or zero of a joint, with frames fitted anew, may do
    what errors of a millimetre do. Where these predict as well, the columns are not mistaken.
    """
    names = tuple(name for name in ORDINARY if name in study.families)
    try:
        state = study.settle(Hypothesis(names))
    except NoConvergenceError:
        return np.inf
    geometry = [i for i, m in enumerate(study.members) if m.family in ORDINARY[:2]]
    if np.abs(state.z[geometry]).max(initial=0.0) > LARGEST["joint_offset"]:
        return np.inf
    return mean_distance(state.errors.region) if state.errors.held_out else np.inf


def best_change(changes: Iterable[Change[D]], left: Callable[[D], float]) -> tuple[float, str, str]:
    """The change of data of the least residual; of those that do as well the simplest, which comes first.

    Args:
        changes: data as they may have been meant, a name, and what to do.
        left: residual of a robot by data.

    Returns:
        The residual, the name, and what to do.
    """
    found = [(left(changed), name, remedy) for changed, name, remedy in changes]
    return next(one for one in found if one[0] <= 1.02 * min(found)[0])


def joints_meant(study: Study, data: D) -> Iterator[Change[D]]:
    """Joints with other signs and zeros, or two columns exchanged."""
    for i, name in enumerate(data.joints):
        one = np.eye(len(data.joints))[i]
        yield replace(data, q=data.q * (1.0 - 2.0 * one)), f"joint_sign.{name}", f"multiply {name} by −1"
        for words, angle in QUARTERS.items() if not study.machine.slides[i] else ():
            remedy = f"turn the zero of {name} by {words} (add {angle:.6g} rad)"
            yield replace(data, q=data.q + angle * one), f"joint_zero.{name}", remedy
    for i, j in itertools.combinations(range(len(data.joints)), 2):
        if study.machine.slides[i] == study.machine.slides[j]:
            a, b = data.joints[i], data.joints[j]
            remedy = f"exchange the columns of {a} and {b}"
            yield replace(data, q=exchanged(data.q, i, j)), f"joints_swapped.{a}.{b}", remedy


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
        yield replace(data, q=data.q[:, ::-1]), "joints_reversed", "reverse the joints' order"
        for by in range(1, len(names)):
            words = f"the column of {names[by]} is that of {names[0]}, and so on around"
            yield replace(data, q=np.roll(data.q, -by, axis=1)), f"joints_shifted.{by}", words


def _of_positions(study: PoseStudy, data: PoseData, keep: np.ndarray) -> Iterator[Change[PoseData]]:
    """Markers, axes, units and rows of the positions."""
    y = data.position
    for i, j in itertools.combinations(range(len(data.markers)), 2):
        a, b = data.markers[i], data.markers[j]
        remedy = f"exchange the markers {a} and {b}"
        yield replace(data, position=exchanged(y, i, j)), f"markers_swapped.{a}.{b}", remedy
    words = "the tracker's axes are left-handed: exchange two of them or reverse one,"
    yield replace(data, position=y * [-1.0, 1.0, 1.0]), "tracker_mirrored", words
    for unit, factor in LENGTHS.items():
        words = f"the positions are in {unit}: multiply them by {factor:g}"
        yield replace(data, position=y * factor), f"positions_in_{unit}", words
    for by, words in ((-1, "one row too early: move them down"), (1, "one row too late: move them up")):
        inside = (keep + by >= 0) & (keep + by < len(study.data))
        moved = study.data.position[np.clip(keep + by, 0, len(study.data) - 1)]
        shifted = replace(data, position=np.where(inside[:, None, None], moved, np.nan))
        yield shifted, f"positions_shifted.{by}", f"the positions stand {words} by one,"


def rigid_spread(machine: PoseMachine, data: PoseData) -> float:
    """Spread of the rigid robot's ends where markers were seen, mm."""
    ends = unloaded_frames(machine.tree, machine.rows(data.q))[1]
    return spread_of(np.where(np.isfinite(data.position), ends, np.nan))


def rigid_error(machine: PoseMachine, sheet: RobotSheet, data: PoseData) -> float:
    """Mean distance of the markers from the rigid robot's ends, mm."""
    R, p = unloaded_frames(machine.tree, machine.rows(data.q))
    sigma = np.array([table.sigma_mm for table in sheet.markers.values()])
    _, distance = align(R, p, data.position, np.full((*data.position.shape[:2], 3, 3), np.nan), sigma, None)
    return float(np.nanmean(distance))


def spread_of(position: Array) -> float:
    """How far positions ``(…, 3)`` lie from their mean, root mean square, mm; 0 where fewer than two were seen."""
    points = position.reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    return float(np.linalg.norm(points.std(axis=0))) if len(points) > 1 else 0.0
