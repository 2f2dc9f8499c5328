"""How a wrong model file is reported: one line that names the file, the key and the remedy."""

from __future__ import annotations

import difflib
import math
import reprlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar, get_args

import pydantic
from pydantic_core import ErrorDetails
from pydantic_core.core_schema import ErrorType

Checked = TypeVar("Checked", bound=pydantic.BaseModel)
KnownKeys = Callable[[str], Iterable[str]]
"""The keys that a table may have, by the table's tag: a kind of part, a kind of section, the name of another table,
or the empty string for the document itself."""
LONGEST = 2000
"""Characters of a message; of a longer one its middle is left out."""


class ModelFileError(ValueError):
    """A model file cannot be read or describes no sane machine; its text is one line.

    Example:
        >>> import vjm
        >>> try:
        ...     vjm.load("planar-3r")
        ... except vjm.ModelFileError as error:
        ...     print("planar-2r" in str(error))
        True
    """

    def __init__(self, message: str) -> None:
        # a quoted key may hold a line break, or a whole file
        line = " ".join(message.split())
        super().__init__(line if len(line) <= LONGEST else f"{line[: LONGEST // 2]} … {line[-LONGEST // 2 :]}")


@contextmanager
def naming(where: str) -> Iterator[None]:
    """Put a file, or what of it, before what is refused within.

    Raises:
        ModelFileError: of any other ValueError.
    """
    try:
        yield
    except ValueError as error:
        raise ModelFileError(f"{where}: {error}") from error


def printed(value: float, digits: int = 6) -> str:
    """A number as people write it: ``1.1e-4``, not ``0.00011`` or ``1.1e-04``."""
    value = float(f"{value:.{digits}g}")
    if not math.isfinite(value):
        return str(value)
    if value == 0.0 or 1e-2 <= abs(value) < 1e6:
        return f"{value:.6g}"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa.rstrip('0').rstrip('.')}e{int(exponent)}"


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """``"; did you mean 'x'?"`` where something known is close to ``word``, else nothing."""
    close = difflib.get_close_matches(word, list(known), n=1)
    return f"; did you mean '{close[0]}'?" if close else ""


def validated(
    kind: type[Checked], content: Mapping[str, Any], where: str, known_keys: KnownKeys | None = None,
    context: Collection[str] = (),
) -> Checked:  # fmt: skip
    """A document, as TOML gives it, as a table of a kind, each key of its type.

    Raises:
        ModelFileError: a key is missing, unknown or of another type; one line.
    """
    try:
        return kind.model_validate(content, context=context)
    except pydantic.ValidationError as error:
        said = one_line(error, content, known_keys or (lambda _: kind.model_fields))
        raise ModelFileError(f"{where}: {said}") from error


def one_line(error: pydantic.ValidationError, document: Mapping[str, Any], known_keys: KnownKeys) -> str:
    """The first thing that is wrong with a document, and how many more there are."""
    # a misspelt key is also a missing one: the misspelling is the better news
    details = sorted(error.errors(include_url=False), key=lambda one: one["type"] != "extra_forbidden")
    more = f" (and {len(details) - 1} more)" if len(details) > 1 else ""
    return _sentence(details[0], document, known_keys) + more


def every_line(details: Iterable[ErrorDetails], document: Mapping[str, Any], known_keys: KnownKeys) -> list[str]:
    """All that is wrong with a document, a line each; see `one_line`."""
    return [_sentence(detail, document, known_keys) for detail in details]


def _sentence(detail: ErrorDetails, document: Mapping[str, Any], known_keys: KnownKeys) -> str:
    where, path, table = _place(detail["loc"], document)
    if detail["type"] == "extra_forbidden":
        *parents, key = path
        inside = _key(parents)
        text = f"unknown key '{key}'" + (f" in {inside}" if inside else "")
        if inside == "section" and str(key) in known_keys("beam"):
            text += ": it belongs to the part, so write it above [parts.section]"
        else:
            known = list(known_keys(table))
            text += did_you_mean(str(key), known) or f"; known are {', '.join(known)}"
    else:
        text = f"{_key(path)} {_phrase(detail)}".strip()
    return f"{where}: {text}" if where else text


_ENTRIES = {
    f"{word}s": word for word in ("part", "piece", "point_spring", "closure", "coupling", "joint", "beam", "leg")
}
_ENTRIES["bodies"] = "body"
"""Lists of tables, and what one is called, which is also its tag."""


