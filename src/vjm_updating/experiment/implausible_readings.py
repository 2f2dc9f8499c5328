"""Mistakes in what was read, of all kinds of test.

A file's clock and temperatures, what is blank, rows that stand twice or elsewhere, and numbers that nobody
read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import combinations
from math import erf

import numpy as np
from scipy.special import gammaln

from vjm.io.findings import Finding, Grade
from vjm.rotations import Array
from vjm_updating.constants import definition, numerical, physical_bound, prior_scale, stated_level
from vjm_updating.experiment.comparison import FEW, Comparison
from vjm_updating.experiment.data_file import EFFORT, POSE, TEMPERATURE, TIME, WRENCH
from vjm_updating.experiment.mistakes import (
    CLOCK,
    LEAST_ROWS,
    ODDS,
    ColumnsMistaken,
    Mistake,
    MistakeFound,
    rarity,
    reordered,
    shifted,
)
from vjm_updating.experiment.readings import DEADBAND, Readings, runs
from vjm_updating.inference.significance import level, median_sigma

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
    for rows in r.sequences:
        rows = rows[~np.isnan(r.values[name][rows]) & ~np.isnan(r.values[other][rows])]
        v, w = r.values[name][rows], r.values[other][rows]
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
    distances = [away for away, differs in beside if differs] or [away for away, _ in beside]
    return bool(distances) and float(np.median(distances)) > 0.5 * ROUNDED * digit


def _beside(value: Array, driving: Array, noise: float, digit: float) -> list[tuple[float, bool]]:
    """How far inner values ``(k,)`` lie from the line through their neighbours, beyond the other channel's noise.

    Of each also whether the steps before and behind it differ, in either channel, by half a digit.
    """
    distances = []
    for k in range(1, len(value) - 1):
        way = driving[k + 1] - driving[k - 1]
        turned = (driving[k] - driving[k - 1]) * (driving[k + 1] - driving[k]) <= 0.0
        if turned or abs(way) <= DEADBAND * noise:
            continue
        slope = (value[k + 1] - value[k - 1]) / way
        away = abs(value[k] - value[k - 1] - slope * (driving[k] - driving[k - 1]))
        steps = np.diff(value[k - 1 : k + 2], 2)[0], slope * np.diff(driving[k - 1 : k + 2], 2)[0]
        differs = max(map(abs, steps)) > 0.5 * digit
        distances.append((max(float(away - 2.0 * abs(slope) * noise), 0.0), bool(differs)))
    return distances


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
    for rows in r.sequences:
        step = np.diff(time[rows])
        step = step[~np.isnan(step)]
        if len(step) >= FEW:
            # before the clock changes, where it does
            steps.append((rows, float(np.median(step[: _change(step)]))))
            if np.mean(step == 0.0) > 0.3:
                yield doubtful(f"{r.file}: row {r.row[rows[0]]}, column {TIME}", "many readings have the same time")
    usual = min((step for _, step in steps), default=0.0)
    for rows, step in steps:
        if usual > 0.0 and 300.0 < step / usual < 3000.0:
            yield _in_ms(
                r, rows, f"posture {r.posture[rows[0]]}, row {r.row[rows[0]]}",
                f"readings lie {step / usual:.0f} times further apart than elsewhere: is the clock in ms there?",
            )  # fmt: skip
        else:
            yield from _jump(r, rows, step)


def _in_ms(r: Readings, rows: np.ndarray, where: str, words: str) -> MistakeFound:
    """A clock that counts milliseconds at some readings, by their indices."""
    inside = np.isin(np.arange(len(r)), rows)
    mistake = Mistake(cause=CLOCK, where=inside, factors={TIME: 1e-3}, parameters={f"{CLOCK}.factor": 1e-3})
    return MistakeFound(Grade.DOUBTFUL, f"{r.file}: {where}, column {TIME}", words, mistake)


def _jump(r: Readings, rows: np.ndarray, usual: float) -> Iterator[Finding]:
    """A clock that jumps forward within one posture, or changes to milliseconds there."""
    time = r.values[TIME][rows]
    step = np.diff(time)
    if usual <= 0.0 or (change := _change(step)) == len(step):
        return
    k = change + 1
    where, order = f"{r.file}: row {r.row[rows[k]]}, column {TIME}", np.arange(len(r))
    behind = step[k:]
    if len(behind) and 300.0 < np.median(behind) / usual < 3000.0:
        # what lies behind the change has to fall into line with what is before it
        words = "readings lie a thousand times further apart from here on: is the clock in ms?"
        yield _in_ms(r, rows[k:], f"row {r.row[rows[k]]}", words)
        return
    heat = r.values.get(TEMPERATURE)
    warmed = np.abs(np.diff(heat[rows])) if heat is not None else None
    if warmed is not None and warmed[k - 1] > 10.0 * max(float(np.nanmedian(warmed)), 1e-3):
        return  # a pause, and no clock's jump
    jump = float(step[k - 1] - usual)
    yield MistakeFound(
        Grade.DOUBTFUL, where,
        f"the clock jumps by {step[k - 1]:.6g} s, {step[k - 1] / usual:.0f} usual steps: a pause, or was it set?",
        Mistake(
            cause=CLOCK, where=order >= rows[k], added={TIME: -jump},
            parameters={f"{CLOCK}.jump_s": jump},
        ),
    )  # fmt: skip


def _change(step: Array) -> int:
    """Which step of a clock is the first one that is a jump beside those before it; their number where none is."""
    for k in range(1, len(step)):
        before = float(np.nanmedian(step[:k]))
        if before > 0.0 and step[k] > -np.log(CHANCE) * max(before, PAUSE_S):
            return k
    return len(step)


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
    named = [unit for unit, celsius in in_units.items() if ROOM[0] <= celsius <= ROOM[1]]
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
    kinds = ([one for one in names if one in c.readings.values] for names in (POSE[:3], WRENCH[:3]))
    # of the shift and the force that span most: what the noise of so many readings spans, and a zero that may be
    # anywhere; a minor channel may show no more
    main = name in {max(names, key=c.readings.span) for names in kinds if names}
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


def roughness(r: Readings, name: str) -> float:
    """Standard deviation of the noise as second differences of neighbouring readings show it, by their median."""
    parts = [np.diff(r.values[name][rows], 2) for rows in r.sequences]
    second = np.concatenate(parts) if parts else np.zeros(0)
    second = second[~np.isnan(second)]
    return float(np.median(np.abs(second)) / 0.6745 / np.sqrt(6.0)) if len(second) >= FEW else 0.0


SLIPS = definition((1e3, 1e-3, 1e2, 1e-2, 10.0, 0.1))
"""What a cell is multiplied by where its decimal point is misplaced."""
LEAST_NOISE = physical_bound(1e-9)
"""Of a column's span: no instrument reads so finely."""
COARSEST = physical_bound(10.0)
"""Steps in a column's range: nobody measures with an instrument that has fewer."""
ROUNDS = numerical(3)
"""Fits, each without the cells that the last one misses."""


