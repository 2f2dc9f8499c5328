"""Cases with a known answer that both solvers must meet before they are compared with each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydantic import BaseModel, ConfigDict

from vjm.chain import FOOT, Chain
from vjm.engine import Engine
from vjm.parts import Beam, PassiveJoint, Section
from vjm.paths import EventKind
from vjm.programme import Programme
from vjm.rotations import AXES
from vjm.vjm_engine import VjmEngine
from vjm_fea.exudyn_engine import ExudynEngine
from vjm_validation.rounding import printed_entries

MESHES = (4, 8, 16)


class VerificationRow(BaseModel):
    """One quantity of one case on one engine."""

    model_config = ConfigDict(frozen=True)

    name: str
    kind: str
    """``exact``, ``code``, ``published`` or ``measured``."""
    quantity: str
    reference: float
    source: str
    value: float
    error: float
    """Relative to the reference."""
    tolerance: float
    order: float | None
    """Observed order of convergence, where meshes were compared."""
    passed: bool


def pinned_column(section: Section, length: float) -> Chain:
    """A straight column with a universal joint at either end, along x."""
    parts = (
        PassiveJoint("q1", AXES["y"]),
        PassiveJoint("q2", AXES["z"]),
        Beam("link", length, section=section),
        PassiveJoint("q3", AXES["z"]),
        PassiveJoint("q4", AXES["y"]),
    )
    return Chain("pinned-column", parts, postures={"straight": np.zeros(4)})


def column_load(section: Section, length: float) -> float:
    """Critical load in N of the pinned, extensible, shearable column: ``P (1 + P/GA − P/EA) = π² EI/L²``.

    The geometrically exact beam's: Reissner (1972), as in Ziegler, *Ingenieur-Archiv* 52 (1982).
    """
    soft = min((section.EIy, section.GAz), (section.EIz, section.GAy))
    euler = np.pi**2 * soft[0] / length**2
    a = 1.0 / soft[1] - 1.0 / section.EA
    # the root that tends to Euler's load as a tends to zero
    return float(2.0 * euler / (1.0 + np.sqrt(1.0 + 4.0 * a * euler)))


def column_rows(chain: Chain) -> list[VerificationRow]:
    """The chain's own bar as a pinned column: critical load of both solvers against the closed form."""
    bar = next(beam for beam in chain.beams if beam.name != FOOT and beam.section is not None)
    section = replace(bar.effective_section(), GAy=float("inf"), GAz=float("inf"))
    exact = column_load(section, bar.length)
    column = pinned_column(section, bar.length)
    shortening = 1.2 * exact * bar.length / section.EA
    rows = []
    # leading terms: 28/n¹⁰ (beam-column springs, docs/virtual-springs.md), 1.0/n⁴ (corrected elements, measured);
    # events are located to 1e-9 of the path
    for name, engines, leading, power in (
        ("vjm", [VjmEngine(n) for n in MESHES], 40.0, 10),
        ("exudyn", [ExudynEngine(elements=n) for n in MESHES], 2.0, 4),
    ):
        loads = [_critical_force(engine, column, shortening) for engine in engines]
        errors = np.abs(np.array(loads) / exact - 1.0)
        # from the two coarser meshes: on the finest the location of the event shows
        order = float(np.log(errors[0] / errors[1]) / np.log(MESHES[1] / MESHES[0]))
        for n, load, error in zip(MESHES, loads, errors, strict=True):
            tolerance = leading / n**power + 1e-8
            rows.append(
                VerificationRow(
                    name=f"pinned column, {name}, n = {n}",
                    kind="exact",
                    quantity="critical load, N",
                    reference=exact,
                    source="P (1 − P/EA) = π² EI/L²",
                    value=load,
                    error=float(error),
                    tolerance=tolerance,
                    order=order,
                    passed=bool(error <= tolerance),
                )
            )
    return rows


def _critical_force(engine: Engine, column: Chain, shortening: float) -> float:
    event = engine.walk(column, Programme("straight", -shortening)).critical
    if event is None or event.kind is not EventKind.BIFURCATION:
        return float("nan")
    return event.force


def foot_rows(chain: Chain) -> list[VerificationRow]:
    """The foot as a beam has the foot's printed matrix (19), unloaded, within the printed digits."""
    foot = next((beam for beam in chain.beams if beam.name == FOOT), None)
    if foot is None or foot.section is None or foot.compliance is None:
        return []
    ours = foot.beam_compliance()
    theirs = foot.tip_compliance()
    entries = [e for e in printed_entries(chain) if e.part == FOOT]
    worst = max(entries, key=lambda e: abs(ours[e.row, e.column] - theirs[e.row, e.column]) / e.half_unit)
    value, reference = float(ours[worst.row, worst.column]), float(theirs[worst.row, worst.column])
    tolerance = worst.half_unit / abs(reference)
    error = abs(value / reference - 1.0)
    return [
        VerificationRow(
            name="foot as a beam against (19), worst entry",
            kind="published",
            quantity=f"compliance ({worst.row + 1},{worst.column + 1})",
            reference=reference,
            source="Pashkevich, Klimchik, Chablat, eq. (19); half a unit of the last printed digit",
            value=value,
            error=error,
            tolerance=tolerance,
            order=None,
            passed=error <= tolerance,
        )
    ]
