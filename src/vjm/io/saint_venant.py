"""Torsion, warping and shear of cross-sections: Saint-Venant's problems, solved when a constant is asked for.

Sections of right angles are meshed by a quarter, with elements of degree `DEGREE` that shrink towards the
re-entrant corner and the free ends. Prandtl's stress function gives the torsion constant, and the warping function
the warping constant. The shear functions of Pilkey (*Analysis and Design of Elastic Beams*, 2002, chapter 6) give
the shear areas: those for which ``V²/(2 G A_s)`` is the energy of the shear stresses. They depend on Poisson's
ratio. Errors are below 0.05 % down to walls of `THINNEST`, see ``tests/vjm/io/test_section_constants.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, lru_cache
from typing import assert_never

import numpy as np
from numpy.polynomial import legendre

from vjm.rotations import Array

DEGREE = 4
"""Of the elements' polynomials."""
FINEST = 0.03
"""Smallest element, at the re-entrant corner, over the smallest length of the section."""
GROWTH = 8.0
"""Distance of an element's far border from the corner over that of its near border."""
THINNEST = 1e-4
"""Wall over the section's larger side down to which rounding leaves shear areas 0.1 %; at 1e-6 it takes 5 %."""


class Empty(StrEnum):
    """What a quarter of a section lacks of its rectangle."""

    NOTHING = "nothing"
    CORE = "core"
    """Both inner: a tube."""
    SIDES = "sides"
    """The inner part along y, the outer part along z: an I with its web along y."""


@dataclass(frozen=True)
class Quarter:
    """The quarter ``y, z ≥ 0`` of a section that is symmetric about y and z.

    Attributes:
        y: distances from the centre at which something begins or ends, and of the outer border, mm.
        z: the same along z.
        empty: what is cut out between them; nothing leaves the outer ones only.

    Example:
        >>> round(Quarter((0.0, 10.0), (0.0, 10.0), Empty.NOTHING).area)
        400
    """

    y: tuple[float, float]
    z: tuple[float, float]
    empty: Empty

    @property
    def bands(self) -> list[tuple[float, float, float, float]]:
        """Bands from one y to another, filled from one z to another, mm."""
        (yi, yo), (zi, zo) = self.y, self.z
        match self.empty:
            case Empty.NOTHING:
                return [(0.0, yo, 0.0, zo)]
            case Empty.CORE:
                return [(0.0, yi, zi, zo), (yi, yo, 0.0, zo)]
            case Empty.SIDES:
                return [(0.0, yi, 0.0, zi), (yi, yo, 0.0, zo)]
            case _:
                assert_never(self.empty)

    @property
    def area(self) -> float:
        """Of the whole section, mm²."""
        return 4.0 * sum((b - a) * (d - c) for a, b, c, d in self.bands)

    @property
    def inertias(self) -> tuple[float, float]:
        """Second moments of area of the whole section about y and about z, mm⁴."""
        about_y = sum((b - a) * (d**3 - c**3) for a, b, c, d in self.bands)
        about_z = sum((b**3 - a**3) * (d - c) for a, b, c, d in self.bands)
        return 4.0 / 3.0 * about_y, 4.0 / 3.0 * about_z


@lru_cache(maxsize=512)
def torsion(quarter: Quarter) -> float:
    """Torsion constant J of a section, mm⁴: the torque over shear modulus and twist, the ends free to warp."""
    if quarter.empty is Empty.NOTHING:
        return rectangle_torsion(2.0 * quarter.y[1], 2.0 * quarter.z[1])
    return _mesh(quarter).torsion()


@lru_cache(maxsize=512)
def warping(quarter: Quarter) -> float:
    """Warping constant of a section, mm⁶: the integral of the squared warping function about its centre."""
    return _mesh(quarter).warping()


@lru_cache(maxsize=512)
def shear_areas(quarter: Quarter, poissons_ratio: float) -> tuple[float, float]:
    """Shear areas of a section for deflection along y and along z, mm², by the energy of the shear stresses."""
    return _mesh(quarter).shear_areas(poissons_ratio)


