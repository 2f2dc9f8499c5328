"""Rigid pieces of a system of Exudyn, and the points that show its shape."""

from __future__ import annotations

from dataclasses import dataclass

from vjm.continuation.path import StationLabel
from vjm.rotations import Array
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
class Station:
    """A material point of which the shape is made: ``offset`` ``(3,)`` mm in the axes of the node."""

    label: StationLabel
    node: int
    offset: Array
