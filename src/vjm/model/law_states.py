"""Where the laws of a machine's springs are at a state, in numbers and words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vjm.model.laws import Law
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint
from vjm.model.springs import LawSpring
from vjm.rotations import Array

OF_CABLES = {"without contact": "slack", "in contact": "taut"}
"""Regions of the law of a cable in a cable's words."""


@dataclass(frozen=True)
class LawState:
    """A law at a deflection.

    Attributes:
        what: ``joint``, ``actuator``, ``mount``, ``spring`` between points, or ``cable``, which is one that only
            pulls.
        name: of the joint or spring.
        law: of it.
        deflection: rad or mm.
        slides: whether it is in mm.
    """

    what: str
    name: str
    law: Law
    deflection: float
    slides: bool

    @property
    def tangent(self) -> float:
        """Its tangent stiffness there, N mm/rad or N/mm."""
        return float(self.law.tangent(self.deflection))

    @property
    def place(self) -> int:
        """Number of the region of the law in which it is."""
        return self.law.place(self.deflection)

    def words(self, place: int) -> str:
        """Words for a region of the law."""
        region = self.law.regions[place]
        return OF_CABLES[region] if self.what == "cable" else region

    @property
    def region(self) -> str:
        """Words for where it is."""
        return self.words(self.place)

    def __str__(self) -> str:
        """In one line.

        Example:
            >>> from vjm.model.laws import OneSided
            >>> str(LawState("cable", "upper", OneSided(20.0, 1e-3), 0.5, slides=True))
            "cable 'upper' is taut: 10 N at 0.5 mm, tangent stiffness 20 N/mm"
        """
        force, angle, stiffness = ("N", "mm", "N/mm") if self.slides else ("N mm", "rad", "N mm/rad")
        return (
            f"{self.what} '{self.name}' is {self.region}: {float(self.law.force(self.deflection)):.6g} {force} at "
            f"{self.deflection:.6g} {angle}, tangent stiffness {self.tangent:.6g} {stiffness}"
        )


def free_words(states: Sequence[LawState]) -> str:
    """Words for the laws that have no slope where they are, and hold nothing: one may be free within its clearance.

    Example:
        >>> from vjm.model.laws import DeadZone
        >>> free_words([LawState("joint", "elbow", DeadZone(1e6, 2e-3), 5e-4, slides=False)])
        "joint 'elbow' is free within its clearance"
    """
    free = (state for state in states if not state.tangent > 0.0)
    return ", ".join(
        f"{state.what} '{state.name}' is {'' if state.what == 'cable' else 'free '}{state.region}" for state in free
    )


def law_states(model: Mechanism, x: Array) -> list[LawState]:
    """All laws of a machine at a state, joints first.

    Args:
        model: of the machine.
        x: components ``(size,)`` of the state.
    """
    states = []
    for spring, where in [] if model.plain else model.blocks:
        if isinstance(spring, LawSpring):
            c = where.start
            name = next(name for name, span in model.built.spans.items() if c in span)
            deflection = float(x[c] - model.natural[c])
            what = next(part.what for part in model.chain.parts if isinstance(part, Joint) and part.name == name)
            states.append(LawState(what, name, spring.law, deflection, slides=not model.rotary[c]))
    for own, length in zip(model.chain.point_springs, model.spring_lengths(x), strict=True):
        if own.law is not None:
            what = "cable" if own.cable else "spring"
            states.append(LawState(what, own.name, own.law, float(length) - own.free_length, slides=True))
    return states
