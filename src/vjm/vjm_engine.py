"""The virtual joint method as an engine: springs, equilibrium, stability and branches of a lumped chain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from vjm.arc_length import walk
from vjm.chain import FOOT, Chain
from vjm.imperfections import buckling_shape
from vjm.lumped import LumpedModel
from vjm.lumped_problem import LumpedProblem
from vjm.parts import Placement
from vjm.paths import Path
from vjm.programme import Programme


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

    def problem(self, chain: Chain, programme: Programme) -> LumpedProblem:
        """The chain with this engine's springs under a programme, ready to be followed."""
        if programme.imperfection == 0.0:
            return LumpedProblem(self.model(chain), programme, self.label)
        bow = programme.imperfection * buckling_shape(self, chain, programme)
        return LumpedProblem(self.model(chain), programme, self.label, bow)

    def walk(self, chain: Chain, programme: Programme, progress: Callable[[float], None] | None = None) -> Path:
        """Take the chain through the programme; see `vjm.following.follow` and `vjm.arc_length.follow_arc`."""
        path = walk(self.problem(chain, programme), programme, progress=progress)
        return replace(path, model=chain.name, model_sha256=chain.sha256)
