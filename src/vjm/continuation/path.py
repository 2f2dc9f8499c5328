"""Load paths: equilibria in a row, with what is known of each, and the events between them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from vjm.model.load_case import LoadCase
from vjm.outcome import DISPLACEMENT_COLUMNS, WRENCH_ROWS, Outcome, axes_or_new, table_html
from vjm.rotations import Array

if TYPE_CHECKING:
    from vjm.outcome import Axes


ROWS, SHOWN = 12, ("s", "force", "k_N_per_mm", "unstable_modes")
"""Points of a path that its HTML shows, and what of them."""


class EventKind(StrEnum):
    """What can happen along a path of imposed displacement, in the order of precedence at a tie.

    Example:
        >>> import vjm
        >>> str(vjm.EventKind.BIFURCATION)
        'bifurcation'
    """

    BIFURCATION = "bifurcation"
    """The smallest stability eigenvalue passes zero."""
    LIMIT = "limit"
    """The force has a maximum."""
    FOLD = "fold"
    """The ramp of a displacement turns back: beyond it no equilibrium is near, and an imposed one snaps."""
    STIFFNESS_KNEE = "stiffness-knee"
    """Neither, but the tangent stiffness falls through half of its unloaded value."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """One converged state, whoever solved it.

    Attributes:
        s: path parameter: the ramp, a point's displacement, or the arc's length, as the load case says.
        displacement: ``(6,)`` of the end-effector from its unloaded pose, mm, rad, world axes.
        wrench: ``(6,)`` that the chain needs at the end-effector, N, N mm, world axes.
        tangent: derivative of the driven force by the ramp, the rest of the pose held; of a load factor by the
            displacement on which the ramped loads work.
        stiffness: the whole ``(6, 6)`` loaded stiffness K^F, where computed; of the support, where some components
            of the pose are free, and of the end-effector again, where all are.
        eigenvalue: smallest eigenvalue of the tangent on the constraints' null space, in the engine's own
            units; nan where not computed.
        unstable: number of negative eigenvalues, −1 where not computed.
        iterations: of the solver.
        residual: relative, in the engine's own scaling.
        shape: positions ``(k, 3)`` of the stations, mm, world.
        state: the engine's own coordinates ``(n,)``.
        ramp: the driven displacement's magnitude or the load factor; the path parameter itself where not given.
        rounding: by which the eigenvalue may be wrong, as far as the engine says.

    Example:
        >>> import vjm
        >>> path = vjm.trace(vjm.load("orthoglide-chain"), vjm.LoadCase("A", to=1.0), engine="vjm-paper")
        >>> path.points[0].s, path.points[-1].unstable
        (0.0, 0)
    """

    s: float
    displacement: Array
    wrench: Array
    tangent: float
    eigenvalue: float
    unstable: int
    iterations: int
    residual: float
    shape: Array
    state: Array
    stiffness: Array | None = None
    ramp: float = float("nan")
    rounding: float = 0.0

    def __repr__(self) -> str:
        stable = "unstable" if self.unstable > 0 else "stable" if self.unstable == 0 else "stability not computed"
        return f"<Equilibrium at s = {self.s:.6g}, tangent {self.tangent:.6g}, {stable}>"

    def __post_init__(self) -> None:
        if np.isnan(self.ramp):
            object.__setattr__(self, "ramp", self.s)


@dataclass(frozen=True)
class Event:
    """A critical point, located.

    Attributes:
        kind: what happens.
        s: path parameter there.
        force: magnitude of the driven wrench component there.
        stiffness_before: tangent at 0.99 s on the stable path; None for a stiffness knee or off the path.
        stiffness_after: tangent at 1.01 s on the stable path; likewise.
        multiplicity: number of eigenvalues that pass zero together.
        point: the state at the event, for its shape.
        switched: for a bifurcation: whether a stable branch was found and taken.

    Example:
        >>> import vjm
        >>> path = vjm.trace(vjm.load("orthoglide-chain"), vjm.LoadCase("A", to=1.0), engine="vjm-paper")
        >>> f"{path.critical.kind} at {path.critical.s:.3f} mm"
        'bifurcation at 0.813 mm'
    """

    kind: EventKind
    s: float
    force: float
    stiffness_before: float | None = None
    stiffness_after: float | None = None
    multiplicity: int = 1
    point: Equilibrium | None = None
    switched: bool = False

    def __repr__(self) -> str:
        return f"{self.kind} at s = {self.s:.6g}, force {self.force:.6g}"


@dataclass(frozen=True)
class LawChange:
    """Where a spring passes from one region of its law to the next, located.

    Attributes:
        what: ``joint``, ``actuator``, ``mount``, ``spring`` or ``cable``.
        name: of it.
        region: that it comes into, in words.
        s: path parameter there.
        force: magnitude of the driven wrench component there.
        point: the state there, which is a point of the path.
    """

    what: str
    name: str
    region: str
    s: float
    force: float
    point: Equilibrium

    def __str__(self) -> str:
        return f"from {self.point.ramp:.6g} on {self.what} '{self.name}' is {self.region}, at {self.force:.6g}"


@dataclass(frozen=True)
class StationLabel:
    """Which material point a row of a shape is: part name and fraction of its elastic length."""

    part: str
    fraction: float


def driven_force(load_case: LoadCase, point: Equilibrium) -> float:
    """The wrench along the ramp, positive where the chain resists it; the load factor where loads are driven."""
    return point.ramp if load_case.load_driven else float(load_case.direction @ point.wrench)


@dataclass(frozen=True)
class Path(Outcome):
    """The equilibria that a chain passes through: stable ones, and where the arc is followed unstable ones too.

    Attributes:
        engine: label of the engine.
        model: name of the model.
        model_sha256: hash of its file.
        load_case: what was done.
        points: the equilibria in the order of the path, the unloaded one first. All are converged; each says
            whether it is stable.
        events: located critical points in the order of the path.
        stations: labels of the rows of the shapes.
        stopped: why the path ends before its load case does; empty where it does not.
        seconds: wall time.
        law_changes: where springs pass from region to region of their laws, in the order of the path.

    Example:
        >>> import vjm
        >>> path = vjm.trace(vjm.load("orthoglide-chain"), vjm.LoadCase("A", to=1.0), engine="vjm-paper")
        >>> path.complete, round(path.critical.force)
        (True, 2696)
    """

    engine: str
    model: str
    load_case: LoadCase
    points: tuple[Equilibrium, ...]
    events: tuple[Event, ...] = ()
    stations: tuple[StationLabel, ...] = ()
    stopped: str = ""
    seconds: float = 0.0
    model_sha256: str = ""
    law_changes: tuple[LawChange, ...] = ()

    @property
    def s(self) -> Array:
        """Path parameter of every point ``(n,)``."""
        return np.array([p.s for p in self.points])

    @property
    def force(self) -> Array:
        """Driven force ``(n,)``, see `driven_force`."""
        return np.array([driven_force(self.load_case, p) for p in self.points])

    @property
    def ramp(self) -> Array:
        """Driven displacement's magnitude or load factor of every point ``(n,)``."""
        return np.array([p.ramp for p in self.points])

    @property
    def tangent(self) -> Array:
        """Tangent stiffness ``(n,)`` along the driven component."""
        return np.array([p.tangent for p in self.points])

    @property
    def displacement(self) -> Array:
        """Displacements ``(n, 6)``, mm, rad."""
        return np.array([p.displacement for p in self.points])

    @property
    def wrench(self) -> Array:
        """Wrenches ``(n, 6)``, N, N mm."""
        return np.array([p.wrench for p in self.points])

    @property
    def unstable(self) -> np.ndarray:
        """Number of unstable modes ``(n,)``, −1 where not computed."""
        return np.array([p.unstable for p in self.points], dtype=int)

    @property
    def eigenvalue_relative(self) -> Array:
        """Smallest stability eigenvalue over its unloaded value ``(n,)``; nan where not computed."""
        values = np.array([p.eigenvalue for p in self.points])
        return values / values[0]

    @property
    def critical(self) -> Event | None:
        """The first event, by precedence at a tie."""
        return self.events[0] if self.events else None

    @property
    def complete(self) -> bool:
        """Whether the path reached the end of its load case."""
        return not self.stopped

    def __repr__(self) -> str:
        case, n = self.load_case, len(self.points)
        unit = case.driven.unit if case.load_driven else case.driven.along
        unit = f" {unit}" if unit else ""
        axis = case.axis if isinstance(case.axis, str) else "a direction"
        per = f" {case.driven.stiffness}" if case.driven.stiffness else ""
        lines = [
            f"<Path {self.model}, posture {case.posture}, {self.engine}: "
            f"{axis} to {case.to:g}{unit}, {n} equilibria",
            f" K0 = {self.points[0].tangent:.5g}{per}; {int((self.unstable > 0).sum())} of {n} unstable",
        ]
        for event in self.events:
            lines.append(f" {event!r}")
        lines += [f" {change}" for change in self.law_changes]
        if self.stopped:
            lines.append(f" ends at {self.points[-1].ramp:.5g}{unit}: {self.stopped}")
        return "\n".join(lines) + ">"

    def _repr_html_(self) -> str:
        last, rows = len(self.points) - 1, self.table()
        some = sorted({round(k * last / (ROWS - 1)) for k in range(ROWS)})
        shown = [{name: rows[i][name] for name in SHOWN} for i in some]
        return f"<pre>{escape(repr(self))}</pre>{table_html(shown)}"

    def table(self) -> list[dict[str, Any]]:
        """A row a point under the names of a curve file."""
        columns: dict[str, Any] = {"s": self.s}
        columns |= dict(zip(DISPLACEMENT_COLUMNS, self.displacement.T, strict=True))
        columns |= dict(zip(WRENCH_ROWS, self.wrench.T, strict=True))
        columns |= {"force": self.force, "k_N_per_mm": self.tangent, "unstable_modes": self.unstable}
        columns |= {"lambda_min_rel": self.eigenvalue_relative}
        return [
            dict(zip(columns, row, strict=True))
            for row in zip(*map(np.ndarray.tolist, columns.values()), strict=True)
        ]

    def plot(self, ax: Axes | None = None, label: str = "") -> Axes:
        """Driven force over ramp, unstable stretches dotted, critical points marked.

        Raises:
            ImportError: matplotlib is not installed.
        """
        ax = axes_or_new(ax)
        line = ax.plot(self.ramp, self.force, label=label or f"{self.load_case.posture}, {self.engine}")[0]
        lost = self.unstable > 0
        if lost.any():
            ax.plot(np.where(lost, self.ramp, np.nan), np.where(lost, self.force, np.nan), "w:", linewidth=1.0)
        for event in self.events:
            ramp = event.point.ramp if event.point else event.s
            ax.plot(ramp, event.force, "o", color=line.get_color(), markersize=4)
        driven = self.load_case.driven
        load = f"{driven.name}, {driven.unit}" if driven.unit else driven.name
        ax.set_xlabel(load if self.load_case.load_driven else f"displacement, {driven.along}")
        ax.set_ylabel(load)
        ax.legend()
        return ax


def travel(path: Path, point: Equilibrium) -> float:
    """How far a point of a path is along what drives it: the ramp, or the end-effector along its ramped loads.

    Nan where loads are driven and none of them acts on the end-effector.
    """
    load_case = path.load_case
    if not load_case.load_driven:
        return point.ramp
    force = sum((np.array(load.wrench) for load in load_case.loads if load.ramped and not load.part), np.zeros(6))
    size = float(np.linalg.norm(force))
    return load_case.sign * float(point.displacement @ force) / size if size else float("nan")
