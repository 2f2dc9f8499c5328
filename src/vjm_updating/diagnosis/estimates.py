"""The parameters of a fit with their uncertainty: what the readings say of a size, and of where it may sit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.document import ValueRow
from vjm_updating.inference.fitting import Fit, Fitter, prior
from vjm_updating.inference.forward import values_of
from vjm_updating.inference.normal_equations import inverse
from vjm_updating.inference.parameters import of_effect, release_key
from vjm_updating.inference.truncated_normal import truncated_draws
from vjm_updating.observation.coordinate import Evaluation, uncertain
from vjm_updating.observation.significance import NORMAL_95, latin_hypercube, normal_quantile

DRAWS = numerical(512)
"""Of the coordinates, from which an interval follows."""
THINNED = numerical(15)
"""Of the draws from a truncated distribution, each how many-th is taken: about as many."""
FAR, GRID = numerical(40.0), numerical(65)
"""Squares beyond the least at which a profile ends, and points between two places of it."""
PARTS = numerical(8)
"""Of an interval, over which draws are counted for a density."""
LIMITS: Mapping[tuple[bool, bool], str] = {
    (True, True): "both", (False, True): "upper", (True, False): "lower", (False, False): "none",
}  # fmt: skip
"""Of a `ValueRow`, by whether readings tell the lower and the upper end."""
DIRECTION = "direction_rad"
"""Last word of parameters that are angles all round."""


def estimates(fitter: Fitter, fit: Fit, force: float) -> dict[str, ValueRow]:
    """The parameters of a fit under docs/measured-data.md's names.

    Errors are taken as normal in the fit's own coordinates, where they nearly are; the intervals are of what is
    reported, which may be no straight function of them: a vector's size grows by errors in whatever direction.
    """
    covariance = covariance_of(fitter, fit)
    push = _beyond_bounds(fitter, fit)
    result: dict[str, ValueRow] = {}
    for i, effect in enumerate(fit.hypothesis):
        key = release_key(effect)
        here = _reported(fit, fit.at.z, i, force)
        own = (
            of_effect(fit.found, i)
            if key is None
            else [k for k, c in enumerate(fit.found) if (c.kind, c.subject) == key]
        )
        if not own:
            continue
        z = fit.at.z[own]
        slopes = {name: np.zeros(len(own)) for name in here}
        for k in range(len(own)):
            h = 1e-5 * max(1.0, abs(float(z[k])))
            for name, value in _with(fit, own, z + h * np.eye(len(own))[k], i, force).items():
                slopes[name][k] = (value - here[name]) / h
        block = covariance[np.ix_(own, own)]
        low, high = (np.array([getattr(fit.found[k], end) for k in own]) for end in ("low", "high"))
        bounded, errors = _errors(block, low - z, high - z, push[own])
        drawn = [_with(fit, own, z + d, i, force) for d in errors]
        for name, value in here.items():
            std = max(float(slopes[name] @ block @ slopes[name]), 0.0) ** 0.5
            off = np.array([there[name] for there in drawn]) - value
            if name.endswith(DIRECTION):
                off = np.angle(np.exp(1j * off))
            if bounded and effect.extent == 1:
                ends = [
                    _with(fit, own, end, i, force)[name] - value for end in (low, high) if np.isfinite(end).all()
                ]
                least, most = credible(off, ends)
                least, most = min(least, 0.0), max(most, 0.0)
            else:
                least, most = (float(v) for v in np.quantile(off, [0.025, 0.975]))
                # a size that errors in whatever direction make larger is smaller by what lies along it
                least = least if least < 0.0 else -NORMAL_95 * std
                most = most if most > 0.0 else NORMAL_95 * std
            result[name] = ValueRow(value=value, std=std, interval95=[value + least, value + most])
        for k in own[effect.extent :] if key is None else ():
            alone = [name for name, slope in slopes.items() if slope[own.index(k)] and np.count_nonzero(slope) == 1]
            if alone:
                profile = by_profile(fitter, fit, k, float(covariance[k, k]) ** 0.5)
                reported = [(_with(fit, [k], np.array([end]), i, force), told) for end, told in profile]
                for name in alone:
                    (least, by_low), (most, by_high) = sorted((one[name], told) for one, told in reported)
                    interval = {"interval95": [least, most], "limits": LIMITS[by_low, by_high]}
                    result[name] = result[name].model_copy(update=interval)
    return result


def by_profile(fitter: Fitter, fit: Fit, index: int, std: float) -> list[tuple[float, bool]]:
    """Ends of an interval that holds 95 % of a shape's posterior, from its profile, and whether readings tell each.

    Readings tell an end where they, without the prior, speak against what lies farthest beyond it.

    Readings may say that a shape is below something and no more. There the objective is flat to one side, and its
    curvature says nothing. So it is found at distances that double, the other coordinates following to first order.

    Args:
        fitter: of the test.
        fit: at its best.
        index: of the shape's coordinate.
        std: by the curvature: the first distance.
    """
    coordinate, z = fit.found[index], float(fit.at.z[index])
    others = [i for i, c in enumerate(fit.found) if i != index and c.sigma != 0.0]
    W = fitter.whitening.flat(fit.jacobian)[:, others]
    weight = prior(fit.found, fit.at.z)[1]
    A = np.linalg.qr(np.vstack([W, np.diag(weight)[:, others]]))[0]
    known = {z: 0.0}
    least, told = _least_squares(fitter, fit, fit.at, A), list[bool]()
    for way in (-1.0, 1.0):
        distance, against = std, 0.0
        while known[min(known) if way < 0.0 else max(known)] < FAR:
            there = fit.at.z.copy()
            there[index] = np.clip(z + way * distance, coordinate.low, coordinate.high)
            at = fitter.evaluate(fit.found, there, fit.hypothesis)
            if at is None or there[index] in known:
                break
            known[float(there[index])] = max(_least_squares(fitter, fit, at, A) - least, 0.0)
            usual = [float(prior(fit.found, where)[0][index]) for where in (there, fit.at.z)]
            against = known[float(there[index])] - usual[0] ** 2 + usual[1] ** 2
            distance *= 2.0
        told.append(at is None or against > NORMAL_95**2)
    places = np.array(sorted(known))
    fine = np.unique(np.concatenate([np.linspace(a, b, GRID) for a, b in pairwise(places)] or [places]))
    density = np.exp(-0.5 * np.interp(fine, places, [known[place] for place in places]))
    mass = np.concatenate([[0.0], np.cumsum(np.diff(fine) * 0.5 * (density[1:] + density[:-1]))])
    if mass[-1] == 0.0:
        return [(z, True), (z, True)]
    low, high = (float(np.interp(q, mass / mass[-1], fine)) for q in (0.025, 0.975))
    return [(min(low, z), told[0]), (max(high, z), told[1])]


def _least_squares(fitter: Fitter, fit: Fit, at: Evaluation, basis: Array) -> float:
    """Squares of readings and priors that the other coordinates' slopes ``(N, k)``, orthonormal, leave."""
    r = np.concatenate([fitter.whitening.flat(at.residual), prior(fit.found, at.z)[0]])
    left = r - basis @ (basis.T @ r)
    return float(left @ left)


