"""Zeros and scales of the channels: what they do to readings, and their derivatives, against differences."""

import numpy as np
import pytest

from vjm_updating.calibration.parameters import CalibrationParameter
from vjm_updating.experiment import Kind
from vjm_updating.experiment.data_file import POSE, WRENCH
from vjm_updating.inference.instruments import SLOTS, InstrumentErrors
from vjm_updating.inference.parameters import EffectParameter, Evaluation, FitParameter, instrument_errors
from vjm_updating.mechanisms.effect import Quantity

RNG = np.random.default_rng(3)
STIFFNESS = np.diag([900.0, 700.0, 500.0, 4e4, 3e4, 2e4]) + 40.0 * RNG.standard_normal((6, 6))
READ, FORCES = 0.1 * RNG.standard_normal((5, 6)), 50.0 * RNG.standard_normal((5, 6))
FORCES[2, 4] = np.nan
OFF = {
    (Kind.ZERO, "ux_mm"): 0.02,
    (Kind.SCALE, "ux_mm"): 0.1,
    (Kind.SCALE, "ry_rad"): -0.2,
    (Kind.ZERO, "fz_N"): 3.0,
    (Kind.SCALE, "fz_N"): 0.15,
    (Kind.SCALE, "mx_Nmm"): -0.05,
}


def spring(off: dict, read: np.ndarray = READ) -> Evaluation:
    """A linear spring at the true displacements."""
    errors = InstrumentErrors.of(off)
    place = errors.true_displacement(read)
    wrench = place @ STIFFNESS.T
    stiffness = np.tile(STIFFNESS, (len(read), 1, 1))
    return Evaluation(np.zeros(0), errors.residual(FORCES, wrench), wrench, stiffness, place, errors)


def test_readings_are_scaled_and_shifted_true_values():
    errors = InstrumentErrors.of(OFF)
    u = errors.true_displacement(READ)
    np.testing.assert_allclose(1.1 * u[:, 0] + 0.02, READ[:, 0], rtol=1e-13)
    np.testing.assert_allclose(0.8 * u[:, 4], READ[:, 4], rtol=1e-13)
    np.testing.assert_array_equal(u[:, [1, 2, 3, 5]], READ[:, [1, 2, 3, 5]])
    np.testing.assert_allclose(errors.reading(FORCES)[:, 2], 1.15 * FORCES[:, 2] + 3.0, rtol=1e-13)
    assert errors.residual(FORCES, np.zeros((5, 6)))[2, 4] == 0.0


@pytest.mark.parametrize("kind", [Kind.ZERO, Kind.SCALE])
@pytest.mark.parametrize("channel", ["ux_mm", "uy_mm", "ry_rad", "fx_N", "fz_N", "mx_Nmm"])
def test_slopes_are_those_of_the_residuals(kind: Kind, channel: str):
    h = 1e-5
    more, less = (spring(OFF | {(kind, channel): OFF.get((kind, channel), 0.0) + s * h}) for s in (1.0, -1.0))
    slope = (more.residual - less.residual) / (2.0 * h)
    found = np.where(np.isnan(FORCES), 0.0, spring(OFF).slope(kind, channel, SLOTS))
    # rounding of residuals of some 1e3 over the step
    np.testing.assert_allclose(found, slope, rtol=1e-6, atol=1e-6)


def test_an_error_of_the_displacement_shows_by_the_sensitivity():
    at = spring(OFF)
    for k in range(len(POSE)):
        moved = spring(OFF, READ + 1e-3 * np.eye(6)[k])
        change = (moved.prediction - at.prediction) @ np.diag(at.errors.gain)
        # the spring is linear
        np.testing.assert_allclose(1e-3 * at.sensitivity[:, :, k], change, rtol=1e-9, atol=1e-12)


def test_channels_that_are_no_ones_have_no_say():
    assert not spring(OFF).slope(Kind.ZERO, "mid.uy_mm", SLOTS).any()
    plain = InstrumentErrors.of({(Kind.ZERO, "mid.uy_mm"): 1.0, (Kind.MODULUS, "link"): 0.1})
    assert not plain.zero_u.any()
    assert not plain.zero.any()
    assert (plain.gain == 1.0).all()
    assert (plain.gain_u == 1.0).all()


def test_another_point_may_take_the_displacements_place():
    slots = {"mid.uy_mm": 0}
    errors = InstrumentErrors.of({(Kind.ZERO, "mid.uy_mm"): 0.5, (Kind.ZERO, "ux_mm"): 7.0}, slots)
    assert errors.zero_u.tolist() == [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert len(WRENCH) == len(errors.zero)


# Coordinates and their values: one law there and back, and its derivative.


def of_quantity(*, log: bool) -> EffectParameter:
    quantity = Quantity("size", 0.1, 9.0, 0.5, usual=1.0, spread=1.0, log=log)
    return EffectParameter(name="size", kind="effect", subject="0", scale=quantity.scale, quantity=quantity)


COORDINATES = [
    *(FitParameter(f"{kind}", kind, "link", 0.3) for kind in Kind),
    CalibrationParameter("link.EIz", "parameter", "link", 1.0, nominal=4e7),
    CalibrationParameter("drive.compliance", "parameter", "drive", 1e-5, nominal=0.0, linear=True),
    of_quantity(log=True),
    of_quantity(log=False),
]


@pytest.mark.parametrize("own", COORDINATES, ids=[f"{c.name}-{type(c).__name__}" for c in COORDINATES])
@pytest.mark.parametrize("z", [-0.8, 0.0, 1.4])
def test_a_value_is_its_coordinates_and_changes_by_its_slope(own: FitParameter, z: float):
    assert own.coordinate(own.value(z)) == pytest.approx(z, abs=1e-12)
    h = 1e-5
    # of central differences
    assert own.slope(z) == pytest.approx((own.value(z + h) - own.value(z - h)) / (2.0 * h), rel=1e-8)


def test_errors_of_instruments_are_those_among_the_coordinates():
    found = [
        FitParameter("zero ux_mm", Kind.ZERO, "ux_mm", 0.002),
        FitParameter("scale fz_N", Kind.SCALE, "fz_N", 0.003),
        FitParameter("modulus link", Kind.MODULUS, "link", 0.02),
        of_quantity(log=True),
    ]
    assert [c.of_instrument for c in found] == [True, True, False, False]
    errors = instrument_errors(found, np.array([2.0, -1.0, 1.0, 0.5]), SLOTS)
    assert errors.zero_u.tolist() == [0.004, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert errors.gain.tolist() == [1.0, 1.0, 0.997, 1.0, 1.0, 1.0]
    assert errors.gain_u.tolist() == [1.0] * 6
