"""The probability that a family of poses acts: against integrals by quadrature, and against made-up differences."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from vjm_updating.poses.findings import acting

POSTURES, FAMILIES = 150, 10


@pytest.mark.parametrize("deviate", [-3.0, 0.0, 1.5, 3.0, 4.5])
@pytest.mark.parametrize("postures", [20, 150])
def test_it_is_the_posterior_of_two_hypotheses(deviate, postures):
    # the deviate is normal about δ√n, δ half normal with unit spread where the family acts, zero where it does not
    def density(delta):
        return norm.pdf(deviate, delta * postures**0.5) * 2.0 * norm.pdf(delta)

    acts = quad(density, 0.0, 8.0, points=[max(deviate, 0.0) / postures**0.5], epsabs=1e-14, limit=200)[0]
    odds = acts / norm.pdf(deviate) / FAMILIES
    assert acting(deviate, postures, FAMILIES) == pytest.approx(odds / (1.0 + odds), rel=1e-6)


def test_of_what_is_said_to_act_with_a_probability_that_share_acts():
    rng = np.random.default_rng(12)
    n = 200_000
    # odds of one in as many as there are families
    acts = rng.random(n) < 1.0 / (FAMILIES + 1.0)
    size = np.where(acts, np.abs(rng.standard_normal(n)), 0.0)
    deviate = size * POSTURES**0.5 + rng.standard_normal(n)
    said = np.array([acting(z, POSTURES, FAMILIES) for z in deviate])
    for low, high in ((0.0, 0.05), (0.05, 0.3), (0.3, 0.7), (0.7, 0.95), (0.95, 1.01)):
        own = (low <= said) & (said < high)
        # three standard errors
        error = 3.0 * float(np.sqrt(said[own].mean() * (1.0 - said[own].mean()) / own.sum()))
        assert acts[own].mean() == pytest.approx(said[own].mean(), abs=error)


def test_a_family_without_effect_is_not_listed():
    # before, half of them were: the probability of a difference above zero is even where there is none
    assert acting(0.0, POSTURES, FAMILIES) < 0.01
    assert acting(4.5, POSTURES, FAMILIES) > 0.95
