"""The paper's bar of double stiffness in the place of a parallelogram, against the real one with four hinges."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.continuation.arc_length import ArcControl, trace
from vjm.continuation.path import EventKind, Path
from vjm.errors import NoConvergenceError
from vjm.io.machine_file import load_model
from vjm.io.manipulator_file import leg_chain, library_folder
from vjm.machine.closing import closed
from vjm.machine.legs import ATTACHMENT, ROOT
from vjm.model.load_case import COMPONENTS, TO_LIMIT, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Part, RigidOffset
from vjm.rotations import Array, frame, inverse_frame
from vjm.statics.stiffness import unloaded_stiffness
from vjm.vjm_engine import VjmEngine
from vjm_fea.common.platforms import platform_stiffness
from vjm_fea.exudyn.engine import ExudynEngine

SPRINGS = VjmEngine(8, 8)
DISTANCES = (20.0, 40.0, 80.0, 120.0, 200.0)
"""mm between the bars; the Orthoglide's is 80."""
FINE = VjmEngine(16, 16)
"""Of critical forces: with 4 springs a beam the real one's limit point at Q2 is 1.7 % off, with these 0.1 %."""
LARGEST = 14_000.0
"""N up to which the whole robot is pressed."""
NEARLY = 1e-4
"""Smallest eigenvalue over its unloaded value at which stability is as good as lost."""


@dataclass(frozen=True)
class ParallelogramStiffness:
    """A parallelogram's own stiffness at its far axis, the near one held.

    Attributes:
        pose: ``straight`` or ``turned``.
        distance: of its bars, mm.
        single: diagonal ``(6,)`` of the bar of double stiffness, N/mm and N mm/rad.
        real: of the two bars.
        exudyn: of the two bars by finite elements; None where not computed.
    """

    pose: str
    distance: float
    single: Array
    real: Array
    exudyn: Array | None = None


@dataclass(frozen=True)
class ParallelogramRobots:
    """The whole Orthoglide with either at one pose.

    Attributes:
        pose: its label.
        single: eigenvalues ``(6,)`` of its stiffness with single bars, turns over the bar's length, N/mm.
        real: with real parallelograms.
        critical_single: N pressed against x at which the free platform loses its stability; None where it does not.
        critical_real: likewise.
    """

    pose: str
    single: Array
    real: Array
    critical_single: float | None
    critical_real: float | None


@dataclass(frozen=True)
class ParallelogramComparison:
    """Both comparisons."""

    elements: tuple[ParallelogramStiffness, ...]
    robots: tuple[ParallelogramRobots, ...]


def study(elements: int = 8) -> ParallelogramComparison:
    """Compare single bars and parallelograms, alone and in the whole Orthoglide.

    Args:
        elements: finite elements a bar.
    """
    machine = load_model("parallelogram")
    alone = [element(machine, "straight", d) for d in DISTANCES]
    exudyn = ExudynEngine(elements=elements)
    for pose in machine.poses:
        found = element(machine, pose, 80.0)
        theirs = np.diag(platform_stiffness(exudyn, machine, pose, np.zeros(6)))
        alone.append(replace(found, exudyn=theirs))
    return ParallelogramComparison(tuple(alone), tuple(robot(pose) for pose in load_model("orthoglide").poses))


def element(machine: Machine, pose: str, distance: float) -> ParallelogramStiffness:
    """The parallelogram with its bars at a distance in mm, and the bar that stands for it."""
    spread = apart(machine, distance)
    real = SPRINGS.problem(spread, LoadCase(pose, 1.0)).unloaded().stiffness
    assert real is not None
    chain = doubled(leg_chain("orthoglide-bar", library_folder() / "chains"))
    # the first leg carries the platform: its joints come first
    q = spread.posture(pose)[: len(chain.joints)]
    # the chain's own axes are those of the near axis
    single = unloaded_stiffness(SPRINGS_OF_BAR.model(chain), q)
    return ParallelogramStiffness(pose, distance, np.diag(single).copy(), np.diag(real).copy())


SPRINGS_OF_BAR = replace(SPRINGS, foot_segments=None)
"""A bar has no foot."""


def apart(machine: Machine, distance: float) -> Machine:
    """The parallelogram with its bars at another distance, mm."""
    shifts = {
        part.name.partition("/")[0]: frame(p=[0.0, 0.5 * np.sign(part.transform[1, 3]) * distance, 0.0])
        for part in machine.parts
        if isinstance(part, RigidOffset) and part.name.endswith(f"/{ROOT}")
    }
    parts: list[Part] = []
    for part in machine.parts:
        leg, _, own = part.name.partition("/")
        if isinstance(part, RigidOffset) and own in (ROOT, ATTACHMENT):
            parts.append(replace(part, transform=shifts[leg] if own == ROOT else inverse_frame(shifts[leg])))
        else:
            parts.append(part)
    closures = tuple(replace(each, frames=np.array([np.eye(4), shifts[each.name]])) for each in machine.closures)
    return closed(replace(machine, parts=tuple(parts), closures=closures))


def doubled(chain: Machine) -> Machine:
    """The chain with bars of double stiffness."""
    parts = tuple(replace(part, count=2) if isinstance(part, Beam) else part for part in chain.parts)
    return replace(chain, parts=parts)


def robot(pose: str) -> ParallelogramRobots:
    """The whole Orthoglide with single bars and with parallelograms."""
    values, forces = [], []
    for name in ("orthoglide", "orthoglide-parallelograms"):
        machine = load_model(name)
        K = SPRINGS.problem(machine, LoadCase(pose, 1.0)).unloaded().stiffness
        unit = np.repeat([1.0, machine.characteristic_length], 3)
        values.append(np.linalg.eigvalsh(np.asarray(K) / unit[:, None] / unit))
        forces.append(critical_force(machine, pose))
    return ParallelogramRobots(pose, values[0], values[1], forces[0], forces[1])


def critical_force(machine: Machine, pose: str) -> float | None:
    """N pressed against x at which the free platform loses its stability; None where it does not.

    Raises:
        NoConvergenceError: the path ends before.
    """
    load_case = LoadCase(
        pose, -LARGEST, "load", loads=(Load((1.0, 0, 0, 0, 0, 0)),), free=COMPONENTS, control=TO_LIMIT
    )
    problem = FINE.problem(machine, load_case)
    return stability_lost(trace(problem, load_case, ArcControl(last=EventKind.BIFURCATION)))


def stability_lost(path: Path) -> float | None:
    """The force at which a path along the arc loses its stability, N; None where it keeps it to its end.

    The path of an over-constrained robot has no perfect bifurcation, but a knee so sharp that no step may follow
    it: there the path ends with its smallest eigenvalue all but zero, and that is the force.

    Raises:
        NoConvergenceError: it ends before, for another reason.
    """
    for event in path.events:
        if event.kind in (EventKind.BIFURCATION, EventKind.LIMIT):
            return event.force
    if path.complete:
        return None
    if abs(path.eigenvalue_relative[-1]) < NEARLY:
        return path.points[-1].ramp
    raise NoConvergenceError(path.stopped)
