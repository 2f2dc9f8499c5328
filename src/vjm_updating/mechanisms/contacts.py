"""Causes in contacts: a contact in series, backlash in a drive, clearance in the joints of a link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.mechanisms.drives import BEFORE_JOINTS, DriveSite, InDrive, drives
from vjm_updating.mechanisms.effect import Effect, ExperimentContext, Quantity, along_link, drive
from vjm_updating.mechanisms.modified_chain import ModifiedMachine
from vjm_updating.mechanisms.series_elements import ElementSite, SeriesElement, memoryless

BLUNT = numerical(0.5, "N")
"""N below which the power law's infinite slope is rounded off."""


@dataclass(frozen=True)
class ContactCompliance(Effect):
    """``x = x₁ (|N|/1000 N)^p`` with the sign of N; Hertz's p is 2/3.

    Attributes:
        force: largest of the test, N.
        part: ``actuator``, or ``joints`` for those of the only link; the link's name where there are several.
        link: name of the link along which the joints' contact is; empty: the only one.
    """

    force: float = 1000.0
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

    def elements(self, machine: ModifiedMachine, values: Sequence[float]) -> tuple[SeriesElement, ...]:
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


def contact_compliance_effects(scene: ExperimentContext) -> list[Effect]:
    """In the drive's bearings, and in those of each link's joints."""
    effects: list[Effect] = [ContactCompliance(scene.force)] if scene.machine.drive_axis is not None else []
    return [
        *effects,
        *(ContactCompliance(scene.force, part or "joints", link) for part, link in scene.places(jointed=True)),
    ]


HERTZ = prior_scale(2.0 / 3.0)
"""Power of the force with which the ends of a travel yield: that of a contact."""
BEYOND = numerical(10.0)
"""Times the largest force of a test, that a search for the equilibrium may try."""


def play(place: ElementSite, values: Sequence[float], largest: float) -> SeriesElement:
    """Free travel between two contacts.

    ``x = g (½ tanh(N/N₀) + o + e N/F ((N² + N₀²)/F²)^(−1/6))``: g is the whole travel, N₀ the force within which it
    is crossed, and o where in it the unloaded machine stood, counted so that ``x = 0`` there. Beyond N₀ the ends
    yield as ``e g (|N|/F)^(2/3)``, like Hertz's contacts: by the share e of the travel at the largest force F. With
    e = 0 they are hard. A contact alone is the limit of no travel (`contact_compliance`). ``values`` are g in mm,
    o, N₀ in N, and e; ``largest`` is F in N.
    """
    gap, offset, crossed, ends = values

    def law(N: Array) -> tuple[Array, Array]:
        t, n = np.tanh(N / crossed), N / largest
        r = n**2 + (crossed / largest) ** 2
        power = r ** (0.5 * (HERTZ - 1.0))
        x = gap * (0.5 * t + offset + ends * n * power)
        give = ends / largest * power * (1.0 + (HERTZ - 1.0) * n**2 / r)
        return x, gap * (0.5 / crossed * (1.0 - t**2) + give)

    most = gap * (0.5 + abs(offset) + ends * BEYOND**HERTZ)
    return SeriesElement(place, memoryless(law), most=most + 1e-9)


def travel(force: float, share: float = 1.0) -> tuple[Quantity, ...]:
    """Travel, place, the force that crosses it, and how far its ends yield.

    ``force`` is the largest of the test, N; ``share`` is of the forces at which ends are usually met.
    """
    return (
        Quantity("gap_mm", 0.0, 5.0, 0.01, neutral=0.0),
        Quantity("offset_share", -0.5, 0.5, 0.1, usual=0.0, spread=0.2),
        Quantity("contact_N", 0.3 * share, 0.2 * force, 20.0 * share, usual=10.0 * share, spread=0.8, log=True),
        Quantity("end_share", 0.0, 5.0, 0.1, usual=0.0, spread=0.2),
    )


def travels(share: float = 1.0) -> Sequence[tuple[float, ...]]:
    """Small and large ones, hard and soft."""
    return [(0.01, 0.0, 5.0 * share, 0.0), (0.01, 0.0, 60.0 * share, 0.0), (0.06, 0.0, 10.0 * share, 0.0)]


@dataclass(frozen=True)
class ActuatorBacklash(InDrive):
    """Lost motion in a drive, see `play`.

    A joint may bear little: its ends are met at the share of its load that they are of a drive's usual one. The
    ``force`` is the largest of the test on the drive, N.
    """

    force: float = 1000.0
    part: str = ""
    drive: DriveSite = BEFORE_JOINTS
    cause = "actuator_backlash"
    title = "lost motion in the drive"

    @property
    def _share(self) -> float:
        return self.force / BEFORE_JOINTS.force if self.drive.joint else 1.0

    def sliding(self) -> tuple[Quantity, ...]:
        """Travel, place, the force that crosses it, and how far its ends yield."""
        return travel(self.force, self._share)

    def sliding_trials(self) -> Sequence[tuple[float, ...]]:
        """Small and large ones, hard and soft."""
        return travels(self._share)

    def sliding_elements(self, place: ElementSite, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """One element."""
        return (play(place, values, self.force),)


@dataclass(frozen=True)
class JointClearance(Effect):
    """Backlash along a link in its joints, see `play`.

    Attributes:
        force: largest of the test, N.
        part: the link along which it is, where there are several.
        link: name of the link whose line that is; empty: the only one.
    """

    force: float = 1000.0
    part: str = ""
    link: str = ""
    cause = "joint_clearance"
    title = "backlash along the link in its joints"

    def quantities(self) -> tuple[Quantity, ...]:
        """Travel, place, the force that crosses it, and how far its ends yield."""
        return travel(self.force)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Small and large ones, hard and soft."""
        return travels()

    def elements(self, machine: ModifiedMachine, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """One element."""
        return (play(along_link(machine, self.link), values, self.force),)


def lost_motion_effects(scene: ExperimentContext) -> list[Effect]:
    """In every drive, and along each link that has a joint."""
    effects: list[Effect] = [ActuatorBacklash(own.force, own.part, own) for own in drives(scene)]
    return [*effects, *(JointClearance(scene.force, part, link) for part, link in scene.places(jointed=True))]
