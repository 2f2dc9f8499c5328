"""Tables of Denavit and Hartenberg, in both conventions.

Here are files of them, TOML or CSV, the frames of joints that they say, and the serial robot that they make.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from vjm.io.errors import ModelFileError, did_you_mean, printed, validated
from vjm.io.fields import LONGEST_MM, Table
from vjm.io.files import csv_rows, small_text, toml_content, toml_line, toml_text
from vjm.io.robot import Body, Kind, Notes, Placing, Reading, Robot, RobotJoint, triple, turned
from vjm.io.robot_xml import WHOLE_TURN, FilePlace, rpy_turns, taken_limits
from vjm.rotations import Array, inverse_frame, roll_pitch_yaw

Convention = Literal["dh", "mdh"]
Parallel = Literal["beta", "offsets"]
NEARLY_PARALLEL = 0.1
"""Sine of the angle between two axes. Below it their common normal may lie farther away than ten times the distance
from one axis to the other."""
ROUNDING = 1e-14
"""Of angles in rad, and of lengths over the machine's: what a hundred products of rotations leave of zero."""
FARTHEST = 1e5
"""Offsets over the machine's size. Doubles round them by 2e-16, which is 2e-11 of the size; 1e-9 is promised."""
ANGLES = ("alpha", "theta", "beta")
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class DhRow:
    """One joint.

    Attributes:
        name: of the joint.
        slides: along its axis; else it turns about it.
        a: length of the common normal, mm.
        d: offset along the joint's axis, mm.
        alpha: angle between the axes, rad.
        theta: offset of the angle about the joint's axis, rad.
        beta: Hayati's angle, rad.
        limits: of the joint's coordinate, mm or rad.
    """

    name: str
    slides: bool = False
    a: float = 0.0
    d: float = 0.0
    alpha: float = 0.0
    theta: float = 0.0
    beta: float = 0.0
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class DhTable:
    """A serial machine as a table.

    Attributes:
        name: of the machine.
        convention: of the rows.
        rows: from base to tool.
        base: frame in which the first row begins.
        tool: frame of the end, behind the last row.
    """

    name: str
    convention: Convention
    rows: tuple[DhRow, ...]
    base: Placing = field(default_factory=Placing)
    tool: Placing = field(default_factory=Placing)

    def steps(self) -> list[Placing]:
        """From each joint's frame, its axis along z, to the next: first from the base's, at last to the tool's.

        Example:
            >>> table = DhTable("two", "dh", (DhRow("a", d=9.0), DhRow("b", a=5.0)))
            >>> [step.shift for step in table.steps()]
            [(0.0, 0.0, 0.0), (0.0, 0.0, 9.0), (5.0, 0.0, 0.0)]
        """
        still = DhRow("")
        if self.convention == "dh":
            return [Placing(), *(_step(row, row) for row in self.rows)]
        return [_step(row, ahead) for row, ahead in zip((still, *self.rows), (*self.rows, still), strict=True)]


def _step(axis: DhRow, normal: DhRow) -> Placing:
    """``Rz(θ) Tz(d)`` of one row, then ``Tx(a) Rx(α) Ry(β)`` of one."""
    c, s = math.cos(axis.theta), math.sin(axis.theta)
    turns = ((Z, axis.theta), (X, normal.alpha), (Y, normal.beta))
    return Placing(
        (normal.a * c + 0.0, normal.a * s + 0.0, axis.d + 0.0),
        tuple((about, angle) for about, angle in turns if angle),
    )


def _placing_of(T: Array, size: float) -> Placing:
    """A frame ``(4, 4)`` as a shift and turns about z, y and x, less what rounding leaves of zero; all in mm."""
    roll, pitch, yaw = roll_pitch_yaw(T[:3, :3])
    x, y, z = (_whole(v, ROUNDING * size) for v in T[:3, 3])
    turns = ((Z, yaw), (Y, pitch), (X, roll))
    return Placing((x, y, z), tuple((axis, angle) for axis, angle in turns if abs(angle) > ROUNDING))


def _whole(value: float, rounding: float) -> float:
    """A number, zero where rounding leaves no more of it."""
    return float(value) if abs(value) > rounding else 0.0


# --- offsets that cancel --------------------------------------------------------------------------------------


