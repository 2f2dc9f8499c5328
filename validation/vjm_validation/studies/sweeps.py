"""Sweeps: many paths at once over processes, kept as they finish."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath

from vjm import batch
from vjm.continuation.direction import Direction, ramp_end
from vjm.continuation.path import Path
from vjm.engines import engine_by_name
from vjm.errors import NoConvergenceError
from vjm.io.files import write_whole
from vjm.io.path_files import curve_csv, load_path, save_path
from vjm.io.provenance import Provenance
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm_output import terminal
from vjm_validation.studies.study_results import Key

ENGINES = (
    "vjm-paper", "vjm-16", "vjm-16f16", "exudyn", "exudyn-footspring",
    "vjm-linear", "vjm-unloaded-jacobian", "msa",
)  # fmt: skip
"""The engines of a comparison, in the order of its tables."""


@dataclass(frozen=True)
class PathTask:
    """One path to compute: a chain, an engine by name, a load case, and the key under which it is filed."""

    key: Key
    chain: Machine
    load_case: LoadCase

    @property
    def trace(self) -> batch.Task:
        """The path itself."""
        return batch.Task(engine_by_name(self.key.engine), self.chain, self.load_case)

    @cached_property
    def made_of(self) -> Provenance:
        """All that determines it."""
        trace = self.trace
        return Provenance.of(self.chain.files, machine=self.chain, engine=trace.engine, load_case=self.load_case)


def chain_tasks(
    chain: Machine,
    postures: Sequence[str],
    engines: Sequence[str] = ENGINES,
    steps: int | None = None,
) -> list[PathTask]:
    """The paths of a chain's comparison: every posture, direction and engine.

    Args:
        chain: the machine.
        postures: labels.
        engines: by name.
        steps: number of equal steps of each path; None where they adapt.
    """
    return [
        PathTask(
            Key(posture, direction, engine),
            chain,
            LoadCase(posture, ramp_end(chain, posture, direction), steps=steps),
        )
        for posture in postures
        for direction in Direction
        for engine in engines
    ]


class PathStore:
    """Finished paths of a run in its folder: what an interrupted run resumes from.

    Each path is a curve file for people and a record with everything, which is used again only where all that the
    path was made of is still the same.
    """

    def __init__(self, folder: FilePath) -> None:
        self.folder = folder

    def record(self, key: Key) -> FilePath:
        """Where the whole record of a path lies."""
        return self.folder / "paths" / f"{key.stem}.npz"

    def curve(self, key: Key) -> FilePath:
        """Where a path's curve file lies."""
        return self.folder / "curves" / f"{key.stem}.csv"

    def find(self, task: PathTask) -> Path | None:
        """A finished path of the same task, if there is one."""
        try:
            path = load_path(self.record(task.key), task.made_of.key)
        except ValueError:
            return None
        self._show(path, task.key)
        return path

    def _show(self, path: Path, key: Key) -> None:
        """Write the curve of a path, unless it stands there: an interrupt may have left none, or an older one."""
        file, text = self.curve(key), curve_csv(path)
        if not file.exists() or file.read_bytes() != text.encode():
            write_whole(file, text)

    def keep(self, task: PathTask, path: Path) -> None:
        """Write a path's files: the record first, so that what has a curve is never computed again."""
        save_path(path, self.record(task.key), task.made_of.key)
        self._show(path, task.key)


def run_sweep(
    tasks: Sequence[PathTask],
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

    Raises:
        NoConvergenceError: a path has no beginning; all others are in the store then.
        ValueError: likewise, where an engine lacks something in a chain.
    """
    paths: dict[Key, Path] = {}
    failures: list[tuple[Key, batch.Failure]] = []

    def finish(key: Key, path: Path) -> None:
        paths[key] = path
        if done is not None:
            done(key, path)

    missing: list[PathTask] = []
    for task in tasks:
        found = store.find(task)
        if found is None:
            missing.append(task)
        else:
            finish(task.key, found)

    if spoilt := [task.key for task in missing if store.record(task.key).exists()]:
        terminal.error(
            f"{store.folder}: {len(spoilt)} paths, the first {spoilt[0].stem}, are damaged or made of other "
            "inputs: they are computed anew"
        )

    def keep(index: int, result: Path | batch.Failure) -> None:
        task = missing[index]
        if isinstance(result, batch.Failure):
            failures.append((task.key, result))
        else:
            store.keep(task, result)
            finish(task.key, result)

    batch.trace_all([task.trace for task in missing], jobs, done=keep)
    if failures:
        said = "; ".join(f"{key.stem}: {failure.message}" for key, failure in failures)
        gave_up = all(failure.kind == NoConvergenceError.__name__ for _, failure in failures)
        raise NoConvergenceError(said) if gave_up else ValueError(said)
    return {task.key: paths[task.key] for task in tasks}
