"""A blind set: what is hidden, how strongly, what could be mistaken for it, and the files that a finder gets."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hidden_effects.baselines import likelihood_ratio, threshold
from hidden_effects.causes import Family, Hidden, Laws, catalogue
from hidden_effects.designs import draw
from hidden_effects.detectability import visibility
from hidden_effects.follow_up import extended
from hidden_effects.machine import NoTruthError
from hidden_effects.noise import with_nuisances
from hidden_effects.off_catalogue import outside
from hidden_effects.plan import Group, Plan
from hidden_effects.refined_signatures import sharpened, sharpened_pairs
from hidden_effects.rig import Rig
from hidden_effects.signatures import ONE_CLASS, Signatures, signatures
from hidden_effects.store import Store
from hidden_effects.truth_models import as_drawn, by_finite_elements
from hidden_effects.virtual_rig import Design, data_text, read, sheet_text
from vjm.io.files import write_whole
from vjm.rotations import Array

BY_ELEMENTS = 4
"""Of so many sets one is read off finite elements, where they have what it needs."""
NEAR = 0.05
"""Relative error of a strength that is near enough."""


class UnreachableError(ValueError):
    """No size of a cause has the wanted strength in this design."""


def make(plan: Plan, store: Store, folder: Path, proposal: dict[str, Any] | None = None) -> dict[str, Any]:
    """Write a set's files and return what is hidden in it.

    Args:
        plan: of the set.
        store: of signatures.
        folder: that gets ``data.csv``, ``sheet.toml``, ``still.csv`` (the same without noise) and ``truth.json``.
        proposal: a further experiment, whose readings are added; then there is no ``truth.json``.

    Raises:
        UnreachableError: the causes cannot be hidden as strongly as wanted.
        NoTruthError: the simulator gave up.
        NoExperimentError: the proposal cannot be carried out.
    """
    rng = np.random.default_rng([plan.number, 3])
    known, hidden = _hide(plan, store, rng)
    design = known.visibility.design
    rig = as_drawn(design)
    for one in hidden:
        rig = one.put(rig, one.size)
    loose, nuisances = with_nuisances(rig, design, rng)
    simulator = "rods"
    if plan.number % BY_ELEMENTS == 0 and proposal is None:
        loose, simulator = _elements(loose, design)
    if proposal is not None:
        design = extended(design, proposal)
    still = loose.response(design)
    seen, regular = read(design, still, rng)
    truth = {}
    if proposal is None:
        change = known.visibility.whitened(rig.response(design).less(known.visibility.nominal))
        sharp = sharpened(known, change, hidden) if hidden else known
        truth = _truth(plan, sharp, hidden, change, nuisances)
        truth["likelihood_ratio"] = likelihood_ratio(sharp, regular, threshold(known))
        truth["simulator"] = simulator
    write_whole(folder / "sheet.toml", sheet_text(design, f"blind {plan.name}"))
    write_whole(folder / "data.csv", data_text(design, seen.ux, seen.forces))
    write_whole(folder / "still.csv", data_text(design, still.ux, still.forces))
    if truth:
        write_whole(folder / "truth.json", json.dumps(truth, indent=1))
    return truth


def _elements(rig: Rig, design: Design) -> tuple[Rig, str]:
    """The rig on finite elements if they can be it, and by what it is simulated."""
    other = by_finite_elements(rig)
    if other is None:
        return rig, "rods"
    try:
        other.response(design)
    except NoTruthError:
        # behind a bifurcation there is no smooth path
        return rig, "rods"
    return other, "finite elements"


def _truth(
    plan: Plan, known: Signatures, hidden: Sequence[Hidden], change: Array, nuisances: dict[str, float]
) -> dict[str, Any]:
    design = known.visibility.design
    names = sorted({one.family.cause for one in hidden})
    alike = known.equivalent(change) if hidden else {}
    return {
        "set": plan.number,
        "group": str(plan.group),
        "design": {"seed": design.seed, "kind": design.kind, "readings": len(design),
                   "postures": [s.posture for s in design.sequences], "channels": list(design.channels),
                   "autocorrelation": design.autocorrelation},
        "causes": names,
        "hidden": [
            {"cause": one.family.cause, "label": one.family.label, "size": one.size, "strength": one.strength,
             "parameter": one.family.parameter,
             "value": one.family.value(one.size) if one.family.parameter else None}
            for one in hidden
        ],
        "strength": float(np.linalg.norm(change)),
        "wanted": list(plan.strengths),
        "alike": alike,
        "apart": _apart(known, change, names),
        "admitted": _admitted(known, change, names, alike, hidden),
        "nuisances": nuisances,
    }  # fmt: skip


def _admitted(
    known: Signatures, change: Array, names: Sequence[str], alike: dict[str, float], hidden: Sequence[Hidden]
) -> list[list[str]]:
    """Sets of causes that a verdict may name beside the hidden one: one class with it."""
    admitted = [[cause] for cause in alike]
    if len(names) < 2 and not set(names) - set(known.causes):
        return admitted
    causes = [c for c in known.causes if c not in alike]
    # pairs that hold one of the hidden causes, and for a cause outside the catalogue all pairs of the nearest
    near = sorted(causes, key=lambda c: known.nearest(change, [c]).distance)[:8]
    pairs = {tuple(sorted((a, b))) for a in (names if len(names) > 1 else near) for b in causes if a != b}
    pairs = {pair for pair in pairs if set(pair) <= set(causes)}
    if len(hidden) == 2:
        known = sharpened_pairs(known, change, hidden)
    pairs = {pair for pair in pairs if known.at_least(change, pair) <= ONE_CLASS}
    admitted += [list(pair) for pair in sorted(pairs) if known.nearest(change, pair).distance <= ONE_CLASS]
    return admitted


def _apart(known: Signatures, change: Array, names: Sequence[str]) -> float:
    """Strength that the nearest cause beside the hidden ones leaves."""
    others = [cause for cause in known.causes if cause not in names]
    return min((known.nearest(change, [cause]).distance for cause in others), default=float(np.linalg.norm(change)))


def _hide(plan: Plan, store: Store, rng: np.random.Generator) -> tuple[Signatures, list[Hidden]]:
    """Signatures of the first design in which all of a plan's causes can be hidden as strongly as wanted."""
    best: tuple[float, Signatures, list[Hidden]] | None = None
    for trial in range(store.designs):
        seed = store.another(plan.design, trial)
        if plan.causes and plan.causes[0].endswith("lumping"):
            found = _lumped(plan, seed)
            if found is not None:
                return found
            continue
        known = store.signatures(seed)
        try:
            hidden = [
                _sized(known, cause, strength, plan, rng)
                for cause, strength in zip(plan.causes, plan.strengths, strict=True)
            ]
        except UnreachableError:
            continue
        if plan.group is Group.INSEPARABLE and not _confused(known, hidden):
            continue
        short = sum(abs(np.log(h.strength / s)) for h, s in zip(hidden, plan.strengths, strict=True))
        if best is None or short < best[0]:
            best = short, known, hidden
        if short <= 2 * NEAR * len(hidden):
            break
    if best is None:
        raise UnreachableError(f"set {plan.number}: {', '.join(plan.causes)} cannot be hidden in any design tried")
    return best[1], best[2]


