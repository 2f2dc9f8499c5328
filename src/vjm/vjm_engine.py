"""The virtual joint method as an engine: springs, equilibrium, stability and branches of a lumped chain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from vjm.continuation.arc_length import trace
from vjm.continuation.imperfections import buckling_shape
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Path
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Placement
from vjm.threads import single_threaded


@dataclass(frozen=True)
class VjmEngine:
    """The virtual joint method with any number of springs.

    Attributes:
        segments: springs in every beam that has no number of its own; None: one spring with the printed 6×6
            compliance at the far end of each link, the paper's model.
        foot_segments: springs in the part named "foot", as ``parts`` says it of any; None: its own number.
        placement: where a spring sits in its segment.
        parts: springs by the name of the beam, before all else; 1: its compliance at its tip, by (22). The name of
            a part of a leg's chain is that of every leg's.

    Example:
        >>> import vjm
        >>> vjm.VjmEngine(8).label
        'vjm-8'
    """

    segments: int | None = None
    foot_segments: int | None = None
    placement: Placement = Placement.BEST
    parts: tuple[tuple[str, int], ...] = ()

    @classmethod
    def of(cls, link: int, foot: int = 1, placement: Placement = Placement.BEST) -> VjmEngine:
        """With the springs that files ask for: 1 in the link is the paper's one spring at its far end."""
        return cls(link if link > 1 else None, foot if foot > 1 else None, placement)

    @property
    def label(self) -> str:
        """``vjm-paper``, ``vjm-16`` or ``vjm-16f16``, with the placement where it is not the best."""
        named = ",".join(f"{name}={n}" for name, n in self.parts)
        named = f"[{named}]" if named else ""
        if self.segments is None:
            return f"vjm-paper{named}"
        foot = f"f{self.foot_segments}" if self.foot_segments and self.foot_segments > 1 else ""
        place = "" if self.placement is Placement.BEST else f"-{self.placement}"
        return f"vjm-{self.segments}{foot}{place}{named}"

    def model(self, chain: Machine) -> Mechanism:
        """The chain with this engine's springs.

        Raises:
            ValueError: a beam that is to be split has no section, or there is none of a name.
        """
        return Mechanism(self.split(chain))

    def split(self, chain: Machine) -> Machine:
        """The chain with its beams split into this engine's springs.

        Raises:
            ValueError: as `model`.
        """
        numbers = chain.segment_numbers(self.segments, self.foot_segments)
        for name, n in self.parts:
            numbers |= dict.fromkeys(chain.beams_named(name) or [name], n)
        return chain.refined(numbers, self.placement)

    @single_threaded
    def problem(self, chain: Machine, load_case: LoadCase) -> LumpedProblem:
        """The chain with this engine's springs under a load case, ready to be followed."""
        chain = chain.at(load_case.posture)
        if chain.closes:
            # what its loops hold too often is counted in its one posture
            chain = replace(chain, postures={load_case.posture: chain.posture(load_case.posture)})
        model, bow = self.model(chain), None
        if load_case.imperfection:
            shape = buckling_shape(lambda perfect: LumpedProblem(model, perfect, self.label), load_case)
            bow = load_case.imperfection * shape
        return LumpedProblem(model, load_case, self.label, bow)

    @single_threaded
    def trace(self, chain: Machine, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Trace the equilibrium path; see `vjm.continuation.load_stepping` and `vjm.continuation.arc_length`."""
        path = trace(self.problem(chain, load_case), load_case, progress=progress)
        return replace(path, model=chain.name, model_sha256=chain.sha256)


def refuse_unbuildable(machine: Machine) -> None:
    """Build what commands compute with: the machine's springs, split as usual, in each of its postures.

    Raises:
        ValueError: naming the posture in which they would all refuse the machine.
    """
    engine = VjmEngine(*machine.usual_segments)
    for label in machine.postures:
        try:
            engine.model(machine.at(label)).refuse_rigid()
        except ValueError as error:
            raise ValueError(f"posture '{label}': {error}") from error
