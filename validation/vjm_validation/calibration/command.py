"""``validate calibrate``: from a test's two files to the calibration's three."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from vjm.io.files import check_writable, write_whole
from vjm.programme import Programme
from vjm_validation.calibration.design import parsed_ramps
from vjm_validation.calibration.document import Calibration
from vjm_validation.calibration.fit import fit
from vjm_validation.calibration.page import write_page
from vjm_validation.calibration.problem import Problem, problem_of
from vjm_validation.calibration.results import results
from vjm_validation.measurement import Measurement, read_measurement
from vjm_validation.summary import as_json

DOCUMENT, MODEL, PAGE = "calibration.json", "calibrated-model.toml", "calibration.html"
STAGES = 3
"""Fitting, judging, drawing."""


@dataclass(frozen=True)
class Task:
    """A calibration whose files and options make sense.

    Attributes:
        measurement: sheet, readings and nominal machine.
        problem: what is looked for.
        ramps: feasible next experiments; empty: the usual ones.
    """

    measurement: Measurement
    problem: Problem
    ramps: tuple[Programme, ...]


def prepare(data: Path, sheet: Path, names: Sequence[str] = (), ramps: Sequence[str] = ()) -> Task:
    """Read and check all that a calibration needs.

    Args:
        data: readings, CSV.
        sheet: test sheet, TOML.
        names: parameters, see `vjm_validation.calibration.unknowns.unknowns`.
        ramps: feasible next experiments, see `vjm_validation.calibration.design.parsed_ramps`.

    Raises:
        ValueError: a file or an option cannot be used; one line.
    """
    measurement = read_measurement(data, sheet)
    return Task(measurement, problem_of(measurement, names), tuple(parsed_ramps(ramps, measurement.chain)))


def calibrate(
    task: Task, out: Path, *, figure: str = "", progress: Callable[[int], None] = lambda done: None
) -> Calibration:
    """Calibrate a machine and write what was found.

    Args:
        task: see `prepare`.
        out: folder for `DOCUMENT`, `MODEL` and `PAGE`; all are written at the end or none.
        figure: that the next experiment is to make certain, see `vjm_validation.calibration.design.in_view`.
        progress: called with how many of `STAGES` are done.

    Raises:
        ValueError: the figure is none, or the calibrated machine is none that a model file admits.
        vjm.equilibrium.NoConvergenceError: the nominal model does not reach the readings.
        OSError: the folder cannot be written to.
    """
    check_writable(out)
    found = fit(task.problem)
    progress(1)
    document, model = results(task.measurement, found, ramps=task.ramps, figure=figure, model_file=MODEL)
    progress(2)
    page = write_page(task.measurement, found, document)
    for name, content in ((DOCUMENT, as_json(document)), (MODEL, model), (PAGE, page)):
        write_whole(out / name, content)
    progress(STAGES)
    return document
