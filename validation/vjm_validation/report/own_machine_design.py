"""The design chapters of the report on a user's own machine: shares, frequencies, what to stiffen, a map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.rotations import Array
from vjm_output.number_text import number, percent
from vjm_output.plot_style import Picture, drawing_of, figure
from vjm_updating.maps.quantity import OK, SHOWN, TITLES, MapQuantity
from vjm_validation.design_documents import SENSITIVITY_HEADER, SOUGHT, sensitivity_cells, sensitivity_lines
from vjm_validation.report.design_figures import modes_picture, shares_picture, tornado_picture
from vjm_validation.report.tables import ReportTable
from vjm_validation.report.words import ReportFinding, Tone
from vjm_validation.studies.own_machine_design import SMALL, TRIED
from vjm_validation.studies.own_machine_request import OwnMachine

COLUMN = SHOWN[MapQuantity.STIFFNESS]
"""Of a map's values that is drawn: the smallest stiffness against a force."""


# --- words --------------------------------------------------------------------------------------------


def design_findings(found: OwnMachine) -> list[ReportFinding]:
    """What the chapters say in words."""
    parts = (_contributors(found), _slowest(found), _to_stiffen(found))
    return [finding for finding in parts if finding is not None]


def _contributors(found: OwnMachine) -> ReportFinding | None:
    lines = []
    for row in found.shares:
        ranked = sorted((p for p in row.parts if p.energy), key=lambda p: -(p.energy or 0.0))[:3]
        if ranked:
            said = ", ".join(f"{p.part} ({p.kind}) {percent(p.energy or 0.0)}" for p in ranked)
            lines.append(f"Posture {row.posture} along {found.shares_along[row.posture]}: {said}.")
    if not lines:
        return None
    lines.append(
        f"Shares in the deflection under {number(SMALL * found.size)} N along the direction of least stiffness in "
        "each posture, without weight."
    )
    return ReportFinding(Tone.NOTE, "What contributes most to the deflection", tuple(lines))


def _slowest(found: OwnMachine) -> ReportFinding | None:
    if not found.modes:
        return None
    first = min(found.modes, key=lambda row: row.frequency_Hz)
    lines = [
        f"Posture {row.posture}: {number(row.frequency_Hz)} Hz, moving most at {row.largest_at}."
        for row in found.modes
        if row.mode == 1
    ]
    growing = [row for row in found.modes if row.growth_per_s > 0.0]
    lines += [f"Posture {row.posture}: motion {row.mode} grows by {number(row.growth_per_s)}/s." for row in growing]
    title = f"The lowest natural frequency is {number(first.frequency_Hz)} Hz, posture {first.posture}"
    return ReportFinding(Tone.CAUSE if growing else Tone.NOTE, title, tuple(lines))


def _to_stiffen(found: OwnMachine) -> ReportFinding | None:
    document, row = found.sensitivity, found.stiffened
    if document is None or row is None:
        return None
    title = f"What to change to halve the deflection in posture {row.posture} along {document.along}"
    changes = [each for each in document.parameters if each.factor is not None][:SOUGHT]
    lines = sensitivity_lines(document.model_copy(update={"parameters": changes}))
    if not changes:
        lines.append(f"None of the {TRIED} numbers that matter most does it alone, up to ten times what it is.")
    about = "Twice the stiffness is half the deflection. Each change is made alone, all other numbers stay."
    return ReportFinding(Tone.NOTE, title, (*lines, about))


# --- pictures -----------------------------------------------------------------------------------------


def design_pictures(found: OwnMachine) -> list[Picture]:
    """Bars of the shares, the shapes of the lowest motions, and the tornado of the sensitivities."""
    pictures = []
    if any(part.energy for row in found.shares for part in row.parts):
        pictures.append(shares_picture(found.drawn.name, found.shares))
    if found.modes:
        first = min(found.modes, key=lambda row: row.frequency_Hz)
        pictures.append(modes_picture(found.shapes[first.posture]))
    if found.sensitivity is not None and any(row.relative for row in found.sensitivity.parameters):
        pictures.append(tornado_picture(found.sensitivity))
    return pictures


