"""The Exudyn engine: the beams of a chain as geometrically exact finite elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from vjm.continuation.arc_length import trace
from vjm.continuation.path import Path
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.threads import single_threaded
from vjm_fea.common.mesh import Mesh
from vjm_fea.exudyn.problem import ExudynProblem


@dataclass(frozen=True)
class ExudynEngine:
    """Traces paths of a chain with Exudyn's `ObjectBeamGeometricallyExact`.

    With ``foot_spring`` the part named "foot" is one `RigidBodySpringDamper` in its intrinsic form instead:
    its 6×6 stiffness acts on the SE(3) logarithm between its two sides, at their mid-pose. At finite rotation
    that is another law than (22), which translates before it rotates: the same matrix, the same linear
    answer, but displacements that differ by the square of the spring's turn. A comparison of displacements
    with a lumped model must say which law each side uses.

    Exudyn gives elements, joints, residual and Jacobian; Newton's method, stability and the change of branch
    are in `vjm_fea.common.beam_problem` and `vjm_fea.exudyn.problem`. It traces every load case but those with an
    imperfection.

    Attributes:
        foot_spring: the foot as a spring with the inverse of its tip compliance.
        elements: per beam.
        shear: whether a section's shear stiffness counts.
        corrected: the residual-flexibility correction, see `Mesh`.
    """

    foot_spring: bool = False
    elements: int = 16
    shear: bool = True
    corrected: bool = True

    @property
    def label(self) -> str:
        """The name under which results are filed."""
        return "exudyn-footspring" if self.foot_spring else "exudyn"

    @single_threaded
    def problem(self, chain: Machine, load_case: LoadCase) -> ExudynProblem:
        """The chain in the load case's posture, meshed and assembled.

        Raises:
            ValueError: a beam without a section, or without shear stiffness where the element needs one; a load on
                no point of the chain; an imperfection.
        """
        mesh = Mesh(self.elements, self.shear, self.corrected, self.foot_spring)
        return ExudynProblem(chain, load_case, mesh, self.label)

    @single_threaded
    def trace(self, chain: Machine, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Trace the equilibrium path; see `vjm.continuation.load_stepping` and `vjm.continuation.arc_length`."""
        path = trace(self.problem(chain, load_case), load_case, progress=progress)
        return replace(path, model=chain.name, model_sha256=chain.sha256)
