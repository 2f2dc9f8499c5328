"""Closing the loops of a rigid machine: inverse and forward kinematics, and mobility by rank.

With some coordinates given, or the pose of the end-effector, the other coordinates follow by Newton's method, along
a straight way from home, on which the machine keeps its branch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from vjm.machine.rigid_tree import RigidTree, difference
from vjm.model.chain import Chain
from vjm.model.joint_limits import joint_limits
from vjm.model.load_case import COMPONENTS
from vjm.rotations import Array, displaced

CLOSED = 1e-11
"""Gap over the machine's length at which loops are closed: some hundred times rounding."""
ITERATIONS = 12
LARGEST_TURN = 0.3
"""rad by which a passive joint may turn, or lengths by which it may slide, in one step of the way from home."""
SMALLEST_STEP = 1e-3
"""Share of the way from home below which a pose counts as out of reach."""
SINGULAR = 1e-6
"""Singular value over the largest below which a motion or a constraint is lost."""
HOME_GAP = 0.05
"""Gap over the machine's length up to which a posture of a file is taken to be rounded."""
NEGLIGIBLE = 1e-9
"""Singular value over the largest that Newton's step leaves out: what redundant constraints leave to rounding."""


_Step: TypeAlias = Callable[[Array, float], tuple[Array, float]]
"""Coordinates closed at a share of a way, and what is left open, from coordinates nearby."""


class PoseError(ValueError):
    """A pose that the rigid machine cannot take; the message says why."""


@dataclass(frozen=True)
class Mobility:
    """What a rigid machine can do in a posture.

    Attributes:
        freedom: independent motions of the end-effector with the drives free.
        loose: motions ``(6, k)`` of the end-effector with the drives held, world axes, lengths over the machine's.
        idle: names of the passive joints of each group that moves with end-effector and drives at rest.
        idle_freedom: number of those motions.
        redundant: constraints beyond those that are needed: that many self-stresses are possible.
    """

    freedom: int
    loose: Array
    idle: tuple[tuple[str, ...], ...]
    idle_freedom: int
    redundant: int


