"""Figures of maps over planes of their grids, side by side too, and the difference of two engines."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
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
    label = f"difference of the {TITLES[found.quantity].split(',')[0]}, %"
    drawn, left_out = _drawn(
        folder / "difference.png", found.axes,
        lambda: _picture(found.axes, [(title, found.percent)], label, spread=True),
    )  # fmt: skip
    return [*files, *drawn], left_out


def write_planes(
    file: Path,
    quantity: MapQuantity,
    axes: Mapping[str, Sequence[float]],
    panels: Sequence[tuple[str, Array, Sequence[tuple[str, str]]]],
) -> tuple[list[Path], list[str]]:
    """Write a figure of one map, or of those of several wrenches on one scale.

    Args:
        file: that is written.
        quantity: of all.
        axes: see `Difference`.
        panels: titles, values ``(g, k)``, and g parts and kinds where the quantity has them.

    Returns:
        The file, or a line that says why it is left out.
    """
    shown = [(title, values[:, SHOWN[quantity]]) for title, values, _ in panels]
    if quantity is not MapQuantity.SHARES:
        return _drawn(file, axes, lambda: _picture(axes, shown, TITLES[quantity], spread=False))
    named = [
        (title, values, [f"{part} ({kind})" if part else "" for part, kind in names])
        for (title, values), (_, _, names) in zip(shown, panels, strict=True)
    ]
    return _drawn(file, axes, lambda: _parts_picture(axes, named))


def _drawn(
    file: Path, axes: Mapping[str, Sequence[float]], draw: Callable[[], bytes]
) -> tuple[list[Path], list[str]]:
    if why := why_not("matplotlib"):
        return [], [f"no {file.name}: {why}"]
    if not any(len(values) > 1 for values in axes.values()):
        return [], [f"no {file.name}: the grid has one pose"]
    write_whole(file, draw())
    return [file], []


@dataclass(frozen=True)
class _Plane:
    """What a figure shows of a grid: the first two axes with more than one value, the others in their middle."""

    axes: Mapping[str, Sequence[float]]

    @property
    def varied(self) -> list[str]:
        return [name for name, values in self.axes.items() if len(values) > 1][:2]

    @property
    def middle(self) -> dict[str, int]:
        return {n: len(v) // 2 for n, v in self.axes.items() if len(v) > 1 and n not in self.varied}

    @property
    def beside(self) -> str:
        """Where the others are, to stand behind a title."""
        return "".join(f"; {name} = {self.axes[name][k]:g}" for name, k in self.middle.items())

    def cut(self, values: Array) -> Array:
        """Of values ``(g, …)`` those on the plane, along the varied axes."""
        cube = values.reshape(*(len(each) for each in self.axes.values()), *values.shape[1:])
        result: Array = cube[tuple(slice(None) if n in self.varied else self.middle.get(n, 0) for n in self.axes)]
        return result


def _picture(
    axes: Mapping[str, Sequence[float]], panels: Sequence[tuple[str, Array]], label: str, *, spread: bool
) -> bytes:
    """Panels over a plane of the grid, and how values spread."""
    from vjm_output.plot_style import figure, plain, png

    plane = _Plane(axes)
    varied = plane.varied
    everything = np.concatenate([values for _, values in panels])
    finite = everything[np.isfinite(everything)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    with figure(3.2, len(panels) + spread) as (fig, drawn):
        for ax, (title, values) in zip(drawn, panels, strict=False):
            x = np.array(axes[varied[0]])
            if len(varied) == 1:
                ax.plot(x, plane.cut(values), "o-", ms=3)
                ax.set_ylabel(label)
            else:
                mesh = ax.pcolormesh(
                    x, np.array(axes[varied[1]]), plane.cut(values).T, vmin=low, vmax=high, shading="nearest",
                    cmap="viridis",
                )  # fmt: skip
                ax.set_ylabel(varied[1])
                fig.colorbar(mesh, ax=ax, label=label)
            ax.set(xlabel=varied[0], title=plain(f"{title}{plane.beside}"))
        if spread:
            drawn[-1].hist(finite, bins="auto")
            drawn[-1].set(xlabel=label, ylabel="poses", title="all poses")
        return png(fig)


def _parts_picture(
    axes: Mapping[str, Sequence[float]], panels: Sequence[tuple[str, Array, Sequence[str]]]
) -> bytes:
    """Panels over a plane of the grid: a colour for each part, the stronger the larger its share."""
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch

    from vjm_output.plot_style import PARTS, figure, plain, png

    plane = _Plane(axes)
    varied = plane.varied
    counts = Counter(name for _, _, names in panels for name in names if name)
    named = [name for name, _ in counts.most_common()]
    # the last colour is for all that have none of their own
    colours = {name: PARTS[min(k, len(PARTS) - 1)] for k, name in enumerate(named)}
    legend = {colour: plain(name) for name, colour in colours.items()}
    if len(named) > len(PARTS):
        legend[PARTS[-1]] = "others"
    with figure(3.4, len(panels)) as (fig, drawn):
        for ax, (title, values, names) in zip(drawn, panels, strict=True):
            own = np.array([to_rgb(colours.get(name, "white")) for name in names])
            x = np.array(axes[varied[0]])
            if len(varied) == 1:
                ax.plot(x, plane.cut(values), color="#8C8C8C", lw=1.0)
                ax.scatter(x, plane.cut(values), c=plane.cut(own), s=18.0, zorder=3)
                ax.set(ylabel="largest share in the strain energy", ylim=(0.0, 1.05))
            else:
                share = np.nan_to_num(values)[:, None]
                mixed = 1.0 - share * (1.0 - own)
                ax.pcolormesh(x, np.array(axes[varied[1]]), np.swapaxes(plane.cut(mixed), 0, 1), shading="nearest")
                ax.set_ylabel(varied[1])
                ax.grid(False)
            ax.set(xlabel=varied[0], title=plain(f"{title}{plane.beside}"))
        handles = [Patch(color=colour, label=name) for colour, name in legend.items()]
        if handles:
            said = "part with the largest share: the stronger its colour, the larger its share (full: 100 %)"
            fig.legend(handles=handles, loc="outside lower center", ncols=3, title=said if len(varied) == 2 else "")
        return png(fig)