def _brought_near(steps: Sequence[Placing]) -> tuple[list[Placing], list[int]]:
    """The steps with joints' frames moved along their axes, where that halves the lengths at least.

    A frame may stand anywhere on its joint's axis. Behind a nearly parallel axis it is put where its own axis meets
    the plane across the other one, so that no offset is left between the two. It is done where offsets cancel: most
    of the sum of the steps' lengths then leads forth and back.
    """
    near, moved, slid = list[Placing](), list[int](), 0.0
    for k, step in enumerate(steps):
        x, y, z = step.shift
        z, slid = z - slid, 0.0
        u = turned(step.turns)[:, 2]
        if 0 < k < len(steps) - 1 and math.hypot(u[0], u[1]) < NEARLY_PARALLEL:
            slid = -z / float(u[2])
            x, y, z = x + slid * float(u[0]), y + slid * float(u[1]), 0.0
            moved += [k] if slid else []
        near.append(Placing((x, y, z), step.turns))
    if 2.0 * _length(near) >= _length(steps):
        return list(steps), []
    return near, moved


def _length(steps: Sequence[Placing]) -> float:
    return sum(math.hypot(*step.shift) for step in steps)


def _longest(steps: Sequence[Placing]) -> float:
    """The length of the longest step, mm."""
    return max(math.hypot(*step.shift) for step in steps)


def said_parallel(table: DhTable) -> list[str]:
    """How a table holds nearly parallel axes, a line for each way; empty where there are none."""
    bent = [row.name for row in table.rows if row.beta]
    lines = []
    if bent:
        lines.append(
            f"beta, Hayati's angle, stands in the rows of {', '.join(bent)}: their axes are nearly parallel"
        )
    moved = _brought_near(table.steps())[1]
    if moved:
        lines.append(
            f"offsets d of {printed(max(abs(row.d) for row in table.rows) / 1e3)} m stand at "
            f"{', '.join(table.rows[k].name for k in moved)}: they lead along nearly parallel axes and back, and "
            "every digit counts"
        )
    return lines


# --- a table of a machine -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SerialChain:
    """Joints one behind another.

    Attributes:
        name: of the machine.
        joints: rows with names, motions and limits only.
        steps: frames ``(n + 1, 4, 4)`` from each joint's frame, its axis along z, to the next, mm: first from the
            base's, at last to the end's.
    """

    name: str
    joints: tuple[DhRow, ...]
    steps: tuple[Array, ...]


def dh_table(chain: SerialChain, convention: Convention, parallel: Parallel = "beta") -> DhTable:
    """The table of a chain.

    Of the two directions of each common normal the one with the smaller angle θ is taken, as makers' tables have
    it; a may be negative then. Nearly parallel axes get Hayati's β, or offsets that cancel. Along exactly parallel
    axes d is zero, and the offset stands in the row behind them.

    Raises:
        ValueError: offsets would be so large that digits are lost; it names the joints.

    Example:
        >>> from vjm.rotations import frame
        >>> steps = (np.eye(4), frame(np.eye(3), [500.0, 0.0, 20.0]), frame(np.eye(3), [300.0, 0.0, 0.0]))
        >>> table = dh_table(SerialChain("two", (DhRow("a"), DhRow("b")), steps), "dh")
        >>> [(row.a, row.d) for row in table.rows]
        [(500.0, 0.0), (300.0, 20.0)]
    """
    size = _length(_brought_near([_placing_of(step, 0.0) for step in chain.steps])[0])
    base = _base(chain.steps[0])
    rest, dh_rows = inverse_frame(base) @ chain.steps[0], list[DhRow]()
    for step in chain.steps[1:-1]:
        row, rest = _split(rest @ step, size, hayati=parallel == "beta")
        dh_rows.append(row)
    end = rest @ chain.steps[-1]
    dh_rows.append(_last(end, size, hayati=parallel == "beta"))
    tool = inverse_frame(_step(dh_rows[-1], dh_rows[-1]).frame) @ end
    normals = dh_rows
    if convention == "mdh":
        still = replace(dh_rows[-1], theta=0.0, d=0.0)
        tool = _step(still, still).frame @ tool
        normals = [DhRow(""), *dh_rows[:-1]]
    rows = tuple(
        replace(joint, theta=own.theta, d=own.d, a=normal.a, alpha=normal.alpha, beta=normal.beta)
        for joint, own, normal in zip(chain.joints, dh_rows, normals, strict=True)
    )
    far = [row for row in rows if abs(row.d) > FARTHEST * size]
    if far:
        raise ValueError(
            f"the axes at {', '.join(row.name for row in far)} are so nearly parallel that offsets of "
            f"{printed(max(abs(row.d) for row in far) / 1e3, 3)} m would lose digits: write them with beta"
        )
    return DhTable(chain.name, convention, rows, _placing_of(base, size), _placing_of(tool, size))


