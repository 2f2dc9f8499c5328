"""What a law that is right to some per cent only makes of a hypothesis' evidence.

A cause's law is never quite the machine's. So each hypothesis carries a discrepancy: what its causes do to the
readings beyond what the sheet's tolerances could do, times smooth functions of displacement, direction and time.
Their coefficients are Gaussian with zero mean. Their common standard deviation, the law's relative error, has a
prior of its own, and both are integrated out (Kennedy and O'Hagan 2001, with a basis in place of a Gaussian
process).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.diagnosis.screening import Projection, projection
from vjm_updating.inference.fitting import Fit, Fitter, prior
from vjm_updating.inference.law_error import NODES, WEIGHTS, costs, integrated, principal
from vjm_updating.inference.parameters import release_key
from vjm_updating.inference.residual_basis import smooth_shapes
from vjm_updating.observation.whitening import weighed


def response(fitter: Fitter, fit: Fit) -> Array:
    """What the causes of a fit do to the readings ``(n, 6)``, raw, beyond what the sheet's tolerances could do.

    Every hypothesis takes the tolerances' laws for exact, so that a cause's can only be wrong in what goes beyond
    them: in the part by which it is seen at all. Zero where the machine does not stand without the causes.
    """
    own = fitter.nuisances
    z = fit.at.z[: len(own)].copy()
    released = {release_key(effect) for effect in fit.hypothesis}
    for i, c in enumerate(own):
        if (c.kind, c.subject) in released:
            z[i] = c.mean
    without = fitter.evaluate(own, z, ())
    if without is None:
        return np.zeros_like(fit.at.residual)
    made = without.residual - fit.at.residual
    J = fit.jacobian[:, :, : len(own)]
    _, weight = prior(own, z)
    known = weight > 0.0
    columns = np.vstack([fitter.whitening.flat(J[:, :, known]), np.diag(weight[known])])
    right = np.concatenate([fitter.whitening.flat(made), np.zeros(int(known.sum()))])
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    nuisances = np.linalg.lstsq(columns / size, right, rcond=None)[0] / size
    result: Array = made - J[:, :, known] @ nuisances
    return result


@dataclass(frozen=True)
class Softened(Projection):
    """A space in which what a discrepancy may do counts for less.

    Attributes:
        directions: orthonormal ``(N, k)`` ones of the discrepancy.
        left: share ``(k,)`` of what lies along each that is left.
    """

    directions: Array
    left: Array

    def rest(self, columns: Array) -> Array:
        """Columns ``(N, k)`` without what the fit can absorb, in units of noise and discrepancy together."""
        free = super().rest(columns)
        result: Array = free - self.directions @ ((1.0 - self.left)[:, None] * (self.directions.T @ free))
        return result


def spectrum(fitter: Fitter, fit: Fit, space: Projection) -> tuple[Array, Array]:
    """The discrepancy's principal directions in the space that the fit cannot absorb.

    Returns:
        Directions ``(N, k)``, and the standard deviation ``(k,)`` along each, in units of the noise, of a law that
        is wrong by its own size.
    """
    observed = fitter.forward.observed
    shapes, _ = smooth_shapes(observed)
    if not fit.hypothesis or not shapes.shape[1]:
        return np.zeros((len(space.residual), 0)), np.zeros(0)
    postures = observed.readings.posture
    size = np.array([(postures == label).sum() for label in postures], dtype=float)
    # of unit mean square within a posture, all shapes of it together
    number = shapes.shape[1] / len(set(postures.tolist()))
    relative = shapes * np.sqrt(size / number)[:, None]
    made = fitter.whitening.flat(response(fitter, fit)[:, :, None] * relative[:, None, :])
    columns = space.rest(np.vstack([made, np.zeros((len(space.residual) - space.rows, made.shape[1]))]))
    turn, sizes = principal(columns.T @ columns)
    return columns @ turn / sizes, sizes


def discrepancy(fitter: Fitter, fit: Fit, law_error: float) -> float:
    """What the discrepancy adds to a fit's objective, its size and its shape integrated out; 0 without causes."""
    if not fit.hypothesis or law_error == 0.0:
        return 0.0
    own = replace(fitter, whitening=weighed(fitter.whitening, fitter.forward.observed, fit.at))
    space = projection(own, fit)
    U, sizes = spectrum(own, fit, space)
    return integrated(sizes, U.T @ space.residual, law_error)


def softened(fitter: Fitter, fit: Fit, law_error: float) -> Projection:
    """The space that a fit cannot absorb, with the likeliest discrepancy of its laws among the noise."""
    space = projection(fitter, fit)
    if not fit.hypothesis or law_error == 0.0:
        return space
    U, sizes = spectrum(fitter, fit, space)
    change = costs(sizes, U.T @ space.residual, law_error) - 2.0 * np.log(WEIGHTS)
    left = 1.0 / np.sqrt(1.0 + (law_error * NODES[int(np.argmin(change))] * sizes) ** 2)
    residual = space.residual - U @ ((1.0 - left) * (U.T @ space.residual))
    return Softened(space.basis, residual, space.rows, space.released, U, left)
