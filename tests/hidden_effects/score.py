"""The score of a campaign: how often right, how wrong, how sure, against what."""

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from hidden_effects.judging import admitted, candidate_sets, column, principal, right
from hidden_effects.plan import CAUSES, STRENGTHS, STRONG
from hidden_effects.statistics import calibration_error, rate, reliability

Result = dict[str, Any]
RIVALS = {
    "likelihood_ratio": "likelihood ratio that knows laws and noise",
    "largest_drop": "largest drop of the error",
    "plain_bic": "plain BIC on raw rows",
}
WITHIN = 2**0.5
"""Factor around a strength within which a set belongs to it."""
SURE = 0.8
"""Confidence above which a wrong name counts as worse."""
FAR = 5.0
"""Strength that no single cause of the catalogue can take away, from which on a cause outside it should be
told as one."""
VISIBLE = 1.5
"""Error before, in noise, from which a gain can be spoken of."""


def score(results: list[Result], *, held_out: bool | None = True) -> dict[str, Any]:
    """Figures of a campaign."""
    mine = [r for r in results if held_out is None or r["truth"]["held_out"] is held_out]
    skipped = [r["truth"] for r in mine if "skipped" in r["truth"]]
    done = [r for r in mine if "skipped" not in r["truth"]]
    not_run = [r for r in done if str(r["found"].get("error", "")).startswith("the finder has no option")]
    done = [r for r in done if r not in not_run]
    group: Callable[[str], list[Result]] = lambda name: [r for r in done if r["truth"]["group"] == name]  # noqa: E731
    single, pair, quiet = group("single"), group("pair"), group("quiet")
    strong = [r for r in single if _strength(r) >= STRONG]
    sure = [(float(r["found"]["confidence"]), float(_right(r))) for r in done if "error" not in r["found"]]
    confidence, hits = np.array([s[0] for s in sure]), np.array([s[1] for s in sure])
    return {
        "half": {True: "held out", False: "development", None: "both"}[held_out],
        "sets": len(done),
        "not_made": [f"{t['set']}: {t['skipped']}" for t in skipped],
        "not_run": len(not_run),
        "failed": [f"{r['truth']['set']}: {r['found']['error']}" for r in done if "error" in r["found"]],
        "right": {
            "strong": rate([_right(r) for r in strong]),
            "by_strength": {
                f"{s:g}": rate([_right(r) for r in single if _near(r, s)]) for s in STRENGTHS
            },
            "by_cause": {c: rate([_right(r) for r in strong if r["truth"]["causes"] == [c]]) for c in CAUSES},
        },
        "rivals": {
            name: {
                "quiet": rate([bool(r["truth"]["rivals"][name]["causes"]) for r in quiet]),
                "strong": rate([_rival_right(r, name) for r in strong]),
                "by_strength": {
                    f"{s:g}": rate([_rival_right(r, name) for r in single if _near(r, s)]) for s in STRENGTHS
                },
            }
            for name in RIVALS
        },
        "false_alarms": rate([r["found"].get("verdict") != "none" for r in quiet]),
        "outside": _outside_catalogue(group("outside")),
        "omitted": _outside_catalogue(group("omitted")),
        "pairs": {
            "all": rate([_right(r) for r in pair]),
            "both_strong": rate([_right(r) for r in pair if _separable(r)]),
        },
        "inseparable": {
            "right": rate([_right(r) for r in group("inseparable")]),
            "class_with_experiment": rate([_right(r) and _proposes(r) for r in group("inseparable")]),
            "resolved": rate([_resolved(r) for r in group("inseparable") if "next" in r]),
        },
        "class_size": _class_sizes(done),
        "parameters": _parameters(strong),
        "gain": _gain([*strong, *pair]),
        "calibration": calibration_error(confidence, hits),
        "reliability": reliability(confidence, hits) if len(sure) else [],
        "confusion": _confusion(done),
        "wrong": _wrong(done),
        "seconds": _seconds(done),
    }  # fmt: skip


def _right(r: Result) -> bool:
    return right(r["truth"], r["found"])


def _strength(r: Result) -> float:
    return float(r["truth"]["hidden"][0]["strength"])


def _near(r: Result, strength: float) -> bool:
    """Whether a set belongs to a strength: within the factor √2 around it."""
    return bool(1.0 / WITHIN <= _strength(r) / strength < WITHIN)


def _rival_right(r: Result, name: str) -> bool:
    """Of a rival: its name is the hidden cause's, or all that it cannot tell from it are one class with it."""
    said = r["truth"]["rivals"][name]
    if not said["causes"]:
        return False
    hidden = r["truth"]["causes"]
    if said["causes"] == hidden and len(said.get("alike", [])) <= 1:
        return True
    may = admitted(r["truth"])
    alike = [frozenset([c]) for c in said.get("alike", said["causes"])]
    return frozenset(hidden) in alike and all(c in may for c in alike)


