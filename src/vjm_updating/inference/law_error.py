"""What it changes of a hypothesis' evidence that laws are right to some per cent only.

What a cause does beyond its law is a Gaussian discrepancy of zero mean. Its size, the law's relative error, has a
half-normal prior and is integrated out with it (Kennedy and O'Hagan, J. R. Statist. Soc. B 63, 425, 2001).
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical

NODES = numerical(np.linspace(0.1, 1.5, 8))
"""Relative errors over their prior's scale at which it is integrated: with a law that is off by more, another one
acts."""
WEIGHTS = numerical(np.exp(-0.5 * NODES**2) / np.exp(-0.5 * NODES**2).sum())


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
        law_error: scale of the relative error's half-normal prior.
    """
    variance = (law_error * NODES[:, None] * sizes) ** 2
    result: Array = np.sum(np.log1p(variance) - left**2 * variance / (1.0 + variance), axis=1)
    return result


def integrated(sizes: Array, left: Array, law_error: float) -> float:
    """The same with the relative error integrated out; see `costs`.

    Example:
        >>> integrated(np.zeros(1), np.zeros(1), 0.1)
        0.0
    """
    change = costs(sizes, left, law_error)
    least = float(change.min())
    return least - 2.0 * float(np.log(np.sum(WEIGHTS * np.exp(-0.5 * (change - least)))))
