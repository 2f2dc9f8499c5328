"""A test of a robot under a hypothesis: the state of the model, its fit, and its errors held out.

`Study` is what all kinds of test have in common; a kind says what it predicts, which members it can show, what its
instruments leave unknown, and how they scatter.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Self, TypeAlias

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import cho_factor, cho_solve
from scipy.special import fdtrc, fdtri

from vjm.errors import NoConvergenceError
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_updating.constants import numerical, physical_bound, prior_scale, shown, stated_level
from vjm_updating.experiment.data_file import SheetError
from vjm_updating.inference.model_error import integrated, principal
from vjm_updating.inference.significance import FALSE_ALARMS, LAW_ERROR, too_many
from vjm_updating.poses.document import NotKnownRow
from vjm_updating.poses.families import COMPLIANCE, LARGEST, STRETCH, WAVES, FamilyParameter
from vjm_updating.poses.fit import (
    NO_FAMILY,
    SMALLEST_SIZE,
    NormalEquations,
    PoseSolution,
    PostureNoise,
    blocks_of,
    gear_waves,
    held_out,
    noise_of,
    places,
    precision_of,
    scaled,
    solve,
)
from vjm_updating.poses.forward import Frames, Linearised, ReadingsForward, SeriesForward
from vjm_updating.poses.machine import PoseMachine, with_coupling
from vjm_updating.poses.measurement import PoseData, RobotSheet
from vjm_updating.poses.state import COUPLING, Candidates, Errors, FittedState, Folds, Hypothesis, Outlier, folds_of

# --- What it changes of a hypothesis' evidence that the laws of its families are right to some per cent only ------
#
# A spring that stiffens a little, a gear with one more harmonic: what a family does beyond its law is what it does
# by the law times a smooth function of what the law depends on. Geometry, weights and the scales of encoders have
# no such error. See `vjm_updating.inference.model_error`.

DEGREE = numerical(4)
"""Of the polynomials by which a law may be off."""
EXACT = ("joint_offset", "frame_error", "gravity", "encoder_scale", "instrument_zero")
"""Families whose laws are geometry or scales."""


def law_shape(member: FamilyParameter, data: PoseData, bearing: Array) -> Array | None:
    """Functions of the posture ``(g, k)`` by which the law of a member may be off; None: it is exact.

    Args:
        member: of a test.
        data: its postures.
        bearing: ``(g, n_tree)`` what each coordinate bears, N mm or N.
    """
    if member.family in EXACT:
        return None
    if member.kind == COMPLIANCE:
        return _smooth(bearing[:, member.index])
    if member.family == "gear_error":
        q = data.q[:, data.joints.index(member.subject)]
        return np.sqrt(2.0 / len(WAVES)) * np.column_stack([wave(q) for wave in WAVES.values()])
    return None if member.basis is None else _smooth(member.basis)


def _smooth(argument: Array) -> Array | None:
    """Legendre's polynomials ``(g, DEGREE)`` of an argument ``(g,)``, of mean square one in all."""
    most = float(np.abs(argument).max(initial=0.0))
    if most == 0.0:
        return None
    shapes = legendre.legvander(argument / most, DEGREE)[:, 1:]
    return shapes / np.sqrt(DEGREE * np.maximum(np.mean(shapes**2, axis=0), 1e-300))


