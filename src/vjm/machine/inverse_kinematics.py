"""Postures of a machine that put an end frame where it is wanted, without load and within the joints' limits.

Damped least squares within bounds, for many starts at once (Levenberg and Marquardt's method).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vjm.machine.equilibria import unloaded_frames
from vjm.machine.rigid_mechanism import LoopClosure, PoseError
from vjm.model.joint_limits import JointLimits, own_limits
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array, displacement_between, frame, rotation_vectors

ITERATIONS = 100
STEP = 1e-6
"""Of a coordinate's unit: of the differences that make the Jacobian, good to 1e-10."""
LARGEST_MOVE = 0.4
"""Of a unit, in one iteration: within it a rotation's sine and its angle are alike."""
SETTLED = 1e-14
"""Residual that is rounding."""
DAMPING, SOFTER, HARDER = 1e-3, 0.1, 30.0
"""Times the square of the residual; and its factors after a step that was taken, and one that was not."""
FLOOR = 1e-7
"""Of the largest singular value, and at least of one: smaller ones are rounding, a thousand times what differences
of J are good to, and lead nowhere."""
DOUBLE, LIKE = 0.25, 0.05
"""What Newton's step leaves of the residual at a double root, within what: each step goes half the way there."""
REFUSED = 12
"""Steps in a row that were not taken, after which a start rests: the damping is 1e17 times as large then."""
CLOSE = 1e-8
"""Residual below which steps are doubled: of two roots apart by more than 1e-4, its square root, none is passed."""
IDLE = 1e-9
"""Share of the residual that a step takes away, below which a start rests: there it is least, and not zero."""

Residual = Callable[[Array, np.ndarray], Array]
"""Of rows ``(s, n)`` and the numbers ``(s,)`` of their starts: ``(s, m)``, nan where there is none."""


def damped_search(residual: Residual, q: Array, low: Array, high: Array, unit: Array) -> tuple[Array, Array]:
    """Coordinates of the least residual near each start, within bounds.

    Args:
        residual: dimensionless, of size 1 for a change of a unit.
        q: starts ``(s, n)``.
        low: bounds ``(n,)``.
        high: likewise.
        unit: of the coordinates ``(n,)``.

    Returns:
        Coordinates ``(s, n)`` and the sizes of their residuals ``(s,)``, inf where it is not defined at the start.

    Example:
        >>> ones = np.ones(1)
        >>> q, left = damped_search(lambda q, at: q**2 - 2.0, np.array([[1.0]]), 0 * ones, 9 * ones, ones)
        >>> float(q[0, 0])
        1.4142135623730951
    """
    q = np.clip(q, low, high)
    everyone = np.arange(len(q))
    r = residual(q, everyone)
    size = _sizes(r)
    damping, refused = np.full(len(q), DAMPING), np.zeros(len(q), dtype=int)
    factor = np.ones(len(q))
    J = np.zeros((len(q), r.shape[1], q.shape[1]))
    stale = np.ones(len(q), dtype=bool)
    for _ in range(ITERATIONS):
        active = np.flatnonzero((size > SETTLED) & np.isfinite(size) & (refused < REFUSED))
        if not len(active):
            break
        new = active[stale[active]]
        if len(new):
            J[new] = _jacobian(residual, r[new], new, (q[new], low, high), unit)
            stale[new] = False
        move = _moves(J[active], r[active], size[active], damping[active], (q[active], low, high))
        trial = np.clip(q[active] + factor[active, None] * move * unit, low, high)
        after = residual(trial, active)
        smaller = _sizes(after) < size[active]
        good, bad = active[smaller], active[~smaller & (factor[active] == 1.0)]
        gained = 1.0 - _sizes(after)[smaller] / size[good]
        halved = np.zeros(len(q), dtype=bool)
        halved[good] = (np.abs(1.0 - gained - DOUBLE) < LIKE) & (factor[good] == 1.0)
        q[good], r[good], size[good] = trial[smaller], after[smaller], _sizes(after)[smaller]
        factor[active] = np.where(halved[active] & (size[active] < CLOSE), 2.0, 1.0)
        stale[good], refused[good] = True, np.where(gained > IDLE, 0, REFUSED)
        refused[bad] += 1
        damping[good] = np.maximum(SOFTER * damping[good], DAMPING)
        damping[bad] *= HARDER
    return q, size


def _sizes(r: Array) -> Array:
    size = np.linalg.norm(r, axis=1)
    return np.where(np.isfinite(size), size, np.inf)


