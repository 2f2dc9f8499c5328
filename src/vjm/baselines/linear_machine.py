"""A machine that is linear about a posture without forces: stiffness of its unknowns, and what holds them.

An engine sets up the stiffness of its unknowns and says how each place of the machine moves with them. What closes
loops and what couples joints are rows of conditions; the imposed pose of the end-effector is six more. Held so, the
machine is a quadratic program, and the multipliers of the pose are the wrench on the end-effector:

    [ K  Bᵀ ] [  x ]   [ f ]
    [ B  0  ] [ −λ ] = [ d ]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import qr

from vjm.limits import PRESTRESS
from vjm.model.closures import Closure, Coupling
from vjm.model.end_condition import rigid_direction
from vjm.model.joints import PointSpring
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.rank import NEGLIGIBLE, rank_of
from vjm.rotations import Array

NEUTRAL = 1e-12
"""Stiffness of a motion, over that of the stiffest, that is none but for rounding."""


@dataclass(frozen=True)
class LinearResponse:
    """What a machine does under loads and imposed displacements, k of them side by side.

    Attributes:
        x: unknowns ``(n, k)``.
        reactions: of the held rows ``(h, k)``.
    """

    x: Array
    reactions: Array


@dataclass(frozen=True)
class LinearMachine:
    """Stiffness, conditions and places in n unknowns.

    Attributes:
        name: of the machine.
        length: mm, unit of shifts.
        unit: of each unknown ``(n,)``: ``length`` of shifts in mm, 1 of turns in rad.
        stiffness: ``(n, n)`` N, mm, rad.
        end: motion of the end-effector ``(6, n)``, world axes, mm and rad.
        conditions: rows ``(c, n)`` that are zero: closures and couplings. Some may depend on others.
        motion: motion ``(6, n)`` of a point of a part at a fraction of its length.
        weights: masses in kg, and the shifts ``(3, n)`` of their centres.
    """

    name: str
    length: float
    unit: Array
    stiffness: Array
    end: Array
    conditions: Array
    motion: Callable[[str, float], Array]
    weights: Sequence[tuple[float, Array]] = ()

    @cached_property
    def energy(self) -> float:
        """Typical stiffness of turns, N mm: the geometric mean of those that have one; of shifts where none has."""
        own = np.diag(self.stiffness) * self.unit**2
        turns, sprung = self.unit == 1.0, own > 0.0
        typical = own[sprung & turns] if np.any(sprung & turns) else own[sprung]
        return float(np.exp(np.mean(np.log(typical)))) if len(typical) else 1.0

    @cached_property
    def scale(self) -> Array:
        """Units ``(n,)`` in which each unknown's own stiffness is one, of passive joints as of the typical one."""
        own = np.diag(self.stiffness) * self.unit**2
        result: Array = self.unit / np.sqrt(np.where(own > 0.0, own, self.energy))
        return result

    @cached_property
    def kept(self) -> np.ndarray:
        """Indices ``(r,)`` of conditions that do not follow from one another.

        A loop of rigid links that moves in a plane is held several times over in the other directions.
        """
        return independent_rows(self.conditions * self.unit)

    @property
    def independent(self) -> Array:
        """These conditions ``(r, n)``."""
        return self.conditions[self.kept]

    def neutral(self, held: Array) -> Array:
        """Motions ``(n, k)`` that strain nothing and keep to the conditions and to the held rows ``(h, n)``."""
        rows = np.vstack([self.independent, held]) * self.scale
        size = np.linalg.norm(rows, axis=1, keepdims=True)
        # a row of zeros holds nothing
        rows = rows / np.where(size > 0.0, size, 1.0)
        K = self.stiffness * self.scale[:, None] * self.scale
        _, values, V = np.linalg.svd(np.vstack([K, rows]))
        rank = np.count_nonzero(values > NEUTRAL * values[0])
        result: Array = self.scale[:, None] * V[rank:].T
        return result

    def held(self, rows: Array, forces: Array, imposed: Array) -> LinearResponse:
        """What it does with some rows imposed.

        Motions that strain nothing and that nobody drives stay out: a bar between two ball joints does not turn
        about itself.

        Args:
            rows: imposed ``(h, n)``.
            forces: on the unknowns ``(n, k)``.
            imposed: values of the rows ``(h, k)``.

        Raises:
            ValueError: the machine is rigid in a direction in which it is held, or loads move it without
                straining a spring.
        """
        n, h = len(self.unit), len(rows)
        if self.rigid(rows):
            raise rigid_direction(self.name)
        neutral = self.neutral(rows)
        free = neutral / self.unit[:, None]
        works = forces * self.unit[:, None]
        least = NEGLIGIBLE * np.abs(free).max(initial=0.0) * np.abs(works).max(initial=0.0)
        if np.abs(free.T @ works).max(initial=0.0) > least:
            raise ValueError(f"{self.name}: under these loads it moves without straining a spring; hold it")
        B = np.vstack([rows, self.independent, (neutral / self.scale[:, None] ** 2).T])
        b = np.zeros((len(B), forces.shape[1]))
        b[:h] = imposed
        # entries span many decades: unknowns in units of their own stiffness, rows of their own reach
        reach = 1.0 / np.linalg.norm(B * self.scale, axis=1)
        units = np.concatenate([self.scale, reach])
        A = np.block([[self.stiffness, B.T], [B, np.zeros((len(B), len(B)))]]) * units[:, None] * units
        solved = units[:, None] * np.linalg.solve(A, units[:, None] * np.vstack([forces, b]))
        return LinearResponse(solved[:n], -solved[n : n + h])

    def rigid(self, rows: Array) -> bool:
        """Whether some of the rows ``(h, n)`` are zero, or follow from the others and the conditions."""
        both = np.vstack([self.independent, rows]) * self.unit
        size = np.linalg.norm(both, axis=1)
        if len(both) > both.shape[1] or np.any(size == 0.0):
            return True
        return rank_of(both / size[:, None]).rank < len(both)

    def end_stiffness(self) -> Array:
        """Stiffness ``(6, 6)`` of the end-effector whose pose is imposed, world axes, N, mm, rad.

        Raises:
            ValueError: the machine is rigid in some direction.
        """
        return self.held(self.end, np.zeros((len(self.unit), 6)), np.eye(6)).reactions

    def forces(self, load_case: LoadCase) -> tuple[Array, Array]:
        """Forces ``(n,)`` on the unknowns: of what acts all along, and of what the ramp multiplies.

        Without forces a load that turns with its body is the same as one that does not.

        Raises:
            ValueError: a load stands on a point that the machine does not have.
        """
        constant, ramped = np.zeros((2, len(self.unit)))
        for load in load_case.loads:
            (ramped if load.ramped else constant)[:] += self.motion(load.part, load.at).T @ np.array(load.wrench)
        if load_case.gravity is not None:
            for mass, shift in self.weights:
                weight = mass * np.array(load_case.gravity)
                (ramped if load_case.weight_ramped else constant)[:] += shift.T @ weight
        return constant, load_case.sign * ramped


