"""The truth: a robot that rests where its energy is smallest, with causes hidden in it.

Frames are products of 4×4 matrices; the energy is that of springs and weights, its gradient a central difference.
It is minimised by descent in the springs' metric, ``θ ← θ − C ∇E``. Nothing of the finder's kinematics, statics
or families is used.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hidden_effects.poses.robots import Robot

Array = NDArray[np.float64]
STEP = 1e-5
"""rad, of the differences: their error is below 1e-9 of the torques."""
ROUNDS = 40
SETTLED = 1e-9
"""rad: change of the deflections at which the energy is smallest."""


@dataclass
class Hidden:
    """What is hidden in a robot of n joints; zero where nothing is.

    Attributes:
        offset: ``(n,)`` rad.
        shift: ``(n, 3)`` mm and
        tilt: ``(n, 2)`` rad, errors of the frame before each joint.
        own: ``(n,)`` and
        across: ``(n, 2)`` and
        base: ``(3,)`` compliances, rad/(N mm).
        wave: ``(n, 4)`` rad: sine and cosine of the joint's angle, and of twice it.
        scale: ``(n,)`` of the encoder.
        backlash: ``(n,)`` rad, by the sign of the way by which the joint came.
        drift: ``(3,)`` mm over the test.
        slip: joint, share of the test, rad: a belt jumps teeth.
        crack: joint, rad/(N mm): it gives way for torques of one sign only.
        flipped: joints whose encoders count backwards.
        rubber: rad/(N mm) and mm³-like factor: a foot whose compliance grows with the square of its torque.
    """

    offset: Array
    shift: Array
    tilt: Array
    own: Array
    across: Array
    base: Array
    wave: Array
    scale: Array
    backlash: Array
    drift: Array
    slip: tuple[int, float, float] | None = None
    crack: tuple[int, float] | None = None
    flipped: tuple[int, ...] = ()
    rubber: tuple[float, float] | None = None
    names: tuple[str, ...] = field(default=())

    @classmethod
    def nothing(cls, n: int) -> Hidden:
        """No cause."""
        return cls(
            np.zeros(n), np.zeros((n, 3)), np.zeros((n, 2)), np.zeros(n), np.zeros((n, 2)), np.zeros(3),
            np.zeros((n, 4)), np.zeros(n), np.zeros(n), np.zeros(3),
        )  # fmt: skip


def _turn(axis: int, angle: Array) -> Array:
    """Matrices ``(g, 4, 4)``."""
    T = np.tile(np.eye(4), (len(angle), 1, 1))
    a, b = (axis + 1) % 3, (axis + 2) % 3
    T[:, a, a] = T[:, b, b] = np.cos(angle)
    T[:, b, a] = np.sin(angle)
    T[:, a, b] = -T[:, b, a]
    return T


def _moved(x: float, y: float, z: float) -> Array:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def _fixed(axis: int, angle: float) -> Array:
    return _turn(axis, np.array([angle]))[0]


def frames(robot: Robot, hidden: Hidden, q: Array, theta: Array) -> tuple[Array, Array]:
    """End frames ``(g, 4, 4)`` and the potential of the weights ``(g,)`` N mm at deflections ``(g, 3 + 3 n)``."""
    g = len(q)
    T = np.tile(np.eye(4), (g, 1, 1))
    for k in range(3):
        T = T @ _turn(k, theta[:, k])
    weight = -np.array([*robot.gravity, 0.0])
    energy = np.zeros(g)
    for i, (d, a, alpha) in enumerate(robot.rows):
        T = T @ _moved(*hidden.shift[i]) @ _fixed(0, hidden.tilt[i, 0]) @ _fixed(1, hidden.tilt[i, 1])
        own = theta[:, 3 + 3 * i : 6 + 3 * i]
        T = T @ _turn(2, q[:, i]) @ _turn(0, own[:, 0]) @ _turn(1, own[:, 1]) @ _turn(2, own[:, 2])
        centre = T @ np.array([*robot.centres[i], 1.0])
        energy += robot.masses[i] * (centre @ weight)
        T = T @ _moved(a, 0.0, d) @ _fixed(0, alpha)
    energy += robot.payload * (T[:, :, 3] @ weight)
    return T, energy


@dataclass(frozen=True)
class Push:
    """Forces ``(g, 3)`` N, base's axes, at a point ``(3,)`` mm of the last link."""

    force: Array
    point: Array