class Closing:
    """The rigid machine with its loops, in any posture.

    Attributes:
        tree: its joints and closures.
        home: coordinates ``(n,)`` at home, closed.
        end: frame ``(4, 4)`` of the end-effector at home.
    """

    def __init__(self, machine: Chain, home: str | Mapping[str, float], end: Array | None = None) -> None:
        """Close the machine at home.

        Args:
            machine: with closures or without.
            home: a label of its postures, or coordinates by the joints' names, mm or rad; may be rounded.
            end: frame ``(4, 4)`` of the end-effector at home, mm, where it is known better.

        Raises:
            PoseError: the loops do not close there.
        """
        self.machine = machine
        self.tree = RigidTree(machine)
        self._six = np.repeat([self.tree.length, 1.0], 3)
        q = self.tree.posture(home) if isinstance(home, str) else self.tree.coordinates(home)
        self.end = self.tree.end_motion(self.tree.state(q[None]))[0][0]
        self._refuse_open(q, HOME_GAP, "at home")
        # a rounded file: drives stand where it has them, where the loops close so
        nothing, wanted = np.zeros(len(q), dtype=bool), None if end is None else end[None]
        there, left = self.solve(q[None], ~self.tree.passive if end is None else nothing, wanted)
        if not left[0] < CLOSED:
            there, left = self.solve(q[None], nothing, wanted)
            if not left[0] < CLOSED:
                self._refuse_open(there[0], CLOSED, "at home")
                stands = self.tree.end_motion(self.tree.state(there))[0]
                missed = self._said(difference(stands, stands if end is None else end[None])[0] / self._six)
                raise PoseError(
                    f"{machine.name}: with its loops closed at home the end-effector stays {missed} from its "
                    f"place; check that place, and the coordinates at home"
                )
        self.home = there[0]
        self.end = self.tree.end_motion(self.tree.state(there))[0][0]

    def solve(
        self,
        q: Array,
        fixed: np.ndarray,
        wanted: Array | None = None,
        components: Sequence[bool] | np.ndarray = (True,) * 6,
    ) -> tuple[Array, Array]:
        """Newton's method from coordinates ``(g, n)`` nearby, for all g at once.

        Args:
            q: to start from.
            fixed: ``(n,)`` which coordinates stay.
            wanted: frames ``(g, 4, 4)`` of the end-effector; None: it is free.
            components: of the end-effector's pose that are wanted, world axes: x, y, z, and turns.

        Returns:
            Closed coordinates ``(g, n)`` and the largest gap ``(g,)`` that is left of each.
        """
        tree, q = self.tree, q.copy()
        free, rows = ~fixed, np.asarray(components, dtype=bool)
        left = np.full(len(q), np.inf)
        active = np.arange(len(q))
        for iteration in range(ITERATIONS + 1):
            state = tree.state(q[active])
            gap, J = tree.closing(q[active], state)
            if wanted is not None:
                end, J_end = tree.end_motion(state)
                miss = difference(wanted[active], end) / self._six
                gap = np.concatenate([gap, miss[:, rows]], axis=1)
                J = np.concatenate([J, J_end[:, rows]], axis=1)
            size = np.abs(gap).max(axis=1, initial=0.0)
            left[active] = size
            going = np.isfinite(size) & (size >= CLOSED)
            active, gap, J = active[going], gap[going], J[going]
            if not len(active) or iteration == ITERATIONS:
                break
            step = -least_norm(J[:, :, free], gap)
            largest = np.abs(step).max(axis=1, initial=1e-300)
            step *= np.minimum(1.0, 0.5 / largest)[:, None]
            q[np.ix_(active, np.flatnonzero(free))] += step * tree.unit[free]
        return q, left

    def displaced(self, displacement: Array, components: Sequence[bool] = (True,) * 6) -> Array:
        """Coordinates ``(n,)`` with the end-effector displaced from home.

        Args:
            displacement: ``(6,)`` mm, rad, from home.
            components: of the pose that are wanted; the others follow, as they are nearest.

        Raises:
            PoseError: out of reach, on another branch, singular, or beyond a joint's limits.
        """
        way = np.asarray(displacement, dtype=float)
        rows = np.asarray(components, dtype=bool)
        # what has fewer freedoms takes only some poses: its way leads over those that are near the straight one
        freedom, asked = self._freedom(self.home).shape[1], int(np.count_nonzero(rows))
        bound = freedom < asked
        nothing = np.zeros(len(self.home), dtype=bool)
        where = _words(way)

        def closed(q: Array, to: float) -> tuple[Array, float]:
            aim = displaced(self.end, to * way)[None]
            there, left = self.solve(q[None], nothing, aim, rows)
            if bound and to < 1.0:
                there, left = self.solve(there, nothing)
            return there[0], float(left[0])

        try:
            q = self._followed(closed, where, watch=True)
        except PoseError as error:
            if not bound or not freedom:
                raise
            raise PoseError(
                f"{error}; the end-effector has {freedom} {'freedom' if freedom == 1 else 'freedoms'}, and takes "
                f"only some of the poses by {asked} components: give the drives' coordinates"
            ) from error
        self.refuse_unfit(q)
        return q

    def held(self, values: Mapping[str, float]) -> Array:
        """Coordinates ``(n,)`` with the held joints at coordinates by name, mm or rad; passive joints follow.

        Raises:
            ValueError: other joints than the held ones are given.
            PoseError: out of reach, or beyond a joint's limits.
        """
        names = [name for name, passive in zip(self.tree.names, self.tree.passive, strict=True) if not passive]
        other = sorted(set(values) ^ set(names))
        if other:
            what = "no coordinate for" if other[0] in names else "there is no held joint"
            raise ValueError(
                f"{self.machine.name}: {what} '{other[0]}'; held joints are {', '.join(names) or 'none'}"
            )
        goal = self.home.copy()
        for name, value in values.items():
            goal[self.tree.names.index(name)] = value
        fixed = ~self.tree.passive

        def closed(q: Array, to: float) -> tuple[Array, float]:
            start = q.copy()
            start[fixed] = (1.0 - to) * self.home[fixed] + to * goal[fixed]
            there, left = self.solve(start[None], fixed)
            return there[0], float(left[0])

        q = self._followed(closed, ", ".join(f"{k}={v:g}" for k, v in values.items()), watch=False)
        self._refuse_beyond_limits(q)
        return q

    def _followed(self, closed: _Step, where: str, *, watch: bool) -> Array:
        """Go from home to the end of a way, in steps that keep the branch.

        Raises:
            PoseError: the way ends before.
        """
        tree, q = self.tree, self.home
        basis = self._freedom(q)
        before = self._rates(q, basis) if watch else None
        done, step = 0.0, 1.0
        while done < 1.0:
            to = min(1.0, done + step)
            there, left = closed(q, to)
            moved = np.abs((there - q) / tree.unit)[tree.passive].max(initial=0.0)
            if left < CLOSED and moved <= LARGEST_TURN:
                # the free motions turn along the way, where there are fewer than six
                basis = _aligned(self._freedom(there), basis) if watch else basis
                answers = self._rates(there, basis) if watch else None
                if _turned_back(before, answers):
                    raise PoseError(
                        f"{self.machine.name}: the pose {where} lies on another branch: between {done:.0%} and "
                        f"{to:.0%} of the way from home the machine passes a singularity"
                    )
                q, done, step, before = there, to, 2.0 * (to - done), answers
                continue
            step = 0.5 * (to - done)
            if step < SMALLEST_STEP:
                raise PoseError(self._out_of_reach(there, left, where, done))
        return q

    def _gaps(self, q: Array) -> tuple[str, Array]:
        """The closure that is open the most, and its gap: lengths over the machine's, rad."""
        gap = self.tree.closing(q[None])[0][0]
        if not len(gap):
            return "", gap
        worst = self.tree.row_names[int(np.nanargmax(np.abs(gap)))]
        return worst, gap[[name == worst for name in self.tree.row_names]]

    def _refuse_open(self, q: Array, allowed: float, where: str) -> None:
        worst, gap = self._gaps(q)
        if np.all(np.abs(gap) <= allowed):
            return
        raise PoseError(
            f"{self.machine.name}: closure '{worst}' does not close {where}: its frames are {self._said(gap)} "
            f"apart; check its frames, and the posture's coordinates and branch"
        )

    def _said(self, gap: Array) -> str:
        shift = f"{np.linalg.norm(gap[:3]) * self.tree.length:.4g} mm"
        if len(gap) == 6:
            return f"{shift} and {np.linalg.norm(gap[3:]):.4g} rad"
        return shift if len(gap) == 3 else f"{abs(gap[0]):.4g} of its total"

    def _out_of_reach(self, q: Array, left: float, where: str, done: float) -> str:
        name = self.machine.name
        worst, gap = self._gaps(q)
        if left < 1e-6:
            return (
                f"{name}: the pose {where} is out of reach on the branch of home: closure '{worst}' passes a dead "
                f"point at {done:.0%} of the way"
            )
        if np.any(self.tree.passive) and not np.any(~self.tree.passive):
            return (
                f"{name}: the pose {where} is out of reach: nothing drives it, and its passive joints do not let "
                f"the end-effector come there; give it drives, or take the pose at home"
            )
        short = f"closure '{worst}' stays {self._said(gap)} open" if len(gap) else "the end-effector stays short"
        return f"{name}: the pose {where} is out of reach: {short} (the way from home ends at {done:.0%})"

    def refuse_unfit(self, q: Array) -> None:
        """Refuse coordinates ``(n,)`` that are singular or beyond limits.

        Raises:
            PoseError: saying how the end-effector is loose, or which joints are beyond.
        """
        self._refuse_singular(q)
        self._refuse_beyond_limits(q)

    def _refuse_beyond_limits(self, q: Array) -> None:
        said = joint_limits(self.machine, self.tree.names).said(q)
        if said:
            raise PoseError(f"{self.machine.name}: out of reach: {said}")

    def _refuse_singular(self, q: Array) -> None:
        found = self.mobility(q)
        loose = found.loose
        if loose.shape[1] <= max(0, found.freedom - int(np.count_nonzero(~self.tree.passive))):
            # what has fewer drives than freedoms is loose by its nature
            return
        said = [f"{c} {v:.2g}" for c, v in zip(COMPONENTS, loose[:, 0], strict=True) if abs(v) > 0.05]
        raise PoseError(
            f"{self.machine.name}: the pose is singular: with all drives held the end-effector still moves by "
            f"({', '.join(said)}; turns in rad, shifts over {self.tree.length:g} mm)"
        )

    def _derivatives(self, q: Array) -> tuple[Array, Array]:
        """Derivatives ``(r, n)`` of the gaps and ``(6, n)`` of the end-effector."""
        state = self.tree.state(q[None])
        return self.tree.closing(q[None], state)[1][0], self.tree.end_motion(state)[1][0]

    def _freedom(self, q: Array) -> Array:
        """Orthonormal motions ``(6, f)`` of the end-effector with the drives free."""
        J, end = self._derivatives(q)
        return _span(end @ _null(J))

    def _rates(self, q: Array, basis: Array) -> Array | None:
        """Drives' motions by the end-effector's in a ``basis`` (6, f); None where they do not match one to one."""
        J, end = self._derivatives(q)
        free = _null(J)
        drive, moved = free[~self.tree.passive], basis.T @ end @ free
        if not 0 < drive.shape[0] == drive.shape[1] == basis.shape[1]:
            return None
        result: Array = np.linalg.solve(moved.T, drive.T).T
        return result

    def mobility(self, q: Array) -> Mobility:
        """Freedom, idle motions and redundant constraints at coordinates ``(n,)``, by rank."""
        J, end = self._derivatives(q)
        passive = self.tree.passive
        free, held = _null(J), _null(J[:, passive])
        idle = _null(np.vstack([J, end])[:, passive])
        names = [name for name, is_passive in zip(self.tree.names, passive, strict=True) if is_passive]
        return Mobility(
            freedom=_span(end @ free).shape[1],
            loose=_span(end[:, passive] @ held),
            idle=_groups(names, idle),
            idle_freedom=idle.shape[1],
            redundant=int(len(J) - (J.shape[1] - free.shape[1])),
        )

    def posture(self, q: Array) -> tuple[Array, dict[str, float]]:
        """Passive coordinates ``(n_q,)``, and held ones by name, of coordinates ``(n,)``; mm and rad."""
        passive = self.tree.passive
        values = zip(self.tree.names, q.tolist(), passive, strict=True)
        return q[passive].copy(), {name: value for name, value, is_passive in values if not is_passive}


