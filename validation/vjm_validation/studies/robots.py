"""Whole robots, the virtual joint method against finite elements.

Compared are stiffness, critical forces, misfits and mobility.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from pydantic import BaseModel, ConfigDict

from vjm.batch import map_all
from vjm.continuation.arc_length import ArcControl, trace
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium, EventKind, Path
from vjm.engines import Engine, VjmEngine
from vjm.errors import NoConvergenceError
from vjm.io.machine_file import load_model
from vjm.machine import platforms
from vjm.machine.platforms import assembled
from vjm.machine.rigid_mechanism import LoopClosure
from vjm.model.load_case import COMPONENTS, TO_LIMIT, Load, LoadCase
from vjm.model.machine import Machine, legs_of
from vjm.rotations import Array
from vjm_fea.common.beam_problem import TINY, BeamProblem
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.opensees import OpenSeesEngine
from vjm_fea.opensees.beams import available
from vjm_output.documents import Row

NEARLY_NOTHING = 1e-6
"""mm: end of a path of which only the unloaded beginning is wanted."""


def platform_stiffness(engine: Engine, machine: Machine, pose: str, displacement: Array) -> Array:
    """Stiffness ``(6, 6)`` of a platform held at a displacement ``(6,)`` from a pose, N/mm, N, N mm.

    Raises:
        NoConvergenceError: the displacement is not reached, or not on a stable path.
    """
    still = not np.any(displacement)
    load_case = (
        LoadCase(pose, NEARLY_NOTHING, steps=1) if still else LoadCase(pose, 1.0, tuple(displacement), steps=4)
    )
    path = engine.trace(machine, load_case)
    if not path.complete:
        raise NoConvergenceError(path.stopped)
    K = path.points[0 if still else -1].stiffness
    assert K is not None
    return K


def deflecting_shares(problem: BeamProblem, critical: Equilibrium) -> dict[str, float]:
    """Which legs deflect at a critical point: each one's share of the mode, their squares adding up to one.

    What counts is how far a leg's beams bow out of their chords.

    Args:
        problem: of a machine of legs, see `vjm.model.machine.legs_of`.
        critical: a critical point of the problem.
    """
    mode = problem.exact(critical.state).critical_modes()[0]
    ahead, behind = (
        problem.statics.shape(problem.statics.moved_freely(critical.state, t * mode)) for t in (TINY, -TINY)
    )
    bows: dict[str, float] = {}
    for part in dict.fromkeys(station.part for station in problem.stations):
        rows = [i for i, station in enumerate(problem.stations) if station.part == part]
        leg, _, own = part.partition("/")
        if own:
            fractions = np.array([problem.stations[i].fraction for i in rows])
            bows[leg] = bows.get(leg, 0.0) + _bow(fractions, (ahead - behind)[rows])
    whole = sum(bows.values())
    return {leg: float(np.sqrt(bow / whole)) for leg, bow in bows.items()}


def _bow(fractions: Array, moved: Array) -> float:
    """Sum of the squares of what stations ``(k, 3)`` of a part move out of the chord between its ends."""
    first, last = np.argmin(fractions), np.argmax(fractions)
    if first == last:
        return 0.0
    along = (fractions - fractions[first]) / (fractions[last] - fractions[first])
    chord = moved[first] + np.outer(along, moved[last] - moved[first])
    return float(np.sum((moved - chord) ** 2))


ROBOT, REAL = "orthoglide", "orthoglide-parallelograms"
OTHERS = ("3-puu", "delta", "par2")
SPRINGS = VjmEngine(16, 16)
EXUDYN = ExudynEngine(elements=6)
"""Within 1e-4 of the beam where it does not buckle, and 7e-4 where it does."""
ENGINES = (VjmEngine(), VjmEngine(16), SPRINGS, ExudynEngine(elements=8))
"""That are asked for critical forces; the first has the paper's one spring a link."""
PAPER, COMPARED = ENGINES[0].label, tuple(engine.label for engine in ENGINES[1:])
CURVES = (ENGINES[0], ENGINES[2], EXUDYN)
SECOND_ENGINE = OpenSeesEngine(8)
"""A second finite element program, where it is installed."""
LOAD = 1000.0
"""N on the free platform."""
LARGEST = 12_000.0
"""N up to which it is pulled and pressed."""
REACH = 4.0
"""mm along x, the rest of the pose held."""
TOO_LONG = 0.2
"""mm."""
MISFIT_POSE = "Q1"
FELT = 1.0
"""N below which an isostatic robot counts as free of stress; the misfit times a leg's stiffness is some 700 N."""
THEORY = {
    # freedom of the platform, constraints too many, rank of K with the drives held. Three constraints for each
    # planar parallelogram too many, and one turn of three that each leg of the Orthoglide holds and one would do
    ROBOT: (3, 0, 6),
    REAL: (3, 12, 6),
    "3-puu": (3, 0, 6),
    # Grübler: six rods hold six freedoms; eight rods and a coupling hold six of the platform and two free arms
    "delta": (3, 0, 6),
    "par2": (2, 1, 6),
    # has no drive: what it is free in has no stiffness
    "parallelogram": (1, 3, 5),
}
NO_STIFFNESS = 1e-9
"""Singular value of K over its largest, turns over the characteristic length, that is none."""


