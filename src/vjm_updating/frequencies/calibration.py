"""Calibration by natural frequencies, from the fit to the model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from vjm.io.findings import Finding
from vjm_updating.calibration.calibrated_model import calibrated_text
from vjm_updating.calibration.document import (
    Calibration,
    FitRow,
    IdentifiabilityRow,
    PairedRow,
    PairingRow,
)
from vjm_updating.calibration.fit import CalibrationSolution
from vjm_updating.calibration.identifiability import Identifiability, identifiability
from vjm_updating.calibration.parameters import MASS, default_parameters, unknowns
from vjm_updating.calibration.problem import CalibrationProblem
from vjm_updating.calibration.results import fit_row, found_document, identifiability_row
from vjm_updating.calibration.run import distinguishable_solution, finished
from vjm_updating.constants import stated_level
from vjm_updating.experiment.mistakes import TAKEN_BY_FORCE, refuse_mistaken
from vjm_updating.frequencies.fit import costs_of, observe_frequencies, solve
from vjm_updating.frequencies.forward import FrequencyForward
from vjm_updating.frequencies.measurement import FrequencyMeasurement
from vjm_updating.frequencies.pairing import probability
from vjm_updating.frequencies.plausibility import considered
from vjm_updating.result import CalibrationResult

SURE = stated_level(0.95)
"""Probability of a pairing below which it is said that another one may be right."""


def calibrate_frequencies(
    measurement: FrequencyMeasurement,
    *,
    fit: Sequence[str] = (),
    force: bool = False,
    strict: bool = False,
    warn: Callable[[Sequence[Finding]], None] = lambda _: None,
    progress: Callable[[str], None] = lambda _: None,
) -> CalibrationResult[Calibration]:
    """Calibrate a machine by its natural frequencies; see `vjm_updating.calibrate`.

    Args:
        measurement: the test.
        fit: parameters, see `vjm_updating.calibration.parameters.unknowns`.
        force: whether a model is written that is not for use.
        strict: whether what is doubtful is refused.
        warn: told what is implausible, before anything is fitted.
        progress: told what is being done.

    Raises:
        ValueError: a parameter means nothing, there are too few readings, or the calibrated machine is none that
            a model file admits; one line.
        vjm.errors.NoConvergenceError: the machine has no stable equilibrium in a posture, or too few modes.
    """
    problem = _problem_of(measurement, fit)
    findings = considered(measurement, strict=strict)
    if not force:
        refuse_mistaken(findings, TAKEN_BY_FORCE)
    warn(findings)
    progress("fit and pairing")
    found = distinguishable_solution(problem, lambda one: solve(measurement, one))
    progress("uncertainty")
    document = _document(measurement, found)
    model = calibrated_text(measurement, found.problem.unknowns.build(found.z))
    return finished(document, model, findings, force=force)


def _problem_of(measurement: FrequencyMeasurement, names: Sequence[str]) -> CalibrationProblem:
    chain, engine = measurement.chain, measurement.engine
    wanted = names or default_parameters(engine, chain)
    if not wanted:
        raise ValueError(f"{measurement.sheet.file}: nothing in {chain.name} is elastic: name parameters by --fit")
    found = unknowns(chain, engine, wanted, measurement.nuisances, masses=True)
    count = int(np.isfinite(measurement.frequency).sum())
    if count <= found.parameters:
        raise ValueError(
            f"{measurement.readings.file}: {count} frequencies for {found.parameters} parameters: look for fewer "
            "of them (--fit), or tap in more postures"
        )
    return CalibrationProblem(found, observe_frequencies(measurement), by_default=not names)


def _document(measurement: FrequencyMeasurement, fit: CalibrationSolution) -> Calibration:
    found, pairing = identifiability(fit), _pairing(measurement, fit)
    return found_document(measurement, fit, found).model_copy(
        update={
            "fit": _fit(fit),
            "identifiability": _told(measurement, fit, found, pairing),
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
                        column=measurement.columns[k],
                        mode=int(forward.pairs[i, k]) + 1,
                        measured=float(measurement.frequency[i, k]),
                        computed=float(fit.at.wrench[i, k]),
                        in_sigma=float(fit.at.residual[i, k] / measurement.sigma[i, k]),
                    )
                    for k in columns
                ],
                probability=probability(cost, own),
                otherwise=[int(m) + 1 for m in ways[others[0]][columns]] if others else [],
            )
        )
    return rows


def _told(
    measurement: FrequencyMeasurement,
    fit: CalibrationSolution,
    found: Identifiability,
    pairing: Sequence[PairingRow],
) -> IdentifiabilityRow:
    """What the readings tell, in words: of parameters, of masses, and of the pairing."""
    row, words, forward = identifiability_row(fit, found), [], fit.fitter.forward
    assert isinstance(forward, FrequencyForward)
    names = [unknown.name for unknown in fit.problem.unknowns.sought]
    if not any(name.endswith(f".{MASS}") for name in names):
        known = measurement.sheet.tolerance.mass_rel
        words.append(
            "Frequencies tell stiffnesses over masses. "
            + (
                f"The masses are the model's within the sheet's {known:.2g}, which counts in every uncertainty."
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
