"""Names in a machine that a manipulator file describes: of its legs, whose parts are ``leg/part``, and bodies."""

from __future__ import annotations

from typing import NamedTuple

from vjm.model.machine import Machine

BASE, PLATFORM = "base", "platform"
"""Names of the body that stands still, and of the one whose pose is asked for: the last part's too."""
HOME = "home"
"""Label of the posture in which a machine is drawn, where its file gives it no other."""
ROOT, ATTACHMENT = "root", "attachment"
"""Rigid parts before a leg's first part, and from the end of a leg to the body that it carries."""


class Leg(NamedTuple):
    """A leg of a machine.

    Attributes:
        name: unique.
        parts: full names of its chain's parts, from where it begins to where it ends.
    """

    name: str
    parts: tuple[str, ...]


def named(leg: str, part: str) -> str:
    """Full name of a part of a leg."""
    return f"{leg}/{part}"


def legs_of(machine: Machine) -> tuple[Leg, ...]:
    """The legs of a machine, none where its file is not one of legs.

    Example:
        >>> import vjm
        >>> [leg.name for leg in legs_of(vjm.load("parallelogram"))]
        ['bar-1', 'bar-2']
    """
    names: dict[str, list[str]] = {}
    for part in machine.parts:
        leg, _, own = part.name.partition("/")
        if own == ROOT:
            names[leg] = []
        elif own and own != ATTACHMENT and leg in names:
            names[leg].append(part.name)
    return tuple(Leg(leg, tuple(parts)) for leg, parts in names.items())
