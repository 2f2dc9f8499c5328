"""The study of a test of poses: where markers stood, seen by a tracker whose frame is not known.

First guesses of that frame and of the markers' places are from nothing but postures and positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vjm.io.fields import rotation
from vjm.rotations import Array, rotation_from_vector
from vjm_updating.constants import numerical
from vjm_updating.inference.significance import median_sigma
from vjm_updating.poses.families import FamilyParameter, members_of
from vjm_updating.poses.forward import Frames, Linearised, PoseForward, SeriesForward
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.measurement import BaseGuess, PoseData, PoseSheet, ends_of
from vjm_updating.poses.state import Candidates, FittedState
from vjm_updating.poses.study import BEHIND_ENCODERS, SeriesStudy

ROUNDS = numerical(50)
SETTLED, SHARE = numerical(1e-6, "mm"), numerical(1e-4)
"""Change of the mean error below which the frames have settled: in mm; above 1 mm over the error."""


def kabsch(p: Array, y: Array) -> tuple[Array, Array]:
    """Rotation ``(3, 3)`` and shift ``(3,)`` that take points ``p`` (n, 3) to ``y`` (n, 3) in least squares.

    Kabsch, Acta Crystallographica A 32, 922, 1976.
    """
    a, b = p.mean(axis=0), y.mean(axis=0)
    U, _, Vt = np.linalg.svd((p - a).T @ (y - b))
    D = np.diag([1.0, 1.0, np.sign(np.linalg.det(Vt.T @ U.T))])
    R = Vt.T @ D @ U.T
    return R, b - R @ a


def _fitted(R: Array, p: Array, position: Array, whole: np.ndarray, prior: Array) -> tuple[Array, Array, Array]:
    """The tracker's frame and the markers' places by Gauss and Newton's steps; see `align`.

    They begin at Kabsch's frame. In a small region the places and the frame do nearly the same, and finding one of
    them after the other would take thousands of rounds. ``whole`` (g, k) says which positions were seen.

    Returns:
        Q ``(3, 3)``, t ``(3,)``, m ``(k, 3)``.
    """
    k = p.shape[1]
    of = np.broadcast_to(np.arange(k), whole.shape)[whole]
    R, p, y = R[whole], p[whole], position[whole]
    m, last = np.zeros((k, 3)), np.inf
    Q, t = kabsch(p, y)
    count = np.maximum(np.bincount(of, minlength=k), 1)
    for _ in range(ROUNDS):
        place = (p + np.einsum("sab,sb->sa", R, m[of])) @ Q.T
        error = y - place - t
        size = np.linalg.norm(error, axis=1)
        left = float(size.mean())
        if abs(last - left) < (SHARE * left if left > 1.0 else SETTLED):
            break
        last = left
        J = np.zeros((len(y), 3, 6 + 3 * k))
        for one in range(3):
            # a turn about an axis moves a place along the next two
            two, three = (one + 1) % 3, (one + 2) % 3
            J[:, two, one], J[:, three, one], J[:, one, 3 + one] = -place[:, three], place[:, two], 1.0
        columns = 6 + 3 * of[:, None] + np.arange(3)
        J[np.arange(len(y))[:, None, None], np.arange(3)[:, None], columns[:, None, :]] = Q @ R
        # the prior of a place, in the unit of the errors there
        weight = np.sqrt(np.bincount(of, size**2, minlength=k) / count) / prior
        held = np.zeros((3 * k, 6 + 3 * k))
        held[:, 6:] = np.diag(np.repeat(weight, 3))
        A = np.concatenate([J.reshape(-1, 6 + 3 * k), held])
        b = np.concatenate([error.reshape(-1), -np.repeat(weight, 3) * m.reshape(-1)])
        step = np.linalg.lstsq(A, b, rcond=None)[0]
        Q = rotation_from_vector(step[:3] * min(1.0, 1.0 / max(float(np.linalg.norm(step[:3])), 1e-300))) @ Q
        m = m + step[6:].reshape(-1, 3)
        place = (p + np.einsum("sab,sb->sa", R, m[of])) @ Q.T
        t = (y - place).mean(axis=0)
    return Q, t, m


def with_tilts(frames: Frames, R: Array, tilt: Array, gravity: Sequence[float]) -> Frames:
    """Frames with those of the inclinometers on their bodies, from what they read on a rigid robot.

    Each axis m of an instrument reads ``asin(u · R m)``: linear least squares for its direction, both made
    perpendicular. One that was read in too few directions stays as the sheet's marker is. The end frames R
    ``(g, k, 3, 3)`` are in the base's axes, as gravity; tilts ``(g, k, 2)`` are in rad, nan where not read.
    """
    if not np.isfinite(tilt).any():
        return frames
    u = -np.array(gravity) / np.linalg.norm(gravity)
    M = frames.M.copy()
    for j in np.flatnonzero(np.isfinite(tilt).any(axis=(0, 2))):
        axes = []
        for k in range(2):
            own = np.isfinite(tilt[:, j, k])
            A = np.swapaxes(R[own, j], 1, 2) @ u
            if own.sum() < 3 or np.linalg.matrix_rank(A, tol=1e-2 * np.sqrt(own.sum())) < 3:
                axes.append(np.full(3, np.nan))
                continue
            axis = np.linalg.lstsq(A, np.sin(tilt[own, j, k]), rcond=None)[0]
            axes.append(axis / np.linalg.norm(axis))
        x, y = axes
        if np.isnan(x).all() and np.isnan(y).all():
            continue
        if np.isnan(x).all():
            x = np.cross(y, np.eye(3)[int(np.argmin(np.abs(y)))])
        if np.isnan(y).all():
            y = np.cross(np.eye(3)[int(np.argmin(np.abs(x)))], x)
        U, _, Vt = np.linalg.svd(np.column_stack([x, y]), full_matrices=False)
        first, second = (U @ Vt).T
        M[j] = np.column_stack([first, second, np.cross(first, second)])
    return Frames(frames.R, frames.t, frames.m, M)


def align(
    R: Array, p: Array, position: Array, orientation: Array, prior: Array, guess: BaseGuess | None
) -> tuple[Frames, Array]:
    """Frames that bring a rigid robot's end frames to the positions, and the distances ``(g, k)`` left, mm.

    Args:
        R: ``(g, k, 3, 3)`` and
        p: ``(g, k, 3)`` end frames in the base.
        position: ``(g, k, 3)`` as tracked, nan where not seen.
        orientation: ``(g, k, 3, 3)``, nan where not tracked.
        prior: ``(k,)`` mm, how well the markers' places are known.
        guess: of the base in the tracker's frame; None: from the data.
    """
    k = p.shape[1]
    whole = np.asarray(np.isfinite(position).all(axis=2))
    m, seen = np.zeros((k, 3)), np.flatnonzero(whole.reshape(-1))
    Q, t = np.eye(3), np.zeros(3)
    if guess is not None:
        Q, t = rotation(guess.turns), np.array(guess.position_mm, dtype=float)
    elif len(seen) >= 3:
        Q, t, m = _fitted(R, p, position, whole, prior)
    M = np.tile(np.eye(3), (k, 1, 1))
    for j in range(k):
        own = np.asarray(np.isfinite(orientation[:, j]).all(axis=(1, 2)))
        if own.any():
            if guess is None and not whole[:, j].any():
                continue
            U, _, Vt = np.linalg.svd(np.einsum("gba,gbc->ac", Q @ R[own, j], orientation[own, j]))
            M[j] = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    seen_at = (p + np.einsum("gkab,kb->gka", R, m)) @ Q.T + t
    distance = np.sqrt(np.nansum((position - seen_at) ** 2, axis=2))
    distance[~np.isfinite(position).any(axis=2)] = np.nan
    return Frames(Q, t, m, M), distance


class PoseStudy(SeriesStudy):
    """A test of poses."""

    sheet: PoseSheet

    def forward_of(self, machine: PoseMachine, data: PoseData) -> PoseForward:
        """The model of readings of the test, by a machine and without members."""
        return PoseForward(machine, data, self.sheet.test.gravity)

    def members_for(self, forward: SeriesForward) -> list[FamilyParameter]:
        """All members that the data can show."""
        members = members_of(self.machine, self.data, forward.torques(), ordered=self.ordered)
        return [m for m in members if not (self.sheet.at_output and m.family in BEHIND_ENCODERS)]

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

    def scatter(self, linearised: Linearised) -> Array:
        """Standard deviations ``(g, k, 6)``: the readings' own and one more for what the model lacks."""
        said = self.stated()
        for half in (slice(0, 3), slice(3, 6)):
            r = np.abs(linearised.residual[..., half])
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
        by_name = {m.name: m for m in members_of(machine, data, np.ones(machine.tree.coordinates), ordered=False)}
        forward.members = [
            replace(by_name[m.name], scale=m.scale) if m.name in by_name else replace(m, basis=np.zeros(g))
            for m in self.members
        ]
        return forward.evaluate(state.z, state.frames)

    def under_loads(self, q: Array, rng: np.random.Generator) -> Candidates:
        """Each posture ``(c, n)`` under the wrenches of a reading drawn from the loaded ones, every third free."""
        load = np.zeros((len(q), len(self.points), 6))
        if self.points:
            loaded = np.flatnonzero(self.data.wrench.any(axis=(1, 2)))
            load[:] = self.data.wrench[rng.choice(loaded, len(q))]
            load[::3] = 0.0
        return Candidates(q, load)
