"""The studies of the paper's chain and what a run holds of them.

Here are paths of every engine, kept as they finish; critical force against number and placement of springs; end
conditions and imperfections. Results that need finite elements are here as data only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from vjm import batch
from vjm.batch import Failure, Task, trace_all
from vjm.continuation.lumped_problem import ImperfectionCurve, imperfection_curve
from vjm.continuation.path import EventKind, Path
from vjm.engines import Engine, VjmEngine, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.io.files import write_whole
from vjm.io.path_files import curve_csv, load_path, save_path
from vjm.io.provenance import Provenance
from vjm.model.load_case import TO_LIMIT, Direction, Load, LoadCase, ramp_end
from vjm.model.machine import Machine
from vjm.model.parts import Placement
from vjm.rotations import Array
from vjm_output import terminal
from vjm_output.documents import Row
from vjm_updating.diagnosis.document import CriticalPointRow, FoldRow

if TYPE_CHECKING:
    from vjm_validation.studies.robots import RobotStudy


CAUSE = "link_lumping"
"""What the data hold and the sheet lacks."""


class Discovery(Row):
    """The discovery as ``summary.json`` has it; N."""

    verdict: str
    causes: list[str]
    confidence: float
    held_out: list[FoldRow]
    """Tension predicted from compression, and compression from tension."""
    critical: list[CriticalPointRow]
    truth_N: float | None  # noqa: N815
    """Critical force in compression of the finite elements that made the data, which no reading reached."""
    readings: int
    seconds: float
    """Of the diagnosis."""

    @property
    def error(self) -> float:
        """Of compression held out, over its force."""
        fold = next((fold for fold in self.held_out if fold.name == "compression"), None)
        return float("inf") if fold is None else fold.rmse_after / fold.force

    @property
    def tension(self) -> CriticalPointRow:
        """Critical forces in tension."""
        return next(row for row in self.critical if row.direction == "tension")

    @property
    def compression(self) -> CriticalPointRow:
        """And in compression."""
        return next(row for row in self.critical if row.direction == "compression")


@dataclass(frozen=True)
class DiscoveryStudy:
    """Rows and curves.

    Attributes:
        rows: what was found.
        page: the diagnosis, relative to the run's folder.
        displacement: as read ``(n,)`` mm.
        force: as read ``(n,)`` N.
        nominal: the sheet's model, in tension and compression.
        extended: the extended model file, likewise.
    """

    rows: Discovery
    page: str
    displacement: Array
    force: Array
    nominal: tuple[Path, Path]
    extended: tuple[Path, Path]


@dataclass(frozen=True, order=True)
class Key:
    """Which path of a run: posture label, direction, engine label."""

    posture: str
    direction: Direction
    engine: str

    @property
    def stem(self) -> str:
        """Name of the path's files without their ending."""
        return f"{self.posture}_{self.direction}_{self.engine}"


@dataclass(frozen=True)
class LumpingStudy:
    """Critical force of one posture against the number and the placement of the bar's springs.

    Attributes:
        posture: label.
        direction: of the ramp.
        reference: critical force of the finite elements, N; None where they have none on the path.
        rows: (placement, number of springs, critical force in N or None where the path has no bifurcation).
    """

    posture: str
    direction: Direction
    reference: float | None
    rows: tuple[tuple[str, int, float | None], ...]


@dataclass(frozen=True)
class EndConditionStudy:
    """What the support of the end-effector decides.

    Attributes:
        paths: compression by posture, end condition and engine; under dead loads to the first limit point.
        imperfections: largest force against the size of an imperfection by posture, under a dead load on a hinged
            end-effector, where the perfect chain buckles and then collapses.
    """

    paths: Mapping[tuple[str, str, str], Path]
    imperfections: Mapping[str, ImperfectionCurve]


@dataclass
class Run:
    """What `validate all` computed.

    Attributes:
        chain: the machine.
        paths: by posture, direction and engine.
        lumping: the study that names the tension artefact's cause, one per direction.
        end_conditions: critical points under other supports than the paper's; None without the study.
        robots: whole robots beside Exudyn's; None without the study.
        discovery: a diagnosis of finite elements' data under the paper's model; None without the study.
        summary: the content of ``summary.json``.
    """

    chain: Machine
    paths: dict[Key, Path] = field(default_factory=dict)
    lumping: tuple[LumpingStudy, ...] = ()
    end_conditions: EndConditionStudy | None = None
    robots: RobotStudy | None = None
    discovery: DiscoveryStudy | None = None
    summary: Mapping[str, Any] = field(default_factory=dict)


