"""What the commands on measured data share: their files and sheets, effects of one's own, words while they work."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm.io.files import check_writable
from vjm.io.findings import Finding
from vjm_output import terminal
from vjm_updating import load_data
from vjm_updating.data_set import DataSet
from vjm_validation.cli.doubts import warn

Readings = Annotated[
    tuple[Path, ...],
    Parameter(
        help="Readings, CSV; see docs/measured-data.md and docs/poses.md. Of poses and deflections also several "
        "series of one machine."
    ),
]
Sheets = Annotated[
    tuple[Path, ...],
    Parameter(consume_multiple=True, help="Test sheet, TOML: one for all series, or one each in their order."),
]
Beside = Annotated[
    tuple[tuple[Path, Path], ...],
    Parameter(
        help="DATA SHEET of another test that judges what is found. Of poses and deflections: another series of "
        "the machine, only frames and zeros refitted; more than once. A ramp, in `diagnose` only: another "
        "specimen, nothing fitted anew."
    ),
]


def load_series(data: Sequence[Path], sheets: Sequence[Path]) -> list[DataSet]:
    """The series of a command.

    Args:
        data: files of readings.
        sheets: one for all, or one each in their order.

    Raises:
        ValueError: as many sheets as fit neither, or a file cannot be used; one line.
    """
    if not data:
        raise ValueError("no data file: give at least one CSV file of readings")
    if len(sheets) not in (1, len(data)):
        raise ValueError(
            f"--sheet: {len(sheets)} sheets for {len(data)} data files: give one for all, or one each in order"
        )
    each = list(sheets) * len(data) if len(sheets) == 1 else list(sheets)
    return [load_data(*files) for files in zip(data, each, strict=True)]


# --- What the commands on measured data say while they work: doubts first, then how far they are ------------------

Telling = tuple[Callable[[Sequence[Finding]], None], Callable[[str], None]]


@contextmanager
def telling(stage: str, out: Path, *, quiet: bool) -> Iterator[Telling]:
    """Refuse a folder that cannot be written to, say what is implausible, and show how many steps are done.

    What is refused is refused before anything is displayed, in one line.

    Args:
        stage: word before the display.
        out: folder that is written to in the end.
        quiet: whether nothing is displayed.
    """
    check_writable(out)
    with ExitStack() as stack:
        display: Callable[[str, int, int], None] | None = None
        done = 0

        def tell(_: str) -> None:
            nonlocal display, done
            display = display or stack.enter_context(terminal.progress(quiet=quiet))
            done += 1
            display(stage, done, 0)

        yield warn, tell


# --- Files with effects of one's own, which commands run ----------------------------------------------------------

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
