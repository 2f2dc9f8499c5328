"""The `validate` command: its exit statuses, and what a wrong request raises.

Each command's module is read when it is called; what stands here is read by all of them, so that it imports
nothing.
"""

from __future__ import annotations

OK, NOT_ACCEPTED, BAD_INPUT, GAVE_UP, INTERRUPTED = 0, 1, 2, 3, 130


class UsageError(ValueError):
    """A request that makes no sense; one line that says what and where."""
