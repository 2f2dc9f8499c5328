"""The OpenSees engine: the beams of a chain as corotational finite elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

from vjm.continuation.arc_length import trace
from vjm.continuation.path import Path
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.threads import single_threaded
from vjm_fea.opensees.beams import ElementKind
from vjm_fea.opensees.problem import OpenSeesProblem


@dataclass(frozen=True)
class OpenSeesEngine:
    """Traces the paths of a chain with OpenSees' shear-rigid beams in corotational frames.

    OpenSees gives the elements' forces and tangents. Rigid pieces and joints, Newton's method, stability and the
    change of branch are here: OpenSees' own constraints are linear in the turns, and so wrong at finite rotation. A
    section's shear stiffness does not count.

    Attributes:
        elements: per beam.
        element: which.
        takes_shear: its beams are rigid in shear.
    """

    elements: int = 16
    element: ElementKind = ElementKind.BOWED
    takes_shear: ClassVar[bool] = False

    @property
    def label(self) -> str:
        """The name under which results are filed."""
        return "opensees"

    @single_threaded
    def problem(self, chain: Machine, load_case: LoadCase) -> OpenSeesProblem:
        """The chain in the load case's posture, meshed.

        Raises:
            ImportError: OpenSeesPy, an optional extra, is not installed.
            ValueError: a beam without a section, a load on no point of the chain, or an imperfection.
        """
        return OpenSeesProblem(chain, load_case, self.elements, self.element, self.label)

    @single_threaded
    def trace(self, chain: Machine, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Trace the equilibrium path; see `vjm.continuation.load_stepping` and `vjm.continuation.arc_length`."""
        path = trace(self.problem(chain, load_case), load_case, progress=progress)
        return replace(path, model=chain.name, model_sha256=chain.sha256)
