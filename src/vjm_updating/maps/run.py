"""Running a map: tasks over processes or a cluster, each kept as it finishes: a run goes on where it ended.

Also a quantity over the workspace of a machine, in one call.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from pydantic import Field

from vjm import __version__
from vjm.analysis import held_by_itself
from vjm.batch import Progress, map_all
from vjm.engines import Engine, EngineOptions, VjmEngine, engine_by_name
from vjm.errors import MechanismError
from vjm.io.files import check_writable, write_whole
from vjm.io.findings import Finding
from vjm.io.provenance import Provenance
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity, Mechanism
from vjm.outcome import Outcome
from vjm.plain_numbers import finite_numbers
from vjm.postures import Posture, in_posture
from vjm.rotations import Array
from vjm_output.documents import DoubtRow, Row, doubt_rows
from vjm_updating.constants import numerical
from vjm_updating.maps.evaluate import (
    COLUMNS,
    NAMES,
    SHOWN,
    TITLES,
    MapQuantity,
    MapRows,
    MapSetting,
    MapTask,
    evaluate,
)
from vjm_updating.maps.grid import MapGrid, MapPoints, parsed_grid, points_of

if TYPE_CHECKING:
    from vjm.outcome import Axes


Item = TypeVar("Item")
Result = TypeVar("Result")

RETRIES = numerical(5)
"""Times that a cluster may lose a task with its worker before it gives up."""
PATIENCE = "10s"
"""How long a scheduler has to answer."""


def on_cluster(
    function: Callable[[Item], Result], tasks: Sequence[Item], address: str
) -> Iterator[tuple[int, Result]]:
    """Index and result of each task as the cluster finishes it; what dies with a worker is done again by another.

    The ``function`` can be pickled, and its result must follow from its argument alone. The ``address`` is of a
    Dask scheduler, such as ``tcp://host:8786``.

    Raises:
        ImportError: the optional extra is not installed.
        ValueError: no scheduler answers.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise ImportError(
            "--scheduler needs Dask: install the optional extra, pip install 'vjm-stiffness[cluster]'"
        ) from None
    try:
        client = distributed.Client(address, timeout=PATIENCE)
    except (OSError, ValueError, TypeError) as failure:
        reason = " ".join(str(failure).split())[:200]
        raise ValueError(f"--scheduler {address}: no Dask scheduler answers there ({reason})") from None
    with client:
        futures = {
            client.submit(function, task, pure=False, retries=RETRIES): index for index, task in enumerate(tasks)
        }
        for future, result in distributed.as_completed(list(futures), with_results=True):
            yield futures[future], result


def compute_all(
    function: Callable[[Item], Result],
    tasks: Sequence[Item],
    jobs: int = 1,
    scheduler: str = "",
    *,
    done: Callable[[int, Result], None],
) -> None:
    """Do all tasks, over processes or by a cluster; ``done`` takes the index and the result of each as it finishes.

    Raises:
        ImportError: as `on_cluster`.
        ValueError: likewise.
    """
    if not scheduler:
        map_all(function, tasks, jobs, done=done)
        return
    for index, result in on_cluster(function, tasks, scheduler):
        done(index, result)


# --- The JSON files of a map's folder -----------------------------------------------------------------------------


class MapDocument(Row):
    """``map.json``: what was asked."""

    model: str
    model_sha256: str
    version: str
    engine: str
    quantity: str
    columns: list[str]
    """Of ``map.csv``, between the place and its status."""
    grid: dict[str, list[float]]
    """Values of joints, mm or rad, or of the end's x, y and z, mm: from home for a machine with poses."""
    posture: str
    """That gives what the grid leaves out."""
    end: str
    """Name of the end frame; empty for the first."""
    wrench: list[float]
    """On the end, N and N mm."""
    gravity: list[float] | None
    """m/s²."""
    loads: list[str]
    """On parts."""
    most_N: float  # noqa: N815
    """Largest force tried for a critical one."""
    made_of: dict[str, str]
    """All that determines the answers: SHA-256 of files by name, options and versions."""
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


POINTS = numerical({
    MapQuantity.STIFFNESS: 400, MapQuantity.DEFLECTION: 400, MapQuantity.CRITICAL: 20, MapQuantity.FREQUENCY: 20,
    MapQuantity.SHARES: 20,
})  # fmt: skip
"""Of a task: a second's work or so, which can be lost. An engine that goes from point to point has one."""


