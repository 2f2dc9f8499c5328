"""What a map asks at each pose, and its answer."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import NamedTuple, assert_never

import numpy as np

from vjm.loaded_stiffness import NO_COMPLIANCE
from vjm.machine.platforms import PlatformBatch
from vjm.platform.manipulator import Manipulator
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine

OK, LOST, UNSTABLE = "ok", "no equilibrium under these loads", "the equilibrium is unstable"


class MapQuantity(StrEnum):
    """What is mapped."""

    STIFFNESS = "stiffness"
    """Smallest and largest stiffness against a force, the platform free to turn, and against a moment, free to
    shift: over the eigenvalues of the two blocks of K⁻¹. Under the wrench, if one is given."""
    CRITICAL = "critical"
    """The smallest force, over all directions, at which the free platform loses its stability."""
    DEFLECTION = "deflection"
    """The platform's displacement under the wrench."""
    FREQUENCY = "frequency"
    """The lowest natural frequency about the loaded equilibrium."""
    SHARES = "shares"
    """The largest share of a part in the linear strain energy under the loads, and which part that is."""


COLUMNS: dict[MapQuantity, tuple[str, ...]] = {
    MapQuantity.STIFFNESS: ("kt_min_N_per_mm", "kt_max_N_per_mm", "kr_min_Nmm_per_rad", "kr_max_Nmm_per_rad"),
    MapQuantity.CRITICAL: ("F_cr_N", "direction_x", "direction_y", "direction_z"),
    MapQuantity.DEFLECTION: ("ux_mm", "uy_mm", "uz_mm", "rx_rad", "ry_rad", "rz_rad", "u_mm"),
    MapQuantity.FREQUENCY: ("f1_Hz",),
    MapQuantity.SHARES: ("largest_share",),
}
PER_MACHINE = (MapQuantity.FREQUENCY, MapQuantity.SHARES)
"""Quantities for which a platform is one machine with closed loops."""
NAMES = ("part", "kind")
"""Columns of text behind those of `MapQuantity.SHARES`."""
SHOWN = {
    MapQuantity.STIFFNESS: 0, MapQuantity.CRITICAL: 0, MapQuantity.DEFLECTION: 6, MapQuantity.FREQUENCY: 0,
    MapQuantity.SHARES: 0,
}  # fmt: skip
"""The column that the pictures show."""
TITLES = {
    MapQuantity.STIFFNESS: "smallest stiffness against a force, N/mm",
    MapQuantity.CRITICAL: "smallest critical force, N",
    MapQuantity.DEFLECTION: "deflection, mm",
    MapQuantity.FREQUENCY: "lowest natural frequency, Hz",
    MapQuantity.SHARES: "largest share in the strain energy",
}


@dataclass(frozen=True)
class MapTask:
    """Some poses of a map.

    Attributes:
        index: of the task.
        manipulator: the machine.
        springs: how its beams become springs.
        quantity: what is mapped.
        poses: displacements ``(n, 6)`` from home, neighbours next to one another.
        wrench: on the platform, ``(6,)`` N, N mm.
        most: largest force tried for a critical one, N.
    """

    index: int
    manipulator: Manipulator
    springs: VjmEngine
    quantity: MapQuantity
    poses: Array
    wrench: tuple[float, ...]
    most: float


class MapRows(NamedTuple):
    """Answers at some poses.

    Attributes:
        task: its index.
        values: ``(n, c)``, nan where there is no answer.
        why: ``(n,)`` `OK`, or why there is none.
    """

    task: int
    values: Array
    why: list[str]


def evaluate(task: MapTask) -> MapRows:
    """The rows of a task; a pose without an answer says why and stops no other."""
    batch = _batch(pickle.dumps((task.manipulator, task.springs)))
    values = np.full((len(task.poses), len(COLUMNS[task.quantity])), np.nan)
    wrench = np.zeros(6) if task.quantity is MapQuantity.CRITICAL else np.array(task.wrench)
    found = batch.equilibria(task.poses, wrench)
    why = [
        str(reason) or _beyond(task.manipulator, drives)
        for reason, drives in zip(found.why, found.drives, strict=True)
    ]
    good = np.array([not said for said in why])
    match task.quantity:
        case MapQuantity.STIFFNESS:
            values[good] = principal(found.compliance[good])
        case MapQuantity.DEFLECTION:
            values[good] = moved(found.displacement[good])
        case MapQuantity.CRITICAL:
            for k, weak in zip(np.flatnonzero(good), batch.weakest(task.poses[good], task.most), strict=True):
                values[k], why[k] = [weak.force, *weak.direction], weak.why
        case MapQuantity.FREQUENCY | MapQuantity.SHARES:
            raise ValueError(f"a map of the {task.quantity} takes a platform as one machine: see `map_arm`")
        case _:
            assert_never(task.quantity)
    return MapRows(task.index, values, [said or OK for said in why])


@lru_cache(maxsize=4)
def _batch(pickled: bytes) -> PlatformBatch:
    """The batch of a machine and its springs, which tasks bring along one after another."""
    return PlatformBatch(*pickle.loads(pickled))


def _beyond(manipulator: Manipulator, drives: Array) -> str:
    said = manipulator.beyond_limits(drives)
    return f"out of reach: {said}" if said else ""


def principal(C: Array) -> Array:
    """Smallest and largest stiffness against forces (N/mm) and moments (N mm/rad) ``(g, 4)``.

    Infinite in a direction in which nothing moves.

    Args:
        C: compliances ``(g, 6, 6)``.
    """
    rows = []
    for part in (slice(0, 3), slice(3, 6)):
        block = C[:, part, part]
        values = np.linalg.eigvalsh(0.5 * (block + np.swapaxes(block, 1, 2)))
        with np.errstate(divide="ignore"):
            least = np.where(values[:, 0] > NO_COMPLIANCE * values[:, 2], values[:, 0], 0.0)
            rows += [1.0 / values[:, 2], 1.0 / least]
    return np.stack(rows, axis=1)


def moved(displacements: Array) -> Array:
    """Displacements ``(g, 6)`` and the sizes of their shifts ``(g, 7)``."""
    return np.column_stack([displacements, np.linalg.norm(displacements[:, :3], axis=1)])
