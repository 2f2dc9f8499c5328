"""A permanent set after a yield load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vjm_updating.mechanisms.drives import BEFORE_JOINTS, DriveSite, InDrive, drives
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.element_sites import along_link, foot, has_joint
from vjm_updating.mechanisms.modified_chain import LINK, ModifiedChain, foot_of, link_of
from vjm_updating.mechanisms.series_elements import ElementSite, SeriesElement, together, yielding


@dataclass(frozen=True)
class Plasticity(InDrive):
    """Slip with linear hardening once the force is beyond the yield force, and more of it later on.

    Two slip elements (Iwan 1967) make the yield gradual; hardening is partly isotropic, partly kinematic.

    Attributes:
        part: ``actuator``, ``foot``, or ``joints`` along the only link, ``link`` where it has none; the link's name
            where there are several, or a joint's.
        force: largest of the test, N.
        link: name of the link along which it slips; empty: the only one.
        drive: which, where the part is the drive before all passive joints or one in a joint.
    """

    part: str = "foot"
    force: float = 1000.0
    link: str = ""
    drive: DriveSite = BEFORE_JOINTS
    cause = "plasticity"
    title = "a permanent set after a yield load"

    def sliding(self) -> tuple[Quantity, ...]:
        """Axial force at first yield, the plastic compliance in the end, and shapes.

        The compliance of the foot is over its elastic one. Shapes: how much of it comes half-way from first yield
        to the largest force, and how much of the hardening is isotropic.
        """
        soft = (
            Quantity("softness", 0.0, 20.0, 0.05, neutral=0.0)
            if self.part == "foot"
            else Quantity("softness_mm_per_N", 0.0, 1e-1, 1e-5, neutral=0.0)
        )
        return (
            Quantity("yield_N", 0.01 * self.force, 1.2 * self.force, 0.1 * self.force),
            soft,
            Quantity("late_share", 0.0, 0.95, 0.1, usual=0.3, spread=0.25),
            Quantity("isotropic_share", 0.0, 1.0, 0.1, usual=0.5, spread=0.4),
        )

    def sliding_trials(self) -> Sequence[tuple[float, ...]]:
        """Early and late yield."""
        soft = 0.1 if self.part == "foot" else 2e-5
        return [(share * self.force, soft, 0.3, 0.5) for share in (0.3, 0.5, 0.7, 0.85)]

    def sliding_elements(self, place: ElementSite, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """One element with that law."""
        limit, soft, late, grows = values
        soft = max(soft, 1e-12)
        slips = together(
            yielding(limit, (1.0 - late) * soft, grows),
            yielding(0.5 * (limit + max(self.force, limit)), max(late, 1e-6) * soft, grows),
        )
        return (SeriesElement(place, slips),)

    def site(self, machine: ModifiedChain) -> ElementSite:
        """Where it slips."""
        if self.part == "actuator" or self.drive.joint:
            return self.drive.place(machine)
        return foot(machine) if self.part == "foot" else along_link(machine, self.link)


def effects(scene: Scene) -> list[Effect]:
    """In drives and foot, and along each link or in its joints."""
    found: list[Effect] = [Plasticity(own.part or "actuator", own.force, drive=own) for own in drives(scene)]
    found += [Plasticity("foot", scene.force)] if foot_of(scene.chain) else []
    places = scene.places(jointed=False)
    only = "joints" if places and has_joint(scene.chain, link_of(scene.chain)) else LINK
    return [*found, *(Plasticity(part or only, scene.force, link) for part, link in places)]
