"""A machine as surfaces: sections as its files give them, bars of equal stiffness or thin ones elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vjm.design.linear_state import LinearState
from vjm.design.modes import Modes, station_lines
from vjm.io.shapes import IBeam, Round, Shape
from vjm.model.parts import Beam, Joint
from vjm.rotations import Array
from vjm_validation.report.scenes import THIN, radii_of

CORNERS = 24
"""Of what is drawn for a circle."""
BEAM, RIGID, BODY = "beams", "rigid parts", "bodies"
"""What surfaces stand for."""
HELD, FREE = "joints", "passive joints"
"""What marks of joints stand for."""
JOINT = 1.5
"""Radius of a joint's mark over that of a rigid part."""


class DrawnMesh(NamedTuple):
    """A surface.

    Attributes:
        vertices: ``(v, 3)`` mm.
        faces: ``(f, 3)`` indices.
    """

    vertices: Array
    faces: np.ndarray


@dataclass(frozen=True)
class Profile:
    """Outlines of a cross-section.

    Attributes:
        outlines: closed polygons ``(k, 2)`` along the section's y and z, mm: the outer one, perhaps that of a hole.
        caps: triangles ``(t, 3)`` over the points of all outlines that close an end.
    """

    outlines: tuple[Array, ...]
    caps: np.ndarray


def _circle(radius: float) -> Array:
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _rectangle(y: float, z: float) -> Array:
    return np.array([[-y, -z], [y, -z], [y, z], [-y, z]])


def _solid(outline: Array) -> Profile:
    k = np.arange(1, len(outline) - 1)
    return Profile((outline,), np.stack([np.zeros_like(k), k, k + 1], axis=1))


def _hollow(outer: Array, inner: Array) -> Profile:
    n = len(outer)
    k = np.arange(n)
    j = (k + 1) % n
    caps = np.concatenate([np.stack([k, j, n + j], axis=1), np.stack([k, n + j, n + k], axis=1)])
    return Profile((outer, inner), caps)


def profile(shape: Shape) -> Profile:
    """The outlines of a shape of a file."""
    y, z = 0.5 * shape.sides[0], 0.5 * shape.sides[1]
    if isinstance(shape, Round):
        return _hollow(_circle(y), _circle(0.5 * shape.bore)) if shape.bore else _solid(_circle(y))
    if isinstance(shape, IBeam):
        web, flange = 0.5 * shape.web_mm, y - shape.flange_mm
        outline = np.array(
            [
                [-y, -z], [-flange, -z], [-flange, -web], [flange, -web], [flange, -z], [y, -z],
                [y, z], [flange, z], [flange, web], [-flange, web], [-flange, z], [-y, z],
            ]
        )  # fmt: skip
        quads = ((0, 1, 10, 11), (2, 3, 8, 9), (4, 5, 6, 7))
        return Profile((outline,), np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))
    wall = getattr(shape, "wall_mm", None)
    outer = _rectangle(y, z)
    return _solid(outer) if wall is None else _hollow(outer, _rectangle(y - wall, z - wall))


class Surface(NamedTuple):
    """A surface around the points of a drawing, which goes along with them.

    A section keeps its direction: the turns of a drawn deflection are too small to be seen in it.

    Attributes:
        rows: ``(v,)`` point at which each vertex is.
        offsets: ``(v, 3)`` from there, mm.
        faces: ``(f, 3)`` indices of vertices.
    """

    rows: np.ndarray
    offsets: Array
    faces: np.ndarray

    def at(self, points: Array) -> Array:
        """Its vertices ``(v, 3)`` where the drawing's points stand."""
        return points[self.rows] + self.offsets


def _along(rows: np.ndarray, own: Profile, axes: Array, shifts: Array | float = 0.0) -> Surface:
    """A cross-section that is drawn out through points ``(n,)``; ``axes`` (2, 3) are its y and z."""
    vertex_rows, offsets, faces, first, n = [], [], [], 0, len(rows)
    for outline in own.outlines:
        k = len(outline)
        vertex_rows.append(np.repeat(rows, k))
        offsets.append(np.tile(outline @ axes, (n, 1)) + np.repeat(np.broadcast_to(shifts, (n, 3)), k, axis=0))
        ring = first + np.stack([np.arange(k), np.roll(np.arange(k), -1)], axis=1)
        a, b = (ring[None] + k * np.arange(n - 1)[:, None, None]).reshape(-1, 2).T
        faces += [np.stack([a, b, b + k], axis=1), np.stack([a, b + k, a + k], axis=1)]
        first += n * k
    # ends have vertices of their own, so that they are shaded as flat
    outline = np.concatenate(own.outlines) @ axes
    for row in (0, n - 1):
        vertex_rows.append(np.full(len(outline), rows[row]))
        offsets.append(outline + np.broadcast_to(shifts, (n, 3))[row])
        faces.append(first + own.caps)
        first += len(outline)
    return Surface(np.concatenate(vertex_rows), np.concatenate(offsets), np.concatenate(faces))


