"""Mistakes in readings and sheets that are well-formed: other units, signs, swapped columns, repeated rows.

Readings are compared with what the nominal machine's unloaded stiffness predicts at their displacements, before
anything is fitted. A machine that differs from its model changes forces by a factor that its causes explain; a
mistaken unit changes them by exactly a known factor, in whole postures or from one row on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations

import numpy as np

from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_updating.experiment.channels import POSE, TEMPERATURE, TIME, WRENCH
from vjm_updating.experiment.measurement import Measurement
from vjm_updating.experiment.readings import Readings

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
FEW, LEAST = 5, 3
"""Readings on each side of a change; readings of a test without which nothing can be said."""


class Grade(StrEnum):
    """What is done about a finding."""

    REFUSED = "refused"
    """Physically impossible: no result is computed."""
    DOUBTFUL = "doubtful"
    """Likely a mistake: a warning, which ``--strict`` makes a refusal."""
    NOTED = "noted"
    """Worth knowing."""


@dataclass(frozen=True)
class Finding:
    """One implausible thing.

    Attributes:
        grade: what is done about it.
        where: file, and posture, column or key.
        found: what was found, and the likely mistake.
    """

    grade: Grade
    where: str
    found: str

    def __str__(self) -> str:
        return f"{self.where}: {self.found}"


Rule = Callable[["Comparison"], Iterator[Finding]]


class Comparison:
    """Readings beside the nominal machine's prediction.

    Attributes:
        measurement: sheet, readings, machine.
        readings: its readings.
        labels: postures in the order of the file.
        stiffness: unloaded ``(6, 6)`` by posture.
    """

    def __init__(self, measurement: Measurement) -> None:
        self.measurement, self.readings = measurement, measurement.readings
        self.labels: list[str] = list(dict.fromkeys(self.readings.posture.tolist()))
        engine, chain = measurement.engine, measurement.chain
        self.stiffness = {
            label: np.asarray(engine.problem(chain, LoadCase(label, 1.0)).unloaded().stiffness)
            for label in self.labels
        }

    @property
    def comparable(self) -> bool:
        """Whether displacements of the end-effector and wrenches were read."""
        return self.measurement.imposed and any(name in self.readings.values for name in WRENCH)

    def at(self, label: str) -> np.ndarray:
        """Indices of the readings of a posture whose displacement is known."""
        return np.flatnonzero((self.readings.posture == label) & ~np.isnan(self.readings.pose).any(axis=1))

    def predicted(self, at: np.ndarray, label: str, order: tuple[int, ...] = (0, 1, 2, 3, 4, 5)) -> Array:
        """Wrenches ``(k, 6)`` by a posture's stiffness, the columns of the displacement in another order."""
        result: Array = self.readings.pose[at][:, list(order)] @ self.stiffness[label].T
        return result

    def ratios(self, label: str) -> tuple[np.ndarray, Array]:
        """Forces along the prediction over it, at the larger half of the displacements: indices, ratios."""
        at = self.at(label)
        f, g = self.readings.wrench[at, :3], self.predicted(at, label)[:, :3]
        known = ~np.isnan(f)
        along, size = np.sum(np.where(known, f * g, 0.0), axis=1), np.sum(np.where(known, g * g, 0.0), axis=1)
        large = (size > 0.0) & (size >= np.median(size))
        return at[large], along[large] / size[large]

    def error(self, at: np.ndarray, predicted: Array) -> float:
        """Norm of what is measured less what is predicted ``(k, 6)``, over the prediction's; forces only."""
        f, g = self.readings.wrench[at, :3], predicted[:, :3]
        known = ~np.isnan(f)
        size = float(np.linalg.norm(g[known]))
        return float(np.linalg.norm((f - g)[known])) / size if size > 0.0 else float("inf")


def plausibility(measurement: Measurement) -> list[Finding]:
    """What is implausible about a test, refusals first.

    Raises:
        NoConvergenceError: the nominal machine has no equilibrium in a posture.
    """
    compared = Comparison(measurement)
    found = [finding for rule in RULES for finding in rule(compared)]
    return sorted(found, key=lambda finding: list(Grade).index(finding.grade))


# --- units and signs --------------------------------------------------------------------------------------------


