"""What is asked of a user's own machine, and what is found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.continuation.path import Path
from vjm.design.modes import Modes
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.model.parts import Beam, RigidOffset
from vjm_validation.documents import MapRowsDocument, SensitivityDocument, SharesRow
from vjm_validation.studies.force_directions import DIRECTIONS
from vjm_validation.studies.own_machine_rows import (
    ConvergenceRow,
    CriticalRow,
    EndStiffnessRow,
    FrequencyRow,
    LoadRow,
)

ENGINES = ("vjm", "exudyn")
REFERENCE = "exudyn"

Key = tuple[str, str, str]
"""Posture, direction, engine."""
Progress = Callable[[str, int, int], None]
"""Told what is done, how much of it, and of how much."""


@dataclass(frozen=True)
class Request:
    """What is asked for.

    Attributes:
        model: name or path.
        postures: labels; all where there are none.
        directions: such as ``x`` or ``-z``.
        force: N on the free end; None for one of a size that suits the machine.
        reach: mm of an imposed pose; likewise.
        gravity: m/s²; None for none.
        engines: by name; the first is the lumped model.
        jobs: processes.
    """

    model: str
    postures: tuple[str, ...] = ()
    directions: tuple[str, ...] = DIRECTIONS
    force: float | None = None
    reach: float | None = None
    gravity: Gravity | None = None
    engines: tuple[str, ...] = ENGINES
    jobs: int = 1


@dataclass
class OwnMachine:
    """What was found.

    Attributes:
        machine: what is solved: its end-effector is its first end frame.
        drawn: the machine as its file has it.
        held: whether poses are imposed, as passive joints let the end move freely; else it is free.
        size: N of the largest force, or mm of the imposed displacement.
        paths: by posture, direction and engine.
        criticals: paths to the first critical point under a growing load; those of ``paths`` where poses are held.
        stiffness: of the free ends.
        loads: one row a path.
        critical: one row a path of ``criticals``.
        convergence: with the number of springs.
        elements: the quantity of ``convergence`` by finite elements.
        shares: of the parts in the deflection, posture by posture.
        shares_along: the direction of the force that deflects, by posture.
        modes: the lowest natural frequencies, posture by posture.
        shapes: the motions of those by posture.
        sensitivity: of the stiffness to the numbers of the model file.
        stiffened: the load path whose stiffness that is.
        map: of the stiffness about a posture.
        map_axes: values of its axes by name, in the order of its rows.
        map_posture: label of that posture.
        notes: what was left out, and why.
    """

    machine: Machine
    drawn: Machine
    held: bool
    size: float
    paths: dict[Key, Path] = field(default_factory=dict)
    criticals: dict[Key, Path] = field(default_factory=dict)
    stiffness: list[EndStiffnessRow] = field(default_factory=list)
    loads: list[LoadRow] = field(default_factory=list)
    critical: list[CriticalRow] = field(default_factory=list)
    convergence: list[ConvergenceRow] = field(default_factory=list)
    elements: float | None = None
    shares: list[SharesRow] = field(default_factory=list)
    shares_along: dict[str, str] = field(default_factory=dict)
    modes: list[FrequencyRow] = field(default_factory=list)
    shapes: dict[str, Modes] = field(default_factory=dict)
    sensitivity: SensitivityDocument | None = None
    stiffened: LoadRow | None = None
    map: MapRowsDocument | None = None
    map_axes: dict[str, list[float]] = field(default_factory=dict)
    map_posture: str = ""
    notes: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Say once what is omitted."""
        if text not in self.notes:
            self.notes.append(text)


def solved(drawn: Machine) -> Machine:
    """The machine that is solved: its end-effector is its first end frame."""
    part = next(iter(drawn.ends.values()), drawn.parts[-1].name)
    if part == drawn.parts[-1].name:
        return drawn
    name = next(iter(drawn.ends))
    if name in [each.name for each in drawn.parts]:
        name = f"{name}-end"
    ends = {**drawn.ends, next(iter(drawn.ends)): name}
    return replace(
        drawn, parts=(*drawn.parts, RigidOffset(name, np.eye(4))), after={**drawn.after, name: part}, ends=ends
    )


def extent(machine: Machine) -> float:
    """Size of a machine in mm: what an arm can reach; where loops are closed, the longest part."""
    if machine.closes:
        return machine.characteristic_length
    before = machine.predecessors
    parts, name, length = {part.name: part for part in machine.parts}, machine.parts[-1].name, 0.0
    while name:
        part = parts[name]
        if isinstance(part, Beam):
            length += float(np.linalg.norm(part.tip))
        elif isinstance(part, RigidOffset):
            length += float(np.linalg.norm(part.transform[:3, 3]))
        name = before[name]
    return max(1.0, length)


def end_name(machine: Machine) -> str:
    """Name of the end frame at the end-effector; empty where the machine names none."""
    return next((name for name, part in machine.ends.items() if part == machine.parts[-1].name), "")
