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

import numpy as np

from vjm.kernels.arrays import Floats, Ints, MachineArrays, Work
from vjm.kernels.compilation import entry, kernel
from vjm.kernels.entry_points import inverse
from vjm.kernels.newton import linearise
from vjm.kernels.statics import place, turn_followers
from vjm.machine.critical_search import FIRST_STEP, critical_forces
from vjm.machine.equilibria import Equilibria, equilibria, objects
from vjm.model.load_case import Load
from vjm.model.mechanism import Gravity, Mechanism
from vjm.rank import SUM_ROUNDING
from vjm.rotations import Array

# --- Compiled: where linear theory expects critical forces, from which their search starts ------------------------

ALIKE = float(np.cos(0.04))
"""Cosine between directions of starts that count as one."""
ROUGH, TURNS = 8, 60
"""Iterations for linear starts: before those that are alike become one, and after."""
STILL = 1e-3
"""Of the work: its change in an iteration where this ends."""


@entry
def inverses_of(
    model: MachineArrays, work: Work, command: Floats, natural: Floats, end_wrench: Floats, x: Floats,
    wrench: Floats, out: Floats,
) -> None:  # fmt: skip
    """Inverse second variations ``out`` (g, n, n) on what the closures leave, scaled by the units, at equilibria.

    See `vjm.kernels.newton.equilibria_of` for the arguments; those of the posture have one row each.
    """
    n = x.shape[1]
    forces, none, v = np.empty(n), np.zeros(model.size[2]), np.zeros(n)
    place(model, command, v, work)
    turn_followers(model, work)
    for g in range(len(x)):
        work.wrench[:] = wrench[g]
        linearise(model, command, natural, x[g], end_wrench[g], 1.0, False, work)
        for i in range(n):
            v[:] = 0.0
            v[i] = 1.0
            inverse(model, work, v, forces, none, out[g, i])


@entry
def linear_starts(B: Floats, counts: Ints, some: Floats, y: Floats, size: Floats) -> int:
    """Motions at which the work ``yᵀ B y`` (3,) is largest, one for each direction, for each number of modes.

    Args:
        B: ``(3, c, c)`` in modes, the most compliant last.
        counts: how many of the most compliant modes.
        some: ``(k, c)`` any motions to start from.
        y: ``(k · counts, c)`` written: motions of unit length.
        size: written: their work.

    Returns:
        Number of motions written.
    """
    c = B.shape[1]
    motions, work = np.zeros(some.shape), np.zeros((len(some), 3))
    written, before = 0, -1
    for count in counts:
        first, kept = max(c - count, 0), len(some)
        if first == before:
            break
        before = first
        for r in range(kept):
            length = 0.0
            for i in range(first, c):
                length += some[r, i] ** 2
            for i in range(c):
                motions[r, i] = some[r, i] / np.sqrt(length) if i >= first else 0.0
        for turns in (ROUGH, TURNS):
            for r in range(kept):
                _largest_work(B, first, turns, motions[r], work[r])
            many, kept = kept, 0
            for r in range(many):
                alike = False
                for k in range(kept):
                    along = work[r, 0] * work[k, 0] + work[r, 1] * work[k, 1] + work[r, 2] * work[k, 2]
                    alike = alike or along >= ALIKE * _length(work[r]) * _length(work[k])
                if not alike:
                    motions[kept], work[kept] = motions[r], work[r]
                    kept += 1
        for r in range(kept):
            y[written], size[written] = motions[r], _length(work[r])
            written += 1
    return written


@kernel
def _length(v: Floats) -> float:
    return np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)


