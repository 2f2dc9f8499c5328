"""First guesses of the tracker's frame and of the markers' places, from nothing but postures and positions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.io.fields import rotation
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.poses.forward import Frames
from vjm_updating.poses.sheet import BaseGuess

ROUNDS = numerical(200)
SETTLED = numerical(1e-6, "mm")
"""mm: change of the mean error below which the alternation has settled."""


def kabsch(p: Array, y: Array) -> tuple[Array, Array]:
    """Rotation ``(3, 3)`` and shift ``(3,)`` that take points ``p`` (n, 3) to ``y`` (n, 3) in least squares.

    Kabsch, Acta Crystallographica A 32, 922, 1976.
    """
    a, b = p.mean(axis=0), y.mean(axis=0)
    U, _, Vt = np.linalg.svd((p - a).T @ (y - b))
    D = np.diag([1.0, 1.0, np.sign(np.linalg.det(Vt.T @ U.T))])
    R = Vt.T @ D @ U.T
    return R, b - R @ a


def with_tilts(frames: Frames, R: Array, tilt: Array, gravity: Sequence[float]) -> Frames:
    """Frames with those of the inclinometers on their bodies, from what they read on a rigid robot.

    Each axis m of an instrument reads ``asin(u · R m)``: linear least squares for its direction, both made
    perpendicular. One that was read in too few directions stays as the sheet's marker is.

    Args:
        frames: of all markers.
        R: ``(g, k, 3, 3)`` end frames in the base.
        tilt: ``(g, k, 2)`` rad, nan where not read.
        gravity: ``(3,)``.
    """
    if not np.isfinite(tilt).any():
        return frames
    u = -np.array(gravity) / np.linalg.norm(gravity)
    M = frames.M.copy()
    for j in np.flatnonzero(np.isfinite(tilt).any(axis=(0, 2))):
        axes = []
        for k in range(2):
            own = np.isfinite(tilt[:, j, k])
            A = np.swapaxes(R[own, j], 1, 2) @ u
            if own.sum() < 3 or np.linalg.matrix_rank(A, tol=1e-2 * np.sqrt(own.sum())) < 3:
                axes.append(np.full(3, np.nan))
                continue
            axis = np.linalg.lstsq(A, np.sin(tilt[own, j, k]), rcond=None)[0]
            axes.append(axis / np.linalg.norm(axis))
        x, y = axes
        if np.isnan(x).all() and np.isnan(y).all():
            continue
        if np.isnan(x).all():
            x = np.cross(y, np.eye(3)[int(np.argmin(np.abs(y)))])
        if np.isnan(y).all():
            y = np.cross(np.eye(3)[int(np.argmin(np.abs(x)))], x)
        U, _, Vt = np.linalg.svd(np.column_stack([x, y]), full_matrices=False)
        first, second = (U @ Vt).T
        M[j] = np.column_stack([first, second, np.cross(first, second)])
    return Frames(frames.R, frames.t, frames.m, M)


def align(
    R: Array, p: Array, position: Array, orientation: Array, prior: Array, guess: BaseGuess | None
) -> tuple[Frames, Array]:
    """Frames that bring a rigid robot's end frames to the positions, and the distances ``(g, k)`` left, mm.

    Args:
        R: ``(g, k, 3, 3)`` and
        p: ``(g, k, 3)`` end frames in the base.
        position: ``(g, k, 3)`` as tracked, nan where not seen.
        orientation: ``(g, k, 3, 3)``, nan where not tracked.
        prior: ``(k,)`` mm, how well the markers' places are known.
        guess: of the base in the tracker's frame; None: from the data.
    """
    k = p.shape[1]
    whole = np.asarray(np.isfinite(position).all(axis=2))
    m, seen = np.zeros((k, 3)), np.flatnonzero(whole.reshape(-1))
    Q, t = np.eye(3), np.zeros(3)
    if guess is not None:
        Q, t = rotation(guess.turns), np.array(guess.position_mm, dtype=float)
    elif len(seen) >= 3:
        last = np.inf
        for _ in range(ROUNDS):
            place = p + np.einsum("gkab,kb->gka", R, m)
            Q, t = kabsch(place.reshape(-1, 3)[seen], position.reshape(-1, 3)[seen])
            error = (position - t) @ Q - p
            for j in range(k):
                own = whole[:, j]
                spread = (
                    float(np.mean(np.sum((error[own, j] - R[own, j] @ m[j]) ** 2, axis=1))) if own.any() else 1.0
                )
                body = np.einsum("gba,gb->a", R[own, j], error[own, j])
                m[j] = body / (own.sum() + spread / prior[j] ** 2) if own.any() else 0.0
            left = float(np.mean(np.linalg.norm(error - np.einsum("gkab,kb->gka", R, m), axis=2)[whole]))
            if abs(last - left) < SETTLED:
                break
            last = left
    M = np.tile(np.eye(3), (k, 1, 1))
    for j in range(k):
        own = np.asarray(np.isfinite(orientation[:, j]).all(axis=(1, 2)))
        if own.any():
            if guess is None and not whole[:, j].any():
                continue
            U, _, Vt = np.linalg.svd(np.einsum("gba,gbc->ac", Q @ R[own, j], orientation[own, j]))
            M[j] = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    seen_at = (p + np.einsum("gkab,kb->gka", R, m)) @ Q.T + t
    distance = np.sqrt(np.nansum((position - seen_at) ** 2, axis=2))
    distance[~np.isfinite(position).any(axis=2)] = np.nan
    return Frames(Q, t, m, M), distance
