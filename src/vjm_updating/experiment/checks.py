"""What tells bad data from a machine that differs from its model."""

from __future__ import annotations

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_updating.constants import numerical, physical_bound, prior_scale, stated_level
from vjm_updating.experiment.channels import POSE, TIME, WRENCH, split_point
from vjm_updating.experiment.readings import Readings
from vjm_updating.experiment.source import DataError
from vjm_updating.observation.significance import level

THOUSAND = physical_bound((200.0, 5000.0))
"""Ratio of measured to predicted that a wrong prefix of a unit explains and a machine does not."""
LEAST_SIGNALS = stated_level(20.0)
"""Predicted force over its noise, that of the gauges of displacement included, from which on a ratio counts."""
MISSED = prior_scale(0.35)
"""Logarithm of a machine's forces over those of its model, where it is not as its sheet promises."""
DIFFERS = stated_level(level(1) * MISSED)
"""Logarithm of a factor beyond which forces are not those of a machine that differs from its model."""
LARGEST, FULL_TURN = physical_bound(1e12), physical_bound(2.0 * np.pi)
"""Above these no reading is one of a machine: N, N mm, mm; rad."""
REACH = numerical(0.01)
"""End of the ramp over the longest part's length on which the force is sought that a chain cannot exceed."""


def check_time(readings: Readings) -> None:
    """Refuse a clock that goes backwards; it may begin anew with a posture or run that was not there before.

    Raises:
        DataError: naming the row, and whether it is swapped with its neighbour.
    """
    if TIME not in readings.values:
        return
    known = np.flatnonzero(~np.isnan(readings.values[TIME]))
    time, row = readings.values[TIME][known], readings.row[known]
    label = [(p, r) for p, r in zip(readings.posture[known], readings.run[known], strict=True)]
    seen = set(label[:1])
    back = []
    for k in range(1, len(known)):
        if time[k] < time[k - 1] and label[k] in seen:
            back.append(k)
        seen.add(label[k])
    if not back:
        return
    k = back[0]
    swapped = time.copy()
    swapped[[k - 1, k]] = swapped[[k, k - 1]]
    near = swapped[max(k - 2, 0) : k + 2]
    if np.all(np.diff(near) >= 0.0):
        raise DataError(
            f"{readings.file}: rows {row[k - 1]} and {row[k]} are swapped in time ({TIME} {time[k - 1]:g}, then "
            f"{time[k]:g}): put them in the order in which they were taken"
        )
    raise DataError(
        f"{readings.file}: row {row[k]}, column {TIME}: {time[k]:g} comes after {time[k - 1]:g}, and {len(back)} "
        f"rows in all go back: sort by {TIME} or number the runs"
    )


def check_postures(readings: Readings, control: str) -> None:
    """Refuse a posture that says nothing: no reading at all, or nothing that moved.

    Raises:
        DataError: naming the posture and the columns.
    """
    moved = [name for name in readings.channels if split_point(name)[1] in POSE]
    loaded = [name for name in readings.channels if name in WRENCH]
    for label in dict.fromkeys(readings.posture.tolist()):
        at = readings.posture == label
        for names, kind in ((loaded, "force"), (moved, "displacement")):
            if all(np.isnan(readings.values[name][at]).all() for name in names):
                raise DataError(
                    f"{readings.file}: posture {label}: every reading of {', '.join(names)} is blank: "
                    f"give the {kind}s or leave out the posture's {int(at.sum())} rows"
                )
        controlled = [control] if control in readings.values else loaded if control == "force" else moved
        spans = [float(np.ptp(v)) for name in controlled if len(v := _present(readings.values[name][at]))]
        if not any(spans):
            raise DataError(
                f"{readings.file}: posture {label}, column {', '.join(controlled)}: it is constant over all "
                f"{int(at.sum())} rows: nothing was loaded; was the right column exported?"
            )


def check_reach(readings: Readings, chain: Machine) -> None:
    """Refuse displacements that leave the machine's own size, and what no instrument reads.

    Raises:
        DataError: naming row and column.
    """
    length = chain.characteristic_length
    for name, values in readings.values.items():
        point, channel = split_point(name)
        far = np.flatnonzero(np.abs(values) > (FULL_TURN if channel in POSE[3:] else LARGEST))
        if len(far):
            why = "rad is more than a full turn: is it in degrees?" if channel in POSE[3:] else "is no reading"
            raise DataError(f"{readings.file}: row {readings.row[far[0]]}, column {name}: {values[far[0]]:g} {why}")
        if channel not in POSE[:3]:
            continue
        # the end-effector is held, a point between may move out
        far = np.flatnonzero(np.abs(values) > (length if point else length / 5.0))
        if len(far):
            raise DataError(
                f"{readings.file}: row {readings.row[far[0]]}, column {name}: {values[far[0]]:g} mm is out of "
                f"reach (the longest part has {length:g} mm): is it in µm, a factor 1000? Write it in mm"
            )