def rest(robot: Robot, hidden: Hidden, q: Array, push: Push | None = None) -> Array:
    """End frames ``(g, 4, 4)`` where the energy is smallest."""

    def potential(theta: Array) -> Array:
        T, energy = frames(robot, hidden, q, theta)
        if push is None:
            return energy
        return energy - np.einsum("ga,ga->g", push.force, (T @ np.array([*push.point, 1.0]))[:, :3])

    g, n = q.shape
    theta = np.zeros((g, 3 + 3 * n))
    C = np.zeros(3 + 3 * n)
    C[:3] = hidden.base
    for i in range(n):
        C[3 + 3 * i : 5 + 3 * i] = hidden.across[i]
        C[5 + 3 * i] = hidden.own[i]
    live = [int(k) for k in np.flatnonzero(C)]
    if hidden.rubber is not None:
        live += [k for k in (0, 1, 2) if k not in live]
    if hidden.crack is not None and 5 + 3 * hidden.crack[0] not in live:
        live.append(5 + 3 * hidden.crack[0])
    for _ in range(ROUNDS):
        new = np.zeros_like(theta)
        for k in live:
            plus, minus = theta.copy(), theta.copy()
            plus[:, k] += STEP
            minus[:, k] -= STEP
            torque = -(potential(plus) - potential(minus)) / (2.0 * STEP)
            new[:, k] = C[k] * torque
            if hidden.rubber is not None and k < 3:
                c, size = hidden.rubber
                new[:, k] += c * torque * (torque / size) ** 2
            if hidden.crack is not None and k == 5 + 3 * hidden.crack[0]:
                new[:, k] += hidden.crack[1] * np.maximum(torque, 0.0)
        change = float(np.abs(new - theta).max(initial=0.0))
        theta = new
        if change < SETTLED:
            break
    else:
        raise ArithmeticError("the energy has no minimum near the unloaded posture")
    return frames(robot, hidden, q, theta)[0]


def measure(robot: Robot, hidden: Hidden, commanded: Array, noise: float, rng: np.random.Generator) -> Array:
    """Positions ``(g, 3)`` mm of the target in the tracker's frame, as read."""
    g = len(commanded)
    q = commanded.copy()
    for i in hidden.flipped:
        q[:, i] *= -1.0
    waves = np.stack([np.sin(q), np.cos(q), np.sin(2 * q), np.cos(2 * q)], axis=2)
    way = np.sign(np.diff(commanded, axis=0, prepend=commanded[:1]))
    q = (
        q * (1.0 + hidden.scale)
        + hidden.offset
        + np.einsum("gnw,nw->gn", waves, hidden.wave)
        + way * hidden.backlash
    )
    if hidden.slip is not None:
        joint, share, size = hidden.slip
        q[int(share * g) :, joint] += size
    T = rest(robot, hidden, q)
    target = T @ np.array([40.0, -25.0, 60.0, 1.0])
    angle = np.array([0.3, -0.2, 1.1])
    view: Any = _fixed(0, angle[0]) @ _fixed(1, angle[1]) @ _fixed(2, angle[2])
    seen = target[:, :3] @ view[:3, :3].T + np.array([900.0, -2000.0, 400.0])
    course = (np.arange(g) / (g - 1) - 0.5)[:, None]
    result: Array = seen + course * hidden.drift + rng.normal(0.0, noise, (g, 3))
    return result
