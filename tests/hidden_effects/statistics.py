"""Rates with their intervals, and how well confidences are calibrated."""

from collections.abc import Sequence

import numpy as np

from vjm.rotations import Array

Z95 = 1.959963984540054
BINS = 8
DRAWS = 1000


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


def reliability(confidence: Array, right: Array) -> list[dict[str, float]]:
    """Rows of a reliability diagram, bins of as many verdicts each."""
    order = np.argsort(confidence, kind="stable")
    rows = []
    for part in np.array_split(order, min(BINS, max(1, len(order) // 5))):
        if len(part):
            low, high = wilson(int(right[part].sum()), len(part))
            rows.append(
                {
                    "confidence": float(confidence[part].mean()),
                    "right": float(right[part].mean()),
                    "low": low,
                    "high": high,
                    "sets": len(part),
                }
            )
    return rows


def calibration_error(confidence: Array, right: Array) -> dict[str, float | list[float] | None]:
    """Mean distance of confidence and rate over the bins, and its bootstrap interval.

    A mean of distances is never negative: the interval is of the estimate less what as many verdicts of perfect
    calibration show.
    """
    if len(confidence) < 2:
        return {"error": None, "interval95": None, "of_perfect": None}
    rng = np.random.default_rng(0)
    here = _distance(confidence, right)
    drawn, perfect = [], []
    for _ in range(DRAWS):
        k = rng.integers(0, len(confidence), len(confidence))
        drawn.append(_distance(confidence[k], right[k]))
        perfect.append(_distance(confidence[k], (rng.random(len(k)) < confidence[k]).astype(float)))
    low, high = np.quantile(drawn, [0.025, 0.975])
    bias = float(np.mean(perfect))
    return {
        "error": here,
        "interval95": [max(float(low) - bias, 0.0), max(float(high) - bias, 0.0)],
        "of_perfect": bias,
    }


def _distance(confidence: Array, right: Array) -> float:
    rows = reliability(confidence, right)
    return float(sum(r["sets"] * abs(r["confidence"] - r["right"]) for r in rows) / len(confidence))