def _base(T: Array) -> Array:
    """A frame whose z is the first joint's axis, turned from the world's as little as that takes."""
    u, p = T[:3, 2], T[:3, 3]
    # the shortest turn of z is about an axis across both; of the opposite direction any axis across is one
    about = np.array([-u[1], u[0], 0.0])
    sine = math.hypot(u[0], u[1])
    if sine <= ROUNDING:
        turns = () if u[2] > 0.0 else ((X, math.pi),)
    else:
        x, y, _ = (about / sine).tolist()
        turns = (((x, y, 0.0), math.atan2(sine, u[2])),)
    # where the axis meets the plane of the base, or is next to its origin
    along = p[2] / u[2] if sine < NEARLY_PARALLEL else p @ u
    x, y, z = (p - along * u).tolist()
    return Placing((x, y, z), turns).frame


def _split(T: Array, size: float, *, hayati: bool) -> tuple[DhRow, Array]:
    """A frame as a row of ``dh``, and the turn about z with the shift along it that lead on from there."""
    u = T[:3, 2]
    sine = math.hypot(u[0], u[1])
    parallel = sine < (NEARLY_PARALLEL if hayati else ROUNDING)
    row = _parallel(T, size) if parallel else _common_normal(T, size)
    rest = inverse_frame(_step(row, row).frame) @ T
    angle = math.atan2(rest[1, 0], rest[0, 0])
    return row, Placing((0.0, 0.0, float(rest[2, 3])), ((Z, angle),)).frame


def _last(T: Array, size: float, *, hayati: bool) -> DhRow:
    """The last row, behind which any frame may stand: it holds as much as it can."""
    u = T[:3, 2]
    sine = math.hypot(u[0], u[1])
    if sine >= NEARLY_PARALLEL:
        return _common_normal(T, size)
    row = _parallel(T, size)
    if sine <= ROUNDING:
        row = replace(row, d=_whole(T[2, 3], ROUNDING * size))
        if not row.a and not row.alpha:
            row = replace(row, theta=_whole(math.atan2(T[1, 0], T[0, 0]), ROUNDING))
    elif not hayati:
        row = replace(row, alpha=0.0 if u[2] > 0.0 else math.pi, beta=0.0)
    return row


def _parallel(T: Array, size: float) -> DhRow:
    """Nearly parallel axes: from the origin to where the next axis meets the plane across this one."""
    u = T[:3, 2]
    across = T[:3, 3] - T[2, 3] / u[2] * u
    a, theta = math.hypot(across[0], across[1]), 0.0
    if a <= ROUNDING * size:
        a = 0.0
    else:
        theta, a = _smaller(math.atan2(across[1], across[0]), a)
    c, s = math.cos(theta), math.sin(theta)
    along, aside = c * u[0] + s * u[1], c * u[1] - s * u[0]
    beta, alpha = math.atan2(along, math.hypot(aside, u[2])), math.atan2(-aside, u[2])
    if math.hypot(u[0], u[1]) <= ROUNDING:
        beta, alpha = 0.0, 0.0 if u[2] > 0.0 else math.pi
    return DhRow("", a=a, theta=theta, alpha=_whole(alpha, ROUNDING), beta=_whole(beta, ROUNDING))


def _common_normal(T: Array, size: float) -> DhRow:
    u, p = T[:3, 2], T[:3, 3]
    sine = math.hypot(u[0], u[1])
    theta, sign = _smaller(math.atan2(u[0], -u[1]), 1.0)
    normal = sign * np.array([-u[1], u[0], 0.0]) / sine
    # across the first axis and the normal
    side = np.array([-normal[1], normal[0], 0.0])
    along = float(p @ side) / float(u @ side)
    d, a = float(p[2] - along * u[2]), float(p @ normal)
    alpha = math.atan2(sign * sine, u[2])
    return DhRow("", a=_whole(a, ROUNDING * size), d=_whole(d, ROUNDING * size), theta=theta, alpha=alpha)


