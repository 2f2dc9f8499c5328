"""What virtual experiments are made on: parts of a chain between passive joints, taken out and clamped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import assert_never

import numpy as np

from vjm.io.errors import did_you_mean
from vjm.model.joints import Joint
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Part, RigidOffset
from vjm.rotations import Array, frame, rotate_matrix6, shift_compliance, translation

BETWEEN = ".."
"""Stands between the first and the last part of a range."""
POSTURE = "-"
"""Label of the only posture of a chain without joints."""


@dataclass(frozen=True)
class Specimen:
    """An elastic body between a clamped root and a loaded tip.

    Attributes:
        name: of the part or range.
        axes: in words, those of the compliance.
        meshed: the body and the number of elements for each of its beams, at refinement n.
        theory: its compliance ``(6, 6)`` by linear beam theory.
        given: the compliance ``(6, 6)`` that the model file states, where it does.
    """

    name: str
    axes: str
    meshed: Callable[[int], tuple[Machine, int]]
    theory: Array
    given: Array | None = None


def part_specimen(chain: Machine, name: str) -> Specimen:
    """One part, or the parts ``first..last``, of a chain.

    One beam is taken alone, as one member, in its own axes, as the model file states its compliance. A range is
    taken whole, with all members, in the axes of the chain frame at its root.

    Raises:
        ValueError: no such part, nothing elastic in it, a passive joint inside, or a beam without a section.
    """
    first, _, last = name.partition(BETWEEN)
    names = [part.name for part in chain.parts]
    for one in (first, last or first):
        if one not in names:
            raise ValueError(
                f"--part: {chain.name} has no part '{one}' (it has {', '.join(names)}){did_you_mean(one, names)}"
            )
    start, end = names.index(first), names.index(last or first)
    if end < start:
        raise ValueError(f"--part: '{last}' comes before '{first}' in {chain.name}: write {last}{BETWEEN}{first}")
    parts = chain.parts[start : end + 1]
    if len(parts) == 1 and isinstance(parts[0], Beam):
        member = replace(parts[0], own_frame=np.eye(3), count=1)
        body = _alone(name, (member,))
        return Specimen(name, "the part's own", _same(body), member.beam_compliance(), member.compliance)
    _check_range(name, parts)
    body = _alone(name, parts)
    return Specimen(name, f"chain frame at the root of '{first}'", _same(body), series_compliance(body))


def series_compliance(chain: Machine) -> Array:
    """Compliance ``(6, 6)`` at the tip of beams, offsets and drives in series, base axes, by linear beam theory.

    Raises:
        ValueError: a beam without a section, or a joint, which has a coordinate or moves freely.
    """
    frames, T = [], chain.base
    for part in chain.parts:
        frames.append(T)
        match part:
            case RigidOffset():
                T = T @ part.transform
            case Beam():
                T = T @ translation(part.tip)
            case Joint(free=True):
                raise ValueError(f"part '{part.name}' is a passive joint: it moves freely")
            case Joint(fixed=False):
                raise ValueError(f"part '{part.name}' is a joint with a coordinate: name the beams beside it alone")
            case Joint():
                pass
            case _:
                assert_never(part)
    C = np.zeros((6, 6))
    for part, at in zip(chain.parts, frames, strict=True):
        R, p = at[:3, :3], at[:3, 3]
        if isinstance(part, Beam):
            own = rotate_matrix6(part.beam_compliance(), R @ part.own_frame)
            C += shift_compliance(own, T[:3, 3] - p - R @ part.tip)
        elif isinstance(part, Joint):
            axis = R @ part.axis
            moves = np.append(axis, np.zeros(3))
            if not part.slides:
                moves = np.append(np.cross(axis, T[:3, 3] - p), axis)
            C += part.compliance * np.outer(moves, moves)
    return C


def _check_range(name: str, parts: tuple[Part, ...]) -> None:
    joints = [part.name for part in parts if isinstance(part, Joint) and part.free]
    if joints:
        raise ValueError(
            f"--part {name}: '{joints[0]}' is a passive joint, which moves freely: take parts between joints"
        )
    if not any(isinstance(part, Beam) for part in parts):
        raise ValueError(f"--part {name}: nothing in it is a beam: it deflects in no direction that can be meshed")


def _alone(name: str, parts: tuple[Part, ...]) -> Machine:
    for part in parts:
        if isinstance(part, Beam):
            part.effective_section()
    return Machine(name, parts, base=frame(), postures={POSTURE: np.zeros(0)})


def _same(body: Machine) -> Callable[[int], tuple[Machine, int]]:
    return lambda n: (body, n)
