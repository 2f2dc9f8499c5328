"""``validate all MODEL``: a user's own machine in all its postures, engines side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Protocol, runtime_checkable

import numpy as np

from vjm.batch import Failure, Task, map_all, trace_all
from vjm.continuation.arc_length import ArcControl, ArcProblem, follow_arc
from vjm.continuation.path import EventKind, Path, travel
from vjm.engine import Engine
from vjm.engines import EngineOptions, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.loaded_stiffness import held_by_itself
from vjm.model.load_case import COMPONENTS, RAMP, TO_LIMIT, Load, LoadCase
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm.threads import single_threaded
from vjm.tree.equilibria import Equilibria, equilibria
from vjm.vjm_engine import VjmEngine
from vjm_validation.load_any_model import in_postures, loaded
from vjm_validation.metrics import path_metrics
from vjm_validation.studies.force_directions import unit_of
from vjm_validation.studies.own_machine_design import design
from vjm_validation.studies.own_machine_request import (
    REFERENCE,
    Key,
    OwnMachine,
    Progress,
    Request,
    end_name,
    extent,
    solved,
)
from vjm_validation.studies.own_machine_rows import ConvergenceRow, CriticalRow, EndStiffnessRow, LoadRow

# --- Load paths of a user's own machine, its critical points, and how many springs they need ----------------------

SPRINGS, SPRINGS_HELD = (1, 2, 4, 8), (1, 2, 4, 8, 16, 32)
"""In every beam, of the study of convergence, where the end is free and where its pose is imposed. The last is what
the others are compared with, the one before it what all paths are traced with."""
FEW_ELEMENTS, ELEMENTS = 4, 8
"""In every beam: under a force on a free end that moves it by little; and towards a critical point, where the error
of the shape counts. They are of fourth order."""
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
    request: Request, found: OwnMachine, labels: Sequence[str], engines: Sequence[Engine], progress: Progress
) -> None:
    """The load paths in every posture and direction by every engine."""
    keys = list(product(labels, request.directions, engines))
    cases = [_case(request, found, posture, direction, found.size, RAMP) for posture, direction, _ in keys]
    if not found.held:
        cases = [
            replace(case, steps=REFERENCE_STEPS if engine.label == REFERENCE else STEPS)
            for case, (_, _, engine) in zip(cases, keys, strict=True)
        ]
    tasks = [Task(engine, found.machine, case) for (_, _, engine), case in zip(keys, cases, strict=True)]
    results = trace_all(tasks, min(request.jobs, len(tasks)), partial(progress, "loads"))
    found.paths = _kept(found, keys, results, "loads")
    found.loads = _load_rows(found)


def trace_critical(
    request: Request, found: OwnMachine, labels: Sequence[str], engines: Sequence[Engine], progress: Progress
) -> None:
    """The first critical points: by virtual springs everywhere, by finite elements the smallest one."""
    if found.held:
        found.criticals = found.paths
    else:
        lumped, *others = engines
        keys: list[tuple[str, str, Engine]] = [(p, d, lumped) for p, d in product(labels, request.directions)]
        found.criticals = _losses(request, found, keys, progress)
        weakest = _weakest(found.criticals)
        if weakest is not None:
            names = [engine.label for engine in others if isinstance(engine, FollowedEngine)]
            finer = [engine_by_name(name, EngineOptions(ELEMENTS), found.machine) for name in names]
            if finer:
                found.criticals |= _losses(request, found, [(*weakest, engine) for engine in finer], progress)
            if finer and len(keys) > 1:
                found.note(
                    "finite elements follow a growing force in one case only, that of the smallest critical force"
                )
    found.critical = [_critical_row(key, path) for key, path in found.criticals.items()]


def _losses(
    request: Request, found: OwnMachine, keys: Sequence[tuple[str, str, Engine]], progress: Progress
) -> dict[Key, Path]:
    tasks = [
        Task(engine, found.machine, _case(request, found, posture, direction, MOST * found.size, TO_LIMIT))
        for posture, direction, engine in keys
    ]
    results = map_all(first_loss, tasks, min(request.jobs, len(tasks)), partial(progress, "critical forces"))
    return _kept(found, keys, results, "critical forces")


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


def _case(request: Request, found: OwnMachine, posture: str, direction: str, size: float, control: str) -> LoadCase:
    unit = unit_of(direction)
    if found.held:
        axis = next((n for n in COMPONENTS if abs(unit[COMPONENTS.index(n)]) == 1.0), None)
        sign = 1.0 if axis is None else float(unit[COMPONENTS.index(axis)])
        return LoadCase(posture, sign * size, axis or tuple(unit), gravity=request.gravity)
    return LoadCase(
        posture, size, "load", loads=(Load(tuple(unit)),), free=COMPONENTS, gravity=request.gravity, control=control
    )


def _kept(
    found: OwnMachine, keys: Sequence[tuple[str, str, Engine]], results: Sequence[Path | Failure], what: str
) -> dict[Key, Path]:
    """Paths by key; what has none becomes a note."""
    paths: dict[Key, Path] = {}
    for (posture, direction, engine), result in zip(keys, results, strict=True):
        if isinstance(result, Failure):
            found.note(f"{engine.label} has no {what}: {result.message}")
        else:
            paths[posture, direction, engine.label] = result
    return paths


def _load_rows(found: OwnMachine) -> list[LoadRow]:
    rows = []
    unit = np.repeat([1.0, extent(found.machine)], 3)
    answers = {key: path.force[-1:] if found.held else unit * _moved(path) for key, path in found.paths.items()}
    # a direction in which a machine is rigid, or a mechanism, answers with rounding
    least = NOTHING * max((float(np.abs(answer).max()) for answer in answers.values()), default=0.0)
    for (posture, direction, engine), path in found.paths.items():
        reference = found.paths.get((posture, direction, REFERENCE))
        apart = None
        if reference is not None and engine != REFERENCE and path.complete and reference.complete:
            ours, theirs = answers[posture, direction, engine], answers[posture, direction, REFERENCE]
            apart = float(np.abs(ours - theirs).max() / max(float(np.abs(theirs).max()), least))
        along = abs(float(unit_of(direction)[:3] @ _moved(path)[:3]))
        K: list[float | None] = [float(point.tangent) for point in (path.points[0], path.points[-1])]
        if (float(np.abs(path.force[-1])) if found.held else along) < least:
            K = [0.0, 0.0] if found.held else [None, None]
        rows.append(
            LoadRow(
                posture=posture, direction=direction, engine=engine, K0=K[0], K_end=K[1],
                force=float(path.force[-1]), moved=_moved(path).tolist(), difference=apart, stopped=path.stopped,
            )
        )  # fmt: skip
    return rows


def _moved(path: Path) -> Array:
    """Displacement ``(6,)`` of the end-effector along the path; rotation vectors of some hundredths add up."""
    result: Array = path.points[-1].displacement - path.points[0].displacement
    return result


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


def studied(found: OwnMachine) -> tuple[str, str, bool] | None:
    """Posture and direction of the smallest critical force, else of the largest loss of stiffness; which it is."""
    lumped = next(iter(found.paths))[2] if found.paths else ""
    critical = [row for row in found.critical if row.engine == lumped and row.F_cr is not None]
    if critical:
        row = min(critical, key=lambda each: float(each.F_cr or 0.0))
        return row.posture, row.direction, True
    loads = [(row.K_end / row.K0, row) for row in found.loads if row.engine == lumped and row.K0 and row.K_end]
    if not loads:
        return None
    softer = min(loads, key=lambda each: each[0])[1]
    return softer.posture, softer.direction, False


def converge(found: OwnMachine, lumped: VjmEngine, progress: Progress) -> None:
    """What is studied, with more and more springs in every beam."""
    where = studied(found)
    beams = [beam.name for beam in found.machine.beams if beam.section is not None]
    if where is None or not beams:
        found.note("no study of convergence: no beam is split into springs" if not beams else "no load path")
        return
    posture, direction, critical = where
    source = found.criticals if critical else found.paths
    case = source[posture, direction, lumped.label].load_case
    numbers = SPRINGS_HELD if found.held else SPRINGS
    paths: dict[int, Path] = {}
    for done, n in enumerate(numbers):
        progress("convergence", done, len(numbers))
        engine = replace(lumped, segments=n, parts=tuple((name, n) for name in beams))
        task = Task(engine, found.machine, case)
        (path,) = [first_loss(task)] if critical and not found.held else trace_all([task])
        if isinstance(path, Failure):
            found.note(f"no study of convergence: {path.message}")
            return
        paths[n] = path
    progress("convergence", len(numbers), len(numbers))
    values = {n: quantity(path, critical, found.held) for n, path in paths.items()}
    last = values[numbers[-1]]
    if last is None:
        return
    name = "critical force, N" if critical else "force, N" if found.held else "deflection, mm"
    found.convergence = [
        ConvergenceRow(
            posture=posture,
            direction=direction,
            quantity=name,
            springs=n,
            value=value,
            error=abs(value / last - 1.0),
        )
        for n, value in values.items()
        if value is not None
    ]
    reference = source.get((posture, direction, REFERENCE))
    found.elements = quantity(reference, critical, found.held) if reference is not None else None


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
    springs = SPRINGS_HELD[-2] if held else SPRINGS[-2]
    lumped = engine_by_name(request.engines[0], EngineOptions(springs), machine)
    if not isinstance(lumped, VjmEngine):
        raise ValueError(f"--engine {request.engines[0]}: the first engine must be vjm, vjm-paper or vjm-<n>")
    lumped = _refined(lumped, machine)
    found = OwnMachine(machine, drawn, held, _size(request, machine, labels, lumped, held))
    engines: list[Engine] = [lumped]
    for name in request.engines[1:]:
        try:
            engines.append(engine_by_name(name, EngineOptions(ELEMENTS if held else FEW_ELEMENTS), machine))
        except (ValueError, ImportError) as error:
            found.note(f"{name} was left out: {error}")
    if not held:
        found.stiffness = _stiffness(request, found, labels, lumped)
    trace_loads(request, found, labels, engines, progress)
    trace_critical(request, found, labels, engines, progress)
    converge(found, lumped, progress)
    design(request, found, labels, progress)
    return found


def _refined(engine: VjmEngine, machine: Machine) -> VjmEngine:
    """The engine with its springs in beams too that have a smaller number of their own: elements split them all."""
    n = engine.segments
    if n is None:
        return engine
    few = [beam.name for beam in machine.beams if beam.section is not None and (beam.own_segments or n) < n]
    return replace(engine, parts=(*((name, n) for name in few), *engine.parts))


def _size(request: Request, machine: Machine, labels: Sequence[str], lumped: VjmEngine, held: bool) -> float:
    if held:
        return request.reach or _round(REACH * machine.characteristic_length)
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
    return _round(DEFLECTION * extent(machine) / largest_compliance)


def _round(value: float) -> float:
    """Down to 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** np.floor(np.log10(value))
    return float(max(m * decade for m in (1.0, 2.0, 5.0) if m * decade <= value))


