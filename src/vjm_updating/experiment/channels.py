"""Columns of a data file: which quantity each is, and in which unit it has to be."""

from __future__ import annotations

import re
from math import radians

from vjm.io.errors import did_you_mean, printed

POSE = ("ux_mm", "uy_mm", "uz_mm", "rx_rad", "ry_rad", "rz_rad")
"""Displacement of the end-effector from its unloaded pose, world axes."""
WRENCH = ("fx_N", "fy_N", "fz_N", "mx_Nmm", "my_Nmm", "mz_Nmm")
"""Wrench that the chain needs at the end-effector, world axes."""
TIME, POSTURE, RUN, TEMPERATURE = "time_s", "posture", "run", "temperature_C"
MOTION, EFFORT = ("angle_rad", "deflection_mm"), ("torque_Nmm", "force_N")
"""Of a test of one joint: its turn, or the shift of a point on a lever; its torque, or the force on a lever."""
OF_JOINT = (TIME, RUN, *MOTION, *EFFORT, TEMPERATURE)
"""Every column of a test of one joint."""
PLAIN = (TIME, POSTURE, RUN, *POSE, *WRENCH, TEMPERATURE)
"""Every column that needs no point."""

_OTHER_UNITS = {
    "mm": {"m": 1e3, "cm": 10.0, "um": 1e-3, "µm": 1e-3, "in": 25.4},
    "rad": {"mrad": 1e-3, "deg": 0.017453292519943295},
    "N": {"kN": 1e3, "mN": 1e-3, "MN": 1e6, "lbf": 4.4482216152605},
    "Nmm": {"Nm": 1e3, "kNmm": 1e3, "kNm": 1e6, "mNm": 1.0},
    "s": {"ms": 1e-3, "min": 60.0, "h": 3600.0},
    "C": {"K": 1.0, "F": 1.0},
}
"""What people write instead, and what it takes to convert."""
_QUANTITY = re.compile(r"(?:(?P<point>[A-Za-z][\w-]*)\.)?(?P<name>[a-z]+)(?:_(?P<unit>.+))?")


def split_point(column: str) -> tuple[str, str]:
    """The point that a column belongs to, empty for the end-effector, and the channel there: ``mid``, ``uy_mm``."""
    point, dot, channel = column.rpartition(".")
    return (point, channel) if dot else ("", column)


def unit_of(channel: str) -> str:
    """A channel's unit: ``mm`` of ``mid.uy_mm``."""
    return split_point(channel)[1].rpartition("_")[2]


def beyond_turn(angle: float, most: float, remedy: str = "") -> str:
    """What may be wrong with an angle in rad that is larger than any: degrees, where they explain it.

    Args:
        angle: rad.
        most: that there may be, rad.
        remedy: where it is in degrees.
    """
    explained = radians(abs(angle)) <= most
    return f"is it in degrees?{remedy and f' {remedy}'}" if explained else "degrees do not explain it either"


def converted(given: str, unit: str) -> str:
    """How a column in a unit is written in the format's: ``multiply it by 1000``."""
    factor = _OTHER_UNITS.get(unit, {}).get(given, 1.0)
    return "convert it" if factor == 1.0 else f"multiply it by {printed(factor)}"


def check_column(column: str, points: tuple[str, ...], plain: tuple[str, ...] = PLAIN) -> None:
    """Refuse a column that is no channel, with the remedy.

    Args:
        column: its name.
        points: that the sheet names.
        plain: columns that need no point.

    Raises:
        ValueError: an unknown quantity or point, or a unit other than the format's.
    """
    point, channel = split_point(column)
    if point and point not in points:
        known = f"the sheet names {', '.join(points)}" if points else "the sheet names none"
        raise ValueError(f"column '{column}': no point '{point}'; {known}: add [points.{point}]")
    known_channels = POSE if point else plain
    if channel in known_channels:
        return
    found = _QUANTITY.fullmatch(column)
    quantity = found["name"] if found else column
    right = next((name for name in known_channels if name.split("_")[0] == quantity and "_" in name), None)
    if right is None and re.search(r"[;\t]", column):
        raise ValueError(f"column '{column}' is several: separate columns by commas, and write decimal points")
    if right is None:
        hint = did_you_mean(channel, known_channels)
        raise ValueError(f"column '{column}' is no channel{hint or '; known are ' + ', '.join(known_channels)}")
    name = f"{point}.{right}" if point else right
    unit, given = right.split("_")[1], found["unit"] if found else None
    if given is None:
        raise ValueError(f"column '{column}' has no unit: name it {name} if it is in {unit}")
    if (how := converted(given, unit)) == "convert it":
        raise ValueError(
            f"column '{column}': '{given}' is not the unit of {quantity}: convert to {unit}, as {name}"
        )
    raise ValueError(f"column '{column}' must be in {unit}: {how} and name it {name}")
