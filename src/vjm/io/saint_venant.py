"""Torsion, warping and shear of cross-sections: Saint-Venant's problems, solved when a constant is asked for.

Polygons with holes are solved by quadratic triangles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
    def sides(self) -> tuple[float, float]:
        """Outer lengths along y and along z, mm."""
        return 2.0 * self.y[1], 2.0 * self.z[1]

    @property
    def farthest(self) -> tuple[float, float]:
        """Of its points from the axes z and y, mm."""
        return self.y[1], self.z[1]

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

    @property
    def torsion(self) -> float:
        """Torsion constant J, mm⁴: the torque over shear modulus and twist, the ends free to warp."""
        return _torsion(self)

    @property
    def warping(self) -> float:
        """Warping constant, mm⁶: the integral of the squared warping function about its centre."""
        return _warping(self)

    def shear_areas(self, poissons_ratio: float) -> tuple[float, float]:
        """For deflection along y and along z, mm², by the energy of the shear stresses."""
        return _shear_areas(self, poissons_ratio)

    @property
    def steps(self) -> list[float]:
        """Distances ``y ≥ 0`` between which the section's width is smooth."""
        return [self.bands[0][0], *(b for _, b, _, _ in self.bands)]

    def width(self, y: Array) -> Array:
        """Of the section along z at distances ``(k,)`` from the axis z, mm."""
        filled = [np.where((y > a) & (y < b), d - c, 0.0) for a, b, c, d in self.bands]
        return np.asarray(2.0 * np.sum(filled, axis=0))


@dataclass(frozen=True)
class Ring:
    """What lies between two circles, of an outer diameter and a bore, mm."""

    diameter: float
    bore: float
    warping: float = 0.0
    """Circles do not warp."""

    @property
    def sides(self) -> tuple[float, float]:
        """Outer lengths along y and along z, mm."""
        return self.diameter, self.diameter

    @property
    def farthest(self) -> tuple[float, float]:
        """Of its points from the axes z and y, mm."""
        return 0.5 * self.diameter, 0.5 * self.diameter

    @property
    def area(self) -> float:
        """In mm²."""
        return np.pi * (self.diameter**2 - self.bore**2) / 4.0

    @property
    def inertias(self) -> tuple[float, float]:
        """Second moments of area about y and about z, mm⁴."""
        inertia = np.pi * (self.diameter**4 - self.bore**4) / 64.0
        return inertia, inertia

    @property
    def torsion(self) -> float:
        """The polar moment of area, mm⁴."""
        return sum(self.inertias)

    def shear_areas(self, poissons_ratio: float) -> tuple[float, float]:
        """For deflection along y and along z, mm², exact by the energy of the shear stresses.

        The shear function of Pilkey's chapter 6 is ``(A r + B/r − r³/4) cos θ`` between two circles. A bar has
        ``6 (1 + ν)²/(7 + 14 ν + 8 ν²)`` of its area.
        """
        (a, b), nu = (0.5 * self.diameter, 0.5 * self.bore), poissons_ratio
        c, e = 0.25 * (3.0 + 2.0 * nu), 0.25 * (1.0 - 2.0 * nu)
        A, B = c * (a**2 + b**2), c * a**2 * b**2
        ring = a**2 - b**2
        energy = A**2 * ring + c * B * ring + (c**2 + e**2) * (a**6 - b**6) / 6.0
        energy += -0.5 * A * (a**4 - b**4) + 0.5 * B * (1.0 + 2.0 * nu) * ring
        inertia = 0.25 * np.pi * (a**4 - b**4)
        area = float((2.0 * (1.0 + nu) * inertia) ** 2 / (np.pi * energy))
        return area, area

    @property
    def steps(self) -> list[float]:
        """Distances ``y ≥ 0`` between which the section's width is smooth."""
        return [0.0, *([0.5 * self.bore] if self.bore else []), 0.5 * self.diameter]

    def width(self, y: Array) -> Array:
        """Of the section along z at distances ``(k,)`` from the axis z, mm."""
        outer, inner = (np.sqrt(np.maximum((0.5 * d) ** 2 - y**2, 0.0)) for d in (self.diameter, self.bore))
        return np.asarray(2.0 * (outer - inner))


