"""A part's 6×6 compliance on one mesh: its base held, its tip moved as a rigid body or loaded over its face.

Both answers bound the part in its machine. A tip that moves as a rigid body is the stiffer one, as every motion
that it can make the loaded one can make too; the wrench spread over the face lets it deform as it likes.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from vjm.rotations import Array
from vjm_fea.solid import load
from vjm_fea.solid.elasticity import ElasticSolid, carried, components, rigid_motions
from vjm_fea.solid.mesh import Indices

# --- Sparse symmetric systems: PARDISO from the wheel of MKL, chosen by measurement, see ``docs/solid-parts.md``

SYMMETRIC_DEFINITE = 2
"""PARDISO's name of the kind of matrix, of which it takes the upper triangle."""
OUT_OF_MEMORY = -2


class Factorization:
    """A factorized matrix, to be freed: its working memory is not Python's.

    Attributes:
        solve: from right-hand sides ``(n, k)`` to solutions.
        free: give the working memory back; nothing can be solved any more.
    """

    def __init__(self, solve: Callable[[Array], Array], free: Callable[[], None]) -> None:
        self.solve = solve
        self.free = free


def solver_name() -> str:
    """Which solver `factorized` takes on this machine."""
    return "pardiso" if importlib.util.find_spec("pypardiso") is not None else "superlu"


