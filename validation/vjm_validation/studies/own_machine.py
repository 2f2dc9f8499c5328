"""``validate all MODEL``: a user's own machine in all its postures, engines side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Protocol, runtime_checkable

import numpy as np
from pydantic import Field

from vjm.analysis import held_by_itself
from vjm.batch import Failure, Task, map_all, trace_all
from vjm.continuation.arc_length import ArcControl, ArcProblem, follow_arc
from vjm.continuation.path import EventKind, Path, travel
from vjm.design.modes import Modes, modes
from vjm.design.sensitivity import DesignQuantity, sensitivity
from vjm.design.shares import shares
from vjm.engines import Engine, EngineOptions, VjmEngine, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.io.file_parameters import MachineFiles
from vjm.machine.equilibria import Equilibria, equilibria
from vjm.machine.inverse_kinematics import ranges_of
from vjm.machine.rigid_mechanism import LoopClosure
from vjm.model.load_case import COMPONENTS, RAMP, TO_LIMIT, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity, Mechanism
from vjm.model.parts import Beam, RigidOffset
from vjm.rotations import Array
from vjm.threads import single_threaded
from vjm_output.documents import DoubtRow, Row
from vjm_updating.maps.evaluate import MapQuantity, MapSetting
from vjm_updating.maps.grid import grid_origin, parsed_grid, points_of
from vjm_updating.maps.run import Map, run_map
from vjm_validation.acceptance import AcceptanceRow
from vjm_validation.design_documents import SOUGHT, map_document, sensitivity_document, shares_row
from vjm_validation.documents import MapRowsDocument, SensitivityDocument, SharesRow
from vjm_validation.load_any_model import DIRECTIONS, in_postures, loaded, unit_of
from vjm_validation.metrics import path_metrics, round_down

# --- What a run on a user's own machine holds: the content of its ``summary.json`` --------------------------------


class EndStiffnessRow(Row):
    """How stiff the free end is in one posture: force over the deflection along it, nothing else held."""

    posture: str
    end: str
    """Name of the end frame; empty where the machine names none."""
    load: str
    """``none`` or ``weight``."""
    along: list[float | None]
    """Along x, y, z in N/mm and about them in N mm/rad, world axes; null where nothing deflects."""


class LoadRow(Row):
    """One load path of one engine."""

    posture: str
    direction: str
    engine: str
    K0: float | None
    """N/mm along the direction, at its beginning; null where nothing deflects along it."""
    K_end: float | None
    """Likewise at its end."""
    force: float
    """N at its end."""
    moved: list[float]
    """Of the end-effector from the beginning of the path: mm, and rotation vector in rad, world axes."""
    difference: float | None
    """Largest difference of ``moved``, turns times the machine's size, or of the force where the pose is imposed,
    to finite elements, over its size; null for themselves and without them."""
    stopped: str
    """Why the path ends before; empty where it does not."""


class CriticalRow(Row):
    """The first critical point of one engine under a growing load."""

    posture: str
    direction: str
    engine: str
    kind: EventKind | None
    """Null: none up to the largest load tried."""
    F_cr: float | None
    """N, a magnitude."""
    d_cr: float | None
    """mm along the direction."""
    largest: float
    """N that was reached."""
    stopped: str


class ConvergenceRow(Row):
    """One quantity with a number of springs in every beam."""

    posture: str
    direction: str
    quantity: str
    """Critical force in N, or deflection in mm."""
    springs: int
    value: float
    error: float
    """Relative, to the value with the most springs."""


class FrequencyRow(Row):
    """One natural frequency in one posture."""

    posture: str
    mode: int
    """Counted from 1, the lowest first."""
    frequency_Hz: float  # noqa: N815
    growth_per_s: float
    """By which its amplitude grows; zero for a stable machine."""
    largest_at: str
    """The part, and the fraction of its length, that moves most."""


class OwnMachineSummary(Row):
    """The content of ``summary.json`` of a run on one's own machine; N, mm, rad."""

    command: str
    model: str
    control: str
    """``free``: dead forces on the free end; ``held``: its pose is imposed along the direction, the rest held."""
    gravity: list[float] | None
    """m/s²."""
    stiffness: list[EndStiffnessRow]
    loads: list[LoadRow]
    critical: list[CriticalRow]
    convergence: list[ConvergenceRow]
    elements: float | None
    """The quantity of ``convergence`` by finite elements; null without them."""
    shares: list[SharesRow]
    """Of every part in the deflection, posture by posture, under a hundredth of the force along its least stiff
    direction."""
    shares_along: dict[str, str]
    """That direction by posture."""
    modes: list[FrequencyRow]
    """The lowest natural frequencies without a force on the end, under the weight where it acts."""
    sensitivity: SensitivityDocument | None
    """Of the stiffness in the least stiff posture and direction
    to the numbers of the model file; null without one."""
    map: MapRowsDocument | None
    """Of the stiffness about one posture; null without one."""
    acceptance: list[AcceptanceRow]
    seconds: float
    versions: dict[str, str]
    made_of: dict[str, str]
    """All that determines the run: SHA-256 of files by name, options and versions."""
    hashes: dict[str, str]
    notes: list[str]
    """What was left out of this run, and why."""
    doubts: list[DoubtRow] = Field(default=[])
    """What is implausible about the model."""