@lru_cache(maxsize=512)
def _torsion(quarter: Quarter) -> float:
    if quarter.empty is Empty.NOTHING:
        return rectangle_torsion(2.0 * quarter.y[1], 2.0 * quarter.z[1])
    return _mesh(quarter).torsion()


@lru_cache(maxsize=512)
def _warping(quarter: Quarter) -> float:
    return _mesh(quarter).warping()


@lru_cache(maxsize=512)
def _shear_areas(quarter: Quarter, poissons_ratio: float) -> tuple[float, float]:
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


def _solver(stiffness: Array, dof: np.ndarray, first: int) -> Callable[[Array], Array]:
    """Solves for unknowns ``(e, n)`` of elements with matrices ``(e, n, n)``; before the first they are zero."""
    # scipy's sparse matrices take a tenth of a second to import, which most models need not
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import splu

    count, n = int(dof.max()) + 1, dof.shape[1]
    rows, columns = np.repeat(dof, n, axis=1).ravel(), np.tile(dof, (1, n)).ravel()
    K = csc_matrix((stiffness.ravel(), (rows, columns)), shape=(count, count))
    # symmetric and positive definite: no pivoting
    factors = splu(
        csc_matrix(K[first:, first:]), "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return lambda right: np.concatenate([np.zeros(first), factors.solve(right[first:])])


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

    last_borders = [length - x for x in reversed(growing(last))] if last else []
    middle = [to] if last else []
    return [0.0, *growing(first), *middle, *last_borders, length]


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
        self.inner = [0 if solid else int(np.argmin(np.abs(b - edge))) for b, edge in inner]
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
        """Nodal values ``(elements, n, n)`` of a Poisson problem."""
        number = 2 + self.row[:, :, None] * (self.counts[1] * DEGREE + 1) + self.column[:, None, :]
        number = np.where(zero, 0, np.where(tied, 1, number))
        # zero and tied are there once, so that the first two numbers are theirs
        _, packed = np.unique(np.concatenate([[0, 1], number.ravel()]), return_inverse=True)
        dof = packed.ravel()[2:].reshape(len(number), -1)
        F = np.bincount(dof.ravel(), right.ravel(), minlength=int(dof.max()) + 1).astype(float)
        F[1] += more
        u = _solver(self._stiffness, dof, 1 if tied.any() else 2)(F)
        return np.asarray(u[dof].reshape(right.shape))

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
        """Of what is not solid, by Prandtl's function: −2 its Laplacian, zero outside, one value around a hole."""
        row, column = self.row[:, :, None], self.column[:, None, :]
        corner = [DEGREE * n for n in self.inner]
        outer = (row == DEGREE * self.counts[0]) | (column == DEGREE * self.counts[1])
        match self.empty:
            case Empty.NOTHING:
                inner = np.zeros_like(outer)
            case Empty.CORE:
                inner = ((row == corner[0]) & (column <= corner[1])) | ((column == corner[1]) & (row <= corner[0]))
            case Empty.SIDES:
                inner = ((row == corner[0]) & (column >= corner[1])) | ((column == corner[1]) & (row <= corner[0]))
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


Loop = tuple[tuple[float, float], ...]
"""Corners of a polygon, y and z, mm."""
ACROSS = 2.0
"""Elements across the thinnest place, and a tenth of the section is the widest one."""
WIDEST = 0.1
GRADING = 0.3
"""Width of an element over its distance from a re-entrant corner."""
FINEST_AT_CORNER = 1e-2
"""Of the widest element, at a re-entrant corner."""
SLENDEREST = 100.0
"""Size of the section over its thinnest place, up to which meshes are small."""
ROUNDS = 20
"""Of splitting borders that the triangles cross."""
# six points of degree four (Dunavant, 1985), barycentric
_A, _B = 0.445948490915965, 0.091576213509771
_POINTS = np.array([(_A, _A), (1 - 2 * _A, _A), (_A, 1 - 2 * _A), (_B, _B), (1 - 2 * _B, _B), (_B, 1 - 2 * _B)])
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)