def factorized(upper: scipy.sparse.csr_matrix) -> Factorization:
    """Factorize a symmetric positive definite matrix, given by its upper triangle ``(n, n)``.

    PARDISO's wheel exists for Intel and AMD processors; elsewhere SciPy's SuperLU does the same with several times
    the working memory and time.

    Raises:
        ValueError: the matrix is not positive definite: some piece of the part is not held.
        MemoryError: there is not enough.
    """
    if solver_name() == "pardiso":
        return _pardiso(upper)
    full = (upper + scipy.sparse.triu(upper, 1).T).tocsc()
    try:
        lu = scipy.sparse.linalg.splu(full, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise ValueError(f"the stiffness matrix cannot be factorized (SuperLU: {error})") from error
    return Factorization(lu.solve, lambda: None)


def _pardiso(upper: scipy.sparse.csr_matrix) -> Factorization:
    wrapper = load("pypardiso.pardiso_wrapper")
    solver: Any = wrapper.PyPardisoSolver(mtype=SYMMETRIC_DEFINITE)
    try:
        solver.factorize(upper)
    except wrapper.PyPardisoError as error:
        if error.value == OUT_OF_MEMORY:
            raise MemoryError("PARDISO: not enough working memory") from error
        raise ValueError(f"the stiffness matrix cannot be factorized (PARDISO error {error.value})") from error

    def solve(right: Array) -> Array:
        return np.asarray(solver.solve(upper, right))

    return Factorization(solve, lambda: solver.free_memory(everything=True))


# ------------------------------------------------------------------------------------------------------------------


OUTLIER = 4.0
"""Residuals over their robust standard deviation from which on a node is left out of a rigid-body fit."""
FITS = 20
"""Most repetitions of that fit."""


class TipLoad(StrEnum):
    """How the wrench enters."""

    RIGID = "rigid"
    """The tip's faces move as one rigid body."""
    SPREAD = "spread"
    """A traction that is linear over the tip's faces; what moves is their mean."""


class RootSupport(StrEnum):
    """How the part is held."""

    CLAMPED = "clamped"
    """No point of the base's faces moves."""
    MEAN = "mean"
    """The base's faces are still in the mean, under a reaction that is linear over them: beam theory's end."""


@dataclass(frozen=True)
class PartEnds:
    """Where a part is held and where its compliance is read.

    Attributes:
        base: numbers of faces.
        tip: numbers of faces.
        point: ``(3,)`` mm on the tip's body at which wrench and motion are read; None: the tip's centre of area.
        held: how the base is.
    """

    base: tuple[int, ...]
    tip: tuple[int, ...]
    point: Array | None = None
    held: RootSupport = RootSupport.CLAMPED


@dataclass(frozen=True)
class Answer:
    """What one mesh says of one kind of tip.

    Attributes:
        compliance: ``(6, 6)`` by virtual work at the tip, symmetric, mm, N, rad.
        fitted: ``(6, 6)`` the rigid motion nearest to the displacements of the tip's nodes, outliers left out; not
            quite symmetric.
        left_out: nodes that were outliers, of all loads, over all nodes and loads.
        displacements: ``(3 n, 6)`` of the nodes under unit wrenches.
    """

    compliance: Array
    fitted: Array
    left_out: float
    displacements: Array


def face_centre(solid: ElasticSolid, faces: Sequence[int]) -> Array:
    """Centre of area ``(3,)`` of some faces, mm."""
    basis = solid.mesh.face_basis(faces)
    x = np.asarray(basis.global_coordinates())
    return np.einsum("afq,fq->a", x, basis.dx) / float(np.sum(basis.dx))


def answer(
    solid: ElasticSolid, ends: PartEnds, tip: TipLoad, stiffness: scipy.sparse.csr_matrix | None = None
) -> Answer:
    """Compliance of a meshed part.

    Args:
        solid: the part.
        ends: of it.
        tip: how the wrench enters.
        stiffness: `ElasticSolid.stiffness`, where it is at hand.

    Raises:
        ValueError: a piece of the part is not held, or base and tip share nodes.
    """
    upper = solid.stiffness() if stiffness is None else stiffness
    point = face_centre(solid, ends.tip) if ends.point is None else np.asarray(ends.point, dtype=float)
    tip_nodes = solid.mesh.face_nodes(ends.tip)
    loads, kept = loads_and_support(solid, ends, point)
    n = solid.mesh.unknowns
    if tip is TipLoad.RIGID:
        moved = components(tip_nodes)
        free = np.setdiff1d(kept, moved)
        R = rigid_motions(solid.mesh.points[tip_nodes], point)
        T = _tied(n, free, moved, R)
        right = T.T @ loads
        reduced = T.T @ (upper + scipy.sparse.triu(upper, 1).T) @ T
    else:
        T = _tied(n, kept, np.zeros(0, dtype=np.int64), np.zeros((0, 0)))
        right = loads[kept]
        reduced = upper[kept][:, kept]
    matrix = scipy.sparse.csr_matrix(scipy.sparse.triu(reduced))
    matrix.sort_indices()
    del reduced
    factors = factorized(matrix)
    try:
        u: Array = np.asarray(T @ factors.solve(np.asarray(right)))
    finally:
        factors.free()
    C: Array = loads.T @ u
    base_motion = np.zeros((6, 6)) if ends.held is RootSupport.CLAMPED else _mean_motion(solid, ends.base, point, u)
    # displacements count from the base
    u -= rigid_motions(solid.mesh.points, point) @ base_motion
    fitted, left_out = _rigid_fits(solid.mesh.points[tip_nodes], u[components(tip_nodes)], point)
    return Answer(0.5 * (C + C.T), fitted, left_out, u)


def loads_and_support(solid: ElasticSolid, ends: PartEnds, point: Array) -> tuple[Array, Indices]:
    """Nodal forces ``(3 n, 6)`` of the unit wrenches and the displacements that are not held."""
    loads = spread(solid, ends.tip, point)
    base = solid.mesh.face_nodes(ends.base)
    everything = np.arange(solid.mesh.unknowns)
    if ends.held is RootSupport.CLAMPED:
        return loads, np.setdiff1d(everything, components(base))
    # in balance by itself; three nodes only keep the part from floating
    loads = loads - spread(solid, ends.base, point)
    points = solid.mesh.points[base]
    first = int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    second = int(np.argmax(np.linalg.norm(points - points[first], axis=1)))
    line = (points[second] - points[first]) / np.linalg.norm(points[second] - points[first])
    off = points - points[first]
    third = int(np.argmax(np.linalg.norm(off - np.outer(off @ line, line), axis=1)))
    candidates = components(base[[first, second, third]])
    R = rigid_motions(points[[first, second, third]], points.mean(axis=0))
    R[:, 3:] /= np.linalg.norm(points[second] - points[first])
    held: list[int] = []
    for i in range(9):
        rows = [*held, i]
        if len(held) < 6 and np.linalg.svd(R[rows], compute_uv=False)[-1] > 0.05:
            held.append(i)
    return loads, np.setdiff1d(everything, candidates[held])


def spread(solid: ElasticSolid, faces: Sequence[int], point: Array) -> Array:
    """Nodal forces ``(3 n, 6)`` of unit wrenches at a point ``(3,)``, as tractions that are linear over faces."""
    centre = face_centre(solid, faces)
    P, square = solid.face_moments(faces, centre)
    # a wrench at `point` is at the centre the same force and a moment more
    return np.asarray(P @ np.linalg.solve(square, carried(point - centre).T), dtype=np.float64)


def _mean_motion(solid: ElasticSolid, faces: Sequence[int], point: Array, u: Array) -> Array:
    """Mean rigid motion ``(6, k)`` of some faces, read at a point ``(3,)``."""
    P, square = solid.face_moments(faces, point)
    return np.asarray(np.linalg.solve(square, P.T @ u), dtype=np.float64)


def _tied(n: int, free: Indices, moved: Indices, R: Array) -> scipy.sparse.csr_matrix:
    """Matrix ``(n, k)`` from the unknowns that are left to all: free ones as they are, moved ones rigidly."""
    ones = scipy.sparse.csr_matrix((np.ones(len(free)), (free, np.arange(len(free)))), shape=(n, len(free)))
    if not len(moved):
        return ones
    rows = np.repeat(moved, 6)
    columns = np.tile(np.arange(6), len(moved))
    rigid = scipy.sparse.csr_matrix((R.ravel(), (rows, columns)), shape=(n, 6))
    return scipy.sparse.csr_matrix(scipy.sparse.hstack([ones, rigid]))


def _rigid_fits(points: Array, u: Array, point: Array) -> tuple[Array, float]:
    """Rigid motions ``(6, 6)``, column by column, nearest to displacements ``(3 k, 6)``, and the share left out."""
    fits, dropped = np.zeros((6, 6)), 0
    for k in range(u.shape[1]):
        fits[:, k], used = rigid_fit(points, u[:, k].reshape(-1, 3), point)
        dropped += int(np.sum(np.logical_not(used)))
    return fits, dropped / (len(points) * u.shape[1])


def rigid_fit(points: Array, displacements: Array, point: Array) -> tuple[Array, Array]:
    """The rigid motion nearest to a field, with nodes left out that do not follow it.

    Least squares, repeated without the nodes whose residual is `OUTLIER` robust standard deviations (1.4826 times
    the median) or more, until the same ones stay out.

    Args:
        points: ``(k, 3)`` mm.
        displacements: ``(k, 3)`` mm.
        point: point ``(3,)`` at which the motion is read.

    Returns:
        The motion ``(6,)`` and which nodes ``(k,)`` were used.
    """
    R = rigid_motions(points, point).reshape(-1, 3, 6)
    used = np.ones(len(points), dtype=bool)
    motion = np.zeros(6)
    for _ in range(FITS):
        motion[:] = np.linalg.lstsq(R[used].reshape(-1, 6), displacements[used].ravel(), rcond=None)[0]
        residual = np.linalg.norm(displacements - R @ motion, axis=1)
        spread_ = 1.4826 * float(np.median(residual[used]))
        # below rounding everything fits
        floor = 1e-9 * float(np.max(np.linalg.norm(displacements, axis=1)))
        keep = residual <= max(OUTLIER * spread_, floor)
        if np.array_equal(keep, used) or keep.sum() < 6:
            break
        used = keep
    return motion, used
