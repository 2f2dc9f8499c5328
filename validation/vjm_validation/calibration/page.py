"""``calibration.html``: fit, residuals, intervals and correlation as one page that needs nothing else."""

from __future__ import annotations

from vjm_validation.calibration.document import Calibration
from vjm_validation.calibration.figures import pictures
from vjm_validation.calibration.fit import Fit
from vjm_validation.calibration.words import interval
from vjm_validation.measurement import Measurement
from vjm_validation.report.templating import environment


def write_page(measurement: Measurement, fit: Fit, document: Calibration) -> str:
    """The page as HTML."""
    template = environment().get_template("calibration.html.j2")
    return template.render(
        found=document,
        source=measurement.sheet.test.source,
        pictures=pictures(fit, document),
        interval=interval,
    )
