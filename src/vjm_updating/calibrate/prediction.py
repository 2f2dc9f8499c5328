"""The model's wrenches at the very displacements of the readings, their stiffness, and their exact derivatives.

Each half of a ray is one march through its readings' displacements (`vjm.continuation.load_grid.trace_grid`), so
that no value is interpolated. The derivatives by the parameters (`vjm.sensitivity.gradients`) are computed at
`KNOTS` equilibria of each branch and interpolated linearly between them: they only steer the fit and state its
covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.continuation.load_grid import GridPath, trace_grid
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium, Path
from vjm.errors import NoConvergenceError
from vjm.model.chain import Chain
from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm.sensitivity.gradients import Sensitivity, by_posture
from vjm.vjm_engine import VjmEngine
from vjm_updating.calibrate.parameters import Unknowns
from vjm_updating.experiment.rays import Ray

SUPPORT = 30
"""Steps into which a half-ray is divided beside its readings, so that each is one that Newton's method can take."""
REFINED, FINER = 12, 4
"""How often, and into how many, the step at which a march stops is divided."""
KNOTS = 12
"""Equilibria of a branch at which derivatives are computed."""


@dataclass(frozen=True)
class Prediction:
    """The model at n readings.

    Attributes:
        wrench: ``(n, 6)`` N, N mm.
        stiffness: loaded stiffness K^F ``(n, 6, 6)``.
        derivative: of the wrench by the unknowns that change the chain ``(n, 6, m)``, where asked for.
        branched: ``(n,)`` whether the reading lies behind a bifurcation.
    """

    wrench: Array
    stiffness: Array
    derivative: Array | None
    branched: np.ndarray


@dataclass(frozen=True)
class Branches:
    """Which of two mirrored branches each half-ray takes behind a bifurcation, by (ray, sign); +1 by default."""

    taken: tuple[tuple[int, int, int], ...] = ()

    def of(self, ray: int, sign: int) -> int:
        """+1 or −1."""
        return next((branch for r, s, branch in self.taken if (r, s) == (ray, sign)), 1)

    def turned(self, ray: int, sign: int) -> Branches:
        """The same with the other branch on one half-ray."""
        rest = tuple(entry for entry in self.taken if entry[:2] != (ray, sign))
        return Branches((*rest, (ray, sign, -self.of(ray, sign))))


def predict(
    engine: VjmEngine,
    unknowns: Unknowns,
    z: Array,
    rays: Sequence[Ray],
    pose: Array,
    branches: Branches = Branches(),
    *,
    derivatives: bool = True,
) -> Prediction:
    """The model at the readings' true displacements.

    Args:
        engine: of the lumped model.
        unknowns: what the coordinates mean.
        z: coordinates ``(n_z,)``.
        rays: of the readings.
        pose: true displacements ``(n, 6)``, mm, rad.
        branches: on which to go on behind bifurcations.
        derivatives: whether they are wanted.

    Raises:
        NoConvergenceError: the model does not reach a reading.
    """
    chain = unknowns.build(z)
    sensitivity = by_posture(engine, chain, unknowns.sensitivity_parameters(z))
    n, m = len(pose), len(unknowns.on_chain)
    wrench, stiffness = np.zeros((n, 6)), np.zeros((n, 6, 6))
    derivative, branched = np.zeros((n, 6, m)), np.zeros(n, dtype=bool)
    for number, ray in enumerate(rays):
        place = pose[ray.index] @ ray.measure
        for sign in (1, -1):
            on = place * sign > 0.0 if sign > 0 else place <= 0.0
            if not on.any():
                continue
            at, s = ray.index[on], np.abs(place[on])
            half = _Half(engine, chain, ray, sign, branches.of(number, sign), float(s.max()))
            path = half.trace(s)
            wrench[at], stiffness[at] = half.at(path, s)
            if derivatives:
                derivative[at] = half.derivative(path, s, sensitivity(ray.posture))
            branched[at] = s > min(path.bifurcations, default=np.inf)
            off = pose[at] - place[on, None] * ray.direction
            wrench[at] += np.einsum("kij,kj->ki", stiffness[at], off)
    return Prediction(wrench, stiffness, derivative if derivatives else None, branched)


