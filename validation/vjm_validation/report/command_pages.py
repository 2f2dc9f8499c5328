"""Figures and the page of the single commands.

Here are paths, stiffnesses, shares, natural motions, sections, sweeps and fronts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Annulus, Circle, Patch, PathPatch, Rectangle
from matplotlib.path import Path as Outline

from vjm.continuation.path import Path
from vjm.design.modes import Modes
from vjm.io.files import write_whole
from vjm.io.saint_venant import Quarter
from vjm.io.shapes import Polygon, Round, Shape
from vjm.rotations import Array
from vjm_output.number_text import number
from vjm_output.plots import ENGINES, EVENT_MARKERS, Picture, drawing_of, engine_style, figure, plain
from vjm_output.templating import environment
from vjm_validation.compensation import CompensationDocument
from vjm_validation.design_documents import FrontDocument, SweepDocument
from vjm_validation.documents import SensitivityDocument, SharesRow
from vjm_validation.page_content import ReportTable
from vjm_validation.report.words import Tone

FREE = 1e-9
"""Of the largest diagonal entry of its unit, below which an axis is free."""
AXES = ("x", "y", "z", "rx", "ry", "rz")
COLOURS = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#7A5C00")
"""Of paths of one engine, which that engine's colour would not distinguish."""


def path_pictures(paths: Sequence[Path]) -> list[Picture]:
    """Force along each path, and its stiffness over the force."""
    names = _names(paths)
    colours = _colours(paths)
    first = paths[0]
    driven = first.load_case.driven
    across = "arc length of the path" if first.load_case.load_driven else f"displacement, {driven.along}"
    up = f"{driven.name}, {driven.unit}" if driven.unit else driven.name
    slope = f"tangent stiffness, {driven.stiffness}" if driven.stiffness else "its stiffness"
    with figure(3.6, 2) as (fig, axes):
        for path, name, colour in zip(paths, names, colours, strict=True):
            _line(axes[0], path.s, path.force, name, colour)
            for event in path.events:
                axes[0].plot(
                    event.s, event.force, EVENT_MARKERS[event.kind], ms=6.5, mfc="white", mec=colour,
                    label=f"_of {name}",
                )  # fmt: skip
            _line(axes[1], path.force, path.tangent, name, colour)
        axes[0].set(xlabel=across, ylabel=up)
        axes[1].set(xlabel=up, ylabel=slope)
        handles, labels = axes[0].get_legend_handles_labels()
        fig.legend(handles, labels, loc="outside upper center", ncols=min(4, len(labels)))
        drawing = drawing_of(fig)
    caption = (
        f"Magnitudes along the driven component. Left: {up.partition(',')[0]}, with critical points as hollow "
        "marks. Right: the stiffness that is left; it falls at a critical point."
    )
    return [Picture("paths", drawing, f"{first.model}: force and stiffness along the path", caption)]


def stiffness_picture(model: str, loaded: Array, unloaded: Array) -> Picture:
    """What the load makes of the stiffness, axis by axis.

    Args:
        model: its name.
        loaded: K^F ``(6, 6)``.
        unloaded: K ``(6, 6)``.
    """
    before, after = np.diag(unloaded), np.diag(loaded)
    # an axis about which the chain turns freely has no stiffness to compare with
    held = np.abs(before) > FREE * np.repeat([np.abs(before[:3]).max(), np.abs(before[3:]).max()], 3)
    ratio = np.divide(after, before, out=np.zeros(6), where=held)
    with figure(2.8, 1) as (fig, axes):
        axes[0].bar(AXES, ratio, color="#0072B2", label="loaded over unloaded")
        axes[0].axhline(1.0, color="black", lw=0.8)
        axes[0].set(ylabel="diagonal of loaded over unloaded stiffness")
        drawing = drawing_of(fig)
    caption = (
        "The line is 1: what the load does not change. Below it the load softens that axis. A free axis has no bar."
    )
    return Picture("stiffness", drawing, f"{model}: what the load makes of the stiffness", caption)


DARK = 0.6
"""Share of the colour scale from which on white reads better than black."""


