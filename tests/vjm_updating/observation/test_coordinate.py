"""Coordinates and their values: one law there and back, and its derivative."""

from __future__ import annotations

import numpy as np
import pytest

from vjm_updating.calibration.parameters import Unknown
from vjm_updating.experiment import Kind
from vjm_updating.inference.instruments import SLOTS
from vjm_updating.inference.parameters import Coordinate, EffectCoordinate, instrument_errors
from vjm_updating.mechanisms.effect import Quantity


def of_quantity(*, log: bool) -> EffectCoordinate:
    quantity = Quantity("size", 0.1, 9.0, 0.5, usual=1.0, spread=1.0, log=log)
    return EffectCoordinate(name="size", kind="effect", subject="0", scale=quantity.scale, quantity=quantity)


COORDINATES = [
    *(Coordinate(f"{kind}", kind, "link", 0.3) for kind in Kind),
    Unknown("link.EIz", "parameter", "link", 1.0, nominal=4e7),
    Unknown("drive.compliance", "parameter", "drive", 1e-5, nominal=0.0, linear=True),
    of_quantity(log=True),
    of_quantity(log=False),
]


@pytest.mark.parametrize("own", COORDINATES, ids=[f"{c.name}-{type(c).__name__}" for c in COORDINATES])
@pytest.mark.parametrize("z", [-0.8, 0.0, 1.4])
def test_a_value_is_its_coordinates_and_changes_by_its_slope(own: Coordinate, z: float):
    assert own.coordinate(own.value(z)) == pytest.approx(z, abs=1e-12)
    h = 1e-5
    # of central differences
    assert own.slope(z) == pytest.approx((own.value(z + h) - own.value(z - h)) / (2.0 * h), rel=1e-8)


def test_errors_of_instruments_are_those_among_the_coordinates():
    found = [
        Coordinate("zero ux_mm", Kind.ZERO, "ux_mm", 0.002),
        Coordinate("scale fz_N", Kind.SCALE, "fz_N", 0.003),
        Coordinate("modulus link", Kind.MODULUS, "link", 0.02),
        of_quantity(log=True),
    ]
    assert [c.of_instrument for c in found] == [True, True, False, False]
    errors = instrument_errors(found, np.array([2.0, -1.0, 1.0, 0.5]), SLOTS)
    assert errors.zero_u.tolist() == [0.004, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert errors.gain.tolist() == [1.0, 1.0, 0.997, 1.0, 1.0, 1.0]
    assert errors.gain_u.tolist() == [1.0] * 6
