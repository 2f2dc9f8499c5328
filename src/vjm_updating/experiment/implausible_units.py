"""Mistakes in units, signs and the places of columns and labels."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from vjm.io.findings import Finding, Grade
from vjm.rotations import Array
from vjm_updating.experiment.channels import POSE, WRENCH
from vjm_updating.experiment.comparison import Comparison
from vjm_updating.experiment.implausible_rows import FEW, LEAST

OTHER_UNITS = {
    "forces in kN, or displacements in µm": 1e-3,
    "forces in kgf": 1.0 / 9.80665,
    "forces in lbf": 1.0 / 4.4482216152605,
    "displacements in cm": 10.0,
    "displacements in inches": 25.4,
    "forces in mN, or displacements in m": 1e3,
}
"""What readings are over their prediction where a unit is mistaken."""
NEAR = 0.12
"""Difference of logarithms up to which a ratio is a known factor: a machine's own departure in one posture."""
STEADY = 0.25
"""Spread (half the interquartile range) of the ratio's logarithm up to which it is one factor."""
FITS, MISSES = 0.5, 0.8
"""Norm of the error over that of the prediction below which a prediction fits, and above which it does not."""


def units(c: Comparison) -> Iterator[Finding]:
    """Whole postures, or the test from one row on, off by the factor between two units."""
    if not c.comparable:
        return
    logs = {label: _log_ratio(c.ratios(label)[1]) for label in c.labels}
    for label, (middle, spread) in logs.items():
        if np.isnan(middle) or spread > STEADY:
            continue
        others = [m for other, (m, s) in logs.items() if other != label and s <= STEADY]
        beside = float(np.median(others)) if others else 0.0
        name = _unit(middle - beside) if abs(beside) < 1.0 else _unit(middle)
        if name:
            rest = "while those of other postures fit" if others and abs(beside) < 1.0 else "in every reading of it"
            yield Finding(
                Grade.DOUBTFUL,
                f"{c.readings.file}: posture {label}",
                f"forces are {np.exp(middle):.3g} of what the model predicts there, {rest}: {name}? Convert them",
            )
    for label in c.labels:
        yield from _change(c, label)


def _change(c: Comparison, label: str) -> Iterator[Finding]:
    """A factor between units from one row of a posture on."""
    at, ratio = c.ratios(label)
    if len(ratio) < 2 * FEW or np.any(ratio <= 0.0):
        return
    logs = np.log(ratio)
    for k in range(FEW, len(logs) - FEW + 1):
        before, behind = logs[:k], logs[k:]
        name = _unit(float(np.median(behind) - np.median(before)))
        back = _unit(float(np.median(before) - np.median(behind)))
        if (name or back) and max(np.ptp(before), np.ptp(behind)) < 2.0 * STEADY:
            row = c.readings.row[at[k if name else k - 1]]
            yield Finding(
                Grade.DOUBTFUL,
                f"{c.readings.file}: posture {label}, row {row}",
                f"forces over displacements change by a factor {np.exp(np.median(behind) - np.median(before)):.3g} "
                f"{'from there on' if name else 'behind it'}: {name or back} {'there' if name else 'before'}?",
            )
            return


def _log_ratio(ratio: Array) -> tuple[float, float]:
    """Median and half the interquartile range of the logarithm; nan where signs differ."""
    if len(ratio) < LEAST or np.any(ratio <= 0.0):
        return float("nan"), float("inf")
    low, middle, high = np.percentile(np.log(ratio), [25.0, 50.0, 75.0])
    return float(middle), float(0.5 * (high - low))


def _unit(log_ratio: float) -> str:
    """The mistaken unit whose factor a ratio is; empty for none."""
    name = min(OTHER_UNITS, key=lambda unit: abs(log_ratio - np.log(OTHER_UNITS[unit])))
    return name if abs(log_ratio - np.log(OTHER_UNITS[name])) < NEAR else ""


def signs(c: Comparison) -> Iterator[Finding]:
    """One posture, or all of them, with the other sign."""
    if not c.comparable:
        return
    medians = {label: float(np.median(r)) for label in c.labels if len(r := c.ratios(label)[1]) >= LEAST}
    for label in (label for label, middle in medians.items() if middle < -0.2):
        yield Finding(
            Grade.DOUBTFUL,
            f"{c.readings.file}: posture {label}",
            "forces point against the displacements, which no stable machine does: turn the sign of one of them",
        )


def swapped_columns(c: Comparison) -> Iterator[Finding]:
    """Two columns of the wrench, or of the displacement, that stand in each other's place."""
    if not c.comparable:
        return
    for label in c.labels:
        at = c.at(label)
        predicted = c.predicted(at, label)
        if c.error(at, predicted) < MISSES:
            continue
        for i, j in combinations(range(6), 2):
            order = list(range(6))
            order[i], order[j] = j, i
            both = POSE[i] in c.readings.values and POSE[j] in c.readings.values
            if both and c.error(at, c.predicted(at, label, tuple(order))) < FITS:
                yield _swap(c, label, POSE[i], POSE[j])
            if WRENCH[i] in c.readings.values and WRENCH[j] in c.readings.values:
                f = c.readings.wrench[at][:, order]
                known = ~np.isnan(f)
                size = float(np.linalg.norm(predicted[known]))
                unit = np.repeat([1.0, 1.0 / c.measurement.chain.characteristic_length], 3)
                error = np.linalg.norm(((f - predicted) * unit)[known]) / max(size, 1e-300)
                here = c.readings.wrench[at]
                before = np.linalg.norm(((here - predicted) * unit)[~np.isnan(here)]) / max(size, 1e-300)
                if error < FITS < MISSES < before:
                    yield _swap(c, label, WRENCH[i], WRENCH[j])


def _swap(c: Comparison, label: str, a: str, b: str) -> Finding:
    return Finding(
        Grade.DOUBTFUL,
        f"{c.readings.file}: posture {label}",
        f"the readings fit the model with the columns {a} and {b} exchanged, not as they stand: are they swapped?",
    )


def swapped_postures(c: Comparison) -> Iterator[Finding]:
    """Two postures whose labels stand in each other's place."""
    if not c.comparable:
        return
    own = {label: c.error(c.at(label), c.predicted(c.at(label), label)) for label in c.labels}
    for a, b in combinations(c.labels, 2):
        crossed = [c.error(c.at(p), c.predicted(c.at(p), q)) for p, q in ((a, b), (b, a))]
        if max(crossed) < FITS and max(own[a], own[b]) > MISSES:
            yield Finding(
                Grade.DOUBTFUL,
                f"{c.readings.file}: postures {a} and {b}",
                f"the readings of {a} fit the model in {b}, and those of {b} in {a}: are the labels swapped?",
            )
