"""A map's pictures: a figure, and a render of the workspace."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from vjm_output import optional_drawing
from vjm_output.plots import PAGE_WIDTH, figure, plain, png
from vjm_updating.constants import shown
from vjm_updating.maps.evaluate import COLUMNS, OK, SHOWN, TITLES
from vjm_updating.maps.run import MapResult

SLICES = shown(3)
"""Panels of the figure: levels of z."""


def map_figure(result: MapResult) -> bytes:
    """Levels of z side by side, one colour scale."""
    wanted = result.map
    x, y, z = (np.array(axis) for axis in wanted.points.grid.ordered.values())
    cube = result.cube(SHOWN[wanted.setting.quantity])
    levels = sorted({round(float(k)) for k in np.linspace(0, len(z) - 1, min(SLICES, len(z)))})
    finite = cube[np.isfinite(cube)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
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


def render(result: MapResult) -> bytes:
    """The workspace in space, off the screen: three planes through its middle."""
    import pyvista

    wanted = result.map
    grid: Any = pyvista.RectilinearGrid(*(np.array(axis) for axis in wanted.points.grid.ordered.values()))
    column = SHOWN[wanted.setting.quantity]
    name = COLUMNS[wanted.setting.quantity][column]
    grid.point_data[name] = result.cube(column).ravel(order="F")
    plotter = optional_drawing.plotter((int(130 * PAGE_WIDTH), 700))
    plotter.background_color = "white"
    values = result.cube(column)[np.isfinite(result.cube(column))]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    plotter.add_mesh(
        grid.slice_orthogonal(),
        scalars=name,
        clim=(low, high),
        cmap="viridis",
        lighting=False,
        nan_color="white",
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
        fig.colorbar(
            ScalarMappable(Normalize(low, high), "viridis"),
            ax=axes[0],
            label=TITLES[wanted.setting.quantity],
            shrink=0.7,
        )
        return png(fig)
