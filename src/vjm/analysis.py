"""What is asked of a machine, in one call each: a path, a loaded stiffness, critical points.

A loaded equilibrium has its stiffness, also that of an end-effector that nothing holds, and whether cables hold it
whatever acts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg
from scipy.optimize import nnls

from vjm.continuation.path import Path, travel
from vjm.design.linear_state import equilibrium_of, loaded_posture
from vjm.engines import Engine, EngineOptions, VjmEngine, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.limits import LINEAR
from vjm.machine.equilibria import Equilibria, largest_residual
from vjm.model.end_condition import RigidDirectionError
from vjm.model.law_states import law_states
from vjm.model.load_case import COMPONENTS, TO_LIMIT, Direction, Load, LoadCase, ramp_end
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity, Mechanism
from vjm.outcome import (
    DISPLACEMENT_COLUMNS,
    WRENCH_ROWS,
    Outcome,
    axes_or_new,
    frame_of,
    rounded,
    table_html,
)
from vjm.plain_numbers import finite_numbers
from vjm.postures import Posture, check_machine, in_posture
from vjm.rank import NEGLIGIBLE, beyond, null_space, rank_of
from vjm.rotations import Array, displacement_between, frame
from vjm.statics import free_stability, loaded_stiffness, solve_under_wrench, unloaded_stiffness
from vjm.threads import single_threaded

if TYPE_CHECKING:
    from vjm.outcome import Axes, DataFrame


def force_closed(pulls: Array) -> bool:
    """Whether pulls of cables carry every wrench: they span all, and some of them, all positive, balance.

    Args:
        pulls: ``(k, m)`` what a unit of each of m cables' pull does to each of k free motions.

    Example:
        >>> force_closed(np.array([[1.0, -1.0]])), force_closed(np.array([[1.0, 2.0]]))
        (True, False)
    """
    k, m = pulls.shape
    if m <= k or rank_of(pulls).rank < k:
        return False
    # t = 1 + u with u >= 0 in place of t > 0, which may be scaled at will
    size = np.linalg.norm(pulls, axis=0)
    scaled = pulls / np.where(size > 0.0, size, 1.0)
    _, left = nnls(scaled, -scaled.sum(axis=1))
    return bool(left < NEGLIGIBLE * m)


def cable_words(model: Mechanism, x: Array) -> tuple[str, ...]:
    """What is said of a machine's cables at a state, in one line; nothing where it has none.

    Args:
        model: of the machine.
        x: components ``(size,)`` of the state.
    """
    cables = [k for k, spring in enumerate(model.chain.point_springs) if spring.cable]
    if not cables:
        return ()
    states = {state.name: state for state in law_states(model, x) if state.what == "cable"}
    taut = [k for k in cables if states[model.chain.point_springs[k].name].place]
    kinematics = model.kinematics(x)
    motions = null_space(model.closing_rows(kinematics)[:, model.passive])
    pulls = -(model.stretching_rows(kinematics)[taut][:, model.passive] @ motions).T
    held = "force-closed: with more pull in all they carry every load"
    if not force_closed(pulls):
        held = "not force-closed: under other loads the platform moves until others become taut"
    return (f"{len(taut)} of {len(cables)} cables are taut, and {held}",)


DISPLACEMENT, WRENCH = "displacement", "wrench"
"""What is imposed on the end-effector."""
MISSED = 1e-5
"""Share of the acting forces that an equilibrium may lack: results are told to five digits."""


@dataclass(frozen=True, repr=False)
class LoadedStiffness(Outcome):
    """A stable loaded equilibrium with its stiffness, world axes.

    Attributes:
        model: name.
        model_sha256: hash of its file.
        engine: label.
        posture: label.
        control: what is imposed: ``displacement`` or ``wrench``.
        displacement: ``(6,)`` of the end-effector: translation and rotation vector, mm and rad.
        wrench: ``(6,)`` on the end-effector, N and N mm.
        loaded: ``(6, 6)`` K^F of eq. (18), N/mm, N, N mm.
        unloaded: ``(6, 6)`` K of eq. (5); nan where it has none, as its springs' laws have no slope there.
        eigenvalue: smallest of the second variation, in units of the engine's energy scale; nan if not computed.
        iterations: of the solver; None if not counted.
        residual: largest scaled component of the equilibrium equations.
        events: critical points that were passed on the way, in words.
        eigenvalue_relative: the same eigenvalue over that of the unloaded machine, as a path has it: 1 unloaded, 0
            at a critical point; nan if not computed.
        end: name of the end frame; empty where the machine names none.
        gravity: ``(3,)`` m/s², where the parts have their weight.
        loaded_compliance: ``(6, 6)`` inverse of K^F, mm/N, 1/N, rad/(N mm), of a machine that carries its free end;
            where a wrench moves nothing, K^F is infinite and this is not.
        unloaded_compliance: ``(6, 6)`` inverse of K, likewise.
        rigid: ``(k, 6)`` unit wrenches that move nothing where the machine stands under its loads.
        torques: what holds each joint of such a machine, N mm or N, by its name.
        pulls: of the springs between points, N, by their names; what pushes is negative.
        laws: where each law of a spring is, in words; K^F has its tangent there.
        stable: None where the engine does not examine it; an unstable equilibrium is refused.

    Example:
        >>> import vjm
        >>> loaded = vjm.stiffness(vjm.load("planar-2r"), "stretched", wrench=(0, -50, 0, 0, 0, 0))
        >>> f"{loaded.displacement[1]:.2f} mm"
        '-28.80 mm'
    """

    model: str
    model_sha256: str
    engine: str
    posture: str
    control: str
    displacement: Array
    wrench: Array
    loaded: Array
    unloaded: Array
    eigenvalue: float
    iterations: int | None
    residual: float
    events: tuple[str, ...] = ()
    eigenvalue_relative: float = float("nan")
    end: str = ""
    gravity: Gravity | None = None
    loaded_compliance: Array | None = None
    unloaded_compliance: Array | None = None
    rigid: Array | None = None
    torques: Mapping[str, float] | None = None
    pulls: Mapping[str, float] = field(default_factory=dict)
    laws: tuple[str, ...] = ()
    stable: bool | None = True

    def __post_init__(self) -> None:
        """Refuse what is no equilibrium.

        Raises:
            NoConvergenceError: forces are left over.
        """
        if not self.residual <= MISSED:
            raise NoConvergenceError(
                f"{self.model}, posture {self.posture}: not converged: {self.residual:.1e} of the acting forces is "
                "left over. It is no equilibrium"
            )

    def __repr__(self) -> str:
        diagonal, wrench = rounded(np.diag(self.loaded)), rounded(self.wrench)
        return (
            f"<LoadedStiffness {self.model}, posture {self.posture}, {self.engine}, imposed {self.control}\n"
            f" wrench {wrench} N, N mm\n"
            f" diagonal of K^F {diagonal} N/mm, N mm/rad>"
        )

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>{table_html(self.table())}"

    def table(self) -> list[dict[str, Any]]:
        """The loaded matrix, a row for each component of the wrench."""
        return [
            {"": name, **dict(zip(DISPLACEMENT_COLUMNS, line, strict=True))}
            for name, line in zip(WRENCH_ROWS, self.loaded.tolist(), strict=True)
        ]

    def to_frame(self) -> DataFrame:
        """The loaded matrix as a pandas DataFrame, rows wrench components, columns displacements.

        Raises:
            ImportError: pandas is not installed.
        """
        return frame_of(self.loaded, WRENCH_ROWS, DISPLACEMENT_COLUMNS)

    def plot(self, ax: Axes | None = None) -> Axes:
        """The diagonals of K and K^F side by side, as ratios.

        Raises:
            ImportError: matplotlib is not installed.
        """
        ax = axes_or_new(ax)
        before = np.diag(self.unloaded)
        ratio = np.divide(np.diag(self.loaded), before, out=np.full(6, np.nan), where=np.abs(before) > 0.0)
        ax.bar(COMPONENTS, ratio)
        ax.axhline(1.0, color="k", linewidth=0.7)
        ax.set_ylabel("loaded over unloaded stiffness")
        return ax


@single_threaded
def under_wrench(chain: Machine, engine: VjmEngine, posture: str, wrench: tuple[float, ...]) -> LoadedStiffness:
    """The stable equilibrium of the free end-effector under a dead wrench ``(6,)`` N, N mm."""
    chain = chain.at(posture)
    model = engine.model(chain)
    x = model.configuration(chain.posture(posture))
    state = solve_under_wrench(model, np.array(wrench, dtype=float), x)
    rest = solve_under_wrench(model, np.zeros(6), x)
    moved = displacement_between(model.kinematics(x).end, state.kinematics.end)
    verdict = free_stability(state)
    if verdict.unstable:
        raise NoConvergenceError(
            f"under this wrench the free end-effector has an equilibrium, but it is unstable in "
            f"{verdict.unstable} motions; hold the pose instead, `validate stiffness --displacement`"
        )
    return LoadedStiffness(
        model=chain.name,
        model_sha256=chain.sha256,
        engine=engine.label,
        posture=posture,
        control=WRENCH,
        displacement=moved,
        wrench=state.wrench,
        loaded=loaded_stiffness(state),
        unloaded=unloaded_stiffness(model, chain.posture(posture)),
        eigenvalue=verdict.eigenvalue,
        iterations=state.iterations,
        residual=state.residual,
        laws=tuple(map(str, law_states(model, state.x))),
        eigenvalue_relative=verdict.eigenvalue / free_stability(rest).eigenvalue,
    )


def held_by_itself(chain: Machine, posture: str = "") -> bool:
    """Whether a machine carries a wrench on its free end: with its drives held, no passive joint lets that move.

    Args:
        chain: the machine; springs between points hold too.
        posture: label; the first where it is empty.
    """
    if not chain.joints:
        return True
    if not chain.is_tree:
        return False
    # imported when it is asked for: closing loops takes linear algebra that no chain needs
    from vjm.machine.rigid_mechanism import LoopClosure

    closing = LoopClosure(chain, posture or next(iter(chain.postures)))
    return closing.mobility(closing.home).loose.shape[1] == 0


@single_threaded
def of_free_end(
    chain: Machine,
    engine: VjmEngine,
    posture: str,
    wrench: Sequence[float],
    *,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
) -> LoadedStiffness:
    """The equilibrium of a machine whose end frame is free, under a dead wrench, weight and loads on its parts.

    Args:
        chain: arm or tree; springs between points and couplings of loaded joints are welcome.
        engine: that splits its beams.
        posture: label.
        wrench: ``(6,)`` N, N mm on the end frame.
        gravity: m/s².
        loads: on parts, in full.
        end: name of the end frame; the first where it is empty.

    Raises:
        NoConvergenceError: there is no equilibrium near, or it is unstable.
        ValueError: no such end frame, posture or part.
    """
    asked = loaded_posture(chain, posture, wrench=wrench, gravity=gravity, loads=loads, end=end, engine=engine)
    model = engine.model(chain.at(posture))
    index = model.ends.index(asked.end)
    equilibrium = equilibrium_of(asked, model, compliance=True)
    if not equilibrium.stable[0]:
        raise NoConvergenceError(f"{chain.name}, posture {posture}: the equilibrium under these loads is unstable")
    passive = {joint.name for joint in chain.joints}
    x = model.configuration(chain.posture(posture))
    rigid0 = _rigid_at(model, x, asked.end)
    x[: model.coordinates] += equilibrium.x[0]
    rigid = _rigid_at(model, x, asked.end)
    laws = (*map(str, law_states(model, x)), *cable_words(model, x))
    K, C = _of_end(equilibrium, index, rigid)
    try:
        K0, C0 = _of_end(equilibrium_of(asked.unloaded, model, compliance=True), index, rigid0)
    except NoConvergenceError as error:
        held = held_by_itself(chain, posture)
        if held and not laws:
            raise
        K0, C0 = np.full((6, 6), np.nan), np.full((6, 6), np.nan)
        laws += (f"there is no unloaded stiffness: {error if held else 'the loads alone hold the machine'}",)
    pulls = dict(zip((spring.name for spring in chain.point_springs), model.pulls(x).tolist(), strict=True))
    return LoadedStiffness(
        model=chain.name,
        model_sha256=chain.sha256,
        engine=engine.label,
        posture=posture,
        control=WRENCH,
        displacement=_moved(equilibrium, posture, index),
        wrench=np.array(wrench, dtype=float),
        loaded=K,
        unloaded=K0,
        eigenvalue=float("nan"),
        iterations=None,
        residual=largest_residual(equilibrium, gravity=gravity, loads=asked.acting),
        end=asked.end,
        gravity=gravity,
        loaded_compliance=C,
        unloaded_compliance=C0,
        rigid=rigid,
        torques={
            name: torque
            for name, torque in zip(model.joints, equilibrium.torques[0].tolist(), strict=True)
            if name not in passive
        },
        pulls=pulls,
        laws=laws,
    )


def _moved(equilibrium: Equilibria, posture: str, index: int) -> Array:
    """Displacement ``(6,)`` of an end frame: of the end-effector from where it is as designed."""
    chain = equilibrium.model.chain
    designed = chain.nominal_ends.get(posture)
    last = chain.parts[-1].name
    if designed is None or chain.ends.get(equilibrium.model.ends[index], last) != last:
        return equilibrium.deflection[0, index]
    return displacement_between(designed, frame(equilibrium.rotation[0, index], equilibrium.position[0, index]))


def _of_end(equilibrium: Equilibria, end: int, rigid: Array) -> tuple[Array, Array]:
    """Stiffness and compliance ``(6, 6)`` of an end frame, of which ``rigid`` (k, 6) wrenches move nothing."""
    assert equilibrium.stiffness is not None
    assert equilibrium.compliance is not None
    K, C = equilibrium.stiffness[0, end], equilibrium.compliance[0, end]
    # what rounding leaves of a compliance that is none has an inverse, which means nothing
    return (np.full((6, 6), np.inf) if len(rigid) else K), C


def _rigid_at(model: Mechanism, x: Array, end: str) -> Array:
    """Wrenches ``(k, 6)`` that move nothing at coordinates ``(size,)``."""
    k = model.kinematics(x)
    end_kinematics = model.at_point(k, *model.find(end, 1.0))
    return rigid_wrenches(
        beyond(model.pose_rows(end_kinematics), model.closing_rows(k)), model.characteristic_length
    )


def rigid_wrenches(motions: Array, length: float) -> Array:
    """Wrenches ``(k, 6)`` that move nothing: those that do no work on any motion of the end.

    Each has one component that the others lack (reduced echelon form), and largest component 1: of a planar
    mechanism, the force across its plane and the moments in it stand alone.

    Args:
        motions: ``(6, m)`` of the end by what deflects, shifts over the length.
        length: mm, by which moments become forces.
    """
    basis = null_space(motions.T).T
    *_, order = scipy.linalg.qr(basis, pivoting=True)
    own = order[: len(basis)]
    wrenches: Array = np.linalg.solve(basis[:, own], basis) * np.repeat([1.0, length], 3)
    wrenches[np.abs(wrenches) < NEGLIGIBLE * np.abs(wrenches).max(axis=1, keepdims=True)] = 0.0
    largest = np.abs(wrenches).argmax(axis=1, keepdims=True)
    # no negative zeros
    return (wrenches / np.take_along_axis(wrenches, largest, axis=1))[np.argsort(largest[:, 0])] + 0.0


DEFAULTS = EngineOptions()
NEARLY_NOTHING = 1e-6
"""mm: end of a path of which only the unloaded beginning is wanted."""
NO_LOAD = 1e-9
"""N: on a free end of which the equilibrium without loads is wanted; no arm moves by 1e-9 mm under it."""


@dataclass(frozen=True, repr=False)
class Buckling(Outcome):
    """Paths of a machine in several postures and directions, and their critical points.

    Attributes:
        paths: by posture and direction (``tension``, ``compression``).

    Example:
        >>> import vjm
        >>> buckling = vjm.buckling(vjm.load("orthoglide-chain"), ["A"], ["tension"], engine="vjm-paper")
        >>> [(row["critical"], round(row["F_cr"])) for row in buckling.rows()]
        [('bifurcation', 2696)]
    """

    paths: Mapping[tuple[str, str], Path]

    def rows(self) -> list[dict[str, Any]]:
        """One row a path: posture, direction, ``K0``, kind of the first event, ``F_cr``, ``d_cr``, ``K1``, ``K2``.

        N and mm along the driven component, magnitudes; None where there is no event.
        """
        rows = []
        for (posture, direction), path in self.paths.items():
            event = path.critical
            rows.append(
                {
                    "posture": posture,
                    "direction": direction,
                    "K0": path.points[0].tangent,
                    "critical": str(event.kind) if event else None,
                    "F_cr": event.force if event else None,
                    "d_cr": travel(path, event.point) if event and event.point else None,
                    "K1": event.stiffness_before if event else None,
                    "K2": event.stiffness_after if event else None,
                }
            )
        return rows

    def table(self) -> list[dict[str, Any]]:
        """As `rows`."""
        return self.rows()

    def __repr__(self) -> str:
        first = next(iter(self.paths.values()))
        lines = [f"<Buckling {first.model}, {first.engine}"]
        for row in self.rows():
            what, driven = "no critical point", self.paths[row["posture"], row["direction"]].load_case.driven
            if row["critical"]:
                what = f"{row['critical']} at {row['d_cr']:.5g} {driven.along}, {row['F_cr']:.5g} {driven.unit}"
            K0 = f"{row['K0']:.5g} {driven.stiffness}"
            lines.append(f" {row['posture']} {row['direction']}: K0 = {K0}; {what}")
        return "\n".join(lines) + ">"

    def _repr_html_(self) -> str:
        return table_html(self.rows())

    def plot(self, ax: Axes | None = None) -> Axes:
        """Every path's force over displacement, critical points marked.

        Raises:
            ImportError: matplotlib is not installed.
        """
        for (posture, direction), path in self.paths.items():
            ax = path.plot(ax, f"{posture}, {direction}")
        assert ax is not None
        return ax


def trace(
    machine: Machine,
    load_case: LoadCase,
    engine: str | Engine = "vjm",
    options: EngineOptions = DEFAULTS,
) -> Path:
    """The equilibrium path of a machine under a load case, on the stable branch behind every bifurcation.

    Args:
        machine: see `vjm.load`.
        load_case: what is done to it.
        engine: a word of `vjm.engine_by_name` such as ``vjm``, ``vjm-16f16`` or ``exudyn``, or an engine.
        options: number of springs or elements, for an engine given by its word.

    Raises:
        ValueError: no such engine or posture, or the engine cannot do what the load case asks.
        NoConvergenceError: no stable state to start from.

    Example:
        >>> import vjm
        >>> path = vjm.trace(vjm.load("orthoglide-chain"), vjm.LoadCase("A", to=1.0), engine="vjm-paper")
        >>> path.critical.kind, round(path.critical.force)
        (<EventKind.BIFURCATION: 'bifurcation'>, 2696)
    """
    machine, label = in_posture(machine, load_case.posture)
    load_case = load_case if label == load_case.posture else replace(load_case, posture=label)
    return _solver(machine, engine, options).trace(machine, load_case)


def stiffness(
    machine: Machine,
    posture: Posture = "",
    *,
    displacement: Sequence[float] | None = None,
    wrench: Sequence[float] | None = None,
    engine: str | Engine = "vjm",
    options: EngineOptions = DEFAULTS,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
) -> LoadedStiffness:
    """The loaded equilibrium of a machine and its 6×6 stiffness, eq. (18), beside the unloaded one, eq. (5).

    Args:
        machine: see `vjm.load`.
        posture: label, or coordinates, by the joints' names too, see `vjm.in_posture`; the first one if left out.
        displacement: ``(6,)`` of the end-effector, imposed; mm and rad, world axes. Zero if neither is given.
        wrench: ``(6,)`` on the free end-effector, dead; N and N mm, world axes.
        engine: as for `trace`.
        options: likewise.
        gravity: ``(3,)`` m/s², world axes: the parts have their weight. This and what follows is for a free end,
            and not for an imposed displacement.
        loads: on parts.
        end: name of the end frame; the first if left out.

    Raises:
        ValueError: both are given, or not six numbers, no such posture, end frame or part, the engine computes no
            6×6 stiffness, or takes no weight and loads.
        NoConvergenceError: there is no stable equilibrium; the message says how far it came.

    Example:
        >>> import vjm
        >>> vjm.stiffness(vjm.load("orthoglide-chain"), "A", displacement=(-1, 0, 0, 0, 0, 0))
        <LoadedStiffness orthoglide-chain, posture A, vjm-16, imposed displacement
         wrench -3281.5 0 -11.516 0 0 0 N, N mm
         diagonal of K^F 3262.7 -10.804 -10.473 67882 0 0.83598 N/mm, N mm/rad>
    """
    if displacement is not None and wrench is not None:
        raise ValueError("give displacement or wrench, not both: one imposes the other")
    control, given = (WRENCH, wrench) if wrench is not None else (DISPLACEMENT, displacement or (0.0,) * 6)
    values = finite_numbers(control, given, 6)
    machine, label = in_posture(machine, posture or _labels(machine)[0])
    solver = _solver(machine, engine, options)
    if displacement is None and isinstance(solver, VjmEngine):
        # what its weight or its loads hold stands by itself too, as a rod that hangs
        if held_by_itself(machine, label) or gravity is not None or loads or end:
            return of_free_end(machine, solver, label, values, gravity=gravity, loads=loads, end=end)
        if wrench is not None and not machine.is_tree:
            # it is a mechanism by its passive joints: Newton on the free end goes where no straight path does
            return under_wrench(machine, solver, label, values)
    if gravity is not None or loads or end:
        why = f"{solver.label} takes none" if displacement is None else "the displacement holds the end"
        raise ValueError(
            f"gravity, loads and an end frame are for a free end and engines vjm: {why}: follow a load case "
            "(`validate curve`)"
        )
    try:
        return _traced(machine, solver, label, control, values)
    except RigidDirectionError:
        if any(values) or not held_by_itself(machine, label) or not isinstance(solver, VjmEngine):
            raise
        # the stiffness is infinite where the end is rigid; the compliance of the free one is not
        return replace(of_free_end(machine, solver, label, values), control=DISPLACEMENT)


def buckling(
    machine: Machine,
    postures: Sequence[Posture] = (),
    directions: Sequence[str] = ("tension", "compression"),
    *,
    engine: str | Engine = "vjm",
    options: EngineOptions = DEFAULTS,
    to: float | None = None,
    axis: str = "x",
    free: Sequence[str] = (),
    force: bool = False,
) -> Buckling:
    """Paths along an axis in every posture and direction, with their critical points.

    Args:
        machine: see `vjm.load`.
        postures: labels or coordinates, see `vjm.in_posture`; all if left out.
        directions: ``tension`` is the positive ramp, ``compression`` the negative one.
        engine: as for `trace`.
        options: likewise.
        to: how far, mm or rad, with ``force`` N or N mm; 4 mm by default along x, y and z.
        axis: the driven component, one of x, y, z, rx, ry, rz.
        free: components in which the end-effector is free, such as ``("rx", "ry", "rz")``.
        force: a dead force or moment along the axis is driven, up to its first maximum, instead of the
            displacement.

    Raises:
        ValueError: as `trace`, or ``force`` or a rotation without ``to``.
        NoConvergenceError: as `trace`.

    Example:
        >>> import vjm
        >>> vjm.buckling(vjm.load("orthoglide-chain"), ["A"], engine="vjm-paper")
        <Buckling orthoglide-chain, vjm-paper
         A tension: K0 = 3300.3 N/mm; bifurcation at 0.81313 mm, 2696.2 N
         A compression: K0 = 3300.3 N/mm; no critical point>
    """
    if axis not in COMPONENTS:
        raise ValueError(f"axis '{axis}' is none of {', '.join(COMPONENTS)}")
    if to is None and (force or axis not in COMPONENTS[:3]):
        raise ValueError(
            f"{'with force=True' if force else f'along {axis}'} say up to how many "
            f"{'N' if axis in COMPONENTS[:3] else 'N mm' if force else 'rad'}: to=…"
        )
    solver = _solver(machine, engine, options)
    paths, labels = {}, []
    for wanted in postures or _labels(machine):
        machine, label = in_posture(machine, wanted)
        labels.append(label)
    for posture in labels:
        for word in directions:
            direction = Direction(word)
            end = ramp_end(machine, posture, direction) if to is None else direction.sign * abs(to)
            case = LoadCase(posture, end, axis, free=tuple(free))
            if force:
                push = Load(tuple(float(name == axis) for name in COMPONENTS))
                slides = tuple(name for name in COMPONENTS if name == axis or name in free)
                case = LoadCase(posture, end, "load", free=slides, loads=(push,), control=TO_LIMIT)
            paths[posture, str(direction)] = solver.trace(machine, case)
    return Buckling(paths)


def _solver(machine: Machine, engine: str | Engine, options: EngineOptions) -> Engine:
    return engine_by_name(engine, options, machine) if isinstance(engine, str) else engine


def _labels(machine: Machine) -> list[str]:
    check_machine(machine)
    return list(machine.postures)


def _traced(
    machine: Machine, solver: Engine, posture: str, control: str, values: tuple[float, ...]
) -> LoadedStiffness:
    """The stable equilibrium at the end of a straight path, by any engine that computes K^F."""
    if control == WRENCH and not any(values) and held_by_itself(machine, posture):
        # stressed springs move a free end without any load, while a path without a load would hold the pose
        stiffness = _traced(machine, solver, posture, control, (0.0, 0.0, NO_LOAD, 0.0, 0.0, 0.0))
        return replace(stiffness, wrench=np.zeros(6))
    path = solver.trace(machine, _straight(posture, control, values))
    if any(values) and not path.complete:
        raise NoConvergenceError(f"the {control} is reached only to {path.points[-1].s:.1%}: {path.stopped}")
    first, last = path.points[0], path.points[-1 if any(values) else 0]
    if first.stiffness is None or last.stiffness is None:
        raise ValueError(f"--engine {solver.label}: computes forces along a path, but no 6×6 stiffness")
    if last.unstable > 0:
        raise NoConvergenceError(f"the equilibrium at the end of the {control} is unstable")
    events = tuple(f"{e.kind} at {e.s:.4%} of the {control}" for e in path.events) if any(values) else ()
    return LoadedStiffness(
        model=machine.name,
        model_sha256=machine.sha256,
        engine=solver.label,
        posture=posture,
        control=control,
        displacement=last.displacement,
        wrench=last.wrench,
        loaded=last.stiffness,
        unloaded=first.stiffness,
        eigenvalue=last.eigenvalue,
        iterations=last.iterations,
        residual=last.residual,
        events=events,
        eigenvalue_relative=last.eigenvalue / first.eigenvalue,
        stable=True if last.unstable == 0 else None,
        laws=_laws(machine, solver, path),
    )


def _laws(machine: Machine, solver: Engine, path: Path) -> tuple[str, ...]:
    """What is to be said of springs' laws at the end of a path."""
    if isinstance(solver, VjmEngine):
        return tuple(map(str, solver.problem(machine, path.load_case).law_states(path.points[-1])))
    if machine.laws and solver.label in LINEAR:
        return (f"{solver.label} is linear about the posture as drawn: laws of springs have their tangents there",)
    return ()


def _straight(posture: str, control: str, values: tuple[float, ...]) -> LoadCase:
    """The load case that ends at the values; without any, one that begins at the unloaded posture."""
    if not any(values):
        return LoadCase(posture, NEARLY_NOTHING, steps=1)
    if control == DISPLACEMENT:
        return LoadCase(posture, 1.0, axis=values)
    return LoadCase(posture, 1.0, "load", loads=(Load(values),), free=COMPONENTS)
