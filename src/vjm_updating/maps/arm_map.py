"""Maps of arms, trees and closed loops over a grid of joint coordinates or of tool positions."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from vjm import __version__
from vjm.engine import Engine
from vjm.io.files import write_whole
from vjm.model.chain import Chain
from vjm.model.joint_limits import joint_limits
from vjm.model.load_case import Load
from vjm.rotations import Array
from vjm.tree.critical_force import CriticalForce
from vjm.tree.equilibria import equilibria, unloaded_frames
from vjm.tree.inverse_kinematics import ClosedPostures, ReachError, followed, ranges_of
from vjm.tree.model import Gravity, TreeModel
from vjm.vjm_engine import VjmEngine
from vjm_updating.maps.by_engine import rows_by
from vjm_updating.maps.design_rows import design_rows
from vjm_updating.maps.difference import write_planes
from vjm_updating.maps.evaluate import COLUMNS, LOST, NAMES, OK, PER_MACHINE, UNSTABLE, MapQuantity, principal
from vjm_updating.maps.pose_grid import MOST, grid_axis, workspace_axes

TOOL = ("x", "y", "z")
MOST_FORCE = 20_000.0
"""N: largest force tried for a critical one."""
RIGID = "empty_where_ok=rigid"
"""Of a map's file: an empty cell of a row with an answer is an infinite stiffness."""


@dataclass(frozen=True)
class ArmGrid:
    """Values of joints or of tool coordinates.

    Attributes:
        axes: by name: joints, mm or rad, or x, y, z of the tool in mm, world axes, from `grid_origin`.
        tool: whether they are of the tool.
    """

    axes: dict[str, tuple[float, ...]]
    tool: bool

    @property
    def ordered(self) -> dict[str, tuple[float, ...]]:
        """The axes in the order in which the poses run: of the tool x, y, z whatever the option's order."""
        return {name: self.axes[name] for name in TOOL if name in self.axes} if self.tool else self.axes

    @property
    def varied(self) -> list[str]:
        """Names with more than one value."""
        return [name for name, values in self.axes.items() if len(values) > 1]


def parsed_arm_grid(
    text: str, model: TreeModel, workspace: Array | None = None, *, from_home: bool = False
) -> ArmGrid:
    """The grid of an option such as ``elbow=0:2:21,wrist=0.5``, ``x=400:600:11,z=200``, or ``11`` in a workspace.

    Of a platform, whose places count from home, x, y and z are its own coordinates, even where drives have these
    names.

    Raises:
        ValueError: it makes no sense; one line that says what would.
    """
    if text.isascii() and text.isdigit():
        return ArmGrid(dict(zip(TOOL, workspace_axes(text, model.chain.name, workspace), strict=True)), True)
    joints = [name for name, driven in zip(model.joints, ranges_of(model).driven, strict=True) if driven]
    if from_home:
        joints = [name for name in joints if name not in TOOL]
    axes: dict[str, tuple[float, ...]] = {}
    for word in text.split(","):
        name, _, numbers = (piece.strip() for piece in word.partition("="))
        if (name not in joints and name not in TOOL) or not numbers:
            if name in model.joints and name not in joints:
                raise ValueError(f"--grid {text}: joint '{name}' is passive: nothing sets it; leave it out")
            known = f"x, y, z or a joint ({', '.join(joints)})"
            raise ValueError(f"--grid {text}: '{word}' is not NAME=from:to:count with {known}")
        axes[name] = grid_axis(text, numbers)
    own = {name for name in axes if name in joints}
    if own and len(own) < len(axes):
        raise ValueError(f"--grid {text}: give joints or coordinates of the tool, not both")
    count = int(np.prod([len(values) for values in axes.values()], dtype=float))
    if count > MOST:
        raise ValueError(f"--grid {text}: {count} points are more than {MOST}")
    return ArmGrid(axes, not own)


@dataclass(frozen=True)
class ArmMap:
    """A map.

    Attributes:
        chain: the machine.
        engine: label.
        joints: names of the n joints.
        quantity: what was asked.
        grid: where.
        q: coordinates ``(g, n)`` that are asked for; nan where a tool position is not reached within the limits.
        tool: positions ``(g, 3)`` of the unloaded end, mm.
        values: ``(g, k)`` in the order of `COLUMNS`.
        why: ``ok``, or why there is no value.
        names: of a map of the shares, g times the part and the kind; empty texts where there is no value.
    """

    chain: Chain
    engine: str
    joints: tuple[str, ...]
    quantity: MapQuantity
    grid: ArmGrid
    q: Array
    tool: Array
    values: Array
    why: list[str]
    names: Sequence[tuple[str, str]] = ()


