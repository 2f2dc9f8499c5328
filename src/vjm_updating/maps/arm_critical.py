"""The smallest force on a free end at which an arm, a tree or a machine with closed loops loses its stability.

A dead force F d grows from zero; weight and other loads act in full. Along most directions d a curved arm only
bends further and stays stable. It loses its stability where its end has no stiffness left: the smallest eigenvalue
of the end's stiffness against a force falls to zero, and the direction in which that needs the least force is
sought while the force grows. Loops and single links may also lose their stability while the end keeps its
stiffness; the count of negative eigenvalues says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from vjm.model.load_case import Load
from vjm.rotations import Array
from vjm.tree.equilibria import equilibria
from vjm.tree.model import Gravity, TreeModel

TOLERANCE = 1e-3
"""Relative, of a critical force."""
LAST_TURN = float(np.sqrt(2.0 * TOLERANCE))
"""rad between directions of which the component along the weakest differs by less than the tolerance."""
FIRST_TURN = np.pi / 8.0
"""rad: half of the angle between the first directions, those to a cube's faces, edges and corners."""
FIRST_STEP = 1e-4
"""Of the machine's reach: how far the first force moves the end; so little that all is linear there."""
LAST_PART = 0.02
"""Of a force: what is left to the point where the stiffness is zero when it is found by a straight line."""
LIKELY = 2.0
"""Times the least force that is expected from half of it on: directions beyond are given up."""
HALVINGS = 6
"""Of a step of the force, before what it does not lead to counts as lost."""
TURNS = 16
"""Looks around a direction at one force: the turn is halved that often, or the direction has moved on."""
STEPS = 8
"""In which a force along a single direction grows before the point of loss is found by halving."""
ROUNDS = 200
"""Forces tried before the search gives up: doubling passes from 1e-4 N to 1e9 N in 43."""


@dataclass(frozen=True)
class Weakest:
    """The smallest critical force of a posture.

    Attributes:
        force: N; nan where there is none.
        direction: ``(3,)`` unit vector, world axes.
        why: empty, or why there is none.
    """

    force: float
    direction: Array
    why: str = ""


@dataclass
class _States:
    """Equilibria under k forces.

    Attributes:
        forces: ``(k, 3)`` N.
        x: coordinates ``(k, n)``.
        moved: shift ``(k, 3)`` of the end.
        compliance: ``(k, 3, 3)`` of the end against a force, mm/N.
        lost: ``(k,)`` whether there is no stable equilibrium that the force leads to.
    """

    forces: Array
    x: Array
    moved: Array
    compliance: Array
    lost: np.ndarray

    @property
    def stiffness(self) -> Array:
        """Smallest stiffness ``(k,)`` of the end against a force, N/mm."""
        symmetric = 0.5 * (self.compliance + np.swapaxes(self.compliance, 1, 2))
        symmetric[self.lost] = 0.0
        with np.errstate(divide="ignore"):
            result: Array = np.where(self.lost, 0.0, 1.0 / np.linalg.eigvalsh(symmetric)[:, -1])
        return result

    def chosen(self, rows: np.ndarray) -> _States:
        """Some of them."""
        return _States(*(values[rows] for values in self._each()))

    def put(self, rows: np.ndarray, others: _States) -> None:
        """Others in the place of some."""
        for own, new in zip(self._each(), others._each(), strict=True):
            own[rows] = new

    def _each(self) -> tuple[Array, ...]:
        return self.forces, self.x, self.moved, self.compliance, self.lost

    @property
    def directions(self) -> Array:
        """Unit vectors ``(k, 3)`` along the forces."""
        result: Array = self.forces / np.linalg.norm(self.forces, axis=1)[:, None]
        return result


