"""Options that several commands share, and how they are checked.

They are those of engines, of the load case, and ``--strict``, which refuses what is implausible about an input and
is said as a warning else.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from vjm.continuation.limits_along import limits_passed
from vjm.continuation.path import Path
from vjm.engines import Engine, EngineOptions, VjmEngine, engine_by_name
from vjm.io.findings import Finding, Grade, refuse
from vjm.io.machine_file import load_model
from vjm.io.model_file import read_document
from vjm.io.model_plausibility import findings_of, weight_findings
from vjm.model.joint_limits import beyond_measured
from vjm.model.load_case import ARC, COMPONENTS, LOAD, RAMP, TO_LIMIT, Load, LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.parts import Placement
from vjm.plain_numbers import plain_number, whole_number
from vjm.rotations import Array
from vjm_output import terminal
from vjm_validation.cli import GAVE_UP, OK, UsageError

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
Wrench = Annotated[str | None, Parameter(help="fx,fy,fz,mx,my,mz in N and N mm on the free end.")]
EndFrame = Annotated[str, Parameter(help="Name of the end frame, where the machine names some.")]


@Parameter(name="*")
@dataclass(frozen=True)
class EngineChoice:
    """How many springs or elements an engine has, where the springs sit, and whether the model's shear counts."""

    segments: Segments = None
    foot_segments: FootSegments = None
    placement: PlacementOption = Placement.BEST
    shear: Shear = None

    @property
    def sheared(self) -> bool:
        """Whether the model's shear counts; ``--shear``, which once asked finite elements for it, is told so."""
        if self.shear:
            terminal.error("--shear: is no longer needed: what the model states of shear counts in every engine")
        return self.shear is not False

    @property
    def checked(self) -> EngineOptions:
        """As engines take them.

        Raises:
            UsageError: a number makes no sense.
        """
        number, parts = segments_of(self.segments)
        positive("--foot-segments", self.foot_segments)
        return EngineOptions(number, self.foot_segments, self.placement, parts)

    def engine(self, name: str, machine: Machine) -> Engine:
        """The engine of a name for a machine.

        Raises:
            ValueError: an option makes no sense, or there is no such engine.
        """
        return engine_by_name(name, self.checked, machine)

    def lumped(self, machine: Machine) -> VjmEngine:
        """The lumped model of a machine; see `engine`."""
        engine = self.engine("vjm", machine)
        assert isinstance(engine, VjmEngine)
        return engine


ENGINE_CHOICE = EngineChoice()


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


def six_or_none(name: str, text: str | None) -> list[float] | None:
    """Six finite numbers from the text of an option; None where it is not given."""
    return None if text is None else six(name, text)


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
    size, reach = max(abs(v) for v in displacement[:3]), chain.longest
    # of joints that slide alone there is no such size
    if 0.0 < reach < size:
        raise UsageError(f"{name}: {size:g} mm is out of reach: {chain.name}'s longest part has {reach:g} mm")
    turn = max(abs(v) for v in displacement[3:])
    if turn > 3.0:
        raise UsageError(f"{name}: {turn:g} rad is out of reach: rotations end short of half a turn, at 3 rad")


def gave_up(paths: Sequence[Path]) -> int:
    """Say where paths ended early."""
    early = [path for path in paths if not path.complete]
    for path in early:
        terminal.error(f"{path.engine}, posture {path.load_case.posture}: {path.stopped}")
    return GAVE_UP if early else OK


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


@Parameter(name="*")
@dataclass(frozen=True)
class ActingLoads:
    """Weight and loads on parts."""

    gravity: GravityOption = ""
    load: LoadOption = ()

    @property
    def acceleration(self) -> tuple[float, float, float] | None:
        """In m/s²; see `acceleration`."""
        return acceleration(self.gravity)

    @property
    def parsed(self) -> list[Load]:
        """The loads on parts; see `parsed_load`."""
        return [parsed_load(text) for text in self.load]

    def words(self, *wrenches: str | None) -> list[str]:
        """What acts, with wrenches on the end, as people read it."""
        return [
            *(f"wrench {text} N, N mm on the end" for text in wrenches if text),
            *(f"load {text} N, N mm" for text in self.load),
            *([f"weight by {self.gravity} m/s²"] if self.gravity else []),
        ]


NO_LOADS = ActingLoads()


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
    place, fraction = _place(words[0] if words else "")
    try:
        numbers = [plain_number(word) for word in tail.split(",")]
    except ValueError:
        raise ValueError(f"--load {text}: '{tail}' is not three or six numbers separated by commas") from None
    if len(words) > 1 or len(numbers) not in (3, 6):
        raise ValueError(f"--load {text}: write [part@fraction:]fx,fy,fz[,mx,my,mz][:follower][:constant]")
    wrench = tuple(numbers + [0.0] * (6 - len(numbers)))
    return Load(wrench, place, fraction, "follower" in flags, ramped and "constant" not in flags)


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
    part, fraction = _place(place)
    return PointControl(part, fraction, _three("--control", direction))


def _three(name: str, text: str) -> tuple[float, float, float]:
    try:
        a, b, c = (plain_number(word) for word in text.split(","))
    except ValueError:
        raise ValueError(f"{name}: '{text}' is not three numbers separated by commas") from None
    return a, b, c


Strict = Annotated[
    bool, Parameter(name="--strict", negative="", help="Refuse what is doubtful, such as a mistaken unit.")
]


def warn(findings: Iterable[Finding]) -> None:
    """Each finding as a line on standard error."""
    for finding in findings:
        word = "note" if finding.grade is Grade.NOTED else "warning"
        terminal.error(f"{word}: {finding}")


def considered(model: str, strict: bool, *, weighed: bool = False) -> list[Finding]:
    """What is implausible about a model, said as warnings; ``weighed``: also about one that has its weight.

    Raises:
        ModelFileError: it cannot be read.
        ImplausibleError: it is refused, see `vjm.io.findings.refuse`.
    """
    findings = findings_of(model)
    if weighed:
        findings += weight_findings(load_model(model), read_document(model).file)
    refuse(findings, strict=strict)
    warn(findings)
    return findings


def beyond_calibration(machine: Machine, coordinates: Mapping[str, Array], strict: bool) -> list[Finding]:
    """Joints that stand where a calibrated model was not measured, said as warnings.

    Args:
        machine: that is asked.
        coordinates: ``(g,)`` of joints by name, rad or mm.
        strict: whether it is refused.

    Raises:
        ImplausibleError: in strict use there is one.
    """
    messages = beyond_measured(machine, coordinates)
    findings = [Finding(Grade.DOUBTFUL, f"{machine.name}: [calibrated.valid_within]", one) for one in messages]
    refuse(findings, strict=strict)
    warn(findings)
    return findings


def along_paths(chain: Machine, traced: Sequence[tuple[Engine, Path]], strict: bool) -> list[Finding]:
    """Joints that paths lead beyond their limits, said as warnings; of engines whose coordinates are the joints'.

    Raises:
        ImplausibleError: in strict use there is one.
    """
    findings = [
        Finding(
            Grade.DOUBTFUL,
            f"{path.model}, posture {path.load_case.posture}, {path.engine}",
            passed.words,
        )
        for engine, path in traced
        if isinstance(engine, VjmEngine) and path.points
        for passed in limits_passed(engine.problem(chain, path.load_case).model, path)
    ]
    refuse(findings, strict=strict)
    warn(findings)
    return findings
