"""Engines: what each one is, the virtual joint method as one, and all of them by their names.

Other packages bring more by the entry point `vjm.engines`.
"""

from __future__ import annotations

import importlib.metadata
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, Protocol

from vjm.continuation.arc_length import trace
from vjm.continuation.lumped_problem import LumpedProblem, buckling_shape
from vjm.continuation.path import Path
from vjm.model.load_case import LoadCase
from vjm.model.machine import USUAL_SEGMENTS, Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Placement
from vjm.threads import single_threaded


class Engine(Protocol):
    """A way to compute load paths; comparisons never ask which one they hold.

    Attributes:
        label: the name under which results are filed, such as ``vjm-16f16`` or ``exudyn``.
    """

    @property
    def label(self) -> str: ...  # noqa: D102

    def trace(self, chain: Machine, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Take the chain through the load case, staying on the stable path.

        Args:
            chain: the machine; the engine splits or meshes its beams as it needs.
            load_case: what is done to it.
            progress: called with the fraction done.

        Raises:
            ValueError: the chain lacks something that the engine needs, such as a beam's section.
        """


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


DESCRIPTIONS = {
    "vjm-paper": "the paper's model: one spring a link, at its far end, with the printed matrices",
    "vjm": "virtual joint method with --segments n and --foot-segments m; also as vjm-<n> or vjm-<n>f<m>",
    "vjm-linear": "linear stiffness, eq. (5)",
    "msa": "matrix structural analysis: linear beams, the foot as its 6x6 matrix",
    "exudyn": "geometrically exact beam finite elements, foot and bars",
    "exudyn-footspring": "the same with the foot as its 6x6 spring",
    "opensees": "corotational beam finite elements; an optional extra: pip install 'vjm-stiffness[opensees]'",
}
"""Every engine's name and what it is."""

GROUP = "vjm.engines"
"""Of the entry points by which other packages bring engines."""


@dataclass(frozen=True)
class EngineOptions:
    """What the command line can say about an engine.

    Attributes:
        segments: springs or elements in every beam that has no number of its own; None for the engine's default.
        foot_segments: springs in the foot; None for one. Finite elements split it like any beam.
        placement: where a spring sits in its segment.
        parts: springs by the name of the beam, for the virtual joint method.

    Example:
        >>> import vjm
        >>> vjm.engine_by_name("vjm", vjm.EngineOptions(segments=8)).label
        'vjm-8'
    """

    segments: int | None = None
    foot_segments: int | None = None
    placement: Placement = Placement.BEST
    parts: tuple[tuple[str, int], ...] = ()


def engine_by_name(name: str, options: EngineOptions = EngineOptions(), chain: object = None) -> Engine:
    """The engine of a name.

    Args:
        name: see `DESCRIPTIONS`.
        options: what the command line says.
        chain: what it is for; ``vjm`` takes as many springs as its model file asks for, unless the options say so.

    Raises:
        ValueError: there is none; the message lists those that there are.

    Example:
        >>> import vjm
        >>> vjm.engine_by_name("vjm-16f16").label
        'vjm-16f16'
    """
    if not name.isascii():
        raise ValueError(f"unknown engine '{name}': write it with the letters and digits of `validate list`")
    by_part = re.fullmatch(r"(vjm[^\[]*)\[((?:[^=,\]]+=[1-9]\d*,?)+)\]", name)
    if by_part:
        parts = tuple((part, int(n)) for part, n in (word.split("=") for word in by_part[2].split(",") if word))
        return engine_by_name(by_part[1], replace(options, parts=parts), chain)
    split = re.fullmatch(r"vjm-(\d+)(?:f(\d+))?(?:-(end|middle|two-thirds|best))?", name)
    if split:
        n, m, placement = split.groups()
        foot = int(m) if m else options.foot_segments
        return VjmEngine(int(n), foot, Placement(placement or options.placement), options.parts)
    if name in ("vjm-paper", "vjm"):
        return VjmEngine(parts=options.parts) if name == "vjm-paper" else _vjm(options, chain)
    if name in ("vjm-linear", "msa"):
        return _baseline(name)
    for entry in importlib.metadata.entry_points(group=GROUP):
        if entry.name == name:
            return _brought(entry, options, chain)
    near = get_close_matches(name, DESCRIPTIONS, 1)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    raise ValueError(f"unknown engine '{name}'{hint} (there are {', '.join(DESCRIPTIONS)})")


def _brought(entry: importlib.metadata.EntryPoint, options: EngineOptions, chain: object) -> Engine:
    """The engine of another package's entry point.

    Raises:
        ValueError: it takes no springs by part, or no shear, which the model states.
        ImportError: what it needs is not installed; one line that says how to get it.
    """
    if options.parts:
        raise ValueError(
            f"--segments: {entry.name} takes one number of elements for all beams, not numbers by part"
        )
    make: Any = entry.load()
    engine: Engine = make(options)
    if isinstance(chain, Machine) and chain.shears and not getattr(engine, "takes_shear", True):
        raise ValueError(
            f"{entry.name}: its beams are rigid in shear, but the model states GA: "
            "--no-shear leaves it out in every engine, or take vjm or exudyn"
        )
    return engine


def _vjm(options: EngineOptions, chain: object) -> VjmEngine:
    link, foot = chain.usual_segments if isinstance(chain, Machine) else (USUAL_SEGMENTS, None)
    return VjmEngine(options.segments or link, options.foot_segments or foot, options.placement, options.parts)


# Imported when it is asked for: it takes a third of a second.


def _baseline(name: str) -> Engine:
    from vjm.baselines import LinearEngine, MsaEngine

    return LinearEngine() if name == "vjm-linear" else MsaEngine()
