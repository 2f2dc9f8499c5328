"""Scenes that a page turns: models over each other along their paths, whole robots, and what is drawn of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from vjm.continuation.path import Equilibrium, Event, Path
from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.model.load_case import Direction
from vjm.model.machine import ATTACHMENT, ROOT, Machine
from vjm.model.parts import Beam, Joint
from vjm.rotations import Array
from vjm_output import optional_drawing
from vjm_output.number_text import listed, number
from vjm_output.plots import FE, PAGE_WIDTH, PAPER, REFINED, Drawing, Picture, engine_style, figure, png
from vjm_validation.metrics import round_down
from vjm_validation.report.figures import force_at, postures
from vjm_validation.studies.chain import Key, Run
from vjm_validation.studies.robots import ROBOT, RobotStudy

# --- What of a chain is drawn: its lines, joints and ends, unloaded and displaced, and from where it is seen ------

MAGNIFICATIONS = (1, 2, 3, 5, 10, 20, 30, 50, 100, 200, 500, 1000)
SHARE = 0.2
"""Largest drawn displacement over the chain's extent: the shape shows and the machine is still recognised."""


@dataclass(frozen=True)
class Skeleton:
    """A chain as lines to draw.

    Attributes:
        points: ``(k, 3)``, mm, world, unloaded, from base to tool.
        moved: displacement ``(k, 3)`` of each, mm.
        pieces: (first row, last row + 1, whether thin) of each line. Thin are rigid arms and the gap that a
            lumped spring opens at the end of its rigid link.
        joints: rows of the passive joints.
        beads: whether the points bound lumped segments and deserve a mark.
        parts: name of the part of each point.
    """

    points: Array
    moved: Array
    pieces: tuple[tuple[int, int, bool], ...]
    joints: tuple[int, ...]
    beads: bool
    parts: tuple[str, ...] = ()

    def positions(self, magnification: float) -> Array:
        """The points with their displacements magnified, ``(k, 3)``."""
        return self.points + magnification * self.moved


def skeleton(chain: Machine, path: Path, point: Equilibrium) -> Skeleton:
    """The lines of a path's chain at one of its points."""
    start = path.points[0]
    parts = [label.part for label in path.stations]
    thin = [label.fraction > 1.0 for label in path.stations]
    points, shape = start.shape, point.shape
    ends = _rigid_link_ends(chain, path, start)
    if ends:
        # a rigid link ends where its spring begins, which is no station: put it in front of the part's tip
        rows = list(ends)
        points = np.insert(points, rows, list(ends.values()), axis=0)
        shape = np.insert(shape, rows, list(_rigid_link_ends(chain, path, point).values()), axis=0)
        thin = [row in ends or flag for row, flag in enumerate(thin)]
        for row in reversed(rows):
            parts.insert(row, parts[row])
            thin.insert(row, False)
    return Skeleton(
        points=points,
        moved=shape - points,
        pieces=tuple(_joined(parts, thin, 0, len(parts))),
        joints=_joints(chain, parts),
        beads=path.engine not in (FE, PAPER),
        parts=tuple(parts),
    )


def _rigid_link_ends(chain: Machine, path: Path, point: Equilibrium) -> dict[int, Array]:
    """Where the rigid links of the paper's model end, before their springs, by the row of the tip behind."""
    if path.engine != PAPER:
        return {}
    model = VjmEngine().model(chain)
    kinematics = model.kinematics(point.state[: model.size])
    beams = {beam.name for beam in chain.beams}
    ends = {}
    for row, station in enumerate(model.stations):
        if station.part in beams and station.fraction == 0.0:
            spring = station.joint + 1
            ends[row + 1] = (kinematics.behind[spring] @ model.before[spring])[:3, 3]
    return ends