# --- What is asked of a user's own machine, and what is found -----------------------------------------------------

ENGINES = ("vjm", "exudyn")
REFERENCE = "exudyn"

Key = tuple[str, str, str]
"""Posture, direction, engine."""
Progress = Callable[[str, int, int], None]
"""Told what is done, how much of it, and of how much."""


@dataclass(frozen=True)
class Request:
    """What is asked for.

    Attributes:
        model: name or path.
        postures: labels; all where there are none.
        directions: such as ``x`` or ``-z``.
        force: N on the free end; None for one of a size that suits the machine.
        reach: mm of an imposed pose; likewise.
        gravity: m/s²; None for none.
        engines: by name; the first is the lumped model.
        jobs: processes.
    """

    model: str
    postures: tuple[str, ...] = ()
    directions: tuple[str, ...] = DIRECTIONS
    force: float | None = None
    reach: float | None = None
    gravity: Gravity | None = None
    engines: tuple[str, ...] = ENGINES
    jobs: int = 1


@dataclass
class OwnMachine:
    """What was found.

    Attributes:
        machine: what is solved: its end-effector is its first end frame.
        drawn: the machine as its file has it.
        held: whether poses are imposed, as passive joints let the end move freely; else it is free.
        size: N of the largest force, or mm of the imposed displacement.
        paths: by posture, direction and engine.
        criticals: paths to the first critical point under a growing load; those of ``paths`` where poses are held.
        stiffness: of the free ends.
        loads: one row a path.
        critical: one row a path of ``criticals``.
        convergence: with the number of springs.
        elements: the quantity of ``convergence`` by finite elements, a critical force under a growing load refined
            until it has converged.
        shares: of the parts in the deflection, posture by posture.
        shares_along: the direction of the force that deflects, by posture.
        modes: the lowest natural frequencies, posture by posture.
        shapes: the motions of those by posture.
        sensitivity: of the stiffness to the numbers of the model file.
        stiffened: the load path whose stiffness that is.
        map: of the stiffness about a posture.
        map_axes: values of its axes by name, in the order of its rows.
        map_posture: label of that posture.
        notes: what was left out, and why.
    """

    machine: Machine
    drawn: Machine
    held: bool
    size: float
    paths: dict[Key, Path] = field(default_factory=dict)
    criticals: dict[Key, Path] = field(default_factory=dict)
    stiffness: list[EndStiffnessRow] = field(default_factory=list)
    loads: list[LoadRow] = field(default_factory=list)
    critical: list[CriticalRow] = field(default_factory=list)
    convergence: list[ConvergenceRow] = field(default_factory=list)
    elements: float | None = None
    shares: list[SharesRow] = field(default_factory=list)
    shares_along: dict[str, str] = field(default_factory=dict)
    modes: list[FrequencyRow] = field(default_factory=list)
    shapes: dict[str, Modes] = field(default_factory=dict)
    sensitivity: SensitivityDocument | None = None
    stiffened: LoadRow | None = None
    map: MapRowsDocument | None = None
    map_axes: dict[str, list[float]] = field(default_factory=dict)
    map_posture: str = ""
    notes: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Say once what is omitted."""
        if text not in self.notes:
            self.notes.append(text)


def solved(drawn: Machine) -> Machine:
    """The machine that is solved: its end-effector is its first end frame."""
    part = next(iter(drawn.ends.values()), drawn.parts[-1].name)
    if part == drawn.parts[-1].name:
        return drawn
    name = next(iter(drawn.ends))
    if name in [each.name for each in drawn.parts]:
        name = f"{name}-end"
    ends = {**drawn.ends, next(iter(drawn.ends)): name}
    return replace(
        drawn, parts=(*drawn.parts, RigidOffset(name, np.eye(4))), after={**drawn.after, name: part}, ends=ends
    )


def extent(machine: Machine) -> float:
    """Size of a machine in mm: what an arm can reach; where loops are closed, the longest part."""
    if machine.closes:
        return machine.characteristic_length
    before = machine.predecessors
    parts, name, length = {part.name: part for part in machine.parts}, machine.parts[-1].name, 0.0
    while name:
        part = parts[name]
        if isinstance(part, Beam):
            length += float(np.linalg.norm(part.tip))
        elif isinstance(part, RigidOffset):
            length += float(np.linalg.norm(part.transform[:3, 3]))
        name = before[name]
    return max(1.0, length)


def end_name(machine: Machine) -> str:
    """Name of the end frame at the end-effector; empty where the machine names none."""
    return next((name for name, part in machine.ends.items() if part == machine.parts[-1].name), "")


# --- What contributes to the deflection of a user's own machine, how it vibrates, what to stiffen, and a map ------

SPRINGS, FEW_SPRINGS = VjmEngine(4), VjmEngine(2)
"""Of frequencies, good to 1e-4 with four springs a beam; and of shares, sensitivities and the map, which at small
loads do not depend on the number."""
SMALL = 0.01
"""Of the largest force: what shares are asked under. So little is linear and far from any loss of
stability, behind which there are other equilibria."""
MODES = 6
"""Natural frequencies of a posture."""
TRIED = 2 * SOUGHT
"""Numbers of the file that matter most, of which it is looked for what doubles the stiffness: some do not."""
ASIDE = 0.1
"""Of the machine's size, or rad: how far a map goes to each side of its posture where there is no workspace."""
POINTS = {1: (21,), 2: (11, 11), 3: (7, 7, 3)}
"""Of a map, by the number of its axes."""
REACHED = 1e-6
"""Of a unit motion along an axis: what the drives leave of it where they can make it."""
SINGULAR = 1e-3
"""Singular value over the largest below which the end does not move by the drives."""
MECHANISM = (
    "no compliance shares, natural frequencies, sensitivities and map: passive joints let the end move without "
    "straining a spring"
)