@dataclass(frozen=True)
class ReadColumns:
    """What was read in n rows by m columns, beside the nominal machine.

    Attributes:
        row: ``(n,)`` lines of the file.
        read: ``(n, m)``; nan where nothing was read.
        noise: ``(m,)`` standard deviation of a reading.
        predicted: ``(n, m)`` by the nominal machine; nan where it is not known.
        group: ``(n,)`` which readings have one zero and one gain; of ramps those of a posture.
        sequence: ``(n,)`` which rows were read one after another.
        others: columns ``(n,)`` by name that were imposed; they may be copies.
        rounded: whether a column of multiples of a digit was rounded, and not set to these values, where other
            columns tell that.
    """

    file: str
    row: np.ndarray
    names: tuple[str, ...]
    read: Array
    noise: Array
    predicted: Array
    group: np.ndarray
    sequence: np.ndarray
    others: Mapping[str, Array] = field(default_factory=dict)
    rounded: Callable[[str, float], bool] | None = None

    def __len__(self) -> int:
        return len(self.row)

    @cached_property
    def left(self) -> Array:
        """Residual ``(n, m)``, see `_beside`; nan where nothing is known."""
        return np.column_stack([_robust(self, k) for k in range(len(self.names))])

    @property
    def fits(self) -> Array:
        """What the machine shows ``(n, m)`` with its own zero and gain; nan where nothing is known."""
        return self.read - self.left

    @cached_property
    def scale(self) -> Array:
        """``(m,)`` standard deviation of a residual by the median of their sizes, at least the noise."""
        known = [one[np.isfinite(one)] for one in self.left.T]
        sizes = [median_sigma(one) if len(one) else 0.0 for one in known]
        return np.maximum(sizes, self.noise)

    def doubt(
        self, words: str, column: int | None = None, begin: int = 0, end: int | None = None,
        kind: type[Finding] = Finding,
    ) -> Finding:  # fmt: skip
        """A finding on a column, or on some rows of it, or of all; of `ColumnsMistaken` nothing is fitted."""
        where = [] if column is None else [f"column {self.names[column]}"]
        if end is not None:
            rows = f"rows {self.row[begin]} to {self.row[end - 1]}"
            where.append(f"row {self.row[begin]}" if end - begin == 1 else rows)
        return kind(Grade.DOUBTFUL, f"{self.file}: {', '.join(where)}" if where else self.file, words)