def law_evidence(
    blocks: NormalEquations, shapes: Sequence[Array | None], members: Sequence[FamilyParameter],
    solution: PoseSolution, noise: PostureNoise, whitened: NormalEquations,
) -> float:  # fmt: skip
    """What the discrepancy of its families adds to the logarithm of a fit's evidence.

    ``blocks`` are the readings as they are, ``whitened`` made independent by the noise, and the solution the fit to
    these. The shapes are those of the members, see `law_shape`.
    """
    n = blocks.nuisances
    groups: dict[tuple[str, int], list[int]] = {}
    for u in solution.active[n:]:
        if shapes[u - n] is not None and solution.z[u] != 0.0:
            groups.setdefault((members[u - n].family, members[u - n].index), []).append(int(u))
    if not groups:
        return 0.0
    made = [
        (blocks.J[:, own] @ solution.z[own])[:, None] * shape[blocks.posture]
        for own in groups.values()
        if (shape := shapes[own[0] - n]) is not None
    ]
    noise2 = solution.noise**2
    D = noise.independent(np.concatenate(made, axis=1)) / solution.noise
    held = np.isin(solution.active, solution.at_bound)
    free = solution.active[~held]
    J = whitened.J[:, free] / solution.noise
    r = (whitened.y - whitened.J[:, solution.active] @ solution.z[solution.active]) / solution.noise
    precision = precision_of(blocks, blocks.family[solution.active], solution.sizes)[~held]
    A, scale = scaled(whitened.N[np.ix_(free, free)] / noise2 + np.diag(precision))
    X = (J.T @ D) * scale[:, None]
    M = D.T @ D - X.T @ cho_solve(cho_factor(A, lower=True), X)
    turn, sizes = principal(M)
    left = (D @ turn).T @ r / sizes
    return -0.5 * integrated(sizes, left, LAW_ERROR)


# --- Which members a test can know at all, before anything is fitted ----------------------------------------------
#
# Functions of a joint's angle: sine and cosine over a part of a turn are polynomials, such as frames, weights and
# springs make too, and what they were fitted to says nothing of the rest of the turn. So they are asked where the
# postures cover the turn. Compliances are seen by *changes* of the torque: a constant one turns the joint by a
# constant angle, which is an offset. Whether one whose torque changes little is needed, what is held out says (see
# `vjm_updating.poses.selection.unneeded`). Backlash is asked where the way of approach is no function of the angle.

WORST_OVER_MEAN = stated_level(9.0)
"""Variance of a once-a-turn error at the worst angle of the turn over its mean at the angles measured: three
standard deviations there for one here. An even half turn has 9.7, six tenths of a turn 4.7, a whole one 1."""
NO_TORQUE = physical_bound(1e-3, "N mm")
"""N mm: change of a torque below which it is none. The most compliant that is built turns by 1e-8 rad under it."""
EXPANDS = physical_bound(2.4e-5, "1/K")
"""1/K, of aluminium: the largest of what links are made of."""
MOST_IMITATED = stated_level(0.75)
"""Share of the way of approach that a cubic of the joint's angle makes: beyond it a standard error doubles."""
TURNED = ("gear_error", "encoder_scale")
"""Families of functions of a joint's angle."""


def knowable(
    members: Sequence[FamilyParameter], machine: PoseMachine, data: PoseData, torque: Array
) -> tuple[list[FamilyParameter], tuple[NotKnownRow, ...]]:
    """The members that the data can know, and the others with the reason.

    ``torque`` (n_tree,) has the standard deviation over the postures of what each coordinate bears, N mm or N.
    """
    reasons = [_reason(member, machine, data, torque) for member in members]
    asked = [member for member, reason in zip(members, reasons, strict=True) if not reason]
    of_part = {(member.family, member.subject) for member in asked}
    others: dict[str, NotKnownRow] = {}
    for member, reason in zip(members, reasons, strict=True):
        if reason:
            whole = (member.family, member.subject) not in of_part and bool(member.subject)
            name = f"{member.family}.{member.subject}" if whole else member.name
            others.setdefault(name, NotKnownRow(name=name, reason=reason))
    return asked, tuple(others.values())


