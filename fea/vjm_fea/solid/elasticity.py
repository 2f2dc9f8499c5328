"""Linear elasticity of an isotropic solid on quadratic tetrahedra.

Here are stiffness, loads, stress, and the highest von Mises stress under any wrench as quadratic forms.
Displacements are numbered node by node: component a of node n is ``3 n + a``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vjm.rotations import Array, skew
from vjm_fea.solid.mesh import Indices, SolidMesh

CHUNK = 8000
"""Elements whose matrices are made at once: some 60 MB."""
UPPER = np.triu_indices(30)


@dataclass(frozen=True)
class IsotropicMaterial:
    """An isotropic one.

    Attributes:
        youngs_modulus: MPa.
        poissons_ratio: above −1 and below 0.5.
        density: kg/mm³.
    """

    youngs_modulus: float
    poissons_ratio: float
    density: float = 0.0

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's λ and μ, MPa."""
        E, nu = self.youngs_modulus, self.poissons_ratio
        return E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), 0.5 * E / (1.0 + nu)


@dataclass(frozen=True)
class ElasticSolid:
    """A meshed solid of one material."""

    mesh: SolidMesh
    material: IsotropicMaterial

    def __getstate__(self) -> dict[str, Any]:
        """As that of the mesh."""
        return {"mesh": self.mesh, "material": self.material}

    @cached_property
    def basis(self) -> Any:  # noqa: ANN401
        """Shape functions at the elements' quadrature points."""
        return self.mesh.basis()

    def stiffness(self) -> scipy.sparse.csr_matrix:
        """Upper triangle of the stiffness matrix ``(3 n, 3 n)``, N/mm.

        An element's block between nodes i and j is ``λ ∇φᵢ∇φⱼᵀ + μ (∇φⱼ∇φᵢᵀ + ∇φᵢ·∇φⱼ I)``, integrated.
        """
        lam, mu = self.material.lame
        gradients = [self.basis.basis[j][0].grad for j in range(10)]
        dx = self.basis.dx
        dofs = (3 * self.mesh.elements[:, :, None] + np.arange(3)).reshape(-1, 30)
        n = self.mesh.unknowns
        total = scipy.sparse.csr_matrix((n, n))
        pieces = []
        for start in range(0, len(dofs), CHUNK):
            part = slice(start, start + CHUNK)
            # (m, 30, q): gradient of shape function i along a at row 3 i + a
            g = np.stack([one[:, part] for one in gradients]).transpose(2, 0, 1, 3)
            m, q = g.shape[0], g.shape[3]
            g = g.reshape(m, 30, q)
            blocks = np.matmul(g * dx[part, None, :], g.transpose(0, 2, 1)).reshape(m, 10, 3, 10, 3)
            trace = np.einsum("miaja->mij", blocks)
            local = lam * blocks + mu * blocks.transpose(0, 1, 4, 3, 2)
            for a in range(3):
                local[:, :, a, :, a] += mu * trace
            values = local.reshape(m, 30, 30)[:, UPPER[0], UPPER[1]].ravel()
            rows, columns = dofs[part][:, UPPER[0]].ravel(), dofs[part][:, UPPER[1]].ravel()
            low, high = np.minimum(rows, columns).astype(np.int32), np.maximum(rows, columns).astype(np.int32)
            pieces.append(scipy.sparse.csr_matrix((values, (low, high)), shape=(n, n)))
            if len(pieces) == 4:
                total, pieces = total + sum(pieces[1:], pieces[0]), []
        for piece in pieces:
            total = total + piece
        return total

    @cached_property
    def volume(self) -> float:
        """mm³."""
        return float(np.sum(self.basis.dx))

    @cached_property
    def centroid(self) -> Array:
        """Centre of volume ``(3,)``, mm."""
        x = np.asarray(self.basis.global_coordinates())
        return np.einsum("aeq,eq->a", x, self.basis.dx) / self.volume

    def face_moments(self, faces: Sequence[int], about: Array) -> tuple[Array, Array]:
        """What a face feels of its rigid motions, for loads and means over it.

        Args:
            faces: numbers of faces.
            about: point ``(3,)`` mm.

        Returns:
            ``P`` ``(3 n, 6)`` with ``Pᵀu = ∫ R(x)ᵀ u dA`` and ``∫ Rᵀ R dA`` ``(6, 6)``, R the rigid motions
            ``[I, −(x−about)×]``.
        """
        basis = self.mesh.face_basis(faces)
        x, dx = np.asarray(basis.global_coordinates()), basis.dx
        r = x - about[:, None, None]
        modes = np.zeros((3, 6, *dx.shape))
        for a in range(3):
            modes[a, a] = 1.0
        # a turn w moves x by w × r
        modes[0, 4], modes[0, 5] = r[2], -r[1]
        modes[1, 3], modes[1, 5] = -r[2], r[0]
        modes[2, 3], modes[2, 4] = r[1], -r[0]
        P = np.zeros((len(self.mesh.points), 3, 6))
        for j in range(10):
            values = np.einsum("acfq,fq->fac", modes, np.asarray(basis.basis[j][0]) * dx)
            np.add.at(P, basis.element_dofs[j], values)
        square = np.einsum("acfq,adfq,fq->cd", modes, modes, dx)
        return P.reshape(-1, 6), square

    def pressure(self, faces: Sequence[int], size: float) -> Array:
        """Nodal forces ``(3 n,)`` N of a pressure in MPa on some faces, inwards."""
        basis = self.mesh.face_basis(faces)
        F = np.zeros((len(self.mesh.points), 3))
        for j in range(10):
            values = np.einsum("afq,fq->fa", basis.normals, -size * np.asarray(basis.basis[j][0]) * basis.dx)
            np.add.at(F, basis.element_dofs[j], values)
        return F.ravel()

    def stress(self, u: Array, eigenstrain: Array | None = None) -> Array:
        """Stress ``(n, 3, 3)`` MPa at the nodes, for displacements ``u`` ``(3 n,)``.

        Computed at four points of every element, where quadratic elements are most accurate, carried to the
        element's nodes linearly and averaged over the elements that meet there.

        Args:
            u: displacements.
            eigenstrain: ``(n,)`` an equal strain of all directions at the nodes that makes no stress, such as αT.
        """
        basis = self.mesh.basis(order=2)
        elements = self.mesh.elements
        local = u.reshape(-1, 3)[elements]
        grad = sum(np.einsum("ma,bmq->mqab", local[:, j], basis.basis[j][0].grad) for j in range(10))
        strain = 0.5 * (grad + np.swapaxes(grad, 2, 3))
        if eigenstrain is not None:
            given = sum(
                np.broadcast_to(np.asarray(basis.basis[j][0]), basis.dx.shape) * eigenstrain[elements[:, j], None]
                for j in range(10)
            )
            strain = strain - np.asarray(given)[:, :, None, None] * np.eye(3)
        lam, mu = self.material.lame
        sigma = lam * np.trace(strain, axis1=2, axis2=3)[:, :, None, None] * np.eye(3) + 2.0 * mu * strain
        # linear functions through the quadrature points, at the ten nodes
        points = np.column_stack([np.ones(basis.X.shape[1]), basis.X.T])
        nodes = np.column_stack([np.ones(10), basis.elem.doflocs])
        carry = nodes @ np.linalg.inv(points)
        at_nodes = np.einsum("jq,mqab->mjab", carry, sigma)
        total = np.zeros((len(self.mesh.points), 3, 3))
        np.add.at(total, elements, at_nodes)
        count = np.bincount(elements.ravel(), minlength=len(total))
        return total / count[:, None, None]


