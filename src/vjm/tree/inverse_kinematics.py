"""Postures of a machine that put an end frame where it is wanted, without load."""

from __future__ import annotations

import numpy as np

from vjm.model.joints import HeldJoint
from vjm.model.parts import PassiveJoint
from vjm.rotations import Array
from vjm.tree.equilibria import unloaded_frames
from vjm.tree.model import TreeModel

STARTS = 128
"""Random postures from which a solution is looked for: a 6R arm has up to 16."""
ITERATIONS = 100
FOUND = 1e-9
"""Of the machine's reach and in rad: what is left of the pose at a solution."""
STEP = 1e-6
"""rad, or of the reach: step of the differences that make the Jacobian."""
LARGEST_MOVE = 0.4
"""rad, or of the reach, in one iteration."""
ALIKE = 1e-5
"""rad, or of the reach, up to which two solutions are one."""
MOST = 16
"""Solutions that are listed; a machine of more joints than the pose has conditions has endless ones."""


class ReachError(ValueError):
    """No posture puts the end frame there; the message says how near the nearest comes."""


def postures_of(
    model: TreeModel, position: Array, rotation: Array | None = None, end: str = "", seed: int = 0
) -> list[Array]:
    """Joint coordinates that put an end frame at a pose, by damped least squares from many random postures.

    Args:
        model: the machine.
        position: ``(3,)`` wanted, mm, world.
        rotation: ``(3, 3)`` wanted; None where the end may turn as it likes.
        end: name of the end frame; the first where it is empty.
        seed: of the random postures.

    Returns:
        Up to `MOST` solutions ``(n_joints,)``, those of the smallest coordinates first.

    Raises:
        ReachError: none was found; with the distance of the nearest.
        ValueError: there is no such end frame.
    """
    if end and end not in model.ends:
        raise ValueError(f"{model.chain.name}: no end frame '{end}'; it has {', '.join(model.ends)}")
    index = model.ends.index(end) if end else 0
    low, high, unit, turns = _ranges(model)
    q = low + (high - low) * np.random.default_rng(seed).random((STARTS, len(low)))
    q[0] = np.clip(0.0, low, high)
    lost = _missing(model, q, position, rotation, index)
    best, best_lost = q.copy(), lost.copy()
    for _ in range(ITERATIONS):
        size = np.linalg.norm(lost, axis=1)
        if np.all(size < 0.01 * FOUND):
            break
        J = _jacobian(model, q, unit, position, rotation, index)
        # damped by what is left: Newton's steps near a solution, short ones near a singular posture
        damping = (1e-3 * size**2)[:, None, None] * np.eye(J.shape[1])
        gram = J @ J.swapaxes(1, 2) + damping + 1e-14 * np.eye(J.shape[1])
        move = np.einsum("sij,si->sj", J, np.linalg.solve(gram, lost[:, :, None])[:, :, 0])
        move *= np.minimum(1.0, LARGEST_MOVE / np.maximum(np.abs(move).max(axis=1), 1e-300))[:, None]
        q = np.clip(q + move * unit, low, high)
        lost = _missing(model, q, position, rotation, index)
        nearer = np.linalg.norm(lost, axis=1) < np.linalg.norm(best_lost, axis=1)
        best[nearer], best_lost[nearer] = q[nearer], lost[nearer]
    good = np.linalg.norm(best_lost, axis=1) < FOUND
    if not good.any():
        raise ReachError(_far(model, best_lost))
    return _distinct(best[good], unit, turns, low, high)


def _ranges(model: TreeModel) -> tuple[Array, Array, Array, np.ndarray]:
    """Lower and upper limits of the joints, a unit of each, and which of them turn; ``(n_joints,)``."""
    parts = {part.name: part for part in model.chain.parts}
    low, high, unit, turns = [], [], [], []
    for name in model.joints:
        part = parts[name]
        assert isinstance(part, HeldJoint | PassiveJoint)
        own = part.limits if isinstance(part, HeldJoint) else None
        reach = model.reach if part.slides else np.pi
        low.append(own[0] if own is not None else -reach)
        high.append(own[1] if own is not None else reach)
        unit.append(model.reach if part.slides else 1.0)
        turns.append(not part.slides)
    return np.array(low), np.array(high), np.array(unit), np.array(turns, dtype=bool)


def _missing(model: TreeModel, q: Array, position: Array, rotation: Array | None, index: int) -> Array:
    """What is left to the pose ``(s, 3 or 6)``: shift over the reach, and rotation vector."""
    R, p = unloaded_frames(model, q)
    shift = (np.asarray(position, dtype=float) - p[:, index]) / model.reach
    if rotation is None:
        return shift
    A = rotation @ R[:, index].swapaxes(1, 2)
    vector = 0.5 * np.stack([A[:, 2, 1] - A[:, 1, 2], A[:, 0, 2] - A[:, 2, 0], A[:, 1, 0] - A[:, 0, 1]], axis=1)
    sine = np.linalg.norm(vector, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(A, axis1=1, axis2=2) - 1.0))
    # at half a turn any axis is a way out
    vector = np.where((sine > 1e-9)[:, None], vector * (angle / np.maximum(sine, 1e-300))[:, None], vector)
    return np.hstack([shift, vector])


def _jacobian(
    model: TreeModel, q: Array, unit: Array, position: Array, rotation: Array | None, index: int
) -> Array:
    """Derivative ``(s, 3 or 6, n)`` of the pose by the joints in their units, by central differences."""
    s, n = q.shape
    shifts = STEP * np.diag(unit)
    rows = np.concatenate([q[:, None] + shifts, q[:, None] - shifts], axis=1).reshape(-1, n)
    lost = _missing(model, rows, position, rotation, index).reshape(s, 2, n, -1)
    result: Array = ((lost[:, 1] - lost[:, 0]) / (2.0 * STEP)).swapaxes(1, 2)
    return result


def _far(model: TreeModel, lost: Array) -> str:
    nearest = lost[np.argmin(np.linalg.norm(lost, axis=1))]
    text = f"{np.linalg.norm(nearest[:3]) * model.reach:.4g} mm"
    if len(nearest) > 3:
        text += f" and {np.degrees(np.linalg.norm(nearest[3:])):.4g} degrees"
    return (
        f"{model.chain.name}: out of reach: the nearest posture within the joints' limits misses the pose by {text}"
    )


def _distinct(q: Array, unit: Array, turns: np.ndarray, low: Array, high: Array) -> list[Array]:
    """Different solutions; what turns is brought to ±π where its limits allow it."""
    wrapped = np.where(turns, q - 2.0 * np.pi * np.round(q / (2.0 * np.pi)), q)
    q = np.where((wrapped >= low) & (wrapped <= high), wrapped, q)
    found: list[Array] = []
    for row in q[np.argsort(np.abs(q / unit).max(axis=1))]:
        if all(np.abs((row - other) / unit).max() > ALIKE for other in found):
            found.append(row)
        if len(found) == MOST:
            break
    return found
