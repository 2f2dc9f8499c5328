"""What all results share.

Each gives a table of its figures, as plain Python, as a data frame, as HTML in a notebook, and as a figure.

Matplotlib and pandas are imported only when they are asked for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from vjm.rotations import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from pandas import DataFrame as DataFrame


WRENCH_ROWS = ("fx_N", "fy_N", "fz_N", "mx_Nmm", "my_Nmm", "mz_Nmm")
DISPLACEMENT_COLUMNS = ("ux_mm", "uy_mm", "uz_mm", "rx_rad", "ry_rad", "rz_rad")
NOTHING = 1e-10
"""Of the largest component: below it others are zero but for rounding."""


def frame_of(
    rows: Sequence[Mapping[str, Any]] | Mapping[str, Any] | Array,
    index: Sequence[str] | None = None,
    columns: Sequence[str] | None = None,
) -> DataFrame:
    """A pandas DataFrame.

    Raises:
        ImportError: pandas is not installed.
    """
    try:
        import pandas as pd
    except ModuleNotFoundError:
        raise ImportError("tables need pandas: pip install pandas") from None
    return pd.DataFrame(rows, index=index, columns=columns)


def bars(names: Sequence[str], values: Array, label: str, ax: Axes | None = None) -> Axes:
    """A bar for each name, the first one on top.

    Raises:
        ImportError: matplotlib is not installed.
    """
    ax = axes_or_new(ax)
    ax.barh(range(len(names)), values, tick_label=list(names))
    ax.invert_yaxis()
    ax.set_xlabel(label)
    return ax


def scatter(
    x: tuple[str, Array], y: tuple[str, Array], marked: np.ndarray, mark: str, ax: Axes | None = None
) -> Axes:
    """Points of two columns by their names, some of them marked.

    Raises:
        ImportError: matplotlib is not installed.
    """
    ax = axes_or_new(ax)
    for own, words in ((~marked, ""), (marked, mark)):
        ax.plot(x[1][own], y[1][own], "o", markersize=4, label=words)
    ax.set_xlabel(x[0])
    ax.set_ylabel(y[0])
    if marked.any():
        ax.legend()
    return ax


def axes_or_new(ax: Axes | None) -> Axes:
    """Axes, or those of a new figure.

    Raises:
        ImportError: matplotlib is not installed.
    """
    if ax is not None:
        return ax
    try:
        import matplotlib.pyplot as plt
    except ModuleNotFoundError:
        raise ImportError("figures need matplotlib: pip install 'vjm-stiffness[report]'") from None
    new: Axes = plt.subplots(figsize=(5.0, 3.4), layout="constrained")[1]
    return new


def rounded(values: Array) -> str:
    """Six components to five digits, zero where they are so but for rounding beside the largest."""
    size = np.abs(values).max()
    return " ".join(f"{v:.5g}" for v in np.where(np.abs(values) < NOTHING * size, 0.0, values) + 0.0)


def table_html(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows as an HTML table, numbers to five digits."""
    head = "".join(f"<th>{escape(str(name))}</th>" for name in rows[0])
    body = "".join("<tr>" + "".join(f"<td>{escape(_cell(v))}</td>" for v in row.values()) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _cell(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:.5g}" if isinstance(value, float) else str(value)


class Outcome(ABC):
    """A result that shows itself as a table.

    Example:
        >>> import vjm
        >>> sweep = vjm.sweep("planar-2r", {"tool.mass_kg": [1.0]}, ["mass"])
        >>> isinstance(sweep, vjm.Outcome), len(sweep.table())
        (True, 1)
    """

    @abstractmethod
    def table(self) -> list[dict[str, Any]]:
        """The figures, one row each of columns by name; the names say the units."""

    def to_dict(self) -> dict[str, Any]:
        """All that was found by the names of the attributes, as dictionaries, lists, texts and numbers."""
        result: dict[str, Any] = plain(self)
        return result

    def to_frame(self) -> DataFrame:
        """`table` as a pandas DataFrame.

        Raises:
            ImportError: pandas is not installed.
        """
        return frame_of(self.table())


def plain(value: object) -> Any:  # noqa: ANN401
    """A value as dictionaries, lists, texts and numbers; complex numbers as real and imaginary part.

    Example:
        >>> plain({("A", "x"): np.array([1.0, 2.0]), "b": 3j})
        {'A, x': [1.0, 2.0], 'b': [0.0, 3.0]}
    """
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, Enum | str):
        return str(value)
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {", ".join(name) if isinstance(name, tuple) else str(name): plain(v) for name, v in value.items()}
    if isinstance(value, Collection):
        return [plain(each) for each in value]
    if is_dataclass(value):
        return {each.name: plain(getattr(value, each.name)) for each in fields(value)}
    return str(value)
