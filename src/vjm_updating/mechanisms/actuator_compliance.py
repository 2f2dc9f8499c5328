"""A drive that deflects linearly along its axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vjm.model.chain import Chain
from vjm.model.parts import Actuator
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene, part_table
from vjm_updating.mechanisms.element_sites import drive
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.series_elements import Element, memoryless


@dataclass(frozen=True)
class ActuatorCompliance(Effect):
    """``x = c N`` along the drive."""

    cause = "actuator_compliance"
    title = "the drive deflects linearly along its axis"

    def quantities(self) -> tuple[Quantity, ...]:
        """Beyond what the model has."""
        return (Quantity("compliance_mm_per_N", 0.0, 1e-2, 1e-5, neutral=0.0),)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """A twentieth of a foot's."""
        return [(1e-5,)]

    def elements(self, machine: ModifiedChain, values: Sequence[float]) -> tuple[Element, ...]:
        """One spring."""
        c = values[0]
        return (Element(drive(machine), memoryless(lambda N: (c * N, np.full_like(N, c)))),)

    def write(self, document: dict[str, Any], nominal: Chain, values: Sequence[float]) -> None:
        """Added to what each drive has."""
        for part in nominal.parts:
            if isinstance(part, Actuator):
                part_table(document, part.name)["compliance_mm_per_N"] = float(part.compliance + values[0])


def effects(scene: Scene) -> list[Effect]:
    """Where there is a drive."""
    return [ActuatorCompliance()] if ModifiedChain(scene.chain, scene.engine).drive_axis is not None else []
