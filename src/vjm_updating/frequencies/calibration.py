"""Calibration by natural frequencies, from the fit to the model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.findings import Finding
from vjm.rotations import Array
from vjm_updating.calibration.calibrated_model import calibrated_text
from vjm_updating.calibration.document import (
    Calibration,
    FitRow,
    IdentifiabilityRow,
    PairedRow,
    PairingRow,
)
from vjm_updating.calibration.fit import (
    ROUNDING,
    SETTLED,
    CalibrationProblem,
    CalibrationSolution,
    Identifiability,
    deviations,
    identifiability,
    spread_by,
)
from vjm_updating.calibration.parameters import MASS, Unknowns, default_parameters, unknowns
from vjm_updating.calibration.run import (
    distinguishable_solution,
    finished,
    fit_row,
    found_document,
    identifiability_row,
)
from vjm_updating.constants import numerical, stated_level
from vjm_updating.experiment import Kind
from vjm_updating.experiment.comparison import Ray
from vjm_updating.frequencies.forward import FrequencyForward, pairings, probability, skipping, unlikeliness
from vjm_updating.frequencies.measurement import FrequencyMeasurement
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem, best_fit, whitening_of
from vjm_updating.inference.noise import Noise
from vjm_updating.inference.observed import Observed
from vjm_updating.result import CalibrationResult

# --- The most probable parameters by frequencies, and which mode each frequency is --------------------------------

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
    solutions: dict[bytes, tuple[float, LeastSquaresProblem, FrequencyForward, Fit]] = {}
    for pairs in _starts(measurement, problem):
        least = min((squares for squares, *_ in solutions.values()), default=np.inf)
        one = _settled(measurement, problem, pairs, least)
        if one is None:
            continue
        fitter, forward, fit = one
        key, squares = forward.pairs.tobytes(), fitter.squares(problem.unknowns.all, fit.evaluation)
        if key not in solutions or squares < solutions[key][0]:
            solutions[key] = squares, fitter, forward, fit
    if not solutions:
        raise NoConvergenceError(
            f"{measurement.readings.file}: {measurement.chain.name} has fewer modes than were read in a posture: "
            "give the model more springs ([model] link_segments), or read fewer frequencies"
        )
    (squares, fitter, forward, fit), *others = sorted(solutions.values(), key=lambda one: one[0])
    if others:
        second = float(np.exp(-0.5 * (others[0][0] - squares)))
        fitter.forward = forward = replace(forward, rival=(others[0][2].pairs, second / (1.0 + second)))
    for _ in range(ROUNDS):
        before, deviation = fit.evaluation.z, deviations(fitter, fit)
        fitter.whitening = replace(fitter.whitening, spread=_spread(fitter, fit, problem.unknowns))
        fit = best_fit(fitter, (), before, []) or fit
        # the spread follows from the unknowns: where they stay, it stays
        if np.max(np.abs(fit.evaluation.z - before) / deviation) < SETTLED:
            break
    fit = replace(fit, jacobian=fitter.slopes(fit.parameters, fit.evaluation, ()))
    return CalibrationSolution(problem.observed, forward, fitter, fit, problem)


def _settled(
    measurement: FrequencyMeasurement, problem: CalibrationProblem, pairs: np.ndarray, target: float
) -> tuple[LeastSquaresProblem, FrequencyForward, Fit] | None:
    """The best parameters with a pairing ``(n, k)``, the pairing about them, and so on.

    None where the machine lacks a mode that was read. A fit that will not come to the ``target`` ends early.
    """
    unknowns, observed = problem.unknowns, problem.observed
    forward = FrequencyForward(observed, measurement, pairs, unknowns=unknowns)
    z, solution = unknowns.start, None
    for _ in range(ROUNDS):
        try:
            nominal = forward.evaluate(unknowns.all, z, ())
        except NoConvergenceError:
            return None
        fitter = LeastSquaresProblem(forward, unknowns.all, whitening_of(observed, nominal), ROUNDING)
        fit = best_fit(fitter, (), z, [], target=target)
        if fit is None:
            return solution
        solution, z = (fitter, forward, fit), fit.evaluation.z
        pairs = paired(measurement, forward, z)
        if np.array_equal(pairs, forward.pairs):
            break
        forward = forward.paired(pairs)
    return solution


def costs_of(
    measurement: FrequencyMeasurement, forward: FrequencyForward, z: Array, spread: float = 1.0,
    root: Array | None = None,
) -> list[tuple[np.ndarray, Array]]:  # fmt: skip
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
    forward = FrequencyForward(problem.observed, measurement, first, unknowns=unknowns)
    starts = [paired(measurement, forward, unknowns.start, unknowns.sigma), first]
    for mode in range(int(read.sum(axis=1).max())):
        starts.append(np.array([skipping(row, mode) for row in read]))
    return list({pairs.tobytes(): pairs for pairs in starts}.values())


def _spread(fitter: LeastSquaresProblem, fit: Fit, unknowns: Unknowns) -> Array:
    """Standard deviation of the residuals over the sheet's, of all columns alike ``(k,)``, where they show one."""
    whitening = replace(fitter.whitening, spread=np.ones(1))
    r, J = whitening.flat(fit.evaluation.residual), whitening.flat(fit.jacobian)
    information = J.T @ J
    # squares that what the readings determine takes of them
    used = float(np.trace(np.linalg.solve(information + np.diag(unknowns.sigma**-2.0), information)))
    return np.full(whitening.present.shape[1], spread_by(float(r @ r), max(len(r) - used, 1.0)))


