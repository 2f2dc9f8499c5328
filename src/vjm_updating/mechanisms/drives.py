"""Drives of a machine: the one before all passive joints, and those in the joints of a serial robot.

What deflects in a joint that turns is told in rad and N mm. Laws take it at a lever, the chain's longest straight
piece L: a turn x moves a point there by L x mm, and a moment M is a force M/L there. So one law, and one size that
matters, serve drives that slide and joints that turn.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.joints import Joint
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_updating.constants import prior_scale
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.element_sites import SAME, drive
from vjm_updating.mechanisms.joint_motions import braced, joint_motions
from vjm_updating.mechanisms.modified_chain import NEITHER, ModifiedChain
from vjm_updating.mechanisms.part_compliance import FACTOR
from vjm_updating.mechanisms.series_elements import AtJoint, ElementSite, SeriesElement

SOFT = "_mm_per_N"
"""Ending of compliances."""
TURNED = {SOFT: ("_rad_per_Nmm", -2), "_mm": ("_rad", -1), "_N": ("_Nmm", 1)}
"""Endings of quantities of what slides, those of what turns, and which power of the lever lies between."""

USUAL = prior_scale(1e-5, "mm/N")
"""mm/N of a drive before all passive joints that matter."""


@dataclass(frozen=True)
class DriveSite:
    """Where something is driven; by default the drive before all passive joints.

    Attributes:
        part: what a verdict calls it; empty for the drive before all passive joints.
        joint: name of the joint; empty for that drive.
        turns: whether it turns.
        lever: mm at which a turn is counted; 1 for what slides.
        compliance: of its spring in the model at the lever, mm/N.
        matters: change of it that matters, mm/N at the lever; of a joint a share, `part_compliance.FACTOR`'s, of
            what the joint has or the whole machine shows in the test, whichever is more.
        force: the largest one on it in the test, at the lever, N.
    """

    part: str = ""
    joint: str = ""
    turns: bool = False
    lever: float = 1.0
    compliance: float = 0.0
    matters: float = USUAL
    force: float = 1000.0

    def place(self, machine: ModifiedChain) -> ElementSite:
        """Where elements sit.

        Raises:
            ValueError: there is no such drive.
        """
        return AtJoint(self.joint, self.lever) if self.joint else drive(machine)

    def told(self, quantity: Quantity) -> Quantity:
        """A quantity of what slides, in mm and N, as that of this drive."""
        if not self.joint:
            return quantity
        name, per = self._unit(quantity.name)
        soft = quantity.name.endswith(SOFT)
        neutral = None if quantity.neutral is None else quantity.neutral * per
        return Quantity(
            name, quantity.low * per, np.inf if soft else quantity.high * per,
            quantity.scale * per * (self.matters / USUAL if soft else 1.0), neutral, quantity.usual * per,
            quantity.spread * (1.0 if quantity.log else per), quantity.log,
        )  # fmt: skip

    def sizes(self, quantities: Sequence[Quantity]) -> Array:
        """How many times as large values ``(k,)`` matter as those of the drive before all passive joints."""
        return np.array([self.matters / USUAL if q.name.endswith(SOFT) else 1.0 for q in quantities])

    def factors(self, quantities: Sequence[Quantity]) -> Array:
        """Factors ``(k,)`` from values of what slides, in mm and N, to those of this drive."""
        return np.array([self._unit(q.name)[1] for q in quantities])

    def _unit(self, name: str) -> tuple[str, float]:
        if self.turns:
            for ending, (own, power) in TURNED.items():
                if name.endswith(ending):
                    return name.removesuffix(ending) + own, self.lever**power
        return name, 1.0


BEFORE_JOINTS = DriveSite()
"""That before all passive joints."""


class InDrive(Effect, ABC):
    """A cause in a drive, told by a law in mm and N.

    Attributes:
        drive: which.
    """

    drive: DriveSite = BEFORE_JOINTS

    @abstractmethod
    def sliding(self) -> tuple[Quantity, ...]:
        """The parameters of the law, in mm and N."""

    @abstractmethod
    def sliding_trials(self) -> Sequence[tuple[float, ...]]:
        """Values of these to begin a search from."""

    @abstractmethod
    def sliding_elements(self, place: ElementSite, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """Elements with the law in a place."""

    def quantities(self) -> tuple[Quantity, ...]:
        """The parameters, in rad and N mm where the drive turns."""
        return tuple(self.drive.told(q) for q in self.sliding())

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Values of the parameters to begin a search from."""
        quantities = self.sliding()
        factors = self.drive.factors(quantities) * self.drive.sizes(quantities)
        return [tuple(float(v) for v in factors * trial) for trial in self.sliding_trials()]

    def elements(self, machine: ModifiedChain, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """The law where the drive is."""
        own = np.asarray(values) / self.drive.factors(self.sliding())
        return self.sliding_elements(self.site(machine), own.tolist())

    def site(self, machine: ModifiedChain) -> ElementSite:
        """Where elements sit."""
        return self.drive.place(machine)


def drives(scene: Scene) -> list[DriveSite]:
    """The drive before all passive joints, where there is one, and those in joints, from base to tool.

    Joints that move the end-effector alike in every posture of a test, about one line or along one direction, are
    one place: no reading distinguishes them. A joint on a branch that does not carry the end-effector is none, nor
    is one whose deflection strains a machine with closed loops.
    """
    machine, chain = scene.machine, scene.chain
    own = machine.drive
    found = [] if own is None else [DriveSite(compliance=own.compliance, force=scene.force)]
    away = braced(machine, scene.labels)
    joints = [j for j in chain.moving if j.held and _is_driven(chain, j) and j.name not in away]
    if not joints or not scene.slips:
        return found
    length = chain.characteristic_length
    moved = [joint_motions(machine, label) for label in sorted(scene.labels)]
    places: list[tuple[list[Joint], Array]] = []
    for joint in joints:
        motion = np.array([at[joint.name] / np.repeat([1.0, 1.0 / length], 3) for at in moved])
        if not np.abs(motion).max(initial=0.0) > SAME:
            continue
        size = np.abs(motion).max()
        same = next((one for one, other in places if np.abs(other - motion).max() < SAME * size), None)
        if same is None:
            places.append(([joint], motion))
        else:
            same.append(joint)
    begun = _begun(scene)
    for same, _ in places:
        first = same[0]
        lever = 1.0 if first.slides else length
        name = " or ".join(joint.name for joint in same)
        compliance = compliance_of(first) * lever**2
        matters = FACTOR.scale * max(compliance, scene.reach / scene.force)
        load = _load(begun, first.name, lever) * scene.force or scene.force
        found.append(DriveSite(name, first.name, not first.slides, lever, compliance, matters, load))
    return found


def _begun(scene: Scene) -> list[tuple[Array, dict[str, Array]]]:
    """Of each ramp the wrench ``(6,)`` with which it begins, over its force, and the joints' motions ``(6,)``."""
    found = []
    for posture, direction in scene.rays:
        try:
            wrench = scene.begun(scene.machine, posture, direction)
        except NoConvergenceError:
            continue
        if wrench[:3].any():
            wrench /= np.linalg.norm(wrench[:3])
            found.append((wrench, joint_motions(scene.machine, posture)))
    return found


def _load(begun: Sequence[tuple[Array, dict[str, Array]]], joint: str, lever: float) -> float:
    """Largest force on a joint at its lever, over that at the end-effector; zero where none is felt."""
    found = max((abs(float(wrench @ motions[joint])) / lever for wrench, motions in begun), default=0.0)
    return found if found > NEITHER else 0.0


def _is_driven(chain: Machine, joint: Joint) -> bool:
    """Whether it has a drive, or a spring in its place that is free of stress in every posture."""
    at = [held.get(joint.name, 0.0) for held in chain.held.values()] if joint.passive else []
    return all(replace(joint, value=value).stretch == 0.0 for value in at)


def compliance_of(joint: Joint) -> float:
    """Of a joint's spring about or along its axis, rad/(N mm) or mm/N."""
    return joint.compliance if joint.matrix is None else float(_along(joint) @ joint.matrix @ _along(joint))


def softened(joint: Joint, by: float) -> Joint:
    """A joint with a compliance about or along its axis, rad/(N mm) or mm/N, added to what it has."""
    if joint.matrix is None:
        return replace(joint, compliance=joint.compliance + by)
    return replace(joint, matrix=joint.matrix + by * np.outer(_along(joint), _along(joint)))


def _along(joint: Joint) -> Array:
    """What the joint does to what is behind it ``(6,)``, in its own frame."""
    result = np.zeros(6)
    result[slice(0, 3) if joint.slides else slice(3, 6)] = joint.axis
    return result