def _reason(member: FamilyParameter, machine: PoseMachine, data: PoseData, torque: Array) -> str:
    """Why a member cannot be known; empty where it can."""
    # a sliding spring's force counts at the machine's reach
    arm = machine.tree.reach if member.unit == "mm/N" else 1.0
    if member.kind == COMPLIANCE and float(torque[member.index]) * arm < NO_TORQUE:
        return "its torque does not change over the postures"
    if member.family in TURNED:
        q = data.q[:, machine.joints.index(member.subject)]
        worst = worst_over_mean(q)
        if worst > WORST_OVER_MEAN:
            far = f"{worst:.0f}" if worst < 1e3 else "a thousand or more"
            return (
                f"its angles, {np.ptp(q):.3g} rad, cover too little of a turn. The variance at the worst angle of "
                f"the turn is {far} times the mean, at most {WORST_OVER_MEAN:.0f}"
            )
    if member.family == "approach" and member.basis is not None:
        q = data.q[:, machine.joints.index(member.subject)]
        if _imitated(q, member.basis) > MOST_IMITATED:
            return "it came to most angles from one side only"
    if member.kind == STRETCH and member.basis is not None:
        noise = float(np.median(data.sigma[np.isfinite(data.position)]))
        if EXPANDS * float(np.ptp(member.basis)) * machine.tree.reach < noise:
            by = np.ptp(member.basis)
            return f"the temperature changes by {by:.2g} K, by which aluminium stretches less than the noise"
    return ""


def worst_over_mean(q: Array) -> float:
    """Variance of a constant with a sine and a cosine at the worst angle of a turn over its mean at angles, rad."""
    A, turn = (_wave(x) for x in (q, np.linspace(-np.pi, np.pi, 361)))
    M = A.T @ A / len(q)
    if np.linalg.cond(M) > 1e12:
        return np.inf
    return float(np.einsum("ij,jk,ik->i", turn, np.linalg.inv(M), turn).max()) / 3.0


def _wave(q: Array) -> Array:
    return np.column_stack([np.ones_like(q), np.sin(q), np.cos(q)])


def _imitated(q: Array, way: Array) -> float:
    """Share of the way of approach ``(g,)`` that a cubic of the angle makes."""
    if not np.ptp(q) > 0.0:
        return 1.0
    A = np.polynomial.legendre.legvander(2.0 * (q - q.min()) / np.ptp(q) - 1.0, 3)
    left = way - A @ np.linalg.lstsq(A, way, rcond=None)[0]
    total = way - way.mean()
    return 1.0 - float(left @ left) / max(float(total @ total), 1e-12)


ROUNDS = numerical(4)
"""Linearisations at most after which a fit has settled."""
SETTLED = numerical(2e-3)
"""Relative change of the mean error that ends them."""
WORSE, SMALLEST_CUT = numerical(1.02), numerical(0.05)
"""Growth of the mean error by a step from which on it is cut, and how far."""
MOST_WAVES = numerical(8)
"""Waves a turn by which gears err in the intervals; faster ones differ from posture to posture and are scatter."""
TAIL = prior_scale(4.0)
"""Degrees of freedom of Student's distribution that weighs outliers down (Lange, Little and Taylor, JASA 84,
1989)."""
OUTLIER = shown(0.15)
"""Weight below which a reading is counted as an outlier."""
Ranges: TypeAlias = Sequence[tuple[float, float]]
"""Least and largest coordinate of each joint, rad or mm."""
BEHIND_ENCODERS = ("actuator_compliance", "approach")
"""Families that are not seen where the joints are measured at the output: their coordinates have them already."""


