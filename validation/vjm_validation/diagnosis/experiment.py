"""The next experiment: of postures, directions, cycles and holds the one that tells the members of a class apart.

For each candidate both hypotheses predict the readings. What the less probable one could still make up by its own
coordinates, within what the present test leaves open, does not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import ceil

import numpy as np

from vjm.effects.machine import Machine
from vjm.effects.series import History
from vjm.equilibrium import NoConvergenceError
from vjm.paths import EventKind
from vjm.programme import Programme
from vjm.rotations import Array
from vjm_validation.calibration.noise import memory_of
from vjm_validation.calibration.rays import Ray
from vjm_validation.diagnosis.fitting import Fit, Fitter
from vjm_validation.diagnosis.forward import Forward
from vjm_validation.diagnosis.observed import Observed
from vjm_validation.diagnosis.steady import Steady, basis, pieces
from vjm_validation.measurement import Readings
from vjm_validation.measurement.channels import POSE, WRENCH

PER_RAMP = 12
"""Readings on each way."""
FURTHER = 2.5
"""How far beyond the furthest reading a test may be taken."""
HELD = 6
"""Readings while held."""
WANTED, MOST = 4.0, 20
"""Strength at which two causes are told apart for sure, and how often a test is repeated for that at most."""
HELPS = 4
"""Times `MOST` repetitions that would be needed, up to which so many still tell half as much as wanted."""
SMALL = 0.15
"""Share of the usual reach within which scales and moduli count for little: there play and friction show best."""
SHORT_OF, UNKNOWN = 0.8, 0.1
"""How near a critical displacement a posture may be taken, and how far where the model does not say."""


@dataclass(frozen=True)
class Proposal:
    """A test to be done next.

    Attributes:
        posture: label.
        path: what is done, in words.
        strength: of the discrimination to be expected, of the two hypotheses that it tells apart least.
        difference: largest difference of a reading that it would show.
        channel: of that reading.
    """

    posture: str
    path: str
    strength: float
    difference: float
    channel: str


def propose(fitter: Fitter, fits: Sequence[Fit]) -> Proposal | None:
    """The candidate that tells hypotheses best from one another; None where none can be computed.

    Pairs that it tells apart for sure count no more than that, and it is repeated as often as the others need.

    No posture is taken near a critical point that it was not taken to before: what a machine does there tells all
    hypotheses apart, and may be the last thing that it does.

    Args:
        fitter: of the test.
        fits: of the members, the most probable first.
    """
    observed = fitter.forward.observed
    chain = observed.measurement.chain
    pairs = list(combinations(fits, 2))
    best: tuple[float, str, str, tuple[float, ...], list[Proposal]] | None = None
    for posture in chain.postures:
        reach = _reach(observed, posture)
        pull, push = (_safe(observed, posture, sign, FURTHER * reach) for sign in (1.0, -1.0))
        near = min(reach, pull, push)
        both = "pull and push"
        programmes = [
            (both, (near, -near)),
            (both, (SMALL * near, -SMALL * near)),
            ("pull", (min(reach, pull),)),
            ("push", (-min(reach, push),)),
            (both, (min(pull, push), -min(pull, push))),
        ]
        for name, ends in programmes:
            told = _told(fitter, pairs, posture, name, ends, 1)
            worth = sum(min(t.strength, WANTED) for t in told)
            if told and (best is None or worth > 1.05 * best[0]):
                best = worth, posture, name, ends, told
    if best is None:
        return None
    _, posture, name, ends, told = best
    enough = [ceil((WANTED / max(t.strength, 1e-9)) ** 2) for t in told]
    times = max((min(n, MOST) for n in enough if n <= HELPS * MOST), default=1)
    if times > 1:
        told = _told(fitter, pairs, posture, name, ends, times) or told
    return min(told, key=lambda t: t.strength)


def _told(
    fitter: Fitter,
    pairs: Sequence[tuple[Fit, Fit]],
    posture: str,
    name: str,
    ends: tuple[float, ...],
    times: int,
) -> list[Proposal]:
    """How well a candidate tells each pair apart; empty where that cannot be computed for one."""
    found = [_candidate(fitter, one, other, posture, name, ends, times) for one, other in pairs]
    return [f for f in found if f is not None] if None not in found else []


def _reach(observed: Observed, posture: str) -> float:
    """As far as the posture was taken, else as far as any."""
    own = [r for r in observed.rays if r.posture == posture] or list(observed.rays)
    return max(float(np.abs(observed.pose[r.index, 0]).max()) for r in own) or 1.0


def _safe(observed: Observed, posture: str, sign: float, far: float) -> float:
    """How far a posture may be taken along x: short of where the nominal model turns critical, or as before."""
    own = [sign * observed.pose[r.index, 0] for r in observed.rays if r.posture == posture]
    taken = max((float(u.max()) for u in own), default=0.0)
    try:
        measurement = observed.measurement
        path = measurement.engine.walk(measurement.chain, Programme(posture, sign * far))
    except (NoConvergenceError, ValueError):
        return max(taken, UNKNOWN * far)
    sharp = [e.s for e in path.events if e.kind is not EventKind.BEND_OVER]
    end = min([far, *(SHORT_OF * s for s in sharp), *([] if path.complete else [SHORT_OF * path.points[-1].s])])
    return max(taken, end)


def _candidate(
    fitter: Fitter, one: Fit, other: Fit, posture: str, name: str, ends: tuple[float, ...], times: int
) -> Proposal | None:
    made = _observed(fitter.forward.observed, posture, ends * times)
    forward = Forward(made)
    own = Fitter(forward, fitter.nuisances, fitter.whitening)
    first = own.evaluate(one.found, one.at.z, one.hypothesis)
    second = own.evaluate(other.found, other.at.z, other.hypothesis)
    if first is None or second is None:
        return None
    own.whitening = replace(
        fitter.whitening,
        memory=replace(memory_of(made.readings.sequence, made.present), rho=fitter.whitening.memory.rho),
    )
    own.weigh(first)
    # residuals against zero readings: prediction with the sign turned
    raw = second.residual - first.residual
    own.anchor = None
    J = own.slopes(other.found, second, other.hypothesis, fresh=True)
    W, r = own.whitening.flat(J), own.whitening.flat(raw)
    known = fitter.normal(other)
    fixed = np.array([c.sigma == 0.0 for c in other.found], dtype=bool)
    A = W.T @ W + known + np.diag(np.where(fixed, 1e12, 1e-9))
    step: Array = np.linalg.solve(A, -(W.T @ r))
    step[fixed] = 0.0
    left = raw + J @ step
    rest = own.whitening.flat(left)
    strength = max(float(rest @ rest + step @ known @ step), 0.0) ** 0.5
    forces = np.where(made.present, np.abs(left), 0.0) * np.repeat([1.0, 1e-2], 3)
    k = int(np.argmax(forces.max(axis=0)))
    to = max(ends) if max(ends) > 0.0 else min(ends)
    path = f"{name} to {to:.4g} mm, out, held and back" + (f", {times} times" if times > 1 else "")
    return Proposal(posture, path, strength, float(np.abs(left[:, k]).max()), WRENCH[k])


def _way(end: float) -> Array:
    """Out, held and back."""
    out = np.linspace(0.0, end, PER_RAMP + 1)
    return np.concatenate([out[1:], np.full(HELD, end), out[::-1][1:]])


def _observed(observed: Observed, posture: str, ends: tuple[float, ...]) -> Observed:
    """A test to be: ramps out, held and back, with the instruments of the test at hand."""
    u = np.concatenate([_way(end) for end in ends])
    n = len(u)
    pose = np.zeros((n, 6))
    pose[:, 0] = u
    read = observed.present.any(axis=0)
    wrench = np.where(read, 0.0, np.nan) * np.ones((n, 1))
    clock: Array | None = None
    warmth: Array | None = None
    if observed.clock is not None:
        clock = np.linspace(0.0, (n - 1) * float(np.median(np.diff(observed.clock))), n)
    if observed.warmth is not None:
        warmth = np.linspace(0.0, float(np.ptp(observed.warmth)), n)
    begins = np.zeros(n, dtype=bool)
    begins[0] = True
    line = Machine(observed.measurement.chain, observed.measurement.engine).line(posture)
    values: dict[str, Array] = {name: pose[:, k] for k, name in enumerate(POSE) if name in observed.pose_channels}
    readings = Readings("next", np.arange(n), np.full(n, posture), np.ones(n, dtype=int), values)
    x = np.eye(6)[0]
    steady: Steady | None = None
    if observed.steady is not None:
        # it will be steered as the test at hand was
        order = np.arange(n, dtype=float) if clock is None else clock
        parts = pieces(readings.sequence, order, u, float(observed.noise.pose[0]))
        steady = Steady(basis(parts, order), readings.sequence, observed.steady.moved)
    return replace(
        observed,
        readings=readings,
        pose=pose,
        wrench=wrench,
        rays=(Ray(posture, x, x, np.arange(n)),),
        memory=memory_of(readings.sequence, ~np.isnan(wrench)),
        history=History(np.zeros(n) if clock is None else clock, begins, np.tile(line, (n, 1))),
        clock=clock,
        warmth=warmth,
        steady=steady,
    )
