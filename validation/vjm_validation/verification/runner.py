"""Running cases over processes, kept as they finish.

A runner makes the machine and load case of a case on one mesh, the engines by family, and their answers on every
mesh.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import assert_never

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from vjm.baselines import LinearEngine, MsaEngine
from vjm.batch import map_all
from vjm.continuation.path import Equilibrium, Event, EventKind, Path, driven_force
from vjm.engines import Engine, VjmEngine
from vjm.errors import NoConvergenceError
from vjm.io.path_files import from_plain
from vjm.io.provenance import Provenance
from vjm.io.schema import rotation
from vjm.model.load_case import COMPONENTS, LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, Part, RigidOffset, Section
from vjm.rotations import AXES, Array, frame, translation, turn
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.opensees import OpenSeesEngine
from vjm_fea.opensees.beams import MISSING, available
from vjm_output.documents import Row
from vjm_validation.verification.library import ArcTable, Asked, Case, Family, RodTable, RunTable

MESHED: tuple[Family, ...] = ("vjm", "exudyn", "opensees")
"""Families that are refined, in the order of the tables."""
TITLES = {
    "vjm": "lumped, beam-column springs",
    "exudyn": "geometrically exact beams",
    "opensees": "corotational beams",
    "vjm-linear": "linear, eq. (5)",
    "msa": "matrix structural analysis",
}
"""What each family is."""


def engine(family: Family, mesh: int, *, shear: bool = False, foot: bool | None = None) -> Engine:
    """An engine of a family.

    Args:
        family: its name.
        mesh: springs or elements of every beam; of no meaning for the linear ones.
        shear: whether elements keep their shear flexibility. Springs always do.
        foot: whether the part named foot is split as well, or is one spring of its 6×6 compliance; None where there
            is none.

    Raises:
        ValueError: the family has no such element.
        ImportError: it is not installed.
    """
    match family:
        case "vjm":
            return VjmEngine(mesh, mesh if foot else None)
        case "exudyn":
            return ExudynEngine(elements=mesh, shear=shear, foot_spring=foot is False)
        case "opensees":
            if not available():
                raise ImportError(MISSING)
            if foot is False:
                raise ValueError("it has no 6×6 spring")
            if shear:
                raise ValueError("its corotational beams are rigid in shear")
            return OpenSeesEngine(elements=mesh)
        case "vjm-linear":
            return LinearEngine()
        case "msa":
            return MsaEngine()
        case _:
            assert_never(family)


ARC = "arc"
"""Name of the whole arc as a place for loads and points."""
POSTURE = "straight"
"""Label of a case's only posture."""


def chain_of(case: Case, mesh: int) -> Machine:
    """The chain of a case; an arc or a rod has ``mesh`` sides, any other chain is the same on every mesh."""
    file = case.file
    if file.arc is not None:
        return arc_chain(file.name, file.arc, mesh, case.files)
    if file.rod is not None:
        return rod_chain(file.name, file.rod, mesh, case.files)
    assert file.chain is not None
    table = file.chain
    parts = tuple(part.part() for part in table.parts)
    return Machine(
        file.name,
        parts,
        base=frame(rotation(table.turns)),
        postures={POSTURE: np.array(table.posture, dtype=float)},
        held={POSTURE: {part.name: 0.0 for part in parts if isinstance(part, Joint) and part.held}},
        title=file.title,
        files=case.files,
    )


def arc_chain(name: str, arc: ArcTable, sides: int, files: Mapping[str, str] | None = None) -> Machine:
    """An arc as straight sides, each along the chord of its piece but through the piece's own centroid.

    Rigid arms join the sides to the corners, which are points of the arc, and a section is softened so that a side
    deflects like the length of arc that it stands for. Then the zeroth and the first moment of a piece's length
    are exact and the second is to the leading order. In a plane a side is as flexible as its piece but for terms of
    the fourth order in the angle that it subtends. A chord in the arc's place would err with the second.
    """
    angle = np.deg2rad(arc.angle_deg) / sides
    chord = 2.0 * arc.radius_mm * np.sin(0.5 * angle)
    section = _softened(arc.section.stiffness(), chord / (arc.radius_mm * angle))
    bulge = arc.radius_mm * (np.sin(0.5 * angle) / (0.5 * angle) - np.cos(0.5 * angle))
    out, back = translation([0.0, bulge, 0.0]), translation([0.0, -bulge, 0.0])
    # a chord leaves the tangent by half of the angle that it subtends
    half = turn(AXES["z"], -0.5 * angle)
    parts: list[Part] = [RigidOffset(corner_name(0), half @ out)]
    for i in range(1, sides + 1):
        parts.append(Beam(f"side-{i}", chord, section=section))
        parts.append(RigidOffset(f"arm-{i}", back))
        parts.append(RigidOffset(corner_name(i), half if i == sides else half @ half @ out))
    if arc.hinged_end:
        parts.append(Joint("hinge", AXES["z"], passive=True))
    base = turn(AXES["z"], np.deg2rad(arc.start_deg))
    posture = np.zeros(1 if arc.hinged_end else 0)
    return Machine(name, tuple(parts), base=base, postures={POSTURE: posture}, files=files or {})


