"""The page: figures, renders, findings and tables of a run as one file that needs nothing else; its PDF."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from vjm.io.files import write_whole
from vjm.model.load_case import Direction
from vjm_fea.opensees.beams import MISSING
from vjm_output.number_text import DASH, listed, number, percent
from vjm_output.optional_drawing import why_not_rendered
from vjm_output.plots import FE, PAPER, Picture, engine_order, engine_style
from vjm_output.templating import environment
from vjm_validation.acceptance import CURVE_AGREEMENT, LOAD_AGREEMENT, MODEL_ROW
from vjm_validation.report.chapter_figures import (
    convergence_picture,
    digits_table,
    end_condition_picture,
    foot_picture,
    lumping_pictures,
    published_picture,
)
from vjm_validation.report.chapters import (
    discovery_picture,
    discovery_tables,
    robot_pictures,
    robot_tables,
)
from vjm_validation.report.figures import posture_paths, posture_pictures, postures, worst_difference
from vjm_validation.report.findings import findings
from vjm_validation.report.scenes import render_pictures, robot_renders
from vjm_validation.report.words import SHARP, engine_metrics, findings_markdown
from vjm_validation.studies.chain import Run
from vjm_validation.verification.runner import TITLES

# --- The first screen: passed, failed and not run, counted; engines by postures; what is wrong in the paper -------

SHOWN = 4
"""Reasons and failed checks that the first screen names."""


@dataclass(frozen=True)
class Count:
    """How many checks of one kind passed, failed, and were meant to run and did not; the chapter has them."""

    name: str
    chapter: str
    passed: int
    failed: int
    not_run: int


@dataclass(frozen=True)
class Failing:
    """One check that does not hold, the chapter where it stands, and what was asked for and found."""

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
    )
    check_counts = []
    for name, chapter, key in names:
        rows = [row for row in summary.get(key, ()) if row["passed"] is not None or not _expected(_why(row))]
        if rows:
            check_counts.append(
                Count(name, chapter, *(sum(row["passed"] is v for row in rows) for v in (True, False, None)))
            )
    return check_counts


def not_run_because(summary: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """Why checks were not run, and how many by each reason, the commonest first.

    Returns:
        The reasons of those that were meant to run, and of those that were not: an optional engine is not
        installed, or an engine does not have what a case asks for.
    """
    meant: dict[str, int] = {}
    expected: dict[str, int] = {}
    for key in ("acceptance", "verification"):
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
    failures = [
        Failing(row["name"], "checks", f"{number(row['value'])}; required: {row['requirement']}")
        for row in summary.get("acceptance", ()) if row["passed"] is False
    ] + [
        Failing(
            row["name"], "checks",
            f"{row['quantity']} is {number(row['value'])} and should be {number(row['reference'])}; "
            f"error {number(row['error'], 2)}, tolerance {number(row['tolerance'], 2)}",
        )
        for row in summary.get("verification", ()) if row["passed"] is False
    ]  # fmt: skip
    more = len(failures) - SHOWN
    others = f"{more} other check{'s do' if more > 1 else ' does'} not hold"
    return failures[:SHOWN] + ([Failing("More", "checks", others)] if more > 0 else [])


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


# --- The page: figures, renders, findings and tables of a run as one file that needs nothing else -----------------

# ------------------------------------------------------------------------------------------------------------------


METRICS = ("K0", "K1", "critical", "F_cr", "d_cr", "K2", "F_end", "d_end", "K3")
"""Columns of the tables of ``summary.json``'s ``chain``."""


@dataclass(frozen=True)
class PostureSection:
    """All that the page shows of one posture.

    Attributes:
        posture: label.
        figures: of its curves.
        renders: of its shapes.
        tables: rows of metrics by direction.
    """

    posture: str
    figures: list[Picture]
    renders: list[Picture]
    tables: dict[str, list[dict[str, Any]]]


