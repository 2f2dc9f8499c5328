"""A drive that deflects linearly along its axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
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


def effects(scene: Scene) -> list[Effect]:
    """Where there is a drive."""
    return [ActuatorCompliance()] if ModifiedChain(scene.chain, scene.engine).drive_axis is not None else []
