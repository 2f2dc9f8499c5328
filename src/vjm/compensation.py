"""Joint coordinates that put a loaded tool where it should be, for machines of any kind.

They are found pose by pose or along a path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from vjm.analysis import held_by_itself
from vjm.engines import VjmEngine
from vjm.errors import MechanismError, NoConvergenceError
from vjm.machine.equilibria import equilibria, unloaded_frames
from vjm.machine.inverse_kinematics import (
    ClosedPostures,
    Ranges,
    ReachError,
    damped_search,
    difference,
    end_index,
    followed,
    least_beyond,
    ranges_of,
)
from vjm.machine.rigid_mechanism import CLOSED, LoopClosure, home_label
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity, Mechanism
from vjm.outcome import Outcome
from vjm.postures import Posture, check_machine, in_posture
from vjm.rank import span
from vjm.rotations import Array, displaced, rotation_vector, rotations_from_vectors

if TYPE_CHECKING:
    from vjm.outcome import Axes


COMPENSATIONS = ("rigid", "linear", "loaded")
"""Models by which coordinates are computed."""
EXACT = 1e-10
"""Of the machine's reach and in rad: what may be left of what the joints can put right."""
STEP = 1e-6
"""rad, or of the reach: of the differences that make the Jacobian."""
SMALL = 1e-4
"""Share of the loads, and of the springs' stress, under which the linear answer is measured: second-order terms are
that share of it."""
ASIDE = 0.1
"""rad, or of the reach: how far beside a singular posture its arm is looked at. There it can go in more
directions."""
AROUND = (0.01, 0.03, 0.1, 0.3, 1.0)
"""rad, or of the reach: within which further starts lie, where a row has no solution near its rigid posture."""
STARTS = 16
"""Of each of them."""


