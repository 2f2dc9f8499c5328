"""The hypothesis that a cause acts which no catalogue has: shapes without a name, each kind of its own size.

What the sheet's tolerances leave is then noise and zero-mean Gaussian shapes. There are smooth ones along the ramp,
in time, while held, and between loading and unloading, and sudden ones (`vjm_updating.inference.residual_basis`).
They act in one channel, or in all where something deflects along the displacement, or rough. Some one kind is
expected to act; of its size nothing is known, and it is integrated out. What remains is an evidence like any
cause's, so that nothing but the posterior says whether a cause is named.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.discrepancy import softened
from vjm_updating.diagnosis.model_adequacy import blocks_of
from vjm_updating.diagnosis.screening import Projection
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.residual_basis import smooth_shapes
from vjm_updating.observation.whitening import weighed

SIZES = numerical(np.geomspace(0.5, 500.0, 40))
"""Standard deviations of a kind's shapes, in units of the noise's, evenly by their logarithms: from what no test
can see to the strongest that there is."""
OVERLAP = numerical(0.05)
"""Singular value below which a direction belongs to the kinds before."""


def unmodelled(fitter: Fitter, fit: Fit, law_error: float = 0.0) -> float:
    """What shapes without a name add to the criterion of a fit, beside which they act.

    A nuisance that lies where its sheet does not let it be is one of the shapes. What the laws of the fit's causes
    may be wrong by is noise.

    Args:
        fitter: of the test.
        fit: of the causes; of the sheet's tolerances alone.
        law_error: relative error of the causes' laws, standard deviation.
    """
    own = replace(fitter, whitening=weighed(fitter.whitening, fitter.forward.observed, fit.at))
    space = softened(own, fit, law_error)
    beyond = np.eye(len(space.residual))[:, sorted(set(space.released.values()))]
    kinds = [*_deflection_shapes(own, fit, space), *(block.directions for block in blocks_of(own, space))]
    kinds += [column[:, None] for column in space.rest(beyond).T]
    known = np.zeros((len(space.residual), 0))
    found = []
    for directions in kinds:
        free = directions - known @ (known.T @ directions)
        U, sizes, _ = np.linalg.svd(free - known @ (known.T @ free), full_matrices=False)
        U = U[:, sizes > OVERLAP]
        known = np.column_stack([known, U])
        if U.shape[1]:
            found.append((U.shape[1], float(np.sum((U.T @ space.residual) ** 2))))
    # and what is rough has no shape at all
    left = len(space.residual) - space.basis.shape[1] - known.shape[1]
    found.append((left, float(space.residual @ space.residual) - sum(squares for _, squares in found)))
    return sum(kind_present(dimension, squares, 1.0 / (1 + len(found))) for dimension, squares in found)


def _deflection_shapes(fitter: Fitter, fit: Fit, space: Projection) -> list[Array]:
    """What the readings show where something deflects along the displacement, by kinds of smooth shapes."""
    observed = fitter.forward.observed
    along = np.zeros((len(observed.pose), 6))
    for ray in observed.rays:
        along[ray.index] = ray.direction
    force = np.einsum("nij,nj->ni", fit.at.stiffness, along)
    shapes, names = smooth_shapes(observed)
    raw = fitter.whitening.flat(np.where(observed.present, force, 0.0)[:, :, None] * shapes[:, None, :])
    columns = space.rest(np.vstack([raw, np.zeros((len(space.residual) - space.rows, raw.shape[1]))]))
    size = np.linalg.norm(columns, axis=0)
    seen = size > OVERLAP * np.linalg.norm(raw, axis=0)
    kinds: dict[str, list[int]] = {}
    for i in np.flatnonzero(seen):
        kinds.setdefault(names[i].partition(": ")[2], []).append(int(i))
    return [columns[:, own] / size[own] for own in kinds.values()]


def kind_present(dimension: int, squares: float, chance: float) -> float:
    """Twice the negative logarithm of the evidence with a kind of shapes that may act, over that of noise alone.

    Args:
        dimension: of the space of its shapes.
        squares: of the whitened residual there.
        chance: that it acts.
    """
    variance: Array = SIZES**2
    by_size = 0.5 * (squares * variance / (1.0 + variance) - dimension * np.log1p(variance))
    acts = np.logaddexp.reduce(by_size) - np.log(len(by_size))
    return -2.0 * float(np.logaddexp(np.log1p(-chance), np.log(chance) + acts))
