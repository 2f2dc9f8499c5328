"""A drive that deflects linearly along its axis, or about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vjm.io.checks import checked_part_compliance
from vjm.model.joints import Joint, JointKind
from vjm.model.machine import Machine
from vjm.model.parts import Part
from vjm_updating.mechanisms.drives import BEFORE_JOINTS, DriveSite, InDrive, drives, softened
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene, part_table
from vjm_updating.mechanisms.series_elements import ElementSite, SeriesElement, memoryless


@dataclass(frozen=True)
class ActuatorCompliance(InDrive):
    """``x = c N`` along the drive, or ``x = c M`` about the axis of a joint that turns.

    Attributes:
        part: the joint in which the drive is; empty: the drive before all passive joints.
        drive: the same.
    """

    part: str = ""
    drive: DriveSite = BEFORE_JOINTS
    cause = "actuator_compliance"
    title = "the drive deflects linearly along its axis"

    def sliding(self) -> tuple[Quantity, ...]:
        """Beyond what the model has."""
        return (Quantity("compliance_mm_per_N", 0.0, 1e-2, 1e-5, neutral=0.0),)

    def sliding_trials(self) -> Sequence[tuple[float, ...]]:
        """A twentieth of a foot's."""
        return [(1e-5,)]

    def sliding_elements(self, place: ElementSite, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """One spring."""
        c = values[0]
        return (SeriesElement(place, memoryless(lambda N: (c * N, np.full_like(N, c)))),)

    def built(self, chain: Machine, values: Sequence[float]) -> Machine:
        """A chain with it, added to what the joint, or each drive that slides before all joints, has."""
        softer: dict[str, Part] = {joint.name: softened(joint, values[0]) for joint in self._joints(chain)}
        return replace(chain, parts=tuple(softer.get(part.name, part) for part in chain.parts))

    def _joints(self, chain: Machine) -> list[Joint]:
        """The joint, or each drive that slides before all joints."""
        joints = [part for part in chain.parts if isinstance(part, Joint)]
        if self.drive.joint:
            return [joint for joint in joints if joint.name == self.drive.joint and joint.held]
        return [joint for joint in joints if joint.kind is JointKind.ACTUATOR]

    def is_written(self, nominal: Machine, values: Sequence[float]) -> bool:
        """Whether a file can say it: not beside a 6×6 compliance that is rigid askew to the joint's axis."""
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
            if joint.matrix is not None:
                table["compliance"] = joint.matrix.tolist()
            elif joint.passive:
                table["stiffness_N_per_mm" if joint.slides else "stiffness_Nmm_per_rad"] = float(joint.stiffness)
            else:
                table[self.quantities()[0].name] = float(joint.compliance)


def effects(scene: Scene) -> list[Effect]:
    """In every drive."""
    return [ActuatorCompliance(own.part, own) for own in drives(scene)]