def design(request: Request, study: OwnMachine, labels: Sequence[str], progress: Progress) -> None:
    """Shares, natural frequencies, sensitivities and a map of a machine that its drives hold."""
    if study.held:
        study.note(MECHANISM)
        return
    steps: list[Callable[[], None]] = [
        lambda: _shares(study, labels),
        lambda: _modes(request, study, labels),
        lambda: _sensitivity(request, study),
        lambda: _map(request, study, labels),
    ]
    for done, step in enumerate(steps):
        progress("design", done, len(steps))
        step()
    progress("design", len(steps), len(steps))


def least_stiff(study: OwnMachine, labels: Sequence[str]) -> list[LoadRow]:
    """The load path of each posture along which the stiffness is least, by virtual springs."""
    rows = []
    for label in labels:
        known = [row for row in study.loads if row.posture == label and row.K0 and row.engine.startswith("vjm")]
        rows += [min(known, key=lambda row: row.K0 or np.inf)] if known else []
    return rows


def _shares(study: OwnMachine, labels: Sequence[str]) -> None:
    for row in least_stiff(study, labels):
        wrench = SMALL * study.size * unit_of(row.direction)
        try:
            result = shares(study.machine, row.posture, wrench=wrench.tolist(), engine=FEW_SPRINGS)
        except (ValueError, NoConvergenceError) as error:
            study.note(f"no compliance shares in posture {row.posture}: {error}")
            continue
        study.shares.append(shares_row(result))
        study.shares_along[row.posture] = row.direction


def _modes(request: Request, study: OwnMachine, labels: Sequence[str]) -> None:
    for label in labels:
        try:
            result = modes(study.machine, label, number=MODES, gravity=request.gravity, engine=SPRINGS)
        except ValueError as error:
            study.note(f"no natural frequencies: {error}")
            continue
        except NoConvergenceError as error:
            study.note(f"no natural frequencies in posture {label}: {error}")
            continue
        study.shapes[label] = result
        study.modes += [
            FrequencyRow(posture=label, mode=k + 1, frequency_Hz=f, growth_per_s=g, largest_at=result.largest(k))
            for k, (f, g) in enumerate(zip(result.frequencies.tolist(), result.growth.tolist(), strict=True))
        ]
        if result.massless:
            study.note(f"for natural frequencies these beams have no mass: {', '.join(result.massless)}")


# --- what to stiffen ----------------------------------------------------------------------------------


