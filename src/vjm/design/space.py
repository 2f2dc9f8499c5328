"""A machine whose files' numbers vary, in the postures and under the loads in which it is judged."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from vjm.design.held_tool import HeldTool, held_tool
from vjm.design.linear_state import Question, question
from vjm.design.maker import Designed, numbered
from vjm.design.masses import total_mass
from vjm.io.file_parameters import Numbered
from vjm.model.load_case import Load
from vjm.model.mechanism import Gravity
from vjm.model.parameters import Parameter
from vjm.postures import Posture, in_posture
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine

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
            if len(wrench) != 6 or not np.all(np.isfinite(wrench)):
                raise ValueError(f"wrench must be six finite numbers, got {list(wrench)}")


NO_LOADS = LoadCases()
"""The first posture, without a load."""


@dataclass(frozen=True)
class DesignSpace:
    """A machine whose numbers vary.

    Attributes:
        files: of the machine, or what makes it.
        keys: of the numbers, see `vjm.io.file_parameters.MachineFiles` and `vjm.design.maker.maker_of`.
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
        return question(
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
        there = self.changed(row)
        return [there.parameter(key, case.posture) for key in self.keys]


def design_space(
    model: Designed, keys: Sequence[str], cases: LoadCases = NO_LOADS, *, cost: str = ""
) -> DesignSpace:
    """A machine whose numbers vary, in each of the postures under each of the wrenches.

    Args:
        model: a model of the library, a file, its content, a machine, or a function that makes one.
        keys: of the numbers.
        cases: in which it is judged. How a tool is held see `vjm.design.held_tool`.
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