@dataclass(frozen=True)
class PolygonConstants:
    """Constants of a polygon about its centroid, axes y and z as its points have them.

    Attributes:
        area: mm².
        centroid: ``(y, z)`` in the axes of the points, mm.
        inertias: second moments about y and z, mm⁴.
        product: of inertia, ``∫ y z dA``, mm⁴.
        torsion: constant J, mm⁴.
        shear_centre: ``(y, z)`` from the centroid, mm; Trefftz's, which depends on no material.
        warping: constant about the shear centre, mm⁶.
        shear_areas: for deflection along y and along z, mm².
        errors: largest relative change of torsion, warping and shear areas by a mesh of half the width.
        loops: corners ``(k, 2)`` of the outline and of each hole from the centroid, mm.
    """

    area: float
    centroid: tuple[float, float]
    inertias: tuple[float, float]
    product: float
    torsion: float
    shear_centre: tuple[float, float]
    warping: float
    shear_areas: tuple[float, float]
    errors: dict[str, float]
    loops: Sequence[Array]

    @property
    def by_mesh(self) -> tuple[float, float, tuple[float, float], tuple[float, float]]:
        """What depends on the mesh: torsion, warping, shear areas and shear centre."""
        return self.torsion, self.warping, self.shear_areas, self.shear_centre

    @property
    def sides(self) -> tuple[float, float]:
        """Outer lengths along y and along z, mm."""
        along_y, along_z = np.ptp(self.loops[0], axis=0).tolist()
        return along_y, along_z

    @property
    def farthest(self) -> tuple[float, float]:
        """Of its points from the axes z and y, mm."""
        far_y, far_z = np.abs(self.loops[0]).max(axis=0).tolist()
        return far_y, far_z

    @property
    def steps(self) -> list[float]:
        """Distances ``y ≥ 0`` between which the section's width is smooth."""
        y = np.concatenate(self.loops)[:, 0]
        return [0.0, *np.unique(y[y > 0.0]).tolist()]

    def width(self, y: Array) -> Array:
        """Of the section along z at distances ``(k,)`` from the axis z, mm."""
        starts, ends, _ = _edges(self.loops)
        crossed = (starts[:, 0] > y[:, None]) != (ends[:, 0] > y[:, None])
        rise = np.where(ends[:, 0] == starts[:, 0], 1.0, ends[:, 0] - starts[:, 0])
        crossings = starts[:, 1] + (y[:, None] - starts[:, 0]) / rise * (ends[:, 1] - starts[:, 1])
        places = np.sort(np.where(crossed, crossings, np.inf), axis=1)
        pairs = np.where(np.isfinite(places), places, 0.0)
        return (pairs[:, 1::2] - pairs[:, : 2 * (pairs.shape[1] // 2) : 2]).sum(axis=1)


Geometry = Quarter | Ring | PolygonConstants


@lru_cache(maxsize=64)
def polygon_constants(loops: tuple[Loop, ...], nu: float) -> PolygonConstants:
    """All constants of a polygon: of its outline, and its holes, in any sense of rotation.

    Raises:
        ValueError: the loops cross or touch, a hole lies outside, or it is too slender.
    """
    _check_loops(loops)
    area, centroid, moments = _moments(loops)
    centred = [np.array(loop) - centroid for loop in loops]
    wide, middle = _width(centred), (float(centroid[0]), float(centroid[1]))
    first, second = (_Triangles(centred, wide * share).solved(area, middle, moments, nu) for share in (1.0, 0.5))
    apart = [np.abs(np.array(a) - np.array(b)).max() for a, b in zip(first.by_mesh, second.by_mesh, strict=True)]
    scales = second.torsion, max(second.warping, area**3 * 1e-6), min(second.shear_areas), float(np.sqrt(area))
    names = ("torsion", "warping", "shear areas", "shear centre")
    errors = {name: float(most / scale) for name, most, scale in zip(names, apart, scales, strict=True)}
    return replace(second, errors=errors)


def _check_loops(loops: Sequence[Loop]) -> None:
    """Refuse what is no polygon with holes."""
    names = ["outline_mm", *(f"hole {k} of holes_mm" for k in range(1, len(loops)))]
    for name, loop in zip(names, loops, strict=True):
        if len(set(loop)) < max(len(loop), 3):
            raise ValueError(f"{name}: needs three corners or more, and none twice")
    starts, ends, owners = _edges([np.array(loop) for loop in loops])
    crossing = _crossing(starts, ends)
    if len(crossing):
        first, second = (names[owners[k]] for k in crossing[0])
        where = f"{first} crosses or touches itself" if first == second else f"{first} crosses or touches {second}"
        raise ValueError(f"{where}: give corners in their order along the border")
    for k, loop in enumerate(loops[1:], start=1):
        within = [bool(_inside([np.array(other)], np.array(loop[:1]))[0]) for other in loops]
        if not within[0] or any(within[j] for j in range(1, len(loops)) if j != k):
            raise ValueError(f"{names[k]}: does not lie in the material within outline_mm")


def _moments(loops: Sequence[Loop]) -> tuple[float, Array, tuple[float, float, float]]:
    """Area, centroid ``(2,)``, and second moments about y and z and their product about it, by Green's theorem."""

    def summed(shift: Array) -> Array:
        total = np.zeros(6)
        for k, loop in enumerate(loops):
            a = np.array(loop) - shift
            b = np.roll(a, -1, axis=0)
            cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
            (y, z), (Y, Z) = a.T, b.T
            own = np.array([
                np.sum(cross) / 2.0, np.sum(cross * (y + Y)) / 6.0, np.sum(cross * (z + Z)) / 6.0,
                np.sum(cross * (z * z + z * Z + Z * Z)) / 12.0, np.sum(cross * (y * y + y * Y + Y * Y)) / 12.0,
                np.sum(cross * (y * Z + 2.0 * y * z + 2.0 * Y * Z + Y * z)) / 24.0,
            ])  # fmt: skip
            total += (1.0 if k == 0 else -1.0) * np.sign(own[0]) * own
        return total

    middle = np.mean(loops[0], axis=0)
    area, first_y, first_z = summed(middle)[:3]
    centroid: Array = middle + np.array([first_y, first_z]) / area
    sums = summed(centroid)
    return float(sums[0]), centroid, (float(sums[3]), float(sums[4]), float(sums[5]))


def _edges(loops: Sequence[Array]) -> tuple[Array, Array, np.ndarray]:
    """Beginnings and ends ``(e, 2)`` of all borders, and the number of their loop."""
    owners = np.concatenate([np.full(len(loop), k) for k, loop in enumerate(loops)])
    return np.concatenate(list(loops)), np.concatenate([np.roll(loop, -1, axis=0) for loop in loops]), owners


def _crossing(starts: Array, ends: Array) -> np.ndarray:
    """Pairs ``(p, 2)`` of borders that cross or touch but at a common corner."""

    def side(a: Array, b: Array, p: Array) -> Array:
        along, way = (b - a)[:, None], p[None] - a[:, None]
        return along[..., 0] * way[..., 1] - along[..., 1] * way[..., 0]

    scale = 1e-12 * float(np.ptp(starts, axis=0).max()) ** 2
    first, second = side(starts, ends, starts), side(starts, ends, ends)
    apart = (first * second > 0.0) & (np.minimum(np.abs(first), np.abs(second)) > scale)
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    beside = np.any((low[:, None] > high[None]) | (low[None] > high[:, None]), axis=2)
    joined = np.zeros_like(apart)
    for p, q in ((starts, starts), (starts, ends), (ends, starts), (ends, ends)):
        joined |= np.all(p[:, None] == q[None], axis=2)
    crossing = ~apart & ~apart.T & ~beside & ~joined
    return np.argwhere(np.triu(crossing, 1))


def _inside(loops: Sequence[Array], points: Array) -> np.ndarray:
    """Which points ``(p,)`` lie within an odd number of loops."""
    starts, ends, _ = _edges(loops)
    y, z = points[:, None, 0], points[:, None, 1]
    upward = (starts[:, 1] > z) != (ends[:, 1] > z)
    rise = np.where(ends[:, 1] == starts[:, 1], 1.0, ends[:, 1] - starts[:, 1])
    crossings = starts[:, 0] + (z - starts[:, 1]) / rise * (ends[:, 0] - starts[:, 0])
    return np.asarray(np.sum(upward & (y < crossings), axis=1) % 2 == 1)


def _distance(starts: Array, ends: Array, points: Array) -> Array:
    """Of points ``(p,)`` from borders ``(e,)``, ``(p, e)``."""
    along = ends - starts
    share = np.einsum("pei,ei->pe", points[:, None] - starts, along) / np.sum(along**2, axis=1)
    nearest = starts + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.linalg.norm(points[:, None] - nearest, axis=2)


def _width(loops: Sequence[Array]) -> float:
    """Of the widest element."""
    starts, ends, _ = _edges(loops)
    size = float(np.ptp(loops[0], axis=0).max())
    # from the middle of each border across the material to another one
    along = ends - starts
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    thin = size
    middle = starts + 0.5 * along
    inward = np.where(_inside(loops, middle + 1e-7 * size * normal)[:, None], normal, -normal)
    for p, d in zip(middle, inward, strict=True):
        det = d[1] * along[:, 0] - d[0] * along[:, 1]
        r = starts - p
        with np.errstate(divide="ignore", invalid="ignore"):
            far = (r[:, 1] * along[:, 0] - r[:, 0] * along[:, 1]) / det
            place = (d[0] * r[:, 1] - d[1] * r[:, 0]) / det
        hit = far[(far > 1e-9 * size) & (place >= 0.0) & (place <= 1.0)]
        if len(hit):
            thin = min(thin, float(hit.min()))
    if thin * SLENDEREST < size:
        raise ValueError(
            f"a wall of {thin:.3g} mm is thinner than a hundredth of the section's {size:.4g} mm: "
            "give EA_N, GJ_Nmm2, EIy_Nmm2 and EIz_Nmm2"
        )
    return min(WIDEST * size, thin / ACROSS)


class _Triangles:
    """Triangles of six nodes; fields at the points of integration are ``(triangles, 6)``."""

    def __init__(self, loops: Sequence[Array], wide: float) -> None:
        self._loops, self._wide = loops, wide
        self._notches = np.concatenate([_notches(loops, k) for k in range(len(loops))])
        corners, triangles = self._triangles()
        edges = np.sort(np.concatenate([triangles[:, [1, 2]], triangles[:, [2, 0]], triangles[:, [0, 1]]]), axis=1)
        unique, number = np.unique(edges, axis=0, return_inverse=True)
        middles = len(corners) + number.reshape(3, -1).T
        self.nodes = np.hstack([triangles, middles])
        self.count = len(corners) + len(unique)
        a, b, c = (corners[triangles[:, k]] for k in range(3))
        self.double = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        L = np.column_stack([1.0 - _POINTS.sum(axis=1), _POINTS])
        self.shapes = np.hstack([L * (2.0 * L - 1.0), 4.0 * L[:, [1, 2, 0]] * L[:, [2, 0, 1]]])
        place = L[None, :, :, None] * np.stack([a, b, c], axis=1)[:, None]
        self.y, self.z = np.moveaxis(place.sum(axis=2), 2, 0)
        # slopes of the barycentric coordinates
        dy = np.stack([b[:, 1] - c[:, 1], c[:, 1] - a[:, 1], a[:, 1] - b[:, 1]], axis=1) / self.double[:, None]
        dz = np.stack([c[:, 0] - b[:, 0], a[:, 0] - c[:, 0], b[:, 0] - a[:, 0]], axis=1) / self.double[:, None]
        self.slopes = tuple(self._slopes(L, d) for d in (dy, dz))
        self.areas = 0.5 * np.abs(self.double)[:, None] * _WEIGHTS

    @staticmethod
    def _slopes(L: Array, d: Array) -> Array:
        """Slopes ``(t, 6, 6)`` of the shape functions at the points."""
        own = (4.0 * L - 1.0)[None] * d[:, None, :]
        i, j = [1, 2, 0], [2, 0, 1]
        mixed = 4.0 * (L[None][:, :, i] * d[:, None, j] + L[None][:, :, j] * d[:, None, i])
        return np.concatenate([own, mixed], axis=2)

    def _size(self, points: Array) -> Array:
        """Width of elements at points ``(p,)``."""
        if not len(self._notches):
            return np.full(len(points), self._wide)
        apart = np.linalg.norm(points[:, None] - self._notches, axis=2).min(axis=1)
        return np.clip(GRADING * apart, FINEST_AT_CORNER * self._wide, self._wide)

    def _border(self) -> list[tuple[Array, Array]]:
        edges, todo = [], []
        for loop in self._loops:
            todo += list(zip(loop, np.roll(loop, -1, axis=0), strict=True))
        while todo:
            a, b = todo.pop()
            if np.linalg.norm(b - a) > 1.3 * self._size(0.5 * (a + b)[None])[0]:
                todo += [(a, 0.5 * (a + b)), (0.5 * (a + b), b)]
            else:
                edges.append((a, b))
        return edges

    def _lattice(self, starts: Array, ends: Array) -> Array:
        """Points inside, as far apart as elements are wide."""
        low, high = self._loops[0].min(axis=0), self._loops[0].max(axis=0)
        levels = int(np.ceil(np.log2(1.0 / FINEST_AT_CORNER))) + 1 if len(self._notches) else 1
        accepted = []
        for level in range(levels):
            step = self._wide * 0.5**level
            reach = 2.0 * step / GRADING
            boxes = [(low, high)] if level == 0 else [(p - reach, p + reach) for p in self._notches]
            for first, last in boxes:
                first, last = np.maximum(first, low), np.minimum(last, high)
                i = np.arange(np.floor(first[0] / step), np.ceil(last[0] / step) + 1.0)
                j = np.arange(np.floor(first[1] / (0.75**0.5 * step)), np.ceil(last[1] / (0.75**0.5 * step)) + 1.0)
                grid = np.stack(
                    [(i[:, None] + 0.5 * (j % 2)) * step, 0.75**0.5 * step * j + 0.0 * i[:, None]], axis=2
                )
                points = grid.reshape(-1, 2)
                size = self._size(points)
                accepted.append(points[(size >= step) & ((size < 2.0 * step) | (level == 0))])
        points = np.unique(np.concatenate(accepted).round(12), axis=0)
        points = points[_inside(self._loops, points)]
        far = np.concatenate(
            [_distance(starts, ends, part).min(axis=1) for part in np.array_split(points, len(points) // 500 + 1)]
        )
        return points[far > 0.5 * self._size(points)]

    def _triangles(self) -> tuple[Array, np.ndarray]:
        """Corners ``(p, 2)`` and triangles ``(t, 3)`` that fill the polygon."""
        from scipy.spatial import Delaunay

        border = self._border()
        whole, _ = _edges(self._loops)[:2]
        inner = self._lattice(*_edges(self._loops)[:2])
        for _ in range(ROUNDS):
            corners = np.unique(np.concatenate([*(np.array(pair) for pair in border), inner, whole]), axis=0)
            number = {tuple(point): k for k, point in enumerate(corners.tolist())}
            simplices = Delaunay(corners).simplices
            sides = {tuple(sorted(pair)) for t in simplices.tolist() for pair in (t[:2], t[1:], (t[0], t[2]))}
            split = []
            for a, b in border:
                if tuple(sorted((number[tuple(a.tolist())], number[tuple(b.tolist())]))) in sides:
                    split.append((a, b))
                else:
                    split += [(a, 0.5 * (a + b)), (0.5 * (a + b), b)]
            if len(split) == len(border):
                kept = simplices[_inside(self._loops, corners[simplices].mean(axis=1))]
                used, packed = np.unique(kept, return_inverse=True)
                return corners[used], packed.reshape(kept.shape)
            border = split
        raise ValueError("no triangles fill it: give corners that are farther apart")

    def solved(
        self, area: float, centroid: tuple[float, float], moments: tuple[float, float, float], nu: float
    ) -> PolygonConstants:
        """The constants, about the centroid at zero."""
        Iy, Iz, P = moments
        y, z = self.y, self.z
        K = sum(np.einsum("tq,tqa,tqb->tab", self.areas, slope, slope, optimize=True) for slope in self.slopes)
        solve = _solver(np.asarray(K), self.nodes, 1)
        twist = self._nodal(0.0 * y, z, -y)
        omega = solve(twist)
        torsion = Iy + Iz - float(omega @ twist)
        omega_values = omega[self.nodes] @ self.shapes.T
        by_y, by_z, mean = (float(np.sum(self.areas * omega_values * f)) for f in (y, z, np.ones_like(y)))
        det = Iy * Iz - P**2
        centre = ((P * by_y - Iz * by_z) / det, (Iy * by_y - P * by_z) / det)
        warping = float(np.sum(self.areas * omega_values**2)) - mean**2 / area - centre[1] * by_y + centre[0] * by_z
        r, q, scale = y**2 - z**2, 2.0 * y * z, 2.0 * (1.0 + nu)
        areas = []
        for load, along_y, along_z in (
            (Iy * y - P * z, Iy * r - P * q, P * r + Iy * q),
            (Iz * z - P * y, -P * r + Iz * q, -Iz * r - P * q),
        ):
            by = 0.5 * nu * along_y, 0.5 * nu * along_z
            u = solve(self._nodal(scale * load, *by))[self.nodes]
            stress = [np.einsum("tqn,tn->tq", slope, u) - b for slope, b in zip(self.slopes, by, strict=True)]
            areas.append((scale * det) ** 2 / float(np.sum(self.areas * (stress[0] ** 2 + stress[1] ** 2))))
        shear = areas[0], areas[1]
        return PolygonConstants(area, centroid, (Iy, Iz), P, torsion, centre, warping, shear, {}, self._loops)

    def _nodal(self, source: Array, along_y: Array, along_z: Array) -> Array:
        """Integrals of a source times the shape functions, and of a field times their slopes, by node."""
        own = (self.areas * source) @ self.shapes
        for slope, field in zip(self.slopes, (along_y, along_z), strict=True):
            own = own + np.einsum("tq,tqn->tn", self.areas * field, slope)
        return np.bincount(self.nodes.ravel(), own.ravel(), minlength=self.count).astype(float)


def _notches(loops: Sequence[Array], k: int) -> Array:
    """Re-entrant corners ``(c, 2)`` of a loop: there the material takes more than a half turn."""
    loop = loops[k]
    before, after = loop - np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0) - loop
    turned = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    area = np.sum(loop[:, 0] * np.roll(loop[:, 1], -1) - np.roll(loop[:, 0], -1) * loop[:, 1])
    convex = turned * np.sign(area) > 0.0
    return loop[convex] if k else loop[~convex & (turned != 0.0)]
