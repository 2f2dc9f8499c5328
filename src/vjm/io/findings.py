"""What is implausible or old about an input that is well-formed: a grade, a place, and the likely mistake.

Old names of causes and old words of JSON documents are read on for one release, and said.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any


class Grade(StrEnum):
    """What is done about a finding."""

    REFUSED = "refused"
    """Physically impossible: no result is computed."""
    DOUBTFUL = "doubtful"
    """Likely a mistake: a warning, which ``--strict`` makes a refusal."""
    NOTED = "noted"
    """Worth knowing."""


@dataclass(frozen=True)
class Finding:
    """One implausible thing.

    Attributes:
        grade: what is done about it.
        where: file, and part, posture, row, column or key.
        description: what was found, and the likely mistake.
    """

    grade: Grade
    where: str
    description: str

    def __str__(self) -> str:
        return f"{self.where}: {self.description}"


class ImplausibleError(ValueError):
    """An input is refused for what it says; its text is one line."""


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """Findings with the refusals first, then the doubts."""
    return sorted(findings, key=lambda finding: list(Grade).index(finding.grade))


def refuse(findings: Iterable[Finding], *, strict: bool = False) -> None:
    """Stop at what is impossible, and in strict use at what is doubtful.

    Raises:
        ImplausibleError: naming the first such finding, and how many more there are.
    """
    stopping = {Grade.REFUSED, Grade.DOUBTFUL} if strict else {Grade.REFUSED}
    stopped = [finding for finding in worst_first(findings) if finding.grade in stopping]
    if stopped:
        more = f" (and {len(stopped) - 1} more)" if len(stopped) > 1 else ""
        hint = " (--strict refuses what is doubtful)" if stopped[0].grade is Grade.DOUBTFUL else ""
        raise ImplausibleError(f"{stopped[0]}{more}{hint}")


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
DOCUMENT_KEYS = {"ladder": "selection"}
"""Old keys of JSON documents, and what each is now."""
DOCUMENT_VALUES = {key: {"bend-over": "stiffness-knee"} for key in ("critical", "kind")}
"""Of a key of a JSON document: its old values, and what each is now."""
UNTIL = "0.5.0"
"""The version that reads the old words no more."""


def present_document(content: dict[str, Any], file: str) -> tuple[dict[str, Any], list[Finding]]:
    """A JSON document in the present words, and a finding for each old word in it.

    Example:
        >>> present_document({"cause": "backlash"}, "diagnosis.json")[0]
        {'cause': 'actuator_backlash'}
    """
    old: dict[str, str] = {}

    def present(value: Any, key: str) -> Any:  # noqa: ANN401
        if isinstance(value, dict):
            old.update({name: DOCUMENT_KEYS[name] for name in value if name in DOCUMENT_KEYS})
            return {DOCUMENT_KEYS.get(name, name): present(one, name) for name, one in value.items()}
        if isinstance(value, list):
            return [present(one, key) for one in value]
        if isinstance(value, str):
            new = _present_cause(value) if key in CAUSE_KEYS else DOCUMENT_VALUES.get(key, {}).get(value, value)
            if new != value:
                old[value] = new
            return new
        return value

    result = present(content, "")
    return result, [_renamed(file, name, new) for name, new in old.items()]


def present_causes(names: Iterable[str], where: str) -> tuple[tuple[str, ...], list[Finding]]:
    """Names of causes, or causes of a part, as they are now, and a finding for each old one.

    Example:
        >>> present_causes(["backlash.elbow", "creep"], "--only")[0]
        ('actuator_backlash.elbow', 'creep')
    """
    given = tuple(names)
    present = tuple(_present_cause(name) for name in given)
    return present, [_renamed(where, old, new) for old, new in zip(given, present, strict=True) if old != new]


def _present_cause(name: str) -> str:
    cause, dot, place = name.partition(".")
    return CAUSES.get(cause, cause) + dot + place


def _renamed(where: str, old: str, new: str) -> Finding:
    said = f"'{old}' is now called '{new}'; the old word is read until {UNTIL}"
    return Finding(Grade.NOTED, where, said)
