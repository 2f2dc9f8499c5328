"""Rates with their intervals."""

from collections.abc import Sequence

import numpy as np

Z95 = 1.959963984540054


def wilson(hits: int, count: int) -> tuple[float, float]:
    """95 % interval of a rate (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927)."""
    if count == 0:
        return 0.0, 1.0
    p, z2 = hits / count, Z95**2
    middle = (p + z2 / (2 * count)) / (1 + z2 / count)
    half = Z95 / (1 + z2 / count) * np.sqrt(p * (1 - p) / count + z2 / (4 * count**2))
    return float(max(middle - half, 0.0)), float(min(middle + half, 1.0))


def rate(flags: Sequence[bool]) -> dict[str, float | int | list[float] | None]:
    """A rate as the score keeps it."""
    hits, count = sum(flags), len(flags)
    return {
        "rate": hits / count if count else None,
        "interval95": list(wilson(hits, count)),
        "hits": hits,
        "sets": count,
    }