def _confused(known: Signatures, hidden: Sequence[Hidden]) -> bool:
    """Whether another cause is one class with the hidden one."""
    (one,) = hidden
    rig = as_drawn(known.visibility.design)
    change = one.put(rig, one.size).response(known.visibility.design).less(known.visibility.nominal)
    target = known.visibility.whitened(change)
    if len(known.equivalent(target)) < 2:
        return False
    return any(cause != one.family.cause for cause in sharpened(known, target, hidden).equivalent(target))


def _sized(known: Signatures, cause: str, strength: float, plan: Plan, rng: np.random.Generator) -> Hidden:
    """A cause by a law that is drawn, of a size that has about the wanted strength."""
    design = known.visibility.design
    largest = known.visibility.largest
    laws = Laws()
    if plan.group is Group.OUTSIDE:
        families = outside(design, rng)
        families = [families[int(cause) % len(families)]]
    else:
        laws = Laws.draw(rng)
        families = [f for f in catalogue(design, largest, laws) if f.cause == cause]
    if not families:
        raise UnreachableError(f"{cause} has no place in this design")
    family = families[int(rng.integers(len(families)))]
    sign = float(rng.choice(family.signs))
    (put,) = family.members
    rig = as_drawn(design)
    low, high = (0.0, 0.0), (np.inf, np.inf)
    size = family.first
    for _ in range(14):
        size = min(size, family.most)
        try:
            here = known.visibility.strength(put(rig, sign * size).response(design).less(known.visibility.nominal))
        except NoTruthError:
            high, size = (size, np.inf), 0.5 * (low[0] + size)
            continue
        if abs(here / strength - 1.0) < NEAR or (size >= family.most and here >= 0.5 * strength):
            return Hidden(family, sign * size, here, laws)
        if here < strength:
            low = (size, here)
            if size >= family.most:
                break
        else:
            high = (size, here)
        if np.isfinite(high[1]) and low[1] > 0.0:
            share = np.log(strength / low[1]) / np.log(high[1] / low[1])
            size = low[0] * (high[0] / low[0]) ** float(np.clip(share, 0.1, 0.9))
        elif np.isfinite(high[0]):
            size = max(0.5 * (low[0] + high[0]) if low[0] > 0.0 else high[0] * strength / high[1], 1e-12)
        else:
            size *= float(np.clip(strength / max(here, 1e-3), 1.2, 30.0))
    if low[1] < 0.5 * strength:
        raise UnreachableError(f"{family.name} does not reach a strength of {strength:g}")
    return Hidden(family, sign * low[0], low[1], laws)


