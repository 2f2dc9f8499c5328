"""What the commands that trace paths say beside them: of flutter, and of springs with laws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.continuation.path import EventKind, Path
from vjm.engine import Engine
from vjm.model.end_condition import held
from vjm.model.law_states import law_states
from vjm.model.machine import Machine
from vjm.vjm_engine import VjmEngine


def path_words(machine: Machine, traced: Sequence[tuple[Engine, Path]]) -> list[str]:
    """What is to be said beside paths; a line for each answer.

    Args:
        machine: of the paths.
        traced: each path with its engine.
    """
    return _flutter_words(machine, traced) + [
        line for engine, path in traced for line in _law_words(machine, engine, path)
    ]


def _law_words(machine: Machine, engine: Engine, path: Path) -> list[str]:
    """Where the laws of springs are at the end of a path."""
    if not isinstance(engine, VjmEngine):
        return []
    model = engine.model(machine.at(path.load_case.posture))
    end, last = held(model, path.load_case), path.points[-1]
    return [f"at {last.ramp:.6g} {state}" for state in law_states(model, end.alone(last.state[: end.model.size]))]


def _flutter_words(machine: Machine, traced: Sequence[tuple[Engine, Path]]) -> list[str]:
    """Where paths under loads without a potential flutter, or why that is not known; a line for each answer.

    Args:
        machine: of the paths.
        traced: each path with its engine.
    """
    without = [(engine, path) for engine, path in traced if not path.load_case.conservative]
    if not without:
        return []
    found = any(event.kind is EventKind.BIFURCATION for _, path in without for event in path.events)
    statics = "the losses of stability above are the static ones" if found else "no static loss of stability"
    several = len(without) > 1
    lines = []
    for engine, path in without:
        where = f"{path.engine}, posture {path.load_case.posture}: " if several else ""
        lines.append(
            f"{where}followers and moments have no potential: {statics}; {_flutter(machine, engine, path)}"
        )
    return list(dict.fromkeys(lines))


def _flutter(machine: Machine, engine: Engine, path: Path) -> str:
    if not isinstance(engine, VjmEngine):
        return "flutter is examined by the engine vjm only"
    # what few paths need takes SciPy's linear algebra, half a second
    from vjm.design.flutter import flutter_along

    try:
        found = flutter_along(machine, engine, path)
    except ValueError as error:
        return f"flutter is not examined: {error}"
    unit = "" if path.load_case.load_driven else f" {path.load_case.driven.along}"
    if np.isnan(found.begins):
        return f"no flutter at the {found.examined} stable points of the path"
    if np.isnan(found.before):
        return f"flutter already at {found.begins:.6g}{unit}"
    return f"flutter begins between {found.before:.6g} and {found.begins:.6g}{unit}"
