"""Tension and compression: the sign of a driven displacement, and how far comparisons go."""

from __future__ import annotations

from enum import StrEnum

from vjm.model.machine import Machine

DEFAULT_REACH_MM = 4.0
"""How far paths go: the paper's own range of displacements."""
LATE_STIFFNESS_KNEE = ("orthoglide-chain", ("B", "D"), 14.0)
"""The paper's slanted postures have their knee only at 7 to 9 mm of compression: their paths go to 14 mm."""


class Direction(StrEnum):
    """Sign of the driven displacement: for posture A, pull or push."""

    TENSION = "tension"
    COMPRESSION = "compression"

    @property
    def sign(self) -> int:
        """+1 for tension, −1 for compression."""
        return 1 if self is Direction.TENSION else -1


def ramp_end(machine: Machine, posture: str, direction: Direction) -> float:
    """Signed end of a comparison's ramp along x, mm."""
    model, postures, late = LATE_STIFFNESS_KNEE
    far = machine.name == model and posture in postures and direction is Direction.COMPRESSION
    return direction.sign * (late if far else DEFAULT_REACH_MM)