def _merged(surfaces: Sequence[Surface]) -> Surface:
    firsts = np.cumsum([0, *(len(each.rows) for each in surfaces)])
    faces = [each.faces + first for each, first in zip(surfaces, firsts, strict=False)]
    rows, offsets = (np.concatenate([each[k] for each in surfaces]) for k in range(2))
    return Surface(rows, offsets, np.concatenate(faces))


class MachineDrawing:
    """A machine at rest and loaded, to be drawn with any factor on its deflection.

    Attributes:
        rest: points ``(k, 3)`` mm.
        moved: their displacements ``(k, 3)`` mm.
        mode: their motions ``(k, 3)`` in the lowest mode, the largest being one; zeros where there is none.
        surfaces: what is drawn around the points, by what it stands for.
        of: the machine at rest that it shows.
        end: ``(3,)`` where the end is at rest, and
        end_moved: ``(3,)`` by how much it moves, mm.
        extent: largest side of the box around it, mm.
    """

    def __init__(
        self,
        rest: LinearState,
        loaded: LinearState,
        modes: Modes | None,
        sections: Mapping[str, Shape],
        before: MachineDrawing | None = None,
    ) -> None:
        """Draw a machine.

        Args:
            rest: without loads.
            loaded: the equilibrium.
            modes: the lowest mode about it.
            sections: shapes of beams by name, see `vjm.io.file_parameters.MachineFiles.sections`.
            before: the drawing before this one, whose surfaces stay where only loads have changed.
        """
        model = loaded.model
        stations = len(model.stations)
        unloaded = replace(rest, x=model.configuration(model.chain.posture(rest.question.posture)))
        self.rest = _points(unloaded)
        self.moved = _points(loaded) - self.rest
        self.mode = np.zeros_like(self.rest)
        if modes is not None:
            self.mode[:stations] = modes.shapes[0]
            self.mode[stations:] = _closure_rates(loaded, modes)
        self.extent = max(1.0, float(np.ptp(self.rest, axis=0).max(initial=0.0)))
        self.end = unloaded.end.end[:3, 3]
        self.end_moved = loaded.end.end[:3, 3] - self.end
        self.of = rest
        self.surfaces: dict[str, Surface] = {}
        if before is not None and before.of is rest:
            self.surfaces = before.surfaces
            return
        by_kind: dict[str, list[Surface]] = {}
        for kind, surface in self._surfaces(unloaded, sections):
            by_kind.setdefault(kind, []).append(surface)
        self.surfaces = {kind: _merged(surfaces) for kind, surfaces in by_kind.items()}

    def _surfaces(self, state: LinearState, sections: Mapping[str, Shape]) -> Iterator[tuple[str, Surface]]:
        parts = {part.name: part for part in state.model.chain.parts}
        names = [station.part for station in state.model.stations]
        thin, radii = THIN * self.extent, radii_of(state.model.chain)
        beams: dict[str, list[int]] = {}
        for first, last in station_lines(state):
            part = parts[names[first]]
            if names[first] == names[last] and isinstance(part, Beam):
                beams.setdefault(part.name, [first]).append(last)
            else:
                yield from self._bar(RIGID, first, last, thin)
        for name, rows in beams.items():
            part = parts[name]
            assert isinstance(part, Beam)
            own = profile(sections[name]) if name in sections else _solid(_circle(radii.get(name, thin)))
            site = state.model.built.begins[name]
            R = state.kinematics.behind[site.joint + 1][:3, :3] @ site.frame[:3, :3]
            kept = self._apart(rows)
            if len(kept) > 1:
                yield BEAM, _along(kept, own, (R @ part.section_in_chain[:3, :3])[:, 1:].T)
        stations = len(names)
        for k in range(len(state.model.chain.closures)):
            yield from self._bar(BODY, stations + 2 * k, stations + 2 * k + 1, 0.5 * thin)
        radius = JOINT * thin
        for kind, position, axis in _joints(state):
            row = int(np.argmin(np.linalg.norm(self.rest - position, axis=1)))
            shifts = position - self.rest[row] + 1.2 * radius * np.array([-axis, axis])
            yield kind, _along(np.array([row, row]), _solid(_circle(radius)), _across(axis), shifts)

    def _bar(self, kind: str, first: int, last: int, radius: float) -> Iterator[tuple[str, Surface]]:
        rows = self._apart([first, last])
        if len(rows) > 1:
            axes = _across(self.rest[last] - self.rest[first])
            yield kind, _along(rows, _solid(_circle(radius)), axes)

    def _apart(self, rows: Sequence[int]) -> np.ndarray:
        """Rows of points that do not lie on the one before."""
        kept = [rows[0]]
        for row in rows[1:]:
            if np.linalg.norm(self.rest[row] - self.rest[kept[-1]]) > 1e-6 * self.extent:
                kept.append(row)
        return np.array(kept)

    def points(self, factor: float, oscillation: float = 0.0) -> Array:
        """The points with their displacements times a factor, and mm of the mode's largest motion."""
        return self.rest + factor * self.moved + oscillation * self.mode


