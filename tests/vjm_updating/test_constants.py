"""Every number of calibration and diagnosis says where it stands what kind it is; tuned ones are counted."""

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from vjm_updating import constants

SOURCES = Path(constants.__file__).parent
KINDS = {
    "tuned", "prior_scale", "physical_bound", "stated_level", "numerical", "definition", "shown",
}  # fmt: skip
MOST_TUNED = 7
"""What was reached; ten was the aim."""
MOST_BARE = 134
"""Floats in comparisons, but for 0 and 1, that have no name: most of them are rounding."""
BY_LAW = {"experiment/mistakes"}
"""Its names are of other modules' columns."""


def numbers(source: str) -> Iterator[tuple[str, str | None]]:
    """A module's own numbers and the kinds that they are declared to be, None where there is none."""
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        names = [n.id for n in ast.walk(target) if isinstance(n, ast.Name)]
        given = [n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant)]
        if not names or not all(name.isupper() for name in names):
            continue
        if not any(isinstance(v, int | float) and not isinstance(v, bool) for v in given):
            continue
        several = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
        values = node.value.elts if several and isinstance(node.value, ast.Tuple) else [node.value]
        for name, value in zip(names, values, strict=False):
            called = isinstance(value, ast.Call) and isinstance(value.func, ast.Name)
            kind = value.func.id if called and value.func.id in KINDS else None
            # a table of texts is no number
            if kind is not None or not any(isinstance(v, str) for v in given):
                yield name, kind


def modules() -> list[tuple[str, str]]:
    found = [(path.relative_to(SOURCES).with_suffix("").as_posix(), path) for path in sorted(SOURCES.rglob("*.py"))]
    return [(name, path.read_text(encoding="utf-8")) for name, path in found if name not in BY_LAW | {"constants"}]


def test_every_number_is_declared():
    bare = [f"{module}: {name}" for module, source in modules() for name, kind in numbers(source) if kind is None]
    assert bare == [], f"say which of {', '.join(sorted(KINDS))} it is, see vjm_updating.constants"


def test_no_more_numbers_are_tuned_than_there_were():
    counted = Counter(kind for _, source in modules() for _, kind in numbers(source))
    assert sum(counted.values()) > 350
    assert counted["tuned"] <= MOST_TUNED


def test_no_more_thresholds_stand_bare_in_comparisons():
    found = 0
    for _, source in modules():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Compare):
                sides = (n for side in (node.left, *node.comparators) for n in ast.walk(side))
                found += sum(
                    isinstance(n, ast.Constant) and isinstance(n.value, float) and n.value not in (0.0, 1.0)
                    for n in sides
                )
    assert found <= MOST_BARE


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_declaration_returns_its_value(kind):
    assert getattr(constants, kind)(2.5, "mm") == 2.5


def test_a_number_without_a_declaration_is_found():
    source = "A = 3.0\nB, C = tuned(1), 2\nD = {'x': 1}\nE: float = numerical(4.0)\n"
    assert list(numbers(source)) == [("A", None), ("B", "tuned"), ("C", None), ("E", "numerical")]
