"""What is read off a path: the measured value of a quantity."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from vjm.continuation.path import Equilibrium, Event, EventKind, Path, driven_force
from vjm.engine import Engine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS, LoadCase
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_validation.verification.geometry import place, unloaded_position
from vjm_validation.verification.schema import Asked

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
    found = [event for event in path.events if event.kind is kind]
    if len(found) <= which:
        raise NoConvergenceError(f"{len(found) or 'no'} {kind} on the path{_ending(path)}")
    return found[which]


def _at(path: Path, ramp: float | None) -> Equilibrium:
    if ramp is None:
        if not path.complete:
            raise NoConvergenceError(path.stopped)
        return path.points[-1]
    at = min(path.points, key=lambda point: abs(point.s - ramp))
    if abs(at.s - ramp) > SAME_RAMP * max(abs(ramp), 1.0):
        raise NoConvergenceError(f"the path has no point at {ramp:g}{_ending(path)}")
    return at


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
