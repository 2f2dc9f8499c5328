"""``validate all MODEL``: the study of a user's own machine.

It goes from the model file to the run's folder: what the solvers must do on the machine, and the report with
figures and findings.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from vjm.continuation.path import Path as LoadPath
from vjm.continuation.path import travel
from vjm.io.files import check_writable, write_whole
from vjm.io.findings import Finding
from vjm.io.machine_file import load_model
from vjm.io.path_files import write_curve
from vjm.io.provenance import Provenance, digest
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_output.documents import as_json, doubt_rows, versions
from vjm_output.number_text import number, percent
from vjm_output.optional_drawing import why_not_rendered
from vjm_output.plots import Drawing, Picture, drawing_of, engine_style, figure
from vjm_output.templating import environment
from vjm_updating.maps.evaluate import OK, SHOWN, TITLES, MapQuantity
from vjm_validation.acceptance import AcceptanceRow, at_most, none_of
from vjm_validation.design_documents import SOUGHT, sensitivity_lines, sensitivity_table
from vjm_validation.metrics import round_down
from vjm_validation.page_content import ReportTable
from vjm_validation.report.command_pages import modes_picture, or_nan, shares_picture, tornado_picture
from vjm_validation.report.machine_view import geometry, rendered
from vjm_validation.report.words import ReportFinding, Tone, failed_acceptance, findings_markdown
from vjm_validation.runs.paper import discard_outdated
from vjm_validation.studies.own_machine import (
    CONVERGED,
    REFERENCE,
    SMALL,
    TRIED,
    CriticalRow,
    LoadRow,
    OwnMachine,
    OwnMachineSummary,
    Progress,
    Request,
    extent,
    study,
)

# --- Pictures of a user's own machine in its postures, with its deflected shape -----------------------------------

SHOWN_TURN = 0.1
"""Of the machine's size: largest deflection in a render."""


def machine_picture(study: OwnMachine, label: str) -> Picture:
    """The machine, and the shape of its largest deflection in the posture."""
    shown = geometry(study.drawn, label)
    paths = {
        key: path for key, path in study.paths.items() if key[0] == label and key[2] != REFERENCE and path.stations
    }
    moved, said = [], ""
    if paths:
        key, path = max(paths.items(), key=lambda item: _largest(item[1]))
        start, end = path.points[0].shape, path.points[-1].shape
        size = _largest(path)
        times = max(1.0, round_down(SHOWN_TURN * shown.extent / size)) if size > 0.0 else 1.0
        moved = _polylines(study.machine, path, start + times * (end - start))
        said = f" In black, {times:g} times its size, the deflection under the load along {key[1]}."
    return Picture(
        f"machine_{file_name(label)}", Drawing(rendered(shown, moved)), f"Posture {label}",
        f"Beams blue, rigid links grey, joints that deflect orange, passive joints pink.{said}",
    )  # fmt: skip


def _polylines(machine: Machine, path: LoadPath, shape: np.ndarray) -> list[np.ndarray]:
    """The stations of a path as lines: along each part, from the last station of the part on which it begins."""
    rows: dict[str, list[int]] = {}
    for row, station in enumerate(path.stations):
        rows.setdefault(station.part, []).append(row)
    lines, last = [], dict[str, int]()
    for name, behind in machine.predecessors.items():
        own = rows.get(name, [])
        begun = [last[behind]] if behind in last else []
        if own:
            lines.append(shape[[*begun, *own]])
        if own or begun:
            last[name] = own[-1] if own else begun[0]
    return lines


def _largest(path: LoadPath) -> float:
    moved = path.points[-1].shape - path.points[0].shape
    return float(np.linalg.norm(moved, axis=1).max(initial=0.0))


def file_name(label: str) -> str:
    """A posture's label as a part of a file's name."""
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in label)


# ------------------------------------------------------------------------------------------------------------------


