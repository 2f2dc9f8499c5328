"""Mistakes in a file's clock and temperatures, in what is blank, and in its sheet."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from vjm.io.findings import Finding, Grade
from vjm.rotations import Array
from vjm_updating.constants import definition, numerical, physical_bound, prior_scale, stated_level
from vjm_updating.experiment.channels import EFFORT, POSE, TEMPERATURE, TIME, WRENCH
from vjm_updating.experiment.comparison import FEW, Comparison
from vjm_updating.experiment.mistakes import CLOCK, Mistake, MistakeFound
from vjm_updating.experiment.readings import DEADBAND, Readings, runs
from vjm_updating.observation.significance import level

CHANCE = stated_level(0.01)
"""That readings repeat as they do, below which it is no chance."""
doubtful = partial(Finding, Grade.DOUBTFUL)
ROUNDED = definition(0.262)
"""Median distance of one number from the mean of two, all uniform over one: of a rounded reading from the line
through its neighbours, in digits."""
LEAST = numerical(3)
"""Readings of a test without which nothing can be said."""

PAUSE_S = prior_scale(600.0, "s")
"""Mean of a pause between two readings; longer ones are rarer exponentially."""
LONGEST_S = physical_bound(7 * 86400.0, "s")
"""Of a test: machines are not loaded for longer."""
ROOM = physical_bound((-50.0, 50.0), "°C")
"""Temperatures of rooms in which machines are tested."""
FINEST_MM = physical_bound(1e-3, "mm")
"""Of a link's tolerance: gauge blocks are made to a tenth of it."""


def rounded(c: Comparison, name: str, digit: float) -> bool:
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
    loads = (*WRENCH, *EFFORT)
    kinds = [n for n in r.channels if (n in loads) != (name in loads) and len(r.known(n))]
    first = [n for n in kinds if n in (*POSE[:3], *WRENCH[:3])] or kinds
    return max((n for n in first if r.span(n) > 0.0), key=r.span, default=None)


def blanks(c: Comparison) -> Iterator[Finding]:
    """Channels that are mostly blank."""
    r = c.readings
    for name in r.channels:
        blank = int(np.isnan(r.values[name]).sum())
        if blank > 0.4 * len(r):
            words = f"{blank} of {len(r)} readings are blank: was the right column exported?"
            yield doubtful(f"{r.file}: column {name}", words)


def clock(c: Comparison) -> Iterator[Finding]:
    """Times that stand twice or are negative, and one posture in milliseconds."""
    r = c.readings
    if TIME not in r.values:
        return
    time = r.values[TIME]
    if np.nanmin(time, initial=0.0) < 0.0:
        row = r.row[int(np.nanargmin(time))]
        yield doubtful(f"{r.file}: row {row}, column {TIME}", "the clock is negative")
    if (lasted := r.span(TIME)) > LONGEST_S:
        words = f"the test lasts {lasted / 86400.0:.3g} days: is the clock in ms?"
        yield doubtful(f"{r.file}: column {TIME}", words)
    steps = list[tuple[np.ndarray, float]]()
    for at in r.sequences:
        step = np.diff(time[at])
        step = step[~np.isnan(step)]
        if len(step) >= FEW:
            # before the clock changes, where it does
            steps.append((at, float(np.median(step[: _change(step)]))))
            if np.mean(step == 0.0) > 0.3:
                yield doubtful(f"{r.file}: row {r.row[at[0]]}, column {TIME}", "many readings have the same time")
    usual = min((step for _, step in steps), default=0.0)
    for at, step in steps:
        if usual > 0.0 and 300.0 < step / usual < 3000.0:
            yield _in_ms(
                r, at, f"posture {r.posture[at[0]]}, row {r.row[at[0]]}",
                f"readings lie {step / usual:.0f} times further apart than elsewhere: is the clock in ms there?",
            )  # fmt: skip
        else:
            yield from _jump(r, at, step)


