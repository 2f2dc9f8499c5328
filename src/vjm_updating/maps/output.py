"""A map's files: CSV for people, VTK for ParaView, figures over planes of its grid, a render of the workspace.

Also the difference of two engines.
"""

from __future__ import annotations

import csv
import io
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vjm.io.files import write_whole
from vjm.rotations import Array
from vjm_output import optional_drawing
from vjm_output.optional_drawing import why_not
from vjm_updating.constants import shown
from vjm_updating.maps.evaluate import COLUMNS, NAMES, OK, SHOWN, TITLES, MapQuantity
from vjm_updating.maps.grid import TOOL
from vjm_updating.maps.run import MapResult


@dataclass(frozen=True)
class Difference:
    """How far the maps of two engines over one grid are apart, by their shown columns."""

    first: MapResult
    second: MapResult

    @property
    def labels(self) -> tuple[str, str]:
        """Of the engines."""
        return self.first.map.setting.engine.label, self.against

    @property
    def against(self) -> str:
        """Label of the second engine."""
        return self.second.map.setting.engine.label

    @property
    def why(self) -> list[str]:
        """``(g,)`` ``ok``, or which engine has no value and why."""
        labels, pairs = self.labels, zip(self.first.why, self.second.why, strict=True)
        return [
            next((f"{label}: {own}" for label, own in zip(labels, pair, strict=True) if own != OK), OK)
            for pair in pairs
        ]

    @property
    def both(self) -> tuple[Array, Array]:
        """Shown columns ``(g,)`` of the two."""
        shown = SHOWN[self.first.map.setting.quantity]
        return self.first.values[:, shown], self.second.values[:, shown]

    @property
    def percent(self) -> Array:
        """``(g,)`` of the second; nan where one of them has no value."""
        first, second = self.both
        with np.errstate(divide="ignore", invalid="ignore"):
            result: Array = 100.0 * (first - second) / np.abs(second)
        result[~np.isfinite(result)] = np.nan
        return result

    @property
    def words(self) -> str:
        """The mean and the worst pose in one line."""
        percent = self.percent
        if not np.isfinite(percent).any():
            return f"difference to {self.against}: no pose has a value by both"
        worst = int(np.nanargmax(np.abs(percent)))
        place = ", ".join(f"{v:.6g}" for v in self.first.map.points.places[worst])
        return (
            f"difference to {self.against}: {np.nanmean(np.abs(percent)):.3g} % on average, "
            f"{percent[worst]:+.3g} % at the worst pose, ({place}) mm"
        )


def write_difference(difference: Difference, folder: Path) -> tuple[list[Path], list[str]]:
    """Write ``difference.csv`` and ``difference.png``: the files, and a line that says why one is left out."""
    quantity, points = difference.first.map.setting.quantity, difference.first.map.points
    name, stream = COLUMNS[quantity][SHOWN[quantity]], io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    columns = (f"{name}:{label}" for label in difference.labels)
    writer.writerow(["x_mm", "y_mm", "z_mm", *columns, "difference_percent", "status"])
    percent = difference.percent
    rows = np.column_stack([points.places, *difference.both, percent])
    for row, why in zip(rows, difference.why, strict=True):
        writer.writerow([*(f"{v:.9g}" if np.isfinite(v) else "" for v in row), why])
    files = [folder / "difference.csv"]
    write_whole(files[0], stream.getvalue())
    title, axes = " against ".join(difference.labels), points.grid.ordered
    label = f"difference of the {TITLES[quantity].split(',')[0]}, %"
    drawn, left_out = _drawn(
        folder / "difference.png", axes, lambda: _picture(axes, [(title, percent)], label, spread=True)
    )
    return [*files, *drawn], left_out


