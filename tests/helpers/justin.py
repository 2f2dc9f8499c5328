"""Agile Justin (DLR) as its makers publish it, as a model document and a sheet of a test of poses.

Geometry, masses and centres of mass: the public repository dlr-alr/dlr-elastic-calibration; Craig's convention.
"""

import math
from typing import Any

HALF = math.pi / 2.0
TORSO = ((0.1055, 0.0, 0.0, 0.0), (0.0, -HALF, 0.0, -HALF), (0.0, 0.0, 0.3, 0.0), (0.0, 0.0, 0.3, 0.0))
RIGHT = (
    (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, HALF), (0.4, -HALF, 0.0, -HALF), (0.0, 0.0, 0.0, HALF),
    (0.39, -math.pi, 0.0, -HALF), (0.0, HALF, 0.0, HALF), (0.0, -HALF, 0.0, HALF),
)  # fmt: skip
LEFT = (
    (0.0, 0.0, 0.0, math.pi), (0.0, 0.0, 0.0, HALF), (-0.4, -HALF, 0.0, -HALF), (0.0, 0.0, 0.0, HALF),
    (-0.39, 0.0, 0.0, -HALF), (0.0, HALF, 0.0, -HALF), (0.0, -HALF, 0.0, -HALF),
)  # fmt: skip
"""Rows d in m, θ in rad, a in m, α in rad."""
TORSO_MASS, ARM_MASS = (4.651, 5.470, 2.925, 5.759), (2.637, 2.326, 2.239, 2.204, 1.101, 1.641, 0.675)
TORSO_CENTRE = (
    (1.334, 15.387, 7.426), (218.591, -13.020, 6.223), (153.201, -22.721, 1.928), (53.666, 74.571, 0.683),
)  # fmt: skip
RIGHT_CENTRE = (
    (-0.414, 20.290, -45.943), (-0.029, 114.065, 16.447), (-0.030, 16.512, -113.295), (-0.031, 113.745, 16.369),
    (0.109, 21.901, -105.624), (0.500, -7.845, -8.706), (29.083, 78.114, 19.575),
)  # fmt: skip
LEFT_CENTRE = (
    (0.414, -20.290, 45.943), (0.029, -114.065, 16.447), (-0.030, -16.512, 113.295), (-0.031, -113.745, -16.369),
    (-0.109, 21.901, 105.624), (0.500, -7.845, 8.706), (29.083, 78.114, -19.575),
)  # fmt: skip
TORSO_JOINTS = ("torso_pan", "torso_tilt_1", "torso_tilt_2", "chest")


def _dh(
    name: str, row: tuple[float, ...], mass: float, centre: tuple[float, ...], after: str | None, coupled: bool
) -> list[dict[str, Any]]:
    d, theta, a, alpha = row
    before: dict[str, Any] = {
        "kind": "link", "name": f"{name}-before", "translation_mm": [1000.0 * a, 0.0, 0.0],
        "turns": [{"turn_about": "x", "angle_deg": math.degrees(alpha)}],
    }  # fmt: skip
    if after is not None:
        before["after"] = after
    joint: dict[str, Any] = {"name": name, "axis": "z", "compliance_rad_per_Nmm": 1e-9}
    if coupled:
        joint |= {"kind": "coupled", "to": {"torso_tilt_1": -1.0, "torso_tilt_2": -1.0}, "coupling": "as commanded"}
    else:
        joint |= {"kind": "actuated"}
    behind = {
        "kind": "link", "name": f"{name}-link", "translation_mm": [0.0, 0.0, 1000.0 * d],
        "turns": [{"turn_about": "z", "angle_deg": math.degrees(theta)}],
    }  # fmt: skip
    weight = {"kind": "payload", "name": f"{name}-mass", "mass_kg": mass, "centre_of_mass_mm": list(centre)}
    return [before, joint, behind, weight]


def _turned(name: str, turns: list[dict[str, Any]], place: tuple[float, ...], after: str) -> dict[str, Any]:
    return {"kind": "link", "name": name, "translation_mm": list(place), "turns": turns, "after": after}


def document() -> dict[str, Any]:
    """The model document; compliances are placeholders, which the sheet sets aside."""
    parts: list[dict[str, Any]] = [{"kind": "offset", "name": "pedestal", "translation_mm": [0.0, 0.0, 588.4]}]
    for name, row, mass, centre in zip(TORSO_JOINTS, TORSO, TORSO_MASS, TORSO_CENTRE, strict=True):
        parts += _dh(name, row, mass, centre, None, name == "chest")
    chest = "chest-mass"
    # rotations by rows: right [-c 0 s; 0 1 0; -s 0 -c] is a turn about y by 150 degrees, left [c 0 s; 0 1 0;
    # -s 0 c]
    # one by 30
    for side, rows, centres, angle, z in (
        ("right", RIGHT, RIGHT_CENTRE, 150.0, -256.0),
        ("left", LEFT, LEFT_CENTRE, 30.0, 256.0),
    ):
        parts.append(
            _turned(f"{side}-shoulder", [{"turn_about": "y", "angle_deg": angle}], (190.0, 88.0, z), chest)
        )
        for i, (row, mass, centre) in enumerate(zip(rows, ARM_MASS, centres, strict=True), 1):
            parts += _dh(f"{side}_{i}", row, mass, centre, None, False)
        # [-1 0 0; 0 0 1; 0 1 0]: a turn about z by 180 degrees, then about x by 90 backwards
        hand = [{"turn_about": "z", "angle_deg": 180.0}, {"turn_about": "x", "angle_deg": 90.0}]
        parts.append(
            _turned(f"{side}-hand", hand, (0.0, 118.0, 0.0), f"{side}_7-mass")
            | {"mass_kg": 2.0, "centre_of_mass_mm": [0.0, 218.0, 0.0]}
        )
    parts.append(
        {
            "kind": "payload",
            "name": "head",
            "mass_kg": 3.0,
            "after": chest,
            "centre_of_mass_mm": [235.0, 98.0, -140.0],
        }
    )
    names = [*TORSO_JOINTS[:3], *(f"{side}_{i}" for side in ("right", "left") for i in range(1, 8))]
    return {
        "format": 1, "name": "justin", "title": "Agile Justin", "source": "dlr-alr/dlr-elastic-calibration",
        "units": {"length": "mm", "force": "N", "angle": "rad"},
        "parts": parts, "postures": {"zero": dict.fromkeys(names, 0.0)},
    }  # fmt: skip


SHEET = """kind = "poses"
[test]
title = "Agile Justin, 500 postures"
model = "justin.toml"
rigid = true
order = "unknown"
[markers.right]
on = "right-hand"
position_mm = [-100.0, -30.0, 100.0]
[markers.left]
on = "left-hand"
position_mm = [-100.0, 30.0, 50.0]
[tracker]
noise_mm = 0.5
source = "assumed: a Vicon system"
"""