def _sensitivity(request: Request, study: OwnMachine) -> None:
    ways = least_stiff(study, list(dict.fromkeys(row.posture for row in study.loads)))
    if not ways:
        study.note("nothing to stiffen: nothing deflects along the directions asked for")
        return
    row = min(ways, key=lambda each: each.K0 or np.inf)
    files = MachineFiles.read(request.model)
    parameters = [files.parameter(key, row.posture) for key in files.keys()]  # noqa: SIM118
    along = COMPONENTS[int(np.argmax(np.abs(unit_of(row.direction))))]
    try:
        result = sensitivity(
            study.machine, parameters, DesignQuantity.STIFFNESS, row.posture, along=along, engine=FEW_SPRINGS,
            factors=TRIED, leave_out=True,
        )  # fmt: skip
    except (ValueError, NoConvergenceError) as error:
        study.note(f"no sensitivities: {error}")
        return
    if not any(each.relative for each in result.rows):
        study.note("nothing to stiffen: no number of a part in the model file changes the stiffness")
        return
    study.sensitivity = sensitivity_document(result)
    study.stiffened = row
    if result.left_out:
        name, why = result.left_out[0]
        study.note(f"what to stiffen leaves out {len(result.left_out)} numbers of the file, such as {name}: {why}")


# --- map ----------------------------------------------------------------------------------------------


def _map(request: Request, study: OwnMachine, labels: Sequence[str]) -> None:
    """A map of the stiffness about the posture that is farthest from a singular one."""
    try:
        grid, posture = _grid(study, labels)
        setting = MapSetting(
            study.machine, SPRINGS, MapQuantity.STIFFNESS, gravity=request.gravity, end=end_name(study.machine)
        )
        points = points_of(setting.model, parsed_grid(grid, setting.model), posture, setting.end)
        result = run_map(Map(setting, points))
    except ValueError as error:
        study.note(f"no map of the stiffness: {error}")
        return

    study.map_axes, study.map_posture = {n: list(v) for n, v in points.grid.ordered.items()}, posture
    study.map = map_document(result)


def _grid(study: OwnMachine, labels: Sequence[str]) -> tuple[str, str]:
    """The grid as ``validate map`` has it, and its posture.

    It is over the axes along which the drives can move the end, or over the first two drives where these are fewer
    than two.

    Raises:
        ValueError: nothing is driven.
    """
    machine = study.machine
    model = FEW_SPRINGS.model(machine)
    ranges = ranges_of(model)
    driven = [name for name, is_driven in zip(model.joints, ranges.driven, strict=True) if is_driven]
    if not driven:
        raise ValueError("no joint is driven")
    best = max(labels, key=lambda label: _dexterity(machine, label, driven))
    axes = _reached(machine, best, driven)
    if len(axes) < 2:
        return ",".join(_joint_axis(study, model, name, best, min(2, len(driven))) for name in driven[:2]), best
    place = _end(machine, best)[:3, 3] - grid_origin(model)
    words = []
    for k, count in zip(axes, POINTS[len(axes)], strict=True):
        low, high = place[k] + extent(machine) * ASIDE * np.array([-1.0, 1.0])
        if machine.workspace is not None:
            low, high = machine.workspace[:, k]
        words.append(f"{'xyz'[k]}={low:.9g}:{high:.9g}:{count}" if high > low else f"{'xyz'[k]}={low:.9g}")
    return ",".join(words), best


def _joint_axis(study: OwnMachine, model: Mechanism, name: str, posture: str, count: int) -> str:
    k = model.joints.index(name)
    ranges, coordinate = ranges_of(model), float(model.posture(posture)[k])
    aside = ASIDE * (1.0 if ranges.turns[k] else extent(study.machine))
    low, high = max(coordinate - aside, float(ranges.low[k])), min(coordinate + aside, float(ranges.high[k]))
    return f"{name}={low:.9g}:{high:.9g}:{POINTS[count][0]}"


def _motions(machine: Machine, label: str, driven: Sequence[str]) -> Array:
    """Shifts ``(3, k)`` of the end by independent motions of the drives, lengths over the machine's."""
    closing = LoopClosure(machine, label)
    _, J, _, J_end = closing.tree.linearised(closing.home[None])
    moving = np.array([name in driven for name in closing.tree.names]) | closing.tree.passive * machine.closes
    gaps, shifts = J[0][:, moving], J_end[0][:3, moving]
    if not len(gaps):
        return shifts
    _, s, Vt = np.linalg.svd(gaps)
    return shifts @ Vt[int(np.count_nonzero(s > SINGULAR * s[0])) :].T


