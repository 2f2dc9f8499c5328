"""The study of a test of deflections."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.constants import prior_scale
from vjm_updating.deflections.families import COMPLIANCES, NOT_SHOWN, members_of_loads
from vjm_updating.deflections.forward import DeflectionForward
from vjm_updating.deflections.readings import DeflectionData
from vjm_updating.deflections.sheet import DeflectionSheet
from vjm_updating.poses.families import Member
from vjm_updating.poses.forward import Frames, Linearised, ReadingsForward
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.measurement import ends_of
from vjm_updating.poses.readings import PoseData
from vjm_updating.poses.state import Candidates, FittedState, Hypothesis
from vjm_updating.poses.study import MEDIAN_TO_SIGMA, Ranges, SeriesStudy

ANY_AXES = prior_scale(10.0, "rad")
"""rad: of axes that are found."""


class DeflectionStudy(SeriesStudy):
    """A test of deflections."""

    baseline: str = "as modelled"
    against: tuple[str, str] = (
        "[loads]",
        "the joints deflect against the load: are the displacements unloaded minus loaded, or is the force that "
        "of the robot on what loads it? Reverse the sign of one of them",
    )
    jump: tuple[str, str] = (
        "reference_jump",
        "from here on all displacements are ({by}) mm off: the unloaded readings have changed",
    )
    turns_with_tracker: bool = False
    sheet: DeflectionSheet
    data: DeflectionData

    def forward_of(self, machine: PoseMachine, data: PoseData) -> DeflectionForward:
        """The model of readings of the test, by a machine and without members."""
        assert isinstance(data, DeflectionData)
        return DeflectionForward(machine, data, self.sheet)

    def members_for(self, forward: ReadingsForward) -> list[Member]:
        """All members that a difference of two equilibria shows."""
        plain = self.forward_of(self.machine, self.data)
        return members_of_loads(self.machine, self.data, plain, plain.torques())

    def nuisance_prior(self) -> Array:
        """Standard deviations ``(n_f,)`` of the axes and of the markers' places."""
        turns = ANY_AXES if self.sheet.tracker.axes == "own" else self.sheet.tracker.sigma_rad
        places = [np.full(3, table.sigma_mm) for table in self.sheet.markers.values()]
        return np.concatenate([np.full(3, turns), *places])

    def first_frames(self) -> tuple[Frames, Array]:
        """The axes of the base, or those in which the joints deflect best; what the nominal machine misses."""
        k = len(self.data.markers)
        frames = Frames(np.eye(3), np.zeros(3), np.zeros((k, 3)), np.tile(np.eye(3), (k, 1, 1)))
        forward = self.forward_of(self.machine, self.data)
        forward.members = self.members
        z = np.zeros(len(self.members))
        if self.sheet.tracker.axes == "own":
            frames = replace(frames, R=self._axes(forward.evaluate(z, frames)))
        return frames, self.distance(forward.evaluate(z, frames).residual)

    def _axes(self, at: Linearised) -> Array:
        """Axes ``(3, 3)`` in which springs of the joints, none negative, explain the displacements best.

        Springs and axes are found in turn from the 24 axes that are right-angled turns of the base's.
        """
        own = [i for i, member in enumerate(self.members) if member.family == COMPLIANCES[0]]
        seen = np.isfinite(self.data.position).all(axis=2)
        y = self.data.position[seen]
        modelled, J = y - at.residual[..., :3][seen], at.member[..., :3, :][seen][..., own]
        lower = lower_bounds([self.members[i] for i in own])
        best, axes = np.inf, np.eye(3)
        for order in itertools.permutations(range(3)):
            for signs in itertools.product((1.0, -1.0), repeat=3):
                Q = np.diag(signs)[:, order]
                if np.linalg.det(Q) < 0.0:
                    continue
                for _ in range(10):
                    c = springs_to(J.reshape(-1, len(own)), (y @ Q - modelled).reshape(-1), lower)
                    p = modelled + J @ c
                    U, _, Vt = np.linalg.svd(p.T @ y)
                    Q = Vt.T @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ U.T
                left = float(np.sum((y @ Q - p) ** 2))
                if left < best:
                    best, axes = left, Q
        return axes

    def stated(self) -> Array:
        """Standard deviations ``(g, k, 6)`` of the deflections."""
        said = np.empty((*self.data.sigma.shape[:2], 6))
        said[..., :3], said[..., 3:] = self.data.sigma, self.data.sigma_turn[..., None]
        return said

    def scatter(self, at: Linearised) -> Array:
        """Standard deviations ``(g, k, 6)``: the readings' own, all by one factor more where residuals show it.

        What a model lacks grows with the load as what it has, so that a factor is nearer than a sum.
        """
        said = self.stated()
        for half in (slice(0, 3), slice(3, 6)):
            over = np.abs(at.residual[..., half]) / said[..., half]
            if np.isfinite(over).any():
                said[..., half] *= max(MEDIAN_TO_SIGMA * float(np.nanmedian(over)), 1.0)
        return said

    def misfits(self) -> tuple[Array, Array]:
        """Residuals once all compliances are fitted, over the readings' standard deviations; none without a fit."""
        try:
            state = self.settle(Hypothesis(tuple(f for f in COMPLIANCES if f in self.families)))
        except NoConvergenceError:
            return self.aligned * 0.0, self.aligned
        over = state.at.residual / self.scatter(state.at)
        return self.distance(over), self.distance(state.at.residual)

    @property
    def points(self) -> tuple[str, ...]:
        """Points of load."""
        return self.data.loads

    @property
    def not_asked(self) -> tuple[str, ...]:
        """Families of poses that a difference does not show."""
        return NOT_SHOWN

    @property
    def not_asked_for(self) -> str:
        """Why, for people."""
        return "they move the loaded and the unloaded robot alike"

    def ends(self) -> dict[str, tuple[str, Array]]:
        """The markers' and loads' parts and places."""
        return ends_of_test(self.sheet)

    def at_candidates(self, state: FittedState, candidates: Candidates) -> Linearised:
        """The model at a state in other postures under other loads."""
        g = len(candidates)
        blank = self.data.only(np.zeros(g, dtype=int))
        data = replace(blank, q=candidates.q, load=candidates.load, row=np.arange(g))
        machine = self.machine_of(state.hypothesis.as_deflected)
        forward = DeflectionForward(machine, data, self.sheet)
        there = {
            m.name: m
            for m in members_of_loads(machine, data, forward, self.forward_of(machine, self.data).torques())
        }
        still = np.zeros(g)
        forward.members = [
            m if m.basis is None else replace(m, basis=there[m.name].basis if m.name in there else still)
            for m in self.members
        ]
        return forward.evaluate(state.z, state.frames)

    def drawn(self, rng: np.random.Generator, count: int, within: Ranges | None = None) -> Candidates:
        """Postures as `postures` draws them, each under one of the largest loads."""
        return with_loads(self.postures(rng, count, within), self.data)


def ends_of_test(sheet: DeflectionSheet) -> dict[str, tuple[str, Array]]:
    """Points of a test's machine, the markers first; a load may bear the name of a marker."""
    return ends_of(sheet.markers) | {f"{name}~load": end for name, end in ends_of(sheet.loads).items()}


def with_loads(q: Array, data: DeflectionData) -> Candidates:
    """Each posture under one load: along one axis of one point, as large as the largest that was measured there."""
    largest = np.abs(data.load).reshape(-1, *data.load.shape[1:]).max(axis=0)
    used = np.argwhere(largest > 0.0)
    load = np.zeros((len(q), *data.load.shape[1:]))
    for i in range(len(q)):
        point, axis = used[i % len(used)]
        load[i, point, axis] = largest[point, axis]
    return Candidates(q, load)


def springs_to(J: Array, y: Array, lower: Array) -> Array:
    """Sizes ``(n,)``, none below ``lower`` (n,), of columns ``J`` (r, n) that come nearest to ``y`` (r,)."""
    scale = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
    found: Array = lower + nnls(J / scale, y - J @ lower)[0] / scale
    return found


def lower_bounds(members: Sequence[Member]) -> Array:
    """Of members in their units."""
    return np.array([member.low for member in members])