# --- The design chapters of the report on a user's own machine: shares, frequencies, what to stiffen, a map -------

COLUMN = SHOWN[MapQuantity.STIFFNESS]
"""Of a map's values that is drawn: the smallest stiffness against a force."""


# --- words --------------------------------------------------------------------------------------------


def design_findings(study: OwnMachine) -> list[ReportFinding]:
    """What the chapters say in words."""
    parts = (_contributors(study), _slowest(study), _to_stiffen(study))
    return [finding for finding in parts if finding is not None]


def _contributors(study: OwnMachine) -> ReportFinding | None:
    lines = []
    for row in study.shares:
        ranked = sorted((p for p in row.parts if p.energy), key=lambda p: -(p.energy or 0.0))[:3]
        if ranked:
            said = ", ".join(f"{p.part} ({p.kind}) {percent(p.energy or 0.0)}" for p in ranked)
            lines.append(f"Posture {row.posture} along {study.shares_along[row.posture]}: {said}.")
    if not lines:
        return None
    lines.append(
        f"Shares in the deflection under {number(SMALL * study.size)} N along the direction of least stiffness in "
        "each posture, without weight."
    )
    return ReportFinding(Tone.NOTE, "What contributes most to the deflection", tuple(lines))


def _slowest(study: OwnMachine) -> ReportFinding | None:
    if not study.modes:
        return None
    first = min(study.modes, key=lambda row: row.frequency_Hz)
    lines = [
        f"Posture {row.posture}: {number(row.frequency_Hz)} Hz, moving most at {row.largest_at}."
        for row in study.modes
        if row.mode == 1
    ]
    growing = [row for row in study.modes if row.growth_per_s > 0.0]
    lines += [f"Posture {row.posture}: motion {row.mode} grows by {number(row.growth_per_s)}/s." for row in growing]
    title = f"The lowest natural frequency is {number(first.frequency_Hz)} Hz, posture {first.posture}"
    return ReportFinding(Tone.CAUSE if growing else Tone.NOTE, title, tuple(lines))


def _to_stiffen(study: OwnMachine) -> ReportFinding | None:
    document, row = study.sensitivity, study.stiffened
    if document is None or row is None:
        return None
    title = f"What to change to halve the deflection in posture {row.posture} along {document.along}"
    enough = [each for each in document.parameters if each.factor is not None]
    changes = enough[:SOUGHT] + [each for each in enough[SOUGHT:] if not each.geometric][:SOUGHT]
    lines = sensitivity_lines(document.model_copy(update={"parameters": changes}))
    if not changes:
        lines.append(f"None of the {TRIED} numbers that matter most does it alone, up to ten times what it is.")
    about = "Twice the stiffness is half the deflection. Each change is made alone, all other numbers stay."
    return ReportFinding(Tone.NOTE, title, (*lines, about))


# --- pictures -----------------------------------------------------------------------------------------


def design_pictures(study: OwnMachine) -> list[Picture]:
    """Bars of the shares, the shapes of the lowest motions, and the tornado of the sensitivities."""
    pictures = []
    if any(part.energy for row in study.shares for part in row.parts):
        pictures.append(shares_picture(study.drawn.name, study.shares))
    if study.modes:
        first = min(study.modes, key=lambda row: row.frequency_Hz)
        pictures.append(modes_picture(study.shapes[first.posture]))
    if study.sensitivity is not None and any(row.relative for row in study.sensitivity.parameters):
        pictures.append(tornado_picture(study.sensitivity))
    return pictures


def map_picture(study: OwnMachine) -> Picture | None:
    """The smallest stiffness over the map's axes: a line, or levels of the third axis side by side."""
    if study.map is None:
        return None
    axes = {name: np.array(values) for name, values in study.map_axes.items() if len(values) > 1}
    values = np.array([or_nan(row[COLUMN]) for row in study.map.values])
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
    solved = sum(status == OK for status in study.map.status)
    missing = len(study.map.status) - solved
    white = f" {missing} of {len(study.map.status)} points have no answer and are white." if missing else ""
    where = "the end's place in the world" if tool else "the drives"
    return Picture(
        "map", drawing, f"{study.drawn.name}: stiffness about posture {study.map_posture}",
        f"The smallest stiffness against a force on the end in any direction, over {where}.{white}",
    )  # fmt: skip


