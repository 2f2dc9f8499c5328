"""Exit statuses of the command, and what a wrong request raises."""

from __future__ import annotations

OK, NOT_ACCEPTED, BAD_INPUT, GAVE_UP, INTERRUPTED = 0, 1, 2, 3, 130


class UsageError(ValueError):
    """A request that makes no sense; one line that says what and where."""
