"""The paper's bar of double stiffness in the place of a parallelogram, against the real one with four hinges."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.continuation.arc_length import ArcControl, trace
from vjm.continuation.path import EventKind
from vjm.io.manipulator_file import load_manipulator
from vjm.model.chain import Chain
from vjm.model.load_case import COMPONENTS, TO_LIMIT, Load, LoadCase
from vjm.model.parts import Beam
from vjm.platform.manipulator import Manipulator
from vjm.platform.problem import ManipulatorProblem
from vjm.rotations import Array, frame
from vjm.statics.stiffness import unloaded_stiffness
from vjm.vjm_engine import VjmEngine
from vjm_fea.exudyn.manipulator_engine import ManipulatorExudynEngine, platform_stiffness
from vjm_updating.maps.evaluate import stability_lost

SPRINGS = VjmEngine(8, 8)
DISTANCES = (20.0, 40.0, 80.0, 120.0, 200.0)
"""mm between the bars; the Orthoglide's is 80."""
FINE = VjmEngine(16, 16)
"""Of critical forces: with 4 springs a beam the real one's limit point at Q2 is 1.7 % off, with these 0.1 %."""
LARGEST = 14_000.0
"""N up to which the whole robot is pressed."""


@dataclass(frozen=True)
class Element:
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
class Robot:
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
class Study:
    """Both comparisons."""

    elements: tuple[Element, ...]
    robots: tuple[Robot, ...]


def study(elements: int = 8) -> Study:
    """Compare single bars and parallelograms, alone and in the whole Orthoglide.

    Args:
        elements: finite elements a bar.
    """
    machine = load_manipulator("parallelogram")
    alone = [element(machine, "straight", d) for d in DISTANCES]
    exudyn = ManipulatorExudynEngine(elements)
    for pose in machine.poses:
        found = element(machine, pose, 80.0)
        theirs = np.diag(platform_stiffness(exudyn, machine, pose, np.zeros(6)))
        alone.append(replace(found, exudyn=theirs))
    return Study(tuple(alone), tuple(robot(pose) for pose in load_manipulator("orthoglide").poses))


def element(machine: Manipulator, pose: str, distance: float) -> Element:
    """The parallelogram with its bars at a distance in mm, and the bar that stands for it."""
    spread = apart(machine, distance)
    problem = ManipulatorProblem(spread, LoadCase(pose, 1.0), SPRINGS)
    real = problem.unloaded().stiffness
    assert real is not None
    chain = doubled(machine.legs[0].chain)
    q = problem.model.pose.q[0]
    # the chain's own axes are those of the near axis
    single = unloaded_stiffness(SPRINGS_OF_BAR.model(chain), q)
    return Element(pose, distance, np.diag(single).copy(), np.diag(real).copy())


SPRINGS_OF_BAR = replace(SPRINGS, foot_segments=None)
"""A bar has no foot."""


def apart(machine: Manipulator, distance: float) -> Manipulator:
    """The parallelogram with its bars at another distance, mm."""
    legs = []
    for leg in machine.legs:
        side = np.sign(leg.root[1, 3])
        shift = frame(p=[0.0, 0.5 * side * distance, 0.0])
        legs.append(replace(leg, root=shift, attachment=shift))
    return replace(machine, legs=tuple(legs))


def doubled(chain: Chain) -> Chain:
    """The chain with bars of double stiffness."""
    parts = tuple(replace(part, count=2) if isinstance(part, Beam) else part for part in chain.parts)
    return replace(chain, parts=parts)


def robot(pose: str) -> Robot:
    """The whole Orthoglide with single bars and with parallelograms."""
    values, forces = [], []
    for name in ("orthoglide", "orthoglide-parallelograms"):
        machine = load_manipulator(name)
        K = ManipulatorProblem(machine, LoadCase(pose, 1.0), SPRINGS).unloaded().stiffness
        unit = np.repeat([1.0, machine.characteristic_length], 3)
        values.append(np.linalg.eigvalsh(np.asarray(K) / unit[:, None] / unit))
        forces.append(critical_force(machine, pose))
    return Robot(pose, values[0], values[1], forces[0], forces[1])


def critical_force(machine: Manipulator, pose: str) -> float | None:
    """N pressed against x at which the free platform loses its stability; None where it does not.

    Raises:
        NoConvergenceError: the path ends before.
    """
    load_case = LoadCase(
        pose, -LARGEST, "load", loads=(Load((1.0, 0, 0, 0, 0, 0)),), free=COMPONENTS, control=TO_LIMIT
    )
    problem = ManipulatorProblem(machine, load_case, FINE)
    return stability_lost(trace(problem, load_case, ArcControl(last=EventKind.BIFURCATION)))
