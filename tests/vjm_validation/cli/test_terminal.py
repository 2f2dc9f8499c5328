"""The terminal: an interrupt ends the work wherever it strikes; what is printed is printed as it is."""

import signal
from io import StringIO

import pytest
from rich.console import Console

from vjm_output import terminal
from vjm_validation.acceptance import AcceptanceRow
from vjm_validation.cli.tables import acceptance_table


def interrupted_and_swallowed():
    """As in a callback of a library that goes on after what is raised in it."""
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_an_interrupt_that_was_swallowed_is_raised_with_the_next_progress():
    before, told = signal.getsignal(signal.SIGINT), []

    def work():
        with terminal.progress(quiet=True) as progress:
            for done in (1, 2, 3):
                progress("paths", done, 3)
                told.append(done)
                interrupted_and_swallowed()

    with pytest.raises(KeyboardInterrupt):
        work()
    assert told == [1]
    assert signal.getsignal(signal.SIGINT) is before


def test_or_at_the_end():
    with pytest.raises(KeyboardInterrupt), terminal.progress(quiet=True):
        interrupted_and_swallowed()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_that_a_library_turned_into_an_error_is_an_interrupt(number):
    def work():
        with terminal.progress(quiet=True) as progress:
            progress("paths", 1, 3)
            # what Exudyn makes of an interrupt in the constructor of an item
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(number)
            raise RuntimeError("Check your python code")

    with pytest.raises(KeyboardInterrupt):
        work()


def test_an_error_without_an_interrupt_stays_one():
    with pytest.raises(RuntimeError, match="negative"), terminal.progress(quiet=True):
        raise RuntimeError("negative indices")


def test_without_one_nothing_is_raised():
    with terminal.progress(quiet=True) as progress:
        progress("paths", 3, 3)


def test_a_number_too_long_for_its_column_is_broken_and_not_cut():
    table = terminal.TerminalTable()
    table.add_column("K0")
    table.add_column("K1")
    table.add_row("1.3371e+05", "2.5336e-03")
    narrow = Console(width=16, file=StringIO())
    narrow.print(table)
    shown = narrow.file.getvalue()
    assert "…" not in shown
    pieces = [line.split("│")[1:3] for line in shown.splitlines() if line.startswith("│")]
    assert ["".join(cell.strip() for cell in cells) for cells in zip(*pieces, strict=True)] == [
        "1.3371e+05", "2.5336e-03",
    ]  # fmt: skip


def test_brackets_of_a_table_are_printed(capsys):
    row = AcceptanceRow(name="engines", requirement="agree", value="pip install 'vjm[extra]'", passed=None)
    terminal.console().print(acceptance_table([row]))
    printed = capsys.readouterr().out
    assert "pip install 'vjm[extra]'" in printed
    assert "not run" in printed
