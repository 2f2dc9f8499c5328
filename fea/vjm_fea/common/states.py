"""States of bodies in space as one array with unit quaternions, and motions from one to another.

The quaternions are Euler parameters, scalar first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array


def quaternion(R: Array) -> Array:
    """Unit quaternion ``(4,)`` of a rotation matrix ``(3, 3)``, by its largest component (Shepperd)."""
    t = float(np.trace(R))
    squares = np.array([t, *(2.0 * np.diag(R) - t)])
    k = int(np.argmax(squares))
    if k == 0:
        p = np.array([1.0 + t, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    else:
        i, j, m = k - 1, k % 3, (k + 1) % 3
        p = np.zeros(4)
        p[0] = R[m, j] - R[j, m]
        p[1 + i] = 1.0 + squares[k]
        p[1 + j] = R[j, i] + R[i, j]
        p[1 + m] = R[m, i] + R[i, m]
    return p / np.linalg.norm(p)


def rotation_matrices(p: Array) -> Array:
    """Rotation matrices ``(n, 3, 3)`` of unit quaternions ``(n, 4)``."""
    w, v = p[:, 0], p[:, 1:]
    R: Array = 2.0 * (v[:, :, None] * v[:, None, :] + w[:, None, None] * skews(v))
    R += (w**2 - np.sum(v**2, axis=1))[:, None, None] * np.eye(3)
    return R


def skews(v: Array) -> Array:
    """Cross-product matrices ``(n, 3, 3)`` of vectors ``(n, 3)``."""
    S = np.zeros((len(v), 3, 3))
    S[:, 0, 1], S[:, 0, 2], S[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    return S - np.swapaxes(S, 1, 2)


def turned(p: Array, rotation: Array) -> Array:
    """Unit quaternions ``(n, 4)`` after turns by rotation vectors ``(n, 3)`` in rad, world axes."""
    angle = np.linalg.norm(rotation, axis=1)
    w = np.cos(0.5 * angle)
    v = 0.5 * np.sinc(0.5 * angle / np.pi)[:, None] * rotation
    scalar = w * p[:, 0] - np.sum(v * p[:, 1:], axis=1)
    vector = w[:, None] * p[:, 1:] + p[:, :1] * v + np.cross(v, p[:, 1:])
    both = np.column_stack([scalar, vector])
    return both / np.linalg.norm(both, axis=1)[:, None]


def product(p: Array, q: Array) -> Array:
    """Unit quaternions ``(n, 4)`` of the rotations ``R(p) R(q)``, p and q ``(n, 4)``."""
    scalar = p[:, 0] * q[:, 0] - np.sum(p[:, 1:] * q[:, 1:], axis=1)
    vector = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
    return np.column_stack([scalar, vector])


def rates(p: Array) -> Array:
    """Derivative ``(n, 4, 3)`` of quaternions ``(n, 4)`` by a small turn in the world's axes.

    It takes an angular velocity to the quaternion's rate, and its transpose takes a generalised force on the
    quaternion to the moment in world axes. Linear in ``p``.
    """
    E = np.empty((len(p), 4, 3))
    E[:, 0] = -0.5 * p[:, 1:]
    E[:, 1:] = 0.5 * (p[:, 0, None, None] * np.eye(3) - skews(p[:, 1:]))
    return E


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
