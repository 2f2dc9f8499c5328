"""Off-screen pictures of the deformed chain: two models over each other, displacements magnified."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from vjm.continuation.direction import Direction
from vjm.continuation.path import Equilibrium, Event, Path
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_output import off_screen
from vjm_output.number_text import listed, number
from vjm_output.plot_style import FE, PAGE_WIDTH, PAPER, REFINED, Drawing, Picture, engine_style, figure, png
from vjm_validation.report.figures import postures
from vjm_validation.report.scenes import Draw, turnable
from vjm_validation.report.skeleton import (
    Camera,
    Skeleton,
    magnification,
    picture_axes,
    ruler_length,
    skeleton,
)
from vjm_validation.studies.study_results import Key, Run

GHOST, BASE, JOINT, TOOL = "#a8a8a8", "#222222", "#CC79A7", "#009E73"
WIDTH = 660
"""Of one rendered panel, pixels: as many as it has in the picture, so that nothing has to be interpolated."""


def render_pictures(run: Run) -> list[Picture]:
    """Compression of every posture, and the tension in which the paper's model buckles."""
    pictures = []
    for posture in postures(run):
        wanted = [(Direction.COMPRESSION, REFINED)]
        paper = run.paths.get(Key(posture, Direction.TENSION, PAPER))
        if paper is not None and paper.critical and paper.critical.switched:
            wanted.append((Direction.TENSION, PAPER))
        for direction, label in wanted:
            paths = {engine: run.paths.get(Key(posture, direction, engine)) for engine in (FE, label)}
            usable = {engine: path for engine, path in paths.items() if path is not None and path.stations}
            if usable:
                pictures.append(_picture(run.chain, posture, direction, usable))
    return pictures


def _picture(chain: Machine, posture: str, direction: Direction, paths: Mapping[str, Path]) -> Picture:
    what = (
        "The rigid link of the paper's model leans to one side and the spring at its end (thin) bridges "
        "the gap to the tool: leaning moves the pins apart, so that pulling makes it lean. The beam does not."
        if PAPER in paths
        else "The tube is the finite elements' line; the beads bound the lumped model's segments."
    )
    return rendered_states(
        f"{posture}_{direction}",
        f"Posture {posture}, {direction}",
        what,
        paths,
        lambda path, point: skeleton(chain, path, point),
        picture_axes,
        turnable(chain, paths),
    )


def rendered_states(
    name: str,
    title: str,
    what: str,
    paths: Mapping[str, Path],
    draw: Draw,
    axes_of: Callable[[Sequence[Skeleton]], tuple[Array, Array]],
    scene: str,
) -> Picture:
    """Models over each other at the critical point, where there is one, and at the end of their paths.

    Args:
        name: of the picture.
        title: what is loaded and how.
        what: to see in it.
        paths: by engine label.
        draw: the lines of a path's machine at one of its points.
        axes_of: right and up ``(3,)`` of the view.
        scene: JSON of the same for the page's script.
    """
    states = _states(paths)
    drawn = [{label: draw(paths[label], point) for label, point in points.items()} for points in states.values()]
    right, up = axes_of(list(drawn[-1].values()))
    ruler = ruler_length(list(drawn[-1].values()))
    factors = [magnification(list(group.values())) for group in drawn]
    scenes = _cropped(
        [
            _scene(group, times, Camera.framing(right, up, list(group.values()), times), ruler)
            for group, times in zip(drawn, factors, strict=True)
        ]
    )
    height, width = scenes[0].shape[:2]
    with figure(PAGE_WIDTH / len(drawn) * height / width + 1.6, len(drawn)) as (fig, axes):
        for ax, heading, times, shown in zip(axes, states, factors, scenes, strict=True):
            ax.imshow(shown, interpolation="nearest")
            ax.set(xticks=[], yticks=[])
            ax.spines[:].set_visible(False)
            ax.set_title(f"{heading}\ndisplacements drawn {times} × their size", fontsize=8.5)
        fig.suptitle(title, fontsize=10, fontweight="bold")
        fig.legend(handles=_legend(paths, ruler), loc="outside lower center", ncols=3, fontsize=7.5)
        content = Drawing(png(fig))
    return Picture(
        name,
        content,
        f"{title}: {' and '.join(paths)}",
        f"Displacements are drawn {listed([str(times) for times in factors])} times their size, as the "
        f"panels say; the machine itself is to scale. {what}",
        scene,
    )


def _states(paths: Mapping[str, Path]) -> dict[str, dict[str, Equilibrium]]:
    """The states to draw by title: critical, where there is such a point with a shape, and the end.

    A path without a critical point shows its state at the other's.
    """
    states = {}
    events = {label: path.critical for label, path in paths.items() if path.critical and path.critical.point}
    if events:
        first = min(event.s for event in events.values())
        states["\n".join(_critical_title(label, events.get(label), first) for label in paths)] = {
            label: _critical_state(path, events.get(label), first) for label, path in paths.items()
        }
    title = "\n".join(
        f"{label}: end, {path.s[-1]:g} mm, {number(path.force[-1])} N" for label, path in paths.items()
    )
    states[title] = {label: path.points[-1] for label, path in paths.items()}
    return states


