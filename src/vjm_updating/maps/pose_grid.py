"""Grids of poses, as the command line writes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.platform.manipulator import Manipulator
from vjm.rotations import Array

MOST = 5_000_000
"""Poses beyond which a grid is taken for a slip of the pen."""


@dataclass(frozen=True)
class Grid:
    """A box of displacements from home.

    Attributes:
        axes: coordinates along x, y and z, mm.
    """

    axes: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of points along x, y and z."""
        x, y, z = self.axes
        return len(x), len(y), len(z)

    def __len__(self) -> int:
        return int(np.prod(self.shape))

    def poses(self) -> Array:
        """Displacements ``(n, 6)``, z running fastest."""
        points = np.array(np.meshgrid(*self.axes, indexing="ij")).reshape(3, -1).T
        return np.hstack([points, np.zeros_like(points)])


def parsed_grid(text: str, manipulator: Manipulator) -> Grid:
    """The grid of an option.

    Args:
        text: ``21``: so many points along each side of the model's workspace; or ``x=-50:50:11,y=0,z=-10:10:3``,
            where an axis that is left out is zero.
        manipulator: the machine.

    Raises:
        ValueError: it makes no sense; one line that says what would.
    """
    if not text.isascii():
        raise ValueError(f"--grid {text}: write numbers with the digits 0 to 9")
    if text.isdigit():
        axes = workspace_axes(text, manipulator.name, manipulator.workspace)
    else:
        axes, seen = [(0.0,), (0.0,), (0.0,)], set[str]()
        for word in text.split(","):
            name, _, numbers = word.partition("=")
            if name.strip() not in ("x", "y", "z") or not numbers:
                raise ValueError(f"--grid {text}: '{word}' is not x=from:to:count, y=… or z=…")
            if name.strip() in seen:
                raise ValueError(f"--grid {text}: {name.strip()} is given twice: which is meant?")
            seen.add(name.strip())
            axes["xyz".index(name.strip())] = grid_axis(text, numbers)
    grid = Grid((axes[0], axes[1], axes[2]))
    if len(grid) > MOST:
        raise ValueError(f"--grid {text}: {len(grid)} poses are more than {MOST}")
    return grid


def workspace_axes(text: str, name: str, workspace: Array | None) -> list[tuple[float, ...]]:
    """As many places along each side of a workspace as an option says, mm.

    Args:
        text: the option, a whole number.
        name: of the machine, for messages.
        workspace: corners ``(2, 3)``, mm; None: the machine's file has none.

    Raises:
        ValueError: there is no workspace, or it would be too many places.
    """
    if workspace is None:
        raise ValueError(
            f"--grid {text}: {name} has no [workspace]: write x=from:to:count,y=…,z=…, or joints, elbow=0:1:11"
        )
    count = int(text)
    if not 1 <= count**3 <= MOST:
        raise ValueError(f"--grid {text}: needs at least one point a side, and at most {MOST} in all")
    return [_line(a, b, count if a < b else 1) for a, b in workspace.T.tolist()]


def grid_axis(text: str, numbers: str) -> tuple[float, ...]:
    """Values of ``from:to:count`` or of one number; ``text`` is the option, for messages.

    Raises:
        ValueError: it is neither.
    """
    words = numbers.split(":")
    try:
        values = [float(word) for word in words]
    except ValueError:
        raise ValueError(f"--grid {text}: '{numbers}' is not a number, nor from:to:count") from None
    if len(values) == 1 and np.isfinite(values[0]):
        return (values[0],)
    if len(values) != 3 or not np.all(np.isfinite(values)) or values[2] != int(values[2]) or values[2] < 2:
        raise ValueError(f"--grid {text}: '{numbers}' must be from:to:count with a count of two or more")
    if values[2] > MOST:
        raise ValueError(f"--grid {text}: '{numbers}' has more than {MOST} points")
    if values[0] >= values[1]:
        raise ValueError(f"--grid {text}: '{numbers}' must run upwards")
    return _line(values[0], values[1], int(values[2]))


def _line(a: float, b: float, count: int) -> tuple[float, ...]:
    if count == 1:
        return (0.5 * (a + b),)
    return tuple(np.linspace(a, b, count).tolist())
