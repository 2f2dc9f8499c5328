"""The smallest force on a free end at which an arm, a tree or a machine with closed loops loses its stability.

A dead force F d grows from zero; weight and other loads act in full. Along most directions d a bent arm only bends
further and stays stable. It loses its stability where its end has no stiffness left: the smallest eigenvalue of
the end's stiffness against a force falls to zero, and the direction in which that needs the least force is sought
while the force grows. Loops and single links may also lose their stability while the end keeps its stiffness; the
count of negative eigenvalues says so.
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
LAST_PART = 0.1
"""Of a force: what is left to the point where the stiffness is zero when it is found by a straight line."""
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
    """Equilibria under forces of one size along k directions.

    Attributes:
        force: N.
        directions: ``(k, 3)``.
        x: coordinates ``(k, n)``.
        moved: shift ``(k, 3)`` of the end.
        compliance: ``(k, 3, 3)`` of the end against a force, mm/N.
        lost: ``(k,)`` whether there is no stable equilibrium that the force leads to.
    """

    force: float
    directions: Array
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
        each = (self.directions, self.x, self.moved, self.compliance, self.lost)
        return _States(self.force, *(values[rows] for values in each))


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
        rest = self._under(0.0, np.zeros((1, 3)), None)
        if rest.lost[0]:
            return _none("no stable equilibrium without a force on the end")
        if not rest.stiffness[0] < np.inf:
            return _none("no force moves the end")
        probe = FIRST_STEP * self.model.reach * float(rest.stiffness[0])
        return self._march(rest, min(probe, self.most))

    def _march(self, rest: _States, force: float) -> Weakest:
        """Let the force grow along all directions, each of which turns to where the end is softest."""
        start = self._directions(force)
        before = self._from(rest.chosen(np.zeros(len(start), dtype=int)), force, start)
        if before.lost.any():
            return self._turned(before.directions[np.argmax(before.lost)], force)
        unloaded, turn = np.full(len(start), rest.stiffness[0]), np.full(len(start), FIRST_TURN)
        zero = force - before.stiffness * force / np.minimum(before.stiffness - unloaded, -1e-300)
        low, high, expected, lost = force, np.inf, float(zero.min()), np.zeros(3)
        for _ in range(ROUNDS):
            ahead = min(2.0 * low, low + 0.5 * (expected - low), self.most)
            ahead = ahead if np.isinf(high) else min(ahead, 0.5 * (low + high))
            now = self._from(before, ahead, before.directions)
            if not now.lost.any():
                now, turn = self._softened(before, now, turn)
            if now.lost.any():
                high, lost = ahead, now.directions[np.argmax(now.lost)]
                if high - low <= TOLERANCE * high:
                    return self._turned(lost, high)
                continue
            slope = (now.stiffness - before.stiffness) / (ahead - low)
            with np.errstate(divide="ignore"):
                zero = np.where(slope < 0.0, ahead - now.stiffness / np.minimum(slope, -1e-300), np.inf)
            nearest = int(np.argmin(zero))
            foreseen, expected = expected, float(zero[nearest])
            low = ahead
            certain = abs(foreseen - expected) <= TOLERANCE * expected
            if certain and expected - low <= LAST_PART * expected and expected <= self.most:
                return Weakest(expected, now.directions[nearest])
            if low >= self.most:
                break
            kept = _distinct(now.directions, now.stiffness)
            before, turn = now.chosen(kept), turn[kept]
        return _none(f"no critical force up to {self.most:g} N")

    def _softened(self, before: _States, now: _States, turn: Array) -> tuple[_States, Array]:
        """Directions turned to neighbours where the end is softer, and by what they are turned next."""
        k = len(turn)
        around = _around(now.directions, turn)
        rows = np.tile(np.arange(k), 4)
        tried = self._from(now.chosen(rows), now.force, around)
        best = np.argmin(tried.stiffness.reshape(4, k), axis=0) * k + np.arange(k)
        better = tried.stiffness[best] < now.stiffness
        for own, new in zip(
            (now.directions, now.x, now.moved, now.compliance, now.lost),
            (tried.directions, tried.x, tried.moved, tried.compliance, tried.lost),
            strict=True,
        ):
            own[better] = new[best][better]
        return now, np.where(better, turn, 0.5 * turn)

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
        at = self._under(0.0, np.zeros((1, 3)), None)
        high = np.inf
        while at.force < most and high - at.force > TOLERANCE * high or np.isinf(high) and at.force < most:
            ahead = at.force + most / STEPS if np.isinf(high) else 0.5 * (at.force + high)
            now = self._from(at, min(ahead, most), direction[None])
            if now.lost[0]:
                high = now.force
            else:
                at = now
        return high

    def _from(self, at: _States, force: float, directions: Array) -> _States:
        """Equilibria under other forces, from those at hand; lost where they do not lead there.

        Halfway between the slopes at both ends of a step lies what it moves the end by. What is further off than
        half of the whole way has not been led to, but lies behind a loss of stability.
        """
        now = self._under(force, directions, at.x)
        change = force * directions - at.force * at.directions
        mean = 0.5 * (at.compliance + now.compliance)
        way = now.moved - at.moved
        off = np.linalg.norm(way - np.einsum("kij,kj->ki", mean, change), axis=1)
        now.lost |= ~(off <= 0.5 * np.linalg.norm(way, axis=1) + FIRST_STEP * self.model.reach)
        return now

    def _under(self, force: float, directions: Array, x: Array | None) -> _States:
        k = len(directions)
        wrench = np.zeros((k, len(self.model.ends), 6))
        wrench[:, self.end, :3] = force * directions
        q = np.tile(self.q, (k, 1))
        found = equilibria(self.model, q, gravity=self.gravity, wrench=wrench, loads=self.loads, start=x)
        assert found.compliance is not None
        lost = ~(found.found & found.stable)
        moved, compliance = found.deflection[:, self.end, :3], found.compliance[:, self.end, :3, :3]
        return _States(force, directions.copy(), found.x, moved.copy(), compliance.copy(), lost)

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
            self.model, np.tile(self.q, (4, 1)), gravity=self.gravity, wrench=wrench, loads=self.loads, compliance=False
        )  # fmt: skip
        slopes = found.closures[:3] - found.closures[3]
        firsts = np.cumsum([0, *rows])[:-1]
        strained = [np.linalg.svd(slopes[:, first : first + 3].T)[2][0] for first in firsts if np.isfinite(slopes).all()]
        return np.array([*around, *(sign * each for each in strained for sign in (1.0, -1.0))])


def _none(why: str) -> Weakest:
    return Weakest(float("nan"), np.full(3, np.nan), why)


def _around(directions: Array, turn: Array) -> Array:
    """Four neighbours of each direction ``(4 k, 3)``, turned by angles ``(k,)``; those to one side together."""
    sides = np.array([np.linalg.svd(each[None])[2][1:] for each in directions])
    offsets = np.concatenate([sides[:, 0], -sides[:, 0], sides[:, 1], -sides[:, 1]])
    around = np.tile(directions, (4, 1)) + np.tan(np.tile(turn, 4))[:, None] * offsets
    result: Array = around / np.linalg.norm(around, axis=1)[:, None]
    return result


def _distinct(directions: Array, stiffness: Array) -> np.ndarray:
    """Indices of directions of which no two are almost the same; the softer of two is kept."""
    kept: list[int] = []
    for k in np.argsort(stiffness, kind="stable").tolist():
        if all(directions[k] @ directions[other] < np.cos(LAST_TURN) for other in kept):
            kept.append(k)
    return np.array(sorted(kept))