def check_units(readings: Readings, chain: Machine, engine: VjmEngine, noise: dict[str, float]) -> None:
    """Refuse displacements and wrenches that are off by a thousand, or of the other sign.

    Measured wrenches are compared with the unloaded stiffness times the displacement. Where the end-effector's pose
    was not read, the largest force is compared with the one at which the chain buckles.

    Args:
        readings: of the test.
        chain: the nominal machine.
        engine: of the lumped model.
        noise: of one reading by column.

    Raises:
        DataError: naming column and remedy.
    """
    if not any(name in readings.values for name in POSE):
        _check_against_buckling(readings, chain, engine, noise)
        return
    pose, wrench = readings.pose, readings.wrench
    predicted, uncertain = np.full_like(wrench, np.nan), np.zeros(6)
    gauges = np.array([noise.get(name, 0.0) for name in POSE])
    for label in dict.fromkeys(readings.posture.tolist()):
        at = readings.posture == label
        K = engine.problem(chain, LoadCase(label, 1.0)).unloaded().stiffness
        assert K is not None
        predicted[at] = pose[at] @ K.T
        # what noise of the gauges makes of a prediction: a stiff machine feels that of an axis which nobody drives
        uncertain = np.maximum(uncertain, np.sqrt(K**2 @ gauges**2))
    for i, name in enumerate(WRENCH):
        known = ~np.isnan(wrench[:, i]) & ~np.isnan(predicted[:, i])
        f, g = wrench[known, i], predicted[known, i]
        least = LEAST_SIGNALS * float(np.hypot(noise.get(name, 0.0), uncertain[i]))
        if not len(f) or max(np.abs(f).max(), np.abs(g).max()) <= least:
            continue
        driving = bool(np.any(pose[:, i]))
        if not driving and np.abs(g).max() <= least:
            continue  # what little the unloaded stiffness says of this channel is no measure
        moved = next((POSE[k] for k in (i, *range(6)) if np.any(pose[:, k])), POSE[0])
        _check_ratio(readings.file, name, moved, ratio_of(f, g), driving=driving)


def ratio_of(f: Array, g: Array) -> tuple[float, float, float]:
    """Quartiles of measured to predicted in the large half, which a few outliers do not move; all 1 without it."""
    large = (np.abs(g) >= np.median(np.abs(g))) & (g != 0.0)
    if not large.any():
        return 1.0, 1.0, 1.0
    low, middle, high = np.percentile(f[large] / g[large], [25.0, 50.0, 75.0])
    return float(low), float(middle), float(high)


def thousandfold(ratio: tuple[float, float, float]) -> int:
    """1 where a ratio's quartiles are about a thousand, -1 where they are a thousandth, else 0; of either sign."""
    low, _, high = ratio
    if low * high <= 0.0:
        return 0
    sizes = np.abs([low, high])
    (least, most), inverse = THOUSAND, 1.0 / sizes
    if np.all((least < sizes) & (sizes < most)):
        return 1
    return -1 if np.all((least < inverse) & (inverse < most)) else 0


def opposite(ratio: tuple[float, float, float]) -> bool:
    """Whether measured has the other sign than predicted, and a size that a machine may have."""
    return ratio[2] < 0.0 and ratio[1] < -np.exp(-DIFFERS)


def _check_ratio(file: str, force: str, moved: str, ratio: tuple[float, float, float], *, driving: bool) -> None:
    unit, larger, smaller = ("N", "mN", "kN") if force.endswith("_N") else ("N mm", "µN m", "N m")
    length, up, down = ("mm", "m", "µm") if moved.endswith("_mm") else ("rad", "krad", "mrad")
    middle = ratio[1]
    if by := thousandfold(ratio):
        times = f"{middle:.3g} times" if by > 0 else f"1/{1.0 / abs(middle):.3g} of"
        unit_of_force, unit_of_motion = (larger, up) if by > 0 else (smaller, down)
        raise DataError(
            f"{file}: column {force}: is about {times} what the model predicts for {moved}, a factor 1000: is "
            f"{force} in {unit_of_force} instead of {unit}, or {moved} in {unit_of_motion} instead of {length}? "
            "Convert it"
        )
    if driving and opposite(ratio):
        raise DataError(
            f"{file}: column {force}: has the other sign than the model predicts for {moved}. {force} is what the "
            f"chain needs at the end-effector, positive with {moved}; turn the sign of one of them"
        )


def _check_against_buckling(readings: Readings, chain: Machine, engine: VjmEngine, noise: dict[str, float]) -> None:
    """Of a test that another point controls: no force is a thousand times the one at which the chain buckles."""
    name = WRENCH[0]
    if name not in readings.values:
        return
    for label in dict.fromkeys(readings.posture.tolist()):
        force = np.abs(_present(readings.values[name][readings.posture == label]))
        try:
            path = engine.trace(chain, LoadCase(label, -REACH * chain.characteristic_length))
        except NoConvergenceError:
            continue
        # the largest tenth, not one outlier
        if path.critical is None or not len(force):
            continue
        ratio = float(np.percentile(force, 95.0)) / path.critical.force
        if ratio > THOUSAND[0]:
            raise DataError(
                f"{readings.file}: column {name}: is about {ratio:.3g} times the force at which posture {label} "
                "buckles, a factor 1000: is it in mN instead of N? Convert it"
            )
        if 0.0 < ratio < 1.0 / THOUSAND[0] and path.critical.force > LEAST_SIGNALS * noise.get(name, 0.0):
            raise DataError(
                f"{readings.file}: column {name}: stays below 1/{1.0 / ratio:.3g} of the force at which posture "
                f"{label} buckles, a factor 1000: is it in kN instead of N? Convert it"
            )


def _present(values: Array) -> Array:
    result: Array = values[~np.isnan(values)]
    return result
