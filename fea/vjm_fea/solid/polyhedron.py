"""An STL as the polyhedron that it is: its flat patches as plane surfaces, which can be meshed anew at any size.

The triangles of a drawing that was written coarsely are bad elements, and splitting keeps their shape. Triangles
that lie in one plane make one surface; the small ones of a curved face stay as they are.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np

from vjm.rotations import Array
from vjm_fea.solid.mesh import Indices

FLAT = 1e-6
"""Distance from a plane or a line, over the drawing's diagonal, up to which a corner lies in it: the rounding of
coordinates with seven digits."""

Edge = tuple[int, int]


def build(gmsh: Any, points: Array, faces: dict[int, Indices]) -> dict[int, list[int]]:  # noqa: ANN401
    """Make a new model with the polyhedron, as one volume.

    Args:
        gmsh: the library.
        points: corners ``(n, 3)``, mm.
        faces: triangles ``(k, 3)``, indices into them, by the number of the face; closed together.

    Returns:
        The plane surfaces of every face.

    Raises:
        ValueError: a surface's border does not close.
    """
    tolerance = FLAT * float(np.linalg.norm(np.ptp(points, axis=0)))
    patches: list[tuple[int, Indices]] = []
    for number, triangles in faces.items():
        patches += [(number, one) for one in _flat_patches(points, triangles, tolerance)]
    owners = defaultdict(list)
    for k, (_, triangles) in enumerate(patches):
        for edge in _borders(triangles):
            owners[edge].append(k)
    chains = _straightened(points, list(owners), tolerance)
    gmsh.model.add("polyhedron")
    geo = gmsh.model.geo
    corner = {node: geo.addPoint(*points[node].tolist()) for node in {node for ends in chains for node in ends}}
    line = {ends: geo.addLine(corner[ends[0]], corner[ends[1]]) for ends in chains}
    sides = defaultdict(list)
    for ends, members in chains.items():
        for k in owners[members[0]]:
            sides[k].append(ends)
    made: dict[int, list[int]] = {number: [] for number in faces}
    for k, (number, _) in enumerate(patches):
        loops = sorted(_loops(sides[k]), key=lambda loop: -_size(points, loop))
        signed = [[line[e] if e in line else -line[e[::-1]] for e in loop] for loop in loops]
        made[number].append(geo.addPlaneSurface([geo.addCurveLoop(one) for one in signed]))
    geo.addVolume([geo.addSurfaceLoop([tag for tags in made.values() for tag in tags])])
    geo.synchronize()
    return made


def _flat_patches(points: Array, triangles: Indices, tolerance: float) -> list[Indices]:
    """Connected triangles that lie in one plane."""
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    neighbours = defaultdict(list)
    for k, row in enumerate(triangles):
        for edge in _edges(row):
            neighbours[edge].append(k)
    left = np.ones(len(triangles), dtype=bool)
    found = []
    # the largest triangle knows its plane best
    for seed in np.argsort(-areas):
        if not left[seed]:
            continue
        left[seed] = False
        members, stack = [seed], [seed]
        normal = normals[seed] / max(areas[seed], 1e-300)
        while stack:
            here = stack.pop()
            for edge in _edges(triangles[here]):
                for other in neighbours[edge]:
                    if left[other] and np.abs((corners[other] - corners[seed, 0]) @ normal).max() <= tolerance:
                        left[other] = False
                        members.append(other)
                        stack.append(other)
        found.append(triangles[members])
    return found


def _edges(row: Indices) -> list[Edge]:
    a, b, c = (int(node) for node in row)
    return [(min(p, q), max(p, q)) for p, q in ((a, b), (b, c), (c, a))]


def _borders(triangles: Indices) -> list[Edge]:
    """Edges of one triangle only."""
    counts: dict[Edge, int] = defaultdict(int)
    for row in triangles:
        for edge in _edges(row):
            counts[edge] += 1
    return [edge for edge, count in counts.items() if count == 1]


def _straightened(points: Array, edges: list[Edge], tolerance: float) -> dict[Edge, list[Edge]]:
    """Edges that continue each other in one line as one, with the edges that it consists of."""
    chains: dict[Edge, list[Edge]] = {edge: [edge] for edge in edges}
    at: dict[int, set[Edge]] = defaultdict(set)
    for edge in edges:
        for node in edge:
            at[node].add(edge)
    for node in list(at):
        if len(at[node]) != 2:
            continue
        one, other = at[node]
        a, b = (next(end for end in edge if end != node) for edge in (one, other))
        joined = (min(a, b), max(a, b))
        if a == b or joined in chains or _off(points[node], points[a], points[b]) > tolerance:
            continue
        chains[joined] = chains.pop(one) + chains.pop(other)
        for end in (a, b):
            at[end] = (at[end] - {one, other}) | {joined}
        del at[node]
    return chains


def _off(point: Array, a: Array, b: Array) -> float:
    """Distance of a point from the line between two others; infinite where it is not between them."""
    along = b - a
    length = float(np.linalg.norm(along))
    if length == 0.0 or not 0.0 < float((point - a) @ along) < length**2:
        return float("inf")
    return float(np.linalg.norm(np.cross(point - a, along))) / length


def _loops(edges: list[Edge]) -> list[list[Edge]]:
    """Directed edges in closed loops."""
    at = defaultdict(list)
    for edge in edges:
        for node in edge:
            at[node].append(edge)
    left = set(edges)
    found = []
    while left:
        first = next(iter(left))
        left.discard(first)
        loop, end = [first], first[1]
        while end != first[0]:
            following = next((edge for edge in at[end] if edge in left), None)
            if following is None:
                raise ValueError("its triangles do not close around a flat face: repair it, or export STEP")
            left.discard(following)
            directed = following if following[0] == end else following[::-1]
            loop.append((directed[0], directed[1]))
            end = directed[1]
        found.append(loop)
    return found


def _size(points: Array, loop: list[Edge]) -> float:
    """Area within a loop."""
    corners = points[[edge[0] for edge in loop]]
    return 0.5 * float(np.linalg.norm(np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)))