def write_report(run: Run, out: pathlib.Path) -> pathlib.Path:
    """Write ``index.html``, ``findings.md``, ``figures/*.png`` and ``renders/*.png`` of a run.

    Every file is written whole or not at all. Where the machine cannot render off the screen the report is
    complete but for the renders, and says so.

    Args:
        run: what was computed.
        out: folder of the run; made where it is missing.

    Returns:
        Path of ``index.html``.
    """
    proofs = lumping_pictures(run)
    foot, table2 = foot_picture(run), published_picture(run)
    supports = end_condition_picture(run)
    machines = robot_pictures(run.robots) if run.robots is not None else []
    own = discovery_picture(run.discovery) if run.discovery is not None else None
    convergence = convergence_picture(run)
    curves = {posture: posture_pictures(run, posture) for posture in postures(run)}
    renders, no_renders = _renders(run)
    proof = [picture for picture in (*proofs, foot, supports, table2, *machines, own, convergence) if picture]
    figures = [*proof, *chain.from_iterable(curves.values())]
    for folder, pictures in (("figures", figures), ("renders", renders)):
        for picture in pictures:
            write_whole(out / folder / f"{picture.name}.png", picture.content)
    machines += [picture for picture in renders if picture.name.startswith("robot_")]
    chains = [picture for picture in renders if picture not in machines]
    key_render = next(
        (p for ending in ("_tension", "_compression") for p in chains if p.name.endswith(ending)), None
    )
    key_figure = next(iter(next(iter(curves.values()), [])), None)
    sections = [
        PostureSection(
            posture,
            [picture for picture in pictures if picture is not key_figure],
            [p for p in renders if p.name.startswith(f"{posture}_") and p is not key_render],
            _metric_tables(run, posture),
        )
        for posture, pictures in curves.items()
    ]
    report_findings = findings(run, no_renders)
    checked = counts(run.summary)
    not_run, not_asked = not_run_because(run.summary)
    tone, words = verdict(checked, run.summary.get("notes", ()))
    chapters = _chapters(sections, {
        "lumping": proofs, "foot": foot, "end-conditions": supports, "table2": run.summary.get("published"),
        "robots": machines, "discovery": own,
        "verification": digits_table(run) or convergence, "checks": True,
    })  # fmt: skip
    versions = ", ".join(f"{name} {version}" for name, version in run.summary.get("versions", {}).items())
    text = findings_markdown(
        run.chain.title, run.summary.get("command"), report_findings, {"figures": proof}, versions
    )
    write_whole(out / "findings.md", text)
    page = environment("vjm_validation.report").get_template("index.html.j2").render(
        chain=run.chain,
        verdict_tone=tone,
        verdict_words=words,
        checked=checked,
        failing=failing(run.summary),
        not_run=not_run,
        not_asked=not_asked,
        wrong=wrong_in_the_paper(run),
        matrix=matrix(run),
        tolerances=TOLERANCES,
        key_figure=key_figure,
        key_render=key_render,
        chapters=chapters,
        published=run.summary.get("published", ()),
        acceptance=run.summary.get("acceptance", ()),
        verification=run.summary.get("verification", ()),
        digits=digits_table(run),
        convergence=convergence,
        families=TITLES,
        command=run.summary.get("command"),
        records={
            title: run.summary.get(key)
            for title, key in (
                ("Timings, s", "timings"), ("Versions", "versions"), ("Made of", "made_of"), ("Hashes", "hashes"),
            )
        },
        findings=report_findings,
        proofs=proofs,
        foot=foot,
        supports=supports,
        machines=machines,
        machine_tables=robot_tables(run.robots.rows) if run.robots is not None else (),
        own=own,
        own_tables=discovery_tables(run.discovery.rows) if run.discovery is not None else (),
        own_page=run.discovery.page if run.discovery is not None else "",
        table2=table2,
        sections=sections,
        metrics=METRICS,
        engines=_engine_rows(run),
        no_renders=no_renders,
    )  # fmt: skip
    index = out / "index.html"
    write_whole(index, page.encode())
    return index


def _chapters(sections: list[PostureSection], present: Mapping[str, Any]) -> dict[str, str]:
    """Anchors of the chapters that the page has, by the name that findings know them by."""
    anchors = {name: name for name, content in present.items() if content}
    if sections:
        anchors["postures"] = f"posture-{sections[0].posture}"
    return anchors


def _renders(run: Run) -> tuple[list[Picture], str]:
    """The renders, or why there are none."""
    reason = why_not_rendered()
    if reason:
        return [], reason
    try:
        robots = robot_renders(run.robots) if run.robots is not None else []
        return [*render_pictures(run), *robots], ""
    except (RuntimeError, OSError, ImportError) as failure:
        return [], f"{type(failure).__name__}: {failure}"


def _metric_tables(run: Run, posture: str) -> dict[str, list[dict[str, Any]]]:
    by_direction: Mapping[str, Any] = run.summary.get("chain", {}).get(posture, {})
    return {
        str(direction): [{"engine": label, **rows[label]} for label in sorted(rows, key=engine_order)]
        for direction in Direction
        if (rows := by_direction.get(str(direction)))
    }


def _engine_rows(run: Run) -> list[dict[str, Any]]:
    """What each engine is and what its paths cost."""
    rows = []
    for label in sorted({key.engine for key in run.paths}, key=engine_order):
        paths = [path for key, path in run.paths.items() if key.engine == label]
        points = [point for path in paths for point in path.points]
        residuals = [point.residual for point in points if np.isfinite(point.residual)]
        rows.append(
            {
                "engine": label,
                "title": engine_style(label).title,
                "colour": engine_style(label).colour,
                "paths": len(paths),
                "equilibria": len(points),
                "iterations": sum(point.iterations for point in points),
                "residual": max(residuals, default=None),
                "seconds": sum(path.seconds for path in paths),
            }
        )
    return rows


# --- A page as PDF, printed by Chromium where that is installed ---------------------------------------------------

NAMES = ("chromium", "chromium-browser", "google-chrome")
SECONDS = 120.0
"""After which Chromium is given up."""


def chromium() -> str:
    """The browser's program, empty where there is none."""
    return next((program for name in NAMES if (program := shutil.which(name))), "")


def print_page(page: Path, pdf: Path) -> None:
    """Print a page by its own style for paper; the file is written whole or not at all.

    Raises:
        OSError: there is no Chromium, or it did not print.
    """
    program = chromium()
    if not program:
        raise OSError("--pdf: no Chromium is installed: install it, or print the page from a browser")
    with tempfile.TemporaryDirectory(dir=pdf.parent) as folder:
        # what Chromium writes half is never under the file's own name
        temporary = Path(folder) / "page.pdf"
        arguments = ["--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer", "--no-first-run"]
        arguments += [f"--user-data-dir={folder}/profile", f"--print-to-pdf={temporary}", page.resolve().as_uri()]
        try:
            done = subprocess.run(
                [program, *arguments], capture_output=True, text=True, timeout=SECONDS, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise OSError(f"--pdf: Chromium did not print {page} within {SECONDS:g} s") from error
        if not temporary.is_file():
            last = done.stderr.strip().splitlines()[-1:] or ["no message"]
            raise OSError(f"--pdf: Chromium did not print {page}: {last[0][:200]}")
        os.replace(temporary, pdf)
