"""Frames of straight bars: turning points of their load paths in their plane, and their buckling out of it.

In the plane every bar is the rod of `vjm_validation.exact.rod`, joined to the next at a rigid corner, and
integrated from one support to the other. A limit point is where the supports' reactions can change at a constant
load, a turning point of a displacement where they can change with it held. Both are roots of a determinant, by
Newton's method from a guess that says which turning point is meant.

Out of the plane a frame that does not bend in it before it buckles is a linear problem. Let t be the tangent of a
bar, b its normal across the plane, n and M b the internal force and moment that the loads bring, u a displacement
along b and φ a rotation in the plane. Kirchhoff's rod gives (Simo and Vu-Quoc 1986, linearised)

    u' = (φ × t)·b,   φ' = C (m − φ × M b),   m' = −(u b)' × n,   C = t tᵀ/GJ + s sᵀ/EI,   s = b × t,

where m is the change of the internal moment in the plane. N, mm, rad.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq, root

from vjm_validation.exact.rod import integrate

Array = NDArray[np.float64]

DIFFERENCE = 1e-6
"""Step of the Jacobians' central differences, in scaled unknowns."""


@dataclass(frozen=True)
class FrameBar:
    """A straight bar.

    Attributes:
        length: mm.
        turn_deg: of its axis from the bar before it, or from x, counterclockwise.
    """

    length: float
    turn_deg: float = 0.0


@dataclass(frozen=True)
class PlaneFrame:
    """A frame of equal section between two supports, with a dead load in one place.

    Attributes:
        bars: from base to end.
        EI: N mm².
        EA: N.
        base: "hinged", or "clamped".
        end: "hinged", or "guided" across x, where the load acts.
        loaded: number of bars in front of the load's place; all of them for a guided end.
    """

    bars: Sequence[FrameBar]
    EI: float
    EA: float
    base: Literal["hinged", "clamped"]
    end: Literal["hinged", "guided"]
    loaded: int

    def turning_load(self, guess: Sequence[float], of: Literal["load", "x", "y"] = "load") -> float:
        """Load in N, downwards along −y, where the load or a displacement of its place has its turning point.

        Args:
            guess: at that point: the force (x, y) in N on the base, its moment in N mm (clamped) or the first bar's
                rotation in rad (hinged), and the load in N.
            of: what turns.

        Raises:
            RuntimeError: Newton's method did not converge.
        """
        scale = np.array([self._force, self._force, 1.0, self._force])
        if self.base == "clamped":
            scale[2] = self.EI / self._length
        unknown = np.array(guess, dtype=float) / scale

        def lacking(z: Array) -> Array:
            # the state and its neighbours at once
            steps = DIFFERENCE * np.hstack([np.eye(4), -np.eye(4)])
            residuals = np.vstack(self._lacking(z[:, None] + np.hstack([np.zeros((4, 1)), steps])))
            J = (residuals[:, 1:5] - residuals[:, 5:]) / (2.0 * DIFFERENCE)
            rows = {"load": [0, 1, 2], "x": [0, 1, 2, 3], "y": [0, 1, 2, 4]}[of]
            return np.append(residuals[:3, 0], np.linalg.det(J[rows][:, : len(rows)]))

        solution = root(lacking, unknown, method="hybr", options={"xtol": 1e-13})
        if np.abs(solution.fun).max() > 1e-8:
            raise RuntimeError(f"frame: no turning point near {list(guess)}: {solution.message}")
        return float(solution.x[3] * self._force)

    @property
    def _length(self) -> float:
        return sum(bar.length for bar in self.bars)

    @property
    def _force(self) -> float:
        return self.EI / self._length**2

    def _lacking(self, z: Array) -> tuple[Array, Array]:
        """What the end support lacks ``(3, k)``, and where the load's place is ``(2, k)``, of k states (4, k)."""
        rx, ry, third, load = z
        force, zero = (-rx, -ry), np.zeros_like(load)
        hinged = self.base == "hinged"
        state = np.array([zero, zero, third if hinged else zero, zero if hinged else third])
        straight, along, place = np.zeros(2), 0.0, np.zeros((2, len(load)))
        axial = self.EI / (self.EA * self._length**2)
        for number, bar in enumerate(self.bars):
            turn = np.deg2rad(bar.turn_deg)
            along += turn
            state[2] += turn
            length = bar.length / self._length
            state = integrate(state, force, (0.0, length), axial)
            straight += length * np.array([np.cos(along), np.sin(along)])
            if number + 1 == self.loaded:
                place = state[:2].copy()
                # the load −P y: the internal force behind it is larger by P along y
                force = (force[0], force[1] + load)
        if self.end == "hinged":
            return np.array([state[0] - straight[0], state[1] - straight[1], state[3]]), place
        return np.array([state[0] - straight[0], state[2] - along, force[1]]), place