@kernel
def _largest_work(B: Floats, first: int, turns: int, y: Floats, work: Floats) -> None:
    """Motion ``y`` (c,) of unit length, zero before the first mode, at which the work ``(3,)`` is largest.

    The power method with the matrix along the work's direction; it ends where this changes no more.
    """
    c = len(y)
    image = np.zeros((3, c))
    for turn in range(turns + 1):
        off = 0.0
        for a in range(3):
            s = 0.0
            for i in range(first, c):
                row, own = B[a, i, first:], y[first:]
                t = 0.0
                for j in range(len(own)):
                    t += row[j] * own[j]
                image[a, i] = t
                s += t * y[i]
            off = max(off, abs(s - work[a]))
            work[a] = s
        size = _length(work)
        if turn == turns or (turn > 0 and off <= STILL * size):
            break
        length = 0.0
        for i in range(first, c):
            t = size * y[i]
            for a in range(3):
                t += work[a] / size * image[a, i]
            y[i] = t
            length += t * t
        length = np.sqrt(length)
        for i in range(first, c):
            y[i] /= length


MODES = np.array([10, 20, 40])
"""Most compliant modes in the linear starts, each number for itself. The more stiff motions linear theory has, the
farther from the truth may it be when the force turns the machine; with too few it misses losses among them."""
RIGID = 1e-9
"""Compliance of a mode over the largest that is left out: rounding is a part of 1e-16 of it."""
TRIES = 26
"""Motions from which each linear start is looked for."""
NOT_MOVED = (
    "no force moves the end to first order: there is no way to follow. `validate curve --axis load` finds the "
    "critical force of one direction"
)
POSTURES = 64
"""Taken at once, for the room that they need."""


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


