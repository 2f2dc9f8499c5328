"""A serial chain of parts from base to tool, the paper's (1) and (21)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.model.parts import Actuator, Beam, Part, PassiveJoint, Placement
from vjm.rotations import Array

FOOT = "foot"
"""Name of the beam that ``foot_segments`` splits; ``segments`` splits every other beam."""


@dataclass(frozen=True)
class Chain:
    """Parts in series between a fixed base and the end-effector.

    Attributes:
        name: of the model.
        parts: from base to tool.
        base: frame ``(4, 4)`` of the first part's root in the world, mm.
        postures: passive joint coordinates ``(n_q,)`` in rad by posture label.
        title: one line for people.
        source: where the numbers come from.
        sha256: of the model file, empty where there was none.
        link_segments: springs in every beam but the foot that its model file asks for; 1: the paper's one spring
            at the far end. None where it leaves that to the engine.
        foot_segments: likewise in the foot.
    """

    name: str
    parts: tuple[Part, ...]
    base: Array = field(default_factory=lambda: np.eye(4))
    postures: Mapping[str, Array] = field(default_factory=dict)
    title: str = ""
    source: str = ""
    sha256: str = ""
    link_segments: int | None = None
    foot_segments: int | None = None

    def __post_init__(self) -> None:
        names = [part.name for part in self.parts]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{self.name}: part names must differ, but {', '.join(twice)} stands twice")

    @property
    def beams(self) -> tuple[Beam, ...]:
        """The elastic parts, from base to tool."""
        return tuple(part for part in self.parts if isinstance(part, Beam))

    @property
    def joints(self) -> tuple[PassiveJoint, ...]:
        """The passive joints, from base to tool."""
        return tuple(part for part in self.parts if isinstance(part, PassiveJoint))

    @property
    def characteristic_length(self) -> float:
        """The longest elastic part's length in mm: the unit in which solvers measure lengths."""
        return max((beam.length for beam in self.beams), default=1.0)

    def posture(self, label: str) -> Array:
        """Passive joint coordinates ``(n_q,)`` in rad.

        Raises:
            KeyError: no such posture, with the ones that there are.
        """
        if label not in self.postures:
            raise KeyError(f"{self.name}: no posture '{label}'; it has {', '.join(self.postures) or 'none'}")
        return self.postures[label]

    def refined(self, segments: Mapping[str, int] | int, placement: Placement | str = Placement.BEST) -> Chain:
        """The same machine with its beams split into virtual springs.

        Args:
            segments: number of segments by beam name; one number for every beam but the foot. A beam that is
                not named stays as it is.
            placement: where the spring sits in its segment.

        Raises:
            ValueError: no such beam, fewer than one segment, or a beam known by its compliance only.
        """
        if isinstance(segments, int):
            segments = {beam.name: segments for beam in self.beams if beam.name != FOOT}
        names = {beam.name for beam in self.beams}
        for name, n in segments.items():
            if name not in names:
                raise ValueError(f"{self.name}: no beam '{name}' to split; it has {', '.join(sorted(names))}")
            if n < 1:
                raise ValueError(f"{self.name}: beam '{name}' needs at least one segment, got {n}")

        def split(part: Part) -> Part:
            if not isinstance(part, Beam) or part.name not in segments:
                return part
            part.effective_section()
            return replace(part, segments=segments[part.name], placement=Placement(placement))

        return replace(self, parts=tuple(split(part) for part in self.parts))

    def with_actuator_compliance(self, compliance: float) -> Chain:
        """The same machine with every drive giving way by ``compliance`` mm/N."""
        return replace(
            self,
            parts=tuple(
                replace(part, compliance=compliance) if isinstance(part, Actuator) else part for part in self.parts
            ),
        )