def rod_chain(name: str, rod: RodTable, sides: int, files: Mapping[str, str] | None = None) -> Machine:
    """A rod of constant curvature as straight beams, each along the tangent at the middle of its piece.

    Rigid arms join the beams' ends to the rod's own points, so that the unloaded shape is exact on any mesh. A beam
    of the piece's length stands for the piece with an error of the second order in the angle that it turns by.
    """
    length = rod.length_mm / sides
    half = _along(np.array(rod.curvature_per_mm), 0.5 * length)
    back = translation([-0.5 * length, 0.0, 0.0])
    parts: list[Part] = [RigidOffset(corner_name(0), half @ back)]
    for i in range(1, sides + 1):
        parts.append(Beam(f"side-{i}", length, section=rod.section.stiffness()))
        parts.append(RigidOffset(corner_name(i), back @ half if i == sides else back @ half @ half @ back))
    base = frame(rotation(rod.turns))
    return Machine(name, tuple(parts), base=base, postures={POSTURE: np.zeros(0)}, files=files or {})


def _along(curvature: Array, length: float) -> Array:
    """Frame ``(4, 4)`` of a curve's section after a length of it, from its own frame before."""
    twist = np.zeros((4, 4))
    twist[:3, :3] = np.cross(curvature, np.eye(3)).T
    twist[0, 3] = 1.0
    return expm(twist * length)


def _softened(section: Section, factor: float) -> Section:
    stiffness = {name: factor * getattr(section, name) for name in ("EA", "GJ", "EIy", "EIz", "GAy", "GAz")}
    return replace(section, **stiffness)


def corner_name(number: int) -> str:
    """Name of the rigid piece that begins at one corner of an arc; the root's is 0."""
    return f"corner-{number}"


def place(part: str, fraction: float, sides: int) -> tuple[str, float]:
    """Part and fraction of a point; one of the arc becomes the root of the rigid piece at one of its corners.

    Raises:
        ValueError: the point is no corner of the polygon.
    """
    if part != ARC:
        return part, fraction
    side = fraction * sides
    if abs(side - round(side)) > 1e-9:
        raise ValueError(f"{fraction} of the arc is no corner of a polygon of {sides} sides")
    return corner_name(round(side)), 0.0


def load_case_of(run: RunTable, mesh: int) -> LoadCase:
    """The load case of a run.

    Raises:
        ValueError: it makes no sense.
    """
    data = run.load_case.model_dump(exclude_none=True)
    places = [*data["loads"], *([data["control"]] if isinstance(data["control"], dict) else [])]
    for table in places:
        table["part"], table["at"] = place(table["part"], table["at"], mesh)
    return from_plain({"posture": POSTURE, **data})


def unloaded_position(chain: Machine) -> Array:
    """Position ``(3,)`` of the end-effector without load, mm, world."""
    model = Mechanism(chain)
    return model.kinematics(model.configuration(chain.posture(POSTURE))).end[:3, 3]


# --- What is read off a path: the measured value of a quantity ----------------------------------------------------

SAME_RAMP = 1e-9
"""Relative difference of two ramps that are one."""
EVENT_KINDS = {
    "critical force": (EventKind.BIFURCATION, 0),
    "limit force": (EventKind.LIMIT, 0),
    "second limit force": (EventKind.LIMIT, 1),
    "fold force": (EventKind.FOLD, 0),
    "second fold force": (EventKind.FOLD, 1),
}
"""Kind of an event, and which of its kind on the path."""


def measured(asked: Asked, engine: Engine, chain: Machine, load_case: LoadCase, path: Path, mesh: int) -> float:
    """The value of a quantity on a path, in the quantity's unit.

    Args:
        asked: the quantity.
        engine: that traced the path.
        chain: the machine.
        load_case: of the path.
        path: what was traced.
        mesh: for points of an arc.

    Raises:
        NoConvergenceError: the path ends before it gets there, or has no such event.
        ValueError: there is no such point.
    """
    value = _raw(asked, engine, chain, load_case, path, mesh) / asked.over
    return abs(value) if asked.absolute else value


