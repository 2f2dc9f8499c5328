"""What is right: a verdict against what was hidden, by docs/measured-data.md."""

from typing import Any

RATIOS = ("factor", "ratio", "stiffness_ratio")
"""Last words of parameters whose error is taken on r − 1."""


def admitted(truth: dict[str, Any]) -> set[frozenset[str]]:
    """Sets of causes that a verdict may name: the hidden one, and what is one class with it.

    A cause that no catalogue has is none of them.
    """
    unknown = set(truth["causes"]) if truth["group"] == "outside" else set()
    own = {frozenset(causes) for causes in truth["admitted"]}
    own |= {frozenset(truth["causes"])} if truth["causes"] else set()
    return {causes for causes in own if not causes & unknown}


def right(truth: dict[str, Any], found: dict[str, Any]) -> bool:
    """Whether a verdict is right.

    ``none`` where nothing is hidden. ``named`` with exactly the hidden set; ``class`` with candidates that contain
    it and all lie in its equivalence class. Where the finder cannot know the cause: ``unknown``, or if causes that
    it knows are one class with it, any of these.
    """
    if "error" in found:
        return False
    verdict, candidates = found["verdict"], candidate_sets(found)
    if not truth["causes"]:
        return bool(verdict == "none")
    may = admitted(truth)
    if truth["group"] == "outside":
        if verdict == "unknown":
            return True
        return bool(candidates) and all(causes in may for causes in candidates)
    hidden = frozenset(truth["causes"])
    if verdict == "named":
        return candidates == [hidden]
    return bool(verdict == "class") and hidden in candidates and all(causes in may for causes in candidates)


def rival_right(truth: dict[str, Any]) -> bool:
    """Whether the likelihood ratio is right: by the hidden cause, or by a class of it and what is alike."""
    said = truth["likelihood_ratio"]
    if not said["causes"]:
        return False
    hidden, alike = truth["causes"], [frozenset([c]) for c in said.get("alike", said["causes"])]
    if said["causes"] == hidden and len(alike) <= 1:
        return True
    return frozenset(hidden) in alike and all(c in admitted(truth) for c in alike)


def candidate_sets(found: dict[str, Any]) -> list[frozenset[str]]:
    """The sets of causes that remain possible, each once: candidates may differ in the part alone."""
    return list(dict.fromkeys(frozenset(candidate["causes"]) for candidate in found.get("candidates", [])))


def parameter(found: dict[str, Any], causes: list[str], key: str) -> dict[str, Any] | None:
    """An estimate of the first candidate with these causes that has it."""
    for candidate in found.get("candidates", []):
        value = candidate.get("parameters", {}).get(key)
        if sorted(candidate["causes"]) == sorted(causes) and isinstance(value, dict):
            return value
    return None


def principal(truth: dict[str, Any], found: dict[str, Any], still: dict[str, Any]) -> dict[str, Any] | None:
    """Error and coverage of the principal parameter.

    The truth is the finder's law fitted to the readings without noise, else what the injector built in.

    Returns:
        ``error`` relative (of r − 1 for a ratio), ``inside`` the 95 % interval; None where there is no estimate of
        it or no truth.
    """
    (hidden,) = truth["hidden"]
    key = hidden["parameter"] or ("plasticity.yield_N" if hidden["cause"] == "plasticity" else "")
    if not key:
        return None
    estimate = parameter(found, truth["causes"], key)
    known = parameter(still, truth["causes"], key) or {"value": hidden["value"]}
    if estimate is None or known["value"] is None:
        return None
    value, true = float(estimate["value"]), float(known["value"])
    less = 1.0 if key.rsplit(".", 1)[-1] in RATIOS else 0.0
    if true == less:
        return None
    low, high = estimate["interval95"]
    return {
        "key": key,
        "error": abs(value - true) / abs(true - less),
        "inside": bool(low <= true <= high),
        "injected": hidden["value"],
        "true": true,
        "value": value,
    }