def write_planes(
    file: Path,
    quantity: MapQuantity,
    axes: Mapping[str, Sequence[float]],
    panels: Sequence[tuple[str, Array, Sequence[tuple[str, str]]]],
) -> tuple[list[Path], list[str]]:
    """Write a figure of one map, or of those of several wrenches on one scale.

    ``axes`` are coordinates of the grid by name, the last running fastest; ``panels`` are titles, values (g, k),
    and g parts and kinds where the quantity has them. Returned are the file, or a line that says why there is none.
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
        return cube[tuple(slice(None) if n in self.varied else self.middle.get(n, 0) for n in self.axes)]


def _picture(
    axes: Mapping[str, Sequence[float]], panels: Sequence[tuple[str, Array]], label: str, *, spread: bool
) -> bytes:
    """Panels over a plane of the grid, and how values spread."""
    from vjm_output.plots import figure, plain, png

    plane = _Plane(axes)
    varied = plane.varied
    everything = np.concatenate([values for _, values in panels])
    low, high = _range(everything)
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
            drawn[-1].hist(everything[np.isfinite(everything)], bins="auto")
            drawn[-1].set(xlabel=label, ylabel="poses", title="all poses")
        return png(fig)


def _range(values: Array) -> tuple[float, float]:
    """From the least to the largest that is known."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)


SLICES = shown(3)
"""Panels of the figure: levels of z."""


def _levels(result: MapResult) -> bytes:
    """Levels of z side by side, one colour scale."""
    from vjm_output.plots import figure, plain, png

    wanted = result.map
    x, y, z = (np.array(axis) for axis in wanted.points.grid.ordered.values())
    cube = result.cube(SHOWN[wanted.setting.quantity])
    levels = sorted({round(float(k)) for k in np.linspace(0, len(z) - 1, min(SLICES, len(z)))})
    low, high = _range(cube)
    with figure(3.0, len(levels), sharey=True) as (fig, axes):
        for ax, level in zip(axes, levels, strict=True):
            image = ax.pcolormesh(
                x, y, cube[:, :, level].T, vmin=low, vmax=high, cmap="viridis", shading="nearest", rasterized=True
            )
            ax.set_title(f"z = {z[level]:g} mm")
            ax.set_xlabel("x, mm")
            ax.set_aspect("equal")
            # the cells are centred on the poses: what they reach beyond the outermost is no workspace
            ax.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
            ax.grid(False)
        axes[0].set_ylabel("y, mm")
        fig.colorbar(image, ax=axes, label=TITLES[wanted.setting.quantity], shrink=0.8)
        missing = sum(why != OK for why in result.why)
        white = f"; {missing} points without an answer are white" if missing else ""
        title = plain(f"{wanted.setting.machine.title}: {wanted.setting.engine.label}")
        fig.suptitle(title + white, fontsize=8.5)
        return png(fig)


def _render(result: MapResult) -> bytes:
    """The workspace in space, off the screen: three planes through its middle."""
    import pyvista
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    from vjm_output.plots import PAGE_WIDTH, figure, png

    wanted = result.map
    grid: Any = pyvista.RectilinearGrid(*(np.array(axis) for axis in wanted.points.grid.ordered.values()))
    column = SHOWN[wanted.setting.quantity]
    name = COLUMNS[wanted.setting.quantity][column]
    grid.point_data[name] = result.cube(column).ravel(order="F")
    plotter = optional_drawing.plotter((int(130 * PAGE_WIDTH), 700))
    plotter.background_color = "white"
    low, high = _range(result.cube(column))
    plotter.add_mesh(
        grid.slice_orthogonal(), scalars=name, clim=(low, high), cmap="viridis", lighting=False, nan_color="white",
        show_scalar_bar=False,
    )  # fmt: skip
    plotter.add_mesh(grid.outline(), color="#888888")
    plotter.show_bounds(
        xtitle="x, mm", ytitle="y, mm", ztitle="z, mm", color="black", font_size=10, location="outer"
    )
    plotter.view_isometric()
    picture = plotter.screenshot(return_img=True)
    plotter.close()
    with figure(0.8 * PAGE_WIDTH * picture.shape[0] / picture.shape[1], 1) as (fig, axes):
        axes[0].imshow(picture)
        axes[0].axis("off")
        colours = ScalarMappable(Normalize(low, high), "viridis")
        fig.colorbar(colours, ax=axes[0], label=TITLES[wanted.setting.quantity], shrink=0.7)
        return png(fig)


def _parts_picture(
    axes: Mapping[str, Sequence[float]], panels: Sequence[tuple[str, Array, Sequence[str]]]
) -> bytes:
    """Panels over a plane of the grid: a colour for each part, the stronger the larger its share."""
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch

    from vjm_output.plots import PARTS, figure, plain, png

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


RIGID = "empty_where_ok=rigid"
"""Of a map's file: an empty cell of a row with an answer is an infinite stiffness."""