def _raw(asked: Asked, engine: Engine, chain: Machine, load_case: LoadCase, path: Path, mesh: int) -> float:
    if asked.measure in EVENT_KINDS:
        return _event(path, *EVENT_KINDS[asked.measure]).force
    if asked.measure in ("stiffness", "compliance"):
        K = _unloaded_stiffness(engine, chain, load_case, path)
        matrix = K if asked.measure == "stiffness" else np.linalg.inv(K)
        return float(matrix[_index(asked.component), _index(asked.by)])
    if asked.measure == "turning load":
        return _turning_load(path, _index(asked.component), *place(asked.part, asked.at, mesh))
    point = _at(path, asked.ramp)
    if asked.measure == "force":
        return driven_force(load_case, point)
    axis = _index(asked.component)
    if asked.measure == "point":
        return _moved(path, point, *place(asked.part, asked.at, mesh))[axis]
    moved = float(point.displacement[axis])
    return moved + float(unloaded_position(chain)[axis]) if asked.measure == "position" else moved


def _index(component: str | None) -> int:
    assert component is not None
    return COMPONENTS.index(component)


def _event(path: Path, kind: EventKind, which: int) -> Event:
    events = [event for event in path.events if event.kind is kind]
    if len(events) <= which:
        raise NoConvergenceError(f"{len(events) or 'no'} {kind} on the path{_ending(path)}")
    return events[which]


def _at(path: Path, ramp: float | None) -> Equilibrium:
    if ramp is None:
        if not path.complete:
            raise NoConvergenceError(path.stopped)
        return path.points[-1]
    nearest = min(path.points, key=lambda point: abs(point.s - ramp))
    if abs(nearest.s - ramp) > SAME_RAMP * max(abs(ramp), 1.0):
        raise NoConvergenceError(f"the path has no point at {ramp:g}{_ending(path)}")
    return nearest


def _ending(path: Path) -> str:
    return f": it ends at {path.points[-1].s:.6g}, {path.stopped}" if path.stopped else ""


def _turning_load(path: Path, axis: int, part: str, fraction: float) -> float:
    """Load where a point first turns back, by splines through the points of the path's arc."""
    s = [point.s for point in path.points]
    moved = CubicSpline(s, [_moved(path, point, part, fraction)[axis] for point in path.points])
    turns = moved.derivative().roots(extrapolate=False)
    if not len(turns):
        raise NoConvergenceError(f"no turning point of the displacement on the path{_ending(path)}")
    return float(CubicSpline(s, path.ramp)(turns[0]))


def _moved(path: Path, point: Equilibrium, part: str, fraction: float) -> list[float]:
    for row, station in enumerate(path.stations):
        if station.part == part and abs(station.fraction - fraction) < 1e-9:
            moved: list[float] = (point.shape[row] - path.points[0].shape[row]).tolist()
            return moved
    raise ValueError(f"no station at {fraction} of part '{part}'")


def _unloaded_stiffness(engine: Engine, chain: Machine, load_case: LoadCase, path: Path) -> Array:
    start = path.points[0]
    if start.stiffness is not None:
        return start.stiffness
    raise ValueError(f"{engine.label} computes no 6×6 stiffness")


# ------------------------------------------------------------------------------------------------------------------


SQUARE = ("exudyn", "opensees")
"""Engines of dense tangents, whose time grows with the squares of the meshes: the longest items are begun first."""


class Answers(Row):
    """What one family answered to one case, as it is kept in the run's folder."""

    case: str
    family: Family
    values: list[list[float | None]]
    """By question, by mesh; null where the engine did not get there."""
    failures: list[str]
    """By question: why its finest value is missing, empty where it is not."""
    refused: str = ""
    """Why the family cannot answer at all."""
    seconds: float = 0.0
    """Of processor time."""


class AnswerStore:
    """Finished answers in a run's folder, which an interrupted run uses again; without a folder nothing is kept."""

    def __init__(self, folder: FilePath | None) -> None:
        self._folder = folder / "verification" if folder is not None else None

    def find(self, case: str, files: Mapping[str, str], family: Family) -> Answers | None:
        """The answers to the same files by the same program, if they are there."""
        if self._folder is None:
            return None
        kept = self._made_of(case, files, family).kept(self._file(self._folder, case, family))
        answers = None if kept is None else Answers.model_validate(kept)
        # what was refused may have been installed or learned since
        return answers if answers is not None and not answers.refused else None

    def keep(self, answers: Answers, files: Mapping[str, str]) -> None:
        """Write what one family answered."""
        if self._folder is not None:
            made_of = self._made_of(answers.case, files, answers.family)
            made_of.keep(self._file(self._folder, answers.case, answers.family), answers.model_dump())

    @staticmethod
    def _made_of(case: str, files: Mapping[str, str], family: Family) -> Provenance:
        return Provenance.of(files, case=case, family=family)

    @staticmethod
    def _file(folder: FilePath, case: str, family: str) -> FilePath:
        return folder / f"{case}_{family}.json"


