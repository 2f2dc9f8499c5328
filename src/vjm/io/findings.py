"""What is implausible about an input that is well-formed: a grade, a place, and the likely mistake."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


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
        found: what was found, and the likely mistake.
    """

    grade: Grade
    where: str
    found: str

    def __str__(self) -> str:
        return f"{self.where}: {self.found}"


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
