"""``diagnosis.html``: the story of a diagnosis as one page that needs nothing else."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_output.templating import environment
from vjm_updating.calibration.calibrated_model import FILE
from vjm_updating.diagnosis.document import Diagnosis
from vjm_updating.diagnosis.figures import HEADLINES, TONES, Before, nominal, picture, pictures
from vjm_updating.diagnosis.preprocess import Prepared
from vjm_updating.diagnosis.summary_text import CONFIDENCE, no_value, placed
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.mistakes import TITLES
from vjm_updating.inference.fitting import Fit

STEPS = {
    "none": "No further test is needed to explain these data.",
    "named": "No further test is needed to distinguish causes.",
    "unknown": "Repeat the test with a hold, and on the way back: whether the residual follows the displacement, "
    "the clock or the history says where to look. An effect of one's own can be tried with --effects.",
}
"""Where there is no experiment."""


def _channels(prepared: Prepared, fit: Fit, before: Before) -> list[dict[str, object]]:
    """Errors of each channel, root mean square, beside the noise of one reading by the sheet.

    Of the nominal model with the sheet's own values, None where it does not reach the readings, and at its best.
    """
    observed = prepared.fitter.forward.observed

    def rms(residual: Array, c: int) -> float:
        return float(np.sqrt(np.mean(residual[observed.present[:, c], c] ** 2)))

    return [
        {
            "name": name,
            "noise": float(observed.measurement.sheet.sigma(name).noise),
            "drawn": None if before.drawn is None else rms(before.drawn, c),
            "best": rms(before.best, c),
            "after": rms(fit.evaluation.residual, c),
        }
        for c, name in enumerate(observed.columns)
        if observed.present[:, c].any()
    ]


def _common(document: Diagnosis) -> list[str]:
    """Causes of every candidate of a class; none where there is one candidate."""
    sets = [set(candidate.causes) for candidate in document.candidates]
    return sorted(set.intersection(*sets)) if len(sets) > 1 else []


def write_page(measurement: Measurement, prepared: Prepared, fit: Fit, document: Diagnosis) -> str:
    """The page as HTML."""
    observed = prepared.fitter.forward.observed
    titles = TITLES | {effect.cause: effect.title for effect in prepared.effects}
    before = nominal(prepared)
    drawn = pictures(prepared, fit, document, before)
    return (
        environment("vjm_updating.diagnosis")
        .get_template("diagnosis.html.j2")
        .render(
            found=document,
            title=measurement.sheet.test.title,
            model=measurement.chain.name,
            engine=measurement.engine.label,
            files=(measurement.readings.file, measurement.sheet.file),
            source=measurement.sheet.test.source,
            headline=HEADLINES[document.verdict],
            tone=TONES[document.verdict],
            titles=titles,
            common=_common(document),
            postures=list(dict.fromkeys(observed.readings.posture.tolist())),
            channels=[*observed.pose_channels, *observed.wrench_channels],
            errors=_channels(prepared, fit, before),
            chart=picture(document.findings),
            pictures=drawn,
            step=STEPS.get(document.verdict, ""),
            extended=FILE,
            placed=placed,
            no_value=no_value,
            confidence=CONFIDENCE,
            values=int(observed.present.sum()),
        )
    )
