"""The chain's own weight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from vjm.model.chain import FOOT, Chain
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.modified_chain import ModifiedChain, beam_of, link_of

UNLIKE = 0.2
"""Standard deviation of the foot's share of the weight about what both have were they of one material."""


@dataclass(frozen=True)
class Gravity(Effect):
    """Weight of the bar and, where it is a beam, of the foot, spread evenly over each.

    Attributes:
        beam: the bar's name.
        direction: of the weight.
        foot: share of the weight that the foot has if both are of one material; None: it is no beam, and could
            not bend under what it weighs.
    """

    beam: str = "link"
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    foot: float | None = None
    cause = "gravity"
    title = "the chain's own weight"

    def quantities(self) -> tuple[Quantity, ...]:
        """The whole mass, and the foot's share of it."""
        mass = Quantity("mass_kg", 0.0, 500.0, 1.0, neutral=0.0)
        if self.foot is None:
            return (mass,)
        return mass, Quantity("foot_share", 0.0, 1.0, UNLIKE, usual=self.foot, spread=UNLIKE)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """A bar of steel of that size weighs about this."""
        return [(2.0,)] if self.foot is None else [(2.0, self.foot)]

    def machine(self, machine: ModifiedChain, values: Sequence[float]) -> ModifiedChain:
        """Carrying its weight."""
        if self.foot is None:
            weight: tuple[tuple[str, float], ...] = ((self.beam, values[0]),)
        else:
            weight = ((FOOT, values[0] * values[1]), (self.beam, values[0] * (1.0 - values[1])))
        return replace(machine, weight=weight, gravity=self.direction)


def effects(scene: Scene) -> list[Effect]:
    """Where the bar has a section that its weight acts on; down is −z where the sheet does not say."""
    name = link_of(scene.chain)
    if beam_of(scene.chain, name).section is None or (scene.engine.segments or 1) == 1:
        return []
    return [Gravity(name, scene.gravity or (0.0, 0.0, -1.0), _share(scene.chain, name))]


def _share(chain: Chain, link: str) -> float | None:
    """The foot's share of both beams' volume, by their stiffness in pull."""
    foot = next((beam for beam in chain.beams if beam.name == FOOT and link != FOOT), None)
    if foot is None or foot.section is None:
        return None
    size = {beam.name: beam.count * beam.section.EA * beam.length for beam in (foot, beam_of(chain, link))
            if beam.section is not None}  # fmt: skip
    return size[FOOT] / sum(size.values())
