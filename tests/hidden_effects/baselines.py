"""A finder to be compared with: it knows laws and noise, and chooses among the injector's own curves."""

from typing import Any

import numpy as np

from hidden_effects.signatures import ONE_CLASS, Signatures
from hidden_effects.virtual_rig import RigResponse

DRAWS = 400
"""Of noise, from which the threshold of the likelihood ratio follows."""
FAMILYWISE = 0.01
"""Share of quiet sets on which the likelihood ratio may raise an alarm."""


def likelihood_ratio(known: Signatures, regular: RigResponse, limit: float) -> dict[str, Any]:
    """The largest drop of the whitened square, against its limit, and what comes near it.

    Args:
        known: signatures of the design, sharpened for what is hidden.
        regular: readings without outliers and missed ones: who knows the noise knows which they are.
        limit: see `threshold`.

    Returns:
        ``causes`` that it names, an empty list for none; ``alike``, all that it cannot tell from these.
    """
    visibility = known.visibility
    residual = visibility.whitened(regular.less(visibility.nominal))
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
