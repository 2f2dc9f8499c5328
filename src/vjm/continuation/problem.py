"""What an engine shows of itself so that its path can be followed."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from vjm.continuation.path import Equilibrium, StationLabel
from vjm.model.law_states import LawState
from vjm.rotations import Array


class Problem(Protocol):
    """What an engine must be able to do for its path to be followed, by its arc where its ramp turns."""

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

    def tangent(self, point: Equilibrium, along: Array | None = None) -> Array:
        """Derivative of the state by the arc's length; its last component is the ramp's.

        Args:
            point: an equilibrium.
            along: a change of state that tells forwards from backwards; else the ramp grows.

        Raises:
            NoConvergenceError: the point is critical.
        """

    def growth(self, point: Equilibrium, change: Array) -> float:
        """Change of the path parameter of a ramp by a small change of state at a point."""

    def scaled(self, change: Array) -> Array:
        """A change of state in the units of an arc; its last component is the ramp's."""

    def across(self, start: Equilibrium, slope: Array, step: float) -> Equilibrium:
        """Equilibrium whose coordinates lie on the plane across a direction, so far from a point.

        Args:
            start: the point.
            slope: change of state along which the plane is found, its scaled coordinates of length one.
            step: distance of the plane, in the units of an arc.

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


@runtime_checkable
class WithLaws(Protocol):
    """A problem that tells where the laws of its springs are."""

    def law_states(self, point: Equilibrium) -> list[LawState]:
        """All laws at a point of a path, always in the same order."""

    def law_rates(self, point: Equilibrium, along: Array) -> Array:
        """Derivatives ``(l,)`` of their deflections by the path parameter.

        Args:
            point: of the path.
            along: a change of state that tells forwards from backwards.

        Raises:
            NoConvergenceError: the point is critical.
        """
