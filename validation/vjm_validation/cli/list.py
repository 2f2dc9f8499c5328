"""The command ``validate list``."""

from __future__ import annotations

from vjm.engines import DESCRIPTIONS
from vjm.io.manipulator_file import machines, manipulators
from vjm.io.model_file import library
from vjm_output import terminal
from vjm_validation.cli.status import OK
from vjm_validation.comparison_names import COMPARISONS
from vjm_validation.verification.library import library as cases


def list_() -> int:
    """Show the models, engines, comparisons and verification cases that there are."""
    console = terminal.console()
    console.print(terminal.two_columns("Models", {entry.name: entry.title for entry in library()}))
    console.print(terminal.two_columns("Manipulators", {entry.name: entry.title for entry in manipulators()}))
    console.print(terminal.two_columns("Closed loops", {entry.name: entry.title for entry in machines()}))
    console.print(terminal.two_columns("Engines", DESCRIPTIONS))
    console.print(terminal.two_columns("Comparisons of `validate all`", COMPARISONS))
    console.print(terminal.two_columns("Verification cases", {case.name: case.file.title for case in cases()}))
    return OK
