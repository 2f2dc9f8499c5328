"""What commands answer, what their refusals claim, and whether two answers agree."""

from __future__ import annotations

import json
import re
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from helpers.command import validate
from numpy.typing import ArrayLike

from contradictions.sketches import MODEL, Drawn
from vjm.engines import EngineOptions
from vjm.errors import NoConvergenceError
from vjm.io.machine_file import load_model
from vjm.model.machine import Machine

SPRINGS = 4
"""In every beam: all ways have the same, so that their number is no difference."""
SECONDS = 30.0
"""Of a processor, for one command on one small machine. The slowest that is right takes three."""


@dataclass(frozen=True)
class Reason:
    """What a refusal says.

    Attributes:
        said: pattern of the message.
        claim: what that claims of the machine, which other commands may deny; empty where it is a limit of the
            command and claims nothing.
        why: the physical reason.
    """

    said: str
    claim: str
    why: str


REASONS = (
    Reason(r"unstable", "unstable", "the equilibrium under the loads is unstable"),
    Reason(r"does not bear its constant loads", "unstable", "springs under stress make the drawn posture unstable"),
    Reason(
        r"stability is lost at|the load is greatest at",
        "unstable",
        "the loads are beyond a critical one: a stable state is jumped to",
    ),
    Reason(r"no equilibrium", "no equilibrium", "the loads have no equilibrium near the posture"),
    Reason(r"no force moves the end to first order", "", "the search follows what forces move to first order"),
    Reason(r"nothing deflects", "rigid", "no part of the machine deflects"),
    Reason(r"is a mechanism|leave the end a mechanism|pose is singular", "mechanism", "a motion strains no spring"),
    Reason(
        r"beyond|out of (its )?reach|outside|free length|no free length|is longer than",
        "out of reach",
        "a beam would be longer than it is, or shorter than nothing",
    ),
)
"""Every refusal that may stand beside an answer of another command. Any other refusal is a failure."""


class RefusedError(Exception):
    """A command did not answer."""

    def __init__(self, status: int, said: str) -> None:
        super().__init__(said)
        self.status, self.said = status, said

    @property
    def reason(self) -> Reason | None:
        return next((each for each in REASONS if re.search(each.said, self.said)), None)


