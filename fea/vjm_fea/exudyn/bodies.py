"""Rigid pieces of a system of Exudyn, and the points that show its shape."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vjm.continuation.path import StationLabel
from vjm.rotations import Array, inverse_frame
from vjm_fea.exudyn.backend import Item


@dataclass(frozen=True)
class Rigid:
    """A rigid piece.

    Attributes:
        node: index of its node, −1 for the ground.
        item: number of the object that carries markers.
        reference: frame ``(4, 4)`` of the node in the reference configuration.
    """

    node: int
    item: Item
    reference: Array


@dataclass(frozen=True)
class ExudynStation:
    """A material point of which the shape is made: ``offset`` ``(3,)`` mm in the axes of the node."""

    label: StationLabel
    node: int
    offset: Array


def between(before: Rigid, behind: Rigid, at: Array) -> tuple[tuple[int, int], Array]:
    """Nodes of two pieces that meet in a frame ``at`` (4, 4), and that frame in the axes of each, ``(2, 4, 4)``."""
    return (before.node, behind.node), np.array([inverse_frame(r.reference) @ at for r in (before, behind)])


def leaders_of(count: int, locked: Iterable[tuple[int, int]], first: Iterable[int]) -> list[int]:
    """Leader of every node's rigid piece, −1 on the ground.

    Args:
        count: number of nodes.
        locked: pairs of nodes of one piece, −1 for the ground.
        first: nodes that lead their pieces, unless these stand on the ground.
    """
    leaders = list(range(count))
    for a, b in locked:
        old, new = leaders[b] if b >= 0 else -1, leaders[a] if a >= 0 else -1
        if old == -1:
            old, new = new, old
        leaders = [new if leader == old else leader for leader in leaders]
    for node in first:
        old = leaders[node]
        if old >= 0:
            leaders = [node if leader == old else leader for leader in leaders]
    return leaders
