"""The calibration of a machine by ramps, from its fit to its model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from vjm.io.findings import Finding
from vjm_output.documents import doubt_rows
from vjm_updating.calibration.calibrated_model import comments, marked, not_for_use
from vjm_updating.calibration.design import parsed_ramps
from vjm_updating.calibration.document import Calibration
from vjm_updating.calibration.fit import MISFIT, CalibrationSolution, solve
from vjm_updating.calibration.identifiability import identifiability
from vjm_updating.calibration.problem import CalibrationProblem, problem_of, with_promises
from vjm_updating.calibration.results import results
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.mistakes import DIAGNOSED, TAKEN_BY_FORCE, columns_mistaken, refuse_mistaken
from vjm_updating.experiment.plausibility import considered
from vjm_updating.result import CALIBRATED, CalibrationResult

MISSES, MISTAKEN = "it does not explain its own readings", "its readings are mistaken"


def calibrate_ramps(
    measurement: Measurement,
    *,
    fit: Sequence[str] = (),
    ramps: Sequence[str] = (),
    figure: str = "",
    force: bool = False,
    strict: bool = False,
    warn: Callable[[Sequence[Finding]], None] = lambda _: None,
    progress: Callable[[str], None] = lambda _: None,
) -> CalibrationResult[Calibration]:
    """Calibrate a machine by ramps; arguments and errors as of `vjm_updating.calibrate`.

    Args:
        measurement: the test.
        fit: parameters, see `vjm_updating.calibration.parameters.unknowns`.
        ramps: feasible next experiments, see `vjm_updating.calibration.design.parsed_ramps`.
        figure: that the next experiment is to make certain, see `vjm_updating.calibration.design.in_view`.
        force: whether a model is written that is not for use, see `finished`, and mistaken columns are taken.
        strict: whether doubtful readings are refused.
        warn: told what is implausible, before anything is fitted.
        progress: told what is being done.
    """
    problem, feasible = problem_of(measurement, fit), tuple(parsed_ramps(ramps, measurement.chain))
    findings = accepted(measurement, strict=strict, force=force)
    warn(findings)
    progress("fit")
    found = distinguishable_solution(problem, solve)
    progress("uncertainty and predictions")
    document, model = results(measurement, found, ramps=feasible, figure=figure)
    progress("report")

    def page(document: Calibration) -> str:
        # matplotlib takes a second to import, and is an extra
        from vjm_updating.calibration.page import write_page

        return write_page(measurement, found, document)

    return finished(document, model, findings, force=force, page=page)


def accepted(measurement: Measurement, *, strict: bool, force: bool) -> list[Finding]:
    """What is implausible about a test that a machine may be calibrated by.

    Raises:
        ImplausibleError: it is refused for that, or its columns are not what they say and nobody says ``force``.
    """
    findings = considered(measurement, strict=strict)
    if not force:
        refuse_mistaken(findings, DIAGNOSED, TAKEN_BY_FORCE)
    return findings


def finished(
    document: Calibration,
    model: str,
    findings: Sequence[Finding],
    *,
    force: bool,
    page: Callable[[Calibration], str] | None = None,
) -> CalibrationResult[Calibration]:
    """A calibration with what is doubted, and whether its model is for use, and is written.

    It is not for use where it misses its own readings, or where columns are not what they say, which `accepted`
    takes by force alone: a machine that fits them is another one.

    Args:
        document: what was found.
        model: text of the model.
        findings: what is implausible about the test.
        force: whether a model is written that is not for use; it says so in its head.
        page: makes the page of a document.
    """
    unfit = [] if document.fit.fits else [MISSES]
    unfit += [f"{MISTAKEN}: {one}" for one in columns_mistaken(findings)]
    changed = {"doubts": doubt_rows(findings), "unfit": unfit}
    written = force or not unfit
    found = document.model_copy(update=changed if written else changed | {"calibrated_model": ""})
    text = marked(comments(not_for_use(unfit)) + model, unfit)
    return CalibrationResult(found, {CALIBRATED: text if written else ""}, page)


def distinguishable_solution(
    problem: CalibrationProblem, solver: Callable[[CalibrationProblem], CalibrationSolution]
) -> CalibrationSolution:
    """A solution, or where its parameters are not distinguishable the one with beams as the sheet promises them.

    The second counts where it explains the readings as well and each of its parameters has a number. What the
    nuisances' priors take is part of what explains: each promised beam adds one square of a standard normal to it,
    whose sum is judged as the variance of residuals is.

    Raises:
        vjm.errors.NoConvergenceError: as the solver.
    """
    found = solver(problem)
    if identifiability(found).separable.all() or (promised := with_promises(problem)) is None:
        return found
    other = solver(promised)
    n, more = len(other.problem.promised), float(np.sum(other.pulls**2) - np.sum(found.pulls**2))
    within = more <= n * (1.0 + MISFIT * np.sqrt(2.0 / n))
    if not within or not (other.whitening.spread <= found.whitening.spread).all():
        return replace(found, refuted=other.problem.promised)
    return other if identifiability(other).separable.all() else found
