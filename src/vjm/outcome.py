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
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from vjm.model.load_case import COMPONENTS, LoadCase
from vjm.rotations import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from pandas import DataFrame as DataFrame


WRENCH_ROWS = ("fx_N", "fy_N", "fz_N", "mx_Nmm", "my_Nmm", "mz_Nmm")
DISPLACEMENT_COLUMNS = ("ux_mm", "uy_mm", "uz_mm", "rx_rad", "ry_rad", "rz_rad")
NOTHING = 1e-10
"""Of the largest component: below it others are zero but for rounding."""
ROWS = 12
"""Points of a path that its HTML shows."""


class RampedPoint(Protocol):
    """An equilibrium on a path; see `vjm.continuation.path.Equilibrium`."""

    @property
    def ramp(self) -> float:
        """Driven displacement or load factor."""


class Located(Protocol):
    """A critical point as figures mark it; see `vjm.continuation.path.Event`."""

    @property
    def s(self) -> float:
        """Ramp."""

    @property
    def force(self) -> float:
        """Driven force."""

    @property
    def point(self) -> RampedPoint | None:
        """Its equilibrium, where it was kept."""


class Traced(Protocol):
    """A path as tables and figures show it; see `vjm.continuation.path.Path`."""

    @property
    def engine(self) -> str:
        """Its label."""

    @property
    def load_case(self) -> LoadCase:
        """What was done."""

    @property
    def points(self) -> Sequence[object]:
        """Equilibria."""

    @property
    def events(self) -> Sequence[Located]:
        """Critical points."""

    @property
    def s(self) -> Array:
        """Ramp made positive ``(n,)``."""

    @property
    def ramp(self) -> Array:
        """Ramp ``(n,)``."""

    @property
    def displacement(self) -> Array:
        """Of the end-effector ``(n, 6)``."""

    @property
    def wrench(self) -> Array:
        """On the end-effector ``(n, 6)``."""

    @property
    def force(self) -> Array:
        """Driven force ``(n,)``."""

    @property
    def tangent(self) -> Array:
        """Its slope ``(n,)``."""

    @property
    def unstable(self) -> Array:
        """Unstable modes ``(n,)``."""

    @property
    def eigenvalue_relative(self) -> Array:
        """Smallest stability eigenvalue over its first ``(n,)``."""


class Compared(Protocol):
    """A loaded stiffness beside the unloaded one; see `vjm.analysis.LoadedStiffness`."""

    @property
    def unloaded(self) -> Array:
        """``(6, 6)``."""

    @property
    def loaded(self) -> Array:
        """``(6, 6)``."""


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


def path_columns(path: Traced) -> dict[str, Any]:
    """Columns of a path under the names of a curve file, each ``(n,)``."""
    columns: dict[str, Any] = {"s": path.s}
    columns |= dict(zip(DISPLACEMENT_COLUMNS, path.displacement.T, strict=True))
    columns |= dict(zip(WRENCH_ROWS, path.wrench.T, strict=True))
    columns |= {"force": path.force, "k_N_per_mm": path.tangent, "unstable_modes": path.unstable}
    return columns | {"lambda_min_rel": path.eigenvalue_relative}


def path_unit(path: Traced) -> str:
    """Unit of the ramp: ``mm`` or ``rad``; of a driven load ``N``, ``N mm``, or nothing for a load factor."""
    driven = path.load_case.driven
    return driven.unit if path.load_case.load_driven else driven.along


def path_plot(path: Traced, ax: Axes | None = None, label: str = "") -> Axes:
    """Driven force over ramp, unstable stretches dotted, critical points marked.

    Raises:
        ImportError: matplotlib is not installed.
    """
    ax = axes_or_new(ax)
    line = ax.plot(path.ramp, path.force, label=label or f"{path.load_case.posture}, {path.engine}")[0]
    lost = path.unstable > 0
    if lost.any():
        ax.plot(np.where(lost, path.ramp, np.nan), np.where(lost, path.force, np.nan), "w:", linewidth=1.0)
    for event in path.events:
        ramp = event.point.ramp if event.point else event.s
        ax.plot(ramp, event.force, "o", color=line.get_color(), markersize=4)
    driven = path.load_case.driven
    load = f"{driven.name}, {driven.unit}" if driven.unit else driven.name
    ax.set_xlabel(load if path.load_case.load_driven else f"displacement, {driven.along}")
    ax.set_ylabel(load)
    ax.legend()
    return ax


def stiffness_plot(result: Compared, ax: Axes | None = None) -> Axes:
    """Diagonal of the loaded stiffness over that of the unloaded one.

    Raises:
        ImportError: matplotlib is not installed.
    """
    ax = axes_or_new(ax)
    before = np.diag(result.unloaded)
    ratio = np.divide(np.diag(result.loaded), before, out=np.full(6, np.nan), where=np.abs(before) > 0.0)
    ax.bar(COMPONENTS, ratio)
    ax.axhline(1.0, color="k", linewidth=0.7)
    ax.set_ylabel("loaded over unloaded stiffness")
    return ax


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


def stiffness_frame(result: Compared) -> DataFrame:
    """The loaded stiffness as a pandas DataFrame.

    Raises:
        ImportError: pandas is not installed.
    """
    return frame_of(result.loaded, WRENCH_ROWS, DISPLACEMENT_COLUMNS)


def stiffness_html(result: Compared) -> str:
    """The loaded stiffness as an HTML table under one line of words."""
    return f"<pre>{escape(repr(result))}</pre>{table_html(stiffness_rows(result))}"


def stiffness_rows(result: Compared) -> list[dict[str, Any]]:
    """The loaded stiffness, a row for each component of the wrench, its name first."""
    return [
        {"": name, **dict(zip(DISPLACEMENT_COLUMNS, line, strict=True))}
        for name, line in zip(WRENCH_ROWS, result.loaded.tolist(), strict=True)
    ]


def path_html(path: Traced) -> str:
    """A path's words, and a few of its points as an HTML table."""
    columns = path_columns(path)
    n = len(path.points)
    some = sorted({round(k * (n - 1) / (ROWS - 1)) for k in range(ROWS)})
    shown = ("s", "force", "k_N_per_mm", "unstable_modes")
    rows = [{name: columns[name][i] for name in shown} for i in some]
    return f"<pre>{escape(repr(path))}</pre>{table_html(rows)}"


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
