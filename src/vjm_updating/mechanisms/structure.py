"""Causes in the structure: parts that are softer, longer or bowed, and a frame that deflects under the chain.

Also one spring for a link or the foot where it bends all along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vjm.io.manipulator_file import from_base
from vjm.io.schema import Base
from vjm.model.machine import FOOT, Machine
from vjm.model.parts import Joint
from vjm.rotations import inverse_frame
from vjm_updating.constants import numerical, physical_bound
from vjm_updating.mechanisms.effect import Effect, ExperimentContext, Quantity
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, beam_of, foot_of, links_of, place_of
from vjm_updating.mechanisms.series_elements import AboutAxis, AlongAxis, Law, SeriesElement, memoryless

FACTOR = Quantity("factor", 0.2, 5.0, 0.02, neutral=1.0)
"""Compliance over its nominal value."""


@dataclass(frozen=True)
class PartCompliance(Effect):
    """One factor on all compliances of the part ``beam``; ``part`` is its name where there are several links."""

    beam: str = ""
    part: str = ""
    cause = "part_compliance"

    def quantities(self) -> tuple[Quantity, ...]:
        """The factor."""
        return (FACTOR,)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Softer; stiffer is the same but for the sign."""
        return [(1.05,)]

    def machine(self, machine: ModifiedMachine, values: Sequence[float]) -> ModifiedMachine:
        """The part times the factor."""
        return machine.times(self.beam, values[0])


@dataclass(frozen=True)
class FootCompliance(PartCompliance):
    """The foot is softer or stiffer than its matrix says."""

    beam: str = FOOT
    cause = "foot_compliance"
    title = "the foot is softer or stiffer than its matrix says"


@dataclass(frozen=True)
class LinkCompliance(PartCompliance):
    """The bar is softer or stiffer than its matrix says."""

    cause = "link_compliance"
    title = "the bar is softer or stiffer than its matrix says"


def part_compliance_effects(scene: ExperimentContext) -> list[Effect]:
    """One for each beam that the chain has."""
    feet: list[Effect] = [FootCompliance()] if foot_of(scene.chain) else []
    return [*feet, *(LinkCompliance(name, place_of(scene.chain, name)) for name in links_of(scene.chain))]


@dataclass(frozen=True)
class LinkLength(Effect):
    """The bar's length is off; the unloaded pose moves with it."""

    beam: str = "link"
    part: str = ""
    cause = "link_length"
    exact = True
    title = "the bar is longer or shorter than drawn"

    def quantities(self) -> tuple[Quantity, ...]:
        """By how much."""
        return (Quantity("delta_mm", -60.0, 60.0, 0.2, neutral=0.0),)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Longer."""
        return [(1.0,)]

    def machine(self, machine: ModifiedMachine, values: Sequence[float]) -> ModifiedMachine:
        """The longer bar."""
        return machine.longer(self.beam, values[0])


def link_length_effects(scene: ExperimentContext) -> list[Effect]:
    """One a link."""
    return [LinkLength(name, place_of(scene.chain, name)) for name in links_of(scene.chain)]


CROOKED = physical_bound(30.0)
"""Lengths over mid-span amplitudes below which a link is not one that should be straight."""


@dataclass(frozen=True)
class LinkBow(Effect):
    """A bow along the section's y and z axes.

    Attributes:
        sizes: amplitudes to begin a search with, mm.
        length: of the beam, mm.
    """

    sizes: tuple[float, ...] = (0.5, 2.0)
    length: float = 310.0
    beam: str = "link"
    part: str = ""
    cause = "link_bow"
    extent = 2
    title = "the bar is not straight when unloaded"

    def quantities(self) -> tuple[Quantity, ...]:
        """Mid-span amplitudes along both axes of the section."""
        most = self.length / CROOKED
        return tuple(Quantity(f"along_{axis}_mm", -most, most, 0.5, neutral=0.0) for axis in "yz")

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Both senses in both planes."""
        return [(sign * a, 0.02 * a) for a in self.sizes for sign in (1.0, -1.0)] + [
            (0.02 * a, sign * a) for a in self.sizes[1:] for sign in (1.0, -1.0)
        ]

    def machine(self, machine: ModifiedMachine, values: Sequence[float]) -> ModifiedMachine:
        """Built with the bow."""
        return machine.with_bow(self.beam, values[0], values[1])

    def reported(self, values: Sequence[float]) -> dict[str, float]:
        """Amplitude, and direction about the link's axis from the section's y axis."""
        y, z = values
        return {"link_bow.amplitude_mm": float(np.hypot(y, z)), "link_bow.direction_rad": float(np.arctan2(z, y))}


def link_bow_effects(scene: ExperimentContext) -> list[Effect]:
    """One a link whose section is known: one spring alone has no shape.

    A model file has no bow of a beam that comes out of its root or carries a joint.
    """
    if (scene.engine.segments or 1) == 1:
        return []
    links = [beam_of(scene.chain, name) for name in links_of(scene.chain) if name not in scene.chain.riders]
    return [
        LinkBow(length=link.length, beam=link.name, part=place_of(scene.chain, link.name))
        for link in links
        if link.section is not None and link.length > 0.0 and not link.free_length
    ]


LINK_SEGMENTS = numerical(12)
"""Springs that converge: their error is far below any reading's."""


@dataclass(frozen=True)
class LinkLumping(Effect):
    """Every link distributed over segments."""

    cause = "link_lumping"
    title = "one spring per link, where the link deflects all along it"

    def machine(self, machine: ModifiedMachine, values: Sequence[float]) -> ModifiedMachine:
        """More springs."""
        return replace(machine, engine=replace(machine.engine, segments=LINK_SEGMENTS))


def link_lumping_effects(scene: ExperimentContext) -> list[Effect]:
    """Where the model has one spring a link and the links' sections are known."""
    known = all(beam_of(scene.chain, name).section is not None for name in links_of(scene.chain))
    return [LinkLumping()] if (scene.engine.segments or 1) == 1 and known else []


FOOT_SEGMENTS = numerical(8)
"""Springs that converge."""


@dataclass(frozen=True)
class FootLumping(Effect):
    """The foot distributed over segments."""

    cause = "foot_lumping"
    title = "one spring for the foot, where it deflects all along it"

    def machine(self, machine: ModifiedMachine, values: Sequence[float]) -> ModifiedMachine:
        """More springs."""
        return replace(machine, engine=replace(machine.engine, foot_segments=FOOT_SEGMENTS))


def foot_lumping_effects(scene: ExperimentContext) -> list[Effect]:
    """Where the model has a foot of one spring and its section is known."""
    feet = [beam for beam in scene.chain.beams if beam.name == FOOT and beam.section is not None]
    return [FootLumping()] if feet and (scene.engine.foot_segments or 1) == 1 else []


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

    def elements(self, machine: ModifiedMachine, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """Three springs along the axes, and three about them where the base turns."""
        along, about = _compliances(machine.nominal, values)
        # a bracket of one spring would be void as soon as the others move
        shifts = (SeriesElement(AlongAxis(AXES[a]), _spring(c), smooth=True) for a, c in along.items())
        turns = (SeriesElement(AboutAxis(AXES[a]), _spring(c), smooth=True) for a, c in about.items())
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


def base_compliance_effects(scene: ExperimentContext) -> list[Effect]:
    """Always."""
    return [BaseCompliance()]
