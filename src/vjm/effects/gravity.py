"""The chain's own weight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from vjm.effects.effect import Effect, Quantity, Scene
from vjm.effects.machine import Machine, beam_of, link_of


@dataclass(frozen=True)
class Gravity(Effect):
    """Weight that is spread evenly over the bar: what the foot weighs hardly shows at the end-effector.

    Attributes:
        beam: the part's name.
        direction: of the weight.
    """

    beam: str = "link"
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    cause = "gravity"
    title = "the chain's own weight"

    def quantities(self) -> tuple[Quantity, ...]:
        """All that hangs."""
        return (Quantity("mass_kg", 0.0, 500.0, 1.0, neutral=0.0),)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """A bar of steel of that size weighs about this."""
        return [(2.0,)]

    def machine(self, machine: Machine, values: Sequence[float]) -> Machine:
        """Carrying its weight."""
        return replace(machine, weight=((self.beam, values[0]),), gravity=self.direction)


def effects(scene: Scene) -> list[Effect]:
    """Where the bar has a section to hang it on; down is −z where the sheet does not say."""
    name = link_of(scene.chain)
    if beam_of(scene.chain, name).section is None or (scene.engine.segments or 1) == 1:
        return []
    return [Gravity(beam=name, direction=scene.gravity or (0.0, 0.0, -1.0))]