@dataclass(frozen=True)
class Map:
    """What is to be mapped."""

    setting: MapSetting
    points: MapPoints
    doubts: tuple[Finding, ...] = ()

    @cached_property
    def made_of(self) -> Provenance:
        """What makes two maps the same."""
        setting = self.setting
        return Provenance.of(
            setting.machine.files, machine=setting.machine, engine=setting.engine, quantity=setting.quantity,
            grid=self.points.grid.ordered, posture=self.points.posture, end=setting.end, wrench=setting.wrench,
            gravity=setting.gravity, load=setting.loads, most=setting.most,
        )  # fmt: skip

    @property
    def document(self) -> MapDocument:
        """What was asked, and what answers are made of."""
        setting, machine = self.setting, self.setting.machine
        return MapDocument(
            model=machine.name,
            model_sha256=machine.sha256,
            version=__version__,
            engine=setting.engine.label,
            quantity=str(setting.quantity),
            columns=list(COLUMNS[setting.quantity]),
            grid={name: list(values) for name, values in self.points.grid.ordered.items()},
            posture=self.points.posture,
            end=setting.end,
            wrench=list(setting.wrench),
            gravity=None if setting.gravity is None else list(setting.gravity),
            loads=[str(load) for load in setting.loads],
            most_N=setting.most,
            made_of=dict(self.made_of.inputs),
            doubts=doubt_rows(self.doubts),
        )

    def tasks(self) -> list[MapTask]:
        """The points that are reached in pieces, neighbours together."""
        q = self.points.q[self.points.reached]
        size = POINTS[self.setting.quantity] if isinstance(self.setting.engine, VjmEngine) else 1
        return [MapTask(i, self.setting, q[a : a + size]) for i, a in enumerate(range(0, len(q), size))]


@dataclass(frozen=True)
class MapResult(Outcome):
    """A finished map; g points.

    Attributes:
        map: what was asked.
        values: ``(g, c)`` in the order of `COLUMNS`, nan where there is no answer.
        why: ``(g,)`` ``ok``, or why there is none.
        names: of a map of the shares, g times the part and the kind; empty texts where there is no answer.

    Example:
        >>> import vjm
        >>> from vjm_updating import workspace_map
        >>> workspace = workspace_map(vjm.load("planar-2r"), {"elbow": [0.5, 1.5]}, "frequency")
        >>> len(workspace.table())
        2
    """

    map: Map
    values: Array
    why: tuple[str, ...]
    names: tuple[tuple[str, str], ...] = ()

    @property
    def joints(self) -> dict[str, Array]:
        """Coordinates ``(g,)`` of the joints that drives set, or of all where no loops are closed."""
        setting, q = self.map.setting, self.map.points.q
        driven = {joint.name for joint in setting.machine.held_joints}
        return {
            name: q[:, k]
            for k, name in enumerate(setting.model.joints)
            if name in driven or not setting.machine.closes
        }

    def table(self) -> list[dict[str, Any]]:
        """A row for each point: coordinates, place of the end, values, the worst part's names, and status."""
        joints, places = self.joints, self.map.points.places
        columns = COLUMNS[self.map.setting.quantity]
        return [
            {name: float(q[i]) for name, q in joints.items()}
            | dict(zip(("x_mm", "y_mm", "z_mm"), places[i].tolist(), strict=True))
            | dict(zip(columns, self.values[i].tolist(), strict=True))
            | (dict(zip(NAMES, self.names[i], strict=True)) if self.names else {})
            | {"status": why}
            for i, why in enumerate(self.why)
        ]

    def to_dict(self) -> dict[str, Any]:
        """What was asked, and `table`."""
        return self.map.document.model_dump(mode="json") | {"points": self.table()}

    def plot(self, ax: Axes | None = None) -> Axes:
        """The shown column over a grid of one or two axes.

        Raises:
            ImportError: matplotlib is not installed.
            ValueError: the grid has more axes.
        """
        from vjm.outcome import axes_or_new

        grid, shown = self.map.points.grid, SHOWN[self.map.setting.quantity]
        axes = {name: grid.ordered[name] for name in grid.varied}
        if not 1 <= len(axes) <= 2:
            raise ValueError(f"the grid has {len(axes)} axes, and a picture takes one or two: fix the others")
        ax = axes_or_new(ax)
        values, title = np.squeeze(self.cube(shown)), TITLES[self.map.setting.quantity]
        (x, first), *others = axes.items()
        ax.set_xlabel(x)
        for y, second in others:
            drawn = ax.pcolormesh(first, second, np.ma.masked_invalid(values.T), shading="nearest")
            ax.set_ylabel(y)
            ax.figure.colorbar(drawn, ax=ax, label=title)
        if not others:
            ax.plot(first, values, "o-", markersize=3)
            ax.set_ylabel(title)
        return ax

    def cube(self, column: int) -> Array:
        """One column over the grid, an axis for each of its own; nan where there is no answer."""
        return self.values[:, column].reshape(self.map.points.grid.shape)


