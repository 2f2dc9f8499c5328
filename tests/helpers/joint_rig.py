"""A made-up test of one joint, by laws that are not the suite's.

The spring's torque is a cubic of its wind-up, the backlash a dead zone with hard ends, and friction a slider behind
a spring whose torque is integrated over many small steps between readings.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from helpers.file_texts import instruments_text, model_text, part_text, section_of, table_text
from vjm.rotations import Array

MODEL = model_text(
    "wrist",
    part_text("actuated", "elbow", axis="y", compliance_rad_per_Nmm=1e-7),
    part_text("beam", "arm", length_mm=300.0, section=section_of("round_tube", 60.0, 4.0, density=2700.0)),
    postures={"home": {"elbow": 0.0}},
)
SHEET = (
    'kind = "joint"\n'
    + table_text(
        "test", title="Elbow, motor locked, torque on the output, two cycles", model="wrist.toml", joint="elbow"
    )
    + instruments_text(angle_rad=(2e-6, 2e-5, 0.0005), torque_Nmm=(60.0, 100.0, 0.005))
)
FINE = 40
"""Steps between two readings."""


@dataclass(frozen=True)
class Joint:
    """What the joint does.

    Attributes:
        stiffness: of its spring without load, N mm/rad.
        cubic: N mm/rad³.
        gap: whole free travel, rad.
        friction: torque at which it slips, N mm.
        presliding: elastic turn before that, rad.
        scale: relative error of the cell.
    """

    stiffness: float = 1e7
    cubic: float = 0.0
    gap: float = 0.0
    friction: float = 0.0
    presliding: float = 4e-5
    scale: float = 0.0

    def spring(self, angle: Array) -> Array:
        """Torque of spring and dead zone at angles ``(n,)``, N mm."""
        wound = np.sign(angle) * np.maximum(np.abs(angle) - 0.5 * self.gap, 0.0)
        result: Array = self.stiffness * wound + self.cubic * wound**3
        return result

    def angle(self, torque: float) -> float:
        """The angle at which spring and dead zone bear a torque, rad."""
        roots = np.roots(
            [self.cubic, 0.0, self.stiffness, -abs(torque)] if self.cubic else [self.stiffness, -abs(torque)]
        )
        wound = min(float(r.real) for r in roots if abs(r.imag) < 1e-9 * abs(r) + 1e-18 and r.real >= 0.0)
        return float(np.sign(torque)) * (wound + 0.5 * self.gap)

    def torques(self, angles: Array) -> Array:
        """Torques ``(n,)`` on the output along angles ``(n,)``, which begin where nothing is strained."""
        path = np.concatenate([[0.0], angles])
        held, found = 0.0, []
        stiff = self.friction / self.presliding
        for a, b in pairwise(path.tolist()):
            for _ in range(FINE):
                held = float(np.clip(held + stiff * (b - a) / FINE, -self.friction, self.friction))
            found.append(held)
        return self.spring(angles) + np.array(found)


def angles(joint: Joint, torque: float, *, steps: int = 25, cycles: int = 2) -> Array:
    """Angles of a test to a torque in both directions and back, rad."""
    most = joint.angle(torque)
    up = np.linspace(0.0, most, steps + 1)[1:]
    one = np.concatenate([up, up[-2::-1], [0.0], -up, -up[-2::-1], [0.0]])
    return np.tile(one, cycles)


def write(folder: Path, joint: Joint, seed: int, *, torque: float = 5e4, sheet: str = SHEET) -> tuple[Path, Path]:
    """Model, sheet and readings of a test: two errors of each instrument are drawn with the noise."""
    rng = np.random.default_rng(seed)
    turned = angles(joint, torque)
    borne = joint.torques(turned)
    read_angle = turned * (1.0 + 5e-4 * rng.standard_normal()) + 2e-5 * rng.standard_normal()
    read_torque = borne * (1.0 + joint.scale + 5e-3 * rng.standard_normal()) + 100.0 * rng.standard_normal()
    read_angle = read_angle + 2e-6 * rng.standard_normal(len(turned))
    read_torque = read_torque + 60.0 * rng.standard_normal(len(turned))
    lines = ["time_s,run,angle_rad,torque_Nmm"]
    half = len(turned) // 2
    for k, (a, t) in enumerate(zip(read_angle, read_torque, strict=True)):
        lines.append(f"{5.0 * k:g},{1 + k // half},{a:.7f},{t:.1f}")
    (folder / "wrist.toml").write_text(MODEL)
    (folder / "sheet.toml").write_text(sheet)
    (folder / "readings.csv").write_text("\n".join(lines) + "\n")
    return folder / "readings.csv", folder / "sheet.toml"
