"""Channels that stand still or are rounded beyond their noise, judged by what their own readings show.

How many digits a file prints says little: a cell may count in steps of 1.88 N that are printed to 0.001 N, and
set weights of 10, 20 and 30 N are exact. What tells a mistake is how the channel behaves elsewhere in the test, and
what the channel that goes with it does meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import erf

import numpy as np

from vjm.io.findings import Finding, Grade
from vjm.rotations import Array
from vjm_updating.constants import definition, stated_level
from vjm_updating.experiment.channels import POSE, WRENCH
from vjm_updating.experiment.comparison import FEW, Comparison
from vjm_updating.experiment.readings import DEADBAND, Readings, runs
from vjm_updating.observation.significance import level

CHANCE = stated_level(0.01)
"""That readings repeat as they do, below which it is no chance."""
ROUNDED = definition(0.262)
"""Median distance of one number from the mean of two, all uniform over one: of a rounded reading from the line
through its neighbours, in digits."""


def digits(c: Comparison, name: str) -> Iterator[Finding]:
    """A channel that stands still, which its readings make no chance, or that is rounded far beyond its noise."""
    r, known = c.readings, c.measurement.sheet.errors(name)
    if known.noise == 0.0 or known.held is not None:
        return
    yield from _stuck(c, name, known.noise)
    digit = last_digit(r.values[name])
    if digit > np.sqrt(12.0) * known.noise and _rounded(c, name, digit):
        yield Finding(
            Grade.DOUBTFUL, f"{r.file}: column {name}",
            f"every reading is a multiple of {digit:g}, far above its noise of {known.noise:g}: were digits "
            "lost, or is one in another unit?",
        )  # fmt: skip


def _stuck(c: Comparison, name: str, noise: float) -> Iterator[Finding]:
    r = c.readings
    values = r.values[name]
    found = [(at[a], b - a, len(at)) for at in r.sequences for a, b in runs(values[at])]
    lengths = np.array([count for _, count, _ in found])
    steps = np.diff(np.unique(values[~np.isnan(values)]))
    digit = max(last_digit(values), float(steps.min(initial=np.inf)) if len(steps) else 0.0)
    by_noise = agreeing(digit, noise)
    for k in np.argsort(-lengths, kind="stable").tolist():
        begin, count, of = found[k]
        # what is the same in a whole posture may be so, see `implausible_rows.nothing_read`
        if not FEW <= count < of:
            continue
        # two readings of one value agree by noise, by what the others do, and by the longest of the other runs
        others = np.delete(lengths, k)
        repeating = 1.0 - len(others) / max(int(others.sum()), 1)
        likely = max(by_noise, repeating, len(found) ** (-1.0 / max(int(others.max(initial=1)), 1)))
        if len(r) * likely ** (count - 1) < CHANCE and _moves(c, name, slice(begin, begin + count)):
            yield Finding(
                Grade.DOUBTFUL, f"{r.file}: column {name}, rows {r.row[begin]} to {r.row[begin + count - 1]}",
                f"{count} readings are {values[begin]:g}, under a noise of {noise:g}: "
                "did the channel hang, or reach the end of its range?",
            )  # fmt: skip
            return


def agreeing(digit: float, noise: float) -> float:
    """Probability that two readings of one value, rounded to a digit, are the same; the value lies anywhere."""
    if not noise > 0.0:
        return 1.0
    x = min(digit / (2.0 * noise), 1e6)
    return float(erf(x) - (1.0 - np.exp(-(x**2))) / (x * np.sqrt(np.pi))) if x > 0.0 else 0.0


def _moves(c: Comparison, name: str, rows: slice) -> bool:
    """Whether the channel that goes with one moves in some rows: where it stands, the one may stand, too."""
    if (other := _driving(c.readings, name)) is None:
        return True
    values = c.readings.values[other][rows]
    values = values[~np.isnan(values)]
    noise = c.measurement.sheet.errors(other).noise
    return bool(len(values)) and float(np.ptp(values)) > 2.0 * level(len(values)) * noise


def _rounded(c: Comparison, name: str, digit: float) -> bool:
    """Whether a channel whose readings are multiples of a digit was rounded, and not set to these values.

    The channel that goes with it moves on while a rounded one stands, and rounded readings lie beside the machine's
    curve by shares of the digit.
    """
    r = c.readings
    other = _driving(r, name)
    if other is None:
        return True
    noise = c.measurement.sheet.errors(other).noise
    within, between, beside = 0.0, 0.0, list[tuple[float, bool]]()
    for at in r.sequences:
        at = at[~np.isnan(r.values[name][at]) & ~np.isnan(r.values[other][at])]
        v, w = r.values[name][at], r.values[other][at]
        held = runs(v)
        moves = [abs(float(w[b - 1] - w[a])) for a, b in held]
        within += sum(move for move in moves if move > DEADBAND * noise)
        between += sum(abs(float(w[b] - w[b - 1])) for _, b in held[:-1])
        middle = np.array([float(np.mean(w[a:b])) for a, b in held])
        value = np.array([float(v[a]) for a, _ in held])
        beside += _beside(value, middle, noise, digit)
    # of set values it is none of the way, of values rounded with m readings a step (m - 1)/m: at least a half
    if within > 0.5 * (within + between) - within:
        return True
    # of a steady ramp most steps are alike, rounded or set: those that differ tell
    told = [away for away, differs in beside if differs] or [away for away, _ in beside]
    return bool(told) and float(np.median(told)) > 0.5 * ROUNDED * digit


def _beside(value: Array, driving: Array, noise: float, digit: float) -> list[tuple[float, bool]]:
    """How far inner values ``(k,)`` lie from the line through their neighbours, beyond the other channel's noise.

    Returns:
        A distance each, and whether the steps before and behind it differ, in either channel, by half a digit.
    """
    found = []
    for k in range(1, len(value) - 1):
        way = driving[k + 1] - driving[k - 1]
        turned = (driving[k] - driving[k - 1]) * (driving[k + 1] - driving[k]) <= 0.0
        if turned or abs(way) <= DEADBAND * noise:
            continue
        slope = (value[k + 1] - value[k - 1]) / way
        away = abs(value[k] - value[k - 1] - slope * (driving[k] - driving[k - 1]))
        steps = np.diff(value[k - 1 : k + 2], 2)[0], slope * np.diff(driving[k - 1 : k + 2], 2)[0]
        differs = max(map(abs, steps)) > 0.5 * digit
        found.append((max(float(away - 2.0 * abs(slope) * noise), 0.0), bool(differs)))
    return found


def _driving(r: Readings, name: str) -> str | None:
    """The displacement that goes with a force, or the other way round: that of the largest span."""
    kinds = [n for n in r.channels if (n in WRENCH) != (name in WRENCH) and len(r.known(n))]
    first = [n for n in kinds if n in (*POSE[:3], *WRENCH[:3])] or kinds
    return max((n for n in first if r.span(n) > 0.0), key=r.span, default=None)


def last_digit(values: Array) -> float:
    """What readings are rounded to: a power of ten from 1e3 down to 1e-12."""
    known = values[~np.isnan(values)]
    least = 1e-12 * float(np.abs(known).max(initial=0.0))
    exact = (10.0**-d for d in range(-3, 12) if np.all(np.abs(np.round(known, d) - known) <= least))
    return next(exact, 1e-12)


def chance_of_repeats(c: Comparison, same: np.ndarray) -> float:
    """How many rows of a test may repeat the one before them in every column by chance.

    Args:
        c: the test.
        same: which pairs of rows ``(n - 1,)`` do, and are left out of what the columns do elsewhere.
    """
    r, chance = c.readings, float(len(c.readings))
    within = r.sequence[1:] == r.sequence[:-1]
    for name in [n for n in r.channels if n in c.measurement.sheet.instrument]:
        noise, values = c.measurement.sheet.instrument[name].noise, r.values[name]
        likely = agreeing(last_digit(values), noise)
        elsewhere = (values[1:] == values[:-1])[within & ~same]
        chance *= max(likely, float(np.mean(elsewhere)) if len(elsewhere) else 0.0)
    return chance
