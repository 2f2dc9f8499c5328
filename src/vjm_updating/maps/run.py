"""Running a map: tasks over processes or a cluster, each kept as it finishes: a run goes on where it ended."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vjm import __version__
from vjm.batch import map_all
from vjm.engine import Engine
from vjm.io.files import check_writable, write_whole
from vjm.io.findings import Finding
from vjm.platform.manipulator import Manipulator
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_output.documents import doubt_rows
from vjm_updating.cluster import on_cluster
from vjm_updating.maps.by_engine import rows_by
from vjm_updating.maps.documents import MapDocument, MapTaskDocument
from vjm_updating.maps.evaluate import COLUMNS, MapQuantity, MapRows, MapTask, evaluate
from vjm_updating.maps.pose_grid import Grid

POSES = {MapQuantity.CRITICAL: 20, MapQuantity.STIFFNESS: 400, MapQuantity.DEFLECTION: 400}
"""Of a task: a second's work or so, which can be lost. Other quantities are not mapped in tasks."""


@dataclass(frozen=True)
class Map:
    """What is to be mapped.

    Attributes:
        manipulator: the machine.
        springs: engine; ``vjm`` keeps the poses that are done.
        quantity: one of `POSES`, asked at each pose.
        grid: of poses.
        wrench: on the platform, N, N mm.
        most: largest force tried for a critical one, N.
        doubts: what is implausible about the machine's file.
    """

    manipulator: Manipulator
    springs: Engine
    quantity: MapQuantity
    grid: Grid
    wrench: tuple[float, ...] = (0.0,) * 6
    most: float = 20_000.0
    doubts: tuple[Finding, ...] = ()

    @property
    def document(self) -> MapDocument:
        """What makes two maps the same."""
        return MapDocument(
            model=self.manipulator.name,
            model_sha256=self.manipulator.sha256,
            version=__version__,
            engine=self.springs.label,
            quantity=str(self.quantity),
            columns=list(COLUMNS[self.quantity]),
            grid_mm=[list(axis) for axis in self.grid.axes],
            wrench=list(self.wrench),
            most_N=self.most,
            doubts=doubt_rows(self.doubts),
        )

    def tasks(self) -> list[MapTask]:
        """The poses in pieces, neighbours together."""
        assert isinstance(self.springs, VjmEngine)
        poses = self.grid.poses()
        size = POSES[self.quantity]
        starts = range(0, len(poses), size)
        return [
            MapTask(
                i, self.manipulator, self.springs, self.quantity, poses[a : a + size], self.wrench, self.most
            )
            for i, a in enumerate(starts)
        ]  # fmt: skip


@dataclass(frozen=True)
class MapResult:
    """A finished map; n poses.

    Attributes:
        map: what was asked.
        values: ``(n, c)``, nan where there is no answer.
        why: ``(n,)`` ``ok``, or why there is none.
    """

    map: Map
    values: Array
    why: tuple[str, ...]

    def cube(self, column: int) -> Array:
        """One column over the grid ``(nx, ny, nz)``; nan where there is no answer."""
        cube: Array = self.values[:, column].reshape(self.map.grid.shape)
        return cube


class MapStore:
    """The finished tasks of a map in its folder."""

    def __init__(self, folder: Path, wanted: Map) -> None:
        """Open or make a folder.

        Raises:
            ValueError: it holds another map.
            OSError: it cannot be written to.
        """
        self.folder = folder
        check_writable(folder)
        text = wanted.document.model_dump_json(indent=1)
        self._digest = hashlib.sha256(text.encode()).hexdigest()
        description = folder / "map.json"
        if description.exists() and description.read_text(encoding="utf-8") != text:
            raise ValueError(f"{description}: this folder holds another map; give another --out, or empty it")
        write_whole(description, text)

    def _file(self, index: int) -> Path:
        return self.folder / "tasks" / f"{index:06d}.json"

    def find(self, task: MapTask) -> MapRows | None:
        """The rows of a finished task, if there are any."""
        try:
            found = MapTaskDocument.model_validate_json(self._file(task.index).read_text(encoding="utf-8"))
            values = np.array(found.values, dtype=float).reshape(len(task.poses), len(COLUMNS[task.quantity]))
        except (OSError, ValueError):
            return None
        if found.map != self._digest or len(found.why) != len(task.poses):
            return None
        return MapRows(task.index, values, found.why)

    def keep(self, rows: MapRows) -> None:
        """Write a task's rows, whole or not at all."""
        values = [[None if np.isnan(v) else float(v) for v in row] for row in rows.values]
        found = MapTaskDocument(map=self._digest, values=values, why=rows.why)
        write_whole(self._file(rows.task), found.model_dump_json())


def run_map(
    wanted: Map,
    folder: Path,
    jobs: int = 1,
    scheduler: str = "",
    progress: Callable[[int, int], None] | None = None,
) -> MapResult:
    """Evaluate a map, from where an earlier run of the same one ended.

    Args:
        wanted: the map.
        folder: where its tasks are kept.
        jobs: processes, where there is no scheduler.
        scheduler: address of a Dask scheduler, such as ``tcp://host:8786``.
        progress: called with the poses that are done, and of how many.

    Raises:
        ValueError: the folder holds another map, or no scheduler answers.
        ImportError: a scheduler is named, but the optional extra is not installed.
    """
    if not isinstance(wanted.springs, VjmEngine):
        labels = [",".join(f"{v:.12g}" for v in pose[:3]) for pose in wanted.grid.poses()]
        machines = [(wanted.manipulator, label) for label in labels]
        values, why = rows_by(wanted.springs, machines, wanted.quantity, wanted.wrench, progress)
        return MapResult(wanted, values, tuple(why))
    store = MapStore(folder, wanted)
    tasks = wanted.tasks()
    found: dict[int, MapRows] = {}
    total, done = len(wanted.grid), 0

    def finish(rows: MapRows) -> None:
        nonlocal done
        found[rows.task] = rows
        done += len(rows.why)
        if progress is not None:
            progress(done, total)

    missing = []
    for task in tasks:
        rows = store.find(task)
        if rows is None:
            missing.append(task)
        else:
            finish(rows)

    def keep(rows: MapRows) -> None:
        store.keep(rows)
        finish(rows)

    if scheduler:
        for _, rows in on_cluster(evaluate, missing, scheduler):
            keep(rows)
    elif missing:
        if jobs > 1:
            # compiled here once, or every process would do it
            evaluate(replace(missing[0], poses=missing[0].poses[:1]))
        map_all(evaluate, missing, min(jobs, len(missing)), done=lambda _, rows: keep(rows))
    ordered = [found[task.index] for task in tasks]
    return MapResult(wanted, np.vstack([rows.values for rows in ordered]), tuple(w for r in ordered for w in r.why))
