"""A serial robot of joints one behind another, as tables and controllers' calibrations describe it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vjm.io.dh_table import ANGLES, FARTHEST, DhRow, DhTable, brought_near, longest
from vjm.io.errors import ModelFileError, printed
from vjm.io.files import small_text
from vjm.io.robot import Body, Kind, Notes, Placing, Reading, Robot, RobotJoint
from vjm.io.sections import LONGEST_MM
from vjm.io.urdf_values import WHOLE_TURN, FilePlace, in_order, usable_limits

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
    """A robot whose joints turn about, or slide along, the z axes of their frames.

    Args:
        name: of the robot.
        joints: their names, motions and limits, from base to tool.
        steps: from each joint's frame to the next, see `vjm.io.dh_table.DhTable.steps`. Offsets that cancel are
            moved along the joints' axes, and the notes say so.
        file: for messages.
        reading: how limits are read that are reversed.
        notes: to which is added what is to be said.
        base: frame of the base in the world.
        tool: frame of the tool, behind the last step.

    Raises:
        ModelFileError: lengths beyond 100 m that do not cancel, or reversed limits that are not to be repaired.
    """
    for what, placing, most in (
        *(("a step between the frames of two joints", step, FARTHEST * LONGEST_MM) for step in steps),
        ("its base", base, LONGEST_MM),
        ("its tool", tool, LONGEST_MM),
    ):
        if placing is not None and longest([placing]) > most:
            raise ModelFileError(
                f"{file}: {what} is {printed(longest([placing]) / 1e3)} m long: is it in mm? Correct the unit"
            )
    near, moved = brought_near(steps)
    if moved:
        notes.changed.append(
            f"offsets of {printed(longest(steps) / 1e3)} m lead along nearly parallel axes and back: the frames of "
            f"{', '.join(joints[k].name for k in moved)} were moved along their axes, to where the steps between "
            f"frames have {printed(longest(near) / 1e3, 4)} m at most. Motions are the same"
        )
        if longest(steps) > FARTHEST * longest(near):
            # of doubles, 2e-16 of the number
            known = printed(longest(steps) * np.finfo(float).eps, 2)
            notes.doubtful.append(f"offsets so long have no more digits than to {known} mm")
    elif longest(steps) > LONGEST_MM:
        raise ModelFileError(
            f"{file}: has a step of {printed(longest(steps) / 1e3)} m between the frames of two joints, and none "
            "leads back: are lengths in mm? Correct the unit"
        )
    root, at = "base", "base"
    found, taken = list[RobotJoint](), {joint.name for joint in joints}

    def fixed(label: str, child: str, where: Placing | None) -> None:
        nonlocal at
        if where is not None and not where.is_identity:
            while label in taken:
                label += "-frame"
            found.append(RobotJoint(label, "fixed", at, child, where))
            at = child

    fixed("robot-base", "robot-base", base)
    for k, (joint, step) in enumerate(zip(joints, near, strict=False), start=1):
        limits, home = _limits(joint, file, reading, notes)
        kind: Kind = "slides" if joint.slides else "turns"
        link = f"link-{k}"
        found.append(RobotJoint(joint.name, kind, at, link, step, (0.0, 0.0, 1.0), limits, home))
        at = link
    fixed("flange", "flange", near[-1])
    fixed("tool", "tool", tool)
    bodies = {one: Body(one) for one in (root, *(joint.child for joint in found))}
    return Robot(name, root, bodies, found, {}, file, notes)


def _limits(joint: DhRow, file: str, reading: Reading, notes: Notes) -> tuple[tuple[float, float] | None, float]:
    if joint.limits is None:
        return None, 0.0
    found = in_order(joint.limits, FilePlace(file, f"joint '{joint.name}'"), reading, notes, slides=joint.slides)
    if found is None:
        return None, 0.0
    return usable_limits(*found, joint.name, slides=joint.slides, doubts=notes.doubtful, changed=notes.changed)
