"""Mistakes in units, signs and the places of columns and labels."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.errors import printed
from vjm.io.findings import Finding, Grade
from vjm.model.load_case import LoadCase
from vjm_updating.constants import numerical
from vjm_updating.experiment.channels import MOTION, POSE, WRENCH, split_point, unit_of
from vjm_updating.experiment.comparison import CLEAR, DIFFERS, MISSED, Comparison, machines, ratio_of
from vjm_updating.experiment.joint_levers import OfJoint, one_sided
from vjm_updating.experiment.measured import Measurement
from vjm_updating.experiment.mistaken_as import RIGHT, UNITS, MistakenAs
from vjm_updating.experiment.mistaken_rows import LEAST_ROWS, ODDS, Mistaken, mistaken_rows, times, ways_of
from vjm_updating.experiment.mistakes import SIGN, UNIT, ColumnsMistaken, Mistake, MistakeFound
from vjm_updating.experiment.nominal_curve import ByDisplacements
from vjm_updating.experiment.nominal_loads import ByLoads
from vjm_updating.experiment.readings import runs
from vjm_updating.observation.significance import NORMAL_95, level

REMEDIES = {UNIT: "Convert them", SIGN: "Turn it"}


def mistaken(c: Comparison) -> Iterator[Finding]:
    """Rows in another unit, with the other sign, or with columns or labels in each other's place."""
    if not c.comparable:
        return
    explained = mistaken_rows(c)
    strange = list(_strange(c, explained))
    yield from strange or (undecided(c) if not explained else ())
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
            Grade.DOUBTFUL, where, f"{what}? {REMEDIES.get(cause, 'Put them right')}",
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
        if abs(multiple - 1.0) < NORMAL_95 * own and machines(multiple):
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
    f, g = way.put_right(c.read, c.columns), c.predicted(way)
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


PREFIXED = {"N": ("mN", "kN"), "Nmm": ("µN m", "N m"), "mm": ("µm", "m"), "rad": ("mrad", "krad")}
"""By unit, the one in which readings are a thousand times as large, and the one in which they are a thousandth."""


REACH = numerical(0.01)
"""End of the ramp over the longest part's length on which the force is sought that a chain cannot exceed."""


def compared(measurement: Measurement) -> Comparison:
    """Readings beside the nominal machine, as its kind of test has it."""
    if measurement.sheet.kind == "joint":
        return OfJoint(measurement)
    return ByLoads(measurement) if measurement.loaded else ByDisplacements(measurement)


def wrong_scale(c: Comparison) -> Iterator[Finding]:
    """What was read is off by a thousand, has the other sign, or is beside an angle in degrees."""
    if not c.comparable:
        yield from _beside_buckling(c)
        return
    for name, f, g in c.pairs(c.linear()):
        if max(np.abs(f).max(), np.abs(g).max()) <= (least := CLEAR * c.noise(name)):
            continue
        index = 0 if c.of_joint else (*POSE, *WRENCH).index(split_point(name)[1]) % 6
        driven = next((i for i in (index, *range(len(c.given))) if np.any(c.imposed[:, i])), 0)
        if c.measurement.imposed and driven != index and np.abs(g).max() <= least:
            continue  # what little the unloaded stiffness says of this channel is no measure
        ratio, given = ratio_of(f, g), c.given[driven]
        beside = f"what the model predicts for {given}"
        by = next((i for i in (1, -1) if all(machines(abs(r) * 1000.0**-i) for r in ratio)), 0)
        if by and ratio[0] * ratio[2] > 0.0:
            units = [(one, unit_of(one), PREFIXED[unit_of(one)][by * s < 0]) for one, s in ((name, 1), (given, -1))]
            asked = ", or ".join(f"{one} in {other} instead of {own}" for one, own, other in units)
            asked = ", or ".join([re.sub(r"\bNmm\b", "N mm", asked), *_near_a_thousand(name, given, ratio[1])])
            words = f"is about {said(ratio[1])} {beside}, a factor 1000: is {asked}? Convert it"
        elif ratio[2] < 0.0 and ratio[1] < -np.exp(-DIFFERS) and driven == index and not c.measurement.loaded:
            words = (
                f"has the other sign than the model predicts for {given}. {name} is what the machine needs there, "
                f"positive with {given}; turn the sign of one of them"
            )
        elif given == MOTION[0] and all(r > 0.0 and abs(np.log(np.degrees(r))) < MISSED for r in ratio):
            words = (
                f"is about 1/57 of {beside}: is the angle in degrees? Convert it to rad, or give the model that "
                "compliance"
            )
        else:
            continue
        yield Finding(Grade.REFUSED, f"{c.readings.file}: column {name}", words)


