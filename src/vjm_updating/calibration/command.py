"""``validate calibrate``: from a test's two files to the calibration's three."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vjm.io.files import check_writable, write_together
from vjm.io.findings import Finding
from vjm.model.load_case import LoadCase
from vjm_output.documents import as_json, doubt_rows
from vjm_output.optional_page import page_of
from vjm_updating.calibration.design import parsed_ramps
from vjm_updating.calibration.document import Calibration
from vjm_updating.calibration.fit import MISFIT, Solution, solve
from vjm_updating.calibration.identifiability import identifiability
from vjm_updating.calibration.problem import Problem, problem_of, with_promises
from vjm_updating.calibration.results import results
from vjm_updating.experiment import Measurement, read_measurement
from vjm_updating.experiment.mistakes import columns_mistaken, refuse_mistaken
from vjm_updating.experiment.plausibility import considered

DOCUMENT, MODEL, PAGE = "calibration.json", "calibrated-model.toml", "calibration.html"
MISSES, MISTAKEN = "it does not explain its own readings", "its readings are mistaken"
TAKEN_BY_FORCE = "; --force takes the readings as they are, and the model says so"
STAGES = 3
"""Fitting, judging, drawing."""


@dataclass(frozen=True)
class Task:
    """A calibration whose files and options make sense.

    Attributes:
        measurement: sheet, readings and nominal machine.
        problem: what is looked for.
        ramps: feasible next experiments; empty: the usual ones.
        findings: what is implausible about the measurement.
    """

    measurement: Measurement
    problem: Problem
    ramps: tuple[LoadCase, ...]
    findings: tuple[Finding, ...] = ()


def prepare(
    data: Path, sheet: Path, names: Sequence[str] = (), ramps: Sequence[str] = (), *, strict: bool = False,
    force: bool = False,
) -> Task:  # fmt: skip
    """Read and check all that a calibration needs.

    Args:
        data: readings, CSV.
        sheet: test sheet, TOML.
        names: parameters, see `vjm_updating.calibration.parameters.unknowns`.
        ramps: feasible next experiments, see `vjm_updating.calibration.design.parsed_ramps`.
        strict: whether doubtful readings are refused.
        force: whether readings are taken whose columns are not what they say.

    Raises:
        ValueError: a file or an option cannot be used; one line.
    """
    measurement = read_measurement(data, sheet)
    problem, wanted = problem_of(measurement, names), tuple(parsed_ramps(ramps, measurement.chain))
    findings = tuple(considered(measurement, strict=strict))
    if not force:
        refuse_mistaken(findings, TAKEN_BY_FORCE)
    return Task(measurement, problem, wanted, findings)


def calibrate(
    task: Task,
    out: Path,
    *,
    figure: str = "",
    force: bool = False,
    progress: Callable[[int], None] = lambda done: None,
) -> Calibration:
    """Calibrate a machine and write what was found.

    A model that is not for use is written only by ``force``, and says so in its file; see `judged`.

    Args:
        task: see `prepare`.
        out: folder for `DOCUMENT`, `MODEL` and, where the extra ``report`` is installed, `PAGE`; all are written
            at the end or none. A model or a page of an earlier calibration is removed where this one writes none.
        figure: that the next experiment is to make certain, see `vjm_updating.calibration.design.in_view`.
        force: whether a model is written that is not for use.
        progress: called with how many of `STAGES` are done.

    Raises:
        ValueError: the figure is none, or the calibrated machine is none that a model file admits.
        vjm.statics.equilibrium.NoConvergenceError: the nominal model does not reach the readings.
        OSError: the folder cannot be written to.
    """
    check_writable(out)
    found = _told_apart(solve(task.problem))
    progress(1)
    document, model = results(task.measurement, found, ramps=task.ramps, figure=figure, model_file=MODEL)
    document = judged(document, task.findings, force=force)
    progress(2)

    def page() -> str:
        # matplotlib takes a second to import, and is an extra
        from vjm_updating.calibration.page import write_page

        return write_page(task.measurement, found, document)

    files = {out / DOCUMENT: as_json(document), **page_of(out / PAGE, page)}
    if document.calibrated_model:
        files[out / MODEL] = "".join(f"# {line}\n" for line in warned(document)) + model
    write_together(files)
    if not document.calibrated_model:
        (out / MODEL).unlink(missing_ok=True)
    progress(STAGES)
    return document


def judged(document: Calibration, findings: Sequence[Finding], *, force: bool) -> Calibration:
    """A calibration with what is doubted, and whether its model is for use, and is written.

    It is not for use where it misses its own readings, or where columns are not what they say, which `prepare`
    takes by force alone: a machine that fits them is another one.

    Args:
        document: what was found.
        findings: what is implausible about the test.
        force: whether a model is written that is not for use.
    """
    unfit = [] if document.fit.fits else [MISSES]
    unfit += [f"{MISTAKEN}: {one}" for one in columns_mistaken(findings)]
    changed = {"doubts": doubt_rows(findings), "unfit": unfit}
    return document.model_copy(update=changed if force or not unfit else changed | {"calibrated_model": ""})


def warned(document: Calibration) -> list[str]:
    """Lines of the head of a model that is not for use; none where it is."""
    return [f"Not for use: {reason}; see {DOCUMENT}." for reason in document.unfit]


def _told_apart(found: Solution) -> Solution:
    """A solution, or where its parameters are not distinguishable the one with beams as the sheet promises them.

    The second counts where it explains the readings as well and each of its parameters has a number. What the
    nuisances' priors take is part of what explains: each promised beam adds one square of a standard normal to it,
    whose sum is judged as the variance of residuals is.
    """
    if identifiability(found).separable.all() or (problem := with_promises(found.problem)) is None:
        return found
    other = solve(problem)
    n, more = len(other.problem.promised), float(np.sum(other.pulls**2) - np.sum(found.pulls**2))
    within = more <= n * (1.0 + MISFIT * np.sqrt(2.0 / n))
    if not within or not (other.whitening.spread <= found.whitening.spread).all():
        return replace(found, refuted=other.problem.promised)
    return other if identifiability(other).separable.all() else found
