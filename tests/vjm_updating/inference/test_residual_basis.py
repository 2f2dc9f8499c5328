"""Shapes without a name are of what was read, and not of its gauge's noise."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from vjm_updating.inference import model_error
from vjm_updating.inference.model_error import smooth_shapes

N = 200
"""Readings."""
NOISE = 2e-3
"""Of a place on its ramp, over the ramp."""


@pytest.mark.parametrize(("slow", "seen"), [(0.0, False), (2.0, False), (9.0, True)])
def test_the_clock_is_a_shape_where_the_drive_went_otherwise_than_by_it(monkeypatch, slow, seen):
    """A ramp that lags behind the clock by a wave of so many of its gauge's deviations."""
    rng = np.random.default_rng(4)
    clock = np.linspace(0.0, 1.0, N)
    place = clock + slow * NOISE * np.sin(40.0 * clock) + NOISE * rng.standard_normal(N)
    monkeypatch.setattr(model_error, "driven_place", lambda observed: place)
    monkeypatch.setattr(model_error, "place_noise", lambda observed: np.full(N, NOISE))
    monkeypatch.setattr(model_error, "loading", lambda observed: np.ones(N))
    observed = SimpleNamespace(
        clock=clock, warmth=None, readings=SimpleNamespace(posture=np.full(N, "A"), sequence=np.zeros(N, dtype=int))
    )
    shapes, names = smooth_shapes(observed)
    assert ("posture A: in time" in names) == seen
    # round-off of a few dozen operations
    assert np.allclose(shapes.T @ shapes, np.eye(len(names)), rtol=0.0, atol=1e-12)
