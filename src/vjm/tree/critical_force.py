"""The smallest dead force on a free end under which a machine loses its stability, over all directions.

A force F on an end grows from zero; weight and other loads act in full. The equilibria under all forces on the end
are a surface of three dimensions. On it lie the critical ones, where the second variation of the energy has an
eigenvalue of zero, and the smallest critical force is the point of these that is nearest to zero force.

It starts from linear theory. With A₀, the second variation without a force, and G_i, its change with a unit force
along axis i, ``A₀ + f Σ u_i G_i`` becomes singular. It does so at the least f where ``|q(φ)| = |φᵀ G φ|`` is
largest for ``φᵀ A₀ φ = 1``. The direction is ``u = −q/|q|``: the push that does most work on the mode's second
order. From every such mode the constrained minimum

    min ½ |F|²   where   g(F) = 1/(cᵀ A⁻¹ c) = γ

is followed from γ = g(0) to γ = 0 along equilibria. At its end A is singular. F then lies along the end's motion in
the mode (a limit of the force), or the third derivative of the energy along the mode is zero (a bifurcation).
Charts of the surface stay regular at both: three coordinates along its tangent instead of the force. In each F and
g are quadratic but for a remainder, which the step is measured against. At last the force is put on step by step
along its direction, to see that nothing is lost before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from vjm.kernels.critical import chart_points, inverses_of
from vjm.model.load_case import Load
from vjm.rotations import Array
from vjm.tree.constrained_minimum import AROUND, QuadraticModel, symmetric, towards
from vjm.tree.equilibria import Equilibria, equilibria, objects
from vjm.tree.model import Gravity, TreeModel

TOLERANCE = 1e-5
"""Relative, of a critical force: the stiffness where the search ends, over that without a force."""
LEFT = 0.1
"""Of the tolerance: the stiffness that is aimed at, for the factors are singular where none is left."""
EXACT = 1e-4
"""Remainder of the quadratic model in the last step: the force, which is least there, errs by its square."""
FIRST_STEP = 1e-4
"""Of the machine's reach: how far the first force moves the end; so little that all is linear there."""
RADIUS = 2.0
"""Of a chart's unit: the longest step. A step of one changes the force by about as much as it is."""
SMALLEST = 2.0**-12
"""Of it: a step below which a search is lost."""
GOOD, FAIR = 0.05, 0.3
"""Remainder of the model over the step: below the one the next is longer, above the other it is taken again."""
STEPS = 80
"""After which a search is given up."""
ALIKE = float(np.cos(0.04))
"""Cosine between directions of starts that count as one."""
LIKELY = 2.0
"""Times the least force so far that a straight line foresees: a search beyond is given up."""
MODES = 40
"""Softest modes in the linear start."""
RIGID = 1e-9
"""Compliance of a mode over the largest that is left out: rounding is a part of 1e-16 of it."""
TURNS = 40
"""Of the linear start's alternation between mode and direction."""
STILL = 1e-4
"""Of a turn: what is left of it where this ends."""
PARTS = 8
"""In which the force is put on at last, each halved up to `HALVINGS` times."""
HALVINGS = 6
SHORT = 0.02
"""Of a critical force: by how much the last equilibrium of this check falls short of it. Of the stiffness without
a force: below it the signs of other modes, which may vanish together with it, are not asked for."""
BESIDE = 0.1
"""Of a chart's unit: how far from a critical equilibrium the eigenvalues are counted at most."""
INVERSE = 6
"""Iterations to the softest mode where stability is lost on the way."""


@dataclass(frozen=True)
class Weakest:
    """The smallest critical force of a posture.

    Attributes:
        force: N; nan where there is none.
        direction: ``(3,)`` unit vector, world axes.
        why: empty, or why there is none.
        negative: numbers of negative eigenvalues at a little more and a little less stiffness than none.
        error: N, by the stiffness and the remainder of the quadratic model at the end. It is large where a path
            keeps a little stiffness over a range of forces, as beside a bifurcation.
    """

    force: float
    direction: Array
    why: str = ""
    negative: tuple[int, int] = (-1, -1)
    error: float = float("nan")


@dataclass
class _Point:
    """An equilibrium on the way.

    Attributes:
        x: ``(n,)``.
        wrench: ``(f,)`` of the closures.
        force: ``(3,)`` N.
        value: stiffness that the device feels, N mm.
        mode: ``(n,)`` what it moves.
        response: ``(n, 3)`` what unit forces on the end move.
        negative: number of negative eigenvalues, −1 where it was not found.
    """

    x: Array
    wrench: Array
    force: Array
    value: float
    mode: Array
    response: Array
    negative: int

    @property
    def row(self) -> Array:
        """Force and stiffness ``(4,)``."""
        return np.array([*self.force, self.value])


