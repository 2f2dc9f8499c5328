"""Mistakes in units, signs and the places of columns and labels."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vjm.io.findings import Finding, Grade
from vjm_updating.constants import tuned
from vjm_updating.experiment.channels import MOTION, unit_of
from vjm_updating.experiment.checks import ALIKE as ONE_FACTOR
from vjm_updating.experiment.checks import OPPOSITE, THOUSAND, ratio_of
from vjm_updating.experiment.comparison import CLEAR, FOLLOWS, Comparison
from vjm_updating.experiment.joint_levers import channels_of, expected, one_sided
from vjm_updating.experiment.mistaken_as import RIGHT, MistakenAs
from vjm_updating.experiment.mistaken_columns import factors_of, turned_rows
from vjm_updating.experiment.mistaken_rows import FAR, Mistaken, far_postures, mistaken_rows, ways_of
from vjm_updating.experiment.mistakes import SIGN, UNIT, ColumnsMistaken, Mistake, MistakeFound
from vjm_updating.observation.significance import NORMAL_95, level

GAIN = tuned((2.0 + FAR) / (2.0 - FAR))
"""Factor beyond which one channel's gain is not its machine's: it puts readings at the distance `FAR`."""
SAME_GAIN = tuned(0.2)
"""By how much it differs between postures at most."""


def mistaken(c: Comparison) -> Iterator[Finding]:
    """Rows in another unit, with the other sign, or with columns or labels in each other's place."""
    if not c.comparable:
        return
    explained = mistaken_rows(c)
    yield from _strange(c, explained)
    if not explained:
        yield from undecided(c)
    for found in explained:
        ways = [found.way, *found.others]
        words = ", or ".join(dict.fromkeys(way.words for way in ways))
        where, what = f"{c.readings.file}: {_place(c, found.rows)}", _seen(c, found)
        if not found.way.cause:
            yield ColumnsMistaken(Grade.DOUBTFUL, where, f"{what}: {words}: are the labels swapped?")
            continue
        factors = factors_of(c, found)
        cause = found.way.cause
        parameters = {f"{cause}.{name}": value for name, value in factors.items()}
        if found.rows.sum() < len(c.readings):
            parameters[f"{cause}.row"] = float(c.readings.row[found.rows][0])
        yield MistakeFound(
            Grade.DOUBTFUL, where, f"{what}: {words}? {_remedy(found.way)}",
            Mistake(cause, found.rows, factors, found.way.exchanged, parameters=parameters),
        )  # fmt: skip


def undecided(c: Comparison) -> Iterator[Finding]:
    """A unit that all readings together fit, where none of them alone is large enough to say so.

    What was read is a multiple of what is predicted, beside zeros that the sheet allows. The multiple is beyond
    what a machine differs by, its distance from one is no accident, and in another unit it is one. These readings
    do not tell such a unit from such a machine.
    """
    as_is, spread = _multiple(c, RIGHT)
    if 1.0 / GAIN < as_is < GAIN or abs(as_is - 1.0) < level(1) * spread:
        return
    found = []
    for way in ways_of(c):
        multiple, own = _multiple(c, way) if way.cause == UNIT else (np.nan, np.nan)
        if abs(multiple - 1.0) < NORMAL_95 * own:
            found.append(way.words)
    if found:
        words = ", or ".join(dict.fromkeys(found))
        yield Finding(
            Grade.DOUBTFUL,
            f"{c.readings.file}: every row",
            f"{c.words} are {as_is:.2g} ± {spread:.1g} of what the model predicts: {words}, or a machine that "
            "differs so much from its model? The readings are too few or too small to tell: load it more, or hang "
            "a known weight on it",
        )