Mistaken = Callable[[ReadColumns], Iterator[Finding]]
"""What finds one kind of mistake."""


def column_findings(
    c: ReadColumns, mistakes: Sequence[Mistaken], of_whole: Sequence[Mistaken] = ()
) -> Iterator[Finding]:
    """What is implausible about what was read.

    Those ``of_whole`` are asked for where none of the ``mistakes`` is found; see `OF_WHOLE` and `MISTAKES`.

    Example:
        >>> import numpy as np
        >>> n, force = 12, np.linspace(1.0, 12.0, 12)[:, None] + 0.1 * np.sin(9.0 * np.arange(12.0))[:, None]
        >>> read = np.where(np.arange(n)[:, None] == 7, 1e3 * force, force)
        >>> one = np.zeros(n, dtype=int)
        >>> columns = ReadColumns("f.csv", np.arange(2, 14), ("fx_N",), read, np.array([0.01]), force, one, one)
        >>> [str(finding) for finding in column_findings(columns, MISTAKES)]
        ['f.csv: column fx_N, row 9: 8016.74 is 1000 times what fits: is its decimal point misplaced?']
    """
    known = np.isfinite(c.read)
    span = np.array(
        [float(np.ptp(one[own])) if own.any() else 0.0 for one, own in zip(c.read.T, known.T, strict=True)]
    )
    # a noise that is below any digit is no noise: the sheet is doubted for it
    keep = np.flatnonzero((known.sum(axis=0) > LEAST_ROWS) & (c.noise > LEAST_NOISE * span))
    if not len(keep):
        return
    columns = replace(
        c, names=tuple(c.names[k] for k in keep), read=c.read[:, keep], noise=c.noise[keep],
        predicted=c.predicted[:, keep],
    )  # fmt: skip
    findings = [one for mistake in mistakes for one in mistake(columns)]
    # what is mistaken in some cells may look like another order, or like another zero
    yield from findings or (one for mistake in of_whole for one in mistake(columns))


# --- What a machine of that kind may show: a least-squares fit to each group and column ---------------------------


def _beside_neighbours(p: Array, sequence: np.ndarray) -> Array:
    """Columns ``(n, b)`` of what a machine adds to its prediction ``(n,)`` without any mistake."""
    size = float(np.nanmax(np.abs(p), initial=0.0)) or 1.0
    x = np.nan_to_num(p) / size
    way = np.zeros(len(x))
    way[1:] = np.where(sequence[1:] == sequence[:-1], np.sign(np.diff(x)), 0.0)
    zero_and_gain = [np.ones(len(x)), x]
    # friction follows the way, backlash the side, hardening the size
    laws = [way, np.sign(x), x * np.abs(x), x**3]
    enough = len(x) > FEW * (len(zero_and_gain) + len(laws))
    return np.column_stack([*zero_and_gain, *(laws if enough else ())])


def _groups(c: ReadColumns, y: Array, k: int) -> Iterator[tuple[np.ndarray, Array]]:
    """Rows of each group in which a column is known, as read or as meant, and what its machine may add there."""
    for one in np.unique(c.group):
        own = np.flatnonzero((c.group == one) & np.isfinite(y) & np.isfinite(c.predicted[:, k]))
        if len(own):
            yield own, _beside_neighbours(c.predicted[own, k], c.sequence[own])


