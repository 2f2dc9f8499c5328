"""The dense matrices about an equilibrium against differences of forces and against the compiled kernel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vjm
from vjm.design.changes import residual_forces
from vjm.design.linear_state import question, state_of
from vjm.model.load_case import Load

WRENCH = (100.0, 50.0, -80.0, 1e3, 2e3, -3e3)
CASES = {
    "arm": ("ur10", {"wrench": WRENCH, "gravity": (0.0, 0.0, -9.81)}),
    "arm with a follower": (
        "planar-2r",
        {"loads": [Load((30.0, -50.0, 5.0, 100.0, 0.0, 20.0), "fore", 0.5, follower=True)]},
    ),
    "platform": ("orthoglide", {"wrench": WRENCH}),
    "hexapod": ("hexapod", {"wrench": WRENCH, "gravity": (0.0, 0.0, -9.81)}),
    "loops and a spring between points": (
        "palletiser", {"wrench": (10.0, 5.0, 0.0, 0.0, 0.0, 0.0), "gravity": (0.0, 0.0, -9.81)},
    ),
    "held chain": ("orthoglide-chain", {"displacement": (-1.0, 0.2, 0.0, 0.0, 0.0, 1e-3)}),
}  # fmt: skip


@pytest.mark.parametrize(("name", "asked"), CASES.values(), ids=CASES)
def test_the_tangent_is_the_derivative_of_the_forces(name, asked):
    state = state_of(question(vjm.load(name), **asked))
    # solvers stop at 1e-11 of the machine's scale
    scale = np.broadcast_to(state.model.coordinate_scale, state.model.size)[: state.n]
    assert np.abs(residual_forces(state) * scale).max() < 1e-9 * np.abs(state.reactions[: state.n] * scale).max()
    N, h = state.motions, 1e-6
    rate = N @ np.random.default_rng(0).standard_normal(N.shape[1])

    def forces(step):
        x = state.x.copy()
        x[: state.n] += step * rate
        return replace(state, x=x).reactions[: state.n]

    change = (forces(h) - forces(-h)) / (2.0 * h)
    expected = N.T @ (state.spring_stiffness @ rate - change)
    # of a central difference 1e-12 of the curvature and 1e-16 over h of the forces are left
    np.testing.assert_allclose(N.T @ (state.tangent @ rate), expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["orthoglide", "hexapod", "palletiser"])
def test_the_compliance_is_that_of_the_compiled_kernel(name):
    machine, asked = vjm.load(name), CASES["platform"][1]
    state = state_of(question(machine, **asked))
    N = state.motions
    C = state.jacobian @ N @ np.linalg.solve(N.T @ state.tangent @ N, N.T @ state.jacobian.T)
    K = vjm.stiffness(machine, state.question.posture, engine=state.question.engine, **asked).loaded
    np.testing.assert_allclose(np.linalg.inv(C), K, atol=1e-9 * np.abs(K).max())


def test_conservative_loads_have_a_symmetric_tangent():
    state = state_of(question(vjm.load("palletiser"), **CASES["loops and a spring between points"][1]))
    assert state.conservative
    A = state.motions.T @ state.tangent @ state.motions
    np.testing.assert_allclose(A, A.T, atol=1e-13 * np.abs(A).max())
    assert not state_of(question(vjm.load("planar-2r"), **CASES["arm with a follower"][1])).conservative
