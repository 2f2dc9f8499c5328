"""A bar that is not straight when unloaded: a half sine wave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm_updating.constants import physical_bound
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.modified_chain import ModifiedChain, beam_of, links_of, place_of

CROOKED = physical_bound(30.0)
"""Lengths over mid-span amplitudes below which a link is not one that should be straight."""


@dataclass(frozen=True)
class LinkBow(Effect):
    """A bow along the section's y and z axes.

    Attributes:
        sizes: amplitudes to begin a search with, mm.
        length: of the beam, mm.
        beam: its name.
        part: the same where there are several links.
    """

    sizes: tuple[float, ...] = (0.5, 2.0)
    length: float = 310.0
    beam: str = "link"
    part: str = ""
    cause = "link_bow"
    extent = 2
    title = "the bar is not straight when unloaded"

    def quantities(self) -> tuple[Quantity, ...]:
        """Mid-span amplitudes along both axes of the section."""
        most = self.length / CROOKED
        return tuple(Quantity(f"along_{axis}_mm", -most, most, 0.5, neutral=0.0) for axis in "yz")

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Both senses in both planes."""
        return [(sign * a, 0.02 * a) for a in self.sizes for sign in (1.0, -1.0)] + [
            (0.02 * a, sign * a) for a in self.sizes[1:] for sign in (1.0, -1.0)
        ]

    def machine(self, machine: ModifiedChain, values: Sequence[float]) -> ModifiedChain:
        """Built with the bow."""
        return machine.with_bow(self.beam, values[0], values[1])

    def reported(self, values: Sequence[float], force: float) -> dict[str, float]:
        """Amplitude, and direction about the link's axis from the section's y axis."""
        y, z = values
        return {"link_bow.amplitude_mm": float(np.hypot(y, z)), "link_bow.direction_rad": float(np.arctan2(z, y))}


def effects(scene: Scene) -> list[Effect]:
    """One a link whose section is known: one spring alone has no shape.

    A model file has no bow of a beam that comes out of its root or carries a joint.
    """
    if (scene.engine.segments or 1) == 1:
        return []
    links = [beam_of(scene.chain, name) for name in links_of(scene.chain) if name not in scene.chain.riders]
    return [
        LinkBow(length=link.length, beam=link.name, part=place_of(scene.chain, link.name))
        for link in links
        if link.section is not None and link.length > 0.0 and not link.free_length
    ]
