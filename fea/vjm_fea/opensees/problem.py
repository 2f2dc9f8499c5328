"""A chain of OpenSees' beams under a load case, as a problem that can be followed."""

from __future__ import annotations

from vjm.limits import refuse
from vjm.model.load_case import LoadCase, PointControl
from vjm.model.machine import Machine
from vjm_fea.common.beam_problem import BeamProblem
from vjm_fea.common.end_condition import hand_joints
from vjm_fea.common.points import fixed_points, wanted
from vjm_fea.opensees.beams import Beams, ElementKind
from vjm_fea.opensees.statics import OpenSeesStatics
from vjm_fea.opensees.system import MachineSystem

TOLERANCE = 1e-13
"""Scaled residual at which an equilibrium counts as found: some hundred times what rounding leaves of it."""


class OpenSeesProblem(BeamProblem):
    """The `BeamProblem` of OpenSees.

    Attributes:
        statics: residual and tangent.
    """

    statics: OpenSeesStatics

    def __init__(
        self, chain: Machine, load_case: LoadCase, elements: int, element: ElementKind, label: str
    ) -> None:
        """Mesh a chain in a posture.

        Raises:
            ImportError: OpenSeesPy, an optional extra, is not installed.
            ValueError: there is no beam, or one without a section; a load on no point of the chain; a load case
                that the engine does not know.
        """
        refuse(label, chain, load_case)
        chain = chain.at(load_case.posture)
        q, points = chain.posture(load_case.posture), wanted(load_case)
        for part, at in fixed_points(chain).items():
            points[part] = (*points.get(part, ()), *at)
        system = MachineSystem(chain, q, elements, points, hand_joints(chain, load_case))
        control = load_case.control
        watched = system.find(control.part, control.at) if isinstance(control, PointControl) else None
        length = chain.characteristic_length
        super().__init__(
            chain,
            load_case,
            OpenSeesStatics(system, Beams(system.lines, element), length, load_case),
            tuple(s.label for s in system.stations),
            watched,
            label,
            TOLERANCE,
        )