class TooSlowError(Exception):
    """A command took longer than `SECONDS`."""


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Stop what takes a processor longer; in the main thread."""

    def stop(signum: int, frame: FrameType | None) -> None:
        raise TooSlowError(f"no answer in {seconds:g} s of a processor")

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


class Asked:
    """A machine in a folder of its own; what commands said of it is kept."""

    def __init__(self, machine: Drawn, folder: Path) -> None:
        self.machine, self.folder = machine, folder
        for name, text in machine.files.items():
            (folder / name).write_text(text)
        self._said: dict[tuple[str, ...], Any] = {}
        self._loaded: dict[str, Machine] = {}
        self._count = 0

    @property
    def model(self) -> str:
        return str(self.folder / MODEL)

    @property
    def load(self) -> np.ndarray:
        return np.array(self.machine.load)

    def loaded(self, file: str = MODEL) -> Machine:
        """The machine as Python has it."""
        if file not in self._loaded:
            self._loaded[file] = load_model(self.folder / file)
        return self._loaded[file]

    @property
    def options(self) -> EngineOptions:
        return EngineOptions(segments=SPRINGS)

    @property
    def length(self) -> float:
        """mm, by which turns become shifts."""
        return float(self.loaded().characteristic_length)

    def new_file(self) -> Path:
        self._count += 1
        return self.folder / f"written-{self._count}.toml"

    def new_folder(self) -> str:
        self._count += 1
        return str(self.folder / f"out-{self._count}")

    def text(self, *words: str) -> str:
        """What a command prints."""
        return self._run(words)

    def json(self, *words: str) -> dict[str, Any]:
        """What a command prints as JSON."""
        found: dict[str, Any] = json.loads(self._run((*words, "--json")))
        return found

    def _run(self, words: tuple[str, ...]) -> str:
        if words not in self._said:
            done = validate(*words, status=None)
            # a path that ended early has status 3 and its points, a derivative in doubt status 1 and its row
            spoken = {"curve": 3, "buckling": 3, "sensitivity": 1}.get(words[0])
            whole = done.status == 0 or (done.status == spoken and done.out.strip())
            lines = [line for line in done.err.splitlines() if "warning:" not in line and "━" not in line]
            self._said[words] = done.out if whole else RefusedError(done.status, " ".join(" ".join(lines).split()))
        said = self._said[words]
        if isinstance(said, RefusedError):
            raise said
        return said


@dataclass(frozen=True)
class Value:
    """Numbers that a way states.

    Attributes:
        numbers: ``(n,)`` in one unit, an array or a list.
        tolerance: relative to the largest of them.
        floor: absolute, of what rounding leaves of nothing.
    """

    numbers: ArrayLike
    tolerance: float
    floor: float = 0.0

    def agrees(self, other: Value) -> bool:
        mine, theirs = np.asarray(self.numbers, dtype=float), np.asarray(other.numbers, dtype=float)
        allowed = max(self.tolerance, other.tolerance) * max(np.abs(mine).max(), np.abs(theirs).max())
        # a number that is none agrees with nothing
        return bool(np.abs(mine - theirs).max() <= allowed + max(self.floor, other.floor))

    def __str__(self) -> str:
        shown = np.asarray(self.numbers, dtype=float)
        if len(shown) > 3:
            shown = shown[np.argsort(-np.abs(shown))[:3]]
        return ", ".join(f"{v:.6g}" for v in shown)


@dataclass(frozen=True)
class Between:
    """A number lies between two, as far as a way can tell: one that found it has both alike.

    Attributes:
        low, high: infinite where nothing is known.
        tolerance: relative.
    """

    low: float
    high: float
    tolerance: float = 1e-6

    def agrees(self, other: Between) -> bool:
        wide = 1.0 + max(self.tolerance, other.tolerance)
        return self.low <= other.high * wide and other.low <= self.high * wide

    def __str__(self) -> str:
        if self.low == self.high:
            return f"{self.low:.6g}"
        return f"none up to {self.low:.6g}" if np.isinf(self.high) else f"{self.low:.6g} to {self.high:.6g}"


Claim = Value | Between | str
Found = dict[str, Claim]
"""What is stated, by its name: numbers, or in a word."""
GIVEN = "answer"
"""Name under which a way says whether it answers: `GIVEN`, or the claim of its refusal."""


@dataclass(frozen=True)
class Way:
    """One command, or one way through Python, to the answer of a question.

    Attributes:
        name: as in the table.
        ask: what it states.
        slow: only in the long run.
        elements: by finite elements, which take seconds: once for each kind.
    """

    name: str
    ask: Callable[[Asked], Found]
    slow: bool = False
    elements: bool = False


@dataclass(frozen=True)
class Question:
    """What several ways answer.

    Attributes:
        name: as in the table.
        ways: two or more.
        fits: whether it makes sense for a machine.
        every: of machines of a kind each that is so many further is asked: the dear ones of a few.
    """

    name: str
    ways: Sequence[Way]
    fits: Callable[[Drawn], bool] = lambda machine: True
    every: int = 1

    @property
    def elements(self) -> bool:
        return any(way.elements for way in self.ways)


@dataclass(frozen=True)
class Contradiction:
    """Two ways that do not agree, or one that failed."""

    machine: str
    question: str
    answers: tuple[str, ...]
    failure: bool = False

    def __str__(self) -> str:
        return f"{self.machine}: {self.question}: " + " | ".join(self.answers)


@dataclass(frozen=True)
class Judged:
    """What came of one question on one machine."""

    compared: int
    refused: tuple[tuple[str, str], ...]
    contradictions: tuple[Contradiction, ...]
    seconds: dict[str, float]


def judge(question: Question, asked: Asked, *, slow: bool, elements: bool = False) -> Judged:
    """Ask a question in every way and compare."""
    stated: dict[str, list[tuple[str, Claim]]] = {}
    refused, broken, seconds = [], [], {}
    name = asked.machine.name
    for way in question.ways:
        if (way.slow and not slow) or (way.elements and not elements):
            continue
        began = time.process_time()
        try:
            with at_most(SECONDS):
                found = way.ask(asked)
            if found:
                found = {GIVEN: GIVEN, **found}
        except (RefusedError, NoConvergenceError, ValueError, TooSlowError, Exception) as error:
            refusal = _refusal(error)
            reason = None if refusal is None else refusal.reason
            if reason is None:
                said = f"{way.name}: {type(error).__name__ if refusal is None else 'refused'}: {error}"
                broken.append(Contradiction(name, question.name, (said,), failure=True))
                found = {}
            else:
                refused.append((way.name, reason.why))
                found = {GIVEN: reason.claim} if reason.claim else {}
        seconds[way.name] = time.process_time() - began
        for what, claim in found.items():
            stated.setdefault(what, []).append((way.name, claim))
    differing = [
        Contradiction(name, f"{question.name}, {what}", _grouped(claims))
        for what, claims in stated.items()
        if not _all_agree([claim for _, claim in claims])
    ]
    pairs = sum(len(claims) * (len(claims) - 1) // 2 for claims in stated.values())
    return Judged(pairs, tuple(refused), (*differing, *broken), seconds)


def _grouped(claims: Sequence[tuple[str, Claim]]) -> tuple[str, ...]:
    """Claims with the ways that make them."""
    groups: dict[str, list[str]] = {}
    for way, claim in claims:
        groups.setdefault(str(claim), []).append(way)
    return tuple(f"{claim} ({', '.join(ways)})" for claim, ways in groups.items())


def _refusal(error: Exception) -> RefusedError | None:
    match error:
        case RefusedError():
            return error
        case NoConvergenceError() | ValueError():
            # the call from Python refuses as the command does
            return RefusedError(2, str(error))
    return None


def _all_agree(claims: Sequence[Claim]) -> bool:
    return all(_agree(a, b) for i, a in enumerate(claims) for b in claims[:i])


def _agree(a: Claim, b: Claim) -> bool:
    if isinstance(a, Value) and isinstance(b, Value):
        return a.agrees(b)
    if isinstance(a, Between) and isinstance(b, Between):
        return a.agrees(b)
    return a == b
