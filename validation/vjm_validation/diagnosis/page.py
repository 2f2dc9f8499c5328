"""``diagnosis.html``: the story of a diagnosis as one page that needs nothing else."""

from __future__ import annotations

import numpy as np

from vjm_validation.diagnosis.document import Diagnosis
from vjm_validation.diagnosis.figures import pictures
from vjm_validation.diagnosis.fitting import Fit
from vjm_validation.diagnosis.preparation import Prepared
from vjm_validation.measurement import Measurement
from vjm_validation.report.style import number
from vjm_validation.report.templating import environment

HEADLINES = {
    "none": "The model explains the data within the sheet's tolerances.",
    "named": "One cause explains what the model gets wrong.",
    "class": "Several causes explain the data alike; these data cannot tell them apart.",
    "unknown": "The model is wrong, and no known cause explains how.",
}


def write_page(measurement: Measurement, prepared: Prepared, fit: Fit, document: Diagnosis) -> str:
    """The page as HTML.

    Args:
        measurement: sheet, readings and nominal machine.
        prepared: the nominal fit.
        fit: of the first candidate, or the nominal one.
        document: what was found.
    """
    observed = prepared.fitter.forward.observed
    titles = {effect.cause: effect.title for effect in prepared.effects}
    force = np.where(observed.present[:, :3], prepared.null.at.residual[:, :3], np.nan)
    headline = HEADLINES[document.verdict]
    if document.verdict == "named" and len(document.causes) > 1:
        headline = f"{len(document.causes)} causes together explain what the model gets wrong."
    return (
        environment()
        .get_template("diagnosis.html.j2")
        .render(
            found=document,
            title=measurement.sheet.test.title,
            model=measurement.chain.name,
            engine=measurement.engine.label,
            files=(measurement.readings.file, measurement.sheet.file),
            source=measurement.sheet.test.source,
            headline=headline,
            titles=titles,
            postures=list(dict.fromkeys(observed.readings.posture.tolist())),
            channels=[*observed.pose_channels, *observed.wrench_channels],
            missed=number(float(np.sqrt(np.nanmean(force**2))) if np.isfinite(force).any() else None, 3),
            pictures=pictures(prepared, fit, document),
        )
    )
