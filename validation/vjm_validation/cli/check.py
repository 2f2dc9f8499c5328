"""The command ``validate check``."""

from __future__ import annotations

from vjm.io.errors import ModelFileError
from vjm.io.machine_file import is_legs, load_model
from vjm.io.model_report import errors_of, summary_of
from vjm.vjm_engine import refuse_unbuildable
from vjm_output import terminal
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.options import Model
from vjm_validation.cli.status import BAD_INPUT, OK


def check_(model: Model, *, strict: Strict = False) -> int:
    """List every error of a model file, or say what machine it describes and what is doubtful about it."""
    console = terminal.console()
    if not is_legs(model):
        # of parts, all errors at once
        try:
            errors = errors_of(model)
        except ModelFileError as error:
            errors = [str(error)]
        for line in errors:
            terminal.error(line)
        if errors:
            return BAD_INPUT
    machine = load_model(model)
    try:
        refuse_unbuildable(machine)
    except ValueError as error:
        terminal.error(f"{model}: {error}")
        return BAD_INPUT
    considered(model, strict)
    console.print(terminal.two_columns(f"{machine.name}: {machine.title}", _merged(summary_of(machine))))
    return OK


def _merged(rows: list[tuple[str, str]]) -> dict[str, str]:
    """Rows of one name under each other."""
    table: dict[str, str] = {}
    for name, value in rows:
        table[name] = f"{table[name]}\n{value}" if name in table else value
    return table
