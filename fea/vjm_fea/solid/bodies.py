"""Whether a drawing holds one body, in one piece."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import connected_components

from vjm_fea.solid.faces import inside
from vjm_fea.solid.mesh import Indices

TRIANGLE3, TETRAHEDRON4 = 2, 4
"""gmsh's numbers of its elements."""


def one_body(gmsh: Any, name: str) -> int:  # noqa: ANN401
    """Make bodies that touch one, with common faces; gives how many they were.

    Raises:
        ValueError: there is none, or some do not touch.
    """
    bodies = [tag for _, tag in gmsh.model.getEntities(3)]
    if not bodies:
        raise ValueError(f"{name}: holds no solid, only surfaces or lines: export the part as a solid")
    count = len(bodies)
    if count == 1:
        return 1
    gmsh.model.occ.fragment([(3, bodies[0])], [(3, tag) for tag in bodies[1:]])
    gmsh.model.occ.synchronize()
    bodies = [tag for _, tag in gmsh.model.getEntities(3)]
    owner = {tag: tag for tag in bodies}
    for _, face in gmsh.model.getEntities(2):
        above, _ = gmsh.model.getAdjacencies(2, face)
        if len(above) == 2:
            old, new = owner[int(above[0])], owner[int(above[1])]
            owner = {tag: new if one == old else one for tag, one in owner.items()}
    _refuse(name, len(set(owner.values())))
    return count


def check_one_mesh(gmsh: Any, name: str, kind: str) -> int:  # noqa: ANN401
    """Refuse a mesh of tetrahedra, or the triangles of an STL, that fall apart; gives how many bodies it holds.

    Raises:
        ValueError: there is no body, or more than one.
    """
    if not gmsh.model.getEntities(3):
        raise ValueError(f"{name}: holds no solid, only surfaces or lines: export the part as a solid")
    corners, element = (3, TRIANGLE3) if kind == ".stl" else (4, TETRAHEDRON4)
    nodes = np.asarray(gmsh.model.mesh.getElementsByType(element)[1], dtype=np.int64).reshape(-1, corners)
    bodies = len([tag for _, tag in gmsh.model.getEntities(3)])
    if not len(nodes):
        return bodies
    pieces = _pieces(nodes)
    if kind == ".msh":
        _refuse(name, int(pieces.max()) + 1)
        return bodies
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    place[tags.astype(np.int64)] = np.arange(len(tags))
    triangles = np.asarray(coordinates).reshape(-1, 3)[place[nodes]]
    surfaces = [triangles[pieces == k] for k in range(int(pieces.max()) + 1)]
    # a surface within another one is that of a hollow
    outer = [
        one
        for k, one in enumerate(surfaces)
        if not any(inside(one[0, 0], other) for m, other in enumerate(surfaces) if m != k)
    ]
    _refuse(name, len(outer))
    return bodies


def _pieces(nodes: Indices) -> Indices:
    """Number ``(m,)`` of the piece that each element, with its nodes ``(m, k)``, belongs to."""
    _, inverse = np.unique(nodes, return_inverse=True)
    rows = inverse.reshape(nodes.shape)
    pairs = np.concatenate([rows[:, [0, k]] for k in range(1, nodes.shape[1])])
    count = int(rows.max()) + 1
    links = scipy.sparse.coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, labels = connected_components(links, directed=False)
    result: Indices = np.asarray(labels, dtype=np.int64)[rows[:, 0]]
    return result


def _refuse(name: str, count: int) -> None:
    if count > 1:
        raise ValueError(f"{name}: holds {count} bodies that do not touch: export one part, or join them")