def _dexterity(machine: Machine, label: str, driven: Sequence[str]) -> tuple[int, float]:
    """In how many directions the end moves, and its smallest motion over its largest."""
    s = np.linalg.svd(_motions(machine, label, driven), compute_uv=False)
    kept = s[s > SINGULAR * s[0]] if s[0] > 0.0 else s[:0]
    return len(kept), float(kept[-1] / kept[0]) if len(kept) else 0.0


def _reached(machine: Machine, label: str, driven: Sequence[str]) -> list[int]:
    """Axes 0 to 2 along which the drives can move the end."""
    U, s, _ = np.linalg.svd(_motions(machine, label, driven))
    kept = U[:, : int(np.count_nonzero(s > SINGULAR * s[0]))] if s[0] > 0.0 else U[:, :0]
    left = np.eye(3) - kept @ kept.T
    return [k for k in range(3) if np.linalg.norm(left[:, k]) < REACHED]


def _end(machine: Machine, label: str) -> Array:
    return LoopClosure(machine, label).end


# --- Load paths of a user's own machine, its critical points, and how many springs they need ----------------------

SPRINGS_A_BEAM, HELD_SPRINGS_A_BEAM = 4, 16
"""What all paths are traced with, where the end is free and where its pose is imposed."""
FEW_ELEMENTS, ELEMENTS = 4, 8
"""In every beam: under a force on a free end that moves it by little; and towards a critical point, where the error
of the shape counts."""
CONVERGED = 1e-3
"""Largest change by twice as many springs or elements. Their error is of fourth order where segments turn and
stretch by little, and of second order where a beam that is held at both ends is stretched by per cents. By second
order a third of the change is left: of springs and elements together 7e-4."""
MOST_IN_A_BEAM = 64
"""Springs or elements. By second order this is good to 1e-4 where 16 are good to 2e-3."""
STEPS, REFERENCE_STEPS = 4, 2
"""Of a force on a free end, which moves it by little; a path takes more where it bends."""
MOST = 300.0
"""Times the force, up to which critical points are looked for."""
NOTHING = 1e-6
"""Of the largest answer of all load paths: what is less is none."""
EVENTS = (EventKind.BIFURCATION, EventKind.LIMIT)
FIRST_LOSS = ArcControl(last=EventKind.BIFURCATION)
"""A path ends at its first loss of stability."""


@runtime_checkable
class FollowedEngine(Protocol):
    """An engine whose paths are followed by their arc."""

    label: str

    def problem(self, chain: Machine, load_case: LoadCase) -> ArcProblem:
        """The machine in the load case's posture."""


def trace_loads(
    request: Request, study: OwnMachine, labels: Sequence[str], engines: Sequence[Engine], progress: Progress
) -> None:
    """The load paths in every posture and direction by every engine."""
    keys = list(product(labels, request.directions, engines))
    cases = [_case(request, study, posture, direction, study.size, RAMP) for posture, direction, _ in keys]
    if not study.held:
        cases = [
            replace(case, steps=REFERENCE_STEPS if engine.label == REFERENCE else STEPS)
            for case, (_, _, engine) in zip(cases, keys, strict=True)
        ]
    tasks = [Task(engine, study.machine, case) for (_, _, engine), case in zip(keys, cases, strict=True)]
    results = trace_all(tasks, min(request.jobs, len(tasks)), partial(progress, "loads"))
    study.paths = _kept(study, keys, results, "loads")
    study.loads = _load_rows(study)


def trace_critical(
    request: Request, study: OwnMachine, labels: Sequence[str], engines: Sequence[Engine], progress: Progress
) -> None:
    """The first critical points: by virtual springs everywhere, by finite elements the smallest one."""
    if study.held:
        study.criticals = study.paths
    else:
        lumped, *others = engines
        keys: list[tuple[str, str, Engine]] = [(p, d, lumped) for p, d in product(labels, request.directions)]
        study.criticals = _losses(request, study, keys, progress)
        weakest = _weakest(study.criticals)
        if weakest is not None:
            names = [engine.label for engine in others if isinstance(engine, FollowedEngine)]
            finer = [engine_by_name(name, EngineOptions(ELEMENTS), study.machine) for name in names]
            if finer:
                study.criticals |= _losses(request, study, [(*weakest, engine) for engine in finer], progress)
            if finer and len(keys) > 1:
                study.note(
                    "finite elements follow a growing force in one case only, that of the smallest critical force"
                )
    study.critical = [_critical_row(key, path) for key, path in study.criticals.items()]


