"""A bar that is longer or shorter than drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.modified_chain import ModifiedChain, links_of, place_of


@dataclass(frozen=True)
class LinkLength(Effect):
    """The bar's length is off; the unloaded pose moves with it.

    Attributes:
        beam: the link's name.
        part: the same where there are several.
    """

    beam: str = "link"
    part: str = ""
    cause = "link_length"
    exact = True
    title = "the bar is longer or shorter than drawn"

    def quantities(self) -> tuple[Quantity, ...]:
        """By how much."""
        return (Quantity("delta_mm", -60.0, 60.0, 0.2, neutral=0.0),)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Longer."""
        return [(1.0,)]

    def machine(self, machine: ModifiedChain, values: Sequence[float]) -> ModifiedChain:
        """The longer bar."""
        return machine.longer(self.beam, values[0])


def effects(scene: Scene) -> list[Effect]:
    """One a link."""
    return [LinkLength(name, place_of(scene.chain, name)) for name in links_of(scene.chain)]