class Study(ABC):
    """A test, the machine with all that may be wrong with it, and the kinds of holding postures out.

    Attributes:
        sheet: of the test, and
        data: its readings.
        machine: extended.
        outliers: readings that were left out.
        all_members: all numbers that the kind of test can show.
        members: those that the data can know, which a hypothesis may change, and
        families: their families.
        unasked: the others, with the reason.
        prior: standard deviations ``(n_f,)`` of the nuisances.
        folds: kinds of holding out.
        frames: first guess of the nuisances, and
        aligned: ``(g, k)`` mm, what the rigid robot misses with them.
        ordered: whether the postures stand in the order in which they were taken.
        points: of load.
        not_asked: families that the data cannot show, whatever they are, and
        not_asked_for: why, for people.
    """

    baseline: str = "frames only"
    """What is fitted before any family is added, for people."""
    against: tuple[str, str] = (
        "[test] gravity",
        "the joints deflect against the weight: does gravity point the other way in the base's axes?",
    )
    """Where in the sheet, and what to ask, where springs deflect against what loads them."""
    jump: tuple[str, str] = (
        "tracker_jump",
        "from here on all markers stand ({by}) mm off: the tracker's frame jumped",
    )
    """What a step of all readings in the course of the file is: its name, and the words with its size."""
    turns_with_tracker: bool = True
    """Whether readings are places in a tracker's frame."""
    sheet: RobotSheet
    data: PoseData
    machine: PoseMachine
    outliers: tuple[Outlier, ...]
    all_members: list[FamilyParameter]
    members: list[FamilyParameter]
    families: tuple[str, ...]
    unasked: tuple[NotKnownRow, ...]
    torques: Array
    prior: Array
    folds: Folds
    frames: Frames
    aligned: Array
    ordered: bool = False
    points: tuple[str, ...] = ()
    not_asked: tuple[str, ...] = ()
    not_asked_for: str = ""
    _law_shapes: list[Array | None]

    @abstractmethod
    def stated(self) -> Array:
        """Standard deviations ``(g, k, 6)`` of the readings as the sheet and the file give them."""

    @abstractmethod
    def scatter(self, linearised: Linearised) -> Array:
        """Standard deviations ``(g, k, 6)`` of the readings, raised to what the residuals' bulk shows."""

    @abstractmethod
    def at_candidates(self, state: FittedState, candidates: Candidates) -> Linearised:
        """The model at a state in readings that could be taken."""

    @abstractmethod
    def drawn(self, rng: np.random.Generator, count: int, within: Ranges | None = None) -> Candidates:
        """Readings that could be taken, no further than ``within``; None: than what was measured reaches."""

    @abstractmethod
    def forward(self, as_deflected: tuple[str, ...] = ()) -> ReadingsForward:
        """The model with some couplings the other way than the model file has them."""

    @abstractmethod
    def as_modelled(self, springs: Collection[tuple[str, str]]) -> Study:
        """The same test of the machine in which some springs of joints have the model's compliance all the same.

        Of each spring the joint and the label are given, see `vjm_updating.poses.machine.SPRINGS`.
        """

    @property
    @abstractmethod
    def groups(self) -> tuple[SeriesStudy, ...]:
        """Series with frames and zeros of their own, of which the test is made."""

    def number(self, family: str) -> int:
        """Of a family."""
        return self.families.index(family)

    def numbers(self, hypothesis: Hypothesis) -> list[int]:
        """Of a hypothesis' families."""
        return [self.number(family) for family in hypothesis.families]

    def gauss_newton(self, hypothesis: Hypothesis, start: FittedState | None = None) -> FittedState:
        """Fit a hypothesis: linearise, solve, and again until the mean error stays.

        Raises:
            vjm.errors.NoConvergenceError: the model has no equilibrium in a posture.
        """
        free = [m.family in hypothesis.families and m.name not in hypothesis.kept for m in self.members]
        z = np.zeros(len(self.members)) if start is None else np.where(free, start.z, 0.0)
        frames = self.frames if start is None else start.frames
        sizes = None if start is None else start.solution.sizes
        noise = PostureNoise() if start is None else start.noise
        forward, last, cut = self.forward(hypothesis.as_deflected), np.inf, 1.0
        before, step, turn, origin = z, np.zeros_like(z), np.zeros(forward.nuisances), frames
        for round_ in range(ROUNDS + 1):
            evaluated, mean = self._evaluated(forward, z, frames)
            while (evaluated is None or mean > WORSE * last) and cut > SMALLEST_CUT and round_:
                # the step went beyond what is linear, or beyond what the robot can bear
                cut *= 0.5
                z, frames = before + cut * step, forward.moved(origin, cut * turn)
                evaluated, mean = self._evaluated(forward, z, frames)
            stuck = evaluated is None
            if stuck:
                z, frames, mean = before, origin, last
            linearised = forward.evaluate(z, frames) if evaluated is None else evaluated
            sigma, weight = self.noise(linearised)
            blocks = self.blocks(linearised, z, sigma, hypothesis)
            solution = solve(blocks, self.numbers(hypothesis), sizes)
            # a family without effect on a rigid machine may have one at the next linearisation
            sizes = {f: size for f, size in solution.sizes.items() if size > SMALLEST_SIZE}
            if stuck or round_ == ROUNDS or (round_ > 1 and abs(mean - last) < SETTLED * mean):
                break
            last, cut, origin, before = mean, 1.0, frames, z
            step, turn = solution.z[blocks.nuisances :] - z, solution.z[: blocks.nuisances] - linearised.off
            z, frames = z + step, forward.moved(frames, turn)
        errors, whitened = self.errors(blocks, solution, sigma), noise.whitened(blocks)
        return FittedState(
            hypothesis, z, frames, linearised, blocks, solution, noise, whitened, errors, sigma, weight
        )

    def judged(self, state: FittedState, *, gears: bool = False) -> FittedState:
        """The same fit with the correlation of readings that its residuals show: of like postures, and by gears.

        Errors of gears are the same at the same angle.
        """
        turning = np.array([name in self.machine.turning for name in self.data.joints])
        noise = noise_of(state.blocks, state.solution, places(self.data.q, turning))
        if gears and (columns := self._waves(state.blocks)) is not None:
            noise = replace(noise, waves=gear_waves(state.blocks, state.solution, columns))
        return replace(state, noise=noise, whitened=noise.whitened(state.blocks))

    def _waves(self, blocks: NormalEquations) -> Array | None:
        """What waves of the gears do to the whitened readings ``(rows, w)``, per mrad; None where none is seen."""
        waves = []
        for i, m in enumerate(self.members):
            if m.family == "joint_offset" and m.subject in self.machine.turning and m.subject in self.data.joints:
                q = self.data.q[:, self.data.joints.index(m.subject)][blocks.posture]
                angles = q[:, None] * np.arange(1, MOST_WAVES + 1)
                turned = blocks.J[:, blocks.nuisances + i, None]
                waves.append(turned * np.concatenate([np.sin(angles), np.cos(angles)], axis=1))
        return np.concatenate(waves, axis=1) if waves else None

    def _evaluated(self, forward: ReadingsForward, z: Array, frames: Frames) -> tuple[Linearised | None, float]:
        """The model at a state and its mean error; none and infinity where a posture has no equilibrium there."""
        try:
            linearised = forward.evaluate(z, frames)
        except NoConvergenceError:
            return None, np.inf
        return linearised, float(np.nanmean(self.distance(linearised.residual)))

    def noise(self, linearised: Linearised) -> tuple[Array, Array]:
        """Standard deviations ``(g, k, 6)`` with the robust weights in them, and those ``(g, k)``."""
        said = self.scatter(linearised)
        square = np.nansum((linearised.residual / said) ** 2, axis=2)
        count = np.isfinite(linearised.residual).sum(axis=2)
        weight = np.minimum((TAIL + count) / (TAIL + square), 1.0)
        return said / np.sqrt(weight)[..., None], weight

    def blocks(self, linearised: Linearised, z: Array, sigma: Array, hypothesis: Hypothesis) -> NormalEquations:
        """Normal equations of all members and nuisances at a state."""
        J = np.concatenate([linearised.nuisance, linearised.member], axis=3)
        n = linearised.nuisance.shape[3]
        lower = np.concatenate([np.full(n, -np.inf), [member.low for member in self.members]])
        upper = np.concatenate([np.full(n, np.inf), [member.high for member in self.members]])
        largest = {self.number(name): size for name, size in LARGEST.items() if name in self.families}
        return blocks_of(
            linearised.residual + linearised.nuisance @ linearised.off + linearised.member @ z, J, sigma,
            self.folds.parts, n, self.prior,
            self._family(n, hypothesis), lower, largest, upper,
            float(np.median((self.stated() / sigma)[self.present] ** 2)),
        )  # fmt: skip

    def of(self, blocks: NormalEquations, hypothesis: Hypothesis) -> NormalEquations:
        """The same normal equations for a hypothesis that keeps other members."""
        return replace(blocks, family=self._family(blocks.nuisances, hypothesis))

    def _family(self, nuisances: int, hypothesis: Hypothesis) -> np.ndarray:
        """Numbers ``(n_f + P,)`` of the unknowns' families; what a hypothesis keeps has none."""
        own = [NO_FAMILY if m.name in hypothesis.kept else self.number(m.family) for m in self.members]
        return np.array([-1] * nuisances + own, dtype=int)

    def errors(self, blocks: NormalEquations, solution: PoseSolution, sigma: Array) -> Errors:
        """Distances by the linear fit, of readings fitted and held out; nan where nothing can be held out."""
        active = solution.active
        fitted = blocks.y - blocks.J[:, active] @ solution.z[active]
        residuals = [fitted, *(held_out(blocks, solution, way) for way in range(len(self.folds.parts)))]
        fit, *held = (self.distance(self.unwhitened(r, sigma)) for r in residuals)
        random, region, *others = held if self.folds.several else [np.full_like(fit, np.nan) for _ in held]
        series = others.pop() if self.folds.series is not None else None
        levels = None
        if others:
            # the mean over the coordinates that have levels; at random where a reading lies in none
            count = np.sum(np.isfinite(others), axis=0)
            levels = np.where(count > 0, np.nansum(others, axis=0) / np.maximum(count, 1), random)
        return Errors(fit, random, region, levels, series)

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
        return np.where(np.isfinite(residual[..., :3]).any(axis=2), np.sqrt(square), np.nan)

    def tried(self, state: FittedState, hypothesis: Hypothesis) -> tuple[PoseSolution, Errors]:
        """The linear fit of another hypothesis at a state; couplings are linearised anew."""
        blocks = self.blocks_for(state, hypothesis)
        solution = solve(blocks, self.numbers(hypothesis), state.solution.sizes)
        return solution, self.errors(blocks, solution, state.sigma)

    def evidence(self, state: FittedState, hypothesis: Hypothesis) -> float:
        """Logarithm of the evidence of another hypothesis at a state, its laws right to some per cent only."""
        blocks, whitened, solution = self.compared(state, hypothesis)
        by_laws = law_evidence(blocks, self._law_shapes, self.members, solution, state.noise, whitened)
        return solution.evidence + by_laws

    def compared(
        self, state: FittedState, hypothesis: Hypothesis
    ) -> tuple[NormalEquations, NormalEquations, PoseSolution]:
        """Readings as they are, made independent, and the linear fit of another hypothesis at a state to these."""
        blocks = self.blocks_for(state, hypothesis)
        same = set(hypothesis.as_deflected) == set(state.hypothesis.as_deflected)
        whitened = self.of(state.whitened, hypothesis) if same else state.noise.whitened(blocks)
        return blocks, whitened, solve(whitened, self.numbers(hypothesis), state.solution.sizes)

    def blocks_for(self, state: FittedState, hypothesis: Hypothesis) -> NormalEquations:
        """Normal equations of another hypothesis at a state; couplings are linearised anew."""
        if set(hypothesis.as_deflected) == set(state.hypothesis.as_deflected):
            return self.of(state.blocks, hypothesis)
        linearised = self.forward(hypothesis.as_deflected).evaluate(state.z, state.frames)
        return self.blocks(linearised, state.z, state.sigma, hypothesis)