def _smaller(theta: float, a: float) -> tuple[float, float]:
    """Of the two directions of a normal the one within a quarter turn of x."""
    if abs(theta) > 0.5 * math.pi + ROUNDING:
        theta, a = theta - math.copysign(math.pi, theta), -a
    return _whole(theta, ROUNDING), a


LARGEST = 2**20
"""Bytes of a file; the table of a hundred joints has ten thousand."""


def table_text(path: Path) -> str:
    """The text of a file with a table of joints, see `vjm.io.files.small_text`."""
    return small_text(path, LARGEST, "no table of joints is")


def table_robot(table: DhTable, file: str, reading: Reading, notes: Notes) -> Robot:
    """The robot of a table, see `serial_robot`; angles beyond a whole turn are doubted, and taken within one."""
    rows = []
    for row in table.rows:
        angles = {key: getattr(row, key) for key in ANGLES}
        if beyond := [key for key, angle in angles.items() if abs(angle) > WHOLE_TURN]:
            notes.doubtful.append(
                f"joint '{row.name}': {beyond[0]} = {printed(angles[beyond[0]])} rad is beyond a whole turn: is it "
                "in another unit?"
            )
        alpha, theta, beta = (math.remainder(angles[key], WHOLE_TURN) for key in ANGLES)
        rows.append(replace(row, alpha=alpha, theta=theta, beta=beta))
    steps = replace(table, rows=tuple(rows)).steps()
    return serial_robot(table.name, rows, steps, file, reading, notes, table.base, table.tool)


def serial_robot(
    name: str,
    joints: Sequence[DhRow],
    steps: Sequence[Placing],
    file: str,
    reading: Reading,
    notes: Notes,
    base: Placing | None = None,
    tool: Placing | None = None,
) -> Robot:
    """A robot whose joints turn about, or slide along, the z axes of their frames, from base to tool.

    The steps are those of `DhTable.steps`. Offsets that cancel are moved along the joints' axes, and the notes say
    so. The base lies in the world, the tool behind the last step.

    Raises:
        ModelFileError: lengths beyond 100 m that do not cancel, or reversed limits that are not to be repaired.
    """
    for what, placing, most in (
        *(("a step between the frames of two joints", step, FARTHEST * LONGEST_MM) for step in steps),
        ("its base", base, LONGEST_MM),
        ("its tool", tool, LONGEST_MM),
    ):
        if placing is not None and _longest([placing]) > most:
            raise ModelFileError(
                f"{file}: {what} is {printed(_longest([placing]) / 1e3)} m long: is it in mm? Correct the unit"
            )
    near, moved = _brought_near(steps)
    if moved:
        notes.changed.append(
            f"offsets of {printed(_longest(steps) / 1e3)} m lead along nearly parallel axes and back: the frames "
            f"of {', '.join(joints[k].name for k in moved)} were moved along their axes, to where the steps "
            f"between frames have {printed(_longest(near) / 1e3, 4)} m at most. Motions are the same"
        )
        if _longest(steps) > FARTHEST * _longest(near):
            # of doubles, 2e-16 of the number
            known = printed(_longest(steps) * np.finfo(float).eps, 2)
            notes.doubtful.append(f"offsets so long have no more digits than to {known} mm")
    elif _longest(steps) > LONGEST_MM:
        raise ModelFileError(
            f"{file}: has a step of {printed(_longest(steps) / 1e3)} m between the frames of two joints, and none "
            "leads back: are lengths in mm? Correct the unit"
        )
    root, parent = "base", "base"
    robot_joints, taken = list[RobotJoint](), {joint.name for joint in joints}

    def fixed(label: str, child: str, where: Placing | None) -> None:
        nonlocal parent
        if where is not None and not where.is_identity:
            while label in taken:
                label += "-frame"
            robot_joints.append(RobotJoint(label, "fixed", parent, child, where))
            parent = child

    fixed("robot-base", "robot-base", base)
    for k, (joint, step) in enumerate(zip(joints, near, strict=False), start=1):
        limits, home = None, 0.0
        if joint.limits is not None:
            place = FilePlace(file, f"joint '{joint.name}'")
            limits, home = taken_limits(joint.limits, joint.name, place, reading, notes, slides=joint.slides)
        kind: Kind = "slides" if joint.slides else "turns"
        link = f"link-{k}"
        robot_joints.append(RobotJoint(joint.name, kind, parent, link, step, (0.0, 0.0, 1.0), limits, home))
        parent = link
    fixed("flange", "flange", near[-1])
    fixed("tool", "tool", tool)
    bodies = {one: Body(one) for one in (root, *(joint.child for joint in robot_joints))}
    return Robot(name, root, bodies, robot_joints, {}, file, notes)


