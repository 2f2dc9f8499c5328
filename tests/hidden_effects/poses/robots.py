"""Four robots as plain numbers, and the model files that the finder gets."""

import math
from dataclasses import dataclass
from typing import Any

HALF = math.pi / 2.0


@dataclass(frozen=True)
class Robot:
    """A serial arm by classic Denavit-Hartenberg rows.

    Attributes:
        name: of it.
        rows: d in mm, a in mm, α in rad, a joint each.
        masses: kg, a link each, and
        centres: of mass in mm, in the frame before the link's shift.
        payload: kg at the end.
        gravity: m/s².
        reach: rad, how far the joints turn to both sides.
        torque: N mm, what its largest joints bear.
        softer: compliances of the joints' drives over that of the first, a joint each.
    """

    name: str
    rows: tuple[tuple[float, float, float], ...]
    masses: tuple[float, ...]
    centres: tuple[tuple[float, float, float], ...]
    payload: float
    gravity: tuple[float, float, float]
    reach: float
    torque: float
    softer: tuple[float, ...]


UR10 = Robot(
    "ur10-like",
    ((127.3, 0.0, HALF), (0.0, -612.0, 0.0), (0.0, -572.3, 0.0), (163.9, 0.0, HALF), (115.7, 0.0, -HALF),
     (92.2, 0.0, 0.0)),
    (7.8, 12.9, 3.9, 2.0, 2.0, 0.2),
    ((0.0, -27.0, 125.0), (-337.0, 0.0, 158.0), (-322.0, 0.0, 68.0), (0.0, -18.0, 164.0), (0.0, 18.0, 116.0),
     (0.0, 0.0, 92.0)),
    5.0, (0.0, 0.0, -9.81), 2.4, 1.5e5, (1.0, 1.4, 1.8, 2.2, 2.6, 3.0),
)  # fmt: skip
SEVEN = Robot(
    "arm-7r",
    ((340.0, 0.0, -HALF), (0.0, 0.0, HALF), (400.0, 0.0, HALF), (0.0, 0.0, -HALF), (400.0, 0.0, -HALF),
     (0.0, 0.0, HALF), (126.0, 0.0, 0.0)),
    (4.0, 4.0, 3.0, 2.7, 1.7, 1.8, 0.3),
    ((0.0, 30.0, 250.0), (0.0, 60.0, 40.0), (0.0, 30.0, 300.0), (0.0, 70.0, 30.0), (0.0, 20.0, 280.0),
     (0.0, 0.0, 20.0), (0.0, 0.0, 60.0)),
    7.0, (0.0, 0.0, -9.81), 1.9, 1.0e5, tuple(1.0 + k / 3.0 for k in range(7)),
)  # fmt: skip
PLANAR = Robot(
    "planar-2r-like", ((0.0, 500.0, 0.0), (0.0, 400.0, 0.0)), (3.0, 2.0), ((250.0, 0.0, 0.0), (200.0, 0.0, 0.0)),
    4.0, (0.0, -9.81, 0.0), 2.2, 5e4, (1.0, 3.0),
)  # fmt: skip
HEAVY = Robot(
    "heavy-6r",
    ((670.0, 312.0, -HALF), (0.0, 1075.0, 0.0), (0.0, 225.0, -HALF), (1280.0, 0.0, HALF), (0.0, 0.0, -HALF),
     (215.0, 0.0, 0.0)),
    (300.0, 200.0, 150.0, 60.0, 40.0, 60.0),
    ((150.0, 0.0, 300.0), (500.0, 0.0, 100.0), (150.0, 20.0, 50.0), (0.0, 30.0, 600.0), (0.0, 40.0, 30.0),
     (100.0, 0.0, 100.0)),
    100.0, (0.0, 0.0, -9.81), 2.0, 6e6, (1.0, 1.0, 1.0, 50.0, 50.0, 50.0),
)  # fmt: skip
"""Of a large industrial robot's size, whose wrist bears a thirtieth of the shoulder's torque on soft drives."""
ROBOTS = (UR10, SEVEN, PLANAR)


def document(robot: Robot) -> dict[str, Any]:
    """The nominal model file's content; compliances are placeholders that the sheet sets aside."""
    parts: list[dict[str, Any]] = []
    for i, ((d, a, alpha), mass, centre) in enumerate(zip(robot.rows, robot.masses, robot.centres, strict=True), 1):
        parts.append({"kind": "actuated", "name": f"joint-{i}", "axis": "z", "compliance_rad_per_Nmm": 1e-9})
        parts.append(
            {
                "kind": "link", "name": f"link-{i}", "translation_mm": [a, 0.0, d],
                "turns": [{"turn_about": "x", "angle_deg": math.degrees(alpha)}],
                "mass_kg": mass, "centre_of_mass_mm": list(centre),
            }
        )  # fmt: skip
    parts.append(
        {"kind": "payload", "name": "payload", "mass_kg": robot.payload, "centre_of_mass_mm": [0.0, 0.0, 0.0]}
    )
    names = [f"joint-{i}" for i in range(1, len(robot.rows) + 1)]
    return {
        "format": 1, "name": robot.name, "title": robot.name, "source": "made up",
        "units": {"length": "mm", "force": "N", "angle": "rad"},
        "parts": parts, "postures": {"zero": dict.fromkeys(names, 0.0)},
    }  # fmt: skip


def sheet_text(robot: Robot, noise: float, order: str = "as taken") -> str:
    """The sheet of a test of the robot."""
    g = ", ".join(repr(v) for v in robot.gravity)
    return (
        f'kind = "poses"\n[test]\nmodel = "model.toml"\nrigid = true\norder = "{order}"\ngravity = [{g}]\n'
        f"[markers.target]\nposition_mm = [0.0, 0.0, 0.0]\nsigma_mm = 200.0\n[tracker]\nnoise_mm = {noise}\n"
    )
