"""A machine whose tool stays where it is while its lengths change: the joints turn so that it does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.io.catalogues import Row
from vjm.io.file_parameters import MachineFiles, Numbered, parameter_of
from vjm.machine.rigid_mechanism import RigidMechanism
from vjm.model.joint_limits import joint_limits
from vjm.model.machine import Machine
from vjm.model.parameters import Parameter
from vjm.rotations import Array, displacement_between

ITERATIONS = 50
"""Of Newton's method, whose steps are bounded: from far away it takes some ten."""
LARGEST_STEP = 0.5
"""rad, or of the machine's length, of one step: a larger one may end on another branch."""
REACHED = 1e-9
"""rad, or of the machine's length: residual of the tool's pose where it is reached."""
DEPENDENT = 1e-6
"""Singular value of the tool's motion, over the largest one, below which the joints do not bring it about."""


@dataclass(frozen=True, eq=False)
class ToolPlace:
    """Where the tool stands in a posture.

    Attributes:
        frame: ``(4, 4)`` of the unloaded end-effector, mm.
        rows: how many components of its pose are held: 3 for its place, 6 for its direction too.
    """

    frame: Array
    rows: int


@dataclass(frozen=True)
class HeldTool:
    """A machine with numbers whose tool is held in some postures; see `vjm.io.file_parameters.Numbered`.

    Attributes:
        numbers: of the machine.
        places: of the tool, by the label of the posture.

    Example:
        >>> held = held_tool(MachineFiles.read("planar-2r"), ["bent"])
        >>> longer = held.with_numbers({"upper.length_mm": 600.0}).machine("bent")
        >>> [round(float(v), 3) for v in RigidMechanism(longer).end_frames(coordinates(longer, "bent"))[0, :2, 3]]
        [387.253, 636.379]
    """

    numbers: Numbered
    places: Mapping[str, ToolPlace]

    @property
    def name(self) -> str:
        """Of the machine."""
        return self.numbers.name

    def keys(self) -> list[str]:
        """Keys of the numbers."""
        return self.numbers.keys()

    def unit(self, key: str) -> str:
        """Of a number; empty for none."""
        return self.numbers.unit(key)

    def number(self, key: str) -> float:
        """A number.

        Raises:
            ModelFileError: there is none of the key.
        """
        return self.numbers.number(key)

    def with_numbers(self, values: Mapping[str, float]) -> HeldTool:
        """The same with other numbers.

        Raises:
            ModelFileError: there is no number of a key.
        """
        return replace(self, numbers=self.numbers.with_numbers(values))

    def with_rows(self, rows: Mapping[str, Row]) -> HeldTool:
        """The same with other parts of a catalogue."""
        return replace(self, numbers=self.numbers.with_rows(rows))

    def machine(self, posture: str = "") -> Machine:
        """The machine in a posture, its joints turned so that the tool is in its place.

        Raises:
            ValueError: the place is out of reach, or there is no such machine.
        """
        machine = self.numbers.machine(posture)
        place = self.places.get(posture)
        return machine if place is None else _standing(machine, posture, place)

    def parameter(self, key: str, posture: str = "") -> Parameter:
        """A number as what the machine's behaviour is differentiated by, the tool held.

        Raises:
            ModelFileError: there is no such number, or it is zero, which has no size.
        """
        return parameter_of(self, key, posture, self.name)

    @property
    def with_postures(self) -> Numbered:
        """The numbers alone; of files with the postures that hold the tool, where the file names them.

        Raises:
            ValueError: a place is out of reach.
        """
        files = self.numbers
        if isinstance(files, MachineFiles):
            for label in self.places:
                if label in files.document.content.get("postures", {}):
                    machine = self.machine(label)
                    names = RigidMechanism(machine).names
                    files = files.with_posture(
                        label, dict(zip(names, coordinates(machine, label)[0].tolist(), strict=True))
                    )
        return files