def map_arm(
    chain: Chain,
    engine: Engine,
    quantity: MapQuantity,
    grid: str,
    posture: str,
    *,
    wrench: Sequence[float] = (0.0,) * 6,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
    most: float = MOST_FORCE,
    workspace: Array | None = None,
    from_home: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> ArmMap:
    """Evaluate a quantity at every point of a grid, all equilibria in one batch.

    A point that takes a joint beyond its limits has no value, and its ``why`` names the joint and by how much.

    Args:
        chain: arm or tree.
        engine: any; ``vjm`` solves for all points in one batch.
        quantity: stiffness, deflection, the smallest critical force on the end over all directions, the lowest
            natural frequency, or the largest compliance share.
        grid: see `parsed_arm_grid`; what it leaves out stays as in the posture, the tool's direction too where the
            machine has six drives or more. Passive joints stay, or follow where loops are closed.
        posture: label.
        wrench: ``(6,)`` on the end, N, N mm.
        gravity: m/s².
        loads: on parts, in full.
        end: name of the end frame; the first where it is empty.
        most: largest force tried for a critical one, N.
        workspace: corners ``(2, 3)`` of the box that a grid of one number fills, mm from home.
        from_home: whether the grid counts the tool's coordinates from the first posture, as poses of a platform do.
        progress: called with the points that are done, and of how many, where they are computed one by one.

    Raises:
        ValueError: the grid, the posture or the end makes no sense, or the engine does not have the quantity.
    """
    springs = engine if isinstance(engine, VjmEngine) else VjmEngine()
    model = springs.tree_model(chain)
    if end and end not in model.ends:
        raise ValueError(f"--end: {chain.name} has no end frame '{end}' (it has {', '.join(model.ends)})")
    index = model.ends.index(end) if end else 0
    points, home = parsed_arm_grid(grid, model, workspace, from_home=from_home), model.posture(posture)
    q, why = _tool_rows(model, points, home, index, from_home) if points.tool else _joint_rows(model, points, home)
    reached = np.array([not each for each in why])
    names = [("", "")] * len(q) if quantity is MapQuantity.SHARES else []
    values, tool = np.full((len(q), len(COLUMNS[quantity])), np.nan), np.full((len(q), 3), np.nan)
    if reached.any():
        tool[reached] = unloaded_frames(model, q[reached])[1][:, index]
    if not isinstance(engine, VjmEngine):
        if gravity is not None or loads or end:
            raise ValueError(
                f"--engine {engine.label}: maps by it have a wrench on the end alone: leave --gravity, --load and "
                "--end out"
            )
        rows, own = rows_by(
            engine, [_standing(chain, model, each) for each in q[reached]], quantity, wrench, progress
        )
        values[reached] = rows
        for row, each in zip(np.flatnonzero(reached), own, strict=True):
            why[row] = each
    elif quantity is MapQuantity.CRITICAL:
        search = CriticalForce(model, index, most, gravity=gravity, loads=loads)
        for row, weak in zip(np.flatnonzero(reached), search.each(q[reached]), strict=True):
            values[row], why[row] = [weak.force, *weak.direction], weak.why or OK
    elif quantity in PER_MACHINE and reached.any():
        standing = [_standing(chain, model, each) for each in q[reached]]
        design = design_rows(
            engine, model, q[reached], standing, quantity, wrench=wrench, gravity=gravity, loads=loads, end=end,
            progress=progress,
        )  # fmt: skip
        for row, one in zip(np.flatnonzero(reached), design, strict=True):
            values[row], why[row] = one.value, one.why
            if names:
                names[row] = (one.part, one.kind)
    elif reached.any():
        on_ends = np.zeros((len(model.ends), 6))
        on_ends[index] = wrench
        stiff = quantity is MapQuantity.STIFFNESS
        found = equilibria(model, q[reached], gravity=gravity, wrench=on_ends, loads=loads, compliance=stiff)
        if stiff:
            assert found.compliance is not None
            rows = principal(found.compliance[:, index])
        else:
            moved = found.deflection[:, index]
            rows = np.hstack([moved, np.linalg.norm(moved[:, :3], axis=1, keepdims=True)])
        good = np.asarray(found.found & found.stable)
        rows[~good] = np.nan
        values[reached] = rows
        for k, row in enumerate(np.flatnonzero(reached)):
            why[row] = OK if good[k] else UNSTABLE if found.found[k] else LOST
    return ArmMap(chain, engine.label, model.joints, quantity, points, q, tool, values, why, names)


def _standing(chain: Chain, model: TreeModel, q: Array) -> tuple[Chain, str]:
    """The machine with one posture, of coordinates ``(n_joints,)``, and its label."""
    values = dict(zip(model.joints, q.tolist(), strict=True))
    passive = np.array([values.pop(joint.name) for joint in chain.joints])
    return replace(chain, postures={"point": passive}, held={"point": values}, poses={}, home=""), "point"


def grid_origin(model: TreeModel, index: int, *, from_home: bool) -> Array:
    """Place ``(3,)`` from which a grid counts coordinates of the tool, mm, world.

    From home that is the place of the end frame with a number in the first posture, else the origin of the world.
    """
    if not from_home:
        return np.zeros(3)
    first = next(iter(model.chain.postures))
    place: Array = unloaded_frames(model, model.posture(first))[1][0, index]
    return place


def _joint_rows(model: TreeModel, grid: ArmGrid, home: Array) -> tuple[Array, list[str]]:
    """Joint coordinates of a grid, and which of them are beyond their limits, and by how much."""
    if model.chain.closes:
        return _driven_rows(model, grid, home)
    rows = np.tile(home, (int(np.prod([len(v) for v in grid.axes.values()])), 1))
    columns = [model.joints.index(name) for name in grid.axes]
    rows[:, columns] = np.array(list(product(*grid.axes.values())))
    limits = joint_limits(model.chain, model.joints)
    kept = limits.kept(rows)
    return rows, ["" if good else f"out of reach: {limits.said(q)}" for q, good in zip(rows, kept, strict=True)]


def _driven_rows(model: TreeModel, grid: ArmGrid, home: Array) -> tuple[Array, list[str]]:
    """The same of a machine with closed loops, whose passive joints follow."""
    closed, points = ClosedPostures(model, home), list(product(*grid.axes.values()))
    rows, why = np.full((len(points), len(model.joints)), np.nan), [""] * len(points)
    for k, values in enumerate(points):
        try:
            rows[k] = closed.driven(dict(zip(grid.axes, values, strict=True)))
        except ReachError as error:
            why[k] = str(error).removeprefix(f"{model.chain.name}: ")
    return rows, why


def _tool_rows(
    model: TreeModel, grid: ArmGrid, home: Array, index: int, from_home: bool
) -> tuple[Array, list[str]]:
    """Joint coordinates of tool positions, each found from the one before it, and why some are not reached."""
    R, p = (frames[0, index] for frames in unloaded_frames(model, home))
    origin = grid_origin(model, index, from_home=from_home)
    axes = [grid.axes.get(name, (float(p[k] - origin[k]),)) for k, name in enumerate(TOOL)]
    positions = origin + np.array(list(product(*axes)))
    six = np.count_nonzero(ranges_of(model, home).driven) >= 6
    rotations = np.tile(R, (len(positions), 1, 1)) if six else None
    rows, why = followed(model, positions, rotations, home, model.ends[index])
    return rows, [each.removeprefix(f"{model.chain.name}: ") for each in why]


def write_arm_map(found: ArmMap, folder: Path) -> tuple[list[Path], list[str]]:
    """Write ``map.csv``, and ``map.png`` where what draws it is there and the grid has more than one point.

    A grid over more than two axes is drawn over the first two, in the middle of the others.

    Returns:
        The files, and for one that is left out a line that says why.
    """
    files = [folder / "map.csv"]
    stream = io.StringIO()
    stream.write(
        f"# model={found.chain.name} engine={found.engine} quantity={found.quantity} version={__version__}"
    )
    stream.write(f" model_sha256={found.chain.sha256} {RIGID}\n")
    writer = csv.writer(stream, lineterminator="\n")
    texts = NAMES if found.names else ()
    writer.writerow([*found.joints, "x_mm", "y_mm", "z_mm", *COLUMNS[found.quantity], *texts, "status"])
    names: Sequence[tuple[str, ...]] = found.names or [()] * len(found.why)
    for q, p, row, words, why in zip(found.q, found.tool, found.values, names, found.why, strict=True):
        writer.writerow([*(f"{v:.9g}" if np.isfinite(v) else "" for v in (*q, *p, *row)), *words, why])
    write_whole(files[0], stream.getvalue())
    axes = {_axis_title(found, name): values for name, values in found.grid.ordered.items()}
    panel = (f"{found.chain.name}, {found.engine}", found.values, found.names)
    drawn, left_out = write_planes(folder / "map.png", found.quantity, axes, [panel])
    return [*files, *drawn], left_out


def _axis_title(found: ArmMap, name: str) -> str:
    part = next((part for part in found.chain.parts if part.name == name), None)
    return f"{name}, {'mm' if found.grid.tool or getattr(part, 'slides', False) else 'rad'}"
