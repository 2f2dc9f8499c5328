"""Derivatives of natural frequencies by parameters of a machine, its equilibrium following."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.design.changes import STEP, changed, difference, state_rate
from vjm.design.linear_state import LinearState
from vjm.design.masses import mass_matrix
from vjm.design.modes import MM_PER_M, REAL
from vjm.model.parameters import Parameter
from vjm.rotations import Array


def frequency_rates(state: LinearState, parameters: Sequence[Parameter], values: Array, motions: Array) -> Array:
    """Derivatives ``(k, p)`` of natural frequencies by parameters, Hz per unit of each parameter.

    With the motion φ of a mode, ``φᵀ M φ = 1``, an eigenvalue λ changes by ``φᵀ (A' − λ M') φ`` and by what keeps φ
    on what the closures leave (Fox and Kapoor 1968). The matrices' derivatives are two central differences along
    the equilibria. Equal frequencies part by the eigenvalues of that form on their motions.

    Args:
        state: a stable equilibrium under loads that have a potential.
        parameters: of its machine.
        values: ``(k,)`` squares of angular frequencies, 1/s², see `vjm.design.modes.eigenmodes`;
            ascending and positive.
        motions: ``(n, k)`` of these modes.

    Raises:
        ValueError: a parameter has no derivative.
    """
    lam = values / MM_PER_M
    M, A, C = mass_matrix(state), state.tangent, state.rows(state.combinations)
    phi = motions / np.sqrt(np.einsum("nk,nm,mk->k", motions, M, motions))
    groups = np.split(np.arange(len(lam)), np.flatnonzero(np.diff(lam) > REAL * lam[1:]) + 1)
    inverse = np.linalg.pinv(C * state.unit)
    bears = inverse.T @ (state.unit[:, None] * (lam * (M @ phi) - A @ phi))
    result = np.zeros((len(lam), len(parameters)))
    for j, parameter in enumerate(parameters):
        dA, dM, dC = _matrices(state, parameter)
        for own in groups:
            P, mean = phi[:, own], float(lam[own].mean())
            # a motion that leaves what the closures allow is brought back
            back = -state.unit[:, None] * (inverse @ (dC @ P))
            B = P.T @ (dA - mean * dM) @ P + P.T @ (A - mean * M) @ back + bears[:, own].T @ (dC @ P)
            result[own, j] = np.linalg.eigvalsh(0.5 * (B + B.T)) if len(own) > 1 else B[0]
    return result * MM_PER_M / (8.0 * np.pi**2 * (np.sqrt(values) / (2.0 * np.pi)))[:, None]


def _matrices(state: LinearState, parameter: Parameter) -> tuple[Array, Array, Array]:
    """Total derivatives of tangent ``(n, n)``, mass matrix ``(n, n)`` and independent constraints ``(r, n)``."""
    n, known = state.n, dict[tuple[float, bytes], LinearState]()

    def machine(step: float, x: Array) -> LinearState:
        # a machine without loads stays where it is, and is made once for each step
        key = step, x.tobytes()
        if key not in known:
            known[key] = changed(state, parameter, parameter.value + step, x)
        return known[key]

    rate = state_rate(state, parameter, machine)

    def matrices(step: float) -> Array:
        there = machine(step, state.x + step * rate)
        return np.vstack([there.tangent, mass_matrix(there), there.rows(state.combinations)])

    rows = difference(matrices, STEP * parameter.scale)
    return rows[:n], rows[n : 2 * n], rows[2 * n :]
