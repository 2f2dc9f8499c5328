"""Three-dimensional views of any machine: a picture, and a page whose view the reader turns."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence

import numpy as np

from vjm.rotations import Array
from vjm_output import off_screen
from vjm_output.templating import environment
from vjm_validation.report.machine_geometry import (
    BEAM,
    BODY,
    ELASTIC_JOINT,
    PASSIVE,
    RIGID,
    STIFF,
    Geometry,
    labels,
)

COLOURS = {
    BEAM: "#0072B2", RIGID: "#7f7f7f", BODY: "#009E73",
    ELASTIC_JOINT: "#D55E00", PASSIVE: "#CC79A7", STIFF: "#222222",
}  # fmt: skip
SPRING, MOVED = "#E69F00", "#000000"
AXES = (("x", "#cc2222"), ("y", "#229922"), ("z", "#2222cc"))
SIZE = (1000, 760)
"""Of a rendered picture, pixels."""


def rendered(shown: Geometry, moved: Sequence[Array] = (), *, names: bool = True) -> bytes:
    """A PNG of the machine, seen from above and the side.

    Args:
        shown: the machine.
        moved: lines ``(k, 3)`` of its deflected shape, mm, drawn in black over it.
        names: whether parts and joints are named.
    """
    import pyvista as pv  # takes seconds, and its library may be missing

    # VTK tries an X display first and would write about its absence on stderr
    size = shown.extent
    plotter = off_screen.plotter(SIZE)
    try:
        plotter.set_background("white")
        for line in shown.lines:
            if np.ptp(line.points, axis=0).max() > 1e-6 * size:
                tube = pv.Line(*line.points).tube(radius=size * (0.012 if line.kind == BEAM else 0.008))
                plotter.add_mesh(tube, color=COLOURS[line.kind])
        for joint in shown.joints:
            along = 0.03 * size * joint.axis
            if joint.slides:
                body = pv.Cube(center=joint.at, x_length=0.04 * size, y_length=0.04 * size, z_length=0.04 * size)
            else:
                body = pv.Cylinder(center=joint.at, direction=joint.axis, radius=0.022 * size, height=0.05 * size)
            plotter.add_mesh(body, color=COLOURS[joint.kind])
            plotter.add_mesh(pv.Line(joint.at - 2.0 * along, joint.at + 2.0 * along), color="black", line_width=2)
        for _, points in shown.springs:
            plotter.add_mesh(
                pv.MultipleLines(_coil(points[0], points[1], 0.015 * size)), color=SPRING, line_width=4
            )
        for T in (np.eye(4), *(T for _, T in shown.ends)):
            for k, (_, colour) in enumerate(AXES):
                plotter.add_mesh(pv.Line(T[:3, 3], T[:3, 3] + 0.1 * size * T[:3, k]), color=colour, line_width=5)
        for points in moved:
            if len(points) > 1 and np.ptp(points, axis=0).max() > 1e-6 * size:
                plotter.add_mesh(pv.MultipleLines(points), color=MOVED, line_width=5)
        if names:
            texts, places = zip(*labels(shown), strict=True)
            plotter.add_point_labels(
                np.array(places), list(texts), font_size=15, shape_opacity=0.6, shape_color="white", margin=2,
                show_points=False, always_visible=True, text_color="black",
            )  # fmt: skip
        plotter.enable_parallel_projection()
        plotter.view_isometric()
        plotter.camera.zoom(1.1)
        plotter.add_axes(line_width=3)
        image = np.asarray(plotter.screenshot(return_img=True))
    finally:
        plotter.close()
    from matplotlib.image import imsave

    stream = io.BytesIO()
    imsave(stream, image, format="png")
    return stream.getvalue()


def _coil(a: Array, b: Array, radius: float, turns: int = 8) -> Array:
    """A helix ``(k, 3)`` between two points."""
    along = b - a
    length = float(np.linalg.norm(along)) or 1.0
    e = along / length
    side = np.cross(e, np.eye(3)[int(np.argmin(np.abs(e)))])
    side /= np.linalg.norm(side)
    t = np.linspace(0.0, 1.0, 20 * turns)[:, None]
    round_about = 2.0 * np.pi * turns * t
    coil: Array = a + t * along + radius * (np.cos(round_about) * side + np.sin(round_about) * np.cross(e, side))
    return coil


def page(title: str, shown: Geometry) -> str:
    """A page that needs nothing else: the machine on a canvas, turned by dragging."""
    lines = [
        {
            "name": line.name,
            "colour": COLOURS[line.kind],
            "width": 7 if line.kind == BEAM else 4,
            "points": line.points.tolist(),
        }
        for line in shown.lines
    ]
    lines += [
        {
            "name": name,
            "colour": SPRING,
            "width": 2,
            "points": _coil(points[0], points[1], 0.015 * shown.extent).tolist(),
        }
        for name, points in shown.springs
    ]
    for joint in shown.joints:
        half = 0.05 * shown.extent * joint.axis
        lines.append(
            {"name": joint.name, "colour": COLOURS[joint.kind], "width": 11,
             "points": [(joint.at - 0.4 * half).tolist(), (joint.at + 0.4 * half).tolist()]}
        )  # fmt: skip
        lines.append(
            {
                "name": "",
                "colour": "#222222",
                "width": 1,
                "points": [(joint.at - half).tolist(), (joint.at + half).tolist()],
            }
        )
    for T in (np.eye(4), *(T for _, T in shown.ends)):
        lines += [
            {"name": "", "colour": colour, "width": 2,
             "points": [T[:3, 3].tolist(), (T[:3, 3] + 0.12 * shown.extent * T[:3, k]).tolist()]}
            for k, (_, colour) in enumerate(AXES)
        ]  # fmt: skip
    scene = {
        "lines": lines,
        "labels": [{"text": text, "at": at.tolist()} for text, at in labels(shown)],
        "centre": (0.5 * (shown.points.max(axis=0) + shown.points.min(axis=0))).tolist(),
    }
    kinds = [(kind, COLOURS[kind]) for kind in (BEAM, RIGID, BODY, ELASTIC_JOINT, PASSIVE, STIFF)]
    template = environment("vjm_validation.report").get_template("view.html.j2")
    # "<" could end the script that the scene stands in
    return template.render(title=title, kinds=kinds, scene=json.dumps(scene).replace("<", "\\u003c"))
