"""The Exudyn engine: the beams of a chain as geometrically exact finite elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from vjm.arc_length import walk
from vjm.chain import Chain
from vjm.paths import Path
from vjm.programme import Programme
from vjm_fea.mesh import Mesh
from vjm_fea.problem import ExudynProblem


@dataclass(frozen=True)
class ExudynEngine:
    """Walks a chain with Exudyn's `ObjectBeamGeometricallyExact`.

    With ``foot_spring`` the part named "foot" is one `RigidBodySpringDamper` in its intrinsic form instead:
    its 6×6 stiffness acts on the SE(3) logarithm between its two sides, at their mid-pose. At finite rotation
    that is another law than (22), which translates before it rotates: the same matrix, the same linear
    answer, but displacements that differ by the square of the spring's turn. A comparison of displacements
    with a lumped model must say which law each side uses.

    Exudyn gives elements, joints, residual and Jacobian; Newton's method, stability and the change of branch
    are in `vjm_fea.beam_problem` and `vjm_fea.statics`. It walks every programme but those with an
    imperfection. Threads slow the small matrices down five times and more: run with ``OMP_NUM_THREADS=1``.

    Attributes:
        foot_spring: the foot as a spring with the inverse of its tip compliance.
        elements: per beam.
        shear: whether a section's shear stiffness counts.
        corrected: the residual-flexibility correction, see `Mesh`.
    """

    foot_spring: bool = False
    elements: int = 16
    shear: bool = False
    corrected: bool = True

    @property
    def label(self) -> str:
        """The name under which results are filed."""
        return "exudyn-footspring" if self.foot_spring else "exudyn"

    def problem(self, chain: Chain, programme: Programme) -> ExudynProblem:
        """The chain in the programme's posture, meshed and assembled.

        Raises:
            ValueError: a beam without a section, or without shear stiffness where the element needs one; a load on
                no point of the chain; an imperfection.
        """
        mesh = Mesh(self.elements, self.shear, self.corrected, self.foot_spring)
        return ExudynProblem(chain, programme, mesh, self.label)

    def walk(self, chain: Chain, programme: Programme, progress: Callable[[float], None] | None = None) -> Path:
        """Take the chain through the programme; see `vjm.following.follow` and `vjm.arc_length.follow_arc`."""
        path = walk(self.problem(chain, programme), programme, progress=progress)
        return replace(path, model=chain.name, model_sha256=chain.sha256)
