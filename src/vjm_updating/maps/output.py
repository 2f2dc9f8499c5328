"""A map's files: CSV for people, VTK for ParaView, a figure and a render for the report."""

from __future__ import annotations

import csv
import io
import tempfile
from pathlib import Path

import numpy as np

from vjm.io.files import write_whole
from vjm_output import off_screen
from vjm_output.optional_page import why_not
from vjm_updating.maps.evaluate import COLUMNS, OK
from vjm_updating.maps.run import MapResult


def write_map(result: MapResult, folder: Path) -> tuple[list[Path], list[str]]:
    """Write ``map.csv``, and ``map.vtr``, ``map.png`` and ``render.png`` where what makes them is there.

    Returns:
        The files, and for each that is left out a line that says why.
    """
    files, left_out = [folder / "map.csv"], []
    write_whole(files[0], csv_text(result))
    if why := why_not("pyvista"):
        left_out.append(f"no map.vtr: {why}")
    else:
        files.append(folder / "map.vtr")
        write_vtk(result, files[-1])
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


def csv_text(result: MapResult) -> str:
    """One row a pose: where, the values, and ``ok`` or why there are none."""
    stream = io.StringIO()
    wanted = result.map
    head = wanted.document
    stream.write(f"# model={head.model} engine={head.engine} quantity={head.quantity} version={head.version}")
    stream.write(f" model_sha256={head.model_sha256} wrench={','.join(f'{v:g}' for v in head.wrench)}\n")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["x_mm", "y_mm", "z_mm", *COLUMNS[wanted.quantity], "status"])
    for pose, row, why in zip(wanted.grid.poses(), result.values, result.why, strict=True):
        writer.writerow([*(f"{v:.9g}" for v in pose[:3]), *("" if np.isnan(v) else f"{v:.9g}" for v in row), why])
    return stream.getvalue()


def write_vtk(result: MapResult, path: Path) -> None:
    """A rectilinear grid in VTK's XML format, one array a column; nan where there is no answer."""
    import pyvista

    grid = pyvista.RectilinearGrid(*(np.array(axis) for axis in result.map.grid.axes))
    for k, name in enumerate(COLUMNS[result.map.quantity]):
        grid.point_data[name] = result.cube(k).ravel(order="F")
    grid.point_data["ok"] = (
        np.array([why == OK for why in result.why]).reshape(result.map.grid.shape).ravel(order="F")
    )
    with tempfile.TemporaryDirectory() as folder:
        # VTK writes to a name of its own choosing's ending, and does not say that a disk is full
        temporary = Path(folder) / path.name
        grid.save(temporary)
        content = temporary.read_bytes()
    if not content.rstrip().endswith(b"</VTKFile>"):
        raise OSError(f"{temporary}: could not be written whole: is the disk full?")
    write_whole(path, content)
