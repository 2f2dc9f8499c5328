"""Many paths at once over processes, or many of anything else: calibrations, diagnoses, studies.

`trace_all` takes engines, chains and load cases, `map_all` a function and its arguments. Results come in the order
of the items and do not depend on the number of processes, which share nothing: each item is computed from itself
alone. Not even lumped models are shared between paths: theirs keep the modes that they found last.

Processes are spawned, since forking a process that runs threads is not safe, and take a second or two to import.
Each leaves linear algebra one thread. It asks for its next items when it is done with the last, so many of them at
a time that messages cost little beside the work.
"""

from __future__ import annotations

import multiprocessing
import operator
import os
import signal
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Generic, TypeVar

from vjm.continuation.path import Path
from vjm.engines import Engine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine

Item = TypeVar("Item")
Result = TypeVar("Result")

CHUNK_SECONDS = 0.1
"""Work that is sent at once: a thousand times what a message takes, and as much as an interrupt can lose."""
MOST_OF_THE_REST = 0.5
"""Share of its part of the remaining items that a process gets at once, so that all of them end together."""
PATIENCE = 5.0
"""Seconds that a process has to end after it was asked to."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""What the libraries below NumPy read when they are imported."""

Progress = Callable[[int, int], None]
"""Called with how many items are done, and of how many."""


@dataclass(frozen=True)
class Task:
    """One path to compute.

    Attributes:
        engine: any that can be pickled.
        chain: the machine.
        load_case: what is done to it.
    """

    engine: Engine
    chain: Machine
    load_case: LoadCase


@dataclass(frozen=True)
class Failure:
    """Why a task has no path.

    Attributes:
        kind: name of the exception: ``NoConvergenceError`` where a solver gave up, else of what is wrong with the
            task.
        message: what it said.
    """

    kind: str
    message: str


def trace_all(
    tasks: Sequence[Task],
    jobs: int = 1,
    progress: Progress | None = None,
    done: Callable[[int, Path | Failure], None] | None = None,
) -> list[Path | Failure]:
    """Trace many paths.

    A path that ends early says so itself, see `vjm.continuation.path.Path.stopped`. A task that has none at all,
    because of its chain, its load case or a solver, is a `Failure` in its place and stops no other.

    Args:
        tasks: in any order; the longest first use the processes best.
        jobs: processes; with one all is done in this one.
        progress: called in this process.
        done: called in this process with the index and the result of each task as it finishes, to keep it; an
            interrupted caller comes back with the tasks that are left.

    Returns:
        The paths in the order of the tasks, the same to the last bit for any number of jobs but for the seconds
        that they took.
    """
    return map_all(_trace, tasks, jobs, progress, done)


def map_all(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int = 1,
    progress: Progress | None = None,
    done: Callable[[int, Result], None] | None = None,
) -> list[Result]:
    """The results of a function of many items.

    On an interrupt or an error, here or in ``function``, the processes are ended before it is passed on.

    Args:
        function: of the module's top level, or else picklable; its result must follow from its argument alone.
        items: its arguments, picklable.
        jobs: processes; with one all is done in this one.
        progress: called in this process.
        done: called in this process with the index and the result of each item as it finishes, in any order.

    Returns:
        The results in the order of the items.

    Raises:
        ValueError: fewer than one job.
        RuntimeError: a process died, for lack of working memory for example.
        Exception: what ``function`` raises.
    """
    if jobs < 1:
        raise ValueError(f"a batch needs at least one job, not {jobs}")
    results: dict[int, Result] = {}

    def finish(index: int, result: Result) -> None:
        results[index] = result
        if done is not None:
            done(index, result)
        if progress is not None:
            progress(len(results), len(items))

    jobs = min(jobs, len(items))
    if jobs <= 1:
        for index, item in enumerate(items):
            finish(index, function(item))
    else:
        with _workers(function, jobs) as workers:
            _share(items, workers, finish)
    return [results[index] for index in range(len(items))]


@contextmanager
def beside(work: Callable[[], Result], jobs: int) -> Iterator[Callable[[], Result]]:
    """Let a process do what cannot be shared out, while this one goes on; yields what waits for the result.

    The process is ended at once if the block is left by an exception. With one job the work is done here, when its
    result is asked for.

    Args:
        work: picklable, without arguments.
        jobs: processes that there may be.

    Raises:
        RuntimeError: the process died, for lack of working memory for example.
        Exception: what ``work`` raises.
    """
    if jobs == 1:
        yield work
        return
    with _workers(operator.call, 1) as workers:
        (worker,) = workers
        worker.rows = range(1)
        worker.line.send([work])

        def result() -> Result:
            answer: _Answer[Result] = _received(worker)
            if answer.error is not None:
                raise answer.error
            return answer.results[0]

        yield result


