"""Starts of a fit by a coarse profile over the shapes of laws: each over the decades that its prior allows.

How far a joint turns before it slips, or at which load a gear's slope changes, moves readings only near one place
of the path. From another place no step of a fit leads there. So each shape is set to places over its prior in
turn, the other coordinates follow by one step, and a fit begins at the best place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.forward import values_of
from vjm_updating.inference.normal_equations import bounded_step
from vjm_updating.inference.parameters import Hypothesis
from vjm_updating.inference.trust_region import best_fit
from vjm_updating.observation.coordinate import Coordinate

SPREADS, PLACES = numerical(4.0), numerical(9)
"""Of a shape's prior to either side of its middle within which it is tried, and at how many places."""
DAMPING = numerical(1e-3)
"""Of the step by which other coordinates follow."""


def begun_anew(fitter: Fitter, fit: Fit) -> Fit:
    """A fit, or a better one of the same causes that begins elsewhere.

    Args:
        fitter: of the test.
        fit: where the search for its causes ended.
    """
    best = fit
    for i, c in enumerate(fit.found):
        if c.kind != "effect" or not np.isfinite(c.sigma):
            continue
        z = _elsewhere(fitter, best, i)
        if z is None:
            continue
        values = values_of(best.found, z, best.hypothesis)
        other = best_fit(fitter, best.hypothesis, z[: len(fitter.nuisances)], values)
        if other is not None and other.objective < best.objective - fitter.rounding:
            best = other
    return best


def _elsewhere(fitter: Fitter, fit: Fit, index: int) -> Array | None:
    """Coordinates ``(n_z,)`` with a shape at its best place that is not next to its own; None where none stands."""
    c, here = fit.found[index], float(fit.at.z[index])
    ends = max(c.low, c.mean - SPREADS * c.sigma), min(c.high, c.mean + SPREADS * c.sigma)
    places, apart = np.linspace(*ends, PLACES, retstep=True)
    least, found = np.inf, None
    for place in places[np.abs(places - here) > apart]:
        z = fit.at.z.copy()
        z[index] = place
        squares, followed = after_a_step(fitter, fit.hypothesis, fit.found, z, [index])
        if squares < least:
            least, found = squares, followed
    return found


def after_a_step(
    fitter: Fitter, hypothesis: Hypothesis, found: Sequence[Coordinate], z: Array, held: Sequence[int] = ()
) -> tuple[float, Array]:
    """Squares one step from a place, infinite where the machine does not stand, and where ``(n_z,)`` that leads.

    Args:
        fitter: of the test.
        hypothesis: the causes.
        found: its coordinates.
        z: the place ``(n_z,)``.
        held: indices of coordinates that stay.
    """
    at = fitter.evaluate(found, z, hypothesis)
    if at is None:
        return np.inf, z
    low, high = (np.array([getattr(one, end) for one in found]) for end in ("low", "high"))
    fixed = np.array([one.sigma == 0.0 for one in found])
    fixed[list(held)] = True
    linear = np.array([one.of_instrument for one in found])
    A, b = fitter.system(found, at, fitter.slopes(found, at, hypothesis))
    there = z + bounded_step(A, b, DAMPING, fixed, linear, z, low, high)
    moved = fitter.evaluate(found, there, hypothesis)
    # what is no better than where it begins stays
    ends = [(fitter.squares(found, one), where) for one, where in ((at, z), (moved, there)) if one is not None]
    return min(ends, key=lambda pair: pair[0])
