"""Deflections that are not what their columns say: units, signs, exchanged axes and joints, too few readings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.findings import Finding, Grade, refuse
from vjm.machine.equilibria import unloaded_frames
from vjm.rotations import Array
from vjm_updating.constants import definition, physical_bound
from vjm_updating.experiment.comparison import machines, ratio_of
from vjm_updating.experiment.data_file import WRENCH
from vjm_updating.experiment.mistakes import FORCES, LENGTHS, SHIFTS, UNITS, ColumnsMistaken
from vjm_updating.experiment.plausibility import said
from vjm_updating.poses.deflections import (
    COMPLIANCES,
    SHIFT,
    DeflectionData,
    DeflectionForward,
    DeflectionStudy,
    springs_to,
)
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.measurement import RobotMeasurement
from vjm_updating.poses.plausibility import (
    Beside,
    Change,
    axes,
    columns_of,
    coordinates,
    few,
    gravity,
    joints_meant,
    judged,
    mistaken_everywhere,
    mistaken_rows,
    outliers,
    positions_in_units,
    shifted_rows,
)

STEEL = definition(2.1e5, "N/mm²")
"""N/mm²."""
SLENDER = physical_bound(10.0)
"""Length over thickness of the solid steel rod that no serial arm is stiffer than."""
SAGS = physical_bound(0.01)
"""Of its distance from the base: what the weight of a kilogram moves no arm by."""
KILOGRAM = definition(9.81, "N")
"""N."""


def units(data: DeflectionData, machine: PoseMachine) -> list[Finding]:
    """Angles in degrees and displacements in metres, with the factor."""
    return [*coordinates(data, machine), *impossible_size(data, machine)]


def check_count(study: DeflectionStudy) -> None:
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


def considered(measurement: RobotMeasurement, study: DeflectionStudy, *, strict: bool = False) -> list[Finding]:
    """What is implausible about a test and its model; see `judged`."""
    rules = (another_unit, outliers, few, gravity)
    findings = [*impossible_size(study.data, study.machine), *(one for rule in rules for one in rule(study))]
    data = measurement.data
    assert isinstance(data, DeflectionData)
    # rows that were left out as outliers may be a stretch that is mistaken
    beside = BesideSprings(study, data)
    mistaken = [*mistaken_rows(beside)] or [*mistaken_everywhere(BesideSprings(study, study.data))]
    findings += [*mistaken, *columns_of(beside, SHIFT, named=bool(mistaken))]
    return judged(measurement, findings, strict=strict)


class BesideSprings(Beside[DeflectionData, Array]):
    """Displacements beside those of springs of the joints and of their bearings, none negative."""

    misses = "the model with springs in its joints misses the displacements"

    def __init__(self, study: DeflectionStudy, data: DeflectionData) -> None:
        super().__init__(data, len(data.joints))
        self.study = study
        self.springs = [member for member in study.members if member.family in COMPLIANCES[:2]]
        self._known: list[tuple[Array, Array, tuple[Array, Array]]] = []

    def changes(self, keep: np.ndarray, *, whole: bool) -> Iterator[Change[DeflectionData]]:
        """See `Beside`; springs of any size explain another unit of all displacements, or of all loads."""
        data = self.data.only(keep)
        yield from () if whole else positions_in_units(data, "displacements")
        for words, factor, names in () if whole else UNITS:
            if names[:3] == WRENCH[:3] and words.startswith("forces"):
                load = data.load * factor
                yield Change(
                    replace(data, load=load), "loads_in_unit", f"{words}: multiply the loads by {factor:g}"
                )
        words = "reverse the sign of the displacements, which are unloaded minus loaded, or that of the loads,"
        yield Change(replace(data, position=-data.position), "sign_reversed", words)
        yield from _of_axes(self.study, data)
        yield from joints_meant(self.study.machine, data)
        for change in shifted_rows(self.data, "displacements"):
            yield replace(change, data=change.data.only(keep))

    def fitted(self, data: DeflectionData, rows: np.ndarray) -> Array:
        """See `Beside`: sizes ``(P,)`` of the springs."""
        moved, J = self._moved(data)
        y = (data.position - moved)[rows]
        seen = np.isfinite(y)
        sigma = data.sigma[rows][seen]
        lower = np.array([spring.low for spring in self.springs])
        return springs_to(J[rows][seen] / sigma[:, None], y[seen] / sigma, lower)

    def residual(self, data: DeflectionData, fitted: Array) -> Array:
        """See `Beside`."""
        moved, J = self._moved(data)
        result: Array = data.position - moved - J @ fitted
        return result

    def stands(self, data: DeflectionData) -> bool:
        """Whether the machine has an equilibrium in each posture."""
        return bool(np.isfinite(self._moved(data)[0]).all())

    def _moved(self, data: DeflectionData) -> tuple[Array, Array]:
        """Displacements ``(g, k, 3)`` mm of the machine without springs, and by each spring ``(g, k, 3, P)``."""
        # changes of the displacements alone leave postures and loads as they are
        for q, load, displacements in self._known:
            if q is data.q and load is data.load:
                return displacements
        every = replace(data, position=np.zeros_like(data.position))
        forward = DeflectionForward(self.study.machine, every, self.study.sheet)
        forward.members = self.springs
        try:
            linearised = forward.evaluate(np.zeros(len(self.springs)), self.study.frames)
            displacements = -linearised.residual[..., :3], linearised.member[..., :3, :]
        except NoConvergenceError:
            shape = data.position.shape
            displacements = np.full(shape, np.inf), np.zeros((*shape, len(self.springs)))
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
    for power, shift, force in ((-1, "m instead of mm", "mN"), (1, "µm instead of mm", "kN")):
        if all(machines(abs(r) * 1000.0**-power) for r in ratio):
            words = f"are they in {shift}, or the loads in {force} instead of N? Convert them"
            yield Finding(Grade.REFUSED, study.data.file, f"{are}, a factor 1000: {words}")
            return
    if ratio[0] <= 0.0 or any(map(machines, ratio)):
        return
    units = {
        words: factor if SHIFTS[0] in names else 1.0 / factor
        for words, factor, names in UNITS
        if SHIFTS[0] in names or FORCES[0] in names
    }
    possible_units = [words for words, factor in units.items() if all(machines(r * factor) for r in ratio)]
    if possible_units:
        said_units = ", or ".join(possible_units)
        words = f"they may be in another unit ({said_units}), or the machine differs so much from its model"
        yield Finding(Grade.DOUBTFUL, study.data.file, f"{are}: {words}")


def _of_axes(study: DeflectionStudy, data: DeflectionData) -> Iterator[Change[DeflectionData]]:
    """Axes of displacements and of loads that are exchanged or reversed; those that are found cannot be."""
    if study.sheet.tracker.axes == "base":
        for order, sign, name, words in axes(np.asarray(np.isfinite(data.position).any(axis=(0, 1)))):
            shift = data.position[..., order] * sign
            yield Change(replace(data, position=shift), f"displacement_axes.{name}", f"{words} displacements")
    for j, point in enumerate(data.loads):
        for order, sign, name, words in axes(data.given[j].reshape(2, 3).any(axis=0)):
            load = data.load.copy()
            # a moment is an axial vector: it turns with the axes, and keeps its sign where they are mirrored
            mirrored = np.linalg.det(np.eye(3)[:, order] * sign)
            load[:, j, :3], load[:, j, 3:] = load[:, j, order] * sign, mirrored * load[:, j, 3:][:, order] * sign
            yield Change(replace(data, load=load), f"load_axes.{point}.{name}", f"{words} columns of {point}")
        other = "tool" if study.sheet.loads[point].axes == "base" else "base"
        remedy = f"write axes = '{other}' in [loads.{point}]"
        yield Change(_in_other_axes(study, data, j), f"load_axes.{point}.{other}", remedy)


def _in_other_axes(study: DeflectionStudy, data: DeflectionData, point: int) -> DeflectionData:
    """The readings with a load of which the base's axes are the tool's, or the reverse."""
    k = len(data.markers)
    R = unloaded_frames(study.machine.tree, study.machine.rows(data.q))[0][:, k + point]
    if study.sheet.loads[data.loads[point]].axes == "tool":
        R = np.swapaxes(R, 1, 2)
    load = data.load.copy()
    for half in (slice(0, 3), slice(3, 6)):
        load[:, point, half] = np.einsum("gab,gb->ga", R, load[:, point, half])
    return replace(data, load=load)
