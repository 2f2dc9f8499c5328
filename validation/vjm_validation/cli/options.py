"""Options that several commands share, and how they are checked."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Annotated

from cyclopts import Parameter

from vjm.continuation.path import Path
from vjm.engines import FROZEN, EngineOptions
from vjm.model.machine import Machine
from vjm.model.parts import Placement
from vjm.plain_numbers import plain_number, whole_number
from vjm_output import terminal
from vjm_validation.cli.status import GAVE_UP, OK, UsageError

MOST = 100_000
"""Of springs, elements and steps: more fit in no working memory, and tell nothing that these do not."""

Segments = Annotated[
    str | None,
    Parameter(
        name="--segments",
        help="Springs or elements in every beam that has no number of its own, or by part: link=16,foot=4.",
    ),
]
FootSegments = Annotated[int | None, Parameter(name="--foot-segments", help="Springs in the foot; 1 by default.")]
PlacementOption = Annotated[
    Placement,
    Parameter(name="--placement", help="Where a spring sits in its segment: end, middle, two-thirds or best."),
]
Shear = Annotated[
    bool | None,
    Parameter(
        name="--shear",
        negative="--no-shear",
        show_default=False,
        help="Leave out the shear that the model states; by default every engine has it.",
    ),
]
Axis = Annotated[
    str, Parameter(help="x, y, z, rx, ry, rz, a direction dx,dy,dz, or load: the factor on every --load.")
]
Free = Annotated[str, Parameter(help="Components of the pose that are free, such as rx,ry,rz.")]
Force = Annotated[
    bool, Parameter(negative="", help="Drive a dead force or moment along --axis, N or N mm, instead of the pose.")
]
Jobs = Annotated[int, Parameter(help="Processes; one a core by default.")]
Json = Annotated[bool, Parameter(name="--json", negative="", help="Print one JSON document and nothing else.")]
Posture = Annotated[
    str | None,
    Parameter(
        allow_leading_hyphen=True,
        help="Label of a posture, or coordinates in mm and rad: of an arm 0.1,0.2 or elbow=0.2,shoulder=0.1, of a "
        "manipulator x,y,z from home.",
    ),
]
Model = Annotated[str, Parameter(help="A model of the library, or a path to a model file.")]


def engine_options(segments: str | None, foot_segments: int | None, placement: Placement) -> EngineOptions:
    """What the command line says about an engine, checked."""
    number, parts = segments_of(segments)
    positive("--foot-segments", foot_segments)
    return EngineOptions(number, foot_segments, placement, parts)


def with_shear(shear: bool | None) -> bool:
    """Whether the model's shear counts; ``--shear``, which once asked finite elements for it, is told so."""
    if shear:
        terminal.error("--shear: is no longer needed: what the model states of shear counts in every engine")
    return shear is not False


def segments_of(text: str | None) -> tuple[int | None, tuple[tuple[str, int], ...]]:
    """``16``, ``link=16,foot=4`` or ``8,foot=4``: the number for every beam, and the numbers by part."""
    number, parts = None, []
    for word in text.split(",") if text is not None else ():
        part, equals, count = word.rpartition("=")
        try:
            value = whole_number(count)
        except ValueError:
            raise UsageError(
                f"--segments: '{word}' is no whole number and no part=number, such as link=16"
            ) from None
        positive("--segments", value)
        if equals:
            parts.append((part.strip(), value))
        else:
            number = value
    return number, tuple(parts)


def positive(name: str, value: int | None) -> None:
    """Refuse a number below one."""
    if value is not None and value < 1:
        raise UsageError(f"{name}: must be at least 1, not {value}")
    if value is not None and value > MOST:
        raise UsageError(f"{name}: must be at most {MOST}, not {value:g}")


def processes(jobs: int) -> int:
    """Number of processes; one a core for zero."""
    if jobs < 0:
        raise UsageError(f"--jobs: must be at least 1, not {jobs}")
    return jobs or len(os.sched_getaffinity(0))


def six(name: str, text: str) -> list[float]:
    """Six finite numbers from text."""
    try:
        values = [plain_number(word) for word in text.split(",")]
    except ValueError:
        raise UsageError(f"{name}: '{text}' is not six numbers separated by commas") from None
    if len(values) != 6:
        raise UsageError(f"{name}: needs six numbers separated by commas, got {len(values)}")
    if not all(abs(value) < float("inf") for value in values):
        raise UsageError(f"{name}: must be finite, got '{text}'")
    return values


def within_reach(name: str, chain: Machine, displacement: Sequence[float]) -> None:
    """Refuse displacements that leave the machine's own size: no spring is linear there."""
    size, reach = max(abs(v) for v in displacement[:3]), chain.characteristic_length
    if size > reach:
        raise UsageError(f"{name}: {size:g} mm is out of reach: {chain.name}'s longest part has {reach:g} mm")
    turn = max(abs(v) for v in displacement[3:])
    if turn > 3.0:
        raise UsageError(f"{name}: {turn:g} rad is out of reach: rotations end short of half a turn, at 3 rad")


def gave_up(paths: Sequence[Path]) -> int:
    """Say where paths ended early; an engine that stops at its first event by its nature has not given up."""
    early = [path for path in paths if not path.complete and path.engine != FROZEN]
    for path in early:
        terminal.error(f"{path.engine}, posture {path.load_case.posture}: {path.stopped}")
    return GAVE_UP if early else OK
