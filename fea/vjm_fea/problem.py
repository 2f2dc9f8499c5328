"""A chain meshed with Exudyn under a programme, as a problem that can be followed."""

from __future__ import annotations

from vjm.chain import Chain
from vjm.programme import PointControl, Programme
from vjm_fea.beam_problem import BeamProblem, refuse_imperfection
from vjm_fea.hand import hand_joints
from vjm_fea.mesh import Mesh
from vjm_fea.points import wanted
from vjm_fea.statics import Statics
from vjm_fea.system import ExudynSystem

TOLERANCE = 1e-11
"""Scaled residual at which an equilibrium counts as found: a thousand times what rounding leaves of it."""


class ExudynProblem(BeamProblem):
    """The `BeamProblem` of Exudyn.

    Attributes:
        statics: the system's residual and tangent.
    """

    statics: Statics

    def __init__(self, chain: Chain, programme: Programme, mesh: Mesh, label: str) -> None:
        """Mesh a chain in a posture.

        Raises:
            ValueError: a beam without a section, or without shear stiffness where the element needs one; a load on
                no point of the chain; a programme that the engine cannot walk.
        """
        refuse_imperfection(label, programme)
        system = ExudynSystem(
            chain, chain.posture(programme.posture), mesh, wanted(programme), hand_joints(chain, programme)
        )
        control = programme.control
        watched = system.find(control.part, control.at) if isinstance(control, PointControl) else None
        super().__init__(
            chain,
            programme,
            Statics(system, chain.characteristic_length, programme),
            tuple(s.label for s in system.stations),
            watched,
            label,
            TOLERANCE,
        )
