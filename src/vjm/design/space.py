"""A machine whose numbers vary, made of files or of a function.

It is judged in chosen postures and under chosen loads.

Its tool can stay where it is while its lengths change: the joints turn so that it does.
"""

from __future__ import annotations

import ast
import inspect
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from vjm.design.linear_state import Question, loaded_posture
from vjm.design.modes import total_mass
from vjm.engines import VjmEngine
from vjm.io.catalogues import Row
from vjm.io.errors import ModelFileError, did_you_mean
from vjm.io.file_parameters import MachineFiles, Numbered, parameter_of, unit_of_key
from vjm.io.model_file import Model
from vjm.io.shapes import shape
from vjm.machine.rigid_mechanism import RigidMechanism
from vjm.model.joint_limits import joint_limits
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.model.parameters import Parameter
from vjm.plain_numbers import finite_numbers
from vjm.postures import Posture, assembled, in_posture
from vjm.rotations import Array, displacement_between

Made: TypeAlias = Machine | Callable[..., Machine]
PART_UNITS = {
    "length": "mm", "EA": "N", "GAy": "N", "GAz": "N", "GJ": "N mm²", "EIy": "N mm²", "EIz": "N mm²",
    "own_mass": "kg", "end_offset": "mm", "bow": "mm", "stiffness": "N/mm", "free_length": "mm", "centre": "mm",
}  # fmt: skip
"""Of the attributes of parts."""
NOT_VARIED = ("value", "limits")
"""Attributes of joints by which nothing becomes softer or heavier."""


Designed: TypeAlias = Model | Made | Numbered
"""A model file, what it holds, a machine, or a function of numbers that makes one."""


@dataclass(frozen=True)
class MachineMaker:
    """A machine made in Python.

    Attributes:
        name: of the machine.
        make: makes it of its numbers, by keyword.
        values: numbers, and rows of catalogues, by key.
        unit_of: unit of a number by its key.

    Example:
        >>> import vjm
        >>> maker = maker_of(vjm.load("planar-2r"))
        >>> maker.number("upper.length"), maker.unit("upper.length")
        (500.0, 'mm')
        >>> maker.with_numbers({"upper.length": 600.0}).machine().beams[0].length
        600.0
    """

    name: str
    make: Callable[..., Machine]
    values: Mapping[str, float | Row]
    unit_of: Callable[[str], str] = unit_of_key

    def keys(self) -> list[str]:
        """Keys of the numbers, but zeros."""
        return [key for key, value in self.values.items() if not isinstance(value, Mapping) and value]

    def unit(self, key: str) -> str:
        """Of a number; empty for none."""
        return self.unit_of(key)

    def number(self, key: str) -> float:
        """A number.

        Raises:
            ModelFileError: there is none of the key.
        """
        name, _, column = key.rpartition(".")
        row = self.values.get(name)
        value = row.get(column) if isinstance(row, Mapping) else self.values.get(key)
        if value is None or isinstance(value, Mapping | str):
            known = ", ".join(self.values)
            raise ModelFileError(
                f"{self.name}: '{key}' is no number of it{did_you_mean(key, self.values) or f'; it has {known}'}"
            )
        return value

    def with_numbers(self, values: Mapping[str, float]) -> MachineMaker:
        """The same with other numbers.

        Raises:
            ModelFileError: there is no number of a key.
        """
        now: dict[str, float | Row] = dict(self.values)
        for key, value in values.items():
            self.number(key)
            name, _, column = key.rpartition(".")
            row = now.get(name)
            if isinstance(row, Mapping):
                now[name] = {**row, column: value}
            else:
                now[key] = value
        return replace(self, values=now)

    def with_rows(self, rows: Mapping[str, Row]) -> MachineMaker:
        """The same with other parts of a catalogue."""
        return replace(self, values={**self.values, **rows})

    def machine(self, posture: str = "") -> Machine:
        """The machine with its loops closed, in a posture; see `vjm.in_posture`.

        Raises:
            ValueError: there is none of these numbers, or no such posture.
        """
        made = self.make(**self.values)
        return in_posture(made, posture or next(iter(made.postures)))[0]

    def parameter(self, key: str, posture: str = "") -> Parameter:
        """A number as what the machine's behaviour is differentiated by.

        Raises:
            ModelFileError: there is no such number, or it is zero, which has no size.
        """
        return parameter_of(self, key, posture, self.name)