def _compliance(at: Equilibria) -> Array:
    """``(e, 6, 6)`` of the first posture."""
    assert at.compliance is not None
    C: Array = at.compliance[0]
    return C


def _stiffness(
    request: Request, found: OwnMachine, labels: Sequence[str], lumped: VjmEngine
) -> list[EndStiffnessRow]:
    model, rows = lumped.model(found.machine), []
    for label in labels:
        for load in ("none", "weight") if request.gravity else ("none",):
            gravity = request.gravity if load == "weight" else None
            at = equilibria(model, model.posture(label), gravity=gravity)
            if not at.found[0]:
                found.note(f"posture {label}, load {load}: no equilibrium, and so no stiffness")
                continue
            for end, C in zip(model.ends, _compliance(at), strict=True):
                along = [_along(C, unit) for unit in np.eye(6)]
                rows.append(EndStiffnessRow(posture=label, end=end, load=load, along=along))
    return rows


def _along(C: Array, unit: Array) -> float | None:
    """Stiffness along or about a direction ``(6,)`` of a compliance ``(6, 6)``; None where nothing deflects."""
    compliance, kind = float(unit @ C @ unit), slice(0, 3) if unit[:3].any() else slice(3, 6)
    # the residual of a direction in which nothing moves is rounding
    return 1.0 / compliance if compliance > RIGID * float(np.diag(C)[kind].max()) else None
