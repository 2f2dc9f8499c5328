"""Compiled laws of springs: forces by polynomials between knots, see `vjm.model.laws`."""

from __future__ import annotations

from vjm.kernels.arrays import Floats, Ints
from vjm.kernels.compilation import kernel

ORDER = 5
"""Coefficients of a force: it is at most of the fourth degree in the deflection."""


@kernel
def law_at(first: Ints, knots: Floats, pieces: Floats, law: int, u: float) -> tuple[float, float]:
    """Force and tangent of a law at a deflection.

    Args:
        first: ``(l + 1,)`` first knot of each law; its first piece is one further for every law before.
        knots: see `vjm.model.laws.Curve`, of all laws one after another.
        pieces: likewise.
        law: which.
        u: deflection.
    """
    k0, k1 = first[law], first[law + 1]
    k = k0
    while k < k1 and knots[k] <= u:
        k += 1
    own = pieces[k + law]
    s = u - knots[max(k - 1, k0)]
    force, slope = own[ORDER - 1], 0.0
    for power in range(ORDER - 2, -1, -1):
        slope = slope * s + force
        force = force * s + own[power]
    return force, slope


@kernel
def law_inverse(first: Ints, knots: Floats, pieces: Floats, law: int, force: float, u: float) -> float:
    """The deflection at a force, near enough for Newton's method to go on from; ``u`` where there is none."""
    k0, k1 = first[law], first[law + 1]
    low, high = knots[k0], knots[k1 - 1]
    at_low, slope_low = law_at(first, knots, pieces, law, low)
    at_high, slope_high = law_at(first, knots, pieces, law, high)
    if force <= at_low:
        slope_low = pieces[k0 + law, 1]
        return low + (force - at_low) / slope_low if slope_low > 0.0 else u
    if force >= at_high:
        slope_high = pieces[k1 + law, 1]
        return high + (force - at_high) / slope_high if slope_high > 0.0 else u
    return u
