"""How legs lie between bodies, and what each adds to the bodies' equilibrium."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vjm.model.lumped import LumpedModel
from vjm.rotations import Array, displacement_between, rotation_from_vector, rotation_vector, skew


class Edge(NamedTuple):
    """A leg as the network sees it.

    Attributes:
        start: index of the body on which it begins, −1 for the base.
        end: index of the body on which it ends.
        root: frame ``(4, 4)`` of its world in the starting body.
        place: frame ``(4, 4)`` of its end in the body that it ends on.
    """

    start: int
    end: int
    root: Array
    place: Array


class Layout:
    """Where things are in the coordinates ``(n,)``: legs, their wrenches, bodies, couplings."""

    def __init__(self, models: Sequence[LumpedModel], bodies: int, couplings: int) -> None:
        ends = np.cumsum([0, *(model.size for model in models)])
        self.legs = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        first = int(ends[-1])
        self.wrenches = [slice(first + 6 * i, first + 6 * i + 6) for i in range(len(models))]
        first += 6 * len(models)
        self.bodies = slice(first, first + 6 * bodies)
        self.platform = slice(first, first + 6)
        self.couplings = slice(first + 6 * bodies, first + 6 * bodies + couplings)
        self.size = self.couplings.stop


class Visited(NamedTuple):
    """What is known of one leg at a state."""

    statics: Array
    gap: Array
    error: float
    world: Array
    K: Array
    at_end: Array
    at_start: Array
    wrench: Array
    torques: list[tuple[int, int, float, Array, Array]]
    """Of the couplings on the leg: coupling, joint, weight, and what a unit of torque does to coordinates and
    wrench."""


def add_leg(M: Array, balance: Array, edge: Edge, leg: Visited, bodies: int) -> None:
    """Add one leg's share to the bodies' matrix and balance: stiffness, its wrench, and how that turns."""
    b = 6 * bodies
    e = slice(6 * edge.end, 6 * edge.end + 6)
    E, A, W = leg.at_end, leg.at_start, leg.wrench
    f, m = W[:3], W[3:]
    balance[e] -= E.T @ W
    M[e, e] += E.T @ leg.K @ E
    # the lever turns with the body
    r = -E[:3, 3:]  # skew of the lever
    lever = np.zeros((6, 6))
    lever[3:, 3:] = skew(f) @ r
    M[e, e] += lever
    for k, _, _, _, dF in leg.torques:
        M[e, b + k] += E.T @ leg.world @ dF
        M[b + k, e] += E.T @ leg.world @ dF
    if edge.start >= 0:
        a = slice(6 * edge.start, 6 * edge.start + 6)
        balance[a] += A.T @ W
        # the wrench turns with the body on which the leg begins
        turning = np.zeros((6, 6))
        turning[:3, 3:], turning[3:, 3:] = -skew(f), -skew(m)
        M[e, a] += E.T @ (turning - leg.K @ A)
        M[a, e] -= A.T @ leg.K @ E
        M[a, a] -= A.T @ (turning - leg.K @ A)
        # its lever about that body goes to where the end is
        travel = np.zeros((6, 6))
        travel[3:, :3], travel[3:, 3:] = -skew(f), skew(f) @ r
        M[a, e] -= travel
        M[a, a][3:, :3] += -skew(f)
        for k, _, _, _, dF in leg.torques:
            M[a, b + k] -= A.T @ leg.world @ dF
            M[b + k, a] -= A.T @ leg.world @ dF
    for k, joint, weight, _, _ in leg.torques:
        for k2, _, _, dx2, _ in leg.torques:
            M[b + k, b + k2] -= weight * dx2[joint]


def pose_error(there: Array, target: Array, held: Array) -> Array:
    """Motion ``(6,)`` by which a body misses a frame in the held components; zero in the others.

    Args:
        there: its frame ``(4, 4)``.
        target: where it is to be.
        held: ``(6,)`` which components count. Where one turn is free a hinge carries the body along that axis.
    """
    d = displacement_between(there, target)
    free = np.flatnonzero(np.logical_not(held[3:]))
    if len(free) == 1:
        # all but the turn about the hinge: about an axis across it
        half = 0.5 * float(np.linalg.norm(d[3:]))
        share = 0.5 * float(np.sinc(half / np.pi)) * d[3 + free[0]]
        hinge = np.zeros(3)
        hinge[free] = -2.0 * np.arctan2(share, np.cos(half))
        d[3:] = rotation_vector(rotation_from_vector(hinge) @ rotation_from_vector(d[3:]))
    return np.where(held, d, 0.0)


class Universal:
    """A universal joint that carries a platform, two of its turns free: one axis turns with it, one is fixed.

    The order is that of `vjm.model.end_condition`: of the two the first of ry, rx, rz is the platform's own.

    Args:
        held: ``(6,)`` which components are held.
        rest: frame ``(4, 4)`` of the platform at rest.
    """

    def __init__(self, held: Array, rest: Array) -> None:
        own, fixed = (k for k in (1, 0, 2) if not held[3 + k])
        self.own, self.fixed = own, fixed
        self.held = 3 - own - fixed
        self.sign = float(np.cross(np.eye(3)[own], np.eye(3)[fixed])[self.held])
        self.rest: Array = rest[:3, :3].copy()

    def axes(self, there: Array) -> Array:
        """Directions ``(3, 3)`` of the turns, free and held ones, with the platform at a frame ``(4, 4)``."""
        B = np.eye(3)
        B[:, self.own] = there[:3, :3] @ self.rest.T[:, self.own]
        across = np.cross(B[:, self.own], B[:, self.fixed])
        B[:, self.held] = self.sign * across / np.linalg.norm(across)
        return B

    def pose_error(self, there: Array) -> float:
        """Turn about the held direction by which the two axes miss their right angle, rad."""
        B = self.axes(there)
        return -self.sign * float(np.arcsin(np.clip(B[:, self.own] @ B[:, self.fixed], -1.0, 1.0)))

    def borne(self, B: Array, moment: Array) -> Array:
        """Of a moment ``(3,)`` what the joint can bear."""
        n = B[:, self.held]
        return n * float(n @ moment)

    def turning(self, B: Array, moment: Array) -> Array:
        """What a turn of the platform takes from its balance ``(3, 3)``: the held direction turns too."""
        size = self.sign * float(B[:, self.held] @ moment)
        return -size * np.outer(B[:, self.own], B[:, self.fixed])


def carried(lever: Array) -> Array:
    """Motion ``(6, 6)`` of a point at a lever ``(3,)`` from a body's reference point by the body's."""
    E = np.eye(6)
    E[:3, 3:] = -skew(lever)
    return E


def turn_rate(d: Array) -> Array:
    """Small turn in world axes ``(3, 3)`` by the change of a rotation vector ``d`` (3,)."""
    angle, S = float(np.linalg.norm(d)), skew(d)
    a = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    b = 1.0 / 6.0 - angle**2 / 120.0 if angle < 1e-2 else (angle - np.sin(angle)) / angle**3
    result: Array = np.eye(3) + a * S + b * (S @ S)
    return result
