"""What a machine costs, by a formula of its mass, its standard parts and its numbers."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

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
