"""Postures of machines by their labels, or by coordinates: of all joints in a row, or by the joints' names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from vjm.io.checks import check_postures
from vjm.machine.inverse_kinematics import postures_of
from vjm.machine.rigid_mechanism import LoopClosure, closed, home_label
from vjm.model.joint_limits import joint_limits, said_turned
from vjm.model.machine import Machine, pushed_out
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint
from vjm.plain_numbers import finite_numbers, plain_number
from vjm.rotations import rotation_from_vector

Posture: TypeAlias = str | Mapping[str, float] | Sequence[float]
"""A label; a text of numbers, ``0.1,0.2`` or ``elbow=0.2,shoulder=0.1``; or these as a sequence or by name."""


def check_machine(machine: object) -> None:
    """Refuse what is no machine, such as a model's name.

    Raises:
        TypeError: it is none.
    """
    if not isinstance(machine, Machine):
        raise TypeError(f"give a machine, as vjm.load gives it, not {machine!r}")


def in_posture(machine: Machine, posture: Posture) -> tuple[Machine, str]:
    """A machine that has a posture, and the label under which it has it.

    Args:
        machine: see `vjm.load`.
        posture: a label of the machine's; or coordinates in mm and rad of its joints, from base to tool
            without coupled ones; or by the joints' names. Of a machine with closed loops: a label, or by name all
            held joints, which the passive ones follow, or its end-effector's ``x, y, z`` from home in mm and
            perhaps ``rx, ry, rz`` in rad. Without these it keeps its direction if it has all six freedoms, else
            it turns as its loops let it.

    Returns:
        The machine itself for a label; else one that has the posture too.

    Raises:
        ValueError: no such posture, or coordinates that are too few, not finite, in degrees, beyond the joints'
            limits (naming the joint and by how much), or leave passive joints dependent.
        TypeError: it is no machine, or no posture.

    Example:
        >>> import vjm
        >>> arm, label = in_posture(vjm.load("planar-2r"), {"shoulder": 0.1, "elbow": 1.2})
        >>> label, dict(arm.held[label])
        ('0.1,1.2', {'shoulder': 0.1, 'elbow': 1.2})
    """
    check_machine(machine)
    if not isinstance(posture, str | Mapping | Sequence | np.ndarray):
        raise TypeError(f"{machine.name}: a posture is a label or coordinates, not {posture!r}")
    if isinstance(posture, str) and posture in machine.postures:
        return machine, posture
    if machine.closes:
        return _closed_in(machine, posture)
    values = _values(machine, posture)
    label = _label(values.values())
    return _standing(machine, label, values), label


def assembled(machine: Machine) -> Machine:
    """A machine whose postures were checked and whose loops are closed in them, as a model file's are.

    Raises:
        ValueError: naming a posture that leaves passive joints dependent, has a coordinate beyond a limit, or in
            which a loop does not close.
    """
    limits = joint_limits(machine)
    for label, q in machine.postures.items():
        try:
            passive = {joint.name: float(value) for joint, value in zip(machine.joints, q, strict=True)}
            limits.check({**machine.held.get(label, {}), **passive})
            machine.at(label)
            for joint, beam in machine.pushing.items():
                pushed_out(beam, machine.held[label][joint])
        except ValueError as error:
            raise ValueError(f"posture '{label}': {error}") from error
    check_postures(machine)
    return closed(machine) if machine.closes else machine


def tool_postures(
    machine: Machine, position: Sequence[float], turn: Sequence[float] | None = None, *, end: str = ""
) -> list[dict[str, float]]:
    """Joint coordinates that put the unloaded tool at a pose.

    Args:
        machine: see `vjm.load`.
        position: ``(3,)`` mm, in the world.
        turn: rotation vector ``(3,)`` rad; None where the tool may turn as it likes.
        end: name of the end frame; the first if left out.

    Returns:
        Coordinates by the joints' names, mm and rad, those of the smallest coordinates first. Each is a posture
        that `in_posture` takes.

    Raises:
        ValueError: not three finite numbers, no such end frame, or out of reach, with the distance.

    Example:
        >>> import vjm
        >>> [round(each["elbow"], 3) for each in vjm.tool_postures(vjm.load("planar-2r"), (600, 300, 0))]
        [1.471, -1.471]
    """
    check_machine(machine)
    place = np.array(finite_numbers("position", position, 3))
    R = None if turn is None else rotation_from_vector(np.array(finite_numbers("turn", turn, 3)))
    # unloaded: neither how beams are split nor springs between points matter
    model = Mechanism(replace(machine, point_springs=()))
    solutions = postures_of(model, place, R, end)
    return [{name: round(float(v), 12) for name, v in zip(model.joints, q, strict=True)} for q in solutions]


def in_posture_of(machine: Machine, label: str, other: Machine) -> Machine:
    """The machine with another's posture of a label, where it has none of it itself: coordinates given by hand."""
    if label in machine.postures:
        return machine
    return replace(
        machine,
        postures={**machine.postures, label: other.postures[label]},
        held={**machine.held, label: other.held.get(label, {})},
    )


