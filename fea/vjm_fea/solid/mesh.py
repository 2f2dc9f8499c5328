"""A mesh of ten-node tetrahedra: nodes, elements and the six-node triangles of every face of the drawing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vjm.rotations import Array
from vjm_fea.solid import load

Indices = NDArray[np.int64]

FROM_GMSH = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]
"""Ten nodes of gmsh's tetrahedron in the order of scikit-fem, whose last two edges are swapped."""
CORNERS = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
"""The corners of an element between which its nodes 4 to 9 lie."""


@dataclass(frozen=True)
class SolidMesh:
    """Quadratic tetrahedra, perhaps with curved edges.

    Attributes:
        points: of the nodes ``(n, 3)``, mm; corners first, then the nodes on edges, as scikit-fem numbers them.
        elements: nodes ``(m, 10)`` of every element, corners first.
        faces: corner nodes ``(k, 3)`` of the triangles of every face of the drawing, by its number.
    """

    points: Array
    elements: Indices
    faces: dict[int, Indices]

    def __getstate__(self) -> dict[str, Any]:
        """The arrays; what was made of them is larger, and is made again where it is asked for."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    @property
    def unknowns(self) -> int:
        """Displacements of all nodes, the held ones included."""
        return 3 * len(self.points)

    @cached_property
    def finite_elements(self) -> Any:  # noqa: ANN401
        """The same as scikit-fem's mesh."""
        return load("skfem").MeshTet2(self.points.T, self.elements[:, :4].T, validate=False)

    def basis(self, order: int = 4) -> Any:  # noqa: ANN401
        """scikit-fem's quadratic shape functions at the quadrature points of every element."""
        skfem = load("skfem")
        return skfem.Basis(self.finite_elements, skfem.ElementTetP2(), intorder=order)

    def face_basis(self, faces: Sequence[int], order: int = 4) -> Any:  # noqa: ANN401
        """The same at the quadrature points of the triangles of some faces."""
        skfem = load("skfem")
        return skfem.FacetBasis(
            self.finite_elements, skfem.ElementTetP2(), facets=self._facets(faces), intorder=order
        )

    def _facets(self, faces: Sequence[int]) -> Indices:
        """scikit-fem's numbers of the triangles."""
        count = len(self.points)

        def keys(triangles: Indices) -> Indices:
            a, b, c = np.sort(triangles, axis=1).T
            return (a * count + b) * count + c

        every = keys(np.asarray(self.finite_elements.facets.T, dtype=np.int64))
        wanted = np.concatenate([keys(self.faces[face]) for face in faces])
        order = np.argsort(every)
        return order[np.searchsorted(every, wanted, sorter=order)]

    def face_nodes(self, faces: Sequence[int]) -> Indices:
        """Numbers ``(k,)`` of the nodes on some faces, those on edges included."""
        basis_dofs = self.finite_elements.dofs if hasattr(self.finite_elements, "dofs") else None
        assert basis_dofs is not None
        return np.unique(np.asarray(basis_dofs.get_facet_dofs(self._facets(faces)).flatten(), dtype=np.int64))


def from_gmsh(points: Array, tets: Indices, triangles: dict[int, Indices]) -> SolidMesh:
    """A mesh from gmsh's nodes, ten-node tetrahedra and six-node triangles by face.

    Args:
        points: ``(n, 3)``; nodes that no element uses are dropped.
        tets: ``(m, 10)`` in gmsh's order, indices into ``points``.
        triangles: ``(k, 6)`` by the number of the face.
    """
    tets = tets[:, FROM_GMSH]
    # scikit-fem wants the corners of every element in rising order; the edge nodes move along
    order = np.argsort(tets[:, :4], axis=1)
    corners = np.take_along_axis(tets[:, :4], order, axis=1)
    used, inverse = np.unique(corners, return_inverse=True)
    corners = inverse.reshape(corners.shape)
    skfem = load("skfem")
    linear = skfem.MeshTet(points[used].T, corners.T, validate=False)
    edges = np.zeros((linear.edges.shape[1], 3))
    place = {frozenset(pair): 4 + k for k, pair in enumerate(CORNERS)}
    # number of the edge node between corners i and j, for every element
    table = np.zeros((4, 4), dtype=np.int64)
    for pair, k in place.items():
        i, j = sorted(pair)
        table[i, j] = table[j, i] = k
    for k, (i, j) in enumerate(CORNERS):
        column = table[order[:, i], order[:, j]]
        edges[linear.t2e[k]] = points[tets[np.arange(len(tets)), column]]
    every = np.vstack([points[used], edges])
    elements = np.hstack([corners, len(used) + linear.t2e.T.astype(np.int64)])
    index = np.full(len(points), -1, dtype=np.int64)
    index[used] = np.arange(len(used))
    return SolidMesh(every, elements, {face: index[nodes[:, :3]] for face, nodes in triangles.items()})
