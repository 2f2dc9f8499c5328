"""What to do next with a column: the direct measurement that distinguishes explanations, and what it would show."""

from __future__ import annotations

from collections.abc import Mapping

from vjm_updating.diagnosis.document import ExperimentRow, ValueRow
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.channels import WRENCH


def direct(
    measurement: Measurement, posture: str, cause: str, found: Mapping[str, ValueRow], load: float
) -> ExperimentRow | None:
    """The measurement that shows a cause directly, by how much over the sheet's sigma; None where there is none.

    Args:
        measurement: of the test.
        posture: of the column.
        cause: to be shown.
        found: parameters of the hypothesis that has it.
        load: largest one of the test, N.
    """
    name = next((n for n in found if n.startswith(f"{cause}.")), None)
    if name is None:
        return None
    e, channel = found[name], name.partition(".")[2]
    known, tolerance, cell = measurement.sheet.sigma, measurement.sheet.tolerance, channel == WRENCH[0]
    size = abs(e.value)
    if cause == "instrument_zero":
        what = "load cell" if cell else "ruler"
        return ExperimentRow(
            path=f"take the column out of the rig and read the {what}",
            why=f"an error of zero of the {what} would show as {e.value:.3g} there, against the sheet's "
            f"±{known(channel).zero:.3g}; a column that is stiffer or longer would not",
            posture=posture,
            difference=size,
            channel=channel,
            strength=_over(size, known(channel).zero),
        )
    if cause == "instrument_scale":
        return ExperimentRow(
            path=f"load the cell with a known weight of some {load:.3g} N"
            if cell
            else "lay a second ruler beside the first",
            why=f"an error of its scale would show as {size * load:.3g} N; a column that is stiffer or longer "
            "would not"
            if cell
            else f"it would be off by {100.0 * e.value:.2g} %",
            posture=posture,
            difference=size * load if cell else None,
            channel=channel,
            strength=_over(size, known(channel).scale),
        )
    if cause == "link_compliance":
        return ExperimentRow(
            path="lay the column on two supports and bend it by a known weight at its middle",
            why=f"it would deflect by {100.0 * abs(1.0 - e.value):.2g} % {'less' if e.value < 1.0 else 'more'} "
            "than the model says; errors of zero and scale of the rig do not change it",
            posture=posture,
            strength=_over(abs(1.0 / e.value - 1.0), tolerance.modulus_rel),
        )
    if cause == "link_length":
        return ExperimentRow(
            path="measure the distance between the knife edges with calipers",
            why=f"it would be off by {e.value:.3g} mm",
            posture=posture,
            strength=_over(size, tolerance.link_length_mm),
        )
    return None


def _over(difference: float, sigma: float) -> float | None:
    return difference / sigma if sigma > 0.0 else None