# --- tables -------------------------------------------------------------------------------------------


def design_tables(study: OwnMachine) -> list[ReportTable]:
    """Shares, frequencies and sensitivities as the page shows them."""
    tables = []
    shown = [row for row in study.shares if any(part.energy for part in row.parts)]
    if shown:
        names = list(dict.fromkeys((part.part, part.kind) for row in shown for part in row.parts))
        cells = {(row.posture, p.part, p.kind): p.energy or 0.0 for row in shown for p in row.parts}
        rows = [
            (part, kind, *(percent(cells.get((row.posture, part, kind), 0.0), 3) for row in shown))
            for part, kind in names
        ]
        header = ("Part", "Kind", *(f"{row.posture}, {study.shares_along[row.posture]}" for row in shown))
        tables.append(ReportTable("Shares in the deflection along the force", header, tuple(rows), 2))
    if study.modes:
        rows = [
            (row.posture, str(row.mode), number(row.frequency_Hz), number(row.growth_per_s), row.largest_at)
            for row in study.modes
        ]
        header = ("Posture", "Motion", "Frequency, Hz", "Growth, 1/s", "Moves most at")
        tables.append(ReportTable("Natural frequencies", header, tuple(rows), 1))
    if study.sensitivity is not None:
        caption = f"Sensitivity of the {study.sensitivity.quantity} along {study.sensitivity.along}"
        tables.append(sensitivity_table(study.sensitivity, caption))
    return tables


def map_table(study: OwnMachine) -> list[ReportTable]:
    """The range of the map's values."""
    if study.map is None:
        return []
    values = np.array([[or_nan(v) for v in row] for row in study.map.values])
    rows = tuple((name, *_range(values[:, k])) for k, name in enumerate(study.map.columns))
    return [ReportTable(f"Map about posture {study.map_posture}", ("Quantity", "Smallest", "Largest"), rows, 1)]


def _range(values: Array) -> Sequence[str]:
    known = values[np.isfinite(values)]
    return [number(float(known.min())), number(float(known.max()))] if known.size else [number(None)] * 2


# ------------------------------------------------------------------------------------------------------------------


AXES = ("x", "y", "z", "rx", "ry", "rz")


def write_own_report(study: OwnMachine, summary: OwnMachineSummary, out: Path) -> Path:
    """Write ``index.html``, ``findings.md``, ``figures/*.png`` and ``renders/*.png``.

    Returns:
        Path of ``index.html``.
    """
    labels = list(dict.fromkeys(row.posture for row in study.loads)) or list(study.machine.postures)
    figures = [picture for label in labels for picture in _curves(study, label)]
    figures += [picture for picture in (_convergence(study),) if picture]
    reason = why_not_rendered()
    renders = [] if reason else [machine_picture(study, label) for label in labels]
    chapters = design_pictures(study)
    maps = [picture for picture in (map_picture(study),) if picture]
    for folder, pictures in (("figures", [*figures, *maps, *chapters]), ("renders", renders)):
        for picture in pictures:
            write_whole(out / folder / f"{picture.name}.png", picture.drawing.png)
    findings = own_findings(study, summary, reason)
    shown = {"renders": renders, "figures": [*figures, *maps, *chapters]}
    title = study.drawn.title or study.drawn.name
    write_whole(out / "findings.md", findings_markdown(title, summary.command, findings, shown))
    page = environment("vjm_validation.report").get_template("own_machine.html.j2").render(
        machine=study.drawn,
        held=study.held,
        size=study.size,
        gravity=summary.gravity,
        findings=findings,
        renders=renders,
        figures=figures,
        maps=maps,
        map_tables=map_table(study),
        design=chapters,
        design_findings=design_findings(study),
        design_tables=design_tables(study),
        tables=own_tables(study),
        acceptance=summary.acceptance,
        command=summary.command,
        records={"Versions": summary.versions, "Made of": summary.made_of, "Hashes": summary.hashes},
        seconds=summary.seconds,
    )  # fmt: skip
    index = out / "index.html"
    write_whole(index, page.encode())
    return index


