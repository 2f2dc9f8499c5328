"""A part's own sections from base to tip, and the column that they make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from vjm.rotations import Array
from vjm_fea.solid.elasticity import ElasticSolid

STATIONS = 41
"""Sections from base to tip. Of a part that tapers by a factor e the second moments are 0.01 % off by that."""
ELEMENTS = 5
"""Of the column between two of them: Euler's load is 1e-5 off."""


@dataclass(frozen=True)
class SectionsAlong:
    """Sections across the line from the base's centre to the tip's.

    Attributes:
        x: places ``(n,)`` along the line, mm.
        length: of the line, mm.
        axes: ``(3, 3)``, columns along the line and across it.
        area: ``(n,)`` mm².
        offset: of their centres from the line, across it, ``(n, 2)`` mm.
        second: second moments of area about their centres ``(n, 2, 2)``, mm⁴: ``∫ r rᵀ dA``, r across the line.
        depth: the larger width across the line, along the part's principal axes, ``(n,)`` mm.
    """

    x: Array
    length: float
    axes: Array
    area: Array
    offset: Array
    second: Array
    depth: Array

    @property
    def gyration(self) -> float:
        """Mean of the sections' larger radii of gyration, mm."""
        return float(np.mean(np.sqrt(np.linalg.eigvalsh(self.second)[:, 1] / self.area)))

    @property
    def straight(self) -> bool:
        """Whether the centres keep to the line, to a tenth of the depth."""
        return bool(np.all(np.linalg.norm(self.offset, axis=1) <= 0.1 * self.depth))


def sections_along(solid: ElasticSolid, start: Array, end: Array) -> SectionsAlong | None:
    """Sections of a meshed part between two points ``(3,)``; None where a plane across the line meets nothing.

    Each is a mean over twice the distance of two stations, weighted by a hat function: all of it is integrals over
    the volume, which the mesh gives without any cut.
    """
    length = float(np.linalg.norm(end - start))
    if length == 0.0:
        return None
    along = (end - start) / length
    axes = np.column_stack([along, np.linalg.svd(along[None, :])[2][1:].T])
    x, y, z = np.einsum("ab,beq->aeq", axes.T, np.asarray(solid.basis.global_coordinates()) - start[:, None, None])
    dx, step = np.asarray(solid.basis.dx), length / (STATIONS - 1)
    inside = (x >= 0.0) & (x <= length)
    low = np.clip((x / step).astype(int), 0, STATIONS - 2)
    share = x / step - low
    fields = np.stack([np.ones_like(x), x, y, z, y * y, y * z, z * z]) * dx
    sums = np.zeros((len(fields), STATIONS))
    for k, field in enumerate(fields):
        for node, weight in ((low, 1.0 - share), (low + 1, share)):
            sums[k] += np.bincount(node[inside], (weight * field)[inside], minlength=STATIONS)
    if np.any(sums[0] <= 0.0):
        return None
    width = np.full(STATIONS, step)
    width[[0, -1]] *= 0.5
    # hats at the ends are half ones, with their centre a third of the step inside
    place: Array = np.arange(STATIONS, dtype=np.float64) * step
    place[[0, -1]] += np.array([1.0, -1.0]) * step / 3.0
    area = sums[0] / width
    centre = (sums[2:4] / sums[0]).T
    second = np.empty((STATIONS, 2, 2))
    second[:, 0, 0], second[:, 0, 1], second[:, 1, 1] = sums[4:] / sums[0]
    second[:, 1, 0] = second[:, 0, 1]
    # the squares of the offsets within one hat belong to the slope of the centres, not to the section
    second = (second - centre[:, :, None] * centre[:, None, :]) * area[:, None, None]
    # widths along the axes of the whole, of what lies nearest to each station
    near = np.clip(np.rint(x / step).astype(int), 0, STATIONS - 1)
    widths = []
    for direction in np.linalg.eigh(second.sum(axis=0))[1].T:
        across = y * direction[0] + z * direction[1]
        highest, lowest = np.full(STATIONS, -np.inf), np.full(STATIONS, np.inf)
        np.maximum.at(highest, near[inside], across[inside])
        np.minimum.at(lowest, near[inside], across[inside])
        widths.append(highest - lowest)
    return SectionsAlong(place, length, axes, area, centre, second, np.max(widths, axis=0))


@dataclass(frozen=True)
class SectionedColumn:
    """A part as a column of its own sections, held at its base and free at its tip.

    Attributes:
        force: compression at the tip under which it buckles, N, without shear.
        misfit: largest difference of the bending that its sections imply to the part's, over √(c_ii c_jj).
    """

    force: float
    misfit: float


def column(sections: SectionsAlong, modulus: float, compliance: Array) -> SectionedColumn:
    """Buckling of the column whose bending stiffness is the modulus times the sections' second moments.

    Args:
        sections: of the part.
        modulus: Young's, MPa.
        compliance: of the part, ``(6, 6)``, read at the line's end, the drawing's axes.
    """
    n = ELEMENTS * (STATIONS - 1)
    h = sections.length / n
    middle = (np.arange(n) + 0.5) * h
    EI = np.empty((n, 2, 2))
    for i in range(2):
        for j in range(2):
            EI[:, i, j] = modulus * np.interp(middle, sections.x, sections.second[:, i, j])
    K, M = np.zeros((2 * (n + 1),) * 2), np.zeros((2 * (n + 1),) * 2)
    slope, mass = np.array([[1.0, -1.0], [-1.0, 1.0]]) / h, h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    for e in range(n):
        part = slice(2 * e, 2 * e + 4)
        K[part, part] += np.kron(slope, EI[e])
        M[part, part] += np.kron(mass, np.eye(2))
    # the slope is zero at the base; (EI θ')' + P θ = 0
    force = float(scipy.linalg.eigh(K[2:, 2:], M[2:, 2:], eigvals_only=True, subset_by_index=[0, 0])[0])
    # a couple m turns by ∫ (EI)⁻¹ m ds and moves by ∫ (L − s) (EI)⁻¹ m ds; slopes of (y, z) are (φz, −φy)
    inverse = np.linalg.inv(EI)
    turn = h * inverse.sum(axis=0)
    move = h * np.einsum("k,kij->ij", sections.length - middle, inverse)
    rows = np.kron(np.eye(2), sections.axes).T
    own = rows @ compliance @ rows.T
    slopes = np.array([[0.0, 1.0], [-1.0, 0.0]])
    found_turn = slopes @ own[4:, 4:] @ slopes.T
    found_move = own[1:3, 4:] @ slopes.T
    d = np.sqrt(np.diag(own))
    scale_turn = np.outer(d[[5, 4]], d[[5, 4]])
    scale_move = np.outer(d[1:3], d[[5, 4]])
    misfit = max(
        float(np.max(np.abs(turn - found_turn) / scale_turn)), float(np.max(np.abs(move - found_move) / scale_move))
    )
    return SectionedColumn(force, misfit)