def _fitted(c: ReadColumns, y: Array, k: int, keep: np.ndarray) -> Array:
    """Residual ``(n,)`` of a column as read or as meant, with some rows fitted."""
    left = np.full(len(y), np.nan)
    for own, A in _groups(c, y, k):
        used = keep[own]
        if used.sum() > A.shape[1]:
            left[own] = y[own] - A @ np.linalg.lstsq(A[used], y[own][used], rcond=None)[0]
    return left


def _gain(c: ReadColumns, k: int) -> float:
    """Median of what was read over what is predicted, of the larger half; 0 where nothing is known."""
    y, p = c.read[:, k], c.predicted[:, k]
    known = np.isfinite(y) & np.isfinite(p) & (p != 0.0)
    large = known & (np.abs(p) >= np.median(np.abs(p[known]))) if known.any() else known
    return float(np.median(y[large] / p[large])) if large.any() else 0.0


def _robust(c: ReadColumns, k: int) -> Array:
    """Residual of a column, fitted to the rows that most agree with."""
    y, p = c.read[:, k], c.predicted[:, k]
    left = y - _gain(c, k) * p
    for _ in range(ROUNDS):
        known = np.isfinite(left)
        spread = max(median_sigma(left[known]), c.noise[k]) if known.any() else 0.0
        left = _fitted(c, y, k, known & (np.abs(np.nan_to_num(left)) <= level(len(y)) * spread))
    return left


# --- The mistakes -------------------------------------------------------------------------------------------------


def agreeing(digit: float, noise: float) -> float:
    """Probability that two readings of one value, rounded to a digit, are the same; the value lies anywhere."""
    if not noise > 0.0:
        return 1.0
    x = min(digit / (2.0 * noise), 1e6)
    return float(erf(x) - (1.0 - np.exp(-(x**2))) / (x * np.sqrt(np.pi))) if x > 0.0 else 0.0


def last_digit(values: Array) -> float:
    """What readings are rounded to: a power of ten from 1e3 down to 1e-12."""
    known = values[~np.isnan(values)]
    least = 1e-12 * float(np.abs(known).max(initial=0.0))
    exact = (10.0**-d for d in range(-3, 12) if np.all(np.abs(np.round(known, d) - known) <= least))
    return next(exact, 1e-12)


def _step(values: Array) -> float:
    """What readings are multiples of: of a counter the least step between them, else the last digit."""
    steps, digit = np.diff(np.unique(values[np.isfinite(values)])), last_digit(values)
    if len(steps) < LEAST_ROWS:
        return digit
    least = float(steps.min())
    count = np.round(steps / least)
    # each reading is rounded to the digit, and so is the least step
    counts = bool(np.all(np.abs(steps - count * least) <= digit * (1.0 + count)))
    return least if counts and least > digit else digit


def repeated(c: ReadColumns) -> Iterator[Finding]:
    """Rows whose readings stand in the file before: pasted twice, or some rows from where they belong."""
    filled = (np.isfinite(c.read) & (c.read != 0.0)).any(axis=1)
    first: dict[bytes, int] = {}
    before = np.array(
        [first.setdefault(one.tobytes(), k) for k, one in enumerate(np.nan_to_num(c.read, nan=1e300))]
    )
    again = before < np.arange(len(c))
    # by how far a row stands behind the first of its kind: the same within a block
    behind = np.where(again & filled, np.arange(len(c)) - before, 0)
    chance = 1.0
    for values, noise in zip(c.read.T, c.noise, strict=True):
        chance *= max(agreeing(_step(values[~again]), noise), _elsewhere(values, again))

    def rare(rows: int, by: int) -> bool:
        # of all pairs of rows that stand no further apart
        return bool(len(c) * by * chance**rows < CHANCE)

    blocks = [(a, b) for a, b in runs(behind) if behind[a] > 0 and rare(b - a, int(behind[a]))]
    for a, b in blocks[:1]:
        by, more = int(behind[a]), f" (and {len(blocks) - 1} more)" if len(blocks) > 1 else ""
        source = f"row {c.row[before[a]]}" if b - a == 1 else f"rows {c.row[before[a]]} to {c.row[before[b - 1]]}"
        shifted = f", or are readings shifted by {by} row{'s' if by > 1 else ''}" if by == b - a else ""
        yield c.doubt(f"the same was read as in {source}{more}: was it written twice{shifted}?", None, a, b)


