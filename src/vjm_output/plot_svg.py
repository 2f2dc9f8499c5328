"""A figure as SVG that a page can embed and its script can serve: named lines, their values, their axes."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import re
from dataclasses import dataclass
from html import escape
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.container import BarContainer
from matplotlib.figure import Figure

INCH = 72.0
"""Units of an SVG file of matplotlib's in an inch."""


@dataclass(frozen=True)
class Vector:
    """A figure for a page.

    Attributes:
        svg: the element, without a declaration; lines that have a name carry it as ``data-series``.
        csv: panel, series, x and y of every named line, one point a row.
        axes: JSON list of the panels: their place in the SVG's units, limits and scales.
        file: the figure as a file of its own.
    """

    svg: str
    csv: str
    axes: str
    file: str


@dataclass(frozen=True)
class _Line:
    panel: int
    name: str
    x: Any
    y: Any


def vector(fig: Figure, rc: dict[Any, Any], dpi: float) -> Vector | None:
    """The figure as SVG with the values behind it; None where no line of it has a name.

    Args:
        fig: in the report's style. Its panels stay where they are from here on.
        rc: matplotlib's settings of that style.
        dpi: pixels per inch of its PNG, by which labels are measured where they still make room for themselves.
    """
    lines: list[_Line] = []
    marked: list[str] = []
    for panel, ax in enumerate(fig.axes):
        for artist in ax.get_lines():
            label = _plain(str(artist.get_label()))
            own = not label.startswith("_")
            series = label.removeprefix("_of ") if label.startswith("_of ") else label
            if own:
                lines.append(_Line(panel, label, np.asarray(artist.get_xdata()), np.asarray(artist.get_ydata())))
            if own or series != label:
                artist.set_gid(f"series{len(marked)}")
                marked.append(series)
        for container in ax.containers:
            if isinstance(container, BarContainer) and not str(container.get_label()).startswith("_"):
                bars = [p.get_bbox() for p in container.patches]
                x, y = [0.5 * (b.x0 + b.x1) for b in bars], [b.y1 for b in bars]
                lines.append(_Line(panel, str(container.get_label()), x, y))
                for patch in container.patches:
                    patch.set_gid(f"series{len(marked)}")
                    marked.append(str(container.get_label()))
    if not lines:
        return None
    stream = io.StringIO()
    with mpl.rc_context({**rc, "svg.fonttype": "none", "svg.hashsalt": "vjm", "path.simplify": True}):
        _lay_out(fig, dpi)
        fig.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    panels, file, table = json.dumps([_panel(fig, ax) for ax in fig.axes]), stream.getvalue(), _table(fig, lines)
    # unique on its page; the names of lines stand in the table
    name = f"plot{hashlib.sha256((file + table).encode()).hexdigest()[:8]}"
    return Vector(_element(file, name, marked), table, panels, file)


def _lay_out(fig: Figure, dpi: float) -> None:
    """Give the panels their places, once: measuring the labels takes as long as to draw."""
    engine = fig.get_layout_engine()
    if engine is None:
        return
    own = fig.dpi
    fig.dpi = dpi
    engine.execute(fig)
    fig.dpi = own
    fig.set_layout_engine("none")


def _plain(label: str) -> str:
    """A name without the signs of mathematics."""
    return label.translate(str.maketrans("", "", "${}\\"))


def _element(text: str, name: str, marked: list[str]) -> str:
    """The element alone, its ids made unique to the page."""
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<style[^>]*>.*?</style>|<!--.*?-->", "", text, flags=re.DOTALL)
    # its size is the page's affair
    text = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", text, count=1)
    text = re.sub(r' xmlns(:xlink)?="[^"]*"', "", text)
    text = text.replace("xlink:href=", "href=").replace(' version="1.1"', ' class="plot"', 1)
    for k, series in enumerate(marked):
        text = text.replace(f'id="series{k}"', f'data-series="{escape(series, quote=True)}"', 1)
    text = re.sub(r'\bid="([^"]*)"', rf'id="{name}-\1"', text)
    text = re.sub(r"url\(#([^)]*)\)", rf"url(#{name}-\1)", text)
    text = re.sub(r'href="#([^"]*)"', rf'href="#{name}-\1"', text)
    return re.sub(r"(\d\.\d{3})\d+", r"\1", re.sub(r">\s+<", "><", text))


def _panel(fig: Figure, ax: Axes) -> dict[str, Any]:
    """Where a panel is, and how its values become places."""
    width, height = fig.get_size_inches()
    box = ax.get_position()

    def scale(axis: Any) -> list[Any]:  # noqa: ANN401
        found = axis.get_scale()
        transform = axis.get_transform()
        return [found, transform.linthresh, transform.linscale] if found == "symlog" else [found]

    left, right = box.x0 * width * INCH, box.x1 * width * INCH
    top, bottom = (1.0 - box.y1) * height * INCH, (1.0 - box.y0) * height * INCH
    return {
        "box": [round(v, 2) for v in (left, top, right, bottom)],
        "x": [float(v) for v in ax.get_xlim()],
        "y": [float(v) for v in ax.get_ylim()],
        "scale": [scale(ax.xaxis), scale(ax.yaxis)],
        "names": [ax.get_xlabel(), ax.get_ylabel()],
    }


def _table(fig: Figure, lines: list[_Line]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    titles = [ax.get_title().replace("\n", " ") for ax in fig.axes]
    labels = [next((t for ax in fig.axes if (t := get(ax))), "") for get in (Axes.get_xlabel, Axes.get_ylabel)]
    writer.writerow(
        ["panel", "title", "series", *(f"{axis}: {t}" if t else axis for axis, t in zip("xy", labels, strict=True))]
    )
    for line in lines:
        for x, y in zip(line.x, line.y, strict=True):
            writer.writerow([line.panel, titles[line.panel], line.name, _value(x), _value(y)])
    return stream.getvalue()


def _value(value: Any) -> str:  # noqa: ANN401
    return value if isinstance(value, str) else f"{float(value):.6g}"
