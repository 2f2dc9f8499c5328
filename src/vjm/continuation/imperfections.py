"""Imperfections: chains built with a deflection in the shape in which the perfect one buckles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.continuation.arc_length import ArcControl, trace
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import EventKind, Path, driven_force
from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm.statics.stability import critical_modes

REACH = (1.0, 2.0, 4.0, 8.0)
"""How far beyond the load case's own end the perfect chain is taken to find how it buckles."""


def buckling_shape(problem_of: Callable[[LoadCase], LumpedProblem], load_case: LoadCase) -> Array:
    """Coordinates ``(n,)`` of the critical mode of a perfect machine, per mm of its largest deflection.

    It points towards the load case's branch.

    Args:
        problem_of: the perfect machine under a load case, ready to be followed.
        load_case: under which it buckles.

    Raises:
        ValueError: the machine does not buckle under its load case, or without any point of it moving.
    """
    for reach in REACH:
        perfect = replace(load_case, imperfection=0.0, to=reach * load_case.to, steps=None)
        problem = problem_of(perfect)
        path = trace(problem, perfect, ArcControl(last=EventKind.BIFURCATION))
        event = next((e for e in path.events if e.kind is EventKind.BIFURCATION), None)
        if event is not None and event.point is not None:
            break
    else:
        raise ValueError(
            f"posture {load_case.posture} has no bifurcation up to {REACH[-1]:g} times this load case's end. "
            "Without a mode an imperfection has no shape: give a load case that buckles"
        )
    at = problem.configuration(event.point)
    mode = critical_modes(at)[0]
    size = float(np.linalg.norm(problem.model.velocities(at.x, mode), axis=1).max())
    if size < 1e-9 * problem.model.characteristic_length:
        raise ValueError("the critical mode moves no point of the chain: use more than one spring a link")
    return (load_case.branch or 1) * mode / size


@dataclass(frozen=True)
class ImperfectionCurve:
    """What imperfections cost; k sizes.

    Attributes:
        size: ``(k,)`` mm.
        force: ``(k,)`` driven force, or load factor, at each path's first limit point; at the path's end where the
            force only grows.
        ramp: ``(k,)`` where that is.
        limit: ``(k,)`` whether it is a limit point.
        paths: as far as there.
    """

    size: Array
    force: Array
    ramp: Array
    limit: np.ndarray
    paths: tuple[Path, ...]


def imperfection_curve(
    problem_of: Callable[[LoadCase], LumpedProblem],
    load_case: LoadCase,
    sizes: Sequence[float],
    progress: Callable[[float], None] | None = None,
) -> ImperfectionCurve:
    """The largest force against the size of an imperfection in the shape of the buckling mode.

    Args:
        problem_of: the machine under a load case, imperfection included, ready to be followed.
        load_case: under which the perfect machine buckles; its own imperfection is replaced.
        sizes: mm.
        progress: called with the fraction done.
    """
    paths, found = [], []
    for k, size in enumerate(sizes):
        imperfect = replace(load_case, imperfection=float(size))
        path = trace(problem_of(imperfect), imperfect, ArcControl(last=EventKind.LIMIT))
        top = next((e.point for e in path.events if e.kind is EventKind.LIMIT), None) or path.points[-1]
        found.append((float(size), driven_force(imperfect, top), top.ramp, top is not path.points[-1]))
        paths.append(path)
        if progress is not None:
            progress((k + 1) / len(sizes))
    size_, force_, ramp_, limit_ = (np.array(column) for column in zip(*found, strict=True))
    return ImperfectionCurve(size_, force_, ramp_, limit_, tuple(paths))