def _near_a_thousand(name: str, given: str, ratio: float) -> list[str]:
    """Other units, no thousand times the right one, that explain what was read over what is predicted."""
    return [
        words
        for words, factor, names in UNITS
        if factor not in (1e3, 1e-3)
        and any(
            split_point(one)[1] in names and machines(ratio * factor**sign)
            for one, sign in ((name, 1), (given, -1))
        )
    ]


def _beside_buckling(c: Comparison) -> Iterator[Finding]:
    """Of a test that another point controls: no force is many times the one at which the chain buckles."""
    name, chain = WRENCH[0], c.measurement.chain
    for label in c.labels if name in c.readings.values else ():
        force = np.abs(c.readings.only(c.readings.posture == label).known(name))
        try:
            path = c.measurement.engine.trace(chain, LoadCase(label, -REACH * chain.characteristic_length))
        except NoConvergenceError:
            continue
        if path.critical is None or not len(force):
            continue
        # the largest tenth, not one outlier
        many = float(np.percentile(force, 95.0)) / path.critical.force
        clear = path.critical.force > CLEAR * c.measurement.sheet.sigma(name).noise
        units = [unit for unit, factor in (("mN", 1e-3), ("kN", 1e3)) if machines(many * factor)]
        beside = f"the force at which posture {label} buckles"
        if units and (many > 1.0 or clear):
            words = f"reaches {said(many)} {beside}, a factor 1000: is it in {units[0]} instead of N? Convert it"
            yield Finding(Grade.REFUSED, f"{c.readings.file}: column {name}", words)
        elif many > np.exp(DIFFERS):
            others = dict.fromkeys(one for one, factor, names in UNITS if name in names and machines(many * factor))
            why = f": {', or '.join(others)}?" if others else ", and no unit explains it"
            yield Finding(
                Grade.DOUBTFUL, f"{c.readings.file}: column {name}", f"reaches {said(many)} {beside}{why}"
            )


def said(times: float) -> str:
    """``20 times``, ``1/20 of``."""
    return f"1/{printed(1.0 / times, 3)} of" if 0.0 < abs(times) < 1.0 else f"{printed(times, 3)} times"


def of_joint(c: Comparison) -> Iterator[Finding]:
    """A joint that was loaded to one side only."""
    if c.of_joint and one_sided(c.measurement):
        words = "the joint was loaded to one side only: backlash is not asked, load both sides to know it"
        yield Finding(Grade.NOTED, f"{c.readings.file}: column {c.columns[0]}", words)


def gains(c: Comparison) -> Iterator[Finding]:
    """One channel that is another multiple of its prediction than a machine's, while the others fit."""
    if not c.comparable:
        return
    ratios = {
        name: ratio_of(f, g)
        for name, f, g in c.pairs(c.predicted())
        if np.sqrt(np.mean(g**2)) > CLEAR * c.noise(name)
    }
    fits = {name: abs(np.log(max(ratio[1], 1e-300))) < DIFFERS for name, ratio in ratios.items()}
    for name, (low, middle, high) in ratios.items():
        others = [fit for other, fit in fits.items() if other != name]
        beyond = low > 0.0 and (np.log(low) > DIFFERS or np.log(high) < -DIFFERS)
        if beyond and others and all(others):
            yield Finding(
                Grade.DOUBTFUL, f"{c.readings.file}: column {name}",
                f"is {said(middle)} what the model predicts, while other columns fit: is it in another unit, "
                "or its amplifier set to another range?",
            )  # fmt: skip


