"""Old words of model files, causes and JSON documents: they are read on for one release, and said."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from vjm.io.findings import Finding, Grade

RENAMED = {"coupling": {"as bent": "as deflected"}}
"""Of a key of a part: its old values, and what each is now."""
DOCUMENT_KEYS = {"ladder": "selection"}
"""Old keys of JSON documents, and what each is now."""
DOCUMENT_VALUES = {key: {"bend-over": "stiffness-knee"} for key in ("critical", "kind")}
"""Of a key of a JSON document: its old values, and what each is now."""
CAUSES = {
    "joint_compliance": "actuator_compliance",
    "backlash": "actuator_backlash",
    "joint_nonlinearity": "actuator_hardening",
    "one_sided_compliance": "tension_compression_asymmetry",
    "load_zero": "instrument_zero",
    "mass": "gravity",
}
"""Causes that tests of poses and deflections named differently than other tests, and the one name of each."""
CAUSE_KEYS = ("cause", "causes", "families", "family", "parameter")
"""Keys of JSON documents whose values are causes, or begin with one: ``joint_compliance.elbow``."""
UNTIL = "0.4.0"
"""The version that reads the old words no more."""
CAUSES_UNTIL = "0.5.0"
"""The version that reads the old names of causes no more."""


def read_on(key: str) -> Callable[[object], object]:
    """What turns an old value of a key into the present one, for a validator; other values stay.

    Example:
        >>> read_on("coupling")("as bent")
        'as deflected'
    """

    def present(value: object) -> object:
        return RENAMED[key].get(value, value) if isinstance(value, str) else value

    return present


def old_words(content: Mapping[str, Any], file: str) -> Iterator[Finding]:
    """The old words in a model's document.

    Args:
        content: as its file says it.
        file: its name for messages.
    """
    for part in content.get("parts", []):
        for key, values in RENAMED.items():
            old = part.get(key)
            if isinstance(old, str) and old in values:
                place = f"{file}: part '{part.get('name', '')}', {key}"
                yield _found(place, old, f"'{values[old]}': write that")


def present_document(content: dict[str, Any], file: str) -> tuple[dict[str, Any], list[Finding]]:
    """A JSON document in the present words, and a finding for each old word in it.

    Args:
        content: as its file says it; it is not changed.
        file: its name for messages.

    Example:
        >>> present_document({"ladder": []}, "diagnosis.json")[0]
        {'selection': []}
    """
    old: dict[str, str] = {}

    def present(value: Any, key: str) -> Any:  # noqa: ANN401
        if isinstance(value, dict):
            old.update({name: DOCUMENT_KEYS[name] for name in value if name in DOCUMENT_KEYS})
            return {DOCUMENT_KEYS.get(name, name): present(one, name) for name, one in value.items()}
        if isinstance(value, list):
            return [present(one, key) for one in value]
        if isinstance(value, str) and value in (values := DOCUMENT_VALUES.get(key, {})):
            old[value] = values[value]
            return values[value]
        if isinstance(value, str) and key in CAUSE_KEYS and (new := _present_cause(value)) != value:
            causes[value] = new
            return new
        return value

    causes: dict[str, str] = {}
    result = present(content, "")
    findings = [_found(file, word, f"'{new}'") for word, new in old.items()]
    return result, findings + [_found(file, word, f"'{new}'", CAUSES_UNTIL) for word, new in causes.items()]


def present_causes(names: Iterable[str], where: str) -> tuple[tuple[str, ...], list[Finding]]:
    """Names of causes as they are now, and a finding for each old one.

    Args:
        names: causes, or causes of a part: ``backlash.elbow``.
        where: what they stand in, for messages.

    Example:
        >>> present_causes(["backlash.elbow", "creep"], "--only")[0]
        ('actuator_backlash.elbow', 'creep')
    """
    given = tuple(names)
    present = tuple(_present_cause(name) for name in given)
    pairs = zip(given, present, strict=True)
    return present, [_found(where, old, f"'{new}'", CAUSES_UNTIL) for old, new in pairs if old != new]


def _present_cause(name: str) -> str:
    cause, dot, place = name.partition(".")
    return CAUSES.get(cause, cause) + dot + place


def _found(where: str, old: str, new: str, until: str = UNTIL) -> Finding:
    return Finding(Grade.NOTED, where, f"'{old}' is now called {new}; the old word is read until {until}")
