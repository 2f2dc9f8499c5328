"""The critical force of a measured curve: the knee of force over displacement, in data and predictions alike."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_validation.diagnosis.fitting import Fit, Fitter
from vjm_validation.measurement.channels import WRENCH

LEAST = 5
"""Readings on either side of a knee."""
FLAT = 0.3
"""Slope behind a knee over that before it, at most."""


def knee(s: Array, force: Array) -> float | None:
    """Force at the knee of a curve ``(n,)`` that rises, bends once and goes on nearly level; None where none is.

    The best continuous pair of straight lines.
    """
    order = np.argsort(s)
    x, y = s[order], force[order]
    if len(x) < 2 * LEAST + 2:
        return None
    best: tuple[float, float] | None = None
    for at in x[LEAST:-LEAST]:
        X = np.column_stack([np.ones_like(x), np.minimum(x, at), np.maximum(x - at, 0.0)])
        c, *_ = np.linalg.lstsq(X, y, rcond=None)
        cost = float(np.sum((y - X @ c) ** 2))
        if c[1] > 0.0 and c[2] < FLAT * c[1] and (best is None or cost < best[0]):
            best = cost, float(c[0] + c[1] * at)
    straight = np.column_stack([np.ones_like(x), x])
    c, *_ = np.linalg.lstsq(straight, y, rcond=None)
    if best is None or best[0] > 0.5 * float(np.sum((y - straight @ c) ** 2)):
        return None
    return best[1]


def critical_forces(fitter: Fitter, null: Fit, fit: Fit) -> tuple[float | None, float | None, float | None]:
    """Measured critical force of the first half-ray that has one, and its predictions before and after."""
    observed = fitter.forward.observed
    for ray in observed.rays:
        c = int(np.argmax(np.abs(ray.direction[:3])))
        if not observed.present[:, c].any() or WRENCH[c] not in observed.wrench_channels:
            continue
        s = observed.pose[ray.index] @ ray.measure
        for sign in (1.0, -1.0):
            on = ray.index[(sign * s > 0.0) & observed.present[ray.index, c]]
            if len(on) < 2 * LEAST + 2:
                continue
            u = sign * (observed.pose[on] @ ray.measure)
            measured = sign * observed.wrench[on, c]
            found = knee(u, measured)
            if found is None:
                continue
            before, after = (knee(u, measured - sign * one.at.residual[on, c]) for one in (null, fit))
            return found, before, after
    return None, None, None