def home_label(machine: Chain) -> str:
    """Label of the posture from which a machine's poses are displaced."""
    return machine.home or next(iter(machine.postures))


def closed(machine: Chain, end: Array | None = None) -> Chain:
    """The machine with its loops closed in all its postures, and a posture for each of its poses.

    Args:
        machine: whose postures may be rounded: held joints stay where they are if the loops close so.
        end: frame ``(4, 4)`` of the end-effector at home, mm, where it is known better.

    Raises:
        PoseError: naming the posture, or all poses, in which the loops do not close, and why.
    """
    closings: dict[str, Closing] = {}
    for label in machine.postures:
        try:
            closings[label] = Closing(machine, label, end if label == home_label(machine) else None)
            closings[label].refuse_unfit(closings[label].home)
        except PoseError as error:
            raise PoseError(f"posture '{label}': {error}") from error
    stands = {label: closing.posture(closing.home) for label, closing in closings.items()}
    home = closings[home_label(machine)]
    unreached: list[str] = []
    for label, displacement in machine.poses.items():
        if label in stands:
            continue
        try:
            stands[label] = home.posture(home.displaced(displacement))
        except PoseError as error:
            unreached.append(f"pose '{label}': {error}")
    if unreached:
        raise PoseError("; ".join(unreached))
    return replace(
        machine,
        postures={label: passive for label, (passive, _) in stands.items()},
        held={label: held for label, (_, held) in stands.items()},
    )


