"""Sweeps: many paths at once over processes, kept as they finish."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path as FilePath

from vjm.chain import Chain
from vjm.io.path_files import load_path, save_path, write_curve
from vjm.paths import Path
from vjm.programme import Programme
from vjm_validation.engines import engine_by_name
from vjm_validation.run import Direction, Key

ENGINES = (
    "vjm-paper", "vjm-16", "vjm-16f16", "exudyn", "exudyn-footspring",
    "vjm-linear", "vjm-unloaded-jacobian", "msa",
)  # fmt: skip
"""The engines of a comparison, in the order of its tables."""

DEFAULT_REACH_MM = 4.0
"""How far paths go: the paper's own range of displacements."""
LATE_BEND_OVER = ("orthoglide-chain", ("B", "D"), 14.0)
"""The paper's slanted postures bend over only at 7 to 9 mm of compression: their paths go to 14 mm."""


def ramp_end(chain: Chain, posture: str, direction: Direction) -> float:
    """Signed end of a comparison's ramp along x, mm."""
    model, postures, late = LATE_BEND_OVER
    far = chain.name == model and posture in postures and direction is Direction.COMPRESSION
    return direction.sign * (late if far else DEFAULT_REACH_MM)


@dataclass(frozen=True)
class Task:
    """One path to compute: a chain, an engine by name, a programme, and the key under which it is filed."""

    key: Key
    chain: Chain
    programme: Programme

    def run(self) -> Path:
        """Walk the path."""
        return engine_by_name(self.key.engine).walk(self.chain, self.programme)


def chain_tasks(
    chain: Chain,
    postures: Sequence[str],
    engines: Sequence[str] = ENGINES,
    steps: int | None = None,
) -> list[Task]:
    """The paths of a chain's comparison: every posture, direction and engine.

    Args:
        chain: the machine.
        postures: labels.
        engines: by name.
        steps: number of equal steps of each path; None where they adapt.
    """
    return [
        Task(
            Key(posture, direction, engine),
            chain,
            Programme(posture, ramp_end(chain, posture, direction), steps=steps),
        )
        for posture in postures
        for direction in Direction
        for engine in engines
    ]


class PathStore:
    """Finished paths of a run in its folder: what an interrupted run resumes from.

    Each path is a curve file for people and a record with everything, which is used again only when engine,
    programme, model and version are still the same.
    """

    def __init__(self, folder: FilePath) -> None:
        self.folder = folder

    def record(self, key: Key) -> FilePath:
        """Where the whole record of a path lies."""
        return self.folder / "paths" / f"{key.stem}.npz"

    def curve(self, key: Key) -> FilePath:
        """Where a path's curve file lies."""
        return self.folder / "curves" / f"{key.stem}.csv"

    def find(self, task: Task) -> Path | None:
        """A finished path of the same task, if there is one."""
        try:
            path = load_path(self.record(task.key))
        except ValueError:
            return None
        same = path.programme == task.programme and path.model_sha256 == task.chain.sha256
        if not same or not task.chain.sha256:
            return None
        if not self.curve(task.key).exists():
            # interrupted between the two files
            write_curve(path, self.curve(task.key))
        return path

    def keep(self, key: Key, path: Path) -> None:
        """Write a path's files: the record first, so that what has a curve is never computed again."""
        save_path(path, self.record(key))
        write_curve(path, self.curve(key))


@contextmanager
def worker_pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that end at once when the block is left by an exception or an interrupt."""
    pool = ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"))
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in list((pool._processes or {}).values()):
            process.terminate()
        raise
    pool.shutdown()


def run_sweep(
    tasks: Sequence[Task],
    store: PathStore,
    jobs: int = 1,
    done: Callable[[Key, Path], None] | None = None,
) -> dict[Key, Path]:
    """Compute every path that the store does not have, and keep each as it finishes.

    The result does not depend on the number of jobs. On an interrupt what is finished is in the store.

    Args:
        tasks: the paths.
        store: where they are kept.
        jobs: processes.
        done: called for every path, found or finished.
    """
    paths: dict[Key, Path] = {}

    def finish(key: Key, path: Path) -> None:
        paths[key] = path
        if done is not None:
            done(key, path)

    missing = []
    for task in tasks:
        found = store.find(task)
        if found is None:
            missing.append(task)
        else:
            finish(task.key, found)
    if jobs <= 1:
        for task in missing:
            path = task.run()
            store.keep(task.key, path)
            finish(task.key, path)
    elif missing:
        with worker_pool(jobs) as pool:
            waiting: dict[Future[Path], Task] = {pool.submit(task.run): task for task in missing}
            while waiting:
                ready, _ = wait(waiting, return_when=FIRST_COMPLETED)
                for future in ready:
                    task = waiting.pop(future)
                    path = future.result()
                    store.keep(task.key, path)
                    finish(task.key, path)
    return {task.key: paths[task.key] for task in tasks}
