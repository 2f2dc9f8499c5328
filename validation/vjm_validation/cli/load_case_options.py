"""What the command line says of a load case: what is free, loads, weight, and what controls the path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from cyclopts import Parameter

from vjm.model.load_case import ARC, COMPONENTS, LOAD, RAMP, TO_LIMIT, Load, LoadCase, PointControl
from vjm.plain_numbers import plain_number

GravityOption = Annotated[
    str,
    Parameter(name="--gravity", help="gx,gy,gz in m/s2: the parts get their weight."),
]
LoadOption = Annotated[
    tuple[str, ...],
    Parameter(
        name="--load",
        help="[part@fraction:]fx,fy,fz[,mx,my,mz][:follower][:constant], N and N mm; may be repeated.",
    ),
]


def parsed_load_case(
    posture: str,
    to: float,
    *,
    axis: str = "x",
    force: bool = False,
    steps: int | None = None,
    branch: int = 1,
    free: str = "",
    loads: Sequence[str] = (),
    gravity: str = "",
    control: str = RAMP,
    imperfection: float = 0.0,
) -> LoadCase:
    """The load case of a command's options.

    Args:
        posture: label.
        to: end of the ramp: mm or rad, or with ``force`` N or N mm, or a load factor.
        axis: driven component, a direction ``dx,dy,dz`` (or six numbers), or ``load``.
        force: a dead force or moment along ``axis`` is driven, and the end-effector is free there.
        steps: equal steps.
        branch: +1, −1 or 0.
        free: components, separated by commas.
        loads: each ``[part[@fraction]:]fx,fy,fz[,mx,my,mz][:follower][:constant]``.
        gravity: three numbers, m/s².
        control: ``ramp``, ``arc``, ``limit``, or ``part@fraction:dx,dy,dz``.
        imperfection: mm.

    Raises:
        ValueError: one option makes no sense; the message names it.
    """
    let_go = tuple(word.strip() for word in free.split(",") if word.strip())
    acting = [parsed_load(text, ramped=axis == LOAD) for text in loads]
    if force:
        if axis == LOAD:
            raise ValueError("--force: it drives a force along --axis, which must be a component of the pose")
        unit = [float(name == axis) for name in COMPONENTS]
        if axis not in COMPONENTS:
            raise ValueError(f"--force: --axis must be one of {', '.join(COMPONENTS)}, not '{axis}'")
        acting.append(Load(tuple(unit)))
        let_go = (axis, *(name for name in let_go if name != axis))
        axis = LOAD
    try:
        return LoadCase(
            posture, to, _direction(axis), steps, branch, let_go, tuple(acting),
            acceleration(gravity), _control(control), imperfection,
        )  # fmt: skip
    except ValueError as error:
        raise ValueError(f"the load case makes no sense: {error}") from error


def _direction(axis: str) -> str | tuple[float, ...]:
    """A component, or a direction's six numbers, its shift of length one: the ramp stays in mm."""
    if "," not in axis:
        return axis
    try:
        numbers = [plain_number(word) for word in axis.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 6):
        raise ValueError(f"--axis {axis}: write a component, or three or six numbers separated by commas")
    size = math.hypot(*numbers[:3]) or 1.0
    return tuple(v / size for v in (*numbers, *[0.0] * (6 - len(numbers))))


def acceleration(text: str) -> tuple[float, float, float] | None:
    """``--gravity`` in m/s², None where it is not given.

    Raises:
        ValueError: it is not three numbers.
    """
    return _three("--gravity", text) if text else None


def parsed_load(text: str, *, ramped: bool = False) -> Load:
    """One ``--load``.

    Raises:
        ValueError: it does not say a load; the message shows how.
    """
    *words, tail = text.split(":") if ":" in text else ["", text]
    flags = set()
    while tail in ("follower", "constant") and words:
        flags.add(tail)
        tail = words.pop()
    place, at = _place(words[0] if words else "")
    try:
        numbers = [plain_number(word) for word in tail.split(",")]
    except ValueError:
        raise ValueError(f"--load {text}: '{tail}' is not three or six numbers separated by commas") from None
    if len(words) > 1 or len(numbers) not in (3, 6):
        raise ValueError(f"--load {text}: write [part@fraction:]fx,fy,fz[,mx,my,mz][:follower][:constant]")
    wrench = tuple(numbers + [0.0] * (6 - len(numbers)))
    return Load(wrench, place, at, "follower" in flags, ramped and "constant" not in flags)


def _place(text: str) -> tuple[str, float]:
    part, _, fraction = text.partition("@")
    try:
        return part, plain_number(fraction or "1")
    except ValueError:
        raise ValueError(f"'{text}': '{fraction}' is no fraction of the part's length") from None


def _control(text: str) -> str | PointControl:
    if text in (RAMP, ARC, TO_LIMIT):
        return text
    place, separator, direction = text.partition(":")
    if not separator:
        raise ValueError(f"--control {text}: write {RAMP}, {ARC}, {TO_LIMIT} or part@fraction:dx,dy,dz")
    part, at = _place(place)
    return PointControl(part, at, _three("--control", direction))


def _three(name: str, text: str) -> tuple[float, float, float]:
    try:
        a, b, c = (plain_number(word) for word in text.split(","))
    except ValueError:
        raise ValueError(f"{name}: '{text}' is not three numbers separated by commas") from None
    return a, b, c
