"""What predictions of tests share in which no equilibrium has a second branch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment.rays import Ray
from vjm_updating.inference.forward import machine_of
from vjm_updating.inference.parameters import Hypothesis
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.observation.coordinate import Coordinate
from vjm_updating.observation.observed import Observed


@dataclass
class PlainForward:
    """All of a `vjm_updating.inference.forward.Predictor` but its predictions.

    Attributes:
        observed: the readings.
        branches: none.
    """

    observed: Observed
    branches: dict[tuple[int, int], int] = field(default_factory=dict)

    def machine(self, found: Sequence[Coordinate], z: Array, hypothesis: Hypothesis) -> ModifiedChain:
        """The machine of a hypothesis."""
        return machine_of(self.observed, found, z, hypothesis)

    def reading(self, observed: Observed) -> Self:
        """The same for other readings of the same test."""
        return type(self)(observed)

    def branched(self, ray: Ray, sign: int, reach: float) -> bool:
        """No half-ray has a bifurcation behind which readings could lie."""
        return False

    def behind_bifurcation(self, found: Sequence[Coordinate], z: Array, hypothesis: Hypothesis) -> np.ndarray:
        """No reading ``(n,)`` is."""
        return np.zeros(len(self.observed.pose), dtype=bool)
