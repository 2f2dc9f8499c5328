"""Verification: cases with known answers, frame invariance, the foot's matrix, and three engines side by side.

Every solver must get there before any two are compared with each other on the paper's findings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath

from vjm.model.machine import FOOT, Machine
from vjm_updating.identify.rounding import printed_entries
from vjm_validation.verification.invariance import invariance_rows
from vjm_validation.verification.judging import TriangulationRow, VerificationRow, case_rows
from vjm_validation.verification.library import picked
from vjm_validation.verification.runner import run_cases
from vjm_validation.verification.triangulation import triangulation


@dataclass(frozen=True)
class Verification:
    """What was found.

    Attributes:
        rows: one for every quantity of every case on every engine.
        triangulation: one for every quantity of the paper's chain and every pair of engines.
    """

    rows: list[VerificationRow] = field(default_factory=list)
    triangulation: list[TriangulationRow] = field(default_factory=list)


def verify(
    chain: Machine,
    *,
    cases: Sequence[str] = (),
    quick: bool = False,
    jobs: int = 1,
    folder: FilePath | None = None,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> Verification:
    """Run the verification hierarchy.

    Args:
        chain: the paper's.
        cases: only these, by name, and nothing else; all where it is empty.
        quick: without the cases that take long, and less of the triangulation.
        jobs: processes.
        folder: of the run, where answers are kept and those of an interrupted run are found.
        progress: called with a stage's name, how much of it is done, and of how much.
    """
    wanted = picked(cases, quick=quick)
    answers = run_cases(wanted, jobs=jobs, folder=folder, progress=_stage(progress, "verification cases"))
    rows = case_rows(wanted, answers, jobs)
    if cases:
        return Verification(rows)
    rows += invariance_rows(wanted, jobs=jobs, progress=_stage(progress, "frame invariance"))
    rows += foot_rows(chain)
    pairs = triangulation(jobs, folder, _stage(progress, "triangulation"), quick=quick)
    return Verification(rows, pairs)


def _stage(progress: Callable[[str, int, int], None], name: str) -> Callable[[int, int], None]:
    return lambda done, total: progress(name, done, total)


def foot_rows(chain: Machine) -> list[VerificationRow]:
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
            case="foot",
            group="paper",
            engine="beam theory",
            reason="half a unit of the last printed digit",
        )
    ]
