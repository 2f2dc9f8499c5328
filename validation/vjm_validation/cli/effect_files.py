"""Files with effects of one's own, which commands run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm_output import terminal

EffectFiles = Annotated[
    tuple[Path, ...],
    Parameter(
        consume_multiple=True, help="Python files with effects of your own, which are run; see docs/effects.md."
    ),
]


def tell_what_runs(files: Sequence[Path]) -> None:
    """Warn that a file of effects is a program."""
    for path in filter(Path.is_file, files):
        terminal.error(f"warning: --effects runs the program {path} with all your rights: only what you trust")
