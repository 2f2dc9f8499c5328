"""Torsion constant of the rectangle."""

from __future__ import annotations

import numpy as np
import pytest

from vjm_validation.exact.torsion import torsion_constant


@pytest.mark.parametrize(("a", "b"), [(1.0, 1.0), (1.0, 2.0), (5.0, 3.0), (1.0, 8.0)])
def test_double_sine_series(a, b):
    # J = (256/π⁶) Σ Σ a b/(m² n² (m²/a² + n²/b²)), m, n odd: Prandtl's function in both directions. Of the terms
    # beyond 20001 in n at most 1e-12 is left, and the sum over m is taken in closed form:
    # Σ 1/(m² (m² + c²)) = π²/8c² − π tanh(πc/2)/4c³.
    n = np.arange(1.0, 20002.0, 2.0)
    c = n * a / b
    over_m = a**2 * (np.pi**2 / (8.0 * c**2) - np.pi * np.tanh(0.5 * np.pi * c) / (4.0 * c**3))
    J = 256.0 / np.pi**6 * a * b * np.sum(over_m / n**2)
    assert torsion_constant(a, b) == pytest.approx(J, rel=1e-9)


@pytest.mark.parametrize(("a", "b"), [(1.0, 1.0), (1.2, 1.0), (2.0, 1.0)])
def test_series_along_the_other_side(a, b):
    # the single series holds with the sides exchanged too, with an independent remainder
    n = np.arange(1.0, 400.0, 2.0)
    tail = 31.0 / 32.0 * 1.0369277551433699 - np.sum((1.0 - np.tanh(0.5 * n * np.pi * b / a)) / n**5)
    assert torsion_constant(a, b) == pytest.approx(
        b * a**3 * (1.0 / 3.0 - 64.0 * a / (np.pi**5 * b) * tail), rel=1e-12
    )


# Timoshenko and Goodier, *Theory of Elasticity*, section 109, J/(a b³): half a unit of the last printed digit
@pytest.mark.parametrize(
    ("ratio", "printed"), [(1.0, 0.1406), (2.0, 0.229), (3.0, 0.263), (5.0, 0.291), (10.0, 0.312)]
)
def test_timoshenko_and_goodier(ratio, printed):
    digits = 4 if ratio == 1.0 else 3
    assert torsion_constant(ratio, 1.0) / ratio == pytest.approx(printed, abs=0.51 * 10.0**-digits)


def test_limits_and_symmetry():
    assert torsion_constant(3.0, 7.0) == torsion_constant(7.0, 3.0)
    # a b³ (1/3 − 0.21 b/a) for a thin strip; the remainder is exponentially small
    strip = 1e4 / 3.0 - 64.0 / np.pi**5 * 31.0 / 32.0 * 1.0369277551433699
    assert torsion_constant(1e4, 1.0) == pytest.approx(strip, rel=1e-14)


def test_out_of_range_is_refused():
    with pytest.raises(ValueError, match="both sides"):
        torsion_constant(0.0, 1.0)