MM = {"mm": 1.0, "m": 1e3}
RADIANS = {"rad": 1.0, "deg": math.pi / 180.0}
NUMBERS = ("a", "d", "alpha", "theta", "beta", "lower", "upper")
COLUMNS = ("name", "kind", *NUMBERS)
NEEDED = ("a", "d", "alpha", "theta")
_SAYS = re.compile(r"#\s*(\w[\w.]*\s*=.*)")

Three = Annotated[list[float], Field(min_length=3, max_length=3)]


class DhUnits(Table):
    """Of the whole file."""

    length: Literal["mm", "m"]
    angle: Literal["rad", "deg"]


class DhFrame(Table):
    """A frame in the one before it."""

    xyz: Three = Field([0.0, 0.0, 0.0], description="its place")
    rpy: Three = Field([0.0, 0.0, 0.0], description="roll, pitch, yaw about the fixed axes x, y, z, in this order")


class RowTable(Table):
    """One joint; lengths and angles in the file's units."""

    name: str = ""
    kind: Literal["revolute", "prismatic"] = "revolute"
    a: float
    d: float = Field(description="offset along the joint's axis; its coordinate is added where it slides")
    alpha: float
    theta: float = Field(description="offset of the angle; the joint's coordinate is added where it turns")
    beta: float = Field(0.0, description="Hayati's angle: about y, behind alpha")
    limits: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None


class DhFile(Table):
    """The whole file."""

    convention: Literal["dh", "mdh"] = Field(description="dh: Rz Tz Tx Rx; mdh: Rx Tx Rz Tz")
    units: DhUnits
    name: str = ""
    source: str = ""
    base: DhFrame | None = Field(None, description="of the first row, in the world")
    tool: DhFrame | None = Field(None, description="of the end, behind the last row")
    joints: list[RowTable] = Field(min_length=1)

    @model_validator(mode="after")
    def _names(self) -> DhFile:
        names = [row.name for row in self.joints if row.name]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"two joints are called '{twice[0]}': rename one")
        return self


_KEYS: dict[str, type[Table]] = {"units": DhUnits, "base": DhFrame, "tool": DhFrame, "joint": RowTable}


def dh_robot(path: Path, reading: Reading) -> Robot:
    """The robot of a table's file.

    Raises:
        ModelFileError: it cannot be read, or lacks a column or the name of its convention or units.

    Example:
        >>> dh_robot(Path("puma.csv"), Reading())  # doctest: +SKIP
    """
    return table_robot(_read_table(path), path.name, reading, Notes())


def _read_table(path: Path) -> DhTable:
    """The table of a file, mm and rad."""
    text, file = table_text(path), path.name
    content = _csv_content(text, file) if path.suffix.lower() == ".csv" else toml_content(text, file)
    if "parts" in content:
        raise ModelFileError(f"{file}: is a model file: all commands read it as it is")
    table = validated(DhFile, content, file, lambda name: _KEYS.get(name, DhFile).model_fields)
    mm, rad = MM[table.units.length], RADIANS[table.units.angle]
    rows = []
    for k, row in enumerate(table.joints, start=1):
        slides = row.kind == "prismatic"
        limits = None
        if row.limits is not None:
            low, high = (limit * (mm if slides else rad) for limit in row.limits)
            limits = low, high
        angles = {key: getattr(row, key) * rad for key in ANGLES}
        rows.append(DhRow(row.name or f"joint-{k}", slides, row.a * mm, row.d * mm, limits=limits, **angles))
    name = table.name or path.name.split(".")[0]
    base, tool = (_placing(one, mm, rad) for one in (table.base, table.tool))
    return DhTable(name, table.convention, tuple(rows), base, tool)


def _placing(table: DhFrame | None, mm: float, rad: float) -> Placing:
    if table is None:
        return Placing()
    return Placing(triple(value * mm for value in table.xyz), rpy_turns([angle * rad for angle in table.rpy]))


