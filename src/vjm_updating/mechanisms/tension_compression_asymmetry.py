"""A stiffness that differs between pull and push."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.machine import FOOT
from vjm.rotations import Array
from vjm_updating.mechanisms.drives import BEFORE_JOINTS, DriveSite, drives
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.modified_chain import LINK, ModifiedChain, foot_of, links_of, place_of
from vjm_updating.mechanisms.series_elements import SeriesElement, memoryless

RATIO = Quantity("ratio", 0.1, 10.0, 0.05, neutral=1.0)
AS_DRAWN = Quantity("as_drawn", -1.5, 1.5, 0.5, usual=0.0, spread=0.7)
"""Which way has the drawn stiffness: pull at 1, push at -1, at 0 neither but their geometric mean."""


class PullAndPush(Effect):
    """A stiffness in pull and another one in push."""

    cause = "tension_compression_asymmetry"
    title = "a stiffness differs between pull and push"

    @property
    def contains(self) -> tuple[str, ...]:
        """The part's compliance: in tests that pull only, or push only, it is the same."""
        named = self.part in ("actuator", "foot", LINK)
        return (f"{self.part}_compliance" if named else f"link_compliance.{self.part}",)

    def quantities(self) -> tuple[Quantity, ...]:
        """Pull stiffness over push stiffness, and which way is as drawn."""
        return (RATIO, AS_DRAWN)


def _mean(values: Sequence[float]) -> float:
    """Factor on the geometric mean of both compliances."""
    ratio, as_drawn = values
    return float(ratio ** (0.5 * as_drawn))


@dataclass(frozen=True)
class Asymmetry(PullAndPush):
    """Two factors on all stiffnesses of a part, one in pull and one in push.

    Attributes:
        part: ``foot`` or ``link``, or the link's name where there are several.
        beam: the part's name in the chain.
    """

    part: str = "link"
    beam: str = "link"

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Stiffer in pull, weaker in push, and both."""
        return [(1.1, 0.0), (1.1, 1.0), (1.1, -1.0)]

    def machine(self, machine: ModifiedChain, values: Sequence[float]) -> ModifiedChain:
        """Both factors."""
        changed = replace(machine, asymmetry=(*machine.asymmetry, (self.beam, values[0])))
        return changed.times(self.beam, _mean(values))


@dataclass(frozen=True)
class DriveAsymmetry(PullAndPush):
    """A drive whose spring differs between pull and push along its axis, or between both senses about it.

    Attributes:
        compliance: of the drive's spring in the model, mm/N.
        part: ``actuator``, or the joint in which it is.
        drive: the same.
    """

    compliance: float = 1e-5
    part: str = "actuator"
    drive: DriveSite = BEFORE_JOINTS

    @property
    def contains(self) -> tuple[str, ...]:
        """The drive's compliance."""
        return (f"actuator_compliance.{self.drive.part}".rstrip("."),)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Stiffer in pull, and softer, by either way or by both."""
        return [(1.3, 0.0), (1.3, 1.0), (1.3, -1.0), (0.75, 0.0)]

    def elements(self, machine: ModifiedChain, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """Deflection of both springs beyond the model's own one."""
        mean = _mean(values)
        pull, push = (self.compliance * (mean * values[0] ** power - 1.0) for power in (-0.5, 0.5))

        def law(N: Array) -> tuple[Array, Array]:
            slope = np.where(N > 0.0, pull, push)
            return slope * N, slope

        return (SeriesElement(self.drive.place(machine), memoryless(law)),)


def effects(scene: Scene) -> list[Effect]:
    """Of each drive where the model has a spring, of the foot and of each link, where the test loads them."""
    elastic = [own for own in drives(scene) if own.compliance > 0.0]
    found: list[Effect] = [DriveAsymmetry(own.compliance, own.part or "actuator", own) for own in elastic]
    found += [Asymmetry(part="foot", beam=FOOT)] if foot_of(scene.chain) else []
    found += [Asymmetry(place_of(scene.chain, name) or LINK, name) for name in links_of(scene.chain)]
    return [effect for effect in found if not isinstance(effect, Asymmetry) or _is_pulled(scene, effect)]


def _is_pulled(scene: Scene, effect: Asymmetry) -> bool:
    """Whether a ramp of the test pulls on the part, or pushes; what only bends has one stiffness."""
    machine = effect.machine(scene.machine, (1.0, 0.0))
    for posture, direction in scene.rays:
        try:
            force = scene.begun(machine, posture, direction)[:3]
        except NoConvergenceError:
            return True
        if any(machine.axial_signs(posture, force)):
            return True
    return not scene.rays
