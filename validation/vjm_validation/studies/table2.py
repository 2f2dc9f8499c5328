"""Table II of the paper beside what its own model gives, and what the rounding of its data can reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.continuation.load_stepping import StepControl, follow
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium, EventKind
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_output.documents import Row
from vjm_updating.identify.rounding import (
    DIFFERENCE_STEP,
    AdmissibleRoundings,
    perturbed,
    printed_entries,
)


@dataclass(frozen=True)
class PublishedRow:
    """One row of Table II; N, mm. The table's header says N/m, its numbers are N/mm: 2661 N / 0.82 mm = 3245."""

    K0: float
    K1: float
    F_cr: float
    d_cr: float
    K2: float
    F1: float
    d1: float
    K3: float


TABLE_II = {
    "A": PublishedRow(K0=3228, K1=3228, F_cr=2661, d_cr=0.82, K2=8.56, F1=2672, d1=2.00, K3=8.56),
    "B": PublishedRow(K0=1130, K1=1105, F_cr=1920, d_cr=1.7, K2=159, F1=2494, d1=4.00, K3=27.7),
    "C": PublishedRow(K0=13056, K1=13090, F_cr=2300, d_cr=0.18, K2=8.56, F1=2305, d1=0.30, K3=8.56),
    "D": PublishedRow(K0=1260, K1=1170, F_cr=2000, d_cr=1.61, K2=52.73, F1=2191, d1=3.00, K3=20.6),
}
"""Pashkevich, Klimchik and Chablat, Table II."""

QUANTITIES = {"K0": "N/mm", "K1": "N/mm", "F_cr": "N", "d_cr": "mm", "K2": "N/mm", "F1": "N", "K3": "N/mm"}
"""The figures that are compared, with their units; d1 is where F1 and K3 are read."""


class PublishedFigure(Row):
    """One figure of Table II with ours beside it."""

    posture: str
    quantity: str
    unit: str
    published: float
    ours: float
    ratio: float
    """Ours over the published one."""
    reach_low: float | None
    """Lowest value found within the rounding of (19) and (20); null where it was not sought."""
    reach_high: float | None
    inside: bool | None
    """Whether the published figure lies in the reach."""
    definition_differs: bool
    """Whether ours is read off at the paper's own displacement, for want of a sharp critical point."""
    note: str


@dataclass(frozen=True)
class TableFigures:
    """What the paper's model gives for one row of Table II.

    Attributes:
        values: by quantity, N and mm.
        sharp: whether the path has a bifurcation.
    """

    values: dict[str, float]
    sharp: bool


COARSE = StepControl(first=0.02, largest=0.1)
"""Events are located and points solved whatever the steps between them: larger ones serve for single figures."""


def table_figures(chain: Machine, posture: str, control: StepControl = COARSE) -> TableFigures:
    """Compute a row of Table II with the paper's model, in tension.

    Where the path has a bifurcation, K1 and K2 are the stiffnesses at 0.99 and 1.01 of its displacement.
    Where it has none (B and D) force and stiffness are read at 1, 0.99 and 1.01 of the paper's own Δ_cr, and
    ours for Δ_cr is where the stiffness falls through half of K0.

    Raises:
        ValueError: the path ends before the paper's Δ1, or has neither a bifurcation nor a stiffness knee.
    """
    row = TABLE_II[posture]
    load_case = LoadCase(posture, row.d1)
    engine = VjmEngine()
    problem = LumpedProblem(engine.model(chain), load_case, engine.label)
    path = follow(problem, load_case, control)
    event = path.critical
    if event is None or not path.complete:
        raise ValueError(f"posture {posture}: no critical point up to {row.d1} mm {path.stopped}")

    def at(s: float) -> Equilibrium:
        return problem.solve(s, min(path.points, key=lambda p: abs(p.s - s)))

    last = path.points[-1]
    values = {"K0": path.points[0].tangent, "F1": float(path.force[-1]), "K3": last.tangent, "d_cr": event.s}
    sharp = event.kind is EventKind.BIFURCATION
    if sharp:
        if event.stiffness_before is None or event.stiffness_after is None:
            raise ValueError(f"posture {posture}: no stiffness beside the critical point")
        values |= {"F_cr": event.force, "K1": event.stiffness_before, "K2": event.stiffness_after}
    else:
        values |= {
            "F_cr": float(load_case.direction @ at(row.d_cr).wrench),
            "K1": at(0.99 * row.d_cr).tangent,
            "K2": at(1.01 * row.d_cr).tangent,
        }
    return TableFigures(values, sharp)


def published_figures(
    chain: Machine, reach: dict[str, dict[str, tuple[float, float]]] | None = None
) -> list[PublishedFigure]:
    """Every figure of Table II with ours, their ratio, and whether the inputs' rounding can reach it.

    Args:
        chain: the paper's chain.
        reach: intervals by posture and quantity, from `vjm_validation.studies.table2`; None where not sought.
    """
    rows = []
    for posture, published in TABLE_II.items():
        if posture not in chain.postures:
            continue
        figures = table_figures(chain, posture)
        for quantity, unit in QUANTITIES.items():
            theirs, ours = getattr(published, quantity), figures.values[quantity]
            low, high = (reach or {}).get(posture, {}).get(quantity, (None, None))
            differs = not figures.sharp and quantity in ("K1", "F_cr", "d_cr", "K2")
            rows.append(
                PublishedFigure(
                    posture=posture,
                    quantity=quantity,
                    unit=unit,
                    published=theirs,
                    ours=ours,
                    ratio=ours / theirs,
                    reach_low=low,
                    reach_high=high,
                    inside=None if low is None or high is None else low <= theirs <= high,
                    definition_differs=differs,
                    note=_note(quantity, published, differs=differs),
                )
            )
    return rows


def _note(quantity: str, row: PublishedRow, *, differs: bool) -> str:
    if not differs:
        return ""
    if quantity == "d_cr":
        return "no sharp point: ours is where the stiffness falls through half of K0"
    factor = {"K1": "0.99 of ", "F_cr": "", "K2": "1.01 of "}[quantity]
    return f"no sharp point: read at {factor}the paper's own {row.d_cr} mm"


# --- What the figures of Table II can be within the rounding of the printed matrices (19) and (20) ----------------
#
# A figure is linearised over the box of roundings, see `vjm_updating.identify.rounding`, and computed at the point
# of the box where the linear model is furthest, so that what is reported can be reached for certain. (Linearising
# again at that point does not move it for any figure of Table II.)


def reach(chain: Machine, posture: str) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each figure of a row of Table II within the rounding.

    Args:
        chain: the paper's chain.
        posture: its row.

    Returns:
        By quantity, the interval in N and mm.
    """
    entries = printed_entries(chain)
    names = list(QUANTITIES)

    def figures(amounts: Array) -> Array:
        try:
            values = table_figures(perturbed(chain, entries, amounts), posture).values
        except (ValueError, NoConvergenceError, np.linalg.LinAlgError):
            return np.full(len(names), np.nan)
        return np.array([values[name] for name in names])

    cone = AdmissibleRoundings(chain, entries)
    nominal = figures(np.zeros(len(entries)))
    steps = DIFFERENCE_STEP * np.eye(len(entries))
    slopes = np.array([(figures(step) - figures(-step)) / (2.0 * DIFFERENCE_STEP) for step in steps]).T
    result = {}
    for k, name in enumerate(names):
        ends = [figures(cone.furthest(sign * slopes[k]))[k] for sign in (-1.0, 1.0)]
        result[name] = (float(np.nanmin([*ends, nominal[k]])), float(np.nanmax([*ends, nominal[k]])))
    return result
