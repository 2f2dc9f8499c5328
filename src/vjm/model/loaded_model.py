"""What paths, loaded stiffness and stability ask of a model; `vjm.model.lumped.LumpedModel` is one."""

from __future__ import annotations

from typing import Protocol

from vjm.kernels.state_solver import StateSolver
from vjm.model.applied_loads import AppliedLoads
from vjm.rotations import Array


class LoadedModel(Protocol):
    """A machine whose elasticity is lumped into springs, with the loads on it."""

    @property
    def name(self) -> str:
        """Of the machine."""

    @property
    def size(self) -> int:
        """Number n of the coordinates."""

    @property
    def free(self) -> int:
        """Number of motions that are left where the end-effector and all closures hold what they can."""

    @property
    def characteristic_length(self) -> float:
        """Unit of its translations, mm."""

    @property
    def applied_loads(self) -> AppliedLoads:
        """The loads on its bodies."""

    @property
    def coordinate_scale(self) -> Array:
        """Unit of each coordinate ``(n,)``; infinite for one that is no motion."""

    @property
    def wrench_scale(self) -> Array:
        """Unit of each wrench component ``(6,)``, N and N mm."""

    @property
    def compiled(self) -> StateSolver:
        """What solves for its states."""

    def velocities(self, x: Array, motion: Array) -> Array:
        """Velocities ``(k, 3)`` of the stations at ``x`` (n,), the coordinates moving by ``motion`` (n,)."""
