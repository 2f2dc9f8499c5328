"""The chapter on verification: relative errors, convergence, and three engines on the paper's chain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from vjm_output.number_text import listed, number
from vjm_output.plot_style import Picture, drawing_of, figure
from vjm_validation.report.words import ReportFinding, Tone
from vjm_validation.studies.study_results import Run
from vjm_validation.verification.families import MESHED, TITLES
from vjm_validation.verification.invariance import GROUP as INVARIANCE
from vjm_validation.verification.schema import GROUPS

COLOURS = {
    "linear": "#999999", "lumped": "#999999", "bending": "#0072B2", "columns": "#D55E00",
    "post-buckling": "#009E73", "arches": "#CC79A7", "space": "#E69F00", "paper": "#000000",
}  # fmt: skip
"""Of the groups of cases."""
LEAST = 1e-15
"""Errors below are drawn here."""
GUIDES = {"vjm": (2, 4, 10), "exudyn": (2, 4), "opensees": (2, 4)}
"""Orders whose slopes are drawn for comparison, by engine."""

Row = Mapping[str, Any]


def _rows(run: Run) -> list[Row]:
    """Rows of cases; those of runs that knew no cases have no name of one."""
    return [row for row in run.summary.get("verification", ()) if row.get("case")]


def digits_table(run: Run) -> list[dict[str, Any]]:
    """One row a case: fewest digits that agree and range of orders, by engine; the published figures apart."""
    found: dict[str, dict[str, Any]] = {}
    for row in _rows(run):
        if row["group"] == INVARIANCE or row["engine"] not in TITLES:
            continue
        case = found.setdefault(row["case"], {"case": row["case"], "group": row["group"], "engines": {}})
        cell = case["engines"].setdefault(row["engine"], {"exact": [], "other": [], "orders": [], "theory": set()})
        cell["not_run"] = row["not_run"]
        cell["failed"] = cell.get("failed", False) or row["passed"] is False
        if row["digits"] is not None:
            cell["exact" if row["kind"] == "exact" else "other"].append(row["digits"])
        if row["kind"] == "exact" and row["order"] is not None:
            cell["orders"].append(row["order"])
            cell["theory"].add(row["theoretical_order"])
    order = list(GROUPS)
    rows = sorted(found.values(), key=lambda case: (order.index(case["group"]), case["case"]))
    return [
        {"case": case["case"], "group": GROUPS[case["group"]]}
        | {family: _cell(case["engines"].get(family)) for family in TITLES}
        for case in rows
    ]


def _cell(cell: Mapping[str, Any] | None) -> dict[str, Any]:
    """Digits, order and state of one case on one engine, as words."""
    if cell is None:
        return {"digits": "", "order": "", "failed": False}
    if not cell["exact"] and not cell["other"]:
        return {"digits": "gave up" if cell["failed"] else "not run", "order": "", "failed": cell["failed"]}
    digits = number(min(cell["exact"]), 2) if cell["exact"] else f"({number(min(cell['other']), 2)})"
    low, high = (f"{pick(cell['orders']):.1f}" if cell["orders"] else "" for pick in (min, max))
    theory = listed([f"{order:g}" for order in sorted(cell["theory"] - {None})])
    order = f"{low}" if low == high else f"{low}–{high}"
    return {
        "digits": digits,
        "order": f"{order} ({theory})" if order and theory else order,
        "failed": cell["failed"],
    }


def convergence_picture(run: Run) -> Picture | None:
    """Error against mesh of every case with an exact answer, one panel an engine; None without cases."""
    rows = [row for row in _rows(run) if row["kind"] == "exact" and row["group"] != INVARIANCE]
    families = [family for family in MESHED if any(row["engine"] == family and row["values"] for row in rows)]
    if not families:
        return None
    with figure(4.2, len(families), sharey=True) as (fig, axes):
        for ax, family in zip(axes, families, strict=True):
            _errors(ax, family, [row for row in rows if row["engine"] == family])
        axes[0].set_ylabel("relative error")
        shown = [group for group in GROUPS if any(row["group"] == group for row in rows)]
        handles = [Line2D([], [], color=COLOURS[group], label=GROUPS[group]) for group in shown]
        handles.append(Line2D([], [], color="black", ls=":", lw=0.8, label="slopes of order 2, 4 and 10"))
        fig.legend(handles=handles, loc="outside upper center", ncols=4)
        content = drawing_of(fig)
    return Picture(
        "verification",
        content,
        "How fast each engine comes to the exact answer",
        "Error of every quantity with an exact reference against the number of springs or elements of a beam or an "
        "arc. Springs find critical loads of columns with the tenth order, what bends in a plane without shear "
        "with the fourth, and with shear or in space the second. Below 1e-8 errors tell where events are located.",
    )


def _errors(ax: Axes, family: str, rows: Sequence[Row]) -> None:
    top = 1e-2
    for row in rows:
        pairs = [(n, max(e, LEAST)) for n, e in zip(row["meshes"], row["errors"], strict=False) if e is not None]
        if pairs:
            ax.plot(*zip(*pairs, strict=True), marker=".", ms=3, lw=0.8, color=COLOURS[row["group"]], alpha=0.75)
    n = np.array([4.0, 16.0])
    for order in GUIDES[family]:
        ax.plot(n, top * (n / n[0]) ** -float(order), color="black", ls=":", lw=0.8)
    ax.set(xscale="log", yscale="log", xlabel="springs" if family == "vjm" else "elements", title=family)
    ax.set_xticks([2, 4, 8, 16, 32, 64], ["2", "4", "8", "16", "32", "64"], minor=False)
    ax.minorticks_off()
    ax.set_ylim(LEAST, 1.0)


def verified(run: Run) -> ReportFinding | None:
    """What verification found, in words."""
    rows = _rows(run)
    if not rows:
        return None
    ran = [row for row in rows if row["passed"] is not None]
    cases = {row["case"] for row in ran if row["group"] in GROUPS}
    failed = [row for row in ran if not row["passed"]]
    sentences = [
        f"{len(ran)} answers to {len(cases)} cases, {len(rows) - len(ran)} not given because an engine is not "
        f"installed or cannot express the case; {len(failed)} miss."
    ]
    for family in MESHED:
        worst = [
            row["error"] for row in ran if row["engine"] == family and row["kind"] == "exact" and row["meshes"]
        ]
        given = [error for error in worst if error is not None]
        if given:
            sentences.append(f"{family}: largest error on the finest mesh {number(max(given), 2)}.")
    pairs = [row for row in run.summary.get("triangulation", ()) if row["difference"] is not None]
    if pairs:
        critical = [row["difference"] for row in pairs if row["quantity"].startswith("critical")]
        curves = [row["difference"] for row in pairs if row["quantity"].startswith("force along")]
        covered = sum(1 for row in pairs if row["within"])
        words = [f"critical forces {number(max(critical), 2)}"] if critical else []
        words += [f"whole curves {number(max(curves), 2)}"] if curves else []
        sentences.append(
            f"Engines on the paper's own chain differ by at most: {listed(words)}. In {covered} of {len(pairs)} "
            "comparisons that is within the sum of their own error estimates."
        )
    if failed:
        names = listed(sorted({row["name"] for row in failed}))
        return ReportFinding(
            Tone.FAILED, f"Verification: {len(failed)} answers miss", (*sentences, f"Look at {names}.")
        )
    return ReportFinding(Tone.AGREES, "Every solver meets every case with a known answer", tuple(sentences))