def compliance_picture(name: str, compliance: Array) -> Picture:
    """The coupling of a compliance's axes.

    Args:
        name: of the part.
        compliance: ``(6, 6)``.
    """
    size = np.sqrt(np.abs(np.diag(compliance)))
    scaled = compliance / np.outer(size, size)
    with figure(4.2, 1) as (fig, axes):
        image = axes[0].imshow(scaled, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
        axes[0].set_xticks(range(6), AXES)
        axes[0].set_yticks(range(6), AXES)
        axes[0].grid(visible=False)
        for i in range(6):
            for j in range(6):
                text, colour = number(float(scaled[i, j]), 2), "white" if abs(scaled[i, j]) > DARK else "black"
                axes[0].text(j, i, text, ha="center", va="center", fontsize=7.5, color=colour)
        fig.colorbar(image, ax=axes[0], label="over the root of both diagonal entries")
        drawing = drawing_of(fig)
    caption = "Zero: a load along one axis does not move the other; ±1: they move together."
    return Picture("compliance", drawing, f"{name}: coupling of the compliance's axes", caption)


def _line(ax: Axes, x: Array, y: Array, name: str, colour: str) -> None:
    ax.plot(x, y, color=colour, lw=1.6, label=name)


def _names(paths: Sequence[Path]) -> list[str]:
    """What tells the paths apart."""
    postures = len({path.load_case.posture for path in paths}) > 1
    ways = len({path.load_case.sign for path in paths}) > 1
    names = []
    for path in paths:
        way = ("pulled" if path.load_case.sign > 0 else "pushed") if ways else ""
        names.append(" ".join(filter(None, [path.engine, path.load_case.posture if postures else "", way])))
    return names


def _colours(paths: Sequence[Path]) -> list[str]:
    engines = [path.engine for path in paths]
    if len(set(engines)) == len(engines) and all(engine in ENGINES for engine in engines):
        return [engine_style(engine).colour for engine in engines]
    return [COLOURS[k % len(COLOURS)] for k in range(len(paths))]


def compensation_picture(document: CompensationDocument) -> Picture:
    """The error left along the path by each model."""
    colours = {"rigid": "#8C8C8C", "linear": "#D55E00", "loaded": "#0072B2"}
    with figure(3.2, 1) as (fig, (ax,)):
        poses = np.arange(1, document.poses + 1)
        for name in document.commands:
            error = np.linalg.norm(np.array(document.errors[name])[:, :3], axis=1)
            # a logarithmic axis has no zero; a nanometre is none
            ax.semilogy(poses, np.maximum(error, 1e-6), "o-", ms=3, color=colours[name], label=name)
        ax.set(xlabel="pose", ylabel="error of the loaded end, mm")
        fig.legend(loc="outside upper right", ncols=3)
        drawing = drawing_of(fig)
    return Picture(
        "compensation", drawing, f"{document.model}, {document.engine}: error left along the path",
        "Distance of the loaded end from where it should be, by the model that the joints were computed with.",
    )  # fmt: skip


SHOWN = 7
"""Parts that a figure names; the others are added up."""
LONGEST_TORNADO = 15
"""Parameters that a tornado shows."""
FILLED = "#8C8C8C"
REACH = 0.15
"""Of the machine's size, by which the largest motion of a shape is drawn."""


def shares_picture(model: str, rows: Sequence[SharesRow]) -> Picture:
    """What each part has in the strain energy, a bar for each posture."""
    totals: dict[str, float] = {}
    for row in rows:
        for part in row.parts:
            totals[f"{part.part} ({part.kind})"] = totals.get(f"{part.part} ({part.kind})", 0.0) + (
                part.energy or 0.0
            )
    named = sorted((name for name in totals if totals[name]), key=lambda name: -totals[name])[:SHOWN]
    labels = [row.posture for row in rows]
    with figure(1.2 + 0.35 * len(rows) + 0.2 * ((len(named) + 3) // 3), 1) as (fig, (ax,)):
        left = np.zeros(len(rows))
        for name, colour in zip([*named, "others"], COLOURS, strict=False):
            width = np.array([_energy(row, name, named) for row in rows])
            if width.any():
                ax.barh(labels, 100.0 * width, left=100.0 * left, color=colour, label=plain(name), height=0.7)
            left += width
        ax.set(xlabel="share in the strain energy, %", ylabel="posture", xlim=(0.0, 100.0))
        ax.invert_yaxis()
        fig.legend(loc="outside upper center", ncols=3)
        drawing = drawing_of(fig)
    caption = (
        "Under a wrench on the end alone it is the share in the deflection along the wrench. Bearings are a "
        "joint's compliance across its axis."
    )
    return Picture("shares", drawing, f"{model}: what deflects", caption)


def _energy(row: SharesRow, name: str, named: Sequence[str]) -> float:
    own = {f"{part.part} ({part.kind})": part.energy or 0.0 for part in row.parts}
    return own.get(name, 0.0) if name != "others" else sum(v for key, v in own.items() if key not in named)


def modes_picture(modes: Modes) -> Picture:
    """The shapes of the first motions beside the machine at its equilibrium."""
    count = min(len(modes.frequencies), 6)
    columns = min(count, 3)
    rows = (count + columns - 1) // columns
    size = float(np.ptp(modes.shape, axis=0).max()) or 1.0
    with figure(2.3 * rows + 0.4, columns, rows=rows) as (fig, axes):
        for k, ax in enumerate(axes):
            if k >= count:
                ax.set_visible(False)
                continue
            across, up = _plane(modes.shape, modes.shapes[k])
            moved = modes.shape + REACH * size * modes.shapes[k]
            for places, colour, width in ((modes.shape, "#8C8C8C", 1.0), (moved, "#0072B2", 1.8)):
                for pair in modes.lines:
                    ax.plot(*places[list(pair)][:, [across, up]].T, color=colour, lw=width)
            growth = f", grows by {modes.growth[k]:.3g}/s" if modes.growth[k] else ""
            ax.set_title(f"{k + 1}: {modes.frequencies[k]:.4g} Hz{growth}")
            ax.set(xlabel=f"{'xyz'[across]}, mm", ylabel=f"{'xyz'[up]}, mm")
            ax.tick_params(labelbottom=True)
            ax.set_aspect("equal", adjustable="datalim")
        drawing = drawing_of(fig)
    caption = (
        "Grey: the equilibrium. Blue: the motion, its largest part drawn as 15 % of the machine's size, in the "
        "plane in which it is seen best."
    )
    return Picture("modes", drawing, f"{modes.model}: natural motions, posture {modes.posture}", caption)


def sections_picture(shapes: Mapping[str, Shape]) -> Picture:
    """Cross-sections to one scale, z to the right and y upwards."""
    columns = min(len(shapes), 3)
    rows = (len(shapes) + columns - 1) // columns
    with figure(2.3 * rows + 0.4, columns, rows=rows, sharex=False) as (fig, axes):
        for ax in axes[len(shapes) :]:
            ax.set_visible(False)
        reach = 1.2 * max(_extent(shape) for shape in shapes.values())
        for ax, (name, shape) in zip(axes, shapes.items(), strict=False):
            for patch in _outline(shape):
                ax.add_patch(patch)
            if isinstance(shape, Polygon):
                y, z = shape.geometry.shear_centre
                ax.plot([z], [y], "+", color="black", markersize=8)
            ax.set(xlim=(-reach, reach), ylim=(-reach, reach), xlabel="z, mm", ylabel="y, mm", title=plain(name))
            ax.set_aspect("equal")
        drawing = drawing_of(fig)
    return Picture(
        "sections",
        drawing,
        "Cross-sections",
        "Filled: what bears. All are drawn to one scale. Of polygons the cross is the shear centre.",
    )


def _extent(shape: Shape) -> float:
    """How far a section, or its shear centre, lies from its centroid along an axis at most, mm."""
    if isinstance(shape, Polygon):
        return float(np.abs(np.vstack([*shape.geometry.loops, shape.geometry.shear_centre])).max())
    return 0.5 * max(shape.sides)


def _outline(shape: Shape) -> list[Patch]:
    if isinstance(shape, Round):
        radius = 0.5 * shape.diameter_mm
        if shape.bore:
            return [Annulus((0.0, 0.0), radius, radius - 0.5 * shape.bore, color=FILLED)]
        return [Circle((0.0, 0.0), radius, color=FILLED)]
    if isinstance(shape, Polygon):
        # holes run the other way round, so that they stay open
        loops = [
            loop if (_turns(loop) > 0.0) == (k == 0) else loop[::-1] for k, loop in enumerate(shape.geometry.loops)
        ]
        paths = [Outline(np.vstack([loop, loop[:1]])[:, ::-1], closed=True) for loop in loops]
        return [PathPatch(Outline.make_compound_path(*paths), facecolor=FILLED, edgecolor="none")]
    assert isinstance(shape.geometry, Quarter)
    return [
        Rectangle((min(i * c, i * d), min(j * a, j * b)), d - c, b - a, color=FILLED)
        for a, b, c, d in shape.geometry.bands
        for i in (-1.0, 1.0)
        for j in (-1.0, 1.0)
    ]


def _turns(loop: Array) -> float:
    """Twice the area of a loop, negative where it runs clockwise."""
    after = np.roll(loop, -1, axis=0)
    return float(np.sum(loop[:, 0] * after[:, 1] - after[:, 0] * loop[:, 1]))


def _plane(shape: Array, motion: Array) -> tuple[int, int]:
    """The two world axes in which a motion is seen best: what moves most, and what the machine spans beside it."""
    moves, spans = np.abs(motion).max(axis=0), np.ptp(shape, axis=0)
    first = int(np.argmax(moves))
    others = [axis for axis in range(3) if axis != first]
    second = max(others, key=lambda axis: float(spans[axis]))
    across, up = sorted((first, second))
    return across, up


def tornado_picture(document: SensitivityDocument) -> Picture:
    """The relative derivatives by the parameters that matter most, the largest one on top."""
    rows = [row for row in document.parameters if row.relative][:LONGEST_TORNADO]
    with figure(1.0 + 0.28 * len(rows), 1) as (fig, (ax,)):
        values = [row.relative for row in rows]
        colours = ["#D55E00" if value > 0.0 else "#0072B2" for value in values]
        ax.barh([plain(row.parameter) for row in rows], values, color=colours, height=0.7)
        ax.axvline(0.0, color="black", lw=0.8)
        ax.set(xlabel=f"change of the {document.quantity}, % per %", ylabel="parameter")
        ax.invert_yaxis()
        drawing = drawing_of(fig)
    caption = (
        "Orange: it grows with the parameter. Blue: it falls. Each is for a small change of one parameter alone."
    )
    return Picture("sensitivity", drawing, f"{document.model}: what its {document.quantity} depends on", caption)


def sweep_picture(document: SweepDocument) -> Picture:
    """Quantities over the one number that varies; else the first two quantities against each other."""
    good = [row for row in document.rows if None not in row.values]
    names = [f"{q}, {u}" for q, u in zip(document.quantities, document.quantity_units, strict=True)]
    worst = " in its worst case" if len(document.rows[0].cases) > 1 else ""
    if len(document.keys) == 1 or len(names) == 1:
        x = [row.numbers[0] for row in good]
        key = ", ".join(filter(None, (plain(document.keys[0]), document.units[0])))
        with figure(2.2 * len(names) + 0.4, 1, rows=len(names)) as (fig, axes):
            for k, ax in enumerate(axes):
                ax.plot(
                    x,
                    [or_nan(row.values[k]) for row in good],
                    "o-" if len(document.keys) == 1 else "o",
                    color="#0072B2",
                    label=names[k],
                )
                ax.set(xlabel=key, ylabel=names[k])
                ax.tick_params(labelbottom=True)
            drawing = drawing_of(fig)
        return Picture("sweep", drawing, f"{document.model}: a sweep", f"Each point is a machine{worst}.")
    with figure(3.2, 1) as (fig, (ax,)):
        for on_front, colour, label in ((False, "#8C8C8C", "others"), (True, "#D55E00", "beaten by no other")):
            rows = [row for row in good if row.on_front is on_front]
            rows.sort(key=lambda row: row.values[0] or 0.0)
            places = [[or_nan(row.values[k]) for row in rows] for k in (0, 1)]
            ax.plot(*places, "o-" if on_front and len(names) == 2 else "o", color=colour, label=label)
        ax.set(xlabel=names[0], ylabel=names[1])
        ax.legend()
        drawing = drawing_of(fig)
    return Picture(
        "sweep", drawing, f"{document.model}: a sweep", f"Each point is a machine{worst}. Orange: the front."
    )


def front_picture(document: FrontDocument) -> Picture:
    """The second quantity of a front over the first one."""
    labels = [f"{q}, {u}" if u else q for q, u in zip(document.quantities, document.quantity_units, strict=True)]
    with figure(3.2, 1) as (fig, (ax,)):
        ax.plot(
            *zip(*(point.values for point in document.points), strict=True),
            "o-",
            color="#D55E00",
            label="not beaten",
        )
        ax.set(xlabel=labels[0], ylabel=labels[1])
        drawing = drawing_of(fig)
    caption = "Each point is a machine; no other one within the bounds is better in both."
    return Picture("front", drawing, f"{document.model}: the Pareto front", caption)


def or_nan(value: float | None) -> float:
    """Nan where there is no value: what a figure leaves out."""
    return float("nan") if value is None else value


def write_small_page(
    file: FilePath,
    title: str,
    verdict: str,
    *,
    tone: Tone = Tone.NOTE,
    sentences: Sequence[str] = (),
    pictures: Sequence[Picture] = (),
    tables: Sequence[ReportTable] = (),
) -> None:
    """Write the page, whole or not at all.

    Args:
        file: HTML.
        title: of the page.
        verdict: its first sentence.
        tone: of the verdict.
        sentences: below it.
        pictures: figures.
        tables: below the figures.
    """
    template = environment("vjm_validation.report").get_template("small.html.j2")
    text = template.render(
        title=title, verdict=verdict, tone=tone, sentences=sentences, pictures=pictures, tables=tables
    )
    write_whole(file, text.encode())
