"""Errors of the model: shapes of a misfit that have no name, and laws that are right to some per cent only.

The shapes are smooth ones, differences on the way back, waves and jumps. Of inexact laws it is asked what they
change of a hypothesis' evidence.
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import definition, numerical
from vjm_updating.inference.observed import Observed
from vjm_updating.inference.significance import level

NODES = numerical(np.geomspace(0.1, 12.5, 19))
"""Relative errors over their prior's scale at which it is integrated. A smaller one shows nowhere. By more than the
last, 38 %, no law of a textbook is off: another one acts."""


NINE_IN_TEN = definition(6.31)
"""Relative error over its prior's scale that nine in ten laws stay below: the prior's quantile."""


def _masses(nodes: Array) -> Array:
    """Mass ``(k,)`` of a half-Cauchy prior in the cells about its nodes ``(k,)``, which ends at the last one."""
    edges = np.concatenate([[0.0], np.sqrt(nodes[1:] * nodes[:-1]), nodes[-1:]])
    mass: Array = np.diff(np.arctan(edges))
    return mass / mass.sum()


WEIGHTS = numerical(_masses(NODES))
"""Of the nodes, by the prior."""
SEEN = numerical(1e-12)
"""Share of the largest square below which a direction of a discrepancy is rounding."""


def principal(products: Array) -> tuple[Array, Array]:
    """Principal directions ``(n, k)`` of a discrepancy's columns, and their sizes ``(k,)``.

    From the products: what is smaller than half of the digits of the largest changes nothing. ``products`` (n, n)
    are of the columns with one another.

    Example:
        >>> principal(np.diag([4.0, 0.0]))[1].tolist()
        [2.0]
    """
    squares, turn = np.linalg.eigh(products)
    seen = squares > SEEN * squares.max(initial=0.0)
    return turn[:, seen], np.sqrt(squares[seen])


def costs(sizes: Array, left: Array, law_error: float) -> Array:
    """Twice the negative logarithm of what a discrepancy changes of the evidence, by its relative error at `NODES`.

    A law that is wrong by its own size has ``sizes`` (k,) along the discrepancy's principal directions in the space
    that the fit cannot absorb: standard deviations in units of the noise. The residual along them is ``left`` (k,).
    The scale of the relative error's half-Cauchy prior is ``law_error``.
    """
    variance = (law_error * NODES[:, None] * sizes) ** 2
    return np.sum(np.log1p(variance) - left**2 * variance / (1.0 + variance), axis=1)


def largest(law_error: float) -> float:
    """The largest relative error that the prior of a scale allows; see `NODES`."""
    return law_error * float(NODES[-1])


def likeliest(sizes: Array, left: Array, law_error: float) -> float:
    """The relative error that is the most probable one of the nodes; see `costs`.

    Example:
        >>> likeliest(np.full(40, 100.0), np.full(40, 10.0), 0.03) > 0.08
        True
    """
    return law_error * float(NODES[int(np.argmin(costs(sizes, left, law_error) - 2.0 * np.log(WEIGHTS)))])


def integrated(sizes: Array, left: Array, law_error: float) -> float:
    """The same with the relative error integrated out; see `costs`.

    Example:
        >>> integrated(np.zeros(1), np.zeros(1), 0.1)
        0.0
    """
    change = costs(sizes, left, law_error)
    least = float(change.min())
    return least - 2.0 * float(np.log(np.sum(WEIGHTS * np.exp(-0.5 * (change - least)))))


def mean_square(sizes: Array, left: Array, law_error: float) -> float:
    """Mean square of the relative error, given the residual; see `costs`.

    Example:
        >>> mean_square(np.full(40, 100.0), np.zeros(40), 0.03) ** 0.5 < 0.0031
        True
    """
    change = costs(sizes, left, law_error)
    posterior = WEIGHTS * np.exp(-0.5 * (change - change.min()))
    return float(posterior @ (law_error * NODES) ** 2 / posterior.sum())


ORDER = numerical(4)
"""Of the polynomials in the displacement."""
WAVES, A_WAVE = numerical(12), numerical(4)
"""Half waves over a ray's half at most, and readings for each of them."""
JUMPS = numerical(8)
"""Parts of a sequence between which jumps are looked for."""


def driven_place(observed: Observed) -> Array:
    """Each reading's place on its ray over the ray's length ``(n,)``, signed."""
    place = np.zeros(len(observed.imposed))
    for ray in observed.rays:
        s = observed.imposed[ray.index] @ ray.measure
        place[ray.index] = s / max(float(np.abs(s).max()), 1e-12)
    return place


def place_noise(observed: Observed) -> Array:
    """Standard deviation of each reading's place ``(n,)``."""
    result = np.zeros(len(observed.imposed))
    for ray in observed.rays:
        s = observed.imposed[ray.index] @ ray.measure
        spread = float(np.linalg.norm(ray.measure * observed.noise.pose))
        result[ray.index] = spread / max(float(np.abs(s).max()), 1e-12)
    return result