def _losses(
    request: Request, study: OwnMachine, keys: Sequence[tuple[str, str, Engine]], progress: Progress
) -> dict[Key, Path]:
    tasks = [
        Task(engine, study.machine, _case(request, study, posture, direction, MOST * study.size, TO_LIMIT))
        for posture, direction, engine in keys
    ]
    results = map_all(first_loss, tasks, min(request.jobs, len(tasks)), partial(progress, "critical forces"))
    return _kept(study, keys, results, "critical forces")


@single_threaded
def first_loss(task: Task) -> Path | Failure:
    """The path of a task up to its first loss of stability, or why there is none."""
    engine, machine = task.engine, task.chain
    assert isinstance(engine, FollowedEngine)
    try:
        path = follow_arc(engine.problem(machine, task.load_case), task.load_case, FIRST_LOSS)
    except (NoConvergenceError, ValueError) as error:
        return Failure(type(error).__name__, str(error))
    return replace(path, model=machine.name, model_sha256=machine.sha256)


def _weakest(paths: dict[Key, Path]) -> tuple[str, str] | None:
    """Posture and direction of the smallest critical force; None where there is none."""
    rows = [row for row in (_critical_row(key, path) for key, path in paths.items()) if row.F_cr is not None]
    least = min(rows, key=lambda row: row.F_cr or 0.0, default=None)
    return None if least is None else (least.posture, least.direction)


def _case(request: Request, study: OwnMachine, posture: str, direction: str, size: float, control: str) -> LoadCase:
    unit = unit_of(direction)
    if study.held:
        axis = next((n for n in COMPONENTS if abs(unit[COMPONENTS.index(n)]) == 1.0), None)
        sign = 1.0 if axis is None else float(unit[COMPONENTS.index(axis)])
        return LoadCase(posture, sign * size, axis or tuple(unit), gravity=request.gravity)
    return LoadCase(
        posture, size, "load", loads=(Load(tuple(unit)),), free=COMPONENTS, gravity=request.gravity, control=control
    )


def _kept(
    study: OwnMachine, keys: Sequence[tuple[str, str, Engine]], results: Sequence[Path | Failure], what: str
) -> dict[Key, Path]:
    """Paths by key; what has none becomes a note."""
    paths: dict[Key, Path] = {}
    for (posture, direction, engine), result in zip(keys, results, strict=True):
        if isinstance(result, Failure):
            study.note(f"{engine.label} has no {what}: {result.message}")
        else:
            paths[posture, direction, engine.label] = result
    return paths


def _load_rows(study: OwnMachine) -> list[LoadRow]:
    rows = []
    unit = np.repeat([1.0, extent(study.machine)], 3)
    answers = {key: path.force[-1:] if study.held else unit * _moved(path) for key, path in study.paths.items()}
    # a direction in which a machine is rigid, or a mechanism, answers with rounding
    least = NOTHING * max((float(np.abs(answer).max()) for answer in answers.values()), default=0.0)
    for (posture, direction, engine), path in study.paths.items():
        reference = study.paths.get((posture, direction, REFERENCE))
        apart = None
        if reference is not None and engine != REFERENCE and path.complete and reference.complete:
            ours, theirs = answers[posture, direction, engine], answers[posture, direction, REFERENCE]
            apart = float(np.abs(ours - theirs).max() / max(float(np.abs(theirs).max()), least))
        along = abs(float(unit_of(direction)[:3] @ _moved(path)[:3]))
        K: list[float | None] = [float(point.tangent) for point in (path.points[0], path.points[-1])]
        if (float(np.abs(path.force[-1])) if study.held else along) < least:
            K = [0.0, 0.0] if study.held else [None, None]
        rows.append(
            LoadRow(
                posture=posture, direction=direction, engine=engine, K0=K[0], K_end=K[1],
                force=float(path.force[-1]), moved=_moved(path).tolist(), difference=apart, stopped=path.stopped,
            )
        )  # fmt: skip
    return rows


def _moved(path: Path) -> Array:
    """Displacement ``(6,)`` of the end-effector along the path; rotation vectors of some hundredths add up."""
    return path.points[-1].displacement - path.points[0].displacement


def _critical_row(key: Key, path: Path) -> CriticalRow:
    posture, direction, engine = key
    event = next((e for e in path.events if e.kind in EVENTS), None)
    return CriticalRow(
        posture=posture, direction=direction, engine=engine,
        kind=event.kind if event else None,
        F_cr=abs(event.force) if event else None,
        d_cr=travel(path, event.point) if event and event.point else None,
        largest=float(np.max(np.abs(path.force))), stopped=path.stopped,
    )  # fmt: skip


