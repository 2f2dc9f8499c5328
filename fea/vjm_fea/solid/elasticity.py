"""Linear elasticity of an isotropic solid on quadratic tetrahedra: stiffness, loads, stress.

Displacements are numbered node by node: component a of node n is ``3 n + a``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse

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
        result: Array = np.einsum("aeq,eq->a", x, self.basis.dx) / self.volume
        return result

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
        result: Array = total / count[:, None, None]
        return result


def von_mises(stress: Array) -> Array:
    """Von Mises' equivalent ``(n,)`` of stresses ``(n, 3, 3)``."""
    deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    result: Array = np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2)))
    return result


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
