"""A part that is softer or stiffer than its matrix says, by one factor: `foot_compliance`, `link_compliance`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vjm.model.machine import FOOT
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.modified_chain import ModifiedChain, foot_of, links_of, place_of

FACTOR = Quantity("factor", 0.2, 5.0, 0.02, neutral=1.0)
"""Compliance over its nominal value."""


@dataclass(frozen=True)
class PartCompliance(Effect):
    """One factor on all compliances of a part.

    Attributes:
        beam: the part's name.
        part: the same where there are several links.
    """

    beam: str = ""
    part: str = ""
    cause = "part_compliance"

    def quantities(self) -> tuple[Quantity, ...]:
        """The factor."""
        return (FACTOR,)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Softer; stiffer is the same but for the sign."""
        return [(1.05,)]

    def machine(self, machine: ModifiedChain, values: Sequence[float]) -> ModifiedChain:
        """The part times the factor."""
        return machine.times(self.beam, values[0])


@dataclass(frozen=True)
class FootCompliance(PartCompliance):
    """The foot is softer or stiffer than its matrix says."""

    beam: str = FOOT
    cause = "foot_compliance"
    title = "the foot is softer or stiffer than its matrix says"


@dataclass(frozen=True)
class LinkCompliance(PartCompliance):
    """The bar is softer or stiffer than its matrix says."""

    cause = "link_compliance"
    title = "the bar is softer or stiffer than its matrix says"


def effects(scene: Scene) -> list[Effect]:
    """One for each beam that the chain has."""
    feet: list[Effect] = [FootCompliance()] if foot_of(scene.chain) else []
    return [*feet, *(LinkCompliance(name, place_of(scene.chain, name)) for name in links_of(scene.chain))]