def von_mises(stress: Array) -> Array:
    """Von Mises' equivalent ``(n,)`` of stresses ``(n, 3, 3)``."""
    deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    return np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2)))


def rigid_motions(points: Array, about: Array) -> Array:
    """Displacements ``(3 n, 6)`` of points ``(n, 3)`` in unit shifts and turns about a point ``(3,)``."""
    result = np.zeros((len(points), 3, 6))
    result[:, :, :3] = np.eye(3)
    for k, axis in enumerate(np.eye(3)):
        result[:, :, 3 + k] = np.cross(axis, points - about)
    return result.reshape(-1, 6)


def carried(vector: Array) -> Array:
    """Matrix ``(6, 6)`` that takes a rigid motion at a point to that at the point ``vector`` (3,) further."""
    result = np.eye(6)
    result[:3, 3:] = -skew(vector)
    return result


def components(nodes: Indices) -> Indices:
    """Numbers of the three displacements of every node."""
    return (3 * nodes[:, None] + np.arange(3)).ravel()


Mask = NDArray[np.bool_]

AWAY = 0.5
"""Distance from base and tip, in thicknesses of the part, from which on Saint-Venant's principle is relied upon."""
WRENCHES = 4000
"""Directions of the wrench that are tried."""
BELOW = 0.005
"""What the kept points may miss of the highest stress under a wrench that was tried, over it."""
NODE_CHUNK = 2000
"""Nodes whose stresses are compared at once: 64 MB."""
UPPER_WRENCH = np.triu_indices(6)


