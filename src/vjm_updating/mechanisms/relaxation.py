"""A beam whose stress relaxes: all reactions of its springs, in bending and behind a bifurcation as well.

In a standard linear solid with relaxing shares ``φ_i`` and times ``τ_i`` the stress is that of an elastic one less
``Σ φ_i m_i``, where ``m_i' = (σ − m_i)/τ_i`` follows the elastic stress (Ferry 1980, chapter 3). The stresses of a
beam's springs are their reactions ``σ = J_θᵀ F`` (9). Virtual work is taken on the motion of the springs with the
end-effector, ``T = ∂θ/∂u``. The wrench is then, to first order in what relaxes,

    W(u) − T(u)ᵀ Σ φ_i m_i(t).

Once all has relaxed ``m = σ``, and this is φ times the derivative of ``W`` by the logarithm of the beam's modulus,
also of springs that are not linear. But what has relaxed makes the springs longer while the end-effector is held:
``σ = σ₀ + (1 − α) Σ φ_i m_i``, with α the beam's share of the compliance along the ray. That is a solid with other
shares and times (Gross 1953), by which a linear chain is exact to all orders on one ray. Left out is, of second
order in φ, that α changes with the load, and what is across the rays.

At a bifurcation the bend goes with the root w of the distance ``v`` from it, T with ``1/w``, and the first order
fails. A curved beam that is led back keeps a bow and never is straight, and softer ones buckle elsewhere. Let x be
what a straight chain has lengthened by, and k the fall of the stiffness along the ray. The bend is the largest root
a of

    a³ − (v − x) a = g/k,

the symmetric, stable bifurcation of a chain with a bow (Koiter 1945). It takes the place of the root ``w``. The
force is less by ``k (a² − v)``. The constant g makes that right to first order wherever it is small, and the bend
that is remembered goes with ``a``. A chain that has buckled is right within some per cent for φ = 0.1, and
in the limit of all relaxed.

A perfectly straight beam does not buckle by itself while it is held between the displacements at which it would
when relaxed and when fresh. A real one would, after a time that its bow decides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.mechanisms.equilibrium_tables import PathTable
from vjm_updating.mechanisms.history_kernels import HalfRayPath, relaxed_wrenches
from vjm_updating.mechanisms.modified_chain import springs_of
from vjm_updating.mechanisms.series_elements import History

OnRay = tuple[np.ndarray, Array, PathTable, PathTable]
"""Readings ``(k,)`` of a ray, what measures their places on it ``(6,)``, the tables along and against it."""


@dataclass(frozen=True)
class Relaxation:
    """What of a beam relaxes: ``shares`` (k,) of its stiffness, together below one, in ``times`` (k,), s."""

    part: str
    shares: tuple[float, ...]
    times: tuple[float, ...]

    def within(self, alpha: float) -> tuple[Array, Array]:
        """Shares ``(k,)`` and times ``(k,)`` of the beam in a chain of which it has the share α of the compliance.

        ``m' = D (σ₀ + (1 − α) Σ φ m − m)`` with ``D = diag(1/τ)``, by its eigenvectors.
        """
        phi, rate = np.array(self.shares), 1.0 / np.array(self.times)
        A = rate[:, None] * (np.eye(len(phi)) - (1.0 - alpha) * phi)
        # similar to a symmetric matrix but for shares of zero, so its eigenvalues are real
        rates, V = np.linalg.eig(A)
        shares = (phi @ V) * np.linalg.solve(V, rate) / rates
        return shares.real, 1.0 / rates.real


def relaxing(rays: Sequence[OnRay], history: History, relaxation: Relaxation) -> Callable[[Array], Array]:
    """What relaxation adds to the wrenches ``(n, 6)`` at displacements of the chain ``(n, 6)``, in their order."""
    n = len(history.time)
    paths: list[HalfRayPath] = []
    both, measures, alpha = np.zeros((n, 2), dtype=np.int64), np.empty((n, 6)), np.empty(n)
    for index, measure, *two in rays:
        both[index] = len(paths), len(paths) + 1
        paths += [_path(table, relaxation.part) for table in two]
        measures[index], alpha[index] = measure, paths[-2].alpha
    # one relaxation for all rays of a history
    number = np.cumsum(history.begins)
    shares, times = (np.empty((n, len(relaxation.shares))) for _ in range(2))
    for k in np.unique(number):
        shares[number == k], times[number == k] = relaxation.within(float(alpha[number == k].mean()))
    step = np.zeros(n)
    step[1:] = np.maximum(np.diff(history.time), 0.0)
    s, reaction, motion = (np.concatenate([path[i] for path in paths]) for i in range(3))
    first = np.cumsum([0, *(len(path.s) for path in paths)])
    bifurcation, fall, stiff, along = (np.array([path[i] for path in paths]) for i in range(3, 7))
    terms = shares, times, np.array(relaxation.shares), np.array(relaxation.times)

    def added(own: Array) -> Array:
        return relaxed_wrenches(
            (s, reaction, motion), first, bifurcation, fall, stiff, along, both,
            np.einsum("ni,ni->n", own, measures), terms, step, history.begins,
        )  # fmt: skip

    return added


def _path(table: PathTable, part: str) -> HalfRayPath:
    """What the springs of a beam do along a table; kept with it."""
    known = table.springs.get(part)
    if known is not None:
        return known
    model, d = table.problem.model, np.asarray(table.problem.load_case.direction)
    own = np.concatenate([np.arange(where.start, where.stop) for where in springs_of(model, part)])
    nodes = np.flatnonzero(table.s != table.bifurcation)
    s, none = table.s[nodes], np.zeros((6, model.size))
    states = list(zip(table.x[nodes], table.wrench[nodes], strict=True))
    motion = np.array([model.compiled.responses(x, F, none, np.eye(6))[0][:, own].T for x, F in states])
    reaction = model.end_reactions(table.x[nodes], table.wrench[nodes])[:, own]
    # a weight that has acted for long has relaxed what it can
    reaction -= reaction[0].copy()
    energy = float(reaction[1] @ motion[0] @ d)
    beyond = s > table.bifurcation
    motion[beyond] *= np.sqrt(s[beyond] - table.bifurcation)[:, None, None]
    slope, i = table.slope[nodes], int(np.argmax(beyond))
    fall = slope[i - 1] - slope[i] if i else np.zeros(6)
    work = float(d @ (table.wrench[nodes[1]] - table.wrench[0]))
    alpha = min(energy / work, 1.0) if energy > 0.0 and work > 0.0 else 1.0
    stiff = float(slope[max(i - 1, 0)] @ d)
    path = HalfRayPath(s, reaction, motion, float(table.bifurcation), fall, stiff, d, alpha)
    table.springs[part] = path
    return path
