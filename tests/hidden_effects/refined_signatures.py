"""A reference that knows what is hidden: the points of every cause that come nearest to it, simulated.

The curves of `signatures` serve a whole design. They are straight between a few sizes and have usual laws, so that
they can lie beside what a law of another shape, or a size between, would show. Here each cause that might be one
class with the hidden one is refitted to its readings: the same machine with the cause in it, by the hidden one's
laws where both have them, its sizes and directions found by Gauss and Newton's method with differences.

Of a hidden pair either cause stays as it is hidden, and every other cause is refitted to what the second one adds,
in the machine that has the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hidden_effects.causes import Family, Hidden, Laws, Put, catalogue
from hidden_effects.machine import NoTruthError
from hidden_effects.rig import Rig
from hidden_effects.signatures import Curve, Signatures, change_of
from hidden_effects.truth_models import as_drawn
from hidden_effects.virtual_rig import RigResponse
from vjm.rotations import Array

WITHIN = 8.0
"""Strength by the coarse curves within which a cause is looked at."""
ROUNDS, HALVED = 4, 3
"""Steps of a refit, and times that one which does not come nearer is halved."""
DIFFERENCE = 0.03
"""Relative step of differences."""
SETTLED = 0.02
"""Strength by which a step must come nearer for another one."""


Added = tuple[str, str, Array]
"""A cause, where it sits, and what it changes at some sizes, whitened ``(n c,)``."""


@dataclass(frozen=True)
class Refit:
    """Simulates causes in a design by given laws."""

    known: Signatures
    laws: Laws
    rig: Rig
    base: RigResponse

    @staticmethod
    def into(known: Signatures, laws: Laws, beside: Hidden | None = None) -> Refit | None:
        """Of causes in the machine as drawn, or in one with a cause already; None where that does not stand."""
        seen, rig = known.visibility, as_drawn(known.visibility.design)
        if beside is None:
            return Refit(known, laws, rig, seen.nominal)
        rig = beside.put(rig, beside.size)
        try:
            return Refit(known, laws, rig, rig.response(seen.design))
        except NoTruthError:
            return None

    def simulated(self, put: Put, size: float) -> Array | None:
        """What a cause changes, ``(n c,)``; None where the simulator gives up or a lumped link lacks it."""
        seen = self.known.visibility
        try:
            flat = change_of(seen, self.rig, self.base, put, size)
        except NoTruthError:
            return None
        return seen.whitened_flat(flat) if flat.any() else None

    def point(self, cause: str, label: str, sizes: Array) -> Array | None:
        """The same at its sizes ``(k,)``, see `_form`; None also where it has no place."""
        seen = self.known.visibility
        laws, size = _form(cause, sizes, self.laws)
        largest = seen.largest
        family = next(
            (f for f in catalogue(seen.design, largest, laws) if f.cause == cause and _same_place(f, label)), None
        )
        if family is None or size == 0.0:
            return None
        (put,) = family.members
        return self.simulated(put, float(np.clip(size, -family.most, family.most)))

    def nearest(self, cause: str, target: Array) -> tuple[str, Array] | None:
        """Label and point of a cause nearest to a whitened change ``(n c,)``, from where its coarse curves are."""
        fit = self.known.nearest(target, [cause])
        curve = next((c for c in self.known.curves if c.cause == cause and fit.weights[list(c.nodes)].any()), None)
        # a sheet's lumped link is another machine than that of the coarse curves
        far = fit.distance > WITHIN and self.known.visibility.design.link_segments > 1
        if far or curve is None:
            return None
        sizes = _sizes(curve, fit.weights)
        here = self.point(cause, curve.label, sizes)
        for _ in range(ROUNDS if here is not None else 0):
            assert here is not None
            if not sizes.any():
                # nothing of it is nearest, and has no direction
                break
            slopes = self._slopes(cause, curve.label, sizes, here)
            step = np.linalg.lstsq(slopes, target - here, rcond=1e-6)[0]
            before = float(np.linalg.norm(target - here))
            for k in range(HALVED):
                moved = _inside(cause, sizes + 0.5**k * step, sizes)
                there = self.point(cause, curve.label, moved)
                if there is not None and float(np.linalg.norm(target - there)) < before:
                    sizes, here = moved, there
                    break
            if before - float(np.linalg.norm(target - here)) < SETTLED:
                break
        return None if here is None else (curve.label, here)

    def _slopes(self, cause: str, label: str, sizes: Array, here: Array) -> Array:
        """Derivatives ``(n c, k)`` of the whitened change by the sizes."""
        scale = float(np.abs(sizes).max())
        columns = np.zeros((len(here), len(sizes)))
        for k in range(len(sizes)):
            outwards = DIFFERENCE * scale * (1.0 if sizes[k] >= 0.0 else -1.0)
            for h in (outwards, -outwards):
                moved = sizes.copy()
                moved[k] += h
                there = self.point(cause, label, moved)
                if there is not None:
                    columns[:, k] = (there - here) / h
                    break
        return columns


def sharpened(known: Signatures, target: Array, hidden: Sequence[Hidden]) -> Signatures:
    """A design's reference with a point more for each cause that comes near, and with the hidden ones' own."""
    added = list[Added]()
    for own in hidden:
        added += _hidden_point(Refit.into(known, own.laws), own)
    refit = Refit.into(known, hidden[0].laws if hidden else Laws())
    return _with(known, [*added, *_nearest(refit, target)])


def sharpened_pairs(known: Signatures, target: Array, pair: Sequence[Hidden]) -> Signatures:
    """A design's reference of pairs that hold one of two hidden causes; single causes are not to be read off it."""
    added = list[Added]()
    for kept, other in (pair, pair[::-1]):
        own = _hidden_point(Refit.into(known, kept.laws), kept)
        if own:
            ((_, _, point),) = own
            beside = Refit.into(known, other.laws, kept)
            added += [*own, *_hidden_point(beside, other), *_nearest(beside, target - point)]
    return _with(known, added)