class PlatformStiffnessRow(Row):
    """The platform's stiffness at one pose: eigenvalues, turns over the characteristic length, N/mm."""

    robot: str
    pose: str
    load: str
    """On the free platform: ``none``, or such as ``-x`` for 1 kN against x."""
    vjm: list[float]
    exudyn: list[float]
    difference: float
    """Largest, relative."""


class RobotCriticalRow(Row):
    """The force along x at which the free platform of the Orthoglide first loses its stability."""

    pose: str
    direction: str
    engine: str
    kind: EventKind | None
    F_cr: float | None
    """N, a magnitude; null where it is stable up to the largest force tried."""
    stopped: str
    """Why the path ends before; empty where it does not."""
    shares: dict[str, float]
    """Each leg's share of the mode, their squares adding up to one."""

    @property
    def first_leg(self) -> str | None:
        """The leg that loses stability, None where none does."""
        return max(self.shares, key=lambda leg: self.shares[leg]) if self.shares else None


class MisfitRow(Row):
    """What a part that is too long does."""

    robot: str
    what: str
    """The part, and the load on the platform."""
    quantity: str
    vjm: float
    exudyn: float
    scale: float
    """By which the difference is measured: the largest of its kind."""

    @property
    def difference(self) -> float:
        """Over the scale."""
        return abs(self.vjm - self.exudyn) / self.scale


class MobilityRow(Row):
    """Freedom of a platform and rank of its stiffness at one pose, found and by theory."""

    robot: str
    pose: str
    freedom: int
    overconstraint: int
    rank: int
    theory: tuple[int, int, int]
    """Freedom, constraints too many, rank."""

    @property
    def holds(self) -> bool:
        """Whether theory is met."""
        return (self.freedom, self.overconstraint, self.rank) == self.theory


class Robots(BaseModel):
    """The study as ``summary.json`` has it."""

    model_config = ConfigDict(frozen=True)

    stiffness: list[PlatformStiffnessRow]
    critical: list[RobotCriticalRow]
    misfit: list[MisfitRow]
    mobility: list[MobilityRow]


@dataclass(frozen=True)
class RobotStudy:
    """Rows and curves.

    Attributes:
        rows: what was compared.
        curves: by pose, sign along x and engine.
    """

    rows: Robots
    curves: Mapping[tuple[str, int, str], Path] = field(default_factory=dict)


Task = tuple[str, ...]


def tasks(robots: Sequence[str] = (ROBOT, *OTHERS)) -> list[Task]:
    """All pieces of the study, the longest first."""
    poses = list(load_model(ROBOT).poses)
    curves = [("curve", pose, sign) for pose, sign in product(poses, "+-")]
    critical: list[Task] = [("critical", pose, sign) for pose, sign in product(poses, "+-")]
    if available():
        critical += [("second", pose) for pose in poses]
    loaded = [("stiffness", ROBOT, pose, sign + axis) for pose, sign, axis in product(poses, "+-", "xyz")]
    plain = [("stiffness", name, pose, "none") for name in robots for pose in load_model(name).poses]
    misfits = [("misfit", ROBOT, "x", "link"), ("misfit", REAL, "bar-x1", "bar")]
    return [*curves, *critical, *misfits, *loaded, *plain, *(("mobility", name) for name in THEORY)]