def map_picture(found: OwnMachine) -> Picture | None:
    """The smallest stiffness over the map's axes: a line, or levels of the third axis side by side."""
    if found.map is None:
        return None
    axes = {name: np.array(values) for name, values in found.map_axes.items() if len(values) > 1}
    values = np.array([_number(row[COLUMN]) for row in found.map.values])
    if not axes or not np.isfinite(values).any():
        return None
    title, names = TITLES[MapQuantity.STIFFNESS], list(axes)
    cube = values.reshape([len(axis) for axis in axes.values()])
    tool = set(names) <= set("xyz")
    labels = [f"{name}, mm" if tool else f"{name}, mm or rad" for name in names]
    if len(names) == 1:
        with figure(2.9, 1) as (fig, (ax,)):
            ax.plot(axes[names[0]], cube, "o-", ms=3, color="#0072B2")
            ax.set(xlabel=labels[0], ylabel=title)
            drawing = drawing_of(fig)
    else:
        levels = [cube] if len(names) == 2 else [cube[:, :, k] for k in range(cube.shape[2])]
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        with figure(2.9, len(levels), sharey=True) as (fig, panels):
            for k, (ax, level) in enumerate(zip(panels, levels, strict=True)):
                image = ax.pcolormesh(
                    axes[names[0]], axes[names[1]], level.T, shading="nearest", vmin=low, vmax=high, cmap="viridis"
                )
                ax.set(xlabel=labels[0])
                ax.locator_params(axis="x", nbins=4)
                if len(names) == 3:
                    ax.set_title(f"{names[2]} = {axes[names[2]][k]:.4g} mm")
                ax.grid(False)
            panels[0].set_ylabel(labels[1])
            fig.colorbar(image, ax=list(panels), label=title, shrink=0.85)
            drawing = drawing_of(fig)
    solved = sum(status == OK for status in found.map.status)
    missing = len(found.map.status) - solved
    white = f" {missing} of {len(found.map.status)} points have no answer and are white." if missing else ""
    where = "the end's place in the world" if tool else "the drives"
    return Picture(
        "map", drawing, f"{found.drawn.name}: stiffness about posture {found.map_posture}",
        f"The smallest stiffness against a force on the end in any direction, over {where}.{white}",
    )  # fmt: skip


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


# --- tables -------------------------------------------------------------------------------------------


def design_tables(found: OwnMachine) -> list[ReportTable]:
    """Shares, frequencies and sensitivities as the page shows them."""
    tables = []
    shown = [row for row in found.shares if any(part.energy for part in row.parts)]
    if shown:
        names = list(dict.fromkeys((part.part, part.kind) for row in shown for part in row.parts))
        cells = {(row.posture, p.part, p.kind): p.energy or 0.0 for row in shown for p in row.parts}
        rows = [
            (part, kind, *(percent(cells.get((row.posture, part, kind), 0.0), 3) for row in shown))
            for part, kind in names
        ]
        header = ("Part", "Kind", *(f"{row.posture}, {found.shares_along[row.posture]}" for row in shown))
        tables.append(ReportTable("Shares in the deflection along the force", header, tuple(rows), 2))
    if found.modes:
        rows = [
            (row.posture, str(row.mode), number(row.frequency_Hz), number(row.growth_per_s), row.largest_at)
            for row in found.modes
        ]
        header = ("Posture", "Motion", "Frequency, Hz", "Growth, 1/s", "Moves most at")
        tables.append(ReportTable("Natural frequencies", header, tuple(rows), 1))
    if found.sensitivity is not None:
        caption = f"Sensitivity of the {found.sensitivity.quantity} along {found.sensitivity.along}"
        tables.append(ReportTable(caption, SENSITIVITY_HEADER, tuple(sensitivity_cells(found.sensitivity)), 1))
    return tables


def map_table(found: OwnMachine) -> list[ReportTable]:
    """The range of the map's values."""
    if found.map is None:
        return []
    values = np.array([[_number(v) for v in row] for row in found.map.values])
    rows = tuple((name, *_range(values[:, k])) for k, name in enumerate(found.map.columns))
    return [ReportTable(f"Map about posture {found.map_posture}", ("Quantity", "Smallest", "Largest"), rows, 1)]


def _range(values: Array) -> Sequence[str]:
    known = values[np.isfinite(values)]
    return [number(float(known.min())), number(float(known.max()))] if known.size else [number(None)] * 2
