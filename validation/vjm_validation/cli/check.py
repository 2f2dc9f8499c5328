"""The command ``validate check``."""

from __future__ import annotations

from collections.abc import Iterable

from vjm.io.findings import refuse
from vjm.io.model_report import check
from vjm_output import terminal
from vjm_validation.cli.doubts import Strict, warn
from vjm_validation.cli.options import Model
from vjm_validation.cli.status import BAD_INPUT, OK


def check_(model: Model, *, strict: Strict = False) -> int:
    """List every error of a model file, or say what machine it describes and what is doubtful about it."""
    found = check(model)
    for line in found.errors:
        terminal.error(line)
    if found.errors:
        return BAD_INPUT
    refuse(found.findings, strict=strict)
    warn(found.findings)
    console = terminal.console()
    console.print(terminal.two_columns(f"{found.name}: {found.title}", _merged(found.summary)))
    return OK


def _merged(rows: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Rows of one name under each other."""
    table: dict[str, str] = {}
    for name, value in rows:
        table[name] = f"{table[name]}\n{value}" if name in table else value
    return table
