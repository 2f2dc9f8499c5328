"""A test of poses under a hypothesis: the state of the model, its fit, and its errors held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.poses.alignment import align, with_tilts
from vjm_updating.poses.families import LARGEST, members_of
from vjm_updating.poses.fit import Blocks, Solution, blocks_of, held_out, solve
from vjm_updating.poses.folds import Folds, folds_of
from vjm_updating.poses.forward import Frames, Linearised, PoseForward
from vjm_updating.poses.knowable import knowable
from vjm_updating.poses.machine import PoseMachine, with_coupling
from vjm_updating.poses.readings import PoseData
from vjm_updating.poses.sheet import PoseSheet

COUPLING = "coupling"
ROUNDS = 4
"""Linearisations at most after which a fit has settled."""
SETTLED = 2e-3
"""Relative change of the mean error that ends them."""
WORSE, SMALLEST_CUT = 1.02, 0.05
"""Growth of the mean error by a step from which on it is cut, and how far."""
TAIL = 4.0
"""Degrees of freedom of Student's distribution that weighs outliers down (Lange, Little and Taylor, JASA 84,
1989)."""
MEDIAN_TO_SIGMA = 1.4826
OUTLIER = 0.15
"""Weight below which a reading is counted as an outlier."""
OUTLYING, MOST_OUTLIERS = 10.0, 0.05
"""Median distances of the rigid robot beyond which a position is left out (a normal error would reach that once in
10^50 readings), and the share of the postures beyond which it is the median that means nothing."""
RANDOM, REGION = 0, 1
BEHIND_ENCODERS = ("joint_compliance", "approach")
"""Families that are not seen where the joints are measured at the output: their coordinates have them already."""


@dataclass(frozen=True)
class Hypothesis:
    """What is thought wrong.

    Attributes:
        families: names, in the order in which they were added.
        bent: coupled joints that are thought to pass on what bends though the model says not, or the reverse.
    """

    families: tuple[str, ...] = ()
    bent: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Families, and the couplings among them."""
        return self.families + tuple(f"{COUPLING}.{joint}" for joint in self.bent)

    def plus(self, name: str) -> Hypothesis:
        """With one more."""
        if name.startswith(f"{COUPLING}."):
            return Hypothesis(self.families, (*self.bent, name.partition(".")[2]))
        return Hypothesis((*self.families, name), self.bent)

    def minus(self, name: str) -> Hypothesis:
        """Without one."""
        bent = tuple(joint for joint in self.bent if f"{COUPLING}.{joint}" != name)
        return Hypothesis(tuple(f for f in self.families if f != name), bent)


@dataclass(frozen=True)
class Errors:
    """Distances of markers from their predictions, mm; of tracked orientations the positions only.

    Attributes:
        fitted: ``(g, k)`` of all readings fitted.
        random: ``(g, k)`` of postures held out at random.
        region: ``(g, k)`` of regions held out.
    """

    fitted: Array
    random: Array
    region: Array

    @property
    def means(self) -> tuple[float, float, float]:
        """Mean distances."""
        return float(np.nanmean(self.fitted)), float(np.nanmean(self.random)), float(np.nanmean(self.region))


@dataclass(frozen=True)
class State:
    """A hypothesis with its fit.

    Attributes:
        hypothesis: what is thought wrong.
        z: ``(P,)`` members, in units.
        frames: nuisances.
        at: the model there.
        blocks: normal equations of all members there.
        solution: the linear fit there.
        errors: of the readings.
        sigma: ``(g, k, 6)`` standard deviations with the robust weights.
        weight: ``(g, k)`` robust weights.
    """

    hypothesis: Hypothesis
    z: Array
    frames: Frames
    at: Linearised
    blocks: Blocks
    solution: Solution
    errors: Errors
    sigma: Array
    weight: Array


@dataclass(frozen=True)
class Outlier:
    """A position that is not used: its row, marker, and how far it is off, mm."""

    row: int
    marker: str
    distance: float


