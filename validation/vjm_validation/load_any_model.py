"""What commands take of a machine.

The model by name or file, its postures, and directions of forces as the command line writes them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.io.machine_file import load_model
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.postures import in_posture
from vjm.rotations import Array


def loaded(name_or_path: str, *, shear: bool = True) -> Machine:
    """The machine of a model.

    Args:
        name_or_path: of the model.
        shear: whether the shear stiffness that it states counts.

    Raises:
        ModelFileError: see `vjm.io.machine_file.load_model`.
    """
    model = load_model(name_or_path)
    return model if shear else model.rigid_in_shear()


def in_postures(model: Machine, wanted: Sequence[str]) -> tuple[Machine, list[str]]:
    """A model that has the postures asked for, and their labels; all of its own where none is asked for.

    Args:
        model: any machine.
        wanted: labels, or coordinates, see `vjm.postures.in_posture`.

    Raises:
        ValueError: there is no such posture, or a coordinate is beyond its joint's limits.
    """
    labels = []
    for text in wanted:
        try:
            model, label = in_posture(model, text)
        except ValueError as error:
            raise ValueError(f"--posture: {error}") from None
        labels.append(label)
    return model, labels or list(model.postures)


DIRECTIONS = ("x", "-x", "y", "-y", "z", "-z")


def parsed_directions(words: Sequence[str]) -> tuple[str, ...]:
    """Directions from words such as ``x``, ``x,-z`` or ``1,1,0``; all six axes where there are none."""
    names = [sign + name for name in COMPONENTS[:3] for sign in ("", "-")]
    directions: list[str] = []
    for word in words:
        pieces = [piece.strip() for piece in word.split(",")]
        directions += pieces if all(piece in names for piece in pieces) else [word]
    return tuple(dict.fromkeys(directions)) or DIRECTIONS


def unit_of(direction: str) -> Array:
    """Unit vector ``(6,)`` of ``x``, ``-z`` or of three numbers ``dx,dy,dz``.

    Raises:
        ValueError: it is none of them.
    """
    sign, name = (-1.0, direction[1:]) if direction.startswith("-") else (1.0, direction)
    if name in COMPONENTS[:3]:
        return sign * np.eye(6)[COMPONENTS.index(name)]
    try:
        shift = np.array([float(word) for word in direction.split(",")])
    except ValueError:
        shift = np.zeros(0)
    if len(shift) != 3 or not 0.0 < np.linalg.norm(shift) < np.inf:
        raise ValueError(f"--direction: '{direction}' is no axis such as x or -z and no three numbers dx,dy,dz")
    return np.concatenate([shift / np.linalg.norm(shift), np.zeros(3)])
