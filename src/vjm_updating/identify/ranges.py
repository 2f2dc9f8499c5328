"""How wide the set of beams is that meet every entry of a compliance: what the rounding leaves open."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, tuned
from vjm_updating.identify.candidates import AT_THE_BOUND, Form, Space, as_people_write_it
from vjm_updating.identify.fitting import BeamFit
from vjm_updating.identify.rounding import smallest

STIFFNESSES = ("EA_N", "GJ_Nmm2", "EIy_Nmm2", "EIz_Nmm2", "GAy_N", "GAz_N")
"""Names in the order of a space's coordinates."""
OPEN = tuned(2.0)
"""Ratio of highest to lowest from which a stiffness counts as not identifiable."""
SLACK = numerical(1e-4)
"""Of the intervals, that an optimiser leaves."""
TRIALS = numerical(8)
"""Searches for one end."""
FIRST_RADIUS = numerical(0.2)
"""Of a search with short steps, in the logarithms and rad that the coordinates are."""
ENOUGH = numerical(1e-5)
"""Gain at which an end counts as reached, relative."""
UPRIGHT = numerical(0.98)
"""Cosine to the z axis from which an azimuth means little."""


@dataclass(frozen=True)
class Range:
    """What a quantity can be.

    Attributes:
        low: lowest value.
        high: highest value, infinite where no entry sets a limit.
    """

    low: float
    high: float

    @property
    def identifiable(self) -> bool:
        """Whether a stiffness is known to a factor of two."""
        return self.high < OPEN * self.low


@dataclass(frozen=True)
class _Quantity:
    """A function of a point: its value, its gradient ``(n,)``; for a stiffness its logarithm and its coordinate."""

    value: Callable[[Array], tuple[float, Array]]
    coordinate: int | None = None


def ranges(fits: list[BeamFit]) -> dict[str, Range]:
    """Range of length, direction, offset and stiffnesses over the beams that meet every entry.

    Each end is found by a local search from every given fit. What is reported is reached for certain; the set may
    be wider yet.

    Args:
        fits: beams of one form that meet every entry.

    Returns:
        By name with its unit: ``length_mm``, ``azimuth_deg``, ``elevation_deg``, ``offset_x_mm``, ``EA_N`` etc.
    """
    found: dict[str, Range] = {}
    for fit in fits:
        beam = as_people_write_it(fit.beam)
        space = Space(fit.space.target, fit.space.form, beam.section_frame)
        x = space.point(beam)
        for name, quantity in _quantities(space).items():
            if name == "azimuth_deg" and abs(beam.section_frame[2, 0]) > UPRIGHT:
                continue
            low, high = (_end(space, x, quantity, sign) for sign in (-1, 1))
            before = found.get(name, Range(np.inf, -np.inf))
            found[name] = Range(min(low, before.low), max(high, before.high))
    return found


def entry_range(fits: list[BeamFit], i: int, j: int) -> Range:
    """Range of the compliance's entry (i, j) over the beams that meet every other entry, sought as in `ranges`.

    Args:
        fits: beams of one form that meet every entry of a target from which this one was left out.
        i: zero-based.
        j: zero-based.
    """

    def quantity(space: Space) -> _Quantity:
        # as large as a diagonal entry's share, so that one tolerance serves all
        unit = float(np.sqrt(space.target.matrix[i, i] * space.target.matrix[j, j]))

        def scaled(x: Array) -> tuple[float, Array]:
            value, slope = space.entry(x, i, j)
            return value / unit, slope / unit

        return _Quantity(scaled)

    ends = [_end(fit.space, fit.x, quantity(fit.space), sign) for fit in fits for sign in (-1, 1)]
    C = fits[0].space.target.matrix
    unit = float(np.sqrt(C[i, i] * C[j, j]))
    return Range(min(ends) * unit, max(ends) * unit)


def _quantities(space: Space) -> dict[str, _Quantity]:
    n = len(space.bounds[0])

    def linear(slope: Array) -> Callable[[Array], tuple[float, Array]]:
        return lambda x: (float(slope @ x), slope)

    def azimuth(x: Array) -> tuple[float, Array]:
        d, D = space.direction(x)
        slope = (d[0] * D[1] - d[1] * D[0]) / (d[0] ** 2 + d[1] ** 2)
        return float(np.rad2deg(np.arctan2(d[1], d[0]))), np.rad2deg(slope)

    def elevation(x: Array) -> tuple[float, Array]:
        d, D = space.direction(x)
        # rounding may leave a unit vector's entry above 1
        across = float(np.hypot(d[0], d[1]))
        return float(np.rad2deg(np.arctan2(d[2], across))), np.rad2deg(D[2] / across)

    def length(x: Array) -> tuple[float, Array]:
        L = float(np.exp(x[3]))
        return L, L * np.eye(n)[3]

    result = {
        "length_mm": _Quantity(length),
        "azimuth_deg": _Quantity(azimuth),
        "elevation_deg": _Quantity(elevation),
    }
    first = 4
    if space.form is Form.OFFSET:
        for k, axis in enumerate("xyz"):
            result[f"offset_{axis}_mm"] = _Quantity(linear(space.target.size * np.eye(n)[4 + k]))
        first = 7
    names = STIFFNESSES if space.form is Form.SHEARED else STIFFNESSES[:4]
    for k, name in enumerate(names, first):
        result[name] = _Quantity(linear(np.eye(n)[3] - np.eye(n)[k]), k)
    return result


def _end(space: Space, x: Array, quantity: _Quantity, sign: int) -> float:
    """Furthest value over the beams that meet every entry, searched from one that does."""
    at, radius = x, np.inf
    for _ in range(TRIALS):
        y = _ahead(space, at, quantity, sign, radius)
        gain = sign * (quantity.value(y)[0] - quantity.value(at)[0])
        if BeamFit(space, y).worst > 1.0 + SLACK or gain < 0.0:
            # the linear model led astray: go on with smaller steps
            radius = min(0.3 * radius, FIRST_RADIUS)
            continue
        enough = gain < ENOUGH * (1.0 + abs(quantity.value(y)[0]))
        at, radius = y, 3.0 * radius
        if enough:
            break
    value, k = quantity.value(at)[0], quantity.coordinate
    if k is None:
        return value
    low = space.bounds[0][k]
    return float("inf") if sign > 0 and at[k] < low + AT_THE_BOUND else float(np.exp(value))


def _ahead(space: Space, x: Array, quantity: _Quantity, sign: int, radius: float) -> Array:
    """A point further on, at most ``radius`` away in every coordinate."""
    # near one whatever the quantity, so that one tolerance serves all
    unit = max(float(np.linalg.norm(quantity.value(x)[1])), 1e-12)
    low, high = space.bounds

    def objective(y: Array) -> tuple[float, Array]:
        value, slope = quantity.value(y)
        return -sign * value / unit, -sign * slope / unit

    def margins(y: Array) -> tuple[Array, Array]:
        r, J = space.residuals(y), space.slopes(y)
        return np.concatenate([1.0 - r, 1.0 + r]), np.vstack([-J, J])

    bounds = np.maximum(low, x - radius), np.minimum(high, x + radius)
    return smallest(objective, x, bounds, margins, iterations=100, tolerance=1e-9)