class Study:
    """A test, the machine with all that may be wrong with it, and the ways of holding postures out."""

    def __init__(
        self, sheet: PoseSheet, machine: PoseMachine, data: PoseData, outliers: tuple[Outlier, ...] = ()
    ) -> None:
        self.sheet, self.data, self.machine, self.outliers = sheet, data, machine, outliers
        forward = PoseForward(machine, data, sheet.test.gravity)
        self._forward: dict[tuple[str, ...], PoseForward] = {(): forward}
        torque = forward.torques()
        all_members = members_of(machine, data, torque, ordered=self.ordered)
        self.all_members = [m for m in all_members if not (sheet.at_output and m.family in BEHIND_ENCODERS)]
        self.members, self.unasked = knowable(self.all_members, machine, data, torque)
        forward.members = self.members
        self.families = tuple(dict.fromkeys(member.family for member in self.members))
        self.folds: Folds = folds_of(data.q)
        guess = sheet.base
        wide = (1e5, 10.0) if guess is None else (guess.sigma_mm, guess.sigma_rad)
        self.prior = np.concatenate(
            [
                np.full(3, wide[1]),
                np.full(3, wide[0]),
                *[np.full(3, table.sigma_mm) for table in sheet.markers.values()],
                np.full(3 * len(forward.tracked), 10.0),
            ]
        )
        R, p = forward.unloaded()
        sigma = np.array([table.sigma_mm for table in sheet.markers.values()])
        frames, self.aligned = align(R, p, data.position, data.orientation, sigma, guess)
        self.frames = with_tilts(frames, R, data.tilt, forward.gravity)

    def without_outliers(self) -> Study:
        """The same test without positions that lie far beyond what errors of a robot spread to.

        A robot's errors are functions of its posture, seen in many of them; what one reading has many times over
        is of that reading. It would weigh on every mean distance.
        """
        study = self
        while True:
            far = study.aligned > OUTLYING * np.nanmedian(study.aligned)
            if not far.any() or len(study.outliers) + far.sum() > MOST_OUTLIERS * self.data.position.shape[0]:
                return study
            found = tuple(
                Outlier(int(study.data.row[i]), study.data.markers[j], float(study.aligned[i, j]))
                for i, j in np.argwhere(far)
            )
            study = Study(self.sheet, self.machine, study.data.blanked(far), study.outliers + found)

    @property
    def ordered(self) -> bool:
        """Whether the postures stand in the order in which they were taken."""
        return self.sheet.test.order == "as taken"

    def forward(self, bent: tuple[str, ...] = ()) -> PoseForward:
        """The model with some couplings the other way than the model file has them."""
        key = tuple(sorted(bent))
        if key not in self._forward:
            chain = self.machine.chain
            for joint in key:
                chain = with_coupling(chain, joint, as_bent=not self.machine.coupled[joint])
            ends = {
                name: (table.on, np.array(table.position_mm, dtype=float))
                for name, table in self.sheet.markers.items()
            }
            machine = PoseMachine(chain, ends, rigid=self.sheet.test.rigid, at_output=self.sheet.at_output)
            self._forward[key] = self._forward[()].with_machine(machine)
        return self._forward[key]

    def holding_torques(self) -> Array:
        """What holds each joint ``(g, n)`` by the model, N mm or N."""
        return self._forward[()].holding()

    def number(self, family: str) -> int:
        """Of a family."""
        return self.families.index(family)

    def numbers(self, hypothesis: Hypothesis) -> list[int]:
        """Of a hypothesis' families."""
        return [self.number(family) for family in hypothesis.families]

    def settle(self, hypothesis: Hypothesis, start: State | None = None, rounds: int = ROUNDS) -> State:
        """Fit a hypothesis: linearise, solve, and again until the mean error stays.

        Raises:
            vjm.errors.NoConvergenceError: the model has no equilibrium in a posture.
        """
        z = np.zeros(len(self.members)) if start is None else self._kept(start.z, hypothesis)
        frames = self.frames if start is None else start.frames
        sizes = None if start is None else start.solution.sizes
        forward, last, cut = self.forward(hypothesis.bent), np.inf, 1.0
        before, step, turn, origin = z, np.zeros_like(z), np.zeros(forward.nuisances), frames
        for round_ in range(rounds + 1):
            found, mean = self._evaluated(forward, z, frames)
            while (found is None or mean > WORSE * last) and cut > SMALLEST_CUT and round_:
                # the step went beyond what is linear, or beyond what the robot can bear
                cut *= 0.5
                z, frames = before + cut * step, forward.moved(origin, cut * turn)
                found, mean = self._evaluated(forward, z, frames)
            stuck = found is None
            if stuck:
                z, frames, mean = before, origin, last
            at = forward.evaluate(z, frames) if found is None else found
            sigma, weight = self.noise(at)
            blocks = self.blocks(at, z, sigma)
            solution = solve(blocks, self.numbers(hypothesis), sizes)
            sizes = solution.sizes
            if stuck or round_ == rounds or (round_ > 1 and abs(mean - last) < SETTLED * mean):
                break
            last, cut, origin, before = mean, 1.0, frames, z
            step, turn = solution.z[blocks.nuisances :] - z, solution.z[: blocks.nuisances]
            z, frames = z + step, forward.moved(frames, turn)
        return State(
            hypothesis, z, frames, at, blocks, solution, self.errors(blocks, solution, sigma), sigma, weight
        )

    def _evaluated(self, forward: PoseForward, z: Array, frames: Frames) -> tuple[Linearised | None, float]:
        """The model at a state and its mean error; none and infinity where a posture has no equilibrium there."""
        try:
            at = forward.evaluate(z, frames)
        except NoConvergenceError:
            return None, np.inf
        return at, float(np.nanmean(self.distance(at.residual)))

    def _kept(self, z: Array, hypothesis: Hypothesis) -> Array:
        keep = np.array([member.family in hypothesis.families for member in self.members])
        return np.where(keep, z, 0.0)

    def noise(self, at: Linearised) -> tuple[Array, Array]:
        """Standard deviations ``(g, k, 6)`` with the robust weights in them, and those ``(g, k)``."""
        said = np.empty_like(at.residual)
        said[..., :3], said[..., 3:] = self.data.sigma, self.sheet.tracker.noise_rad
        for half in (slice(0, 3), slice(3, 6)):
            r = np.abs(at.residual[..., half])
            if np.isfinite(r).any():
                scatter = MEDIAN_TO_SIGMA * float(np.nanmedian(r))
                floor = float(np.nanmedian(said[..., half]))
                extra = max(scatter**2 - floor**2, 0.0)
                said[..., half] = np.sqrt(said[..., half] ** 2 + extra)
        square = np.nansum((at.residual / said) ** 2, axis=2)
        count = np.isfinite(at.residual).sum(axis=2)
        weight = np.minimum((TAIL + count) / (TAIL + square), 1.0)
        return said / np.sqrt(weight)[..., None], weight

    def blocks(self, at: Linearised, z: Array, sigma: Array) -> Blocks:
        """Normal equations of all members and nuisances at a state."""
        J = np.concatenate([at.nuisance, at.member], axis=3)
        n = at.nuisance.shape[3]
        family = np.concatenate([np.full(n, -1), [self.number(member.family) for member in self.members]])
        lower = np.concatenate([np.full(n, -np.inf), [member.lower / member.unit for member in self.members]])
        upper = np.concatenate([np.full(n, np.inf), [member.upper / member.unit for member in self.members]])
        largest = {self.number(name): size for name, size in LARGEST.items() if name in self.families}
        return blocks_of(
            at.residual + at.member @ z,
            J,
            sigma,
            self.folds.parts,
            n,
            self.prior,
            family.astype(int),
            lower,
            largest,
            upper,
        )

    def errors(self, blocks: Blocks, solution: Solution, sigma: Array) -> Errors:
        """Distances by the linear fit, of readings fitted and held out."""
        active = solution.active
        fitted = blocks.y - blocks.J[:, active] @ solution.z[active]
        found = [fitted, held_out(blocks, solution, RANDOM), held_out(blocks, solution, REGION)]
        return Errors(*(self.distance(self.unwhitened(r, sigma)) for r in found))

    def unwhitened(self, whitened: Array, sigma: Array) -> Array:
        """Residuals ``(g, k, 6)`` from whitened rows."""
        result = np.full(sigma.shape, np.nan)
        present = self.present
        result[present] = whitened * sigma[present]
        return result

    @property
    def present(self) -> np.ndarray:
        """Which numbers ``(g, k, 6)`` were read."""
        turned = np.asarray(np.isfinite(self.data.orientation).all(axis=(2, 3)))
        result = np.concatenate([np.isfinite(self.data.position), np.repeat(turned[..., None], 3, axis=2)], axis=2)
        result[..., 3:5] |= np.isfinite(self.data.tilt)
        return result

    @staticmethod
    def distance(residual: Array) -> Array:
        """Distances ``(g, k)`` mm of residuals ``(g, k, 6)``, nan where there is no position."""
        square = np.nansum(residual[..., :3] ** 2, axis=2)
        result: Array = np.where(np.isfinite(residual[..., :3]).any(axis=2), np.sqrt(square), np.nan)
        return result

    def tried(self, state: State, hypothesis: Hypothesis) -> tuple[Solution, Errors]:
        """The linear fit of another hypothesis at a state; couplings are linearised anew."""
        blocks = state.blocks
        if set(hypothesis.bent) != set(state.hypothesis.bent):
            at = self.forward(hypothesis.bent).evaluate(state.z, state.frames)
            blocks = self.blocks(at, state.z, state.sigma)
        solution = solve(blocks, self.numbers(hypothesis), state.solution.sizes)
        return solution, self.errors(blocks, solution, state.sigma)


def couplings(study: Study) -> Sequence[str]:
    """Names of the couplings that may be the other way than the model has them.

    None of joints that are measured at the output, where what bends is in the coordinates.
    """
    if study.sheet.at_output:
        return []
    return [f"{COUPLING}.{joint}" for joint in study.machine.coupled]
