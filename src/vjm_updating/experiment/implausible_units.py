"""Mistakes in units, signs and the places of columns and labels."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from vjm.io.findings import Finding, Grade
from vjm.rotations import Array
from vjm_updating.experiment.channels import POSE, WRENCH
from vjm_updating.experiment.comparison import FEW, Comparison
from vjm_updating.experiment.implausible_rows import LEAST
from vjm_updating.experiment.mistakes import EXCHANGE, SIGN, UNIT, Mistake, MistakeFound

FORCES, SHIFTS = WRENCH, POSE[:3]
OTHER_UNITS = {
    "forces in kN, or displacements in µm": (1e-3, FORCES),
    "forces in kgf": (1.0 / 9.80665, FORCES),
    "forces in lbf": (1.0 / 4.4482216152605, FORCES),
    "displacements in cm": (10.0, SHIFTS),
    "displacements in inches": (25.4, SHIFTS),
    "forces in mN, or displacements in m": (1e3, FORCES),
}
"""What forces are over their prediction where a unit is mistaken, and which columns that concerns."""
NEAR = 0.12
"""Difference of logarithms up to which a ratio is a known factor: a machine's own departure in one posture."""
STEADY = 0.25
"""Spread (half the interquartile range) of the ratio's logarithm up to which it is one factor."""
OPPOSITE = -0.2
"""Ratio of measured to predicted below which the sign is the other one."""
FITS, MISSES = 0.5, 0.8
"""Norm of the error over that of the prediction below which a prediction fits, and above which it does not."""
ALIKE = 0.95
"""Correlation of a channel with its prediction from which on, turned round, it is the prediction."""


def units(c: Comparison) -> Iterator[Finding]:
    """The test from one row on, or whole postures, off by the factor between two units or by the sign."""
    if not c.comparable:
        return
    changed = {label: found for label in c.labels if (found := list(_change(c, label)))}
    logs = {label: _log_ratio(c.ratios(label)[1]) for label in c.labels}
    for label in c.labels:
        if label in changed:
            yield from changed[label]
            continue
        middle, spread = logs[label]
        if np.isnan(middle) or spread > STEADY:
            continue
        others = [m for other, (m, s) in logs.items() if other not in (label, *changed) and s <= STEADY]
        beside = float(np.median(others)) if others else 0.0
        name = _unit(middle - beside) if abs(beside) < 1.0 else _unit(middle)
        if name:
            rest = "while those of other postures fit" if others and abs(beside) < 1.0 else "in every reading of it"
            yield MistakeFound(
                Grade.DOUBTFUL,
                f"{c.readings.file}: posture {label}",
                f"forces are {np.exp(middle):.3g} of what the model predicts there, {rest}: {name}? Convert them",
                _unit_mistake(c, name, c.readings.posture == label),
            )


def _unit_mistake(c: Comparison, name: str, where: np.ndarray) -> Mistake:
    factor, columns = OTHER_UNITS[name]
    # forces are multiplied by what they are too small by, displacements by what makes forces too large
    right = 1.0 / factor if columns is FORCES else factor
    factors = {column: right for column in columns if column in c.readings.values}
    return Mistake(UNIT, where, factors, parameters={f"{UNIT}.{column}": right for column in factors})


def _change(c: Comparison, label: str) -> Iterator[Finding]:
    """A factor between units, or the sign, from one row of a posture on."""
    at, ratio = c.steps(label)
    for k in range(FEW, len(ratio) - FEW + 1):
        before, behind = ratio[k - FEW : k], ratio[k : k + FEW]
        mine = np.median(before)
        rest = np.median(behind)
        if not (_one(before) and _one(behind)):
            continue
        if mine * rest < 0.0 and min(mine, rest) < OPPOSITE:
            late = bool(rest < 0.0)
            yield _from_row(c, label, at, k, late, "the sign is turned", SIGN, dict.fromkeys(_loaded(c), -1.0))
            return
        if mine * rest <= 0.0:
            continue
        jump = float(np.log(rest / mine))
        # which side is the other unit: the one that does not fit the model
        late = abs(float(np.log(abs(rest)))) >= abs(float(np.log(abs(mine))))
        name = _unit(jump if late else -jump)
        if name:
            factor, columns = OTHER_UNITS[name]
            right = 1.0 / factor if columns is FORCES else factor
            factors = {column: right for column in columns if column in c.readings.values}
            yield _from_row(c, label, at, k, late, f"{np.exp(jump):.3g} of what they were: {name}", UNIT, factors)
            return


