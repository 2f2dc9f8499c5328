"""What a diagnosis of one specimen says of another: its findings taken over one by one, nothing fitted anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vjm.errors import NoConvergenceError
from vjm_updating.diagnosis.document import TransferRow
from vjm_updating.diagnosis.kinds import kind_of
from vjm_updating.experiment import Measurement
from vjm_updating.inference.fitting import Fit
from vjm_updating.inference.forward import Predictor
from vjm_updating.inference.parameters import (
    EffectCoordinate,
    Hypothesis,
    coordinates,
    nuisance_coordinates,
    release_key,
)
from vjm_updating.observation.coordinate import Coordinate
from vjm_updating.observation.observed import Observed


def transfer(fit: Fit, other: Measurement) -> list[TransferRow]:
    """Errors of another test's readings under what a fit has found: nothing of it, each cause, tolerances, all.

    Args:
        fit: of one test.
        other: test of another specimen, by its own sheet.

    Raises:
        ValueError: the other test cannot be used.
    """
    kind = kind_of(other)
    observed = kind.observe(other)
    forward = kind.forward(observed)
    causes = sorted({effect.cause for effect in fit.hypothesis})

    def row(what: str, chosen: Sequence[int], *, nuisances: bool) -> TransferRow:
        value = _values(fit, set(chosen), nuisances=nuisances)
        rmse, unit = _error(forward, observed, tuple(fit.hypothesis[i] for i in chosen), value)
        return TransferRow(causes=causes, what=what, rmse=rmse, unit=unit)

    every = range(len(fit.hypothesis))
    return [
        row("nothing: the sheet's own model", (), nuisances=False),
        *(row(effect.cause, (i,), nuisances=False) for i, effect in enumerate(fit.hypothesis)),
        *([row("zeros, scales and tolerances", (), nuisances=True)] if causes else []),
        row("all of it", every, nuisances=True),
    ]


def _values(fit: Fit, chosen: set[int], *, nuisances: bool) -> Callable[[Coordinate], float]:
    """A coordinate's value: that of the chosen causes and, if so, of the nuisances that no cause has released."""
    freed = {release_key(fit.hypothesis[i]) for i in chosen}
    all_freed = {release_key(effect) for effect in fit.hypothesis}
    order = {str(i): str(k) for k, i in enumerate(sorted(chosen))}
    known: dict[tuple[str, str, str], float] = {}
    for c, z in zip(fit.found, fit.at.z, strict=True):
        if isinstance(c, EffectCoordinate):
            if c.subject in order:
                known[c.kind, order[c.subject], c.quantity.name] = c.value(float(z))
        elif (c.kind, c.subject) in freed or (nuisances and (c.kind, c.subject) not in all_freed):
            known[c.kind, c.subject, ""] = c.value(float(z))

    def value(c: Coordinate) -> float:
        return known.get((c.kind, c.subject, c.quantity.name if isinstance(c, EffectCoordinate) else ""), 0.0)

    return value


def _error(
    forward: Predictor, observed: Observed, hypothesis: Hypothesis, value: Callable[[Coordinate], float]
) -> tuple[float | None, str]:
    """Error of the readings under given values and its unit, see `Observed.scored`; None where nothing stands."""
    found = coordinates(nuisance_coordinates(observed), hypothesis)
    z = np.array([c.coordinate(value(c)) for c in found])
    own, unit = observed.scored
    try:
        at = forward.evaluate(found, z, hypothesis)
    except NoConvergenceError:
        return None, unit
    return float(np.sqrt(np.mean(at.residual[:, own][observed.present[:, own]] ** 2))), unit
