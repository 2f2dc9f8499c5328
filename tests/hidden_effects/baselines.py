"""Finders to be compared with: one that knows laws and noise, and two plain ones.

All of them choose among the injector's own curves, so that what tells them apart is the criterion.
"""

from typing import Any

import numpy as np

from hidden_effects.signatures import ONE_CLASS, Signatures
from hidden_effects.virtual_rig import RigResponse
from vjm.rotations import Array

DRAWS = 400
"""Of noise, from which the threshold of the likelihood ratio follows."""
FAMILYWISE = 0.01
"""Share of quiet sets on which the likelihood ratio may raise an alarm."""


def verdicts(known: Signatures, seen: RigResponse, regular: RigResponse, limit: float) -> dict[str, Any]:
    """What each of them says: the causes it names, an empty list for none.

    Args:
        known: signatures of the design, sharpened for what is hidden.
        seen: readings as in the file.
        regular: the same without outliers and missed ones: who knows the noise knows which they are.
        limit: of the likelihood ratio, see `threshold`.
    """
    visibility = known.visibility
    sigma = visibility.noises
    raw = visibility.flat(seen.less(visibility.nominal))
    ratio = np.nan_to_num(raw / sigma)
    return {
        "likelihood_ratio": _likelihood_ratio(known, visibility.whitened(regular.less(visibility.nominal)), limit),
        "largest_drop": _largest_drop(known, ratio),
        "plain_bic": _plain_bic(known, ratio, int(np.isfinite(raw).sum())),
    }


def _likelihood_ratio(known: Signatures, residual: Array, limit: float) -> dict[str, Any]:
    """The largest drop of the whitened square, against its limit, and what comes near it."""
    drops = known.drops(residual[:, None])[:, 0]
    by_cause = {c: max(d for curve, d in zip(known.curves, drops, strict=True) if curve.cause == c)
                for c in known.causes}  # fmt: skip
    best = max(by_cause, key=lambda c: by_cause[c])
    if by_cause[best] < limit:
        return {"causes": [], "drop": by_cause[best]}
    alike = [c for c, d in by_cause.items() if by_cause[best] - d <= ONE_CLASS**2]
    return {"causes": [best], "alike": alike, "drop": by_cause[best]}


_THRESHOLDS: dict[int, float] = {}


def threshold(known: Signatures) -> float:
    """Of the largest drop over all curves, which noise alone exceeds in a share `FAMILYWISE` of tests."""
    seed = known.visibility.design.seed
    if seed not in _THRESHOLDS:
        rng = np.random.default_rng([seed, 5])
        noise = rng.standard_normal((known.nodes.shape[1], DRAWS))
        _THRESHOLDS[seed] = float(np.quantile(known.drops(noise).max(axis=0), 1.0 - FAMILYWISE))
    return _THRESHOLDS[seed]


def _largest_drop(known: Signatures, ratio: Array) -> dict[str, Any]:
    """Whatever lowers the plain root mean square most; never none."""
    causes = [curve.cause for curve in known.curves]
    drops = _plain_drops(known, ratio)
    return {"causes": [causes[int(np.argmax(drops))]]}


def _plain_bic(known: Signatures, ratio: Array, count: int) -> dict[str, Any]:
    """Bayes' information criterion over raw readings, as if they were independent; none is a candidate too."""
    square = max(float(ratio @ ratio), 1e-12)
    drops = _plain_drops(known, ratio)
    sizes = np.array([len(curve.nodes) if curve.spans else 1 for curve in known.curves])
    scores = count * np.log(np.maximum(square - drops, 1e-9 * square) / count) + sizes * np.log(count)
    best = int(np.argmin(scores))
    none = count * np.log(square / count)
    return {"causes": [known.curves[best].cause] if scores[best] < none else []}


def _plain_drops(known: Signatures, ratio: Array) -> Array:
    """Drop of the plain square by the best multiple of each curve's nodes ``(curves,)``."""
    result = np.zeros(len(known.curves))
    for i, curve in enumerate(known.curves):
        at = list(curve.nodes)
        if curve.spans:
            A = known.raw[at].T
            fitted = A @ np.linalg.lstsq(A, ratio, rcond=None)[0]
            result[i] = fitted @ fitted
        else:
            A = known.raw[at]
            along = A @ ratio
            result[i] = float(np.max(np.maximum(along, 0.0) ** 2 / np.einsum("ij,ij->i", A, A)))
    return result