def driven_channel(observed: Observed) -> str:
    """The displacement that moved most."""
    size = {name: float(np.nanmax(np.abs(observed.readings.values[name]))) for name in observed.pose_channels}
    return max(size, key=lambda name: size[name] * (1.0 if name.endswith("mm") else 100.0))


def loading(observed: Observed, channel: str = "") -> Array:
    """+1 on the way out, −1 on the way back, 0 held ``(n,)``, of a driven channel; by default the main one."""
    channel = channel or driven_channel(observed)
    known = observed.measurement.sheet.instrument.get(channel)
    return observed.readings.ways(channel, known.noise if known else 0.0)


def _while_held(way: Array) -> Array:
    """How long each reading has been held, from 0 to 1 within each hold ``(n,)``; 0 elsewhere."""
    result = np.zeros(len(way))
    still = np.concatenate([[False], way == 0.0, [False]])
    begins, ends = np.flatnonzero(~still[:-1] & still[1:]), np.flatnonzero(still[:-1] & ~still[1:])
    for a, b in zip(begins, ends, strict=True):
        result[a:b] = np.arange(1, b - a + 1) / (b - a)
    return result


def smooth_shapes(observed: Observed) -> tuple[Array, list[str]]:
    """Shapes ``(n, k)`` of one channel, orthonormal within a posture, and what each is about."""
    place, way = driven_place(observed), loading(observed)
    unsure = place_noise(observed)
    clock = np.arange(len(place), dtype=float) if observed.clock is None else observed.clock
    warmth = observed.warmth
    columns, names = [], []
    for label in dict.fromkeys(observed.readings.posture.tolist()):
        on = observed.readings.posture == label
        p, w = place[on], way[on]
        t = clock[on] - clock[on].mean()
        t = t / max(float(np.abs(t).max()), 1e-12)
        # a steady ramp tells the clock from the gauge by the gauge's noise alone, which is no shape: even the usual
        # reading must show more of one than the largest of so many errors
        least = level(len(p)) * float(unsure[on].max()) * np.sqrt(len(p))
        parts = [p**k for k in range(ORDER + 1)]
        kinds = ["shape"] * len(parts)
        if (p > 0.2).any() and (p < -0.2).any():
            parts += [np.abs(p), np.abs(p) ** 2, np.abs(p) ** 3]
            kinds += ["pull against push"] * 3
        if (w > 0.0).any() and (w < 0.0).any():
            parts += [w, w * p, w * np.abs(p)]
            kinds += ["way out against way back"] * 3
        if (w == 0.0).any() and (w != 0.0).any():
            held = _while_held(w)
            parts += [held, held * p]
            kinds += ["while held"] * 2
        if warmth is not None and np.ptp(warmth[on]) > 0.0:
            warm = warmth[on] - warmth[on].mean()
            warm = warm / float(np.abs(warm).max())
            parts += [warm, warm * p]
            kinds += ["with the temperature"] * 2
        if np.ptp(t) > 0.0:
            parts += [t, t * p]
            kinds += ["in time"] * 2
        Q = np.zeros((len(p), 0))
        for part, kind in zip(parts, kinds, strict=True):
            rest = part - Q @ (Q.T @ part)
            rest = rest - Q @ (Q.T @ rest)
            size = float(np.linalg.norm(rest))
            if size < max(1e-3 * float(np.linalg.norm(part)), least) or size == 0.0:
                continue
            Q = np.column_stack([Q, rest / size])
            column = np.zeros(len(place))
            column[on] = rest / size
            columns.append(column)
            names.append(f"posture {label}: {kind}")
    # where nothing moved beyond its noise there is no ramp
    return np.column_stack([np.zeros((len(place), 0)), *columns]), names


def sudden_shapes(observed: Observed) -> tuple[Array, list[str]]:
    """Waves along the ramp and jumps in the order of the readings ``(n, k)``, and what each is about."""
    place, sequence = driven_place(observed), observed.readings.sequence
    columns, names = [], []
    for label in dict.fromkeys(observed.readings.posture.tolist()):
        on = observed.readings.posture == label
        for k in range(2, min(WAVES, int(on.sum()) // A_WAVE) + 1):
            columns += [np.where(on, np.cos(np.pi * k * place), 0.0), np.where(on, np.sin(np.pi * k * place), 0.0)]
            names += [f"posture {label}: a wave of {2.0 / k:.2g} of the ramp"] * 2
    for number in np.unique(sequence):
        own = np.flatnonzero(sequence == number)
        for edge in sorted({len(own) * k // JUMPS for k in range(1, JUMPS)} - {0}):
            column = np.zeros(len(place))
            column[own[edge:]] = 1.0
            columns.append(column)
            names.append(f"sequence {number}: a jump")
    return np.column_stack(columns) if columns else np.zeros((len(place), 0)), names