def _lumped(plan: Plan, seed: int) -> tuple[Signatures, list[Hidden]] | None:
    """A sheet whose link or foot is one spring, loaded as far as the difference has the wanted strength."""
    (cause,), (wanted,) = plan.causes, plan.strengths
    whole = replace(draw(seed, lumped_link=cause == "link_lumping"), foot_segments=1)
    if cause == "link_lumping":
        whole = replace(whole, foot_segments=8)
    family = Family(cause, "", (_beams,), 1.0, most=1.0)
    low, high, share = 0.01, 1.0, 1.0
    best: tuple[float, float] | None = None
    for _ in range(8):
        design = scaled(whole, share)
        try:
            seen = visibility(design)
            here = seen.strength(_beams(as_drawn(design), 1.0).response(design).less(seen.nominal))
        except NoTruthError:
            high, share = share, 0.7 * share
            continue
        if best is None or abs(np.log(here / wanted)) < abs(np.log(best[1] / wanted)):
            best = share, here
        if abs(here / wanted - 1.0) < NEAR or (share == 1.0 and here < wanted):
            break
        low, high = (share, high) if here < wanted else (low, share)
        share = float(np.sqrt(low * high))
    if best is None or not 0.5 < best[1] / wanted < 2.0:
        return None
    return signatures(scaled(whole, best[0])), [Hidden(family, 1.0, best[1])]


def _beams(rig: Rig, _: float) -> Rig:
    """The rig with a foot and a link that are distributed."""
    return Rig(replace(rig.machine, lumped_foot=False), rig.tilt, rig.screw, rig.faults, rig.softer_per_kelvin)


def scaled(design: Design, share: float) -> Design:
    """The same test with all displacements times a share."""
    return replace(design, sequences=tuple(replace(s, ux=share * s.ux) for s in design.sequences))