def independent_rows(rows: Array) -> np.ndarray:
    """Indices, increasing, of rows ``(c, n)`` of which none is zero or follows from the others.

    Example:
        >>> len(independent_rows(np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 3.0]])))
        2
    """
    size = np.linalg.norm(rows, axis=1)
    # what differences of two motions leave of one that is none is rounding
    own = np.flatnonzero(size > NEGLIGIBLE * size.max(initial=0.0))
    if not len(own):
        return own
    unit_rows = rows[own] / size[own, None]
    _, order = qr(unit_rows.T, mode="r", pivoting=True)
    return np.asarray(own[np.sort(order[: rank_of(unit_rows).rank])])


def refuse_open(engine: str, chain: Machine, closure: Closure, first: Array, second: Array) -> None:
    """For closures that the posture does not close, which would be under stress.

    Args:
        engine: its label.
        chain: the machine.
        closure: which.
        first: one of its frames ``(4, 4)``, world.
        second: the other.

    Raises:
        ValueError: it is open by more than what rounding leaves.
    """
    gap = float(np.linalg.norm(second[:3, 3] - first[:3, 3]))
    turned = 0.0 if closure.turns else float(np.abs(second[:3, :3] - first[:3, :3]).max())
    if gap > NEGLIGIBLE * chain.characteristic_length or turned > NEGLIGIBLE:
        raise PRESTRESS.refusal(
            engine, f"closure '{closure.name}', open by {gap:.3g} mm and {turned:.3g} rad in this posture"
        )


def refuse_uncoupled(engine: str, coupling: Coupling, coordinates: Mapping[str, float]) -> None:
    """For couplings that the posture does not keep to, which would be under stress.

    Args:
        engine: its label.
        coupling: which.
        coordinates: of the passive joints, mm or rad, by name.

    Raises:
        ValueError: the weighted coordinates add up to another total, by more than what rounding leaves.
    """
    values = [weight * coordinates[name] for name, weight in coupling.terms]
    off = sum(values) - coupling.total
    if abs(off) > NEGLIGIBLE * max(1.0, *(abs(value) for value in values)):
        raise PRESTRESS.refusal(engine, f"coupling '{coupling.name}', off its total by {off:.3g} in this posture")


def refuse_stretched(engine: str, chain: Machine, spring: PointSpring, length: float) -> None:
    """For springs between points that pull or push in the posture.

    Args:
        engine: its label.
        chain: the machine.
        spring: which.
        length: at which it is, mm.

    Raises:
        ValueError: its force is more than what rounding of the length leaves.
    """
    force = float(spring.pull(length))
    stiffness = spring.stiffness if spring.law is None else spring.law.largest_stiffness
    if abs(force) > NEGLIGIBLE * stiffness * chain.characteristic_length:
        raise PRESTRESS.refusal(engine, f"spring '{spring.name}', which bears {force:.3g} N")