def held_tool(numbers: Numbered, postures: Sequence[str]) -> HeldTool:
    """A machine whose tool is held where it is in some postures.

    Its direction is held too, where the joints can hold both: of a six-axis arm, and of an arm in a plane with
    three joints.

    Args:
        numbers: of the machine.
        postures: labels, see `vjm.in_posture`.

    Raises:
        ValueError: the machine has closed loops or several end frames, or a posture is singular: there the tool
            cannot follow.
    """
    places = {}
    for label in postures:
        machine = numbers.machine(label)
        if machine.closes or len(machine.ends) > 1:
            what = "closed loops" if machine.closes else "several end frames"
            raise ValueError(f"{machine.name}: has {what}: the tool is held of an arm with one end frame")
        rigid, q = RigidMechanism(machine), coordinates(machine, label)
        near = np.random.default_rng(0).uniform(-1.0, 1.0, (4, len(rigid.names))) * rigid.unit
        found = [_ranks(_motion(rigid, q + row)) for row in (0.0 * near[0], *near)]
        place, turn, both = (max(rank[k] for rank in found) for k in range(3))
        rows = 6 if both == place + turn else 3
        needed, here = (both, found[0][2]) if rows == 6 else (place, found[0][0])
        if here < needed:
            raise ValueError(
                f"{machine.name}, posture {label}: the arm is stretched or folded there, so that its tool cannot "
                f"stay while lengths change: give another posture"
            )
        places[label] = ToolPlace(rigid.end_frames(q)[0], rows)
    return HeldTool(numbers, places)


def coordinates(machine: Machine, label: str) -> Array:
    """Coordinates ``(1, n)`` of a posture as `RigidMechanism` has them, mm and rad."""
    return np.array(RigidMechanism(machine).posture(label), dtype=float)[None]


def _motion(rigid: RigidMechanism, q: Array) -> Array:
    """Motion ``(6, n)`` of the end-effector by what its drives set, over the coordinates' units."""
    motion: Array = rigid.linearised(q)[3][0] * ~rigid.passive
    return motion


def _ranks(motion: Array) -> tuple[int, int, int]:
    """Of the motion of the end-effector's place, of its direction, and of both."""
    place, turn, both = (
        int(np.linalg.matrix_rank(part, tol=DEPENDENT * max(float(np.linalg.norm(part)), 1e-300)))
        for part in (motion[:3], motion[3:], motion)
    )
    return place, turn, both


def _standing(machine: Machine, label: str, place: ToolPlace) -> Machine:
    """The machine with the coordinates of a posture that put its tool in its place.

    Raises:
        ValueError: it is out of reach, or beyond a limit of a joint.
    """
    rigid, q = RigidMechanism(machine), coordinates(machine, label)
    scale = np.repeat([rigid.length, 1.0], 3)[: place.rows]
    best, left = q, np.inf
    for _ in range(ITERATIONS):
        missing = displacement_between(rigid.end_frames(q)[0], place.frame)[: place.rows] / scale
        size = float(np.linalg.norm(missing))
        if size >= left and size < REACHED:
            break
        if size < left:
            best, left = q, size
        step = np.linalg.lstsq(_motion(rigid, q)[: place.rows], missing, rcond=DEPENDENT)[0]
        q = q + rigid.unit * step * min(1.0, LARGEST_STEP / max(float(np.linalg.norm(step)), LARGEST_STEP))
    if left >= REACHED:
        raise ValueError(f"{machine.name}, posture {label}: the tool's place is out of reach")
    values = dict(zip(rigid.names, best[0].tolist(), strict=True))
    joint_limits(machine).check(values)
    passive = [joint.name for joint in machine.joints]
    return replace(
        machine,
        postures={**machine.postures, label: np.array([values[name] for name in passive], dtype=float)},
        held={**machine.held, label: {name: v for name, v in values.items() if name not in passive}},
    )
