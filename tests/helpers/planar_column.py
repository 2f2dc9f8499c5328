"""An independent solver: a plane column of rigid links between hinges, dense, by Newton's method on its angles.

It shares no code with the package. Links stand for an inextensible, shear-rigid elastica; the error of loads goes
with the square of their number.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh, null_space

PER_BEAM = 32
DEFLECTED = (0.05, 0.03, 0.1, 0.02, 0.01, 0.005, 0.002)
"""Largest deflection, over the length, of the state with which a buckled path begins: the first that is found."""


@dataclass(frozen=True)
class Column:
    """A column along x under a dead axial load at its end, and perhaps a constant lateral one.

    Attributes:
        lengths: of its beams, mm.
        bending: their EI, N mm².
        hinges: stiffness of what joins the base, each beam and the end's support, N mm; inf where it is rigid, zero
            where it turns freely. One more than there are beams.
        held: whether the end stays on the axis; else it is free, and the last hinge does not count.
        lateral: N at the end of the first beam, of an end that is held, or of the whole column.
    """

    lengths: tuple[float, ...]
    bending: tuple[float, ...]
    hinges: tuple[float, ...]
    held: bool
    lateral: float = 0.0

    @property
    def links(self) -> np.ndarray:
        return np.repeat(np.array(self.lengths) / PER_BEAM, PER_BEAM)

    @property
    def size(self) -> int:
        """Of a state: the links' angles, and the reaction of an end that is held."""
        return len(self.links) + self.held

    @property
    def stiffness(self) -> np.ndarray:
        """Of the hinges' turns by the links' angles, which are zero beyond both ends."""
        half = np.repeat(0.5 * np.array(self.lengths) / PER_BEAM / np.array(self.bending), PER_BEAM)
        n = len(half)
        compliance = np.zeros(n + 1)
        compliance[:n] += half
        compliance[1:] += half
        k = 1.0 / compliance
        for i, hinge in enumerate(self.hinges):
            at = i * PER_BEAM
            k[at] = 0.0 if hinge == 0.0 else 1.0 / (compliance[at] + 1.0 / hinge)
        if not self.held:
            k[n] = 0.0
        turn = np.zeros((n + 1, n))
        turn[np.arange(n), np.arange(n)] = 1.0
        turn[np.arange(1, n + 1), np.arange(n)] = -1.0
        return turn.T @ (k[:, None] * turn)

    @property
    def pushed(self) -> np.ndarray:
        """Which links lie before the lateral load."""
        return np.arange(len(self.links)) < (PER_BEAM if self.held else len(self.links))

    def critical(self) -> tuple[float, float]:
        """Of the straight column: its least buckling load, and its second coefficient (Koiter).

        The latter is the load's change over the square of the mode's largest deflection.
        """
        load, v, reaction = self._mode()
        h = self.links
        second = (load * (h @ v**4) / 6.0 + reaction * 2.0 / 3.0 * (h @ v**3)) / (h @ v**2)
        return load, float(second)

    def _mode(self) -> tuple[float, np.ndarray, float]:
        """The buckling load, angles in which the largest deflection is 1 mm, and the end's reaction with them."""
        h, K = self.links, self.stiffness
        N = null_space(h[None, :]) if self.held else np.eye(len(h))
        values, modes = eigh(N.T @ K @ N, N.T @ (h[:, None] * N))
        load, v = float(values[0]), N @ modes[:, 0]
        v = v / np.abs(np.cumsum(h * v)).max()
        return load, v, float(h @ (K @ v - load * h * v)) / float(h @ h) if self.held else 0.0

    def residual(self, angles: np.ndarray, reaction: float, load: float) -> np.ndarray:
        h = self.links
        across = reaction + self.lateral * self.pushed
        r = self.stiffness @ angles - load * h * np.sin(angles) - across * h * np.cos(angles)
        return np.append(r, h @ np.sin(angles)) if self.held else r

    def tangent(self, angles: np.ndarray, reaction: float, load: float) -> np.ndarray:
        h = self.links
        across = reaction + self.lateral * self.pushed
        H = self.stiffness - np.diag(h * (load * np.cos(angles) - across * np.sin(angles)))
        if not self.held:
            return H
        row = h * np.cos(angles)
        return np.block([[H, -row[:, None]], [row[None, :], np.zeros((1, 1))]])

    def solve(self, state: np.ndarray, load: float) -> np.ndarray | None:
        """Equilibrium near a state (angles, and the reaction where the end is held); None where none is found."""
        n = len(self.links)
        for _ in range(30):
            angles, reaction = state[:n], float(state[n]) if self.held else 0.0
            step = np.linalg.solve(self.tangent(angles, reaction, load), -self.residual(angles, reaction, load))
            if not np.all(np.isfinite(step)) or np.abs(step[:n]).max() > 1.0:
                return None
            state = state + step
            if np.abs(step[:n]).max() < 1e-11:
                return state
        return None

    def unstable(self, state: np.ndarray, load: float) -> int:
        """Number of negative eigenvalues of the energy on what the end's support leaves free."""
        n = len(self.links)
        angles, reaction = state[:n], float(state[n]) if self.held else 0.0
        H = self.tangent(angles, reaction, load)[:n, :n]
        if self.held:
            N = null_space((self.links * np.cos(angles))[None, :])
            H = N.T @ H @ N
        return int(np.count_nonzero(np.linalg.eigvalsh(H) < 0.0))

    def deflections(self, state: np.ndarray) -> tuple[float, float]:
        """Of the end along the axis, and the largest across it, mm."""
        h, angles = self.links, state[: len(self.links)]
        return float(h @ (np.cos(angles) - 1.0)), float(np.abs(np.cumsum(h * np.sin(angles))).max())

    def buckled(self, far: float) -> tuple[np.ndarray, float] | None:
        """A state a little behind the buckling load, deflected by some hundredths of the length, and its load.

        The third order of the angles and the fourth of the load are left to Newton's method.
        """
        (load, second), (v, reaction) = self.critical(), self._mode()[1:]
        for share in DEFLECTED:
            size = share * float(np.sum(self.lengths))
            if load + second * size**2 > 0.5 * (load + far):
                continue
            found = self.solve(size * (np.append(v, reaction) if self.held else v), load + second * size**2)
            near = found is not None and 0.5 * size < self.deflections(found)[1] < 2.0 * size
            if near and not self.unstable(found, load + second * size**2):
                return found, load + second * size**2
        return None

    def end(self, state: np.ndarray, load: float, far: float, steps: int = 80) -> tuple[float, dict[float, float]]:
        """Follow stable states by the load."""
        largest, seen, before = (far - load) / steps, {}, None
        step, smallest = largest, 1e-6 * far
        while load < far and step > smallest:
            # the tangent's prediction from the last two
            guess = state if before is None else state + (state - before[0]) * step / (load - before[1])
            there = self.solve(guess, min(load + step, far))
            near = there is not None and np.abs(there - state)[: len(self.links)].max() < 0.2
            if not near or self.unstable(there, min(load + step, far)):
                step *= 0.5
                continue
            before, state, load, step = (state, load), there, min(load + step, far), min(2.0 * step, largest)
            seen[load] = self.deflections(state)[0]
        return load, seen
