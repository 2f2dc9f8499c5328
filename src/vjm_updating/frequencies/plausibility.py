"""What is implausible about a test of frequencies: its model, and readings in another unit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.findings import Finding, Grade, refuse, worst_first
from vjm.io.model_plausibility import model_findings
from vjm.rotations import Array
from vjm_updating.experiment.comparison import machines
from vjm_updating.experiment.implausible_readings import MISTAKES, OF_WHOLE, ReadColumns, column_findings
from vjm_updating.experiment.mistakes import ColumnsMistaken
from vjm_updating.experiment.plausibility import said
from vjm_updating.frequencies.forward import pairings, tapped
from vjm_updating.frequencies.measurement import MOST_MISSING, UNITS, FrequencyMeasurement


def considered(measurement: FrequencyMeasurement, *, strict: bool = False) -> list[Finding]:
    """What is implausible about the model, and units that are not Hz; ``strict`` refuses what is doubtful, too.

    Raises:
        ImplausibleError: something cannot be meant; one line.
    """
    name = f"{measurement.sheet.file}, model {measurement.sheet.test.model}"
    findings = worst_first(model_findings(measurement.document, name))
    if not any(getattr(part, "mass", 0.0) for part in measurement.chain.parts):
        findings.insert(0, Finding(Grade.REFUSED, name, "no part has a mass: give its links mass_kg"))
    else:
        try:
            modes = tapped(measurement, measurement.chain).frequencies
        except NoConvergenceError:
            shape = len(measurement.frequency), measurement.frequency.shape[1] + MOST_MISSING
            modes = np.full(shape, np.nan)  # said by the fit
        findings += [*_units(measurement, modes), *_columns(measurement, modes)]
    refuse(findings, strict=strict)
    return findings


def _columns(measurement: FrequencyMeasurement, modes: Array) -> Iterator[Finding]:
    """Mistakes in what was read beside the modes ``(n, m)``, see `vjm_updating.experiment.implausible_readings`."""
    r, read = measurement.readings, measurement.frequency
    # where modes may be missing, which one was read is asked by the fit
    known = measurement.sheet.frequencies.missing == 0 and modes.shape == read.shape
    noise = np.array([np.nanmedian(one) if np.isfinite(one).any() else 0.0 for one in measurement.sigma.T])
    one, predicted = np.zeros(len(read), dtype=int), modes if known else np.full(read.shape, np.nan)
    names = tuple(r.values)[: read.shape[1]]
    yield from column_findings(
        ReadColumns(r.file, r.row, names, read, noise, predicted, one, np.arange(len(read))), MISTAKES, OF_WHOLE
    )


def _units(measurement: FrequencyMeasurement, computed: Array) -> Iterator[Finding]:
    """Frequencies that are no machine's like the model, and are one's in another unit.

    A frequency goes with the root of a stiffness, so that its square differs from the model's as forces may.
    """
    n = len(measurement.frequency)
    far = [k for k in range(n) if not machines(multiples(measurement, computed, [k])[1] ** 2)]
    if not far:
        return
    rows = ", ".join(str(measurement.readings.row[k]) for k in far)
    where = measurement.readings.file + ("" if len(far) == n else f": row{'s' if len(far) > 1 else ''} {rows}")
    for unit in UNITS:
        many = multiples(measurement, computed, far, unit.in_hz)
        if all(machines((one / unit.in_hz) ** 2) for one in many):
            words = (
                f"frequencies are {said(many[1])} what the model predicts: are they in {unit.name} instead of Hz? "
            )
            yield ColumnsMistaken(Grade.DOUBTFUL, where, words + unit.remedy.capitalize())


def multiples(
    measurement: FrequencyMeasurement, computed: Array, rows: Sequence[int], unit: float = 1.0
) -> tuple[float, float, float]:
    """Quartiles over rows of how many times what was computed was read; all 1 where no mode can be compared.

    Computed are ``(n, m)`` Hz of the nominal machine, nan where it has no such mode. Of each row the pairing counts
    that is nearest to the ``unit``, what 1 Hz would be in the readings' unit.
    """
    ratios: list[float] = []
    for read, modes in zip(measurement.frequency[rows], computed[rows], strict=True):
        present = np.isfinite(read)
        ways = [
            read[present] / modes[way[present]] for way in pairings(present, measurement.sheet.frequencies.missing)
        ]
        known = [way for way in ways if np.isfinite(way).all()]
        if known:
            ratios += min(known, key=lambda way: float(np.abs(np.log(way / unit)).sum())).tolist()
    low, middle, high = np.percentile(ratios, [25.0, 50.0, 75.0]) if ratios else (1.0, 1.0, 1.0)
    return float(low), float(middle), float(high)