SURE = stated_level(0.95)
"""Probability of a pairing below which it is said that another one may be right."""


def calibrate_frequencies(
    measurement: FrequencyMeasurement, considered: Callable[[], list[Finding]], *, fit: Sequence[str] = (),
    force: bool = False, progress: Callable[[str], None] = lambda _: None,
) -> CalibrationResult[Calibration]:  # fmt: skip
    """Calibrate a machine by its natural frequencies; arguments as of `vjm_updating.calibrate`.

    ``considered`` says what is implausible about the test.

    Raises:
        ValueError: a parameter means nothing, there are too few readings, or the calibrated machine is none that
            a model file admits; one line.
        vjm.errors.NoConvergenceError: the machine has no stable equilibrium in a posture, or too few modes.
    """
    problem = _problem_of(measurement, fit)
    findings = considered()
    progress("fit and pairing")
    solution = distinguishable_solution(problem, lambda one: solve(measurement, one))
    progress("uncertainty")
    document = _document(measurement, solution)
    model = calibrated_text(measurement, solution.problem.unknowns.build(solution.z))
    return finished(document, model, findings, force=force)


def _problem_of(measurement: FrequencyMeasurement, names: Sequence[str]) -> CalibrationProblem:
    chain, engine = measurement.chain, measurement.engine
    wanted = names or default_parameters(engine, chain)
    if not wanted:
        raise ValueError(f"{measurement.sheet.file}: nothing in {chain.name} is elastic: name parameters by --fit")
    sought = unknowns(chain, engine, wanted, measurement.nuisances, masses=True)
    count = int(np.isfinite(measurement.frequency).sum())
    if count <= sought.parameters:
        raise ValueError(
            f"{measurement.readings.file}: {count} frequencies for {sought.parameters} parameters: look for fewer "
            "of them (--fit), or tap in more postures"
        )
    return CalibrationProblem(sought, observe_frequencies(measurement), by_default=not names)


def _document(measurement: FrequencyMeasurement, fit: CalibrationSolution) -> Calibration:
    identified, pairing = identifiability(fit), _pairing(measurement, fit)
    return found_document(measurement, fit, identified).model_copy(
        update={
            "fit": _fit(fit),
            "identifiability": _statements(measurement, fit, identified, pairing),
            "pairing": pairing,
        }
    )


