"""Figures of the single commands: paths, one loaded stiffness, a compliance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from vjm.continuation.path import Path
from vjm.rotations import Array
from vjm_output.number_text import number
from vjm_output.plot_style import ENGINES, EVENT_MARKERS, Picture, drawing_of, engine_style, figure
from vjm_validation.compensation import CompensationDocument

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
        at = np.arange(1, document.poses + 1)
        for name in document.commands:
            error = np.linalg.norm(np.array(document.errors[name])[:, :3], axis=1)
            # a logarithmic axis has no zero; a nanometre is none
            ax.semilogy(at, np.maximum(error, 1e-6), "o-", ms=3, color=colours[name], label=name)
        ax.set(xlabel="pose", ylabel="error of the loaded end, mm")
        fig.legend(loc="outside upper right", ncols=3)
        drawing = drawing_of(fig)
    return Picture(
        "compensation", drawing, f"{document.model}, {document.engine}: error left along the path",
        "Distance of the loaded end from where it should be, by the model that the joints were computed with.",
    )  # fmt: skip
