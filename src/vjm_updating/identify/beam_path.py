"""A beam that turns corners and tapers: straight pieces one behind the other, each with sections of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from vjm.model.machine import Machine
from vjm.model.parts import Beam, Part, RigidOffset, Section
from vjm.rotations import Array, frame, rotate_matrix6, shift_compliance
from vjm_updating.constants import numerical
from vjm_updating.identify.specimens import POSTURE, Specimen

PANELS, POINTS = numerical(16), numerical(8)
"""Gauss's rule along a piece: to rounding for any taper that a machine has."""


@dataclass(frozen=True)
class BeamPathPiece:
    """A straight piece.

    Attributes:
        length: mm.
        section: at a fraction of the length, 0 at the root and 1 at the end.
        turn: rotation ``(3, 3)`` of its axes, x along the piece, against those of the piece before it.
    """

    length: float
    section: Callable[[float], Section]
    turn: Array = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True)
class BeamPath:
    """Pieces from a clamped root to a tip.

    Attributes:
        name: for people.
        pieces: one behind the other; the first one's turn counts from the axes of the compliance.
    """

    name: str
    pieces: tuple[BeamPathPiece, ...]

    def chain(self, steps: int) -> Machine:
        """The path with every piece in ``steps`` uniform beams, each with the section at its middle.

        The compliance errs by 1/steps², as the midpoint rule does, and not at all where no piece tapers.
        """
        parts: list[Part] = []
        for i, piece in enumerate(self.pieces):
            parts.append(RigidOffset(f"turn{i}", frame(piece.turn)))
            parts += [
                Beam(f"piece{i}-{k}", piece.length / steps, section=piece.section((k + 0.5) / steps))
                for k in range(steps)
            ]
        return Machine(self.name, tuple(parts), postures={POSTURE: np.zeros(0)})

    def compliance(self) -> Array:
        """Compliance ``(6, 6)`` at the tip, base axes: beam theory's integral ``∫ Gᵀ c(s) G ds`` along the path."""
        where, R, p = [], np.eye(3), np.zeros(3)
        for piece in self.pieces:
            R = R @ piece.turn
            where.append((R, p))
            p = p + piece.length * R[:, 0]
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        C = np.zeros((6, 6))
        for piece, (R, root) in zip(self.pieces, where, strict=True):
            for panel in range(PANELS):
                for node, weight in zip(nodes, weights, strict=True):
                    at = (panel + 0.5 * (node + 1.0)) / PANELS
                    s = piece.section(at)
                    c = np.diag(1.0 / np.array([s.EA, s.GAy, s.GAz, s.GJ, s.EIy, s.EIz]))
                    ds = 0.5 * weight * piece.length / PANELS
                    C += shift_compliance(rotate_matrix6(ds * c, R), p - root - at * piece.length * R[:, 0])
        return C

    def specimen(self) -> Specimen:
        """The path to make experiments on: the mesh and the taper's steps are refined together."""
        return Specimen(self.name, "the path's own", lambda n: (self.chain(n), 1), self.compliance())
