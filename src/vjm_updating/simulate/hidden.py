"""The hidden effect: what the command line says of it, found in the catalogue of the test."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.io.errors import did_you_mean
from vjm_updating.inference.parameters import release_key
from vjm_updating.mechanisms.effect import Effect, Quantity

Hidden = tuple[Effect, list[float]]
"""An effect with the values of its quantities."""


def parsed_effects(texts: Sequence[str], effects: Sequence[Effect]) -> list[Hidden]:
    """The effects that are hidden.

    Args:
        texts: each ``cause``, ``cause=value`` for its principal parameter, or ``cause.parameter=value``; where a
            cause can sit in several places ``cause.place`` stands for the cause. Several parameters of one cause
            are several texts.
        effects: the catalogue of the test.

    Raises:
        ValueError: there is no such effect or parameter in this test, or its value is out of bounds; one line.
    """
    found: dict[str, Hidden] = {}
    for text in texts:
        name, given, number = text.partition("=")
        effect, parameter = _effect(name.strip(), effects)
        quantities = sizes(effect)
        # who names one component of a size means the others to be none
        size = 0 if parameter else 1
        _, values = found.setdefault(effect.label, (effect, _usual(effect, size)))
        if not given:
            continue
        names = [q.name for q in quantities]
        if not names:
            raise ValueError(
                f"--hide {text}: {effect.label} is there or not and has no size: leave '={number}' out"
            )
        if parameter and parameter not in names:
            hint = did_you_mean(parameter, names)
            raise ValueError(
                f"--hide {text}: {effect.label} has no parameter '{parameter}'{hint}; it has {', '.join(names)}"
            )
        k = names.index(parameter) if parameter else 0
        try:
            value = float(number)
        except ValueError:
            raise ValueError(f"--hide {text}: '{number}' is no number") from None
        q = quantities[k]
        if not q.low <= value <= q.high:
            raise ValueError(f"--hide {text}: {q.name} must be from {q.low:g} to {q.high:g}")
        values[k] = value
    return list(found.values())


def sizes(effect: Effect) -> tuple[Quantity, ...]:
    """The parameters of an effect; an error of an instrument, which has no bounds, is one number."""
    found = effect.quantities()
    if not found and release_key(effect) is not None:
        return (Quantity("error", float("-inf"), float("inf"), 1.0),)
    return found


def _effect(name: str, effects: Sequence[Effect]) -> tuple[Effect, str]:
    """The effect whose label begins a name, and the parameter behind it; empty where there is none."""
    labels = {effect.label: effect for effect in reversed(effects)}
    for label in sorted(labels, key=len, reverse=True):
        if name == label or name.startswith(f"{label}."):
            return labels[label], name[len(label) + 1 :]
    cause = name.partition(".")[0]
    places = [label for label in labels if label.startswith(f"{cause}.")]
    if places:
        raise ValueError(f"--hide {name}: say where it sits: {', '.join(sorted(places))}")
    known = sorted({effect.cause for effect in effects})
    raise ValueError(
        f"--hide {name}: no such effect in this test{did_you_mean(cause, known)}; there are {', '.join(known)}"
    )


def _usual(effect: Effect, size: int) -> list[float]:
    """Values where nothing is said: those of the catalogue's first trial, with ``size`` components of its size."""
    values = list(effect.trials()[0]) or [0.0] * len(sizes(effect))
    for k, q in enumerate(effect.quantities()):
        if size <= k < effect.extent and q.neutral is not None:
            values[k] = q.neutral
        elif k >= effect.extent and np.isfinite(q.spread):
            values[k] = q.usual
    return values