@dataclass(frozen=True)
class _Start:
    """Where a search begins: an equilibrium, the device's pattern ``(n,)``, and the force that is expected, N."""

    x: Array
    wrench: Array
    force: Array
    pattern: Array
    expected: float


@dataclass(frozen=True)
class _Chart:
    """Motions ``(n, 3)`` and forces ``(3, 3)`` by coordinates, and the rows that measure these, likewise."""

    moves: Array
    pushes: Array
    rows_x: Array
    rows_force: Array


class CriticalForce:
    """Looks for the smallest critical force of a machine's free end in postures.

    CriticalForce(model, 0, 20_000.0).weakest(q)
    """

    def __init__(
        self, model: TreeModel, end: int, most: float, *, gravity: Gravity | None = None, loads: Sequence[Load] = ()
    ) -> None:
        """See `weakest`.

        Args:
            model: arm, tree or machine with closed loops.
            end: index of its end frame.
            most: largest force tried, N.
            gravity: m/s².
            loads: on parts, in full.
        """
        self.model, self.end, self.most, self.gravity, self.loads = model, end, most, gravity, tuple(loads)
        arrays = model.arrays(gravity, loads)
        self._machine, self._work = objects(arrays)
        self._unit, self._energy = arrays.unit, float(arrays.energy[0])

    def weakest(self, q: Array) -> Weakest:
        """The smallest critical force over all directions in a posture with coordinates ``(n_joints,)``.

        It is the least of the minima that linear theory leads to. No search tells that there is none beside them.
        """
        self._q = np.asarray(q, dtype=float)[None]
        self._posture = self.model.values(self._q)[0], self.model.naturals(self._q)[0], np.zeros(self.model.size)
        rest = self._under(np.zeros((1, 3)), None)
        if not (rest.found[0] and rest.stable[0]):
            return no_force("no stable equilibrium without a force on the end")
        assert rest.compliance is not None
        softest = float(np.linalg.eigvalsh(symmetric(rest.compliance[0, self.end, :3, :3]))[-1])
        if not softest > 0.0:
            return no_force("no force moves the end")
        starts = self._starts(rest, min(FIRST_STEP * self.model.reach / softest, self.most))
        lost = 0
        while starts:
            best, which, lost = no_force(""), -1, 0
            for k, start in enumerate(starts):
                found = self._followed(start, best.force if which >= 0 else self.most)
                if found is None:
                    lost += 1
                elif not found.why:
                    best, which = found, k
            if which < 0:
                break
            again = self._lost_before(rest, best)
            if again is None:
                return best
            # stability is lost on the way there: a smaller force is near the place where it is
            starts[which : which + 1] = [] if starts[which].force.any() else again
        unsure = f"; {lost} searches could not be followed to their ends" if lost else ""
        return no_force(f"no critical force up to {self.most:g} N{unsure}")

    # --- linear start --------------------------------------------------------------------------------------

    def _starts(self, rest: Equilibria, small: float) -> list[_Start]:
        """Linear theory's minima, the smallest force first."""
        pushed = self._under(small * np.eye(3), rest, compliance=False)
        x, closures = np.vstack([rest.x, pushed.x]), np.vstack([rest.closures, pushed.closures])
        n = self.model.size
        S = np.zeros((4, n, n))
        wrench = self._wrenches(small * np.vstack([np.zeros(3), np.eye(3)]))
        inverses_of(self._machine, self._work, *self._posture, wrench, x, closures, S)
        s, V = np.linalg.eigh(symmetric(S[0]))
        felt = s > RIGID * s[-1]
        s, V = s[felt], V[:, felt]
        # the second variation without a force, which makes of a motion the pattern that moves it
        self._stiff = (V / s) @ V.T
        s, V = s[-MODES:], V[:, -MODES:]
        over = V / np.sqrt(s)
        B = -np.stack([over.T @ symmetric(change - S[0]) @ over / small for change in S[1:]])
        cube = np.array([row for row in product((-1.0, 0.0, 1.0), repeat=3) if any(row)])
        u = cube / np.linalg.norm(cube, axis=1)[:, None]
        for _ in range(TURNS):
            u = _distinct(u)
            y = np.linalg.eigh(-np.tensordot(u, B, 1))[1][:, :, -1]
            work = -np.einsum("ki,aij,kj->ka", y, B, y)
            size = np.linalg.norm(work, axis=1)
            before, u = u, work / np.maximum(size, 1e-300)[:, None]
            if np.abs(u - before).max() < STILL:
                break
        found: list[_Start] = []
        for k in np.argsort(-size, kind="stable"):
            if size[k] > 0.0:
                pattern = (over @ y[k]) * self._energy / self._unit
                found.append(_Start(rest.x[0], rest.closures[0], np.zeros(3), pattern, 1.0 / float(size[k])))
        return found

    # --- the constrained minimum ---------------------------------------------------------------------------

    def _followed(self, start: _Start, most: float) -> Weakest | None:
        """Along the constrained minimum to a critical equilibrium; None where that cannot be followed."""
        size, pattern, full, radius = start.expected, start.pattern, 1.0 / self._energy, RADIUS
        n = len(start.x)
        none = np.zeros((n, 3))
        at = _Point(start.x, start.wrench, start.force, full, none[:, 0], none, 0)
        now = self._evaluated(at, np.zeros((1, 3)), _Chart(none, np.eye(3), none, np.eye(3)), pattern)[0]
        self._far = float(np.linalg.norm(now.response / self._unit[:, None], 2))
        if now.negative != 0 or not self._far > 0.0:
            return None
        for _ in range(STEPS):
            chart = self._chart(now, size)
            around = self._evaluated(now, AROUND, chart, pattern)
            if min(point.negative for point in around) < 0:
                return None
            model = QuadraticModel.of(now.row, np.array([point.row for point in around]))
            while True:
                theta = towards(model, radius, LEFT * TOLERANCE * full)
                there = self._evaluated(now, theta[None], chart, pattern)[0]
                length, off = float(np.linalg.norm(theta)), there.row - model.at(theta)[0]
                remainder = float(np.hypot(np.linalg.norm(off[:3]) / size, off[3] / full))
                # where several modes vanish together their signs are not asked for
                good = there.negative == 0 or (there.negative > 0 and there.value < SHORT * full)
                if good and remainder <= max(FAIR * length, TOLERANCE):
                    break
                radius = 0.5 * min(radius, length)
                if radius < SMALLEST:
                    return None
            if remainder < GOOD * length:
                radius = min(2.0 * radius, RADIUS)
            reached = float(np.linalg.norm(there.force))
            left = there.value / full
            if reached > most or reached > LIKELY * most * max(1.0 - left, TOLERANCE):
                return no_force("beyond")
            if abs(left) < TOLERANCE and remainder < EXACT:
                slopes = model.at(theta)[1]
                slope = slopes[3]
                beside = SHORT * full / (slope @ slope) * slope
                # where the stiffness hardly changes the points stay near by
                beside *= min(1.0, BESIDE / float(np.linalg.norm(beside)))
                sides = self._evaluated(now, theta + np.array([beside, -beside]), chart, pattern)
                if sides[0].negative != 0 or sides[1].negative < 1:
                    return None
                # at the least force it falls with the stiffness that is left
                falls = float(np.linalg.norm(there.force @ slopes[:3])) / reached / float(np.linalg.norm(slope))
                error = abs(there.value) * falls + remainder**2 * size
                return Weakest(reached, there.force / reached, "", (0, sides[1].negative), error)
            # the device pushes along the mode that is softest now
            now, pattern = there, self._pattern(there.mode)
            again = self._evaluated(now, np.zeros((1, 3)), self._chart(now, size), pattern)[0]
            if again.negative < 0:
                return None
            now, size = again, max(reached, LEFT * size)
        return None

    def _pattern(self, mode: Array) -> Array:
        """Forces ``(n,)`` that push along a motion, such that they feel a stiffness of one unit without a force."""
        motion = mode / self._unit
        motion /= np.linalg.norm(motion)
        push = self._stiff @ motion
        result: Array = push / np.sqrt(abs(motion @ push)) * self._energy / self._unit
        return result

    def _chart(self, at: _Point, size: float) -> _Chart:
        """The tangent of the equilibria at a point, in units of a force and of what that moves without a load."""
        far = self._unit[:, None] * self._far * size
        Q = np.linalg.qr(np.vstack([at.response / far, np.eye(3) / size]))[0]
        n = len(at.x)
        return _Chart(
            Q[:n] * far, Q[n:] * size, np.ascontiguousarray(Q[:n] / far), np.ascontiguousarray(Q[n:] / size)
        )

    def _evaluated(self, at: _Point, theta: Array, chart: _Chart, pattern: Array) -> list[_Point]:
        """Equilibria at coordinates ``(g, 3)`` of a chart about a point."""
        g, n = len(theta), len(at.x)
        x, force = at.x + theta @ chart.moves.T, at.force + theta @ chart.pushes.T
        wrench, value, mode, response = (
            np.tile(at.wrench, (g, 1)),
            np.zeros(g),
            np.zeros((g, n)),
            np.zeros((g, n, 3)),
        )
        negative = np.zeros(g, dtype=np.int64)
        chart_points(
            self._machine, self._work, *self._posture, self.end, at.x, at.force, chart.rows_x, chart.rows_force,
            np.ascontiguousarray(theta), pattern, x, wrench, force, value, mode, response, negative,
        )  # fmt: skip
        return [
            _Point(x[k], wrench[k], force[k], float(value[k]), mode[k], response[k], int(negative[k]))
            for k in range(g)
        ]

    # --- the way to a critical force -----------------------------------------------------------------------

    def _lost_before(self, rest: Equilibria, found: Weakest) -> list[_Start] | None:
        """None where the force, put on along its direction, leads there; else where stability is lost."""
        at, share, part, halved = rest, 0.0, 1.0 / PARTS, 0
        force = found.force * found.direction
        while share < 1.0 - SHORT:
            ahead = min(share + part, 1.0 - SHORT)
            now = self._under(ahead * force[None], at)
            if self._leads(at, now, (ahead - share) * force):
                at, share = now, ahead
            elif halved < HALVINGS:
                part, halved = 0.5 * part, halved + 1
            else:
                return self._softest(at, share * force, found.force)
        return None

    def _leads(self, at: Equilibria, now: Equilibria, step: Array) -> bool:
        """Whether one equilibrium leads to the other: halfway between the slopes at both lies what it moves by."""
        if not (now.found[0] and now.stable[0]):
            return False
        assert at.compliance is not None
        assert now.compliance is not None
        end = self.end
        way = now.deflection[0, end, :3] - at.deflection[0, end, :3]
        mean = 0.5 * (at.compliance[0, end, :3, :3] + now.compliance[0, end, :3, :3])
        off = float(np.linalg.norm(way - mean @ step))
        return off <= 0.5 * float(np.linalg.norm(way)) + FIRST_STEP * self.model.reach

    def _softest(self, at: Equilibria, force: Array, expected: float) -> list[_Start]:
        """A start from the mode of the smallest eigenvalue of an equilibrium, by inverse iteration."""
        n = self.model.size
        none = np.zeros((n, 3))
        point = _Point(at.x[0], at.closures[0], force, 0.0, none[:, 0], none, 0)
        pattern = self._pattern(self._unit * np.random.default_rng(0).standard_normal(n))
        for _ in range(INVERSE):
            found = self._evaluated(point, none[:1], _Chart(none, np.eye(3), none, np.eye(3)), pattern)[0]
            if found.negative < 0:
                return []
            pattern = self._pattern(found.mode)
        return [_Start(at.x[0], at.closures[0], force, pattern, expected)]

    def _under(self, forces: Array, start: Equilibria | None, *, compliance: bool = True) -> Equilibria:
        """Equilibria under forces ``(g, 3)``, from one of them or from none."""
        g = len(forces)
        return equilibria(
            self.model, np.tile(self._q, (g, 1)), gravity=self.gravity, loads=self.loads,
            wrench=self._wrenches(forces), start=None if start is None else np.tile(start.x, (g, 1)),
            start_closures=None if start is None else np.tile(start.closures, (g, 1)), gradual=start is None,
            compliance=compliance,
        )  # fmt: skip

    def _wrenches(self, forces: Array) -> Array:
        wrench = np.zeros((len(forces), len(self.model.ends), 6))
        wrench[:, self.end, :3] = forces
        return wrench


def _distinct(directions: Array) -> Array:
    """Directions ``(k, 3)`` of which no two are alike."""
    kept: list[Array] = []
    for each in directions:
        if all(each @ other < ALIKE for other in kept):
            kept.append(each)
    return np.array(kept)


def no_force(why: str) -> Weakest:
    """No number, and why."""
    return Weakest(float("nan"), np.full(3, np.nan), why)
