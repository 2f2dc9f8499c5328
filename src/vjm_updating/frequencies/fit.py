"""The most probable parameters by frequencies, and which mode each frequency is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.calibration.fit import MISFIT, ROUNDING, SETTLED, CalibrationSolution, deviations
from vjm_updating.calibration.parameters import Unknowns
from vjm_updating.calibration.problem import CalibrationProblem
from vjm_updating.constants import numerical
from vjm_updating.experiment.rays import Ray
from vjm_updating.frequencies.forward import FrequencyForward
from vjm_updating.frequencies.measurement import FrequencyMeasurement
from vjm_updating.frequencies.pairing import pairings, skipping, unlikeliness
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.trust_region import best_fit
from vjm_updating.observation.noise import Noise
from vjm_updating.observation.observed import Observed
from vjm_updating.observation.whitening import whitening_of

ROUNDS = numerical(10)
"""In which parameters and pairing are found in turn; each makes the squares smaller."""


def observe_frequencies(measurement: FrequencyMeasurement) -> Observed:
    """The readings of a test: nothing is imposed but the postures."""
    n = len(measurement.readings)
    still = np.zeros(6)
    rays = tuple(
        Ray(label, still, still, np.flatnonzero(measurement.readings.posture == label))
        for label in dict.fromkeys(measurement.readings.posture.tolist())
    )
    return Observed(
        measurement, measurement.readings, np.zeros((n, 6)), measurement.frequency,
        Noise(still, np.where(np.isfinite(measurement.frequency), measurement.sigma, 1.0), {}), rays, None, None,
        {}, measurement.columns,
    )  # fmt: skip


def solve(measurement: FrequencyMeasurement, problem: CalibrationProblem) -> CalibrationSolution:
    """The most probable unknowns with the most probable pairing.

    Where modes may be missing, parameters and pairing are found in turn, from several pairings: a wrong one can
    agree with itself. The first one is the likeliest by the nominal machine within the priors. In the second all
    modes are seen. In each of the others one mode is seen in no posture. A fit that will hardly come to the best
    one's squares is given up.

    Raises:
        NoConvergenceError: the nominal machine has no stable equilibrium in a posture, or fewer modes than were
            read.
    """
    # each as its pairing has come to
    found: dict[bytes, tuple[float, Fitter, FrequencyForward, Fit]] = {}
    for pairs in _starts(measurement, problem):
        least = min((squares for squares, *_ in found.values()), default=np.inf)
        one = _settled(measurement, problem, pairs, least)
        if one is None:
            continue
        fitter, forward, fit = one
        key, squares = forward.pairs.tobytes(), fitter.squares(problem.unknowns.all, fit.at)
        if key not in found or squares < found[key][0]:
            found[key] = squares, fitter, forward, fit
    if not found:
        raise NoConvergenceError(
            f"{measurement.readings.file}: {measurement.chain.name} has fewer modes than were read in a posture: "
            "give the model more springs ([model] link_segments), or read fewer frequencies"
        )
    (squares, fitter, forward, fit), *others = sorted(found.values(), key=lambda one: one[0])
    if others:
        second = float(np.exp(-0.5 * (others[0][0] - squares)))
        fitter.forward = forward = replace(forward, rival=(others[0][2].pairs, second / (1.0 + second)))
    for _ in range(ROUNDS):
        before, deviation = fit.at.z, deviations(fitter, fit)
        fitter.whitening = replace(fitter.whitening, spread=_spread(fitter, fit, problem.unknowns))
        fit = best_fit(fitter, (), before, []) or fit
        # the spread follows from the unknowns: where they stay, it stays
        if np.max(np.abs(fit.at.z - before) / deviation) < SETTLED:
            break
    fit = replace(fit, jacobian=fitter.slopes(fit.found, fit.at, ()))
    return CalibrationSolution(problem.observed, forward, fitter, fit, problem)


def _settled(
    measurement: FrequencyMeasurement, problem: CalibrationProblem, pairs: np.ndarray, target: float
) -> tuple[Fitter, FrequencyForward, Fit] | None:
    """The best parameters with a pairing ``(n, k)``, the pairing about them, and so on.

    None where the machine lacks a mode that was read. A fit that will not come to the ``target`` ends early.
    """
    unknowns, observed = problem.unknowns, problem.observed
    forward = FrequencyForward(measurement, observed, pairs, unknowns=unknowns)
    z, found = unknowns.start, None
    for _ in range(ROUNDS):
        try:
            nominal = forward.evaluate(unknowns.all, z, ())
        except NoConvergenceError:
            return None
        fitter = Fitter(forward, unknowns.all, whitening_of(observed, nominal), ROUNDING)
        fit = best_fit(fitter, (), z, [], target=target)
        if fit is None:
            return found
        found, z = (fitter, forward, fit), fit.at.z
        pairs = paired(measurement, forward, z)
        if np.array_equal(pairs, forward.pairs):
            break
        forward = forward.paired(pairs)
    return found


def costs_of(
    measurement: FrequencyMeasurement,
    forward: FrequencyForward,
    z: Array,
    spread: float = 1.0,
    root: Array | None = None,
) -> list[tuple[np.ndarray, Array]]:
    """Each row's allowed pairings ``(a, k)`` and their `unlikeliness` ``(a,)`` at unknowns ``(n_z,)``.

    Args:
        measurement: the test.
        forward: its model.
        z: unknowns.
        spread: of the readings' errors over the sheet's.
        root: ``(n_z,)`` standard deviations of the unknowns, which the readings of a row share; none if left out.
    """
    computed = forward.tapped(z).frequencies
    shared = None
    if root is not None:
        shared = np.stack([forward.rates(z, i) * own for i, own in enumerate(root)], axis=2)
    result = []
    for i, (frequency, sigma) in enumerate(zip(measurement.frequency, spread * measurement.sigma, strict=True)):
        ways = pairings(np.isfinite(frequency), measurement.sheet.frequencies.missing)
        cost = unlikeliness(frequency, sigma, computed[i], ways, None if shared is None else shared[i])
        result.append((ways, cost))
    return result


def paired(
    measurement: FrequencyMeasurement, forward: FrequencyForward, z: Array, root: Array | None = None
) -> np.ndarray:
    """The likeliest pairing ``(n, k)`` at unknowns; see `costs_of`."""
    return np.array([ways[int(np.argmin(cost))] for ways, cost in costs_of(measurement, forward, z, root=root)])


def _starts(measurement: FrequencyMeasurement, problem: CalibrationProblem) -> list[np.ndarray]:
    """Pairings ``(n, k)`` to begin from, each once."""
    read, unknowns = np.isfinite(measurement.frequency), problem.unknowns
    missing = measurement.sheet.frequencies.missing
    first = np.array([pairings(row, missing)[0] for row in read])
    if not missing:
        return [first]
    forward = FrequencyForward(measurement, problem.observed, first, unknowns=unknowns)
    starts = [paired(measurement, forward, unknowns.start, unknowns.sigma), first]
    for mode in range(int(read.sum(axis=1).max())):
        starts.append(np.array([skipping(row, mode) for row in read]))
    return list({pairs.tobytes(): pairs for pairs in starts}.values())


def _spread(fitter: Fitter, fit: Fit, unknowns: Unknowns) -> Array:
    """Standard deviation of the residuals over the sheet's, of all columns alike ``(k,)``, where they show one."""
    whitening = replace(fitter.whitening, spread=np.ones(1))
    r, J = whitening.flat(fit.at.residual), whitening.flat(fit.jacobian)
    information = J.T @ J
    # squares that what the readings determine takes of them
    used = float(np.trace(np.linalg.solve(information + np.diag(unknowns.sigma**-2.0), information)))
    freedom = max(len(r) - used, 1.0)
    variance = float(r @ r) / freedom
    wide = variance > 1.0 + MISFIT * np.sqrt(2.0 / freedom)
    return np.full(whitening.present.shape[1], np.sqrt(variance) if wide else 1.0)