def _closed_in(machine: Machine, posture: Posture) -> tuple[Machine, str]:
    """A machine with closed loops that has a posture, and its label.

    Raises:
        ValueError: no such posture, or the loops do not close there.
    """
    held = [part.name for part in machine.held_joints]
    known = f"x,y,z of the end-effector from home, or by name {', '.join(held) or 'no joint'}"
    if isinstance(posture, str):
        posture = _parsed(machine, posture, known)
    closing = LoopClosure(machine, home_label(machine))
    if isinstance(posture, Mapping):
        values = {name: float(value) for name, value in posture.items()}
        label = ",".join(f"{name}={value:.12g}" for name, value in values.items())
        q = closing.held(values)
    else:
        numbers = np.array(posture, dtype=float)
        if len(numbers) not in (3, 6) or not np.all(np.isfinite(numbers)):
            raise ValueError(f"{machine.name}: {len(numbers)} coordinates are no pose of it: give {known}")
        label = _label(numbers)
        # what cannot keep its direction turns as its loops let it
        turns = len(numbers) == 6 or closing.mobility(closing.home).freedom == 6
        q = closing.displaced(np.concatenate([numbers, np.zeros(6 - len(numbers))]), (True,) * 3 + (turns,) * 3)
    passive, stands = closing.posture(q)
    return replace(
        machine, postures={**machine.postures, label: passive}, held={**machine.held, label: stands}
    ), label


def _label(values: Iterable[float]) -> str:
    return ",".join(f"{float(v):.12g}" for v in values)


def _joints(chain: Machine) -> list[Joint]:
    """The joints whose coordinates a posture gives, from base to tool."""
    given = joint_limits(chain).given
    return [joint for joint in chain.moving if joint.name in given]


def _values(chain: Machine, posture: Posture) -> dict[str, float]:
    """Coordinates by name in the order of the joints.

    Raises:
        ValueError: it gives other joints than there are, or no numbers.
    """
    names = [joint.name for joint in _joints(chain)]
    known = f"its joints are {', '.join(names)}"
    if isinstance(posture, str):
        posture = _parsed(chain, posture, known)
    if not isinstance(posture, Mapping):
        if len(posture) != len(names):
            raise ValueError(f"{chain.name}: {len(posture)} coordinates for {len(names)} joints; {known}")
        posture = dict(zip(names, posture, strict=True))
    other = [name for name in posture if name not in names] or [name for name in names if name not in posture]
    if other:
        what = f"no joint '{other[0]}' to be given" if other[0] in posture else f"no coordinate for '{other[0]}'"
        raise ValueError(f"{chain.name}: {what}; {known}")
    values = {name: float(posture[name]) for name in names}
    if not np.all(np.isfinite([*values.values()])):
        raise ValueError(f"{chain.name}: coordinates must be finite; {known}")
    return values


def _parsed(chain: Machine, text: str, known: str) -> dict[str, float] | list[float]:
    """``0.1,0.2`` or ``elbow=0.2,shoulder=0.1``."""
    words = [word.partition("=") for word in text.split(",")]
    named = [bool(equals) for _, equals, _ in words]
    try:
        numbers = [plain_number(value if equals else name) for name, equals, value in words]
    except ValueError:
        raise ValueError(
            f"{chain.name} has no posture '{text}' (it has {', '.join(chain.postures)}); or give coordinates in mm "
            f"and rad: {known}"
        ) from None
    if any(named) and not all(named):
        raise ValueError(f"'{text}': give a name to every coordinate or to none; {known}")
    names = [name.strip() for name, _, _ in words]
    if all(named) and len(set(names)) < len(names):
        raise ValueError(f"'{text}': a joint stands twice")
    return dict(zip(names, numbers, strict=True)) if all(named) else numbers


def _standing(chain: Machine, label: str, values: Mapping[str, float]) -> Machine:
    """The machine with one posture more.

    Raises:
        ValueError: a coordinate is beyond its joint's limits or likely in degrees, or passive joints are dependent.
    """
    for joint in _joints(chain):
        if not joint.slides:
            said = said_turned(joint.name, values[joint.name], passive=joint.passive)
            if said:
                raise ValueError(said)
    joint_limits(chain).check(values)
    passive = [joint.name for joint in chain.joints]
    stands = np.array([values[name] for name in passive], dtype=float)
    held = {name: value for name, value in values.items() if name not in passive}
    check_postures(replace(chain, postures={label: stands}, held={label: held}))
    return replace(chain, postures={**chain.postures, label: stands}, held={**chain.held, label: held})