def studied(study: OwnMachine) -> tuple[str, str, bool] | None:
    """Posture and direction of the smallest critical force, else of the largest loss of stiffness; which it is."""
    lumped = next(iter(study.paths))[2] if study.paths else ""
    critical = [row for row in study.critical if row.engine == lumped and row.F_cr is not None]
    if critical:
        row = min(critical, key=lambda each: float(each.F_cr or 0.0))
        return row.posture, row.direction, True
    loads = [(row.K_end / row.K0, row) for row in study.loads if row.engine == lumped and row.K0 and row.K_end]
    if not loads:
        return None
    softer = min(loads, key=lambda each: each[0])[1]
    return softer.posture, softer.direction, False


def converge(study: OwnMachine, lumped: VjmEngine, progress: Progress) -> None:
    """What is studied, with more and more springs in every beam."""
    where = studied(study)
    beams = [beam.name for beam in study.machine.beams if beam.section is not None]
    if where is None or not beams:
        study.note("no study of convergence: no beam is split into springs" if not beams else "no load path")
        return
    posture, direction, critical = where
    source = study.criticals if critical else study.paths
    traced = source[posture, direction, lumped.label]
    follows = critical and not study.held

    def with_springs(n: int) -> Path | Failure:
        engine = replace(lumped, segments=n, parts=tuple((name, n) for name in beams))
        task = Task(engine, study.machine, traced.load_case)
        return first_loss(task) if follows else trace_all([task])[0]

    fewest = 2 * (HELD_SPRINGS_A_BEAM if study.held else SPRINGS_A_BEAM)
    values = _refined_values(study, with_springs, critical, 1, fewest, partial(progress, "convergence"))
    if not values:
        return
    last = list(values.values())[-1]
    name = "critical force, N" if critical else "force, N" if study.held else "deflection, mm"
    study.convergence = [
        ConvergenceRow(
            posture=posture,
            direction=direction,
            quantity=name,
            springs=n,
            value=value,
            error=abs(value / last - 1.0),
        )
        for n, value in values.items()
    ]
    used = HELD_SPRINGS_A_BEAM if study.held else SPRINGS_A_BEAM
    off = abs(values[used] / last - 1.0) if used in values else 0.0
    if off > CONVERGED:
        study.note(
            f"with the {used} springs a beam of the other load paths, the {name.split(',')[0]} is {off:.1%} off"
        )
    reference = source.get((posture, direction, REFERENCE))
    study.elements = quantity(reference, critical, study.held) if reference is not None else None
    if reference is None or not follows:
        return

    def with_elements(n: int) -> Path | Failure:
        if n == ELEMENTS:
            return reference
        engine = engine_by_name(REFERENCE, EngineOptions(n), study.machine)
        return first_loss(Task(engine, study.machine, reference.load_case))

    finer = _refined_values(study, with_elements, critical, ELEMENTS, 2 * ELEMENTS, partial(progress, "elements"))
    if finer:
        study.elements = list(finer.values())[-1]


