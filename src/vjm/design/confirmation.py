"""A design computed again: with twice as many springs, and with finite elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, assert_never

import numpy as np

from vjm.design.linear_state import Question
from vjm.design.sensitivity import UNLOADED, DesignQuantity
from vjm.design.space import DesignCase, DesignSpace
from vjm.design.sweep import AskedQuantity, signs, value_in
from vjm.engines import EngineOptions, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS, LOAD, Load, LoadCase
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine

if TYPE_CHECKING:
    from vjm.continuation.path import Path

ELEMENTS = 8
"""In each beam; half as many state the error."""
FURTHER = 1.2
"""Times a critical load, up to where finite elements look for it."""
TOLD = 5e-6
"""Half a unit of the sixth digit, over a value: results are told with six digits."""
NO_LOAD = Load((0.0, 0.0, 1e-9, 0.0, 0.0, 0.0))
"""N: no machine moves by a thing that counts under it; a path needs some load."""


@dataclass(frozen=True)
class Confirmation:
    """A quantity of a design by other models of its beams.

    Attributes:
        of: the quantity.
        value: as the design has it, in the worst case or the weighted mean.
        refined: with twice as many springs; nan where there is no answer.
        elements: with finite elements; nan where there is no answer.
        error: stated of the last two: what half as many springs, and half as many elements, change.
        why: there is no answer of one; empty where there are both.
    """

    of: AskedQuantity
    value: float
    refined: float
    elements: float
    error: float
    why: str

    @property
    def doubt(self) -> str:
        """In what they differ by more than they state; empty where they agree."""
        first, second = abs(self.value - self.refined), abs(self.refined - self.elements)
        size = TOLD * abs(self.value)
        if second > self.error + size:
            return f"springs and finite elements differ by {second:.3g} {self.of.unit}, more than their errors"
        if first > size:
            changed = f"twice as many springs change it by {first:.3g} {self.of.unit}"
            return f"{changed}: write more `segments` into its beams"
        return ""


def confirmed(
    space: DesignSpace, row: Array, quantities: dict[AskedQuantity, float], *, worst: bool = True
) -> list[Confirmation]:
    """Quantities of a machine by finer models; those that no spring changes are left out.

    Args:
        space: of the machine.
        row: its numbers ``(k,)``.
        quantities: that are asked for, with their values.
        worst: of the cases the worst one counts; else their weighted mean, where they have weights.
    """
    judged = replace(space, weights=()) if worst else space
    fine = replace(space, engine=_twice(space))
    return [_confirmed(judged, fine, row, *each) for each in quantities.items() if each[0].quantity not in UNLOADED]


def _confirmed(space: DesignSpace, fine: DesignSpace, row: Array, of: AskedQuantity, value: float) -> Confirmation:
    (sign,) = signs([of])

    def of_all(at: Callable[[DesignCase], float]) -> float:
        return space.in_all_cases(np.array([at(case) for case in space.cases]), sign)

    def refined_in(case: DesignCase) -> float:
        return value_in(fine, row, fine.question(row, case), of)

    def by_elements(number: int) -> float:
        return of_all(lambda case: _by_elements(space.question(row, case), of, number, value))

    why, refined, elements, error = "", np.nan, np.nan, 0.0
    try:
        refined = of_all(refined_in)
        coarse, elements = by_elements(ELEMENTS // 2), by_elements(ELEMENTS)
        error = abs(value - refined) + abs(coarse - elements)
    except (ValueError, NoConvergenceError, ImportError, np.linalg.LinAlgError) as problem:
        why = " ".join(str(problem).split())
    return Confirmation(of, value, refined, elements, error, why)


def _twice(space: DesignSpace) -> VjmEngine:
    """The engine with twice as many springs in each beam."""
    machine = space.files.machine()
    engine = space.engine or VjmEngine(*machine.usual_segments)
    # a whole beam is one spring, which a section splits and a compliance alone does not
    numbers = {beam.name: beam.segments or 1 for beam in engine.split(machine).beams if beam.section is not None}
    return replace(engine, parts=tuple((name, 2 * n) for name, n in numbers.items()))


def _by_elements(asked: Question, of: AskedQuantity, number: int, factor: float) -> float:
    """A quantity of a machine by finite elements.

    Args:
        asked: the machine, and what is done to it.
        of: the quantity.
        number: of elements in each beam.
        factor: near which a critical load is looked for.

    Raises:
        ValueError: they do not give it.
        NoConvergenceError: their path ends before the load is reached.
        ImportError: they are not installed.
    """
    if asked.end:
        raise ValueError(f"finite elements give the end-effector behind the last part, not end frame '{asked.end}'")
    loads = tuple(replace(load, ramped=True) for load in asked.acting)
    match of.quantity:
        case DesignQuantity.DEFLECTION | DesignQuantity.STIFFNESS:
            to = 1.0
        case DesignQuantity.CRITICAL:
            to = FURTHER * factor
        case DesignQuantity.FREQUENCY:
            raise ValueError("finite elements give no frequencies")
        case DesignQuantity.MASS | DesignQuantity.REACH | DesignQuantity.COST:
            raise ValueError(f"finite elements give no {of.quantity}")
        case _:
            assert_never(of.quantity)
    if not loads and asked.gravity is None:
        loads = (NO_LOAD,)
    case = LoadCase(asked.posture, to, LOAD, free=COMPONENTS, loads=loads, gravity=asked.gravity)
    solver = engine_by_name("exudyn", EngineOptions(number), asked.machine)
    return _of_path(solver.trace(asked.machine, case), of)


def _of_path(path: Path, of: AskedQuantity) -> float:
    if of.quantity is DesignQuantity.CRITICAL:
        if path.critical is None:
            raise ValueError("finite elements find no critical load near")
        return path.critical.s
    last = path.points[-1]
    if not path.complete or last.unstable:
        raise NoConvergenceError(f"finite elements reach {last.s:.1%} of the load: {path.stopped}")
    if of.quantity is DesignQuantity.DEFLECTION:
        moved = last.displacement
        return float(abs(moved[COMPONENTS.index(of.along)]) if of.along else np.linalg.norm(moved[:3]))
    if last.stiffness is None:
        raise ValueError("finite elements give no 6×6 stiffness")
    k = COMPONENTS.index(of.along)
    return float(1.0 / np.linalg.inv(last.stiffness)[k, k])
