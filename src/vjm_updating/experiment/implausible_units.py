"""Mistakes in units, signs and the places of columns and labels."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vjm.io.findings import Finding, Grade
from vjm_updating.experiment.channels import MOTION, unit_of
from vjm_updating.experiment.checks import DIFFERS, MISSED, opposite, ratio_of, thousandfold
from vjm_updating.experiment.comparison import CLEAR, Comparison
from vjm_updating.experiment.joint_levers import channels_of, expected, one_sided
from vjm_updating.experiment.mistaken_as import RIGHT, MistakenAs
from vjm_updating.experiment.mistaken_rows import LEAST_ROWS, Mistaken, mistaken_rows, ways_of
from vjm_updating.experiment.mistakes import SIGN, UNIT, ColumnsMistaken, Mistake, MistakeFound
from vjm_updating.observation.significance import NORMAL_95, level


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
        where, what = f"{c.readings.file}: {_place(c, found.rows)}", f"{_seen(c, found)}: {words}"
        if not found.way.cause:
            yield ColumnsMistaken(Grade.DOUBTFUL, where, f"{what}: are the labels swapped?")
            continue
        (name, *more), cause = found.factors or ("",), found.way.cause
        parameters = {f"{cause}.{name}": value for name, value in found.factors.items()}
        if found.rows.sum() < len(c.readings):
            parameters[f"{cause}.row"] = float(c.readings.row[found.rows][0])
        if cause == SIGN and name in c.columns and not more and np.isfinite(c.read).any(axis=0).sum() > 1:
            where = f"{c.readings.file}: column {name}, {_place(c, found.rows)}"
            what = (
                "follows the model's prediction with the other sign, while other columns fit: is its axis turned, "
                "or that of the displacement"
            )
        yield MistakeFound(
            Grade.DOUBTFUL, where, f"{what}? {_remedy(found.way)}",
            Mistake(cause, found.rows, found.factors, found.way.exchanged, parameters=parameters),
        )  # fmt: skip


def undecided(c: Comparison) -> Iterator[Finding]:
    """A unit that all readings together fit, where none of them alone is large enough to say so.

    What was read is a multiple of what is predicted, beside zeros that the sheet allows. The multiple is beyond
    what a machine differs by, its distance from one is no accident, and in another unit it is one. These readings
    do not tell such a unit from such a machine.
    """
    as_is, spread = _multiple(c, RIGHT)
    if abs(np.log(max(as_is, 1e-300))) < DIFFERS or abs(as_is - 1.0) < level(1) * spread:
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
    predicted = c.curves.predicted()
    for k, name in enumerate(c.columns):
        known = ~np.isnan(c.read[:, k]) & ~np.isnan(predicted[:, k])
        f, g = c.read[known, k], predicted[known, k]
        largest = max(np.abs(f).max(initial=0.0), np.abs(g).max(initial=0.0))
        if largest <= CLEAR * c.noise(name) or not (by := thousandfold(ratio := ratio_of(f, g))):
            continue
        size, mm = abs(ratio[1]), unit_of(name) == "mm"
        what = f"{size:.3g} times" if by > 0 else f"1/{1.0 / size:.3g} of"
        unit = {(1, True): "µm", (1, False): "mrad", (-1, True): "m", (-1, False): "krad"}[by, mm]
        yield Finding(
            Grade.REFUSED, f"{c.readings.file}: column {name}",
            f"is about {what} what the model predicts under the loads, a factor 1000: is it in {unit} instead of "
            f"{unit_of(name)}, or are the loads in {'kN' if by > 0 else 'mN'}? Convert it",
        )  # fmt: skip


def of_joint(c: Comparison) -> Iterator[Finding]:
    """Loads of a joint off by a thousand, with the other sign, to one side only, or by an angle in degrees."""
    if not c.of_joint:
        return
    motion, effort = channels_of(c.measurement)
    where = f"{c.readings.file}: column {effort}"
    if one_sided(c.measurement):
        words = "the joint was loaded to one side only: backlash is not asked, load both sides to know it"
        yield Finding(Grade.NOTED, where, words)
    load, wanted = c.readings.values[effort], expected(c.measurement)
    known = ~np.isnan(load) & ~np.isnan(wanted)
    ratio = ratio_of(load[known], wanted[known])
    predicted = f"what the model predicts for {motion}"
    if opposite(ratio):
        words = f"has the other sign than the model predicts for {motion}: turn the sign of one of them"
    elif thousandfold(ratio):
        words = f"is about {ratio[1]:.3g} times {predicted}, a factor 1000: convert one of them"
    elif motion == MOTION[0] and all(r > 0.0 and abs(np.log(np.degrees(r))) < MISSED for r in ratio):
        words = (
            f"is about 1/57 of {predicted}: is the angle in degrees? Convert it to rad, or give the model that "
            "compliance"
        )
    else:
        return
    yield Finding(Grade.REFUSED, where, words)


def gains(c: Comparison) -> Iterator[Finding]:
    """One channel that is another multiple of its prediction than a machine's, while the others fit."""
    if not c.comparable:
        return
    predicted, ratios = c.curves.predicted(), dict[str, tuple[float, float, float]]()
    for k, name in enumerate(c.columns):
        known = ~np.isnan(c.read[:, k]) & ~np.isnan(predicted[:, k])
        f, g = c.read[known, k], predicted[known, k]
        if len(g) and np.sqrt(np.mean(g**2)) > CLEAR * c.noise(name):
            ratios[name] = ratio_of(f, g)
    fits = {name: abs(np.log(max(ratio[1], 1e-300))) < DIFFERS for name, ratio in ratios.items()}
    for name, (low, middle, high) in ratios.items():
        others = [fit for other, fit in fits.items() if other != name]
        beyond = low > 0.0 and (np.log(low) > DIFFERS or np.log(high) < -DIFFERS)
        if beyond and others and all(others):
            yield Finding(
                Grade.DOUBTFUL, f"{c.readings.file}: column {name}",
                f"is {middle:.3g} times what the model predicts, while other columns fit: is it in another unit, "
                "or its amplifier set to another range?",
            )  # fmt: skip


def _strange(c: Comparison, explained: list[Mistaken]) -> Iterator[Finding]:
    """Readings that are as far from the model in every posture as no machine is, and are not explained."""
    rest = ~np.any([np.zeros(len(c.readings), dtype=bool), *(found.rows for found in explained)], axis=0)
    noise = max((c.noise(n) * c.unit[k] for k, n in enumerate(c.columns) if n in c.readings.values), default=0.0)
    # two numbers whose quotient is exp(x) differ by tanh(x/2) of their sum
    predicted, far = c.curves.predicted(), np.tanh(0.5 * DIFFERS)
    for label in c.labels:
        at = c.at(label)[rest[c.at(label)]]
        read = ~np.isnan(c.read[at])
        f, g = (np.where(read, np.nan_to_num(v[at] * c.unit), 0.0)[:, c.main] for v in (c.read, predicted))
        size = np.linalg.norm(f, axis=1) + np.linalg.norm(g, axis=1)
        loud = size > CLEAR * noise
        if loud.sum() <= LEAST_ROWS:
            return
        if np.median(np.linalg.norm(f - g, axis=1)[loud] / size[loud]) < far:
            return
    yield Finding(
        Grade.DOUBTFUL, f"{c.readings.file}: {'every row' if len(c.labels) > 1 else f'posture {c.labels[0]}'}",
        f"{c.words} differ from what the model predicts by more than a factor {np.exp(DIFFERS):.2g}, and no unit, "
        "sign or exchange explains it. Look at the model's stiffness, the columns' axes and the postures",
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
