"""The OpenSees engine: the beams of a chain as corotational finite elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from vjm.arc_length import walk
from vjm.chain import Chain
from vjm.paths import Path
from vjm.programme import Programme
from vjm_fea.opensees.beams import Element
from vjm_fea.opensees.problem import OpenSeesProblem


@dataclass(frozen=True)
class OpenSeesEngine:
    """Walks a chain with OpenSees' shear-rigid beams in corotational frames.

    OpenSees gives the elements' forces and tangents. Rigid pieces and joints, Newton's method, stability and the
    change of branch are here: OpenSees' own constraints are linear in the turns, and so wrong at finite rotation. A
    section's shear stiffness does not count.

    Attributes:
        elements: per beam.
        element: which.
    """

    elements: int = 16
    element: Element = Element.BOWED

    @property
    def label(self) -> str:
        """The name under which results are filed."""
        return "opensees"

    def problem(self, chain: Chain, programme: Programme) -> OpenSeesProblem:
        """The chain in the programme's posture, meshed.

        Raises:
            ImportError: OpenSeesPy, an optional extra, is not installed.
            ValueError: a beam without a section, a load on no point of the chain, or an imperfection.
        """
        return OpenSeesProblem(chain, programme, self.elements, self.element, self.label)

    def walk(self, chain: Chain, programme: Programme, progress: Callable[[float], None] | None = None) -> Path:
        """Take the chain through the programme; see `vjm.following.follow` and `vjm.arc_length.follow_arc`."""
        path = walk(self.problem(chain, programme), programme, progress=progress)
        return replace(path, model=chain.name, model_sha256=chain.sha256)