def _in_ms(r: Readings, at: np.ndarray, where: str, words: str) -> MistakeFound:
    """A clock that counts milliseconds at some readings, by their indices."""
    inside = np.isin(np.arange(len(r)), at)
    mistake = Mistake(CLOCK, inside, {TIME: 1e-3}, parameters={f"{CLOCK}.factor": 1e-3})
    return MistakeFound(Grade.DOUBTFUL, f"{r.file}: {where}, column {TIME}", words, mistake)


def _jump(r: Readings, at: np.ndarray, usual: float) -> Iterator[Finding]:
    """A clock that jumps forward within one posture, or changes to milliseconds there."""
    time = r.values[TIME][at]
    step = np.diff(time)
    if usual <= 0.0 or (change := _change(step)) == len(step):
        return
    k = change + 1
    where, order = f"{r.file}: row {r.row[at[k]]}, column {TIME}", np.arange(len(r))
    behind = step[k:]
    if len(behind) and 300.0 < np.median(behind) / usual < 3000.0:
        # what lies behind the change has to fall into line with what is before it
        words = "readings lie a thousand times further apart from here on: is the clock in ms?"
        yield _in_ms(r, at[k:], f"row {r.row[at[k]]}", words)
        return
    heat = r.values.get(TEMPERATURE)
    if heat is not None and _warmed(heat[at], k):
        return
    jump = float(step[k - 1] - usual)
    yield MistakeFound(
        Grade.DOUBTFUL, where,
        f"the clock jumps by {step[k - 1]:.6g} s, {step[k - 1] / usual:.0f} usual steps: a pause, or was it set?",
        Mistake(CLOCK, order >= at[k], shifts={TIME: np.full(len(r), -jump)}, parameters={f"{CLOCK}.jump_s": jump}),
    )  # fmt: skip


def _change(step: Array) -> int:
    """Which step of a clock is the first one that is a jump beside those before it; their number where none is."""
    for k in range(1, len(step)):
        before = float(np.nanmedian(step[:k]))
        if before > 0.0 and step[k] > -np.log(CHANCE) * max(before, PAUSE_S):
            return k
    return len(step)


def _warmed(heat: Array, k: int) -> bool:
    """Whether the temperature before the ``k``-th reading differs from that at it: a pause, and no clock's jump."""
    steps = np.abs(np.diff(heat))
    return bool(steps[k - 1] > 10.0 * max(float(np.nanmedian(steps)), 1e-3))


def temperature(c: Comparison) -> Iterator[Finding]:
    """Temperatures that no room has."""
    r = c.readings
    heat = r.values.get(TEMPERATURE)
    if heat is not None and not np.isnan(heat).all():
        yield from no_room(heat, f"{r.file}: column {TEMPERATURE}")


def no_room(heat: Array, where: str) -> Iterator[Finding]:
    """Temperatures ``(g,)`` in °C of a column that no room has."""
    coldest, hottest = float(np.nanmin(heat)), float(np.nanmax(heat))
    # a unit is named where it makes the coldest reading one of a room
    in_units = {"kelvin? Subtract 273.15": coldest - 273.15, "°F? Convert it to °C": (coldest - 32.0) / 1.8}
    named = [unit for unit, there in in_units.items() if ROOM[0] <= there <= ROOM[1]]
    if coldest < -273.15:
        yield Finding(Grade.REFUSED, where, f"{coldest:g} °C is below absolute zero")
    elif hottest > 1500.0:
        yield Finding(Grade.REFUSED, where, f"{hottest:g} °C: no machine is tested so hot")
    elif coldest > ROOM[1]:
        why = f"is it in {named[0]}" if named else "no room is so hot, and neither kelvin nor °F explains it"
        yield doubtful(where, f"{coldest:g} °C at least: {why}")


