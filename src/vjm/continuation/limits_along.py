"""Limits of joints along a path: where the load leads one beyond its own, passive and coupled joints too."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vjm.continuation.path import Path, driven_force
from vjm.model.joint_limits import ROUNDING, joint_limits
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array


@dataclass(frozen=True)
class LimitPassed:
    """A joint that a path leads beyond its limit.

    Attributes:
        joint: name.
        limit: that it passes first, mm or rad.
        farthest: its coordinate that is farthest beyond, mm or rad.
        unit: ``mm`` or ``rad``.
        ramp: of the path where it stands at the limit, between two points of the path by a straight line.
        force: driven force or load factor there.
        path: that passes it.
    """

    joint: str
    limit: float
    farthest: float
    unit: str
    ramp: float
    force: float
    path: Path

    @property
    def words(self) -> str:
        """In words."""
        driven = self.path.load_case.driven
        place = driven.said(self.force)
        if not self.path.load_case.load_driven:
            place = f"a displacement of {self.ramp:.5g} {driven.along} and {place}"
        return (
            f"joint '{self.joint}' reaches its limit {self.limit:.6g} {self.unit} at {place}, and goes on to "
            f"{self.farthest:.6g} {self.unit}: what is beyond is not reached by this machine"
        )


def limits_passed(model: Mechanism, path: Path) -> list[LimitPassed]:
    """The joints that a path leads beyond their limits, in the order of the path.

    Args:
        model: in the posture of the path, whose coordinates its states are.
        path: of an engine that has this model.
    """
    limits = joint_limits(model.chain)
    values = _coordinates(model, path, limits.given)
    beyond, joint_values = limits.excess(values), limits.joint_values(values)
    passed = []
    for k, name in enumerate(limits.names):
        over = np.flatnonzero(beyond[:, k] > ROUNDING * max(1.0, float(np.abs(joint_values[:, k]).max())))
        if len(over) and over[0] > 0:
            n = int(over[0])
            share = float(-beyond[n - 1, k] / (beyond[n, k] - beyond[n - 1, k]))
            ramp, force = (
                float(row[n - 1] + share * (row[n] - row[n - 1]))
                for row in (path.ramp, np.array([driven_force(path.load_case, p) for p in path.points]))
            )
            high = bool(joint_values[n, k] > limits.high[k])
            farthest = int(np.argmax(beyond[:, k]))
            limit = float(limits.high[k] if high else limits.low[k])
            passed.append(
                (n, LimitPassed(name, limit, float(joint_values[farthest, k]), limits.units[k], ramp, force, path))
            )
    return [one for _, one in sorted(passed, key=lambda pair: pair[0])]


def _coordinates(model: Mechanism, path: Path, given: tuple[str, ...]) -> Array:
    """Coordinates ``(g, n)`` of the given joints at the points of a path: of held ones with what they yield by."""
    states = np.array([point.state for point in path.points])
    held, free = model.chain.held.get(path.load_case.posture, {}), {joint.name for joint in model.chain.joints}

    def columns() -> Iterator[Array]:
        for name in given:
            own = model.span(name)
            if name in free:
                yield states[:, own[0]]
            else:
                # bearings beside it turn about other axes
                yielding = states[:, own[0]] if len(own) == 1 else np.zeros(len(states))
                yield held.get(name, 0.0) + yielding

    return np.column_stack([np.zeros((len(states), 0)), *columns()])
