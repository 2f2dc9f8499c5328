"""Views of any machine in space: what of it is drawn, a picture, and a page whose view the reader turns."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import assert_never

import numpy as np

from vjm.model.machine import ATTACHMENT, PLATFORM, ROOT, Machine, legs_of, named
from vjm.model.parts import Beam, Joint, RigidOffset
from vjm.rotations import Array, translation
from vjm_output import optional_drawing
from vjm_output.templating import environment

# --- What of any machine is drawn: lines of its parts, joints with their axes, springs, end frames, names ---------

BEAM, RIGID, BODY = "beam", "rigid", "body"
"""Kinds of lines."""
ELASTIC_JOINT, PASSIVE, STIFF = "elastic joint", "passive joint", "rigid drive"
"""Kinds of joints."""


@dataclass(frozen=True)
class DrawnLine:
    """A part between two points ``(2, 3)``, mm, world."""

    name: str
    kind: str
    points: Array


@dataclass(frozen=True)
class DrawnJoint:
    """A joint at a point ``(3,)`` mm with its axis ``(3,)``, world; it slides along it or turns about it."""

    name: str
    kind: str
    position: Array
    axis: Array
    slides: bool


@dataclass
class Geometry:
    """A machine as lines to draw, without load.

    Attributes:
        lines: its parts.
        joints: its joints.
        springs: between two points ``(2, 3)`` mm, by name.
        ends: end frames ``(4, 4)`` by name.
    """

    lines: list[DrawnLine] = field(default_factory=list)
    joints: list[DrawnJoint] = field(default_factory=list)
    springs: list[tuple[str, Array]] = field(default_factory=list)
    ends: list[tuple[str, Array]] = field(default_factory=list)

    @property
    def points(self) -> Array:
        """All points ``(k, 3)`` that the drawing must hold."""
        point_sets = [line.points for line in self.lines] + [points for _, points in self.springs]
        point_sets += [joint.position[None] for joint in self.joints] + [T[:3, 3][None] for _, T in self.ends]
        return np.vstack(point_sets) if point_sets else np.zeros((1, 3))

    @property
    def extent(self) -> float:
        """Largest side of the box around it, mm."""
        return max(1.0, float(np.ptp(self.points, axis=0).max()))


def geometry(machine: Machine, posture: str) -> Geometry:
    """What is drawn of a machine in a posture.

    Raises:
        KeyError: the machine has no such posture.
    """
    drawing = Geometry()
    values = dict(zip((joint.name for joint in machine.joints), machine.posture(posture), strict=True))
    frames = _draw(machine.at(posture), values, machine.base, drawing)
    for spring in machine.point_springs:
        points = np.array(
            [(frames[name][0] @ np.append(p, 1.0))[:3] for name, p in zip(spring.parts, spring.points, strict=True)]
        )
        drawing.springs.append((spring.name, points))
    _draw_bodies(machine, frames, drawing)
    last = machine.parts[-1].name
    drawing.ends = [(name, frames[part][1]) for name, part in (machine.ends or {_end_name(machine): last}).items()]
    return drawing


def _end_name(machine: Machine) -> str:
    return PLATFORM if machine.parts[-1].name == PLATFORM else "tool"


def _body(machine: Machine, carrier: str) -> str:
    """Name of the rigid body behind a part: of what carries the platform that, of an attachment its leg's."""
    if machine.parts[-1].name == PLATFORM and machine.predecessors[PLATFORM] == carrier:
        return PLATFORM
    return carrier.removesuffix(f"/{ATTACHMENT}")


def _draw_bodies(machine: Machine, frames: dict[str, tuple[Array, Array]], drawing: Geometry) -> None:
    """Lines of rigid bodies: from what carries them, and to the frames by which closures hold them."""
    legs = [leg.name for leg in legs_of(machine)]
    hidden, attachments = ({named(leg, part) for leg in legs} for part in (ROOT, ATTACHMENT))
    drawing.lines = [
        replace(line, name=_body(machine, line.name), kind=BODY) if line.name in attachments else line
        for line in drawing.lines
        if line.name not in hidden
    ]
    for closure in machine.closures:
        for part, frame in zip(closure.parts, closure.frames, strict=True):
            end = frames[part][1]
            point = (end @ frame)[:3, 3]
            if part and np.linalg.norm(point - end[:3, 3]) > 1e-6:
                drawing.lines.append(DrawnLine(_body(machine, part), BODY, np.array([end[:3, 3], point])))