def _moves(
    J: Array, r: Array, size: Array, damping: Array, place: tuple[Array, Array, Array]
) -> Array:  # fmt: skip
    """Damped steps ``(s, n)`` in units; a coordinate at a bound that it is pushed against stays."""
    q, low, high = place
    down = -np.einsum("smn,sm->sn", J, r)
    held = ((q <= low) & (down < 0.0)) | ((q >= high) & (down > 0.0))
    J = np.where(held[:, None, :], 0.0, J)
    # by singular values: J Jᵀ is singular where J has less rank than rows, however small the damping is
    U, values, V = np.linalg.svd(J, full_matrices=False)
    shares = values / (values**2 + (damping * size**2)[:, None] + (FLOOR * np.maximum(values[:, :1], 1.0)) ** 2)
    move: Array = -np.einsum("skn,sk->sn", V, shares * np.einsum("smk,sm->sk", U, r))
    move *= np.minimum(1.0, LARGEST_MOVE / np.maximum(np.abs(move).max(axis=1, initial=0.0), 1e-300))[:, None]
    return move


def _jacobian(
    residual: Residual, r: Array, starts: np.ndarray, place: tuple[Array, Array, Array], unit: Array
) -> Array:
    """Derivative ``(s, m, n)`` by coordinates in their units, by differences; zero where there is none.

    At a bound they are one-sided, of second order too: beyond an end of its beam a carriage has no posture.
    """
    q, low, high = place
    s, n = q.shape
    h = STEP * unit
    side = np.where(q + h > high, -1.0, np.where(q - h < low, 1.0, 0.0))
    first, second = np.where(side, side, 1.0), np.where(side, 2.0 * side, -1.0)
    shifts = np.stack([first, second], axis=1)[..., None] * (np.eye(n) * h)
    rows = np.clip(q[:, None, None] + shifts, low, high).reshape(-1, n)
    near, far = np.moveaxis(residual(rows, np.repeat(starts, 2 * n)).reshape(s, 2, n, -1), 1, 0)
    inward = side[..., None] * (4.0 * near - far - 3.0 * r[:, None])
    J: Array = np.where(side[..., None], inward, near - far).swapaxes(1, 2) / (2.0 * STEP)
    return np.nan_to_num(J)


STARTS = 128
"""Random postures from which all solutions are looked for: a 6R arm has up to 16."""
DRAWN, NEAREST = 4096, 16
"""Random postures, and the number of them nearest to a pose, from which a path goes on where it lost its branch."""
FOUND = 1e-9
"""Of the machine's reach and in rad: the residual of the pose at a solution."""
ALIKE = 1e-5
"""rad, or of the reach, up to which two solutions are one."""
BLURRED = FOUND ** (1.0 / 3.0)
"""Likewise, up to which two are one where what lies between them is a solution too: at a threefold root the
residual is the cube of the way from it."""
MOST = 16
"""Solutions that are listed; a machine of more joints than the pose has conditions has endless ones."""


class ReachError(ValueError):
    """No posture puts the end frame there; the message says how near one comes, or which limit is in the way."""


@dataclass(frozen=True)
class Ranges:
    """Where postures are looked for.

    Attributes:
        low: lower bounds of the joints ``(n,)``, mm or rad; for passive ones, which nothing sets, their coordinate.
        high: upper ones.
        unit: of each: 1 rad, or the machine's reach in mm.
        turns: which of them turn.
        limits: of all joints, coupled ones too.
    """

    low: Array
    high: Array
    unit: Array
    turns: np.ndarray
    limits: JointLimits

    @property
    def driven(self) -> np.ndarray:
        """Which joints ``(n,)`` a drive sets: not the passive ones."""
        return np.asarray(self.high > self.low)

    def random(self, count: int, seed: int) -> Array:
        """Postures ``(count, n)``, the first one with every joint as near to zero as it goes."""
        q = self.low + (self.high - self.low) * np.random.default_rng(seed).random((count, len(self.low)))
        q[0] = np.clip(0.0, self.low, self.high)
        return q

    def following(self) -> Ranges:
        """The same where passive joints follow from closed loops, wherever these lead them."""
        wide = np.where(self.driven, 0.0, np.where(self.turns, 2.0 * np.pi, self.unit))
        return Ranges(self.low - wide, self.high + wide, self.unit, self.turns, self.limits)

    def without_limits(self) -> Ranges:
        """Joints that turn a whole turn either way of the middle of their limits, and slide as far as the reach."""
        middle = 0.5 * (self.low + self.high)
        wide = np.maximum(np.where(self.turns, 2.0 * np.pi, self.unit), 0.5 * (self.high - self.low))
        wide = np.where(self.driven, wide, 0.0)
        return Ranges(middle - wide, middle + wide, self.unit, self.turns, self.limits)