def lateral_buckling(
    bars: Sequence[FrameBar],
    EI: float,
    GJ: float,
    bracket: tuple[float, float],
    force: tuple[float, float] = (0.0, 0.0),
) -> float:
    """Least factor on a dead force at the end of a clamped frame with which it buckles out of its plane.

    Args:
        bars: from the clamp to the free end.
        EI: of bending out of the plane, N mm².
        GJ: of torsion, N mm².
        bracket: of the factor, which the determinant changes its sign in.
        force: in the plane, N.

    Raises:
        ValueError: nothing happens within the bracket.
    """
    ends, x, along = [], np.zeros(2), 0.0
    for bar in bars:
        along += np.deg2rad(bar.turn_deg)
        t = np.array([np.cos(along), np.sin(along)])
        ends.append((x, t, bar.length))
        x = x + bar.length * t

    def determinant(factor: float) -> float:
        n = factor * np.array(force)
        transfer = np.eye(5)
        for start, t, length in ends:
            transfer = _piece(start, t, length, n, x, EI, GJ) @ transfer
        return float(np.linalg.det(transfer[3:, 3:]))

    return float(brentq(determinant, *bracket, xtol=1e-14))


def _piece(start: Array, t: Array, length: float, n: Array, tip: Array, EI: float, GJ: float) -> Array:
    """Transfer matrix ``(5, 5)`` of u, φ and m along a bar, by a Magnus series of the fourth order."""
    s = np.array([-t[1], t[0]])
    C = np.outer(t, t) / GJ + np.outer(s, s) / EI

    def matrix(S: float) -> Array:
        arm = tip - start - S * t
        M = arm[0] * n[1] - arm[1] * n[0]
        A = np.zeros((5, 5))
        # (φ × t)·b, −(φ × M b) and −u' b × n
        A[0, 1], A[0, 2] = t[1], -t[0]
        A[1:3, 1:3] = C @ (M * np.array([[0.0, -1.0], [1.0, 0.0]]))
        A[1:3, 3:] = C
        A[3] = n[1] * A[0]
        A[4] = -n[0] * A[0]
        return A

    steps = 200
    h = length / steps
    transfer: Array = np.eye(5)
    for i in range(steps):
        one, two = (matrix(h * (i + 0.5 + side * np.sqrt(3.0) / 6.0)) for side in (-1.0, 1.0))
        magnus = 0.5 * h * (one + two) + np.sqrt(3.0) / 12.0 * h * h * (two @ one - one @ two)
        transfer = expm(magnus) @ transfer
    return transfer


def pure_bending(length: float, EI: float, GJ: float) -> float:
    """Moment in N mm with which a narrow bar under it buckles out of its plane: π √(EI GJ)/L.

    Its ends are held across the plane and against twisting, and free to turn otherwise (Timoshenko and Gere 1961,
    chapter 6). Each leg of a right-angle frame under equal moments at its hinged ends is such a bar (Argyris and
    others, *CMAME* 20, 1979).
    """
    return float(np.pi * np.sqrt(EI * GJ) / length)


def sprung_links(lengths: Sequence[float], springs: Sequence[float]) -> float:
    """Force in N along a straight arm of rigid links with turning springs at their roots, where it buckles.

    ``½ Σ c_i (φ_i − φ_{i−1})² − P Σ l_i (1 − cos φ_i)`` in the links' directions φ_i: the smallest eigenvalue
    of the springs' matrix over the lengths.

    Args:
        lengths: mm.
        springs: N mm/rad.
    """
    B = np.eye(len(lengths)) - np.eye(len(lengths), k=-1)
    root_length = 1.0 / np.sqrt(np.array(lengths, dtype=float))
    K = B.T @ np.diag(np.array(springs, dtype=float)) @ B
    return float(np.linalg.eigvalsh(K * root_length[:, None] * root_length)[0])
