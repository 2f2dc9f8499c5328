"""The study of a test of poses: where markers stood, seen by a tracker whose frame is not known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.observation.significance import median_sigma
from vjm_updating.poses.alignment import align, with_tilts
from vjm_updating.poses.families import Member, members_of
from vjm_updating.poses.forward import Frames, Linearised, PoseForward, ReadingsForward
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.measurement import ends_of
from vjm_updating.poses.readings import PoseData
from vjm_updating.poses.sheet import PoseSheet
from vjm_updating.poses.state import Candidates, FittedState
from vjm_updating.poses.study import BEHIND_ENCODERS, Ranges, SeriesStudy


class PoseStudy(SeriesStudy):
    """A test of poses."""

    sheet: PoseSheet

    def forward_of(self, machine: PoseMachine, data: PoseData) -> PoseForward:
        """The model of readings of the test, by a machine and without members."""
        return PoseForward(machine, data, self.sheet.test.gravity)

    def members_for(self, forward: ReadingsForward) -> list[Member]:
        """All members that the data can show."""
        found = members_of(self.machine, self.data, forward.torques(), ordered=self.ordered)
        return [m for m in found if not (self.sheet.at_output and m.family in BEHIND_ENCODERS)]

    def coordinates(self) -> dict[str, Array]:
        """Joints, and the place of the first marker in the base's axes by the rigid machine."""
        place = self.forward_of(self.machine, self.data).unloaded()[1][:, 0]
        names = (f"{axis} of {self.data.markers[0]}" for axis in "xyz")
        return super().coordinates() | dict(zip(names, place.T, strict=True))

    def nuisance_prior(self) -> Array:
        """Standard deviations ``(n_f,)`` of the frames of tracker and markers."""
        guess = self.sheet.base
        wide = (1e5, 10.0) if guess is None else (guess.sigma_mm, guess.sigma_rad)
        tracked = self.forward_of(self.machine, self.data).tracked
        return np.concatenate(
            [
                np.full(3, wide[1]),
                np.full(3, wide[0]),
                *[np.full(3, table.sigma_mm) for table in self.sheet.markers.values()],
                np.full(3 * len(tracked), 10.0),
            ]
        )

    def first_frames(self) -> tuple[Frames, Array]:
        """Frames that bring a rigid robot to the positions, and the distances ``(g, k)`` mm left."""
        forward = self.forward_of(self.machine, self.data)
        R, p = forward.unloaded()
        sigma = np.array([table.sigma_mm for table in self.sheet.markers.values()])
        frames, aligned = align(R, p, self.data.position, self.data.orientation, sigma, self.sheet.base)
        return with_tilts(frames, R, self.data.tilt, forward.gravity), aligned

    def stated(self) -> Array:
        """Standard deviations ``(g, k, 6)`` of the tracker's places and turns."""
        said = np.empty((*self.data.sigma.shape[:2], 6))
        said[..., :3], said[..., 3:] = self.data.sigma, self.sheet.tracker.noise_rad
        return said

    def scatter(self, at: Linearised) -> Array:
        """Standard deviations ``(g, k, 6)``: the readings' own and one more for what the model lacks."""
        said = self.stated()
        for half in (slice(0, 3), slice(3, 6)):
            r = np.abs(at.residual[..., half])
            if np.isfinite(r).any():
                scatter = median_sigma(r)
                floor = float(np.nanmedian(said[..., half]))
                extra = max(scatter**2 - floor**2, 0.0)
                said[..., half] = np.sqrt(said[..., half] ** 2 + extra)
        return said

    def misfits(self) -> tuple[Array, Array]:
        """Distances of the rigid robot."""
        return self.aligned, self.aligned

    def ends(self) -> dict[str, tuple[str, Array]]:
        """The markers' parts and places."""
        return ends_of(self.sheet.markers)

    def holding_torques(self) -> Array:
        """What holds each joint ``(g, n)`` by the model, N mm or N."""
        return self.forward_of(self.machine, self.data).holding()

    def at_candidates(self, state: FittedState, candidates: Candidates) -> Linearised:
        """The model at a state in other postures, under wrenches on the markers where some were measured."""
        g = len(candidates)
        blank = self.data.only(np.zeros(g, dtype=int))
        wrench = candidates.load if self.points else np.zeros_like(blank.wrench)
        data = replace(blank, q=candidates.q, wrench=wrench, time=None, temperature=None, row=np.arange(g))
        machine = self.machine_of(state.hypothesis.as_deflected)
        forward = PoseForward(machine, data, self.sheet.test.gravity, self.forward().centre)
        there = {m.name: m for m in members_of(machine, data, np.ones(machine.tree.coordinates), ordered=False)}
        forward.members = [
            replace(there[m.name], scale=m.scale) if m.name in there else replace(m, basis=np.zeros(g))
            for m in self.members
        ]
        return forward.evaluate(state.z, state.frames)

    @property
    def points(self) -> tuple[str, ...]:
        """Markers, where wrenches on them were measured; else none."""
        return self.data.markers if self.data.wrench.any() else ()

    def drawn(self, rng: np.random.Generator, count: int, within: Ranges | None = None) -> Candidates:
        """Postures as `postures` draws them. Where wrenches were measured, each is under one of those, or free."""
        return self.with_wrenches(self.postures(rng, count, within), rng)

    def with_wrenches(self, q: Array, rng: np.random.Generator) -> Candidates:
        """Each posture ``(c, n)`` under the wrenches of a reading drawn from the loaded ones, every third free."""
        load = np.zeros((len(q), len(self.points), 6))
        if self.points:
            loaded = np.flatnonzero(self.data.wrench.any(axis=(1, 2)))
            load[:] = self.data.wrench[rng.choice(loaded, len(q))]
            load[::3] = 0.0
        return Candidates(q, load)