def _fit(fit: CalibrationSolution) -> FitRow:
    row = fit_row(fit)
    if row.fits:
        return row
    spread = max(channel.spread for channel in row.channels)
    statement = (
        f"The model misses the frequencies by {spread:.3g} times the sheet's noise. The uncertainties are widened "
        "by that. A mode that was taken for another, a mass that the model lacks, or a soft base can be the cause."
    )
    return row.model_copy(update={"statement": statement})


def _pairing(measurement: FrequencyMeasurement, fit: CalibrationSolution) -> list[PairingRow]:
    forward = fit.fitter.forward
    assert isinstance(forward, FrequencyForward)
    spread = float(fit.whitening.spread[0])
    rows = []
    for i, (ways, cost) in enumerate(costs_of(measurement, forward, fit.z, spread)):
        own = next(k for k, way in enumerate(ways) if np.array_equal(way, forward.pairs[i]))
        others = [int(k) for k in np.argsort(cost) if k != own and np.isfinite(cost[k])]
        columns = np.flatnonzero(forward.pairs[i] >= 0)
        rows.append(
            PairingRow(
                row=int(measurement.readings.row[i]),
                posture=str(measurement.readings.posture[i]),
                payload_kg=float(measurement.payload[i]),
                modes=[
                    PairedRow(
                        column=measurement.columns[k], mode=int(forward.pairs[i, k]) + 1,
                        measured=float(measurement.frequency[i, k]), computed=float(fit.at.prediction[i, k]),
                        in_sigma=float(fit.at.residual[i, k] / measurement.sigma[i, k]),
                    )
                    for k in columns
                ],
                probability=probability(cost, own),
                otherwise=[int(m) + 1 for m in ways[others[0]][columns]] if others else [],
            )
        )  # fmt: skip
    return rows


def _statements(
    measurement: FrequencyMeasurement, fit: CalibrationSolution, identifiability: Identifiability,
    pairing: Sequence[PairingRow],
) -> IdentifiabilityRow:  # fmt: skip
    """What the readings tell, in words: of parameters, of masses, and of the pairing."""
    row, words, forward = identifiability_row(fit, identifiability), [], fit.fitter.forward
    assert isinstance(forward, FrequencyForward)
    names = [unknown.name for unknown in fit.problem.unknowns.sought]
    if not any(name.endswith(f".{MASS}") for name in names):
        own = [one for one in fit.problem.unknowns.nuisances if one.kind == Kind.MASS]
        known = max((one.scale * one.sigma for one in own), default=0.0)
        whose = "the sheet's " if all(one.sigma == 1.0 for one in own) else ""
        words.append(
            "Frequencies tell stiffnesses over masses. "
            + (
                f"The masses are the model's within {whose}{known:.2g}, which counts in every uncertainty."
                if known
                else "The masses are taken to be exactly the model's: [tolerance] mass_rel says how well they are "
                "known."
            )
        )
    unsure = [one for one in pairing if one.probability < SURE]
    words += [
        f"Row {one.row}, posture {one.posture}: modes {_list(m.mode for m in one.modes)} are the likeliest, with "
        f"probability {one.probability:.2g}; {_list(one.otherwise)} may be right."
        for one in unsure
    ]
    rival = forward.rival
    if rival is not None and rival[1] > 1.0 - SURE:
        rows = [
            f"row {one.row}: {_list(int(k) + 1 for k in other if k >= 0)}"
            for one, own, other in zip(pairing, forward.pairs, rival[0], strict=True)
            if not np.array_equal(own, other)
        ]
        words.append(
            f"Other parameters with another pairing ({'; '.join(rows)}) are the right ones with probability "
            f"{rival[1]:.2g}: tap in more postures, or tell modes by their shapes."
        )
    elif measurement.sheet.frequencies.missing and not unsure:
        words.append(f"No other pairing of frequencies with modes is as likely as {1.0 - SURE:.2g}.")
    return row.model_copy(update={"statement": [*row.statement, *words]})


def _list(modes: Iterable[int]) -> str:
    return ", ".join(map(str, modes))