def _multiple(c: Comparison, way: MistakenAs) -> tuple[float, float]:
    """What was read, put right, over what is predicted, by all readings together; its standard deviation.

    Zeros and scales of the channels and the modulus are as uncertain as the sheet says. Where a multiple does not
    describe the readings, its standard deviation grows by the residual.
    """
    f = c.read[:, list(way.order(c.columns))] * way.scaled(c.columns)
    g = c.curves.predicted(way.scaled(c.given), way.order(c.given))
    squares = products = left = 0.0
    count, scale = 0, 0.0
    for k, name in enumerate(c.columns):
        known = c.measurement.sheet.instrument.get(name)
        seen = ~np.isnan(f[:, k]) & ~np.isnan(g[:, k])
        if known is None or not known.noise > 0.0 or not seen.any():
            continue
        a, b = f[seen, k], g[seen, k]
        by = way.factors.get(name, 1.0)
        noise, zero = abs(by) * known.noise, abs(by) * known.zero
        if not noise**2 > 0.0:
            # below the last digit of any number: the sheet is doubted for it
            continue
        # a constant of standard deviation zero beside the noise, by the inverse of I + z z' (Sherman and Morrison)
        share = zero**2 / (noise**2 + len(a) * zero**2)
        squares += float(b @ b - share * b.sum() ** 2) / noise**2
        products += float(a @ b - share * a.sum() * b.sum()) / noise**2
        left += float(a @ a - share * a.sum() ** 2) / noise**2
        count, scale = count + len(a), max(scale, known.scale)
    if not squares > 0.0 or count < 2:
        return 1.0, np.inf
    multiple = products / squares
    misfit = max((left - multiple * products) / (count - 1), 1.0)
    same = np.hypot(scale, c.measurement.sheet.tolerance.modulus_rel)
    return multiple, float(np.hypot(np.sqrt(misfit / squares), multiple * same))


def a_thousand(c: Comparison) -> Iterator[Finding]:
    """Displacements under loads that are off by a thousand: no machine is that far from its model."""
    if not c.measurement.loaded or not c.comparable:
        return
    predicted, (low, high) = c.curves.predicted(), THOUSAND
    for k, name in enumerate(c.columns):
        known = ~np.isnan(c.read[:, k]) & ~np.isnan(predicted[:, k])
        f, g = c.read[known, k], predicted[known, k]
        largest = max(np.abs(f).max(initial=0.0), np.abs(g).max(initial=0.0))
        ratio, spread = ratio_of(f, g)
        size, unit = max(abs(ratio), 1e-12), unit_of(name)
        if spread >= ONE_FACTOR or largest <= CLEAR * c.noise(name):
            continue
        if low < size < high:
            what = f"{size:.3g} times", "µm" if unit == "mm" else "mrad", "kN"
        elif low < 1.0 / size < high:
            what = f"1/{1.0 / size:.3g} of", "m" if unit == "mm" else "krad", "mN"
        else:
            continue
        yield Finding(
            Grade.REFUSED, f"{c.readings.file}: column {name}",
            f"is about {what[0]} what the model predicts under the loads, a factor 1000: is it in {what[1]} "
            f"instead of {unit}, or are the loads in {what[2]}? Convert it",
        )  # fmt: skip


def of_joint(c: Comparison) -> Iterator[Finding]:
    """Loads of a joint off by a thousand, with the other sign, to one side only, or by an angle in degrees."""
    if c.measurement.sheet.kind != "joint":
        return
    motion, effort = channels_of(c.measurement)
    if one_sided(c.measurement):
        words = "the joint was loaded to one side only: backlash is not asked, load both sides to know it"
        yield Finding(Grade.NOTED, f"{c.readings.file}: column {effort}", words)
    load, wanted = c.readings.values[effort], expected(c.measurement)
    known = ~np.isnan(load) & ~np.isnan(wanted)
    ratio, spread = ratio_of(load[known], wanted[known])
    (low, high), where = THOUSAND, f"{c.readings.file}: column {effort}"
    if spread >= ONE_FACTOR:
        return
    if ratio < OPPOSITE:
        words = f"has the other sign than the model predicts for {motion}: turn the sign of one of them"
        yield Finding(Grade.REFUSED, where, words)
    elif low < ratio < high or low < 1.0 / max(ratio, 1e-12) < high:
        words = (
            f"is about {ratio:.3g} times what the model predicts for {motion}, a factor 1000: convert one of them"
        )
        yield Finding(Grade.REFUSED, where, words)
    elif motion == MOTION[0] and abs(ratio * 180.0 / np.pi - 1.0) < SAME_GAIN:
        words = (
            f"is about 1/57 of what the model predicts for {motion}: is the angle in degrees? Convert it to rad, "
            "or give the model that compliance"
        )
        yield Finding(Grade.REFUSED, where, words)