def nothing_read(c: Comparison) -> Iterator[Finding]:
    """Readings that say nothing."""
    r = c.readings
    loaded = [name for name in r.channels if name in WRENCH]
    if loaded and not any(map(r.span, loaded)):
        words = "every reading is the same: no load was read"
        yield Finding(Grade.REFUSED, f"{r.file}: column {', '.join(loaded)}", words)
    read = [name for name in r.channels if name in c.columns]
    for name in read:
        values = r.known(name)
        if len(read) > 1 and len(values) >= LEAST and not np.ptp(values) and c.expected(name):
            words = f"every reading is {values[0]:g}, but the model predicts a change: was another column exported?"
            yield doubtful(f"{r.file}: column {name}", words)
    both = np.asarray(~np.isnan(c.imposed).any(axis=1) & ~np.isnan(c.read).all(axis=1))
    usable = int(np.sum(both))
    for label in c.labels if c.measurement.imposed and usable >= LEAST else ():
        if not both[r.posture == label].any():
            words = "no reading of it has both a displacement and a force: it says nothing"
            yield doubtful(f"{r.file}: posture {label}", words)
    if c.measurement.imposed and usable < LEAST:
        words = f"{usable} readings have both a displacement and a force: {LEAST} are needed"
        yield Finding(Grade.REFUSED, r.file, words)


def sheet_values(c: Comparison) -> Iterator[Finding]:
    """Instruments and tolerances that no manufacturer promises."""
    sheet, longest = c.measurement.sheet, c.measurement.chain.characteristic_length
    for name in (name for name in c.readings.channels if name in sheet.instrument):
        for words in _instrument(c, name):
            yield doubtful(f"{sheet.file}: [instrument.{name}]", words)
    length, modulus = sheet.tolerance.link_length_mm, sheet.tolerance.modulus_rel
    said = {
        "link_length_mm": f"{length:g} mm is {length / longest:.0%} of the longest part: is it in µm?"
        if length > 0.1 * longest
        else f"{length:g} mm: no link is made so exactly: is it in m?" if 0.0 < length < FINEST_MM else "",
        "modulus_rel": f"{modulus:g} is {modulus:.0%}: is it in per cent?" if modulus > 0.3 else "",
    }  # fmt: skip
    for key, words in said.items():
        if words:
            yield doubtful(f"{sheet.file}: [tolerance] {key}", words)
    if (down := sheet.test.gravity) is not None and abs((size := float(np.linalg.norm(down))) - 1.0) > 0.01:
        words = f"has length {size:.3g}: only its direction is used, of 1 g"
        yield Finding(Grade.NOTED, f"{sheet.file}: [test] gravity", words)


def _instrument(c: Comparison, name: str) -> Iterator[str]:
    """What is implausible about a channel's table in the sheet."""
    known, values = c.measurement.sheet.errors(name), c.readings.known(name)
    span, noise = c.readings.span(name), known.noise
    # what the noise of so many readings spans, and a zero that may be anywhere; a minor channel may show no more
    main = name in _main(c.readings)
    by_noise, by_zero = (2.0 * level(len(values)), np.sqrt(12.0)) if main else (1.0, 1.0 / 3.0)
    if noise == 0.0 and name in c.columns:
        yield "noise = 0: no instrument is without; every misfit then counts"
    elif 0.0 < noise < 1e-9 * span:
        yield f"noise = {noise:g} is below the reading's last digit"
    elif by_noise * noise > span > 0.0:
        yield f"noise = {noise:g} under a span of {span:g} of all: little can be seen; another unit?"
    elif name in c.columns and noise and (rough := roughness(c.readings, name)) > 100.0 * noise:
        yield f"noise = {noise:g}, but neighbouring readings scatter by {rough:.3g}: another unit?"
    if by_zero * known.zero > span > 0.0:
        yield f"zero = {known.zero:g} under a span of {span:g} in the whole test: another unit?"
    if known.scale > 0.1:
        yield f"scale = {known.scale:g} is {known.scale:.0%}: is it in per cent?"


def _main(r: Readings) -> set[str]:
    """The shift and the force whose readings span most: the others may be small."""
    kinds = ([name for name in names if name in r.values] for names in (POSE[:3], WRENCH[:3]))
    return {max(names, key=r.span) for names in kinds if names}


def roughness(r: Readings, name: str) -> float:
    """Standard deviation of the noise as second differences of neighbouring readings show it, by their median."""
    parts = [np.diff(r.values[name][at], 2) for at in r.sequences]
    second = np.concatenate(parts) if parts else np.zeros(0)
    second = second[~np.isnan(second)]
    return float(np.median(np.abs(second)) / 0.6745 / np.sqrt(6.0)) if len(second) >= FEW else 0.0