@dataclass(frozen=True)
class Compensation(Outcome):
    """What compensation does at g poses; each array has g rows.

    Attributes:
        joints: names of the n joints.
        q: ``(g, n)`` coordinates of the rigid arm, mm or rad.
        q_linear: of the linear model.
        q_loaded: of the loaded model.
        rigid: error ``(g, 6)`` of the loaded end under ``q``: shift and rotation vector, mm, rad, world axes.
        linear: under ``q_linear``.
        loaded: under ``q_loaded``: what no joint can put right. Where no rotation is asked for, turns are those
            from the rigid arm's end.

    Example:
        >>> import vjm
        >>> compensation = vjm.compensate(vjm.load("planar-2r"), [(600, 300, 0)], wrenches=[(0, -50, 0, 0, 0, 0)])
        >>> {name: f"{left:.2f} mm" for name, left in compensation.largest_mm.items()}
        {'rigid': '12.08 mm', 'linear': '0.11 mm', 'loaded': '0.00 mm'}
    """

    joints: tuple[str, ...]
    q: Array
    q_linear: Array
    q_loaded: Array
    rigid: Array
    linear: Array
    loaded: Array

    @property
    def commands(self) -> dict[str, Array]:
        """Coordinates ``(g, n)`` by the model."""
        return dict(zip(COMPENSATIONS, (self.q, self.q_linear, self.q_loaded), strict=True))

    @property
    def errors(self) -> dict[str, Array]:
        """Errors ``(g, 6)`` of the loaded end by the model."""
        return dict(zip(COMPENSATIONS, (self.rigid, self.linear, self.loaded), strict=True))

    @property
    def largest_mm(self) -> dict[str, float]:
        """Largest shift of the loaded end from where it should be, mm, by the model."""
        return {name: float(np.linalg.norm(rows[:, :3], axis=1).max()) for name, rows in self.errors.items()}

    def table(self) -> list[dict[str, Any]]:
        """A row for each pose and model: coordinates by the joints' names, and the error that is left."""
        return [
            {"pose": k + 1, "model": name, **dict(zip(self.joints, q.tolist(), strict=True)),
             "error_mm": float(np.linalg.norm(error[:3])), "error_rad": float(np.linalg.norm(error[3:]))}
            for name, rows in self.commands.items()
            for k, (q, error) in enumerate(zip(rows, self.errors[name], strict=True))
        ]  # fmt: skip

    def plot(self, ax: Axes | None = None) -> Axes:
        """The shift that each model leaves, pose by pose.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.outcome import axes_or_new

        ax = axes_or_new(ax)
        for name, rows in self.errors.items():
            ax.plot(np.arange(1, len(rows) + 1), np.linalg.norm(rows[:, :3], axis=1), "o-", label=name)
        ax.set_xlabel("pose")
        ax.set_ylabel("error of the loaded end, mm")
        ax.legend()
        return ax


def compensated_arm(
    model: Mechanism,
    positions: Array,
    rotations: Array | None,
    wrenches: Array,
    *,
    gravity: Gravity | None = None,
    start: Array | None = None,
    end: str = "",
) -> Compensation:
    """Joint coordinates of a path of tool poses for the rigid, the linear and the loaded model.

    All of them are within the joints' limits. Of several solutions of the loaded arm that near the rigid arm's is
    taken. Only what the rigid arm's joints can move is put right: a planar arm's sag out of its plane stays. Of a
    machine with closed loops the drives are set, and its passive joints follow from the loops.

    Args:
        model: the machine.
        positions: ``(g, 3)`` wanted, mm, world.
        rotations: ``(g, 3, 3)`` wanted; None where the end may turn as it likes.
        wrenches: ``(g, 6)`` dead on the end, N, N mm, world axes.
        gravity: m/s².
        start: coordinates ``(n,)`` near which the path begins, and which passive joints keep: nothing sets them.
            None for the posture of smallest coordinates, and see `ranges_of`.
        end: name of the end frame; the first where it is empty.

    Raises:
        ReachError: a pose is out of reach of the rigid or the loaded arm, or a joint would have to go beyond its
            limits; the message says which, and by how much.
        NoConvergenceError: under some load there is no stable equilibrium.
        ValueError: there is no such end frame.
    """
    index = end_index(model, end)
    q, why = followed(model, positions, rotations, start, end)
    lost = next((k for k, each in enumerate(why) if each), None)
    if lost is not None:
        raise ReachError(f"row {lost + 1} of the path: {why[lost]}")
    wanted_R = unloaded_frames(model, q)[0][:, index] if rotations is None else rotations
    ranges, closing = ranges_of(model, start), None
    if model.chain.closes:
        ranges, closing = ranges.following(), ClosedPostures(model, start, end).closing
    arm = _LoadedArm(model, index, positions, wanted_R, wrenches, gravity, closing)
    rigid = arm.errors(q)
    unfound = np.flatnonzero(np.isnan(rigid).any(axis=1))
    if len(unfound):
        raise NoConvergenceError(f"{model.chain.name}: no stable equilibrium at row {1 + unfound[0]} of the path")
    ways = _movable(arm, ranges, q, rotations is not None)
    q_linear = _linear(arm, ranges, ways, q)
    q_loaded = _put_right(arm, ranges, ways, q)
    return Compensation(model.joints, q, q_linear, q_loaded, rigid, arm.errors(q_linear), arm.errors(q_loaded))


@dataclass(frozen=True)
class _LoadedArm:
    """The loaded arm along a path.

    Attributes:
        model: the machine.
        index: of the end frame.
        positions: ``(g, 3)`` wanted, mm, world.
        rotations: ``(g, 3, 3)`` wanted.
        wrenches: ``(g, 6)`` on the end.
        gravity: m/s².
        closing: of a machine with closed loops.
    """

    model: Mechanism
    index: int
    positions: Array
    rotations: Array
    wrenches: Array
    gravity: Gravity | None
    closing: LoopClosure | None

    def closed(self, q: Array) -> Array:
        """Coordinates ``(s, n)`` with passive joints where closed loops put them, nan where they do not close."""
        if self.closing is None:
            return q
        result, left = self.closing.solve(q, ~self.closing.tree.passive)
        result[~(left < CLOSED)] = np.nan
        return result

    def unloaded(self, q: Array) -> tuple[Array, Array]:
        """Rotations ``(s, 3, 3)`` and positions ``(s, 3)`` mm of the unloaded end, nan where loops do not close."""
        q = self.closed(q)
        closes = np.asarray(np.isfinite(q).all(axis=1))
        R, p = unloaded_frames(self.model, np.where(closes[:, None], q, 0.0))
        R[~closes], p[~closes] = np.nan, np.nan
        return R[:, self.index], p[:, self.index]

    def errors(self, q: Array, rows: np.ndarray | None = None, share: float = 1.0) -> Array:
        """Errors ``(s, 6)`` of the end, nan where no equilibrium is stable.

        Args:
            q: coordinates ``(s, n)``.
            rows: number of the pose of each ``(s,)``; None for all poses in their order.
            share: of the loads and of the springs' stress.
        """
        rows = np.arange(len(self.positions)) if rows is None else rows
        wrench = np.zeros((len(q), len(self.model.ends), 6))
        wrench[:, self.index] = self.wrenches[rows]
        q = self.closed(q)
        closes = np.asarray(np.isfinite(q).all(axis=1))
        states = equilibria(
            self.model, np.where(closes[:, None], q, 0.0), gravity=self.gravity, wrench=wrench, compliance=False,
            share=share,
        )  # fmt: skip
        p, R = states.position[:, self.index], states.rotation[:, self.index]
        e = difference(p, R, self.positions[rows], self.rotations[rows])
        e[~(states.converged & states.stable & closes)] = np.nan
        return e

    def rigid_errors(self, q: Array, rows: np.ndarray) -> Array:
        """Errors ``(s, 6)`` of the arm without loads and deflections."""
        R, p = self.unloaded(q)
        return difference(p, R, self.positions[rows], self.rotations[rows])


def _linear(arm: _LoadedArm, ranges: Ranges, ways: Array, q: Array) -> Array:
    """Coordinates ``(g, n)`` of the rigid arm whose end is off by as much as the linear model sags.

    Raises:
        NoConvergenceError: naming the row where the arm does not stand under a small share of the loads, or has
            no linear model, as laws of its springs have no slope there.
    """
    rest = equilibria(arm.model, arm.closed(q), compliance=False, share=0.0)
    if rest.undetermined.any():
        raise NoConvergenceError(
            f"{arm.model.chain.name}: has no linear model at row {1 + int(np.argmax(rest.undetermined))} of the "
            "path: without load nothing holds it, as laws of its springs have no slope there. Give them one"
        )
    sagged = arm.errors(q, share=SMALL) / SMALL
    lost = np.flatnonzero(np.isnan(sagged).any(axis=1))
    if len(lost):
        raise NoConvergenceError(
            f"{arm.model.chain.name}: no stable equilibrium under a small share of the loads at row {1 + lost[0]} "
            "of the path"
        )

    def left(q: Array, rows: np.ndarray) -> Array:
        return _projected(ways[rows], arm.rigid_errors(q, rows) + sagged[rows])

    return arm.closed(damped_search(left, q, ranges.low, ranges.high, ranges.unit)[0])


def _put_right(arm: _LoadedArm, ranges: Ranges, ways: Array, q: Array) -> Array:
    """Coordinates ``(g, n)`` that put the loaded end right, near those of the rigid arm.

    Raises:
        ReachError: naming the row for which there are none.
    """

    def left(q: Array, rows: np.ndarray) -> Array:
        return _projected(ways[rows], arm.errors(q, rows))

    corrected, size = damped_search(left, q, ranges.low, ranges.high, ranges.unit)
    corrected = arm.closed(corrected)
    lost = (size >= EXACT) | ~ranges.limits.kept(corrected)
    for k in np.flatnonzero(lost).tolist():
        starts = _around(q[k], ranges)

        def of_row(q: Array, _: np.ndarray, k: int = k) -> Array:
            return left(q, np.full(len(q), k))

        near, size = damped_search(of_row, starts, ranges.low, ranges.high, ranges.unit)
        near = arm.closed(near)
        good = (size < EXACT) & ranges.limits.kept(near)
        if not good.any():
            within, missed = ranges.limits.kept(near), "no posture near it keeps the limits of coupled joints"
            if within.any():
                best = near[within][int(np.argmin(size[within]))]
                away = arm.model.reach * float(np.linalg.norm(of_row(best[None], np.zeros(1))[0, :3]))
                missed = f"the nearest posture within the joints' limits that was found misses it by {away:.4g} mm"
            said = ""
            if not (arm.model.chain.riders or arm.model.chain.pushing):  # beyond a beam there is no posture
                free = ranges.without_limits()
                wide, wide_size = damped_search(of_row, starts, free.low, free.high, free.unit)
                said = least_beyond(ranges, wide[wide_size < EXACT])
            raise ReachError(
                f"row {k + 1} of the path: {arm.model.chain.name}: out of reach of the loaded arm: "
                f"{'; '.join(filter(None, (said, missed)))}"
            )
        apart = np.abs((near - q[k]) / ranges.unit).max(axis=1)
        corrected[k] = near[int(np.argmin(np.where(good, apart, np.inf)))]
    return corrected


def _around(q: Array, ranges: Ranges) -> Array:
    """Starts ``(s, n)`` about a posture ``(n,)``, further and further from it."""
    aside = np.random.default_rng(0).uniform(-1.0, 1.0, (len(AROUND), STARTS, len(q)))
    rows = q + np.array(AROUND)[:, None, None] * ranges.unit * aside
    return np.clip(np.vstack([q[None], rows.reshape(-1, len(q))]), ranges.low, ranges.high)


def _projected(ways: Array, error: Array) -> Array:
    """What of errors ``(s, 6)`` lies along orthonormal directions ``(s, 6, 6)``, in the units of those."""
    return np.einsum("gij,gj->gi", ways, error)


def _movable(arm: _LoadedArm, ranges: Ranges, q: Array, turns: bool) -> Array:
    """Projections ``(g, 6, 6)`` of errors on what the rigid arm's drives move: shifts over the reach, and turns.

    A stretched arm does not go outwards, and one beside it does: what joints move there counts too.
    """
    model = arm.model
    unit = np.repeat([1.0 / model.reach, 1.0], 3)
    shown = unit * (np.arange(6) < 3 if not turns else np.ones(6))
    aside = ranges.driven * ASIDE * ranges.unit * np.random.default_rng(0).choice([-1.0, 1.0], len(model.joints))
    result = np.zeros((len(q), 6, 6))
    # beyond an end of its beam a carriage has no posture
    beside = np.where((q + aside >= ranges.low) & (q + aside <= ranges.high), q + aside, q - aside)
    beside = np.clip(beside, ranges.low, ranges.high)
    for k, (J, J2) in enumerate(
        zip(*(_jacobian(arm, ranges, coordinates) for coordinates in (q, beside)), strict=True)
    ):
        U = span(shown[:, None] * J)
        other = span(shown[:, None] * J2)
        if other.shape[1] > U.shape[1]:
            missing, _, _ = np.linalg.svd(other - U @ (U.T @ other), full_matrices=False)
            U = np.hstack([U, missing[:, : other.shape[1] - U.shape[1]]])
        result[k] = U @ U.T * unit
    return result


def _jacobian(arm: _LoadedArm, ranges: Ranges, q: Array) -> Array:
    """Derivative ``(g, 6, n)`` of the unloaded end by what drives set, in units, by differences."""
    columns = []
    for i, shift in enumerate(STEP * np.diag(ranges.driven * ranges.unit)):
        high, low = (np.clip(q + sign * shift, ranges.low, ranges.high) for sign in (1.0, -1.0))
        (R1, p1), (R0, p0) = arm.unloaded(high), arm.unloaded(low)
        step = np.maximum((high - low)[:, i] / ranges.unit[i], STEP)
        columns.append(difference(p1, R1, p0, R0) / step[:, None])
    # beside its loops' reach a machine moves by no drive
    return np.nan_to_num(np.stack(columns, axis=2))


def compensate(
    machine: Machine,
    positions: Sequence[Sequence[float]] | Array,
    turns: Sequence[Sequence[float]] | Array | None = None,
    wrenches: Sequence[Sequence[float]] | Array | None = None,
    *,
    gravity: Gravity | None = None,
    posture: Posture = "",
    end: str = "",
    engine: VjmEngine | None = None,
) -> Compensation:
    """The coordinates of the driven joints along a path, by the rigid, the linear and the loaded model.

    Args:
        machine: of any kind; of one with poses the path counts from home.
        positions: ``(g, 3)`` of the end, mm, in the world.
        turns: rotation vectors ``(g, 3)`` rad; None where the end may turn as it likes.
        wrenches: ``(g, 6)`` on the end, N and N mm; nothing if left out.
        gravity: m/s².
        posture: near which the path begins; any if left out.
        end: name of the end frame; the first if left out.
        engine: how beams become springs; as `vjm` if left out.

    Raises:
        ValueError: arrays of another shape, a pose is out of reach, or the machine cannot be compensated.
        MechanismError: passive joints let its end move without straining a spring.
        NoConvergenceError: there is no stable equilibrium somewhere.

    Example:
        >>> import vjm
        >>> compensation = vjm.compensate(vjm.load("planar-2r"), [(600, 300, 0)], wrenches=[(0, -50, 0, 0, 0, 0)])
        >>> [f"{name} leaves {left:.3f} mm" for name, left in compensation.largest_mm.items()]
        ['rigid leaves 12.085 mm', 'linear leaves 0.109 mm', 'loaded leaves 0.000 mm']
    """
    check_machine(machine)
    if not held_by_itself(machine):
        raise MechanismError(
            f"{machine.name}: its passive joints leave the end a mechanism: give the whole machine instead"
        )
    p = _rows("positions", positions, 3)
    R = None if turns is None else _rows("turns", turns, 3, len(p))
    W = np.zeros((len(p), 6)) if wrenches is None else _rows("wrenches", wrenches, 6, len(p))
    label = ""
    if posture:
        machine, label = in_posture(machine, posture)
    if machine.poses:
        p, R = _from_home(machine, p, R)
    model = (engine or VjmEngine(*machine.usual_segments)).model(machine)
    compensation = compensated_arm(
        model, p, None if R is None else rotations_from_vectors(R), W, gravity=gravity,
        start=model.posture(label) if label else None, end=end,
    )  # fmt: skip
    driven = {part.name for part in machine.held_joints}
    shown = [k for k, name in enumerate(compensation.joints) if name in driven]
    return replace(
        compensation,
        joints=tuple(compensation.joints[k] for k in shown),
        q=compensation.q[:, shown],
        q_linear=compensation.q_linear[:, shown],
        q_loaded=compensation.q_loaded[:, shown],
    )


def _rows(name: str, rows: Sequence[Sequence[float]] | Array, columns: int, count: int | None = None) -> Array:
    """Rows of finite numbers.

    Raises:
        ValueError: they are none, or others.
    """
    try:
        values = np.array(rows, dtype=float)
    except (TypeError, ValueError):
        values = np.zeros(0)
    wanted = ("g" if count is None else count, columns)
    if values.ndim != 2 or values.shape[1] != columns or count not in (None, len(values)) or not len(values):
        raise ValueError(f"{name} must have the shape ({wanted[0]}, {wanted[1]}), one row a pose")
    if not np.all(np.isfinite(values)):
        raise ValueError(f"{name} must be finite numbers")
    return values


def _from_home(machine: Machine, positions: Array, turns: Array | None) -> tuple[Array, Array | None]:
    """The path in the world, whose poses count from home."""
    home = LoopClosure(machine, home_label(machine)).end
    vectors = np.zeros_like(positions) if turns is None else turns
    frames = np.array([displaced(home, pose) for pose in np.hstack([positions, vectors])])
    # what cannot keep its direction turns as its loops let it
    keeps = turns is not None or len(machine.held_joints) >= 6
    return frames[:, :3, 3], np.array([rotation_vector(T[:3, :3]) for T in frames]) if keeps else None
