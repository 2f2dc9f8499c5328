"""What solves for the states of a loaded model, a chain's or a manipulator's: the part that both share."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from vjm.rotations import Array

DIVERGED = 1e6
"""Scaled residual from which Newton's method does not come back."""


class StateSolver(ABC):
    """Linear algebra of a loaded model at one state after another; takes and returns N, mm, rad.

    A state is the coordinates ``x`` (n,), the wrench ``(6,)`` that holds the end-effector, world axes, and the
    factor ``load`` on the ramped loads. The factors of the last state are kept, so that all that is asked about one
    state costs one factorisation.

    Attributes:
        coordinate_unit: units ``(n,)`` of the coordinates.
        wrench_unit: units ``(6,)`` of the wrench.
        energy: unit of energy, N mm.
    """

    def __init__(self, coordinate_unit: Array, wrench_unit: Array) -> None:
        self.coordinate_unit, self.wrench_unit = coordinate_unit, wrench_unit
        self.energy = float(wrench_unit[3])
        self._negative = -1
        self._forget()

    @abstractmethod
    def newton(
        self, target: Array, x: Array, wrench: Array, load: float, tolerance: float, max_iterations: int
    ) -> tuple[Array, Array, float, int, str]:
        """Equilibrium with the end-effector at the frame ``target`` (4, 4) under the load factor ``load``.

        Returns:
            Coordinates ``(n,)``, wrench ``(6,)``, scaled residual, iterations, and why it failed or nothing.
        """

    @abstractmethod
    def visit(self, x: Array, wrench: Array, load: float = 0.0) -> int:
        """Factor at a state unless it is the last one; number of negative eigenvalues, −1 where singular."""

    @abstractmethod
    def residual(self, x: Array, wrench: Array, target: Array, load: float = 0.0) -> tuple[Array, Array, float]:
        """What statics ``(n,)`` and geometry ``(6,)`` lack at a state, and the largest of them, scaled."""

    @abstractmethod
    def rounded(self, x: Array, statics: Array, gap: Array) -> bool:
        """Whether the residual that `residual` has just found is no more than the rounding of its terms.

        Each row is a sum of spring forces, loads' moments or distances. The sum of their sizes, times the machine's
        relative rounding, times the number of joints that they pass, bounds what rounding leaves of it.

        Args:
            x: coordinates ``(n,)`` of the state.
            statics: ``(n,)`` and
            gap: ``(6,)`` as `residual` gives them.
        """

    @abstractmethod
    def response(
        self, x: Array, wrench: Array, statics: Array, gap: Array, load: float = 0.0
    ) -> tuple[Array, Array]:
        """Change of the coordinates ``(n,)`` and of the wrench ``(6,)`` that ``statics`` and ``gap`` ask for.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """

    @abstractmethod
    def end_stiffness(self, x: Array, wrench: Array, load: float = 0.0) -> Array:
        """``K^F`` (18) ``(6, 6)``, N/mm, N, N mm.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """

    @abstractmethod
    def smallest(self, x: Array, wrench: Array, load: float = 0.0) -> float:
        """Eigenvalue nearest zero of the second variation on what is free, units of the model's energy.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point to the last digit.
        """

    def near_zero(
        self, x: Array, wrench: Array, load: float, device: Array | None
    ) -> tuple[Array, int | None, bool] | None:
        """Eigenvalues nearest zero where the tangent is not symmetric, or a device holds one motion more.

        Args:
            x: coordinates ``(n,)``.
            wrench: ``(6,)``.
            load: factor on the ramped loads.
            device: generalised forces ``(n,)`` of the device.

        Returns:
            Complex eigenvalues ``(k,)``, nearest zero first; how many of all are negative, where that is counted;
            and whether their number is odd. None where the solver does not tell: then the whole spectrum does.
        """
        return None

    @abstractmethod
    def modes(
        self, x: Array, wrench: Array, count: int, load: float = 0.0, tolerance: float = ...
    ) -> tuple[Array, Array]:
        """Eigenvalues nearest zero ``(count,)``, and their motions ``(n, count)`` of unit length when scaled."""

    @abstractmethod
    def ramped(self, x: Array, wrench: Array, load: float) -> Array:
        """Generalised forces ``(n,)`` of the ramped loads, per unit of the load factor, at a state."""

    @abstractmethod
    def shape(self, x: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""

    def inverse(self, x: Array, wrench: Array, load: float = 0.0) -> Array:
        """The inverse second variation on the null space of J ``(n, n)``, dense and scaled, at a state.

        With loads that turn it is that of the whole tangent, which is not symmetric.
        """
        forces = np.diag(self.energy / self.coordinate_unit)
        none = np.zeros(6)
        return np.array([self.response(x, wrench, f, none, load)[0] / self.coordinate_unit for f in forces]).T

    def _newton(
        self, target: Array, x: Array, wrench: Array, load: float, tolerance: float, max_iterations: int
    ) -> tuple[Array, Array, float, int, str]:
        """`newton` by residuals and responses, whatever the tangent looks like."""
        for iteration in range(max_iterations + 1):
            statics, gap, error = self.residual(x, wrench, target, load)
            if error < tolerance:
                return x, wrench, error, iteration, ""
            if not error < DIVERGED or self._negative < 0 or iteration == max_iterations:
                break
            dx, dF = self.response(x, wrench, statics, gap, load)
            x, wrench = x + dx, wrench + dF
        return x, wrench, error, iteration, f"after {iteration} iterations"

    def _remember(self, x: Array, wrench: Array, load: float) -> None:
        """Which state the factors belong to."""
        # bytes: the caller may write to its own arrays, and these are compared fastest
        self._state, self._load = (x.tobytes(), wrench.tobytes()), load

    def _is_last(self, x: Array, wrench: Array, load: float) -> bool:
        """Whether the factors are those of a state."""
        return load == self._load and (x.tobytes(), wrench.tobytes()) == self._state

    def _forget(self) -> None:
        self._remember(np.full(len(self.coordinate_unit), np.nan), np.full(6, np.nan), np.nan)

    def _must_visit(self, x: Array, wrench: Array, load: float) -> None:
        if self.visit(x, wrench, load) < 0:
            raise np.linalg.LinAlgError("the equilibrium is singular")


class BodySolver(StateSolver):
    """A `StateSolver` of one machine, chain or tree, on whose bodies loads act at l points."""

    @abstractmethod
    def load_forces(self, x: Array, wrench: Array, load: float, wrenches: Array) -> Array:
        """Generalised forces ``(n,)`` of ``wrenches`` (l, 6) on the loaded points; world axes, at a state."""

    @abstractmethod
    def acting(self, x: Array, wrench: Array, load: float) -> Array:
        """Wrenches ``(l, 6)`` on the loaded points, N, N mm, world axes, at a state."""

    @abstractmethod
    def points(self, x: Array, wrench: Array, load: float) -> Array:
        """Positions ``(l, 3)`` of the loaded points, mm, world, at a state."""
