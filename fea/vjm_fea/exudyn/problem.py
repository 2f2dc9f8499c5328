"""A machine meshed with Exudyn under a load case, as a problem that can be followed."""

from __future__ import annotations

from vjm.continuation.path import Equilibrium
from vjm.errors import NoConvergenceError
from vjm.limits import refuse
from vjm.model.load_case import LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_fea.common.beam_problem import BeamProblem
from vjm_fea.common.end_condition import hand_joints
from vjm_fea.common.mesh import Mesh
from vjm_fea.common.points import wanted
from vjm_fea.exudyn.machine_system import ExudynMachineSystem
from vjm_fea.exudyn.statics import ExudynStatics

TOLERANCE = 1e-11
"""Scaled residual at which an equilibrium counts as found: a thousand times what rounding leaves of it."""


class ExudynProblem(BeamProblem):
    """The `BeamProblem` of Exudyn.

    Attributes:
        statics: the system's residual and tangent.
    """

    statics: ExudynStatics

    def __init__(self, chain: Machine, load_case: LoadCase, mesh: Mesh, label: str) -> None:
        """Mesh a machine in a posture.

        Raises:
            ValueError: a beam without a section, or without shear stiffness where the element needs one; a load on
                no point of the chain; a load case that the engine does not know.
        """
        refuse(label, chain, load_case)
        chain = chain.at(load_case.posture)
        self._assembled_with_errors = bool(chain.nominal_ends)
        system = ExudynMachineSystem(
            chain, chain.posture(load_case.posture), mesh, wanted(load_case), hand_joints(chain, load_case),
            chain.nominal_ends.get(load_case.posture),
        )  # fmt: skip
        control = load_case.control
        watched = system.find(control.part, control.at) if isinstance(control, PointControl) else None
        super().__init__(
            chain,
            load_case,
            ExudynStatics(system, chain.characteristic_length, load_case),
            tuple(s.label for s in system.stations),
            watched,
            label,
            TOLERANCE,
        )

    def unloaded(self) -> Equilibrium:
        """The posture as drawn, under constant loads and the machine's errors.

        Raises:
            NoConvergenceError: no stable equilibrium was found.
        """
        point = super().unloaded()
        if self._assembled_with_errors and point.unstable:
            raise NoConvergenceError("with its errors of assembly the machine is unstable")
        return point

    def beam_force(self, beam: str, point: Equilibrium) -> Array:
        """Section force ``(3,)`` in the first element of a beam, its own axes, N; tension positive.

        Raises:
            ValueError: there is no such beam.
        """
        nodes = [station.node for station in self.statics.system.stations if station.label.part == beam]
        if len(nodes) < 2:
            raise ValueError(f"no beam '{beam}' with elements")
        return self.statics.section_force(point.state, nodes[0], nodes[1])
