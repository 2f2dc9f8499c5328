"""``validate calibrate``: from a test's two files to the calibration's three."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from vjm.io.files import check_writable, write_whole
from vjm_validation.calibration.design import parsed_ramps
from vjm_validation.calibration.document import Calibration
from vjm_validation.calibration.fit import fit
from vjm_validation.calibration.page import write_page
from vjm_validation.calibration.problem import problem_of
from vjm_validation.calibration.results import results
from vjm_validation.measurement import read_measurement
from vjm_validation.summary import as_json

DOCUMENT, MODEL, PAGE = "calibration.json", "calibrated-model.toml", "calibration.html"
STAGES = 4
"""Reading, fitting, judging, writing."""


def calibrate(
    data: Path,
    sheet: Path,
    out: Path,
    *,
    names: Sequence[str] = (),
    ramps: Sequence[str] = (),
    figure: str = "",
    progress: Callable[[int], None] = lambda done: None,
) -> Calibration:
    """Calibrate a machine and write what was found.

    Args:
        data: readings, CSV.
        sheet: test sheet, TOML.
        out: folder for `DOCUMENT`, `MODEL` and `PAGE`; all are written at the end or none.
        names: parameters, see `vjm_validation.calibration.unknowns.unknowns`.
        ramps: feasible next experiments, see `vjm_validation.calibration.design.parsed_ramps`.
        figure: that the next experiment is to make certain, see `vjm_validation.calibration.design.in_view`.
        progress: called with how many of `STAGES` are done.

    Raises:
        ValueError: a file or an option cannot be used; one line.
        vjm.equilibrium.NoConvergenceError: the nominal model does not reach the readings.
        OSError: the folder cannot be written to.
    """
    measurement = read_measurement(data, sheet)
    problem = problem_of(measurement, names)
    programmes = parsed_ramps(ramps, measurement.chain)
    check_writable(out)
    progress(1)
    found = fit(problem)
    progress(2)
    document, model = results(
        measurement, found, sheet=sheet.name, ramps=programmes, figure=figure, model_file=MODEL
    )
    progress(3)
    page = write_page(measurement, found, document)
    for name, content in ((DOCUMENT, as_json(document)), (MODEL, model), (PAGE, page)):
        write_whole(out / name, content)
    progress(STAGES)
    return document
