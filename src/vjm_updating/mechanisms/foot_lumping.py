"""One spring for the foot where it bends all along it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from vjm.model.machine import FOOT
from vjm_updating.constants import numerical
from vjm_updating.mechanisms.effect import Effect, Scene
from vjm_updating.mechanisms.modified_chain import ModifiedChain

SEGMENTS = numerical(8)
"""Springs that converge."""


@dataclass(frozen=True)
class FootLumping(Effect):
    """The foot distributed over segments."""

    cause = "foot_lumping"
    title = "one spring for the foot, where it deflects all along it"

    def machine(self, machine: ModifiedChain, values: Sequence[float]) -> ModifiedChain:
        """More springs."""
        return replace(machine, engine=replace(machine.engine, foot_segments=SEGMENTS))


def effects(scene: Scene) -> list[Effect]:
    """Where the model has a foot of one spring and its section is known."""
    feet = [beam for beam in scene.chain.beams if beam.name == FOOT and beam.section is not None]
    return [FootLumping()] if feet and (scene.engine.foot_segments or 1) == 1 else []
