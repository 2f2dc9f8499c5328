"""Where a path under loads without a potential begins to flutter: its modes with the masses of the machine."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vjm.continuation.path import Equilibrium, Path
from vjm.design.changes import placed
from vjm.design.linear_state import Question
from vjm.design.modes import eigenmodes
from vjm.model.end_condition import held
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.threads import single_threaded
from vjm.vjm_engine import VjmEngine

GROWING = 1e-6
"""Imaginary over real part of a frequency from which on an oscillation grows: two that meet split by the root of
rounding."""


class Flutter(NamedTuple):
    """What the modes along a path say.

    Attributes:
        before: ramp of the last point without flutter; nan where the first one has it.
        begins: ramp of the first point with flutter; nan where none has it.
        examined: how many stable points were looked at.
    """

    before: float
    begins: float
    examined: int


@single_threaded
def flutter_along(machine: Machine, engine: VjmEngine, path: Path) -> Flutter:
    """The first point of a path at which an oscillation grows. What is statically unstable is not looked at.

    Args:
        machine: of the path.
        engine: that traced it.
        path: its end is free in all components.

    Raises:
        ValueError: the end is held, or no part that moves has a mass.

    Example:
        >>> flutter_along(chain, VjmEngine(8), path).begins  # doctest: +SKIP
        20.1
    """
    case = path.load_case
    if set(case.free) != set(COMPONENTS):
        raise ValueError("it is examined where the end is free in all six components")
    alone = engine.model(machine.at(case.posture))
    end = held(alone, case)

    def flutters(point: Equilibrium) -> bool:
        loads = tuple(
            replace(load, wrench=tuple(point.ramp * v for v in load.wrench), ramped=False) if load.ramped else load
            for load in case.loads
            if not load.ramped or point.ramp
        )
        asked = Question(machine, case.posture, engine, gravity=case.gravity, loads=loads)
        state = placed(asked, end.alone(point.state[: end.model.size]))
        omega = np.sqrt(np.asarray(eigenmodes(state, state.n)[0], dtype=complex))
        growing = (np.abs(omega.imag) > GROWING * np.abs(omega)) & (omega.real > GROWING * np.abs(omega))
        return bool(np.any(growing))

    before, examined = float("nan"), 0
    for point in path.points:
        if point.unstable == 0:
            examined += 1
            if flutters(point):
                return Flutter(before, point.ramp, examined)
            before = point.ramp
    return Flutter(before, float("nan"), examined)