def _words(displacement: Array) -> str:
    return ",".join(f"{v:g}" for v in displacement)


def least_norm(A: Array, b: Array) -> Array:
    """Solutions ``(g, n)`` of ``A x = b`` by least squares, of least norm; A is ``(g, r, n)``, b ``(g, r)``."""
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    kept = s > NEGLIGIBLE * s.max(axis=1, initial=0.0, keepdims=True)
    y = np.einsum("grk,gr->gk", U, b) * np.where(kept, 1.0 / np.where(kept, s, 1.0), 0.0)
    result: Array = np.einsum("gkn,gk->gn", Vt, y)
    return result


def _null(A: Array) -> Array:
    """Orthonormal basis ``(n, k)`` of a null space."""
    if not A.size:
        return np.eye(A.shape[1])
    _, s, Vt = np.linalg.svd(A)
    rank = int(np.count_nonzero(s > SINGULAR * s[0]))
    result: Array = Vt[rank:].T
    return result


def _span(A: Array) -> Array:
    """Orthonormal basis ``(r, k)`` of what the columns of a matrix span."""
    if not A.size:
        return np.zeros((len(A), 0))
    U, s, _ = np.linalg.svd(A)
    result: Array = U[:, : int(np.count_nonzero(s > SINGULAR))]
    return result


def _aligned(basis: Array, other: Array) -> Array:
    """The basis ``(6, f)`` of the same motions that is nearest to another; itself where the numbers differ."""
    if basis.shape != other.shape:
        return basis
    U, _, Vt = np.linalg.svd(basis.T @ other)
    result: Array = basis @ U @ Vt
    return result


def _groups(names: Sequence[str], motions: Array) -> tuple[tuple[str, ...], ...]:
    """Joints that move together in motions ``(n, k)``: what is apart in them is a group of its own."""
    together = np.abs(motions @ motions.T) > SINGULAR
    groups: list[tuple[str, ...]] = []
    seen = np.zeros(len(names), dtype=bool)
    for first in np.flatnonzero(np.diag(together)).tolist():
        if seen[first]:
            continue
        group = np.zeros(len(names), dtype=bool)
        group[first] = True
        while np.any(grown := together[group].any(axis=0) & ~group):
            group |= grown
        seen |= group
        groups.append(tuple(names[i] for i in np.flatnonzero(group).tolist()))
    return tuple(groups)


def _turned_back(before: Array | None, after: Array | None) -> bool:
    """Whether drives answer the end-effector the other way in some direction: a singularity lies between."""
    if before is None or after is None:
        return False
    values = np.linalg.eigvals(np.linalg.solve(before.T, after.T))
    # what is one value twice comes as a pair that rounding has split
    real = np.abs(values.imag) < SINGULAR * np.abs(values).max()
    return bool(np.any(real & (values.real < 0.0)))