def _draw(
    chain: Machine, values: dict[str, float], base: Array, drawing: Geometry
) -> dict[str, tuple[Array, Array]]:
    """Add a chain's parts; frames where each begins, joints behind their motion, and ends, by name."""
    frames: dict[str, tuple[Array, Array]] = {"": (np.eye(4), base)}
    before = chain.predecessors
    for part in chain.parts:
        name = part.name
        begin = end = frames[before[name]][1]
        match part:
            case Beam():
                end = begin @ translation(part.tip)
                drawing.lines.append(DrawnLine(name, BEAM, np.array([begin[:3, 3], end[:3, 3]])))
            case RigidOffset():
                end = begin @ part.transform
                if np.linalg.norm(part.transform[:3, 3]) > 0.0:
                    drawing.lines.append(DrawnLine(name, RIGID, np.array([begin[:3, 3], end[:3, 3]])))
            case Joint():
                end = begin @ part.motion(values[name] if part.free else part.held_at)
                kind = PASSIVE if part.free else ELASTIC_JOINT if part.elastic or part.passes_on else STIFF
                drawing.joints.append(DrawnJoint(name, kind, begin[:3, 3], begin[:3, :3] @ part.axis, part.slides))
                if part.held and part.slides and abs(part.held_at) > 0.0:
                    drawing.lines.append(DrawnLine(name, RIGID, np.array([begin[:3, 3], end[:3, 3]])))
                begin = end
            case _:
                assert_never(part)
        frames[name] = begin, end
    return frames


def labels(shown: Geometry) -> Iterator[tuple[str, Array]]:
    """Names and where they stand ``(3,)`` mm: each once, at the middle of a line and beside a joint."""
    seen: set[str] = set()
    for line in shown.lines:
        if line.name not in seen:
            seen.add(line.name)
            yield line.name, line.points.mean(axis=0)
    for joint in shown.joints:
        if joint.name not in seen:
            seen.add(joint.name)
            yield joint.name, joint.position
    for name, points in shown.springs:
        yield name, points.mean(axis=0)
    for name, T in shown.ends:
        yield name, T[:3, 3]


# --- Three-dimensional views of any machine: a picture, and a page whose view the reader turns --------------------

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
    plotter = optional_drawing.plotter(SIZE)
    try:
        plotter.set_background("white")
        for line in shown.lines:
            if np.ptp(line.points, axis=0).max() > 1e-6 * size:
                tube = pv.Line(*line.points).tube(radius=size * (0.012 if line.kind == BEAM else 0.008))
                plotter.add_mesh(tube, color=COLOURS[line.kind])
        for joint in shown.joints:
            along = 0.03 * size * joint.axis
            if joint.slides:
                body = pv.Cube(
                    center=joint.position, x_length=0.04 * size, y_length=0.04 * size, z_length=0.04 * size
                )
            else:
                body = pv.Cylinder(
                    center=joint.position, direction=joint.axis, radius=0.022 * size, height=0.05 * size
                )
            plotter.add_mesh(body, color=COLOURS[joint.kind])
            plotter.add_mesh(
                pv.Line(joint.position - 2.0 * along, joint.position + 2.0 * along), color="black", line_width=2
            )
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
    return a + t * along + radius * (np.cos(round_about) * side + np.sin(round_about) * np.cross(e, side))


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
             "points": [(joint.position - 0.4 * half).tolist(), (joint.position + 0.4 * half).tolist()]}
        )  # fmt: skip
        lines.append(
            {
                "name": "",
                "colour": "#222222",
                "width": 1,
                "points": [(joint.position - half).tolist(), (joint.position + half).tolist()],
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
        "labels": [{"text": text, "at": position.tolist()} for text, position in labels(shown)],
        "centre": (0.5 * (shown.points.max(axis=0) + shown.points.min(axis=0))).tolist(),
    }
    kinds = [(kind, COLOURS[kind]) for kind in (BEAM, RIGID, BODY, ELASTIC_JOINT, PASSIVE, STIFF)]
    template = environment("vjm_validation.report").get_template("view.html.j2")
    # "<" could end the script that the scene stands in
    return template.render(title=title, kinds=kinds, scene=json.dumps(scene).replace("<", "\\u003c"))