def _csv_content(text: str, file: str) -> dict[str, Any]:
    said = "\n".join(match[1] for line in text.splitlines() if (match := _SAYS.match(line.strip())))
    content = toml_content(said, f"{file}: the comment lines at its head")
    rows = csv_rows(text, file, _head, f"has no columns: give {', '.join(NEEDED)}")
    return content | {"joints": [_csv_row(cells, where) for where, cells in rows]}


def _head(cells: list[str], where: str) -> list[str]:
    for column in cells:
        if column not in COLUMNS:
            hint = did_you_mean(column, COLUMNS) or f"; known are {', '.join(COLUMNS)}, with commas between them"
            raise ModelFileError(f"{where}: unknown column '{column}'{hint}")
    if twice := [column for column in COLUMNS if cells.count(column) > 1]:
        raise ModelFileError(f"{where}: the column {twice[0]} stands twice: take one out")
    if lacking := [column for column in NEEDED if column not in cells]:
        raise ModelFileError(f"{where}: the column {lacking[0]} is missing: add it")
    return cells


def _csv_row(cells: dict[str, str], where: str) -> dict[str, Any]:
    row: dict[str, Any] = {key: cells[key] for key in ("name", "kind") if cells.get(key)}
    numbers: dict[str, float] = {}
    for key in NUMBERS:
        if not cells.get(key):
            if key in NEEDED:
                raise ModelFileError(f"{where}: {key} is empty: give a number")
            continue
        try:
            numbers[key] = float(cells[key])
        except ValueError:
            raise ModelFileError(
                f"{where}: {key} is {cells[key]!r}, which is no number: write one with a decimal point"
            ) from None
    limits = [numbers.pop(key) for key in ("lower", "upper") if key in numbers]
    if len(limits) == 1:
        raise ModelFileError(f"{where}: has one limit of two: give lower and upper, or none")
    return row | numbers | ({"limits": limits} if limits else {})


# --- writing --------------------------------------------------------------------------------------------------


def dh_text(table: DhTable, source: str, suffix: str) -> str:
    """The file of a table, in mm and rad; every number is written exactly.

    Example:
        >>> print(dh_text(DhTable("one", "dh", (DhRow("hip", a=300.0),)), "", ".csv"))
        # convention = "dh"
        # units = { length = "mm", angle = "rad" }
        # name = "one"
        name,kind,a,d,alpha,theta
        hip,revolute,300.0,0.0,0.0,0.0
        <BLANKLINE>
    """
    head: dict[str, Any] = {
        "convention": table.convention,
        "units": {"length": "mm", "angle": "rad"},
        "name": table.name,
    }
    head |= {"source": source} if source else {}
    for key, placing in (("base", table.base), ("tool", table.tool)):
        if not placing.is_identity:
            angles = dict(placing.turns)
            head[key] = {"xyz": list(placing.shift), "rpy": [angles.get(axis, 0.0) for axis in (X, Y, Z)]}
    rows = [_row_keys(row, beta=any(one.beta for one in table.rows)) for row in table.rows]
    if suffix == ".csv":
        return _csv_text(head, rows)
    return toml_text(head | {"joints": rows})


def _row_keys(row: DhRow, *, beta: bool) -> dict[str, Any]:
    keys: dict[str, Any] = {"name": row.name, "kind": "prismatic" if row.slides else "revolute"}
    keys |= {key: getattr(row, key) + 0.0 for key in (*NEEDED, *(["beta"] if beta else []))}
    return keys | ({"limits": list(row.limits)} if row.limits else {})


def _csv_text(head: dict[str, Any], rows: list[dict[str, Any]]) -> str:
    out = io.StringIO()
    for key, value in head.items():
        out.write(f"# {toml_line(key, value)}\n")
    limited = any("limits" in row for row in rows)
    columns = [key for key in COLUMNS if key in rows[0] or (limited and key in ("lower", "upper"))]
    writer = csv.DictWriter(out, columns, restval="", lineterminator="\n")
    writer.writeheader()
    for row in rows:
        limits = dict(zip(("lower", "upper"), row.pop("limits", []), strict=False))
        writer.writerow(
            {key: repr(value) if isinstance(value, float) else value for key, value in (row | limits).items()}
        )
    return out.getvalue()
