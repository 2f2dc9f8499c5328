"""What the commands on measured data say while they work: doubts first, then how far they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from vjm.io.files import check_writable
from vjm.io.findings import Finding
from vjm_output import terminal
from vjm_validation.cli.doubts import warn

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