SPRINGS = (1, 2, 4, 8, 16, 32)
REACH_MM = 8.0
"""Far enough for two end springs, which buckle at 5.5 mm."""


def lumping_study(
    chain: Machine,
    posture: str,
    direction: Direction,
    reference: float | None,
) -> LumpingStudy:
    """First bifurcation of one posture with the bar in 1 to 32 springs, at every placement.

    Args:
        chain: the machine; its bar needs a section.
        posture: label.
        direction: of the ramp along x.
        reference: critical force of the finite elements, N, or None.
    """
    rows = []
    for placement in Placement:
        for n in SPRINGS:
            path = VjmEngine(n, placement=placement).trace(chain, LoadCase(posture, direction.sign * REACH_MM))
            event = path.critical
            sharp = event is not None and event.kind is EventKind.BIFURCATION
            rows.append((str(placement), n, event.force if event is not None and sharp else None))
    return LumpingStudy(posture, direction, reference, tuple(rows))


ROTATIONS = ("rx", "ry", "rz")
FORCE_N = 10_000.0
"""How far forces are driven: above every critical force of the library's chain."""
SIZES_MM = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
"""Of the imperfections: from far below what can be made to far above."""
HINGED_LOAD = "dead load, hinged"

END_CONDITIONS: Mapping[str, str] = {
    "pose imposed": "the paper's: all six components of the pose are imposed",
    "hinged": "the displacement along x is imposed, the end-effector turns freely about its point",
    "dead load": "a dead force pushes along x on a straight guide, which holds the rest of the pose",
    HINGED_LOAD: "a dead force pushes along x on a straight guide, and the end-effector turns freely",
}
"""Name and meaning of each."""


def end_load_case(condition: str, posture: str, reach: float) -> LoadCase:
    """Compression along x under an end condition.

    Args:
        condition: one of `END_CONDITIONS`.
        posture: label.
        reach: mm, where a displacement is imposed; forces are driven up to `FORCE_N`.
    """
    free = ROTATIONS if "hinged" in condition else ()
    if "dead load" not in condition:
        return LoadCase(posture, -reach, free=free)
    force = Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    return LoadCase(posture, -FORCE_N, "load", free=("x", *free), loads=(force,), control=TO_LIMIT)


def end_condition_study(
    chain: Machine,
    reaches: Mapping[str, float],
    engines: Sequence[Engine],
    jobs: int = 1,
    done: Callable[[int, int], None] | None = None,
) -> EndConditionStudy:
    """Compression of a chain under every end condition, and what imperfections cost where a dead load collapses it.

    Args:
        chain: the machine; its beams need sections.
        reaches: how far each posture is compressed, mm.
        engines: the first is a lumped one, which imperfections are put into.
        jobs: processes.
        done: called with how many paths are finished, and of how many.

    Raises:
        ValueError: an engine finds no path at all.
    """
    keys = [(p, condition, k) for p in reaches for condition in END_CONDITIONS for k in range(len(engines))]
    tasks = [Task(engines[k], chain, end_load_case(condition, p, reaches[p])) for p, condition, k in keys]
    paths: dict[tuple[str, str, str], Path] = {}
    for (posture, condition, k), path in zip(keys, trace_all(tasks, jobs, done), strict=True):
        if isinstance(path, Failure):
            raise ValueError(f"posture {posture}, {condition}, {engines[k].label}: {path.message}")
        paths[posture, condition, engines[k].label] = path
    lumped = engines[0]
    assert isinstance(lumped, VjmEngine)
    imperfections = {}
    for posture in reaches:
        hinged = paths[posture, HINGED_LOAD, lumped.label]
        kinds = [event.kind for event in hinged.events]
        if kinds[:1] == [EventKind.BIFURCATION] and EventKind.LIMIT in kinds:
            imperfections[posture] = imperfection_curve(partial(lumped.problem, chain), hinged.load_case, SIZES_MM)
    return EndConditionStudy(paths, imperfections)


ENGINES = (
    "vjm-paper", "vjm-16", "vjm-16f16", "exudyn", "exudyn-footspring",
    "vjm-linear", "msa",
)  # fmt: skip
"""The engines of a comparison, in the order of its tables."""
SECOND = "opensees"
"""The second finite element program, an optional extra that takes part where verification is asked for."""


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
        stored_path = store.find(task)
        if stored_path is None:
            missing.append(task)
        else:
            finish(task.key, stored_path)

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