def _across(axis: Array) -> Array:
    """Two unit vectors ``(2, 3)`` across an axis."""
    x, y, z = (axis / np.sqrt(axis @ axis)).tolist()
    # of a plane that is far from the axis, without the calls that small arrays make slow
    first = np.array([-z, 0.0, x] if abs(y) < max(abs(x), abs(z)) else [0.0, z, -y])
    first /= np.sqrt(first @ first)
    a, b, c = first.tolist()
    return np.array([first, [y * c - z * b, z * a - x * c, x * b - y * a]])


def _points(state: LinearState) -> Array:
    """Stations, and of each closure what it holds and the middle of the body that it holds it to."""
    return np.concatenate([state.model.shape(state.kinematics), _closure_points(state)])


def _closure_points(state: LinearState) -> Array:
    model, points = state.model, []
    for closure, joints, frames in zip(
        model.chain.closures, model.closure_joints, model.closure_frames, strict=True
    ):
        behind = state.kinematics.behind[joints[1] + 1]
        points += [(behind @ frames[1])[:3, 3], (behind @ state.model.built.ends[closure.parts[1]].frame)[:3, 3]]
    return np.array(points).reshape(-1, 3)


def _closure_rates(state: LinearState, modes: Modes) -> Array:
    """Motions of the closures' points in the lowest mode, in the scale of the stations'."""
    model = state.model
    motion = np.zeros(model.size)
    motion[: state.n] = modes.motions[:, 0].real
    stations = model.shape_rate(state.kinematics, motion)
    size = np.linalg.norm(stations, axis=1).max(initial=0.0)
    if not size:
        return np.zeros((2 * len(model.chain.closures), 3))
    sign = np.sign(np.sum(stations * modes.shapes[0])) or 1.0
    points = _closure_points(state)
    rates = [
        (model.motion(state.kinematics, int(model.closure_joints[k // 2][1]), point) @ motion)[:3]
        for k, point in enumerate(points)
    ]
    return np.array(rates).reshape(-1, 3) * sign / size


def _joints(state: LinearState) -> list[tuple[str, Array, Array]]:
    """What each joint is, where it is ``(3,)`` mm, and its axis ``(3,)``, world."""
    joints = []
    for part in state.model.chain.parts:
        if isinstance(part, Joint):
            site = state.model.built.begins[part.name]
            T = state.kinematics.behind[site.joint + 1] @ site.frame
            axis = T[:3, :3] @ part.axis
            joints.append((FREE if part.free else HELD, T[:3, 3], axis))
    return joints


def ellipsoid(centre: Array, principal: Array, axes: Array, size: float) -> DrawnMesh:
    """The ellipsoid of the stiffnesses against a force, its longest half axis of a size.

    Args:
        centre: middle ``(3,)`` mm.
        principal: stiffnesses ``(3,)``; infinite where the end is rigid. None is negative.
        axes: directions ``(3, 3)`` in columns.
        size: mm.
    """
    finite = principal[np.isfinite(principal)]
    largest = float(finite.max(initial=0.0)) or 1.0
    half = np.where(np.isfinite(principal), np.clip(principal / largest, 0.0, 1.0), 1.0) * size
    u, v = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 33), np.linspace(0.0, np.pi, 17))
    ball = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1).reshape(-1, 3)
    a = (np.arange(16)[:, None] * 33 + np.arange(32)).ravel()
    faces = np.concatenate([np.stack([a, a + 33, a + 34], axis=1), np.stack([a, a + 34, a + 1], axis=1)])
    return DrawnMesh(centre + (ball * half) @ axes.T, faces)