def rectangle_torsion(width: float, thickness: float) -> float:
    """Saint-Venant torsion constant of a solid rectangle, mm⁴ for sides in mm, by its exact series.

    ``J = a b³/3 (1 − 192/π⁵ · b/a · Σ tanh(n π a/2b)/n⁵)`` over odd n, a ≥ b (Timoshenko and Goodier,
    *Theory of Elasticity*, §109).
    """
    a, b = max(width, thickness), min(width, thickness)
    # terms fall as n⁻⁵: the first one left out is 3e-17 of the sum
    n = np.arange(1.0, 2000.0, 2.0)
    series = float(np.sum(np.tanh(0.5 * np.pi * n * a / b) / n**5))
    return a * b**3 / 3.0 * (1.0 - 192.0 / np.pi**5 * (b / a) * series)


def round_shear_area(diameter: float, bore: float, poissons_ratio: float) -> float:
    """Shear area of a round bar or tube, mm², exact by the energy of the shear stresses.

    The shear function of Pilkey's chapter 6 is ``(A r + B/r − r³/4) cos θ`` between two circles. A bar has
    ``6 (1 + ν)²/(7 + 14 ν + 8 ν²)`` of its area.
    """
    a, b, nu = 0.5 * diameter, 0.5 * bore, poissons_ratio
    c, e = 0.25 * (3.0 + 2.0 * nu), 0.25 * (1.0 - 2.0 * nu)
    A, B = c * (a**2 + b**2), c * a**2 * b**2
    ring = a**2 - b**2
    energy = A**2 * ring + c * B * ring + (c**2 + e**2) * (a**6 - b**6) / 6.0
    energy += -0.5 * A * (a**4 - b**4) + 0.5 * B * (1.0 + 2.0 * nu) * ring
    inertia = 0.25 * np.pi * (a**4 - b**4)
    return float((2.0 * (1.0 + nu) * inertia) ** 2 / (np.pi * energy))


@lru_cache(maxsize=1)
def _element() -> tuple[Array, Array, Array, Array]:
    """Gauss points and weights ``(q,)``, and the shape functions ``(q, n)`` and their slopes there, on −1 to 1."""
    own = np.eye(DEGREE + 1)
    nodes = np.concatenate([[-1.0], legendre.legroots(legendre.legder(own[-1])), [1.0]])
    points, weights = legendre.leggauss(DEGREE + 2)
    modal = np.linalg.inv(legendre.legvander(nodes, DEGREE))
    slopes = np.stack([legendre.legval(points, legendre.legder(row)) for row in own], axis=1)
    return points, weights, legendre.legvander(points, DEGREE) @ modal, slopes @ modal


def _graded(length: float, first: float, last: float) -> list[float]:
    """Borders of elements over a length, with sizes that grow from both ends, or from the first alone."""
    to = 0.5 * length if last else length

    def growing(size: float) -> list[float]:
        # the remainder is no sliver
        count = int(np.ceil(np.log(to / size) / np.log(GROWTH) - 0.3))
        return [size * GROWTH**k for k in range(max(count, 0))]

    there = [length - x for x in reversed(growing(last))] if last else []
    middle = [to] if last else []
    return [0.0, *growing(first), *middle, *there, length]