class _Half:
    """One half of a ray."""

    def __init__(self, engine: VjmEngine, chain: Chain, ray: Ray, sign: int, branch: int, reach: float) -> None:
        self.load_case = LoadCase(
            ray.posture, sign * max(reach, 1e-9), tuple(ray.direction.tolist()), branch=branch
        )
        self.problem: LumpedProblem = engine.problem(chain, self.load_case)
        self.reach = max(reach, 1e-9)

    def trace(self, s: Array) -> GridPath:
        """Every reading's displacement, and enough between them."""
        grid = np.unique(np.concatenate([np.linspace(0.0, self.reach, SUPPORT + 1), s]))
        # two equal displacements are one
        grid = grid[np.concatenate([[True], np.diff(grid) > 1e-12 * self.reach])]
        path = trace_grid(self.problem, grid)
        for _ in range(REFINED):
            if not path.stopped:
                break
            # where little breaks a symmetry the path turns sharply: a long step leaves it for the other branch
            at = int(np.searchsorted(grid, path.s[-1], side="right"))
            if at >= len(grid):
                break
            step = grid[at] - path.s[-1]
            finer = np.linspace(max(path.s[-1] - step, 0.0), grid[at], 2 * FINER + 1)
            grid = np.unique(np.concatenate([grid, finer]))
            path = trace_grid(self.problem, grid)
        if path.stopped:
            raise NoConvergenceError(f"posture {self.load_case.posture}: {path.stopped}")
        return path

    def at(self, path: GridPath, s: Array) -> tuple[Array, Array]:
        """Wrenches ``(k, 6)`` and stiffnesses ``(k, 6, 6)`` at ramps ``(k,)`` of the path.

        A reading in the gap that a path leaves behind a bifurcation, 2e-4 of its displacement, is interpolated.
        """
        right = (
            np.clip(np.searchsorted(path.s, s), 1, len(path.s) - 1) if len(path.s) > 1 else np.zeros(len(s), int)
        )
        left = np.maximum(right - 1, 0)
        width = path.s[right] - path.s[left]
        t = np.clip(np.divide(s - path.s[left], width, out=np.zeros_like(s), where=width > 0.0), 0.0, 1.0)
        wrench = path.wrench[left] + t[:, None] * (path.wrench[right] - path.wrench[left])
        stiffness = path.stiffness[left] + t[:, None, None] * (path.stiffness[right] - path.stiffness[left])
        return wrench, stiffness

    def derivative(self, path: GridPath, s: Array, sensitivity: Sensitivity) -> Array:
        """Derivatives ``(k, 6, m)`` of the wrench at ramps ``(k,)``."""
        starts = [0.0, *path.bifurcations]
        edges = np.searchsorted(path.s, [*starts, np.inf])
        result = np.zeros((len(s), 6, len(sensitivity.parameters)))
        for start, begin, end in zip(starts, edges[:-1], edges[1:], strict=True):
            if end <= begin:
                continue
            here = s > start if begin else np.ones(len(s), dtype=bool)
            knots = np.unique(begin + np.clip(np.searchsorted(path.s[begin:end], s[here]), 0, end - begin - 1))
            if not len(knots):
                continue
            if len(knots) > KNOTS:
                share = np.linspace(0.0, 1.0, KNOTS) ** (2 if begin else 1)
                knots = np.unique(begin + np.round(share * (end - begin - 1)).astype(int))
            known = sensitivity.wrench(self._path(path, knots))
            # behind a bifurcation a branch grows with the root of the distance, its derivative falls with it
            nodes, places, weight = path.s[knots], s[here], np.ones(int(here.sum()))
            if begin:
                nodes, places = np.sqrt(nodes - start), np.sqrt(np.maximum(places - start, 1e-6 * start))
                known, weight = known * nodes[:, None, None], 1.0 / places
            for i, j in np.ndindex(known.shape[1:]):
                result[here, i, j] = weight * np.interp(places, nodes, known[:, i, j])
        return result

    def _path(self, path: GridPath, at: np.ndarray) -> Path:
        points = tuple(
            Equilibrium(
                s=float(path.s[i]),
                displacement=self.load_case.displacement(float(path.s[i])),
                wrench=path.wrench[i],
                tangent=0.0,
                eigenvalue=float("nan"),
                unstable=0,
                iterations=int(path.iterations[i]),
                residual=float(path.residual[i]),
                shape=np.zeros((0, 3)),
                state=np.concatenate([path.x[i], path.wrench[i], [path.s[i]]]),
            )
            for i in at
        )
        return Path(self.problem.label, "", self.load_case, points)