def _outside_catalogue(results: list[Result]) -> dict[str, Any]:
    """Sets whose cause the finder cannot know. Where causes that it knows are one class, theirs is right too."""
    wrong = [r for r in results if "error" not in r["found"] and candidate_sets(r["found"]) and not _right(r)]
    return {
        "right": rate([_right(r) for r in results]),
        "unknown": rate([r["found"].get("verdict") == "unknown" for r in results]),
        "far": rate([_right(r) for r in results if r["truth"]["apart"] >= FAR]),
        "wrongly_named": rate([r in wrong and r["found"]["verdict"] == "named" for r in results]),
        "wrongly_named_and_sure": rate([
            r in wrong and r["found"]["verdict"] == "named" and r["found"]["confidence"] > SURE for r in results
        ]),
    }  # fmt: skip


def _separable(r: Result) -> bool:
    """Whether both of a pair are strong, and no other set is one class with it."""
    strong = all(one["strength"] >= STRONG for one in r["truth"]["hidden"])
    return strong and admitted(r["truth"]) == {frozenset(r["truth"]["causes"])}


def _proposes(r: Result) -> bool:
    """Whether there is an experiment to be done next."""
    return bool((r["found"].get("next_experiment") or {}).get("path"))


def _resolved(r: Result) -> bool:
    """Whether with the proposed experiment's readings the hidden cause alone is named."""
    found = r["next"]
    return "error" not in found and found["verdict"] == "named" and sorted(found["causes"]) == r["truth"]["causes"]


def _class_sizes(results: list[Result]) -> dict[str, float | None]:
    said = [len(candidate_sets(r["found"])) for r in results if r["found"].get("verdict") == "class" and _right(r)]
    true = [
        len(admitted(r["truth"])) for r in results if r["truth"]["group"] == "single" and _strength(r) >= STRONG
    ]
    return {
        "of_right_classes": float(np.mean(said)) if said else None,
        "of_the_truth_at_8": float(np.mean(true)) if true else None,
    }


def _parameters(results: list[Result]) -> dict[str, Any]:
    found = [
        principal(r["truth"], r["found"], r["still"])
        for r in results
        if _right(r) and "still" in r and "error" not in r["still"]
    ]
    known = [f for f in found if f is not None]
    errors = np.array([f["error"] for f in known])
    return {
        "sets": len(known),
        "median_error": float(np.median(errors)) if known else None,
        "within_15_percent": rate([bool(e <= 0.15) for e in errors]),
        "coverage": rate([f["inside"] for f in known]),
        "by_key": {
            key: float(np.median([f["error"] for f in known if f["key"] == key]))
            for key in sorted({f["key"] for f in known})
        },
    }


def _gain(results: list[Result]) -> dict[str, Any]:
    """Fall of the held-out error over that of an oracle: the same finder, told which cause it is."""
    shares, after, oracle = [], [], []
    for r in results:
        told = (r.get("told") or {}).get("gain")
        if not told or (told.get("before_in_sigma") or 0.0) <= VISIBLE:
            continue
        before, best = told["before_in_sigma"], told["after_in_sigma"]
        # without a cause nothing is gained
        left = (r["found"].get("gain") or {"after_in_sigma": before})["after_in_sigma"]
        if before > best:
            shares.append((before - left) / (before - best))
            after.append(left)
            oracle.append(best)
    return {
        "sets": len(shares),
        "share_of_the_oracle": float(np.mean(np.clip(shares, -1.0, 1.0))) if shares else None,
        "median_after_in_sigma": float(np.median(after)) if after else None,
        "median_of_the_oracle_in_sigma": float(np.median(oracle)) if oracle else None,
        "within_1.3_sigma": rate([a <= 1.3 for a in after]),
    }


def _confusion(results: list[Result]) -> dict[str, dict[str, int]]:
    """Verdicts by what was hidden; single causes from a strength of 8 on."""
    rows: dict[str, Counter[str]] = {}
    for r in results:
        truth = r["truth"]
        name = truth["group"] if truth["group"] != "single" else truth["causes"][0]
        if truth["group"] == "single" and _strength(r) < STRONG:
            continue
        rows.setdefault(name, Counter())[column(r["found"])] += 1
    order = [*CAUSES, "quiet", "pair", "outside", "omitted", "inseparable"]
    return {name: dict(rows[name]) for name in order if name in rows}


def _wrong(results: list[Result]) -> list[dict[str, Any]]:
    """Sets with a wrong verdict, single causes from a strength of 4 on: what was hidden, what was said."""
    return [
        {
            "set": r["truth"]["set"],
            "group": r["truth"]["group"],
            "hidden": {one["cause"]: one["strength"] for one in r["truth"]["hidden"]},
            "said": r["found"].get("verdict", "failed"),
            "candidates": [sorted(causes) for causes in candidate_sets(r["found"])],
            "confidence": r["found"].get("confidence"),
            "apart": r["truth"]["apart"],
            "likelihood_ratio": r["truth"]["rivals"]["likelihood_ratio"]["causes"],
            "likelihood_ratio_right": _rival_right(r, "likelihood_ratio"),
        }
        for r in results
        if not _right(r) and (r["truth"]["group"] != "single" or _strength(r) >= 4.0 / WITHIN)
    ]


def _seconds(results: list[Result]) -> dict[str, float | None]:
    took = [float(r["found"]["took"]) for r in results if "took" in r["found"]]
    busy = [float(r["found"]["busy"]) for r in results if "busy" in r["found"]]
    return {
        "mean": float(np.mean(took)) if took else None,
        "largest": max(took, default=None),
        "mean_of_a_processor": float(np.mean(busy)) if busy else None,
    }
