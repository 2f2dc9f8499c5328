"""Wild samples: told from their neighbours and from what all others let expect, and never by the dozen."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vjm_updating.inference import model_error
from vjm_updating.inference import refit as outliers
from vjm_updating.inference.fitting import Whitening
from vjm_updating.inference.model_error import smooth_shapes
from vjm_updating.inference.noise import uncorrelated_noise
from vjm_updating.inference.refit import deleted

N = 60


def whitening(rho: float) -> Whitening:
    """Two channels whose noise is correlated within a reading and along the readings."""
    present = np.zeros((N, 6), dtype=bool)
    present[:, :2] = True
    present[17, 1] = False
    covariance = np.tile(np.eye(6), (N, 1, 1))
    covariance[:, :2, :2] = [[4.0, 2.4], [2.4, 9.0]]
    covariance[17] = np.eye(6)
    covariance[17, 0, 0] = 4.0
    factors = np.linalg.inv(np.linalg.cholesky(covariance))
    autoregression = replace(uncorrelated_noise(np.zeros(N, dtype=int), present), rho=np.full(6, rho))
    return Whitening(factors, autoregression, present)


@pytest.mark.parametrize("rho", [0.0, 0.7])
def test_deleted_residuals_are_those_of_a_dense_covariance(rho):
    own = whitening(rho)
    rng = np.random.default_rng(3)
    residual = np.where(own.present, rng.standard_normal((N, 6)), 0.0)
    on = np.flatnonzero(own.present)
    # the whitening as a matrix, column by column
    columns = []
    for k in on:
        unit = np.zeros(N * 6)
        unit[k] = 1.0
        columns.append(own.flat(unit.reshape(N, 6)))
    L = np.array(columns).T
    P = L.T @ L
    expected = P @ residual.ravel()[on] / np.sqrt(np.diag(P))
    found = deleted(own, residual)
    assert np.allclose(found.ravel()[on], expected, rtol=0.0, atol=1e-12)
    assert not found[~own.present].any()


def test_one_sample_off_stands_out_by_what_its_neighbours_leave():
    own = whitening(0.7)
    residual = np.zeros((N, 6))
    residual[30, 0] = 10.0
    found = np.abs(deleted(own, residual))
    assert np.unravel_index(found.argmax(), found.shape) == (30, 0)
    # with both neighbours and the other channel known less is left of the noise than its own size
    assert found[30, 0] > 10.0 / 2.0


def placed(monkeypatch, place, force=0.0):
    """A test of one channel whose readings lie at such places along the ramp, under such a force over its noise."""
    monkeypatch.setattr(outliers, "driven_place", lambda observed: place)
    present = np.zeros((len(place), 6), dtype=bool)
    present[:, 0] = True
    wrench = np.zeros(present.shape)
    wrench[:, 0] = force
    return SimpleNamespace(present=present, measured=wrench, noise=SimpleNamespace(wrench=np.ones(6)))


def few(observed, found):
    return outliers._few(observed, found, outliers.loads(observed, np.zeros(found.shape)))


def test_turns_and_ends_of_a_steep_residual_are_no_outliers(monkeypatch):
    # a model that is off by its stiffness leaves a zigzag along a ramp out, back and out to the other side
    turns = np.concatenate([np.arange(0.0, 20.0), np.arange(20.0, -20.0, -1.0), np.arange(-20.0, 1.0)])
    observed = placed(monkeypatch, turns / 20.0)
    observed.readings = SimpleNamespace(sequence=np.zeros(len(turns), dtype=int))
    residual = np.zeros((len(turns), 6))
    residual[:, 0] = 8.0 * turns + 0.3 * np.random.default_rng(1).standard_normal(len(turns))
    factors = np.tile(np.eye(6), (len(turns), 1, 1))
    assert not outliers.standing_out(observed, residual, factors).any()
    # two that are, one of them beside a turn
    residual[[21, 50], 0] += [40.0, -40.0]
    assert set(np.flatnonzero(outliers.standing_out(observed, residual, factors)[:, 0])) == {21, 50}


@pytest.mark.parametrize("stray", [(), (95,)])
def test_samples_that_lie_together_are_no_accident_though_one_lies_far_off(monkeypatch, stray):
    observed = placed(monkeypatch, np.linspace(-1.0, 1.0, 100))
    found = np.zeros((100, 6))
    found[[44, 46, 48, 50, 52, 54, *stray], 0] = [1.0, -1.0] * 3 + [1.0] * len(stray)
    assert not few(observed, found).any()


def test_samples_at_random_are_accidents(monkeypatch):
    observed = placed(monkeypatch, np.linspace(-1.0, 1.0, 100))
    found = np.zeros((100, 6))
    found[[3, 28, 41, 70, 88], 0] = 1.0
    assert np.array_equal(few(observed, found), found)


@pytest.mark.parametrize(("many", "accident"), [(22, True), (90, False)])
def test_samples_that_lie_together_among_many_others_are_accidents(monkeypatch, many, accident):
    # cycles, the same places over and over: all outliers lie in one half of them, unlikely as that is
    place = np.tile(np.linspace(0.0, 1.0, 50), 20)
    observed = placed(monkeypatch, place)
    found = np.zeros((1000, 6))
    at = np.sort(np.random.default_rng(1).choice(np.flatnonzero(place < 0.5), many, replace=False))
    found[at, 0] = (-1.0) ** np.arange(many)
    assert few(observed, found).any() == accident


@pytest.mark.parametrize(("ways", "accident"), [((1.0, 1.0, 1.0), False), ((1.0, -1.0, 1.0), True)])
def test_neighbours_that_are_off_the_same_way_are_what_the_machine_does(monkeypatch, ways, accident):
    observed = placed(monkeypatch, np.linspace(-1.0, 1.0, 100))
    found = np.zeros((100, 6))
    found[[20, 22, 23], 0] = ways
    found[[3, 70, 88], 0] = 1.0
    assert few(observed, found).any() == accident


@pytest.mark.parametrize(
    ("found", "accident"),
    # the two smallest forces that show, pull and push, read too small; one of them too large; one of them and a
    # larger force; one of them alone; three of the six smallest, not these themselves; and three anywhere
    [
        ({44: 1, 55: -1}, False),
        ({44: -1, 55: -1}, True),
        ({44: 1, 60: -1}, True),
        ({44: 1}, True),
        ({43: 1, 56: -1, 57: -1}, False),
        ({43: 1, 66: -1, 77: -1}, True),
    ],
)
def test_smallest_loads_that_are_read_too_small_are_what_the_gauge_does(monkeypatch, found, accident):
    place = np.linspace(-1.0, 1.0, 100)
    # nobody sees whether forces below eight times the noise are read
    observed = placed(monkeypatch, place, np.where(np.abs(place) > 0.1, 1000.0 * place, 5.0))
    way = np.zeros((100, 6))
    way[list(found), 0] = list(found.values())
    assert few(observed, way).any() == accident


@pytest.mark.parametrize(
    ("loads", "off", "accident"),
    # a first step read too small; too large; with another of the same load beside it that is not; the second step;
    # the first one after what zeros make of an unloaded machine; that one too small; a step too small to show
    [
        ([0.0, 40.0, 80.0], {1: -1}, False),
        ([0.0, 40.0, 80.0], {1: 1}, True),
        ([0.0, 40.0, 41.0], {1: -1}, True),
        ([0.0, 40.0, 80.0], {2: -1}, True),
        ([-12.0, 40.0, 80.0], {1: -1}, False),
        ([-12.0, 40.0, 80.0], {0: 1}, False),
        ([0.0, 6.0, 80.0], {1: -1}, True),
    ],
)
def test_a_reading_too_small_where_a_machine_is_first_loaded_is_no_accident(monkeypatch, loads, off, accident):
    loads = [*loads, *np.arange(120.0, 1000.0, 40.0)]
    observed = placed(monkeypatch, np.linspace(0.0, 1.0, len(loads)), loads)
    way = np.zeros((len(loads), 6))
    # an outlier elsewhere stays one
    way[[15, *off], 0] = [1.0, *off.values()]
    kept = few(observed, way)[:, 0]
    assert (kept[list(off)] != 0.0).all() == accident
    assert kept[15] == 1.0


def test_neighbours_found_one_after_the_other_are_one_lot(monkeypatch):
    own = whitening(0.0)
    observed = placed(monkeypatch, np.linspace(-1.0, 1.0, N))
    observed.present = own.present
    residual = np.zeros((N, 6))
    residual[31, 0] = 20.0
    known = np.zeros((N, 6))
    # alone it is an outlier; beside two that were found before, they are what the machine does
    assert outliers.outlying(observed, own, residual, known, np.zeros((N, 6)))[31, 0] == 1.0
    known[[29, 30], 0] = 1.0
    assert not outliers.outlying(observed, own, residual, known, np.zeros((N, 6))).any()


# Shapes without a name are of what was read, and not of its gauge's noise.


READINGS = 200
"""Readings."""
NOISE = 2e-3
"""Of a place on its ramp, over the ramp."""


@pytest.mark.parametrize(("slow", "seen"), [(0.0, False), (2.0, False), (9.0, True)])
def test_the_clock_is_a_shape_where_the_drive_went_otherwise_than_by_it(monkeypatch, slow, seen):
    """A ramp that lags behind the clock by a wave of so many of its gauge's deviations."""
    rng = np.random.default_rng(4)
    clock = np.linspace(0.0, 1.0, READINGS)
    place = clock + slow * NOISE * np.sin(40.0 * clock) + NOISE * rng.standard_normal(READINGS)
    monkeypatch.setattr(model_error, "driven_place", lambda observed: place)
    monkeypatch.setattr(model_error, "place_noise", lambda observed: np.full(READINGS, NOISE))
    monkeypatch.setattr(model_error, "loading", lambda observed: np.ones(READINGS))
    observed = SimpleNamespace(
        clock=clock,
        warmth=None,
        readings=SimpleNamespace(posture=np.full(READINGS, "A"), sequence=np.zeros(READINGS, dtype=int)),
    )
    shapes, names = smooth_shapes(observed)
    assert ("posture A: in time" in names) == seen
    # round-off of a few dozen operations
    assert np.allclose(shapes.T @ shapes, np.eye(len(names)), rtol=0.0, atol=1e-12)
