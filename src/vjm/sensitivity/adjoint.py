"""The tangent of an equilibrium at an imposed pose, ``A = [H − K, Jᵀ; J, 0]``: solutions with it and with Aᵀ.

Both come from the chain's block factorisation and are linear in the number of springs, at a bifurcation too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vjm.rotations import Array, skew
from vjm.sensitivity.derivatives import Links, Placed, reactions
from vjm.statics.equilibrium import Configuration, newton_scale
from vjm.statics.stability import critical_modes

NUDGE = 1e-10
"""Change of the wrench that makes a tangent regular which is singular to the last digit."""


@dataclass(frozen=True)
class State:
    """An equilibrium, its geometry, and the tangent A there.

    Attributes:
        at: the equilibrium.
        s: path parameter.
        links: of its model.
        placed: the links at its coordinates.
    """

    at: Configuration
    s: float
    links: Links
    placed: Placed

    @property
    def reactions(self) -> Array:
        """``Jᵀ F`` ``(n,)``."""
        return reactions(self.links, self.placed, self.at.wrench, self.at.model.size)

    @cached_property
    def _moment(self) -> Array:
        """``m ×`` ``(3, 3)`` of the wrench's moment."""
        return skew(self.at.wrench[3:])

    def response(self, load: Array, gap: Array, *, transposed: bool = False) -> tuple[Array, Array]:
        """``(δx, δF)`` of ``A (δx; δF) = (−load; gap)``, or of Aᵀ, for ``load`` (n,) and ``gap`` (6,).

        The two differ by ``(m × δΩ) · δΩ'`` over the end-effector's turns, for its moment m, fixed in the world, is
        not conservative; so their answers differ by the moment that this makes of the turn in ``gap``.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        at = self.at
        dx, dF = at.model.compiled.response(at.x, at.wrench, load, gap)
        if transposed:
            dF[3:] += self._moment @ gap[3:]
        return dx, dF

    def adjoint(self) -> tuple[Array, Array]:
        """``u`` ``(6, n)`` and ``v`` ``(6, 6)`` with ``Aᵀ (u_k; v_k) = (0; e_k)``: what the wrench is sensitive to.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        still = np.zeros_like(self.at.x)
        u, v = zip(*(self.response(still, gap, transposed=True) for gap in np.eye(6)), strict=True)
        return np.array(u), np.array(v)

    def solve(self, right: Array, *, transposed: bool = False) -> Array:
        """``A⁻¹ r`` or ``A⁻ᵀ r`` for each row of ``(k, n + 6)``."""
        n = self.at.model.size
        return np.array([np.concatenate(self.response(-r[:n], r[n:], transposed=transposed)) for r in right])


class Mode:
    """The null vector of A at a bifurcation, and A without it.

    Attributes:
        vector: b ``(n + 6,)`` with ``A b = 0`` and ``bᵀ A = 0``, of unit length in scaled units.
        twofold: whether there is a second one.
    """

    def __init__(self, state: State) -> None:
        at, n = state.at, state.at.model.size
        modes = critical_modes(at)
        if at.model.compiled.visit(at.x, at.wrench) < 0:
            at = replace(at, wrench=at.wrench * (1.0 + NUDGE))
        self._state = replace(state, at=at)
        self.twofold = len(modes) > 1
        scale = newton_scale(at.model)
        vector = np.concatenate([modes[0], np.zeros(6)])
        # of the mode and its wrench by inverse iteration, which hardly turns what is known to many digits
        for _ in range(2):
            vector[n:] = 0.0
            vector = self._state.solve((vector / scale**2)[None])[0]
            vector /= np.linalg.norm(vector / scale)
        self.vector = vector
        self._border = vector / scale**2

    def without(self, states: Array) -> Array:
        """States ``(k, n + 6)`` without their part in b, in scaled units."""
        return states - np.outer(states @ self._border, self.vector)

    def solve(self, right: Array) -> Array:
        """The solution without a part in b of ``A y = r`` without r's part in b, for each row of ``(k, n + 6)``.

        It is that of the regular system which b borders. Mixed block elimination (Govaerts and Pryce 1993) gets it
        from solutions with the nearly singular A and Aᵀ as accurately as its own factors would.
        """
        border = self._border
        left = self._state.solve(border[None], transposed=True)[0]
        plain = self._state.solve(border[None])[0]
        lacking = right - np.outer(right @ left / (left @ border), border)
        result = self._state.solve(lacking)
        return result - np.outer(result @ border / (plain @ border), plain)