def _joined(parts: Sequence[str], thin: Sequence[bool], begin: int, end: int) -> list[tuple[int, int, bool]]:
    """Lines of the rows from ``begin`` to ``end``: one for each part, thin where a rigid arm leads to the next."""
    pieces: list[tuple[int, int, bool]] = []
    for row in range(begin + 1, end):
        fine = thin[row] or parts[row] != parts[row - 1]
        if pieces and pieces[-1][2] == fine:
            pieces[-1] = (pieces[-1][0], row + 1, fine)
        else:
            pieces.append((row - 1, row + 1, fine))
    return pieces


def _joints(chain: Machine, parts: Sequence[str]) -> tuple[int, ...]:
    """Rows where the passive joints sit: behind the part before them, or at the root of the first part."""
    rows, row = [], 0
    for part in chain.parts:
        if isinstance(part, Joint) and part.free:
            rows.append(row)
        elif part.name in parts:
            row = len(parts) - 1 - list(reversed(parts)).index(part.name)
            if not isinstance(part, Beam):
                row = min(row + 1, len(parts) - 1)
    return tuple(dict.fromkeys(rows))


def magnification(drawn: Sequence[Skeleton]) -> int:
    """The largest round factor that keeps the drawn displacements below `SHARE` of the chain's extent."""
    extent = max(float(np.max(np.ptp(one.points, axis=0))) for one in drawn)
    largest = max(float(np.max(np.linalg.norm(one.moved, axis=1))) for one in drawn)
    fitting = [m for m in MAGNIFICATIONS if m * largest <= SHARE * extent]
    return fitting[-1] if fitting else 1


@dataclass(frozen=True)
class Camera:
    """A view in parallel projection, so that a ruler holds everywhere in the picture.

    Attributes:
        focus: ``(3,)`` mm, world.
        right: unit vector ``(3,)`` to the right of the picture.
        up: unit vector ``(3,)``.
        half_width: of what has to be seen, mm.
        half_height: likewise.
    """

    focus: Array
    right: Array
    up: Array
    half_width: float
    half_height: float

    @property
    def towards_viewer(self) -> Array:
        """Unit vector ``(3,)`` from the scene to the eye."""
        return np.cross(self.right, self.up)

    @classmethod
    def framing(cls, right: Array, up: Array, drawn: Sequence[Skeleton], magnification: float) -> Camera:
        """The view along ``right × up`` that shows the unloaded and the displaced chains."""
        depth = np.cross(right, up)
        seen = np.vstack([drawn[0].points, *(one.positions(magnification) for one in drawn)])
        across, above = seen @ right, seen @ up
        focus = (
            0.5 * (np.max(across) + np.min(across)) * right
            + 0.5 * (np.max(above) + np.min(above)) * up
            + np.mean(seen @ depth) * depth
        )
        return cls(focus, right, up, 0.5 * float(np.ptp(across)), 0.5 * float(np.ptp(above)))


def picture_axes(drawn: Sequence[Skeleton]) -> tuple[Array, Array]:
    """Right and up ``(3,)`` of a view onto the chain's axis and its largest sideways motion, from above."""
    rest = drawn[0].points
    axis = (rest[-1] - rest[0]) / np.linalg.norm(rest[-1] - rest[0])
    moved = np.vstack([one.moved for one in drawn])
    sideways = moved - np.outer(moved @ axis, axis)
    lateral = sideways[np.argmax(np.linalg.norm(sideways, axis=1))]
    if np.linalg.norm(lateral) < 1e-9:
        lateral = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    normal = np.cross(axis, lateral)
    normal = normal / np.linalg.norm(normal)
    up = np.eye(3)[2] if abs(normal[2]) < 0.8 else np.eye(3)[1]
    # the side from which the tool lies on the right
    if np.cross(up, normal) @ axis < 0.0:
        normal = -normal
    eye = normal - 0.25 * axis + 0.3 * up
    right = np.cross(up, eye)
    right = right / np.linalg.norm(right)
    above = np.cross(eye, right)
    return right, above / np.linalg.norm(above)