def _critical_title(label: str, event: Event | None, s: float) -> str:
    if event is None:
        return f"{label}: no critical point, shown near {number(s)} mm"
    return f"{label}: {event.kind}, {number(event.s)} mm, {number(event.force)} N"


def _critical_state(path: Path, event: Event | None, s: float) -> Equilibrium:
    if event is not None and event.point is not None:
        return event.point
    return path.points[int(np.argmin(np.abs(path.s - s)))]


def _cropped(scenes: list[np.ndarray]) -> list[np.ndarray]:
    """The scenes without the empty rows above and below that all of them have."""
    used = np.flatnonzero(np.any([np.any(scene < 250, axis=(1, 2)) for scene in scenes], axis=0))
    first, last = max(0, used[0] - 10), used[-1] + 10
    return [scene[first:last] for scene in scenes]


def _scene(group: Mapping[str, Skeleton], times: float, camera: Camera, ruler: float) -> np.ndarray:
    """One rendered panel ``(h, w, 3)``."""
    pv = _pyvista()
    unit = 0.011 * camera.half_width
    plotter = off_screen.plotter((WIDTH, WIDTH))
    try:
        plotter.set_background("white")
        plotter.enable_anti_aliasing("ssaa")
        rest = next(iter(group.values()))
        _tubes(plotter, rest, 0.0, GHOST, 1.3 * unit)
        for label, one in group.items():
            colour = engine_style(label).colour
            at = one.at(times)
            if one.beads:
                _balls(plotter, at, 1.7 * unit, colour)
            else:
                _tubes(plotter, one, times, colour, 1.1 * unit)
            _balls(plotter, at[list(one.joints)], 2.6 * unit, JOINT)
            tool = pv.Cone(
                center=at[-1] + 4.5 * unit * camera.right,
                direction=camera.right,
                height=6.0 * unit,
                radius=3.0 * unit,
            )
            plotter.add_mesh(tool, color=TOOL)
        size = 7.0 * unit
        cube = pv.Cube(center=rest.points[0], x_length=size, y_length=size, z_length=size)
        plotter.add_mesh(cube, color=BASE)
        below = camera.half_height + 0.1 * camera.half_width
        corner = camera.focus + camera.half_width * camera.right - below * camera.up
        plotter.add_mesh(pv.Line(corner - ruler * camera.right, corner), color="black", line_width=4)
        low = 0.5 - 0.5 * below / (1.15 * camera.half_width)
        plotter.add_axes(line_width=3, viewport=(0.0, low - 0.02, 0.16, low + 0.14))
        plotter.enable_parallel_projection()
        plotter.camera.focal_point = camera.focus
        plotter.camera.position = camera.focus + 10.0 * camera.half_width * camera.towards_viewer
        plotter.camera.up = camera.up
        plotter.camera.parallel_scale = 1.15 * max(camera.half_width, camera.half_height)
        plotter.reset_camera_clipping_range()
        return np.asarray(plotter.screenshot(return_img=True))
    finally:
        plotter.close()


def _pyvista() -> Any:  # noqa: ANN401
    """The graphics library, loaded only where something is rendered, and silent."""
    import pyvista

    # VTK tries an X display first and would write about its absence on stderr
    pyvista.vtk_verbosity("off")
    return pyvista


def _tubes(plotter: Any, one: Skeleton, times: float, colour: str, radius: float) -> None:  # noqa: ANN401
    pv = _pyvista()
    at = one.at(times)
    for first, last, thin in one.pieces:
        points = at[first:last]
        if np.max(np.ptp(points, axis=0)) > 1e-6:
            tube = pv.MultipleLines(points).tube(radius=radius * (0.45 if thin else 1.0))
            plotter.add_mesh(tube, color=colour)


def _balls(plotter: Any, at: Array, radius: float, colour: str) -> None:  # noqa: ANN401
    pv = _pyvista()
    if len(at):
        ball = pv.Sphere(radius=radius, theta_resolution=20, phi_resolution=20)
        plotter.add_mesh(pv.PolyData(at).glyph(geom=ball, scale=False, orient=False), color=colour)


def _legend(paths: Mapping[str, Path], ruler: float) -> list[Any]:
    handles: list[Any] = [Line2D([], [], color=GHOST, lw=3.5, label="unloaded")]
    for label in paths:
        style = engine_style(label)
        mark: dict[str, Any] = (
            {"ls": "-", "lw": 3.0} if label in (FE, PAPER) else {"ls": ":", "lw": 0.0, "marker": "o", "ms": 6}
        )
        handles.append(Line2D([], [], color=style.colour, label=f"{label}: {style.title}", **mark))
    return [
        *handles,
        Line2D([], [], ls="", marker="o", ms=8, color=JOINT, label="passive joints"),
        Line2D([], [], ls="", marker="s", ms=8, color=BASE, label="base"),
        Line2D([], [], ls="", marker=">", ms=8, color=TOOL, label="tool"),
        Line2D([], [], color="black", lw=2, label=f"ruler: {ruler:g} mm of the machine"),
    ]
