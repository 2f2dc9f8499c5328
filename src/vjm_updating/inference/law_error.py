"""What it changes of a hypothesis' evidence that laws are right to some per cent only.

What a cause does beyond its law is a Gaussian discrepancy of zero mean (Kennedy and O'Hagan, J. R. Statist. Soc. B
63, 425, 2001). Its size over that of what the cause does is the law's relative error. Most laws are right to a few
per cent, and some are far off: the error has a half-Cauchy prior (Gelman, Bayesian Analysis 1, 515, 2006) and is
integrated out with the discrepancy.
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import definition, numerical

NODES = numerical(np.geomspace(0.1, 12.5, 19))
"""Relative errors over their prior's scale at which it is integrated. A smaller one shows nowhere. By more than the
last, 38 %, no law of a textbook is off: another one acts."""


NINE_IN_TEN = definition(6.31)
"""Relative error over its prior's scale that nine in ten laws stay below: the prior's quantile."""


def _masses(nodes: Array) -> Array:
    """Mass ``(k,)`` of a half-Cauchy prior in the cells about its nodes ``(k,)``, which ends at the last one."""
    edges = np.concatenate([[0.0], np.sqrt(nodes[1:] * nodes[:-1]), nodes[-1:]])
    mass: Array = np.diff(np.arctan(edges))
    return mass / mass.sum()


WEIGHTS = numerical(_masses(NODES))
"""Of the nodes, by the prior."""
SEEN = numerical(1e-12)
"""Share of the largest square below which a direction of a discrepancy is rounding."""


def principal(products: Array) -> tuple[Array, Array]:
    """Principal directions ``(n, k)`` of a discrepancy's columns, and their sizes ``(k,)``.

    From the products: what is smaller than half of the digits of the largest changes nothing.

    Args:
        products: of the columns with one another ``(n, n)``.

    Example:
        >>> principal(np.diag([4.0, 0.0]))[1].tolist()
        [2.0]
    """
    squares, turn = np.linalg.eigh(products)
    seen = squares > SEEN * squares.max(initial=0.0)
    return turn[:, seen], np.sqrt(squares[seen])


def costs(sizes: Array, left: Array, law_error: float) -> Array:
    """Twice the negative logarithm of what a discrepancy changes of the evidence, by its relative error at `NODES`.

    Args:
        sizes: standard deviations ``(k,)`` in units of the noise, of a law that is wrong by its own size, along the
            discrepancy's principal directions in the space that the fit cannot absorb.
        left: the residual along them ``(k,)``.
        law_error: scale of the relative error's half-Cauchy prior.
    """
    variance = (law_error * NODES[:, None] * sizes) ** 2
    result: Array = np.sum(np.log1p(variance) - left**2 * variance / (1.0 + variance), axis=1)
    return result


def largest(law_error: float) -> float:
    """The largest relative error that the prior of a scale allows; see `NODES`."""
    return law_error * float(NODES[-1])


def likeliest(sizes: Array, left: Array, law_error: float) -> float:
    """The relative error that is the most probable one of the nodes; see `costs`.

    Example:
        >>> likeliest(np.full(40, 100.0), np.full(40, 10.0), 0.03) > 0.08
        True
    """
    return law_error * float(NODES[int(np.argmin(costs(sizes, left, law_error) - 2.0 * np.log(WEIGHTS)))])


def integrated(sizes: Array, left: Array, law_error: float) -> float:
    """The same with the relative error integrated out; see `costs`.

    Example:
        >>> integrated(np.zeros(1), np.zeros(1), 0.1)
        0.0
    """
    change = costs(sizes, left, law_error)
    least = float(change.min())
    return least - 2.0 * float(np.log(np.sum(WEIGHTS * np.exp(-0.5 * (change - least)))))
