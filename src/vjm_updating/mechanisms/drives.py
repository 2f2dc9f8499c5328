"""Drives of a machine, and the elastic causes in them: compliance, hardening, asymmetry of pull and push.

The one drive before all passive joints, and those in the joints of a serial robot.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.checks import checked_part_compliance
from vjm.model.laws import Law
from vjm.model.machine import FOOT, Machine
from vjm.model.parts import Joint, JointKind, Part
from vjm.rotations import Array
from vjm_updating.constants import prior_scale
from vjm_updating.mechanisms.effect import SAME, Effect, ExperimentContext, Quantity, drive, part_table
from vjm_updating.mechanisms.joint_motions import braced, joint_motions
from vjm_updating.mechanisms.modified_chain import LINK, NEITHER, ModifiedMachine, foot_of, links_of, place_of
from vjm_updating.mechanisms.series_elements import AtJoint, ElementSite, SeriesElement, by_curve, memoryless
from vjm_updating.mechanisms.structure import FACTOR

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
        lever: mm at which a turn is counted; 1 for what slides.
        compliance: of its spring in the model at the lever, mm/N.
        matters: change of it that matters, mm/N at the lever; of a joint a share, `part_compliance.FACTOR`'s, of
            what the joint has or the whole machine shows in the test, whichever is more.
        force: the largest one on it in the test, at the lever, N.
        law: of its spring in the model, where it has one that a force tells; else None.
    """

    part: str = ""
    joint: str = ""
    turns: bool = False
    lever: float = 1.0
    compliance: float = 0.0
    matters: float = USUAL
    force: float = 1000.0
    law: Law | None = None

    def place(self, machine: ModifiedMachine) -> ElementSite:
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

    Its ``part`` is the joint in which the drive is; empty: the drive before all passive joints.
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

    def elements(self, machine: ModifiedMachine, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """The law where the drive is."""
        own = np.asarray(values) / self.drive.factors(self.sliding())
        return self.sliding_elements(self.site(machine), own.tolist())

    def site(self, machine: ModifiedMachine) -> ElementSite:
        """Where elements sit."""
        return self.drive.place(machine)


def drives(scene: ExperimentContext) -> list[DriveSite]:
    """The drive before all passive joints, where there is one, and those in joints, from base to tool.

    Joints that move the end-effector alike in every posture of a test, about one line or along one direction, are
    one place: no reading distinguishes them. A joint on a branch that does not carry the end-effector is none, nor
    is one whose deflection strains a machine with closed loops.
    """
    machine, chain = scene.machine, scene.chain
    own = machine.drive
    sites: list[DriveSite] = []
    if own is not None:
        sites.append(DriveSite(compliance=compliance_of(own), force=scene.force, law=law_told_by_force(own)))
    away = braced(machine, scene.labels)
    joints = [j for j in chain.moving if j.held and _is_driven(chain, j) and j.name not in away]
    if not joints or not scene.slips:
        return sites
    length = chain.characteristic_length
    moved = [joint_motions(machine, label) for label in sorted(scene.labels)]
    places: list[tuple[list[Joint], Array]] = []
    for joint in joints:
        motion = np.array([motions[joint.name] / np.repeat([1.0, 1.0 / length], 3) for motions in moved])
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
        law = law_told_by_force(first) if len(same) == 1 else None
        sites.append(DriveSite(name, first.name, not first.slides, lever, compliance, matters, load, law))
    return sites


def law_told_by_force(joint: Joint) -> Law | None:
    """The law of a joint's spring, where it has one that a force tells."""
    return joint.law if joint.law is not None and joint.law.rises else None


def _begun(scene: ExperimentContext) -> list[tuple[Array, dict[str, Array]]]:
    """Of each ramp the wrench ``(6,)`` with which it begins, over its force, and the joints' motions ``(6,)``."""
    ramps = []
    for posture, direction in scene.rays:
        try:
            wrench = scene.begun(scene.machine, posture, direction)
        except NoConvergenceError:
            continue
        if wrench[:3].any():
            wrench /= np.linalg.norm(wrench[:3])
            ramps.append((wrench, joint_motions(scene.machine, posture)))
    return ramps


def _load(begun: Sequence[tuple[Array, dict[str, Array]]], joint: str, lever: float) -> float:
    """Largest force on a joint at its lever, over that at the end-effector; zero where none is felt."""
    largest = max((abs(float(wrench @ motions[joint])) / lever for wrench, motions in begun), default=0.0)
    return largest if largest > NEITHER else 0.0


def _is_driven(chain: Machine, joint: Joint) -> bool:
    """Whether it has a drive, or a spring in its place that is free of stress in every posture."""
    values = [held.get(joint.name, 0.0) for held in chain.held.values()] if joint.passive else []
    return all(replace(joint, value=value).stretch == 0.0 for value in values)


def compliance_of(joint: Joint) -> float:
    """Of a joint's spring about or along its axis, rad/(N mm) or mm/N; of a law where that is stiffest."""
    if joint.matrix is None or joint.law is not None:
        return joint.compliances[0]
    return float(_along(joint) @ joint.matrix @ _along(joint))


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


COMPLIANCE = Quantity("compliance_mm_per_N", 0.0, 1e-2, 1e-5, neutral=0.0)
"""Of a drive's spring, beyond the model's or where the model has none."""


@dataclass(frozen=True)
class ActuatorCompliance(InDrive):
    """``x = c N`` along the drive, or ``x = c M`` about the axis of a joint that turns.

    A drive with a law deflects by a factor more than its law says.
    """

    part: str = ""
    drive: DriveSite = BEFORE_JOINTS
    cause = "actuator_compliance"
    title = "the drive is softer along its axis"

    def sliding(self) -> tuple[Quantity, ...]:
        """Beyond what the model has."""
        return (COMPLIANCE if self.drive.law is None else FACTOR,)

    def sliding_trials(self) -> Sequence[tuple[float, ...]]:
        """A twentieth of a foot's."""
        return [(1e-5,)] if self.drive.law is None else [(1.3,), (0.8,)]

    def sliding_elements(self, place: ElementSite, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """One spring."""
        if self.drive.law is None:
            c = values[0]
            return (SeriesElement(place, memoryless(lambda N: (c * N, np.full_like(N, c)))),)
        softer = by_curve(self.drive.law.curve, lever=self.drive.lever, times=values[0] - 1.0)
        return (SeriesElement(place, softer),)

    def built(self, chain: Machine, values: Sequence[float]) -> Machine:
        """A chain with it, added to what the joint, or each drive that slides before all joints, has."""
        softer: dict[str, Part] = {joint.name: self._softened(joint, values[0]) for joint in self._joints(chain)}
        return replace(chain, parts=tuple(softer.get(part.name, part) for part in chain.parts))

    def _softened(self, joint: Joint, by: float) -> Joint:
        if joint.law is not None and self.drive.law is not None:
            return replace(joint, law=joint.law.softer(by))
        return softened(joint, by)

    def _joints(self, chain: Machine) -> list[Joint]:
        """The joint, or each drive that slides before all joints."""
        joints = [part for part in chain.parts if isinstance(part, Joint)]
        if self.drive.joint:
            return [joint for joint in joints if joint.name == self.drive.joint and joint.held]
        return [joint for joint in joints if joint.kind is JointKind.ACTUATOR]

    def is_written(self, nominal: Machine, values: Sequence[float]) -> bool:
        """Whether a joint's numbers can say it: no law that no force tells, nor a 6×6 rigid askew to the axis."""
        if self.drive.law is None and any(joint.law is not None for joint in self._joints(nominal)):
            return False
        for joint in self._joints(self.built(nominal, values)):
            if joint.matrix is not None:
                try:
                    checked_part_compliance(joint.matrix)
                except ValueError:
                    return False
        return True

    def write(self, document: dict[str, Any], nominal: Machine, values: Sequence[float]) -> None:
        """Added to what the joint, or each drive, has."""
        if not self.is_written(nominal, values):
            return
        for joint in self._joints(self.built(nominal, values)):
            table = part_table(document, joint.name)
            if joint.law is not None:
                table["law"] = joint.law.table(slides=joint.slides)
            elif joint.matrix is not None:
                table["compliance"] = joint.matrix.tolist()
            elif joint.passive:
                table["stiffness_N_per_mm" if joint.slides else "stiffness_Nmm_per_rad"] = float(joint.stiffness)
            else:
                table[self.quantities()[0].name] = float(joint.compliance)


def actuator_compliance_effects(scene: ExperimentContext) -> list[Effect]:
    """In every drive."""
    return [ActuatorCompliance(own.part, own) for own in drives(scene)]


RATIO = Quantity("stiffness_ratio", 0.05, 20.0, 1.0, neutral=1.0, usual=1.0, spread=np.log(2.5), log=True)
"""Drives' stiffness over their range of load: strain wave gears' makers promise 1 to 1.3 to 1.6 for small, middle
and large torque, preloaded screws double theirs."""


EXPONENT = Quantity("exponent", 0.25, 4.0, 1.0, usual=1.0, spread=0.5, log=True)
"""Of the load: stiffness that falls or grows evenly, or exponentially, lies between 0.4 and 1.8."""


@dataclass(frozen=True)
class ActuatorHardening(InDrive):
    """Tangent compliance ``c₀ (1 + (1/r − 1) u^m)`` at a share ``u = |N|/N_max`` of the largest load.

    So ``x = c₀ N (1 + (1/r − 1) u^m/(m + 1))``; the tangent stiffness at the largest load is r times that at none.

    Attributes:
        force: N_max, the largest force of the test on the drive, N.
        compliance: c₀ of the drive's spring in the model, mm/N; zero where it has none, and c₀ is looked for.
    """

    force: float = 1000.0
    compliance: float = 0.0
    part: str = ""
    drive: DriveSite = BEFORE_JOINTS
    cause = "actuator_hardening"
    title = "the drive's spring stiffens or softens with load"

    @property
    def contains(self) -> tuple[str, ...]:
        """A spring of its own may as well be linear."""
        return () if self.compliance else (f"actuator_compliance.{self.part}".rstrip("."),)

    def sliding(self) -> tuple[Quantity, ...]:
        """r, c₀ at zero load where the model has none, and m."""
        own = () if self.compliance else (COMPLIANCE,)
        return (RATIO, *own, EXPONENT)

    def sliding_trials(self) -> Sequence[tuple[float, ...]]:
        """Stiffening and softening ones."""
        if self.compliance:
            return [(1.5, 1.0), (0.6, 1.0)]
        return [(3.0, 2e-5, 1.0), (10.0, 4e-5, 1.0), (0.3, 1e-5, 1.0)]

    def sliding_elements(self, place: ElementSite, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """One spring with that law, in the place of the model's own."""
        r, c, m = values[0], self.compliance or values[1], values[-1]

        def law(N: Array) -> tuple[Array, Array]:
            x, slope = wound_up_by_load(N / self.force, r, m)
            return c * self.force * x - self.compliance * N, c * slope - self.compliance

        return (SeriesElement(place, memoryless(law)),)


def wound_up_by_load(load: Array, ratio: float, power: float) -> tuple[Array, Array]:
    """Wind-up ``(n,)`` and its derivative at shares of the largest load, of a spring of unit compliance at no load.

    Beyond the largest load the tangent stays.
    """
    size = np.minimum(np.abs(load), 1.0)
    grown = (1.0 / ratio - 1.0) * size**power
    return np.sign(load) * (size * (1.0 + grown / (power + 1.0)) + (np.abs(load) - size) / ratio), 1.0 + grown


def actuator_hardening_effects(scene: ExperimentContext) -> list[Effect]:
    """In every drive."""
    return [ActuatorHardening(own.force, own.compliance, own.part, own) for own in drives(scene)]


PULL_RATIO = Quantity("ratio", 0.1, 10.0, 0.05, neutral=1.0)
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
        return (PULL_RATIO, AS_DRAWN)


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

    def machine(self, machine: ModifiedMachine, values: Sequence[float]) -> ModifiedMachine:
        """Both factors."""
        changed = replace(machine, asymmetry=(*machine.asymmetry, (self.beam, values[0])))
        return changed.times(self.beam, _mean(values))


@dataclass(frozen=True)
class DriveAsymmetry(InDrive, PullAndPush):
    """A drive whose spring differs between pull and push along its axis, or between both senses about it.

    Attributes:
        compliance: of the drive's spring in the model, mm/N; zero where it has none, and the geometric mean of both
            is looked for.
        part: ``actuator``, or the joint in which it is.
    """

    compliance: float = 0.0
    part: str = "actuator"
    drive: DriveSite = BEFORE_JOINTS

    @property
    def contains(self) -> tuple[str, ...]:
        """The drive's compliance."""
        return (f"actuator_compliance.{self.drive.part}".rstrip("."),)

    def sliding(self) -> tuple[Quantity, ...]:
        """Pull stiffness over push stiffness, and which way is as drawn, or the compliance of an undrawn spring."""
        return (PULL_RATIO, AS_DRAWN if self.compliance else COMPLIANCE)

    def sliding_trials(self) -> Sequence[tuple[float, ...]]:
        """Stiffer in pull, and softer, by either way or by both."""
        if self.compliance:
            return [(1.3, 0.0), (1.3, 1.0), (1.3, -1.0), (0.75, 0.0)]
        return [(3.0, 1e-5), (0.3, 1e-5)]

    def sliding_elements(self, place: ElementSite, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """Deflection of both springs beyond the model's own one."""
        ratio, other = values
        mean = self.compliance * _mean(values) if self.compliance else other
        pull, push = (mean * ratio**power - self.compliance for power in (-0.5, 0.5))

        def law(N: Array) -> tuple[Array, Array]:
            slope = np.where(N > 0.0, pull, push)
            return slope * N, slope

        return (SeriesElement(place, memoryless(law)),)


def asymmetry_effects(scene: ExperimentContext) -> list[Effect]:
    """Of each drive, of the foot and of each link, where the test loads them."""
    effects: list[Effect] = [DriveAsymmetry(own.compliance, own.part or "actuator", own) for own in drives(scene)]
    effects += [Asymmetry(part="foot", beam=FOOT)] if foot_of(scene.chain) else []
    effects += [Asymmetry(place_of(scene.chain, name) or LINK, name) for name in links_of(scene.chain)]
    return [effect for effect in effects if not isinstance(effect, Asymmetry) or _is_pulled(scene, effect)]


def _is_pulled(scene: ExperimentContext, effect: Asymmetry) -> bool:
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