def ranges_of(model: Mechanism, held: Array | None = None) -> Ranges:
    """The ranges that the joints' limits leave; half a turn either way, and the reach, where there are none.

    Args:
        model: the machine.
        held: coordinates ``(n,)`` of a posture that passive joints keep, free or sprung; None for those of the
            machine's first posture, or zero where it has none.
    """
    if held is None:
        label = next(iter(model.chain.postures), None)
        held = np.zeros(len(model.joints)) if label is None else model.posture(label)
    joints = {joint.name: joint for joint in model.chain.moving}
    limits, beams, pushing = model.limits, {beam.name: beam for beam in model.chain.beams}, model.chain.pushing
    low, high, unit, turns = [], [], [], []
    for name, value in zip(model.joints, held, strict=True):
        part = joints[name]
        own = (value, value) if part.passive else own_limits(part, beams, pushing)
        reach = model.reach if part.slides else np.pi
        low.append(own[0] if np.isfinite(own[0]) else -reach)
        high.append(own[1] if np.isfinite(own[1]) else reach)
        unit.append(model.reach if part.slides else 1.0)
        turns.append(not part.slides)
    return Ranges(np.array(low), np.array(high), np.array(unit), np.array(turns, dtype=bool), limits)


def end_index(model: Mechanism, end: str) -> int:
    """Number of an end frame; the first where the name is empty.

    Raises:
        ValueError: there is no such end frame.
    """
    if end and end not in model.ends:
        raise ValueError(f"{model.chain.name}: no end frame '{end}'; it has {', '.join(model.ends)}")
    return model.ends.index(end) if end else 0


def postures_of(
    model: Mechanism, position: Array, rotation: Array | None = None, end: str = "", seed: int = 0
) -> list[Array]:
    """Joint coordinates that put an end frame at a pose, by damped least squares from many random postures.

    Passive joints keep the coordinates of the machine's first posture, see `ranges_of`. Those of a machine with
    closed loops follow from its pose: it has one solution, on the branch of that posture, see `ClosedPostures`.

    Args:
        model: the machine.
        position: ``(3,)`` wanted, mm, world.
        rotation: ``(3, 3)`` wanted; None where the end may turn as it likes.
        end: name of the end frame; the first where it is empty.
        seed: of the random postures.

    Returns:
        Up to `MOST` solutions ``(n_joints,)``, those of the smallest coordinates first.

    Raises:
        ReachError: none was found; with the distance of the nearest, or the limits that are in the way.
        ValueError: there is no such end frame.

    Example:
        >>> import vjm
        >>> model = Mechanism(vjm.load("planar-2r").split())
        >>> [q.round(3).tolist() for q in postures_of(model, np.array([600.0, 300.0, 0.0]))]
        [[-0.171, 1.471], [1.099, -1.471]]
    """
    if model.chain.closes:
        return [ClosedPostures(model, None, end).at_pose(position, rotation)]
    ranges, index = ranges_of(model), end_index(model, end)
    return _postures(model, ranges, position, rotation, index, ranges.random(STARTS, seed))


def _postures(
    model: Mechanism, ranges: Ranges, position: Array, rotation: Array | None, index: int, starts: Array
) -> list[Array]:
    q, lost = _searched(model, ranges, position, rotation, index, starts)
    good = (np.linalg.norm(lost, axis=1) < FOUND) & ranges.limits.kept(q)
    if not good.any():
        within = lost[ranges.limits.kept(q)]
        raise ReachError(_why_not(model, ranges, position, rotation, index, starts, within))

    def solves(rows: Array) -> np.ndarray:
        R, p = unloaded_frames(model, rows)
        left = _left(model, p[:, index], R[:, index], position, rotation)
        return np.asarray(np.linalg.norm(left, axis=1) < FOUND)

    # the most exact ones first: at a singular posture others come near it only
    order = np.argsort(np.linalg.norm(lost[good], axis=1), kind="stable")
    return _distinct(q[good][order], ranges, solves)


