"""The numbers by which paths are compared.

They are the stiffness before and after, the critical point, the end of the path, how far two paths lie apart, and
at which load the material yields first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vjm.continuation.path import EventKind, Path, travel
from vjm.engines import Engine, VjmEngine
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_output.documents import Row
from vjm_updating.diagnosis.stress import first_yield


class PathMetrics(Row):
    """Metrics of one path, N and mm along the driven component, magnitudes."""

    K0: float | None
    """Unloaded stiffness; this and the others are null where they are infinite: the load moves nothing there."""
    K1: float | None
    """Stiffness at 0.99 of the critical displacement; null for a stiffness knee."""
    critical: EventKind | None
    """Kind of the first event on the path."""
    F_cr: float | None
    """Force there."""
    d_cr: float | None
    """Displacement there; where loads are driven that of the end-effector along those on it."""
    K2: float | None
    """Stiffness at 1.01 of the critical displacement, on the stable branch; null for a stiffness knee."""
    F_end: float
    """Force at the end of the path."""
    d_end: float
    """Displacement at the end of the path."""
    K3: float | None
    """Stiffness at the end of the path."""
    stopped: str
    """Why the path ends early; empty where it does not."""


def finite(value: float | None) -> float | None:
    """A number that a document can hold: none in place of an infinite one."""
    return value if value is None or np.isfinite(value) else None


def path_metrics(path: Path) -> PathMetrics:
    """Metrics of a path as the suite's files define them."""
    event = path.critical
    return PathMetrics(
        K0=finite(path.points[0].tangent),
        K1=finite(event.stiffness_before) if event else None,
        critical=event.kind if event else None,
        F_cr=event.force if event else None,
        d_cr=travel(path, event.point) if event and event.point else None,
        K2=finite(event.stiffness_after) if event else None,
        F_end=float(path.force[-1]),
        d_end=travel(path, path.points[-1]),
        K3=finite(path.points[-1].tangent),
        stopped=path.stopped,
    )


def force_at(path: Path, s: float) -> float:
    """Force of a path at the displacement ``s``, by cubic Hermite interpolation with the known tangents.

    The critical point, where the tangent jumps, is a node of the interpolation.

    Raises:
        ValueError: the path does not reach ``s``.
    """
    nodes_s, force, left, right = _nodes(path)
    if not nodes_s[0] <= s <= nodes_s[-1] * (1.0 + 1e-12):
        raise ValueError(f"{path.engine}: the path ends at {nodes_s[-1]:.6g}, before {s:.6g}")
    i = int(np.clip(np.searchsorted(nodes_s, s) - 1, 0, len(nodes_s) - 2))
    h = nodes_s[i + 1] - nodes_s[i]
    t = (s - nodes_s[i]) / h
    return float(
        (1 + 2 * t) * (1 - t) ** 2 * force[i]
        + t * (1 - t) ** 2 * h * right[i]
        + t**2 * (3 - 2 * t) * force[i + 1]
        - t**2 * (1 - t) * h * left[i + 1]
    )


def _nodes(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Displacements, forces and the tangents on the left and right of each node."""
    s, force, tangent = path.s, path.force, path.tangent
    left, right = tangent.copy(), tangent.copy()
    for event in path.events:
        if event.kind is not EventKind.BIFURCATION or not event.switched:
            continue
        i = int(np.searchsorted(s, event.s))
        before = left[i - 1] if event.stiffness_before is None else event.stiffness_before
        s = np.insert(s, i, event.s)
        force = np.insert(force, i, event.force)
        left = np.insert(left, i, before)
        right = np.insert(right, i, right[i])
    return s, force, left, right


def round_down(value: float) -> float:
    """Down to 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** np.floor(np.log10(value))
    return float(max(m * decade for m in (1.0, 2.0, 5.0) if m * decade <= value))


# --- How far two paths of the same chain lie apart ----------------------------------------------------------------


def force_difference(path: Path, reference: Path) -> float:
    """Largest difference in N between two paths' forces at equal displacement, as far as both go."""
    end = min(path.points[-1].s, reference.points[-1].s)
    nodes = np.unique(np.concatenate([path.s, reference.s, [e.s for e in (*path.events, *reference.events)]]))
    return max(abs(force_at(path, s) - force_at(reference, s)) for s in nodes[nodes <= end])


def deflection(path: Path, index: int = -1) -> dict[tuple[str, float], Array]:
    """Displacement ``(3,)`` in mm of every station from the unloaded shape, by part and fraction."""
    moved = path.points[index].shape - path.points[0].shape
    labels = [(label.part, round(label.fraction, 9)) for label in path.stations]
    return dict(zip(labels, moved, strict=True))


def shape_difference(path: Path, reference: Path) -> float:
    """Largest distance between the deflected shapes at the two paths' ends, over the reference's amplitude.

    Compared at the stations that both have.

    Raises:
        ValueError: the paths end at different displacements or share no station.
    """
    if not np.isclose(path.points[-1].s, reference.points[-1].s, rtol=1e-9):
        raise ValueError(f"{path.engine} and {reference.engine} end at different displacements")
    ours, theirs = deflection(path), deflection(reference)
    shared = sorted(ours.keys() & theirs.keys())
    if not shared:
        raise ValueError(f"{path.engine} and {reference.engine} share no station")
    amplitude = max(float(np.linalg.norm(v)) for v in theirs.values())
    return max(float(np.linalg.norm(ours[label] - theirs[label])) for label in shared) / amplitude


class YieldRow(Row):
    """Of one path, as far as its critical point or its end."""

    posture: str
    direction: str
    engine: str
    yields_N: float | None  # noqa: N815
    """Driven force at which the material yields first; null where it does not."""
    critical_N: float | None  # noqa: N815
    """Of the path; null where it has no critical point."""
    where: str
    """``on the way, in PART``; or how much of the yield stress is reached."""

    @property
    def words(self) -> str:
        """One line for people."""
        head = f"{self.posture} {self.direction}, {self.engine}: "
        if self.yields_N is None:
            return f"{head}the material does not yield: {self.where}"
        line = f"{head}the material yields first at {self.yields_N:.4g} N, {self.where}"
        if self.critical_N is None:
            return f"{line}; the path has no critical point"
        return f"{line}: {self.yields_N / self.critical_N:.2g} of the critical {self.critical_N:.4g} N"


def yield_rows(
    chain: Machine,
    parts: Sequence[Mapping[str, Any]],
    cases: Sequence[tuple[str, str, Engine]],
    paths: Sequence[Path],
) -> list[YieldRow]:
    """A row for every path of the virtual joint method; none where the file says no yield stress.

    Args:
        chain: that was walked.
        parts: tables of its model file, see `vjm.io.machine_file.part_tables`.
        cases: posture, direction and engine of every path.
        paths: the paths.
    """
    rows = []
    for (posture, direction, engine), path in zip(cases, paths, strict=True):
        if not isinstance(chain, Machine) or not isinstance(engine, VjmEngine):
            continue
        first = first_yield(engine.problem(chain, path.load_case), path, parts)
        if first.known:
            critical = None if path.critical is None else float(path.critical.force)
            rows.append(
                YieldRow(
                    posture=posture, direction=direction, engine=engine.label, yields_N=first.force,
                    critical_N=critical, where=first.words,
                )
            )  # fmt: skip
    return rows