class SeriesStudy(Study):
    """A test of one series: one set of frames, markers and zeros."""

    def __init__(
        self, sheet: RobotSheet, machine: PoseMachine, data: PoseData, outliers: tuple[Outlier, ...] = ()
    ) -> None:
        self.sheet, self.data, self.machine, self.outliers = sheet, data, machine, outliers
        self.ordered, self.points = sheet.ordered, data.loaded
        if sheet.at_output:
            said = "have what bends about their axes in their coordinates"
            self.not_asked = BEHIND_ENCODERS
            self.not_asked_for = f"joints {sheet.meaning} (encoders = 'output') {said}"
        forward = self.forward_of(machine, data)
        self._forward: dict[tuple[str, ...], SeriesForward] = {(): forward}
        self.all_members = self.members_for(forward)
        self.torques = forward.torques()
        self.members, self.unasked = knowable(self.all_members, machine, data, self.torques)
        forward.members = self.members
        bearing = forward.bearing()
        self._law_shapes = [law_shape(member, data, bearing) for member in self.members]
        self.families = tuple(dict.fromkeys(member.family for member in self.members))
        self.folds = folds_of(data.q, self.coordinates())
        self.prior = self.nuisance_prior()
        self.frames, self.aligned = self.first_frames()

    def coordinates(self) -> dict[str, Array]:
        """What may have been moved through a grid, by name ``(g,)``."""
        return dict(zip(self.data.joints, self.data.q.T, strict=True))

    @abstractmethod
    def forward_of(self, machine: PoseMachine, data: PoseData) -> SeriesForward:
        """The model of readings of the test, by a machine and without members."""

    @abstractmethod
    def members_for(self, forward: SeriesForward) -> list[FamilyParameter]:
        """All members that the data can show."""

    @abstractmethod
    def nuisance_prior(self) -> Array:
        """Standard deviations ``(n_f,)`` of the nuisances."""

    @abstractmethod
    def first_frames(self) -> tuple[Frames, Array]:
        """First guess of the nuisances, and what the rigid robot misses ``(g, k)`` mm with them."""

    @abstractmethod
    def misfits(self) -> tuple[Array, Array]:
        """How far off each reading ``(g, k)`` is among the others, in any unit, and in mm; nan where none is."""

    def without_outliers(self) -> Self:
        """The same test without readings that lie far beyond what errors of a robot spread to.

        A robot's errors are functions of its posture, seen in many of them; what one reading has many times over
        is of that reading. It would weigh on every mean distance.
        """
        study = self
        while True:
            misfit, distance = study.misfits()
            far = outlying(misfit)
            if not far.any() or too_many(len(study.outliers) + int(far.sum()), int(np.isfinite(misfit).sum())):
                return study
            outliers = tuple(
                Outlier(int(study.data.row[i]), study.data.markers[j], float(distance[i, j]))
                for i, j in np.argwhere(far)
            )
            study = type(self)(self.sheet, self.machine, study.data.blanked(far), study.outliers + outliers)

    @abstractmethod
    def ends(self) -> dict[str, tuple[str, Array]]:
        """Points of the machine that the test needs: part and place, ``(3,)`` mm, by name."""

    @abstractmethod
    def under_loads(self, q: Array, rng: np.random.Generator) -> Candidates:
        """Postures ``(c, n)``, each under a load as it was measured, or free."""

    def drawn(self, rng: np.random.Generator, count: int, within: Ranges | None = None) -> Candidates:
        """Readings drawn within the limits of all joints; see `Study`.

        Limits of joints that others drive are kept by drawing again; where a thousand times as many draws do not
        give enough, the measured postures that keep them stand in for the rest.
        """
        low, high = (self.data.q.min(axis=0), self.data.q.max(axis=0)) if within is None else np.array(within).T
        for i, limits in enumerate(self.machine.limits):
            if limits is not None:
                low[i], high[i] = max(low[i], limits[0]), min(high[i], limits[1])
        limits_of_all = self.machine.tree.limits
        drawn = np.zeros((0, len(low)))
        for _ in range(1000):
            q = rng.uniform(low, np.maximum(high, low), (count, len(low)))
            drawn = np.concatenate([drawn, q[limits_of_all.kept(self.machine.rows(q))]])
            if len(drawn) >= count:
                return self.under_loads(drawn[:count], rng)
        measured = self.data.q[limits_of_all.kept(self.machine.rows(self.data.q))]
        return self.under_loads(np.concatenate([drawn, measured[: count - len(drawn)]]), rng)

    @property
    def groups(self) -> tuple[SeriesStudy, ...]:
        """The series itself."""
        return (self,)

    def forward(self, as_deflected: tuple[str, ...] = ()) -> SeriesForward:
        """The model with some couplings the other way than the model file has them."""
        key = tuple(sorted(as_deflected))
        if key not in self._forward:
            self._forward[key] = self._forward[()].with_machine(self.machine_of(key))
        return self._forward[key]

    def machine_of(self, as_deflected: Sequence[str]) -> PoseMachine:
        """The machine, extended, with some couplings the other way than the model file has them."""
        if not as_deflected:
            return self.machine
        chain = self.machine.chain
        for joint in as_deflected:
            chain = with_coupling(chain, joint, as_deflected=not self.machine.coupled[joint])
        return self._machine(chain, self.machine.as_modelled)

    def _machine(self, chain: Machine, as_modelled: Collection[tuple[str, str]]) -> PoseMachine:
        test = self.sheet.test
        return PoseMachine(
            chain, self.ends(), rigid=test.rigid, at_output=self.sheet.at_output, as_modelled=as_modelled
        )

    def as_modelled(self, springs: Collection[tuple[str, str]]) -> Self:
        """The same series of the machine in which some springs have the model's compliance all the same."""
        machine = self._machine(self.machine.chain, springs)
        return type(self)(self.sheet, machine, self.data, self.outliers)