def _strange(c: Comparison, explained: list[Mistaken]) -> Iterator[Finding]:
    """Postures whose readings are far from the model altogether, which no known mistake explains."""
    rest = ~np.any([np.zeros(len(c.readings), dtype=bool), *(found.rows for found in explained)], axis=0)
    far = far_postures(c, rest)
    if far and len(far) == len(c.labels):
        yield Finding(
            Grade.DOUBTFUL, f"{c.readings.file}: {'every row' if len(far) > 1 else f'posture {far[0]}'}",
            f"{c.words} differ from what the model predicts by more than a factor 2.6, and no unit, sign or "
            "exchange explains it. Look at the model's stiffness, the columns' axes and the postures",
        )  # fmt: skip


def _seen(c: Comparison, found: Mistaken) -> str:
    rest = "" if found.rows.all() else " while other rows fit"
    if found.way.cause == SIGN:
        return f"{c.words} point against what the model predicts there{rest}"
    if found.way.cause == UNIT:
        f, g = c.read[found.rows][:, c.main], c.curves.predicted()[found.rows][:, c.main]
        known = ~np.isnan(f) & ~np.isnan(g)
        f, g = np.where(known, f, 0.0), np.where(known, g, 0.0)
        size = np.sum(g * g, axis=1)
        large = (size > 0.0) & (size >= np.median(size))
        ratio = np.sum(f * g, axis=1)[large] / size[large]
        if len(ratio) and (middle := float(np.median(ratio))) > 0.0:
            return f"{c.words} are {middle:.3g} of what the model predicts there{rest}"
        return f"{c.words} are far from what the model predicts there{rest}"
    return "the readings fit the model with them changed, not as they stand"


def _remedy(way: MistakenAs) -> str:
    if way.cause == UNIT:
        return "Convert them"
    return "Turn it" if way.cause == SIGN else "Put them right"


def _place(c: Comparison, rows: np.ndarray) -> str:
    """Which rows, in words."""
    if rows.all():
        return "every row"
    parts = []
    for label in c.labels:
        mine = c.readings.posture == label
        here = rows & mine
        if not here.any():
            continue
        if here.sum() == mine.sum():
            parts.append(f"posture {label}")
            continue
        at = np.flatnonzero(mine)
        inside = rows[at]
        begins = np.flatnonzero(inside & ~np.concatenate([[False], inside[:-1]]))
        ends = np.flatnonzero(inside & ~np.concatenate([inside[1:], [False]]))
        spans = ", ".join(
            f"rows {c.readings.row[at[a]]} to {c.readings.row[at[b]]}" for a, b in zip(begins, ends, strict=True)
        )
        parts.append(f"posture {label}, {spans}")
    return "; ".join(parts)


def gains(c: Comparison) -> Iterator[Finding]:
    """One channel that is the same multiple of its prediction in every posture, while the others fit."""
    if not c.comparable:
        return
    slopes = {name: c.slopes(name) for name in c.columns if name in c.readings.values}
    usual = {name: float(np.median(of)) for name, of in slopes.items() if of}
    for name, middle in usual.items():
        others = [value for other, value in usual.items() if other != name]
        alike = max(slopes[name]) < (1.0 + SAME_GAIN) * min(slopes[name])
        if alike and others and not 1.0 / GAIN < middle < GAIN and all(0.5 < value < 2.0 for value in others):
            yield Finding(
                Grade.DOUBTFUL, f"{c.readings.file}: column {name}",
                f"is {middle:.3g} times what the model predicts, while other columns fit: is it in another unit, "
                "or its amplifier set to another range?",
            )  # fmt: skip


def signs(c: Comparison) -> Iterator[Finding]:
    """One channel with the other sign, in whole postures or in a stretch of rows."""
    if not c.comparable:
        return
    for name in [name for name in c.columns if name in c.readings.values]:
        rows = np.zeros(len(c.readings), dtype=bool)
        others = [n for n in c.columns if n != name and n in c.readings.values]
        for label in c.labels:
            if not any(c.agreement(label, n) > FOLLOWS for n in others):
                continue
            if c.agreement(label, name) < -FOLLOWS:
                rows |= c.readings.posture == label
            else:
                rows |= turned_rows(c, label, name)
        if rows.any():
            yield MistakeFound(
                Grade.DOUBTFUL,
                f"{c.readings.file}: column {name}, {_place(c, rows)}",
                "follows the model's prediction with the other sign, while other columns fit: is its axis turned, "
                "or that of the displacement?",
                Mistake(SIGN, rows, {name: -1.0}, parameters={f"{SIGN}.{name}": -1.0}),
            )
