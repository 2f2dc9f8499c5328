"""What is asked of a machine, in one call each: a path, a loaded stiffness, critical points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from vjm.continuation.direction import Direction, ramp_end
from vjm.continuation.path import Path, travel
from vjm.engine import Engine
from vjm.engines import EngineOptions, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.limits import LINEAR
from vjm.loaded_stiffness import (
    DISPLACEMENT,
    WRENCH,
    LoadedStiffness,
    held_by_itself,
    of_free_end,
    under_wrench,
)
from vjm.model.end_condition import RigidDirectionError
from vjm.model.load_case import COMPONENTS, TO_LIMIT, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.outcome import Outcome
from vjm.postures import Posture, in_posture
from vjm.vjm_engine import VjmEngine

if TYPE_CHECKING:
    from vjm.notebook import Axes

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
        >>> found = vjm.buckling(vjm.load("orthoglide-chain"), ["A"], ["tension"], engine="vjm-paper")
        >>> [(row["critical"], round(row["F_cr"])) for row in found.rows()]
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
        from vjm.notebook import table_html

        return table_html(self.rows())

    def plot(self, ax: Axes | None = None) -> Axes:
        """Every path's force over displacement, critical points marked.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.notebook import path_plot

        for (posture, direction), path in self.paths.items():
            ax = path_plot(path, ax, f"{posture}, {direction}")
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
        gravity: ``(3,)`` m/s², world axes: the parts have their weight. This and what follows is for machines that
            carry their free end, arms and trees, and not for an imposed displacement.
        loads: on parts.
        end: name of the end frame; the first if left out.

    Raises:
        ValueError: both are given, or not six numbers, no such posture, end frame or part, the engine computes no
            6×6 stiffness, or weight and loads are for a machine that cannot carry them.
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
    values = tuple(float(value) for value in given)
    if len(values) != 6 or not np.all(np.isfinite(values)):
        raise ValueError(f"{control} must be six finite numbers, got {list(given)}")
    machine, label = in_posture(machine, posture or _labels(machine)[0])
    solver = _solver(machine, engine, options)
    if displacement is None and isinstance(solver, VjmEngine):
        if held_by_itself(machine, label):
            return of_free_end(machine, solver, label, values, gravity=gravity, loads=loads, end=end)
        if wrench is not None and gravity is None and not loads and not end and not machine.is_tree:
            # it is a mechanism by its passive joints: Newton on the free end goes where no straight path does
            return under_wrench(machine, solver, label, values)
    if gravity is not None or loads or end:
        why = "has passive joints or another engine" if displacement is None else "is held at the displacement"
        raise ValueError(
            f"gravity, loads and an end frame are for machines that carry their free end by vjm; {machine.name} "
            f"{why}: follow a load case (`validate curve`)"
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
    return list(machine.postures)


def _traced(
    machine: Machine, solver: Engine, posture: str, control: str, values: tuple[float, ...]
) -> LoadedStiffness:
    """The stable equilibrium at the end of a straight path, by any engine that computes K^F."""
    if control == WRENCH and not any(values) and held_by_itself(machine, posture):
        # stressed springs move a free end without any load, while a path without a load would hold the pose
        found = _traced(machine, solver, posture, control, (0.0, 0.0, NO_LOAD, 0.0, 0.0, 0.0))
        return replace(found, wrench=np.zeros(6))
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
