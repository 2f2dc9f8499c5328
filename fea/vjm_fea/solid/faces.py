"""Faces of a drawing: what they are, and how a user names some of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vjm.io.errors import did_you_mean, printed
from vjm.rotations import Array

KINDS = (".step", ".stp", ".brep", ".stl", ".msh")
"""Endings of drawings."""
NEAR = 1e-4
"""Distance from a face, over the drawing's diagonal, up to which a point lies on it."""


def is_drawing(name: str) -> bool:
    """Whether a file is a drawing, by its ending."""
    return Path(name).suffix.lower() in KINDS


@dataclass(frozen=True)
class Face:
    """A face of a drawing.

    Attributes:
        number: from one.
        name: as the drawing has it; empty where it has none.
        area: mm².
        centre: of area ``(3,)``, mm.
        low: ``(3,)`` corner of its box.
        high: ``(3,)`` the opposite one.
        triangles: corner points ``(k, 3, 3)`` of a coarse mesh of it.
    """

    number: int
    name: str
    area: float
    centre: Array
    low: Array
    high: Array
    triangles: Array

    def distance(self, point: Array) -> float:
        """From a point ``(3,)`` to the nearest of the triangles, mm."""
        return float(np.min([_to_triangle(point, one) for one in self.triangles]))


def selected(faces: Sequence[Face], words: Sequence[str], option: str, size: float) -> list[int]:
    """Numbers of the faces that a user's words mean.

    Args:
        faces: of the drawing.
        words: each a number ``3``, a name ``flange``, a point on the face ``10,0,5`` or a box that holds whole
            faces ``0,0,0:60,40,1``, mm.
        option: from which they come, for messages.
        size: the drawing's diagonal, mm.

    Raises:
        ValueError: a word means no face.
    """
    numbers: list[int] = []
    for word in words:
        numbers += _one(faces, word.strip(), option, size)
    if not numbers:
        raise ValueError(f"{option}: names no face")
    return sorted(set(numbers))


def _one(faces: Sequence[Face], word: str, option: str, size: float) -> list[int]:
    if re.fullmatch(r"[+-]?\d+", word):
        if int(word) not in [face.number for face in faces]:
            raise ValueError(
                f"{option}: there is no face {word}: the drawing has faces {faces[0].number} to "
                f"{faces[-1].number}; `validate show` draws them numbered"
            )
        return [int(word)]
    corners = [_point(part) for part in word.split(":")]
    if all(corner is not None for corner in corners) and len(corners) <= 2:
        points = [np.array(corner) for corner in corners]
        return _at(faces, points[0], option, size) if len(points) == 1 else _inside(faces, points, option, size)
    named = [face.number for face in faces if face.name == word]
    if not named:
        names = sorted({face.name for face in faces if face.name})
        have = f"its names are {', '.join(names)}" if names else "its faces have no names"
        raise ValueError(
            f"{option}: no face is named '{word}': {have}{did_you_mean(word, names)}; or give a number, "
            "a point x,y,z or a box x,y,z:x,y,z"
        )
    return named


def _point(text: str) -> list[float] | None:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        return None
    return numbers if len(numbers) == 3 and np.isfinite(numbers).all() else None


def _at(faces: Sequence[Face], point: Array, option: str, size: float) -> list[int]:
    distances = [face.distance(point) for face in faces]
    best = int(np.argmin(distances))
    # a coarse mesh of a round face lies inside it by the sagitta of its triangles
    if distances[best] > max(NEAR * size, 0.05 * float(np.sqrt(faces[best].area))):
        raise ValueError(
            f"{option}: no face at {_listed(point)}: the nearest, {faces[best].number}, is "
            f"{printed(distances[best], 3)} mm away"
        )
    near = [face.number for face, d in zip(faces, distances, strict=True) if d < distances[best] + NEAR * size]
    if len(near) > 1:
        raise ValueError(
            f"{option}: {_listed(point)} lies on the edge between faces {', '.join(map(str, near))}: give a point "
            "inside one"
        )
    return [faces[best].number]


def _inside(faces: Sequence[Face], corners: list[Array], option: str, size: float) -> list[int]:
    low, high = np.minimum(*corners) - NEAR * size, np.maximum(*corners) + NEAR * size
    numbers = [face.number for face in faces if np.all(face.low >= low) and np.all(face.high <= high)]
    if not numbers:
        raise ValueError(f"{option}: no face lies wholly in the box {_listed(corners[0])} to {_listed(corners[1])}")
    return numbers


