"""The rigid machine.

Here are frames and motions of a tree of parts over many postures at once, motions in steps that keep its branch,
and how its loops close: inverse and forward kinematics, mobility by rank.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from vjm.model.assembly import Assembly, BodyFrame
from vjm.model.joint_limits import joint_limits
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.model.packing import closure_sites
from vjm.rank import NEGLIGIBLE, least_norm, null_space, rank_of, span
from vjm.rotations import Array, rotation_vectors, rotations_from_vectors, translation

if TYPE_CHECKING:
    from vjm.machine.rigid_kernel import RigidArrays


class RigidMechanism:
    """Joints, closures and couplings of a machine whose springs are rigid.

    Coordinates are those of its passive joints and of its held ones but coupled ones, in the order of the parts.

    Attributes:
        names: of the n coordinates.
        coordinates: see `Assembly.coordinates`.
        posture: see `Assembly.posture`.
        passive: ``(n,)`` which of them are passive.
        slides: ``(n,)`` which of them slide.
        unit: ``(n,)`` one radian, or the machine's length in mm for a slide: by it steps are measured.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.length = machine.characteristic_length
        given = [joint for joint in machine.moving if joint.coupling is None]
        self.passive = np.array([part.free for part in given], dtype=bool)
        self.slides = np.array([part.slides for part in given], dtype=bool)
        self.unit = np.where(self.slides, self.length, 1.0)
        self._built = built = Assembly(machine, rigid=True)
        self.names, self.coordinates, self.posture = built.joints, built.coordinates, built.posture
        self._share, self._offset = built.commands
        self._coupled = np.zeros((len(machine.couplings), len(given)))
        for row_, coupling in zip(self._coupled, machine.couplings, strict=True):
            for name, weight in coupling.terms:
                row_[self.names.index(name)] += weight
        self._totals = np.array([coupling.total for coupling in machine.couplings])
        self.row_names = [c.name for c in machine.closures for _ in range(c.rows)]
        self.row_names += [coupling.name for coupling in machine.couplings]

    @cached_property
    def arrays(self) -> RigidArrays:
        """The machine as kernels take it."""
        joints, frames = closure_sites(self._built)
        pairs = zip(joints.ravel().tolist(), frames.reshape(-1, 4, 4), strict=True)
        return self._arrays(
            [BodyFrame(*each) for each in pairs], [closure.rows for closure in self.machine.closures]
        )

    def _arrays(self, sites: list[BodyFrame], rows: list[int]) -> RigidArrays:
        """The machine, with pairs of frames of each of which so many components are compared."""
        # imported when it is asked for: compiled code takes longer to load than a model file
        from vjm.machine.rigid_kernel import RigidArrays

        built = self._built
        sites = [*sites, BodyFrame(built.last, built.rigid)]
        m = len(built.parent)
        return RigidArrays(
            parent=np.array(built.parent, dtype=np.int64),
            rotary=np.array(built.rotary, dtype=np.int64),
            axis=np.array(built.axis).reshape(m, 3),
            before=np.array(built.before).reshape(m, 4, 4),
            share=self._share,
            offset=self._offset,
            joint=np.array([site.joint for site in sites], dtype=np.int64),
            frame=np.array([site.frame for site in sites]),
            rows=np.array(rows, dtype=np.int64),
            coupled=self._coupled,
            total=self._totals.astype(float),
            unit=self.unit.astype(float),
            length=np.array([self.length]),
        )

    def linearised(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """What closures and couplings miss at coordinates ``(g, n)``, and the end-effector.

        Returns:
            Gaps ``(g, r)``, lengths over the machine's, and rad; their derivatives ``(g, r, n)`` by the coordinates
            over their units, exact where closed; frames ``(g, 4, 4)`` of the end-effector, mm; and its motion
            ``(g, 6, n)``, likewise.
        """
        return self._linearised(self.arrays, q, len(self.row_names))

    def _linearised(self, arrays: RigidArrays, q: Array, r: int) -> tuple[Array, Array, Array, Array]:
        from vjm.machine.rigid_kernel import linearised

        g, n = len(q), len(self.names)
        gap, J, J_end = np.empty((g, r)), np.empty((g, r, n)), np.empty((g, 6, n))
        place, end = np.empty((g, 3, 4)), np.tile(np.eye(4), (g, 1, 1))
        linearised(arrays, np.ascontiguousarray(q, dtype=float), gap, J, place, J_end)
        end[:, :3] = place
        return gap, J, end, J_end

    def stretching(self, q: Array) -> Array:
        """Derivatives ``(s, n)`` of the lengths of springs between points at coordinates ``(n,)``, dimensionless.

        The two points of a spring are compared as those of a ball joint are. A row is zero where they meet.
        """
        springs = self.machine.point_springs
        if not springs:
            return np.zeros((0, len(self.names)))
        sites = [
            BodyFrame(site.joint, site.frame @ translation(np.asarray(point, dtype=float)))
            for spring in springs
            for part, point in zip(spring.parts, spring.points, strict=True)
            for site in [self._built.begins[part]]
        ]
        count = 3 * len(springs)
        gap, J, _, _ = self._linearised(self._arrays(sites, [3] * len(springs)), q[None], count + len(self._totals))
        apart = gap[0, :count].reshape(-1, 3)
        length = np.linalg.norm(apart, axis=1, keepdims=True)
        along = apart / np.where(length > 0.0, length, 1.0)
        return np.einsum("sa,san->sn", along, J[0, :count].reshape(len(springs), 3, -1))

    def end_frames(self, q: Array) -> Array:
        """Frames ``(g, 4, 4)`` of the end-effector at coordinates ``(g, n)``, mm."""
        return self.linearised(q)[2]


def difference(start: Array, stop: Array) -> Array:
    """Displacements ``(g, 6)`` between frames ``(g, 4, 4)``, as `vjm.rotations.displacement_between`, mm and rad.

    Of half a turn, which has no one vector, the turn is NaN.
    """
    turned = rotation_vectors(stop[:, :3, :3] @ start[:, :3, :3].transpose(0, 2, 1))
    return np.concatenate([stop[:, :3, 3] - start[:, :3, 3], turned], axis=1)


def displaced_frames(T: Array, displacement: Array) -> Array:
    """Frames ``(g, 4, 4)`` after displacements ``(g, 6)``, as `vjm.rotations.displaced`, mm and rad."""
    result = T.copy()
    result[:, :3, 3] += displacement[:, :3]
    result[:, :3, :3] = rotations_from_vectors(displacement[:, 3:]) @ T[:, :3, :3]
    return result


CLOSED = 1e-11
"""Gap over the machine's length at which loops are closed: some hundred times rounding."""
LARGEST_TURN = 0.3
"""rad by which a passive joint may turn, or lengths by which it may slide, in one step of a way."""
SMALLEST_STEP = 1e-3
"""Share of a way below which its end counts as out of reach."""
DAMPED = 1e-13
"""Of the largest diagonal entry of a Gram matrix: what rounding leaves of motions that nothing holds."""
REAL = 1e-6
"""Imaginary part of an eigenvalue over the largest that is rounding: what is one value twice comes as a pair."""

Step: TypeAlias = Callable[[np.ndarray, Array, Array], tuple[Array, Array]]
"""Of motions by their numbers ``(k,)``, from coordinates ``(k, n)`` nearby, at shares ``(k,)``: the coordinates
closed there, and the gap that remains ``(k,)``."""


@dataclass(frozen=True)
class RigidMotions:
    """How g motions ended.

    Attributes:
        q: coordinates ``(g, n)`` where they did.
        done: shares ``(g,)`` of the motions; one where they came to their ends.
        tried: coordinates ``(g, n)`` of the next steps, which were not taken.
        left: what these leave open ``(g,)``.
        turned: shares ``(g,)`` at which the drives were found to answer the other way; nan where they were not.
        answers: `moved_by_drives` where they ended ``(g, 6, d)``; without columns where the drives are not watched.
    """

    q: Array
    done: Array
    tried: Array
    left: Array
    turned: Array
    answers: Array

    @property
    def arrived(self) -> np.ndarray:
        """Which motions came to their ends ``(g,)``."""
        return np.asarray(self.done == 1.0)


def follow(
    tree: RigidMechanism, start: Array, closed: Step, *, watch: bool, answers: Array | None = None
) -> RigidMotions:
    """Follow motions from coordinates ``(g, n)``, each in steps of its own.

    Args:
        tree: the rigid machine.
        start: closed.
        closed: see `Step`.
        watch: whether the drives, as many as the end-effector's freedoms, must not turn back on the way: between
            lies a singularity, and behind it another branch.
        answers: `moved_by_drives` at the start ``(g, 6, d)``, where it is known; overwritten.
    """
    g = len(start)
    q, tried = start.copy(), start.copy()
    done, step, left, turned = np.zeros(g), np.ones(g), np.zeros(g), np.full(g, np.nan)
    if not watch:
        answers = np.zeros((g, 6, 0))
    elif answers is None:
        answers = moved_by_drives(tree, q)
    going = np.arange(g)
    while len(going):
        to = np.minimum(1.0, done[going] + step[going])
        trial, miss = closed(going, q[going], to)
        # drives that turn, too: by a whole turn the loops are closed as before, and a screw would stay behind
        moves = np.abs((trial - q[going]) / tree.unit)[:, tree.passive | ~tree.slides].max(axis=1, initial=0.0)
        good = (miss < CLOSED) & (moves <= LARGEST_TURN)
        back = np.zeros(len(going), dtype=bool)
        if watch and np.any(good):
            now = moved_by_drives(tree, trial[good])
            back[good] = _turned_back(answers[going[good]], now)
            answers[going[good & ~back]] = now[~back[good]]
        tried[going], left[going] = trial, miss
        turned[going[back]] = to[back]
        gone = going[good & ~back]
        step[going] = np.where(good, 2.0, 0.5) * (to - done[going])
        q[gone], done[gone] = trial[good & ~back], to[good & ~back]
        going = going[~back & (done[going] < 1.0) & (step[going] >= SMALLEST_STEP)]
    return RigidMotions(q, done, tried, left, turned, answers)


def moved_by_drives(tree: RigidMechanism, q: Array) -> Array:
    """Motions ``(g, 6, d)`` of the end-effector by the held joints at coordinates ``(g, n)``, the loops closed.

    Lengths are over the machine's, coordinates over their units.
    """
    from vjm.machine.rigid_kernel import answers

    passive, driven = np.flatnonzero(tree.passive), np.flatnonzero(~tree.passive)
    result = np.empty((len(q), 6, len(driven)))
    answers(tree.arrays, np.ascontiguousarray(q), passive, driven, DAMPED, result)
    return result


def _turned_back(before: Array, after: Array) -> np.ndarray:
    """Whether the end-effector answers the drives ``(g, 6, d)`` the other way in some direction ``(g,)``."""
    Bt = np.swapaxes(before, 1, 2)
    values = np.linalg.eigvals(np.linalg.solve(Bt @ before, Bt @ after))
    real = np.abs(values.imag) < REAL * np.abs(values).max(axis=1, initial=0.0, keepdims=True)
    return np.asarray(np.any(real & (values.real < 0.0), axis=1))


# --- What a rigid machine can do in a posture, by the rank of its motions -----------------------------------------


@dataclass(frozen=True)
class Mobility:
    """What a rigid machine can do in a posture.

    Attributes:
        freedom: independent motions of the end-effector with the drives free.
        loose: motions ``(6, k)`` of the end-effector with the drives held, world axes, lengths over the machine's.
        idle: names of the passive joints of each group that moves with end-effector and drives at rest.
        idle_freedom: number of those motions.
        redundant: constraints beyond those that are needed: that many self-stresses are possible.
        gap: by how much the constraints that count differ from those that do not, see `vjm.rank.Rank`.
    """

    freedom: int
    loose: Array
    idle: tuple[tuple[str, ...], ...]
    idle_freedom: int
    redundant: int
    gap: float


def mobility_of(J: Array, stretching: Array, end: Array, passive: np.ndarray, names: Sequence[str]) -> Mobility:
    """Freedom, idle motions and redundant constraints of a machine.

    Args:
        J: derivatives ``(r, n)`` of the closures' gaps by the coordinates, dimensionless.
        stretching: derivatives ``(s, n)`` of the lengths of springs between points, which hold too, likewise.
        end: derivatives ``(6, n)`` of the end-effector's pose, likewise.
        passive: ``(n,)`` which coordinates are those of passive joints.
        names: of the joints.
    """
    closures = rank_of(J)
    free, held = null_space(J), null_space(np.vstack([J, stretching])[:, passive])
    idle = null_space(np.vstack([J, stretching, end])[:, passive])
    passive_names = [name for name, is_passive in zip(names, passive, strict=True) if is_passive]
    return Mobility(
        freedom=span(end @ free).shape[1],
        loose=span(end[:, passive] @ held),
        idle=_groups(passive_names, idle),
        idle_freedom=idle.shape[1],
        redundant=len(J) - closures.rank,
        gap=closures.gap,
    )


def _groups(names: Sequence[str], motions: Array) -> tuple[tuple[str, ...], ...]:
    """Joints that move together in motions ``(n, k)``: what is apart in them is a group of its own."""
    together = np.abs(motions @ motions.T) > NEGLIGIBLE
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


# ------------------------------------------------------------------------------------------------------------------


ITERATIONS, EXACT = 8, 4
"""Of Newton's method by normal equations, and by singular values where those do not close."""
HOME_GAP = 0.05
"""Gap over the machine's length up to which a posture of a file is taken to be rounded."""


class PoseError(ValueError):
    """A pose that the rigid machine cannot take; the message says why."""


class LoopClosure:
    """The rigid machine with its loops, in any posture.

    Attributes:
        tree: its joints and closures.
        home: coordinates ``(n,)`` at home, closed.
        end: frame ``(4, 4)`` of the end-effector at home.
    """

    def __init__(self, machine: Machine, home: str | Mapping[str, float], end: Array | None = None) -> None:
        """Close the machine at home.

        Args:
            machine: with closures or without.
            home: a label of its postures, or coordinates by the joints' names, mm or rad; may be rounded.
            end: frame ``(4, 4)`` of the end-effector at home, mm, where it is known better.

        Raises:
            PoseError: the loops do not close there.
        """
        self.machine = machine
        self.tree = RigidMechanism(machine)
        self._six = np.repeat([self.tree.length, 1.0], 3)
        q = self.tree.posture(home) if isinstance(home, str) else self.tree.coordinates(home)
        self.end = self.tree.end_frames(q[None])[0]
        self._refuse_open(q, HOME_GAP, "at home")
        # a rounded file: drives stand where it has them, where the loops close so
        nothing, wanted = np.zeros(len(q), dtype=bool), None if end is None else end[None]
        solution, left = self.solve(q[None], ~self.tree.passive if end is None else nothing, wanted)
        if not left[0] < CLOSED:
            solution, left = self.solve(q[None], nothing, wanted)
            if not left[0] < CLOSED:
                self._refuse_open(solution[0], CLOSED, "at home")
                stands = self.tree.end_frames(solution)
                missed = self._said(difference(stands, stands if end is None else end[None])[0] / self._six)
                raise PoseError(
                    f"{machine.name}: with its loops closed at home the end-effector stays {missed} from its "
                    f"place; check that place, and the coordinates at home"
                )
        self.home = solution[0]
        self.end = self.tree.end_frames(solution)[0]

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
        # imported when it is asked for: compiled code takes longer to load than a model file
        from vjm.machine.rigid_kernel import close

        tree, q = self.tree, np.array(q, dtype=float, order="C")
        free, rows = np.flatnonzero(~fixed), np.flatnonzero(np.asarray(components, dtype=bool))
        left = np.full(len(q), np.inf)
        aim = np.zeros((0, 4, 4)) if wanted is None else np.ascontiguousarray(wanted, dtype=float)
        close(tree.arrays, q, free, aim, rows, DAMPED, CLOSED, ITERATIONS, left)
        # near a singularity what is damped converges slowly: there singular values are looked at
        active = np.flatnonzero(np.isfinite(left) & (left >= CLOSED))
        for iteration in range(EXACT + 1):
            if not len(active):
                break
            gap, J, end, J_end = tree.linearised(q[active])
            if wanted is not None:
                miss = difference(wanted[active], end) / self._six
                gap = np.concatenate([gap, miss[:, rows]], axis=1)
                J = np.concatenate([J, J_end[:, rows]], axis=1)
            size = np.abs(gap).max(axis=1, initial=0.0)
            left[active] = size
            going = np.isfinite(size) & (size >= CLOSED)
            active, gap, J = active[going], gap[going], J[going]
            if not len(active) or iteration == EXACT:
                break
            step = -least_norm(J[:, :, free], gap)
            largest = np.abs(step).max(axis=1, initial=1e-300)
            step *= np.minimum(1.0, 0.5 / largest)[:, None]
            q[np.ix_(active, free)] += step * tree.unit[free]
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
        # what has fewer freedoms takes only some poses
        freedom, asked = self._mobility.freedom, int(np.count_nonzero(np.array(components)))
        try:
            q = self._arrived(self._towards(self.home[None], way[None], components), _words(way))
        except PoseError as error:
            if not 0 < freedom < asked:
                raise
            raise PoseError(
                f"{error}; the end-effector has {freedom} {'freedom' if freedom == 1 else 'freedoms'}, and takes "
                f"only some of the poses by {asked} components: give the drives' coordinates"
            ) from error
        self.refuse_unfit(q)
        return q

    def all_displaced(
        self, displacements: Array, components: Sequence[bool] = (True,) * 6
    ) -> tuple[Array, list[str]]:
        """Coordinates ``(g, n)`` with the end-effector displaced ``(g, 6)`` from home, and why one is out of reach.

        Each is reached on a straight way from the nearest one that is known, without passing a singularity.
        Limits of joints are not looked at. The reason is empty for what is in reach.
        """
        # imported when it is asked for: one posture needs no neighbours
        from scipy.spatial import cKDTree

        g, unit = len(displacements), np.repeat([1.0 / self.tree.length, 1.0], 3)
        q, why = np.tile(self.home, (g, 1)), [""] * g
        places = displacements * unit
        # the nearest to home first, and it from there
        order = np.argsort(np.linalg.norm(places, axis=1), kind="stable")
        known, stands = np.zeros((1, 6)), self.home[None]
        answers = moved_by_drives(self.tree, stands) if self._watched else np.zeros((1, 6, 0))
        done = 0
        while done < g:
            # as many more as are known already
            rows = order[done : done + len(known)]
            near = cKDTree(known).query(places[rows])[1]
            ways = self._towards(stands[near], displacements[rows], components, answers[near])
            q[rows] = ways.q
            for k in np.flatnonzero(~ways.arrived).tolist():
                why[rows[k]] = self._said_of(ways, k, _words(displacements[rows[k]]), "from a pose near it")
            known, stands, answers = (
                np.concatenate([before, behind[ways.arrived]])
                for before, behind in ((known, places[rows]), (stands, ways.q), (answers, ways.answers))
            )
            done += len(rows)
        return q, why

    def _towards(
        self,
        start: Array,
        displacements: Array,
        components: Sequence[bool] = (True,) * 6,
        answers: Array | None = None,
    ) -> RigidMotions:
        """Motions from coordinates ``(g, n)`` to displacements ``(g, 6)`` of the end-effector from home.

        What is known of the drives at the start, see `follow`, is not found again.
        """
        rows = np.asarray(components, dtype=bool)
        nothing = np.zeros(len(self.home), dtype=bool)
        wanted = displaced_frames(np.tile(self.end, (len(start), 1, 1)), displacements)
        begin = self.tree.end_frames(start)
        # from home it is the displacement itself, also where that is half a turn or more
        way = displacements if len(start) == 1 else difference(begin, wanted)

        def straight(which: np.ndarray, q: Array, to: Array) -> tuple[Array, Array]:
            between = displaced_frames(begin[which], to[:, None] * way[which])
            aim = np.where((to == 1.0)[:, None, None], wanted[which], between)
            return self.solve(q, nothing, aim, rows)

        ways = follow(self.tree, start, straight, watch=self._watched, answers=answers)
        lost = np.flatnonzero(~ways.arrived & np.isnan(ways.turned))
        if self._mobility.freedom >= np.count_nonzero(rows) or not len(lost):
            return ways

        # what has fewer freedoms takes only some poses: its way leads over those that are near the straight one
        def near(which: np.ndarray, q: Array, to: Array) -> tuple[Array, Array]:
            solution, left = straight(lost[which], q, to)
            between = to < 1.0
            solution[between], left[between] = self.solve(solution[between], nothing)
            return solution, left

        others = follow(self.tree, start[lost], near, watch=self._watched)
        recovered = lost[others.arrived]
        ways.q[recovered], ways.done[recovered] = others.q[others.arrived], 1.0
        ways.answers[recovered] = others.answers[others.arrived]
        return ways

    @cached_property
    def _watched(self) -> bool:
        """Whether the drives are as many as the end-effector's freedoms, so that they must not turn back."""
        drives = int(np.count_nonzero(~self.tree.passive))
        return 0 < drives == self._mobility.freedom and not self._mobility.loose.shape[1]

    @cached_property
    def _mobility(self) -> Mobility:
        return self.mobility(self.home)

    def _arrived(self, ways: RigidMotions, where: str) -> Array:
        """Where the only way ended.

        Raises:
            PoseError: before its end.
        """
        if not ways.arrived[0]:
            raise PoseError(self._said_of(ways, 0, where, "from home"))
        return ways.q[0]

    def _said_of(self, ways: RigidMotions, k: int, where: str, begin: str) -> str:
        """Why a motion did not end where it should."""
        done, turned = float(ways.done[k]), float(ways.turned[k])
        if np.isfinite(turned):
            return (
                f"{self.machine.name}: the pose {where} lies on another branch: between {done:.0%} and "
                f"{turned:.0%} of the way {begin} the machine passes a singularity"
            )
        return self._out_of_reach(ways.tried[k], float(ways.left[k]), where, f"{done:.0%} of the way {begin}")

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
                f"{self.machine.name}: {what} '{other[0]}'; held joints are {', '.join(names) or 'none'}; passive "
                "joints follow: leave them out"
            )
        goal = self.home.copy()
        for name, value in values.items():
            goal[self.tree.names.index(name)] = value
        fixed = ~self.tree.passive

        def closed(_: np.ndarray, q: Array, to: Array) -> tuple[Array, Array]:
            start = q.copy()
            start[:, fixed] = (1.0 - to[:, None]) * self.home[fixed] + to[:, None] * goal[fixed]
            return self.solve(start, fixed)

        ways = follow(self.tree, self.home[None], closed, watch=False)
        q = self._arrived(ways, ", ".join(f"{k}={v:g}" for k, v in values.items()))
        self._refuse_beyond_limits(q)
        return q

    def _gaps(self, q: Array) -> tuple[str, Array]:
        """The closure that is open the most, and its gap: lengths over the machine's, rad."""
        gap = self.tree.linearised(q[None])[0][0]
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

    def _out_of_reach(self, q: Array, left: float, where: str, done: str) -> str:
        name = self.machine.name
        worst, gap = self._gaps(q)
        if left < 1e-6:
            return (
                f"{name}: the pose {where} is out of reach on the branch of home: closure '{worst}' passes a dead "
                f"point at {done}"
            )
        if np.any(self.tree.passive) and not np.any(~self.tree.passive):
            return (
                f"{name}: the pose {where} is out of reach: nothing drives it, and its passive joints do not let "
                f"the end-effector come there. Give it drives, or take the pose at home"
            )
        short = f"closure '{worst}' stays {self._said(gap)} open" if len(gap) else "the end-effector stays short"
        return f"{name}: the pose {where} is out of reach: {short} (it ends at {done})"

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
        mobility = self.mobility(q)
        loose = mobility.loose
        drives = int(np.count_nonzero(~self.tree.passive))
        if loose.shape[1] <= max(0, self._motions(mobility) - drives):
            # what has fewer drives than freedoms is loose by its nature
            return
        said = [f"{c} {v:.2g}" for c, v in zip(COMPONENTS, loose[:, 0], strict=True) if abs(v) > 0.05]
        raise PoseError(
            f"{self.machine.name}: the pose is singular: with all drives held the end-effector still moves by "
            f"({', '.join(said)}; turns in rad, shifts over {self.tree.length:g} mm)"
        )

    def _motions(self, mobility: Mobility) -> int:
        """Independent motions of the whole machine with the drives free, without idle ones."""
        rank = len(self.tree.row_names) - mobility.redundant
        return len(self.home) - rank - mobility.idle_freedom

    def mobility(self, q: Array) -> Mobility:
        """Freedom, idle motions and redundant constraints at coordinates ``(n,)``, by rank."""
        _, J, _, end = self.tree.linearised(q[None])
        return mobility_of(J[0], self.tree.stretching(q), end[0], self.tree.passive, self.tree.names)

    def posture(self, q: Array) -> tuple[Array, dict[str, float]]:
        """Passive coordinates ``(n_q,)``, and held ones by name, of coordinates ``(n,)``; mm and rad."""
        passive = self.tree.passive
        values = zip(self.tree.names, q.tolist(), passive, strict=True)
        return q[passive].copy(), {name: value for name, value, is_passive in values if not is_passive}


def home_label(machine: Machine) -> str:
    """Label of the posture from which a machine's poses are displaced: its first."""
    return next(iter(machine.postures))


def closed(machine: Machine, end: Array | None = None) -> Machine:
    """The machine with its loops closed in all its postures, and a posture for each of its poses.

    Args:
        machine: whose postures may be rounded: held joints stay where they are if the loops close so.
        end: frame ``(4, 4)`` of the end-effector at home, mm, where it is known better.

    Raises:
        PoseError: naming the posture, or all poses, in which the loops do not close, and why.
    """
    closings: dict[str, LoopClosure] = {}
    for label in machine.postures:
        try:
            closings[label] = LoopClosure(machine, label, end if label == home_label(machine) else None)
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
