"""Figures of sets by their probabilities: what is said to act, what does, and how far the probabilities hold."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from scipy.special import gammaincinv
from scipy.stats import binomtest

from hidden_effects.outcome import Found, Outcome, Truth, covered
from hidden_effects.plan import STRONG
from hidden_effects.statistics import rate, wilson

TENTHS = 10


def figures(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """The figures of one generator's sets, or of all.

    ``main``: the cause with the largest share is a hidden one, or in a group with it. ``beside``: causes said to
    act that do not, a group of which none does counted as one; of sets whose causes the catalogue has. ``both``:
    each of a pair is said to act, or is in a group of its own. ``outside``: ``unknown``, or told as what cannot be
    told from it. ``sure_main`` and ``sure_beside``: of causes said to act, those of the largest share and the
    others, how many do. A set without an answer is wrong everywhere.
    """
    single = of_group(outcomes, "single", strong=True)
    known = [o for o in outcomes if o.truth.group != "outside"]
    beside = [len(wrongly_said(o.truth, o.found)) for o in known]
    sure = [(cause in o.found.main, cause in o.truth.may) for o in known for cause in sorted(o.found.acts)]
    inside = [flag for o in outcomes for flag in covered(o.truth, o.found)]
    seconds = np.array([o.found.seconds for o in outcomes])
    return {
        "sets": len(outcomes),
        "no_answer": [f"{o.truth.name}: {o.found.error}" for o in outcomes if o.found.error],
        "main": rate([main_right(o) for o in single]),
        "main_inseparable": rate([main_right(o) for o in of_group(outcomes, "inseparable", strong=True)]),
        "main_of_a_pair": rate([main_right(o) for o in of_group(outcomes, "pair", strong=True)]),
        "both": rate([both_right(o) for o in of_group(outcomes, "pair", strong=True)]),
        "beside": count(sum(beside), len(known)),
        "sure_main": rate([acts for main, acts in sure if main]),
        "sure_beside": rate([acts for main, acts in sure if not main]),
        "alarms": rate([o.found.verdict != "none" for o in of_group(outcomes, "quiet")]),
        "outside": rate([outside_right(o) for o in of_group(outcomes, "outside")]),
        "called_unknown": rate([o.found.verdict == "unknown" for o in single]),
        "intervals": rate(inside),
        "reliability": reliability(chances(outcomes)),
        "seconds": {
            "median": float(np.median(seconds)) if len(seconds) else None,
            "nine_in_ten": float(np.quantile(seconds, 0.9)) if len(seconds) else None,
            "largest": float(seconds.max()) if len(seconds) else None,
        },
    }


def of_group(outcomes: Iterable[Outcome], group: str, *, strong: bool = False) -> list[Outcome]:
    """Sets of a group; ``strong``: those whose weakest cause counts as one of 8 and more, or has no strength."""

    def counts(truth: Truth) -> bool:
        return truth.group == group and (not strong or truth.strength is None or truth.strength >= STRONG)

    return [o for o in outcomes if counts(o.truth)]


def main_right(outcome: Outcome) -> bool:
    """Whether the cause of the largest share, or its group, is a hidden one."""
    return bool(outcome.found.main & outcome.truth.causes)


def both_right(outcome: Outcome) -> bool:
    """Whether every hidden cause is said to act; a group of which one acts tells of one."""
    left = outcome.truth.causes - outcome.found.acts
    groups = [group & left for group in outcome.found.groups if group & left]
    return not outcome.found.error and _matched(sorted(left), groups)


def _matched(causes: Sequence[str], groups: Sequence[frozenset[str]]) -> bool:
    """Whether every cause has a group of its own."""
    if not causes:
        return True
    first, *rest = causes
    return any(first in g and _matched(rest, [*groups[:k], *groups[k + 1 :]]) for k, g in enumerate(groups))


def wrongly_said(truth: Truth, found: Found) -> list[str]:
    """Causes said to act that do not, and groups of which none does."""
    groups = [" or ".join(sorted(group)) for group in found.groups if not group & truth.may]
    return [*sorted(found.acts - truth.may), *groups]


def outside_right(outcome: Outcome) -> bool:
    """Whether a cause that no catalogue has is called unknown, or is told as what cannot be told from it."""
    found = outcome.found
    if found.error:
        return False
    return found.verdict == "unknown" or (
        bool(found.named) and all(one in outcome.truth.alike for one in found.named)
    )


RIGHT: dict[str, Callable[[Outcome], bool]] = {
    "quiet": lambda outcome: outcome.found.verdict == "none",
    "single": main_right,
    "inseparable": main_right,
    "pair": both_right,
    "outside": outside_right,
}
"""Whether a set is answered rightly, by its group."""


def paired(outcomes: Sequence[tuple[Outcome, Outcome]]) -> dict[str, dict[str, Any]]:
    """Two versions on the same sets, by group and of all: McNemar's exact test (Psychometrika 12, 1947).

    Sets of weak causes of the catalogue are left out, as in `figures`. Of the sets on which the versions differ
    each is as often right, were they equally good: ``p_value`` of both sides.
    """
    flags: dict[str, list[tuple[bool, bool]]] = {}
    for before, after in outcomes:
        group = after.truth.group
        if of_group([after], group, strong=group not in ("quiet", "outside")):
            flags.setdefault(group, []).append((RIGHT[group](before), RIGHT[group](after)))
    flags["all"] = [pair for own in flags.values() for pair in own]
    result = {}
    for group, own in flags.items():
        better, worse = own.count((False, True)), own.count((True, False))
        result[group] = {
            "sets": len(own), "before": sum(one for one, _ in own), "after": sum(other for _, other in own),
            "better": better, "worse": worse,
            "p_value": float(binomtest(better, better + worse).pvalue) if better + worse else 1.0,
        }  # fmt: skip
    return result


def paired_markdown(groups: dict[str, dict[str, Any]]) -> str:
    """The table of `paired`."""
    rows = [
        f"| {group} | {own['sets']} | {own['before']} | {own['after']} | {own['better']} | {own['worse']} | "
        f"{own['p_value']:.2g} |"
        for group, own in groups.items()
    ]
    head = "| group | sets | right before | right now | right only now | right only before | McNemar's p |"
    return "\n".join([head, "| --- |" + " ---: |" * 6, *rows]) + "\n"


def chances(outcomes: Iterable[Outcome]) -> list[tuple[float, bool]]:
    """Of every cause that a diagnosis lists, the probability and whether the cause acts."""
    return [(p, cause in o.truth.may) for o in outcomes for cause, p in o.found.probability.items()]


def count(events: int, sets: int) -> dict[str, Any]:
    """Events a set with the 95 % interval of their Poisson rate (F. Garwood, Biometrika 28, 1936)."""
    if not sets:
        return {"rate": None, "interval95": [0.0, float("inf")], "hits": events, "sets": 0}
    low = float(gammaincinv(events, 0.025)) if events else 0.0
    return {
        "rate": events / sets,
        "interval95": [low / sets, float(gammaincinv(events + 1, 0.975)) / sets],
        "hits": events,
        "sets": sets,
    }


def reliability(pairs: Sequence[tuple[float, bool]]) -> dict[str, Any]:
    """Mean probability less the share that acts, by tenths of the probability.

    Returns:
        ``tenths``: rows with their number of causes; ``error``: the mean of the distances, weighed by that number;
        ``largest``: the largest of those tenths whose interval leaves out the mean probability, else 0.
    """
    p = np.array([one for one, _ in pairs], dtype=float)
    acts = np.array([flag for _, flag in pairs], dtype=float)
    tenth = np.minimum((p * TENTHS).astype(int), TENTHS - 1)
    rows = []
    for k in range(TENTHS):
        own = tenth == k
        if own.any():
            low, high = wilson(int(acts[own].sum()), int(own.sum()))
            rows.append({
                "from": k / TENTHS, "probability": float(p[own].mean()), "acts": float(acts[own].mean()),
                "low": low, "high": high, "causes": int(own.sum()),
            })  # fmt: skip
    apart = [abs(r["probability"] - r["acts"]) for r in rows]
    sure = [a for a, r in zip(apart, rows, strict=True) if not r["low"] <= r["probability"] <= r["high"]]
    weights = [r["causes"] for r in rows]
    return {
        "tenths": rows,
        "error": float(np.average(apart, weights=weights)) if rows else None,
        "largest": max(sure, default=0.0) if rows else None,
        "causes": len(p),
    }


Row = tuple[str, str, Callable[[dict[str, Any]], dict[str, Any]], bool]
ROWS: tuple[Row, ...] = (
    ("main cause right, strength of 8 and more", "80 %", lambda f: f["main"], True),
    ("the same, where causes are not distinguishable", "", lambda f: f["main_inseparable"], True),
    ("main cause of a pair is one of the two", "", lambda f: f["main_of_a_pair"], True),
    ("both of a pair, each 8 and more", "55 %", lambda f: f["both"], True),
    ("causes said to act that do not, a set", "0.1", lambda f: f["beside"], False),
    ("main causes said to act, that do", "92 %", lambda f: f["sure_main"], True),
    ("causes said to act beside a main one, that do", "85 %", lambda f: f["sure_beside"], True),
    ("quiet sets: alarms", "3 %", lambda f: f["alarms"], True),
    ("outside the catalogue: `unknown`, or told as what is like it", "80 %", lambda f: f["outside"], True),
    ("strong single causes called `unknown`", "", lambda f: f["called_unknown"], True),
    ("95 % intervals that hold the true value", "90 to 98 %", lambda f: f["intervals"], True),
)  # fmt: skip


def markdown(by_generator: dict[str, dict[str, Any]]) -> str:
    """The figures side by side, then the reliability diagram in numbers."""
    names = list(by_generator)
    lines = [
        "| figure | aim | " + " | ".join(names) + " |",
        "| --- | --- |" + " --- |" * len(names),
        "| sets | | " + " | ".join(str(f["sets"]) for f in by_generator.values()) + " |",
    ]
    for name, aim, pick, percent in ROWS:
        cells = " | ".join(_cell(pick(f), percent=percent) for f in by_generator.values())
        lines.append(f"| {name} | {aim} | {cells} |")
    errors = " | ".join(_error(f["reliability"]) for f in by_generator.values())
    lines.append(f"| probability less share that acts, mean over the tenths | 0.1 | {errors} |")
    seconds = " | ".join(_seconds(f["seconds"]) for f in by_generator.values())
    lines.append(f"| seconds of a processor: median, nine in ten, most | 8, 25, 60 | {seconds} |")
    lines += [
        "",
        "Of all causes that a diagnosis lists, by their probability:",
        "",
        "| probability | causes | mean probability | share that acts | 95 % interval |",
        "| --- | --- | --- | --- | --- |",
    ]
    for row in by_generator["all"]["reliability"]["tenths"]:
        lines.append(
            f"| {row['from']:.1f} to {row['from'] + 0.1:.1f} | {row['causes']} | {row['probability']:.2f} | "
            f"{row['acts']:.2f} | {row['low']:.2f} to {row['high']:.2f} |"
        )
    return "\n".join(lines) + "\n"


def _cell(figure: dict[str, Any], *, percent: bool) -> str:
    if not figure["sets"]:
        return "–"
    low, high = figure["interval95"]
    if percent:
        return f"{figure['hits']}/{figure['sets']}, {100 * low:.0f} to {100 * high:.0f} %"
    return f"{figure['rate']:.2f} ({figure['hits']}/{figure['sets']}), {low:.2f} to {high:.2f}"


def _error(found: dict[str, Any]) -> str:
    return "–" if found["error"] is None else f"{found['error']:.2f}"


def _seconds(found: dict[str, float | None]) -> str:
    median, nine, most = found["median"], found["nine_in_ten"], found["largest"]
    return "–" if median is None else f"{median:.1f}, {nine:.1f}, {most:.1f}"
