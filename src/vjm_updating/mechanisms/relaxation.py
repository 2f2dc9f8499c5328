"""A beam whose stress relaxes, its springs' reactions each with a memory: in pull and push, in bending and behind a
bifurcation.

In a standard linear solid with relaxing shares ``φ_i`` and times ``τ_i`` the stress is that of an elastic one less
``Σ φ_i m_i``, where ``m_i' = (σ − m_i)/τ_i`` follows the elastic stress (Ferry 1980, chapter 3). For the springs of
a beam the stresses are their reactions ``σ = J_θᵀ F`` (9). By virtual work on the motion of the springs with the
end-effector, ``T = ∂θ/∂u``, the wrench is then, to first order in what relaxes,

    W(u) − T(u)ᵀ Σ φ_i m_i(t).

Once all has relaxed ``m = σ`` and this is the slope of ``W`` by the logarithm of the beam's modulus times φ, springs
with a law of their own included. What has crept makes the springs longer, though, while the end-effector is held:
``σ = σ₀ + (1 − α) Σ φ_i m_i``, with α the beam's share of the compliance along the ray. That is a solid with other
shares and times (Gross 1953), so a linear chain on one ray is exact to all orders. What is left out is of second
order in φ: how α changes with the load, and displacements across the rays.

A bent beam that is led back keeps a bow, and so passes no bifurcation: T grows there as ``1/w``, with w the root of
the distance ``v`` from it. The amplitude a of the bend of a perfect chain is w; with a bow it is the largest root of

    a³ − v a = g/k,

with g the limit of ``w dᵀ(T − T₀)ᵀ Σ φ_i m_i`` and k the fall of the stiffness along the ray at the bifurcation
(Koiter 1945: a symmetric, stable one). The bend's part of the wrench is then ``w/a`` of that of the first order, and
before the bifurcation ``k a²`` is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.mechanisms.modified_chain import springs_of
from vjm_updating.mechanisms.path_table import Table
from vjm_updating.mechanisms.relaxation_kernel import Path, relaxed_wrenches
from vjm_updating.mechanisms.series_elements import History

OnRay = tuple[np.ndarray, Array, Table, Table]
"""Readings ``(k,)`` of a ray, what measures their places on it ``(6,)``, the tables along and against it."""


@dataclass(frozen=True)
class Relaxation:
    """What of a beam relaxes.

    Attributes:
        part: name of the beam.
        shares: of its stiffness ``(k,)``, together below one.
        times: of their relaxation ``(k,)``, s.
    """

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


def relaxed(rays: Sequence[OnRay], own: Array, history: History, relaxation: Relaxation) -> Array:
    """What relaxation adds to the wrenches ``(n, 6)`` at displacements of the chain ``(n, 6)``, in their order.

    Args:
        rays: of the readings.
        own: displacements of the chain itself ``(n, 6)``.
        history: of the readings.
        relaxation: of one beam.
    """
    n = len(own)
    paths: list[Path] = []
    both, measures, alpha = np.zeros((n, 2), dtype=np.int64), np.empty((n, 6)), np.empty(n)
    for index, measure, *two in rays:
        both[index] = len(paths), len(paths) + 1
        paths += [_path(table, relaxation.part) for table in two]
        measures[index], alpha[index] = measure, paths[-2].alpha
    # one memory for all rays of a history
    number = np.cumsum(history.begins)
    shares, times = (np.empty((n, len(relaxation.shares))) for _ in range(2))
    for k in np.unique(number):
        shares[number == k], times[number == k] = relaxation.within(float(alpha[number == k].mean()))
    step = np.zeros(n)
    step[1:] = np.maximum(np.diff(history.time), 0.0)
    s, reaction, motion = (np.concatenate([path[i] for path in paths]) for i in range(3))
    first = np.cumsum([0, *(len(path.s) for path in paths)])
    before, fall = (np.array([path[i] for path in paths]) for i in (4, 5))
    bifurcation, along = np.array([path.bifurcation for path in paths]), np.array([path.along for path in paths])
    result: Array = relaxed_wrenches(
        (s, reaction, motion), first, bifurcation, before, fall, along, both,
        np.einsum("ni,ni->n", own, measures), shares, times, step, history.begins,
    )  # fmt: skip
    return result


def _path(table: Table, part: str) -> Path:
    """What the springs of a beam do along a table; kept with it."""
    known = table.springs.get(part)
    if known is not None:
        return known
    model, d = table.problem.model, np.asarray(table.problem.load_case.direction)
    own = np.concatenate([np.arange(where.start, where.stop) for where in springs_of(model, part)])
    nodes = np.flatnonzero(table.s != table.bifurcation)
    s, none = table.s[nodes], np.zeros(model.size)
    reaction, motion = np.empty((len(s), len(own))), np.empty((len(s), len(own), 6))
    for k, (x, F) in enumerate(zip(table.x[nodes], table.wrench[nodes], strict=True)):
        reaction[k] = model.reactions(model.kinematics(x), F)[own]
        for j, unit in enumerate(np.eye(6)):
            motion[k, :, j] = model.compiled.response(x, F, none, unit)[0][own]
    # a weight that has hung for long has relaxed what it can
    reaction -= reaction[0].copy()
    before, beyond = motion[0].copy(), s > table.bifurcation
    motion[beyond] *= np.sqrt(s[beyond] - table.bifurcation)[:, None, None]
    slope, i = table.slope[nodes], int(np.argmax(beyond))
    fall = slope[i - 1] - slope[i] if i else np.zeros(6)
    work, energy = float(d @ (table.wrench[nodes[1]] - table.wrench[0])), float(reaction[1] @ before @ d)
    alpha = min(energy / work, 1.0) if 0.0 < energy and 0.0 < work else 1.0
    path = Path(s, reaction, motion, float(table.bifurcation), before, fall, d, alpha)
    table.springs[part] = path
    return path