def _one(ratio: Array) -> bool:
    """Whether ratios are of one sign and one size."""
    return bool(np.all(ratio > 0.0) or np.all(ratio < 0.0)) and float(np.ptp(np.log(np.abs(ratio)))) < 2.0 * STEADY


def _loaded(c: Comparison) -> list[str]:
    return [name for name in WRENCH if name in c.readings.values]


def _from_row(
    c: Comparison, label: str, at: np.ndarray, k: int, late: bool, what: str, cause: str, factors: dict[str, float]
) -> MistakeFound:
    order = np.arange(len(c.readings))
    # unloaded readings between the two that differ go with either
    where = (c.readings.posture == label) & ((order >= at[k]) if late else (order < at[k]))
    row = c.readings.row[at[k]]
    side = "from there on" if late else "before it"
    return MistakeFound(
        Grade.DOUBTFUL,
        f"{c.readings.file}: posture {label}, row {row}",
        f"forces over displacements change at this row, {what} {side}? Convert the rows {side}",
        Mistake(
            cause, where, factors,
            parameters={f"{cause}.{column}": v for column, v in factors.items()} | {f"{cause}.row": float(row)},
        ),
    )  # fmt: skip


def _log_ratio(ratio: Array) -> tuple[float, float]:
    """Median and half the interquartile range of the logarithm; nan where signs differ."""
    if len(ratio) < LEAST or np.any(ratio <= 0.0):
        return float("nan"), float("inf")
    low, middle, high = np.percentile(np.log(ratio), [25.0, 50.0, 75.0])
    return float(middle), float(0.5 * (high - low))


def _unit(log_ratio: float) -> str:
    """The mistaken unit whose factor a ratio is; empty for none."""
    apart = {name: abs(log_ratio - float(np.log(factor))) for name, (factor, _) in OTHER_UNITS.items()}
    name = min(apart, key=lambda unit: apart[unit])
    return name if apart[name] < NEAR else ""


def signs(c: Comparison) -> Iterator[Finding]:
    """One posture, all of them, or one channel, with the other sign."""
    if not c.comparable:
        return
    turned = set()
    for label in c.labels:
        ratio = c.ratios(label)[1]
        if len(ratio) >= LEAST and np.median(ratio) < OPPOSITE:
            turned.add(label)
            factors = dict.fromkeys(_loaded(c), -1.0)
            yield MistakeFound(
                Grade.DOUBTFUL,
                f"{c.readings.file}: posture {label}",
                "forces point against the displacements, as of no stable machine: turn the sign of one of them",
                Mistake(
                    SIGN, c.readings.posture == label, factors,
                    parameters={f"{SIGN}.{name}": -1.0 for name in factors},
                ),
            )  # fmt: skip
    for name in _loaded(c):
        against = [label for label in c.labels if label not in turned and c.agreement(label, name) < -ALIKE]
        if against:
            yield MistakeFound(
                Grade.DOUBTFUL,
                f"{c.readings.file}: column {name}, posture {', '.join(against)}",
                "follows the model's prediction with the other sign, while other columns fit: is its axis turned?",
                Mistake(
                    SIGN, np.isin(c.readings.posture, against), {name: -1.0}, parameters={f"{SIGN}.{name}": -1.0}
                ),
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
    return MistakeFound(
        Grade.DOUBTFUL,
        f"{c.readings.file}: posture {label}",
        f"the readings fit the model with the columns {a} and {b} exchanged, not as they stand: are they swapped?",
        Mistake(EXCHANGE, c.readings.posture == label, exchanged=(a, b)),
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
