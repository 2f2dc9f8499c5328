"""Dry friction in the passive joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vjm.effects.effect import Effect, Quantity, Scene


@dataclass(frozen=True)
class JointFriction(Effect):
    """Coulomb's law, one torque for every joint; see `vjm.effects.friction`."""

    cause = "joint_friction"
    title = "dry friction in the passive joints"

    def quantities(self) -> tuple[Quantity, ...]:
        """Torque at which a joint turns."""
        return (Quantity("torque_Nmm", 0.0, 1e6, 200.0, neutral=0.0),)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """So small that all joints turn, and larger."""
        return [(100.0,), (800.0,), (5000.0,)]

    def friction(self, values: Sequence[float]) -> float:
        """The torque."""
        return values[0]


def effects(scene: Scene) -> list[Effect]:
    """Where there are joints."""
    return [JointFriction()] if scene.chain.joints else []
