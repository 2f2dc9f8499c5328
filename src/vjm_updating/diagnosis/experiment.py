"""The next experiment: of postures, directions, cycles and holds the one that tells the members of a class apart.

For each candidate both hypotheses predict the readings. What the less probable one could still make up by its own
coordinates, within what the present test leaves open, does not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from math import ceil

import numpy as np

from vjm.continuation.path import EventKind, Path
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.document import ExperimentRow
from vjm_updating.experiment.data_file import WRENCH
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem
from vjm_updating.inference.forward import Forward
from vjm_updating.inference.observed import Observed, RampRegression, basis, pieces, planned
from vjm_updating.inference.parameters import FitParameter

PER_RAMP = numerical(12)
"""Readings on each way."""
FURTHER, FARTHEST = numerical(2.5), numerical(10.0)
"""Times the load of the test at hand to which another may be taken, and the displacement, mm, at most."""
HELD = numerical(6)
"""Readings while held."""
WANTED, MOST = numerical(4.0), numerical(20)
"""Strength at which two causes are distinguishable for sure, and how often a test is repeated for that at most."""
HELPS = numerical(4)
"""Times `MOST` repetitions that would be needed, up to which so many still tell half as much as wanted."""
CONTENDERS, BETTER = numerical(4), numerical(1.05)
"""Postures of which it is found what repetitions tell, and times that a later candidate must be worth more."""
SMALL = numerical(0.15)
"""Share of the usual reach within which scales and moduli count for little: there backlash and friction show
best."""
SHORT_OF, UNKNOWN = numerical(0.8), numerical(0.1)
"""How near a critical displacement a posture may be taken, and how far, mm, where the model does not say."""


def propose(fitter: LeastSquaresProblem, fits: Sequence[Fit]) -> ExperimentRow | None:
    """The candidate that tells hypotheses best from one another; None where none does by more than the noise.

    Pairs that it distinguishes for sure count no more than that, and it is repeated as often as the others need.

    No posture is taken near a critical point that it was not taken to before: what a machine does there tells all
    hypotheses apart, and may be the last thing that it does.
    """
    observed = fitter.forward.observed
    load = float(np.abs(fits[0].evaluation.prediction[:, 0]).max())
    once: list[tuple[str, str, tuple[float, ...], list[ExperimentRow]]] = []
    for posture in observed.measurement.chain.postures:
        (pull, further_pull), (push, further_push) = (_safe(observed, posture, sign, load) for sign in (1.0, -1.0))
        near, far = min(pull, push), min(further_pull, further_push)
        both = "pull and push"
        load_cases = [
            (both, (near, -near)),
            (both, (SMALL * near, -SMALL * near)),
            ("pull", (pull,)),
            ("push", (-push,)),
            (both, (far, -far)),
        ]
        own: list[ExperimentRow] = []
        for name, ends in load_cases:
            proposals = _told(fitter, fits, posture, name, ends)
            if _better(proposals, own):
                own, chosen = proposals, (posture, name, ends, proposals)
        if own:
            once.append(chosen)
    best: list[ExperimentRow] = []
    for posture, name, ends, proposals in sorted(once, key=lambda one: -_worth(one[-1]))[:CONTENDERS]:
        if best and _worth(best) >= WANTED * len(best):
            break
        enough = [ceil((WANTED / max(_strength(t), 1e-9)) ** 2) for t in proposals]
        times = max((min(n, MOST) for n in enough if n <= HELPS * MOST), default=1)
        often = _told(fitter, fits, posture, name, ends, times) if times > 1 else proposals
        if not _better(often, proposals):
            # readings that decide nothing are not worth their time
            often = proposals
        if _better(often, best):
            best = often
    return min(best, key=_strength) if max(map(_strength, best), default=0.0) >= 1.0 else None


def _strength(proposal: ExperimentRow) -> float:
    """Of the discrimination to be expected, of the two hypotheses that a test distinguishes least."""
    return proposal.strength or 0.0


def _worth(proposals: Sequence[ExperimentRow]) -> float:
    """Of a candidate: what it distinguishes for sure counts no more than that."""
    return sum(min(_strength(t), WANTED) for t in proposals)


def _better(proposals: Sequence[ExperimentRow], best: Sequence[ExperimentRow]) -> bool:
    """Whether a candidate is worth so much more than one before it."""
    return bool(proposals) and (not best or _worth(proposals) > BETTER * _worth(best))


def _told(
    fitter: LeastSquaresProblem,
    fits: Sequence[Fit],
    posture: str,
    name: str,
    ends: tuple[float, ...],
    times: int = 1,
) -> list[ExperimentRow]:
    """How well a candidate tells each pair apart; empty where that cannot be computed for one."""
    made = _observed(fitter.forward.observed, posture, ends * times)
    own = LeastSquaresProblem(Forward(made), fitter.nuisances, fitter.whitening.reading(made))
    shown, slopes = [], []
    for fit in fits:
        evaluation = own.evaluate(fit.parameters, fit.evaluation.z, fit.hypothesis)
        if evaluation is None:
            return []
        shown.append(evaluation)
        # the first one's readings are what others must make up
        slopes.append(own.slopes(fit.parameters, evaluation, fit.hypothesis) if len(shown) > 1 else np.zeros(0))
    to = max(ends) if max(ends) > 0.0 else min(ends)
    path = f"{name} to {to:.4g} mm, out, held and back" + (f", {times} times" if times > 1 else "")
    proposals = []
    for i, j in combinations(range(len(fits)), 2):
        own.weigh(shown[i])
        # residuals against zero readings: prediction with the sign turned
        raw = shown[j].residual - shown[i].residual
        strength, left = left_over(own, raw, slopes[j], fitter.normal(fits[j]), fits[j].parameters)
        forces = np.where(made.present, np.abs(left), 0.0) * np.repeat([1.0, 1e-2], 3)
        k = int(np.argmax(forces.max(axis=0)))
        largest = float(np.abs(left[:, k]).max())
        proposals.append(
            ExperimentRow(posture=posture, path=path, strength=strength, difference=largest, channel=WRENCH[k])
        )
    return proposals


def left_over(
    own: LeastSquaresProblem, raw: Array, J: Array, known: Array, unknowns: Sequence[FitParameter]
) -> tuple[float, Array]:
    """Strength of a difference ``(n, 6)``, and the rest of it, that a hypothesis cannot make up.

    What the test at hand says nothing of, such as a tilt across what is measured, is spread evenly between its
    bounds: without them the hypothesis could show anything, and no experiment would tell it from any. ``own`` fits
    the test to be. ``J`` (n, 6, n_z) are derivatives of the hypothesis' residuals. Its coordinates have the inverse
    covariance ``known`` (n_z, n_z) by the test at hand.
    """
    known = known + np.diag([12.0 / (c.high - c.low) ** 2 for c in unknowns])
    W, r = own.whitening.flat(J), own.whitening.flat(raw)
    fixed = np.array([c.sigma == 0.0 for c in unknowns], dtype=bool)
    A = W.T @ W + known + np.diag(np.where(fixed, 1e12, 1e-9))
    step: Array = np.linalg.solve(A, -(W.T @ r))
    step[fixed] = 0.0
    left = raw + J @ step
    rest = own.whitening.flat(left)
    return max(float(rest @ rest + step @ known @ step), 0.0) ** 0.5, left


def _safe(observed: Observed, posture: str, sign: float, load: float) -> tuple[float, float]:
    """How far a posture may be taken along x: for the load of the test at hand, and for `FURTHER` times that.

    Short of where the nominal model turns critical, or as far as it was taken before.
    """
    own = [sign * observed.imposed[r.index, 0] for r in observed.rays if r.posture == posture]
    taken = max((float(u.max()) for u in own), default=0.0)
    try:
        measurement = observed.measurement
        path = measurement.engine.trace(measurement.chain, LoadCase(posture, sign * FARTHEST))
    except (NoConvergenceError, ValueError):
        return (taken or UNKNOWN, taken or UNKNOWN)
    end = short_of_critical(path, FARTHEST)
    # the force grows up to where it turns critical
    growing = np.maximum.accumulate(np.abs(path.force))
    near, far = (float(np.interp(times * load, growing, path.s)) for times in (1.0, FURTHER))
    return max(taken, min(near, end)), max(taken, min(far, end))


def short_of_critical(path: Path, most: float) -> float:
    """How far a path may be taken, at most so far: short of where it turns critical, or ends."""
    sharp = [event.s for event in path.events if event.kind is not EventKind.STIFFNESS_KNEE]
    return min([most, *(SHORT_OF * s for s in sharp), *([] if path.complete else [SHORT_OF * path.s[-1]])])


def out_and_back(end: float) -> Array:
    """Out, held and back."""
    out = np.linspace(0.0, end, PER_RAMP + 1)
    return np.concatenate([out[1:], np.full(HELD, end), out[::-1][1:]])


def _observed(observed: Observed, posture: str, ends: tuple[float, ...]) -> Observed:
    """A test to be: ramps out, held and back, with the instruments of the test at hand."""
    u = np.concatenate([out_and_back(end) for end in ends])
    n = len(u)
    made = planned(observed, posture, np.eye(6)[0], u)
    if observed.clock is not None:
        made = replace(made, clock=np.linspace(0.0, (n - 1) * float(np.median(np.diff(observed.clock))), n))
    if observed.warmth is not None:
        made = replace(made, warmth=np.linspace(0.0, float(np.ptp(observed.warmth)), n))
    steady = observed.steady.get(0)
    if steady is not None:
        # it will be driven as the test at hand was
        sequence, order = made.readings.sequence, np.arange(n, dtype=float) if made.clock is None else made.clock
        parts = pieces(sequence, order, u, float(observed.noise.pose[0]))
        if not steady.throughout:
            parts = [(own, slanted) for own, slanted in parts if not slanted]
        moved = np.ones(n)
        moved[np.concatenate([own for own, _ in parts])] = steady.moved.min()
        made = replace(made, steady={0: RampRegression(basis(parts, order), sequence, moved)})
    return made