def _elsewhere(values: Array, again: np.ndarray) -> float:
    """Share of rows that repeat the one before in a column while the others do not: a slow test may do so."""
    pairs = np.isfinite(values[1:]) & ~again[1:]
    return float(np.mean(values[1:][pairs] == values[:-1][pairs])) if pairs.any() else 0.0


def copied(c: ReadColumns) -> Iterator[Finding]:
    """Two columns that are the same in most rows, which the machine does not show alike."""
    columns = {**dict(zip(c.names, c.read.T, strict=True)), **c.others}
    predicted = dict(zip(c.names, c.predicted.T, strict=True))
    for (a, x), (b, y) in combinations(columns.items(), 2):
        both = np.isfinite(x) & np.isfinite(y)
        same = (x == y) & both & (x != 0.0)
        if a in predicted and b in predicted:
            # as the two equal modes of a round beam are
            same &= ~(np.abs(predicted[a] - predicted[b]) <= c.noise[c.names.index(a)])
        if a in c.names and same.sum() > LEAST_ROWS and 2 * same.sum() > both.sum() and np.ptp(x[same]) > 0.0:
            words = f"is the same as column {b} in {int(same.sum())} of {int(both.sum())} rows: was it copied?"
            yield c.doubt(words, c.names.index(a), kind=ColumnsMistaken)


def one_value(c: ReadColumns) -> Iterator[Finding]:
    """One value that stands so often, or so far off, that it was not read each time."""
    for k, values in enumerate(c.read.T):
        kinds, count = np.unique(values[np.isfinite(values)], return_counts=True)
        for value in kinds[np.argsort(-count, kind="stable")][:LEAST_ROWS]:
            if finding := _not_read(c, k, float(value)):
                yield finding
                break


def _not_read(c: ReadColumns, k: int, value: float) -> Finding | None:
    """What is said of one value of a column."""
    values, equal = c.read[:, k], c.read[:, k] == value
    indices, n = np.flatnonzero(equal), int(np.isfinite(values).sum())
    expected, digit = c.predicted[:, k] * (1.0 if len(indices) == n else _gain(c, k)), _step(values)
    least = DEADBAND * max(float(c.noise[k]), _roughness(expected, c.sequence)) + digit

    def moves(rows: np.ndarray) -> bool:
        """Whether the machine goes on: where it stands, or comes back, one value is shown again."""
        known = expected[rows][np.isfinite(expected[rows])]
        return not np.isfinite(expected).any() or (len(known) > 0 and float(np.ptp(known)) > least)

    if len(indices) < LEAST_ROWS:
        return None
    log_likely = float(np.log(max(agreeing(digit, c.noise[k]), _elsewhere(values, equal), 1e-300)))
    a, b = max(((a, b) for a, b in runs(equal) if equal[a]), key=lambda one: one[1] - one[0])
    # of a slow test runs of other values are long, too: as likely as the longest of them
    other = [end - begin for begin, end in runs(values) if begin != a]
    slow = log_likely if not other else max(log_likely, -float(np.log(len(other) + 1)) / max(other))
    what = f"readings are {value:g}, under a noise of {c.noise[k]:g}: "
    if b - a >= FEW and np.log(n) + (b - a - 1) * slow < np.log(CHANCE) and moves(np.arange(a, b)):
        words = "did the channel hang, reach the end of its range, or does the number stand for an absent value?"
        return c.doubt(f"{b - a} {what}{words} Leave such cells blank", k, a, b, ColumnsMistaken)
    # where all of them are far from what fits, they are so many of those that are
    far = np.abs(np.nan_to_num(c.left[:, k])) > level(n) * c.scale[k]
    among = int(far.sum()) if far[indices].all() and 2 * far.sum() < n else n
    log_sets = gammaln(among + 1) - gammaln(len(indices) + 1) - gammaln(among - len(indices) + 1)
    chance = log_sets + (len(indices) - 1) * log_likely < np.log(CHANCE)
    if not chance or (among == n and len(indices) == LEAST_ROWS) or not moves(indices):
        return None
    words = f"does it stand for an absent value, the first in row {c.row[indices[0]]}? Leave such cells blank"
    return c.doubt(f"{len(indices)} {what}{words}", k)