def _hidden_point(refit: Refit | None, hidden: Hidden) -> list[Added]:
    """What a hidden cause changes, where it is known by name and can be simulated."""
    family = hidden.family
    if refit is None or family.cause not in refit.known.causes:
        return []
    point = refit.simulated(hidden.put, hidden.size)
    return [] if point is None else [(family.cause, family.label, point)]


def _nearest(refit: Refit | None, target: Array) -> list[Added]:
    """The nearest point of every cause that comes near."""
    if refit is None:
        return []
    found = ((cause, refit.nearest(cause, target)) for cause in refit.known.causes)
    return [(cause, *nearest) for cause, nearest in found if nearest is not None]


def _with(known: Signatures, added: Sequence[Added]) -> Signatures:
    """A reference with more points."""
    if not added:
        return known
    seen = known.visibility
    white = np.array([*known.nodes, *(point for _, _, point in added)])
    first = len(known.nodes)
    # a plane is straight: what it seems to reach, the refit has shown to be there or not
    bent = {cause for cause, _, _ in added}
    kept = [curve for curve in known.curves if not (curve.spans and curve.cause in bent)]
    curves = [Curve(cause, label, (first + k,), (1.0,), False, False) for k, (cause, label, _) in enumerate(added)]
    return Signatures(seen, (*kept, *curves), white, white @ white.T)


def _same_place(family: Family, label: str) -> bool:
    return family.label == label or family.cause == "link_bow"


def _sizes(curve: Curve, weights: Array) -> Array:
    """Sizes ``(k,)`` at which a coarse curve comes nearest: those of a plane's members, or the one."""
    w, s = weights[list(curve.nodes)], np.array(curve.sizes)
    if curve.cause == "link_bow":
        size, turn = float(w @ s), np.radians(float(curve.label))
        return size * np.array([np.cos(turn), np.sin(turn)])
    result: Array = w * s if curve.spans else np.array([float(w @ s)])
    return result


def _form(cause: str, sizes: Array, laws: Laws) -> tuple[Laws, float]:
    """Laws and size of one form that has a cause's sizes: components of a bow or tilt, compliances, two weights."""
    if cause in ("link_bow", "load_misalignment") and len(sizes) == 2:
        return replace(laws, direction=float(np.arctan2(sizes[1], sizes[0]))), float(np.hypot(*sizes))
    laws = replace(laws, direction=0.0)
    if cause == "base_compliance" and len(sizes) == 3:
        x = max(float(sizes[0]), 1e-4 * float(sizes.max()), 1e-12)
        return replace(laws, base=(float(sizes[1]) / x, float(sizes[2]) / x, 0.0)), x
    if cause == "gravity" and len(sizes) == 2:
        whole = float(sizes.sum())
        return replace(laws, spread=float(sizes[0]) / whole if whole else 0.0), whole
    return laws, float(sizes[0])


def _inside(cause: str, sizes: Array, before: Array) -> Array:
    """Sizes that make sense: compliances and weights are not negative, and one size keeps its sign."""
    if cause in ("base_compliance", "gravity"):
        return np.maximum(sizes, 0.0)
    if len(sizes) == 1:
        return np.where(sizes * before > 0.0, sizes, 0.1 * before)
    return sizes
