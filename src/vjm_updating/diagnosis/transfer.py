"""What a diagnosis of one specimen says of another: its findings taken over one by one, nothing fitted anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vjm.errors import NoConvergenceError
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


@dataclass(frozen=True)
class Transferred:
    """What was taken over, and the error of the other test's readings then, see `Observed.scored`.

    Attributes:
        what: in words.
        rmse: None where the machine does not stand with it.
        unit: of it.
    """

    what: str
    rmse: float | None
    unit: str


def transfer(fit: Fit, other: Measurement) -> list[Transferred]:
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
    rows = [_row(forward, observed, "nothing: the sheet's own model", (), lambda _: 0.0)]
    for i, effect in enumerate(fit.hypothesis):
        rows.append(_row(forward, observed, effect.cause, (effect,), _values(fit, {i}, nuisances=False)))
    if fit.hypothesis:
        rows.append(
            _row(forward, observed, "zeros, scales and tolerances", (), _values(fit, set(), nuisances=True))
        )
    every = set(range(len(fit.hypothesis)))
    rows.append(_row(forward, observed, "all of it", fit.hypothesis, _values(fit, every, nuisances=True)))
    return rows


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


def _row(
    forward: Predictor, observed: Observed, what: str, hypothesis: Hypothesis, value: Callable[[Coordinate], float]
) -> Transferred:
    found = coordinates(nuisance_coordinates(observed), hypothesis)
    z = np.array([c.coordinate(value(c)) for c in found])
    own, unit = observed.scored
    try:
        at = forward.evaluate(found, z, hypothesis)
    except NoConvergenceError:
        return Transferred(what, None, unit)
    on = observed.present[:, own]
    return Transferred(what, float(np.sqrt(np.mean(at.residual[:, own][on] ** 2))), unit)
