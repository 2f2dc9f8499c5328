"""A contact in series, whose displacement grows as a power below one of the force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.element_sites import along_link, drive
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.series_elements import SeriesElement, memoryless

BLUNT = numerical(0.5, "N")
"""N below which the power law's infinite slope is rounded off."""


@dataclass(frozen=True)
class ContactCompliance(Effect):
    """``x = x₁ (|N|/1000 N)^p`` with the sign of N; Hertz's p is 2/3.

    Attributes:
        part: ``actuator``, or ``joints`` for those of the only link; the link's name where there are several.
        link: name of the link along which the joints' contact is; empty: the only one.
    """

    part: str = "actuator"
    link: str = ""
    cause = "contact_compliance"
    title = "a contact in series, like Hertz's"

    def quantities(self) -> tuple[Quantity, ...]:
        """Displacement at 1 kN, and the power."""
        return (
            Quantity("displacement_at_1kN_mm", 0.0, 2.0, 0.01, neutral=0.0),
            Quantity("exponent", 0.3, 0.95, 0.1, usual=2.0 / 3.0, spread=0.1),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Hertz's, and rougher and smoother contacts."""
        return [(0.01, 2.0 / 3.0), (0.01, 0.4), (0.05, 2.0 / 3.0)]

    def elements(self, machine: ModifiedChain, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """One element with that law."""
        size, p = values

        def law(N: Array) -> tuple[Array, Array]:
            r = (N / 1000.0) ** 2 + (BLUNT / 1000.0) ** 2
            power = r ** (0.5 * (p - 1.0))
            x = size * N / 1000.0 * power
            slope = size / 1000.0 * power * (1.0 + (p - 1.0) * (N / 1000.0) ** 2 / r)
            return x, slope

        place = drive(machine) if self.part == "actuator" else along_link(machine, self.link)
        return (SeriesElement(place, memoryless(law)),)


def effects(scene: Scene) -> list[Effect]:
    """In the drive's bearings, and in those of each link's joints."""
    found: list[Effect] = [ContactCompliance("actuator")] if scene.machine.drive_axis is not None else []
    return [*found, *(ContactCompliance(part or "joints", link) for part, link in scene.places(jointed=True))]