def maker_of(made: Made) -> MachineMaker:
    """The numbers of a machine made in Python.

    Args:
        made: a machine, whose numbers are ``part.attribute``, ``part.section.attribute``, or ``part.attribute.1``
            for the first of several; or a function, whose numbers are its arguments.

    Raises:
        ValueError: an argument of the function has no default.
    """
    if isinstance(made, Machine):
        return MachineMaker(made.name, partial(_changed, made), dict(_numbers(made)), _part_unit)
    values: dict[str, float | Row] = {}
    for name, parameter in inspect.signature(made).parameters.items():
        if parameter.default is inspect.Parameter.empty:
            raise ValueError(f"argument '{name}' of the function has no default: give it its present value")
        values[name] = parameter.default
    return MachineMaker(getattr(made, "__name__", "machine"), made, values)


def numbered(model: Designed) -> Numbered:
    """The numbers of a machine, however it is given.

    Raises:
        ModelFileError: there is no such file.
        ValueError: an argument of a function has no default.
    """
    if isinstance(model, Machine) or callable(model):
        return maker_of(model)
    return MachineFiles.read(model) if isinstance(model, str | Path | Mapping) else model


def _numbers(machine: Machine) -> Iterator[tuple[str, float]]:
    for part in machine.parts:
        yield from _within(part.name, part)


def _within(key: str, value: object) -> Iterator[tuple[str, float]]:
    if is_dataclass(value) and not isinstance(value, type):
        for each in fields(value):
            if each.name not in NOT_VARIED:
                yield from _within(f"{key}.{each.name}", getattr(value, each.name))
    elif isinstance(value, tuple):
        for i, one in enumerate(value, start=1):
            yield from _within(f"{key}.{i}", one)
    elif isinstance(value, float) and np.isfinite(value):
        yield key, value


def _changed(machine: Machine, /, **values: float | Row) -> Machine:
    """A machine with other numbers, its loops closed anew."""
    parts = {part.name: part for part in machine.parts}
    now = dict(_numbers(machine))
    for key, value in values.items():
        if now.get(key) != value:
            # names of parts may have points
            name = max((name for name in parts if key.startswith(f"{name}.")), key=len)
            parts[name] = _with(parts[name], key[len(name) + 1 :].split("."), value)
    return assembled(replace(machine, parts=tuple(parts.values())))


def _with(owner: Any, path: list[str], value: float | Row) -> Any:  # noqa: ANN401
    head, *rest = path
    if isinstance(owner, tuple):
        i = int(head) - 1
        return (*owner[:i], _with(owner[i], rest, value) if rest else value, *owner[i + 1 :])
    if rest:
        value = _with(getattr(owner, head), rest, value)
    elif isinstance(value, Mapping):
        sizes = {name: cell for name, cell in value.items() if name != "shape"}
        return replace(owner, **{head: shape(str(value["shape"]), **sizes).stiffness()})
    return replace(owner, **{head: value})


def _part_unit(key: str) -> str:
    words = [word for word in key.split(".") if not word.isdigit()]
    if words[-1] == "mass":
        return "kg/mm" if "section" in words else "kg"
    return PART_UNITS.get(words[-1], "")


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
        ranks = [_ranks(_motion(rigid, q + row)) for row in (0.0 * near[0], *near)]
        place, turn, both = (max(rank[k] for rank in ranks) for k in range(3))
        rows = 6 if both == place + turn else 3
        needed, available = (both, ranks[0][2]) if rows == 6 else (place, ranks[0][0])
        if available < needed:
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
    return rigid.linearised(q)[3][0] * ~rigid.passive


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


# --- What a machine costs, by a formula of its mass, its standard parts and its numbers ---------------------------

OPERATIONS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow, ast.USub: operator.neg, ast.UAdd: operator.pos,
}  # fmt: skip
MASS, PARTS = "mass", "parts"
"""Names in a formula: kg of the machine, and the sum of the column ``cost`` of the chosen rows."""


