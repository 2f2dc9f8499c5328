"""How a chain's motion, reactions and springs change with a parameter, at constant coordinates and wrench.

A parameter moves the rigid pieces between the joints, each by a small twist of its far end, and it changes the
springs' laws. The twists are constants of the chain, whatever its state. An axis that turns by δ is one that turns
with what is behind it, which turns back by δ. A spring whose law changes moves, at constant reactions, by
``∂θ/∂p``. Both are motions of the chain, and what they do to its end and to ``Jᵀ F`` is one sum. A motion before a
joint turns the joint's column of J as a whole, one behind it moves the end of its lever.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.kernels.compilation import entry
from vjm.model.mechanism import Mechanism
from vjm.model.springs import BeamColumnSpring, LawSpring, Spring
from vjm.rotations import Array, translation, turn


class Links(NamedTuple):
    """A lumped model's m joints and the m + 1 rigid pieces before, between and behind them.

    Attributes:
        rotary: ``(m,)`` whether a joint turns.
        axis: ``(m, 3)`` in its own frame.
        R: ``(m + 1, 3, 3)`` and
        p: ``(m + 1, 3)``, mm, the transform of each piece.
        coordinate: ``(m,)`` which coordinate drives a joint.
        factor: ``(m,)`` how much of it.
    """

    rotary: np.ndarray
    axis: Array
    R: Array
    p: Array
    coordinate: np.ndarray
    factor: Array


class Placed(NamedTuple):
    """The links at one state.

    Attributes:
        R: ``(m + 1, 3, 3)`` and
        p: ``(m + 1, 3)`` the frames at the far ends of the pieces, the end-effector's last; world, mm.
        screws: ``(m, 6)`` linear and angular velocity of the end-effector by the joints' velocities.
    """

    R: Array
    p: Array
    screws: Array

    @property
    def end(self) -> Array:
        """Frame ``(4, 4)`` of the end-effector."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.R[-1], self.p[-1]
        return T


def links_of(model: Mechanism) -> Links:
    """The joints that deflect, and the pieces between them: other joints stand where they are commanded to."""
    driven = model.drive.coordinate >= 0
    pieces, T = [], np.eye(4)
    for before, axis, rotary, value, deflects in zip(
        model.before, model.axis, model.joint_rotary, model.command, driven, strict=True
    ):
        T = T @ before @ (turn(axis, value) if rotary else translation(axis * value))
        if deflects:
            pieces.append(T)
            T = np.eye(4)
    all_pieces = np.array([*pieces, T @ model.tail])
    return Links(
        model.joint_rotary[driven],
        np.ascontiguousarray(model.axis[driven]),
        np.ascontiguousarray(all_pieces[:, :3, :3]),
        np.ascontiguousarray(all_pieces[:, :3, 3]),
        model.drive.coordinate[driven],
        model.drive.factor[driven],
    )


def place(links: Links, x: Array) -> Placed:
    """The links at the coordinates ``x`` (n,), mm and rad."""
    m = len(links.rotary)
    placed = Placed(np.empty((m + 1, 3, 3)), np.empty((m + 1, 3)), np.empty((m, 6)))
    _place(*links, x, *placed)
    return placed


def reactions(links: Links, placed: Placed, wrench: Array, size: int) -> Array:
    """``Jᵀ F`` ``(n,)`` of a wrench ``(6,)`` on the ``size`` coordinates."""
    weights = links.factor * (placed.screws @ wrench)
    result: Array = np.bincount(links.coordinate, weights, size).astype(float, copy=False)
    return result


def changes(links: Links, placed: Placed, wrench: Array, twists: Array, rates: Array) -> tuple[Array, Array]:
    """What motions of the chain do to the reactions and to the end-effector, at constant wrench.

    Args:
        links: the chain.
        placed: its state.
        wrench: ``(6,)``, N, N mm.
        twists: ``(k, m + 1, 6)`` of the pieces' far ends in their own axes, for each of k motions.
        rates: ``(k, n)`` of the coordinates.

    Returns:
        Changes of ``Jᵀ F`` ``(k, n)``, and of the end-effector's pose ``(k, 6)``.
    """
    load, end = np.zeros_like(rates), np.empty((len(rates), 6))
    _changes(links.rotary, links.coordinate, links.factor, *placed, wrench, twists, rates, load, end)
    return load, end


def twists_between(less: Links, more: Links, at: Links, width: float) -> Array:
    """Twists ``(m + 1, 6)`` of the pieces' far ends, in their own axes, per unit of a parameter.

    Args:
        less: links at the lower value.
        more: and at the higher one.
        at: and between the two.
        width: difference of the two values.
    """
    spin = at.R.transpose(0, 2, 1) @ (more.R - less.R) / width
    turn = 0.5 * np.stack([spin[:, k, j] - spin[:, j, k] for j, k in ((1, 2), (2, 0), (0, 1))], axis=1)
    shift = np.einsum("jba,jb->ja", at.R, more.p - less.p) / width
    back = np.cross(at.axis, (more.axis - less.axis) / width)
    turn[:-1] += back
    turn[1:] -= np.einsum("jba,jb->ja", at.R[1:], back)
    shift[1:] -= np.einsum("jba,jb->ja", at.R[1:], np.cross(back, at.p[1:]))
    return np.hstack([shift, turn])


