"""Foreign libraries at work in a process of their own, with limits of time and working memory.

A library in C++ holds the interpreter while it works: Python answers no signal until it returns, and an error in it
ends the process. So what a file of somebody else's makes a library do is done in a child. The caller waits for
a message, which a signal interrupts, and then ends the child. The operating system keeps the limits, whatever the
child does. They are those of POSIX systems; on Windows there are none, and Ctrl-C reaches the child by itself.

Results are pickled. The child runs with the rights of who started it: it bounds what a file costs, and is no cage.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib.util
import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, TypeVar

Result = TypeVar("Result")
Progress = Callable[[str, int, int], None]

SIGN, RESULT, ERROR = range(3)
"""Kinds of messages: progress, what the function gave, what it raised."""
GIB = 2.0**30
PARENT_DIED = 1
"""Linux' number, for ``prctl``, of the signal that a process gets when its parent ends."""
REFUSED = 127
"""Exit status of a child whose parent had ended before it could ask to be told."""


@dataclass(frozen=True)
class ChildLimits:
    """What a child may use.

    Attributes:
        seconds: of wall time without a message; each call of the function's progress is one.
        data_bytes: of its data. Reserved addresses and the libraries' code do not count: they are gibibytes where
            there are many cores, and nothing is behind them.
        remedy: what to do where a limit is met, for the end of a message.
    """

    seconds: float
    data_bytes: float
    remedy: str


class ChildError(ValueError):
    """A child met a limit or died; its text is one line."""


def free_ram() -> float:
    """Bytes that the machine has to spare; infinite where it does not say."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return 1024.0 * float(next(line for line in lines if line.startswith("MemAvailable")).split()[1])
    except (OSError, StopIteration, ValueError, IndexError):
        try:
            return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_AVPHYS_PAGES"))
        except (AttributeError, ValueError, OSError):
            return float("inf")


def run_in_child(
    function: Callable[..., Result],
    *arguments: object,
    what: str,
    limits: ChildLimits,
    progress: Progress | None = None,
) -> Result:
    """The result of a function that calls a foreign library, which runs in a child.

    When the wait is interrupted, and when this process ends, so does the child.

    Args:
        function: of a module's top level. With ``progress`` it takes one more argument, of the same kind.
        arguments: picklable, as is the result.
        what: the file and the library, for messages: ``robot.xml: MuJoCo``.
        limits: of time and working memory.
        progress: called here with what the function calls it with there.

    Raises:
        ChildError: a limit of time was met, or the library died; one line.
        MemoryError: the limit of working memory was met.
        Exception: what ``function`` raises.
    """
    # what is printed there is passed on when it ended well; else its last line may say why it did not
    with tempfile.TemporaryFile() as printed:
        process = subprocess.Popen(
            # a child imports what this process would, and nothing of the program that runs here
            [sys.executable, "-c", f"import sys; sys.path[:] = {sys.path!r}; import {__name__} as c; c.serve()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=printed,
            # a terminal's Ctrl-C comes to this process alone, which decides
            process_group=0,
        )
        try:
            assert process.stdin is not None
            assert process.stdout is not None
            try:
                # two: the limits have to stand before what the second one imports
                pickle.dump((os.getpid(), limits, progress is not None), process.stdin)
                pickle.dump((function, arguments), process.stdin)
                process.stdin.flush()
            except BrokenPipeError:
                pass  # it died; how, it says below
            message = _last_message(process.stdout, progress)
            process.wait()
        except BaseException:
            _end(process)
            raise
        finally:
            for pipe in (process.stdin, process.stdout):
                _close(pipe)
        printed.seek(0)
        said = printed.read().decode("utf-8", "replace")
    if message is None:
        raise ChildError(_death(process.returncode, what, limits, said))
    if message[0] == ERROR:
        error, cause = message[1]
        if isinstance(error, MemoryError):
            most = f"{limits.data_bytes / GIB:.2g} GB of working memory"
            raise MemoryError(f"{what} needs more than {most}: {limits.remedy}")
        raise error from cause
    if said and sys.stderr is not None:
        sys.stderr.write(said)
    result: Result = message[1]
    return result


def installed(library: str) -> None:
    """Ask for a library before a child is started for it.

    Raises:
        ModuleNotFoundError: it is not installed.
    """
    if importlib.util.find_spec(library) is None:
        raise ModuleNotFoundError(f"No module named '{library}'", name=library)


def _last_message(line: IO[bytes], progress: Progress | None) -> tuple[int, Any] | None:
    """The message that ends the child's work; None where it died before."""
    while True:
        try:
            kind, value = pickle.load(line)
        except (EOFError, pickle.UnpicklingError):
            return None
        if kind != SIGN or progress is None:
            return kind, value
        progress(*value)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a child, and whatever it started."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


def _close(pipe: IO[bytes] | None) -> None:
    with contextlib.suppress(BrokenPipeError):
        if pipe is not None:
            pipe.close()


def _death(status: int, what: str, limits: ChildLimits, said: str) -> str:
    """Why there is no result."""
    if hasattr(signal, "SIGALRM") and status == -signal.SIGALRM:
        return f"{what} did not finish in {limits.seconds:g} s and was stopped: {limits.remedy}"
    try:
        how = signal.Signals(-status).name if status < 0 else f"exit status {status}"
    except ValueError:
        how = f"signal {-status}"
    last = " ".join(said.strip().splitlines()[-1:])
    return f"{what} crashed ({how}{f': {last}' if last else ''}): {limits.remedy}"


def serve() -> None:
    """What a child does: answer one call, under its limits."""
    asked, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # libraries print: what goes to standard output must not come between messages
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 0)
    os.dup2(nowhere, 1)
    parent, limits, reports = pickle.load(asked)
    _limit(parent, limits)

    def send(*message: object) -> None:
        _wind(limits.seconds)
        pickle.dump(message, answers, protocol=pickle.HIGHEST_PROTOCOL)
        answers.flush()

    try:
        function, arguments = pickle.load(asked)
        if reports:
            arguments = (*arguments, lambda *sign: send(SIGN, sign))
        message: tuple[object, ...] = RESULT, function(*arguments)
    except MemoryError:
        message = ERROR, (MemoryError(), None)
    except Exception as error:
        message = ERROR, (_sendable(error), _sendable(error.__cause__))
    try:
        send(*message)
    except MemoryError:
        send(ERROR, (MemoryError(), None))
    # no end that a library could make long, or die of
    sys.stderr.flush()
    os._exit(0)


def _limit(parent: int, limits: ChildLimits) -> None:
    """Let the operating system keep the limits, and end this process with its parent where it can (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PARENT_DIED, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(REFUSED)
    if sys.platform == "win32":
        return
    # both outlive the start of a program
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGALRM])
    _wind(limits.seconds)
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    asked = resource.RLIM_INFINITY if limits.data_bytes == float("inf") else int(limits.data_bytes)
    if most == resource.RLIM_INFINITY or resource.RLIM_INFINITY != asked < most:
        resource.setrlimit(resource.RLIMIT_DATA, (asked, most))


def _wind(seconds: float) -> None:
    """Set the clock whose signal, which nobody handles, ends this process."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)


def _sendable(error: BaseException | None) -> BaseException | None:
    """An error as it can be pickled and read."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(" ".join(f"{type(error).__name__}: {error}".split()))
    return error