class CriticalForce:
    """Looks for the smallest critical force of a machine's free end in postures.

    CriticalForce(model, 0, 20_000.0).weakest(q)
    """

    def __init__(
        self, model: Mechanism, end: int, most: float, *, gravity: Gravity | None = None, loads: Sequence[Load] = ()
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
        self._energy = float(arrays.energy[0])
        self._some = np.random.default_rng(0).standard_normal((TRIES, model.coordinates))

    def weakest(self, q: Array) -> Weakest:
        """The smallest critical force over all directions in a posture with coordinates ``(n_joints,)``.

        It is the least of the minima that linear theory leads to. No search tells that there is none beside them.
        """
        return self.each(np.asarray(q, dtype=float)[None])[0]

    def each(self, q: Array) -> list[Weakest]:
        """The same in postures ``(g, n_joints)``."""
        q = np.asarray(q, dtype=float)
        weakest: list[Weakest] = []
        for first in range(0, len(q), POSTURES):
            weakest += self._some_of(q[first : first + POSTURES])
        return weakest

    def _some_of(self, q: Array) -> list[Weakest]:
        rest = self._under(q, np.zeros((len(q), 3)), None)
        assert rest.compliance is not None
        result = [no_force("no stable equilibrium without a force on the end")] * len(q)
        rows = np.flatnonzero(rest.converged & rest.stable)
        largest = np.zeros(len(q))
        largest[rows] = np.linalg.eigvalsh(symmetric(rest.compliance[rows, self.end, :3, :3]))[:, -1]
        # of the most that a force could do in the machine's own units
        moved = largest > SUM_ROUNDING * self.model.reach**2 / self._energy
        for k in rows[~moved[rows]]:
            result[k] = no_force(NOT_MOVED)
        rows = rows[moved[rows]]
        if not len(rows):
            return result
        small = np.minimum(FIRST_STEP * self.model.reach / largest[rows], self.most)
        V, s, patterns, expected = self._starts(q[rows], rest.x[rows], rest.closures[rows], small)
        g = len(rows)
        force, error = np.full((g, 3), np.nan), np.full(g, np.nan)
        behind, lost = np.zeros(g, dtype=np.int64), np.zeros(g, dtype=np.int64)
        critical_forces(
            self._machine, self._work, self.model.values(q[rows]), self.model.naturals(q[rows]),
            self.end, self.model.reach, self.most, rest.x[rows],
            rest.closures[rows], V, s, self._some[0], patterns, expected, force, behind, error, lost,
        )  # fmt: skip
        for i, k in enumerate(rows):
            size = float(np.linalg.norm(force[i]))
            if size > 0.0:
                result[k] = Weakest(size, force[i] / size, "", (0, int(behind[i])), float(error[i]))
            else:
                unsure = f"; {lost[i]} searches could not be followed to their ends" if lost[i] else ""
                result[k] = no_force(f"no critical force up to {self.most:g} N{unsure}")
        return result

    def _starts(self, q: Array, x: Array, closures: Array, small: Array) -> tuple[Array, Array, Array, Array]:
        """Linear theory's minima in g postures from their equilibria ``(g, n)`` without a force.

        Returns:
            Modes ``(g, n, c)`` without a force and their compliances ``(g, c)``; patterns ``(g, k, n)`` of the
            devices that push along the starts, scaled; the forces ``(g, k)`` that are expected, N, the smallest
            first, infinite where there is none.
        """
        g, n = x.shape
        forces = np.array([np.eye(3) * size for size in small]).reshape(-1, 3)
        start = np.repeat(x, 3, axis=0), np.repeat(closures, 3, axis=0)
        pushed = self._under(np.repeat(q, 3, axis=0), forces, start, compliance=False)
        commands, naturals, S = self.model.values(q), self.model.naturals(q), np.zeros((4, n, n))
        modes, compliances = np.zeros((g, n, n)), np.ones((g, n))
        patterns: list[Array] = []
        expected: list[Array] = []
        for k in range(g):
            own = slice(3 * k, 3 * k + 3)
            inverses_of(
                self._machine, self._work, commands[k], naturals[k],
                self._wrenches(np.vstack([np.zeros(3), forces[own]])), np.vstack([x[k : k + 1], pushed.x[own]]),
                np.vstack([closures[k : k + 1], pushed.closures[own]]), S,
            )  # fmt: skip
            s, V = np.linalg.eigh(symmetric(S[0]))
            felt = int(np.searchsorted(s, RIGID * s[-1]))
            modes[k, :, felt:], compliances[k, felt:] = V[:, felt:], s[felt:]
            over = V[:, felt:] / np.sqrt(s[felt:])
            B = -np.stack([over.T @ symmetric(change - S[0]) @ over / small[k] for change in S[1:]])
            count = len(MODES) * TRIES
            y, size = np.zeros((count, len(B[0]))), np.zeros(count)
            count = linear_starts(B, MODES, np.ascontiguousarray(self._some[:, felt:]), y, size)
            motions, size = y[:count] @ over.T, size[:count]
            order = np.argsort(-size, kind="stable")
            order = order[size[order] > 0.0]
            patterns.append(motions[order])
            expected.append(1.0 / size[order])
        most = max(1, *map(len, expected))
        return (
            modes,
            compliances,
            np.stack([np.pad(row, ((0, most - len(row)), (0, 0))) for row in patterns]),
            np.stack([np.pad(row, (0, most - len(row)), constant_values=np.inf) for row in expected]),
        )

    def _under(
        self, q: Array, forces: Array, start: tuple[Array, Array] | None, *, compliance: bool = True
    ) -> Equilibria:
        """Equilibria in postures under forces ``(g, 3)``, from coordinates and closures' wrenches, or from none."""
        x, closures = start if start is not None else (None, None)
        return equilibria(
            self.model, q, gravity=self.gravity, loads=self.loads, wrench=self._wrenches(forces), start=x,
            start_closures=closures, gradual=start is None, compliance=compliance,
        )  # fmt: skip

    def _wrenches(self, forces: Array) -> Array:
        wrench = np.zeros((len(forces), len(self.model.ends), 6))
        wrench[:, self.end, :3] = forces
        return wrench


def symmetric(A: Array) -> Array:
    """Symmetric part of matrices ``(…, n, n)``."""
    return 0.5 * (A + np.swapaxes(A, -1, -2))


def no_force(why: str) -> Weakest:
    """No number, and why."""
    return Weakest(float("nan"), np.full(3, np.nan), why)
