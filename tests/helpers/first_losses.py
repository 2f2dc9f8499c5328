"""Where a machine loses its stability along each of many directions of a force: by raising it, without a search."""

import numpy as np

from vjm.machine.equilibria import equilibria
from vjm.model.mechanism import Mechanism

STEPS = 48
"""To the largest force."""
TOLERANCE = 1e-4
"""Relative, of the interval that is halved."""


def first_losses(model: Mechanism, q: np.ndarray, directions: np.ndarray, most: float) -> np.ndarray:
    """Forces ``(k,)`` on the first end along directions ``(k, 3)``; infinite where none is critical up to the most.

    A force goes up in steps until an equilibrium is unstable, is not found, or is twice as far away as the
    compliance foresees; then the interval is halved.
    """
    k = len(directions)
    rows = np.tile(q, (k, 1))
    none = np.zeros((k, len(model.ends), 6))
    at = equilibria(model, rows, wrench=none)
    assert at.stable.all()
    assert at.compliance is not None
    x, closures, moved, C = at.x.copy(), at.closures.copy(), at.deflection[:, 0].copy(), at.compliance[:, 0].copy()
    good, bad = np.zeros(k), np.full(k, np.inf)
    going = np.arange(k)
    scale = np.repeat([1.0, model.reach], 3)
    while len(going):
        ahead = np.where(np.isfinite(bad), 0.5 * (good + bad), np.minimum(good + most / STEPS, most))[going]
        wrench = none[going].copy()
        wrench[:, 0, :3] = ahead[:, None] * directions[going]
        now = equilibria(
            model, rows[going], wrench=wrench, start=x[going], start_closures=closures[going], gradual=False
        )
        assert now.compliance is not None
        step = np.hstack([directions[going], np.zeros((len(going), 3))]) * (ahead - good[going])[:, None]
        foreseen = np.linalg.norm(scale * np.einsum("kab,kb->ka", C[going], step), axis=1)
        gone = np.linalg.norm(scale * (now.deflection[:, 0] - moved[going]), axis=1)
        kept = now.converged & now.stable & (gone <= 2.0 * foreseen)
        on = going[kept]
        good[on], x[on], closures[on] = ahead[kept], now.x[kept], now.closures[kept]
        moved[on], C[on] = now.deflection[kept, 0], now.compliance[kept, 0]
        bad[going[~kept]] = ahead[~kept]
        going = going[(good < most)[going] & (bad - good > TOLERANCE * most / STEPS)[going]]
    return np.where(np.isfinite(bad), good, np.inf)
