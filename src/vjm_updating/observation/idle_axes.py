"""Axes that nobody drove: what their gauges read is noise and no displacement.

Where several displacements are read, a ramp drives some of them, and the others stand still. A stiff machine makes
newtons of what an idle gauge reads, so that it must be known whether the machine went there. Its forces tell: they
follow the gauge, or they do not. Where they do not, the axis stood at its mean, and what is not known of it is that
mean alone. Else the local stiffness would be taken at a place where the machine never was, and a law that is soft
there would gain by it.
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.observation.coordinate import Evaluation
from vjm_updating.observation.noise import whiten
from vjm_updating.observation.observed import Observed, commanded
from vjm_updating.observation.ramp_regression import RampRegression, is_noise
from vjm_updating.observation.significance import CUT, NORMAL_95, median_sigma

LEAST = numerical(3)
"""Readings of a ray from which on an axis has a scatter beside its mean, and second differences."""


def at_their_means(observed: Observed, at: Evaluation) -> Observed:
    """The same with idle axes at their means along each ray, where the forces do not follow their gauges.

    So are those whose forces are too small to tell, and which scatter no more than their gauges do.

    Args:
        observed: readings of a test that imposes displacements, several of which were read.
        at: the nominal machine at them; of it the stiffness matters, and what forces miss from reading to reading.
    """
    found = {}
    for k in observed.slots.values():
        lines = _levels(observed, k)
        on = lines.any(axis=1)
        if not on.any() or observed.noise.pose[k] <= 0.0:
            continue
        off = (observed.pose[:, k] - lines @ (lines.T @ observed.pose[:, k]))[on]
        share = followed_share(observed, at, k)
        # of an axis that stood still the share is 0, of one that went where its gauge says 1
        if share < 1.0 - share and is_noise(off / observed.noise.pose[k]):
            found[k] = RampRegression(lines, observed.readings.sequence, np.where(on, share, 1.0))
    return commanded(observed, found) if found else observed


def _levels(observed: Observed, k: int) -> Array:
    """Orthonormal columns ``(n, s)``: a level on each ray along which displacement k does not change."""
    columns = []
    for ray in observed.rays:
        if ray.direction[k] == 0.0 and len(ray.index) >= LEAST:
            column = np.zeros(len(observed.pose))
            column[ray.index] = 1.0 / np.sqrt(len(ray.index))
            columns.append(column)
    return np.column_stack(columns) if columns else np.zeros((len(observed.pose), 0))


def followed_share(observed: Observed, at: Evaluation, k: int) -> float:
    """Share of what a gauge reads beside its mean while idle that forces follow; 0 where they cannot tell.

    Forces change along a ramp, and a model that lacks a cause misses smooth parts of that. Second differences from
    reading to reading have little of these.

    Args:
        observed: the readings.
        at: the nominal machine at them.
        k: of the displacement among the six.
    """
    lines = _levels(observed, k)
    off = np.where(lines.any(axis=1), observed.pose[:, k] - lines @ (lines.T @ observed.pose[:, k]), 0.0)
    others = np.where(np.arange(6) == k, 0.0, observed.noise.pose)
    sigmas = np.broadcast_to(others, observed.pose.shape)
    white = whiten(sigmas, observed.noise.wrench, at.sensitivity, observed.present)
    # the residual is at the gauge's own reading: at the mean it has what the axis adds
    there = np.where(observed.present, at.sensitivity[:, :, k] * off[:, None], 0.0)
    both = np.einsum("nij,njs->nis", white, np.stack([there, at.residual + there], axis=2))
    followed = whole = unsure = 0.0
    for ray in observed.rays:
        if ray.direction[k] != 0.0 or len(ray.index) < LEAST:
            continue
        for c in range(observed.present.shape[1]):
            own = ray.index[observed.present[ray.index, c]]
            if len(own) < LEAST:
                continue
            follow, missed = np.diff(both[own, c], n=2, axis=0).T
            usual = max(median_sigma(missed), 1.0)
            followed += float(follow @ np.clip(missed, -CUT * usual, CUT * usual))
            whole += float(follow @ follow)
            unsure += float(np.sum(_twice(follow, len(own)) ** 2)) * max(usual**2 / 6.0, 1.0)
    # an axis that reads the same throughout says nothing
    if whole <= 2.0 * NORMAL_95 * unsure**0.5 or followed < NORMAL_95 * unsure**0.5:
        return 0.0
    return followed / whole


def _twice(differences: Array, count: int) -> Array:
    """Second differences ``(count − 2,)`` taken back to readings ``(count,)``: the transpose of taking them."""
    result = np.zeros(count)
    for shift, weight in enumerate((1.0, -2.0, 1.0)):
        result[shift : shift + len(differences)] += weight * differences
    return result
