"""Lost motion: `actuator_backlash` in the drive, `joint_clearance` along a link in its joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.element_sites import drive
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.series_elements import AlongLine, Element, memoryless


@dataclass(frozen=True)
class Play(Effect):
    """Free travel, whose ends are met within a small force.

    ``x = g (½ tanh(N/N₀) + o)``: g is the whole travel, N₀ how soft its ends are, and o where in it the unloaded
    machine stood, counted so that ``x = 0`` there.

    Attributes:
        force: largest of the test, N.
        part: the link along which it is, where there are several.
        link: name of the link whose line that is; empty: the only one.
    """

    force: float = 1000.0
    part: str = ""
    link: str = ""

    def quantities(self) -> tuple[Quantity, ...]:
        """Travel, place and softness."""
        return (
            Quantity("gap_mm", 0.0, 5.0, 0.01, neutral=0.0),
            Quantity("offset_share", -0.5, 0.5, 0.1, usual=0.0, spread=0.2),
            Quantity("contact_N", 0.3, 0.2 * self.force, 20.0, usual=10.0, spread=0.8, log=True),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Small and large ones, hard and soft."""
        return [(0.01, 0.0, 5.0), (0.01, 0.0, 60.0), (0.06, 0.0, 10.0)]

    def elements(self, machine: ModifiedChain, values: Sequence[float]) -> tuple[Element, ...]:
        """One element that ends at half the travel to both sides."""
        gap, offset, contact = values

        def law(N: Array) -> tuple[Array, Array]:
            t = np.tanh(N / contact)
            return gap * (0.5 * t + offset), 0.5 * gap / contact * (1.0 - t**2)

        place = drive(machine) if self.cause == "actuator_backlash" else AlongLine(self.link)
        return (Element(place, memoryless(law), most=gap * (0.5 + abs(offset)) + 1e-9),)


@dataclass(frozen=True)
class ActuatorBacklash(Play):
    """Lost motion in the drive."""

    cause = "actuator_backlash"
    title = "lost motion in the drive"


@dataclass(frozen=True)
class JointClearance(Play):
    """Play along a link in its joints."""

    cause = "joint_clearance"
    title = "play along the link in its joints"


def effects(scene: Scene) -> list[Effect]:
    """In the drive, where there is one, and along each link that has a joint."""
    found: list[Effect] = []
    if scene.machine.drive_axis is not None:
        found.append(ActuatorBacklash(force=scene.force))
    return [*found, *(JointClearance(scene.force, part, link) for part, link in scene.places(jointed=True))]
