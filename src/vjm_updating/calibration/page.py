"""``calibration.html``: fit, residuals, intervals and correlation as one page that needs nothing else."""

from __future__ import annotations

from vjm_output.templating import environment
from vjm_updating.calibration.document import Calibration
from vjm_updating.calibration.figures import pictures
from vjm_updating.calibration.fit import CalibrationSolution
from vjm_updating.calibration.summary_text import interval
from vjm_updating.experiment import Measurement


def write_page(measurement: Measurement, fit: CalibrationSolution, document: Calibration) -> str:
    """The page as HTML."""
    template = environment("vjm_updating.calibration").get_template("calibration.html.j2")
    return template.render(
        found=document,
        source=measurement.sheet.test.source,
        pictures=pictures(fit, document),
        interval=interval,
    )
