"""A drive's stiffness over its load."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm_updating.mechanisms.drives import EXPONENT, ActuatorHardening
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.series_elements import History

LARGEST, SOFT = 2000.0, 5e-5


def deflection(N, values, compliance=0.0):
    """Extension beyond the model's own spring, and its slope."""
    machine = ModifiedChain(load_chain("orthoglide-chain"), VjmEngine(4))
    (element,) = ActuatorHardening(LARGEST, compliance).elements(machine, values)
    nowhere = np.zeros((len(N), 3))
    return element.law(N, History(np.zeros(len(N)), np.zeros(len(N), dtype=bool), nowhere, nowhere))


@pytest.mark.parametrize(("ratio", "exponent"), [(0.3, 0.5), (0.3, 2.0), (4.0, 1.0), (4.0, 0.4)])
def test_the_ratio_is_that_of_the_tangents_and_the_tangent_that_of_the_curve(ratio, exponent):
    N = np.array([-1.5, -1.0, -0.4, 0.0, 0.2, 1.0, 1.5]) * LARGEST
    x, slope = deflection(N, (ratio, SOFT, exponent))
    assert slope[[1, 3, 5, 6]] == pytest.approx(SOFT * np.array([1.0 / ratio, 1.0, 1.0 / ratio, 1.0 / ratio]))
    assert x == pytest.approx(-deflection(-N, (ratio, SOFT, exponent))[0])
    h = 1e-3 * LARGEST
    steps = (deflection(N + h, (ratio, SOFT, exponent))[0] - deflection(N - h, (ratio, SOFT, exponent))[0]) / (
        2.0 * h
    )
    smooth = [2, 4]
    # central differences miss m (m - 1)/6 (h/N)² of what the load adds: 8e-6 at most, at a fifth of it and m = 2
    assert slope[smooth] == pytest.approx(steps[smooth], rel=1e-5)


def test_the_models_own_spring_is_replaced():
    N = np.linspace(-LARGEST, LARGEST, 5)
    own, _ = deflection(N, (2.0, 1.0), compliance=SOFT)
    whole, _ = deflection(N, (2.0, SOFT, 1.0))
    assert own == pytest.approx(whole - SOFT * N)


@pytest.mark.parametrize("law", ["stiffness", "exponential"])
@pytest.mark.parametrize("ratio", [0.3, 0.5, 2.0, 3.0])
def test_other_laws_come_near(law, ratio):
    """Stiffness that grows, or falls, evenly or exponentially: to a part of what it changes."""
    N = np.linspace(0.0, LARGEST, 41)
    u, a = N / LARGEST, ratio - 1.0
    s = np.log(ratio)
    x = SOFT * LARGEST * (np.log1p(a * u) / a if law == "stiffness" else -np.expm1(-s * u) / s)

    def missed(exponent):
        ours = deflection(N, (ratio, SOFT, exponent))[0]
        return np.abs(ours - x).max() / np.abs(x - SOFT * N).max()

    best = minimize_scalar(missed, bounds=(EXPONENT.low, EXPONENT.high), method="bounded")
    # with both ends' tangents held, less than the tenth of its size that a search forgives a law
    assert best.fun < 0.08
    # and within what is thought usual
    assert abs(np.log(best.x / EXPONENT.usual)) < 2.0 * EXPONENT.spread
