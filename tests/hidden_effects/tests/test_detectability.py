"""Strength is docs/measured-data.md's minimum, found here by brute minimisation."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_effects.causes import catalogue
from hidden_effects.detectability import visibility
from hidden_effects.truth_models import as_drawn

from vjm_validation.virtual_rig import RigResponse


def covariance(design, stiffness):
    """Σ of docs/measured-data.md written out reading by reading."""
    c = len(design.channels)
    n = len(design)
    sequence = np.repeat(np.arange(len(design.sequences)), [len(s) for s in design.sequences])
    S = np.zeros((n * c, n * c))
    for i in range(n):
        for j in range(n):
            if sequence[i] != sequence[j]:
                continue
            rho = design.autocorrelation ** abs(i - j) if design.autocorrelation or i == j else 0.0
            for a in range(c):
                for b in range(c):
                    value = rho * stiffness[i, a] * stiffness[j, b] * design.instruments["ux_mm"].noise ** 2
                    if a == b:
                        value += rho * design.instruments[design.channels[a]].noise ** 2
                    S[i * c + a, j * c + b] = value
    return S


@pytest.mark.parametrize("autocorrelation", [0.0, 0.6])
def test_strength_is_the_minimum_over_the_nuisances(design, autocorrelation):
    design = replace(design, autocorrelation=autocorrelation)
    seen = visibility(design)
    (family,) = [f for f in catalogue(design, 4000.0) if f.cause == "actuator_compliance"]
    rig = as_drawn(design)
    change = seen.flat(family.members[0](rig, 5e-6).response(design).less(seen.nominal))
    inverse = np.linalg.inv(covariance(design, seen.stiffness))
    G, sigma = seen.nuisances
    normal = G.T @ inverse @ G + np.diag(1.0 / sigma**2)
    nu = np.linalg.solve(normal, G.T @ inverse @ change)
    left = change - G @ nu
    square = left @ inverse @ left + nu @ (nu / sigma**2)
    assert seen.strength(family.members[0](rig, 5e-6).response(design).less(seen.nominal)) == pytest.approx(
        np.sqrt(square), rel=1e-6
    )
    # and it is a minimum
    for k in range(len(nu)):
        aside = nu.copy()
        aside[k] += 0.1 * sigma[k]
        rest = change - G @ aside
        assert rest @ inverse @ rest + aside @ (aside / sigma**2) > square


def test_the_stiffness_is_the_derivative(design):
    seen = visibility(design)
    rig = replace(as_drawn(design), screw=lambda u: np.full_like(u, -1e-3))
    backward = (seen.nominal.forces - rig.response(design).forces) / 1e-3
    # one-sided differences from both sides: they differ by the curvature times 1e-3 mm
    assert seen.stiffness == pytest.approx(backward, rel=2e-3, abs=1.0)


def test_what_the_gauge_shows_counts_as_force(design):
    seen = visibility(design)
    n, c = seen.nominal.forces.shape
    shift = RigResponse(np.full(n, 0.004), np.zeros((n, c)))
    assert seen.flat(shift) == pytest.approx(-(seen.stiffness * 0.004).ravel())


@pytest.mark.parametrize("name", ["fx_N", "ux_mm"])
def test_a_zero_is_no_more_visible_than_its_size_over_its_sigma(design, name):
    # docs/measured-data.md: causes that are also nuisances are visible only as far as they exceed the sheet's sigma
    seen = visibility(design)
    known = design.instruments[name]
    (family,) = [f for f in catalogue(design, 4000.0) if f.name == f"instrument_zero {name}"]
    size = 10.0 * known.zero
    strength = seen.strength(family.members[0](as_drawn(design), size).response(design).less(seen.nominal))
    assert 1.0 < strength <= 10.0


def test_strength_grows_in_proportion_to_a_zero(design):
    seen = visibility(design)
    (family,) = [f for f in catalogue(design, 4000.0) if f.name == "instrument_zero fx_N"]
    one, two = (
        seen.strength(family.members[0](as_drawn(design), size).response(design).less(seen.nominal))
        for size in (5, 10)
    )
    assert two == pytest.approx(2.0 * one)
