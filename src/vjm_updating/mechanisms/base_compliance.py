"""A frame that deflects under the chain that it carries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vjm.model.chain import Chain
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.series_elements import AlongAxis, Element, Law, memoryless

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
MOUNT = "base"
"""Beginning of the names of the springs that carry the chain."""


@dataclass(frozen=True)
class BaseCompliance(Effect):
    """Translational compliance along the three axes of the world."""

    cause = "base_compliance"
    title = "the frame that carries the chain deflects"

    def quantities(self) -> tuple[Quantity, ...]:
        """Along x, and along y and z over that along x."""
        return (
            Quantity("cxx_mm_per_N", 0.0, 1e-2, 1e-5, neutral=0.0),
            Quantity("cyy_over_cxx", 0.02, 50.0, 1.0, usual=1.0, spread=0.7, log=True),
            Quantity("czz_over_cxx", 0.02, 50.0, 1.0, usual=1.0, spread=0.7, log=True),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Alike in all directions, and softer across."""
        return [(1e-5, 1.0, 1.0), (1e-5, 3.0, 3.0)]

    def elements(self, machine: ModifiedChain, values: Sequence[float]) -> tuple[Element, ...]:
        """Three springs."""
        c, y, z = values
        return tuple(
            Element(AlongAxis(axis), _spring(c * share)) for axis, share in zip(AXES, (1.0, y, z), strict=True)
        )

    def write(self, document: dict[str, Any], nominal: Chain, values: Sequence[float]) -> None:
        """As springs before the chain, along the world's axes wherever the base is turned."""
        c, y, z = values
        names = {part.name for part in nominal.parts}
        mounts = [
            {
                "kind": "mount",
                "name": next(n for k in range(99) if (n := f"{MOUNT}-{letter}" + "-" * k) not in names),
                "axis": (nominal.base[:3, :3].T @ np.array(axis)).tolist(),
                "compliance_mm_per_N": float(c * share),
            }
            for letter, axis, share in zip("xyz", AXES, (1.0, y, z), strict=True)
        ]
        document["parts"] = [*mounts, *document["parts"]]


def _spring(c: float) -> Law:
    return memoryless(lambda N: (c * N, np.full_like(N, c)))


def effects(scene: Scene) -> list[Effect]:
    """Always."""
    return [BaseCompliance()]
