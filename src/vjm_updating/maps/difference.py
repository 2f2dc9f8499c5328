"""Maps side by side, and the difference of two engines."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vjm.io.files import write_whole
from vjm.rotations import Array
from vjm_output.optional_page import why_not
from vjm_updating.maps.evaluate import COLUMNS, OK, SHOWN, TITLES, MapQuantity


@dataclass(frozen=True)
class Difference:
    """How far two engines are apart.

    Attributes:
        engine: label of the first.
        against: label of the second.
        quantity: of both.
        axes: coordinates of the grid by name, in the order of the poses, the last running fastest.
        places: ``(g, 3)`` mm.
        first: shown column ``(g,)`` of the first.
        second: likewise of the second.
        why: why there is no difference, or ``ok``.
    """

    engine: str
    against: str
    quantity: MapQuantity
    axes: Mapping[str, Sequence[float]]
    places: Array
    first: Array
    second: Array
    why: Sequence[str]

    @property
    def percent(self) -> Array:
        """``(g,)`` of the second; nan where one of them has no value."""
        with np.errstate(divide="ignore", invalid="ignore"):
            result: Array = 100.0 * (self.first - self.second) / np.abs(self.second)
        result[~np.isfinite(result)] = np.nan
        return result

    @property
    def words(self) -> str:
        """The mean and the worst pose in one line."""
        percent = self.percent
        if not np.isfinite(percent).any():
            return f"difference to {self.against}: no pose has a value by both"
        worst = int(np.nanargmax(np.abs(percent)))
        place = ", ".join(f"{v:.6g}" for v in self.places[worst])
        return (
            f"difference to {self.against}: {np.nanmean(np.abs(percent)):.3g} % on average, "
            f"{percent[worst]:+.3g} % at the worst pose, ({place}) mm"
        )


def difference_of(
    engines: tuple[str, str], quantity: MapQuantity, axes: Mapping[str, Sequence[float]], places: Array,
    values: tuple[Array, Array], why: tuple[Sequence[str], Sequence[str]],
) -> Difference:  # fmt: skip
    """The difference of two maps over one grid.

    Args:
        engines: labels.
        quantity: of both.
        axes: see `Difference`.
        places: likewise.
        values: ``(g, k)`` of each.
        why: of each.
    """
    shown = SHOWN[quantity]
    reasons = [
        OK if a == b == OK else f"{engines[0]}: {a}" if a != OK else f"{engines[1]}: {b}"
        for a, b in zip(*why, strict=True)
    ]
    return Difference(*engines, quantity, axes, places, values[0][:, shown], values[1][:, shown], reasons)


def write_difference(found: Difference, folder: Path) -> tuple[list[Path], list[str]]:
    """Write ``difference.csv`` and ``difference.png``.

    Returns:
        The files, and for one that is left out a line that says why.
    """
    name, stream = COLUMNS[found.quantity][SHOWN[found.quantity]], io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(
        [
            "x_mm",
            "y_mm",
            "z_mm",
            f"{name}:{found.engine}",
            f"{name}:{found.against}",
            "difference_percent",
            "status",
        ]
    )
    for place, a, b, percent, why in zip(
        found.places, found.first, found.second, found.percent, found.why, strict=True
    ):
        numbers = (*place, a, b, percent)
        writer.writerow([*(f"{v:.9g}" if np.isfinite(v) else "" for v in numbers), why])
    files = [folder / "difference.csv"]
    write_whole(files[0], stream.getvalue())
    title = f"{found.engine} against {found.against}"
    return _drawn(files, folder / "difference.png", found.axes, [(title, found.percent)],
                  f"difference of the {TITLES[found.quantity].split(',')[0]}, %", spread=True)  # fmt: skip


def write_side_by_side(
    folder: Path, quantity: MapQuantity, axes: Mapping[str, Sequence[float]], panels: Sequence[tuple[str, Array]]
) -> tuple[list[Path], list[str]]:
    """Write ``side-by-side.png``: the maps of several wrenches on one scale.

    Args:
        folder: where.
        quantity: of all.
        axes: see `Difference`.
        panels: titles and values ``(g, k)``.
    """
    shown = [(title, values[:, SHOWN[quantity]]) for title, values in panels]
    return _drawn([], folder / "side-by-side.png", axes, shown, TITLES[quantity], spread=False)


def _drawn(
    files: list[Path], file: Path, axes: Mapping[str, Sequence[float]], panels: Sequence[tuple[str, Array]],
    label: str, *, spread: bool,
) -> tuple[list[Path], list[str]]:  # fmt: skip
    if why := why_not("matplotlib"):
        return files, [f"no {file.name}: {why}"]
    if not any(len(values) > 1 for values in axes.values()):
        return files, [f"no {file.name}: the grid has one pose"]
    write_whole(file, _picture(axes, panels, label, spread=spread))
    return [*files, file], []


def _picture(
    axes: Mapping[str, Sequence[float]], panels: Sequence[tuple[str, Array]], label: str, *, spread: bool
) -> bytes:
    """Panels over the first two axes with more than one value, the third in its middle; and how values spread."""
    from vjm_output.plot_style import figure, png

    varied = [name for name, values in axes.items() if len(values) > 1][:2]
    middle = {name: len(values) // 2 for name, values in axes.items() if len(values) > 1 and name not in varied}
    everything = np.concatenate([values for _, values in panels])
    finite = everything[np.isfinite(everything)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    with figure(3.2, len(panels) + spread) as (fig, drawn):
        for ax, (title, values) in zip(drawn, panels, strict=False):
            cube = values.reshape([len(each) for each in axes.values()])
            at = tuple(slice(None) if name in varied else middle.get(name, 0) for name in axes)
            x = np.array(axes[varied[0]])
            if len(varied) == 1:
                ax.plot(x, cube[at], "o-", ms=3)
                ax.set_ylabel(label)
            else:
                mesh = ax.pcolormesh(
                    x, np.array(axes[varied[1]]), cube[at].T, vmin=low, vmax=high, shading="nearest", cmap="viridis"
                )
                ax.set_ylabel(varied[1])
                fig.colorbar(mesh, ax=ax, label=label)
            beside = "; ".join(f"{name} = {axes[name][k]:g}" for name, k in middle.items())
            ax.set(xlabel=varied[0], title=f"{title}{', ' if beside else ''}{beside}")
        if spread:
            drawn[-1].hist(finite, bins="auto")
            drawn[-1].set(xlabel=label, ylabel="poses", title="all poses")
        return png(fig)
