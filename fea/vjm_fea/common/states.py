"""States of bodies in space as one array, and motions from one to another.

A *state* is ``(7 b + k + 1,)``: position or displacement in mm and orientation as a unit quaternion, scalar first,
of each of b bodies. Then come k numbers that simply add up, joint coordinates or multipliers; the ramp is last. A
*motion* is ``(6 b + k,)``: a shift in mm and a small turn in world axes of each body, and what is added to the
numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_fea.common.quaternions import rates, rotation_matrices, turned


@dataclass(frozen=True)
class States:
    """How states are laid out and moved.

    Attributes:
        bodies: number b.
        others: number k.
    """

    bodies: int
    others: int

    def places(self, state: Array) -> Array:
        """Positions and quaternions ``(b, 7)``."""
        return state[: 7 * self.bodies].reshape(-1, 7)

    def numbers(self, state: Array) -> Array:
        """Joint coordinates or multipliers ``(k,)``."""
        return state[7 * self.bodies : -1]

    def turns(self, state: Array) -> Array:
        """Rotation matrices ``(b, 3, 3)``."""
        return rotation_matrices(self.places(state)[:, 3:])

    def rates(self, state: Array) -> Array:
        """Derivative ``(b, 4, 3)`` of the quaternions by small turns in world axes."""
        return rates(self.places(state)[:, 3:])

    def moved(self, state: Array, motion: Array, ramp: float = 0.0) -> Array:
        """The state after a motion and a change of the ramp."""
        places, moves = self.places(state), motion[: 6 * self.bodies].reshape(-1, 6)
        result = np.column_stack([places[:, :3] + moves[:, :3], turned(places[:, 3:], moves[:, 3:])])
        return np.concatenate([result.ravel(), self.numbers(state) + motion[6 * self.bodies :], [state[-1] + ramp]])

    def normalised(self, state: Array) -> Array:
        """The state with quaternions of unit length, after an extrapolation."""
        result = state.copy()
        q = self.places(result)[:, 3:]
        q /= np.linalg.norm(q, axis=1)[:, None]
        return result

    def put(self, state: Array, body: int, position: Array, quaternion: Array) -> Array:
        """The state with one body at a position ``(3,)`` and a unit quaternion ``(4,)``."""
        result = state.copy()
        result[7 * body : 7 * body + 7] = [*position, *quaternion]
        return result

    def change(self, state: Array, motion: Array, ramp: float = 0.0) -> Array:
        """Derivative ``(7 b + k + 1,)`` of the state along a motion."""
        moves = motion[: 6 * self.bodies].reshape(-1, 6)
        turns = np.einsum("kab,kb->ka", self.rates(state), moves[:, 3:])
        result = np.column_stack([moves[:, :3], turns])
        return np.concatenate([result.ravel(), motion[6 * self.bodies :], [ramp]])

    def gradient(self, state: Array, row: Array) -> tuple[Array, float]:
        """Derivative ``(6 b + k,)`` by motions, and by the ramp, of a function with that by the state, ``row``."""
        places = self.places(row)
        turns = np.einsum("kab,ka->kb", self.rates(state), places[:, 3:])
        moves = np.column_stack([places[:, :3], turns])
        return np.concatenate([moves.ravel(), self.numbers(row)]), float(row[-1])
