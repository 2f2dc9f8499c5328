"""Whether a machine can be so large: offsets beyond 100 m are in another unit, or lead along axes and back.

Calibrations write such offsets. The common normal of two axes that are nearly parallel lies far away, and the next
offset leads back along an axis. What counts is then how far the axes are from one another.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vjm.io.sections import LONGEST_MM
from vjm.rotations import Array


@dataclass(frozen=True)
class PlacedPiece:
    """A rigid piece, or a joint at zero.

    Attributes:
        name: of it; steps have different names.
        before: name of the step behind which it begins; empty for the base.
        frame: ``(4, 4)`` of its end where it begins, mm.
        moves: whether it is a joint.
        axis: ``(3,)`` about which it turns, where it does.
    """

    name: str
    before: str
    frame: Array
    moves: bool = False
    axis: Array | None = None


def far_steps(steps: Sequence[PlacedPiece]) -> list[tuple[str, float]]:
    """Names and lengths in mm of the pieces that lead farther away than a machine is long.

    A piece may do so along the axis of a joint beside it, where the next joint's axis is nearly parallel to that.
    Both axes stay less than 100 m from one another all that way.

    Args:
        steps: parents before children.
    """
    far = [step for step in steps if np.abs(step.frame[:3, 3]).max() > LONGEST_MM]
    if not far:
        return []
    by_name = {step.name: step for step in steps}
    turns: dict[str, Array] = {"": np.eye(3)}
    for step in steps:
        turns[step.name] = turns[step.before] @ step.frame[:3, :3]
    axes = {step.name: turns[step.before] @ step.axis for step in steps if step.axis is not None}
    pairs: list[tuple[str, str]] = []
    beside: dict[str, set[str]] = {step.name: set() for step in steps}
    for step in (step for step in steps if step.moves):
        way = list(_pieces_before(step, by_name))
        before = by_name[way[-1] if way else step.name].before
        pairs += [(step.name, before)] if before else []
        for name in way:
            beside[name] |= {step.name, before}
    for step in far:
        # behind the last joint of a branch
        way = list(_pieces_before(step, by_name))
        beside[step.name].add(by_name[way[-1] if way else step.name].before)

    def parallel(name: str, along: float) -> bool:
        others = {one for pair in pairs if name in pair for one in pair} - {name}
        sines = (np.linalg.norm(np.cross(axes[name], axes[other])) for other in others & axes.keys())
        return any(along * sine <= LONGEST_MM for sine in sines)

    def leads_along(step: PlacedPiece) -> bool:
        shift = turns[step.before] @ step.frame[:3, 3]
        for name in beside[step.name] & axes.keys():
            along = float(axes[name] @ shift)
            if np.linalg.norm(shift - along * axes[name]) <= LONGEST_MM and parallel(name, abs(along)):
                return True
        return False

    return [(step.name, float(np.linalg.norm(step.frame[:3, 3]))) for step in far if not leads_along(step)]


def _pieces_before(step: PlacedPiece, by_name: dict[str, PlacedPiece]) -> Iterator[str]:
    """Names of the rigid pieces between a step and the joint before it, the nearest first."""
    while step.before and not by_name[step.before].moves:
        step = by_name[step.before]
        yield step.name
