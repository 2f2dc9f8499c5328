"""The engines by name.

Those of the virtual joint method and the conventional models are here. Every other is found by the entry point of
its name in the group ``vjm.engines`` of an installed package: a function that takes `EngineOptions` and returns an
engine. That is how the finite elements of ``vjm_fea`` come in, and how anybody's own engine does.
"""

from __future__ import annotations

import importlib.metadata
import re
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

from vjm.engine import Engine
from vjm.model.machine import USUAL_SEGMENTS, Machine
from vjm.model.parts import Placement
from vjm.vjm_engine import VjmEngine

DESCRIPTIONS = {
    "vjm-paper": "the paper's model: one spring a link, at its far end, with the printed matrices",
    "vjm": "virtual joint method with --segments n and --foot-segments m; also as vjm-<n> or vjm-<n>f<m>",
    "vjm-linear": "linear stiffness, eq. (5)",
    "vjm-unloaded-jacobian": "loaded stiffness on the unloaded posture's Jacobians, the earlier literature",
    "msa": "matrix structural analysis: linear beams, the foot as its 6x6 matrix",
    "exudyn": "geometrically exact beam finite elements, foot and bars",
    "exudyn-footspring": "the same with the foot as its 6x6 spring",
    "opensees": "corotational beam finite elements; an optional extra: pip install 'vjm-stiffness[opensees]'",
}
"""Every engine's name and what it is."""

GROUP = "vjm.engines"
"""Of the entry points by which other packages bring engines."""
FROZEN = "vjm-unloaded-jacobian"
"""The engine that stops at its first event by its nature."""


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
    if name in ("vjm-linear", "vjm-unloaded-jacobian", "msa"):
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
    from vjm.baselines import LinearEngine, MsaEngine, UnloadedJacobianEngine

    known: dict[str, Engine] = {
        "vjm-linear": LinearEngine(),
        "vjm-unloaded-jacobian": UnloadedJacobianEngine(),
        "msa": MsaEngine(),
    }
    return known[name]