class WeakestForce:
    """Looks for the smallest critical force of a machine's free end in postures."""

    def __init__(
        self, model: TreeModel, end: int, most: float, *, gravity: Gravity | None = None, loads: Sequence[Load] = ()
    ) -> None:
        """See `weakest`.

        Args:
            model: arm, tree or machine with closed loops.
            end: index of its end frame.
            most: largest force tried, N.
            gravity: m/s².
            loads: on parts, in full.
        """
        self.model, self.end, self.most, self.gravity, self.loads = model, end, most, gravity, tuple(loads)

    def weakest(self, q: Array) -> Weakest:
        """The smallest critical force over all directions in a posture with coordinates ``(n_joints,)``."""
        self.q = q
        rest = self._under(np.zeros((1, 3)), None)
        if rest.lost[0]:
            return _none("no stable equilibrium without a force on the end")
        if not rest.stiffness[0] < np.inf:
            return _none("no force moves the end")
        probe = FIRST_STEP * self.model.reach * float(rest.stiffness[0])
        return self._march(rest, min(probe, self.most))

    def _march(self, rest: _States, force: float) -> Weakest:
        """Let the force grow along all directions, each of which turns to where the end is most compliant."""
        start = self._directions(force)
        before = self._from(rest.chosen(np.zeros(len(start), dtype=int)), force * start)
        turn = np.full(len(start), FIRST_TURN)
        zero = _zeros(0.0, np.full(len(start), rest.stiffness[0]), force, before.stiffness)
        low, expected = force, float(zero.min())
        now = before
        for _ in range(ROUNDS):
            if now.lost.any():
                return self._first(now.directions[now.lost], float(np.linalg.norm(now.forces[0])))
            ahead = min(low + 0.5 * (expected - low), self.most)
            now = self._from(before, ahead * before.directions)
            if now.lost.any():
                continue
            # at first each direction looks around its own cell: which of them will be the weakest shows later
            turn = self._softened(now, turn, float(rest.stiffness[0]), start if len(turn) == len(start) else None)
            if now.lost.any():
                continue
            zero = _zeros(low, before.stiffness, ahead, now.stiffness)
            nearest = int(np.argmin(zero))
            foreseen, expected, low = expected, float(zero[nearest]), ahead
            certain = abs(foreseen - expected) <= TOLERANCE * expected <= TOLERANCE * self.most
            if certain and expected - low <= LAST_PART * expected:
                return Weakest(expected, now.directions[nearest])
            if low >= self.most:
                break
            likely = np.flatnonzero(zero <= LIKELY * expected)
            kept = likely[_distinct(now.directions[likely], zero[likely])]
            before, turn = now.chosen(kept), turn[kept]
        return _none(f"no critical force up to {self.most:g} N")

    def _first(self, directions: Array, most: float) -> Weakest:
        """The smallest of the critical forces up to a force along directions ``(k, 3)``, and of those around it."""
        forces = [self._along(each, most) for each in directions]
        k = int(np.argmin(forces))
        if np.isinf(forces[k]):
            return _none(f"the way to {most:.4g} N was lost, but along no single direction")
        return self._turned(directions[k], forces[k])

    def _softened(self, now: _States, turn: Array, unloaded: float, cells: Array | None) -> Array:
        """Turn each direction to where the end is most compliant; by how much each may turn next ``(k,)``, rad.

        Args:
            now: states under forces of one size; become those along the directions found.
            turn: of each direction ``(k,)``, rad.
            unloaded: stiffness of the end without a force, N/mm.
            cells: directions ``(k, 3)`` whose neighbourhoods are not left; None for any way.
        """
        force = float(np.linalg.norm(now.forces[0]))
        turn = turn.copy()
        for _ in range(TURNS):
            # the dip of the stiffness over the directions narrows as it deepens, with the power 3/2 of a cusp
            going = np.flatnonzero(turn > LAST_TURN * (now.stiffness / unloaded) ** 1.5)
            if not len(going):
                break
            around = _around(now.directions[going], turn[going])
            tried = self._from(now.chosen(np.tile(going, 4)), force * around)
            best = np.argmin(tried.stiffness.reshape(4, -1), axis=0) * len(going) + np.arange(len(going))
            found = tried.chosen(best)
            better = found.stiffness < now.stiffness[going]
            if cells is not None:
                better &= np.einsum("ki,ki->k", found.directions, cells[going]) > np.cos(2.0 * FIRST_TURN)
            now.put(going[better], found.chosen(better))
            turn[going] *= np.where(better, 1.0, 0.5)
            if now.lost.any():
                break
        return np.minimum(FIRST_TURN, 4.0 * turn)

    def _turned(self, direction: Array, force: float) -> Weakest:
        """A smaller force that is critical along a neighbour of a direction, where there is one."""
        turn = FIRST_TURN
        while turn > LAST_TURN:
            around = _around(direction[None], np.array([turn]))
            tried = [self._along(each, force * (1.0 - 2.0 * TOLERANCE)) for each in around]
            k = int(np.argmin(tried))
            if tried[k] < np.inf:
                direction, force = around[k], tried[k]
            else:
                turn *= 0.5
        return Weakest(force, direction)

    def _along(self, direction: Array, most: float) -> float:
        """The first critical force along a direction, N; infinite where there is none up to the largest."""
        at, low, high = self._under(np.zeros((1, 3)), None), 0.0, np.inf
        while low < most and (np.isinf(high) or high - low > TOLERANCE * high):
            ahead = min(low + most / STEPS, most) if np.isinf(high) else 0.5 * (low + high)
            now = self._from(at, ahead * direction[None])
            if now.lost[0]:
                high = ahead
            else:
                at, low = now, ahead
        return high

    def _from(self, at: _States, forces: Array, halvings: int = 0) -> _States:
        """Equilibria under other forces, from those at hand; lost where they do not lead there.

        Halfway between the slopes at both ends of a step lies what it moves the end by. What is further off than
        half of the way has not been led to, but lies behind a loss of stability, or the step was too long: it is
        taken again by halves.
        """
        now = self._under(forces, at.x)
        mean, way = 0.5 * (at.compliance + now.compliance), now.moved - at.moved
        off = np.linalg.norm(way - np.einsum("kij,kj->ki", mean, forces - at.forces), axis=1)
        size = np.linalg.norm(way, axis=1) + FIRST_STEP * self.model.reach
        now.lost |= ~(off <= 0.5 * size)
        again = np.flatnonzero(now.lost)
        if len(again) and halvings < HALVINGS:
            middle = self._from(at.chosen(again), 0.5 * (at.forces[again] + forces[again]), halvings + 1)
            led = np.flatnonzero(~middle.lost)
            if len(led):
                now.put(again[led], self._from(middle.chosen(led), forces[again[led]], halvings + 1))
        return now

    def _under(self, forces: Array, x: Array | None) -> _States:
        k = len(forces)
        wrench = np.zeros((k, len(self.model.ends), 6))
        wrench[:, self.end, :3] = forces
        q = np.tile(self.q, (k, 1))
        found = equilibria(self.model, q, gravity=self.gravity, wrench=wrench, loads=self.loads, start=x)
        assert found.compliance is not None
        lost = ~(found.found & found.stable)
        moved, compliance = found.deflection[:, self.end, :3], found.compliance[:, self.end, :3, :3]
        return _States(forces.copy(), found.x, moved.copy(), compliance.copy(), lost)

    def _directions(self, force: float) -> Array:
        """Directions to begin with: all around, and those that strain a closed loop most.

        In a linear model the force in a closure is a linear function of that on the end.
        """
        cube = np.array([row for row in product((-1.0, 0.0, 1.0), repeat=3) if any(row)])
        around = cube / np.linalg.norm(cube, axis=1)[:, None]
        rows = [closure.rows for closure in self.model.chain.closures]
        if not rows:
            return around
        wrench = np.zeros((4, len(self.model.ends), 6))
        wrench[:3, self.end, :3] = force * np.eye(3)
        found = equilibria(
            self.model, np.tile(self.q, (4, 1)), gravity=self.gravity, wrench=wrench, loads=self.loads,
            compliance=False,
        )  # fmt: skip
        slopes = found.closures[:3] - found.closures[3]
        firsts = np.cumsum([0, *rows])[:-1]
        strained = [
            np.linalg.svd(slopes[:, first : first + 3].T)[2][0] for first in firsts if np.isfinite(slopes).all()
        ]
        return np.array([*around, *(sign * each for each in strained for sign in (1.0, -1.0))])


