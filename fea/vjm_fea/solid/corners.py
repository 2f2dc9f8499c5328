"""Re-entrant edges of a drawing, at which the stress of linear elasticity has no bound."""

from __future__ import annotations

from typing import Any

import numpy as np

from vjm.rotations import Array

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
    found = []
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
            found.append(int(edge))
    return found


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