# --- findings -----------------------------------------------------------------------------------------


def own_findings(study: OwnMachine, summary: OwnMachineSummary, no_renders: str = "") -> list[ReportFinding]:
    """What the run shows, in the order in which a reader needs it."""
    parts = (_agreement, _smallest_stiffness, _softening, _critical, _springs)
    possible = (
        failed_acceptance([row.model_dump() for row in summary.acceptance]),
        *(part(study) for part in parts),
    )
    result = [finding for finding in possible if finding is not None]
    notes = tuple(f"{note[0].upper()}{note[1:]}." for note in study.notes)
    if no_renders:
        notes = (*notes, f"No pictures of the machine: {no_renders}.")
    return [*result, ReportFinding(Tone.NOTE, "What this run leaves out", notes)] if notes else result


def _agreement(study: OwnMachine) -> ReportFinding | None:
    apart = [row.difference for row in study.loads if row.difference is not None]
    if not apart:
        text = "No second engine took this machine; what follows is the virtual joint method's alone."
        return ReportFinding(Tone.NOTE, "Nothing here is compared with finite elements", (text,))
    what = "forces" if study.held else "deflections"
    sentences = [
        f"Both are asked for the same {len(apart)} load paths; the largest difference is {percent(max(apart))}."
    ]
    pairs = _pairs(study)
    if pairs:
        worst = max(abs(float(a.F_cr or 0.0) / float(b.F_cr or 1.0) - 1.0) for a, b in pairs)
        sentences.append(f"Critical forces compared: {len(pairs)}; the largest difference is {percent(worst)}.")
    agree = max(apart) < CONVERGED
    verdict = "agree" if agree else "differ"
    title = f"Virtual springs and finite elements {verdict}: {what} are {percent(max(apart))} apart"
    return ReportFinding(Tone.AGREES if agree else Tone.DIFFERS, title, tuple(sentences))


def _pairs(study: OwnMachine) -> list[tuple[CriticalRow, CriticalRow]]:
    """Critical points that both engines have."""
    theirs = {(r.posture, r.direction): r for r in study.critical if r.engine == REFERENCE and r.F_cr}
    return [
        (row, theirs[row.posture, row.direction])
        for row in study.critical
        if row.engine != REFERENCE and row.F_cr and (row.posture, row.direction) in theirs
    ]


def _stiffnesses(study: OwnMachine) -> list[tuple[float, float, LoadRow]]:
    """Stiffness at the beginning and at the end of each path of the lumped model that has one."""
    return [(row.K0, row.K_end, row) for row in study.loads if row.engine != REFERENCE and row.K0 and row.K_end]


def _smallest_stiffness(study: OwnMachine) -> ReportFinding | None:
    known = _stiffnesses(study)
    if not known:
        return None
    (K, _, low), (most, _, high) = min(known, key=lambda k: k[0]), max(known, key=lambda k: k[0])
    moved = float(np.linalg.norm(low.moved[:3]))
    return ReportFinding(
        Tone.NOTE,
        f"The smallest stiffness is in posture {low.posture} along {low.direction}: {number(K)} N/mm",
        (
            f"There {number(low.force)} N go with a displacement of the end of {number(moved)} mm in all.",
            f"It is stiffest in posture {high.posture} along {high.direction}: {number(most)} N/mm.",
        ),
    )  # fmt: skip


