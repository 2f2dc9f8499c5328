"""What an engine shows of itself so that its path can be followed."""

from __future__ import annotations

from typing import Protocol

from vjm.continuation.path import Equilibrium, StationLabel
from vjm.rotations import Array


class Problem(Protocol):
    """What an engine must be able to do for its path to be followed."""

    label: str
    stations: tuple[StationLabel, ...]

    @property
    def conservative(self) -> bool:
        """Whether all loads have a potential: the tangent is symmetric and its eigenvalues are real."""

    def unloaded(self) -> Equilibrium:
        """The state at zero displacement."""

    def solve(self, s: float, start: Equilibrium, slope: Array | None = None) -> Equilibrium:
        """Equilibrium at the path parameter ``s``, from the state of ``start``.

        Args:
            s: path parameter, at which the driven displacement is imposed.
            start: a converged neighbour.
            slope: derivative of the state by s, for a first guess; the engine may ignore it.

        Raises:
            NoConvergenceError: none was found.
        """

    def nearest_product(self, point: Equilibrium) -> float:
        """Magnitude of the product of the two eigenvalues nearest zero at a point; nan where it is not known.

        Unlike the smallest one it has no kink where two modes change places.
        """

    def switch(self, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
        """A state on the branch that crosses at a bifurcation, at the path parameter ``s`` just behind it.

        Args:
            critical: the state at the bifurcation.
            s: a little more than ``critical.s``.
            sign: which of the two mirrored branches, see `LoadCase.branch`.

        Raises:
            NoConvergenceError: the branch was not found, or none leads onwards from here.
        """
