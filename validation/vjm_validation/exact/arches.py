"""The deep circular arch, clamped at one end and hinged at the other, under a dead load at its crown.

Two arcs of the rod of `vjm_validation.exact.rod` with the curvature −1/a at rest, from the clamp over the crown to
the hinge. The force in the first arc is (H, V), in the second (H, V + P). Each arc's θ stands at Chebyshev points.
Its curvature and position follow by spectral integration, which converges faster than any power of their number and
is well conditioned.

The unknowns are θ there, the moment at the clamp, H, V and the load P at the crown. The equations are the rod's,
the position and the moment of the hinge, and the depth v of the crown, which drives the arch through its limit
load. There dP/dv = 0, a root of the linear system's own derivative, so that P is accurate to the square of its
error.

DaDeppo and Schmidt, *Journal of Applied Mechanics* 42 (1975), print the critical P a²/EI of the inextensible arch.
Against ``half_angle``, half of the angle that the arch subtends:

    half angle    here            printed
    60°           13.21315948     13.21
    90°           10.27534437     10.27, the digits cut off (rounded 10.28)
    107.5°         8.97308997      8.97
    120°           4.46667960      4.47

The arch of 215° in the finite element literature is the one with the half angle 107.5°. The load is no monotone
function of the angle: it rises again from 95° to 11.469 at 105° and falls steeply from there. Between 105° and 106°
the path turns so sharply that steps of the depth do not follow it, which is said by an error.

Lengths are over the radius a, forces times a²/EI, moments times a/EI, ``axial`` = EI/(EA a²), ``shear`` =
EI/(GA a²).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.optimize import brentq

POINTS = 48
"""Chebyshev's points in an arc; the limit loads with 40 of them differ by less than 1e-11."""
STEP = 0.02
"""Of the crown's depth, over a; the paths are resolved several times over."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ArchState:
    """An equilibrium of the arch.

    Attributes:
        load: P a²/EI, downwards.
        slope: dP/dv by the crown's depth.
        depth: v, how far the crown has come down, over a.
        sway: how far it has gone towards the hinge, over a.
        thrust: force (H, V) in the arc at the clamp, times a²/EI.
        moment: at the clamp, times a/EI.
        unknowns: of the collocation, ``(2 POINTS + 4,)``.
    """

    load: float
    slope: float
    depth: float
    sway: float
    thrust: tuple[float, float]
    moment: float
    unknowns: Array


class Arch:
    """A clamped, hinged circular arch of unit radius.

    Args:
        half_angle: half of the angle that it subtends, rad, from π/6 to 5π/6.
        axial: EI/(EA a²), ≥ 0.
        shear: EI/(GA a²), ≥ 0.

    Raises:
        ValueError: an argument is out of range.
    """

    def __init__(self, half_angle: float, axial: float = 0.0, shear: float = 0.0) -> None:
        if not np.pi / 6.0 <= half_angle <= 5.0 * np.pi / 6.0:
            raise ValueError(f"half angle is {half_angle} rad: it must be from π/6 to 5π/6")
        if axial < 0.0 or shear < 0.0:
            raise ValueError(f"axial = {axial} and shear = {shear}: a flexibility cannot be negative")
        self.half_angle, self.axial, self.shear = half_angle, axial, shear
        self._points, self._integral = _spectral_integration(half_angle)

    def unloaded(self) -> ArchState:
        """The arch as it was made."""
        first = self.half_angle - self._points
        return self.equilibrium(0.0, np.concatenate([first, first - self.half_angle, np.zeros(4)]))

    def equilibrium(self, depth: float, guess: Array) -> ArchState:
        """The equilibrium with the crown ``depth`` lower, from the unknowns of one nearby.

        Raises:
            RuntimeError: Newton's method did not converge.
        """
        z = guess
        for _ in range(20):
            residual, J = self._linearised(z, depth)
            correction = np.linalg.solve(J, residual)
            z = z - correction
            # quadratic convergence: the step after one of this size is rounding
            if np.abs(correction).max() < 1e-8:
                break
        else:
            raise RuntimeError(f"arch of half angle {self.half_angle}: no equilibrium at depth {depth}")
        # only the last equation knows the depth, with the factor one
        by_depth = np.linalg.solve(self._linearised(z, depth)[1], -np.eye(len(z))[-1])
        moment, H, V, P = z[-4:]
        sway = float(self._integral[-1] @ self._arc(z[:POINTS], H, V)[1] - np.sin(self.half_angle))
        return ArchState(float(P), float(by_depth[-1]), depth, sway, (float(H), float(V)), float(moment), z)

    def path(self, depths: Sequence[float]) -> list[ArchState]:
        """Equilibria from the unloaded arch on.

        Args:
            depths: of the crown over a, growing, in steps of about `STEP`.

        Raises:
            RuntimeError: a step was too long, or the crown's depth does not grow along the path any further.
        """
        states = [self.unloaded()]
        for depth in depths:
            states.append(self.equilibrium(depth, states[-1].unknowns))
        return states[1:]

    def limit(self) -> ArchState:
        """The first maximum of the load.

        Raises:
            RuntimeError: the crown's depth does not grow up to it.
        """
        before = state = self.unloaded()
        while state.slope > 0.0:
            before, state = state, self.equilibrium(state.depth + STEP, state.unknowns)
        limit_depth = brentq(
            lambda depth: self.equilibrium(depth, before.unknowns).slope, before.depth, state.depth, xtol=1e-12
        )
        limit = self.equilibrium(limit_depth, before.unknowns)
        # a slope that changes sign through infinity is a turn of the depth, and no limit of the load
        if abs(limit.slope) > 1e-6:
            raise RuntimeError(
                f"arch of half angle {self.half_angle}: the crown rises again at depth {limit_depth}"
            )
        return limit

    def _arc(
        self, theta: NDArray[Any], H: NDArray[Any] | float, V: NDArray[Any] | float
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Derivatives θ'', x', y' at the points ``(POINTS, ...)`` of an arc under the force (H, V)."""
        cos, sin = np.cos(theta), np.sin(theta)
        N, Q = H * cos + V * sin, V * cos - H * sin
        stretch, slip = 1.0 + self.axial * N, self.shear * Q
        return slip * N - stretch * Q, stretch * cos - slip * sin, stretch * sin + slip * cos

    def _residual(self, z: NDArray[Any], depth: float) -> NDArray[Any]:
        """Equations ``(2 POINTS + 4, ...)`` of the unknowns of the same shape."""
        s, B = self._points, self._integral
        twice, whole = B @ B, B[-1]
        first, second, (moment, H, V, P) = z[:POINTS], z[POINTS : 2 * POINTS], z[2 * POINTS :]
        bend1, x1, y1 = self._arc(first, H, V)
        bend2, x2, y2 = self._arc(second, H, V + P)
        # curvature of the rest shape −1; moment and curvature are continuous at the crown
        at_clamp = moment - 1.0
        at_crown = at_clamp + whole @ bend1
        ends = [
            at_crown + whole @ bend2 + 1.0,
            whole @ (x1 + x2) - 2.0 * np.sin(self.half_angle),
            whole @ (y1 + y2),
            whole @ y1 - (1.0 - np.cos(self.half_angle)) + depth,
        ]
        return np.concatenate(
            [
                first - self.half_angle - np.multiply.outer(s, at_clamp) - twice @ bend1,
                second - first[-1] - np.multiply.outer(s, at_crown) - twice @ bend2,
                np.array(ends),
            ]
        )

    def _linearised(self, z: Array, depth: float) -> tuple[Array, Array]:
        """Residual ``(n,)`` and Jacobian ``(n, n)``, the latter by the complex step, exact to rounding."""
        step = 1e-40
        stepped = self._residual(z[:, None] + 1j * step * np.eye(len(z)), depth)
        return self._residual(z, depth), stepped.imag / step


def limit_load(half_angle: float, axial: float = 0.0, shear: float = 0.0) -> float:
    """Limit load P a²/EI of the clamped, hinged arch; see `Arch` for the arguments and what is raised."""
    return Arch(half_angle, axial, shear).limit().load


def _spectral_integration(length: float) -> tuple[Array, Array]:
    """Chebyshev's points ``(POINTS,)`` on 0 to ``length``, and the integrals from 0 to each of them ``(n, n)``."""
    x = -np.cos(np.pi * np.arange(POINTS) / (POINTS - 1))
    coefficients = np.linalg.inv(chebyshev.chebvander(x, POINTS - 1))
    integrals = [chebyshev.chebval(x, chebyshev.chebint(unit, lbnd=-1.0)) for unit in np.eye(POINTS)]
    return 0.5 * length * (1.0 + x), 0.5 * length * np.array(integrals).T @ coefficients
