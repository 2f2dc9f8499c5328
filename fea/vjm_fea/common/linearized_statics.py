"""Linearised statics of a meshed chain: response, stiffness of what is held, stability."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import eig, eigh, eigvals, eigvalsh, qr

from vjm.rotations import Array
from vjm.statics import without_neutral

ROUNDING = 1e-11
"""Scaled stiffness of what is held below which it is zero but for rounding."""
REAL = 1e-7
"""Imaginary part of an eigenvalue, over its magnitude, up to which it is real: two that nearly meet split
by the root of rounding."""
SMALL = float(np.sqrt(np.finfo(float).eps))
"""Eigenvalue over the largest one below which a solver leaves less than half of its digits."""
COINCIDENT = 1e-3
"""Two eigenvalues vanish together where the second is below this fraction of the third."""


def is_real(values: Array) -> np.ndarray:
    """Which eigenvalues ``(k,)`` are real but for rounding."""
    return np.abs(values.imag) <= REAL * np.abs(values)


class StabilityVerdict(NamedTuple):
    """On stability.

    Attributes:
        eigenvalue: the smallest.
        unstable: how many are negative.
        rounding: by which the smallest may be wrong, where it is hardly told; else zero.
    """

    eigenvalue: float
    unstable: int
    rounding: float


class ScaledBorder(NamedTuple):
    """A condition beside equilibrium, linearised in scaled motions: ``row · δx + at_ramp δramp = missing``."""

    missing: float
    row: Array
    at_ramp: float


def _symmetric_modes(K: Array, *, vectors: bool = True) -> tuple[Array, Array, float]:
    """Eigenvalues ``(k,)``, increasing, unit eigenvectors ``(k, k)``, and by how much the smallest may be wrong.

    Solvers know an eigenvalue to a rounding of the largest one. Chains with very short elements have far smaller
    ones that the stiffness's own entries still tell. Those below the root of rounding are renewed by the method of
    Rayleigh and Ritz on their eigenvectors, of which errors enter as their squares, with products in extended
    precision.

    Args:
        K: ``(k, k)``.
        vectors: whether all eigenvectors are wanted; else there are some or none.
    """
    if vectors:
        values, V = eigh(K, check_finite=False)
    else:
        values, V = np.asarray(eigvalsh(K, check_finite=False), dtype=float), np.empty((len(K), 0))
    chosen = np.flatnonzero(np.abs(values) < SMALL * np.abs(values).max())
    if not len(chosen):
        return values, V, 0.0
    if not vectors:
        # those from the smallest one to the last that is to be renewed
        V = eigh(K, check_finite=False, subset_by_index=(0, int(chosen[-1])))[1]
    own = V[:, chosen].astype(np.longdouble)
    among, turned = eigh((own.T @ (K.astype(np.longdouble) @ own)).astype(float), check_finite=False)
    values[chosen], V[:, chosen] = among, V[:, chosen] @ turned
    # entries are rounded one by one: as many independent errors
    rounding = np.finfo(float).eps * float(np.linalg.norm(V[:, 0, None] * K * V[:, 0]))
    return values, V, rounding


@dataclass(frozen=True)
class Tangent:
    """Derivative of the residual at one state, scaled.

    Attributes:
        J: ``(m + c, m + c)`` stiffness of m motions and Jacobian of c constraints, ``[K, Cᵀ; C, 0]``.
        free: indices of the motions and multipliers that are solved for.
        held: indices ``(6,)`` of the support's motions.
        motions: m.
        symmetric: whether loads and forces are conservative, so that the stiffness is symmetric in equilibrium.
        added: what an engine wants to keep for the next tangent nearby.
    """

    J: Array
    free: np.ndarray
    held: np.ndarray
    motions: int
    symmetric: bool = True
    added: Array | None = None

    @cached_property
    def _free(self) -> Array:
        return self.J[np.ix_(self.free, self.free)]

    def solve(self, right: Array) -> Array:
        """Motion of the free coordinates ``(f, …)`` that makes their residual change by ``right``.

        Raises:
            numpy.linalg.LinAlgError: the tangent is singular.
        """
        return np.asarray(np.linalg.solve(self._free, right), dtype=float)

    def rounding(self, motions: Array) -> float:
        """Largest error of the free coordinates' residual by errors ``(m + c,)`` of the state."""
        return float(np.max(np.abs(self.J[self.free]) @ motions, initial=0.0))

    def by_ramp(self, drive: Array, load: Array) -> Array:
        """Derivative ``(f,)`` of the free coordinates' residual by the ramp.

        Args:
            drive: the support's motion ``(6,)`` per unit of it.
            load: the loads' generalised forces ``(m + c,)`` per unit of it.
        """
        return self.J[np.ix_(self.free, self.held)] @ drive - load[self.free]

    def bordered(self, by_ramp: Array, row: Array, at_ramp: float, right: Array, missing: float) -> Array:
        """Solution ``(f + 1,)`` for the free coordinates and the ramp with one condition more.

        Args:
            by_ramp: see `by_ramp`.
            row: derivative ``(f,)`` of the condition by the free coordinates.
            at_ramp: and by the ramp.
            right: change of the residual that is wanted ``(f,)``.
            missing: and of the condition.

        Raises:
            numpy.linalg.LinAlgError: it is singular.
        """
        f = len(self.free)
        A = np.empty((f + 1, f + 1))
        A[:f, :f], A[:f, f], A[f, :f], A[f, f] = self._free, by_ramp, row, at_ramp
        return np.linalg.solve(A, np.append(right, missing))

    def response(self, held: Array) -> Array:
        """Motion of the free coordinates ``(f, …)`` that goes with one of the support ``(6, …)``."""
        return self.solve(-self.J[np.ix_(self.free, self.held)] @ held)

    def end_stiffness(self) -> Array:
        """Derivative ``(6, 6)`` of the support's wrench by its motion, the chain in equilibrium."""
        response = self.response(np.eye(len(self.held)))
        result: Array = self.J[np.ix_(self.held, self.held)] + self.J[np.ix_(self.held, self.free)] @ response
        result[np.abs(result) < ROUNDING] = 0.0
        return result

    def _modal(self, device: Array | None) -> tuple[Array, Array]:
        """Stiffness ``(k, k)`` on the motions that the constraints leave, and their basis ``(f, k)``."""
        moving = self.free[self.free < self.motions]
        C = self.J[np.ix_(moving, self.free[self.free >= self.motions])]
        # a joint's free axis is a multiplier without a constraint
        C = C[:, np.any(C != 0.0, axis=0)]
        if device is not None:
            C = np.column_stack([C, device[moving]])
        K = self.J[np.ix_(moving, moving)]
        if not C.shape[1]:
            return K, np.eye(len(moving))
        N = qr(C, check_finite=False)[0][:, C.shape[1] :]
        return N.T @ K @ N, N

    def stability(self, device: Array | None = None) -> tuple[Array, float]:
        """Eigenvalues ``(k,)`` of the stiffness that the constraints leave: increasing, or complex.

        Where they are symmetric and the smallest is hardly told, also by how much rounding may have changed it.

        Where loads are not conservative there may be complex ones: they pass no zero, and what they do in time
        (flutter) is not a matter of statics.

        Args:
            device: derivative ``(m + c,)`` of the displacement that a device holds, one constraint more.
        """
        K, _ = self._modal(device)
        if not len(K):
            return np.zeros(0), 0.0
        if self.symmetric:
            values, _, rounding = _symmetric_modes(0.5 * (K + K.T), vectors=False)
            return values, rounding
        return np.asarray(eigvals(K, check_finite=False)), 0.0

    def nearest_product(self, device: Array | None) -> float:
        """See `vjm.continuation.events.Problem.nearest_product`."""
        nearest = np.sort(np.abs(self.stability(device)[0]))[:2]
        return float(np.prod(nearest)) if len(nearest) == 2 and self.symmetric else float("nan")

    def verdict(self, device: Array | None, neutral: float) -> StabilityVerdict:
        """Whether the stiffness that the constraints leave is positive.

        Where they leave no motion at all, as in a cantilever of one element: nan and none. Where loads are not
        conservative, the eigenvalue nearest zero, complex or not, see `vjm.statics.stability_of`.

        Args:
            device: see `stability`.
            neutral: eigenvalue up to which a motion costs nothing.
        """
        values, rounding = self.stability(device)
        if not len(values):
            return StabilityVerdict(float("nan"), 0, 0.0)
        real = values[is_real(values)].real
        negative, sure = (int(np.count_nonzero(real < limit)) for limit in (0.0, -neutral))
        negative = without_neutral(negative, negative - sure, self.symmetric)
        if self.symmetric:
            return StabilityVerdict(float(values[0]), negative, rounding)
        nearest = values[np.argmin(np.abs(values))]
        return StabilityVerdict(
            float(-abs(nearest) if nearest in real[real < 0.0] else abs(nearest)), negative, 0.0
        )

    def critical_modes(self, device: Array | None = None) -> list[Array]:
        """Motions whose eigenvalue is nearest zero, one or two together, and the multipliers that go with them.

        Unit vectors ``(f,)`` but for the multipliers, which keep the motions in equilibrium.
        """
        K, N = self._modal(device)
        if self.symmetric:
            values, V, _ = _symmetric_modes(0.5 * (K + K.T))
        else:
            values, V = eig(K, check_finite=False)
            real = is_real(values)
            values, V = values[real].real, V[:, real].real
        order = np.argsort(np.abs(values))[:3]
        together = 2 if len(order) == 3 and abs(values[order[1]]) < COINCIDENT * abs(values[order[2]]) else 1
        moving, constrained = self.free[self.free < self.motions], self.free[self.free >= self.motions]
        by_multipliers = self.J[np.ix_(moving, constrained)]
        modes = []
        for k in order[:together]:
            mode = N @ V[:, k]
            mode /= np.linalg.norm(mode)
            right = -self.J[np.ix_(moving, moving)] @ mode
            modes.append(np.concatenate([mode, np.linalg.lstsq(by_multipliers, right, rcond=None)[0]]))
        return modes
