"""A frame that deflects under the chain that it carries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vjm.model.chain import Chain
from vjm.model.joints import Joint
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.series_elements import AboutAxis, AlongAxis, Law, SeriesElement, memoryless

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
MOUNT = "base"
"""Beginning of the names of the springs that carry the chain."""


@dataclass(frozen=True)
class BaseCompliance(Effect):
    """Compliance along the three axes of the world, and about them through the base's origin.

    The rotational compliance k is the same about all axes. It is given as ``k L²/c_xx`` with L the chain's longest
    straight piece: what the turn moves at the end of that lever, over what the shift does, under one force.
    """

    cause = "base_compliance"
    title = "the frame that carries the chain deflects"

    def quantities(self) -> tuple[Quantity, ...]:
        """Along x; along y and z, and by turning, over that along x.

        A rigid round footing of radius a on an elastic half-space, with ν = 0.3, has ``c = 1.7/(8 G a)`` and
        ``k = 2.1/(8 G a³)``, so that ``k L²/c`` is about ``(L/a)²``. A column of length h, clamped below, has
        ``3 (L/h)²``. Frames about as large as the chain have about one; half or twice as large a frame is within a
        spread, as is a frame whose feet differ from the rest.
        """
        return (
            Quantity("cxx_mm_per_N", 0.0, 1e-2, 1e-5, neutral=0.0),
            Quantity("cyy_over_cxx", 0.02, 50.0, 1.0, usual=1.0, spread=0.7, log=True),
            Quantity("czz_over_cxx", 0.02, 50.0, 1.0, usual=1.0, spread=0.7, log=True),
            Quantity("turning_over_cxx", 1e-3, 1e3, 1.0, usual=1.0, spread=1.5, log=True),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Alike in all directions, softer across, and turning more than it shifts."""
        return [(1e-5, 1.0, 1.0, 1.0), (1e-5, 3.0, 3.0, 1.0), (1e-6, 1.0, 1.0, 20.0)]

    def elements(self, machine: ModifiedChain, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """Three springs along the axes, and three about them where the base turns."""
        along, about = _compliances(machine.nominal, values)
        shifts = (SeriesElement(AlongAxis(AXES[a]), _spring(c)) for a, c in along.items())
        turns = (SeriesElement(AboutAxis(AXES[a]), _spring(c)) for a, c in about.items())
        return (*shifts, *turns)

    def mounts(self, nominal: Chain, values: Sequence[float]) -> list[Joint]:
        """The same as parts before a chain, along the world's axes wherever its base is turned."""
        names = {part.name for part in nominal.parts}
        along, about = _compliances(nominal, values)
        springs = [(a, f"{MOUNT}-{a}", c, True) for a, c in along.items()]
        springs += [(a, f"{MOUNT}-turn-{a}", c, False) for a, c in about.items()]
        return [
            Joint(
                next(n for k in range(99) if (n := name + "-" * k) not in names),
                nominal.base[:3, :3].T @ np.array(AXES[a]),
                slides,
                passive=True,
                fixed=True,
                compliance=float(c),
            )
            for a, name, c, slides in springs
        ]

    def write(self, document: dict[str, Any], nominal: Chain, values: Sequence[float]) -> None:
        """As springs before the chain."""
        mounts = [
            {
                "kind": "mount",
                "name": mount.name,
                "axis": mount.axis.tolist(),
                "compliance_mm_per_N" if mount.slides else "compliance_rad_per_Nmm": mount.compliance,
            }
            for mount in self.mounts(nominal, values)
        ]
        document["parts"] = [*mounts, *document["parts"]]


def _compliances(nominal: Chain, values: Sequence[float]) -> tuple[dict[str, float], dict[str, float]]:
    """Along the axes in mm/N, and about them in rad/(N mm); none about them where the base does not turn."""
    c, y, z, turning = values
    along = {"x": c, "y": c * y, "z": c * z}
    about = c * turning / nominal.characteristic_length**2
    return along, dict.fromkeys(AXES, about) if turning > 0.0 else {}


def _spring(c: float) -> Law:
    return memoryless(lambda N: (c * N, np.full_like(N, c)))


def effects(scene: Scene) -> list[Effect]:
    """Always."""
    return [BaseCompliance()]
