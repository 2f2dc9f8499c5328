"""Tables of Denavit and Hartenberg, in both conventions, and the frames of joints that they say.

``dh``, the distal convention: ``Rz(θ) Tz(d) Tx(a) Rx(α)`` leads from a joint's axis, which is z, to the next one.
``mdh``, the modified one of Craig: ``Rx(α) Tx(a) Rz(θ) Tz(d)`` leads from the axis before to behind the joint. The
coordinate of a joint that turns is added to θ, that of one that slides to d.

The common normal of two nearly parallel axes lies far away, and goes anywhere with the smallest change of an angle.
Hayati's fifth parameter β, a turn about y behind α, takes its place: d is zero there. Without it two offsets d of
hundreds of metres lead along such axes and back.

Sources: S. Hayati and M. Mirmirani, J. Robotic Systems 2 (1985) 397; J. J. Craig, Introduction to Robotics.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from vjm.io.errors import printed
from vjm.io.robot import Placing, turned
from vjm.rotations import Array, frame, inverse_frame, roll_pitch_yaw

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


def placed(placing: Placing) -> Array:
    """The frame ``(4, 4)`` of a placing, mm."""
    return frame(turned(placing.turns), placing.shift)


def placing_of(T: Array, size: float) -> Placing:
    """A frame as a shift and turns about z, y and x, without what rounding leaves of zero.

    Args:
        T: ``(4, 4)``, mm.
        size: of the machine, mm.
    """
    roll, pitch, yaw = roll_pitch_yaw(T[:3, :3])
    x, y, z = (_whole(v, ROUNDING * size) for v in T[:3, 3])
    turns = ((Z, yaw), (Y, pitch), (X, roll))
    return Placing((x, y, z), tuple((axis, angle) for axis, angle in turns if abs(angle) > ROUNDING))


def _whole(value: float, rounding: float) -> float:
    """A number, zero where rounding leaves no more of it."""
    return float(value) if abs(value) > rounding else 0.0


# --- offsets that cancel --------------------------------------------------------------------------------------


def brought_near(steps: Sequence[Placing]) -> tuple[list[Placing], list[int]]:
    """The steps with joints' frames moved along their axes, where that halves the lengths at least.

    A frame may stand anywhere on its joint's axis. Behind a nearly parallel axis it is put where its own axis meets
    the plane across the other one, so that no offset is left between the two. It is done where offsets cancel: most
    of the sum of the steps' lengths then leads forth and back.

    Args:
        steps: as `DhTable.steps` has them.

    Returns:
        The steps, and the numbers of the joints that were moved, from zero; the same steps and none where lengths
        do not cancel.
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


def longest(steps: Sequence[Placing]) -> float:
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
    moved = brought_near(table.steps())[1]
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
    it; a may be negative then. Along exactly parallel axes d is zero, and the offset stands in the row behind them.

    Args:
        chain: the machine.
        convention: of the table.
        parallel: what nearly parallel axes get: Hayati's β, or offsets that cancel.

    Raises:
        ValueError: offsets would be so large that digits are lost; it names the joints.

    Example:
        >>> steps = (np.eye(4), frame(np.eye(3), [500.0, 0.0, 20.0]), frame(np.eye(3), [300.0, 0.0, 0.0]))
        >>> table = dh_table(SerialChain("two", (DhRow("a"), DhRow("b")), steps), "dh")
        >>> [(row.a, row.d) for row in table.rows]
        [(500.0, 0.0), (300.0, 20.0)]
    """
    size = _length(brought_near([placing_of(step, 0.0) for step in chain.steps])[0])
    base = _base(chain.steps[0])
    rest, found = inverse_frame(base) @ chain.steps[0], list[DhRow]()
    for step in chain.steps[1:-1]:
        row, rest = _split(rest @ step, size, hayati=parallel == "beta")
        found.append(row)
    end = rest @ chain.steps[-1]
    found.append(_last(end, size, hayati=parallel == "beta"))
    tool = inverse_frame(_frame_of(found[-1])) @ end
    normals = found
    if convention == "mdh":
        last = found[-1]
        tool = _frame_of(replace(last, theta=0.0, d=0.0)) @ tool
        normals = [DhRow(""), *found[:-1]]
    rows = tuple(
        replace(joint, theta=own.theta, d=own.d, a=normal.a, alpha=normal.alpha, beta=normal.beta)
        for joint, own, normal in zip(chain.joints, found, normals, strict=True)
    )
    far = [row for row in rows if abs(row.d) > FARTHEST * size]
    if far:
        raise ValueError(
            f"the axes at {', '.join(row.name for row in far)} are so nearly parallel that offsets of "
            f"{printed(max(abs(row.d) for row in far) / 1e3, 3)} m would lose digits: write them with beta"
        )
    return DhTable(chain.name, convention, rows, placing_of(base, size), placing_of(tool, size))


def _frame_of(row: DhRow) -> Array:
    return placed(_step(row, row))


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
    return placed(Placing((x, y, z), turns))


def _split(T: Array, size: float, *, hayati: bool) -> tuple[DhRow, Array]:
    """A frame as a row of ``dh``, and the turn about z with the shift along it that lead on from there."""
    u = T[:3, 2]
    sine = math.hypot(u[0], u[1])
    parallel = sine < (NEARLY_PARALLEL if hayati else ROUNDING)
    row = _parallel(T, size) if parallel else _common_normal(T, size)
    rest = inverse_frame(_frame_of(row)) @ T
    angle = math.atan2(rest[1, 0], rest[0, 0])
    return row, placed(Placing((0.0, 0.0, float(rest[2, 3])), ((Z, angle),)))


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
