"""The first screen: passed, failed and not run, counted; engines by postures; what is wrong in the paper."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from vjm.continuation.direction import Direction
from vjm_output.plot_style import DASH, FE, PAPER, engine_order, listed, number, percent
from vjm_validation.acceptance import CURVE_AGREEMENT, LOAD_AGREEMENT
from vjm_validation.report.figures import posture_paths, postures, worst_difference
from vjm_validation.report.words import SHARP, engine_metrics
from vjm_validation.studies.study_results import Run


@dataclass(frozen=True)
class Count:
    """How many checks of one kind passed, failed, and were not run.

    Attributes:
        name: of the kind.
        chapter: where they stand.
        passed: how many.
        failed: how many.
        not_run: how many.
        why: they were not run; the commonest reason first.
    """

    name: str
    chapter: str
    passed: int
    failed: int
    not_run: int
    why: str = ""


@dataclass(frozen=True)
class Cell:
    """One engine on one path.

    Attributes:
        critical: force at the critical point, N, or what is there instead.
        difference: largest difference of force to the finite elements, over their critical or largest force.
        tone: ``yes`` within the tolerance, ``no`` beyond it, ``soft`` where there is nothing to compare.
    """

    critical: str
    difference: str
    tone: str


@dataclass(frozen=True)
class Matrix:
    """Engines by paths.

    Attributes:
        columns: posture and direction.
        rows: engine label and its cells.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str, tuple[Cell, ...]], ...]


def counts(summary: Mapping[str, Any]) -> list[Count]:
    """Checks by kind; what was not run is neither passed nor failed."""
    acceptance = summary.get("acceptance", ())
    verification = summary.get("verification", ())
    triangulation = summary.get("triangulation", ())
    found = [
        _count("requirements of acceptance", "checks", ((row["passed"], "") for row in acceptance)),
        _count(
            "known answers", "verification", ((row["passed"], row.get("not_run") or "") for row in verification)
        ),
        _count(
            "pairs of engines on the paper's chain",
            "verification",
            ((row["passed"], row.get("not_run") or "") for row in triangulation),
        ),
    ]
    return [row for row in found if row.passed + row.failed + row.not_run]


def _count(name: str, chapter: str, checks: Iterable[tuple[bool | None, str]]) -> Count:
    rows = list(checks)
    reasons: dict[str, int] = {}
    for passed, why in rows:
        if passed is None and why:
            reasons[why] = reasons.get(why, 0) + 1
    commonest = sorted(reasons, key=lambda why: -reasons[why])[:3]
    return Count(
        name, chapter, sum(p is True for p, _ in rows), sum(p is False for p, _ in rows),
        sum(p is None for p, _ in rows), "; ".join(commonest),
    )  # fmt: skip


def verdict(rows: list[Count], notes: Iterable[str] = ()) -> tuple[str, str]:
    """Tone and sentence of the whole run."""
    passed, failed, not_run = (sum(getattr(row, name) for row in rows) for name in ("passed", "failed", "not_run"))
    if not rows:
        return "note", "Nothing was checked in this run"
    if failed:
        return "failed", f"FAILED: {failed} of {passed + failed} checks that were run do not hold"
    left = f"; {not_run} were not run" if not_run else ""
    out = "; parts of the run were left out" if any(notes) else ""
    return ("agrees" if not left + out else "differs"), f"All {passed} checks that were run passed{left}{out}"


def matrix(run: Run) -> Matrix:
    """Critical force and largest difference to the finite elements of every engine on every path."""
    columns = [(p, d) for p in postures(run) for d in Direction if posture_paths(run, p, d)]
    engines = sorted({key.engine for key in run.paths}, key=engine_order)
    rows = []
    for engine in engines:
        cells = []
        for posture, direction in columns:
            paths = posture_paths(run, posture, direction)
            cells.append(_cell(paths, engine))
        rows.append((engine, tuple(cells)))
    return Matrix(tuple(f"{p}, {d}" for p, d in columns), tuple(rows))


def _cell(paths: Mapping[str, Any], engine: str) -> Cell:
    path = paths.get(engine)
    if path is None:
        return Cell("not run", DASH, "soft")
    critical = f"{number(path.critical.force)} N" if path.critical else "none"
    reference = paths.get(FE)
    if reference is None or engine == FE:
        return Cell(critical, "reference" if engine == FE else "no reference", "soft")
    apart = worst_difference(path, reference)
    both = path.critical is not None and reference.critical is not None
    same = (path.critical and path.critical.kind) == (reference.critical and reference.critical.kind)
    within = apart <= CURVE_AGREEMENT and same
    if both:
        within = within and abs(path.critical.force / reference.critical.force - 1.0) <= LOAD_AGREEMENT
    return Cell(critical, percent(apart), "yes" if within else "no")


TOLERANCES = f"{percent(LOAD_AGREEMENT)} of the critical force and {percent(CURVE_AGREEMENT)} of the curve"
"""What the matrix colours by."""


def wrong_in_the_paper(run: Run) -> tuple[str, ...]:
    """Two sentences, or fewer where the run does not show it."""
    pulled, pushed = (engine_metrics(run, direction, PAPER) for direction in Direction)
    real_pulled, real_pushed = (engine_metrics(run, direction, FE) for direction in Direction)
    artefact = [
        p for p, m in pulled.items()
        if m["critical"] in SHARP and p in real_pulled and real_pulled[p]["critical"] is None
    ]  # fmt: skip
    sentences = []
    if artefact:
        where = listed([f"{number(pulled[p]['F_cr'])} N in {p}" for p in artefact])
        sentences.append(
            f"The paper's chain buckles when it is pulled ({where}); the same parts as beams do not: the one "
            "translational spring at the end of each rigid link makes it."
        )
    missed = [
        p for p, m in real_pushed.items()
        if m["critical"] in SHARP and p in pushed and pushed[p]["critical"] is None
    ]  # fmt: skip
    if missed:
        where = listed(
            [f"{number(real_pushed[p]['F_cr'])} N in {p}, where the paper's chain goes on to "
             f"{number(pushed[p]['F_end'])} N" for p in missed]
        )  # fmt: skip
        sentences.append(f"Pushed, the beams buckle at {where}.")
    return tuple(sentences)