def outlying(misfit: Array) -> np.ndarray:
    """Readings that are too far off to be of the others' distribution: Student's, of `TAIL`, with their median.

    Misfits are lengths of vectors of three errors, of any shape and unit; nan where there is none.
    """
    count = int(np.isfinite(misfit).sum())
    F = float(fdtri(3.0, TAIL, 0.5)) * (misfit / np.nanmedian(misfit)) ** 2
    return np.asarray(fdtrc(3.0, TAIL, F) < FALSE_ALARMS / count)


def check_same_machine(other: SeriesStudy, first: Study, words: str, *, alike: bool = False) -> None:
    """Refuse a series of another machine than the first one's, or, where they must be alike, of another kind.

    Raises:
        SheetError: it is; one line, in which the words say what is taken.
    """
    if other.data.joints != first.data.joints:
        raise SheetError(
            f"{other.sheet.file}: {words} of the same machine: its joints are {', '.join(other.data.joints)}, "
            f"those of {first.sheet.file} are {', '.join(first.data.joints)}"
        )
    if other.machine.springs != first.machine.springs or (alike and type(other) is not type(first)):
        both, kind = (" and kind of test", "its kind, ") if alike else ("", "")
        raise SheetError(
            f"{other.sheet.file}: {words} of the same machine{both}: {kind}its model, or 'rigid', is another than "
            f"that of {first.sheet.file}"
        )


def couplings(study: Study) -> Sequence[str]:
    """Names of the couplings that may be the other way than the model has them.

    None of joints that are measured at the output, where what bends is in the coordinates.
    """
    if study.sheet.at_output:
        return []
    return [f"{COUPLING}.{joint}" for joint in study.machine.coupled]
