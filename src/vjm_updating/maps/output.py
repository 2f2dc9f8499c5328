"""A map's files: CSV for people, VTK for ParaView, a figure and a render for the report."""

from __future__ import annotations

import csv
import io
import tempfile
from pathlib import Path

import numpy as np

from vjm.io.files import write_whole
from vjm.rotations import Array
from vjm_output import off_screen
from vjm_output.optional_page import why_not
from vjm_updating.maps.difference import write_planes
from vjm_updating.maps.evaluate import COLUMNS, NAMES, OK
from vjm_updating.maps.grid import TOOL
from vjm_updating.maps.run import MapResult

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
    from vjm_updating.maps.pictures import map_figure, render

    files.append(folder / "map.png")
    write_whole(files[-1], map_figure(result))
    if why := why_not("pyvista") or off_screen.why_not_rendered():
        left_out.append(f"no render.png: {why}")
    else:
        files.append(folder / "render.png")
        write_whole(files[-1], render(result))
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
