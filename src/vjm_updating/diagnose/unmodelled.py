"""The hypothesis that a cause acts which no catalogue has: shapes without a name, each kind of its own size.

What the sheet's tolerances leave is then noise and zero-mean Gaussian shapes: smooth ones along the ramp, in time,
while held, between the ways, and sudden ones (`vjm_updating.diagnose.residual_basis`). A kind may act in a channel
or not, as likely as not; of its size nothing is known, and it is integrated out. What remains is an evidence like
any cause's, so that nothing but the posterior says whether a cause is named.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.diagnose.fitting import Fit, Fitter
from vjm_updating.diagnose.model_adequacy import blocks_of
from vjm_updating.diagnose.screening import projection
from vjm_updating.diagnose.whitening import weighed

SIZES = np.geomspace(0.5, 500.0, 40)
"""Standard deviations of a kind's shapes, in units of the noise's, evenly by their logarithms: from what no test
can see to the strongest that there is."""
OVERLAP = 0.05
"""Singular value below which a direction belongs to the kinds before."""


def unmodelled(fitter: Fitter, null: Fit) -> float:
    """What shapes without a name add to the objective of the sheet's tolerances alone."""
    own = replace(fitter, whitening=weighed(fitter.whitening, fitter.forward.observed, null.at))
    space = projection(own, null)
    known, change = np.zeros((len(space.residual), 0)), 0.0
    for block in blocks_of(own, space):
        free = block.directions - known @ (known.T @ block.directions)
        U, sizes, _ = np.linalg.svd(free - known @ (known.T @ free), full_matrices=False)
        U = U[:, sizes > OVERLAP]
        known = np.column_stack([known, U])
        change += kind_present(U.shape[1], float(np.sum((U.T @ space.residual) ** 2)))
    return change


def kind_present(dimension: int, squares: float) -> float:
    """Twice the negative logarithm of the evidence for a kind of shapes, over that of noise alone.

    Args:
        dimension: of the space of its shapes.
        squares: of the whitened residual there.
    """
    variance: Array = SIZES**2
    by_size = 0.5 * (squares * variance / (1.0 + variance) - dimension * np.log1p(variance))
    acts = np.logaddexp.reduce(by_size) - np.log(len(by_size))
    return -2.0 * float(np.logaddexp(0.0, acts) - np.log(2.0))
