"""A chain of OpenSees' beams under a programme, as a problem that can be followed."""

from __future__ import annotations

from vjm.chain import Chain
from vjm.programme import PointControl, Programme
from vjm_fea.beam_problem import BeamProblem, refuse_imperfection
from vjm_fea.hand import hand_joints
from vjm_fea.opensees.beams import Beams, Element
from vjm_fea.opensees.statics import Statics
from vjm_fea.opensees.system import ChainSystem
from vjm_fea.points import wanted

TOLERANCE = 1e-13
"""Scaled residual at which an equilibrium counts as found: some hundred times what rounding leaves of it."""


class OpenSeesProblem(BeamProblem):
    """The `BeamProblem` of OpenSees.

    Attributes:
        statics: residual and tangent.
    """

    statics: Statics

    def __init__(self, chain: Chain, programme: Programme, elements: int, element: Element, label: str) -> None:
        """Mesh a chain in a posture.

        Raises:
            ImportError: OpenSeesPy, an optional extra, is not installed.
            ValueError: there is no beam, or one without a section; a load on no point of the chain; a programme
                that the engine cannot walk.
        """
        refuse_imperfection(label, programme)
        q, points = chain.posture(programme.posture), wanted(programme)
        system = ChainSystem(chain, q, elements, points, hand_joints(chain, programme))
        control = programme.control
        watched = system.find(control.part, control.at) if isinstance(control, PointControl) else None
        length = chain.characteristic_length
        super().__init__(
            chain,
            programme,
            Statics(system, Beams(system.lines, element), length, programme),
            tuple(s.label for s in system.stations),
            watched,
            label,
            TOLERANCE,
        )
