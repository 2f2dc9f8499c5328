"""How readings may be mistaken: what was read is what the machine did, after a known operation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment.channels import EFFORT, MOTION, POSE, WRENCH, split_point, unit_of
from vjm_updating.experiment.mistakes import EXCHANGE, SIGN, UNIT
from vjm_updating.experiment.readings import Readings

TORQUE, FORCE, TURN, SHIFT = EFFORT[0], EFFORT[1], MOTION[0], MOTION[1]
FORCES, MOMENTS, SHIFTS, TURNS = (*WRENCH[:3], FORCE), (*WRENCH[3:], TORQUE), (*POSE[:3], SHIFT), (*POSE[3:], TURN)
LOADS, MOTIONS = (*WRENCH, *EFFORT), (*POSE, *MOTION)
LENGTHS = {"cm": 10.0, "inches": 25.4, "m": 1e3, "µm": 1e-3, "mil (0.001 inches)": 0.0254, "feet": 304.8}
"""mm in each unit that lengths may be in by mistake."""
LBF, KGF = 4.4482216152605, 9.80665
"""N."""
UNITS = (
    *((f"forces in {unit}", n, FORCES) for unit, n in {"kN": 1e3, "kgf": KGF, "lbf": LBF, "mN": 1e-3}.items()),
    ("forces in gf", 1e-3 * KGF, FORCES),
    ("moments in N m", 1e3, MOMENTS),
    *((f"forces in {unit}", n, LOADS) for unit, n in {"kN": 1e3, "kgf": KGF, "lbf": LBF, "mN": 1e-3}.items()),
    ("torques in lbf in", LBF * 25.4, MOMENTS),
    ("torques in lbf ft", LBF * 304.8, MOMENTS),
    ("torques in ozf in", LBF / 16.0 * 25.4, MOMENTS),
    ("torques in kgf cm", 10.0 * KGF, MOMENTS),
    ("torques in kgf m", 1e3 * KGF, MOMENTS),
    ("torques in N cm", 10.0, MOMENTS),
    *((f"displacements in {unit}", mm, SHIFTS) for unit, mm in LENGTHS.items()),
    ("rotations in degrees", float(np.pi / 180.0), TURNS),
)
"""What is mistaken, what makes it right by multiplication, and what columns that concerns."""
SIGNS = (("the sign of the forces", LOADS), ("the sign of the displacements", MOTIONS))


@dataclass(frozen=True)
class MistakenAs:
    """One way; what is done here makes readings right.

    Attributes:
        words: what was mistaken.
        cause: one of `vjm_updating.experiment.mistakes.TITLES`; empty for labels of postures.
        factors: by column, what readings are multiplied by.
        exchanged: two columns that change places.
        postures: by label, the posture in which the readings were taken.
    """

    words: str
    cause: str
    factors: Mapping[str, float] = field(default_factory=dict)
    exchanged: tuple[str, ...] = ()
    postures: Mapping[str, str] = field(default_factory=dict)

    def put_right(self, values: Array, names: tuple[str, ...]) -> Array:
        """Columns ``(…, m)`` as they were meant: exchanged, then multiplied."""
        order = list(range(len(names)))
        if self.exchanged and self.exchanged[0] in names:
            i, j = (names.index(name) for name in self.exchanged)
            order[i], order[j] = j, i
        result: Array = values[..., order] * [self.factors.get(name, 1.0) for name in names]
        return result


RIGHT = MistakenAs("right", "")


def ways(
    readings: Readings, postures: tuple[str, ...], columns: tuple[tuple[str, ...], tuple[str, ...]] = (POSE, WRENCH)
) -> list[MistakenAs]:
    """All mistakes that concern columns that are there.

    Args:
        readings: of the test.
        postures: labels of those in which the machine may have stood.
        columns: of what was imposed, and of what was read.

    Returns:
        Those that concern more columns first.
    """
    there = [name for names in columns for name in names if np.isfinite(readings.values.get(name, np.nan)).any()]

    def only(names: tuple[str, ...], factor: float) -> dict[str, float]:
        return {name: factor for name in there if split_point(name)[1] in names}

    found = [MistakenAs(words, UNIT, only(names, factor)) for words, factor, names in UNITS]
    found += [MistakenAs(words, SIGN, only(names, -1.0)) for words, names in SIGNS]
    found += [
        MistakenAs(f"the sign of {name}", SIGN, {name: -1.0})
        for name in sorted(there, key=lambda name: unit_of(name) not in ("N", "Nmm"))
    ]
    found = [way for k, way in enumerate(found) if way.factors and way not in found[:k]]
    found += [
        MistakenAs(f"the columns {a} and {b} exchanged", EXCHANGE, exchanged=(a, b))
        for names in columns
        for a, b in combinations([name for name in names if name in there], 2)
    ]
    labels = dict.fromkeys(readings.posture.tolist())
    found += [
        MistakenAs(f"{a} labelled instead of {b}", "", postures={a: b}) for a in labels for b in postures if a != b
    ]
    return found
