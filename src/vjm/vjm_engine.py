"""The virtual joint method as an engine: springs, equilibrium, stability and branches of a lumped chain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from vjm.continuation.arc_length import trace
from vjm.continuation.imperfections import buckling_shape
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Path
from vjm.model.chain import FOOT, Chain
from vjm.model.load_case import LoadCase
from vjm.model.lumped import LumpedModel
from vjm.model.parts import Placement


@dataclass(frozen=True)
class VjmEngine:
    """The virtual joint method with any number of springs.

    Attributes:
        segments: springs in every beam but the foot; None: one spring with the printed 6×6 compliance at the
            far end of each link, the paper's model.
        foot_segments: springs in the foot; None or 1: its 6×6 compliance at its tip, by (22).
        placement: where a spring sits in its segment.
    """

    segments: int | None = None
    foot_segments: int | None = None
    placement: Placement = Placement.BEST

    @classmethod
    def of(cls, link: int, foot: int = 1, placement: Placement = Placement.BEST) -> VjmEngine:
        """With the springs that files ask for: 1 in the link is the paper's one spring at its far end."""
        return cls(link if link > 1 else None, foot if foot > 1 else None, placement)

    @property
    def label(self) -> str:
        """``vjm-paper``, ``vjm-16`` or ``vjm-16f16``, with the placement where it is not the best."""
        if self.segments is None:
            return "vjm-paper"
        foot = f"f{self.foot_segments}" if self.foot_segments and self.foot_segments > 1 else ""
        place = "" if self.placement is Placement.BEST else f"-{self.placement}"
        return f"vjm-{self.segments}{foot}{place}"

    def model(self, chain: Chain) -> LumpedModel:
        """The chain with this engine's springs.

        Raises:
            ValueError: a beam that is to be split has no section.
        """
        if self.segments is not None:
            chain = chain.refined(self.segments, self.placement)
        if self.foot_segments is not None and self.foot_segments > 1:
            chain = chain.refined({FOOT: self.foot_segments}, self.placement)
        return LumpedModel(chain)

    def problem(self, chain: Chain, load_case: LoadCase) -> LumpedProblem:
        """The chain with this engine's springs under a load case, ready to be followed."""
        if load_case.imperfection == 0.0:
            return LumpedProblem(self.model(chain), load_case, self.label)
        bow = load_case.imperfection * buckling_shape(self, chain, load_case)
        return LumpedProblem(self.model(chain), load_case, self.label, bow)

    def trace(self, chain: Chain, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Trace the equilibrium path; see `vjm.continuation.load_stepping` and `vjm.continuation.arc_length`."""
        path = trace(self.problem(chain, load_case), load_case, progress=progress)
        return replace(path, model=chain.name, model_sha256=chain.sha256)