class Laws:
    """How the springs' laws change between two values of a parameter."""

    def __init__(self, less: Mechanism, more: Mechanism, width: float) -> None:
        # the segments of a beam have one law: they are evaluated together
        alike: dict[object, tuple[Spring, Spring, list[slice]]] = {}
        for (a, place), (b, _) in zip(less.blocks, more.blocks, strict=True):
            if not _same_law(a, b):
                key = (a, b) if isinstance(a, BeamColumnSpring) else id(a)
                alike.setdefault(key, (a, b, []))[2].append(place)
        self._width = width
        self._changed = [
            (a, b, np.array([np.arange(place.start, place.stop) for place in places]))
            for a, b, places in alike.values()
        ]

    def strains(self, reactions: Array) -> Array:
        """``∂θ/∂p`` ``(k, n)`` at constant reactions ``(k, n)``, in k states at once."""
        result = np.zeros_like(reactions)
        for a, b, index in self._changed:
            tau = reactions[:, index].reshape(-1, index.shape[1]).T
            change = (b.strain(tau) - a.strain(tau)) / self._width
            result[:, index] = change.T.reshape(len(reactions), *index.shape)
        return result


def _same_law(a: Spring, b: Spring) -> bool:
    """Whether two springs of one kind have one law."""
    if isinstance(a, BeamColumnSpring):
        return a == b
    if isinstance(a, LawSpring) or isinstance(b, LawSpring):
        return a == b
    return np.array_equal(a.unloaded, b.unloaded)


@entry
def _place(
    rotary: np.ndarray,
    axis: Array,
    R0: Array,
    p0: Array,
    coordinate: np.ndarray,
    factor: Array,
    x: Array,
    R_out: Array,
    p_out: Array,
    screws: Array,
) -> None:
    """Kinematics (1), (2) of the joints in a row."""
    m = len(rotary)
    R, p, w, u = np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3)
    for j in range(m + 1):
        for a in range(3):
            p[a] += R[a, 0] * p0[j, 0] + R[a, 1] * p0[j, 1] + R[a, 2] * p0[j, 2]
        for a in range(3):
            u[0], u[1], u[2] = R[a, 0], R[a, 1], R[a, 2]
            for b in range(3):
                R[a, b] = u[0] * R0[j, 0, b] + u[1] * R0[j, 1, b] + u[2] * R0[j, 2, b]
        for a in range(3):
            p_out[j, a] = p[a]
            for b in range(3):
                R_out[j, a, b] = R[a, b]
        if j == m:
            break
        for a in range(3):
            w[a] = R[a, 0] * axis[j, 0] + R[a, 1] * axis[j, 1] + R[a, 2] * axis[j, 2]
            screws[j, a] = w[a]
            screws[j, 3 + a] = w[a] if rotary[j] else 0.0
        value = factor[j] * x[coordinate[j]]
        if not rotary[j]:
            for a in range(3):
                p[a] += value * w[a]
            continue
        # each column of R by Rodrigues' formula
        c, s = np.cos(value), np.sin(value)
        for b in range(3):
            u[0], u[1], u[2] = R[0, b], R[1, b], R[2, b]
            d = (1.0 - c) * (w[0] * u[0] + w[1] * u[1] + w[2] * u[2])
            for a in range(3):
                k, q = (a + 1) % 3, (a + 2) % 3
                R[a, b] = c * u[a] + s * (w[k] * u[q] - w[q] * u[k]) + d * w[a]
    for j in range(m):
        if rotary[j]:
            for a in range(3):
                k, q = (a + 1) % 3, (a + 2) % 3
                screws[j, a] = screws[j, 3 + k] * (p[q] - p_out[j, q]) - screws[j, 3 + q] * (p[k] - p_out[j, k])


@entry
def _changes(
    rotary: np.ndarray,
    coordinate: np.ndarray,
    factor: Array,
    R: Array,
    p: Array,
    screws: Array,
    wrench: Array,
    twists: Array,
    rates: Array,
    load: Array,
    end: Array,
) -> None:
    """Write the changes of the reactions ``load`` (k, n) and of the pose ``end`` (k, 6), see `changes`."""
    m = len(rotary)
    # the change of J_j · F by a turn of its column, and by a shift of its lever's end
    turned, levered, upto, t = np.zeros((m, 3)), np.zeros((m, 3)), np.zeros((m, 6)), np.zeros(6)
    for j in range(m):
        for a in range(3):
            k, q = (a + 1) % 3, (a + 2) % 3
            turned[j, a] = screws[j, k] * wrench[q] - screws[j, q] * wrench[k]
            turned[j, a] += screws[j, 3 + k] * wrench[3 + q] - screws[j, 3 + q] * wrench[3 + k]
            levered[j, a] = wrench[k] * screws[j, 3 + q] - wrench[q] * screws[j, 3 + k]
    for i in range(len(rates)):
        total = end[i]
        total[:] = 0.0
        for j in range(m + 1):
            moves = False
            for a in range(6):
                moves = moves or twists[i, j, a] != 0.0
            if moves:
                for a in range(3):
                    t[a] = t[3 + a] = 0.0
                    for b in range(3):
                        t[a] += R[j, a, b] * twists[i, j, b]
                        t[3 + a] += R[j, a, b] * twists[i, j, 3 + b]
                for a in range(3):
                    k, q = (a + 1) % 3, (a + 2) % 3
                    total[a] += t[a] + t[3 + k] * (p[m, q] - p[j, q]) - t[3 + q] * (p[m, k] - p[j, k])
                    total[3 + a] += t[3 + a]
            if j < m:
                for a in range(6):
                    upto[j, a] = total[a]
                rate = factor[j] * rates[i, coordinate[j]]
                if rate != 0.0:
                    for a in range(6):
                        total[a] += rate * screws[j, a]
        for j in range(m):
            tau = 0.0
            for a in range(3):
                tau += turned[j, a] * upto[j, 3 + a] + levered[j, a] * (total[a] - upto[j, a])
            load[i, coordinate[j]] += factor[j] * tau