def followed(
    model: Mechanism, positions: Array, rotations: Array | None, start: Array | None, end: str = ""
) -> tuple[Array, list[str]]:
    """Coordinates of a path of poses, each near those before it, so that the arm keeps its branch where it can.

    Args:
        model: the machine.
        positions: ``(g, 3)`` wanted, mm, world.
        rotations: ``(g, 3, 3)`` wanted; None where the end may turn as it likes.
        start: coordinates ``(n,)`` near which the path begins, and which passive joints keep; None for the
            smallest, and see `ranges_of`.
        end: name of the end frame; the first where it is empty.

    Returns:
        Coordinates ``(g, n)``, nan where there are none, and why there are none, empty where there are.

    Raises:
        ValueError: there is no such end frame.
    """
    if model.chain.closes:
        return _closed_path(model, positions, rotations, start, end)
    ranges, index = ranges_of(model, start), end_index(model, end)
    drawn = ranges.random(DRAWN, 0)
    R, p = unloaded_frames(model, drawn)
    before = None if start is None else np.clip(start, ranges.low, ranges.high)
    rows, why = np.full((len(positions), len(ranges.low)), np.nan), [""] * len(positions)
    for k, position in enumerate(positions):
        rotation = None if rotations is None else rotations[k]
        if before is not None:
            q, lost = _searched(model, ranges, position, rotation, index, before[None])
            if np.linalg.norm(lost[0]) < FOUND and ranges.limits.kept(q)[0]:
                rows[k] = before = q[0]
                continue
        away = np.linalg.norm(_left(model, p[:, index], R[:, index], position, rotation), axis=1)
        try:
            starts = drawn[np.argsort(away)[:NEAREST]]
            solutions = _postures(model, ranges, position, rotation, index, starts)
        except ReachError as error:
            why[k] = str(error)
            continue
        far = [0.0 if before is None else float(np.abs((q - before) / ranges.unit).max()) for q in solutions]
        rows[k] = before = solutions[int(np.argmin(far))]
    return rows, why


class ClosedPostures:
    """Postures of a machine with closed loops, on the branch of one of them.

    Attributes:
        closing: the rigid machine with its loops.
    """

    def __init__(self, model: Mechanism, start: Array | None, end: str = "") -> None:
        """Take a machine.

        Args:
            model: the machine.
            start: coordinates ``(n_joints,)`` of the posture; None for the machine's first.
            end: name of the end frame.

        Raises:
            ValueError: the end frame is not the end-effector, or the loops do not close in the posture.
        """
        self._model, chain = model, model.chain
        if chain.ends and chain.ends[model.ends[end_index(model, end)]] != chain.parts[-1].name:
            raise ValueError(
                f"{chain.name}: its loops are closed by the pose of its last part, '{chain.parts[-1].name}': ask "
                "for the end frame behind that"
            )
        q = model.posture(next(iter(chain.postures))) if start is None else start
        self._home = dict(zip(model.joints, q.tolist(), strict=True))
        self.closing = LoopClosure(chain, self._home)

    def at_pose(self, position: Array, rotation: Array | None) -> Array:
        """Coordinates ``(n_joints,)`` with the end-effector at a pose.

        Args:
            position: ``(3,)`` mm, world.
            rotation: ``(3, 3)``; None where the end-effector may turn as the loops let it.

        Raises:
            ReachError: it does not come there.
        """
        home = self.closing.end
        way = displacement_between(home, frame(home[:3, :3] if rotation is None else rotation, position))
        try:
            return self.closing.displaced(way, (True,) * 3 + (rotation is not None,) * 3)
        except PoseError as error:
            raise ReachError(str(error)) from None

    def driven(self, values: Mapping[str, float]) -> Array:
        """Coordinates ``(n_joints,)`` with some joints elsewhere, by name, mm or rad; passive ones follow.

        Raises:
            ReachError: the loops do not close there.
        """
        held = [part.name for part in self._model.chain.held_joints]
        try:
            return self.closing.held({name: values.get(name, self._home[name]) for name in held})
        except PoseError as error:
            raise ReachError(str(error)) from None


def _closed_path(
    model: Mechanism, positions: Array, rotations: Array | None, start: Array | None, end: str
) -> tuple[Array, list[str]]:
    """See `followed`; of a machine with closed loops."""
    closed = ClosedPostures(model, start, end)
    rows, why = np.full((len(positions), len(model.joints)), np.nan), [""] * len(positions)
    for k, position in enumerate(positions):
        try:
            rows[k] = closed.at_pose(position, None if rotations is None else rotations[k])
        except ReachError as error:
            why[k] = str(error)
    return rows, why


def difference(p: Array, R: Array, wanted_p: Array, wanted_R: Array) -> Array:
    """Errors ``(g, 6)`` of frames: shift, and rotation vector from the wanted ones, world axes."""
    # at half a turn any axis is a way out
    turned = np.nan_to_num(rotation_vectors(R @ np.swapaxes(wanted_R, 1, 2)))
    return np.hstack([p - wanted_p, turned])


