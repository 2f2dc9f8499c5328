"""Every ``match`` says what becomes of a case that it does not name: it never goes on in silence."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDERS = ("src", "fea", "validation")


def open_matches(source: str) -> list[int]:
    """Lines of the ``match`` statements whose last case is not ``_`` with ``assert_never`` or an error in it."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Match):
            continue
        match node.cases[-1]:
            case ast.match_case(
                pattern=ast.MatchAs(pattern=None, name=None),
                guard=None,
                body=[ast.Raise()] | [ast.Expr(value=ast.Call(func=ast.Name(id="assert_never")))],
            ):
                pass
            case _:
                found.append(node.lineno)
    return found


def test_every_match_ends_in_an_error():
    offences, seen = [], 0
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            source = path.read_text(encoding="utf-8")
            if not re.search(r"^ *match .*:", source, re.M):
                continue
            seen += sum(isinstance(node, ast.Match) for node in ast.walk(ast.parse(source)))
            offences += [f"{path.relative_to(ROOT)}:{line}" for line in open_matches(source)]
    assert offences == []
    assert seen >= 20


def test_open_matches_are_found():
    source = """
match part:
    case Beam():
        bend()
match part:
    case Beam():
        bend()
    case _:
        pass
match part:
    case _ if part.rigid:
        raise ValueError
match part:
    case Beam():
        bend()
    case _:
        assert_never(part)
match value:
    case int():
        count()
    case _:
        raise TypeError("no number")
"""
    assert open_matches(source) == [2, 5, 10]
