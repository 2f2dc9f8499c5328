"""Work that the page asks for, one after the other, where nothing that fails ends the page."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from vjm.errors import NoConvergenceError

LONGEST_LINE = 400
"""Letters of an error on the page."""


@dataclass(frozen=True)
class Job:
    """Work, and where its error is said.

    Attributes:
        work: is called once.
        said: takes a line on what failed.
    """

    work: Callable[[], None]
    said: Callable[[str], None]

    def do(self) -> None:
        """Do the work; what it raises is said in one line."""
        try:
            self.work()
        except Exception as error:
            # whatever failed, the next value may be a good one
            self.said(one_line(error))


class Jobs:
    """Jobs that wait. Of each name one waits at most, the latest: what it replaces is out of date."""

    def __init__(self) -> None:
        """None waits."""
        self._waiting: dict[str, Job] = {}
        self._asked = threading.Condition()
        self._ended = False

    def ask(self, name: str, job: Job) -> None:
        """Let a job wait, instead of the one of the same name."""
        with self._asked:
            self._waiting[name] = job
            self._asked.notify_all()

    def end(self) -> None:
        """Begin no other job."""
        with self._asked:
            self._ended = True
            self._asked.notify_all()

    def run(self, rate: float, between: Callable[[], Job | None]) -> None:
        """Do jobs until `end`, that which waits longest first.

        Args:
            rate: at most so many times a second `between` is asked for a job while none waits.
            between: what to do then; None for nothing until a job is asked for.
        """
        while True:
            idle = between()
            with self._asked:
                self._asked.wait_for(lambda: self._ended or self._waiting, 1.0 / rate if idle else None)
                if self._ended:
                    return
                job = self._waiting.pop(next(iter(self._waiting))) if self._waiting else idle
            if job is not None:
                job.do()


def one_line(error: Exception) -> str:
    """What is said of an error: the words of one that was foreseen, the kind of any other."""
    words = " ".join(str(error).split())[:LONGEST_LINE]
    if isinstance(error, ValueError | NoConvergenceError | OSError) and words:
        return words
    return f"this cannot be computed ({type(error).__name__}{f': {words}' if words else ''}); other values can"
