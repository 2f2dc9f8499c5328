"""A stiffness that differs between pull and push."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from vjm.chain import FOOT
from vjm.effects.effect import Effect, Quantity, Scene
from vjm.effects.machine import Machine, link_of


@dataclass(frozen=True)
class Asymmetry(Effect):
    """Two factors on all stiffnesses of a part, one in pull and one in push.

    Attributes:
        part: ``foot`` or ``link``.
        beam: the part's name in the chain.
    """

    part: str = "link"
    beam: str = "link"
    cause = "tension_compression_asymmetry"
    title = "a stiffness differs between pull and push"
    contains = ("foot_compliance", "link_compliance")

    def quantities(self) -> tuple[Quantity, ...]:
        """Pull stiffness over push stiffness, and the factor on their geometric mean's compliance."""
        return (
            Quantity("ratio", 0.1, 10.0, 0.05, neutral=1.0),
            Quantity("mean_factor", 0.3, 3.0, 0.05, usual=1.0, spread=0.1),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Stiffer in pull."""
        return [(1.1, 1.0)]

    def machine(self, machine: Machine, values: Sequence[float]) -> Machine:
        """Both factors."""
        changed = replace(machine, asymmetry=(*machine.asymmetry, (self.beam, values[0])))
        return changed.times(self.beam, values[1])

    def reported(self, values: Sequence[float], force: float) -> dict[str, float]:
        """With the part."""
        return {f"{self.cause}.ratio": float(values[0]), f"{self.cause}.mean_factor": float(values[1])}


def effects(scene: Scene) -> list[Effect]:
    """Of the foot and of the link."""
    link = link_of(scene.chain)
    feet: list[Effect] = [Asymmetry(part="foot", beam=FOOT) for b in scene.chain.beams if b.name == FOOT != link]
    return [*feet, Asymmetry(part="link", beam=link)]
