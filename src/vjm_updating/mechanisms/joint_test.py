"""What a test of one joint may show: its spring, and dry friction beside it.

The joint's spring, what hardens in it and its backlash are in series; friction of the output's bearing and seal acts
beside them, on the whole turn. So it shows in the backlash, too, and half the hysteresis is its torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.mechanisms.actuator_compliance import ActuatorCompliance
from vjm_updating.mechanisms.drives import Drive
from vjm_updating.mechanisms.effect import Effect, Quantity

STIFFEST = 0.05
"""Share of the model's compliance that a joint has at least: it may be twenty times as stiff as the model says."""
SOFTEST = 1e3
"""Times the model's compliance that a joint has at most."""
SHARE = 0.02
"""Friction over the test's largest load that matters."""
ELASTIC = 0.02
"""Presliding over the test's largest motion, in order of magnitude."""


@dataclass(frozen=True)
class JointCompliance(ActuatorCompliance):
    """Of a joint under test: softer or stiffer than the model says."""

    title = "the joint is softer or stiffer than the model says"

    def sliding(self) -> tuple[Quantity, ...]:
        """Beyond what the model has; negative where it is stiffer."""
        c = self.drive.compliance
        low, high = (STIFFEST - 1.0) * c, SOFTEST * c
        return (Quantity("compliance_mm_per_N", low, high, 0.1 * c, neutral=0.0),)

    def quantities(self) -> tuple[Quantity, ...]:
        """In rad and N mm where the joint turns."""
        (own,) = self.sliding()
        (per,) = self.drive.factors((own,))
        name = "compliance_rad_per_Nmm" if self.drive.turns else own.name
        return (Quantity(name, own.low * per, own.high * per, own.scale * per, neutral=0.0),)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """A tenth softer and stiffer."""
        scale = self.quantities()[0].scale
        return [(scale,), (-scale,)]


@dataclass(frozen=True)
class DriveFriction(Effect):
    """Dry friction in a joint under test: a spring and a slider in series, beside the joint's own spring.

    Attributes:
        largest: load of the test on the joint, N mm, or N where it slides.
        reach: largest motion, rad or mm.
        slides: whether the joint does.
        part: the joint.
    """

    largest: float = 1.0
    reach: float = 1.0
    slides: bool = False
    part: str = ""
    cause = "joint_friction"
    title = "dry friction in the joint"

    def quantities(self) -> tuple[Quantity, ...]:
        """Torque at which it slips, half the hysteresis; and the elastic motion before."""
        torque, elastic = ("force_N", "presliding_mm") if self.slides else ("torque_Nmm", "presliding_rad")
        usual = ELASTIC * self.reach
        return (
            Quantity(torque, 0.0, 2.0 * self.largest, SHARE * self.largest, neutral=0.0),
            Quantity(elastic, 1e-3 * usual, 50.0 * usual, usual, usual=usual, spread=1.5, log=True),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Little and much, rigid and soft before it slips."""
        usual = ELASTIC * self.reach
        return [(share * self.largest, e * usual) for share in (0.02, 0.1) for e in (0.3, 1.0, 4.0)]

    def friction(self, values: Sequence[float]) -> Array:
        """The torque ``(1,)``."""
        return np.array([values[0]])

    def presliding(self, values: Sequence[float]) -> float:
        """Elastic motion before it slips."""
        return float(values[1])


def drive_of(name: str, *, slides: bool, compliance: float, lever: float, force: float) -> Drive:
    """The place of a joint's effects.

    Args:
        name: of the joint.
        slides: whether it does.
        compliance: in the model, rad/(N mm) or mm/N.
        lever: mm at which a turn is counted; 1 for what slides.
        force: largest of the test at the lever, N.
    """
    c = compliance * lever**2
    return Drive(name, name, not slides, lever, c, c, force)