def _softening(study: OwnMachine) -> ReportFinding | None:
    known = _stiffnesses(study)
    if not known:
        return None
    before, after, worst = max(known, key=lambda k: abs(k[1] / k[0] - 1.0))
    change = after / before - 1.0
    return ReportFinding(
        Tone.CAUSE if abs(change) > 0.05 else Tone.NOTE,
        f"Under load the stiffness changes by {percent(change)} at most",
        (
            f"Posture {worst.posture} along {worst.direction}: from {number(before)} to {number(after)} N/mm "
            f"at {number(worst.force)} N.",
            "A linear model keeps the first of the two values at all loads.",
        ),
    )  # fmt: skip


def _critical(study: OwnMachine) -> ReportFinding | None:
    lumped = [row for row in study.critical if row.engine != REFERENCE]
    if not lumped:
        return None
    events = sorted((row for row in lumped if row.F_cr), key=lambda r: float(r.F_cr or 0.0))
    if not events:
        text = f"All {len(lumped)} loads were raised to {number(max(row.largest for row in lumped))} N at most."
        return ReportFinding(Tone.NOTE, "No critical point was found up to the largest loads tried", (text,))
    first = events[0]
    lines = [f"Posture {r.posture} along {r.direction}: {r.kind} at {number(r.F_cr)} N." for r in events[:6]]
    where = f"posture {first.posture}, {first.direction}"
    title = f"The machine loses its stability first at {number(first.F_cr)} N, {where}"
    return ReportFinding(Tone.CAUSE, title, tuple(lines))


def _springs(study: OwnMachine) -> ReportFinding | None:
    if not study.convergence:
        return None
    rows = study.convergence
    enough = next((row.springs for row in rows if row.error < CONVERGED), None)
    first = rows[0]
    what = first.quantity.split(",")[0]
    lines = [f"Studied: the {what} in posture {first.posture} along {first.direction}."]
    lines.append(
        f"One spring a beam misses it by {percent(first.error)}, {rows[-2].springs} by {percent(rows[-2].error)}."
    )
    if study.elements is not None:
        apart = study.elements / rows[-1].value - 1.0
        lines.append(f"With {rows[-1].springs} it differs from the finite elements' by {percent(apart)}.")
    title = "No number of springs is enough"
    if enough:
        count = "One spring a beam is" if enough == 1 else f"{enough} springs a beam are"
        title = f"{count} enough for {percent(CONVERGED)}"
    return ReportFinding(Tone.AGREES if enough else Tone.DIFFERS, title, tuple(lines))


# --- tables -------------------------------------------------------------------------------------------


def own_tables(study: OwnMachine) -> list[ReportTable]:
    """The rows of ``summary.json`` as the page shows them."""
    tables = []
    if study.stiffness:
        header = (
            "Posture",
            "End",
            "Load",
            *(f"{a}, N/mm" for a in AXES[:3]),
            *(f"{a}, N mm/rad" for a in AXES[3:]),
        )
        rows = tuple(
            (row.posture, row.end or "tool", row.load, *("rigid" if k is None else number(k) for k in row.along))
            for row in study.stiffness
        )
        caption = "Stiffness of the free end: force over the deflection along it"
        tables.append(ReportTable(caption, header, rows, 3))
    if study.loads:
        header = (
            "Posture", "Direction", "Engine", "K at the beginning, N/mm", "K at the end, N/mm", "Force, N",
            *(f"u{a}, mm" for a in AXES[:3]), *(f"{a}, rad" for a in AXES[3:]), "Difference", "Stopped",
        )  # fmt: skip
        rows = tuple(
            (
                row.posture, row.direction, row.engine, _stiff(row.K0), _stiff(row.K_end), number(row.force),
                *(number(_clean(v, row.moved, i)) for i, v in enumerate(row.moved)),
                number(None) if row.difference is None else percent(row.difference, 2), row.stopped,
            )
            for row in study.loads
        )  # fmt: skip
        tables.append(ReportTable("Every load path at its end", header, rows, 3))
    if study.critical:
        header = (
            "Posture",
            "Direction",
            "Engine",
            "Critical point",
            "Force, N",
            "Displacement, mm",
            "Reached, N",
            "Stopped",
        )
        rows = tuple(
            (
                row.posture, row.direction, row.engine, str(row.kind or "none"), number(row.F_cr), number(row.d_cr),
                number(row.largest), row.stopped,
            )
            for row in study.critical
        )  # fmt: skip
        tables.append(ReportTable("Critical forces", header, rows, 4))
    if study.convergence:
        header = ("Springs a beam", study.convergence[0].quantity, "Error")
        rows = tuple((str(row.springs), number(row.value, 7), percent(row.error)) for row in study.convergence)
        if study.elements is not None:
            rows = (*rows, (REFERENCE, number(study.elements, 7), number(None)))
        first = study.convergence[0]
        tables.append(
            ReportTable(f"Number of springs: posture {first.posture}, {first.direction}", header, rows, 1)
        )
    return tables