class MapStore:
    """The finished tasks of a map in its folder."""

    def __init__(self, folder: Path, wanted: Map) -> None:
        """Open or make a folder.

        Raises:
            OtherInputsError: it holds another map.
            OSError: it cannot be written to.
        """
        self.folder, self._made_of = folder, wanted.made_of
        check_writable(folder)
        description = folder / "map.json"
        if description.exists():
            try:
                earlier = json.loads(description.read_bytes()).get("made_of")
            except (ValueError, AttributeError):
                earlier = None
            self._made_of.check(
                earlier, f"{description}: this folder holds another map", "give another --out, or empty it"
            )
        write_whole(description, wanted.document.model_dump_json(indent=1))

    def _file(self, index: int) -> Path:
        return self.folder / "tasks" / f"{index:06d}.json"

    def find(self, task: MapTask) -> MapRows | None:
        """The rows of a finished task, if there are any."""
        stored = self._made_of.kept(self._file(task.number))
        if stored is None or len(stored["why"]) != len(task.q):
            return None
        columns = len(COLUMNS[task.setting.quantity])
        values = np.array(stored["values"], dtype=float).reshape(len(task.q), columns)
        return MapRows(task.number, values, stored["why"], [(part, kind) for part, kind in stored["names"]])

    def keep(self, rows: MapRows) -> None:
        """Write a task's rows, whole or not at all."""
        content = {"values": rows.values.tolist(), "why": rows.why, "names": rows.names}
        self._made_of.keep(self._file(rows.task), content)


def run_map(
    wanted: Map,
    folder: Path | None = None,
    jobs: int = 1,
    scheduler: str = "",
    progress: Callable[[int, int], None] | None = None,
) -> MapResult:
    """Evaluate a map, from where an earlier run of the same one ended.

    Tasks are kept in the ``folder``, where there is one, and done by so many ``jobs``, processes, or by the Dask
    ``scheduler`` of an address such as ``tcp://host:8786``. The ``progress`` is told how many points are done, and
    of how many.

    Raises:
        ValueError: see `MapSetting.check`, the folder holds another map, or no scheduler answers.
        ImportError: a scheduler is named, but the optional extra is not installed.
    """
    wanted.setting.check()
    tasks, points = wanted.tasks(), wanted.points
    store = None if folder is None else MapStore(folder, wanted)
    rows_by_task: dict[int, MapRows] = {}
    missing: list[MapTask] = []
    done, total = len(points.why) - len(points.reached), len(points.why)

    def finish(rows: MapRows) -> None:
        nonlocal done
        rows_by_task[rows.task] = rows
        done += len(rows.why)
        if progress is not None:
            progress(done, total)

    def keep(rows: MapRows) -> None:
        if store is not None:
            store.keep(rows)
        finish(rows)

    for task in tasks:
        rows = None if store is None else store.find(task)
        if rows is None:
            missing.append(task)
        else:
            finish(rows)
    if missing and jobs > 1 and not scheduler:
        # compiled here once, or every process would do it
        evaluate(missing[0]._replace(q=missing[0].q[:1]))
    compute_all(evaluate, missing, jobs, scheduler, done=lambda _, rows: keep(rows))
    values = np.full((len(points.why), len(COLUMNS[wanted.setting.quantity])), np.nan)
    why, names = list(points.why), [("", "")] * len(points.why)
    ordered = [rows_by_task[task.number] for task in tasks]
    if ordered:
        values[points.reached] = np.vstack([rows.values for rows in ordered])
    for row, said in zip(points.reached, (each for rows in ordered for each in rows.why), strict=True):
        why[row] = said
    if wanted.setting.quantity is not MapQuantity.SHARES:
        return MapResult(wanted, values, tuple(why))
    for row, own in zip(points.reached, (each for rows in ordered for each in rows.names), strict=True):
        names[row] = own
    return MapResult(wanted, values, tuple(why), tuple(names))