def _trace(task: Task) -> Path | Failure:
    """The path of a task, or why there is none."""
    try:
        task.chain.posture(task.load_case.posture)
    except KeyError as error:
        return Failure("KeyError", str(error.args[0]))
    try:
        return task.engine.trace(task.chain, task.load_case)
    except (NoConvergenceError, ValueError) as error:
        return Failure(type(error).__name__, str(error))


@dataclass
class _Worker:
    """A process, the line to it, and the indices of the items that it works on."""

    process: BaseProcess
    line: Connection[Any, Any]
    rows: range = range(0)


@dataclass(frozen=True)
class _Answer(Generic[Result]):
    """The results of a chunk, the seconds that they took, and the error that ended it."""

    results: list[Result]
    seconds: float
    error: Exception | None = None


def _share(items: Sequence[Item], workers: list[_Worker], finish: Callable[[int, Result], None]) -> None:
    """Give every item to a process, and pass on the results."""
    begun, finished, seconds = 0, 0, 0.0

    def send(worker: _Worker) -> None:
        nonlocal begun
        left = len(items) - begun
        size = 1
        if seconds > 0.0:
            fair = MOST_OF_THE_REST * left / len(workers)
            size = max(1, int(min(CHUNK_SECONDS * finished / seconds, fair)))
        worker.rows = range(begun, min(begun + size, len(items)))
        begun = worker.rows.stop
        if worker.rows:
            worker.line.send([items[index] for index in worker.rows])

    for worker in workers:
        send(worker)
    while busy := [worker for worker in workers if worker.rows]:
        ready = wait([worker.line for worker in busy])
        for worker in (worker for worker in busy if worker.line in ready):
            answer: _Answer[Result] = _received(worker)
            indices = worker.rows
            finished += len(answer.results)
            seconds += answer.seconds
            if answer.error is None:
                send(worker)  # before the results are seen to: it need not wait for that
            for index, result in zip(indices, answer.results, strict=False):
                finish(index, result)
            if answer.error is not None:
                raise answer.error


def _received(worker: _Worker) -> _Answer[Any]:
    """What a process answers next."""
    try:
        answer: _Answer[Any] = worker.line.recv()
    except (EOFError, ConnectionError):
        worker.process.join(PATIENCE)
        raise RuntimeError(
            f"a process of the batch died with exit code {worker.process.exitcode} at items "
            f"{worker.rows.start} to {worker.rows.stop - 1}"
        ) from None
    return answer


@contextmanager
def _workers(function: Callable[[Item], Result], count: int) -> Iterator[list[_Worker]]:
    """Processes that work until the block is left; they are ended at once if it is left by an exception."""
    context = multiprocessing.get_context("spawn")
    workers: list[_Worker] = []
    try:
        with _one_thread():
            for _ in range(count):
                parent_end, child_end = context.Pipe()
                process = context.Process(target=_work, args=(child_end, function), daemon=True)
                process.start()
                # the end in the process is then the only one: when it dies the line breaks
                child_end.close()
                workers.append(_Worker(process, parent_end))
        yield workers
    except BaseException:
        for worker in workers:
            worker.process.terminate()
        raise
    finally:
        for worker in workers:
            # an idle process ends when its line does
            worker.line.close()
        for worker in workers:
            worker.process.join(PATIENCE)
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()
            worker.process.close()


def _work(line: Connection[Any, Any], function: Callable[[Item], Result]) -> None:
    """What a process does: answer chunks until the line ends, with the caller's process if not before."""
    # Ctrl-C goes to every process of a terminal; the caller's decides
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        try:
            items: list[Item] = line.recv()
        except (EOFError, ConnectionError):
            return
        answer = _answer(function, items)
        try:
            line.send(answer)
        except ConnectionError:
            return


def _answer(function: Callable[[Item], Result], items: list[Item]) -> _Answer[Result]:
    started = time.perf_counter()
    results: list[Result] = []
    try:
        for item in items:
            results.append(function(item))
    except Exception as error:
        error.add_note(f"In a process of the batch:\n{traceback.format_exc()}")
        return _Answer(results, time.perf_counter() - started, error)
    return _Answer(results, time.perf_counter() - started)


@contextmanager
def _one_thread() -> Iterator[None]:
    """One thread of linear algebra in each process that is started meanwhile."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
