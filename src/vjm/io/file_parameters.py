"""Any number of a part in a model file as a parameter by which a machine's behaviour is differentiated."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from typing import Any

from vjm.io.errors import ModelFileError, did_you_mean
from vjm.io.model_file import ModelDocument, build_chain
from vjm.model.chain import Chain
from vjm.model.parameters import Parameter

UNITS = {
    "rad_per_Nmm": "rad/(N mm)", "Nmm_per_rad": "N mm/rad", "mm_per_N": "mm/N", "N_per_mm": "N/mm",
    "kg_per_m3": "kg/m³", "kg_mm2": "kg mm²", "Nmm2": "N mm²", "Nmm": "N mm", "MPa": "MPa", "rad": "rad",
    "deg": "deg", "mm": "mm", "kg": "kg", "N": "N",
}  # fmt: skip
"""By the end of a key; the longer ones first."""
COUNTS = ("count", "segments")
"""Keys of whole numbers, by which nothing is differentiated."""
NO_PROPERTY = ("limits_rad", "limits_mm")
"""Keys that do not change how a machine deflects."""


def parameter_keys(content: Mapping[str, Any]) -> list[str]:
    """Keys of the numbers of a document's parts but zeros: ``part.key``, ``part.section.key``, ``part.key.1``.

    Example:
        >>> parameter_keys({"parts": [{"name": "a", "length_mm": 5.0, "section": {"EA_N": 2.0}, "count": 2}]})
        ['a.length_mm', 'a.section.EA_N']
    """
    found = []
    for part in content.get("parts", []):
        for words, value in _numbers(part, ()):
            if value and words[-1] not in COUNTS and words[0] not in NO_PROPERTY:
                found.append(".".join((part["name"], *words)))
    return found


def _numbers(table: Mapping[str, Any], before: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], float]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, (*before, key))
        elif isinstance(value, list):
            for i, one in enumerate(value):
                if isinstance(one, int | float) and not isinstance(one, bool):
                    yield (*before, key, str(i + 1)), float(one)
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield (*before, key), float(value)


def file_parameter(document: ModelDocument, key: str, prepared: Callable[[Chain], Chain]) -> Parameter:
    """A number of a part in a chain file.

    Args:
        document: as read.
        key: as in `parameter_keys`; a zero may be named too.
        prepared: what is done to the chain of a document before it is used, such as to leave out its shear.

    Raises:
        ModelFileError: there is no such number.
    """
    value = file_number(document, key)
    if not value:
        raise ModelFileError(f"{document.file}: '{key}' is zero, which has no size: give it a value first")

    def apply(chain: Chain, now: float) -> Chain:
        return prepared(build_chain(with_numbers(document, {key: now}).content, document.file, chain.sha256))

    return Parameter(key, unit_of_key(key), value, abs(value), apply)


def file_number(document: ModelDocument, key: str) -> float:
    """A number of a part in a chain file.

    Raises:
        ModelFileError: there is no such number.
    """
    part, *words = key.split(".")
    parts = document.content.get("parts", [])
    numbers = {
        ".".join(path): value for one in parts if one.get("name") == part for path, value in _numbers(one, ())
    }
    rest = ".".join(words)
    if rest not in numbers or words[-1] in COUNTS:
        known = [f"{part}.{name}" for name in numbers] or parameter_keys(document.content)
        raise ModelFileError(
            f"{document.file}: '{key}' is no number of a part{did_you_mean(key, known)}; write "
            f"part.key, such as {known[0] if known else 'link.length_mm'}"
        )
    return numbers[rest]


def with_numbers(document: ModelDocument, values: Mapping[str, float]) -> ModelDocument:
    """A chain file's document with other numbers of its parts, by their keys, see `parameter_keys`.

    Example:
        >>> document = ModelDocument("a.toml", {"parts": [{"name": "a", "length_mm": 5.0}]}, "")
        >>> changed = with_numbers(document, {"a.length_mm": 6.0})
        >>> changed.content["parts"][0]["length_mm"]
        6.0
    """
    content = deepcopy(document.content)
    for key, value in values.items():
        part, *words = key.split(".")
        at: Any = next(one for one in content["parts"] if one.get("name") == part)
        for word in words[:-1]:
            at = at[word]
        if isinstance(at, list):
            at[int(words[-1]) - 1] = value
        else:
            at[words[-1]] = value
    return document._replace(content=content)


def unit_of_key(key: str) -> str:
    """Unit that the end of a key names; empty for none."""
    words = key.split(".")
    name = words[-2] if words[-1].isdigit() and len(words) > 1 else words[-1]
    return next((text for end, text in UNITS.items() if name.endswith(f"_{end}")), "")