def _refined_values(
    study: OwnMachine,
    trace: Callable[[int], Path | Failure],
    critical: bool,
    first: int,
    fewest: int,
    progress: Callable[[int, int], None],
) -> dict[int, float]:
    """What is studied by the number of springs or elements a beam, doubled until it has converged.

    Args:
        study: for notes.
        trace: the path with a number of them.
        critical: whether the critical force is studied.
        first: number.
        fewest: with which at least it is known.
        progress: told how many are done, of how many at least.
    """
    values: dict[int, float] = {}
    n, change = first, np.inf
    while n <= fewest or (n <= MOST_IN_A_BEAM and change > CONVERGED):
        progress(len(values), max(len(values) + 1, (fewest // first).bit_length()))
        path = trace(n)
        if isinstance(path, Failure):
            study.note(f"no study of convergence: {path.message}")
            return {}
        value = quantity(path, critical, study.held)
        if value is not None:
            change = abs(values[n // 2] / value - 1.0) if n // 2 in values else np.inf
            values[n] = value
        n *= 2
    progress(len(values), len(values))
    return values if n // 2 in values else {}


def quantity(path: Path, critical: bool, held: bool) -> float | None:
    """The critical force of a path, or its deflection at the end; the force there where the pose is imposed."""
    if critical:
        return next((abs(event.force) for event in path.events if event.kind in EVENTS), None)
    if held:
        return path_metrics(path).F_end
    return travel(path, path.points[-1]) - travel(path, path.points[0])


# ------------------------------------------------------------------------------------------------------------------


DEFLECTION = 0.005
"""Of the machine's size: how far the default force moves the end at most, by linear theory."""
REACH = 0.013
"""Of the longest part: how far an imposed pose goes by default; the paper's 4 mm of 310 mm."""
RIGID = 1e-12
"""Of the largest compliance of its kind: less is rounding, and no deflection."""


def study(request: Request, progress: Progress = lambda name, done, total: None) -> OwnMachine:
    """Load the machine in every posture and direction with every engine.

    Raises:
        ModelFileError: the file is no model.
        ValueError: no such posture, direction or engine.
    """
    drawn, labels = in_postures(loaded(request.model), request.postures)
    for direction in request.directions:
        unit_of(direction)
    machine = solved(drawn)
    held = not held_by_itself(machine, labels[0])
    springs = HELD_SPRINGS_A_BEAM if held else SPRINGS_A_BEAM
    lumped = engine_by_name(request.engines[0], EngineOptions(springs), machine)
    if not isinstance(lumped, VjmEngine):
        raise ValueError(f"--engine {request.engines[0]}: the first engine must be vjm, vjm-paper or vjm-<n>")
    lumped = _refined(lumped, machine)
    machine_study = OwnMachine(machine, drawn, held, _size(request, machine, labels, lumped, held))
    engines: list[Engine] = [lumped]
    for name in request.engines[1:]:
        try:
            engines.append(engine_by_name(name, EngineOptions(ELEMENTS if held else FEW_ELEMENTS), machine))
        except (ValueError, ImportError) as error:
            machine_study.note(f"{name} was left out: {error}")
    if not held:
        machine_study.stiffness = _stiffness(request, machine_study, labels, lumped)
    trace_loads(request, machine_study, labels, engines, progress)
    trace_critical(request, machine_study, labels, engines, progress)
    converge(machine_study, lumped, progress)
    design(request, machine_study, labels, progress)
    return machine_study


def _refined(engine: VjmEngine, machine: Machine) -> VjmEngine:
    """The engine with its springs in beams too that have a smaller number of their own: elements split them all."""
    n = engine.segments
    if n is None:
        return engine
    few = [beam.name for beam in machine.beams if beam.section is not None and (beam.own_segments or n) < n]
    return replace(engine, parts=(*((name, n) for name in few), *engine.parts))


def _size(request: Request, machine: Machine, labels: Sequence[str], lumped: VjmEngine, held: bool) -> float:
    if held:
        return request.reach or round_down(REACH * machine.characteristic_length)
    if request.force is not None:
        return request.force
    largest_compliance, model = 0.0, lumped.model(machine)
    for label in labels:
        C = _compliance(equilibria(model, model.posture(label)))[model.ends.index(end_name(machine))]
        largest_compliance = max(
            largest_compliance, *(float(unit_of(d) @ C @ unit_of(d)) for d in request.directions)
        )
    if not largest_compliance > 0.0:
        raise ValueError(f"{machine.name}: nothing deflects in the directions asked for")
    return round_down(DEFLECTION * extent(machine) / largest_compliance)


def _compliance(states: Equilibria) -> Array:
    """``(e, 6, 6)`` of the first posture."""
    assert states.compliance is not None
    return states.compliance[0]


def _stiffness(
    request: Request, study: OwnMachine, labels: Sequence[str], lumped: VjmEngine
) -> list[EndStiffnessRow]:
    model, rows = lumped.model(study.machine), []
    for label in labels:
        for load in ("none", "weight") if request.gravity else ("none",):
            gravity = request.gravity if load == "weight" else None
            states = equilibria(model, model.posture(label), gravity=gravity)
            if not states.converged[0]:
                study.note(f"posture {label}, load {load}: no equilibrium, and so no stiffness")
                continue
            for end, C in zip(model.ends, _compliance(states), strict=True):
                along = [_along(C, unit) for unit in np.eye(6)]
                rows.append(EndStiffnessRow(posture=label, end=end, load=load, along=along))
    return rows


def _along(C: Array, unit: Array) -> float | None:
    """Stiffness along or about a direction ``(6,)`` of a compliance ``(6, 6)``; None where nothing deflects."""
    compliance, kind = float(unit @ C @ unit), slice(0, 3) if unit[:3].any() else slice(3, 6)
    # the residual of a direction in which nothing moves is rounding
    return 1.0 / compliance if compliance > RIGID * float(np.diag(C)[kind].max()) else None
