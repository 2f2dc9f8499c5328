"""What the parameters of a hypothesis and its choice cost."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from vjm_updating.diagnosis.evidence import Costs, criterion, narrowed
from vjm_updating.inference.instruments import InstrumentZero
from vjm_updating.inference.parameters import Coordinate, coordinates
from vjm_updating.inference.significance import FALSE_ALARMS, NORMAL_95
from vjm_updating.mechanisms.drives import ActuatorCompliance
from vjm_updating.mechanisms.structure import LinkLumping


@pytest.mark.parametrize("precision", [0.0, 1e3, 1e6])
def test_readings_cost_what_they_narrow_a_shape_down_by(precision):
    """Evidence of a Gaussian likelihood under Cauchy's prior by quadrature, at and far beyond what is usual."""
    best = 0.0
    prior = np.sqrt(2.0)  # curvature of −log(1 + x²) at its middle
    cost = narrowed(np.array([[1.0 / (precision + prior**2)]]), np.array([prior]), np.ones(1))

    def density(x):
        return np.exp(-0.5 * precision * (x - best) ** 2) / (np.pi * (1.0 + x * x))

    wide = 10.0 / np.sqrt(precision) if precision else np.inf
    evidence = quad(density, -wide, wide, points=[0.0] if precision else None)[0]
    # reason: Laplace's approximation is right to 1/precision, of each side of the logarithm
    assert cost == pytest.approx(-2.0 * np.log(evidence), abs=4.0 / max(precision, 1e3))


def test_what_is_not_seen_costs_nothing_beside_what_is():
    """Two shapes of which readings see the sum alone: it is one number that they narrow down."""
    seen, prior = 1e4, np.full(2, np.sqrt(2.0))
    one = narrowed(np.array([[1.0 / (2.0 * seen + 2.0)]]), prior[:1], np.ones(1))
    both = np.linalg.inv(seen * np.ones((2, 2)) + np.diag(prior**2))
    # rounding of an inverse of condition 1e4
    assert narrowed(both, prior, np.ones(2)) == pytest.approx(one, abs=1e-6)


def test_what_either_is_or_is_not_has_no_parameter_to_pay_for():
    zero = Coordinate("zero fx_N", "zero", "fx_N", 1.0, sigma=np.inf)
    observed = SimpleNamespace()
    fitter = SimpleNamespace(
        forward=SimpleNamespace(observed=observed), normal=lambda fit: np.eye(1), pressure=lambda fit: np.zeros(1)
    )
    causes = LinkLumping(), InstrumentZero(part="fx_N")
    fits = (
        SimpleNamespace(hypothesis=(e,), found=[zero], at=SimpleNamespace(z=np.zeros(1)), objective=50.0)
        for e in causes
    )
    lumped, shifted = (criterion(fitter, fit, causes, 200.0) for fit in fits)
    # rounding of sums of a few tens
    assert shifted - lumped == pytest.approx(np.log(200.0), rel=1e-12)


def test_an_instrument_off_its_sheet_costs_what_that_says_against_it():
    zero = Coordinate("zero fx_N", "zero", "fx_N", 1.0, sigma=np.inf)
    fitter = SimpleNamespace(
        forward=SimpleNamespace(), normal=lambda fit: np.eye(1), pressure=lambda fit: np.zeros(1)
    )
    cause = InstrumentZero(part="fx_N")

    def cost(z):
        at = SimpleNamespace(z=np.array([z]))
        fit = SimpleNamespace(hypothesis=(cause,), found=[zero], at=at, objective=50.0)
        return criterion(fitter, fit, (cause,), 200.0, Costs(off_sheet=True))

    # twice the logarithm of the density of Cauchy's distribution; rounding of sums of a few tens
    assert cost(40.0) - cost(0.0) == pytest.approx(2.0 * np.log(1.0 + 40.0**2), rel=1e-12)


def test_what_a_sheet_gives_exactly_is_not_free():
    """A stiffness beside a scale that is exact: its size is known as if there were no scale."""
    drive = ActuatorCompliance()
    exact = Coordinate("scale fx_N", "scale", "fx_N", 1.0, sigma=0.0)
    alike = np.array([[1.0, 1.0], [1.0, 1.0 + 1e-6]])
    fitter = SimpleNamespace(forward=SimpleNamespace(), normal=lambda fit: alike, pressure=lambda fit: np.zeros(2))
    found = [exact, *coordinates([], (drive,))]
    fit = SimpleNamespace(
        hypothesis=(drive,), found=found, at=SimpleNamespace(z=np.array([0.0, 3.0])), objective=50.0
    )
    # three standard deviations of one: something acts, and costs its one parameter alone
    assert criterion(fitter, fit, (drive,), 200.0) == pytest.approx(50.0 + np.log(200.0), rel=1e-12)


@pytest.mark.parametrize(("sigmas", "disguised"), [(0.99 * NORMAL_95, True), (1.01 * NORMAL_95, False)])
def test_a_cause_that_may_as_well_be_nothing_costs_what_a_false_alarm_is_worth(sigmas, disguised):
    drive = ActuatorCompliance()
    fitter = SimpleNamespace(
        forward=SimpleNamespace(), normal=lambda fit: np.eye(1), pressure=lambda fit: np.zeros(1)
    )

    def cost(z):
        at = SimpleNamespace(z=np.array([z]))
        fit = SimpleNamespace(hypothesis=(drive,), found=coordinates([], (drive,)), at=at, objective=50.0)
        return criterion(fitter, fit, (drive,), 200.0)

    # rounding of sums of a few tens
    assert cost(sigmas) - cost(50.0) == pytest.approx(2.0 * np.log(1.0 / FALSE_ALARMS) * disguised, abs=1e-12)