def ruler_length(drawn: Sequence[Skeleton]) -> float:
    """A round length, at most a quarter of the chain's extent, mm."""
    return round_down(0.25 * float(np.max(np.ptp(drawn[0].points, axis=0))))


# --- The scene that a page turns: models over each other along their paths, as the data that its script draws -----

STATES = 24
"""Along the path."""
ASPECT = 1.6
"""Width over height of what the script draws on."""
THIN = 0.012
"""Radius of what has no section, such as a rigid arm, over the chain's extent."""


Draw = Callable[[Path, Equilibrium], Skeleton]
"""The lines of a path's machine at one of its points."""


def turnable(chain: Machine, paths: Mapping[str, Path]) -> str:
    """JSON of a chain's scene, see `scene`.

    Args:
        chain: whose parts are drawn.
        paths: by engine label; the first one's unloaded shape is shown too.
    """
    return scene(paths, lambda path, point: skeleton(chain, path, point), radii_of(chain), picture_axes)


def scene(
    paths: Mapping[str, Path],
    draw: Draw,
    radii: Mapping[str, float],
    axes: Callable[[Sequence[Skeleton]], tuple[Array, Array]],
) -> str:
    """JSON of a scene, see ``vjm_output/templates/scene.js``; mm and N.

    Args:
        paths: by engine label; the first one's unloaded shape is shown too.
        draw: what is drawn.
        radii: of the tubes, mm, by part; what has none is thin.
        axes: right and up ``(3,)`` of the first view by what is seen at the paths' ends.
    """
    critical = [path.critical.s for path in paths.values() if path.critical and path.critical.point]
    end = min(path.s[-1] for path in paths.values())
    s = np.unique(np.concatenate([np.linspace(0.0, end, STATES), [v for v in critical if v <= end]]))
    shapes = {label: _along(draw, path, s) for label, path in paths.items()}
    ends = [moved[-1] for moved in shapes.values()]
    times = [magnification([moved[k] for moved in shapes.values()]) for k in range(len(s))]
    start = int(np.argmin(np.abs(s - min(critical)))) if critical and min(critical) <= end else len(s) - 1
    right, up = axes(ends)
    camera = Camera.framing(right, up, [moved[start] for moved in shapes.values()], times[start])
    extent = float(np.max(np.ptp(ends[0].points, axis=0)))
    gap = _gaps(shapes) if FE in shapes and len(shapes) == 2 else None
    compared = next((label for label in shapes if label != FE), "")
    document = {
        "s": _rounded(s),
        "start": start,
        "times": times,
        "right": _rounded(right, 5),
        "up": _rounded(up, 5),
        "focus": _rounded(camera.focus),
        "size": round(1.2 * max(camera.half_width, ASPECT * camera.half_height), 3),
        "joint": round(THIN * extent, 3),
        "largest": 0.0 if gap is None else round(float(gap.max()), 6),
        "models": [
            {
                "name": label,
                "colour": engine_style(label).colour,
                "rest": _rounded(along[0].points),
                "pieces": _pieces(radii, along[0], THIN * extent),
                "joints": list(along[0].joints),
                "moved": [_rounded(one.moved, 4) for one in along],
                "force": _rounded(force_at(paths[label], s), 2),
                "gap": _rounded(gap, 5) if gap is not None and label == compared else None,
            }
            for label, along in shapes.items()
        ],
    }
    return json.dumps(document, separators=(",", ":"))


def radii_of(chain: Machine) -> dict[str, float]:
    """Radius of the tube that stands for each beam whose section is known, mm.

    That of the full circle whose two radii of gyration have the product of the section's, so that a flat bar shows
    by its mean thickness.
    """
    radii = {}
    for beam in chain.beams:
        if beam.section is not None:
            gyration = np.sqrt(np.sqrt(beam.section.EIy * beam.section.EIz) / beam.section.EA)
            radii[beam.name] = 2.0 * float(gyration)
    return radii