def _roughness(values: Array, sequence: np.ndarray) -> float:
    """Standard deviation by second differences of rows that were read one after another; 0 where none were."""
    follows = (sequence[2:] == sequence[:-2]) & np.isfinite(values[2:] - 2.0 * values[1:-1] + values[:-2])
    second = np.diff(values, 2)[follows]
    return median_sigma(second) / np.sqrt(6.0) if len(second) else 0.0


def digits_lost(c: ReadColumns) -> Iterator[Finding]:
    """Readings that are multiples of a step far above their noise, while the machine moves on."""
    for k, values in enumerate(c.read.T):
        step, span = _step(values), float(np.nanmax(values) - np.nanmin(values))
        # an instrument that counts in steps prints them with more digits, and has many of them
        digit = step if span < COARSEST * step else last_digit(values)
        if not digit > np.sqrt(12.0) * c.noise[k] or not span > 0.0:
            continue
        if c.rounded is not None:
            if not c.rounded(c.names[k], digit):
                continue
        elif np.isfinite(c.predicted[:, k]).any():
            # set values lie on the machine's curve, rounded ones beside it by shares of the digit
            off = c.left[np.isfinite(c.left[:, k]), k]
            if not len(off) or not float(np.std(off)) > 0.5 * digit / np.sqrt(12.0):
                continue
        words = f"every reading is a multiple of {digit:g}, far above its noise of {c.noise[k]:g}: "
        yield c.doubt(f"{words}were digits lost, or is one in another unit?", k, kind=ColumnsMistaken)


def sorted_values(c: ReadColumns) -> Iterator[Finding]:
    """A column that only rises, or only falls, while the machine goes to and fro."""
    for k, values in enumerate(c.read.T):
        known = np.isfinite(values) & np.isfinite(c.predicted[:, k])
        steps, expected = np.diff(values[known]), np.diff(c.predicted[known, k])
        for sign, words in ((1.0, "rises"), (-1.0, "falls")):
            against = sign * expected < -DEADBAND * c.noise[k]
            # friction holds a machine still where it turns: what moved on did not
            if len(steps) and (sign * steps >= 0.0).all() and np.sum(against & (steps != 0.0)) >= FEW:
                yield c.doubt(
                    f"only {words} from row to row, while the model predicts to and fro: was it sorted?", k
                )


def misplaced_points(c: ReadColumns) -> Iterator[Finding]:
    """Single cells that are a power of ten times what fits, so nearly that it is no accident."""
    for k, values in enumerate(c.read.T):
        left, fits, limit = c.left[:, k], c.fits[:, k], level(len(c)) * c.scale[k]
        misplaced = []
        for i in np.flatnonzero(np.abs(np.nan_to_num(left)) > limit).tolist():
            off = {f: max(abs(values[i] / f - fits[i]), c.scale[k]) for f in SLIPS}
            factor = min(off, key=lambda f: off[f] * f)
            # a reading that is mistaken by anything comes so near to one of these by chance
            by_chance = len(SLIPS) * 2.0 * off[factor] * factor / max(abs(values[i]), 1e-300)
            misplaced += [(i, factor)] if by_chance < 1.0 / ODDS else []
        # of a few readings none is sure to be the right one
        if misplaced and 2 * max(len(misplaced), FEW) < len(c):
            i, factor = misplaced[0]
            more = f" (and {len(misplaced) - 1} more)" if len(misplaced) > 1 else ""
            words = f"{values[i]:.6g} is {factor:g} times what fits{more}: is its decimal point misplaced?"
            yield c.doubt(words, k, i, i + 1)