def _units(c: Comparison) -> Iterator[Finding]:
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


def _signs(c: Comparison) -> Iterator[Finding]:
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


def _swapped_columns(c: Comparison) -> Iterator[Finding]:
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


def _swapped_postures(c: Comparison) -> Iterator[Finding]:
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


# --- rows, clock, temperature -----------------------------------------------------------------------------------


def _rows(c: Comparison) -> Iterator[Finding]:
    """Rows that stand twice, and channels that are mostly blank."""
    r = c.readings
    table = np.column_stack([np.nan_to_num(r.values[name], nan=1e300) for name in r.channels])
    half = len(r) // 2
    # a slow test may give one reading again and again; that every second row repeats the first is no chance
    pairs = (
        half >= FEW
        and bool(np.ptp(table, axis=0).any())
        and np.mean(
            (table[0 : 2 * half : 2] == table[1 : 2 * half : 2]).all(axis=1) & _moving(table)[: 2 * half : 2][:half]
        )
    )
    halves = half >= FEW and np.mean((table[:half] == table[half : 2 * half]).all(axis=1))
    if max(pairs, halves) > 0.8:
        yield Finding(
            Grade.DOUBTFUL,
            f"{r.file}: row {r.row[1] if pairs > halves else r.row[half]}",
            f"{'every row stands twice' if pairs > halves else 'the second half repeats the first'}: "
            "was the file written twice?",
        )
    for name in r.channels:
        blank = int(np.isnan(r.values[name]).sum())
        if blank > 0.4 * len(r):
            yield Finding(
                Grade.DOUBTFUL,
                f"{r.file}: column {name}",
                f"{blank} of {len(r)} readings are blank: was the right column exported?",
            )


def _moving(table: Array) -> np.ndarray:
    """Which rows ``(n,)`` differ from the one two before or behind: those of a test that goes on."""
    moves = np.ones(len(table), dtype=bool)
    moves[:-2] = (table[2:] != table[:-2]).any(axis=1)
    return moves


def _clock(c: Comparison) -> Iterator[Finding]:
    """Times that stand twice or are negative, and one posture in milliseconds."""
    r = c.readings
    if TIME not in r.values:
        return
    time = r.values[TIME]
    if np.nanmin(time, initial=0.0) < 0.0:
        row = r.row[int(np.nanargmin(time))]
        yield Finding(Grade.DOUBTFUL, f"{r.file}: row {row}, column {TIME}", "the clock is negative")
    steps = {}
    for number in np.unique(r.sequence):
        step = np.diff(time[r.sequence == number])
        step = step[~np.isnan(step)]
        if len(step) >= FEW:
            steps[number] = float(np.median(step))
            if np.mean(step == 0.0) > 0.3:
                row = r.row[r.sequence == number][0]
                yield Finding(
                    Grade.DOUBTFUL, f"{r.file}: row {row}, column {TIME}", "many readings have the same time"
                )
    usual = min(steps.values(), default=0.0)
    for number, step in steps.items():
        if usual > 0.0 and 300.0 < step / usual < 3000.0:
            label, row = r.posture[r.sequence == number][0], r.row[r.sequence == number][0]
            yield Finding(
                Grade.DOUBTFUL,
                f"{r.file}: posture {label}, row {row}, column {TIME}",
                f"readings lie {step / usual:.0f} times further apart than elsewhere: is the clock in ms there?",
            )


def _temperature(c: Comparison) -> Iterator[Finding]:
    """Temperatures that no room has."""
    r = c.readings
    heat = r.values.get(TEMPERATURE)
    if heat is None or np.isnan(heat).all():
        return
    where = f"{r.file}: column {TEMPERATURE}"
    if np.nanmin(heat) < -273.15:
        yield Finding(Grade.REFUSED, where, f"{np.nanmin(heat):g} °C is below absolute zero")
    elif np.nanmax(heat) > 1500.0:
        yield Finding(Grade.REFUSED, where, f"{np.nanmax(heat):g} °C: no machine is tested so hot")
    elif np.nanmin(heat) > 200.0:
        yield Finding(Grade.DOUBTFUL, where, f"{np.nanmedian(heat):g} °C: is it in kelvin? Subtract 273.15")