class _Mesh:
    """Elements of a quarter; arrays of fields at the Gauss points are ``(elements, q, q)``, along y and z."""

    def __init__(self, quarter: Quarter) -> None:
        solid = quarter.empty is Empty.NOTHING
        lengths = [s for inner, outer in (quarter.y, quarter.z) for s in (inner, outer - inner) if s > 0.0]
        self.smallest = min(lengths)
        self.empty, self.hole = quarter.empty, quarter.y[0] * quarter.z[0]
        borders = [self._borders(*ends, solid) for ends in (quarter.y, quarter.z)]
        # how many elements lie before the inner border
        inner = zip(borders, (quarter.y[0], quarter.z[0]), strict=True)
        self.inner = [0 if solid else int(np.argmin(np.abs(b - at))) for b, at in inner]
        self.counts = [len(b) - 1 for b in borders]
        i, j = (grid.ravel() for grid in np.meshgrid(*(np.arange(n) for n in self.counts), indexing="ij"))
        match quarter.empty:
            case Empty.NOTHING:
                filled = np.ones(len(i), dtype=bool)
            case Empty.CORE:
                filled = (i >= self.inner[0]) | (j >= self.inner[1])
            case Empty.SIDES:
                filled = (i >= self.inner[0]) | (j < self.inner[1])
            case _:
                assert_never(quarter.empty)
        i, j = i[filled], j[filled]
        points, self.weights, self.values, self.slopes = _element()
        self.size = np.diff(borders[0])[i], np.diff(borders[1])[j]
        start = borders[0][i], borders[1][j]
        half = [0.5 * size[:, None] * (points + 1.0) for size in self.size]
        shape = (len(i), len(points), len(points))
        self.y = np.broadcast_to((start[0][:, None] + half[0])[:, :, None], shape)
        self.z = np.broadcast_to((start[1][:, None] + half[1])[:, None, :], shape)
        self.areas = 0.25 * (self.size[0] * self.size[1])[:, None, None] * np.outer(self.weights, self.weights)
        n = np.arange(DEGREE + 1)
        self.row, self.column = (k[:, None] * DEGREE + n for k in (i, j))

    def _borders(self, inner: float, outer: float, solid: bool) -> Array:
        if solid:
            return outer - np.array(_graded(outer, self.smallest, 0.0)[::-1])
        corner = FINEST * self.smallest
        before = inner - np.array(_graded(inner, corner, 0.0)[::-1])
        return np.concatenate([before, inner + np.array(_graded(outer - inner, corner, self.smallest)[1:])])

    def integral(self, field: Array) -> float:
        """Over the whole section."""
        return 4.0 * float(np.sum(self.areas * field))

    @cached_property
    def _stiffness(self) -> Array:
        """Matrices ``(elements, n², n²)`` of the Laplacian."""
        K = self.slopes.T @ (self.weights[:, None] * self.slopes)
        M = self.values.T @ (self.weights[:, None] * self.values)
        n = (DEGREE + 1) ** 2
        along_y = np.einsum("ac,bd->abcd", K, M).reshape(n, n)
        along_z = np.einsum("ac,bd->abcd", M, K).reshape(n, n)
        ratio = (self.size[1] / self.size[0])[:, None, None]
        return ratio * along_y + along_z / ratio

    def _solve(self, right: Array, zero: Array, tied: Array, more: float = 0.0) -> Array:
        """Nodal values ``(elements, n, n)`` of a Poisson problem.

        Args:
            right: ``(elements, n, n)``, its right side, node by node.
            zero: nodes ``(elements, n, n)`` that are zero.
            tied: nodes that have one value.
            more: of the right side, on the tied ones.
        """
        # scipy's sparse matrices take a tenth of a second to import, which most models need not
        from scipy.sparse import csc_matrix
        from scipy.sparse.linalg import splu

        number = 2 + self.row[:, :, None] * (self.counts[1] * DEGREE + 1) + self.column[:, None, :]
        number = np.where(zero, 0, np.where(tied, 1, number))
        # zero and tied are there once, so that the first two numbers are theirs
        _, packed = np.unique(np.concatenate([[0, 1], number.ravel()]), return_inverse=True)
        dof = packed.ravel()[2:].reshape(len(number), -1)
        count, n = int(dof.max()) + 1, dof.shape[1]
        rows, columns = np.repeat(dof, n, axis=1).ravel(), np.tile(dof, (1, n)).ravel()
        K = csc_matrix((self._stiffness.ravel(), (rows, columns)), shape=(count, count))
        F = np.bincount(dof.ravel(), right.ravel(), minlength=count)
        F[1] += more
        first = 1 if tied.any() else 2
        u = np.zeros(count)
        free = csc_matrix(K[first:, first:])
        # symmetric and positive definite: no pivoting
        factors = splu(free, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        u[first:] = factors.solve(F[first:])
        return u[dof].reshape(right.shape)

    def _nodal(self, source: Array, along_y: Array, along_z: Array) -> Array:
        """Integrals ``(elements, n, n)`` of a source times a shape function, and of a field times its gradient."""
        N, D = self.values, self.slopes

        def summed(field: Array, first: Array, second: Array) -> Array:
            return np.asarray(np.einsum("eqr,qa,rb->eab", self.areas * field, first, second, optimize=True))

        by = [2.0 / size[:, None, None] for size in self.size]
        return summed(source, N, N) + summed(along_y, D, N) * by[0] + summed(along_z, N, D) * by[1]

    def _at_points(self, u: Array, first: Array, second: Array) -> Array:
        return np.asarray(np.einsum("eab,qa,rb->eqr", u, first, second, optimize=True))

    def _gradient(self, u: Array) -> tuple[Array, Array]:
        by = [2.0 / size[:, None, None] for size in self.size]
        N, D = self.values, self.slopes
        return self._at_points(u, D, N) * by[0], self._at_points(u, N, D) * by[1]

    def torsion(self) -> float:
        """By Prandtl's stress function: −2 its Laplacian, zero outside, one value on the border of a hole."""
        row, column = self.row[:, :, None], self.column[:, None, :]
        at = [DEGREE * n for n in self.inner]
        outer = (row == DEGREE * self.counts[0]) | (column == DEGREE * self.counts[1])
        match self.empty:
            case Empty.NOTHING:
                inner = np.zeros_like(outer)
            case Empty.CORE:
                inner = ((row == at[0]) & (column <= at[1])) | ((column == at[1]) & (row <= at[0]))
            case Empty.SIDES:
                inner = ((row == at[0]) & (column >= at[1])) | ((column == at[1]) & (row <= at[0]))
            case _:
                assert_never(self.empty)
        none, nothing = np.zeros_like(outer), np.zeros_like(self.y)
        right = self._nodal(2.0 + nothing, nothing, nothing)
        if self.empty is not Empty.CORE:
            u = self._solve(right, outer | inner, none)
            return 4.0 * float(np.sum(right * u))
        u = self._solve(right, outer, inner, 2.0 * self.hole)
        return 4.0 * (float(np.sum(right * u)) + 2.0 * self.hole * float(u[inner].max()))

    def warping(self) -> float:
        """By the warping function, whose slope across the border is that of the twist about the centre."""
        right = self._nodal(np.zeros_like(self.y), self.z, -self.y)
        zero = (self.row[:, :, None] == 0) | (self.column[:, None, :] == 0)
        u = self._solve(right, zero, np.zeros_like(zero))
        return self.integral(self._at_points(u, self.values, self.values) ** 2)

    def shear_areas(self, nu: float) -> tuple[float, float]:
        """Along y and along z: the shear function is zero where the other axis crosses the section."""
        y, z = self.y, self.z
        square, product = 0.5 * nu * (y**2 - z**2), nu * y * z
        row = np.broadcast_to(self.row[:, :, None], (len(y), DEGREE + 1, DEGREE + 1))
        column = np.broadcast_to(self.column[:, None, :], row.shape)
        return (
            self._shear_area(y, square, product, row == 0, nu),
            self._shear_area(z, product, -square, column == 0, nu),
        )

    def _shear_area(self, along: Array, by_y: Array, by_z: Array, zero: Array, nu: float) -> float:
        source = 2.0 * (1.0 + nu) * along
        slopes = self._gradient(self._solve(self._nodal(source, by_y, by_z), zero, np.zeros_like(zero)))
        energy = self.integral((slopes[0] - by_y) ** 2 + (slopes[1] - by_z) ** 2)
        return self.integral(source * along) ** 2 / energy


@lru_cache(maxsize=4)
def _mesh(quarter: Quarter) -> _Mesh:
    return _Mesh(quarter)