def credible(draws: Array, bounds: Sequence[float]) -> tuple[float, float]:
    """An interval that holds 95 % of draws ``(n,)`` of a size that bounds cut off.

    It begins at a bound where the density is at least that at the 95 % quantile, as the shortest interval does.
    Quantiles at both ends would leave the bound out always, and so find a size where there may be none.

    Args:
        draws: of the size.
        bounds: of it.

    Example:
        >>> credible(np.linspace(0.01, 10.0, 1000) ** 2, [0.0])[0]
        0.0
    """
    reached = []
    for bound in bounds:
        far = float(np.quantile(draws, 0.95 if bound <= draws.min() else 0.05))
        width = abs(far - bound) / PARTS
        if np.sum(np.abs(draws - bound) < width) >= np.sum(np.abs(draws - far) < 0.5 * width):
            reached.append((bound, far))
    if not reached:
        least, most = (float(v) for v in np.quantile(draws, [0.025, 0.975]))
        return least, most
    # at two bounds there is nothing between them that is less likely
    ends = list(reached[0]) if len(reached) == 1 else [bound for bound, _ in reached]
    return min(ends), max(ends)


def joined(here: Mapping[str, ValueRow], others: Sequence[Mapping[str, ValueRow]]) -> dict[str, ValueRow]:
    """Estimates whose intervals take in those of the same causes in other places, where these explain as much."""
    result = dict(here)
    for other in others:
        result |= {name: result[name].joined(other[name]) for name in result.keys() & other.keys()}
    return result


