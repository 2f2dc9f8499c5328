"""Grids of joint coordinates or of places of the end-effector, as the command line writes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from vjm.machine.equilibria import unloaded_frames
from vjm.machine.inverse_kinematics import ClosedPostures, ReachError, end_index, followed, ranges_of
from vjm.machine.rigid_mechanism import LoopClosure
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array, displacement_between, frame
from vjm_updating.constants import physical_bound

MOST = physical_bound(5_000_000)
"""Points beyond which a grid is taken for a slip of the pen."""
TOOL = ("x", "y", "z")
OF_TOOL, OF_JOINT = "tool.", "joint."
"""Before a name: whose it is, where a joint is called x, y or z."""


@dataclass(frozen=True)
class MapGrid:
    """Values of joints, or of coordinates of the end-effector.

    Attributes:
        axes: by name: joints, mm or rad, or x, y, z of the end-effector in mm, world axes, from `grid_origin`.
        tool: whether they are of the end-effector.
        read_as: of bare names that are a joint's and the tool's, how they were read; empty where there are none.
    """

    axes: Mapping[str, tuple[float, ...]]
    tool: bool
    read_as: str = ""

    @property
    def ordered(self) -> Mapping[str, tuple[float, ...]]:
        """The axes in the order in which the points run: x, y, z whatever the option's order."""
        return {name: self.axes[name] for name in TOOL if name in self.axes} if self.tool else self.axes

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of points along each of the ordered axes, the last running fastest."""
        return tuple(len(values) for values in self.ordered.values())

    @property
    def varied(self) -> list[str]:
        """Names with more than one value."""
        return [name for name, values in self.ordered.items() if len(values) > 1]

    def __len__(self) -> int:
        return int(np.prod(self.shape))


def parsed_grid(text: str, model: Mechanism) -> MapGrid:
    """The grid of an option such as ``elbow=0:2:21,wrist=0.5``, ``x=400:600:11,z=200``, or ``11`` in a workspace.

    Where a joint is called x, y or z, ``tool.x`` is the end-effector's and ``joint.x`` the joint's. A bare name is
    the end-effector's where places count from home, else the joint's; `MapGrid.read_as` says so.

    Raises:
        ValueError: it makes no sense; one line that says what would.
    """
    if not text.isascii():
        raise ValueError(f"--grid {text}: write numbers with the digits 0 to 9")
    chain = model.chain
    if text.isdigit():
        return MapGrid(dict(zip(TOOL, _workspace_axes(text, chain.name, chain.workspace), strict=True)), True)
    joints = [name for name, driven in zip(model.joints, ranges_of(model).driven, strict=True) if driven]
    axes: dict[str, tuple[float, ...]] = {}
    own, bare = list[str](), list[str]()
    for word in text.split(","):
        said, _, numbers = (piece.strip() for piece in word.partition("="))
        of_tool, of_joint = said.startswith(OF_TOOL), said.startswith(OF_JOINT)
        name = said.removeprefix(OF_TOOL if of_tool else OF_JOINT)
        if not numbers or not ((name in joints and not of_tool) or (name in TOOL and not of_joint)):
            if name in model.joints and name not in joints and not of_tool:
                raise ValueError(f"--grid {text}: joint '{name}' is passive: nothing sets it; leave it out")
            known = f"x, y, z or a joint ({', '.join(joints)})"
            raise ValueError(f"--grid {text}: '{word}' is not NAME=from:to:count with {known}")
        if name in axes:
            raise ValueError(f"--grid {text}: {name} is given twice: which is meant?")
        axes[name] = _axis(text, numbers)
        if name in joints and name in TOOL and said == name:
            bare.append(name)
        if of_joint or (name in joints and not of_tool and not (name in bare and chain.poses)):
            own.append(name)
    whose = f"the joint's, and {OF_TOOL}x is the tool's" if own else f"the tool's, and {OF_JOINT}x is the joint's"
    read_as = f"--grid: {', '.join(bare)}: {whose.replace('x is', f'{bare[0]} is')}" if bare else ""
    if own and len(own) < len(axes):
        remedy = f"; {bare[0]} is a joint here, {OF_TOOL}{bare[0]} is the tool's" if bare else ""
        raise ValueError(f"--grid {text}: give joints or coordinates of the tool, not both{remedy}")
    count = int(np.prod([len(values) for values in axes.values()], dtype=float))
    if count > MOST:
        raise ValueError(f"--grid {text}: {count} points are more than {MOST}")
    return MapGrid(axes, not own, read_as)


def grid_origin(model: Mechanism, index: int = 0) -> Array:
    """Place ``(3,)`` from which a grid counts places of an end frame, mm, world: home for a machine with poses."""
    if not model.chain.poses:
        return np.zeros(3)
    return unloaded_frames(model, model.posture(next(iter(model.chain.postures))))[1][0, index]


@dataclass(frozen=True)
class MapPoints:
    """The points of a grid.

    Attributes:
        posture: label of the posture that gives what the grid leaves out.
        q: coordinates ``(g, n)`` of the model's joints; nan where a place is not reached.
        places: ``(g, 3)`` of the unloaded end frame, mm, from `grid_origin`; nan likewise.
        why: why a point is not reached, empty where it is.
    """

    grid: MapGrid
    posture: str
    q: Array
    places: Array
    why: tuple[str, ...]

    @property
    def reached(self) -> np.ndarray:
        """Numbers ``(k,)`` of the points that are reached."""
        return np.flatnonzero([not each for each in self.why])


def points_of(model: Mechanism, grid: MapGrid, posture: str, end: str = "") -> MapPoints:
    """The points of a grid.

    What the grid leaves out stays as in the posture, the end-effector's direction too where the machine has six
    drives or more. Passive joints stay, or follow where loops are closed. Places are those of the ``end`` frame, by
    default the first.

    Raises:
        ValueError: there is no such posture or end frame.
    """
    home, index = model.posture(posture), end_index(model, end)
    origin = grid_origin(model, index)
    if grid.tool:
        wanted = _places(model, grid, home, index, origin)
        q, why = _at_places(model, wanted, home, index)
        if model.chain.poses:
            return MapPoints(grid, posture, q, wanted - origin, tuple(why))
    else:
        q, why = _of_joints(model, grid, home)
    places, reached = np.full((len(q), 3), np.nan), np.flatnonzero([not each for each in why])
    if len(reached):
        places[reached] = unloaded_frames(model, q[reached])[1][:, index] - origin
    return MapPoints(grid, posture, q, places, tuple(why))


def _of_joints(model: Mechanism, grid: MapGrid, home: Array) -> tuple[Array, list[str]]:
    """Joint coordinates of a grid, and which of them are beyond their limits, and by how much."""
    points = list(product(*grid.axes.values()))
    if model.chain.closes:
        closed = ClosedPostures(model, home)
        rows, why = np.full((len(points), len(model.joints)), np.nan), [""] * len(points)
        for k, values in enumerate(points):
            try:
                rows[k] = closed.driven(dict(zip(grid.axes, values, strict=True)))
            except ReachError as error:
                why[k] = str(error).removeprefix(f"{model.chain.name}: ")
        return rows, why
    rows = np.tile(home, (len(points), 1))
    rows[:, [model.joints.index(name) for name in grid.axes]] = np.array(points)
    return rows, _beyond_limits(model, rows)


def _beyond_limits(model: Mechanism, rows: Array) -> list[str]:
    limits = model.limits
    kept = limits.kept(rows)
    return ["" if good else f"out of reach: {limits.said(q)}" for q, good in zip(rows, kept, strict=True)]


def _places(model: Mechanism, grid: MapGrid, home: Array, index: int, origin: Array) -> Array:
    """Places ``(g, 3)`` of a grid, mm, world."""
    p = unloaded_frames(model, home)[1][0, index]
    axes = [grid.axes.get(name, (float(p[k] - origin[k]),)) for k, name in enumerate(TOOL)]
    return origin + np.array(list(product(*axes)))


def _at_places(model: Mechanism, positions: Array, home: Array, index: int) -> tuple[Array, list[str]]:
    """Joint coordinates with the end at places ``(g, 3)``, mm, world, and why some are not reached."""
    six = int(np.count_nonzero(ranges_of(model, home).driven)) >= 6
    if model.chain.closes:
        return _closed_at(model, positions, ClosedPostures(model, home, model.ends[index]).closing, turns=six)
    R = unloaded_frames(model, home)[0][0, index]
    rotations = np.tile(R, (len(positions), 1, 1)) if six else None
    rows, why = followed(model, positions, rotations, home, model.ends[index])
    return rows, [each.removeprefix(f"{model.chain.name}: ") for each in why]


def _closed_at(model: Mechanism, positions: Array, closing: LoopClosure, *, turns: bool) -> tuple[Array, list[str]]:
    """The same of a machine with closed loops, all places at once."""
    ways = np.array([displacement_between(closing.end, frame(closing.end[:3, :3], p)) for p in positions])
    rows, why = closing.all_displaced(ways, (True,) * 3 + (turns,) * 3)
    reached = np.flatnonzero([not each for each in why])
    for k, said in zip(reached, _beyond_limits(model, rows[reached]), strict=True):
        why[k] = said
    return rows, [each.removeprefix(f"{model.chain.name}: ") for each in why]


def _workspace_axes(text: str, name: str, workspace: Array | None) -> list[tuple[float, ...]]:
    """As many places along each side of a workspace as an option says, mm.

    ``workspace`` are corners (2, 3), mm; None: the machine's file has none.

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


def _axis(text: str, numbers: str) -> tuple[float, ...]:
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
