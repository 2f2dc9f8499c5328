"""The first screen: passed, failed and not run, counted; engines by postures; what is wrong in the paper."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from vjm.continuation.direction import Direction
from vjm_fea.opensees.backend import MISSING
from vjm_output.number_text import DASH, listed, number, percent
from vjm_output.plot_style import FE, PAPER, engine_order
from vjm_validation.acceptance import CURVE_AGREEMENT, LOAD_AGREEMENT, MODEL_ROW
from vjm_validation.report.figures import posture_paths, postures, worst_difference
from vjm_validation.report.words import SHARP, engine_metrics
from vjm_validation.studies.study_results import Run

SHOWN = 4
"""Reasons and failed checks that the first screen names."""


@dataclass(frozen=True)
class Count:
    """How many checks of one kind passed, failed, and were not run.

    Attributes:
        name: of the kind.
        chapter: where they stand.
        passed: how many.
        failed: how many.
        not_run: how many that were meant to run.
    """

    name: str
    chapter: str
    passed: int
    failed: int
    not_run: int


@dataclass(frozen=True)
class Failing:
    """One check that does not hold.

    Attributes:
        name: of the check.
        chapter: where it stands.
        words: what was asked for and what was found.
    """

    name: str
    chapter: str
    words: str


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
    """Checks by kind, without those that were not meant to run; what was not run is neither passed nor failed."""
    names = (
        ("requirements of acceptance", "checks", "acceptance"),
        ("known answers", "verification", "verification"),
        ("pairs of engines on the paper's chain", "verification", "triangulation"),
    )
    found = []
    for name, chapter, key in names:
        rows = [row for row in summary.get(key, ()) if row["passed"] is not None or not _expected(_why(row))]
        if rows:
            found.append(
                Count(name, chapter, *(sum(row["passed"] is v for row in rows) for v in (True, False, None)))
            )
    return found


def not_run_because(summary: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """Why checks were not run, and how many by each reason, the commonest first.

    Returns:
        The reasons of those that were meant to run, and of those that were not: an optional engine is not
        installed, or an engine does not have what a case asks for.
    """
    meant: dict[str, int] = {}
    expected: dict[str, int] = {}
    for key in ("acceptance", "verification", "triangulation"):
        for row in summary.get(key, ()):
            if row["passed"] is None:
                why = _why(row)
                reasons = expected if _expected(why) else meant
                reasons[why] = reasons.get(why, 0) + 1
    return _listed(meant), _listed(expected)


def _why(row: Mapping[str, Any]) -> str:
    """Why a check was not run."""
    why = str(row.get("not_run") or row.get("value") or "no reason given")
    # the same reason is told with and without the engine in front of it, and once for each engine of a pair
    for begin in ("not run: ", "refused: "):
        why = why.replace(begin, "")
    if MISSING in why:
        return MISSING
    engine = row.get("engine")
    return f"{engine}: {why}" if engine and not why.startswith(f"{engine}: ") else why


def _expected(why: str) -> bool:
    """Whether the reason is no fault of the installation: it lacks nothing, or only the optional engine."""
    return why == MISSING or "pip install" not in why


def _listed(reasons: Mapping[str, int]) -> list[str]:
    ordered = sorted(reasons.items(), key=lambda item: -item[1])
    return [f"{why} ({count} {'check' if count == 1 else 'checks'})" for why, count in ordered[:SHOWN]]


def failing(summary: Mapping[str, Any]) -> list[Failing]:
    """The first checks that do not hold, and how many more there are."""
    found = [
        Failing(row["name"], "checks", f"{number(row['value'])}; required: {row['requirement']}")
        for row in summary.get("acceptance", ()) if row["passed"] is False
    ] + [
        Failing(
            row["name"], "checks",
            f"{row['quantity']} is {number(row['value'])} and should be {number(row['reference'])}; "
            f"error {number(row['error'], 2)}, tolerance {number(row['tolerance'], 2)}",
        )
        for row in summary.get("verification", ()) if row["passed"] is False
    ] + [
        Failing(
            f"{row['posture']}, {row['direction']}", "verification",
            f"{row['quantity']} of {' and '.join(row['engines'])} differs by {number(row['difference'], 2)}; "
            f"tolerance {number(row['tolerance'], 2)}",
        )
        for row in summary.get("triangulation", ()) if row["passed"] is False
    ]  # fmt: skip
    more = len(found) - SHOWN
    others = f"{more} other check{'s do' if more > 1 else ' does'} not hold"
    return found[:SHOWN] + ([Failing("More", "checks", others)] if more > 0 else [])


def verdict(rows: list[Count], notes: Iterable[str] = ()) -> tuple[str, str]:
    """Tone and sentence of the whole run."""
    passed, failed, not_run = (sum(getattr(row, name) for row in rows) for name in ("passed", "failed", "not_run"))
    if not rows:
        return "note", "Nothing was checked in this run"
    if failed:
        verb = "does" if failed == 1 else "do"
        return "failed", f"FAILED: {failed} of {passed + failed} checks that were run {verb} not hold"
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
    return Cell(critical, percent(apart).replace("less than ", "<\u2009"), "yes" if within else "no")


TOLERANCES = f"{percent(LOAD_AGREEMENT)} of the critical force and {percent(CURVE_AGREEMENT)} of the curve"
"""What the matrix colours by."""


def wrong_in_the_paper(run: Run) -> tuple[str, ...]:
    """Two sentences, or fewer where the run does not show it; none where the model file is doubtful."""
    rows = run.summary.get("acceptance", ())
    if any(row["name"] == MODEL_ROW and row["passed"] is False for row in rows):
        return ()
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
            f"The paper's chain buckles when it is pulled ({where}); the same parts as beams do not. The cause is "
            "the one translational spring at the end of each rigid link."
        )
    missed = [
        p for p, m in real_pushed.items()
        if m["critical"] in SHARP and p in pushed and pushed[p]["critical"] is None
    ]  # fmt: skip
    if missed:
        where = listed([f"{number(real_pushed[p]['F_cr'])} N in {p}" for p in missed])
        on = listed([f"{number(pushed[p]['F_end'])} N" for p in missed])
        sentences.append(f"Pushed, the beams buckle at {where}; the paper's chain does not, and goes on to {on}.")
    return tuple(sentences)