def robot_study(jobs: int = 1, done: Callable[[int, int], None] | None = None) -> RobotStudy:
    """Compare the robots.

    Args:
        jobs: processes.
        done: called with how many pieces are done, and of how many.
    """
    rows: list[Row] = []
    curves: dict[tuple[str, int, str], Path] = {}
    asked = tasks()
    for task, results in zip(asked, map_all(piece, asked, jobs, done), strict=True):
        if task[0] == "curve":
            curves |= {
                (task[1], int(task[2] + "1"), path.engine): path for path in results if isinstance(path, Path)
            }
        else:
            rows += [row for row in results if isinstance(row, Row)]
    return RobotStudy(gathered(rows), curves)


def gathered(rows: Sequence[Row]) -> Robots:
    """Rows by their kind."""
    return Robots(
        stiffness=[row for row in rows if isinstance(row, PlatformStiffnessRow)],
        critical=[row for row in rows if isinstance(row, RobotCriticalRow)],
        misfit=[row for row in rows if isinstance(row, MisfitRow)],
        mobility=[row for row in rows if isinstance(row, MobilityRow)],
    )


def piece(task: Task) -> list[Row] | list[Path]:
    """One piece of the study, see `tasks`."""
    work: dict[str, Callable[..., list[Row] | list[Path]]] = {
        "curve": curve, "critical": critical, "second": second, "stiffness": stiffness, "misfit": misfit,
        "mobility": freedoms,
    }  # fmt: skip
    return work[task[0]](*task[1:])


def curve(pose: str, sign: str) -> list[Path]:
    """Force-displacement curves of the Orthoglide along x, the rest of the pose held."""
    machine = load_model(ROBOT)
    load_case = LoadCase(pose, float(sign + "1") * REACH, "x")
    return [engine.trace(machine, load_case) for engine in CURVES]


def under(pose: str, force: float, axis: str = "x", control: str = "ramp", steps: int | None = None) -> LoadCase:
    """A dead force on the free platform."""
    load = Load(tuple(np.eye(6)[COMPONENTS.index(axis)]))
    return LoadCase(pose, force, "load", loads=(load,), free=COMPONENTS, control=control, steps=steps)


def critical(pose: str, sign: str) -> list[Row]:
    """Critical forces of the Orthoglide along x, and which leg loses stability."""
    return [_critical(engine, pose, sign) for engine in ENGINES]


def second(pose: str) -> list[Row]:
    """The critical force against x by the second finite element program."""
    return [_critical(SECOND_ENGINE, pose, "-")]


def _critical(engine: VjmEngine | ExudynEngine | OpenSeesEngine, pose: str, sign: str) -> RobotCriticalRow:
    machine = load_model(ROBOT)
    load_case = under(pose, float(sign + "1") * LARGEST, control=TO_LIMIT)
    problem = engine.problem(machine, load_case)
    path = trace(problem, load_case, ArcControl(last=EventKind.BIFURCATION))
    event = next((e for e in path.events if e.kind in (EventKind.BIFURCATION, EventKind.LIMIT)), None)
    shares: dict[str, float] = {}
    if event is not None and event.point is not None:
        shares = _shares(problem, event.point)
    return RobotCriticalRow(
        pose=pose, direction=sign + "x", engine=engine.label, kind=event and event.kind,
        F_cr=event and event.force, stopped=path.stopped, shares=shares,
    )  # fmt: skip


def _shares(problem: LumpedProblem | BeamProblem, point: Equilibrium) -> dict[str, float]:
    """Each leg's share of a critical mode."""
    if isinstance(problem, LumpedProblem):
        return platforms.yielding_legs(problem, point)
    return deflecting_shares(problem, point)


def eigenvalues(K: Array | None, machine: Machine) -> Array:
    """Eigenvalues ``(6,)`` of the symmetric part, turns over the characteristic length, N/mm."""
    assert K is not None
    unit = np.repeat([1.0, machine.characteristic_length], 3)
    return np.asarray(np.linalg.eigvalsh(0.5 * (K + K.T) / unit[:, None] / unit))


