"""A frame that deflects under the chain that it carries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vjm.io.legs_document import from_base
from vjm.io.schema import Base
from vjm.model.joints import Joint
from vjm.model.machine import Machine
from vjm.rotations import inverse_frame
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.series_elements import AboutAxis, AlongAxis, Law, SeriesElement, memoryless

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
MOUNT = "base"
"""Beginning of the names of the springs that carry the chain."""


@dataclass(frozen=True)
class BaseCompliance(Effect):
    """Compliance along the three axes of the world, and about them through the base's origin.

    The rotational compliance k about x is given as ``k L²/c_xx`` with L the chain's longest straight piece: what
    the turn moves at the end of that lever, over what the shift does, under one force.
    """

    cause = "base_compliance"
    title = "the frame that carries the chain deflects"

    def quantities(self) -> tuple[Quantity, ...]:
        """Along x; along y and z, and by turning about x, over that along x; by turning about y and z over about x.

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
            Quantity("turning_y_over_x", 0.02, 50.0, 1.0, usual=1.0, spread=0.7, log=True),
            Quantity("turning_z_over_x", 0.02, 50.0, 1.0, usual=1.0, spread=0.7, log=True),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Alike in all directions, softer across, and turning more than it shifts."""
        alike = 1.0, 1.0
        return [(1e-5, *alike, 1.0, *alike), (1e-5, 3.0, 3.0, 1.0, *alike), (1e-6, *alike, 20.0, *alike)]

    def elements(self, machine: ModifiedChain, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """Three springs along the axes, and three about them where the base turns."""
        along, about = _compliances(machine.nominal, values)
        shifts = (SeriesElement(AlongAxis(AXES[a]), _spring(c)) for a, c in along.items())
        turns = (SeriesElement(AboutAxis(AXES[a]), _spring(c)) for a, c in about.items())
        return (*shifts, *turns)

    def mounts(self, nominal: Machine, values: Sequence[float]) -> list[Joint]:
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

    def built(self, chain: Machine, values: Sequence[float]) -> Machine:
        """A chain on these springs, with all that began on the base or was held to it."""
        mounts, back = self.mounts(chain, values), inverse_frame(chain.base)
        last = mounts[-1].name
        closures = (
            replace(c, parts=_on(last, c.parts),
                    frames=np.array([T if part else back @ T for part, T in zip(c.parts, c.frames, strict=True)]))
            for c in chain.closures
        )  # fmt: skip
        springs = (
            replace(s, parts=_on(last, s.parts),
                    points=np.array([p if part else back[:3, :3] @ p + back[:3, 3]
                                     for part, p in zip(s.parts, s.points, strict=True)]))
            for s in chain.point_springs
        )  # fmt: skip
        return replace(
            chain, parts=(*mounts, *chain.parts), after={name: own or last for name, own in chain.after.items()},
            closures=tuple(closures), point_springs=tuple(springs),
        )  # fmt: skip

    def write(self, document: dict[str, Any], nominal: Machine, values: Sequence[float]) -> None:
        """As springs before the chain, see `built`."""
        mounts = [
            {
                "kind": "mount",
                "name": mount.name,
                "axis": mount.axis.tolist(),
                "compliance_mm_per_N" if mount.slides else "compliance_rad_per_Nmm": mount.compliance,
            }
            for mount in self.mounts(nominal, values)
        ]
        last = mounts[-1]["name"]
        own = [part | {"after": last} if part.get("after") == "" else part for part in document["parts"]]
        document["parts"] = [*mounts, *own]
        base = Base.model_validate(document.get("base", {}))
        back = inverse_frame(nominal.base)
        for closure in document.get("closures", []):
            frames = closure.get("frames", [{}, {}])
            closure["frames"] = [
                one if part else from_base(one, base) for part, one in zip(closure["between"], frames, strict=True)
            ]
            closure["between"] = list(_on(last, closure["between"]))
        for spring in document.get("point_springs", []):
            spring["points_mm"] = [
                p if part else (back[:3, :3] @ p + back[:3, 3]).tolist()
                for part, p in zip(spring["between"], spring["points_mm"], strict=True)
            ]
            spring["between"] = list(_on(last, spring["between"]))


def _on(last: str, parts: Sequence[str]) -> tuple[str, str]:
    """Names of two parts, the last of the mounts in the base's place."""
    first, second = parts
    return first or last, second or last


def _compliances(nominal: Machine, values: Sequence[float]) -> tuple[dict[str, float], dict[str, float]]:
    """Along the axes in mm/N, and about them in rad/(N mm); none about them where the base does not turn."""
    c, y, z, turning, turning_y, turning_z = values
    along = {"x": c, "y": c * y, "z": c * z}
    k = c * turning / nominal.characteristic_length**2
    return along, {"x": k, "y": k * turning_y, "z": k * turning_z} if turning > 0.0 else {}


def _spring(c: float) -> Law:
    return memoryless(lambda N: (c * N, np.full_like(N, c)))


def effects(scene: Scene) -> list[Effect]:
    """Always."""
    return [BaseCompliance()]
