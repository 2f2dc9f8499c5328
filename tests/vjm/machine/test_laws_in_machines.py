"""Random machines with laws of springs, against the energy of an independent kinematics."""

import numpy as np
import pytest
from helpers.laws import with_laws
from helpers.random_machines import GRAVITY, random_machine
from helpers.virtual_work import TINY, Statics

from vjm.machine.equilibria import equilibria
from vjm.model.load_case import Load
from vjm.model.mechanism import Mechanism

ROUNDING = 1e-10
"""Of an energy: it is a sum of works of springs and weights that cancel."""
STEP = 1e-8
"""Of differences of gradients: far within the transitions of the laws, 1e-5 at least."""


def gradient(statics, x):
    """Slopes ``(n,)`` of the energy at ``x`` (n,)."""
    return statics.energy(x + 1j * TINY * np.eye(len(x))).imag / TINY


def curvature(statics, x):
    """Second derivatives ``(n, n)`` by differences of exact gradients, and their asymmetry, which is rounding."""
    steps = STEP * np.eye(len(x))
    H = np.array([(gradient(statics, x + d) - gradient(statics, x - d)) / (2.0 * STEP) for d in steps])
    return 0.5 * (H + H.T), H - H.T


def least_energy(statics, unit):
    """Coordinates ``(n,)`` of least energy, downhill from the unloaded posture, as far as it comes."""
    x = np.zeros(statics.n)
    for _ in range(100):
        slope, H = gradient(statics, x) * unit, curvature(statics, x)[0] * unit * unit[:, None]
        values, vectors = np.linalg.eigh(H)
        # Newton's step, but downhill along every eigenvector
        step = -vectors @ ((vectors.T @ slope) / np.maximum(np.abs(values), 1e-9 * np.abs(values).max()))
        step *= min(1.0, 0.3 / max(np.abs(step).max(), 1e-300))
        if np.abs(step).max() < 1e-10:
            break
        before, share = value(statics, x), 1.0
        allowed = ROUNDING * abs(before)
        while value(statics, x + share * step * unit) > before + 1e-4 * share * (slope @ step) + allowed:
            share *= 0.5
        x = x + share * step * unit
    return x


def value(statics, x):
    """The energy at coordinates ``(n,)``."""
    return float(statics.energy(x[None])[0].real)


def close_to_the_energy(seed: int) -> str:
    """An equilibrium, its stability and compliance against slopes of the energy; what it is."""
    machine, values = random_machine(seed)
    machine = with_laws(machine, seed)
    loads = (Load((20.0, -35.0, 12.0, 0.0, 0.0, 0.0), machine.parts[-1].name),)
    model = Mechanism(machine.split())
    found = equilibria(model, values, gravity=GRAVITY, loads=loads)
    statics = Statics(machine, values, gravity=GRAVITY, loads=loads)
    x, unit = found.x[0], model.unit
    least = least_energy(statics, unit)
    assert found.converged[0] or found.undetermined[0]
    residual = gradient(statics, x)
    H, asymmetry = curvature(statics, x)
    # the largest asymmetry shows the rounding of all
    rounding = np.abs(asymmetry * unit * unit[:, None]).max() / (unit * unit[:, None])
    eigenvalues = np.linalg.eigvalsh(H * unit * unit[:, None])
    smallest = np.abs(eigenvalues).min() / np.abs(eigenvalues).max()
    if found.undetermined[0]:
        assert smallest < 1e-12
        assert np.abs(residual * unit).max() < 1e-9 * np.abs(eigenvalues).max()
        return "undetermined"
    # rounding of the differences is 1e-8 of the largest eigenvalue
    if smallest > 1e-8:
        assert bool(found.stable[0]) == bool(eigenvalues.min() > 0.0)
    # no descent comes lower than a stable equilibrium
    lowest = value(statics, least)
    assert value(statics, x) <= lowest + ROUNDING * abs(lowest) or not found.stable[0]
    if smallest < 1e-6:
        return "stable" if found.stable[0] else "unstable"
    # the motion that would balance the residual
    off = np.abs(np.linalg.solve(H, residual)) / unit
    assert off.max() < 1e-9 * max(float(np.abs(x / unit).max()), 1e-3)
    for k, end in enumerate(machine.ends):
        rates = statics.position(x + 1j * TINY * np.eye(len(x)), end).imag / TINY
        moved = np.linalg.solve(H, rates)
        C = rates.T @ moved
        # to first order by the rounding of the differences; an end may stand on the ground
        bound = (np.abs(moved).T @ rounding @ np.abs(moved)).max() + 1e-8 * np.abs(C).max() + 1e-20
        off = np.abs(found.compliance[0, k, :3, :3] - C).max()
        assert off <= bound
    return "stable" if found.stable[0] else "unstable"


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("block", range(40))
def test_random_machines_with_laws_against_their_energy(block: int):
    for k in range(5):
        close_to_the_energy(5 * block + k)