def _rounded(values: Array, digits: int = 3) -> Any:  # noqa: ANN401
    return np.round(values, digits).tolist()


def _along(draw: Draw, path: Path, s: Array) -> list[Skeleton]:
    """The machine's lines at displacements ``(k,)``, linear between the points of the path."""
    points: list[Equilibrium] = [*path.points, *(e.point for e in path.events if e.point is not None)]
    points.sort(key=lambda point: point.s)
    displacements = np.array([point.s for point in points])
    result = []
    for value in s:
        high = int(np.clip(np.searchsorted(displacements, value), 1, len(displacements) - 1))
        low = high - 1
        share = (
            (value - displacements[low]) / (displacements[high] - displacements[low])
            if displacements[high] > displacements[low]
            else 1.0
        )
        a, b = (draw(path, points[k]) for k in (low, high))
        moved = a.moved + np.clip(share, 0.0, 1.0) * (b.moved - a.moved)
        result.append(Skeleton(b.points, moved, b.pieces, b.joints, b.beads, b.parts))
    return result


def _gaps(shapes: Mapping[str, list[Skeleton]]) -> Array:
    """Distance ``(k, points)`` of the other model's line from the finite elements' at equal length along it, mm."""
    (other,) = (along for label, along in shapes.items() if label != FE)
    theirs = shapes[FE]

    def lengths(one: Skeleton) -> Array:
        steps = np.linalg.norm(np.diff(one.points, axis=0), axis=1)
        # points that lie on each other keep their order
        return np.concatenate([[0.0], np.cumsum(steps + 1e-9)])

    ours, reference = lengths(other[0]), lengths(theirs[0])
    result = []
    for a, b in zip(other, theirs, strict=True):
        interpolated = np.stack([np.interp(ours, reference, b.moved[:, d]) for d in range(3)], axis=1)
        result.append(np.linalg.norm(a.moved - interpolated, axis=1))
    return np.array(result)


def _pieces(radii: Mapping[str, float], one: Skeleton, thin: float) -> list[list[float]]:
    """(first row, last row + 1, radius) of each line; lines of one radius end where the part does."""
    pieces: list[list[float]] = []
    for first, last, fine in one.pieces:
        begin = first
        for row in range(first + 1, last):
            if row == last - 1 or one.parts[row + 1] != one.parts[row]:
                radius = 0.5 * thin if fine else radii.get(one.parts[row], thin)
                pieces.append([begin, row + 1, round(radius, 3)])
                begin = row
    return pieces


# --- Whole robots in space: unloaded and at the critical point, the lumped model over the beams, to be turned -----

SHOWN = (("isotropic", -1, REFINED), ("isotropic", 1, PAPER), ("Q1", -1, REFINED))
"""Pose, sign of the displacement along x, and the engine that is drawn over the finite elements."""


def robot_renders(study: RobotStudy) -> list[Picture]:
    """The Orthoglide pressed and pulled, where the study has the paths."""
    pictures = []
    for pose, sign, label in SHOWN:
        paths = {engine: study.curves.get((pose, sign, engine)) for engine in (FE, label)}
        usable = {engine: path for engine, path in paths.items() if path is not None and path.stations}
        if not usable:
            continue
        pressed = "pressed against x" if sign < 0 else "pulled along x"
        what = (
            "The leg along x of the paper's chains leans, that of beams stays straight. The artefact of one spring "
            "a link is the whole robot's too."
            if label == PAPER
            else "The leg along x bends sideways; beads bound the lumped model's segments."
        )
        pictures.append(
            rendered_states(
                f"robot_{pose}_{'compression' if sign < 0 else 'tension'}",
                f"The whole Orthoglide at {pose}, {pressed}",
                what,
                usable,
                robot_skeleton,
                from_above,
                scene(usable, robot_skeleton, _radii(), from_above),
            )
        )
    return pictures