def away_from_ends(solid: ElasticSolid, faces: list[int], thickness: float) -> Mask:
    """Which nodes ``(n,)`` lie `AWAY` thicknesses or more from base and tip; all where none does."""
    points = solid.mesh.points
    distance = np.asarray(cKDTree(points[solid.mesh.face_nodes(faces)]).query(points)[0])
    away: Mask = distance > AWAY * thickness
    return away if np.any(away) else np.ones_like(away)


def stress_forms(solid: ElasticSolid, displacements: Array, away: Mask) -> tuple[Array, Array]:
    """Points ``(k, 3)`` mm and matrices ``(k, 6, 6)`` Q, so that √(max wᵀ Q w) is the highest von Mises stress.

    Under a wrench w; MPa, N, N mm.

    The squared von Mises stress at a node is a quadratic form of the wrench. Of all nodes those are kept that
    together come within `BELOW` of the highest stress under each of `WRENCHES` wrenches.

    Args:
        solid: the part.
        displacements: ``(3 n, 6)`` under unit wrenches.
        away: which nodes count ``(n,)``.
    """
    nodes = np.flatnonzero(away)
    unit = np.stack([solid.stress(displacements[:, k])[nodes] for k in range(6)], axis=1)
    deviator = unit - np.trace(unit, axis1=2, axis2=3)[..., None, None] / 3.0 * np.eye(3)
    forms: Array = 1.5 * np.einsum("nkab,nlab->nkl", deviator, deviator)
    scale = 1.0 / np.sqrt(np.max(np.einsum("nkk->nk", forms), axis=0))
    tried = np.random.default_rng(1).standard_normal((WRENCHES, 6)) * scale
    tried = np.vstack([tried, np.diag(scale)])
    kept = _covering(_flat(forms), _products(tried))
    return solid.mesh.points[nodes[kept]], forms[kept]


def _flat(forms: Array) -> Array:
    """Upper triangles ``(k, 21)``, those off the diagonal doubled."""
    twice = np.where(UPPER_WRENCH[0] == UPPER_WRENCH[1], 1.0, 2.0)
    return forms[:, UPPER_WRENCH[0], UPPER_WRENCH[1]] * twice


def _products(wrenches: Array) -> Array:
    return wrenches[:, UPPER_WRENCH[0]] * wrenches[:, UPPER_WRENCH[1]]


def _covering(flat: Array, products: Array) -> Indices:
    """Fewest nodes, about, that serve every wrench: again and again the one that serves most of those left."""
    highest = np.full(len(products), -1.0)
    where = np.zeros(len(products), dtype=np.int64)
    for start in range(0, len(flat), NODE_CHUNK):
        values = flat[start : start + NODE_CHUNK] @ products.T
        best = np.argmax(values, axis=0)
        value = values[best, np.arange(len(products))]
        where = np.where(value > highest, start + best, where)
        highest = np.maximum(value, highest)
    candidates = np.unique(where)
    serves = flat[candidates] @ products.T >= (1.0 - BELOW) ** 2 * highest
    kept = []
    left = np.ones(len(products), dtype=bool)
    while left.any():
        best_one = int(np.argmax(np.sum(serves & left, axis=1)))
        kept.append(candidates[best_one])
        left &= ~serves[best_one]
    return np.array(sorted(kept), dtype=np.int64)