def _listed(point: Array) -> str:
    return "[" + ", ".join(printed(float(value)) for value in point) + "]"


def _to_triangle(point: Array, triangle: Array) -> float:
    """Distance from a point ``(3,)`` to a triangle ``(3, 3)``."""
    a, b, c = triangle
    normal = np.cross(b - a, c - a)
    length = float(np.linalg.norm(normal))
    if length > 0.0:
        normal = normal / length
        height = float((point - a) @ normal)
        foot = point - height * normal
        sides = [np.cross(q - p, foot - p) @ normal for p, q in ((a, b), (b, c), (c, a))]
        if min(sides) >= 0.0:
            return abs(height)
    distances = []
    for p, q in ((a, b), (b, c), (c, a)):
        along = float((q - p) @ (q - p))
        t = 0.0 if along == 0.0 else float(np.clip((point - p) @ (q - p) / along, 0.0, 1.0))
        distances.append(float(np.linalg.norm(p + t * (q - p) - point)))
    return min(distances)


# --- Re-entrant edges of a drawing, at which the stress of linear elasticity has no bound -------------------------

FLAT = np.cos(np.deg2rad(160.0))
"""Cosine of the angle between two faces from which on their edge counts as smooth."""
STEP = 0.05
"""Of the triangles' height: how far from the edge it is asked whether there is material."""
DIRECTION = np.array([0.5257311, 0.2763932, 0.8045062])
"""Of the rays that are counted; along nothing that people draw."""
LINE2, TRIANGLE3 = 1, 2
"""gmsh's numbers of its elements."""


def re_entrant_edges(gmsh: Any, triangles: Array) -> list[int]:  # noqa: ANN401
    """Edges with more than half of their surroundings filled, from the coarse mesh that gmsh holds.

    Between the two faces at an edge, half-way from the one to the other, there is material where the edge is
    convex, and none where it is re-entrant.

    Args:
        gmsh: with a mesh of the surface.
        triangles: ``(k, 3, 3)`` corners of that mesh, all faces.
    """
    edges = []
    for _, edge in gmsh.model.getEntities(1):
        above = [int(face) for face in gmsh.model.getAdjacencies(1, edge)[0]]
        if len(set(above)) != 2:
            continue
        _, nodes = gmsh.model.mesh.getElementsByType(LINE2, edge)
        if len(nodes) < 2:
            continue
        middle = 2 * (len(nodes) // 4)
        pair = {int(nodes[middle]), int(nodes[middle + 1])}
        a, b = (np.array(gmsh.model.mesh.getNode(node)[0]) for node in sorted(pair))
        thirds = [_third(gmsh, face, pair) for face in above]
        if any(third is None for third in thirds):
            continue
        along = (b - a) / np.linalg.norm(b - a)
        sides = [np.asarray(third) - 0.5 * (a + b) for third in thirds]
        sides = [side - (side @ along) * along for side in sides]
        heights = [float(np.linalg.norm(side)) for side in sides]
        one, other = (side / height for side, height in zip(sides, heights, strict=True))
        if one @ other < FLAT:
            continue
        bisector = (one + other) / np.linalg.norm(one + other)
        if not inside(0.5 * (a + b) + STEP * min(heights) * bisector, triangles):
            edges.append(int(edge))
    return edges


def _third(gmsh: Any, face: int, pair: set[int]) -> Array | None:  # noqa: ANN401
    """The third corner of the triangle of a face at a piece of its border."""
    _, nodes = gmsh.model.mesh.getElementsByType(TRIANGLE3, face)
    rows = np.asarray(nodes, dtype=np.int64).reshape(-1, 3)
    hit = rows[np.isin(rows, list(pair)).sum(axis=1) == 2]
    if not len(hit):
        return None
    (third,) = set(hit[0].tolist()) - pair
    return np.array(gmsh.model.mesh.getNode(third)[0])


def inside(point: Array, triangles: Array) -> bool:
    """Whether a ray from a point leaves the surface an odd number of times (Möller and Trumbore's test)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    e1, e2 = b - a, c - a
    p = np.cross(DIRECTION, e2)
    det = np.sum(e1 * p, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = point - a
        u = np.sum(s * p, axis=1) / det
        q = np.cross(s, e1)
        v = q @ DIRECTION / det
        t = np.sum(e2 * q, axis=1) / det
    hits = (det != 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0)
    return int(np.sum(hits)) % 2 == 1