def _strange(c: Comparison, explained: list[Mistaken]) -> Iterator[Finding]:
    """Readings that are as far from the model in every posture as no machine is, and are not explained."""
    rest = ~np.any([np.zeros(len(c.readings), dtype=bool), *(found.rows for found in explained)], axis=0)
    noise = max((c.noise(n) * c.unit[k] for k, n in enumerate(c.columns) if n in c.readings.values), default=0.0)
    read = ~np.isnan(c.read)
    f, g = (np.where(read, np.nan_to_num(v * c.unit), 0.0)[:, c.main] for v in (c.read, c.predicted()))
    size = np.linalg.norm(f, axis=1) + np.linalg.norm(g, axis=1)
    loud = rest & ~np.isnan(c.imposed).any(axis=1) & (size > CLEAR * noise)
    # two numbers whose quotient is exp(x) differ by tanh(x/2) of their sum
    far = np.linalg.norm(f - g, axis=1) >= np.tanh(0.5 * DIFFERS) * size
    for label in c.labels:
        here = loud & (c.readings.posture == label)
        if here.sum() <= LEAST_ROWS or 2 * (here & far).sum() < here.sum():
            return
    many = times(c, loud & far)
    differ = f"differ from what the model predicts by more than a factor {np.exp(DIFFERS):.2g}"
    seen = f"are {said(many)} what the model predicts" if np.isfinite(many) else differ
    where = f"{c.readings.file}: {'every row' if len(c.labels) > 1 else f'posture {c.labels[0]}'}"
    if units := _in_units(c, loud & far):
        yield ColumnsMistaken(Grade.DOUBTFUL, where, f"{c.words} {seen}: {', or '.join(units)}? Convert them")
        return
    yield Finding(
        Grade.DOUBTFUL, where,
        f"{c.words} {seen}, and no unit, sign or exchange explains it. Look at the model's stiffness, the columns' "
        "axes and the postures",
    )  # fmt: skip


def _in_units(c: Comparison, rows: np.ndarray) -> list[str]:
    """The units in which some rows would be a machine's like the model, the likeliest first.

    The logarithm of what a machine shows over its model's is normal, of standard deviation `MISSED`; a unit that is
    `ODDS` less probable than the best is not told.
    """
    costs: dict[str, float] = {}
    for way in ways_of(c):
        many = times(c, rows, way) if way.cause == UNIT else np.nan
        if machines(many):
            costs.setdefault(way.words, 0.5 * float(np.log(many) / MISSED) ** 2)
    ranked = sorted(costs, key=lambda words: costs[words])
    return [words for words in ranked if costs[words] < costs[ranked[0]] + np.log(ODDS)]


def _seen(c: Comparison, found: Mistaken) -> str:
    rest = "" if found.rows.all() else " while other rows fit"
    if found.way.cause == SIGN:
        return f"{c.words} point against what the model predicts there{rest}"
    if found.way.cause == UNIT:
        many = times(c, found.rows)
        if many > 0.0:
            return f"{c.words} are {said(many)} what the model predicts there{rest}"
        return f"{c.words} are far from what the model predicts there{rest}"
    return "the readings fit the model with them changed, not as they stand"


def _place(c: Comparison, rows: np.ndarray) -> str:
    """Which rows, in words."""
    if rows.all():
        return "every row"
    parts = []
    for label in c.labels:
        at = np.flatnonzero(c.readings.posture == label)
        row, inside = c.readings.row[at], rows[at]
        spans = [f"rows {row[a]} to {row[b - 1]}" for a, b in runs(inside) if inside[a]]
        if spans:
            parts.append(f"posture {label}" + ("" if inside.all() else f", {', '.join(spans)}"))
    return "; ".join(parts)
