"""Exudyn on whole manipulators: every leg's beams as finite elements, all in one system."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from vjm.continuation.arc_length import trace
from vjm.continuation.path import Equilibrium, Path
from vjm.errors import NoConvergenceError
from vjm.limits import refuse
from vjm.model.load_case import COMPONENTS, LoadCase
from vjm.model.parts import PassiveJoint
from vjm.platform.closure import RigidPose
from vjm.platform.loaded_manipulator import lumped
from vjm.platform.manipulator import Manipulator
from vjm.platform.problem import on_platform
from vjm.platform.rigid import inverse_kinematics
from vjm.platform.rigid_legs import refuse_rigid_legs
from vjm.rotations import AXES, Array
from vjm.threads import single_threaded
from vjm.vjm_engine import VjmEngine
from vjm_fea.common.beam_problem import BeamProblem
from vjm_fea.common.branches import TINY
from vjm_fea.common.mesh import Mesh
from vjm_fea.exudyn.manipulator_statics import ManipulatorStatics
from vjm_fea.exudyn.manipulator_system import ManipulatorSystem
from vjm_fea.exudyn.problem import TOLERANCE

HINGES_FIRST = ("ry", "rx", "rz", "x", "y", "z")


class ManipulatorExudynProblem(BeamProblem):
    """A manipulator in a pose, meshed, under a load case."""

    statics: ManipulatorStatics

    def __init__(
        self, manipulator: Manipulator, load_case: LoadCase, mesh: Mesh, label: str, pose: RigidPose | None = None
    ) -> None:
        """Mesh a manipulator.

        Raises:
            PoseError: the rigid machine cannot take the pose.
            RigidLegError: a leg does not deflect in all directions.
            ValueError: a beam without a section, or a load case that only chains know.
        """
        for leg in manipulator.legs:
            refuse(label, leg.chain, load_case)
        held, _, _ = on_platform(load_case)
        if pose is None:
            pose = inverse_kinematics(manipulator, manipulator.displacement(load_case.posture))
        pose = replace(pose, manipulator=manipulator)
        # by the rank of one spring a beam, which is that of its elements
        refuse_rigid_legs(pose, [lumped(VjmEngine(), leg.chain) for leg in manipulator.legs])
        # hinges first, in the order of `vjm.model.end_condition`
        free = [name for name in HINGES_FIRST if not held[COMPONENTS.index(name)]]
        end_condition = [PassiveJoint(f"support-{name}", AXES[name[-1]], slides=len(name) == 1) for name in free]
        system = ManipulatorSystem(pose, mesh, end_condition)
        statics = ManipulatorStatics(system, manipulator.characteristic_length, load_case)
        longest = max((leg.chain for leg in manipulator.legs), key=lambda chain: chain.characteristic_length)
        labels = tuple(station.label for station in system.stations)
        super().__init__(
            replace(longest, name=manipulator.name), load_case, statics, labels, None, label, TOLERANCE
        )
        self._built = any(manipulator.errors) or any(manipulator.offsets)

    def unloaded(self) -> Equilibrium:
        """The pose as drawn, under constant loads and the machine's errors.

        Raises:
            NoConvergenceError: no stable equilibrium was found.
        """
        point = super().unloaded()
        if self._built and point.unstable:
            raise NoConvergenceError("with its errors of assembly the machine is unstable")
        return point

    def beam_force(self, leg: str, beam: str, point: Equilibrium) -> Array:
        """Section force ``(3,)`` in the first element of a beam of a leg, its own axes, N; tension positive.

        Raises:
            ValueError: there is no such beam.
        """
        system = self.statics.system
        nodes = [s.node for s in system.stations if s.label.part == f"{leg}/{beam}"]
        if len(nodes) < 2:
            raise ValueError(f"leg '{leg}' has no beam '{beam}'")
        return self.statics.section_force(point.state, nodes[0], nodes[1])

    def giving_way(self, critical: Equilibrium) -> dict[str, float]:
        """Which legs deflect at a critical point: each one's share of the mode, their squares adding up to one.

        What counts is how far a leg's beams bow out of their chords.
        """
        mode = self.exact(critical.state).critical_modes()[0]
        ahead, behind = (
            self.statics.shape(self.statics.moved_freely(critical.state, t * mode)) for t in (TINY, -TINY)
        )
        bows: dict[str, float] = {}
        for part in dict.fromkeys(station.part for station in self.stations):
            rows = [i for i, station in enumerate(self.stations) if station.part == part]
            leg = part.partition("/")[0]
            fractions = np.array([self.stations[i].fraction for i in rows])
            bows[leg] = bows.get(leg, 0.0) + _bow(fractions, (ahead - behind)[rows])
        whole = sum(bows.values())
        return {leg: float(np.sqrt(bow / whole)) for leg, bow in bows.items()}


def _bow(fractions: Array, moved: Array) -> float:
    """Sum of the squares of what stations ``(k, 3)`` of a part move out of the chord between its ends."""
    first, last = np.argmin(fractions), np.argmax(fractions)
    if first == last:
        return 0.0
    along = (fractions - fractions[first]) / (fractions[last] - fractions[first])
    chord = moved[first] + np.outer(along, moved[last] - moved[first])
    return float(np.sum((moved - chord) ** 2))


@dataclass(frozen=True)
class ManipulatorExudynEngine:
    """Traces paths of a whole manipulator with Exudyn, see `vjm_fea.exudyn.engine.ExudynEngine`.

    Attributes:
        elements: per beam.
        shear: whether a section's shear stiffness counts.
    """

    elements: int = 16
    shear: bool = True

    @property
    def label(self) -> str:
        """The name under which results are filed."""
        return "exudyn"

    @single_threaded
    def problem(self, manipulator: Manipulator, load_case: LoadCase) -> ManipulatorExudynProblem:
        """The manipulator under a load case, meshed and assembled."""
        return ManipulatorExudynProblem(manipulator, load_case, Mesh(self.elements, self.shear), self.label)

    @single_threaded
    def trace(
        self, manipulator: Manipulator, load_case: LoadCase, progress: Callable[[float], None] | None = None
    ) -> Path:
        """Take the manipulator through the load case; see `vjm.continuation.arc_length.trace`."""
        path = trace(self.problem(manipulator, load_case), load_case, progress=progress)
        return replace(path, model=manipulator.name, model_sha256=manipulator.sha256)


def platform_stiffness(engine: ManipulatorExudynEngine, manipulator: Manipulator, pose: str, d: Array) -> Array:
    """Stiffness ``(6, 6)`` of a platform held at a displacement ``d`` (6,) from a pose, by finite elements.

    Raises:
        NoConvergenceError: the displacement is not reached, or not on a stable path.
    """
    if not np.any(d):
        point = engine.problem(manipulator, LoadCase(pose, 1.0)).unloaded()
    else:
        path = engine.trace(manipulator, LoadCase(pose, 1.0, axis=tuple(d), steps=4))
        if not path.complete:
            raise NoConvergenceError(path.stopped)
        point = path.points[-1]
    assert point.stiffness is not None
    return point.stiffness
