"""Joint coordinates that put a loaded tool where it should be, along a path, for machines of any kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vjm.loaded_stiffness import held_by_itself
from vjm.machine.closing import Closing, home_label
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.postures import Posture, in_posture
from vjm.rotations import Array, displaced, rotation_vector, rotations_from_vectors
from vjm.tree.compensation import Compensation, compensated_arm
from vjm.vjm_engine import VjmEngine


def compensate(
    machine: Machine,
    positions: Sequence[Sequence[float]] | Array,
    turns: Sequence[Sequence[float]] | Array | None = None,
    wrenches: Sequence[Sequence[float]] | Array | None = None,
    *,
    gravity: Gravity | None = None,
    posture: Posture = "",
    end: str = "",
    engine: VjmEngine | None = None,
) -> Compensation:
    """The coordinates of the driven joints along a path, by the rigid, the linear and the loaded model.

    Args:
        machine: of any kind; of one with poses the path counts from home.
        positions: ``(g, 3)`` of the end, mm, in the world.
        turns: rotation vectors ``(g, 3)`` rad; None where the end may turn as it likes.
        wrenches: ``(g, 6)`` on the end, N and N mm; nothing if left out.
        gravity: m/s².
        posture: near which the path begins; any if left out.
        end: name of the end frame; the first if left out.
        engine: how beams become springs; as `vjm` if left out.

    Raises:
        ValueError: arrays of another shape, a pose is out of reach, or the machine cannot be compensated.
        NoConvergenceError: there is no stable equilibrium somewhere.

    Example:
        >>> import vjm
        >>> found = vjm.compensate(vjm.load("planar-2r"), [(600, 300, 0)], wrenches=[(0, -50, 0, 0, 0, 0)])
        >>> [f"{name} leaves {left:.3f} mm" for name, left in found.largest_mm.items()]
        ['rigid leaves 12.085 mm', 'linear leaves 0.109 mm', 'loaded leaves 0.000 mm']
    """
    if not held_by_itself(machine):
        raise ValueError(
            f"{machine.name}: its passive joints leave the end a mechanism: give the whole machine instead"
        )
    p = _rows("positions", positions, 3)
    R = None if turns is None else _rows("turns", turns, 3, len(p))
    W = np.zeros((len(p), 6)) if wrenches is None else _rows("wrenches", wrenches, 6, len(p))
    label = ""
    if posture:
        machine, label = in_posture(machine, posture)
    if machine.poses:
        p, R = _from_home(machine, p, R)
    model = (engine or VjmEngine(*machine.usual_segments)).model(machine)
    found = compensated_arm(
        model, p, None if R is None else rotations_from_vectors(R), W, gravity=gravity,
        start=model.posture(label) if label else None, end=end,
    )  # fmt: skip
    driven = {part.name for part in machine.held_joints}
    shown = [k for k, name in enumerate(found.joints) if name in driven]
    return replace(
        found,
        joints=tuple(found.joints[k] for k in shown),
        q=found.q[:, shown],
        q_linear=found.q_linear[:, shown],
        q_loaded=found.q_loaded[:, shown],
    )


def _rows(name: str, rows: Sequence[Sequence[float]] | Array, columns: int, count: int | None = None) -> Array:
    """Rows of finite numbers.

    Raises:
        ValueError: they are none, or others.
    """
    try:
        found = np.array(rows, dtype=float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    wanted = ("g" if count is None else count, columns)
    if found.ndim != 2 or found.shape[1] != columns or count not in (None, len(found)) or not len(found):
        raise ValueError(f"{name} must have the shape ({wanted[0]}, {wanted[1]}), one row a pose")
    if not np.all(np.isfinite(found)):
        raise ValueError(f"{name} must be finite numbers")
    return found


def _from_home(machine: Machine, positions: Array, turns: Array | None) -> tuple[Array, Array | None]:
    """The path in the world, whose poses count from home."""
    home = Closing(machine, home_label(machine)).end
    vectors = np.zeros_like(positions) if turns is None else turns
    frames = np.array([displaced(home, pose) for pose in np.hstack([positions, vectors])])
    # what cannot keep its direction turns as its loops let it
    keeps = turns is not None or len(machine.held_joints) >= 6
    return frames[:, :3, 3], np.array([rotation_vector(T[:3, :3]) for T in frames]) if keeps else None
