"""Saint-Venant's torsion of a solid rectangle."""

from __future__ import annotations

import numpy as np
from scipy.special import zeta

TERMS = 16
"""tanh differs from one by less than 1e-20 in all further terms."""


def torsion_constant(width: float, height: float) -> float:
    """Torsion constant J of a solid rectangle, mm⁴, so that the torque is G J times the twist per length.

    With a ≥ b the longer and the shorter side, J = a b³ [1/3 − (64 b/π⁵ a) Σ tanh(n π a/2b)/n⁵], n = 1, 3, 5, …
    (Saint-Venant 1855; Timoshenko and Goodier, *Theory of Elasticity*, 3rd ed. 1970, section 109). The sum with one
    in the place of tanh is 31 ζ(5)/32; the rest converges exponentially.

    Args:
        width: one side, mm.
        height: the other, mm; J does not depend on which is which.

    Raises:
        ValueError: a side is not above 0.
    """
    if not (width > 0.0 and height > 0.0):
        raise ValueError(f"rectangle {width} x {height} mm: both sides must be above 0")
    a, b = max(width, height), min(width, height)
    n = np.arange(1, 2 * TERMS, 2)
    # 1 − tanh x = 2/(e²ˣ + 1), by e⁻²ˣ because e²ˣ overflows for slender rectangles
    decay = np.exp(-n * np.pi * a / b)
    total = 31.0 / 32.0 * zeta(5.0) - np.sum(2.0 * decay / (1.0 + decay) / n**5)
    return float(a * b**3 * (1.0 / 3.0 - 64.0 * b / (np.pi**5 * a) * total))