MOST_N = numerical(20_000.0)
"""Largest force tried for a critical one."""
REFINED = "vjm-4"
"""Springs a beam: critical loads of a pinned column within 1e-3, at a quarter of the cost of 16."""


def workspace_map(
    machine: Machine,
    grid: int | str | Mapping[str, Sequence[float] | float],
    quantity: MapQuantity | str = MapQuantity.STIFFNESS,
    *,
    wrench: Sequence[float] | None = None,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    posture: Posture = "",
    end: str = "",
    most: float = MOST_N,
    engine: str | Engine = REFINED,
    jobs: int = 1,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> MapResult:
    """A quantity over places of the end, or over joints.

    Args:
        machine: see `vjm.load`.
        grid: values by the name of a joint, mm and rad, or by x, y and z of the end, mm; or how many points a side
            of the workspace that the machine names; or a text such as ``elbow=0:2:21,wrist=0.5``.
        quantity: ``stiffness``, ``critical``, ``deflection``, ``frequency`` or ``shares``.
        wrench: ``(6,)`` on the end, N and N mm.
        gravity: m/s².
        loads: on parts.
        posture: of what the grid leaves out; the first one if left out.
        end: name of the end frame; the first if left out.
        most: largest force that is tried for a critical one, N.
        engine: a word of `vjm.engine_by_name`, or an engine.
        jobs: processes.
        folder: where what is done is kept; a map of the same arguments goes on from there.
        progress: called with how many points are done, and of how many.

    Raises:
        ValueError: no such quantity, joint or posture, a load that the quantity needs is missing, or ``folder``
            holds another map.

    Example:
        >>> import vjm
        >>> from vjm_updating import workspace_map
        >>> workspace = workspace_map(vjm.load("planar-2r"), {"elbow": [0.5, 1.0]}, "frequency")
        >>> [f"{row['f1_Hz']:.2f} Hz" for row in workspace.table()]
        ['4.50 Hz', '4.94 Hz']
    """
    quantity = MapQuantity(quantity)
    check_mapped(machine)
    wrench = None if wrench is None else finite_numbers("wrench", wrench, 6)
    unloaded = wrench is None and gravity is None and not loads
    if unloaded and quantity in (MapQuantity.DEFLECTION, MapQuantity.SHARES):
        raise ValueError(f"a map of the {quantity} needs a load: give wrench, gravity or loads")
    if quantity is MapQuantity.CRITICAL and wrench is not None:
        raise ValueError("a map of critical forces looks at all directions itself: leave wrench out")
    machine, label = in_posture(machine, posture or next(iter(machine.postures)))
    solver = engine_by_name(engine, EngineOptions(), machine) if isinstance(engine, str) else engine
    on_end = tuple(float(value) for value in ((0.0,) * 6 if wrench is None else wrench))
    setting = MapSetting(machine, solver, quantity, on_end, gravity=gravity, loads=tuple(loads), end=end, most=most)
    setting.check()
    points = points_of(setting.model, _grid(grid, setting.model), label, end)
    return run_map(Map(setting, points), folder, jobs, "", progress)


def check_mapped(machine: Machine) -> None:
    """Refuse a machine that has no map.

    Raises:
        MechanismError: its end is a mechanism.
    """
    if not held_by_itself(machine):
        raise MechanismError(
            f"{machine.name}: its passive joints leave the end a mechanism, which has no map: "
            "give the whole machine"
        )


def _grid(grid: int | str | Mapping[str, Sequence[float] | float], model: Mechanism) -> MapGrid:
    if not isinstance(grid, Mapping):
        return parsed_grid(str(grid), model)
    # names are those of the text
    named = parsed_grid(",".join(f"{name}=0" for name in grid), model)
    values = [np.atleast_1d(np.array(given, dtype=float)) for given in grid.values()]
    if any(not len(each) or not np.all(np.isfinite(each)) or np.any(np.diff(each) <= 0.0) for each in values):
        raise ValueError("grid: values must be finite and run upwards")
    return replace(named, axes={name: tuple(own.tolist()) for name, own in zip(named.axes, values, strict=True)})
