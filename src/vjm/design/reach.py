"""The reach of an arm: how far its tool comes from the origin of its base."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import Bounds, minimize

from vjm.machine.rigid_mechanism import RigidMechanism
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array
from vjm.tree.inverse_kinematics import ranges_of

STARTS = 8
"""Random postures from which the farthest one is looked for."""
TIGHT: Any = {"ftol": 1e-16, "gtol": 1e-12}
"""A distance is differenced by a machine's numbers: it is computed to rounding."""


def reach(machine: Machine) -> float:
    """The largest distance of the unloaded tool from the base's origin, within the joints' limits, mm.

    By a gradient method from some postures: a larger one may be missed, and joints that other joints drive are
    held to the limits of those alone.

    Args:
        machine: an arm or a tree, whose tool is its end-effector.

    Raises:
        ValueError: it has closed loops.

    Example:
        >>> import vjm
        >>> round(reach(vjm.load("planar-2r")), 6)
        900.0
    """
    if machine.closes:
        raise ValueError(f"{machine.name}: has closed loops: a reach is of an arm")
    rigid, ranges = RigidMechanism(machine), ranges_of(Mechanism(machine))
    bounds = Bounds(ranges.low, ranges.high)

    def at(q: Array) -> tuple[Array, Array]:
        _, _, frame, motion = rigid.linearised(q[None])
        return frame[0, :3, 3] / rigid.length, motion[0, :3] / rigid.unit

    def near(q: Array) -> float:
        place, _ = at(q)
        return -float(place @ place)

    def rate(q: Array) -> Array:
        place, motion = at(q)
        return -2.0 * (place @ motion)

    least = min(
        float(minimize(near, q, jac=rate, bounds=bounds, method="L-BFGS-B", options=TIGHT).fun)
        for q in ranges.random(STARTS, 0)
    )
    return float(rigid.length * np.sqrt(-least))
