"""``validate all MODEL``: a user's own machine in all its postures, engines side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product

import numpy as np

from vjm.batch import Failure, Task, trace_all
from vjm.continuation.path import EventKind, Path, travel
from vjm.engine import Engine
from vjm.engines import EngineOptions, engine_by_name, trace_machine
from vjm.loaded_stiffness import held_by_itself
from vjm.machine.legs import in_pose
from vjm.model.chain import Chain
from vjm.model.load_case import COMPONENTS, RAMP, TO_LIMIT, Load, LoadCase
from vjm.platform.manipulator import Machine, Manipulator
from vjm.rotations import Array
from vjm.tree.equilibria import Equilibria, equilibria, largest_residual
from vjm.tree.model import Gravity, TreeModel
from vjm.vjm_engine import VjmEngine
from vjm_validation.load_any_model import in_postures, loaded
from vjm_validation.metrics import path_metrics
from vjm_validation.studies.force_directions import DIRECTIONS, unit_of
from vjm_validation.studies.own_machine_rows import ConvergenceRow, CriticalRow, LoadRow, StiffnessRow

ENGINES = ("vjm", "exudyn")
REFERENCE = "exudyn"
ELEMENTS = 8
"""In every beam: of fourth order, 1e-5 of a deflection of the size that is looked at."""
SPRINGS = (1, 2, 4, 8, 16, 32)
"""In every beam, of the study of convergence; the last is what the others are compared with."""
DEFLECTION = 0.005
"""Of the machine's size: how far the default force moves the end at most, by linear theory."""
REACH = 0.013
"""Of the longest part: how far an imposed pose goes by default; the paper's 4 mm of 310 mm."""
MOST = 300.0
"""Times the force, up to which critical points are looked for."""
NOTHING = 1e-6
"""Of the largest answer of all load paths: what is less is none."""
RIGID = 1e-12
"""Of the largest compliance of its kind: less is rounding, and no deflection."""
EVENTS = (EventKind.BIFURCATION, EventKind.LIMIT)

Key = tuple[str, str, str]
"""Posture, direction, engine."""


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
        segments: springs in every beam without a number of its own.
        jobs: processes.
    """

    model: str
    postures: tuple[str, ...] = ()
    directions: tuple[str, ...] = DIRECTIONS
    force: float | None = None
    reach: float | None = None
    gravity: Gravity | None = None
    engines: tuple[str, ...] = ENGINES
    segments: int = 16
    jobs: int = 1


@dataclass
class OwnMachine:
    """What was found.

    Attributes:
        machine: a chain or a manipulator.
        held: whether poses are imposed, as passive joints leave the end a mechanism; else it is free.
        size: N of the largest force, or mm of the imposed displacement.
        paths: by posture, direction and engine.
        criticals: paths to the first critical point under a growing load; those of ``paths`` where poses are held.
        stiffness: of the free end.
        loads: one row a path.
        critical: one row a path of ``criticals``.
        convergence: with the number of springs.
        elements: the quantity of ``convergence`` by finite elements.
        residuals: of a tree, the largest scaled residual of each equilibrium; nan where there is none.
        notes: what was left out, and why.
    """

    machine: Machine
    held: bool
    size: float
    paths: dict[Key, Path] = field(default_factory=dict)
    criticals: dict[Key, Path] = field(default_factory=dict)
    stiffness: list[StiffnessRow] = field(default_factory=list)
    loads: list[LoadRow] = field(default_factory=list)
    critical: list[CriticalRow] = field(default_factory=list)
    convergence: list[ConvergenceRow] = field(default_factory=list)
    elements: float | None = None
    residuals: dict[tuple[str, str], float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


Progress = Callable[[str, int, int], None]


def study(request: Request, progress: Progress = lambda name, done, total: None) -> OwnMachine:
    """Load the machine in every posture and direction with every engine.

    Raises:
        ModelFileError: the file is no model.
        ValueError: no such posture, direction or engine.
    """
    machine, labels = in_postures(loaded(request.model), request.postures)
    for direction in request.directions:
        unit_of(direction)
    held = isinstance(machine, Chain) and not held_by_itself(machine)
    lumped = engine_by_name(request.engines[0], EngineOptions(request.segments), machine)
    if not isinstance(lumped, VjmEngine):
        raise ValueError(f"--engine {request.engines[0]}: the first engine must be vjm, vjm-paper or vjm-<n>")
    lumped = _refined(lumped, machine)
    found = OwnMachine(machine, held, _size(request, machine, labels, lumped, held))
    engines: list[Engine] = [lumped]
    for name in request.engines[1:]:
        try:
            engines.append(engine_by_name(name, EngineOptions(ELEMENTS), machine))
        except (ValueError, ImportError) as error:
            found.notes.append(f"{name} was left out: {error}")
    if isinstance(machine, Chain):
        found.stiffness = _stiffness(request, machine, labels, lumped)
    if isinstance(machine, Chain) and machine.is_tree:
        found.notes.append(
            "of a machine that is no chain this shows equilibria; `validate curve` shows its load paths"
        )
        found.loads = _tree_rows(request, found, machine, lumped, labels)
        return found
    keys = list(product(labels, request.directions, engines))
    case = partial(_case, request, found)
    found.paths = _traced(
        found, [(k, case(k[0], k[1], found.size, RAMP)) for k in keys], request.jobs, "loads", progress
    )
    found.loads = _load_rows(found)
    if held:
        found.criticals = found.paths
    else:
        cases = [(k, case(k[0], k[1], MOST * found.size, TO_LIMIT)) for k in keys]
        found.criticals = _traced(found, cases, request.jobs, "critical forces", progress)
    found.critical = [_critical_row(key, path) for key, path in found.criticals.items()]
    _converge(found, lumped, progress)
    return found


def _refined(engine: VjmEngine, machine: Machine) -> VjmEngine:
    """The engine with its springs in beams too that have a smaller number of their own: elements split them all."""
    n = engine.segments
    if n is None:
        return engine
    chains = [leg.chain for leg in machine.legs] if isinstance(machine, Manipulator) else [machine]
    beams = [beam for chain in chains for beam in chain.beams if beam.section is not None]
    few = dict.fromkeys(beam.name for beam in beams if (beam.own_segments or n) < n)
    return replace(engine, parts=(*((name, n) for name in few), *engine.parts))


def extent(machine: Machine) -> float:
    """Size of a machine in mm: what an arm can reach, a platform's longest part."""
    return machine.characteristic_length if isinstance(machine, Manipulator) else TreeModel(machine).reach