@dataclass(frozen=True)
class Cost:
    """A formula of what a machine costs, in the user's currency.

    Attributes:
        formula: of numbers, ``+ - * / **`` and brackets, ``mass`` in kg, ``parts`` for the sum of the column
            ``cost`` of the chosen rows of catalogues, and keys of the machine's numbers. A key with a hyphen, or
            with a number between points, stands in quotation marks.

    Example:
        >>> price = Cost("parts + 4.2 * mass + 0.1 * upper.section.wall_mm")
        >>> round(price.value({"upper.section.wall_mm": 3.0}.__getitem__, mass=2.0, parts=30.0), 6)
        38.7
    """

    formula: str

    def __post_init__(self) -> None:
        # every name is a number here, so that only what is no formula is refused
        self.value(lambda _: 1.0, 1.0, 1.0)

    def value(self, number: Callable[[str], float], mass: float, parts: float) -> float:
        """The cost.

        Args:
            number: of a key.
            mass: of the machine, kg.
            parts: sum of the column ``cost``.

        Raises:
            ValueError: it is no formula, or no number comes out.
        """
        known = {MASS: mass, PARTS: parts}

        def found(node: ast.AST) -> float:
            match node:
                case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                    return float(value)
                case ast.Constant(value=str() as key):
                    return number(key)
                case ast.Name() | ast.Attribute():
                    key = ast.unparse(node)
                    return known[key] if key in known else number(key)
                case ast.UnaryOp(op=op, operand=inner) if type(op) in OPERATIONS:
                    return OPERATIONS[type(op)](found(inner))
                case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATIONS:
                    return OPERATIONS[type(op)](found(left), found(right))
                case _:
                    raise ValueError(
                        f"cost '{self.formula}': '{ast.unparse(node)}' is no number, mass, parts or key of a number"
                    )

        try:
            tree: Any = ast.parse(self.formula.strip(), mode="eval").body
        except SyntaxError as error:
            raise ValueError(f"cost '{self.formula}' is no formula: write one such as parts + 4.2*mass") from error
        try:
            return float(found(tree))
        except (ArithmeticError, TypeError) as error:
            raise ValueError(f"cost '{self.formula}': no number comes out: {error}") from error


NO_COST = "cost: say what a machine costs, by a formula such as parts + 4.2*mass"


class DesignCase(NamedTuple):
    """Where a machine stands, and what its end bears.

    Attributes:
        posture: label or coordinates.
        wrench: ``(6,)`` on the free end, N and N mm; None for nothing.
    """

    posture: str
    wrench: tuple[float, ...] | None = None

    @property
    def wrench_text(self) -> str:
        """The wrench as a command takes it; empty for nothing."""
        return "" if self.wrench is None else ",".join(f"{v:.12g}" for v in self.wrench)


@dataclass(frozen=True)
class LoadCases:
    """The postures and loads in which a machine is judged: each posture under each wrench is a case.

    Attributes:
        postures: labels or coordinates; the machine's first one if left out.
        wrenches: ``(6,)`` each on the free end, N and N mm; nothing if left out.
        gravity: m/s², in every case.
        loads: on parts, in every case.
        end: name of the end frame; the first if left out.
        engine: how beams become springs; as `vjm` if left out.
        weights: of the cases in what is made best, all wrenches of the first posture first; the worst case counts
            if left out. Limits hold in each case.
        hold_tool: the tool stays in its place in each posture while lengths change: the joints turn.

    Raises:
        ValueError: a wrench is not six finite numbers.

    Example:
        >>> import vjm
        >>> cases = vjm.LoadCases(["bent", "stretched"], [(0, -10, 0, 0, 0, 0)], gravity=(0, -9.81, 0))
        >>> vjm.sweep("planar-2r", {"tool.mass_kg": [1.0]}, ["deflection"], cases=cases).values.shape
        (1, 2, 1)
    """

    postures: Sequence[Posture] = ()
    wrenches: Sequence[Sequence[float]] = ()
    gravity: Gravity | None = None
    loads: Sequence[Load] = ()
    end: str = ""
    engine: VjmEngine | None = None
    weights: Sequence[float] = ()
    hold_tool: bool = False

    def __post_init__(self) -> None:
        for wrench in self.wrenches:
            finite_numbers("wrench", wrench, 6)


NO_LOADS = LoadCases()
"""The first posture, without a load."""


