"""One spring a link where the link bends all along it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from vjm_updating.constants import numerical
from vjm_updating.mechanisms.effect import Effect, Scene
from vjm_updating.mechanisms.modified_chain import ModifiedChain, beam_of, links_of

SEGMENTS = numerical(12)
"""Springs that converge: their error is far below any reading's."""


@dataclass(frozen=True)
class LinkLumping(Effect):
    """Every link distributed over segments."""

    cause = "link_lumping"
    title = "one spring per link, where the link deflects all along it"

    def machine(self, machine: ModifiedChain, values: Sequence[float]) -> ModifiedChain:
        """More springs."""
        return replace(machine, engine=replace(machine.engine, segments=SEGMENTS))


def effects(scene: Scene) -> list[Effect]:
    """Where the model has one spring a link and the links' sections are known."""
    known = all(beam_of(scene.chain, name).section is not None for name in links_of(scene.chain))
    return [LinkLumping()] if (scene.engine.segments or 1) == 1 and known else []