def _none(why: str) -> Weakest:
    return Weakest(float("nan"), np.full(3, np.nan), why)


def _zeros(low: float, before: Array, high: float, now: Array) -> Array:
    """Forces ``(k,)`` at which stiffnesses that fall in a straight line are zero; infinite where they rise."""
    fallen = before - now
    with np.errstate(divide="ignore", over="ignore"):
        result: Array = np.where(fallen > 0.0, high + now * (high - low) / np.maximum(fallen, 1e-300), np.inf)
    return result


def _around(directions: Array, turn: Array) -> Array:
    """Four neighbours of each direction ``(4 k, 3)``, turned by angles ``(k,)``; those to one side together."""
    sides = np.array([np.linalg.svd(each[None])[2][1:] for each in directions])
    offsets = np.concatenate([sides[:, 0], -sides[:, 0], sides[:, 1], -sides[:, 1]])
    around = np.tile(directions, (4, 1)) + np.tan(np.tile(turn, 4))[:, None] * offsets
    result: Array = around / np.linalg.norm(around, axis=1)[:, None]
    return result


def _distinct(directions: Array, zero: Array) -> np.ndarray:
    """Indices of directions of which no two are almost the same; of two that of the smaller force is kept."""
    kept: list[int] = []
    for k in np.argsort(zero, kind="stable").tolist():
        if all(directions[k] @ directions[other] < np.cos(LAST_TURN) for other in kept):
            kept.append(k)
    return np.array(sorted(kept))