def robot_skeleton(path: Path, point: Equilibrium) -> Skeleton:
    """The lines of a robot's legs, and thin ones from their ends to the middle of these, which is the platform."""
    own = [i for i, label in enumerate(path.stations) if label.part.partition("/")[2] not in ("", ROOT, ATTACHMENT)]
    rest, shape = path.points[0].shape[own], point.shape[own]
    stations = [path.stations[i] for i in own]
    legs = [label.part.partition("/")[0] for label in stations]
    parts = [label.part for label in stations]
    thin = [label.fraction > 1.0 for label in stations]
    ends = [max(i for i, name in enumerate(legs) if name == leg) for leg in dict.fromkeys(legs)]
    points, moved = [rest], [shape]
    pieces, joints = [], []
    begin = 0
    for row in range(1, len(legs) + 1):
        if row < len(legs) and legs[row] == legs[row - 1] and parts[row] != parts[row - 1]:
            joints.append(row)
        if row == len(legs) or legs[row] != legs[row - 1]:
            pieces += _joined(parts, thin, begin, row)
            begin = row
    centre, moved_centre = rest[ends].mean(axis=0), shape[ends].mean(axis=0)
    for end in ends:
        pieces.append((begin, begin + 2, True))
        begin += 2
        points.append(np.stack([rest[end], centre]))
        moved.append(np.stack([shape[end], moved_centre]))
        parts += ["platform", "platform"]
    unloaded = np.concatenate(points)
    return Skeleton(
        points=unloaded,
        moved=np.concatenate(moved) - unloaded,
        pieces=tuple(pieces),
        joints=(*joints, *ends),
        beads=path.engine not in (FE, PAPER),
        parts=tuple(parts),
    )


def from_above(drawn: Sequence[Skeleton]) -> tuple[Array, Array]:
    """Right and up ``(3,)`` of a view from the middle between the legs, so that none hides another."""
    rest = drawn[0].points
    begins = rest[[first for first, _, _ in drawn[0].pieces]]
    eye = np.array([1.0, 0.6, 0.8])
    # towards where the machine is not
    eye = eye * np.where(np.mean(begins, axis=0) > rest[-1], -1.0, 1.0)
    up = np.array([0.0, 0.0, 1.0])
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    above = np.cross(eye, right)
    return right, above / np.linalg.norm(above)


def _radii() -> dict[str, float]:
    """Of the legs' beams, mm, by leg and part."""
    return radii_of(load_model(ROBOT))


# --- Off-screen pictures of the deformed chain: two models over each other, displacements magnified ---------------

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
    plotter = optional_drawing.plotter((WIDTH, WIDTH))
    try:
        plotter.set_background("white")
        plotter.enable_anti_aliasing("ssaa")
        rest = next(iter(group.values()))
        _tubes(plotter, rest, 0.0, GHOST, 1.3 * unit)
        for label, one in group.items():
            colour = engine_style(label).colour
            positions = one.positions(times)
            if one.beads:
                _balls(plotter, positions, 1.7 * unit, colour)
            else:
                _tubes(plotter, one, times, colour, 1.1 * unit)
            _balls(plotter, positions[list(one.joints)], 2.6 * unit, JOINT)
            tool = pv.Cone(
                center=positions[-1] + 4.5 * unit * camera.right,
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
    positions = one.positions(times)
    for first, last, thin in one.pieces:
        points = positions[first:last]
        if np.max(np.ptp(points, axis=0)) > 1e-6:
            tube = pv.MultipleLines(points).tube(radius=radius * (0.45 if thin else 1.0))
            plotter.add_mesh(tube, color=colour)


def _balls(plotter: Any, positions: Array, radius: float, colour: str) -> None:  # noqa: ANN401
    pv = _pyvista()
    if len(positions):
        ball = pv.Sphere(radius=radius, theta_resolution=20, phi_resolution=20)
        plotter.add_mesh(pv.PolyData(positions).glyph(geom=ball, scale=False, orient=False), color=colour)


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
