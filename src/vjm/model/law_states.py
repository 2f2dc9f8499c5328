"""Where the laws of a machine's springs are at a state, in numbers and words."""

from __future__ import annotations

from dataclasses import dataclass

from vjm.model.laws import Law
from vjm.model.mechanism import Mechanism
from vjm.model.springs import LawSpring
from vjm.rotations import Array


@dataclass(frozen=True)
class LawState:
    """A law at a deflection.

    Attributes:
        what: ``joint`` or ``spring``, which is between points.
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
    def region(self) -> str:
        """Words for where it is."""
        return self.law.region(self.deflection)

    def __str__(self) -> str:
        """In one line.

        Example:
            >>> from vjm.model.laws import OneSided
            >>> str(LawState("spring", "cable", OneSided(20.0, 1e-3), 0.5, slides=True))
            "spring 'cable' is taut: 10 N at 0.5 mm, tangent stiffness 20 N/mm"
        """
        force, angle, stiffness = ("N", "mm", "N/mm") if self.slides else ("N mm", "rad", "N mm/rad")
        return (
            f"{self.what} '{self.name}' is {self.region}: {float(self.law.force(self.deflection)):.6g} {force} at "
            f"{self.deflection:.6g} {angle}, tangent stiffness {float(self.law.tangent(self.deflection)):.6g} "
            f"{stiffness}"
        )


def law_states(model: Mechanism, x: Array) -> list[LawState]:
    """All laws of a machine at a state, joints first.

    Args:
        model: of the machine.
        x: components ``(size,)`` of the state.
    """
    found = []
    for spring, where in model.blocks:
        if isinstance(spring, LawSpring):
            c = where.start
            name = next(name for name, span in model.built.spans.items() if c in span)
            deflection = float(x[c] - model.natural[c])
            found.append(LawState("joint", name, spring.law, deflection, slides=not model.rotary[c]))
    for own, length in zip(model.chain.point_springs, model.spring_lengths(x), strict=True):
        if own.law is not None:
            found.append(LawState("spring", own.name, own.law, length - own.free_length, slides=True))
    return found