@dataclass(frozen=True)
class DesignSpace:
    """A machine whose numbers vary.

    Attributes:
        files: of the machine, or what makes it.
        keys: of the numbers, see `vjm.io.file_parameters.MachineFiles` and `vjm.design.space.maker_of`.
        cases: where it stands and what its end bears; it is judged in all of them.
        gravity: m/s², in every case.
        loads: on parts, in every case.
        end: name of the end frame; empty for the first.
        engine: how beams become springs; None for `vjm`'s own.
        weights: of the cases in what is made best; empty where the worst one counts.
        price: what a machine costs; None where nothing says it.
        parts_cost: sum of the column ``cost`` of the rows that were chosen.
    """

    files: Numbered
    keys: tuple[str, ...]
    cases: tuple[DesignCase, ...]
    gravity: Gravity | None = None
    loads: tuple[Load, ...] = ()
    end: str = ""
    engine: VjmEngine | None = None
    weights: tuple[float, ...] = ()
    price: Cost | None = None
    parts_cost: float = 0.0

    @property
    def units(self) -> list[str]:
        """Of the numbers."""
        return [self.files.unit(key) for key in self.keys]

    @property
    def present(self) -> Array:
        """Values ``(k,)`` in the files."""
        return np.array([self.files.number(key) for key in self.keys])

    @property
    def freed(self) -> DesignSpace:
        """The same whose tool is not held."""
        return replace(self, files=self.files.numbers) if isinstance(self.files, HeldTool) else self

    def changed(self, row: Sequence[float] | Array) -> Numbered:
        """The files with values ``(k,)``."""
        return self.files.with_numbers(dict(zip(self.keys, map(float, row), strict=True)))

    def question(self, row: Sequence[float] | Array, case: DesignCase) -> Question:
        """The machine of values ``(k,)``, with what is done to it in a case.

        Raises:
            ValueError: there is no such machine, or it cannot stand so.
        """
        return loaded_posture(
            self.changed(row).machine(case.posture), case.posture, wrench=case.wrench, gravity=self.gravity,
            loads=self.loads, end=self.end, engine=self.engine,
        )  # fmt: skip

    def cost(self, row: Sequence[float] | Array, machine: Question) -> float:
        """What the machine of values ``(k,)`` costs.

        Raises:
            ValueError: no formula says it.
        """
        if self.price is None:
            raise ValueError(NO_COST)
        return self.price.value(self.changed(row).number, total_mass(machine), self.parts_cost)

    def in_all_cases(self, values: Array, sign: float) -> float:
        """One quantity of a machine in its cases ``(c,)``: the weighted mean, or the worst.

        Args:
            values: nan where there is no answer, which the whole has none then.
            sign: 1 where less is better, else −1.
        """
        if self.weights:
            return float(np.average(values, weights=self.weights))
        return float(sign * np.max(sign * values))

    def parameters(self, row: Sequence[float] | Array, case: DesignCase) -> list[Parameter]:
        """The numbers as parameters of the machine of values ``(k,)`` in a case."""
        numbers = self.changed(row)
        return [numbers.parameter(key, case.posture) for key in self.keys]


def design_space(
    model: Designed, keys: Sequence[str], cases: LoadCases = NO_LOADS, *, cost: str = ""
) -> DesignSpace:
    """A machine whose numbers vary, in each of the postures under each of the wrenches.

    Args:
        model: a model of the library, a file, its content, a machine, or a function that makes one.
        keys: of the numbers.
        cases: in which it is judged. How a tool is held see `vjm.design.space`.
        cost: formula of what a machine costs, see `vjm.design.space.Cost`.

    Raises:
        ModelFileError: there is no such file or number.
        ValueError: no such posture, there are not as many weights as cases, the tool cannot be held, or the cost
            is no formula.
    """
    files = numbered(model)
    for key in keys:
        files.number(key)
    machine = files.machine()
    labels = []
    for posture in cases.postures or list(machine.postures)[:1]:
        machine, label = in_posture(machine, posture)
        labels.append(label)
    on_end: list[tuple[float, ...] | None] = [tuple(map(float, wrench)) for wrench in cases.wrenches]
    each = tuple(DesignCase(label, wrench) for label in labels for wrench in on_end or [None])
    weights = tuple(map(float, cases.weights))
    if weights and (len(weights) != len(each) or min(weights) < 0.0 or not 0.0 < sum(weights) < np.inf):
        raise ValueError(f"weights: give {len(each)} numbers of zero or more, one for each posture and wrench")
    price = Cost(cost) if cost else None
    if price is not None:
        price.value(files.number, 1.0, 0.0)
    if cases.hold_tool:
        files = held_tool(files, list(dict.fromkeys(labels)))
    return DesignSpace(
        files, tuple(keys), each, cases.gravity, tuple(cases.loads), cases.end, cases.engine, weights, price
    )