def write_map(result: MapResult, folder: Path) -> tuple[list[Path], list[str]]:
    """Write ``map.csv``, and pictures where what makes them is there.

    ``map.vtr`` holds a grid of places; ``map.png`` shows levels of z side by side where x, y and z vary, else the
    first two axes that vary, the others in their middle; ``render.png`` a grid in space.

    Returns:
        The files, and for each that is left out a line that says why.
    """
    files, left_out = [folder / "map.csv"], list[str]()
    write_whole(files[0], csv_text(result))
    wanted = result.map
    if wanted.points.grid.tool:
        if why := why_not("pyvista"):
            left_out.append(f"no map.vtr: {why}")
        else:
            files.append(folder / "map.vtr")
            write_vtk(result, files[-1])
    in_space = wanted.points.grid.tool and len(wanted.points.grid.varied) == 3 and not result.names
    if not in_space:
        axes = {_axis_title(result, name): values for name, values in wanted.points.grid.ordered.items()}
        panel = (f"{wanted.setting.machine.name}, {wanted.setting.engine.label}", result.values, result.names)
        drawn, missing = write_planes(folder / "map.png", wanted.setting.quantity, axes, [panel])
        return [*files, *drawn], [*left_out, *missing]
    if why := why_not("matplotlib"):
        left_out.append(f"no map.png and no render.png: {why}")
        return files, left_out
    files.append(folder / "map.png")
    write_whole(files[-1], _levels(result))
    if why := why_not("pyvista") or optional_drawing.why_not_rendered():
        left_out.append(f"no render.png: {why}")
    else:
        files.append(folder / "render.png")
        write_whole(files[-1], _render(result))
    return files, left_out


def _axis_title(result: MapResult, name: str) -> str:
    if result.map.points.grid.tool:
        return f"{name}, mm"
    joint = next(joint for joint in result.map.setting.machine.moving if joint.name == name)
    return f"{name}, {'mm' if joint.slides else 'rad'}"


def csv_text(result: MapResult) -> str:
    """One row a point: joints that are set, place, values, and ``ok`` or why there are none."""
    stream = io.StringIO()
    wanted = result.map
    head = wanted.document
    stream.write(f"# model={head.model} engine={head.engine} quantity={head.quantity} version={head.version}")
    stream.write(f" model_sha256={head.model_sha256} wrench={','.join(f'{v:g}' for v in head.wrench)} {RIGID}\n")
    writer = csv.writer(stream, lineterminator="\n")
    joints, texts = result.joints, NAMES if result.names else ()
    columns = COLUMNS[wanted.setting.quantity]
    writer.writerow([*joints, "x_mm", "y_mm", "z_mm", *columns, *texts, "status"])
    numbers = np.column_stack([*joints.values(), wanted.points.places, result.values])
    for k, row in enumerate(numbers):
        words = result.names[k] if result.names else ()
        writer.writerow([*(f"{v:.9g}" if np.isfinite(v) else "" for v in row), *words, result.why[k]])
    return stream.getvalue()


def _sides(result: MapResult) -> list[Array]:
    """Coordinates along x, y and z, mm; of one that the grid leaves out the one value."""
    axes, places = result.map.points.grid.axes, result.map.points.places
    middle = np.nan_to_num(np.nanmean(places, axis=0)) if np.isfinite(places).any() else np.zeros(3)
    return [np.array(axes.get(name, (middle[k],))) for k, name in enumerate(TOOL)]


def write_vtk(result: MapResult, path: Path) -> None:
    """A rectilinear grid of places in VTK's XML format, one array a column; nan where there is no answer."""
    import pyvista

    grid = pyvista.RectilinearGrid(*_sides(result))
    for k, name in enumerate(COLUMNS[result.map.setting.quantity]):
        grid.point_data[name] = result.cube(k).ravel(order="F")
    grid.point_data["ok"] = (
        np.array([why == OK for why in result.why]).reshape(result.map.points.grid.shape).ravel(order="F")
    )
    with tempfile.TemporaryDirectory() as folder:
        # VTK writes to a name of its own choosing's ending, and does not say that a disk is full
        temporary = Path(folder) / path.name
        grid.save(temporary)
        content = temporary.read_bytes()
    if not content.rstrip().endswith(b"</VTKFile>"):
        raise OSError(f"{temporary}: could not be written whole: is the disk full?")
    write_whole(path, content)
