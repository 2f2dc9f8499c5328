"""The page: figures, renders, findings and tables of a run as one file that needs nothing else."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from vjm.continuation.direction import Direction
from vjm.io.files import write_whole
from vjm.statics.equilibrium import TOLERANCE
from vjm_output.number_text import number
from vjm_output.off_screen import why_not_rendered
from vjm_output.plot_style import Picture, drawing_of, engine_order, engine_style, figure
from vjm_output.templating import environment
from vjm_validation.report.discovery_chapter import discovery_picture, discovery_tables
from vjm_validation.report.end_condition_figures import end_condition_picture
from vjm_validation.report.figures import posture_pictures, postures
from vjm_validation.report.findings import findings
from vjm_validation.report.first_screen import (
    TOLERANCES,
    failing,
    matrix,
    not_run_because,
    verdict,
    wrong_in_the_paper,
)
from vjm_validation.report.first_screen import counts as counts_of
from vjm_validation.report.iteration_words import USUAL
from vjm_validation.report.lumping_figures import lumping_pictures
from vjm_validation.report.parallelogram_chapter import distance_picture, parallelogram_tables
from vjm_validation.report.proofs import foot_picture, published_picture
from vjm_validation.report.renders import render_pictures
from vjm_validation.report.robot_scenes import robot_renders
from vjm_validation.report.robots_chapter import robot_pictures, robot_tables
from vjm_validation.report.verification_figures import convergence_picture, digits_table
from vjm_validation.report.words import ReportFinding
from vjm_validation.studies.iterations import LIMIT, LOOSE, NOISE, STEP_MM
from vjm_validation.studies.study_results import IterationPoint, IterationStudy, Run
from vjm_validation.verification.families import TITLES

# --- The figure of the iterations: what (13) and Newton-Raphson take along the paper's paths ----------------------

LINES = {
    "paper": ("#D55E00", "-", 1.8),
    "paper_loose": ("#D55E00", (0, (4, 1.5)), 1.3),
    "disturbed_loose": ("#CC79A7", (0, (1, 1)), 1.5),
    "newton": ("#0072B2", "-", 1.8),
}
"""Colour, line and width of each count that is drawn; the others would lie close to these."""


def iteration_picture(run: Run) -> Picture | None:
    """Iterations and contraction along the path of every posture; None without a study."""
    studies = [study for study in run.iterations if study.points]
    if not studies:
        return None
    loose, tight = number(LOOSE, 1), number(TOLERANCE, 1)
    names = {
        "paper": f"(13) to {tight}",
        "paper_loose": f"(13) to {loose}",
        "disturbed_loose": f"(13) to {loose}, start disturbed",
        "newton": f"Newton-Raphson to {tight}",
    }
    columns = len(studies)
    with figure(4.3, columns, rows=2, sharey=True) as (fig, axes):
        for study, counts, rates in zip(studies, axes[:columns], axes[columns:], strict=True):
            _counts(counts, study, names)
            _rates(rates, study)
            counts.set_title(f"Posture {study.posture}")
            for ax in (counts, rates):
                if study.d_cr is not None:
                    ax.axvline(study.d_cr, color="black", lw=0.8, ls=":")
        axes[0].set_ylabel("iterations")
        axes[columns].set_ylabel("contraction of (13)")
        fig.supxlabel(f"displacement in {studies[0].direction}, mm", fontsize=8.5)
        handles = {str(line.get_label()): line for ax in axes for line in ax.get_lines()}
        shown = [line for label, line in handles.items() if not label.startswith("_")]
        fig.legend(handles=shown, loc="outside upper center", ncols=4, handlelength=2.6)
        content = drawing_of(fig)
    return Picture(
        "iterations",
        content,
        "How many iterations the paper's (13) and Newton-Raphson take",
        f"The paper's own model, each equilibrium sought from its neighbour {STEP_MM:g} mm before it, to a scaled "
        f"residual of {tight} (the suite's) or {loose}. Disturbed: with random noise of {NOISE:g} coordinate units "
        f"on every joint, the same for every start. A cross: not found within {LIMIT} iterations. Grey band: the "
        f"paper's {USUAL[0]} to {USUAL[1]}. Below: the factor by which (13) shrinks a small error, computed from "
        "its derivative at the equilibrium, and F/F_cr, the prediction before a bifurcation. Dotted: the critical "
        "point.",
    )


def _counts(ax: Axes, study: IterationStudy, names: dict[str, str]) -> None:
    ax.axhspan(*USUAL, color="#dddddd", zorder=0)
    top = 1.6 * LIMIT
    for column, (colour, line, width) in LINES.items():
        for i, run in enumerate(_branches(study)):
            s = [point.s for point in run]
            found = [getattr(point, column) for point in run]
            ax.plot(
                s, [np.nan if n is None else n for n in found], color=colour, ls=line, lw=width,
                label=names[column] if i == 0 else "_",
            )  # fmt: skip
            failed = [at for at, n in zip(s, found, strict=True) if n is None]
            ax.plot(failed, np.full(len(failed), LIMIT), "x", color=colour, ms=5.0, zorder=5)
    ax.set(xscale="log", yscale="log", ylim=(0.8, top))
    ticks = [n for n in (1, 2, 5, 10, 20, 50, 100, 200) if n <= top]
    ax.set_yticks(ticks, [str(n) for n in ticks])
    ax.minorticks_off()


def _rates(ax: Axes, study: IterationStudy) -> None:
    for i, run in enumerate(_branches(study)):
        ax.plot(
            [point.s for point in run], [point.contraction for point in run], color="black", lw=1.6,
            label="contraction" if i == 0 else "_",
        )  # fmt: skip
    known = [(point.s, point.predicted) for point in study.points if point.predicted is not None]
    if known:
        ax.plot(
            *np.array(known).T, color="#E69F00", ls="", marker="o", ms=3.2, mfc="none", mew=0.9, label="$F/F_{cr}$"
        )
    ax.axhline(1.0, color="#999999", lw=0.8)
    ax.set(xscale="log", ylim=(0.0, 1.08))
    low, high = study.points[0].s, study.points[-1].s
    ticks = [m * 10.0**e for e in range(-6, 4) for m in (1, 3) if low <= m * 10.0**e <= high] or [low, high]
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()


def _branches(study: IterationStudy) -> list[Sequence[IterationPoint]]:
    """The points before and behind a bifurcation: no line joins them."""
    before = [point for point in study.points if point.predicted is not None]
    behind = study.points[len(before) :]
    return [run for run in (before, behind) if run]


# ------------------------------------------------------------------------------------------------------------------


# --- The findings of a run as Markdown beside its figures: short enough to be kept in a repository ----------------


def findings_markdown(run: Run, found: Sequence[ReportFinding], pictures: Sequence[Picture]) -> str:
    """Findings with the pictures that prove them, which lie in ``figures`` beside the text.

    Args:
        run: what was computed.
        found: its findings.
        pictures: shown under the findings.
    """
    lines = [f"# {run.chain.title}", "", f"Written by `{run.summary.get('command')}`.", ""]
    for finding in found:
        lines += [f"## {finding.title}", "", *(f"- {sentence}" for sentence in finding.sentences), ""]
    for picture in pictures:
        lines += [
            f"![{picture.title}](figures/{picture.name}.png)",
            "",
            f"**{picture.title}** {picture.caption}",
            "",
        ]
    versions = ", ".join(f"{name} {version}" for name, version in run.summary.get("versions", {}).items())
    return "\n".join([*lines, versions, ""])


# ------------------------------------------------------------------------------------------------------------------


METRICS = ("K0", "K1", "critical", "F_cr", "d_cr", "K2", "F_end", "d_end", "K3")
"""Columns of the tables of ``summary.json``'s ``chain``."""
CAMPAIGN = pathlib.PurePosixPath("../blind/blind.html")
"""Page of a blind campaign (docs/hidden-effects.md), where one was made beside the report."""


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
    foot, table2, counts = foot_picture(run), published_picture(run), iteration_picture(run)
    supports = end_condition_picture(run)
    bars = distance_picture(run.parallelogram) if run.parallelogram is not None else None
    machines = robot_pictures(run.robots) if run.robots is not None else []
    own = discovery_picture(run.discovery) if run.discovery is not None else None
    convergence = convergence_picture(run)
    curves = {posture: posture_pictures(run, posture) for posture in postures(run)}
    renders, no_renders = _renders(run)
    proof = [
        picture
        for picture in (*proofs, foot, supports, table2, bars, *machines, own, counts, convergence)
        if picture
    ]
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
    found = findings(run, no_renders)
    checked = counts_of(run.summary)
    not_run, not_asked = not_run_because(run.summary)
    tone, words = verdict(checked, run.summary.get("notes", ()))
    chapters = _chapters(sections, {
        "lumping": proofs, "foot": foot, "end-conditions": supports, "table2": run.summary.get("published"),
        "parallelogram": bars, "robots": machines, "discovery": own, "iterations": counts,
        "verification": digits_table(run) or convergence or run.summary.get("triangulation"), "checks": True,
    })  # fmt: skip
    write_whole(out / "findings.md", findings_markdown(run, found, proof))
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
        triangulation=run.summary.get("triangulation", ()),
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
        findings=found,
        proofs=proofs,
        foot=foot,
        supports=supports,
        bars=bars,
        bar_tables=parallelogram_tables(run.parallelogram) if run.parallelogram is not None else (),
        machines=machines,
        machine_tables=robot_tables(run.robots.rows) if run.robots is not None else (),
        own=own,
        own_tables=discovery_tables(run.discovery.rows) if run.discovery is not None else (),
        own_page=run.discovery.page if run.discovery is not None else "",
        blind_page=CAMPAIGN.as_posix() if (out / CAMPAIGN).is_file() else "",
        table2=table2,
        counts=counts,
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
    found = {name: name for name, content in present.items() if content}
    if sections:
        found["postures"] = f"posture-{sections[0].posture}"
    return found


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