def _stiff(K: float | None) -> str:
    return "rigid" if K is None else number(K)


def _clean(value: float, moved: list[float], i: int) -> float:
    """Zero for what is rounding beside the largest component of its kind."""
    largest = max(abs(v) for v in (moved[:3] if i < 3 else moved[3:]))
    return 0.0 if abs(value) < 1e-9 * largest else value


# --- pictures -----------------------------------------------------------------------------------------


def _curves(study: OwnMachine, label: str) -> list[Picture]:
    """Load against displacement, a panel for each axis: both engines and the linear line."""
    paths = {key: path for key, path in study.paths.items() if key[0] == label}
    if not paths:
        return []
    axes = list(dict.fromkeys(direction.lstrip("-") for _, direction, _ in paths))
    columns = min(3, len(axes))
    rows = -(-len(axes) // columns)
    with figure(2.9 * rows + 0.4, columns, rows=rows) as (fig, panels):
        for ax, axis in zip(panels, axes, strict=False):
            for (_, direction, engine), path in paths.items():
                if direction.lstrip("-") == axis:
                    _draw(ax, engine, path, -1.0 if direction.startswith("-") else 1.0)
            ax.set(title=f"along {axis}", xlabel="displacement, mm")
            ax.locator_params(axis="x", nbins=4)
            ax.axhline(0.0, color="#bbbbbb", lw=0.6)
            ax.axvline(0.0, color="#bbbbbb", lw=0.6)
        for ax in panels[len(axes) :]:
            ax.set_visible(False)
        panels[0].set_ylabel("force, N")
        handles = {str(line.get_label()): line for ax in panels for line in ax.get_lines()}
        handles = {name: line for name, line in handles.items() if not name.startswith("_")}
        fig.legend(handles=list(handles.values()), loc="outside upper center", ncols=4)
        drawing = drawing_of(fig)
    return [
        Picture(
            f"load_{file_name(label)}", drawing, f"Posture {label}: force against displacement",
            "Displacement of the end along the force, counted from where no force acts; the linear line has the "
            "stiffness there.",
        )
    ]  # fmt: skip


def _draw(ax: Axes, engine: str, path: LoadPath, sign: float) -> None:
    force = sign * np.abs(np.array(path.force))
    start = travel(path, path.points[0])
    along = np.array([travel(path, point) - start for point in path.points])
    along = sign * (np.abs(along) if path.load_case.load_driven is False else along)
    style = engine_style(engine)
    reference = engine == REFERENCE
    ax.plot(
        along, force, color=style.colour if reference else "#0072B2", ls=style.line if reference else (0, (4, 2)),
        marker="o" if reference else None, ms=4.0, lw=3.0 if reference else 1.8,
        zorder=2.0 if reference else 3.0, label=engine,
    )  # fmt: skip
    K0 = path.points[0].tangent
    if not reference and K0 > 0.0:
        linear = np.array([0.0, abs(force[-1]) / K0])
        ax.plot(sign * linear, [0.0, force[-1]], color="#8C8C8C", ls=(0, (8, 3)), lw=1.1, label="linear")


def _convergence(study: OwnMachine) -> Picture | None:
    rows = [row for row in study.convergence if row.error > 0.0]
    if len(rows) < 2:
        return None
    first = rows[0]
    with figure(2.9, 1) as (fig, (ax,)):
        ax.loglog(
            [r.springs for r in rows], [r.error for r in rows], "o-", color="#0072B2", label="virtual springs"
        )
        last = study.convergence[-1].value
        if study.elements is not None and abs(study.elements / last - 1.0) > 0.0:
            ax.axhline(abs(study.elements / last - 1.0), color="black", ls=":", label=REFERENCE)
        ax.set(xlabel="springs a beam", ylabel="relative difference")
        ax.set_xticks([r.springs for r in rows], [str(r.springs) for r in rows])
        ax.minorticks_off()
        fig.legend(loc="outside upper center", ncols=2)
        drawing = drawing_of(fig)
    what = first.quantity.split(",")[0]
    return Picture(
        "convergence", drawing, f"Number of springs: {what}, posture {first.posture}, {first.direction}",
        f"Difference to {study.convergence[-1].springs} springs a beam; dotted, that of finite elements to them.",
    )  # fmt: skip


WRITTEN = ("stiffness", "loads", "critical", "convergence", "elements", "shares", "shares_along", "modes",
           "sensitivity", "map", "notes")  # fmt: skip
"""Of a study, as they are in its summary."""
NOTHING_CHECKED = "anything checked"
"""Name of the only row of a run that looked at nothing, which is no pass."""
AGREEMENT = 2e-3
"""Of what both engines compute: 16 springs a beam, and 8 elements, are good to 1e-4 and to 7e-4 near buckling, and
what is refined to `CONVERGED` is good to 7e-4 together."""
RESIDUAL = 1e-8
"""Scaled; the lumped solver stops at 1e-11, Exudyn at 1e-9 of its own norm."""
FAR = 3.0
"""Times the machine's first critical force, up to which critical points must agree."""
BENT = 0.1
"""Of the machine's size: displacement up to which they must."""


def run_own(
    request: Request, out: Path, command: str, progress: Progress, doubts: Sequence[Finding] = ()
) -> OwnMachineSummary:
    """Study a machine and write ``index.html``, ``summary.json``, ``findings.md``, curves, figures and renders.

    Args:
        request: what is asked.
        out: folder.
        command: that makes the run again.
        progress: told what is done.
        doubts: what is implausible about the model.

    Raises:
        ModelFileError: the file is no model.
        ValueError: no such posture, direction or engine.
        OSError: the folder cannot be written to.
    """
    started = time.perf_counter()
    check_writable(out)
    made_of = Provenance.of(load_model(request.model).files, command=command)
    discard_outdated(out, made_of)
    machine_study = study(request, progress)
    hashes = {}
    for (posture, direction, engine), path in machine_study.paths.items():
        stem = "".join(c if c.isalnum() or c in "-_+" else "_" for c in f"{posture}_{direction}_{engine}")
        file = out / "curves" / f"{stem}.csv"
        write_curve(path, file)
        hashes[file.name] = digest(file.read_bytes())
    progress("report", 0, 1)
    summary = OwnMachineSummary(
        command=command,
        model=machine_study.machine.name,
        control="held" if machine_study.held else "free",
        gravity=list(request.gravity) if request.gravity else None,
        **{name: getattr(machine_study, name) for name in WRITTEN},
        acceptance=own_acceptance(machine_study),
        seconds=time.perf_counter() - started,
        versions=versions(),
        made_of=dict(made_of.inputs),
        hashes=hashes,
        doubts=doubt_rows(doubts),
    )

    write_own_report(machine_study, summary, out)
    write_whole(out / "summary.json", as_json(summary))
    progress("report", 1, 1)
    return summary


def own_acceptance(study: OwnMachine) -> list[AcceptanceRow]:
    """What the solvers must do on a machine of which nothing is known beforehand."""
    rows = []
    if study.paths:
        early = [f"{'_'.join(key)}: {path.stopped}" for key, path in study.paths.items() if not path.complete]
        residuals = [p.residual for path in study.paths.values() for p in path.points if np.isfinite(p.residual)]
        rows += [
            none_of("paths complete", "every load path reaches its end", early),
            at_most("equilibrium residual", max(residuals, default=0.0), RESIDUAL, " (scaled)"),
        ]
    apart = [row.difference for row in study.loads if row.difference is not None]
    if apart:
        what = "forces" if study.held else "deflections"
        rows.append(at_most(f"{what}: virtual springs against {REFERENCE}", max(apart), AGREEMENT))
        theirs = {(row.posture, row.direction): row.K0 for row in study.loads if row.engine == REFERENCE}
        K = [
            abs(row.K0 / reference - 1.0)
            for row in study.loads
            if row.engine != REFERENCE and row.K0 and (reference := theirs.get((row.posture, row.direction)))
        ]
        rows.append(
            at_most(f"unloaded stiffness: virtual springs against {REFERENCE}", max(K, default=0.0), AGREEMENT)
        )
    rows += _critical_rows(study)
    if len(study.convergence) > 1:
        row = study.convergence[-2]
        name = f"{row.quantity.split(',')[0]}: {row.springs} springs a beam against twice as many"
        rows.append(at_most(name, row.error, CONVERGED))
    if not rows:
        why = "; ".join(study.notes) or "no load path, no equilibrium and no second engine"
        what = "an equilibrium, another engine or more springs"
        rows.append(AcceptanceRow(name=NOTHING_CHECKED, requirement=what, value=f"not run: {why}", passed=None))
    return rows


def _critical_rows(study: OwnMachine) -> list[AcceptanceRow]:
    theirs = {(row.posture, row.direction): row for row in study.critical if row.engine == REFERENCE}
    pairs = [
        (row, theirs[row.posture, row.direction])
        for row in study.critical
        if row.engine != REFERENCE and (row.posture, row.direction) in theirs
    ]
    if not pairs:
        return []
    # where one of them gave up before the other's critical point, there is nothing to compare
    comparable = [(a, b) for a, b in pairs if not (a.stopped or b.stopped) or (a.kind and b.kind)]
    first = min((row.F_cr for pair in pairs for row in pair if row.F_cr), default=0.0)
    # what lies far beyond the first loss of stability, or behind large displacements, is listed only
    far = BENT * extent(study.machine)
    comparable = [
        pair
        for pair in comparable
        if not any(row.F_cr and (row.F_cr > FAR * first or abs(row.d_cr or 0.0) > far) for row in pair)
    ]
    kinds = [
        f"{a.posture} {a.direction}: {a.kind or 'none'} and {b.kind or 'none'}"
        for a, b in comparable
        if a.kind is not b.kind
    ]
    rows = [none_of("kinds of critical points", f"those of {REFERENCE}", kinds)]
    gaps = [abs(a.F_cr / b.F_cr - 1.0) for a, b in comparable if a.F_cr and b.F_cr]
    if gaps and not study.held and study.elements is not None:
        # where the end is free finite elements follow one force, the one that both engines refine
        gaps = [abs(study.convergence[-1].value / study.elements - 1.0)]
    if gaps:
        rows.append(at_most(f"critical forces: virtual springs against {REFERENCE}", max(gaps), AGREEMENT))
    return rows