def _size(request: Request, machine: Machine, labels: Sequence[str], lumped: VjmEngine, held: bool) -> float:
    if held:
        return request.reach or _round(REACH * machine.characteristic_length)
    if request.force is not None:
        return request.force
    softest = 0.0
    for label in labels:
        if isinstance(machine, Manipulator):
            K = lumped.problem(*in_pose(machine, LoadCase(label, 1.0))).unloaded().stiffness
            assert K is not None
            C = np.linalg.pinv(K, rcond=1e-12)
        else:
            model = lumped.tree_model(machine)
            C = _compliance(equilibria(model, model.posture(label)))[0]
        softest = max(softest, *(float(unit_of(d) @ C @ unit_of(d)) for d in request.directions))
    if not softest > 0.0:
        raise ValueError(f"{machine.name}: nothing deflects in the directions asked for")
    return _round(DEFLECTION * extent(machine) / softest)


def _round(value: float) -> float:
    """Down to 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** np.floor(np.log10(value))
    return float(max(m * decade for m in (1.0, 2.0, 5.0) if m * decade <= value))


def _compliance(at: Equilibria) -> Array:
    """``(e, 6, 6)`` of the first posture."""
    assert at.compliance is not None
    C: Array = at.compliance[0]
    return C


def _stiffness(request: Request, chain: Chain, labels: Sequence[str], lumped: VjmEngine) -> list[StiffnessRow]:
    if not held_by_itself(chain):
        return []
    model, rows = lumped.tree_model(chain), []
    for label in labels:
        for load in ("none", "weight") if request.gravity else ("none",):
            at = equilibria(model, model.posture(label), gravity=request.gravity if load == "weight" else None)
            for end, C in zip(model.ends, _compliance(at), strict=True):
                along = [_along(C, unit) for unit in np.eye(6)]
                rows.append(StiffnessRow(posture=label, end=end, load=load, along=along))
    return rows


def _case(request: Request, found: OwnMachine, posture: str, direction: str, size: float, control: str) -> LoadCase:
    unit = unit_of(direction)
    if found.held:
        axis = next((n for n in COMPONENTS if abs(unit[COMPONENTS.index(n)]) == 1.0), None)
        sign = 1.0 if axis is None else float(unit[COMPONENTS.index(axis)])
        return LoadCase(posture, sign * size, axis or tuple(unit), gravity=request.gravity)
    load = Load(tuple(unit))
    return LoadCase(posture, size, "load", loads=(load,), free=COMPONENTS, gravity=request.gravity, control=control)


def _traced(
    found: OwnMachine,
    cases: Sequence[tuple[tuple[str, str, Engine], LoadCase]],
    jobs: int,
    what: str,
    progress: Progress,
) -> dict[Key, Path]:
    """Paths by key; what has none becomes a note."""
    tasks = [Task(engine, found.machine, load_case) for (_, _, engine), load_case in cases]
    results = trace_all(tasks, min(jobs, len(tasks)), partial(progress, what))
    paths: dict[Key, Path] = {}
    for ((posture, direction, engine), _), result in zip(cases, results, strict=True):
        if isinstance(result, Failure):
            note = f"{engine.label} has no {what}: {result.message}"
            found.notes += [note] if note not in found.notes else []
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


def _tree_rows(
    request: Request, found: OwnMachine, tree: Chain, lumped: VjmEngine, labels: Sequence[str]
) -> list[LoadRow]:
    """What the first end of a tree does under the force, by the equilibria of trees."""
    model = lumped.tree_model(tree)
    rows = []
    for posture, direction in product(labels, request.directions):
        unit, wrench = unit_of(direction), np.zeros((len(model.ends), 6))
        before = equilibria(model, model.posture(posture), gravity=request.gravity, wrench=wrench)
        wrench[0] = found.size * unit
        at = equilibria(model, model.posture(posture), gravity=request.gravity, wrench=wrench)
        residual = largest_residual(at, gravity=request.gravity, wrench=wrench) if at.found[0] else float("nan")
        found.residuals[posture, direction] = residual
        if not (before.found[0] and at.found[0]):
            found.notes.append(f"posture {posture}, {direction}: no equilibrium under {found.size:g} N")
            continue
        K0, K1 = (_along(_compliance(each)[0], unit) for each in (before, at))
        rows.append(
            LoadRow(
                posture=posture, direction=direction, engine=lumped.label, K0=K0, K_end=K1, force=found.size,
                moved=(at.deflection - before.deflection)[0, 0].tolist(), difference=None, stopped="",
            )
        )  # fmt: skip
    return rows


def _along(C: Array, unit: Array) -> float | None:
    """Stiffness along or about a direction ``(6,)`` of a compliance ``(6, 6)``; None where nothing deflects."""
    compliance, kind = float(unit @ C @ unit), slice(0, 3) if unit[:3].any() else slice(3, 6)
    # what is left of a direction in which nothing moves is rounding
    return 1.0 / compliance if compliance > RIGID * float(np.diag(C)[kind].max()) else None


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


def _converge(found: OwnMachine, lumped: VjmEngine, progress: Progress) -> None:
    where = studied(found)
    beams = _beams(found.machine)
    if where is None or not beams:
        found.notes.append(
            "no study of convergence: no beam is split into springs" if not beams else "no load path"
        )
        return
    posture, direction, critical = where
    source = found.criticals if critical else found.paths
    case = source[posture, direction, lumped.label].load_case
    paths: dict[int, Path] = {}
    for done, n in enumerate(SPRINGS):
        progress("convergence", done, len(SPRINGS))
        engine = replace(lumped, segments=n, parts=tuple((name, n) for name in beams))
        try:
            paths[n] = trace_machine(engine, found.machine, case)
        except ValueError as error:
            found.notes.append(f"no study of convergence: {error}")
            return
    progress("convergence", len(SPRINGS), len(SPRINGS))
    values = {n: quantity(path, critical, found.held) for n, path in paths.items()}
    last = values[SPRINGS[-1]]
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


def _beams(machine: Machine) -> list[str]:
    """Beams that can be split, by name."""
    chains = [leg.chain for leg in machine.legs] if isinstance(machine, Manipulator) else [machine]
    return list(dict.fromkeys(beam.name for chain in chains for beam in chain.beams if beam.section is not None))
