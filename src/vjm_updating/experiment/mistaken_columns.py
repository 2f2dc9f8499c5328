"""Which columns share a mistake: forces and moments are often, but not always, written by one instrument."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import tuned
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.experiment.comparison import CLEAR, FEW, Comparison, correlation
from vjm_updating.experiment.implausible_rows import roughness
from vjm_updating.experiment.mistaken_rows import CLOSELY, FAR, Mistaken, richest
from vjm_updating.experiment.mistakes import SIGN, UNIT

RELATED = tuned(0.5)
"""Correlation about zero of two columns from which on its sign means something."""
SAME_NOISE, OTHER_NOISE = tuned(0.5), tuned(1.0)
"""Logarithm of a quotient of two noises up to which they are one instrument's, and from which on they are not."""


def factors_of(c: Comparison, found: Mistaken) -> dict[str, float]:
    """What makes each mistaken column right.

    Args:
        c: readings beside the nominal machine.
        found: rows that are mistaken, in another unit or with the other sign.
    """
    way = found.way
    if c.columns != WRENCH or way.cause not in (UNIT, SIGN) or not any(name in WRENCH[:3] for name in way.factors):
        return dict(way.factors)
    factor = next(iter(way.factors.values()))
    there = [name for name in WRENCH if name in c.readings.values]
    spans = {name: float(np.ptp(v)) for name in there if name in WRENCH[:3]
             and len(v := _known(c.readings.values[name][found.rows]))}  # fmt: skip
    main = max(spans, key=lambda name: spans[name], default=there[0])
    rule = _turned if way.cause == SIGN else _converted
    return {name: factor for name in there if name == main or rule(c, found, name)}


def turned_rows(c: Comparison, label: str, name: str) -> np.ndarray:
    """Which of all readings ``(n,)`` of a posture, in one stretch, follow a prediction with the other sign.

    Args:
        c: readings beside the nominal machine.
        label: of the posture.
        name: of the channel.
    """
    at, k = c.at(label), c.columns.index(name)
    f, g = c.read[at, k], c.predicted(label)[:, k]
    least = CLEAR * c.noise(name)
    clear = np.nan_to_num(np.minimum(np.abs(f), np.abs(g))) > least
    size = np.maximum(np.abs(f) + np.abs(g) + least, 1e-300)
    right, other = (np.where(clear, 2.0 * np.abs(f - sign * g) / size, 0.0) for sign in (1.0, -1.0))
    _, begin, end = richest(right - other)
    rows, here = np.zeros(len(c.readings), dtype=bool), clear[begin:end]
    if here.sum() >= FEW and other[begin:end][here].mean() < CLOSELY < FAR < right[begin:end][here].mean():
        rows[at[begin:end]] = True
    return rows


def _turned(c: Comparison, found: Mistaken, name: str) -> bool:
    """Whether a column is turned, too: it goes against a clear prediction; as a rule it is where forces are."""
    predicted = c.curves.predicted()[found.rows, WRENCH.index(name)]
    known = c.measurement.sheet.instrument.get(name)
    size = float(np.sqrt(np.mean(_known(predicted) ** 2))) if len(_known(predicted)) else 0.0
    if size > CLEAR * (known.noise + known.zero if known else 0.0):
        alike = correlation(c.readings.values[name][found.rows], predicted)
        if abs(alike) > RELATED:
            return alike < 0.0
    return name in found.way.factors


def _converted(c: Comparison, found: Mistaken, name: str) -> bool:
    """Whether a column is in another unit, too: only converted is it as rough as elsewhere."""
    factor, known = next(iter(found.way.factors.values())), c.measurement.sheet.instrument.get(name)
    rough, usual = (roughness(c.readings.only(rows), name) for rows in (found.rows, ~found.rows))
    usual = usual or (known.noise if known else 0.0)
    if rough > 0.0 and usual > 0.0:
        as_is, converted = (abs(float(np.log(v / usual))) for v in (rough, rough * factor))
        if min(as_is, converted) < SAME_NOISE and max(as_is, converted) > OTHER_NOISE:
            return converted < as_is
    return name in found.way.factors


def _known(values: Array) -> Array:
    result: Array = values[~np.isnan(values)]
    return result