def _place(loc: tuple[int | str, ...], document: Mapping[str, Any]) -> tuple[str, list[int | str], str]:
    """Where an error lies: the part or table in words, the path of keys inside it, the table's tag."""
    path = list(loc)
    entry = path[1] if len(path) > 1 and path[0] in _ENTRIES else None
    # one that is no table is told by its list
    if isinstance(entry, int) and isinstance(raw := document[str(path[0])][entry], dict):
        word, name = _ENTRIES[str(path[0])], raw.get("name")
        where = f"{word} '{name}'" if isinstance(name, str) else f"{word} {entry + 1}"
        # pydantic names the chosen kind of part, and of section, on the way to the key
        table, inner = (str(path[2]) if len(path) > 2 else "", path[3:]) if word == "part" else (word, path[2:])
        if len(inner) > 1 and inner[0] in ("section", "end_section", "law"):
            table = str(inner.pop(1))
        elif len(inner) > 2 and isinstance(inner[1], int):
            table = "turn"
        return where, inner, table
    if len(path) >= 2 and path[0] == "postures":
        # pydantic names the kind of the posture on the way, and by "[key]" that the key itself is wrong
        inner = path[3:] if path[2:3] in (["row"], ["table"]) else path[2:]
        return f"posture '{path[1]}'", ["its label" if step == "[key]" else step for step in inner], ""
    if len(path) >= 2 and path[0] in ("units", "base", "springs", "platform"):
        return f"[{path[0]}]", path[1:], "turn" if "turns" in path[:-1] else str(path[0])
    return "", path, ""


def _key(path: list[int | str]) -> str:
    """``section.width_mm``, ``compliance (2,6)``, ``end_offset_mm entry 2``; entries count from 1."""
    names = ""
    entries: list[int] = []
    for step in path:
        if isinstance(step, int):
            entries.append(step + 1)
        else:
            names += (f"{_entry(entries)}." if names else "") + step
            entries = []
    return (names + _entry(entries)).strip()


def _entry(entries: list[int]) -> str:
    if len(entries) > 1:
        return f" ({','.join(map(str, entries))})"
    return f" entry {entries[0]}" if entries else ""


_LIMITS = {
    "greater_than": ("above", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("below", "lt"),
    "less_than_equal": ("at most", "le"),
}
_WANTED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "a text in quotes",
    "list_type": "a list [...]",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "finite_number": "finite",
}


_SAID = {
    "missing": "is missing: add it",
    "string_too_short": "must not be empty",
    "union_tag_not_found": "kind is missing: add it",
}
_OF_THE_LIBRARY = frozenset(get_args(ErrorType))


def _phrase(detail: ErrorDetails) -> str:
    """What is wrong with a key, as the rest of a sentence that begins with it."""
    kind, context, given = detail["type"], detail.get("ctx", {}), detail["input"]
    if kind == "value_error":
        return str(context["error"])
    if kind in _SAID:
        return _SAID[kind]
    if kind in _WANTED:
        return f"must be {_WANTED[kind]}, got {reprlib.repr(given)}"
    if kind in _LIMITS:
        word, bound = _LIMITS[kind]
        return f"must be {word} {printed(context[bound])}, got {_number(given)}"
    if kind in ("too_short", "too_long"):
        word, count = ("at least", "min_length") if kind == "too_short" else ("at most", "max_length")
        entries = "entry" if context[count] == 1 else "entries"
        return f"must have {word} {context[count]} {entries}, got {context['actual_length']}"
    if kind == "string_pattern_mismatch":
        return f"must start with a letter and go on with letters, digits, '_' or '-', got {reprlib.repr(given)}"
    if kind == "literal_error":
        remedy = "convert the numbers" if detail["loc"][0] == "units" else "this release reads no other"
        return f"must be {context['expected']}, got {reprlib.repr(given)}: {remedy}"
    if kind == "union_tag_invalid":
        return f"kind must be one of {context['expected_tags']}, got '{context['tag']}'"
    # what a table of ours says itself stays; the library's own sentences are no remedy
    return f"cannot be {reprlib.repr(given)}" if kind in _OF_THE_LIBRARY else detail["msg"]


def _number(given: float) -> str:
    """A number of any size; TOML's integers have no limit."""
    return reprlib.repr(given) if isinstance(given, int) else printed(given)
