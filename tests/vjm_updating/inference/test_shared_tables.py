"""Tables of paths are made once where hypotheses differ in their laws alone."""

from importlib.resources import files

import numpy as np
import pytest

from vjm_updating.data_set import load_data
from vjm_updating.inference import forward as forward_module
from vjm_updating.inference.fitting import LeastSquaresProblem, whitening_of
from vjm_updating.inference.forward import Forward, observe_ramps
from vjm_updating.inference.parameters import coordinates, nuisance_coordinates, start
from vjm_updating.mechanisms.hysteresis import JointFriction


@pytest.fixture
def problem():
    folder = files("vjm_validation") / "examples/soft-springs"
    observed = observe_ramps(load_data(folder / "readings.csv", folder / "sheet.toml").test)
    nuisances = tuple(nuisance_coordinates(observed))
    forward = Forward(observed)
    unknowns = coordinates(nuisances, ())
    nominal = forward.evaluate(unknowns, np.zeros(len(unknowns)), ())
    return LeastSquaresProblem(forward, nuisances, whitening_of(observed, nominal))


@pytest.fixture
def friction(problem):
    return JointFriction(joints=len(problem.forward.observed.measurement.chain.joints))


def begun(problem, effect):
    """Coordinates, where the effect's first trial begins, and the readings there."""
    unknowns = coordinates(problem.nuisances, (effect,))
    z = start(unknowns, (effect,), np.zeros(len(problem.nuisances)), [effect.trials()[0]])
    return unknowns, problem.evaluate(unknowns, z, (effect,))


def test_derivatives_by_a_law_ask_for_no_tables(problem, friction, monkeypatch):
    unknowns, evaluation = begun(problem, friction)
    made, sheaf = [], forward_module.Sheaf

    def counted(*args):
        made.append(args)
        return sheaf(*args)

    monkeypatch.setattr(forward_module, "Sheaf", counted)
    J = np.zeros((*evaluation.residual.shape, len(unknowns)))
    problem.renew(J, unknowns, evaluation, (friction,), [])
    assert np.abs(J[:, :, -1]).max() > 0.0
    assert not made


def test_readings_by_shared_tables_are_those_by_new_ones(problem, friction):
    unknowns, evaluation = begun(problem, friction)
    again = problem.evaluate(unknowns, evaluation.z, (friction,))
    fresh = Forward(problem.forward.observed).evaluate(unknowns, evaluation.z, (friction,))
    np.testing.assert_array_equal(again.residual, fresh.residual)
    np.testing.assert_array_equal(again.stiffness, fresh.stiffness)