def _nothing_read(c: Comparison) -> Iterator[Finding]:
    """Readings that say nothing."""
    r = c.readings
    loaded = [name for name in r.channels if name in WRENCH]
    if loaded and all(np.nanmax(r.values[n], initial=-np.inf) <= np.nanmin(r.values[n], initial=np.inf)
                      for n in loaded):  # fmt: skip
        yield Finding(
            Grade.REFUSED, f"{r.file}: column {', '.join(loaded)}", "every reading is the same: no load was read"
        )
    usable = int(np.sum(~np.isnan(r.pose).any(axis=1) & ~np.isnan(r.wrench).all(axis=1)))
    if c.measurement.imposed and usable < LEAST:
        yield Finding(
            Grade.REFUSED, r.file, f"{usable} readings have both a displacement and a force: {LEAST} are needed"
        )


# --- the sheet --------------------------------------------------------------------------------------------------


def _sheet(c: Comparison) -> Iterator[Finding]:
    """Instruments and tolerances that no maker promises."""
    sheet, r = c.measurement.sheet, c.readings
    for name in (name for name in r.channels if name in sheet.instrument):
        known, where = sheet.instrument[name], f"{sheet.file}: [instrument.{name}]"
        values = r.values[name][~np.isnan(r.values[name])]
        span = float(np.ptp(values)) if len(values) else 0.0
        if known.noise == 0.0 and name in WRENCH:
            yield Finding(Grade.DOUBTFUL, where, "noise = 0: no instrument is without; every misfit then counts")
        elif 0.0 < known.noise < 1e-9 * span:
            yield Finding(Grade.DOUBTFUL, where, f"noise = {known.noise:g} is below the reading's last digit")
        elif known.noise > span > 0.0:
            yield Finding(
                Grade.DOUBTFUL,
                where,
                f"noise = {known.noise:g} is more than the whole test's span of {span:g}: nothing can be seen",
            )
        elif name in WRENCH and known.noise and (rough := _roughness(r, name)) > 100.0 * known.noise:
            yield Finding(
                Grade.DOUBTFUL,
                where,
                f"noise = {known.noise:g}, but neighbouring readings scatter by {rough:.3g}: another unit?",
            )
        if known.scale > 0.3:
            yield Finding(
                Grade.DOUBTFUL, where, f"scale = {known.scale:g} is {known.scale:.0%}: is it in per cent?"
            )
    longest = c.measurement.chain.characteristic_length
    if sheet.tolerance.link_length_mm > 0.1 * longest:
        yield Finding(
            Grade.DOUBTFUL,
            f"{sheet.file}: [tolerance] link_length_mm",
            f"{sheet.tolerance.link_length_mm:g} mm is {sheet.tolerance.link_length_mm / longest:.0%} of the "
            "longest part: is it in µm?",
        )
    if sheet.tolerance.modulus_rel > 0.3:
        yield Finding(
            Grade.DOUBTFUL,
            f"{sheet.file}: [tolerance] modulus_rel",
            f"{sheet.tolerance.modulus_rel:g} is {sheet.tolerance.modulus_rel:.0%}: is it in per cent?",
        )
    if sheet.test.gravity is not None and abs(np.linalg.norm(sheet.test.gravity) - 1.0) > 0.01:
        yield Finding(
            Grade.NOTED,
            f"{sheet.file}: [test] gravity",
            f"has length {np.linalg.norm(sheet.test.gravity):.3g}: only its direction is used, of 1 g",
        )


def _roughness(r: Readings, name: str) -> float:
    """Standard deviation of the noise as second differences of neighbouring readings show it, by their median."""
    parts = [np.diff(r.values[name][r.sequence == s], 2) for s in np.unique(r.sequence)]
    second = np.concatenate(parts) if parts else np.zeros(0)
    second = second[~np.isnan(second)]
    return float(np.median(np.abs(second)) / 0.6745 / np.sqrt(6.0)) if len(second) >= FEW else 0.0


RULES: tuple[Rule, ...] = (
    _nothing_read, _temperature, _units, _signs, _swapped_columns, _swapped_postures, _rows, _clock, _sheet,
)  # fmt: skip
"""All rules."""
