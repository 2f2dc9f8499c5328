"""Three engines on the paper's own chain: do they agree, and by more than their meshes err?

Every engine gets the same parts as beams, foot and bar in n pieces each, without shear. In compression A and C have
a sharp critical point: its force, and the force 1 mm behind it, are compared. Everywhere else it is the curve of
the force against the imposed displacement. A difference of two engines is set against the sum of their own error
estimates, from three meshes each: what is larger than these is a difference of models, not of meshes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path as FilePath

import numpy as np

from vjm.batch import map_all
from vjm.continuation.direction import Direction, ramp_end
from vjm.continuation.path import Event, EventKind, Path
from vjm.errors import NoConvergenceError
from vjm.io.model_file import load_chain
from vjm.io.provenance import Provenance
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm_validation.verification.convergence import Convergence, convergence
from vjm_validation.verification.families import MESHED, engine
from vjm_validation.verification.judging import TriangulationRow
from vjm_validation.verification.library import Family
from vjm_validation.verification.runner import Answers, AnswerStore, new_answers

MODEL = "orthoglide-chain"
MESHES: dict[Family, tuple[int, ...]] = {"vjm": (4, 8, 16), "exudyn": (6, 12, 24), "opensees": (6, 12, 24)}
"""Pieces of foot and bar each: what makes the errors 1e-4 and less at a like cost."""
SHARP = ("A", "C")
"""Postures with a sharp critical point in compression."""
BEHIND_MM = 1.0
"""How far behind the critical point the force is compared."""
STEP_MM = 1.0
"""Distance of the points at which curves are compared."""
CRITICAL_TOLERANCE, BEHIND_TOLERANCE, CURVE_TOLERANCE = 1e-3, 2e-3, 5e-3
"""What the three engines must agree to: critical force, force behind it, and curves over their largest force."""
CRITICAL, BEHIND, CURVE = "critical force, N", "force 1 mm behind the critical point, N", "force along the path, N"


@dataclass(frozen=True)
class ComparedPaths:
    """What is compared in one posture and direction.

    Attributes:
        posture: label.
        direction: of the ramp.
        end: signed end of the ramp, mm.
    """

    posture: str
    direction: Direction
    end: float

    @property
    def sharp(self) -> bool:
        """Whether a critical point is compared; else the whole curve is."""
        return self.direction is Direction.COMPRESSION and self.posture in SHARP

    @property
    def name(self) -> str:
        """Under which answers are kept."""
        return f"{MODEL}_{self.posture}_{self.direction}"

    @property
    def load_case(self) -> LoadCase:
        """The ramp, with its points where curves are compared."""
        return LoadCase(self.posture, self.end, steps=math.ceil(abs(self.end) / STEP_MM - 1e-9))


def comparisons(chain: Machine, *, quick: bool = False) -> list[ComparedPaths]:
    """What is compared: every posture in both directions; A and B in compression alone where it has to be quick."""
    found = []
    for posture in ("A", "B") if quick else sorted(chain.postures):
        for direction in (Direction.COMPRESSION,) if quick else tuple(Direction):
            end = ramp_end(chain, posture, direction)
            one = ComparedPaths(posture, direction, end)
            if one.sharp:
                # the same displacement for all: 1 mm behind the finest lumped model's critical point
                path = engine("vjm", MESHES["vjm"][-1], foot=True).trace(chain, LoadCase(posture, end))
                event = _bifurcation(path)
                one = ComparedPaths(posture, direction, direction.sign * (event.s + BEHIND_MM))
            found.append(one)
    return found


def triangulation(
    jobs: int = 1,
    folder: FilePath | None = None,
    progress: Callable[[int, int], None] | None = None,
    *,
    quick: bool = False,
    families: Sequence[Family] = MESHED,
) -> list[TriangulationRow]:
    """Every pair of engines on every comparison.

    Args:
        jobs: processes.
        folder: of the run, to keep answers in.
        progress: called with how many items are done, and of how many.
        quick: less, see `comparisons`.
        families: engines.
    """
    chain = load_chain(MODEL)
    wanted = comparisons(chain, quick=quick)
    items = [(one, family) for one in wanted for family in families]
    store = AnswerStore(folder)
    found = {(one.name, family): store.find(one.name, _files(chain, one), family) for one, family in items}
    files = {one.name: _files(chain, one) for one in wanted}
    missing = [item for item in items if found[item[0].name, item[1]] is None]
    # the longest first
    missing.sort(key=lambda item: (-MESHED.index(item[1]), -abs(item[0].end)))
    ready = len(items) - len(missing)

    def done(_: int, answers: Answers) -> None:
        store.keep(answers, files[answers.case])
        found[answers.case, answers.family] = answers

    def count(finished: int, _: int) -> None:
        if progress is not None:
            progress(ready + finished, len(items))

    map_all(_answered, missing, jobs, count, done)
    rows: list[TriangulationRow] = []
    for one in wanted:
        answers = [got for family in families if (got := found[one.name, family]) is not None]
        for a, b in combinations(answers, 2):
            rows += _compared(one, a, b)
    return rows


def _files(chain: Machine, one: ComparedPaths) -> dict[str, str]:
    """What answers are made of: the model, and the ramp, which follows from a critical point."""
    return dict(Provenance(chain.files).asked(load_case=one.load_case).inputs)


def _answered(item: tuple[ComparedPaths, Family]) -> Answers:
    comparison, family = item
    chain = load_chain(MODEL)

    def on_mesh(mesh: int) -> list[tuple[float | None, str]]:
        try:
            path = engine(family, mesh, foot=True).trace(chain, comparison.load_case)
            return [(value, "") for value in _read(comparison, path)]
        except NoConvergenceError as failure:
            return [(None, str(failure))] * _count(comparison)

    return new_answers(comparison.name, family, MESHES[family], _count(comparison), on_mesh)


def _count(comparison: ComparedPaths) -> int:
    return 2 if comparison.sharp else comparison.load_case.steps or 0


def _read(comparison: ComparedPaths, path: Path) -> list[float]:
    """Critical force and the force at the end, or the forces at all points but the unloaded one."""
    if not path.complete:
        raise NoConvergenceError(path.stopped)
    if comparison.sharp:
        return [_bifurcation(path).force, float(path.force[-1])]
    at = STEP_MM * np.arange(1, _count(comparison) + 1)
    nearest = [int(np.argmin(np.abs(path.s - s))) for s in at]
    if np.max(np.abs(path.s[nearest] - at)) > 1e-9 * at[-1]:
        raise NoConvergenceError("the path has not all of the points that are compared")
    return [float(path.force[i]) for i in nearest]


def _bifurcation(path: Path) -> Event:
    event = next((event for event in path.events if event.kind is EventKind.BIFURCATION), None)
    if event is None:
        raise NoConvergenceError("the path has no bifurcation")
    return event


def _compared(one: ComparedPaths, a: Answers, b: Answers) -> list[TriangulationRow]:
    asked = [(CRITICAL, CRITICAL_TOLERANCE, [0]), (BEHIND, BEHIND_TOLERANCE, [1])]
    if not one.sharp:
        asked = [(CURVE, CURVE_TOLERANCE, list(range(_count(one))))]
    return [_row(one, quantity, tolerance, where, a, b) for quantity, tolerance, where in asked]


def _row(
    one: ComparedPaths, quantity: str, tolerance: float, where: Sequence[int], a: Answers, b: Answers
) -> TriangulationRow:
    """The largest difference over some questions, at which values and estimates are given."""
    head = {"posture": one.posture, "direction": str(one.direction), "quantity": quantity, "tolerance": tolerance}
    engines = (a.family, b.family)
    not_run = "; ".join(
        f"{answers.family}: {answers.refused or next(filter(None, answers.failures), '')}"
        for answers in (a, b)
        if answers.refused or any(answers.values[i][-1] is None for i in where)
    )
    if not_run:
        # what is not installed says nothing; what gave up does
        passed = None if a.refused or b.refused else False
        return TriangulationRow(**head, engines=engines, passed=passed, not_run=not_run)
    finest = np.array([[answers.values[i][-1] for i in where] for answers in (a, b)], dtype=float)
    scale = float(np.max(np.abs(finest)))
    worst = int(np.argmax(np.abs(finest[0] - finest[1])))
    difference = float(abs(finest[0, worst] - finest[1, worst])) / scale
    found = [_converged(answers, where[worst]) for answers in (a, b)]
    gci = [one.gci if one is not None else None for one in found]
    estimate = None if gci[0] is None or gci[1] is None else (gci[0] + gci[1]) / scale
    return TriangulationRow(
        **head,
        engines=engines,
        at=None if one.sharp else STEP_MM * (where[worst] + 1),
        values=(float(finest[0, worst]), float(finest[1, worst])),
        extrapolated=tuple(one.extrapolated if one is not None else None for one in found),
        difference=difference,
        estimate=estimate,
        within=None if estimate is None else difference <= estimate,
        passed=difference <= tolerance,
    )


def _converged(answers: Answers, question: int) -> Convergence | None:
    values = [value for value in answers.values[question] if value is not None]
    if len(values) < len(answers.values[question]):
        return None
    return convergence(MESHES[answers.family], values, abs(values[-1]), None)
