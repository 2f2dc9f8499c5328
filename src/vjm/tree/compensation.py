"""Compensation of arms: the joint coordinates that put the loaded end where it should be, pose by pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array, rotation_from_vector
from vjm.tree.equilibria import equilibria, unloaded_frames
from vjm.tree.inverse_kinematics import ReachError, postures_of
from vjm.tree.model import Gravity, TreeModel

ITERATIONS = 60
EXACT = 1e-10
"""Of the machine's reach, or in rad: the last correction of the joints' frame."""
STEP = 1e-6
"""rad, or of the reach: of the differences that make the Jacobian."""
SMALL = 1e-4
"""Share of the loads, and of the springs' stress, under which the linear answer is measured: second-order terms are
that share of it."""
SINGULAR = 1e-6
"""Singular value over the largest below which the joints do not move the end."""


@dataclass(frozen=True)
class ArmCompensation:
    """What compensation does at g poses; each array has g rows.

    Attributes:
        joints: names of the n joints.
        q: ``(g, n)`` coordinates of the rigid arm, mm or rad.
        q_linear: of the linear model.
        q_loaded: of the loaded model.
        rigid: error ``(g, 6)`` of the loaded end under ``q``: shift and rotation vector, mm, rad, world axes.
        linear: under ``q_linear``.
        loaded: under ``q_loaded``: what no joint can put right. Where no rotation is asked for, turns are those
            from the rigid arm's end.
    """

    joints: tuple[str, ...]
    q: Array
    q_linear: Array
    q_loaded: Array
    rigid: Array
    linear: Array
    loaded: Array


def compensated_arm(
    model: TreeModel,
    positions: Array,
    rotations: Array | None,
    wrenches: Array,
    *,
    gravity: Gravity | None = None,
    start: Array | None = None,
    end: str = "",
) -> ArmCompensation:
    """Joint coordinates of a path of tool poses for the rigid, the linear and the loaded model.

    Args:
        model: the machine.
        positions: ``(g, 3)`` wanted, mm, world.
        rotations: ``(g, 3, 3)`` wanted; None where the end may turn as it likes.
        wrenches: ``(g, 6)`` dead on the end, N, N mm, world axes.
        gravity: m/s².
        start: coordinates ``(n,)`` near which the path begins; None for the posture of smallest coordinates.
        end: name of the end frame; the first where it is empty.

    Raises:
        ReachError: a pose is out of reach; the message says which.
        NoConvergenceError: under some load there is no stable equilibrium.
        ValueError: there is no such end frame.
    """
    if end and end not in model.ends:
        raise ValueError(f"{model.chain.name}: no end frame '{end}'; it has {', '.join(model.ends)}")
    index = model.ends.index(end) if end else 0
    q = _path(model, positions, rotations, start, end, index)
    wanted_R = unloaded_frames(model, q)[0][:, index] if rotations is None else rotations
    rows = np.ones(6, dtype=bool)
    rows[3:] = rotations is not None
    unit = np.repeat([1.0 / model.reach, 1.0], 3)

    def loaded_error(at: Array, share: float = 1.0) -> Array:
        wrench = np.zeros((len(at), len(model.ends), 6))
        wrench[:, index] = wrenches
        found = equilibria(model, at, gravity=gravity, wrench=wrench, compliance=False, share=share)
        good = found.found & found.stable
        if not good.all():
            raise NoConvergenceError(
                f"{model.chain.name}: no stable equilibrium at row {1 + int(np.argmin(good))} of the path"
            )
        return difference(found.position[:, index], found.rotation[:, index], positions, wanted_R)

    def corrected(at: Array, error: Array, J: Array) -> Array:
        move = np.einsum(
            "gij,gj->gi", np.linalg.pinv((J * unit[:, None])[:, rows], rcond=SINGULAR), (unit * error)[:, rows]
        )
        return at - move

    J = _jacobian(model, q, index)
    # the rigid arm's own error is rounding, so that what is left is the loads'
    q_linear = q
    sagged = loaded_error(q, SMALL) / SMALL
    for _ in range(ITERATIONS):
        R, p = unloaded_frames(model, q_linear)
        shown = difference(p[:, index], R[:, index], positions, wanted_R)
        after = corrected(q_linear, shown + sagged, _jacobian(model, q_linear, index))
        done = np.abs(after - q_linear).max() < EXACT
        q_linear = after
        if done:
            break
    q_loaded = q
    for _ in range(ITERATIONS):
        error = loaded_error(q_loaded)
        after = corrected(q_loaded, error, J)
        done = np.abs(after - q_loaded).max() < EXACT
        q_loaded = after
        if done:
            break
    else:
        raise NoConvergenceError(f"{model.chain.name}: the compensation does not settle in {ITERATIONS} steps")
    return ArmCompensation(
        model.joints, q, q_linear, q_loaded, loaded_error(q), loaded_error(q_linear), loaded_error(q_loaded)
    )


def difference(p: Array, R: Array, wanted_p: Array, wanted_R: Array) -> Array:
    """Errors ``(g, 6)`` of frames: shift, and rotation vector from the wanted ones, world axes."""
    A = R @ np.swapaxes(wanted_R, 1, 2)
    vector = 0.5 * np.stack([A[:, 2, 1] - A[:, 1, 2], A[:, 0, 2] - A[:, 2, 0], A[:, 1, 0] - A[:, 0, 1]], axis=1)
    sine = np.linalg.norm(vector, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(A, axis1=1, axis2=2) - 1.0))
    scale = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-300), 1.0)
    return np.hstack([p - wanted_p, scale[:, None] * vector])


def _jacobian(model: TreeModel, q: Array, index: int) -> Array:
    """Derivative ``(g, 6, n)`` of the unloaded end by the joints, by central differences."""
    parts = {part.name: part for part in model.chain.parts}
    steps = np.array(
        [STEP * (model.reach if getattr(parts[name], "slides", False) else 1.0) for name in model.joints]
    )
    columns = []
    for i, step in enumerate(steps):
        shift = step * np.eye(len(steps))[i]
        (R1, p1), (R0, p0) = (unloaded_frames(model, q + sign * shift) for sign in (1.0, -1.0))
        columns.append(difference(p1[:, index], R1[:, index], p0[:, index], R0[:, index]) / (2.0 * step))
    return np.stack(columns, axis=2)


def _path(
    model: TreeModel, positions: Array, rotations: Array | None, start: Array | None, end: str, index: int
) -> Array:
    """Rigid coordinates ``(g, n)``, each from those before it, so that the arm keeps its branch."""
    rows: list[Array] = []
    before = start
    for k, position in enumerate(positions):
        rotation = None if rotations is None else rotations[k]
        q = near(model, before, position, rotation, index) if before is not None else None
        if q is None:
            try:
                solutions = postures_of(model, position, rotation, end)
            except ReachError as error:
                raise ReachError(f"row {k + 1} of the path: {error}") from None
            q = solutions[0]
            if before is not None:
                distance = [float(np.abs(each - before).max()) for each in solutions]
                q = solutions[int(np.argmin(distance))]
        rows.append(q)
        before = q
    return np.array(rows)


def near(model: TreeModel, q: Array, position: Array, rotation: Array | None, index: int) -> Array | None:
    """A solution by Newton's method from coordinates ``(n,)``; None where that goes astray."""
    q = q[None].copy()
    unit = np.repeat([1.0 / model.reach, 1.0], 3)
    rows = np.ones(6, dtype=bool)
    rows[3:] = rotation is not None
    for _ in range(ITERATIONS):
        R, p = unloaded_frames(model, q)
        error = difference(
            p[:, index], R[:, index], position[None], R[:, index] if rotation is None else rotation[None]
        )
        if np.abs(unit * error)[0, rows].max() < EXACT:
            return np.asarray(q[0])
        J = _jacobian(model, q, index)[0] * unit[:, None]
        move = np.linalg.pinv(J[rows], rcond=SINGULAR) @ (unit * error[0])[rows]
        q[0] -= move * min(1.0, 0.3 / max(float(np.abs(move).max()), 1e-300))
    return None


def rotations_of(vectors: Array) -> Array:
    """Rotations ``(g, 3, 3)`` of rotation vectors ``(g, 3)``, rad."""
    return np.array([rotation_from_vector(vector) for vector in vectors]).reshape(-1, 3, 3)
