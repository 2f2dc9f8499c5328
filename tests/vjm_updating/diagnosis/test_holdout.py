"""What a right model may be expected to predict of readings that it had not seen."""

from types import SimpleNamespace

import numpy as np
import pytest

from vjm_updating.diagnosis.holdout import _deviation


def deviation(predict, covariance, low=-np.inf):
    """Standard deviation of predictions ``(n,)`` about nothing, of coordinates with a covariance."""
    size = len(covariance)

    def evaluate(found, z, hypothesis):
        value = predict(z)
        return None if value is None else SimpleNamespace(z=z, residual=np.array(value)[:, None])

    fit = SimpleNamespace(
        hypothesis=(),
        parameters=[SimpleNamespace(low=low, high=np.inf)] * size,
        evaluation=evaluate((), np.zeros(size), ()),
    )
    return _deviation(SimpleNamespace(evaluate=evaluate), fit, np.array(covariance))[:, 0]


def test_of_straight_predictions_it_is_that_of_their_slopes():
    slopes = np.array([[1.0, 2.0, 0.0], [0.0, -1.0, 3.0]])
    C = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.3], [0.0, 0.3, 4.0]])
    found = deviation(lambda z: slopes @ z, C)
    np.testing.assert_allclose(found, np.sqrt(np.diag(slopes @ C @ slopes.T)), rtol=1e-12)


def test_of_curved_ones_it_is_more_than_to_first_order():
    """Of z + z³ of variance 0.25 it is 0.927 by quadrature; the first order says 0.5, the points 0.625."""
    found = deviation(lambda z: [z[0] + z[0] ** 3], [[0.25]])
    assert found[0] == pytest.approx(0.5 + 0.125, rel=1e-12)


def test_where_no_machine_stands_the_other_points_count_and_bounds_hold():
    assert deviation(lambda z: [z[0]] if z[0] <= 0.0 else None, [[4.0]])[0] == pytest.approx(2.0)
    assert deviation(lambda z: [z[0]], [[4.0]], low=0.0)[0] == pytest.approx(np.sqrt(2.0))
    # a direction that readings know exactly has no points
    assert deviation(lambda z: [z[0] + z[1]], [[4.0, 0.0], [0.0, 0.0]])[0] == pytest.approx(2.0)
