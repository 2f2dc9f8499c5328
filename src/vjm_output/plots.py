"""How figures are drawn.

Here are colours and marks of engines and events, and a figure as SVG that a page can embed and its script can
serve.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from html import escape
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.container import BarContainer
from matplotlib.figure import Figure

from vjm.continuation.path import EventKind

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
        kind = axis.get_scale()
        transform = axis.get_transform()
        return [kind, transform.linthresh, transform.linscale] if kind == "symlog" else [kind]

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


PAPER = "vjm-paper"
FOOT_SPRING = "vjm-16"
REFINED = "vjm-16f16"
FE = "exudyn"
FE_FOOT_SPRING = "exudyn-footspring"
LINEAR = "vjm-linear"
MSA = "msa"

PAGE_WIDTH = 7.4
"""Width of a figure, inches: the text width of a journal page."""
DPI = 180
READABLE = 4.5
"""Contrast of a text, WCAG 2.2, success criterion 1.4.3."""


@dataclass(frozen=True)
class EngineStyle:
    """How one engine looks in every figure.

    Attributes:
        colour: of Okabe and Ito's palette, which the colour-blind distinguish.
        line: matplotlib line style, different for every engine so that print without colour still reads.
        width: of the line, points.
        order: drawing order; the reference lies below so that a line that agrees with it shows.
        title: what the engine is, in a few words.
    """

    colour: str
    line: Any
    width: float
    order: float
    title: str


ENGINES: dict[str, EngineStyle] = {
    FE: EngineStyle("#000000", "-", 3.2, 2.0, "finite elements, foot and bar as beams"),
    FE_FOOT_SPRING: EngineStyle("#009E73", (0, (1, 1.2)), 2.2, 2.6, "finite elements, foot as a 6×6 spring"),
    "opensees": EngineStyle("#7A5C00", (0, (6, 2)), 1.6, 2.3, "second finite element code"),
    REFINED: EngineStyle("#56B4E9", (0, (4, 2)), 1.8, 2.8, "lumped, 16 springs in bar and in foot"),
    FOOT_SPRING: EngineStyle("#0072B2", (0, (5, 1.5, 1, 1.5)), 1.5, 2.7, "lumped, 16 springs in bar, one in foot"),
    PAPER: EngineStyle("#D55E00", "-", 1.8, 3.0, "the paper's model, one spring a link"),
    LINEAR: EngineStyle("#8C8C8C", (0, (8, 3)), 1.1, 2.1, "linear, eq. (5)"),
    MSA: EngineStyle("#E69F00", (0, (2, 3)), 1.6, 2.1, "linear matrix structural analysis"),
}
"""In the order of legends and tables."""

PARTS = ("#D55E00", "#0072B2", "#009E73", "#E69F00", "#CC79A7", "#56B4E9", "#7A5C00", "#666666")
"""Colours of a machine's parts, of Okabe and Ito's palette but for the last two."""

EVENT_MARKERS = {EventKind.BIFURCATION: "o", EventKind.LIMIT: "^", EventKind.STIFFNESS_KNEE: "s"}

RC: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    # at the top; matplotlib measures all ticks to find that out
    "axes.titley": 1.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "xtick.direction": "out",
    "figure.facecolor": "white",
}


def engine_style(label: str) -> EngineStyle:
    """Style of an engine, a plain grey line for one that the report does not know."""
    return ENGINES.get(label, EngineStyle("#666666", "-", 1.2, 2.0, label))


def text_colour(colour: str) -> str:
    """A colour darkened until a text in it is read on white: WCAG 2.2 asks for a contrast of 4.5, lines for 3."""
    red, green, blue = to_rgb(colour)
    while 1.05 / (_luminance(red, green, blue) + 0.05) < READABLE:
        red, green, blue = 0.98 * red, 0.98 * green, 0.98 * blue
    return str(to_hex((red, green, blue)))


def _luminance(*colour: float) -> float:
    """Relative luminance of an sRGB colour, each part of which is 0 to 1."""
    linear = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in colour)
    return sum(share * part for share, part in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def engine_order(label: str) -> tuple[int, str]:
    """Sorting key: the order of `ENGINES`, engines that it does not know last, by name."""
    known = list(ENGINES)
    return (known.index(label) if label in ENGINES else len(known), label)


@dataclass(frozen=True)
class Margins:
    """Room around the axes of a figure, inches, where it is known beforehand what stands there.

    Attributes:
        left: for the first column's labels.
        across: between columns.
        between: between rows.
        right: beside the last column.
        bottom: below the last row.
        top: above the first row.
    """

    left: float = 0.8
    across: float = 0.8
    between: float = 0.35
    right: float = 0.12
    bottom: float = 0.42
    top: float = 0.26

    def apply(self, fig: Figure, rows: int, columns: int) -> None:
        """Place the axes."""
        width, height = fig.get_size_inches()
        wide = (width - self.left - self.right - (columns - 1) * self.across) / columns
        high = (height - self.bottom - self.top - (rows - 1) * self.between) / rows
        fig.subplots_adjust(
            self.left / width, self.bottom / height, 1.0 - self.right / width, 1.0 - self.top / height,
            self.across / wide, self.between / high,
        )  # fmt: skip


@contextmanager
def figure(
    height: float,
    columns: int = 2,
    *,
    rows: int = 1,
    sharey: bool = False,
    sharex: bool = True,
    widths: list[float] | None = None,
    margins: Margins | None = None,
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure of the page's width with its axes row by row, in the report's style, without pyplot's state.

    Without ``margins`` the labels are measured, which takes as long as to draw them.
    """
    with mpl.rc_context(RC):
        fig = Figure(figsize=(PAGE_WIDTH, height), layout="constrained" if margins is None else None)
        axes = fig.subplots(
            rows,
            columns,
            squeeze=False,
            sharex="col" if sharex else False,
            sharey="row" if sharey else False,
            width_ratios=widths,
        )
        if margins is not None:
            margins.apply(fig, rows, columns)
        yield fig, list(axes.flat)


def plain(text: str) -> str:
    """A text of a file as matplotlib draws it as it stands: between two $ it would read formulas."""
    return text.replace("$", r"\$")


def png(fig: Figure) -> bytes:
    """The figure as the bytes of a PNG file."""
    stream = io.BytesIO()
    with mpl.rc_context(RC):
        fig.savefig(stream, format="png", dpi=DPI)
    return stream.getvalue()


@dataclass(frozen=True)
class Drawing:
    """A figure as its files.

    Attributes:
        image: the bytes of a PNG file, or what makes them.
        vector: what a page embeds instead, where the figure has named lines.
    """

    image: bytes | Callable[[], bytes]
    vector: Vector | None = None

    @cached_property
    def png(self) -> bytes:
        """The bytes of a PNG file, drawn when they are first asked for: a page that has lines needs none."""
        return self.image if isinstance(self.image, bytes) else self.image()


def drawing_of(fig: Figure) -> Drawing:
    """The figure as PNG and, with its values, as SVG."""
    return Drawing(partial(png, fig), vector(fig, RC, DPI))


@dataclass(frozen=True)
class Picture:
    """One image of the report.

    Attributes:
        name: of its file, without ending.
        drawing: its files.
        title: what it shows.
        caption: what to see in it.
        scene: JSON of the three-dimensional scene that the page's script turns, see ``templates/page.js``; empty
            for a picture that stays as it is.
    """

    name: str
    drawing: Drawing
    title: str
    caption: str
    scene: str = ""

    @property
    def content(self) -> bytes:
        """The bytes of a PNG file."""
        return self.drawing.png