def _errors(covariance: Array, low: Array, high: Array, push: Array) -> tuple[bool, Array]:
    """Errors ``(n, k)`` of coordinates, and whether a bound is so near that it cuts them off.

    Args:
        covariance: ``(k, k)`` of the coordinates without bounds.
        low: ``(k,)`` and
        high: ``(k,)`` the bounds, from where the coordinates are.
        push: ``(k,)`` how far they would go if there were no bounds.
    """
    drawn = truncated_draws(push, covariance, low, high, np.zeros(len(push)))
    return (False, _normal(covariance)) if drawn is None else (True, drawn[::THINNED])


def _normal(covariance: Array) -> Array:
    """Errors ``(DRAWS, k)`` of a covariance ``(k, k)``, always the same ones, spread evenly."""
    sizes, axes = np.linalg.eigh(covariance)
    even = latin_hypercube(DRAWS, len(covariance), 0)
    result: Array = normal_quantile(even) * np.sqrt(np.maximum(sizes, 0.0)) @ axes.T
    return result


def _with(fit: Fit, own: Sequence[int], z: Array, index: int, force: float) -> dict[str, float]:
    """What is reported with some coordinates ``own`` at ``z`` instead."""
    there = fit.at.z.copy()
    there[list(own)] = z
    return _reported(fit, there, index, force)


def _reported(fit: Fit, z: Array, index: int, force: float) -> dict[str, float]:
    effect = fit.hypothesis[index]
    values = values_of(fit.found, z, fit.hypothesis)[index]
    key = release_key(effect)
    if key is None:
        said = effect.reported(values, force)
        return {_named(fit, index, name.removeprefix(f"{effect.cause}.")): v for name, v in said.items()}
    name = {"modulus": "factor", "length": "delta_mm"}.get(key[0], effect.part)
    return {_named(fit, index, name): float(values[0])}


def _named(fit: Fit, index: int, name: str) -> str:
    """Name of an effect's parameter: with the part, where one cause sits in several parts."""
    effect = fit.hypothesis[index]
    again = sum(other.cause == effect.cause for other in fit.hypothesis) > 1
    inside = again and effect.part and not name.startswith(effect.part)
    return f"{effect.cause}.{effect.part}.{name}" if inside else f"{effect.cause}.{name}"


def _beyond_bounds(fitter: Fitter, fit: Fit) -> Array:
    """How far ``(n_z,)`` the coordinates would go if those that press against bounds had none."""
    pressure = fitter.pressure(fit)
    low = np.array([c.low for c in fit.found])
    result: Array = _inverse(fitter, fit) @ np.where(fit.at.z <= low, -pressure, pressure)
    return result


def _inverse(fitter: Fitter, fit: Fit) -> Array:
    return inverse(fitter.normal(fit), uncertain(fit.found))


def covariance_of(fitter: Fitter, fit: Fit) -> Array:
    """Of a fit's z ``(n_z, n_z)``, widened where it leaves more than the noise."""
    covariance = _inverse(fitter, fit)
    rows = int(fitter.whitening.present.sum())
    inflation = max(1.0, fitter.squares(fit.found, fit.at) / max(rows - fit.free, 1))
    result: Array = covariance * inflation
    return result


def nuisance_estimates(fitter: Fitter, fit: Fit) -> dict[str, ValueRow]:
    """The nuisances of a fit."""
    covariance = covariance_of(fitter, fit)
    result = {}
    for i, c in enumerate(fit.found):
        if c.kind == "effect" or c.sigma == 0.0:
            continue
        z = float(fit.at.z[i])
        value, std = c.value(z), c.slope(z) * float(np.sqrt(covariance[i, i]))
        ends = [value - NORMAL_95 * std, value + NORMAL_95 * std]
        result[c.name] = ValueRow(value=value, std=std, interval95=ends)
    return result