def zero_moved(c: ReadColumns) -> Iterator[Finding]:
    """A column that leaps from one row to the next and stays there, while the machine goes on."""
    for k in range(len(c.names)):
        best: tuple[float, int, float, int] | None = None
        for own, A in _groups(c, c.read[:, k], k):
            n = len(own)
            if n < 4 * FEW:
                continue
            # a drift, and what creeps, is no leap
            Q = np.linalg.qr(np.column_stack([A, np.linspace(-1.0, 1.0, n)]))[0]
            left = c.read[own, k] - Q @ (Q.T @ c.read[own, k])
            # of a step from each row on: its product with the residual, and its square beside the other columns
            product, along = (np.cumsum(one[::-1], axis=0)[::-1] for one in (left, Q))
            square = np.arange(n, 0, -1) - np.sum(along**2, axis=1)
            gain = product**2 / np.maximum(square, 1e-9 * n)
            i = FEW + int(np.argmax(gain[FEW:-FEW]))
            before = _squares(left)
            if _explains(before, before - float(gain[i]), n, n * len(c.names)) and (
                best is None or gain[i] > best[0]
            ):
                best = float(gain[i]), int(own[i]), float(product[i] / square[i]), n
        if best is not None and _leaps(c, k, best[1]):
            words = f"leaps by {best[2]:.3g} and stays there: was its zero set, or a tare not subtracted?"
            yield c.doubt(words, k, best[1], best[1] + 1)


def _leaps(c: ReadColumns, k: int, row: int) -> bool:
    """Whether the step into a row is larger than others, and no turn or change of side of the machine is there."""
    known = np.flatnonzero(np.isfinite(c.read[:, k]) & np.isfinite(c.predicted[:, k]))
    p, y, index = c.predicted[known, k], c.read[known, k], int(np.searchsorted(known, row)) - 1
    same = np.diff(c.sequence[known]) == 0
    if not same.any():
        return True  # no machine goes from one of these rows to the next
    around = p[max(index - 1, 0) : index + 3]
    turns = np.ptp(np.sign(np.diff(around))) > 0 or np.ptp(np.sign(around)) > 0
    steps = np.abs(np.diff(y - _gain(c, k) * p))
    usual = max(median_sigma(np.delete(steps, index)), c.noise[k])
    return bool(same[index] and not turns and steps[index] > level(len(steps)) * usual)


def other_order(c: ReadColumns) -> Iterator[Finding]:
    """Readings that stand some rows from where they belong, or in the reverse order."""
    n = len(c)
    if not np.isfinite(c.predicted).any() or n < 2 * FEW:
        return
    orders = {
        f"{way.words}: {way.remedy.rstrip(',')}": np.arange(n) + way.rows for way in shifted(n - FEW, "readings")
    }
    orders["readings_reversed: they fit in the reverse order, last row first"] = np.arange(n)[::-1]
    every = np.ones(n, dtype=bool)
    best: tuple[float, str] | None = None
    for words, order in orders.items():
        meant = reordered(c.read, order)
        both = np.isfinite(meant) & np.isfinite(c.read)
        before, after, count = 0.0, 0.0, 0
        for k in range(len(c.names)):
            as_read = _fitted(c, np.where(both[:, k], c.read[:, k], np.nan), k, every) / c.scale[k]
            put_right = _fitted(c, np.where(both[:, k], meant[:, k], np.nan), k, every) / c.scale[k]
            before, after = before + _squares(as_read), after + _squares(put_right)
            count += int(np.isfinite(as_read).sum())
        if _explains(before, after, count, len(orders)) and (best is None or after / before < best[0]):
            best = after / before, words
    if best is not None:
        yield c.doubt(best[1], kind=ColumnsMistaken)


def _explains(before: float, after: float, count: int, ways: int) -> bool:
    """Whether a mistake explains more of the squares than it leaves, and is more probable than none.

    The noise is as large as the residual; each mistake is as rare as `rarity` says.
    """
    if not 0.0 < 2.0 * after <= before or count < 2 * FEW:
        return False
    return 0.5 * count * float(np.log(before / after)) > rarity(ways) + np.log(ODDS)


def _squares(left: Array) -> float:
    return float(np.nansum(left**2))


MISTAKES: tuple[Mistaken, ...] = (repeated, copied, one_value, digits_lost, sorted_values, misplaced_points)
"""What is asked of columns that were read, in any kind of test."""
OF_WHOLE: tuple[Mistaken, ...] = (zero_moved, other_order)
"""What is asked of them where nothing of that is found."""
OF_IMPOSED: tuple[Mistaken, ...] = (one_value, digits_lost, misplaced_points)
"""What is asked of columns that were imposed: nobody expects them to go with the machine."""