def _searched(
    model: Mechanism, ranges: Ranges, position: Array, rotation: Array | None, index: int, starts: Array
) -> tuple[Array, Array]:
    """Postures ``(s, n)`` nearest to the pose, and the residual: shift over the reach, and rotation vector."""

    def left(q: Array, _: np.ndarray) -> Array:
        R, p = unloaded_frames(model, q)
        return _left(model, p[:, index], R[:, index], position, rotation)

    q, _ = damped_search(left, starts, ranges.low, ranges.high, ranges.unit)
    return q, left(q, np.arange(len(q)))


def _left(model: Mechanism, p: Array, R: Array, position: Array, rotation: Array | None) -> Array:
    """Residual of a pose ``(s, 3 or 6)``: shift over the reach, and rotation vector where one is wanted."""
    if rotation is None:
        return (p - position) / model.reach
    return difference(p, R, position, rotation[None]) / np.repeat([model.reach, 1.0], 3)


def _why_not(
    model: Mechanism,
    ranges: Ranges,
    position: Array,
    rotation: Array | None,
    index: int,
    starts: Array,
    lost: Array,
) -> str:
    """Which joints would have to go beyond their limits, and how near a posture comes that keeps all of them.

    ``lost`` is what postures within all limits, coupled ones too, leave of the pose.
    """
    if not ranges.driven.any():
        return (
            f"{model.chain.name}: out of reach: no joint of it is driven. Its springs hold it: for another place "
            "give other free lengths"
        )
    free = ranges.without_limits()
    q, left = _searched(model, free, position, rotation, index, starts)
    said = least_beyond(ranges, q[np.linalg.norm(left, axis=1) < FOUND])
    return f"{model.chain.name}: out of reach: {'; '.join(filter(None, (said, _missed(model, lost))))}"


def _missed(model: Mechanism, lost: Array) -> str:
    """How near the best of some postures comes; that there is none where none keeps the limits."""
    if not len(lost):
        return "no posture near it keeps the limits of coupled joints"
    nearest = lost[np.argmin(np.linalg.norm(lost, axis=1))]
    text = f"{np.linalg.norm(nearest[:3]) * model.reach:.4g} mm"
    if len(nearest) > 3:
        text += f" and {np.degrees(np.linalg.norm(nearest[3:])):.4g} degrees"
    return f"the nearest posture within the joints' limits that was found misses it by {text}"


def least_beyond(ranges: Ranges, q: Array) -> str:
    """What is said of the one of postures ``(s, n)`` that goes least beyond the limits; empty for none."""
    if not len(q):
        return ""
    middle = 0.5 * (ranges.low + ranges.high)
    turn = 2.0 * np.pi
    q = np.where(ranges.turns, q - turn * np.round((q - middle) / turn), q)
    size = np.where([unit == "mm" for unit in ranges.limits.units], ranges.unit.max(), 1.0)
    beyond = np.maximum(ranges.limits.excess(q), 0.0) / size
    return ranges.limits.said(q[int(np.argmin(beyond.sum(axis=1)))])


def _distinct(q: Array, ranges: Ranges, solves: Callable[[Array], np.ndarray]) -> list[Array]:
    """Different solutions of ``(s, n)``, the smallest coordinates first; what turns is brought to ±π within limits.

    Of those that are one the first is kept; ``solves`` tells those that a singular one blurs.
    """
    wrapped = np.where(ranges.turns, q - 2.0 * np.pi * np.round(q / (2.0 * np.pi)), q)
    inside = np.where((wrapped >= ranges.low) & (wrapped <= ranges.high), wrapped, q)
    # a whole turn of one joint may be more than one of those coupled to it
    q = np.where(ranges.limits.kept(inside)[:, None], inside, q)
    solutions: list[Array] = []
    for row in q:
        apart = [float(np.abs((row - other) / ranges.unit).max()) for other in solutions]
        if any(way <= ALIKE for way in apart):
            continue
        near = [other for other, way in zip(solutions, apart, strict=True) if way <= BLURRED]
        if not (near and solves(0.5 * (row + np.array(near))).any()):
            solutions.append(row)

    def smallness(row: Array) -> tuple[int, int, tuple[float, ...]]:
        # of equals, such as two elbows, those that turn the last joints forwards: not what rounding says
        size = np.abs(row / ranges.unit)
        return round(float(size.max()) / ALIKE), round(float(size.sum()) / ALIKE), tuple(-row[::-1])

    return sorted(solutions, key=smallness)[:MOST]