def run_cases(
    cases: Sequence[Case],
    families: Sequence[str] | None = None,
    jobs: int = 1,
    folder: FilePath | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Answers]:
    """The answers of every family that a case names.

    Args:
        cases: what is asked.
        families: only these; None for all that the cases name.
        jobs: processes.
        folder: of the run, to keep answers in and to find those of an interrupted one.
        progress: called with how many items are done, and of how many.
    """
    store = AnswerStore(folder)
    wanted: list[tuple[Case, Family]] = [
        (case, family) for case in cases for family in case.file.engines if families is None or family in families
    ]
    all_answers = {(case.name, family): store.find(case.name, case.files, family) for case, family in wanted}
    files = {case.name: case.files for case in cases}
    missing = [item for item in wanted if all_answers[item[0].name, item[1]] is None]
    missing.sort(key=lambda item: -_cost(*item))
    ready = len(wanted) - len(missing)

    def done(_: int, answers: Answers) -> None:
        store.keep(answers, files[answers.case])
        all_answers[answers.case, answers.family] = answers

    def count(finished: int, _: int) -> None:
        if progress is not None:
            progress(ready + finished, len(wanted))

    map_all(_answered, missing, jobs, count, done)
    return [answers for case, family in wanted if (answers := all_answers[case.name, family]) is not None]


def _cost(case: Case, family: Family) -> int:
    table = case.file.engines[family]
    return len(case.file.runs) * sum(mesh**2 if family in SQUARE else mesh for mesh in table.meshes)


def _answered(item: tuple[Case, Family]) -> Answers:
    return answered(*item)


def answered(case: Case, family: Family, meshes: Sequence[int] | None = None) -> Answers:
    """What one family answers to a case.

    Args:
        case: what is asked.
        family: of engines; the case must name it.
        meshes: only these; None for all that the case names.
    """
    table = case.file.engines[family]
    return new_answers(
        case.name,
        family,
        meshes or table.meshes or [1],
        len(case.questions),
        lambda mesh: _on_mesh(case, family, mesh),
    )


def new_answers(
    name: str,
    family: Family,
    meshes: Sequence[int],
    count: int,
    on_mesh: Callable[[int], Sequence[tuple[float | None, str]]],
) -> Answers:
    """Ask on every mesh.

    Args:
        name: of the case.
        family: who is asked.
        meshes: from coarse to fine.
        count: of questions.
        on_mesh: gives for every question a value, or none and why. What it raises as `ValueError` or `ImportError`
            is a refusal of the whole case.
    """
    started = time.process_time()
    values: list[list[float | None]] = [[] for _ in range(count)]
    failures = [""] * count
    refused = ""
    try:
        for mesh in meshes:
            for i, (value, failure) in enumerate(on_mesh(mesh)):
                values[i].append(value)
                failures[i] = failure
    except (ValueError, ImportError) as error:
        refused = " ".join(str(error).split())
    return Answers(
        case=name,
        family=family,
        values=values,
        failures=failures,
        refused=refused,
        seconds=time.process_time() - started,
    )


def _on_mesh(case: Case, family: Family, mesh: int) -> list[tuple[float | None, str]]:
    """Value of every question, or why there is none.

    Raises:
        ValueError: the engine cannot express the case.
        ImportError: it is not installed.
    """
    table = case.file.engines[family]
    elements = 1 if case.file.sided else mesh
    solver = engine(family, elements, shear=table.shear, foot=False if table.foot_spring else None)
    chain = chain_of(case, mesh)
    results: list[tuple[float | None, str]] = []
    for run in case.file.runs:
        load_case = load_case_of(run, mesh)
        try:
            path = solver.trace(chain, load_case)
        except NoConvergenceError as failure:
            results += [(None, str(failure))] * len(run.asked)
            continue
        for asked in run.asked:
            try:
                results.append((measured(asked, solver, chain, load_case, path, mesh), ""))
            except NoConvergenceError as failure:
                results.append((None, str(failure)))
    return results
