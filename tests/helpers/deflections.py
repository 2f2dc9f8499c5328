"""Deflections of a UR10-like arm whose joints are elastic about their own axes."""

import numpy as np
from hidden_effects.poses.deflections import displacement as displacement_of
from hidden_effects.poses.deflections import moved as moved_of
from hidden_effects.poses.injector import Array, Hidden
from hidden_effects.poses.robots import UR10


def drawn(seed: int, postures: int = 25, loads: int = 2) -> tuple[Array, Array]:
    """Postures ``(g, 6)`` rad, each of several times, and forces ``(g, 3)`` N."""
    rng = np.random.default_rng(seed)
    q = np.repeat(rng.uniform(-2.0, 2.0, (postures, 6)), loads, axis=0)
    return q, rng.uniform(-120.0, 120.0, (len(q), 3))


def moved(hidden: Hidden, q: Array, force: Array) -> tuple[Array, Array]:
    """Frames ``(g, 4, 4)`` of the last link, unloaded and loaded."""
    return moved_of(UR10, hidden, q, force)


def displacement(hidden: Hidden, q: Array, force: Array) -> Array:
    """By how much the marker moves ``(g, 3)`` mm."""
    return displacement_of(UR10, hidden, q, force)


def compliant() -> Hidden:
    """Joints that are elastic about their own axes."""
    hidden = Hidden.nothing(6)
    hidden.own = np.array([1.0, 1.2, 1.5, 3.0, 4.0, 5.0]) * 1e-8
    return hidden
