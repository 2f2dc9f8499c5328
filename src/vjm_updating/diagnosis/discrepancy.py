"""What a law that is right to some per cent only makes of a hypothesis' evidence.

A cause's law is never quite the machine's. So each hypothesis carries a discrepancy, cause by cause. It is what
the cause does to the readings times smooth functions of displacement, direction and time. The law's argument may be
off, too, which does what its slope along the ramp does, and so may be the direction in which the cause acts. The
coefficients are Gaussian with zero mean. Their common standard deviation, the law's relative error, has a prior of
its own, and both are integrated out (Kennedy and O'Hagan 2001, with a basis in place of a Gaussian process).
Geometry and scales have no such error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.screening import Projection, projection
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.law_error import integrated, likeliest, principal
from vjm_updating.inference.parameters import coordinates, of_effect, release_key
from vjm_updating.inference.residual_basis import driven_place, loading, smooth_shapes
from vjm_updating.observation.observed import Observed
from vjm_updating.observation.whitening import weighed

SEEN = numerical(1e-6)
"""Share of the largest deviation below which one is rounding."""


def responses(fitter: Fitter, fit: Fit, explained: float) -> Array:
    """What each cause of a fit whose law may be wrong does to the readings ``(n, 6, m)``, raw, beside the others.

    It is no larger than what the causes explain. Else a cause could grow, made up for by nuisances, and its law be
    wrong by more than that. A cause without which no machine stands is left out.

    Args:
        fitter: of the test.
        fit: of the causes.
        explained: by how much they lower the objective, squares.
    """
    made = []
    for number, effect in enumerate(fit.hypothesis):
        if effect.exact:
            continue
        key = release_key(effect)
        own = set(of_effect(fit.found, number))
        others = tuple(other for k, other in enumerate(fit.hypothesis) if k != number)
        z = np.array([
            c.mean if (c.kind, c.subject) == key else value
            for i, (c, value) in enumerate(zip(fit.found, fit.at.z, strict=True))
            if i not in own
        ])  # fmt: skip
        without = fitter.evaluate(coordinates(fitter.nuisances, others), z, others)
        if without is not None:
            change = without.residual - fit.at.residual
            size = float(np.linalg.norm(fitter.whitening.flat(change)))
            made.append(change * min(1.0, explained**0.5 / max(size, 1e-300)))
    return np.stack(made, axis=-1) if made else np.zeros((*fit.at.residual.shape, 0))


def _slopes(observed: Observed, made: Array) -> Array:
    """Derivatives ``(n, 6, m)`` of readings by the place on the ramp, in their order; 0 while held."""
    place, sequence = driven_place(observed), observed.readings.sequence
    result = np.zeros_like(made)
    for number in np.unique(sequence):
        own = np.flatnonzero(sequence == number)
        step = place[own[2:]] - place[own[:-2]]
        change = made[own[2:]] - made[own[:-2]]
        moves = np.abs(step) > 0.0
        result[own[1:-1][moves]] = change[moves] / step[moves, None, None]
    return result


def _columns(fitter: Fitter, made: Array, shapes: Array) -> Array:
    """What laws that are wrong by their own size do ``(N, k)``, whitened; in each posture as much as the causes.

    Args:
        fitter: of the test.
        made: what each cause does ``(n, 6, m)``, raw.
        shapes: smooth ones ``(n, k)``, orthonormal within a posture.
    """
    observed = fitter.forward.observed
    postures = observed.readings.posture
    number = shapes.shape[1] / len(set(postures.tolist()))
    samples = np.array([(postures == label).sum() for label in postures], dtype=float)
    # of unit mean square within a posture, all shapes of it together
    relative = shapes * np.sqrt(samples / number)[:, None]
    products = (made[:, :, :, None] * relative[:, None, None, :]).reshape(*made.shape[:2], -1)
    found = [fitter.whitening.flat(products)]
    # the argument of the law is off: the slope; it acts in another direction: each channel by itself
    apart = made[:, :, :, None] * np.eye(made.shape[1])[None, :, None, :]
    off = np.concatenate([_slopes(observed, made)[:, :, :, None], apart], axis=3)
    ways = np.column_stack([np.ones(len(postures)), np.sign(driven_place(observed)), loading(observed)])
    off = (off[:, :, :, :, None] * ways[:, None, None, None, :]).reshape(*made.shape[:2], -1)
    for label in dict.fromkeys(postures.tolist()):
        on = (postures == label)[:, None, None]
        columns = fitter.whitening.flat(np.where(on, off, 0.0))
        size = np.linalg.norm(columns, axis=0)
        seen = size > SEEN * size.max(initial=0.0)
        # each kind as large as what the cause does there
        own = np.linalg.norm(fitter.whitening.flat(np.where(on, made, 0.0)), axis=0)
        kinds = np.repeat([1.0, *[made.shape[1]] * made.shape[1]], ways.shape[1])
        wanted = (own[:, None] / np.sqrt(ways.shape[1] * kinds)).ravel()
        found.append(columns[:, seen] * (wanted[seen] / size[seen]))
    return np.concatenate(found, axis=1)


def spectrum(fitter: Fitter, fit: Fit, space: Projection, explained: float) -> tuple[Array, Array]:
    """The discrepancy's principal directions in the space that the fit cannot absorb.

    Returns:
        Directions ``(N, k)``, and the standard deviation ``(k,)`` along each, in units of the noise, of laws that
        are wrong by their own size.
    """
    made = responses(fitter, fit, explained)
    shapes, _ = smooth_shapes(fitter.forward.observed)
    if not made.shape[2] or not shapes.shape[1]:
        return np.zeros((len(space.residual), 0)), np.zeros(0)
    columns = _columns(fitter, made, shapes)
    columns = space.rest(np.vstack([columns, np.zeros((len(space.residual) - space.rows, columns.shape[1]))]))
    turn, sizes = principal(columns.T @ columns)
    return columns @ turn / sizes, sizes


@dataclass(frozen=True)
class Marginalised(Projection):
    """A space in which what a discrepancy may do counts for less.

    Attributes:
        directions: orthonormal ``(N, k)`` ones of the discrepancy.
        left: share ``(k,)`` of what lies along each that is left.
        noise: the residual ``(N,)`` without the likeliest discrepancy.
    """

    directions: Array
    left: Array
    noise: Array

    @classmethod
    def of(cls, space: Projection, directions: Array, sizes: Array, law_error: float) -> Marginalised:
        """A space with a Gaussian discrepancy.

        Args:
            space: what the fit cannot absorb.
            directions: orthonormal ``(N, k)`` in it.
            sizes: standard deviations ``(k,)`` along them of laws wrong by their own size, over the noise's.
            law_error: by how much of it they are.
        """
        left, along = 1.0 / np.sqrt(1.0 + (law_error * sizes) ** 2), directions.T @ space.residual
        residual = space.residual - directions @ ((1.0 - left) * along)
        noise = space.residual - directions @ ((1.0 - left**2) * along)
        return cls(
            space.basis, residual, space.rows, space.released, directions, left, noise, law_error=law_error
        )  # fmt: skip

    def rest(self, columns: Array) -> Array:
        """Columns ``(N, k)`` without what the fit can absorb, in units of noise and discrepancy together."""
        free = super().rest(columns)
        result: Array = free - self.directions @ ((1.0 - self.left)[:, None] * (self.directions.T @ free))
        return result

    @property
    def off_sheet(self) -> Array:
        """How far nuisances lie from the sheet's ``(n_z,)``, over its tolerances, beside the discrepancy."""
        return self.noise[self.rows :]


def discrepancy(fitter: Fitter, fit: Fit, law_error: float, explained: float) -> float:
    """What the discrepancy adds to a fit's objective, its size and its shape integrated out; 0 without causes."""
    if not fit.hypothesis or law_error == 0.0:
        return 0.0
    own = replace(fitter, whitening=weighed(fitter.whitening, fitter.forward.observed, fit.at))
    space = projection(own, fit)
    U, sizes = spectrum(own, fit, space, explained)
    return integrated(sizes, U.T @ space.residual, law_error)


def marginalised(fitter: Fitter, fit: Fit, law_error: float, explained: float) -> Projection:
    """The space that a fit cannot absorb, with the likeliest discrepancy of its laws among the noise."""
    space = projection(fitter, fit)
    if not fit.hypothesis or law_error == 0.0:
        return space
    U, sizes = spectrum(fitter, fit, space, explained)
    return Marginalised.of(space, U, sizes, likeliest(sizes, U.T @ space.residual, law_error))