def stiffness(name: str, pose: str, load: str) -> list[Row]:
    """The platform's stiffness, unloaded or under 1 kN on the free platform."""
    machine = load_model(name)
    displacement = np.zeros(6)
    if load == "none":
        K = SPRINGS.problem(machine, LoadCase(pose, 1.0)).unloaded().stiffness
    else:
        load_case = under(pose, float(load[0] + "1") * LOAD, load[1], steps=2)
        K = SPRINGS.trace(machine, load_case).points[-1].stiffness
        displacement = EXUDYN.trace(machine, load_case).points[-1].displacement
    ours = eigenvalues(K, machine)
    theirs = eigenvalues(platform_stiffness(EXUDYN, machine, pose, displacement), machine)
    return [
        PlatformStiffnessRow(
            robot=name, pose=pose, load=load, vjm=ours.tolist(), exudyn=theirs.tolist(),
            difference=float(np.max(np.abs(ours / theirs - 1.0))),
        )
    ]  # fmt: skip


def misfit(name: str, leg: str, part: str) -> list[Row]:
    """A part too long: where the platform goes, and what the beams bear, without a load and with one."""
    machine = assembled(load_model(name), {f"{leg}/{part}": TOO_LONG})
    bending = {beam.name for beam in machine.beams}
    # the last beam of each leg that has one
    last = [next((each for each in reversed(one.parts) if each in bending), "") for one in legs_of(machine)]
    beams = {one.name: beam for one, beam in zip(legs_of(machine), last, strict=True) if beam}
    elastic = np.array([bool(beam) for beam in last])
    rows: list[Row] = []
    for load in (0.0, -LOAD):
        load_case = under(MISFIT_POSE, load or LOAD, steps=2)
        problem, other = SPRINGS.problem(machine, load_case), EXUDYN.problem(machine, load_case)
        if load:
            ours, theirs = (trace(each, load_case).points[-1] for each in (problem, other))
        else:
            ours, theirs = problem.unloaded(), other.unloaded()
        what = f"{leg}, {part} {TOO_LONG:g} mm too long" + (f", {-load:g} N against x" if load else "")
        forces = np.linalg.norm(platforms.leg_wrenches(problem, ours)[elastic, :3], axis=1)
        borne = [np.linalg.norm(other.beam_force(beam, theirs)) for beam in beams.values()]
        d, fe, tilt = ours.displacement, theirs.displacement, TOO_LONG / machine.characteristic_length
        rows += _misfit_rows(name, what, [f"platform, {n}, mm" for n in "xyz"], d[:3], fe[:3], TOO_LONG)
        rows += _misfit_rows(name, what, [f"platform, r{n}, rad" for n in "xyz"], d[3:], fe[3:], tilt)
        rows += _misfit_rows(name, what, [f"force in {n}, N" for n in beams], forces, np.array(borne), FELT)
    return rows


def _misfit_rows(
    name: str, what: str, quantities: Sequence[str], ours: Array, theirs: Array, least: float
) -> list[Row]:
    """Rows of one kind, compared over the largest of them, or over what would count as something."""
    scale = max(float(np.abs(theirs).max()), least)
    return [
        MisfitRow(robot=name, what=what, quantity=quantity, vjm=float(a), exudyn=float(b), scale=scale)
        for quantity, a, b in zip(quantities, ours, theirs, strict=True)
    ]


def freedoms(name: str) -> list[Row]:
    """Freedom, constraints too many and rank of the stiffness at every pose."""
    machine = load_model(name)
    unit = np.repeat([1.0, machine.characteristic_length], 3)
    rows: list[Row] = []
    for pose in machine.poses:
        closing = LoopClosure(machine, pose)
        mobility = closing.mobility(closing.home)
        K = VjmEngine().problem(machine, LoadCase(pose, 1.0)).unloaded().stiffness
        assert K is not None
        values = np.linalg.svd(K / unit[:, None] / unit, compute_uv=False)
        rank = int(np.count_nonzero(values > NO_STIFFNESS * values[0]))
        rows.append(
            MobilityRow(
                robot=name, pose=pose, freedom=mobility.freedom, overconstraint=mobility.redundant, rank=rank,
                theory=THEORY[name],
            )
        )  # fmt: skip
    return rows
